//! Change of the value in a motion or robot file that a culprit names.

use super::{Culprit, DURATION};
use crate::families::Family;
use crate::motion::{Motion, Subject};
use rollwalk_protocol::library::{MAX_CLIP_FRAMES, RATE_HZ};
use rollwalk_robot::{Actuator, Robot};

impl Culprit {
    /// Returns the request with `number` in place of the value that this culprit names. The value is replaced everywhere: in
    /// every motor with the same limit and in every target with the same value. `None` if the culprit names no value, if the
    /// request does not contain it, or if a clip cannot have the duration `number`.
    pub fn with_number(
        &self,
        robot: &Robot,
        motion: &Motion,
        number: f64,
    ) -> Option<(Robot, Motion)> {
        let (field, given) = (self.field.as_deref()?, self.given?);
        let (mut robot, mut motion) = (robot.clone(), motion.clone());
        if field == DURATION {
            return longer(motion, number).map(|motion| (robot, motion));
        }
        let mut found = false;
        let mut put = |place: &mut f64| {
            // Numbers in a plan file may have been rounded by other programs.
            if (*place - given).abs() <= 1e-9 * given.abs() {
                *place = number;
                found = true;
            }
        };
        let coordinate = ["forward_m", "left_m", "up_m"].iter().position(|name| *name == field);
        let component = |name: &str| {
            ["speed_forward_m_s", "speed_left_m_s", "speed_up_m_s"].iter().position(|n| *n == name)
        };
        match self.constraint {
            Family::DisplacementGoal | Family::TurningGoal => {
                let goal = &mut motion.goal;
                let place = match field {
                    "forward_m" => &mut goal.forward_m,
                    "left_m" => &mut goal.left_m,
                    _ => &mut goal.turn_rad,
                };
                place.iter_mut().for_each(&mut put);
            }
            Family::ContactHeight if field == "swing_height_m" => put(&mut motion.swing_height_m),
            Family::ContactHeight | Family::TargetPosition => {
                let of_swing = self.constraint == Family::ContactHeight;
                let shapes = |of: Subject| matches!(of, Subject::EndEffector(_)) && field == "up_m";
                let targets = motion.targets.iter_mut().filter(|t| shapes(t.of) == of_swing);
                targets.for_each(|target| {
                    coordinate.into_iter().for_each(|c| {
                        target.position_m[c].iter_mut().for_each(&mut put);
                    });
                });
            }
            Family::TargetVelocity => motion.targets.iter_mut().for_each(|target| {
                component(field).into_iter().for_each(|c| {
                    target.velocity_m_s[c].iter_mut().for_each(&mut put);
                });
            }),
            Family::TargetHeading => motion.targets.iter_mut().for_each(|target| {
                target.heading_rad.iter_mut().for_each(&mut put);
            }),
            Family::HeightLimit => motion.heights.iter_mut().for_each(|limit| {
                let bound =
                    if field == "above_m" { &mut limit.above_m } else { &mut limit.below_m };
                bound.iter_mut().for_each(&mut put);
            }),
            Family::Friction => {
                let feet = robot.end_effectors.iter_mut();
                feet.for_each(|foot| put(&mut foot.friction_coefficient));
            }
            Family::JointSpeed | Family::JointTorque => {
                let driven = robot.joints.iter_mut().filter(|joint| !joint.is_passive());
                let motors = driven.map(|joint| &mut joint.actuator);
                motors.for_each(|motor| put(limit(motor, field)));
            }
            Family::WheelMotorSpeed | Family::WheelTorque => {
                let motors =
                    robot.end_effectors.iter_mut().filter_map(|f| f.contact.actuator_mut());
                motors.for_each(|motor| put(limit(motor, field)));
            }
            _ => {}
        }
        found.then_some((robot, motion))
    }
}

/// Returns the motion with another duration, rounded to whole frames. Height limits that end with the motion are extended with
/// it. `None` if a clip cannot be that long.
fn longer(mut motion: Motion, number_s: f64) -> Option<Motion> {
    let rate_hz = f64::from(RATE_HZ);
    let frames = (rate_hz * number_s).round();
    let duration_s = frames / rate_hz;
    for limit in &mut motion.heights {
        if limit.to_s == motion.duration_s {
            limit.to_s = duration_s;
        }
    }
    motion.duration_s = duration_s;
    (frames <= f64::from(MAX_CLIP_FRAMES)).then_some(motion)
}

