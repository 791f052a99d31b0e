//! Experiment with a soft puck on an inclined plane, which slides and then sticks, with each model of friction (thesis Fig.
//! 4.1).
//!
//! Penalty friction creeps at the speed of its closed form; hybrid friction stops. A reference without penalties
//! ([`reference`]), the thesis's SQP solver, runs with a coarser puck, as do the runs that are compared with it.
//!
//! At this slope no node slips at rest. At 15 degrees some lightly loaded nodes at the rim do, and the linear penalty creeps 4
//! % faster than by the closed form. At 20 degrees hybrid friction finds no set of nodes that sticks, and creeps like the
//! penalty.
//!
//! Hybrid friction exceeds a bound: the final height of the puck differs from that with penalties by some 3 % of the depth,
//! less than 1 µm. Held nodes keep the strain along the slope with which the puck came to rest, as with Coulomb's law,
//! whereas creeping nodes release it. Two continued runs show this. From the final state of hybrid friction, linear friction
//! reaches the height of the penalty; from the final state of the penalty, hybrid friction keeps it. Hybrid friction takes no
//! longer than penalties, because resting nodes are held from the beginning of a step.

mod reference;

use crate::experiments::incline::reference::Reference;
use crate::experiments::outcome::short;
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use cpu_time::ProcessTime;
use nalgebra::{Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, Body, BodyMotion, Settings, System};
use std::f64::consts::PI;
use std::ops::Range;
use std::sync::Arc;

