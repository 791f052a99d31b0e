//! The `rollwalk-ros2` binary; everything it does is in the library beside it.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_ros2::main()
}