fn limit<'a>(motor: &'a mut Actuator, field: &str) -> &'a mut f64 {
    if field == "speed_max_rad_s" { &mut motor.speed_max_rad_s } else { &mut motor.torque_max_nm }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROBOT: &str = include_str!("../../../shipped/robots/agilebot.toml");
    const DUCK: &str = include_str!("../../../shipped/motions/duck.toml");
    const TARGETS: &str = "
[[target]]
of = \"com\"
at_s = 1.0
left_m = 0.02
speed_left_m_s = 0.1
[[target]]
of = \"body\"
at_s = 1.2
heading_rad = 0.03
";

    fn culprit(constraint: Family, field: &str, given: f64) -> Culprit {
        Culprit {
            constraint,
            part: constraint.kind(),
            subject: None,
            time_s: [0.0, 1.0],
            worst: 1.0,
            unit: constraint.unit().symbol().to_owned(),
            share: 1.0,
            field: Some(field.to_owned()),
            given: Some(given),
            would_do: None,
            advice: String::new(),
        }
    }

    fn read(robot: &str, motion: &str) -> (Robot, Motion) {
        let robot = Robot::from_toml("robot.toml", robot).unwrap();
        let motion = Motion::from_toml("motion.toml", motion, &robot).unwrap();
        (robot, motion)
    }

    /// Checks that a changed value gives the same request as an edit of the file.
    #[test]
    fn another_number_is_that_of_an_edited_file() {
        let motion_text =
            DUCK.replace("samples = 36", "samples = 36\nswing_height_m = 0.04") + TARGETS;
        let (robot, motion) = read(ROBOT, &motion_text);
        for (family, line, number) in [
            (Family::DisplacementGoal, "forward_m = 0.4", 0.3),
            (Family::TurningGoal, "turn_rad = 0.0", 0.1),
            (Family::ContactHeight, "swing_height_m = 0.04", 0.03),
            (Family::TargetPosition, "left_m = 0.02", 0.01),
            (Family::TargetPosition, "up_m = 0.294", 0.28),
            (Family::TargetVelocity, "speed_left_m_s = 0.1", 0.05),
            (Family::TargetHeading, "heading_rad = 0.03", 0.01),
            (Family::HeightLimit, "below_m = 0.24", 0.25),
            (Family::ContactPoint, "duration_s = 2.4", 3.0),
            (Family::JointTorque, "torque_max_nm = 4.38", 5.0),
            (Family::WheelMotorSpeed, "speed_max_rad_s = 6.85", 7.0),
            (Family::JointSpeed, "speed_max_rad_s = 4.16", 5.0),
        ] {
            let (field, given) = line.split_once(" = ").unwrap();
            let found = culprit(family, field, given.parse().unwrap());
            let changed = found.with_number(&robot, &motion, number);
            let edit = |text: &str| text.replace(line, &format!("{field} = {number}"));
            assert!(ROBOT.contains(line) || motion_text.contains(line), "{line}");
            let (other, edited) = read(&edit(ROBOT), &edit(&motion_text));
            assert_eq!(changed, Some((other, edited)), "{line}");
        }
        assert_eq!(culprit(Family::Slip, "forward_m", 0.4).with_number(&robot, &motion, 1.0), None);
    }

    /// Checks that the sample count follows from the duration if the file omits it, and is unchanged otherwise.
    #[test]
    fn a_longer_motion_has_the_samples_of_its_file() {
        let own = DUCK.replace("samples = 36\n", "");
        let given = DUCK.replace("samples = 36", "samples = 40");
        for (text, number, samples) in [(&own, 3.0, 45), (&own, 40.0, 480), (&given, 3.0, 40)] {
            let (robot, motion) = read(ROBOT, text);
            let found = culprit(Family::ContactPoint, "duration_s", 2.4);
            let (_, longer) = found.with_number(&robot, &motion, number).unwrap();
            let typed = longer.sampled_as(&motion);
            let edit = text.replace("duration_s = 2.4", &format!("duration_s = {number:?}"));
            assert_eq!(typed, read(ROBOT, &edit).1);
            assert_eq!(typed.stance.len(), samples);
        }
    }

    #[test]
    fn friction_is_that_of_every_foot_with_the_same() {
        let (robot, motion) = read(ROBOT, DUCK);
        let given = robot.end_effectors[0].friction_coefficient;
        let ice = culprit(Family::Friction, "friction_coefficient", given);
        let (robot, _) = ice.with_number(&robot, &motion, 0.9).unwrap();
        assert!(robot.end_effectors.iter().all(|foot| foot.friction_coefficient == 0.9));
    }
}
