//! The configuration that the board images include is that of the robot file.

#[path = "../../agilebot.rs"]
mod agilebot;

use rollwalk_robot::Robot;
use std::path::Path;
use std::process::Command;

const ROBOT: &str = "robots/agilebot.toml";

#[test]
fn the_images_include_the_configuration_of_the_robot_file() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../..");
    let mut bench = Command::new(env!("CARGO_BIN_EXE_rollwalk-board-bench"));
    let output = bench.arg("config").current_dir(&root).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(
        output.stdout == include_bytes!("../../agilebot.rs"),
        "{ROBOT} has changed: cargo run -p rollwalk-board-bench -- config > firmware/boards/agilebot.rs"
    );

    let text = std::fs::read_to_string(root.join(ROBOT)).unwrap();
    let config = Robot::from_toml(ROBOT, &text).unwrap().controller_config().unwrap();
    assert_eq!(agilebot::config(), config);
    assert_eq!(agilebot::config().hash(), config.hash());
    assert_eq!(config.channels, agilebot::CHANNELS);
}
