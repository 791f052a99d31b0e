//! Start from another plan: its motion, evaluated at the samples of the new problem.
//!
//! The motions may differ in duration, sample count, footfalls and goal. Time is stretched from one duration to the other, and
//! the start is moved to where the anchor term requires it. For an edited robot, contact points and wheel angles are recomputed
//! from the pose. At samples with different footfalls, the weight is redistributed over the stance feet.

use super::guess;
use crate::plan::{Placement, Plan, Sample};
use crate::problem::variables::Lift;
use crate::problem::{Problem, Unknowns};
use crate::sample::resample;
use nalgebra::DVector;

/// Returns the unknowns of `problem` that are closest to the plan `previous`.
///
/// Both motions must have the same kind of ends. Both robots must have the same number of joints, and the same number and kinds
/// of end effectors.
pub fn neighbour(problem: &Problem, previous: &Plan) -> Unknowns {
    let duration_s = previous.motion.duration_s;
    let intervals = (problem.last() - 1) as f64;
    let resampled = (previous.samples.len() != problem.samples)
        .then(|| resample(previous, intervals / duration_s).samples);
    let samples: &[Sample] = resampled.as_ref().unwrap_or(&previous.samples);
    let origin = Placement {
        offset_m: [samples[0].base_position_m[0], samples[0].base_position_m[1]],
        yaw_rad: samples[0].base_yaw_pitch_roll_rad[0],
    };
    let stretch = duration_s / (intervals * problem.interval_s);
    let edited = previous.robot != *problem.model.robot();
    let slot = |(i, sample): (usize, &Sample)| {
        let placed = problem.layout.variables_of(sample);
        let mut vars = Lift::PlacedBack.apply(&problem.layout, &placed, &origin);
        for wheel in problem.layout.end_effectors.iter().filter_map(|ee| ee.wheel) {
            vars[wheel.speed] *= stretch;
        }
        if edited {
            guess::follow_kinematics(&problem.model, &problem.layout, &problem.ground, &mut vars);
        }
        let stood = sample.end_effectors.iter().map(|ee| ee.contact);
        if !stood.eq(problem.stance[i + 1].iter().copied()) {
            guess::share_weight(problem, i + 1, &mut vars);
        }
        vars
    };
    let slots: Vec<DVector<f64>> = samples.iter().enumerate().map(slot).collect();
    let placement = if problem.placement_free {
        relative_to(&origin, &previous.end_placement)
    } else {
        problem.goal_placement()
    };
    Unknowns { slots, placement }
}

/// Converts `placement` to the frame `origin`.
fn relative_to(origin: &Placement, placement: &Placement) -> Placement {
    let [x, y] = origin.offset_m;
    let [x, y, _] = origin.inverse().point(placement.point([x, y, 0.0]));
    Placement { offset_m: [x, y], yaw_rad: placement.yaw_rad }
}
