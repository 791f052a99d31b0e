//! Derivatives of plans, compared with neighbouring plans that were optimised again.

use super::*;
use crate::optimise_solution;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};
use std::fs;
use std::path::Path;

fn read(motion: &str) -> (Robot, Motion) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped/motions").join(motion);
    let text = fs::read_to_string(&file).unwrap();
    let path = file.parent().unwrap().join(Motion::robot_path_in_toml(motion, &text).unwrap());
    let robot = Robot::from_toml(&path.display().to_string(), &fs::read_to_string(&path).unwrap());
    let robot = robot.unwrap();
    let motion = Motion::from_toml(motion, &text, &robot).unwrap();
    (robot, motion)
}

fn on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn planned(robot: &Robot, motion: &Motion) -> Solution {
    let options = Options { refine: false, ..Options::default() };
    optimise_solution(robot, motion, &options, &mut on)
}

/// Function that changes a dimension of a robot by a length, m.
type Measure = fn(&Robot, f64) -> Robot;

/// Returns the robot with the radius of all feet and wheels larger by `by_m`.
fn radius(robot: &Robot, by_m: f64) -> Robot {
    let mut robot = robot.clone();
    robot.end_effectors.iter_mut().for_each(|ee| ee.radius_m += by_m);
    robot
}

/// Returns the robot with all links between joints longer by `by_m`.
fn length(robot: &Robot, by_m: f64) -> Robot {
    let mut robot = robot.clone();
    for joint in robot.joints.iter_mut().filter(|joint| joint.parent != 0) {
        let z = &mut joint.parent_from_joint.translation.z;
        *z += if *z == 0.0 { 0.0 } else { z.signum() * by_m };
    }
    robot
}

/// Returns the robot with the limbs on either side further from its middle by `by_m`.
fn track(robot: &Robot, by_m: f64) -> Robot {
    let mut robot = robot.clone();
    for joint in robot.joints.iter_mut().filter(|joint| joint.parent == 0) {
        let y = &mut joint.parent_from_joint.translation.y;
        *y += if *y == 0.0 { 0.0 } else { y.signum() * by_m };
    }
    robot
}

