//! The `rollwalk-bench` binary under a name of its own, for the tests to run.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_bench::program::main()
}
