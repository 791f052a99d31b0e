//! Changes that may help a motion to pass the simulation, within the limits of a motion file.

use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::Growth;
use rollwalk_robot::Robot;

/// List of changes that may help a plan, as a sentence to follow another: it begins with a full stop. Empty without remedies.
/// `feedback` is the command that simulates the plan with feedback.
pub fn sentence(plan: &Plan, growth: Option<Growth>, feedback: Option<String>) -> String {
    sentence_of(of_plan(plan, growth), feedback)
}

fn sentence_of(mut ways: Vec<String>, feedback: Option<String>) -> String {
    if let Some(feedback) = feedback {
        let or = if ways.is_empty() { "" } else { "or " };
        ways.push(format!("{or}feedback (`{feedback}`)"));
    }
    if ways.is_empty() { String::new() } else { format!(". What may help: {}", ways.join(", ")) }
}

/// Changes of the motion and the robot of a plan that may help.
fn of_plan(plan: &Plan, growth: Option<Growth>) -> Vec<String> {
    let Plan { robot, motion, .. } = plan;
    let servos = (!robot.joints.is_empty()).then(|| of_servos(robot));
    of_motion(motion, growth).into_iter().map(str::to_owned).chain(servos).collect()
}

fn of_motion(motion: &Motion, growth: Option<Growth>) -> Vec<&'static str> {
    let mut changes = motion.changes_within_limits();
    if motion.stance.iter().flatten().all(|stands| *stands) {
        return changes;
    }
    if growth.is_some_and(|growth| !growth.dies_out()) {
        // Errors have less time to grow from step to step.
        changes.retain(|change| *change != Motion::LONGER);
        changes.insert(0, "a shorter cycle with a nearer goal");
    }
    changes.push("a larger `duty`");
    changes
}

/// Changes of the servos that may help.
pub fn of_servos(robot: &Robot) -> String {
    match robot.joint_lag_s() {
        None => "stiffer servos".to_owned(),
        Some(lag_s) => format!(
            "a larger `kp_nm_rad` or a smaller `kd_nm_s_rad` (the servos accept no speed, so that joints lag by kd / kp = {:.1} ms), `rollwalk retarget`",
            1e3 * lag_s
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_names_the_remedies_that_exist() {
        let of = |ways: &[&str], feedback: Option<&str>| {
            let ways = ways.iter().map(|&way| way.to_owned()).collect();
            sentence_of(ways, feedback.map(str::to_owned))
        };
        assert_eq!(of(&[], None), "");
        assert_eq!(of(&[], Some("x")), ". What may help: feedback (`x`)");
        assert_eq!(of(&["more samples"], None), ". What may help: more samples");
        let both = ". What may help: more samples, or feedback (`x`)";
        assert_eq!(of(&["more samples"], Some("x")), both);
    }

    #[test]
    fn a_gait_whose_errors_persist_gets_a_shorter_cycle_and_others_more_time() {
        let agilebot = include_str!("../../shipped/robots/agilebot.toml");
        let agilebot = Robot::from_toml("robot.toml", agilebot).unwrap();
        let of = |text: &str, growth: Option<f64>| {
            let motion = Motion::from_toml("m.toml", text, &agilebot).unwrap();
            of_motion(&motion, growth.map(Growth))
        };
        let walk = include_str!("../../shipped/motions/walk.toml");
        for growth in [0.8, 1.7] {
            let shorter = ["a shorter cycle with a nearer goal", "more samples", "a larger `duty`"];
            assert_eq!(of(walk, Some(growth)), shorter);
        }
        assert_eq!(of(walk, Some(0.4)), ["more samples", Motion::LONGER, "a larger `duty`"]);
        let duck = include_str!("../../shipped/motions/duck.toml");
        assert_eq!(of(duck, None), ["more samples", Motion::LONGER]);
    }

    #[test]
    fn joints_whose_servos_accept_no_speed_lag_by_kd_over_kp() {
        let robot = |text: &str| Robot::from_toml("robot.toml", text).unwrap();
        let agilebot = robot(include_str!("../../shipped/robots/agilebot.toml"));
        assert_eq!(of_servos(&agilebot), "stiffer servos");
        // Dynamixel servos with kp = 15 N·m/rad and kd = 0.15 N·m·s/rad.
        let pup = of_servos(&robot(include_str!("../../shipped/robots/pup_five_bar.toml")));
        assert!(pup.contains("lag by kd / kp = 10.0 ms"), "{pup}");
    }
}
