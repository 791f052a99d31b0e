//! A gripper with six coordinates that are optimised step by step, and what it pulls (thesis 4.7.4.2).

use crate::Watch;
use cpu_time::ProcessTime;
use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::contact::{Contact, Normal, Resistance, Tip};
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::friction::{Friction, Model};
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::hold::{Grip, Hold, Place};
use rollwalk_physics::points::Points;
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Fit, Options, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::Pose;
use rollwalk_physics::sensitivity::{Recorder, Residual, Rollout};
use rollwalk_physics::spring::Spring;
use rollwalk_physics::{Assembly, Inertia, Motion, Settings, System};
use std::sync::Arc;

pub(crate) const STEP_S: f64 = 1.0 / 60.0;
/// Coordinates of the gripper.
pub(crate) const COORDINATES: usize = 6;
/// Edge of a cube, m, and its mass.
pub(crate) const EDGE_M: f64 = 0.05;
pub(crate) const CUBE_KG: f64 = 0.05;
/// Stiffness of strings and bands, and of a cube's corners on the ground (Table A.2).
pub(crate) const STRING_N_M: f64 = 5.0;
const CONTACT_N_M: f64 = 200.0;
const CONTACT_N_S_M: f64 = 1e-3;

/// A body that a hold moves.
#[derive(Clone, Debug)]
pub(crate) struct Gripper {
    pub body: usize,
    hold: usize,
    begin: Vector3<f64>,
    curve: Arc<Curve>,
}

/// Signs of the corners of a square.
pub(crate) const CORNERS: [[f64; 2]; 4] = [[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]];

/// A cube without contacts; its number.
pub(crate) fn add_cube(assembly: &mut Assembly, motion: Motion) -> usize {
    let about_com_kg_m2 = Matrix3::identity() * (CUBE_KG * EDGE_M * EDGE_M / 6.0);
    assembly.add_body(Inertia { mass_kg: CUBE_KG, about_com_kg_m2 }, motion)
}

/// Height of a cube's centre as it rests on its corners, m.
pub(crate) fn rest_m() -> f64 {
    0.5 * EDGE_M - CUBE_KG * 9.81 / (4.0 * CONTACT_N_M)
}

/// The eight corners of a cube touch level ground.
pub(crate) fn touch_ground(assembly: &mut Assembly, cube: usize) {
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    for ([x, y], z) in CORNERS.into_iter().flat_map(|corner| [(corner, 1.0), (corner, -1.0)]) {
        assembly.add(Contact {
            body: [cube],
            center: Vector3::new(x, y, z) * (0.5 * EDGE_M),
            radius_m: 0.0,
            tip: Tip::Sphere,
            normal: Normal {
                stiffness_n_m: CONTACT_N_M,
                damping_n_s_m: CONTACT_N_S_M,
                ramp_m: 0.0,
            },
            friction: Friction {
                model: Model::Linear,
                coefficient: 0.5,
                stick_n_s_m: CONTACT_N_M * STEP_S,
            },
            resistance: Resistance::default(),
            ground: Arc::clone(&ground),
        });
    }
}

/// Four springs from the lower corners of one cube, the gripper's among them, to the upper corners of another, stretched by
/// a share of their length.
pub(crate) fn tie(assembly: &mut Assembly, bodies: [usize; 2], stretch: f64, string: bool) {
    for [x, y] in CORNERS {
        let half_m = 0.5 * EDGE_M;
        let points = [-1.0, 1.0].map(|z| Vector3::new(x, y, z) * half_m);
        let places = [0, 1].map(|k| assembly.motions[bodies[k]].point(&points[k]).0);
        assembly.add(Spring {
            ends: Points { bodies, points },
            rest_m: (places[1] - places[0]).norm() * (1.0 - stretch),
            stiffness_n_m: STRING_N_M,
            damping_n_s_m: 0.0,
            string,
        });
    }
}

