//! Entry point of the `rollwalk-ros2` binary; the code is in the library of `apps/ros2/`.

use std::process::ExitCode;

fn main() -> ExitCode {
    rollwalk_ros2::main()
}