const SLOPE_DEG: f64 = 10.0;
const COEFFICIENT: f64 = 0.4;
const RADIUS_M: f64 = 0.05;
const HEIGHT_M: f64 = 0.02;
/// Contact stiffness k_n of a node at the bottom, N/m.
const NODE_STIFFNESS_N_M: f64 = 1e2;
const STEP_S: f64 = 5e-3;
const STEPS: usize = 500;
const TOLERANCE: f64 = 1e-10;
const GRAVITY_M_S2: f64 = 9.81;
/// Height of the drop, m.
const DROP_M: f64 = 2e-3;
/// Initial speed down the slope, m/s, with which the puck slides as long as in the thesis's figure.
const SPEED_M_S: f64 = 0.8;
/// Number of further steps with the other model, after which strain released by friction is gone.
const ONWARD: usize = 100;
/// Number of cells of the puck that is compared with the reference, whose programs are much more expensive.
const COARSE: [usize; 3] = [4, 4, 2];
/// Steps whose iterations are reported: one during sliding, one during sticking.
const REPORTED: [usize; 2] = [60, 150];

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let cells = [7, 7, 3];
    let mut outcome = ExperimentOutcome {
        setup: format!(
            "puck of {} elements (thesis: 879), radius {RADIUS_M} m, height {HEIGHT_M} m, slope of \
             {SLOPE_DEG} degrees, initially {SPEED_M_S} m/s downhill, Young's modulus 2.1 kPa, k_n \
             {NODE_STIFFNESS_N_M} N/m for each of {} nodes below, BDF1, {STEPS} steps of {STEP_S} \
             s; with SQP a puck of {}; sizes and slope are not in the thesis",
            6 * cells.iter().product::<usize>(),
            (cells[0] + 1) * (cells[1] + 1),
            6 * COARSE.iter().product::<usize>(),
        ),
        ..ExperimentOutcome::default()
    };
    let mut runs = Vec::new();
    let models = [
        (FrictionModel::Linear, "26.24 s"),
        (FrictionModel::Tanh, "30.86 s"),
        (FrictionModel::Hybrid, "31.2 s"),
    ];
    for (model, thesis) in models {
        let begin = ProcessTime::now();
        let slide = slide(model, cells, STEPS, watch)?;
        let cpu_s = begin.elapsed().as_secs_f64();
        let of = |what: &str| format!("{what}, {model:?}");
        let speed = slide.speeds_m_s[STEPS - 1].1;
        outcome.checks.push(Check::informative(&of("CPU seconds"), thesis, cpu_s));
        let weight_n = slide.mass_kg * GRAVITY_M_S2;
        let (down_n, onto_n) =
            (weight_n * SLOPE_DEG.to_radians().sin(), weight_n * SLOPE_DEG.to_radians().cos());
        let limit_n = COEFFICIENT * onto_n;
        let what = of("speed at the end, m/s");
        outcome.checks.push(match model {
            FrictionModel::Linear => Check::near(&what, speed, down_n / slide.stick_n_s_m, 0.02),
            FrictionModel::Tanh => {
                let closed = limit_n / slide.stick_n_s_m * (down_n / limit_n).atanh();
                Check::near(&what, speed, closed, 0.05)
            }
            FrictionModel::Hybrid => Check::at_most(&what, "0", speed.abs(), 1e-8),
        });
        let iterations = REPORTED.map(|step| slide.iterations[step].to_string()).join(" and ");
        let mean = f64::from(slide.iterations.iter().sum::<u32>()) / STEPS as f64;
        outcome.checks.extend([
            Check::at_most(&of("largest friction / its limit"), "1", slide.friction, 1.0 + 1e-9),
            Check::at_most(&of("largest residual, N"), "", slide.residual, TOLERANCE),
            Check::at_most(&of("steps that were halved"), "", f64::from(slide.halved), 0.0),
            Check::new(&of("iterations of steps 60 and 150"), "", "", &iterations, None),
            Check::informative(&of("iterations of a step"), "", mean),
        ]);
        runs.push((model, cpu_s, slide));
    }
    let (_, linear_s, linear) = &runs[0];
    for ((model, cpu_s, slide), thesis) in runs[1..].iter().zip(["1.18", "1.19"]) {
        let what = format!("CPU time of {model:?} / CPU time of linear");
        outcome.checks.push(Check::at_most(&what, thesis, cpu_s / linear_s, 1.5));
        let away = (slide.height_m - linear.height_m).abs() / linear.depth_m;
        let what = format!(
            "(height of {model:?} − height of linear) / depth of {} m",
            short(linear.depth_m)
        );
        let why = "with Coulomb friction the puck stays strained at rest; with creeping contacts the strain relaxes, as the next rows show";
        outcome.checks.push(Check::at_most_known(&what, "imperceptible", away, 0.01, (0.03, why)));
    }
    let hybrid = &runs[2].2;
    for (name, from, model) in
        [("Hybrid", hybrid, FrictionModel::Linear), ("Linear", linear, FrictionModel::Hybrid)]
    {
        let away = (onward(from, model, cells, watch)? - linear.height_m).abs() / linear.depth_m;
        let what = format!(
            "(height after {ONWARD} more steps with {model:?} from the final state of {name} − height of linear) / depth"
        );
        outcome.checks.push(Check::at_most(&what, "", away, 0.01));
    }
    outcome.charts.push(Chart {
        name: "speed".to_owned(),
        title: "Speed of the puck down the slope".to_owned(),
        x: "time, s".to_owned(),
        y: "speed, m/s".to_owned(),
        logarithmic: false,
        curves: runs
            .into_iter()
            .map(|(model, _, run)| (format!("{model:?}"), run.speeds_m_s))
            .collect(),
    });
    compare(&mut outcome, watch)?;
    Some(outcome)
}

