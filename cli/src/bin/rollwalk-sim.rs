//! Entry point of the `rollwalk-sim` binary; the code is in the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk::sim::main()
}
