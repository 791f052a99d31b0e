//! The `rollwalk-sim` binary; everything it does is in the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk::sim::main()
}
