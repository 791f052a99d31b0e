//! Variables of the optimisation (Eq. 2.1), and the samples beyond the ends of a motion that follow from them.
//!
//! A sample contains `q` (6 + N), the contact point e (3) and force f (3) of each end effector, and speed ω, tilt and yaw (3)
//! of each wheel. These are 6 + N + 9n values for n wheels. The centroidal frame is eliminated: its position is φ_CoM(q) and
//! its orientation that of the body, so that Eq. 2.11 and 2.12 are exact. Six further variables are the sums of forces and of
//! moments, which the dynamics of neighbouring samples share. With the forces themselves in their place, an iteration takes 1.6
//! times as long.
//!
//! Terms are evaluated on a timeline that extends the motion by one sample at either end. Each timeline sample is a stored
//! sample, a *slot*, either as stored or **placed**: turned by ψ about the vertical and moved by D. Entries of slots may be
//! frozen. The terms are therefore the same for all kinds of ends:
//!
//! | ends | before the first | after the last |
//! |---|---|---|
//! | periodic | last slot, placed back by (D, ψ) | first slot, placed by (D, ψ) |
//! | at rest | first slot | last slot |
//! | prescribed | frozen slot | frozen slot, placed by (D, ψ) like the last sample |

use crate::plan::{Placement, Sample};
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model};
use rollwalk_multibody::rotation;
use rollwalk_robot::GRAVITY_M_S2;

/// Indices of one end effector's variables in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EndEffectorVars {
    /// Index of the first of three coordinates of the contact point e.
    pub position: usize,
    /// Index of the first of three components of the ground force f.
    pub force: usize,
    /// Wheel variables; `None` for a foot.
    pub wheel: Option<WheelVars>,
}

/// Indices of one wheel's variables in a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WheelVars {
    /// Index of the speed ω.
    pub speed: usize,
    /// Index of the axis tilt.
    pub tilt: usize,
    /// Index of the axis yaw.
    pub yaw: usize,
}

/// Layout of the variables of one sample.
#[derive(Clone, Debug)]
pub struct Layout {
    /// Number of variables in a sample.
    pub len: usize,
    /// Length of `q`, which comes first.
    pub dofs: usize,
    /// End effectors in robot order.
    pub end_effectors: Vec<EndEffectorVars>,
    /// Index of the first of six components: the sum of the ground forces (3), then that of their moments about the centre of
    /// mass (3).
    pub wrench: usize,
    /// Typical size of each variable, in SI units. The solver divides variables by it.
    pub scale: DVector<f64>,
}

impl Layout {
    /// Creates the layout for a robot.
    pub fn new(model: &Model) -> Self {
        let dofs = model.dofs();
        let count = model.robot().end_effectors.len();
        let force_scale = force_scale_n(model);
        let mut scale = vec![1.0; dofs];
        let mut end_effectors = Vec::with_capacity(count);
        for ee in &model.robot().end_effectors {
            let position = scale.len();
            scale.extend([1.0; 3]);
            let force = scale.len();
            scale.extend([force_scale; 3]);
            let wheel = ee.contact.rolls().then(|| {
                let speed = scale.len();
                // Spin at a rim speed of 1 m/s.
                scale.extend([1.0 / ee.radius_m, 1.0, 1.0]);
                WheelVars { speed, tilt: speed + 1, yaw: speed + 2 }
            });
            end_effectors.push(EndEffectorVars { position, force, wheel });
        }
        let wrench = scale.len();
        scale.extend([force_scale; 6]);
        Self { len: scale.len(), dofs, wrench, end_effectors, scale: DVector::from_vec(scale) }
    }

    /// Converts a sample of a plan to variables.
    pub fn variables_of(&self, sample: &Sample) -> DVector<f64> {
        let mut vars = DVector::zeros(self.len);
        for c in 0..3 {
            vars[BASE_POSITION + c] = sample.base_position_m[c];
            vars[BASE_YAW + c] = sample.base_yaw_pitch_roll_rad[c];
        }
        for (j, angle) in sample.joint_rad.iter().enumerate() {
            vars[JOINTS + j] = *angle;
        }
        for (at, ee) in self.end_effectors.iter().zip(&sample.end_effectors) {
            for c in 0..3 {
                vars[at.position + c] = ee.position_m[c];
                vars[at.force + c] = ee.force_n[c];
            }
            if let Some(wheel) = at.wheel {
                vars[wheel.speed] = ee.wheel_speed_rad_s;
                vars[wheel.tilt] = ee.tilt_rad;
                vars[wheel.yaw] = ee.yaw_rad;
            }
        }
        vars
    }

