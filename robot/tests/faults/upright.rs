//! Tests that robots with legs above their body are refused.

use super::*;

#[test]
fn a_leg_that_points_up_is_named_with_its_pose() {
    // One line of the template defines the foot of both legs.
    let found =
        faults("center_in_link_m = [0.0, 0.01, -0.2]", "center_in_link_m = [0.0, 0.01, 0.2]");
    let line = 1 + ROBOT.lines().position(|line| line.ends_with("[0.0, 0.01, -0.2]")).unwrap();
    assert_eq!(found.len(), 1, "{found:#?}");
    let (at, message, help) = &found[0];
    assert_eq!(*at, line);
    for words in
        ["end effector `left`", "is [0, 0.01, 0.2]", "0.225 m above", "`left_hip` at 0.1 rad"]
    {
        assert!(message.contains(words), "{words} is missing in {message}");
    }
    assert!(help.contains("sign of z") && help.contains("`nominal_rad`"), "{help}");
}

#[test]
fn a_joint_that_turns_the_leg_up_is_refused() {
    // The arm is turned over, so its wheel is above the body.
    let text = ROBOT.replacen("position_min_rad = -1.0", "position_min_rad = -3.2", 1).replacen(
        "nominal_rad = 0.0",
        "nominal_rad = -3.1",
        1,
    );
    let error = Robot::from_toml("tiny.toml", &text).unwrap_err();
    let message = error.faults().next().unwrap().message.clone();
    assert!(message.contains("end effector `wheel`") && message.contains("`shoulder` at -3.1 rad"));
    // Robots in plans follow the same rule.
    let mut robot = tiny();
    robot.end_effectors[1].center_in_link_m.z = 0.2;
    let error = robot.validate().unwrap_err().to_string();
    assert!(error.contains("end effector `left`: `center_in_link_m` is [0, 0.01, 0.2]"), "{error}");
}
