//! Parallel projection of the robot, seen from its front right and slightly from above.

use nalgebra::Vector3;

/// Azimuth of the view, rad: angle about the vertical from a pure side view.
const AZIMUTH_RAD: f64 = 0.45;
/// Elevation of the view, rad.
const ELEVATION_RAD: f64 = 0.28;

/// Camera that projects world points to a page. On the page, x points right and y down.
#[derive(Clone, Copy, Debug)]
pub struct Camera {
    /// World point at the page position `origin`.
    pub target_m: Vector3<f64>,
    /// Page position of the target, px.
    pub origin: [f64; 2],
    /// Scale, px/m.
    pub px_per_m: f64,
}

impl Camera {
    /// Page position of a world point, px.
    pub fn project(&self, point_m: &Vector3<f64>) -> [f64; 2] {
        let p = point_m - self.target_m;
        let [x, y] = [right().dot(&p), up().dot(&p)];
        [self.origin[0] + x * self.px_per_m, self.origin[1] - y * self.px_per_m]
    }

    /// Distance of a point behind the target along the direction of view, m. Points with larger values are drawn first.
    pub fn depth(&self, point_m: &Vector3<f64>) -> f64 {
        right().cross(&up()).dot(&(self.target_m - point_m))
    }
}

/// World direction that points right on the page, mostly forward.
fn right() -> Vector3<f64> {
    let (sin, cos) = AZIMUTH_RAD.sin_cos();
    Vector3::new(cos, sin, 0.0)
}

/// World direction that points up on the page.
fn up() -> Vector3<f64> {
    let (sin, cos) = ELEVATION_RAD.sin_cos();
    let (sin_azimuth, cos_azimuth) = AZIMUTH_RAD.sin_cos();
    Vector3::new(-sin_azimuth * sin, cos_azimuth * sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_and_up_are_perpendicular_and_what_is_left_of_the_robot_is_behind() {
        assert!(right().dot(&up()).abs() < 1e-15 && (up().norm() - 1.0).abs() < 1e-15);
        let camera = Camera { target_m: Vector3::zeros(), origin: [0.0; 2], px_per_m: 100.0 };
        assert!(camera.depth(&Vector3::y()) > camera.depth(&-Vector3::y()));
        assert!(camera.project(&Vector3::z())[1] < 0.0, "up is towards smaller y");
        assert!(camera.project(&Vector3::x())[0] > 0.0, "forward is to the right");
    }
}
