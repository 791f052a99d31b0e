//! Binary `rollwalk-bench`, whose code is in the library.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_bench::program::main()
}
