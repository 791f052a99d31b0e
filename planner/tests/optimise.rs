//! The optimiser on the shipped robot, motions and library, judged by the report, which recomputes
//! every residual from the plan alone.

use rollwalk_planner::library_file::LibraryFile;
use rollwalk_planner::motion::{Goal, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::{Grid, Report};
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::{Options, TransitionError, optimise, optimise_transition};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;
use std::sync::LazyLock;

static ROBOT: LazyLock<Robot> = LazyLock::new(|| {
    Robot::from_toml("agilebot.toml", include_str!("../../robots/agilebot.toml")).unwrap()
});

static LIBRARY: LazyLock<LibraryFile> = LazyLock::new(|| {
    let text = include_str!("../../motions/agilebot_library.toml");
    LibraryFile::from_toml("agilebot_library.toml", text, &ROBOT).unwrap()
});

/// The motions of the library, in its order.
static PLANS: LazyLock<Vec<Plan>> =
    LazyLock::new(|| MOTIONS.iter().map(|text| plan(&motion(text))).collect());

const DRIVE: &str = include_str!("../../motions/drive_1m.toml");
const MOTIONS: [&str; 4] = [
    include_str!("../../motions/stand.toml"),
    DRIVE,
    include_str!("../../motions/turn_in_place.toml"),
    include_str!("../../motions/walk.toml"),
];

fn motion(text: &str) -> Motion {
    Motion::from_toml("motion.toml", text, &ROBOT).unwrap()
}

fn plan(motion: &Motion) -> Plan {
    optimise(&ROBOT, motion, &Options::default(), &mut |_| ControlFlow::Continue(()))
}

fn transition(from: usize, to: usize) -> Plan {
    let wanted = LIBRARY.transitions.iter().find(|t| (t.from, t.to) == (from, to)).unwrap();
    let continue_ = &mut |_: &_| ControlFlow::Continue(());
    optimise_transition(&wanted.motion, &PLANS[from], &PLANS[to], &Options::default(), continue_)
        .unwrap()
}

#[test]
fn every_shipped_motion_and_transition_converges_to_a_credible_plan() {
    let transitions = LIBRARY.transitions.iter().map(|t| transition(t.from, t.to));
    for plan in PLANS.iter().cloned().chain(transitions) {
        assert_eq!(plan.solve.status, Status::Converged, "{}", plan.motion.name);
        let report = Report::new(&plan);
        // Credible levels are the bound between the samples, a fifth of them is asked at the samples.
        let worst = report.rows.iter().filter(|row| row.grid == Grid::Samples);
        let worst = worst.map(|row| row.part_of_level()).fold(0.0, f64::max);
        assert!(worst <= 0.2 && report.is_credible(), "{}\n{report}", plan.motion.name);
        plan.validate("plan").unwrap();
    }
}

#[test]
fn goals_are_met() {
    let turn = &PLANS[2];
    let wanted = turn.motion.goal.turn_rad.unwrap();
    assert!((turn.end_placement.yaw_rad / wanted - 1.0).abs() < 1e-3); // 0.1 % of the goal
    let drive = &PLANS[1];
    let way = drive.samples.last().unwrap().com_m[0] - drive.samples[0].com_m[0];
    assert!((way - 1.0).abs() < 1e-3); // 0.1 % of the goal
}

#[test]
fn transitions_continue_the_motions_they_join() {
    let [walk, turn] = [3, 2];
    let edge = transition(walk, turn);
    let joints = |plan: &Plan, time_s: f64| PlanSpline::new(plan).setpoints(time_s);
    let ends = [
        (joints(&PLANS[walk], 0.0), joints(&edge, 0.0)),
        (joints(&edge, edge.motion.duration_s), joints(&PLANS[turn], 0.0)),
    ];
    for (before, after) in &ends {
        for j in 0..ROBOT.joints.len() {
            let angle = (before.joint_rad[j] - after.joint_rad[j]).abs();
            assert!(angle < 1e-9, "angle {j}: {angle}"); // prescribed exactly
            let speed = (before.joint_speed_rad_s[j] - after.joint_speed_rad_s[j]).abs();
            // A difference quotient over 1e-5 s of accelerations below 50 rad/s².
            assert!(speed < 5e-4, "speed {j}: {speed}");
        }
    }
}

#[test]
fn the_same_problem_gives_the_same_plan_to_the_last_bit() {
    assert_eq!(plan(&motion(DRIVE)).to_json(), PLANS[1].to_json());
}

#[test]
fn a_solve_can_be_interrupted_and_keeps_what_it_has() {
    let mut calls = 0;
    let plan = optimise(&ROBOT, &motion(DRIVE), &Options::default(), &mut |progress| {
        calls += 1;
        assert_eq!(progress.iteration, calls);
        if calls == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!((plan.solve.status, plan.solve.iterations), (Status::Interrupted, 2));
    plan.validate("plan").unwrap();
}

#[test]
fn a_motion_beyond_the_wheels_speed_is_infeasible_and_says_what_is_violated() {
    // 3 m in 4 s asks 0.75 m/s of wheels that roll 0.34 m/s.
    let goal = Goal { forward_m: Some(3.0), ..motion(DRIVE).goal };
    let plan = plan(&Motion { goal, ..motion(DRIVE) });
    assert_ne!(plan.solve.status, Status::Converged);
    assert!(plan.solve.worst_level > 1.0);
    assert_eq!(plan.solve.worst_constraint, "displacement goal");
    let report = Report::new(&plan);
    assert!(!report.is_credible());
    assert!(report.row("goal: forward", Grid::Samples).is_some());
}

#[test]
fn motions_that_do_not_fit_together_are_refused() {
    let wanted = &LIBRARY.transitions[0];
    let continue_ = &mut |_: &_| ControlFlow::Continue(());
    let options = Options::default();
    let mut lifted = wanted.motion.clone();
    lifted.stance[0][0] = false;
    let refused = optimise_transition(&lifted, &PLANS[0], &PLANS[1], &options, continue_);
    assert!(matches!(refused, Err(TransitionError::OtherFeetDown { .. })), "{refused:?}");
    let mut other = PLANS[1].clone();
    other.robot.name = "another".into();
    let refused = optimise_transition(&wanted.motion, &PLANS[0], &other, &options, continue_);
    let message = refused.unwrap_err().to_string();
    assert!(message.contains("`agilebot`") && message.contains("`another`"), "{message}");
}
