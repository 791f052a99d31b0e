//! Contacts of a robot with obstacles. The world stops points of links at obstacles, such as feet, wheels and the ends of
//! capsules; this check compares their whole shapes.

use super::World;
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::ground::{Ground, GroundWithObstacles};
use rollwalk_multibody::parts::{Part, parts};
use rollwalk_multibody::{Frames, Tree};
use rollwalk_robot::Robot;
use serde::Serialize;
use std::fmt;

/// Contact of a link with an obstacle.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ObstacleContact {
    /// Simulated time, s.
    pub at_s: f64,
    /// Name of the link, or of the link that carries the foot or wheel.
    pub link: String,
    /// Name of the obstacle.
    pub obstacle: String,
}

impl fmt::Display for ObstacleContact {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { at_s, link, obstacle } = self;
        write!(f, "`{link}` touches obstacle `{obstacle}` after {at_s:.2} s")
    }
}

/// Detector of contacts with obstacles.
#[derive(Debug)]
pub struct ObstacleWatch {
    tree: Tree,
    parts: Vec<Part>,
    obstacles: Vec<Obstacle>,
}

impl ObstacleWatch {
    /// Creates a detector; `None` for ground without obstacles.
    pub fn new(robot: &Robot, ground: &dyn Ground) -> Option<Self> {
        let obstacles = GroundWithObstacles::of(ground)?.obstacles().to_vec();
        Some(Self { tree: Tree::new(robot), parts: parts(robot), obstacles })
    }

    /// Returns the contact of the first part of the robot that overlaps an obstacle.
    pub fn check(&self, world: &World) -> Option<ObstacleContact> {
        let state = world.state(&self.tree);
        let frames = Frames::new(&self.tree, &state.configuration());
        self.parts.iter().find_map(|part| {
            let placed = part.placed(&frames);
            let met = self.obstacles.iter().find(|met| met.distance(&placed, 0.0).is_some())?;
            Some(ObstacleContact {
                at_s: world.system().time_s(),
                link: self.tree.robot().links[part.link].name.clone(),
                obstacle: met.name.clone(),
            })
        })
    }
}
