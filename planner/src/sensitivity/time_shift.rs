//! Direction in which a motion without a fixed phase is free: earlier or later in time.
//!
//! A periodic motion whose feet never leave the ground is equally good at another phase. Samples at fixed times determine the
//! phase only through their discretisation, with eigenvalues of random sign. Newton's method and derivatives therefore require
//! a fixed phase.

use crate::formulation::rows::Columns;
use crate::problem::{Problem, Unknowns};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW};

/// Speed below which a motion is steady, scaled variables per sample. A shift in time does not change a steady motion.
const STEADY: f64 = 1e-6;

/// Unit vector of the shift in time, in scaled variables. `None` if footfalls, targets or height limits fix the phase, or if
/// nothing moves.
pub(super) fn free(problem: &Problem, unknowns: &Unknowns, columns: &Columns) -> Option<Vec<f64>> {
    let inside = &problem.stance[1..=problem.samples];
    let has_clock = inside.iter().any(|stance| *stance != inside[0])
        || !problem.targets.is_empty()
        || problem.heights.iter().any(|limits| !limits.is_empty());
    if !problem.periodic || has_clock {
        return None;
    }
    let layout = &problem.layout;
    let lifted: Vec<_> = problem
        .timeline
        .iter()
        .map(|s| s.lift.apply(layout, &unknowns.slots[s.slot], &unknowns.placement))
        .collect();
    // Speeds of the samples without the planar motion that would carry the first sample away from its anchor.
    let rate = |t: usize| (&lifted[t + 1] - &lifted[t - 1]) / 2.0;
    let first = rate(1);
    let turn = first[BASE_YAW];
    let base: Vector3<f64> = lifted[1].fixed_rows::<3>(BASE_POSITION).into();
    let spin = |v: Vector3<f64>| Vector3::new(-v.y, v.x, 0.0) * turn;
    let mut drift: Vector3<f64> = first.fixed_rows::<3>(BASE_POSITION).into();
    drift.z = 0.0;
    let mut direction = vec![0.0; columns.count];
    for (slot, columns) in columns.of_slot.iter().enumerate() {
        let mut rate = rate(slot + 1);
        let here = &lifted[slot + 1];
        for k in layout.points() {
            let p: Vector3<f64> = here.fixed_rows::<3>(k).into();
            let mut part = rate.fixed_rows_mut::<3>(k);
            part -= drift + spin(p - base);
        }
        for k in layout.vectors() {
            let v: Vector3<f64> = here.fixed_rows::<3>(k).into();
            let mut part = rate.fixed_rows_mut::<3>(k);
            part -= spin(v);
        }
        for k in layout.headings() {
            rate[k] -= turn;
        }
        for (variable, column) in columns.iter().enumerate() {
            if let Some(column) = column {
                direction[*column] = rate[variable] / layout.scale[variable];
            }
        }
    }
    if let Some([x, y, _]) = columns.placement {
        // Effect of the planar motion on the placement, which is seen from a moved frame.
        let offset = unknowns.placement.offset_m;
        let at_origin = drift - spin(base);
        let turned = rollwalk_multibody::rotation::yaw_rotation(unknowns.placement.yaw_rad);
        let moved = at_origin + spin(Vector3::new(offset[0], offset[1], 0.0)) - turned * at_origin;
        direction[x] = -moved.x;
        direction[y] = -moved.y;
    }
    let length = direction.iter().map(|d| d * d).sum::<f64>().sqrt();
    (length > STEADY * (problem.samples as f64).sqrt())
        .then(|| direction.iter().map(|d| d / length).collect())
}
