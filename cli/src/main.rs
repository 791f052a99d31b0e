//! Entry point of the `rollwalk` binary; the code is in the library of this package.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk::main()
}