impl Gripper {
    /// A cube of its own at a place, for so many steps.
    pub fn add(assembly: &mut Assembly, at: Vector3<f64>, steps: usize) -> Self {
        let body = add_cube(assembly, Motion::at(at));
        // A robot's arm is far stiffer than what it pulls.
        let grip =
            Grip { shift_n_m: 1e4, velocity_n_s_m: 0.0, turn_nm_rad: 10.0, spin_nm_s_rad: 0.0 };
        let place = Some(Place::new(at, &Vector3::zeros()));
        let hold = assembly.add(Hold { body: [body], grip, place });
        let curve = Curve {
            begin_s: STEP_S,
            spacing_s: STEP_S,
            knots: steps,
            degree: Degree::Linear,
            periodic: false,
        };
        Self { body, hold, begin: at, curve: Arc::new(curve) }
    }

    pub fn parameters(&self) -> usize {
        COORDINATES * self.curve.knots
    }

    /// β Σ |p_{k+1} − p_k|², from where the gripper begins.
    fn smooth(&self, beta: f64) -> Vec<Penalty> {
        let mut all = Penalty::smooth(COORDINATES, self.curve.knots, false, beta);
        all.extend(Penalty::small(COORDINATES, beta));
        all
    }

    fn follow(&self, system: &mut System, knot: &[f64]) {
        let [shift, turn] = [0, 3].map(|first| Vector3::from_column_slice(&knot[first..first + 3]));
        let hold = system.force_mut::<Hold>(self.hold).expect("the gripper's hold");
        hold.place = Some(Place::new(self.begin + shift, &turn));
    }
}

/// What is pulled where.
pub(crate) struct Task<'a> {
    pub gripper: Gripper,
    /// A new system at its beginning.
    pub begin: &'a dyn Fn() -> System,
    /// Target residuals.
    pub targets: &'a dyn Fn(&Rollout) -> Vec<Residual>,
    /// Weight of the smoothness.
    pub beta: f64,
    pub options: Options,
}

/// How it went.
pub(crate) struct Pulled {
    pub fit: Fit,
    /// With the parameters that were found.
    pub rollout: Rollout,
    /// CPU time of a simulation without derivatives, and of the optimisation, s.
    pub simulation_s: f64,
    pub optimisation_s: f64,
}

impl Pulled {
    pub fn iterations(&self) -> usize {
        self.fit.costs.len() - 1
    }

    /// Objective by iteration.
    pub fn convergence(&self) -> Vec<(f64, f64)> {
        self.fit.costs.iter().zip(0..).map(|(cost, k)| (f64::from(k), *cost)).collect()
    }
}

impl Task<'_> {
    pub fn rollout(&self, parameters: &[f64]) -> Option<Rollout> {
        let mut system = (self.begin)();
        let poses = Pose::of_all(self.gripper.hold, &self.gripper.curve);
        let mut recorder = Recorder::new(&system, poses);
        for knot in parameters.chunks(COORDINATES) {
            self.gripper.follow(&mut system, knot);
            system.step_recorded(STEP_S, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    }

    /// Without derivatives; CPU time, s.
    pub fn simulate(&self, parameters: &[f64]) -> Option<f64> {
        let begin = ProcessTime::now();
        let mut system = (self.begin)();
        for knot in parameters.chunks(COORDINATES) {
            self.gripper.follow(&mut system, knot);
            system.step(STEP_S).ok()?;
        }
        Some(begin.elapsed().as_secs_f64())
    }

    /// Finds the gripper's poses from some with which to begin.
    pub fn pull(&self, watch: &dyn Watch, start: &[f64]) -> Option<Pulled> {
        let begin = ProcessTime::now();
        let run = |parameters: &[f64]| {
            if watch.interrupted() {
                return None;
            }
            let rollout = self.rollout(parameters)?;
            let residuals = (self.targets)(&rollout);
            Some(Evaluation::from((rollout, residuals)))
        };
        let fit = minimise(start, &self.gripper.smooth(self.beta), &self.options, run)?;
        let optimisation_s = begin.elapsed().as_secs_f64();
        let rollout = self.rollout(&fit.parameters)?;
        let simulation_s = self.simulate(&fit.parameters)?;
        (!watch.interrupted()).then_some(Pulled { fit, rollout, simulation_s, optimisation_s })
    }
}

pub(crate) fn settings() -> Settings {
    Settings { tolerance: 1e-10, ..Settings::default() }
}
