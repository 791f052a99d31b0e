//! Copy of the `rollwalk` binary under a separate name, for the tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk::main()
}
