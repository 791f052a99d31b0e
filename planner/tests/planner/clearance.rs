//! Clearance of limbs from each other and from the ground. A motion that violates it without shapes is planned clear of
//! obstacles with them, or refused.

use rollwalk_planner::families::Family;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::report::{Grid, Judgement, Report};
use rollwalk_planner::{Options, candidates, optimise};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

fn robot(text: &str) -> Robot {
    Robot::from_toml("robot.toml", text).unwrap()
}

/// Returns the robot without shapes.
fn without_shapes(robot: &Robot) -> Robot {
    let mut bare = robot.clone();
    bare.links.iter_mut().for_each(|link| link.shapes.clear());
    bare
}

/// Returns the plan from the first start alone.
fn plan(robot: &Robot, motion: &str) -> Plan {
    let motion = Motion::from_toml("motion.toml", motion, robot).unwrap();
    let first = &candidates(robot, &motion, &Options::default())[0];
    optimise(robot, &motion, first, &mut |_| ControlFlow::Continue(()))
}

/// Largest clearance deficit at the samples, mm, if links with the shapes of `robot` move as planned.
fn missing_mm(plan: &Plan, robot: &Robot, family: Family) -> f64 {
    let report = Report::new(&Plan { robot: robot.clone(), ..plan.clone() });
    report.row(family, Grid::Samples).unwrap().worst
}

/// Checks that a motion violates a clearance by more than `least_mm` without shapes, and converges clear of it with them.
fn kept_clear(robot: &Robot, motion: &str, family: Family, least_mm: f64) {
    let blind = plan(&without_shapes(robot), motion);
    assert_eq!(blind.solve.status, Status::Converged, "{:?}", blind.solve.diagnosis);
    let found_mm = missing_mm(&blind, robot, family);
    assert!(found_mm > least_mm, "{found_mm}");

    let clear = plan(robot, motion);
    assert_eq!(clear.solve.status, Status::Converged, "{:?}", clear.solve.diagnosis);
    // The plan has converged: 0.2 of the level of 1 mm.
    let missing_mm = missing_mm(&clear, robot, family);
    assert!(missing_mm <= 0.2, "{missing_mm}");
    let report = Report::new(&clear);
    assert!(report.judgement == Judgement::Consistent, "{report}");
}

const AGILEBOT: &str = include_str!("../../../shipped/robots/agilebot.toml");
const ANYMAL: &str = include_str!("../../../shipped/robots/anymal_wheels.toml");
const ANYMAL_DUCK: &str = include_str!("../../../shipped/motions/anymal_duck.toml");

fn duck_below(below_m: f64) -> String {
    let changed = ANYMAL_DUCK.replace("below_m = 0.4", &format!("below_m = {below_m}"));
    assert_ne!(changed, ANYMAL_DUCK);
    changed
}

#[test]
fn front_legs_that_lean_inward_do_not_cross() {
    let inward = "name = \"inward\"\nrobot = \"agilebot.toml\"\nduration_s = 2.0\nends = \"at_rest\"\nsamples = 12\n\
                  [footfalls]\nall = \"stance\"\n\
                  [posture]\nfront_left_hip_roll = -0.45\nfront_right_hip_roll = -0.45\n";
    // With a margin of 5 mm the shanks overlap by more than 5 mm.
    kept_clear(&robot(AGILEBOT), inward, Family::LinkClearance, 10.0);
}

#[test]
fn knees_stay_above_the_ground_in_a_crouch() {
    kept_clear(&robot(ANYMAL), &duck_below(0.2), Family::GroundClearance, 30.0);
}

#[test]
fn a_crouch_into_the_ground_is_refused_with_its_reason() {
    let refused = plan(&robot(ANYMAL), &duck_below(0.05));
    assert_eq!(refused.solve.status, Status::Infeasible);
    let diagnosis = refused.solve.diagnosis.unwrap();
    let [asked, against] = &diagnosis.culprits[..] else { panic!("{diagnosis}") };
    assert_eq!(asked.constraint, Family::HeightLimit, "{diagnosis}");
    assert_eq!(against.constraint, Family::GroundClearance, "{diagnosis}");
    assert!(against.subject.is_some() && against.worst > 0.001, "{diagnosis}");
}

/// Checks that pairs of shapes that overlap in the nominal pose impose no constraint.
#[test]
fn shapes_that_overlap_in_the_nominal_pose_leave_motions_possible() {
    let text = AGILEBOT
        .replace("box_m = [0.349, 0.189, 0.0936] }]   #", "box_m = [0.349, 0.249, 0.0936] }]   #");
    assert_ne!(text, AGILEBOT);
    let fat = robot(&text);
    let stands = plan(&fat, include_str!("../../../shipped/motions/stand.toml"));
    assert_eq!(stands.solve.status, Status::Converged, "{:?}", stands.solve.diagnosis);
    let report = Report::new(&stands);
    assert!(report.judgement == Judgement::Consistent, "{report}");
}
