//! Requests that cannot be met: constraints and times in the diagnosis, feasible values, and the effort of the diagnosis.

use rollwalk_planner::families::{Family, Kind};
use rollwalk_planner::motion::{Goal, HeightLimit, Motion, Subject};
use rollwalk_planner::plan::{Diagnosis, Plan, StartOutcome, Status, Verdict};
use rollwalk_planner::report::Report;
use rollwalk_planner::{Options, candidates, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

fn robot(text: &str) -> Robot {
    Robot::from_toml("robot.toml", text).unwrap()
}

/// Returns the plan from the first start alone.
fn plan(robot: &Robot, motion: &Motion) -> Plan {
    let first = &candidates(robot, motion, &Options::default())[0];
    optimise(robot, motion, first, &mut |_| ControlFlow::Continue(()))
}

/// Returns the diagnosis of an impossible request. Checks that the verdict ends the search, and that every suggested value is
/// feasible.
fn impossible(impossible: &Plan, feasible: &Plan) -> Diagnosis {
    assert_eq!(feasible.solve.status, Status::Converged);
    assert_eq!(feasible.solve.diagnosis, None);
    assert_eq!(impossible.solve.status, Status::Infeasible);
    assert_eq!(
        impossible.solve.ending(),
        StartOutcome::Hopeless,
        "{:?}",
        impossible.solve.diagnosis
    );
    let diagnosis = impossible.solve.diagnosis.clone().unwrap();
    for culprit in &diagnosis.culprits {
        let Some(works) = culprit.would_do else { continue };
        let request = culprit.with_number(&impossible.robot, &impossible.motion, works);
        let (robot, motion) = request.expect("it names a number of a file");
        assert_eq!(plan(&robot, &motion).solve.status, Status::Converged, "{works}: {diagnosis}");
    }
    diagnosis
}

/// Car with wheels that do not steer, and its drive from rest to rest with another goal.
fn car(goal: Goal) -> (Robot, Motion) {
    let car = robot(include_str!("../../../shipped/robots/car.toml"));
    let text = include_str!("../../../shipped/motions/car_drive.toml");
    let motion = Motion::from_toml("car_drive.toml", text, &car).unwrap();
    (car, Motion { goal, ..motion })
}

const FORWARD: Goal = Goal { forward_m: Some(0.5), left_m: Some(0.0), turn_rad: Some(0.0) };

#[test]
fn a_car_cannot_go_sideways() {
    let (robot, sideways) = car(Goal { left_m: Some(0.3), ..FORWARD });
    let feasible = plan(&robot, &car(FORWARD).1);
    let diagnosis = impossible(&plan(&robot, &sideways), &feasible);
    assert_eq!(diagnosis.verdict, Verdict::Contradiction);
    let goal = &diagnosis.culprits[0];
    let named = (goal.constraint, goal.field.as_deref(), goal.part);
    assert_eq!(named, (Family::DisplacementGoal, Some("left_m"), Kind::Request), "{diagnosis}");
    assert_eq!((goal.given, goal.unit.as_str()), (Some(0.3), "m"));
    // The robot leans a little to the left, but hardly moves there.
    assert!(goal.would_do.is_none_or(|would_do| would_do < 0.1), "{diagnosis}");
    let against = &diagnosis.culprits[1];
    assert_eq!(
        (against.constraint, against.part),
        (Family::ContactPoint, Kind::Build),
        "{diagnosis}"
    );
    assert!(robot.end_effectors.iter().any(|ee| Some(&ee.name) == against.subject.as_ref()));
}

#[test]
fn a_car_without_steering_cannot_turn_on_its_way() {
    let (robot, turning) = car(Goal { turn_rad: Some(0.5), ..FORWARD });
    let feasible = plan(&robot, &car(FORWARD).1);
    let diagnosis = impossible(&plan(&robot, &turning), &feasible);
    let goal = &diagnosis.culprits[0];
    assert_eq!((goal.constraint, goal.given), (Family::TurningGoal, Some(0.5)), "{diagnosis}");
    assert!(goal.would_do.is_none_or(|would_do| would_do < 0.1), "{diagnosis}");
    assert_eq!(goal.time_s, [0.0, 2.0]);
}

#[test]
fn heights_that_exclude_each_other_are_named_with_their_times() {
    let (robot, feasible) = car(FORWARD);
    let limit = |below_m, above_m| HeightLimit {
        of: Subject::Body,
        below_m,
        above_m,
        from_s: 0.5,
        to_s: 1.5,
    };
    let height_m = plan(&robot, &feasible).samples[0].base_position_m[2];
    let between = vec![limit(Some(height_m + 0.01), None), limit(None, Some(height_m - 0.01))];
    let feasible = Motion { heights: between, ..feasible };
    let crossed = vec![limit(Some(height_m - 0.1), None), limit(None, Some(height_m + 0.1))];
    let crossed = Motion { heights: crossed, ..feasible.clone() };
    let diagnosis = impossible(&plan(&robot, &crossed), &plan(&robot, &feasible));
    let first = &diagnosis.culprits[0];
    assert_eq!((first.constraint, first.unit.as_str()), (Family::HeightLimit, "m"), "{diagnosis}");
    // Half the gap of 0.2 m on either side, at the samples around 0.5 to 1.5 s.
    assert!((first.worst - 0.1).abs() < 0.01, "{diagnosis}");
    let [from, to] = first.time_s;
    assert!((0.4..0.6).contains(&from) && (1.4..1.6).contains(&to), "{diagnosis}");
    // One foot could reach the other's position, but the car cannot follow.
    let [one, other] = &diagnosis.culprits[..] else { panic!("{diagnosis}") };
    assert_eq!((one.would_do, other.would_do), (None, None), "{diagnosis}");
}

fn walk(change: impl Fn(&mut Motion)) -> (Robot, Motion) {
    let robot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
    let text = include_str!("../../../shipped/motions/walk.toml");
    let mut motion = Motion::from_toml("walk.toml", text, &robot).unwrap();
    change(&mut motion);
    (robot, motion)
}

/// Plan of a walk with about the largest feasible distance.
fn long_walk() -> Plan {
    let (robot, motion) = walk(|motion| motion.goal.forward_m = Some(0.9));
    plan(&robot, &motion)
}

/// Tests a far goal that continuation from plan to plan does not reach: it ends at 0.3 m. Cold starts find plans for larger
/// goals.
#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn the_suggested_distance_of_a_trot_is_not_far_too_low() {
    let robot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
    let text = include_str!("../../../shipped/motions/trot.toml");
    let mut motion = Motion::from_toml("trot.toml", text, &robot).unwrap();
    motion.goal.forward_m = Some(1.5);
    let diagnosis = plan(&robot, &motion).solve.diagnosis.unwrap();
    let goal = &diagnosis.culprits[0];
    assert_eq!(goal.field.as_deref(), Some("forward_m"), "{diagnosis}");
    let would_do = goal.would_do.unwrap();
    assert!(would_do > 0.4 && would_do < 1.0, "{diagnosis}");
    // The plan of the suggested request holds as played.
    motion.goal.forward_m = Some(would_do);
    let nearer = plan(&robot, &motion);
    assert_eq!(nearer.solve.status, Status::Converged);
    assert!(Report::new(&nearer).judgement.is_good());
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn a_walk_too_far_names_the_distance_and_the_legs() {
    let (robot, motion) = walk(|motion| motion.goal.forward_m = Some(1.5));
    let diagnosis = impossible(&plan(&robot, &motion), &long_walk());
    let goal = &diagnosis.culprits[0];
    let named = (goal.constraint, goal.field.as_deref());
    assert_eq!(named, (Family::DisplacementGoal, Some("forward_m")), "{diagnosis}");
    // The feasible distance is shorter, but not tiny: 1.1 m can be walked in this time.
    let would_do = goal.would_do.unwrap();
    assert!(would_do > 0.8 && would_do < 1.3, "{diagnosis}");
    assert!(diagnosis.culprits.iter().any(|c| c.constraint == Family::ContactPoint), "{diagnosis}");
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn feet_that_cannot_be_lifted_so_high_names_the_height() {
    let (robot, motion) = walk(|motion| motion.swing_height_m = 0.5);
    let diagnosis = impossible(&plan(&robot, &motion), &long_walk());
    let height = &diagnosis.culprits[0];
    let named = (height.constraint, height.field.as_deref());
    assert_eq!(named, (Family::ContactHeight, Some("swing_height_m")), "{diagnosis}");
    assert!((height.given.unwrap() - 0.5).abs() < 1e-9, "{diagnosis}");
    // 0.15 m is feasible; 0.2 m would be, if thighs could pass through the body.
    let would_do = height.would_do.unwrap();
    assert!(would_do > 0.05 && would_do < 0.25, "{diagnosis}");
    assert!(robot.end_effectors.iter().any(|ee| Some(&ee.name) == height.subject.as_ref()));
    assert!(height.advice.contains("swing_height_m"));
}

#[test]
fn a_second_in_the_air_names_the_footfalls() {
    let (robot, motion) =
        walk(|motion| motion.stance.iter_mut().skip(10).take(20).for_each(|feet| feet.fill(false)));
    let diagnosis = impossible(&plan(&robot, &motion), &long_walk());
    let first = &diagnosis.culprits[0];
    assert!(
        [Family::SwingForce, Family::LinearDynamics].contains(&first.constraint),
        "{diagnosis}"
    );
    // The flight lasts from sample 10 to sample 29.
    let [from, to] = first.time_s;
    assert!(from >= 0.4 && to <= 1.55 && to - from > 0.5, "{diagnosis}");
    assert!(first.advice.contains("footfalls"));
}

#[test]
fn a_second_on_one_foot_names_the_balance() {
    let (robot, motion) = walk(|motion| {
        let one_foot = motion.stance.iter_mut().skip(6).take(20);
        one_foot.for_each(|feet| feet[1..].fill(false));
    });
    let diagnosis = impossible(&plan(&robot, &motion), &long_walk());
    let first = &diagnosis.culprits[0];
    assert_eq!(first.constraint, Family::AngularDynamics, "{diagnosis}");
    let [from, to] = first.time_s;
    assert!(from >= 0.2 && to <= 1.35, "{diagnosis}");
    assert!(first.advice.contains("footfalls"));
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn servos_too_weak_to_stand_names_the_torque() {
    weak_servos_are_named(&[0.25]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn servos_weaker_and_nearly_strong_enough_are_named_as_well() {
    weak_servos_are_named(&[0.15, 0.35]);
}

fn weak_servos_are_named(torques_max_nm: &[f64]) {
    let (mut robot, motion) = walk(|_| ());
    for joint in &mut robot.joints {
        joint.actuator.torque_speed = None;
    }
    for &torque_max_nm in torques_max_nm {
        robot.joints.iter_mut().for_each(|joint| joint.actuator.torque_max_nm = torque_max_nm);
        let weak = plan(&robot, &motion);
        assert_eq!(weak.solve.status, Status::Infeasible);
        let diagnosis = weak.solve.diagnosis.unwrap();
        let first = &diagnosis.culprits[0];
        let named = (first.constraint, first.field.as_deref(), first.part);
        let torque = (Family::JointTorque, Some("torque_max_nm"), Kind::Limit);
        assert_eq!(named, torque, "{diagnosis}");
        // Of all motors, the knees carry most.
        assert!(first.subject.as_ref().is_some_and(|joint| joint.ends_with("knee")), "{diagnosis}");
        assert!(first.advice.contains("standing alone requires 0.57 N·m"), "{diagnosis}");
        // With such strong servos it is feasible.
        let works = first.would_do.expect("stronger motors work");
        assert!(works > 0.57, "{diagnosis}");
        robot.joints.iter_mut().for_each(|joint| joint.actuator.torque_max_nm = works);
        assert_eq!(plan(&robot, &motion).solve.status, Status::Converged);
    }
}

#[test]
fn a_roll_that_misses_by_little_is_told_so_soon_and_how_far_it_gets() {
    let robot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
    let text = include_str!("../../../shipped/motions/roll.toml");
    let mut motion = Motion::from_toml("roll.toml", text, &robot).unwrap();
    let mut whole = |forward_m| {
        motion.goal.forward_m = Some(forward_m);
        let mut iterations = 0;
        let plan = optimise(&robot, &motion, &Options::default(), &mut |_| {
            iterations += 1;
            ControlFlow::Continue(())
        });
        (plan, iterations)
    };
    let (feasible, of_feasible) = whole(0.372);
    let (missed, of_missed) = whole(0.382);
    let diagnosis = impossible(&missed, &feasible);
    // Iterations of all starts that were tried.
    assert!(of_missed <= 2 * of_feasible, "{of_missed} against {of_feasible}");
    let works = diagnosis.culprits[0].would_do.unwrap();
    assert!((0.34..0.382).contains(&works), "{diagnosis}");
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn targets_that_exclude_each_other_are_both_named() {
    let robot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
    let text = include_str!("../../../shipped/motions/drive_1m.toml");
    let twice = "
[[target]]
of = \"body\"
at_s = 2.0
forward_m = 0.5
[[target]]
of = \"body\"
at_s = 2.16
forward_m = 1.5
";
    let motion = |text: &str| Motion::from_toml("drive_1m.toml", text, &robot).unwrap();
    let feasible = plan(&robot, &motion(text));
    let diagnosis = impossible(&plan(&robot, &motion(&format!("{text}{twice}"))), &feasible);
    let places = diagnosis.culprits.iter().filter(|c| c.constraint == Family::TargetPosition);
    let mut given: Vec<f64> = places.map(|c| c.given.unwrap()).collect();
    given.sort_by(f64::total_cmp);
    assert_eq!(given, [0.5, 1.5], "{diagnosis}");
}

#[test]
fn the_diagnosis_is_in_the_plan_and_survives_it() {
    let (robot, sideways) = car(Goal { left_m: Some(0.3), ..FORWARD });
    let plan = plan(&robot, &sideways);
    let read = Plan::from_json("plan.json", &plan.to_json()).unwrap();
    assert!(read.solve.diagnosis.is_some());
    assert_eq!(read.solve.diagnosis, plan.solve.diagnosis);
    // Text of a file is checked before it is printed.
    for (from, to, words) in [
        ("displacement goal", "\\u001b[31m", "the name of a constraint"),
        ("contradiction", "proof", "proof"),
        ("\"infeasible\"", "\"converged\"", "null unless status is infeasible"),
    ] {
        let text = plan.to_json().replacen(from, to, 1);
        // The summary also contains the name.
        let text = if to.contains("u001b") { plan.to_json().replace(from, to) } else { text };
        let error = Plan::from_json("plan.json", &text).unwrap_err().to_string();
        assert!(error.contains(words), "{words}: {error}");
        assert!(!error.contains('\u{1b}'), "{error:?}");
    }
    let text = plan.solve.diagnosis.unwrap().to_string();
    for expected in ["contradict", "displacement goal", "left_m is 0.3", "possible remedies"] {
        assert!(text.contains(expected), "{expected}: {text}");
    }
}

#[test]
fn a_side_step_that_standing_sees_no_way_to_is_found_by_way_of_a_shorter_one() {
    let robot = robot(include_str!("../../../shipped/robots/agilebot.toml"));
    let text = include_str!("../../../shipped/motions/drive_1m.toml");
    let text =
        text.replace("forward_m = 1.0", "forward_m = 0.0").replace("left_m = 0.0", "left_m = 0.4");
    let aside = Motion::from_toml("aside.toml", &text, &robot).unwrap();
    assert_eq!(plan(&robot, &aside).solve.status, Status::Converged);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn a_limit_of_iterations_holds_for_probes_as_well() {
    let (robot, motion) = walk(|motion| motion.goal.forward_m = Some(1.5));
    for iterations in 1..16 {
        let mut options = candidates(&robot, &motion, &Options::default()).swap_remove(0);
        options.settings.iterations = iterations;
        let plan = optimise(&robot, &motion, &options, &mut |_| ControlFlow::Continue(()));
        // For a refused request, the program searches for feasible values.
        let refused = plan.solve.status == Status::Infeasible;
        let most = if refused { 3 * iterations } else { iterations };
        assert!(plan.solve.iterations <= most, "{} of {iterations}", plan.solve.iterations);
    }
}
