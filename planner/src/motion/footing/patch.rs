//! Parts of a terrain on which feet may stand.

use nalgebra::Vector2;
use rollwalk_multibody::ground::ElevationMap;

/// Part of a terrain on which a foot may stand.
#[derive(Clone, Debug, PartialEq)]
pub struct Patch {
    /// Ground of the patch: the plane of a tread, or a smoothed elevation map.
    pub plane: ElevationMap,
    /// Borders, at the margin from the edges.
    pub borders: Vec<Border>,
}

/// Border of a patch: contact points e satisfy n·e ≤ d.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Border {
    /// Unit normal n, out of the patch.
    pub outward: Vector2<f64>,
    /// Distance d of the border from the origin along its normal, m.
    pub at_m: f64,
}

impl Patch {
    /// Returns the point of the patch that is nearest to a point.
    pub fn nearest(&self, point: &Vector2<f64>) -> Vector2<f64> {
        let over =
            |border: &Border| border.outward * (border.outward.dot(point) - border.at_m).max(0.0);
        point - self.borders.iter().map(over).sum::<Vector2<f64>>()
    }
}
