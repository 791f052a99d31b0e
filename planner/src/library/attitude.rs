//! Attitude of the body during a plan. The limits of the controller's IMU watch derive from it.

use super::LibraryError;
use crate::plan::Plan;
use rollwalk_protocol::library::{Attitude, MAX_TILT_RAD};

type Direction = [f64; 3];

/// Mean direction of the world's vertical in the base frame, and the largest angle of a sample's vertical from it, rad. Returns
/// an error if the sum of this angle and the tilt of the mean direction exceeds [`MAX_TILT_RAD`].
pub fn attitude(plan: &Plan) -> Result<Attitude, LibraryError> {
    let ups: Vec<Direction> =
        plan.samples.iter().map(|s| up_in_base(s.base_orientation_wxyz)).collect();
    let sum = ups.iter().fold([0.0; 3], |sum, up| [0, 1, 2].map(|i| sum[i] + up[i]));
    let length = dot(&sum, &sum).sqrt();
    // A plan without samples, or with a robot that turns over, has no mean direction. Upright is assumed.
    let mean = if length > 1e-6 { sum.map(|x| x / length) } else { [0.0, 0.0, 1.0] };
    let angles = ups.iter().map(|up| dot(up, &mean).clamp(-1.0, 1.0).acos());
    let spread_rad = angles.fold(0.0, f64::max) as f32;
    let tilt_rad = mean[2].clamp(-1.0, 1.0).acos() as f32 + spread_rad;
    // Margin for rounding, because the encoder checks quanta.
    if tilt_rad > MAX_TILT_RAD - 0.005 {
        return Err(LibraryError::Tilted { motion: plan.motion.name.clone(), tilt_rad });
    }
    Ok(Attitude { up_body: mean.map(|x| x as f32), spread_rad })
}

/// World's z axis in the base frame: third row of the rotation matrix.
fn up_in_base([w, x, y, z]: [f64; 4]) -> Direction {
    [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)]
}

fn dot(a: &Direction, b: &Direction) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::test_plans;
    use nalgebra::UnitQuaternion;

    fn plan_with(ypr: impl Fn(usize) -> [f64; 3]) -> Plan {
        let mut plan = test_plans::BoxMotion {
            ends: Ends::AtRest,
            duration_s: 0.5,
            samples: 6,
            x_m: |_| 0.0,
            leg_rad: |_| 0.3,
        }
        .plan("still");
        for (i, sample) in plan.samples.iter_mut().enumerate() {
            let [yaw, pitch, roll] = ypr(i);
            let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            sample.base_orientation_wxyz = [q.w, q.i, q.j, q.k];
        }
        plan
    }

    #[test]
    fn nose_down_is_up_ahead_wherever_it_heads() {
        let a = attitude(&plan_with(|i| [0.7 * i as f64, 0.3, 0.0])).unwrap();
        let expected = [-(0.3_f32.sin()), 0.0, 0.3_f32.cos()];
        assert!(a.up_body.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{a:?}");
        assert!(a.spread_rad < 1e-5);
    }

    #[test]
    fn what_rolls_to_and_fro_is_level_on_average_and_spread() {
        let a = attitude(&plan_with(|i| [0.0, 0.0, if i % 2 == 0 { 0.2 } else { -0.2 }])).unwrap();
        assert!((a.up_body[1]).abs() < 0.2 && (a.spread_rad - 0.2).abs() < 0.08, "{a:?}");
    }

    #[test]
    fn a_body_that_turns_over_makes_no_library() {
        for ypr in [[0.0, 1.2, 0.0], [0.0, 0.0, 3.1]] {
            let refused = attitude(&plan_with(|_| ypr)).unwrap_err().to_string();
            assert!(
                refused.contains("still: the body tilts by") && refused.contains("60°"),
                "{refused}"
            );
        }
    }
}
