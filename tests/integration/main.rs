//! The whole pipeline as a user meets it: one binary, one module per subject.

mod command_line;

use rollwalk_tests::Desk;

/// A desk with the command line under test.
fn desk() -> Desk {
    Desk::new(env!("CARGO_BIN_EXE_rollwalk-under-test"))
}
