//! Extents of robot and obstacles along and across the straight path to a goal.

use crate::motion::Footing;
use nalgebra::{DVector, Rotation2, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, Model};
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::parts::parts;

/// Fraction of the standing robot's height above which an obstacle is ducked under.
pub(crate) const DUCK: f64 = 0.5;

/// Extent of the robot or an obstacle along and across a path, m.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Extent {
    pub along_m: [f64; 2],
    /// Right and left end.
    pub across_m: [f64; 2],
    pub height_m: [f64; 2],
}

impl Extent {
    /// Extent of points with a radius around them, in axes whose x axis points along the path.
    fn of(
        points: impl Iterator<Item = (Vector3<f64>, f64)>,
        path_from_world: &Rotation2<f64>,
    ) -> Self {
        const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];
        let mut found = Self { along_m: EMPTY, across_m: EMPTY, height_m: EMPTY };
        for (point, radius_m) in points {
            let seen = path_from_world * point.xy();
            let ranges = [&mut found.along_m, &mut found.across_m, &mut found.height_m];
            for (range, at) in ranges.into_iter().zip([seen.x, seen.y, point.z]) {
                *range = [range[0].min(at - radius_m), range[1].max(at + radius_m)];
            }
        }
        found
    }

    /// Extent of a standing robot about its base.
    pub fn of_robot(model: &Model, q: &DVector<f64>, path_from_world: &Rotation2<f64>) -> Self {
        let pose = model.pose_values(q);
        let base = Vector3::new(q[BASE_POSITION], q[BASE_POSITION + 1], 0.0);
        let parts = parts(model.robot());
        let points = parts.iter().flat_map(|part| part.placed(&pose.frames).corners());
        Self::of(points.map(|(point, radius_m)| (point - base, radius_m)), path_from_world)
    }

    /// Extent of an obstacle with its margin. Heights are above the ground below it.
    pub fn of_obstacle(
        obstacle: &Obstacle,
        ground: &Footing,
        path_from_world: &Rotation2<f64>,
    ) -> Self {
        let (corners, radius_m) = obstacle.shape.corners();
        let middle = corners.iter().sum::<Vector3<f64>>() / corners.len() as f64;
        let ground_m = ground.body().at(&middle).height_m;
        let corners = corners.into_iter().map(|corner| (corner, radius_m + obstacle.margin_m));
        let found = Self::of(corners, path_from_world);
        Self { height_m: found.height_m.map(|height_m| height_m - ground_m), ..found }
    }

    /// Extent enlarged by that of the robot, so that the robot counts as a point at its base.
    #[must_use]
    pub fn seen_by(&self, body: &Self) -> Self {
        let Self { along_m, across_m, height_m } = *self;
        Self {
            along_m: [along_m[0] - body.along_m[1], along_m[1] - body.along_m[0]],
            across_m: [across_m[0] - body.across_m[1], across_m[1] - body.across_m[0]],
            height_m,
        }
    }

    /// Returns true if an obstacle, enlarged by the robot, is on the straight path to the goal.
    pub fn is_in_path(&self, length_m: f64) -> bool {
        contains(self.across_m, 0.0) && self.along_m[1] > 0.0 && self.along_m[0] < length_m
    }

    /// Returns true for an obstacle at a height at which a robot goes round it.
    pub fn is_beside(&self, body: &Self) -> bool {
        self.height_m[0] < DUCK * body.height_m[1] && self.height_m[1] > body.height_m[0]
    }
}

pub(crate) fn contains([low, high]: [f64; 2], value: f64) -> bool {
    low < value && value < high
}
