//! Tests with the car of Fig. 2.8, which cannot drive, and the walker of Fig. 2.5, which cannot reach its target.

use super::*;
use rollwalk_planner::motion::{Subject, Target};
use rollwalk_planner::optimise;
use rollwalk_planner::start::Start;
use rollwalk_robot::Contact;
use std::convert::Infallible;
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_4};
use std::fs;
use std::path::Path;

/// Height of the front wheels above the ground when tilted by 45 degrees, m.
const HANGS_M: f64 = 0.05 * (1.0 - FRAC_1_SQRT_2);

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped").join(path))
        .unwrap()
}

fn robot(name: &str) -> Robot {
    Robot::from_toml(name, &text(&format!("robots/{name}.toml"))).unwrap()
}

fn motion(name: &str, robot: &Robot) -> Motion {
    Motion::from_toml(name, &text(&format!("motions/{name}.toml")), robot).unwrap()
}

fn free(name: &str, original: f64, bounds: [f64; 2]) -> Free {
    Free { name: name.into(), original, bounds, unit: 0.01, symbol: "m" }
}

/// Repairs a design from plans that stopped after 40 iterations.
fn repaired(free: &[Free], made: &dyn Fn(&[f64]) -> BuiltDesign, watch: &mut Watch<'_>) -> Repair {
    let original: Vec<f64> = free.iter().map(|free| free.original).collect();
    let BuiltDesign { robot, motions } = made(&original);
    let mut few = Options { start: Start::Standing, refine: false, ..Options::default() };
    few.settings.iterations = 40;
    let plan = |motion| optimise(&robot, motion, &few, &mut |_| ControlFlow::Continue(()));
    let plans: Vec<Plan> = motions.iter().map(plan).collect();
    let make = |values: &[f64]| Ok::<_, Infallible>(made(values));
    repair(free, &plans, PULL, &make, &Options::default(), watch).unwrap()
}

fn on(_: RepairProgress<'_>) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Tilted car with mirrored wheels. `places_m` has x, y and z of the front wheels, then of the rear wheels.
fn car(places_m: &[f64]) -> BuiltDesign {
    let mut robot = robot("car_tilted");
    for (j, wheel) in robot.end_effectors.iter_mut().enumerate() {
        let side = wheel.center_in_link_m.y.signum();
        let [x, y, z] = [0, 1, 2].map(|k| places_m[3 * (j / 2) + k]);
        wheel.center_in_link_m = [x, side * y, z].into();
    }
    let motions = vec![motion("car_drive", &robot)];
    BuiltDesign { robot, motions }
}

const CAR: [f64; 6] = [0.12, 0.09, -0.03, -0.12, 0.09, -0.03];

fn car_with_front(height_m: f64) -> BuiltDesign {
    let mut places = CAR;
    places[2] = height_m;
    car(&places)
}

/// Plan of a repaired car. Asserts that the car drives 0.5 m.
fn driven(repair: &Repair) -> &Plan {
    let Feasibility::Feasible(solutions) = &repair.outcome else { panic!("{:?}", repair.outcome) };
    let plan = &solutions[0].plan;
    let [start, end] = [plan.samples.first(), plan.samples.last()].map(|s| s.unwrap().com_m[0]);
    assert!((end - start - 0.5).abs() < 5e-4, "{start} {end}");
    plan
}

/// Asserts that the plan converged and that the body stays level.
fn is_level(plan: &Plan) {
    assert_eq!(plan.solve.status, Status::Converged);
    for sample in &plan.samples {
        assert!(sample.base_yaw_pitch_roll_rad[1].abs() < 1e-4, "it pitches");
    }
}

#[test]
fn the_car_is_repaired_by_lowering_its_front_wheels() {
    let front = free("front height", -0.03, [-0.07, 0.01]);
    let mut seen = Vec::new();
    let watch = &mut |shown: RepairProgress<'_>| {
        if let RepairProgress::Step(step, short) = shown {
            assert_eq!(short[0].energy(), step.energy);
            seen.push(step.clone());
        }
        ControlFlow::Continue(())
    };
    let found = repaired(&[front], &|values| car_with_front(values[0]), watch);
    is_level(driven(&found));
    let change_m = found.values[0] + 0.03;
    assert!((change_m + HANGS_M).abs() < 2e-5, "{change_m}");
    assert_eq!(seen, found.steps);
    // Three steps of the design. The last step only releases parameters that the pull held back.
    assert!(found.steps.len() <= 4, "{:?}", found.steps);
    let levels: Vec<f64> = found.steps.iter().map(|step| step.worst_level).collect();
    assert!(levels.is_sorted_by(|before, after| after < before), "{levels:?}");
    assert!(levels[0] > 5.0 && levels[2] < 0.05, "{levels:?}");
}

