//! Copy of the `rollwalk-sim` binary under a separate name, for the tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk::sim::main()
}
