//! Odometer of a simulated robot: distance, cost and falls.
//!
//! Simulations without a bus and simulations behind firmware and bus use the same odometer, so that their results can be
//! compared.

use crate::World;
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_multibody::ground::{Ground, floor_of};
use serde::Serialize;
use std::f64::consts::PI;
use std::sync::Arc;

/// Tilt from the starting attitude above which a robot has fallen, rad.
const FALLEN_RAD: f64 = 1.0;
/// Height of the centre of mass below which a robot has fallen, as a fraction of its starting height.
const FALLEN_HEIGHT: f64 = 0.4;
/// Mean part of the weight on body and upper limbs above which a robot has fallen. A robot that lies on its trunk leaves at most
/// half of its weight to its wheels. A knee or belly that touches down leaves nearly all of it to the feet.
const FALLEN_SHARE: f64 = 0.25;
/// Time constant of the mean for [`FALLEN_SHARE`], s. The impact of a knee takes some hundredths of a second, so that even a
/// hard impact is no fall.
const SHARE_S: f64 = 0.5;
/// Largest tilt from the starting attitude of a robot that lies on purpose, rad. Motions lay the body down level.
const LEVEL_RAD: f64 = 0.35;
/// Largest height above the ground of a body that lies at the start, as a fraction of the height of the centre of mass.
const ON_BODY_HEIGHT: f64 = 0.02;

/// Smallest vertical component of the ground normal at a robot's start.
const STEEPEST: f64 = 0.5;

/// Normal of the ground at the origin, where robots start. Beside a wall, the vertical.
pub fn normal_at_start(ground: &dyn Ground) -> Vector3<f64> {
    let normal = ground.at(&Vector3::zeros()).normal;
    if normal.z > STEEPEST { normal } else { Vector3::z() }
}

/// Rotation from world axes to the axes of distance measurements. Their z axis is the [`normal_at_start`].
pub fn ground_from_world(ground: &dyn Ground) -> Rotation3<f64> {
    let rotation = Rotation3::rotation_between(&normal_at_start(ground), &Vector3::z());
    rotation.expect("ground faces up")
}

/// Displacement of the centre of mass in the starting heading, and turn about the vertical. The turn includes whole turns.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct NetDisplacement {
    /// Displacement forward, m.
    pub forward_m: f64,
    /// Displacement to the left, m.
    pub left_m: f64,
    /// Turn, rad.
    pub turn_rad: f64,
}

impl NetDisplacement {
    /// Returns the values in the order of the fields.
    pub fn values(&self) -> [f64; 3] {
        [self.forward_m, self.left_m, self.turn_rad]
    }

    /// Sum of this displacement and the one that follows it, in the starting heading of this one.
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        let (sine, cosine) = self.turn_rad.sin_cos();
        Self {
            forward_m: self.forward_m + cosine * next.forward_m - sine * next.left_m,
            left_m: self.left_m + sine * next.forward_m + cosine * next.left_m,
            turn_rad: self.turn_rad + next.turn_rad,
        }
    }
}

impl From<[f64; 3]> for NetDisplacement {
    fn from([forward_m, left_m, turn_rad]: [f64; 3]) -> Self {
        Self { forward_m, left_m, turn_rad }
    }
}

/// Totals since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Totals {
    /// Largest angle between the body's z axis and the z axis of the measurement, rad.
    pub tilt_max_rad: f64,
    /// Sliding distance of the end effectors in contact, summed, m.
    pub slid_m: f64,
    /// Largest force of the ground on one end effector, N.
    pub force_max_n: f64,
    /// Mechanical work of the motors, J; braking counts as negative.
    pub work_j: f64,
}

/// Measures the distance that a robot covers, step by step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Odometer {
    /// Rotation from world axes to the axes of the measurement, whose z axis is the ground normal.
    ground_from_world: Rotation3<f64>,
    start_com: Vector3<f64>,
    start_heading_rad: f64,
    com: Vector3<f64>,
    heading_rad: f64,
    turn_rad: f64,
    totals: Totals,
}

impl Odometer {
    /// Starts a measurement at the present pose. `ground_from_world` rotates to the axes of the measurement, whose z axis
    /// should be the ground normal.
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

    /// Adds a step that ended now.
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

    /// Displacement since the start, or since [`begin_again`](Self::begin_again).
    pub fn displacement(&self) -> NetDisplacement {
        let (sine, cosine) = self.start_heading_rad.sin_cos();
        let moved = self.com - self.start_com;
        NetDisplacement {
            forward_m: cosine * moved.x + sine * moved.y,
            left_m: cosine * moved.y - sine * moved.x,
            turn_rad: self.turn_rad,
        }
    }

