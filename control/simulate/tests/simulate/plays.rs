//! Tests of shipped motions in the simulated world.

use crate::{plan, plan_of_text, robot, shipped};
use rollwalk_multibody::ground::{Ground, Plane, Profile};
use rollwalk_physics::push::Shove;
use rollwalk_physics::world::heading_rad;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_simulate::{
    Control, Feedback, Mismatch, MotionFailure, Noise, Options, RunOutcome, Script, SensorFault,
    SensorFaultKind, Verdict, play,
};
use std::sync::Arc;

const TRACKING: Control = Control::Tracking(Feedback::Gains);

fn on(slope_rad: f64, plan: &Plan, feed_forward: bool) -> RunOutcome {
    let ground: Option<Arc<dyn Ground>> = Some(Arc::new(Plane::rising(slope_rad)));
    let control = if feed_forward { Control::FeedForward } else { Control::Servos };
    let options = Options { cycles: 3, ground, ..Options::new(control, 60) };
    play(plan, &options, |_| true).unwrap()
}

/// Compares achieved displacements with the plan.
///
/// MuJoCo yields ratios of 1.000, 1.000 and 0.999 (docs/replay.md). Penalty friction lets a walking foot slip by some per
/// mille.
#[test]
fn a_robot_comes_where_its_plans_say() {
    let drive = on(0.0, &plan("agilebot", "drive_1m"), true);
    assert!(drive.holds() && (drive.ratio(0).unwrap() - 1.0).abs() < 5e-3, "{drive:?}");
    assert!(drive.totals.slid_m < 1e-3, "{drive:?}");
    // No feedback corrects a displacement along the slope: wheel drives are controlled by speed, and droop under load.
    let uphill = on(0.05, &plan("agilebot", "drive_1m"), true);
    assert!((0.8..1.0).contains(&uphill.ratio(0).unwrap()), "{uphill:?}");
    let turn = on(0.0, &plan("agilebot", "turn_in_place"), true);
    assert!(turn.holds() && (turn.ratio(2).unwrap() - 1.0).abs() < 0.01, "{turn:?}");
    let walk = on(0.0, &plan("agilebot", "walk"), true);
    assert!(walk.holds() && (walk.ratio(0).unwrap() - 1.0).abs() < 0.03, "{walk:?}");
    assert!(walk.totals.work_j > 0.0, "{walk:?}");
    assert_eq!(walk.cycles.len(), 3);
    assert!(walk.iterations < 4.0 && walk.subdivided == 0, "{walk:?}");
}

#[test]
fn without_feed_forward_a_robot_lags_and_on_a_roof_it_does_not_come_there() {
    let plan = plan("swizzlebot5", "swizzlebot5_forward");
    let outcome = on(0.0, &plan, true);
    assert!(outcome.holds(), "{outcome:?}");
    // MuJoCo: 0.17 in twenty periods.
    let outcome = on(0.0, &plan, false);
    assert!(!outcome.holds() && outcome.ratio(0).unwrap() < 0.9, "{outcome:?}");
    let outcome = on(0.5, &plan, true);
    assert!(!outcome.holds(), "{outcome:?}");
}

#[test]
fn a_run_can_be_ended_and_tells_how_far_it_is() {
    let plan = plan("agilebot", "drive_1m");
    let options = Options { cycles: 1, ..Options::new(Control::FeedForward, 60) };
    let mut seen = Vec::new();
    let outcome = play(&plan, &options, |moment| {
        seen.push(moment.done_s / moment.all_s);
        seen.len() < 10
    });
    let outcome = outcome.unwrap();
    assert!(outcome.cycles.is_empty() && !outcome.holds());
    assert!(seen.len() == 10 && seen.is_sorted() && seen[9] < 0.1, "{seen:?}");
}