/// Compares penalties and hybrid friction with the reference, for a coarse puck.
fn compare(outcome: &mut ExperimentOutcome, watch: &dyn Watch) -> Option<()> {
    let begin = ProcessTime::now();
    let exact = slide_exactly(COARSE, STEPS, watch)?;
    let exact_s = begin.elapsed().as_secs_f64();
    let mut curves = Vec::new();
    let mut linear_s = 0.0;
    for (model, thesis, bound) in [
        (FrictionModel::Linear, "slides slightly further", None),
        (FrictionModel::Tanh, "slides slightly further", None),
        (FrictionModel::Hybrid, "very close to the SQP solution", Some(0.01)),
    ] {
        let begin = ProcessTime::now();
        let slide = slide(model, COARSE, STEPS, watch)?;
        if matches!(model, FrictionModel::Linear) {
            linear_s = begin.elapsed().as_secs_f64();
        }
        // Difference from the reference, whose contacts have no depth.
        let above_m = slide.height_m + slide.carried_m - exact.height_m;
        let what = format!("(height of {model:?} + depth − height of SQP) / depth");
        let of_height = above_m.abs() / slide.carried_m;
        outcome.checks.push(match bound {
            Some(bound) => Check::at_most(&what, thesis, of_height, bound),
            None => Check::informative(&what, "", of_height),
        });
        let further = slide.way_m() / exact.way_m() - 1.0;
        let what = format!("distance of {model:?} / distance of SQP − 1");
        outcome.checks.push(match bound {
            Some(bound) => Check::at_most(&what, thesis, further.abs(), bound),
            None => Check::informative(&what, thesis, further),
        });
        curves.push((format!("{model:?}"), slide.speeds_m_s));
    }
    let speed = exact.speeds_m_s[STEPS - 1].1;
    let iterations = REPORTED.map(|step| exact.iterations[step].to_string()).join(" and ");
    outcome.checks.extend([
        Check::at_most("speed at the end, m/s, SQP", "0", speed.abs(), 1e-8),
        Check::at_most("largest friction / its limit, SQP", "1", exact.friction, 1.0 + 1e-6),
        Check::at_most("largest residual, N, SQP", "", exact.residual, 1e-8),
        Check::at_most(
            "largest mean gap or depth of loaded contacts, m, SQP",
            "0",
            exact.depth_m,
            1e-6,
        ),
        Check::at_most("steps that did not converge, SQP", "", f64::from(exact.halved), 0.0),
        Check::informative("stopping distance, m, SQP", "", exact.way_m()),
        Check::new(
            "quadratic programs solved in steps 60 and 150, SQP",
            "many, then few",
            "",
            &iterations,
            None,
        ),
        Check::informative("CPU time of SQP / CPU time of linear", "2.5", exact_s / linear_s),
    ]);
    curves.push(("SQP".to_owned(), exact.speeds_m_s));
    let sizes = |(name, curve): (String, Vec<(f64, f64)>)| {
        (name, curve.into_iter().map(|(time_s, speed)| (time_s, speed.abs())).collect())
    };
    outcome.charts.push(Chart {
        name: "reference".to_owned(),
        title: "Speed of a coarse puck, with SQP for reference".to_owned(),
        x: "time, s".to_owned(),
        y: "speed, m/s".to_owned(),
        logarithmic: true,
        curves: curves.into_iter().map(sizes).collect(),
    });
    Some(())
}

/// Measurements of a sliding puck.
#[derive(Default)]
struct Slide {
    mass_kg: f64,
    /// Mean speed down the slope as a function of time.
    speeds_m_s: Vec<(f64, f64)>,
    /// Final sum of the stick damping of all touching contacts, N·s/m.
    stick_n_s_m: f64,
    /// Final mean height of the puck above the slope, m.
    height_m: f64,
    /// Final mean depth of the bottom below the surface, m.
    depth_m: f64,
    /// Final depth of the contacts, weighted by load, m. A rigid slope would raise the puck by this amount.
    carried_m: f64,
    /// Final motions of all bodies.
    motions: Vec<BodyMotion>,
    /// Largest ratio of a contact's friction to the limit of its cone.
    friction: f64,
    iterations: Vec<u32>,
    residual: f64,
    halved: u32,
}

impl Slide {
    /// Distance down the slope, m.
    fn way_m(&self) -> f64 {
        self.speeds_m_s.iter().map(|(_, speed)| speed * STEP_S).sum()
    }
}