#[test]
fn of_six_coordinates_two_change_by_half_as_much() {
    let names = ["front x", "front y", "front z", "rear x", "rear y", "rear z"];
    let six: Vec<Free> =
        names.iter().zip(CAR).map(|(name, at)| free(name, at, [at - 0.03, at + 0.03])).collect();
    let found = repaired(&six, &car, &mut on);
    is_level(driven(&found));
    let changes_mm: Vec<f64> =
        found.values.iter().zip(CAR).map(|(value, from)| 1e3 * (value - from)).collect();
    let half_mm = 500.0 * HANGS_M;
    for (change, expected) in changes_mm.iter().zip([0.0, 0.0, -half_mm, 0.0, 0.0, half_mm]) {
        assert!((change - expected).abs() < 0.03, "{changes_mm:?}");
    }
    assert!((changes_mm[5] - changes_mm[2] - 1e3 * HANGS_M).abs() < 0.02, "{changes_mm:?}");
}

#[test]
fn the_car_is_repaired_by_untilting_its_front_wheels() {
    let tilt = Free {
        name: "tilt".into(),
        original: FRAC_PI_4,
        // The range extends beyond upright, where a search that diverges would end.
        bounds: [-0.5, 1.0],
        unit: 0.1,
        symbol: "rad",
    };
    let made = |values: &[f64]| {
        let mut robot = robot("car_tilted");
        let (sine, cosine) = values[0].sin_cos();
        for (wheel, side) in robot.end_effectors.iter_mut().zip([1.0, -1.0]) {
            let Contact::ActuatedWheel { axis_in_link, .. } = &mut wheel.contact else { panic!() };
            *axis_in_link = [0.0, cosine, side * sine].into();
        }
        let motions = vec![motion("car_drive", &robot)];
        BuiltDesign { robot, motions }
    };
    let found = repaired(&[tilt], &made, &mut on);
    assert_eq!(driven(&found).solve.status, Status::Converged);
    // The search ends as soon as the plan converges, so the front wheels may hang by less than a millimetre.
    let hang_m = 0.05 * (1.0 - found.values[0].cos());
    assert!(found.values[0] > 0.0 && hang_m < 1e-3, "{:?}", found.values);

    let BuiltDesign { robot, motions } = made(&[0.0]);
    let upright =
        optimise(&robot, &motions[0], &Options::default(), &mut |_| ControlFlow::Continue(()));
    is_level(&upright);
}

#[test]
fn bounds_that_allow_no_repair_are_named_with_what_the_nearest_design_misses() {
    let front = free("front height", -0.03, [-0.035, 0.01]);
    let found = repaired(&[front], &|values| car_with_front(values[0]), &mut on);
    assert_eq!(found.values, [-0.035]);
    let Feasibility::Nearest(nearest) = &found.outcome else { panic!("{:?}", found.outcome) };
    let text = nearest.to_string();
    for part in ["no design", "`car_drive`: displacement goal", "front height -0.0350 m"] {
        assert!(text.contains(part), "{text}");
    }
}

#[test]
fn a_repair_can_be_stopped_at_any_step_and_iteration() {
    for at_step in [true, false] {
        let front = free("front height", -0.03, [-0.07, 0.01]);
        let watch = &mut |shown: RepairProgress<'_>| match shown {
            RepairProgress::Step(..) if at_step => ControlFlow::Break(()),
            RepairProgress::Iteration(state) if !at_step && state.iteration == 3 => {
                ControlFlow::Break(())
            }
            _ => ControlFlow::Continue(()),
        };
        let found = repaired(&[front], &|values| car_with_front(values[0]), watch);
        assert!(matches!(found.outcome, Feasibility::Interrupted));
        assert_eq!((found.values, found.steps.len()), (vec![-0.03], usize::from(at_step)));
    }
}

