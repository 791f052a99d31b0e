//! Travel of the robot during each clip, and while it follows set-points of its host.

use crate::clock::SimTime;
use nalgebra::Rotation3;
use rollwalk_physics::World;
use rollwalk_physics::world::{NetDisplacement, Odometer, Totals};
use rollwalk_protocol::library::ClipId;

/// Motion of a robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moving {
    /// The controller plays a clip of its library.
    Clip(ClipId),
    /// The robot follows set-points of its host: steered, or in closed loop.
    Setpoints,
}

/// Travel of the robot along the ground during a motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// Motion that was executed.
    pub motion: Moving,
    /// Start time.
    pub from: SimTime,
    /// End time.
    pub to: SimTime,
    odometer: Odometer,
}

impl Travel {
    /// Begins a travel at the present position of the robot.
    pub(super) fn begin(
        motion: Moving,
        now: SimTime,
        world: &World,
        ground_from_world: Rotation3<f64>,
    ) -> Self {
        let odometer = Odometer::new(world, ground_from_world);
        Self { motion, from: now, to: now, odometer }
    }

    /// Clip that was played; `None` if the robot followed set-points of its host.
    pub fn clip(&self) -> Option<ClipId> {
        match self.motion {
            Moving::Clip(clip) => Some(clip),
            Moving::Setpoints => None,
        }
    }

    /// Adds a step of the world that ended at `now`.
    pub(super) fn add(&mut self, now: SimTime, step_s: f64, world: &World) {
        self.to = now;
        self.odometer.add(world, step_s);
    }

    /// Net displacement along the ground.
    pub fn displacement(&self) -> NetDisplacement {
        self.odometer.displacement()
    }

    /// Tilt, slip, forces and work.
    pub fn totals(&self) -> Totals {
        self.odometer.totals()
    }

    /// Duration, s.
    pub fn duration_s(&self) -> f64 {
        (self.to - self.from).as_s()
    }
}
