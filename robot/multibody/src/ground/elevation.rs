//! Height of the ground at a point of the x-y plane, with its derivatives.

use nalgebra::{Matrix2, Matrix3x2, Vector2, Vector3};

/// Height of the ground at a point of the x-y plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Elevation {
    /// Height, m.
    pub height_m: f64,
    /// Gradient (p, q) of the height.
    pub slope: Vector2<f64>,
    /// Hessian of the height, 1/m.
    pub bend: Matrix2<f64>,
}

impl Elevation {
    /// Gradient ν = (−p, −q, 1) of z − h(x, y), the height of a point above the ground.
    pub fn upward(&self) -> Vector3<f64> {
        Vector3::z() - Vector3::new(self.slope.x, self.slope.y, 0.0)
    }

    /// Unit normal n = ν/|ν|, out of the ground.
    pub fn normal(&self) -> Vector3<f64> {
        let upward = self.upward();
        upward / upward.norm()
    }

    /// Derivative of the normal with respect to x and y, (I − n nᵀ) ∂ν/|ν|, 1/m.
    pub fn d_normal(&self) -> Matrix3x2<f64> {
        let upward = self.upward();
        let mut d_upward = Matrix3x2::zeros();
        d_upward.fixed_rows_mut::<2>(0).copy_from(&-self.bend);
        let normal = upward / upward.norm();
        (d_upward - normal * (normal.transpose() * d_upward)) / upward.norm()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Elevation of h = 0.1 sin 3x cos 2y at (0.3, 0.4).
    fn wave() -> Elevation {
        let ((sx, cx), (sy, cy)) = (0.9_f64.sin_cos(), 0.8_f64.sin_cos());
        let bend = [[-0.9 * sx * cy, -0.6 * cx * sy], [-0.6 * cx * sy, -0.4 * sx * cy]];
        Elevation {
            height_m: 0.1 * sx * cy,
            slope: Vector2::new(0.3 * cx * cy, -0.2 * sx * sy),
            bend: bend.into(),
        }
    }

    #[test]
    fn the_normal_of_a_wave_is_that_of_its_closed_form() {
        let expected = Vector3::new(-0.128_048, 0.110_762, 0.985_563);
        let d_expected = Vector3::new(0.479_886, 0.267_318, 0.032_306);
        assert!((wave().normal() - expected).amax() < 1e-6);
        assert!((wave().d_normal().column(0) - d_expected).amax() < 1e-6);
    }
}
