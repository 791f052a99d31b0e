//! The `rollwalk-bench` binary; everything it does is in the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_bench::program::main()
}