#[test]
fn wheels_grow_until_their_motors_are_fast_enough() {
    // 0.8 m in 2 s. Motors with 6.85 rad/s move wheels of 5 cm only 0.685 m.
    let made = |values: &[f64]| {
        let mut robot = robot("car");
        robot.end_effectors.iter_mut().for_each(|wheel| wheel.radius_m = values[0]);
        let mut drive = motion("car_drive", &robot);
        drive.goal.forward_m = Some(0.8);
        let stand = motion("pup_stand", &robot);
        BuiltDesign { robot, motions: vec![drive, stand] }
    };
    let radius = free("radius", 0.05, [0.03, 0.09]);
    let found = repaired(&[radius], &made, &mut on);
    let Feasibility::Feasible(solutions) = &found.outcome else { panic!("{:?}", found.outcome) };
    assert!(solutions.iter().all(is_solved) && solutions.len() == 2);
    let speeds = solutions[0].plan.samples.iter().map(|s| s.end_effectors[0].motor_speed_rad_s);
    let fastest = speeds.fold(0.0, f64::max);
    assert!(fastest < 6.85 && (0.8 / 2.0 / 6.85..0.085).contains(&found.values[0]), "{fastest}");
    // A limit of one motion is not blamed on the other motion.
    let radius = free("radius", 0.05, [0.03, 0.055]);
    let found = repaired(&[radius], &made, &mut on);
    let Feasibility::Nearest(nearest) = &found.outcome else { panic!("{:?}", found.outcome) };
    let names: Vec<&str> = nearest.misses.iter().map(|(motion, _)| motion.as_str()).collect();
    assert_eq!((names, nearest.at_bounds.len()), (vec!["car_drive"], 1), "{nearest}");
}

/// Pup with given leg lengths and a target for its body. `lengths_m` has thigh and shank of the front legs, then of the rear
/// legs.
fn walker(lengths_m: &[f64], up_m: f64) -> BuiltDesign {
    let mut robot = robot("pup");
    for knee in robot.joints.iter_mut().filter(|joint| joint.name.ends_with("_knee")) {
        let thigh = if knee.name.starts_with("front") { 0 } else { 2 };
        knee.parent_from_joint.translation.z = -lengths_m[thigh];
    }
    for wheel in &mut robot.end_effectors {
        let shank = if wheel.name.starts_with("front") { 1 } else { 3 };
        wheel.center_in_link_m.z = -lengths_m[shank];
    }
    let mut walk = motion("pup_walk", &robot);
    walk.targets.push(Target {
        of: Subject::Body,
        at_s: 0.8,
        position_m: [None, None, Some(up_m)],
        velocity_m_s: [None; 3],
        heading_rad: None,
    });
    BuiltDesign { robot, motions: vec![walk] }
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn legs_grow_until_the_body_reaches_its_target() {
    // Legs of 0.23 m, which extend to 0.229 m, must reach 0.26 m.
    let names = ["front thigh", "front shank", "rear thigh", "rear shank"];
    let four: Vec<Free> = names.iter().map(|name| free(name, 0.1, [0.05, 0.18])).collect();
    let found = repaired(&four, &|lengths| walker(lengths, 0.26), &mut on);
    let Feasibility::Feasible(solutions) = &found.outcome else { panic!("{:?}", found.outcome) };
    assert!(matches!(solutions[0].plan.solve.status, Status::Converged));
    let heights = solutions[0].plan.samples.iter().map(|sample| sample.base_position_m[2]);
    assert!((heights.fold(0.0, f64::max) - 0.26).abs() < 2e-3);
    // At least the length for knees bent by 0.2 rad. All legs grow, and none to its bound.
    let needed_m = (0.26 - 0.03) / 0.1_f64.cos();
    for legs in found.values.chunks(2) {
        assert!(legs[0] + legs[1] > needed_m - 0.002, "{:?}", found.values);
        assert!(legs.iter().all(|part| (0.11..0.15).contains(part)), "{:?}", found.values);
    }
}
