//! Rotations: yaw–pitch–roll, the logarithm of SO(3) and its derivative.

use nalgebra::{Matrix3, Vector3};

/// Matrix of the cross product: `skew(v) * w == v × w`.
pub fn skew(v: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Rotation about the vertical, rad.
pub fn yaw_rotation(angle_rad: f64) -> Matrix3<f64> {
    let (s, c) = angle_rad.sin_cos();
    Matrix3::new(c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
}

/// World-from-body rotation R_z(yaw)·R_y(pitch)·R_x(roll).
pub fn from_yaw_pitch_roll(ypr_rad: &Vector3<f64>) -> Matrix3<f64> {
    let (sp, cp) = ypr_rad.y.sin_cos();
    let (sr, cr) = ypr_rad.z.sin_cos();
    let pitch = Matrix3::new(cp, 0.0, sp, 0.0, 1.0, 0.0, -sp, 0.0, cp);
    let roll = Matrix3::new(1.0, 0.0, 0.0, 0.0, cr, -sr, 0.0, sr, cr);
    yaw_rotation(ypr_rad.x) * pitch * roll
}

/// Quaternion `[w, x, y, z]` with the sign for which it is nearer to `other`. Quaternions along a motion then have no jumps.
pub fn nearer_quaternion(wxyz: [f64; 4], other: &[f64; 4]) -> [f64; 4] {
    let dot: f64 = wxyz.iter().zip(other).map(|(a, b)| a * b).sum();
    if dot < 0.0 { wxyz.map(|component| -component) } else { wxyz }
}

/// World axes about which yaw, pitch and roll turn the body. As columns of a matrix, they map the rates of these angles to the
/// angular velocity in world axes.
pub fn yaw_pitch_roll_axes(ypr_rad: &Vector3<f64>) -> [Vector3<f64>; 3] {
    let yaw = yaw_rotation(ypr_rad.x);
    let (sp, cp) = ypr_rad.y.sin_cos();
    [Vector3::z(), yaw * Vector3::y(), yaw * Vector3::new(cp, 0.0, -sp)]
}

/// Rotation vector of a rotation matrix, rad. Suitable for small rotations between samples: the axis is ill-conditioned near a
/// half turn.
pub fn log(r: &Matrix3<f64>) -> Vector3<f64> {
    let twice_sine =
        Vector3::new(r[(2, 1)] - r[(1, 2)], r[(0, 2)] - r[(2, 0)], r[(1, 0)] - r[(0, 1)]);
    let sine = 0.5 * twice_sine.norm();
    let cosine = 0.5 * (r.trace() - 1.0);
    let angle = sine.atan2(cosine);
    // angle/(2 sin) → 1/2 + sin²/12 for small turns, where the quotient loses its digits.
    let factor = if sine < 1e-4 && cosine > 0.0 {
        0.5 + sine * sine / 12.0
    } else {
        0.5 * angle / sine.max(f64::MIN_POSITIVE)
    };
    twice_sine * factor
}

/// Inverse right Jacobian of SO(3): log(exp(φ)·exp(δ)) ≈ φ + J_r⁻¹(φ)·δ.
///
/// The inverse left Jacobian, for log(exp(δ)·exp(φ)), is its transpose.
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle2 = phi.norm_squared();
    let coefficient = if angle2 < 1e-6 {
        1.0 / 12.0 + angle2 / 720.0
    } else {
        let angle = angle2.sqrt();
        1.0 / angle2 - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    let cross = skew(phi);
    Matrix3::identity() + cross * 0.5 + cross * cross * coefficient
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Rotation3;

    #[test]
    fn log_inverts_exp_from_tiny_to_large_turns() {
        for angle in [0.0, 1e-9, 1e-5, 1e-4, 0.1, 1.0, 2.5] {
            let phi = Vector3::new(0.48, -0.6, 0.64) * angle;
            let error = (log(&Rotation3::new(phi).into_inner()) - phi).norm();
            assert!(error < 1e-12, "{angle}: {error}"); // a few roundings of numbers near 1
        }
    }

    #[test]
    fn right_jacobian_is_the_derivative_of_log() {
        let step = 1e-6; // central differences: error about step² + 1e-16/step = 1e-10
        for angle in [0.0, 1e-4, 0.3, 2.0] {
            let phi = Vector3::new(0.48, -0.6, 0.64) * angle;
            let base = Rotation3::new(phi);
            let jacobian = right_jacobian_inverse(&phi);
            for k in 0..3 {
                let delta = Vector3::ith(k, step);
                let plus = log((base * Rotation3::new(delta)).matrix());
                let minus = log((base * Rotation3::new(-delta)).matrix());
                let error = ((plus - minus) / (2.0 * step) - jacobian.column(k)).norm();
                assert!(error < 1e-8, "{angle} {k}: {error}");
            }
        }
    }

    #[test]
    fn yaw_pitch_roll_axes_are_the_angular_velocity_map() {
        let ypr = Vector3::new(0.7, -0.4, 0.3);
        let rotation = from_yaw_pitch_roll(&ypr);
        let axes = yaw_pitch_roll_axes(&ypr);
        let step = 1e-6;
        for k in 0..3 {
            let turned = from_yaw_pitch_roll(&(ypr + Vector3::ith(k, step)));
            let error = (log(&(turned * rotation.transpose())) / step - axes[k]).norm();
            assert!(error < 1e-5, "{k}: {error}"); // one-sided difference: about step
        }
    }
}
