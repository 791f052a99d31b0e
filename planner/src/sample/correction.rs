//! Corrections of the set-points over a transition, from those of the motion that it leaves to those of the motion that it
//! enters.
//!
//! The set-points of a retargeted motion differ from its planned angles. A transition is planned between angles, so that its
//! ends do not match the neighbouring set-points. The correction is a cubic of time that matches them and their rates, so that
//! set-points and their speeds are continuous.

use super::PlanSpline;
use crate::plan::Plan;

/// Corrections of all joints, rad, and their rates, rad/s.
type Corrections = Vec<[f64; 2]>;

/// Adds corrections to a transition if one of the motions that it joins has some.
pub(crate) fn join(transition: &mut Plan, from: &Plan, to: &Plan) {
    let exit = PlanSpline::new(from).corrections(from.motion.exit_time_s());
    let entry = PlanSpline::new(to).corrections(0.0);
    if exit.iter().chain(&entry).all(|of_joint| *of_joint == [0.0; 2]) {
        return;
    }
    let (duration_s, spacing_s) = (transition.motion.duration_s, transition.sample_interval_s);
    for sample in &mut transition.samples {
        let at = sample.time_s / duration_s;
        let joints = exit.iter().zip(&entry);
        let cubic = |(exit, entry): (&[f64; 2], &[f64; 2])| cubic(exit, entry, duration_s, at);
        sample.joint_correction_rad = joints.map(cubic).collect();
    }
    let beyond =
        |of: &Corrections, by_s: f64| of.iter().map(|[at, rate]| at + rate * by_s).collect();
    transition.before.joint_correction_rad = beyond(&exit, -spacing_s);
    transition.after.joint_correction_rad = beyond(&entry, spacing_s);
}

/// Hermite cubic at a fraction of its duration.
fn cubic(exit: &[f64; 2], entry: &[f64; 2], duration_s: f64, at: f64) -> f64 {
    let left = 1.0 - at;
    let values = exit[0] * left * left * (1.0 + 2.0 * at) + entry[0] * at * at * (3.0 - 2.0 * at);
    values + duration_s * (exit[1] * at * left * left - entry[1] * at * at * left)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::test_plans::{self, BoxMotion};

    /// Checks set-points and their speeds at the exit from and the entry to a retargeted walk.
    #[test]
    fn setpoints_are_continuous_where_motions_are_joined() {
        let mut from = test_plans::start_stop();
        let count = from.samples.len();
        for (k, sample) in from.samples.iter_mut().enumerate() {
            let bump = (k as f64 / (count - 1) as f64).powi(2);
            sample.joint_correction_rad = (0..4).map(|joint| bump * 0.01 * joint as f64).collect();
        }
        let drive = BoxMotion {
            ends: Ends::Prescribed,
            duration_s: 0.5,
            samples: 11,
            x_m: |_| 0.0,
            leg_rad: |_| 0.3,
        };
        let to = test_plans::start_stop();
        let mut transition = drive.plan("over");
        join(&mut transition, &from, &to);
        let spline = PlanSpline::new(&transition);
        let left = PlanSpline::new(&from).corrections(from.motion.duration_s);
        assert!((left[3][0] - 0.03).abs() < 1e-12);
        let found = spline.corrections(0.0);
        for (found, left) in found.iter().zip(&left) {
            assert!((found[0] - left[0]).abs() < 1e-12 && (found[1] - left[1]).abs() < 1e-12);
        }
        for found in spline.corrections(0.5) {
            assert!(found[0].abs() < 1e-12 && found[1].abs() < 1e-12, "{found:?}");
        }
        let mut none = drive.plan("over");
        join(&mut none, &to, &to);
        assert_eq!(none, drive.plan("over"));
    }

    #[test]
    fn the_cubic_has_values_and_rates_of_its_ends() {
        let (exit, entry, duration_s) = ([0.1, -0.4], [-0.2, 0.3], 0.8);
        let at = |time_s: f64| cubic(&exit, &entry, duration_s, time_s / duration_s);
        let rate = |time_s: f64| (at(time_s + 1e-6) - at(time_s - 1e-6)) / 2e-6;
        assert!((at(0.0) - 0.1).abs() < 1e-15 && (at(duration_s) + 0.2).abs() < 1e-15);
        assert!((rate(0.0) + 0.4).abs() < 1e-6 && (rate(duration_s) - 0.3).abs() < 1e-6);
    }
}
