//! Body held at a pose by springs: a hoist, a stand, or a hand.

use crate::force::{Derivative, Force, StateBlock, View, Wrench};
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::{from_yaw_pitch_roll, skew};

/// Stiffness and damping of a [`Hold`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HoldGains {
    /// Stiffness against a shift of the centre of mass, N/m.
    pub shift_n_m: f64,
    /// Damping of the velocity of the centre of mass, N·s/m.
    pub velocity_n_s_m: f64,
    /// Stiffness against a turn, N·m/rad for small angles.
    pub turn_nm_rad: f64,
    /// Damping of the spin, N·m·s/rad.
    pub spin_nm_s_rad: f64,
}

/// Target pose of a [`Hold`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TargetPose {
    /// Centre of mass in world axes, m.
    pub position: Vector3<f64>,
    /// Rotation from body to world axes.
    pub rotation: Matrix3<f64>,
}

impl TargetPose {
    /// Creates a pose from a position, m, and yaw, pitch and roll, rad: R_z(yaw) R_y(pitch) R_x(roll).
    pub fn new(position: Vector3<f64>, yaw_pitch_roll: &Vector3<f64>) -> Self {
        Self { position, rotation: from_yaw_pitch_roll(yaw_pitch_roll) }
    }
}

/// Springs that hold one body.
#[derive(Clone, Debug)]
pub struct Hold {
    /// Index of the body.
    pub body: [usize; 1],
    /// Stiffness and damping of the hold.
    pub grip: HoldGains,
    /// Target pose; `None` releases the body.
    pub place: Option<TargetPose>,
}

impl Hold {
    /// Force and moment towards a pose. A deviation by an angle e about any axis gives the moment k sin e about this axis.
    fn wrench(&self, now: &BodyMotion, place: &TargetPose) -> Wrench {
        let HoldGains { shift_n_m, velocity_n_s_m, turn_nm_rad, spin_nm_s_rad } = self.grip;
        let mut sine = Vector3::zeros();
        for axis in 0..3 {
            sine += now.rotation.column(axis).cross(&place.rotation.column(axis)) * 0.5;
        }
        Wrench {
            force: (place.position - now.position) * shift_n_m - now.velocity * velocity_n_s_m,
            moment: sine * turn_nm_rad - now.spin * spin_nm_s_rad,
        }
    }
}

impl Force for Hold {
    fn bodies(&self) -> &[usize] {
        &self.body
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        if let Some(place) = &self.place {
            let Wrench { force, moment } = self.wrench(&view.now[0], place);
            wrenches[0].force += force;
            wrenches[0].moment += moment;
        }
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        self.wrenches(view, wrenches);
        let Some(place) = &self.place else { return };
        let HoldGains { shift_n_m, velocity_n_s_m, turn_nm_rad, spin_nm_s_rad } = self.grip;
        let mut by_turn = Matrix3::zeros();
        for axis in 0..3 {
            // δb = δθ × b: δ(b × b*) = −b*ˣ δb = b*ˣ bˣ δθ.
            let (is, should_be) = (view.now[0].rotation.column(axis), place.rotation.column(axis));
            by_turn += skew(&should_be.into()) * skew(&is.into()) * (0.5 * turn_nm_rad);
        }
        let derivative = &mut derivatives[0];
        derivative.add_force(StateBlock::Position, &(Matrix3::identity() * -shift_n_m));
        derivative.add_force(StateBlock::Velocity, &(Matrix3::identity() * -velocity_n_s_m));
        derivative.add_moment(StateBlock::Rotation, &by_turn);
        derivative.add_moment(StateBlock::Spin, &(Matrix3::identity() * -spin_nm_s_rad));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::agrees_with_finite_differences;
    use crate::rotation::Increment;

    #[test]
    fn a_hold_has_its_derivatives_and_lets_go() {
        let rotation = Increment::new(Vector3::new(0.3, -0.2, 0.1)).rotation();
        let place = TargetPose { position: Vector3::new(0.1, 0.2, 0.3), rotation };
        let grip = HoldGains {
            shift_n_m: 40.0,
            velocity_n_s_m: 3.0,
            turn_nm_rad: 5.0,
            spin_nm_s_rad: 0.7,
        };
        let hold = Hold { body: [0], grip, place: Some(place) };
        agrees_with_finite_differences(&hold);
        agrees_with_finite_differences(&Hold { place: None, ..hold });
    }
}
