//! Ground at a contact of the timeline.

use crate::motion::Border;
use nalgebra::Vector3;
use rollwalk_multibody::ground::ElevationMap;

/// Ground at a contact.
#[derive(Clone, Debug, Default)]
pub struct ContactGround {
    /// Height of the ground.
    pub map: ElevationMap,
    /// Borders of the patch in stance.
    pub borders: Vec<Border>,
    /// Planned foothold of the stance; `None` in swing, and without patches.
    pub foothold: Option<Vector3<f64>>,
}
