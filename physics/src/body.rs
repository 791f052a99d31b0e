//! Rigid bodies, and particles, which have no rotation.

use crate::force::{Derivative, StateBlock};
use crate::motion::BodyMotion;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::rotation::skew;

/// Mass and inertia of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inertia {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Inertia about the centre of mass in body axes, kg·m².
    pub about_com_kg_m2: Matrix3<f64>,
}

/// Rigid body or particle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Body {
    /// Rigid body: six unknowns in a step.
    Rigid(Inertia),
    /// Point mass, such as a node of a soft body: three unknowns in a step. Moments on a particle have no effect.
    Particle {
        /// Mass, kg.
        mass_kg: f64,
    },
}

impl From<Inertia> for Body {
    fn from(inertia: Inertia) -> Self {
        Self::Rigid(inertia)
    }
}

impl Inertia {
    /// Angular momentum about the centre of mass, kg·m²/s, and the inertia matrix, both in world axes.
    pub(crate) fn spinning(&self, motion: &BodyMotion) -> (Vector3<f64>, Matrix3<f64>) {
        let inertia = motion.rotation * self.about_com_kg_m2 * motion.rotation.transpose();
        (inertia * motion.spin, inertia)
    }
}

impl Body {
    /// Mass, kg.
    pub fn mass_kg(&self) -> f64 {
        match self {
            Self::Rigid(inertia) => inertia.mass_kg,
            &Self::Particle { mass_kg } => mass_kg,
        }
    }

    /// Number of unknowns in a step.
    pub(crate) fn unknowns(&self) -> usize {
        match self {
            Self::Rigid(_) => 6,
            Self::Particle { .. } => 3,
        }
    }

    /// Angular momentum about the centre of mass, kg·m²/s.
    pub(crate) fn spin_momentum(&self, motion: &BodyMotion) -> Vector3<f64> {
        match self {
            Self::Rigid(inertia) => inertia.spinning(motion).0,
            Self::Particle { .. } => Vector3::zeros(),
        }
    }

    /// Derivatives of the linear and angular momentum with respect to the motion.
    pub(crate) fn momentum_by(&self, motion: &BodyMotion) -> Derivative {
        let mut by = Derivative::default();
        by.add_force(StateBlock::Velocity, &(Matrix3::identity() * self.mass_kg()));
        if let Self::Rigid(inertia) = self {
            let (momentum, about_com) = inertia.spinning(motion);
            // L = I ω: δL = δθ × L − I (δθ × ω) + I δω.
            by.add_moment(
                StateBlock::Rotation,
                &(about_com * skew(&motion.spin) - skew(&momentum)),
            );
            by.add_moment(StateBlock::Spin, &about_com);
        }
        by
    }

    pub(crate) fn kinetic_j(&self, motion: &BodyMotion) -> f64 {
        let linear = self.mass_kg() * motion.velocity.norm_squared();
        0.5 * (linear + self.spin_momentum(motion).dot(&motion.spin))
    }
}
