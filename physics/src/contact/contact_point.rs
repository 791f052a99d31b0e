//! Contact point of a sphere, rim or blade: the lowest point, and its movement on the body as the body turns.

use crate::motion::BodyMotion;
use nalgebra::{Matrix3, RowVector3, Vector3};
use rollwalk_multibody::ground::{Ground, Surface};
use rollwalk_multibody::rotation::skew;

/// Sine of the angle between wheel plane and ground below which a rim is regarded as flat, without a unique lowest point.
const LEAST_SINE: f64 = 1e-3;

/// Shape of the contacting part.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tip {
    /// Sphere; a point if the radius is 0.
    Sphere,
    /// Rim about an axis of the body.
    Rim {
        /// Unit axis, in body axes.
        axis: Vector3<f64>,
    },
    /// Blade across an axis of the body. The blade glides along itself and resists sideways motion.
    Blade {
        /// Unit vector across the blade, in body axes.
        axis: Vector3<f64>,
    },
}

pub(super) struct ContactPoint {
    pub surface: Surface,
    /// Vector from the centre of mass to the contact point, m.
    pub arm: Vector3<f64>,
    /// Axis of a rim or blade in world axes; `None` for a sphere.
    pub axis: Option<Vector3<f64>>,
    radius_m: f64,
    /// Vector from the centre of mass to the centre of the tip, m.
    fixed: Vector3<f64>,
    at_center: Surface,
    /// True if the gap is the exact distance, as in [`Ground::is_distance`].
    is_distance: bool,
}

/// Derivatives of a contact point with respect to the body's pose.
pub(super) struct ContactPointByPose {
    pub point_by_position: Matrix3<f64>,
    pub point_by_rotation: Matrix3<f64>,
    pub gap_by_position: RowVector3<f64>,
    pub gap_by_rotation: RowVector3<f64>,
    pub normal_by_position: Matrix3<f64>,
    pub normal_by_rotation: Matrix3<f64>,
}

impl ContactPoint {
    /// Computes the contact point of a tip for a motion of its body. `center` is in body axes.
    pub fn new(
        center: &Vector3<f64>,
        radius_m: f64,
        tip: Tip,
        ground: &dyn Ground,
        body: &BodyMotion,
    ) -> Self {
        let fixed = body.rotation * center;
        let at_center = ground.at(&(body.position + fixed));
        let axis = match tip {
            Tip::Sphere => None,
            Tip::Rim { axis } | Tip::Blade { axis } => Some(body.rotation * axis),
        };
        let lever = match &axis {
            None => at_center.normal * -radius_m,
            Some(axis) => Rim::new(axis, &at_center.normal).lowest(radius_m),
        };
        let arm = fixed + lever;
        let is_distance = ground.is_distance();
        let surface = if is_distance {
            // The gap follows from the distance at the centre. At the contact point, inside the solid, the nearest face may
            // belong to another edge than the touched one.
            Surface { gap_m: at_center.gap_m + at_center.normal.dot(&lever), ..at_center }
        } else {
            ground.at(&(body.position + arm))
        };
        Self { surface, arm, axis, radius_m, fixed, at_center, is_distance }
    }

    /// Derivatives with respect to the body's pose.
    pub fn by_pose(&self) -> ContactPointByPose {
        let &Self { surface, arm, radius_m, at_center, .. } = self;
        let (normal, curvature) = (at_center.normal, at_center.curvature);
        let center_by_rotation = -skew(&self.fixed);
        let (by_rotation, by_normal) = match &self.axis {
            None => (Matrix3::zeros(), Matrix3::identity() * -radius_m),
            Some(axis) => {
                let [by_axis, by_normal] = Rim::new(axis, &normal).lowest_by(radius_m);
                (by_axis * -skew(axis), by_normal)
            }
        };
        // The centre moves with the body, and so does the normal on which the lever depends.
        let point_by_position = Matrix3::identity() + by_normal * curvature;
        let point_by_rotation = point_by_position * center_by_rotation + by_rotation;
        if self.is_distance {
            let by_center = (arm - self.fixed).transpose() * curvature;
            return ContactPointByPose {
                point_by_position,
                point_by_rotation,
                gap_by_position: normal.transpose() * point_by_position + by_center,
                gap_by_rotation: normal.transpose() * point_by_rotation
                    + by_center * center_by_rotation,
                normal_by_position: curvature,
                normal_by_rotation: curvature * center_by_rotation,
            };
        }
        ContactPointByPose {
            point_by_position,
            point_by_rotation,
            gap_by_position: surface.gradient.transpose() * point_by_position,
            gap_by_rotation: surface.gradient.transpose() * point_by_rotation,
            normal_by_position: surface.curvature * point_by_position,
            normal_by_rotation: surface.curvature * point_by_rotation,
        }
    }
}

/// Disc with an axis, above a surface with a normal.
struct Rim<'a> {
    axis: &'a Vector3<f64>,
    normal: &'a Vector3<f64>,
    /// Component of the normal along the axis.
    along: f64,
    /// Component of the normal in the plane of the disc.
    down: Vector3<f64>,
    /// Length of `down`.
    sine: f64,
}

impl<'a> Rim<'a> {
    fn new(axis: &'a Vector3<f64>, normal: &'a Vector3<f64>) -> Self {
        let along = axis.dot(normal);
        let down = normal - axis * along;
        let sine = (1.0 - along * along).max(LEAST_SINE * LEAST_SINE).sqrt();
        Self { axis, normal, along, down, sine }
    }

    /// Vector from the centre of the disc to its lowest point, −r (n − a (a·n)) / √(1 − (a·n)²).
    fn lowest(&self, radius_m: f64) -> Vector3<f64> {
        self.down * (-radius_m / self.sine)
    }

    /// Derivatives of the lowest point with respect to axis and normal.
    fn lowest_by(&self, radius_m: f64) -> [Matrix3<f64>; 2] {
        let &Self { axis, normal, along, down, sine } = self;
        let (of_down, of_sine) = (-radius_m / sine, -radius_m * along / sine.powi(3));
        let by_axis = (Matrix3::identity() * along + axis * normal.transpose()) * -of_down
            + down * normal.transpose() * of_sine;
        let by_normal = (Matrix3::identity() - axis * axis.transpose()) * of_down
            + down * axis.transpose() * of_sine;
        [by_axis, by_normal]
    }
}

/// Unit vector along the projection of a blade's axis onto the plane perpendicular to a normal, with derivatives with respect
/// to axis and normal.
pub(super) fn across(
    axis: &Vector3<f64>,
    normal: &Vector3<f64>,
) -> (Vector3<f64>, Matrix3<f64>, Matrix3<f64>) {
    let along = axis.dot(normal);
    let flat = axis - normal * along;
    let length = flat.norm().max(LEAST_SINE);
    let unit = flat / length;
    let project = (Matrix3::identity() - unit * unit.transpose()) / length;
    let by_axis = project * (Matrix3::identity() - normal * normal.transpose());
    let by_normal = -(project * (Matrix3::identity() * along + normal * axis.transpose()));
    (unit, by_axis, by_normal)
}