/// Creates a puck just above the slope, with the given numbers of cells and without contacts.
fn puck(cells: [usize; 3]) -> (Assembly, SoftBody, Plane) {
    let slope = Plane::rising(SLOPE_DEG.to_radians());
    let turn = Rotation3::rotation_between(&Vector3::z(), &slope.normal).expect("not upside down");
    let edges = Vector3::new(2.0, 2.0, HEIGHT_M);
    let mesh = Mesh::block(Vector3::new(-1.0, -1.0, DROP_M), edges, cells).shaped(|place| {
        // A smooth map from a square to its inscribed circle, without flat corners.
        let (x, y) = (place.x, place.y);
        let disc = [x * (1.0 - 0.5 * y * y).sqrt(), y * (1.0 - 0.5 * x * x).sqrt()];
        turn * Vector3::new(RADIUS_M * disc[0], RADIUS_M * disc[1], place.z)
    });
    let mut assembly = Assembly::default();
    let soft = SoftBody::add(&mut assembly, &mesh, &Material::elastic(150.0, 2.1e3, 0.045))
        .expect("no element is flat");
    soft.launch(&mut assembly, turn * Vector3::x() * -SPEED_M_S, Vector3::zeros());
    (assembly, soft, slope)
}

/// Creates the system of a puck with penalty contacts.
fn system(model: FrictionModel, cells: [usize; 3]) -> (System, Range<usize>) {
    let (mut assembly, soft, slope) = puck(cells);
    let below = ((cells[0] + 1) * (cells[1] + 1)) as f64;
    let stiffness_n_m3 = NODE_STIFFNESS_N_M * below / (PI * RADIUS_M * RADIUS_M);
    let contact = SurfaceContact {
        stiffness_n_m3,
        damping_n_s_m3: 0.0,
        ramp_m: 0.0,
        friction: Friction {
            model,
            coefficient: COEFFICIENT,
            stick_n_s_m: stiffness_n_m3 * STEP_S,
        },
    };
    let ground: Arc<dyn Ground> = Arc::new(slope);
    let contacts = soft.touch(&mut assembly, &ground, &contact);
    let gravity_m_s2 = Vector3::z() * -GRAVITY_M_S2;
    let settings = Settings { gravity_m_s2, tolerance: TOLERANCE, ..Settings::default() };
    (System::new(settings, assembly), contacts)
}

fn slide(
    model: FrictionModel,
    cells: [usize; 3],
    steps: usize,
    watch: &dyn Watch,
) -> Option<Slide> {
    let (mut system, contacts) = system(model, cells);
    let normal = Plane::rising(SLOPE_DEG.to_radians()).normal;
    let down = Vector3::new(-normal.z, 0.0, normal.x);
    let mass_kg = system.bodies().iter().map(|body| body.mass_kg()).sum();
    let mut slide = Slide { mass_kg, ..Slide::default() };
    for step in 0..steps {
        if watch.interrupted() {
            return None;
        }
        let report = system.step(STEP_S).ok()?;
        slide.iterations.push(report.iterations);
        slide.residual = slide.residual.max(report.residual);
        slide.halved += report.subdivisions;
        let speed = down.dot(&system.momentum()) / slide.mass_kg;
        slide.speeds_m_s.push((system.time_s(), speed));
        for force in contacts.clone() {
            let Some(touch) = system.touch(force).filter(|touch| touch.gap_m < 0.0) else {
                continue;
            };
            let across = touch.force - touch.normal * touch.normal.dot(&touch.force);
            let limit = touch.friction.coefficient * touch.normal_n;
            slide.friction = slide.friction.max(across.norm() / limit);
        }
        if step % 100 == 99 {
            watch.report(&format!("{model:?}: step {}, {speed:.3e} m/s", step + 1));
        }
    }
    let touching: Vec<_> = contacts
        .filter_map(|force| system.touch(force))
        .filter(|touch| touch.gap_m < 0.0)
        .collect();
    slide.stick_n_s_m = touching.iter().map(|touch| touch.friction.stick_n_s_m).sum();
    slide.depth_m = -touching.iter().map(|touch| touch.gap_m).sum::<f64>() / touching.len() as f64;
    let load_n: f64 = touching.iter().map(|touch| touch.normal_n).sum();
    let carried = touching.iter().map(|touch| -touch.gap_m * touch.normal_n);
    slide.carried_m = carried.sum::<f64>() / load_n;
    slide.height_m = height_m(system.bodies(), system.motions());
    slide.motions = system.motions().to_vec();
    Some(slide)
}