fn norm(v: &[f64]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

fn combined(a: f64, one: &[f64], b: f64, other: &[f64]) -> Vec<f64> {
    one.iter().zip(other).map(|(one, other)| a * one + b * other).collect()
}

impl Optimal {
    /// Computes the optimum of a neighbouring robot by Newton's method, starting from the predicted one. The step is in scaled
    /// variables of this problem.
    fn again(&self, robot: &Robot, by: f64, change: &Change) -> (Vec<f64>, Optimal) {
        let problem = self.neighbour(&Design { robot, motion: &self.motion }).unwrap();
        let system = System::selected(&problem, Default::default());
        let guess: Vec<f64> = change.unknowns.iter().map(|x| by * x).collect();
        let shifts = combined(1.0, &self.shifts, by, &change.shifts);
        let unknowns = system.moved(&self.unknowns, &guess);
        let around = SystemAtPoint { system: &system, unknowns: &unknowns };
        let mut optimum = Optimum::near(&around, shifts, self.pin.clone()).unwrap();
        optimum.polish(POLISH_STEPS, POLISHED).unwrap();
        let step = combined(1.0, &guess, 1.0, optimum.position());
        let unknowns = system.moved(&unknowns, optimum.position());
        let shifts = optimum.shifts().to_vec();
        drop(optimum);
        drop(system);
        let pin = self.pin.clone();
        (
            step,
            Self {
                problem,
                motion: self.motion.clone(),
                unknowns,
                shifts,
                pin,
                curvature: self.curvature,
            },
        )
    }

    fn value(&self, objective: Objective) -> f64 {
        let system = System::selected(&self.problem, Default::default());
        let rows = system.values(&self.unknowns, Rows::default());
        objective.at(&self.problem, &self.motion, &rows).value
    }
}

/// Compares changes and gradients with central differences of optima at 0.1 and 0.2 mm, extrapolated to 0. The tolerance
/// includes a tenth of the extrapolation, which is what remains of it at strongly curved optima.
fn compare(motion: &str, measures: &[Measure]) {
    let (robot, motion) = read(motion);
    let name = &motion.name;
    let mut optimal = Optimal::of(&planned(&robot, &motion), &Options::default(), &mut on).unwrap();
    let goes = Objective::CostOfTransport.is_defined(&motion);
    let power = if goes { Objective::CostOfTransport } else { Objective::Power };
    let objectives =
        [Objective::PlanCost, Objective::PeakJointSpeed, Objective::JointTorque, power];
    for (index, measure) in measures.iter().enumerate() {
        let [ahead, behind] = [1e-5, -1e-5].map(|by_m| measure(&robot, by_m));
        let design = |robot| Design { robot, motion: &motion };
        let parameter = Parameter { ahead: design(&ahead), behind: design(&behind), apart: 2e-5 };
        let change = optimal.changes(&[parameter]).unwrap().remove(0);
        let at = |by_m: f64| {
            let (step, there) = optimal.again(&measure(&robot, by_m), by_m, &change);
            (step, objectives.map(|objective| there.value(objective)))
        };
        let [[ahead, behind], [far_ahead, far_behind]] =
            [1e-4, 2e-4].map(|by_m| [at(by_m), at(-by_m)]);
        let check = |what: &str, found: &[f64], all: [&[f64]; 4], floor: f64| {
            let near = combined(0.5e4, all[0], -0.5e4, all[1]);
            let far = combined(0.25e4, all[2], -0.25e4, all[3]);
            let best = combined(4.0 / 3.0, &near, -1.0 / 3.0, &far);
            let doubt = norm(&combined(1.0, &best, -1.0, &near));
            let error = norm(&combined(1.0, &best, -1.0, found));
            let allowed = 1e-4 * norm(&best) + 0.1 * doubt + floor;
            assert!(error < allowed, "{name}, {index}, {what}: {error:e} of {:e}", norm(&best));
        };
        assert!(norm(&change.unknowns) > 1.0, "{name}: {index} changes nothing");
        let steps = [&ahead.0, &behind.0, &far_ahead.0, &far_behind.0].map(Vec::as_slice);
        check("change", &change.unknowns, steps, 0.0);
        let gradients = optimal.gradients(&objectives, &[parameter]).unwrap();
        for (k, (objective, (value, slopes))) in objectives.into_iter().zip(gradients).enumerate() {
            let values =
                [&ahead, &behind, &far_ahead, &far_behind].map(|(_, values)| &values[k..=k]);
            check(&format!("{objective:?}"), &slopes, values, 1e-5 * value);
        }
    }
}

#[test]
fn plans_on_driven_wheels_change_as_they_are_optimised_again() {
    compare("turn_in_place.toml", &[radius, length, track]);
    compare("anymal_turn.toml", &[length]);
}

#[test]
fn plans_on_free_wheels_whose_phase_is_free_change_as_they_are_optimised_again() {
    compare("table_2_1/brainbot_turn.toml", &[track]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn plans_on_feet_and_skates_change_as_they_are_optimised_again() {
    compare("table_2_1/creature3_fast_walk.toml", &[length]);
    compare("table_2_1/skatebot_skating.toml", &[length]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn more_plans_on_driven_wheels_change_as_they_are_optimised_again() {
    compare("drive_1m.toml", &[radius, length]);
    compare("trot.toml", &[length]);
    compare("pup_drive.toml", &[radius, length]);
    compare("anymal_turn.toml", &[radius]);
    compare("test_leg_roll.toml", &[radius, length]);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn more_plans_on_free_wheels_feet_and_skates_change_as_they_are_optimised_again() {
    compare("swizzlebot_forward.toml", &[radius, length, track]);
    compare("table_2_1/brainbot_turn.toml", &[radius]);
    compare("legbot_walk.toml", &[radius]);
    compare("table_2_1/dinobot_skating.toml", &[radius]);
}

#[test]
fn an_edit_is_planned_from_where_the_optimum_goes() {
    let (robot, motion) = read("trot.toml");
    let from_scratch = planned(&robot, &motion);
    let mut optimal = Optimal::of(&from_scratch, &Options::default(), &mut on).unwrap();
    let [ahead, behind] = [1e-5, -1e-5].map(|by_m| length(&robot, by_m));
    fn design<'a>(robot: &'a Robot, motion: &'a Motion) -> Design<'a> {
        Design { robot, motion }
    }
    let (ahead, behind) = (design(&ahead, &motion), design(&behind, &motion));
    let change = optimal.changes(&[Parameter { ahead, behind, apart: 2e-5 }]).unwrap().remove(0);
    // The prediction is first order: the remaining error grows with the square of the edit.
    let level = |by_m: f64| {
        let edited = length(&robot, by_m);
        let mut options = Options { refine: false, ..Options::default() };
        options.settings.iterations = 0;
        let by = [(by_m, &change)];
        let predicted = optimal.replan(design(&edited, &motion), &by, &options, &mut on).unwrap();
        predicted.plan.solve.worst_level
    };
    let (near, far) = (level(0.005), level(0.01));
    assert!((3.0..5.0).contains(&(far / near)), "{near} {far}");
    let edited = length(&robot, 0.01);
    let options = Options { refine: false, ..Options::default() };
    let by = [(0.01, &change)];
    let plan = optimal.replan(design(&edited, &motion), &by, &options, &mut on).unwrap().plan;
    assert_eq!(plan.solve.status, Status::Converged);
    let iterations = [plan.solve.iterations, planned(&edited, &motion).plan.solve.iterations];
    assert!(iterations[0] <= 5 && iterations[0] < iterations[1], "{iterations:?}");
}

#[test]
fn plans_that_did_not_converge_have_no_derivatives() {
    let (robot, motion) = read("walk.toml");
    let mut options = Options { refine: false, ..Options::default() };
    options.settings.iterations = 2;
    options.start = start::Start::Standing;
    let solution = optimise_solution(&robot, &motion, &options, &mut on);
    let found = Optimal::of(&solution, &options, &mut on).unwrap_err();
    assert!(matches!(found, NotOptimal::NotConverged { .. }), "{found}");
}

#[test]
fn the_tilted_car_stands_as_its_closed_form_says() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped/robots/car_tilted.toml");
    let robot = Robot::from_toml("car_tilted", &fs::read_to_string(file).unwrap()).unwrap();
    let (_, mut stand) = read("pup_stand.toml");
    stand.posture_rad.clear();
    let optimal = Optimal::of(&planned(&robot, &stand), &Options::default(), &mut on).unwrap();
    // The body pitches until the tilted wheels touch: sin θ = r (1 − √(1 − cos²θ / 2)) / 0.24.
    let mut pitch = 0.0_f64;
    for _ in 0..50 {
        pitch = (0.05 * (1.0 - (1.0 - 0.5 * pitch.cos().powi(2)).sqrt()) / 0.24).asin();
    }
    assert!((pitch.to_degrees() - 3.482_740).abs() < 1e-6);
    // Seen from above, the axes lead by sin θ for cos 45° across and cos 45° up.
    let points = pitch.sin().atan();
    assert!((points.to_degrees() - 3.476_324).abs() < 1e-6);
    let layout = &optimal.problem.layout;
    for slot in &optimal.unknowns.slots {
        assert!((slot[BASE_YAW + 1].abs() - pitch).abs() < 1e-6, "{}", slot[BASE_YAW + 1]);
        for (j, side) in [-1.0, 1.0].into_iter().enumerate() {
            let yaw = slot[layout.end_effectors[j].wheel.unwrap().yaw] - slot[BASE_YAW];
            assert!((side * yaw - points).abs() < 1e-6, "{yaw} {points}");
        }
    }
}

#[test]
fn a_standing_body_rises_with_its_legs() {
    let (robot, stand) = read("stand.toml");
    // If forces may be uneven, the legs keep their angles, 0.6 rad at the thighs.
    let mut options = Options { refine: false, ..Options::default() };
    options.weights.force = 1e-7;
    let solution = optimise_solution(&robot, &stand, &options, &mut on);
    let mut optimal = Optimal::of(&solution, &options, &mut on).unwrap();
    let thighs = |by_m: f64, which: &str| {
        let mut robot = robot.clone();
        let knees = robot.joints.iter_mut().filter(|joint| joint.name.ends_with("_knee"));
        for knee in knees.filter(|knee| knee.name.starts_with(which)) {
            knee.parent_from_joint.translation.z -= by_m;
        }
        robot
    };
    let mut rises = |made: &dyn Fn(f64) -> Robot| {
        let [ahead, behind] = [1e-5, -1e-5].map(made);
        let design = |robot| Design { robot, motion: &stand };
        let parameter = Parameter { ahead: design(&ahead), behind: design(&behind), apart: 2e-5 };
        let change = optimal.changes(&[parameter]).unwrap().remove(0);
        let system = System::selected(&optimal.problem, Default::default());
        let moved = system.moved(&optimal.unknowns, &change.unknowns);
        moved.slots[5][BASE_POSITION + 2] - optimal.unknowns.slots[5][BASE_POSITION + 2]
    };
    let near = |found: f64, exact: f64| assert!((found - exact).abs() < 1e-5, "{found} {exact}");
    near(rises(&|by_m| radius(&robot, by_m)), 1.0);
    near(rises(&|by_m| thighs(by_m, "")), 0.6_f64.cos());
    near(rises(&|by_m| thighs(by_m, "front")), 0.5 * 0.6_f64.cos());
}

#[test]
fn the_price_of_the_duration_is_its_gradient_and_that_of_plans_in_other_times() {
    for name in ["walk.toml", "trot.toml", "drive_1m.toml"] {
        let (robot, motion) = read(name);
        let optimum = |motion: &Motion| {
            Optimal::of(&planned(&robot, motion), &Options::default(), &mut on).unwrap()
        };
        let mut here = optimum(&motion);
        let prices = here.timing_prices();
        let per_s = prices.duration_per_s;
        let [longer, shorter] =
            [1.0 + 1e-4, 1.0 - 1e-4].map(|factor| motion.stretched(factor * motion.duration_s));
        let design = |motion| Design { robot: &robot, motion };
        let apart = longer.duration_s - shorter.duration_s;
        let parameter = Parameter { ahead: design(&longer), behind: design(&shorter), apart };
        let gradients = here.gradients(&[Objective::PlanCost], &[parameter]).unwrap();
        // The adjoint method solves with the Hessian instead, to about 1e-4.
        assert!((per_s / gradients[0].1[0] - 1.0).abs() < 2e-3, "{name}: {per_s} {gradients:?}");
        // Re-solved plans a library frame longer and shorter. The third derivative leaves 0.2 %.
        let cost = |frames| optimum(&motion.stretched_to(frames)).timing_prices().cost;
        let difference = 30.0 * (cost(motion.frames() + 1) - cost(motion.frames() - 1));
        assert!((per_s / difference - 1.0).abs() < 1e-2, "{name}: {per_s} {difference}");
    }
}

/// A motion with `lying` adds points of the body to its robot; a design gives the robot without them.
#[test]
fn a_motion_that_lies_has_neighbours() {
    let (robot, motion) = read("anymal_stand_up.toml");
    let problem = Problem::new(motion.model(&robot), &motion, Options::default().weights);
    let other = neighbour(&problem, &Design { robot: &radius(&robot, 0.01), motion: &motion });
    assert_eq!(other.unwrap().model.robot(), &*motion.robot(&radius(&robot, 0.01)));
}
