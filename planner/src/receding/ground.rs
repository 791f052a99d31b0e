//! Ground of horizons: level, a terrain, or a sensed map.

use crate::motion::{ContactMargins, Footing, Motion};
use rollwalk_multibody::ground::{ElevationGrid, Terrain};
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
    /// Sensed elevation map with four cells or more along each axis.
    Map(Arc<ElevationGrid>),
}

impl HorizonGround {
    /// Ground for the footfalls of a gait.
    pub(super) fn footing(&self, robot: &Robot, gait: &Motion) -> Footing {
        let margins = ContactMargins::of(robot);
        let never_lifts =
            |j: usize| gait.stance.iter().all(|flags| flags[j]) && !gait.held_wheels[j];
        let rolls: Vec<bool> = (0..robot.end_effectors.len()).map(never_lifts).collect();
        match self {
            Self::Level => Footing::default(),
            Self::Terrain(terrain) => {
                let bare = Terrain { obstacles: Vec::new(), ..terrain.clone() };
                Footing::on(bare, &margins, robot, &rolls)
            }
            Self::Map(grid) => Footing::mapped(grid, &margins, robot, &rolls)
                .expect("a grid of four cells or more"),
        }
    }
}
