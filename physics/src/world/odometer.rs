//! Way of a robot through its world, what it cost, and whether the robot fell.
//!
//! Both what plays plans without a bus and what plays them behind firmware and bus measure with it, so that their numbers
//! can be compared.

use crate::World;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::Ground;
use serde::Serialize;
use std::f64::consts::PI;
use std::sync::Arc;

/// Tilt against the start beyond which a robot has fallen, rad.
const FALLEN_RAD: f64 = 1.0;
/// Distance of the centre of mass from the ground beneath which a robot has fallen, as a share of that at the start.
const FALLEN_HEIGHT: f64 = 0.4;

/// Steepest ground that a robot begins on: the vertical part of its normal.
const STEEPEST: f64 = 0.5;

/// Normal of the ground at the origin, where robots begin. Beside a wall the ground is level.
pub fn normal_at_start(ground: &dyn Ground) -> Vector3<f64> {
    let normal = ground.at(&Vector3::zeros()).normal;
    if normal.z > STEEPEST { normal } else { Vector3::z() }
}

/// Rotation from world axes to those in which distances along the ground are measured; their z axis is its [`normal_at_start`].
pub fn ground_from_world(ground: &dyn Ground) -> Rotation3<f64> {
    let rotation = Rotation3::rotation_between(&normal_at_start(ground), &Vector3::z());
    rotation.expect("ground faces up")
}

/// Way of the centre of mass ahead and to the left, as the robot faced at the beginning, m, and turn about the vertical, rad;
/// whole turns count.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Way {
    /// m.
    pub forward_m: f64,
    /// m.
    pub left_m: f64,
    /// rad.
    pub turn_rad: f64,
}

impl Way {
    /// Values in the order of the fields.
    pub fn values(&self) -> [f64; 3] {
        [self.forward_m, self.left_m, self.turn_rad]
    }
}

impl From<[f64; 3]> for Way {
    fn from([forward_m, left_m, turn_rad]: [f64; 3]) -> Self {
        Self { forward_m, left_m, turn_rad }
    }
}

/// Totals along the way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Totals {
    /// Greatest angle between the body's z axis and that of the axes in which the way is measured, rad.
    pub tilt_max_rad: f64,
    /// Way that end effectors in contact slid, m, all together.
    pub slid_m: f64,
    /// Greatest force of the ground on one end effector, N.
    pub force_max_n: f64,
    /// Mechanical work of the motors, J; braking counts as negative.
    pub work_j: f64,
}

/// Measures the way of a robot, step by step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometer {
    /// Rotation from world axes to those in which the way is measured, with z out of the ground.
    ground_from_world: Rotation3<f64>,
    start_com: Vector3<f64>,
    start_heading_rad: f64,
    com: Vector3<f64>,
    heading_rad: f64,
    turn_rad: f64,
    totals: Totals,
}

impl Odometer {
    /// Begins where the world is. The way is measured in axes whose z axis is the normal of the ground, and not
    /// along world axes, where `ground_from_world` turns.
    pub fn new(world: &World, ground_from_world: Rotation3<f64>) -> Self {
        let com = ground_from_world * world.com().0;
        let heading_rad = heading_rad(&(ground_from_world.matrix() * world.base().1));
        Self {
            ground_from_world,
            start_com: com,
            start_heading_rad: heading_rad,
            com,
            heading_rad,
            turn_rad: 0.0,
            totals: Totals::default(),
        }
    }

    /// Takes in a step that ended now.
    pub fn add(&mut self, world: &World, step_s: f64) {
        let rotation = self.ground_from_world.matrix() * world.base().1;
        self.com = self.ground_from_world * world.com().0;
        let heading_rad = heading_rad(&rotation);
        self.turn_rad += wrapped(heading_rad - self.heading_rad);
        self.heading_rad = heading_rad;
        let totals = &mut self.totals;
        let tilt_rad = rotation[(2, 2)].clamp(-1.0, 1.0).acos();
        totals.tilt_max_rad = totals.tilt_max_rad.max(tilt_rad);
        for touch in world.touches() {
            if touch.normal_n > 0.0 && touch.slips {
                totals.slid_m += step_s * touch.sliding.norm();
            }
            totals.force_max_n = totals.force_max_n.max(touch.force.norm());
        }
        let power_w = world.shafts().map(|[_, speed_rad_s, torque_nm]| speed_rad_s * torque_nm);
        totals.work_j += step_s * power_w.sum::<f64>();
    }

    /// Way since the beginning, or since [`begin_again`](Self::begin_again).
    pub fn way(&self) -> Way {
        let (sine, cosine) = self.start_heading_rad.sin_cos();
        let moved = self.com - self.start_com;
        Way {
            forward_m: cosine * moved.x + sine * moved.y,
            left_m: cosine * moved.y - sine * moved.x,
            turn_rad: self.turn_rad,
        }
    }

    /// Begins a new way here. The totals go on.
    pub fn begin_again(&mut self) {
        (self.start_com, self.start_heading_rad, self.turn_rad) = (self.com, self.heading_rad, 0.0);
    }

    /// Totals since the beginning.
    pub fn totals(&self) -> Totals {
        self.totals
    }
}

/// A fall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fall {
    /// Tilt against the start, rad.
    pub tilt_rad: f64,
    /// Distance of the centre of mass from the ground, m.
    pub height_m: f64,
}

impl Fall {
    /// True if the robot has tilted, not only sunk down.
    pub fn is_toppled(&self) -> bool {
        self.tilt_rad > FALLEN_RAD
    }
}

/// Sees whether a robot has fallen.
#[derive(Clone, Debug)]
pub struct FallWatch {
    ground: Arc<dyn Ground>,
    /// Out of the ground at the origin.
    up: Vector3<f64>,
    /// The same in axes of the body at the start: not every robot begins level, and one that turns leans elsewhere.
    start_up_in_body: Vector3<f64>,
    /// Distance of the centre of mass from the ground at the start, m: not of the body's origin, which may lie anywhere.
    standing_m: f64,
}

impl FallWatch {
    /// Creates a watch of a robot that stands at present.
    pub fn new(world: &World, ground: &Arc<dyn Ground>) -> Self {
        let up = normal_at_start(ground.as_ref());
        Self {
            ground: Arc::clone(ground),
            up,
            start_up_in_body: world.base().1.transpose() * up,
            standing_m: ground.at(&world.com().0).gap_m,
        }
    }

    /// The fall of a robot that has tilted by more than 1 rad, or whose centre of mass is nearer to the ground than 0.4 of what
    /// it was.
    pub fn look(&self, world: &World) -> Option<Fall> {
        let (_, rotation) = world.base();
        let cosine = (rotation.transpose() * self.up).dot(&self.start_up_in_body);
        let tilt_rad = cosine.clamp(-1.0, 1.0).acos();
        let height_m = self.ground.at(&world.com().0).gap_m;
        let is_high = height_m >= FALLEN_HEIGHT * self.standing_m;
        // What is no number is no robot on its feet.
        let fallen = tilt_rad > FALLEN_RAD || !is_high || tilt_rad.is_nan();
        fallen.then_some(Fall { tilt_rad, height_m })
    }
}

/// Direction of the body's x axis about the z axis, rad.
pub fn heading_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(1, 0)].atan2(world_from_body[(0, 0)])
}

/// An angle between −π and π that differs by whole turns.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(2.0 * PI) - PI
}
