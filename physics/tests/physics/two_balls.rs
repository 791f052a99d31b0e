//! Tests of a frictionless collision of two balls. The first ball transfers its speed to the second, and with it the
//! derivatives of the final position.

use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::force::{Derivative, Force, StateBlock, View, Wrench};
use rollwalk_physics::sensitivity::parameter::{Freedom, Initial};
use rollwalk_physics::sensitivity::{Parameter, Recorder, Residual};
use rollwalk_physics::{Assembly, Body, BodyMotion, Scheme, Settings, System};

/// Force that pushes two balls apart below a given distance.
#[derive(Debug)]
struct Bumper {
    balls: [usize; 2],
    distance_m: f64,
    stiffness_n_m: f64,
}

impl Force for Bumper {
    fn bodies(&self) -> &[usize] {
        &self.balls
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        let apart = view.now[1].position - view.now[0].position;
        let depth_m = (self.distance_m - apart.norm()).max(0.0);
        let push = apart.normalize() * (self.stiffness_n_m * depth_m);
        wrenches[0].force -= push;
        wrenches[1].force += push;
    }

    /// Adds the derivatives for balls that meet head-on.
    fn derivatives(&self, view: &View<'_>, wrenches: &mut [Wrench], by: &mut [Derivative]) {
        self.wrenches(view, wrenches);
        let apart = view.now[1].position - view.now[0].position;
        let along = apart.normalize();
        let closed = f64::from(u8::from(apart.norm() < self.distance_m));
        let stiffness: Matrix3<f64> = along * along.transpose() * (self.stiffness_n_m * closed);
        for (pair, sign) in [-1.0, 1.0, 1.0, -1.0].into_iter().enumerate() {
            by[pair].add_force(StateBlock::Position, &(stiffness * sign));
        }
    }
}

const DURATION_S: f64 = 1.0;

/// Derivatives of the second ball's final position with respect to the initial positions and speeds of both balls.
fn derivatives(stiffness_n_m: f64, steps: u32) -> Vec<f64> {
    let mut assembly = Assembly::default();
    let ball = Body::Particle { mass_kg: 1.0 };
    let first = assembly
        .add_body(ball, BodyMotion { velocity: Vector3::x(), ..BodyMotion::at(Vector3::zeros()) });
    let second = assembly.add_body(ball, BodyMotion::at(Vector3::x() * 0.6));
    assembly.add(Bumper { balls: [first, second], distance_m: 0.2, stiffness_n_m });
    let settings = Settings {
        scheme: Scheme::Bdf2,
        gravity_m_s2: Vector3::zeros(),
        tolerance: 1e-11,
        ..Settings::default()
    };
    let mut system = System::new(settings, assembly);
    let of = |(freedom, body): (Freedom, usize)| -> Box<dyn Parameter> {
        Box::new(Initial { bodies: vec![body], freedom, axis: Vector3::x() })
    };
    let both = [Freedom::Position, Freedom::Velocity].into_iter();
    let parameters = both.flat_map(|freedom| [(freedom, first), (freedom, second)]).map(of);
    let mut recorder = Recorder::new(&system, parameters.collect());
    for _ in 0..steps {
        system.step_recorded(DURATION_S / f64::from(steps), &mut recorder).unwrap();
    }
    let rollout = recorder.finish();
    let place =
        Residual::position(&rollout, rollout.steps(), second, &Vector3::zeros(), Vector3::x());
    rollout.adjoint(place.by.iter().map(|(step, body, by)| (*step, *body, by)))
}

/// Tests the derivatives of a collision. The second ball continues the motion of the first, one diameter ahead: derivatives (1,
/// 0, T, 0). A bumper with the contact time τ = π √(m/2k) gives (1, 0, T − τ/2, τ/2), which converges to these values for a
/// hard bumper. Nimble, with instantaneous collisions, gave (0.75, 0.25, 0.91, 0.08).
///
/// The time of impact within a step changes the speeds slightly, in proportion to the squared step. This change occurs over a
/// displacement as short as a step, so that the derivatives have an error of up to 2k/m h.
#[test]
fn derivatives_are_handed_over_with_the_speed() {
    for (stiffness_n_m, steps) in [(100.0_f64, 4_000), (1e3, 16_000)] {
        let contact_s = std::f64::consts::PI * (0.5 / stiffness_n_m).sqrt();
        let expected = [1.0, 0.0, DURATION_S - 0.5 * contact_s, 0.5 * contact_s];
        let bound = 2.0 * stiffness_n_m * DURATION_S / f64::from(steps);
        for (found, expected) in derivatives(stiffness_n_m, steps).iter().zip(expected) {
            assert!((found - expected).abs() < bound, "{stiffness_n_m}: {found}, {expected}");
        }
    }
}