/// Tests obstacles and pushes: a wall stops the wheels, a kerb does not; the robot withstands a soft push, but not a hard one.
#[test]
fn terrain_and_pushes_act_on_the_robot() {
    let plan = plan("agilebot", "drive_1m");
    let level: Arc<dyn Ground> = Arc::new(Plane::level());
    let run = |ground: &Arc<dyn Ground>, push_n: f64| {
        let shoves = vec![Shove::new(2.0, 0.1, [0.0, push_n, 0.0])];
        let ground = Some(Arc::clone(ground));
        let options =
            Options { cycles: 1, ground, shoves, ..Options::new(Control::FeedForward, 120) };
        play(&plan, &options, |_| true).unwrap()
    };
    let pushed = run(&level, 5.0);
    assert!(pushed.holds() && pushed != run(&level, 0.0), "{pushed:?}");
    let toppled = run(&level, 120.0);
    assert!(toppled.fell_at_s.is_some_and(|at_s| at_s > 2.0), "{toppled:?}");
    assert!(
        matches!(toppled.miss(), Some(MotionFailure::Falls { after_end_s: None, .. })),
        "{toppled:?}"
    );
    // The motion of 4 s begins after 1 s.
    let shoves = vec![Shove::new(5.2, 0.1, [0.0, 120.0, 0.0])];
    let options = Options { shoves, ..Options::new(Control::FeedForward, 120) };
    let late = play(&plan, &options, |_| true).unwrap().miss().expect("a fall");
    let MotionFailure::Falls { after_end_s: Some(after_s), .. } = late else { panic!("{late:?}") };
    assert!((0.2..1.0).contains(&after_s), "{late:?}");
    let message = late.to_string();
    assert!(
        message.ends_with("after the motion has ended, while it holds the last pose"),
        "{message}"
    );
    let kerb = |height_m: f64| run(&(Arc::new(Profile::step(0.5, height_m).unwrap()) as _), 0.0);
    // Four driven wheels of 50 mm climb a kerb of 10 mm, one axle after the other, but not a wall.
    let (low, down, wall) = (kerb(0.01), kerb(-0.01), kerb(0.1));
    for climbed in [&low, &down] {
        assert!(climbed.holds() && climbed.ratio(0).unwrap() > 0.98, "{climbed:?}");
    }
    assert!(!wall.holds() && wall.cycles.iter().all(|way| way.forward_m < 0.6), "{wall:?}");
}

/// Tests tracking of a turn of ANYmal that lifts the wheels of two legs at a time. In open loop the robot makes half of the
/// turn; with feed-forward it makes 0.985 of the turn.
#[test]
fn tracked_by_its_whole_body_a_robot_comes_where_its_plan_says() {
    let shoves = Vec::new();
    let tracked = |plan: &Plan, shoves: &[Shove]| {
        let options = Options { cycles: 2, shoves: shoves.to_vec(), ..Options::new(TRACKING, 500) };
        play(plan, &options, |_| true).unwrap()
    };
    let turn = tracked(&plan("anymal_wheels", "anymal_turn"), &shoves);
    assert!(turn.holds() && (turn.ratio(2).unwrap() - 1.0).abs() < 2e-3, "{turn:?}");
    assert!(turn.totals.slid_m < 0.01 && turn.untracked == 0, "{turn:?}");
    // After a push, the robot returns to its planned path, not only to its planned speed.
    let drive = plan("agilebot", "drive_1m");
    let shove = Shove::new(1.5, 0.1, [15.0, 0.0, 0.0]);
    for shoves in [&shoves[..], &[shove][..]] {
        let drive = tracked(&drive, shoves);
        assert!(drive.holds() && (drive.ratio(0).unwrap() - 1.0).abs() < 2e-3, "{drive:?}");
    }
}

#[test]
fn a_tracked_robot_keeps_its_feet_when_the_world_is_another() {
    let plan = plan("anymal_wheels", "anymal_turn");
    let played = |mismatch: Mismatch, push_n: f64| {
        let shoves = vec![Shove::new(1.2, 0.1, [0.0, push_n, 0.0])];
        play(&plan, &Options { cycles: 2, shoves, mismatch, ..Options::new(TRACKING, 500) }, |_| {
            true
        })
        .unwrap()
    };
    for mismatch in [
        Mismatch { mass: 1.1, ..Mismatch::default() },
        Mismatch { friction: Some(0.5), ..Mismatch::default() },
        Mismatch { delay_s: 0.01, ..Mismatch::default() },
    ] {
        let turn = played(mismatch, 0.0);
        assert!(turn.holds() && (turn.ratio(2).unwrap() - 1.0).abs() < 0.02, "{turn:?}");
    }
    let noisy = played(Mismatch { noise: Some(Noise::USUAL), ..Mismatch::default() }, 0.0);
    assert!(noisy.untracked == 0 && (noisy.ratio(2).unwrap() - 1.0).abs() < 0.05, "{noisy:?}");
    // The noise has an effect.
    assert!((noisy.ratio(2).unwrap() - 1.0).abs() > 1e-3, "{noisy:?}");
    let pushed = played(Mismatch::default(), 250.0);
    assert!(pushed.fell_at_s.is_none(), "{pushed:?}");
}

/// Pushes a robot. Pushed forward, it stands still until it has recovered; pushed sideways, its servos play the plan, whose
/// steps catch it.
#[test]
fn a_robot_that_is_pushed_to_its_side_steps_on() {
    let trot = plan("agilebot", "trot");
    let pushed = |force_n: [f64; 3]| {
        let shoves = vec![Shove::new(1.0, 0.1, force_n)];
        let options = Options { cycles: 3, shoves, ..Options::new(TRACKING, 500) };
        let outcome = play(&trot, &options, |_| true).unwrap();
        assert!(outcome.fell_at_s.is_none(), "{outcome:?}");
        outcome.untracked
    };
    // 0.8 of the weight.
    let [ahead, aside] = [[35.0, 0.0, 0.0], [0.0, 35.0, 0.0]].map(pushed);
    // The tracker follows again before the last of the periods of 400 steps.
    assert!(ahead == 0 && (1..400).contains(&aside), "{ahead} {aside}");
}

