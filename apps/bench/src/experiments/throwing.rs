//! Soft bodies thrown at a target: common parts of the experiments of the thesis's section 4.7.4.1.

use crate::experiments::Watch;
use nalgebra::{Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::sensitivity::lbfgs::{self, Evaluation, Minimum, Options};
use rollwalk_physics::sensitivity::objective::cost;
use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual, Rollout};
use rollwalk_physics::soft::{Material, Mesh, SoftBody, SurfaceContact};
use rollwalk_physics::{Assembly, ContactChange, Scheme, Settings, System};
use std::ops::Range;
use std::sync::Arc;

/// Throw of a soft body at grounds.
#[derive(Clone, Debug)]
pub struct Throw {
    /// Shape at the start.
    pub mesh: Mesh,
    pub material: Material,
    /// Grounds that the body may touch, with their friction coefficients.
    pub grounds: Vec<(Arc<dyn Ground>, f64)>,
    pub model: FrictionModel,
    /// Contact stiffness k_n of a surface node, N/m.
    pub node_stiffness_n_m: f64,
    /// Number of surface nodes that k_n refers to. Contacts here have the same total stiffness per area.
    pub nodes: f64,
    pub scheme: Scheme,
    pub step_s: f64,
    pub steps: usize,
    /// Time that converts contact stiffness to the stiffness of sticking friction, s: k_t = k_n Δt in the thesis. `None` for
    /// the duration of a step.
    pub stick_s: Option<f64>,
    /// Spin that is added to the spin of the parameters, rad/s.
    pub spin: Vector3<f64>,
}

/// Freedoms of a throw: velocity, m/s, then spin, rad/s, along the world's axes.
pub const FREEDOMS: [(Freedom, usize); 6] = [
    (Freedom::Velocity, 0),
    (Freedom::Velocity, 1),
    (Freedom::Velocity, 2),
    (Freedom::Spin, 0),
    (Freedom::Spin, 1),
    (Freedom::Spin, 2),
];

impl Throw {
    /// Creates the deformable ball of the thesis's Fig. 4.12 with a number of layers: 160 elements for two layers, 540 for
    /// three. The thesis's ball has 451.
    ///
    /// The thesis specifies neither radius nor spin. The authors' published code contains tosses that reach the target with one
    /// and with two bounces. Its spin is −4 rad/s, where a point at r from the centre moves with r × ω: forward, like a rolling
    /// ball. With this spin and a radius of 2.5 cm, the ball of 540 elements comes within 1.5 mm of the target in both tosses
    /// (`ball_target`). With the opposite spin it ends 1 cm short; with a radius of 2 cm it is 7 mm too low after two bounces.
    pub fn ball(layers: usize) -> Self {
        let elastic = Material::elastic(150.0, 2e4, 5e-4);
        // Any rotation, so that nodes touch one after the other. Simultaneous contacts would make the objective rougher.
        let turn = Rotation3::new(Vector3::new(0.7, 0.4, -0.9));
        let floor = Plane { point: Vector3::z() * -0.05, normal: Vector3::z() };
        Self {
            mesh: Mesh::ball(0.025, layers).shaped(|place| turn * place),
            material: Material { viscosity_pa_s: 32.0 * 0.0125, ..elastic },
            grounds: vec![(Arc::new(floor), 0.4)],
            model: FrictionModel::Linear,
            node_stiffness_n_m: 1e3,
            nodes: 98.0,
            scheme: Scheme::Bdf2,
            step_s: 1e-3,
            steps: 250,
            stick_s: None,
            spin: Vector3::y() * 4.0,
        }
    }

    /// Changes the duration of a step, s, and keeps the duration of the throw.
    pub fn in_steps(self, steps_s: f64) -> Self {
        let steps = (self.step_s * self.steps as f64 / steps_s).round() as usize;
        Self { step_s: steps_s, steps, ..self }
    }

    /// Creates the system before the throw, with its body and the contacts with each ground.
    pub fn system(&self) -> (System, SoftBody, Vec<Range<usize>>) {
        let mut assembly = Assembly::default();
        let body = SoftBody::add(&mut assembly, &self.mesh, &self.material)
            .expect("shapes here have no flat elements");
        let share = match self.scheme {
            Scheme::Bdf1 => 1.0,
            Scheme::Bdf2 => 2.0 / 3.0,
        };
        // The stiffness is divided by area, so that a mesh of another size has the same surface.
        let area_m2: f64 = self.mesh.areas_m2().iter().sum();
        let stiffness_n_m3 = self.node_stiffness_n_m * self.nodes / area_m2;
        let contacts = self.grounds.iter().map(|(ground, coefficient)| {
            let contact = SurfaceContact {
                stiffness_n_m3,
                damping_n_s_m3: 0.0,
                ramp_m: 0.0,
                friction: Friction {
                    model: self.model,
                    coefficient: *coefficient,
                    stick_n_s_m: stiffness_n_m3 * share * self.stick_s.unwrap_or(self.step_s),
                },
            };
            body.touch(&mut assembly, ground, &contact)
        });
        let contacts = contacts.collect();
        let settings = Settings { scheme: self.scheme, tolerance: 1e-10, ..Settings::default() };
        let mut system = System::new(settings, assembly);
        for (axis, spin) in [Vector3::x(), Vector3::y(), Vector3::z()].iter().zip(&self.spin) {
            let bodies = body.nodes.clone().collect();
            Initial { bodies, freedom: Freedom::Spin, axis: *axis }.vary(&mut system, *spin);
        }
        (system, body, contacts)
    }

