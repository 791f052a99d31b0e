//! Shortfalls of designs that cannot perform a motion, compared with differences of least energies. The designs are the car of
//! thesis 2.5.1 with its tilted front wheels, and short legs below a high target.

use super::*;
use crate::motion::{Subject, Target};
use crate::optimise;
use crate::start::Start;
use rollwalk_robot::Robot;
use std::f64::consts::FRAC_1_SQRT_2;
use std::fs;
use std::path::Path;

fn text(path: &str) -> String {
    fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../shipped").join(path)).unwrap()
}

fn robot(name: &str) -> Robot {
    Robot::from_toml(name, &text(&format!("robots/{name}.toml"))).unwrap()
}

fn motion(name: &str, robot: &Robot) -> Motion {
    Motion::from_toml(name, &text(&format!("motions/{name}.toml")), robot).unwrap()
}

fn on(_: &Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

/// Options with few iterations, for motions without a feasible plan.
fn options() -> Options {
    let mut options = Options { start: Start::Standing, refine: false, ..Options::default() };
    options.settings.iterations = 40;
    options
}

/// Returns the car with its front wheels higher by `front_m`.
fn car(front_m: f64) -> Robot {
    let mut robot = robot("car_tilted");
    robot.end_effectors[..2].iter_mut().for_each(|wheel| wheel.center_in_link_m.z += front_m);
    robot
}

/// Returns Pup with legs longer by `by_m`.
fn legs(by_m: f64) -> Robot {
    let mut robot = robot("pup");
    robot.end_effectors.iter_mut().for_each(|wheel| wheel.center_in_link_m.z -= by_m);
    robot
}

/// Compares derivatives with respect to one parameter with central differences of the least energies, extrapolated from two
/// step lengths.
fn compare(motion: &Motion, made: fn(f64) -> Robot, lengths: [f64; 2]) -> Shortfall {
    let plan = optimise(&made(0.0), motion, &options(), &mut on);
    let short = Shortfall::of(&plan, &options(), &mut on).unwrap();
    let design = |robot| Design { robot, motion };
    let [ahead, behind] = [1e-5, -1e-5].map(made);
    let parameter = Parameter { ahead: design(&ahead), behind: design(&behind), apart: 2e-5 };
    let slopes = short.slopes(&[parameter]).unwrap();
    assert_eq!(short.gradient(&[parameter]).unwrap(), slopes.gradient);
    let at = |by: f64| {
        let by_m = [(by, slopes.unknowns[0].as_slice())];
        let robot = made(by);
        short.of_neighbour(Design { robot: &robot, motion }, &by_m, &mut on).unwrap()
    };
    let [near, far] = lengths.map(|by| {
        let [above, below] = [at(by), at(-by)].map(|there| there.energy());
        [(above - below) / (2.0 * by), (above - 2.0 * short.energy() + below) / (by * by)]
    });
    for (found, k) in [(slopes.gradient[0], 0), (slopes.hessian[0][0], 1)] {
        let best = near[k] + (near[k] - far[k]) / 3.0;
        assert!((found / best - 1.0).abs() < 1e-4, "{}: {k}: {found} {best}", motion.name);
    }
    // Change of the point.
    let by = lengths[0];
    let [ahead, behind] = [at(by), at(-by)].map(|there| there.unknowns);
    let scale = &short.problem.layout.scale;
    let columns = Columns::new(&short.problem);
    let (mut off, mut all) = (0.0_f64, 0.0_f64);
    for (slot, columns) in columns.of_slot.iter().enumerate() {
        for (variable, column) in columns.iter().enumerate() {
            let Some(column) = column else { continue };
            let moved = (ahead.slots[slot][variable] - behind.slots[slot][variable]) / (2.0 * by);
            off += (moved / scale[variable] - slopes.unknowns[0][*column]).powi(2);
            all += (moved / scale[variable]).powi(2);
        }
    }
    assert!((off / all).sqrt() < 1e-3, "{}: {}", motion.name, (off / all).sqrt());
    short
}

#[test]
fn the_tilted_car_falls_short_by_what_differences_say() {
    let robot = car(0.0);
    let drive = motion("car_drive", &robot);
    let short = compare(&drive, car, [1e-4, 2e-4]);
    // Constraints to blame.
    let diagnosis = short.diagnosis().unwrap();
    let [goal, contact] = [0, 1].map(|k| &diagnosis.culprits[k]);
    assert_eq!((goal.constraint, goal.would_do), (Family::DisplacementGoal, None), "{diagnosis}");
    assert_eq!(contact.constraint, Family::ContactPoint, "{diagnosis}");
    assert!(contact.subject.as_ref().unwrap().starts_with("front"), "{diagnosis}");
    assert_eq!(short.worst().0, Family::ContactPoint);
    assert_eq!(short.levels()[&Family::ContactPoint], short.worst().1);
    let plan = short.plan();
    assert_eq!((plan.solve.status, plan.solve.diagnosis), (Status::Infeasible, Some(diagnosis)));
    // With the wheels on the ground the car can drive. Little remains, and more weight reduces it hardly.
    let repaired = car(-0.05 * (1.0 - FRAC_1_SQRT_2));
    let design = Design { robot: &repaired, motion: &drive };
    let there = short.of_neighbour(design, &[], &mut on).unwrap();
    assert!(there.worst().1 < 0.05 && there.energy() < 0.01 * short.energy());
    let pressed = there.pressed(&mut on).unwrap();
    assert!(pressed.worst().1 < 0.1 * there.worst().1, "{:?}", pressed.worst());
    assert_eq!(there.replan(&options(), &mut on).plan.solve.status, Status::Converged);
    assert_eq!(short.replan(&options(), &mut on).plan.solve.status, Status::Infeasible);
}

#[test]
fn a_target_above_the_legs_falls_short_by_what_differences_say() {
    let mut walk = motion("pup_walk", &robot("pup"));
    walk.targets.push(Target {
        of: Subject::Body,
        at_s: 0.8,
        position_m: [None, None, Some(0.19)],
        velocity_m_s: [None; 3],
        heading_rad: None,
    });
    let short = compare(&walk, legs, [2e-5, 4e-5]);
    assert_eq!(short.worst().0, Family::TargetPosition);
}

/// Returns SwizzleBot with the radius of its wheels larger by `by_m`.
fn swizzling_wheels(by_m: f64) -> Robot {
    let mut robot = robot("swizzlebot");
    robot.end_effectors.iter_mut().for_each(|wheel| wheel.radius_m += by_m);
    robot
}

#[test]
fn a_motion_without_a_clock_falls_short_by_what_differences_say() {
    let mut swizzle = motion("swizzlebot_forward", &swizzling_wheels(0.0));
    swizzle.goal.forward_m = Some(8.0);
    // The energy depends on the pinned time shift by the error of the discretisation.
    swizzle.stance = vec![swizzle.stance[0].clone(); 48];
    let options = Options { start: Start::Sinusoid, ..options() };
    let plan = optimise(&swizzling_wheels(0.0), &swizzle, &options, &mut on);
    let short = Shortfall::of(&plan, &options, &mut on).unwrap();
    assert!(short.held.pin.is_some());
    let design = |robot| Design { robot, motion: &swizzle };
    let at = |by: f64| {
        let robot = swizzling_wheels(by);
        let design = Design { robot: &robot, motion: &swizzle };
        short.of_neighbour(design, &[], &mut on).unwrap().energy()
    };
    let [ahead, behind] = [1e-5, -1e-5].map(swizzling_wheels);
    let parameter = Parameter { ahead: design(&ahead), behind: design(&behind), apart: 2e-5 };
    let slope = short.gradient(&[parameter]).unwrap()[0];
    let difference = (at(5e-5) - at(-5e-5)) / 1e-4;
    assert!((slope / difference - 1.0).abs() < 1e-4, "{slope} {difference}");
}