/// Pushes a skating robot aside. Its direction depends on the angle of its skates, which the tracker does
/// not model: tracked to the end, the robot would cover at most half of the planned distance.
#[test]
fn the_plan_of_a_robot_that_stumbles_is_played_in_open_loop() {
    let skate = plan("skaterbot", "skate");
    let shoves = vec![Shove::new(2.0, 0.1, [0.0, 20.0, 0.0])];
    let options = Options { cycles: 10, shoves, ..Options::new(TRACKING, 500) };
    let outcome = play(&skate, &options, |_| true).unwrap();
    assert!(outcome.fell_at_s.is_none() && outcome.untracked > 400, "{outcome:?}");
    let [.., last] = &outcome.cycles[..] else { panic!("{outcome:?}") };
    let ratio = outcome.planned.ratio(last, 0).unwrap();
    assert!((ratio - 1.0).abs() < 0.05, "{ratio}: {outcome:?}");
}

/// Plays standing up from the body on half, usual and double stiffness, and tracked. Without torque the robot stays down, which
/// counts as a failure and not as a fall.
#[test]
fn robots_stand_up_from_their_bodies() {
    for (robot, motion) in [("anymal_wheels", "anymal_stand_up"), ("agilebot", "stand_up")] {
        let plan = plan(robot, motion);
        assert_eq!(Verdict::of(&plan, |_| true), Some(Verdict::Holds), "{motion}");
        let tracked = play(&plan, &Options::new(TRACKING, 500), |_| true).unwrap();
        assert!(tracked.holds() && tracked.untracked == 0, "{tracked:?}");
        let height = tracked.height.unwrap();
        assert!((height - 1.0).abs() < 0.01, "{tracked:?}");
        let mut limp = plan;
        for joint in &mut limp.robot.joints {
            joint.actuator.torque_max_nm *= 1e-3;
        }
        let down = play(&limp, &Options::new(Control::FeedForward, 240), |_| true).unwrap();
        assert!(matches!(down.miss(), Some(MotionFailure::Height { .. })), "{down:?}");
    }
}

/// Drives a pup without its rear legs. It pitches by 56°, and slides to its goal on its trunk and its two wheels.
#[test]
fn a_robot_that_slides_on_its_trunk_has_fallen() {
    let text = shipped("robots/pup_five_bar");
    let (front, _) = text.split_once("[[limb]]\nname = \"rear_left\"").unwrap();
    let front: Vec<_> = front.lines().filter(|line| !line.contains("servo, rear")).collect();
    let front = front.join("\n").replace("[0.066, 0.038", "[-0.004, 0.038");
    let front = front.replace("[0.066, -0.038", "[-0.004, -0.038").replace("[0.090,", "[0.020,");
    let front = front.replace("origin_in_parent_m = [0.07,", "origin_in_parent_m = [0.0,");
    let duo = Robot::from_toml("duo", &front).unwrap();
    let drive = r#"
        name = "drive"
        robot = "duo.toml"
        ends = "at_rest"
        duration_s = 2.5
        footfalls = { all = "stance" }
        goal = { forward_m = 0.3, left_m = 0.0, turn_rad = 0.0 }
    "#;
    let plan = plan_of_text(&duo, "drive", drive);
    let slid = play(&plan, &Options::new(Control::FeedForward, 480), |_| true).unwrap();
    assert!(matches!(slid.miss(), Some(MotionFailure::Falls { .. })), "{slid:?}");
}

/// Plays a motion on servos that accept no speed of joints. Each joint then lags by about kd/kp.
#[test]
fn joints_lag_behind_setpoints_without_speed() {
    let plan = plan("agilebot", "duck");
    let mut lagging = plan.clone();
    let pup = robot("pup");
    for motor in plan.robot.channels().map(|channel| channel.actuator().bus) {
        lagging.robot.buses.insert(motor, pup.buses[&0]);
    }
    assert_eq!(plan.robot.joint_lag_s(), None);
    assert!(lagging.robot.joint_lag_s().is_some_and(|lag_s| lag_s > 0.0));
    let laws = |of: &Plan| Script::new(of, true).laws(0.4 * of.motion.duration_s);
    let joints = plan.robot.driven_joints().count();
    let (fast, slow) = (laws(&plan), laws(&lagging));
    assert!(fast[..joints].iter().any(|law| law.speed_rad_s.abs() > 0.1), "{fast:?}");
    assert!(slow[..joints].iter().all(|law| law.speed_rad_s == 0.0), "{slow:?}");
    assert_eq!(fast[joints..], slow[joints..]);
}