    /// Creates the system of a throw whose freedoms are changed by `by`, and the freedoms as parameters.
    fn launched(&self, freedoms: &[(Freedom, usize)], by: &[f64]) -> (System, Vec<Initial>) {
        let (mut system, body, _) = self.system();
        let initial = freedoms.iter().map(|&(freedom, axis)| {
            let axis = Vector3::ith(axis, 1.0);
            Initial { bodies: body.nodes.clone().collect(), freedom, axis }
        });
        let initial: Vec<Initial> = initial.collect();
        initial.iter().zip(by).for_each(|(initial, by)| initial.vary(&mut system, *by));
        (system, initial)
    }

    /// Simulates a throw whose freedoms are changed by `by`; `None` if a step does not converge.
    pub fn run(&self, freedoms: &[(Freedom, usize)], by: &[f64]) -> Option<Rollout> {
        let (mut system, initial) = self.launched(freedoms, by);
        let parameters = initial.into_iter().map(|one| -> Box<dyn Parameter> { Box::new(one) });
        let mut recorder = Recorder::new(&system, parameters.collect());
        for _ in 0..self.steps {
            system.step_recorded(self.step_s, &mut recorder).ok()?;
        }
        Some(recorder.finish())
    }

    /// Final centre of mass, m, computed without data for derivatives in half the time of [`run`](Self::run).
    pub fn arrival(&self, freedoms: &[(Freedom, usize)], by: &[f64]) -> Option<Vector3<f64>> {
        let (mut system, _) = self.launched(freedoms, by);
        for _ in 0..self.steps {
            system.step(self.step_s).ok()?;
        }
        let masses_kg = system.bodies().iter().map(|body| body.mass_kg());
        let moments = masses_kg.clone().zip(system.motions()).map(|(kg, of)| of.position * kg);
        Some(moments.sum::<Vector3<f64>>() / masses_kg.sum::<f64>())
    }

    /// Bounces in the order of their start, each as the index of the ground.
    pub fn bounces(&self, rollout: &Rollout) -> Vec<usize> {
        let (_, _, contacts) = self.system();
        let mut touching = vec![0_usize; contacts.len()];
        let mut last_left = vec![None; contacts.len()];
        let mut bounces = Vec::new();
        for (step, report) in rollout.reports().iter().enumerate() {
            for event in &report.events {
                let ground = contacts.iter().position(|of| of.contains(&event.force));
                let Some(ground) = ground else { continue };
                match event.change {
                    ContactChange::TouchDown { .. } => {
                        let apart = last_left[ground].is_none_or(|left| step > left + APART);
                        if touching[ground] == 0 && apart {
                            bounces.push(ground);
                        }
                        touching[ground] += 1;
                    }
                    ContactChange::LiftOff => {
                        touching[ground] -= 1;
                        last_left[ground] = Some(step);
                    }
                    _ => {}
                }
            }
        }
        bounces
    }
}

/// Objective of a throw, and its free parameters.
pub struct Aim<'a> {
    pub freedoms: &'a [(Freedom, usize)],
    /// Residuals, whose sum of squares is minimised.
    pub residuals: &'a dyn Fn(&Rollout) -> Vec<Residual>,
    pub watch: &'a dyn Watch,
}

impl Aim<'_> {
    /// Minimises the objective by L-BFGS; `None` after an interrupt, or if the throw fails at the start.
    pub fn descend(&self, throw: &Throw, start: &[f64], options: &Options) -> Option<Minimum> {
        let evaluate = |by: &[f64]| {
            (!self.watch.interrupted()).then_some(())?;
            let rollout = throw.run(self.freedoms, by)?;
            let residuals = (self.residuals)(&rollout);
            let stiffness = throw.node_stiffness_n_m;
            self.watch.report(&format!("k_n {stiffness}: objective {:.3e}", cost(&residuals)));
            Some(Evaluation::from((rollout, residuals)))
        };
        let found = lbfgs::minimise(start, options, evaluate)?;
        (!self.watch.interrupted()).then_some(found)
    }

    /// Minimises the objective with ever stiffer contacts, N/m of a node. Each stage starts from the result of the previous
    /// one.
    pub fn stiffen(
        &self,
        throw: &Throw,
        stages_n_m: &[f64],
        start: &[f64],
        options: &Options,
    ) -> Option<Vec<Minimum>> {
        let mut stages: Vec<Minimum> = Vec::with_capacity(stages_n_m.len());
        for &node_stiffness_n_m in stages_n_m {
            let throw = Throw { node_stiffness_n_m, ..throw.clone() };
            let from = stages.last().map_or(start, |before| &before.parameters);
            stages.push(self.descend(&throw, from, options)?);
        }
        Some(stages)
    }
}

/// Final distance of the centre of mass from a target along the world's axes, m.
pub fn from_target(rollout: &Rollout, target_m: &Vector3<f64>) -> Vec<Residual> {
    [Vector3::x(), Vector3::y(), Vector3::z()]
        .map(|axis| Residual::com(rollout, rollout.steps(), target_m, axis))
        .to_vec()
}

/// Best objective by number of simulations over consecutive stages, relative to the first objective.
pub fn convergence(stages: &[Minimum]) -> Vec<(f64, f64)> {
    let all = stages.iter().flat_map(|stage| &stage.best);
    all.zip(1..).map(|(best, at)| (f64::from(at), best / stages[0].best[0])).collect()
}

/// Number of steps without contact after which the next contact is another bounce. A vibrating soft surface separates and
/// touches again.
const APART: usize = 5;

/// Maps a point of the cube to a point of the unit ball.
pub fn into_ball(place: &Vector3<f64>) -> Vector3<f64> {
    let squares = place.component_mul(place);
    Vector3::from_fn(|k, _| {
        let (one, other) = (squares[(k + 1) % 3], squares[(k + 2) % 3]);
        place[k] * (1.0 - 0.5 * (one + other) + one * other / 3.0).sqrt()
    })
}