    /// Starts a new displacement at the present pose. The totals continue.
    pub fn begin_again(&mut self) {
        (self.start_com, self.start_heading_rad, self.turn_rad) = (self.com, self.heading_rad, 0.0);
    }

    /// Totals since the start.
    pub fn totals(&self) -> Totals {
        self.totals
    }
}

/// State of a fallen robot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fall {
    /// Tilt from the starting attitude, rad.
    pub tilt_rad: f64,
    /// Distance of the centre of mass above the ground, m.
    pub height_m: f64,
}

impl Fall {
    /// Returns true if the robot has tilted over, and not merely collapsed.
    pub fn is_toppled(&self) -> bool {
        self.tilt_rad > FALLEN_RAD
    }
}

/// Detects falls of a robot.
#[derive(Clone, Debug)]
pub struct FallWatch {
    ground: Arc<dyn Ground>,
    /// Normal of the ground at the origin.
    up: Vector3<f64>,
    /// Ground normal in body axes at the start. Robots may start tilted, and then lean in another direction after a turn.
    start_up_in_body: Vector3<f64>,
    /// Height of the centre of mass of the standing robot above the ground, m; 0 if the motion lays the robot on its body.
    upright_m: f64,
    /// Height at which the robot began, at most `upright_m`, m.
    begin_m: f64,
    /// Height that counts as standing at present, from `begin_m` to `upright_m`, m.
    standing_m: f64,
    /// True if the robot began on its body.
    began_on_body: bool,
    /// True if a level body may carry weight at present.
    may_lie: bool,
    /// Mean part of the weight on body and upper limbs.
    share_on_body: f64,
    /// Time of the latest check, s.
    checked_s: f64,
}

impl FallWatch {
    /// Creates the detector for a robot that stands at present.
    pub fn new(world: &World, ground: &Arc<dyn Ground>) -> Self {
        // A bar above the robot is not the ground below it.
        let ground = floor_of(ground);
        let up = normal_at_start(ground.as_ref());
        let upright_m = if world.lies { 0.0 } else { ground.at(&world.com().0).gap_m };
        let began_on_body = is_on_body(world, upright_m);
        Self {
            up,
            start_up_in_body: world.base().1.transpose() * up,
            upright_m,
            begin_m: upright_m,
            standing_m: upright_m,
            began_on_body,
            may_lie: began_on_body,
            share_on_body: 0.0,
            checked_s: world.system().time_s(),
            ground,
        }
    }

    /// Counts the present height as standing if it is lower, for a robot that begins on its body.
    pub fn begin_at(&mut self, world: &World) {
        self.begin_m = self.upright_m.min(self.height_m(world));
        self.standing_m = self.begin_m;
        self.began_on_body = is_on_body(world, self.upright_m);
        self.may_lie = self.began_on_body;
        (self.share_on_body, self.checked_s) = (0.0, world.system().time_s());
    }

    /// Counts the present height as standing if it is higher, for a robot that has risen from its body. A body that carries
    /// weight has fallen, unless the robot began on its body.
    pub fn rise_to(&mut self, world: &World) {
        self.standing_m = self.standing_m.max(self.upright_m.min(self.height_m(world)));
        self.may_lie = self.began_on_body;
    }

    /// Counts the height at which the robot began as standing again, for a robot that may lie down.
    pub fn allow_lying(&mut self) {
        self.standing_m = self.begin_m;
        self.may_lie = true;
    }

    /// Height of the centre of mass above the ground, m.
    pub fn height_m(&self, world: &World) -> f64 {
        self.ground.at(&world.com().0).gap_m
    }

    /// Returns the fall of a robot with a tilt above 1 rad, its centre of mass below 0.4 of its starting height, or a quarter of
    /// its weight on the body. If the motion lays the robot on its body, only the tilt counts.
    ///
    /// The weight on the body is averaged over time, so that each step should be checked.
    pub fn check(&mut self, world: &World) -> Option<Fall> {
        let (_, rotation) = world.base();
        let cosine = (rotation.transpose() * self.up).dot(&self.start_up_in_body);
        let tilt_rad = cosine.clamp(-1.0, 1.0).acos();
        let height_m = self.height_m(world);
        let is_high = height_m >= FALLEN_HEIGHT * self.standing_m;
        self.weigh(world);
        let may_lie = world.lies || self.may_lie && tilt_rad < LEVEL_RAD;
        let is_down = self.share_on_body > FALLEN_SHARE && !may_lie;
        // A robot with NaN in its pose is not on its feet.
        let fallen = tilt_rad > FALLEN_RAD || !is_high || is_down || tilt_rad.is_nan();
        fallen.then_some(Fall { tilt_rad, height_m })
    }