    /// First indices of all points of a sample. A placement turns and moves points.
    pub fn points(&self) -> impl Iterator<Item = usize> + '_ {
        std::iter::once(BASE_POSITION).chain(self.end_effectors.iter().map(|e| e.position))
    }

    /// First indices of all free vectors of a sample. A placement turns vectors.
    pub fn vectors(&self) -> impl Iterator<Item = usize> + '_ {
        self.end_effectors.iter().map(|e| e.force).chain([self.wrench, self.wrench + 3])
    }

    /// Indices of all angles about the vertical. A placement adds ψ to them.
    pub fn headings(&self) -> impl Iterator<Item = usize> + '_ {
        std::iter::once(BASE_YAW)
            .chain(self.end_effectors.iter().filter_map(|e| e.wheel.map(|w| w.yaw)))
    }
}

/// Weight Mg/n on each of n end effectors of a standing robot, N: the unit of ground forces in the solver.
pub fn force_scale_n(model: &Model) -> f64 {
    model.total_mass_kg() * GRAVITY_M_S2 / model.robot().end_effectors.len() as f64
}

/// Direction in which a placement is applied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lift {
    /// Identity: values as stored.
    Identity,
    /// Placement p → R_z(ψ)·p + D.
    Placed,
    /// Inverse placement p → R_z(−ψ)·(p − D).
    PlacedBack,
}

/// Sample of the timeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimelineSample {
    /// Index of the slot.
    pub slot: usize,
    /// Placement of the slot.
    pub lift: Lift,
}

impl Lift {
    /// Places a stored sample on the timeline.
    pub fn apply(
        self,
        layout: &Layout,
        stored: &DVector<f64>,
        placement: &Placement,
    ) -> DVector<f64> {
        let mut lifted = stored.clone();
        self.lift(layout, stored, placement, &mut lifted);
        lifted
    }

    /// Writes the lifted variables to `lifted`, which contains the stored ones.
    pub fn lift(
        self,
        layout: &Layout,
        stored: &DVector<f64>,
        placement: &Placement,
        lifted: &mut DVector<f64>,
    ) {
        let offset = Vector3::new(placement.offset_m[0], placement.offset_m[1], 0.0);
        let (turn, before, after) = match self {
            Self::Identity => return,
            Self::Placed => (placement.yaw_rad, Vector3::zeros(), offset),
            Self::PlacedBack => (-placement.yaw_rad, -offset, Vector3::zeros()),
        };
        let turned = rotation::yaw_rotation(turn);
        for k in layout.points() {
            let p: Vector3<f64> = stored.fixed_rows::<3>(k).into();
            lifted.fixed_rows_mut::<3>(k).copy_from(&(turned * (p + before) + after));
        }
        for k in layout.vectors() {
            let v: Vector3<f64> = stored.fixed_rows::<3>(k).into();
            lifted.fixed_rows_mut::<3>(k).copy_from(&(turned * v));
        }
        for k in layout.headings() {
            lifted[k] += turn;
        }
    }

    /// Converts a gradient with respect to the placed sample to one with respect to the stored sample, in place. Returns the
    /// gradient with respect to the placement (Dx, Dy, ψ).
    pub fn pull_back(
        self,
        layout: &Layout,
        lifted: &DVector<f64>,
        placement: &Placement,
        gradient: &mut [f64],
    ) -> [f64; 3] {
        let (turn, sign) = match self {
            Self::Identity => return [0.0; 3],
            Self::Placed => (placement.yaw_rad, 1.0),
            Self::PlacedBack => (-placement.yaw_rad, -1.0),
        };
        let (s, c) = turn.sin_cos();
        let mut to_placement = [0.0; 3];
        for (k, is_point) in
            layout.points().map(|k| (k, true)).chain(layout.vectors().map(|k| (k, false)))
        {
            let (gx, gy) = (gradient[k], gradient[k + 1]);
            if gx == 0.0 && gy == 0.0 {
                continue;
            }
            let back = (c * gx + s * gy, -s * gx + c * gy);
            if is_point {
                let (dx, dy) = if self == Self::Placed { (gx, gy) } else { (-back.0, -back.1) };
                // Placed: p' = R p + D turns about D; placed back: p' = R⁻¹(p − D) about the origin.
                let about = if self == Self::Placed { placement.offset_m } else { [0.0; 2] };
                let (rx, ry) = (lifted[k] - about[0], lifted[k + 1] - about[1]);
                to_placement[0] += dx;
                to_placement[1] += dy;
                to_placement[2] += sign * (gy * rx - gx * ry);
            } else {
                to_placement[2] += sign * (gy * lifted[k] - gx * lifted[k + 1]);
            }
            (gradient[k], gradient[k + 1]) = back;
        }
        for k in layout.headings() {
            to_placement[2] += sign * gradient[k];
        }
        to_placement
    }
}

#[cfg(test)]
mod tests;
