//! Ground turned about the vertical through the origin.

use super::{Ground, Surface};
use nalgebra::{Rotation3, Vector3};
use std::sync::Arc;

/// Ground that is turned.
#[derive(Clone, Debug)]
pub struct RotatedGround {
    inner: Arc<dyn Ground>,
    world_from_inner: Rotation3<f64>,
}

impl RotatedGround {
    /// Turns `inner` so that its x axis points along a heading, rad.
    pub fn new(inner: Arc<dyn Ground>, heading_rad: f64) -> Self {
        let world_from_inner = Rotation3::from_axis_angle(&Vector3::z_axis(), heading_rad);
        Self { inner, world_from_inner }
    }
}

impl Ground for RotatedGround {
    fn is_distance(&self) -> bool {
        self.inner.is_distance()
    }

    fn parts(&self) -> Vec<Arc<dyn Ground>> {
        let parts = self.inner.parts().into_iter();
        parts.map(|inner| Arc::new(Self { inner, ..*self }) as Arc<dyn Ground>).collect()
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let surface = self.inner.at(&self.world_from_inner.inverse_transform_vector(point));
        let turn = self.world_from_inner.matrix();
        Surface {
            gap_m: surface.gap_m,
            gradient: turn * surface.gradient,
            normal: turn * surface.normal,
            curvature: turn * surface.curvature * turn.transpose(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::{Profile, agrees_with_finite_differences};

    #[test]
    fn a_turned_ground_has_its_derivatives() {
        let ramp = Arc::new(Profile::ramp(-0.2, 0.5, 0.3).unwrap());
        let turned = RotatedGround::new(ramp, 0.7);
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..200 {
            let point = Vector3::from_fn(|_, _| 2.0 * rng.f64() - 1.0);
            agrees_with_finite_differences(&turned, &point);
        }
    }
}
