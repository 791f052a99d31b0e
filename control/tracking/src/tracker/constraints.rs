//! Constraints of a tick: dynamics of degrees of freedom without motors, friction, no pull of the ground, and torque limits.

use super::{Foot, Tracker};
use crate::quadratic::Program;
use nalgebra::DMatrix;
use rollwalk_multibody::JOINTS;
use std::f64::consts::FRAC_1_SQRT_2;

/// Number of inequalities of a contact: four sides of the pyramid, and no pull.
pub(super) const OF_CONTACT: usize = 5;

impl Tracker {
    /// Adds the dynamics M ν̇ + h = Σ Jᵀ f of degrees of freedom without motors.
    pub(super) fn add_dynamics(&mut self) {
        let free = (0..JOINTS).chain(self.undriven.iter().copied());
        for (constraint, dof) in free.enumerate() {
            let Self { program, mass, feet, .. } = self;
            write_torque(program, constraint, &[(dof, 1.0)], 1.0, mass, feet);
            self.program.bounds[constraint] = -self.bias[dof];
        }
    }

    /// Adds the limits: friction, no pull of the ground, and torque limits of motors.
    pub(super) fn add_limits(&mut self) {
        let dofs = self.tree.dofs();
        let mut constraint = self.program.equalities;
        // The friction pyramid lies within the cone. For a robot that recovers, it lies around the cone, because sliding a
        // little is better than a fall.
        let part = if self.recovery.is_active() { 1.0 } else { FRAC_1_SQRT_2 };
        for (j, foot) in self.feet.iter().enumerate().filter(|(_, foot)| foot.stands()) {
            let [along, side] = foot.most(part).map(|most| foot.normal * most);
            let sides = [
                along - foot.along,
                along + foot.along,
                side - foot.side,
                side + foot.side,
                foot.normal,
            ];
            for side in sides {
                for k in 0..3 {
                    self.program.normals[(dofs + 3 * j + k, constraint)] = side[k];
                }
                self.program.bounds[constraint] = 0.0;
                constraint += 1;
            }
        }
        for channel in &self.channels {
            for sign in [1.0, -1.0] {
                let Self { program, mass, feet, .. } = self;
                write_torque(program, constraint, &channel.torques, sign, mass, feet);
                let bias_nm: f64 =
                    channel.torques.iter().map(|(dof, factor)| factor * self.bias[*dof]).sum();
                program.bounds[constraint] = -channel.torque_max_nm - sign * bias_nm;
                constraint += 1;
            }
        }
        self.program.constraints = constraint;
    }
}

impl Foot {
    /// Largest ratios of tangential to normal force, along the travel of a wheel or blade and to its side.
    ///
    /// `part` scales the sides of the pyramid relative to the radius of the cone.
    pub(super) fn most(&self, part: f64) -> [f64; 2] {
        // Along its edge, a blade has the drag of gliding instead of a friction cone.
        let along = self.drag.unwrap_or(part * self.friction);
        [along, part * self.friction]
    }
}

/// Writes a sum of generalised forces times factors, without bias, times `sign`, as the normal of a constraint.
fn write_torque(
    program: &mut Program,
    constraint: usize,
    forces: &[(usize, f64)],
    sign: f64,
    mass: &DMatrix<f64>,
    feet: &[Foot],
) {
    let dofs = mass.ncols();
    let mut normal = program.normals.column_mut(constraint);
    for other in 0..dofs {
        let row = forces.iter().map(|(dof, factor)| factor * mass[(*dof, other)]);
        normal[other] = sign * row.sum::<f64>();
    }
    for (j, foot) in feet.iter().enumerate().filter(|(_, foot)| foot.stands()) {
        for k in 0..3 {
            let row = forces.iter().map(|(dof, factor)| factor * foot.jacobian[(k, *dof)]);
            normal[dofs + 3 * j + k] = -sign * row.sum::<f64>();
        }
    }
}