/// Plays rising from the body and lying down again. Without torque the robot ends at the planned height, but never rises.
#[test]
fn a_robot_that_never_rises_from_its_body_fails() {
    let text = shipped("motions/anymal_stand_up").replace("\"start\"", "\"both\"");
    let plan = plan_of_text(&robot("anymal_wheels"), "rise", &text);
    let rises = play(&plan, &Options::new(TRACKING, 500), |_| true).unwrap();
    assert!(rises.holds(), "{rises:?}");
    let mut limp = plan;
    for joint in &mut limp.robot.joints {
        joint.actuator.torque_max_nm *= 1e-3;
    }
    let down = play(&limp, &Options::new(Control::FeedForward, 240), |_| true).unwrap();
    assert!(matches!(down.miss(), Some(MotionFailure::HeightMax { .. })), "{down:?}");
}

/// Removes the sensors at several times of a motion. The robot comes to rest on its feet each time.
#[test]
fn a_robot_that_loses_its_sensors_comes_to_rest() {
    let turn = plan("anymal_wheels", "anymal_turn");
    let duck = plan("anymal_wheels", "anymal_duck");
    // Before the motion, half a second before its end, and with set-points on their way.
    for (plan, from_s, kind, delay_s) in [
        (&turn, 0.5, SensorFaultKind::NoImu, 0.0),
        (&turn, 0.9, SensorFaultKind::EncoderNan(1), 0.01),
        (&turn, 1.3, SensorFaultKind::GyroBias(2.0), 0.0),
        (&duck, 0.5, SensorFaultKind::NoImu, 0.0),
        (&duck, 2.8, SensorFaultKind::NoImu, 0.0),
    ] {
        let sensor_fault = Some(SensorFault { from_s, kind });
        let noise = Some(Noise::USUAL);
        let mismatch = Mismatch { noise, sensor_fault, delay_s, ..Mismatch::default() };
        let options = Options { cycles: 3, mismatch, ..Options::new(TRACKING, 500) };
        let mut path = Vec::new();
        let outcome = play(plan, &options, |moment| {
            let (place_m, rotation) = moment.world.base();
            path.push((place_m, heading_rad(&rotation)));
            true
        });
        let outcome = outcome.unwrap();
        assert!(
            outcome.fell_at_s.is_none() && outcome.stopped_at_s.is_some(),
            "{kind:?}: {outcome:?}"
        );
        // In the last fifth of a second.
        let last = path.len() - 1;
        let (before, after) = (path[last - 100], path[last]);
        let turned_rad = after.1 - before.1;
        let moved_m = (after.0 - before.0).norm();
        assert!(turned_rad.abs() < 1e-3 && moved_m < 1e-3, "{kind:?}: {turned_rad} {moved_m}");
    }
}

/// Tests a delay of set-points, which the tracker compensates by prediction.
///
/// The drives' own loops would mislead small motors with the angle of a state measured 6 ms earlier: without prediction
/// Creature3 covers 3 % of its planned distance.
#[test]
fn a_known_delay_of_setpoints_costs_nothing() {
    let delayed = |plan: &Plan, delay_s: f64| {
        let mismatch = Mismatch { delay_s, ..Mismatch::default() };
        let options = Options { cycles: 3, mismatch, ..Options::new(TRACKING, 500) };
        let outcome = play(plan, &options, |_| true).unwrap();
        assert_eq!(outcome.untracked, 0, "{outcome:?}");
        outcome.ratio(0).unwrap()
    };
    let walk = delayed(&plan("creature3", "table_2_1/creature3_walk"), 0.006);
    assert!((walk - 1.0).abs() < 0.02, "{walk}");
    // In the rest before its motion, the robot stands still.
    let drive = delayed(&plan("agilebot", "drive_1m"), 0.01);
    assert!((drive - 1.0).abs() < 2e-3, "{drive}");
}

#[test]
fn a_walk_that_has_settled_goes_on_like_that() {
    let plan = plan("agilebot", "walk");
    let options = Options { cycles: 8, ..Options::new(Control::FeedForward, 240) };
    let whole = play(&plan, &options, |_| true).unwrap();
    let settled = play(&plan, &options, |moment| !moment.has_settled).unwrap();
    let count = settled.cycles.len();
    assert!(count < 8 && settled.cycles == whole.cycles[..count], "{settled:?}");
    assert!(settled.holds() && whole.holds(), "{whole:?}");
    assert!((settled.ratio(0).unwrap() - whole.ratio(0).unwrap()).abs() < 2e-3, "{whole:?}");
}
