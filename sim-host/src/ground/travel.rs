//! What became of each clip in the world: way, turn, tilt, slip, work.

use crate::clock::SimTime;
use nalgebra::{Matrix3, Vector3};
use rollwalk_physics::World;
use rollwalk_protocol::library::ClipId;

/// Way of the body while a clip was played on the ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Travel {
    /// The clip.
    pub clip: ClipId,
    /// First instant.
    pub from: SimTime,
    /// Last instant.
    pub to: SimTime,
    start: Vector3<f64>,
    end: Vector3<f64>,
    start_heading_rad: f64,
    /// Turn about the vertical, rad; whole turns count.
    pub turn_rad: f64,
    /// Greatest angle between the body's z axis and the vertical, rad.
    pub tilt_max_rad: f64,
    /// Way that feet and wheels in contact slid, m, all together.
    pub slid_m: f64,
    /// Greatest force of the ground on one foot or wheel, N.
    pub force_max_n: f64,
    /// Mechanical work of the motors, J; braking counts as negative.
    pub work_j: f64,
}

impl Travel {
    /// Begins where the world is.
    pub(super) fn begin(clip: ClipId, now: SimTime, world: &World) -> Self {
        let (start, rotation) = world.base();
        Self {
            clip,
            from: now,
            to: now,
            start,
            end: start,
            start_heading_rad: heading_rad(&rotation),
            turn_rad: 0.0,
            tilt_max_rad: 0.0,
            slid_m: 0.0,
            force_max_n: 0.0,
            work_j: 0.0,
        }
    }

    /// Takes in a step of the world that ended now.
    pub(super) fn add(
        &mut self,
        now: SimTime,
        step_s: f64,
        world: &World,
        channels: usize,
        end_effectors: usize,
    ) {
        let (origin, rotation) = world.base();
        self.to = now;
        self.end = origin;
        let turned = heading_rad(&rotation) - self.start_heading_rad - self.turn_rad;
        self.turn_rad += super::wrapped(turned);
        self.tilt_max_rad = self.tilt_max_rad.max(tilt_rad(&rotation));
        for touch in (0..end_effectors).map(|number| world.touch(number)) {
            if touch.normal_n > 0.0 && touch.slips {
                self.slid_m += step_s * touch.sliding.norm();
            }
            self.force_max_n = self.force_max_n.max(touch.force.norm());
        }
        for [_, speed_rad_s, torque_nm] in (0..channels).map(|channel| world.shaft(channel)) {
            self.work_j += step_s * speed_rad_s * torque_nm;
        }
    }

    /// Way, m: ahead and to the left as the robot faced at the start, and up.
    pub fn way_m(&self) -> Vector3<f64> {
        super::about_vertical(-self.start_heading_rad) * (self.end - self.start)
    }

    /// Its length in time, s.
    pub fn duration_s(&self) -> f64 {
        (self.to - self.from).as_s()
    }
}

/// Direction in which the body's x axis points about the vertical, rad.
pub(super) fn heading_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(1, 0)].atan2(world_from_body[(0, 0)])
}

/// Angle between the body's z axis and the vertical, rad.
pub(super) fn tilt_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(2, 2)].clamp(-1.0, 1.0).acos()
}