/// Height of the centre of mass above the slope, m.
fn height_m(bodies: &[Body], motions: &[BodyMotion]) -> f64 {
    let normal = Plane::rising(SLOPE_DEG.to_radians()).normal;
    let moments =
        bodies.iter().zip(motions).map(|(body, of)| body.mass_kg() * normal.dot(&of.position));
    moments.sum::<f64>() / bodies.iter().map(Body::mass_kg).sum::<f64>()
}

/// Height of a puck after further steps with `model`, from the final state of another run.
fn onward(from: &Slide, model: FrictionModel, cells: [usize; 3], watch: &dyn Watch) -> Option<f64> {
    let (mut system, _) = system(model, cells);
    system.restart(from.motions.clone());
    for _ in 0..ONWARD {
        if watch.interrupted() {
            return None;
        }
        system.step(STEP_S).ok()?;
    }
    Some(height_m(system.bodies(), system.motions()))
}

/// Simulates the sliding puck with hard contacts and Coulomb's law without penalties.
fn slide_exactly(cells: [usize; 3], steps: usize, watch: &dyn Watch) -> Option<Slide> {
    let (assembly, _, plane) = puck(cells);
    let normal = plane.normal;
    let down = Vector3::new(-normal.z, 0.0, normal.x);
    let masses_kg: Vec<f64> = assembly.bodies.iter().map(|body| body.mass_kg()).collect();
    let mut slide = Slide { mass_kg: masses_kg.iter().sum(), ..Slide::default() };
    let mut reference = Reference {
        assembly,
        plane,
        coefficient: COEFFICIENT,
        gravity_m_s2: Vector3::z() * -GRAVITY_M_S2,
        step_s: STEP_S,
    };
    for step in 1..=steps {
        if watch.interrupted() {
            return None;
        }
        let report = reference.step()?;
        slide.iterations.push(report.programs);
        slide.residual = slide.residual.max(report.residual_n);
        slide.halved += u32::from(!report.converged());
        let [mut loads, mut lifted] = [0.0; 2];
        for (particle, impulse) in report.impulses {
            let load = normal.dot(&impulse);
            loads += load;
            lifted += load * normal.dot(&reference.assembly.motions[particle].position).abs();
            // Programs return impulses below 1e-8 N·s where nothing touches.
            if load > 1e-8 {
                let across = (impulse - normal * load).norm();
                slide.friction = slide.friction.max(across / (COEFFICIENT * load));
            }
        }
        if loads > 1e-8 {
            slide.depth_m = slide.depth_m.max(lifted / loads);
        }
        let moments = masses_kg.iter().zip(&reference.assembly.motions);
        let momentum: f64 = moments.map(|(mass_kg, of)| mass_kg * down.dot(&of.velocity)).sum();
        slide.speeds_m_s.push((step as f64 * STEP_S, momentum / slide.mass_kg));
        if step % 100 == 0 {
            watch.report(&format!("SQP: step {step}, {:.3e} m/s", momentum / slide.mass_kg));
        }
    }
    slide.height_m = height_m(&reference.assembly.bodies, &reference.assembly.motions);
    Some(slide)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiments::NoProgress;

    /// Tests that the friction of a coarse puck stays within its cones and slows the puck down.
    #[test]
    fn friction_stays_within_its_cones() {
        let slide = slide(FrictionModel::Hybrid, [3, 3, 1], 60, &NoProgress).unwrap();
        assert!(slide.friction <= 1.0 + 1e-9 && slide.residual < TOLERANCE);
        assert!(slide.speeds_m_s[59].1 < 0.9 * SPEED_M_S && slide.stick_n_s_m > 0.0);
    }
}
