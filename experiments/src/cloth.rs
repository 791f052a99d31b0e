//! Cloth of particles and springs, whose corners are moved (thesis Figs. 4.16 and 4.17).

use crate::Watch;
use cpu_time::ProcessTime;
use nalgebra::Vector3;
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::curve::{Curve, Degree};
use rollwalk_physics::points::Points;
use rollwalk_physics::sensitivity::gauss_newton::{Evaluation, Fit, Options, Penalty, minimise};
use rollwalk_physics::sensitivity::parameter::Handle;
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::spring::Spring;
use rollwalk_physics::{Assembly, System};
use std::ops::Range;
use std::sync::Arc;

pub(crate) const STEP_S: f64 = 1.0 / 60.0;
/// Stiffness of springs and handles, N/m (Table A.2).
const STIFFNESS_N_M: f64 = 1000.0;
/// Damping of springs, N·s/m.
const DAMPING_N_S_M: f64 = 0.1;

/// A square cloth.
#[derive(Clone, Debug)]
pub(crate) struct Cloth {
    /// Its particles, row by row.
    pub nodes: Range<usize>,
    /// Along an edge.
    count: usize,
}

impl Cloth {
    /// Level, around a centre; `slack` is by how much it is larger than that, 1 if it is not.
    pub fn add(
        assembly: &mut Assembly,
        center: Vector3<f64>,
        edge_m: f64,
        count: usize,
        mass_kg: f64,
        slack: f64,
    ) -> Self {
        let (first, spacing) = (assembly.bodies.len(), edge_m / (count - 1) as f64);
        let of_node = mass_kg / (count * count) as f64;
        for k in 0..count * count {
            let [x, y] = [k % count, k / count].map(|k| spacing * k as f64 - 0.5 * edge_m);
            assembly.add_particle(of_node, center + Vector3::new(x, y, 0.0));
        }
        let mut link = |one: usize, other: usize| {
            let bodies = [first + one, first + other];
            let [from, to] = bodies.map(|body| assembly.motions[body].position);
            assembly.add(Spring {
                ends: Points { bodies, points: [Vector3::zeros(); 2] },
                rest_m: (to - from).norm() * slack,
                stiffness_n_m: STIFFNESS_N_M,
                damping_n_s_m: DAMPING_N_S_M,
                string: false,
            });
        };
        for k in 0..count * count {
            let (right, up) = (k % count + 1 < count, k / count + 1 < count);
            if right {
                link(k, k + 1);
            }
            if up {
                link(k, k + count);
            }
            if right && up {
                link(k, k + 1 + count);
                link(k + 1, k + count);
            }
        }
        Self { nodes: first..first + count * count, count }
    }

    /// The particle in a row and column.
    pub fn node(&self, row: usize, column: usize) -> usize {
        self.nodes.start + row * self.count + column
    }
}

/// Handles on some particles, which are moved step by step.
#[derive(Clone, Debug)]
pub(crate) struct Handles {
    anchors: Vec<usize>,
    begins: Vec<Vector3<f64>>,
    curve: Arc<Curve>,
}

impl Handles {
    pub fn add(assembly: &mut Assembly, particles: &[usize], steps: usize) -> Self {
        let begins: Vec<_> =
            particles.iter().map(|&body| assembly.motions[body].position).collect();
        let anchor = |(&body, &place): (&usize, &Vector3<f64>)| {
            let point = Vector3::zeros();
            let (stiffness_n_m, damping_n_s_m) = (STIFFNESS_N_M, 0.0);
            assembly.add(Anchor { body: [body], point, place, stiffness_n_m, damping_n_s_m })
        };
        let anchors = particles.iter().zip(&begins).map(anchor).collect();
        let curve = Curve {
            begin_s: STEP_S,
            spacing_s: STEP_S,
            knots: steps,
            degree: Degree::Linear,
            periodic: false,
        };
        Self { anchors, begins, curve: Arc::new(curve) }
    }

    /// Coordinates of a step.
    fn coordinates(&self) -> usize {
        3 * self.anchors.len()
    }

    pub fn parameters(&self) -> usize {
        self.coordinates() * self.curve.knots
    }

    fn all(&self) -> Vec<Box<dyn Parameter>> {
        let of_knot = |knot: usize| {
            self.anchors.iter().flat_map(move |&anchor| {
                [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
                    Box::new(Handle { anchor, axis, curve: Arc::clone(&self.curve), knot })
                })
            })
        };
        (0..self.curve.knots).flat_map(of_knot).collect()
    }

    fn follow(&self, system: &mut System, knot: &[f64]) {
        for ((&anchor, begin), shift) in self.anchors.iter().zip(&self.begins).zip(knot.chunks(3)) {
            let anchor = system.force_mut::<Anchor>(anchor).expect("a handle's anchor");
            anchor.place = begin + Vector3::from_column_slice(shift);
        }
    }
}

/// What the handles are to do.
pub(crate) struct Task<'a> {
    pub handles: Handles,
    /// A new system at its beginning.
    pub begin: &'a dyn Fn() -> System,
    /// Target residuals.
    pub targets: &'a dyn Fn(&Rollout) -> Vec<Residual>,
    /// Weight of the smoothness.
    pub beta: f64,
    /// Weight of how far the handles are from where they begin.
    pub stay: f64,
    pub options: Options,
}

/// How it went.
pub(crate) struct Moved {
    pub fit: Fit,
    /// With the parameters that were found.
    pub rollout: Rollout,
    /// CPU time of a simulation without derivatives, and of the optimisation, s.
    pub simulation_s: f64,
    pub optimisation_s: f64,
}

impl Task<'_> {
    pub fn rollout(&self, parameters: &[f64]) -> Option<Rollout> {
        let mut system = (self.begin)();
        let mut recorder = Recorder::new(&system, self.handles.all());
        for knot in parameters.chunks(self.handles.coordinates()) {
            self.handles.follow(&mut system, knot);
            system.step_recorded(STEP_S, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    }

    fn simulate(&self, parameters: &[f64]) -> Option<f64> {
        let mut system = (self.begin)();
        let begin = ProcessTime::now();
        for knot in parameters.chunks(self.handles.coordinates()) {
            self.handles.follow(&mut system, knot);
            system.step(STEP_S).ok()?;
        }
        Some(begin.elapsed().as_secs_f64())
    }

    /// Finds the places of the handles from some with which to begin.
    pub fn solve(&self, watch: &dyn Watch, start: &[f64]) -> Option<Moved> {
        let begin = ProcessTime::now();
        let run = |parameters: &[f64]| {
            if watch.interrupted() {
                return None;
            }
            let rollout = self.rollout(parameters)?;
            let residuals = (self.targets)(&rollout);
            Some(Evaluation::from((rollout, residuals)))
        };
        let coordinates = self.handles.coordinates();
        let mut penalties =
            Penalty::smooth(coordinates, self.handles.curve.knots, false, self.beta);
        penalties.extend(Penalty::small(coordinates, self.beta));
        if self.stay > 0.0 {
            penalties.extend(Penalty::small(start.len(), self.stay));
        }
        let fit = minimise(start, &penalties, &self.options, run)?;
        let optimisation_s = begin.elapsed().as_secs_f64();
        let rollout = self.rollout(&fit.parameters)?;
        let simulation_s = self.simulate(&fit.parameters)?;
        (!watch.interrupted()).then_some(Moved { fit, rollout, simulation_s, optimisation_s })
    }
}