    /// Updates the mean part of the weight on the body since the latest check. An impact counts as at most the weight.
    fn weigh(&mut self, world: &World) {
        let now_s = world.system().time_s();
        let part = ((now_s - self.checked_s) / SHARE_S).clamp(0.0, 1.0);
        let share = world.weight_share_on_body(&self.up).clamp(0.0, 1.0);
        self.share_on_body += part * (share - self.share_on_body);
        self.checked_s = now_s;
    }
}

/// Returns true for a robot whose body is on the ground.
fn is_on_body(world: &World, upright_m: f64) -> bool {
    world.body_clearance_m().is_some_and(|of| of < ON_BODY_HEIGHT * upright_m)
}

/// Heading of the body's x axis about the z axis, rad.
pub fn heading_rad(world_from_body: &Matrix3<f64>) -> f64 {
    world_from_body[(1, 0)].atan2(world_from_body[(0, 0)])
}

/// Equivalent angle between −π and π.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(2.0 * PI) - PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::world::{Parameters, RobotState};
    use rollwalk_multibody::ground::Plane;
    use rollwalk_robot::Robot;

    #[test]
    fn a_robot_that_has_risen_and_collapses_has_fallen() {
        let text = include_str!("../../../shipped/robots/agilebot.toml");
        let robot = Robot::from_toml("agilebot.toml", text).unwrap();
        let ground: Arc<dyn Ground> = Arc::new(Plane::rising(0.0));
        let parameters = Parameters::new(&robot);
        let standing = World::standing(&robot, &ground, &parameters);
        let height_m = FallWatch::new(&standing, &ground).height_m(&standing);
        let at = |share: f64| {
            let up_m = standing.base().0.z + (share - 1.0) * height_m;
            let state = RobotState::nominal(&robot, Vector3::new(0.0, 0.0, up_m));
            World::new(&robot, &ground, &parameters, &state)
        };
        let mut watch = FallWatch::new(&standing, &ground);
        assert!(watch.check(&at(0.3)).is_some());
        watch.begin_at(&at(0.3));
        assert_eq!(watch.check(&at(0.3)), None);
        // A jump does not count as standing.
        watch.rise_to(&at(1.8));
        assert!(watch.check(&at(0.3)).is_some());
        assert_eq!(watch.check(&at(0.5)), None);
        watch.allow_lying();
        assert_eq!(watch.check(&at(0.3)), None);
        watch.begin_at(&at(1.0));
        assert!(watch.check(&at(0.3)).is_some());
    }

    /// Drops a car on its body, because its wheels are above its bottom.
    #[test]
    fn a_body_that_carries_the_weight_for_long_has_fallen() {
        let text = include_str!("../../../shipped/robots/car.toml");
        let mut robot = Robot::from_toml("car.toml", text).unwrap();
        for wheel in &mut robot.end_effectors {
            wheel.center_in_link_m.z = 0.05;
        }
        let ground: Arc<dyn Ground> = Arc::new(Plane::rising(0.0));
        let fell_at_s = |drop_m: f64, may_lie: bool| {
            let state = RobotState::nominal(&robot, Vector3::new(0.0, 0.0, 0.03 + drop_m));
            let mut world = World::new(&robot, &ground, &Parameters::new(&robot), &state);
            let mut watch = FallWatch::new(&world, &ground);
            if may_lie {
                watch.allow_lying();
            }
            (0..240).find_map(|_| {
                world.step(1.0 / 240.0).unwrap();
                watch.check(&world).map(|_| world.system().time_s())
            })
        };
        // The car falls for 0.045 s. Its whole weight makes a mean of a quarter 0.144 s later.
        let at_s = fell_at_s(0.01, false);
        assert!(at_s.is_some_and(|at_s| (0.18..0.3).contains(&at_s)), "{at_s:?}");
        assert_eq!(fell_at_s(0.01, true), None);
        // A robot that begins on its body may lie there.
        assert_eq!(fell_at_s(0.0, false), None);
    }

    #[test]
    fn a_robot_beside_a_wall_does_not_begin_on_its_body() {
        let text = include_str!("../../../shipped/robots/car.toml");
        let robot = Robot::from_toml("car.toml", text).unwrap();
        let state = RobotState::nominal(&robot, Vector3::new(-1.0, 0.0, 0.3));
        for (angle_rad, clearance_is_known) in [(0.5, true), (1.5, false)] {
            let ground: Arc<dyn Ground> = Arc::new(Plane::rising(angle_rad));
            let world = World::new(&robot, &ground, &Parameters::new(&robot), &state);
            assert_eq!(world.body_clearance_m().is_some(), clearance_is_known);
            assert!(!FallWatch::new(&world, &ground).began_on_body, "{angle_rad}");
        }
    }
}
