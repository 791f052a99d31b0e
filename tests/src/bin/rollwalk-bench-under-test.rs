//! Copy of the `rollwalk-bench` binary under a separate name, for the tests.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_bench::program::main()
}
