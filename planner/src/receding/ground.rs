//! Ground of horizons: level, a terrain, or a sensed map.

use crate::motion::{ContactMargins, Footing, Motion};
use rollwalk_multibody::ground::{ElevationGrid, FieldError, Terrain};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Ground on which horizons are planned, in world axes.
#[derive(Clone, Debug, Default)]
pub enum HorizonGround {
    /// Plane z = 0.
    #[default]
    Level,
    /// Ground of a terrain file. Horizons ignore its obstacles.
    Terrain(Terrain),
    /// Sensed elevation map. A map without known heights leaves the ground unchanged.
    Map(Arc<ElevationGrid>),
}

impl HorizonGround {
    /// Ground for the footfalls of a gait.
    ///
    /// # Errors
    /// Returns an error if a map is not valid, or if none of its heights is known.
    pub(super) fn footing(&self, robot: &Robot, gait: &Motion) -> Result<Footing, FieldError> {
        let margins = ContactMargins::of(robot);
        let never_lifts =
            |j: usize| gait.stance.iter().all(|flags| flags[j]) && !gait.held_wheels[j];
        let rolls: Vec<bool> = (0..robot.end_effectors.len()).map(never_lifts).collect();
        match self {
            Self::Level => Ok(Footing::default()),
            Self::Terrain(terrain) => {
                let bare = Terrain { obstacles: Vec::new(), ..terrain.clone() };
                Ok(Footing::on(bare, &margins, robot, &rolls))
            }
            Self::Map(grid) => Footing::mapped(grid, &margins, robot, &rolls),
        }
    }
}
