//! Optimiser on the shipped robot, motions and library. The report judges the plans: it recomputes every residual from the plan
//! alone.

use rollwalk_planner::families::Family;
use rollwalk_planner::library_file::LibraryFile;
use rollwalk_planner::motion::{Goal, Motion};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::{Grid, Judgement, Report};
use rollwalk_planner::sample::PlanSpline;
use rollwalk_planner::{Options, TransitionError, optimise, optimise_transition};
use rollwalk_robot::{Contact, Robot, RollingDrag};
use std::ops::ControlFlow;
use std::sync::LazyLock;

static ROBOT: LazyLock<Robot> = LazyLock::new(|| {
    Robot::from_toml("agilebot.toml", include_str!("../../../shipped/robots/agilebot.toml"))
        .unwrap()
});

static LIBRARY: LazyLock<LibraryFile> = LazyLock::new(|| {
    let text = include_str!("../../../shipped/motions/agilebot_library.toml");
    LibraryFile::from_toml("agilebot_library.toml", text, &ROBOT).unwrap()
});

/// Plans of the library's motions, in its order.
static PLANS: LazyLock<Vec<Plan>> =
    LazyLock::new(|| MOTIONS.iter().map(|text| plan(&motion(text))).collect());

const DRIVE: &str = include_str!("../../../shipped/motions/drive_1m.toml");
const WALK_MOTION: &str = include_str!("../../../shipped/motions/walk.toml");
const MOTIONS: [&str; 4] = [
    include_str!("../../../shipped/motions/stand.toml"),
    DRIVE,
    include_str!("../../../shipped/motions/turn_in_place.toml"),
    WALK_MOTION,
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
fn every_shipped_motion_and_transition_converges_and_holds_as_played() {
    let transitions = LIBRARY.transitions.iter().map(|t| transition(t.from, t.to));
    for plan in PLANS.iter().cloned().chain(transitions) {
        assert_eq!(plan.solve.status, Status::Converged, "{}", plan.motion.name);
        let report = Report::new(&plan);
        // The solver must meet a fifth of the tolerances at the samples.
        let worst = report.rows.iter().filter(|row| row.grid == Grid::Samples);
        let worst = worst.map(|row| row.part_of_level()).fold(0.0, f64::max);
        assert!(
            worst <= 0.2 && report.judgement == Judgement::Consistent,
            "{}\n{report}",
            plan.motion.name
        );
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
fn a_transition_that_is_too_short_is_told_how_long_works() {
    let [walk, turn] = [3, 2];
    let wanted = LIBRARY.transitions.iter().find(|t| (t.from, t.to) == (walk, turn)).unwrap();
    let lasting = |duration_s| {
        let motion = Motion { duration_s, ..wanted.motion.clone() };
        let continue_ = &mut |_: &_| ControlFlow::Continue(());
        optimise_transition(&motion, &PLANS[walk], &PLANS[turn], &Options::default(), continue_)
            .unwrap()
    };
    let diagnosis = lasting(0.1).solve.diagnosis.expect("legs are not so fast");
    let told = diagnosis.culprits.iter().find(|c| c.field.as_deref() == Some("duration_s"));
    let works_s = told.and_then(|culprit| culprit.would_do).expect("a longer one works");
    assert_eq!(lasting(works_s).solve.status, Status::Converged, "{diagnosis}");
    assert!(diagnosis.to_string().contains("; duration_s is 0.1; "), "{diagnosis}");
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
    // 3 m in 4 s need 0.75 m/s from wheels that roll at 0.34 m/s.
    let goal = Goal { forward_m: Some(3.0), ..motion(DRIVE).goal };
    let plan = plan(&Motion { goal, ..motion(DRIVE) });
    assert_ne!(plan.solve.status, Status::Converged);
    assert!(plan.solve.worst_level > 1.0);
    assert_eq!(plan.solve.worst_constraint, Family::DisplacementGoal);
    let report = Report::new(&plan);
    assert_eq!(report.judgement, Judgement::NotConverged);
    assert!(report.row(Family::DisplacementGoal, Grid::Samples).is_some());
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

#[test]
fn held_wheels_walk_and_their_motors_are_told_to_stand_still() {
    let held = WALK_MOTION.replacen("samples = 32\n", "samples = 32\nwheels = \"held\"\n", 1);
    let plan = plan(&motion(&held));
    assert_eq!(plan.solve.status, Status::Converged);
    let report = Report::new(&plan);
    assert!(report.judgement == Judgement::Consistent, "{report}");
    assert!(report.row(Family::HeldWheel, Grid::Samples).unwrap().worst < 1.0, "{report}"); // mm/s
    let spline = PlanSpline::new(&plan);
    for k in 0..50 {
        let setpoints = spline.setpoints(plan.motion.duration_s * f64::from(k) / 50.0);
        assert_eq!(setpoints.motor_speed_rad_s, [0.0; 4]);
    }
}

#[test]
fn a_robot_with_weak_knees_stands_on_straighter_legs() {
    let mut weak = ROBOT.clone();
    let knees: Vec<usize> =
        (0..weak.joints.len()).filter(|&j| weak.joints[j].name.ends_with("_knee")).collect();
    assert_eq!(knees.len(), 4);
    for &knee in &knees {
        weak.joints[knee].actuator.torque_max_nm = 0.3;
    }
    let continue_ = &mut |_: &_| ControlFlow::Continue(());
    let stand = motion(MOTIONS[0]);
    let strong = optimise(&ROBOT, &stand, &Options::default(), continue_);
    // The posture of strong legs overloads the weak ones.
    let asked = Plan { robot: weak.clone(), ..strong.clone() };
    let torque = Report::new(&asked).row(Family::JointTorque, Grid::Samples).unwrap().clone();
    assert!(torque.part_of_level() > 1.0, "{torque:?}");
    let plan = optimise(&weak, &stand, &Options::default(), continue_);
    assert_eq!(plan.solve.status, Status::Converged);
    let report = Report::new(&plan);
    assert!(report.judgement == Judgement::Consistent, "{report}");
    assert!(report.row(Family::JointTorque, Grid::Samples).unwrap().part_of_level() <= 0.2);
    for &knee in &knees {
        let [bent, straighter] = [&strong, &plan].map(|p| p.samples[0].joint_rad[knee].abs());
        assert!(straighter < bent - 0.05, "{straighter} {bent}");
    }
}

/// Checks AgileBot on blades in place of its wheels, skating with one diagonal pair of legs at a time.
#[test]
fn skates_push_off_along_their_blades() {
    let mut robot = ROBOT.clone();
    robot.name = "skater".into();
    for skate in &mut robot.end_effectors {
        let axis_in_link = *skate.contact.axis_in_link().unwrap();
        let drag = RollingDrag { rolling_resistance: 0.01, rolling_drag_s_m: 0.02 };
        skate.contact = Contact::Skate { axis_in_link, blade_length_m: 0.1, drag };
        skate.center_in_link_m.z += 0.3 - skate.radius_m;
        skate.radius_m = 0.3;
    }
    robot.validate().unwrap();
    let text = WALK_MOTION
        .replacen("duration_s = 1.6", "duration_s = 2.4", 1)
        .replacen("samples = 32", "samples = 24", 1)
        .replacen("forward_m = 0.12", "forward_m = 0.6", 1)
        .replacen("gait = \"walk\"\nduty = 0.8", "gait = \"trot\"\nduty = 0.75", 1);
    let skating = Motion::from_toml("skate.toml", &text, &robot).unwrap();
    let continue_ = &mut |_: &_| ControlFlow::Continue(());
    let plan = optimise(&robot, &skating, &Options::default(), continue_);
    assert_eq!(plan.solve.status, Status::Converged);
    let report = Report::new(&plan);
    assert!(report.judgement == Judgement::Consistent, "{report}");
    for family in [Family::LandingSlip, Family::BladeContact, Family::FreeWheelTraction] {
        assert!(report.row(family, Grid::Samples).is_some(), "{report}");
    }
    // Drag of at least 1 % of the weight along the path needs thrust, so feet toe out.
    let toe_out = plan.samples.iter().flat_map(|s| &s.end_effectors).map(|e| e.yaw_rad.abs());
    assert!(toe_out.fold(0.0, f64::max) > 0.1);
}
