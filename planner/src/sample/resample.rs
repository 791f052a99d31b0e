//! Resampling: the played motion as a plan with another sample rate.

use super::PlanSpline;
use crate::motion::Ends;
use crate::plan::{Placement, Plan, Sample};

/// Samples the plan at `rate_hz`, or at the nearest rate that divides its duration evenly. Fields have the same meaning as in the
/// plan; speeds of intervals are means over the new intervals.
pub fn resample(plan: &Plan, rate_hz: f64) -> Plan {
    let spline = PlanSpline::new(plan);
    let intervals = (plan.motion.duration_s * rate_hz).round().max(3.0);
    let spacing_s = plan.motion.duration_s / intervals;
    let count = match plan.motion.ends {
        Ends::Periodic => intervals as usize,
        Ends::AtRest | Ends::Prescribed => intervals as usize + 1,
    };
    let sample_at = |index: f64| {
        let time_s = index * spacing_s;
        // Index of the new interval inside the splines that starts at this sample; at rest there is none outside.
        let (mut sample, interval) = match plan.motion.ends {
            Ends::Periodic => (spline.sample(time_s), Some(index.rem_euclid(intervals))),
            Ends::AtRest => {
                (spline.sample(time_s), (0.0..intervals).contains(&index).then_some(index))
            }
            // Outside a prescribed end the velocity at the end continues.
            Ends::Prescribed => (spline.state(time_s, &Placement::default()), Some(index)),
        };
        sample.time_s = time_s;
        if let Some(start) = interval {
            for (j, end_effector) in sample.end_effectors.iter_mut().enumerate() {
                (end_effector.wheel_speed_rad_s, end_effector.motor_speed_rad_s) =
                    spline.mean_speeds(j, start * spacing_s, (start + 1.0) * spacing_s);
            }
        }
        sample
    };
    let samples: Vec<Sample> = (0..count).map(|i| sample_at(i as f64)).collect();
    let mut resampled = Plan {
        sample_interval_s: spacing_s,
        before: sample_at(-1.0),
        after: sample_at(count as f64),
        samples,
        ..plan.clone()
    };
    let stance = |s: &Sample| s.end_effectors.iter().map(|e| e.contact).collect();
    resampled.motion.stance = resampled.samples.iter().map(stance).collect();
    resampled
}
