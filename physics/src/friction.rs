//! Friction of a contact point as a function of its sliding velocity (thesis 4.4.2).

use nalgebra::{Matrix3, Vector3};

/// Dependence of friction on the sliding velocity.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum FrictionModel {
    /// Proportional to the sliding velocity, up to the friction cone (Eq. 4.13).
    #[default]
    Linear,
    /// Smooth transition to the friction cone (Eq. 4.14).
    Tanh,
    /// Linear for a sliding contact; a sticking contact does not move (thesis 4.4.3).
    Hybrid,
}

/// Friction parameters of one contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Friction {
    /// Friction law.
    pub model: FrictionModel,
    /// Coefficient μ.
    pub coefficient: f64,
    /// Ratio of force to sliding velocity of a sticking contact, N·s/m. The thesis ties it to the step (k_t = k_n h); contacts
    /// would then slip more with smaller steps.
    pub stick_n_s_m: f64,
}

/// Friction of a sticking contact: the force estimate minus a stiffness times the remaining sliding velocity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StickingFriction {
    /// Force estimate, N.
    pub force: Vector3<f64>,
    /// Stiffness against sliding, N·s/m.
    pub stick_n_s_m: f64,
}

/// Friction force and its derivatives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionForce {
    /// Force against the sliding direction, N.
    pub force: Vector3<f64>,
    /// Derivative with respect to the sliding velocity, N·s/m.
    pub by_sliding: Matrix3<f64>,
    /// Derivative with respect to the normal force.
    pub by_normal: Vector3<f64>,
    /// Derivative with respect to the coefficient, N.
    pub by_coefficient: Vector3<f64>,
    /// Derivative with respect to [`Friction::stick_n_s_m`], m/s.
    pub by_stick: Vector3<f64>,
    /// True if sticking would require a force outside the friction cone.
    pub slips: bool,
}

impl FrictionForce {
    /// Replaces the derivative with respect to the sliding velocity by the secant, as if the force were proportional to it.
    pub fn secant(self, sliding: &Vector3<f64>) -> Self {
        let speed = sliding.norm();
        if speed == 0.0 {
            return self;
        }
        let by_sliding = Matrix3::identity() * (-self.force.norm() / speed);
        Self { by_sliding, ..self }
    }
}

impl Friction {
    /// Force of a held contact, limited by the friction cone. Without `held`, the force of a free contact.
    pub(crate) fn held_force(
        &self,
        held: Option<&StickingFriction>,
        sliding: &Vector3<f64>,
        normal_n: f64,
    ) -> FrictionForce {
        let Some(&StickingFriction { force, stick_n_s_m }) = held else {
            return self.force(sliding, normal_n);
        };
        let force = Self { stick_n_s_m, ..*self }.force(&(sliding - force / stick_n_s_m), normal_n);
        // Stiffness of the hold is not a parameter of the contact.
        FrictionForce { by_stick: Vector3::zeros(), ..force }
    }

    /// Force at a sliding velocity in the tangent plane, m/s, under a normal force, N.
    pub fn force(&self, sliding: &Vector3<f64>, normal_n: f64) -> FrictionForce {
        let limit = self.coefficient * normal_n;
        let speed = sliding.norm();
        let stick = self.stick_n_s_m;
        let sticking = FrictionForce {
            force: sliding * -stick,
            by_sliding: Matrix3::identity() * -stick,
            by_normal: Vector3::zeros(),
            by_coefficient: Vector3::zeros(),
            by_stick: -sliding,
            slips: false,
        };
        if limit <= 0.0 {
            // Without friction, the one-sided derivative towards more friction.
            let by_coefficient = sliding * (-normal_n.max(0.0) / speed.max(f64::MIN_POSITIVE));
            return FrictionForce {
                force: Vector3::zeros(),
                by_sliding: Matrix3::zeros(),
                by_coefficient,
                by_stick: Vector3::zeros(),
                slips: speed > 0.0,
                ..sticking
            };
        }
        if speed == 0.0 {
            return sticking;
        }
        let along = sliding / speed;
        let across = Matrix3::identity() - along * along.transpose();
        let ratio = stick * speed / limit;
        match self.model {
            FrictionModel::Linear | FrictionModel::Hybrid if ratio < 1.0 => sticking,
            FrictionModel::Linear | FrictionModel::Hybrid => FrictionForce {
                force: along * -limit,
                by_sliding: across * (-limit / speed),
                by_normal: along * -self.coefficient,
                by_coefficient: along * -normal_n,
                by_stick: Vector3::zeros(),
                slips: true,
            },
            FrictionModel::Tanh => {
                let share = ratio.tanh();
                let slope = 1.0 - share * share;
                FrictionForce {
                    force: along * (-limit * share),
                    by_sliding: across * (-limit * share / speed)
                        - along * along.transpose() * (stick * slope),
                    by_normal: along * (-self.coefficient * (share - ratio * slope)),
                    by_coefficient: along * (-normal_n * (share - ratio * slope)),
                    by_stick: sliding * -slope,
                    slips: ratio >= 1.0,
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_agree_with_finite_differences() {
        let step = 1e-7;
        for model in [FrictionModel::Linear, FrictionModel::Tanh] {
            let friction = Friction { model, coefficient: 0.6, stick_n_s_m: 30.0 };
            for sliding in [Vector3::new(0.01, -0.02, 0.0), Vector3::new(0.4, 0.1, 0.2)] {
                let found = friction.force(&sliding, 5.0);
                for axis in 0..3 {
                    let at = |by: f64| {
                        let mut sliding = sliding;
                        sliding[axis] += by;
                        friction.force(&sliding, 5.0).force
                    };
                    let rate = (at(step) - at(-step)) / (2.0 * step);
                    assert!((rate - found.by_sliding.column(axis)).norm() < 1e-6, "{model:?}");
                }
                let at = |by: f64| friction.force(&sliding, 5.0 + by).force;
                let rate = (at(step) - at(-step)) / (2.0 * step);
                assert!((rate - found.by_normal).norm() < 1e-6, "{model:?}");
            }
        }
    }

    #[test]
    fn the_force_stays_within_the_cone_and_vanishes_without_load() {
        for model in [FrictionModel::Linear, FrictionModel::Tanh] {
            let friction = Friction { model, coefficient: 0.5, stick_n_s_m: 300.0 };
            let fast = friction.force(&Vector3::new(3.0, 4.0, 0.0), 2.0);
            assert!(fast.slips && (fast.force + Vector3::new(0.6, 0.8, 0.0)).norm() < 1e-12);
            let free = friction.force(&Vector3::new(3.0, 4.0, 0.0), 0.0);
            assert_eq!(free.force, Vector3::zeros());
            let still = friction.force(&Vector3::zeros(), 2.0);
            assert_eq!((still.force, still.slips), (Vector3::zeros(), false));
        }
    }
}
