//! Robot on the ground, whose motors act in the simulated world of [`rollwalk_physics`].
//!
//! At the start a hoist holds the body level, at a height at which the feet just touch the ground. A robot that falls, or loses
//! its torque, stays where it lies. After some seconds without torque the hoist picks it up again, as an operator would.

mod hoist;
mod travel;

use crate::clock::{Periodic, SimTime};
use crate::plant::Plant;
use crate::servo::Servo;
use hoist::{Hoist, ReleaseCondition, StillWatch};
use nalgebra::{Rotation3, Vector3};
use rollwalk_drives as drives;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::motor::{Law, torque_speed_line};
use rollwalk_physics::push::{Shove, mean_force};
use rollwalk_physics::world::{
    self, FallWatch, Imu, ImuSample, ObstacleContact, ObstacleWatch, Parameters, ground_from_world,
    heading_rad,
};
use rollwalk_physics::{StepError, World};
use rollwalk_protocol::library::ClipId;
use rollwalk_robot::Robot;
use std::f64::consts::PI;
use std::sync::Arc;

pub use travel::{Moving, Travel};

/// Rate of the steps of the world, Hz.
pub const WORLD_RATE_HZ: u32 = 240;
/// Length of a step, s.
const STEP_S: f64 = 1.0 / WORLD_RATE_HZ as f64;
/// Time without torque after which the hoist picks up a robot, s.
const PICKED_UP_S: f64 = 3.0;
/// Time after which a hoist that is still too low for the pose of the legs releases the robot, s.
const RAISED_S: f64 = 1.0;

/// Fall of the robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fall {
    /// Time at which the fall was detected.
    pub at: SimTime,
    /// Tilt and height of the body.
    pub how: world::Fall,
}

/// Robot in its world, with its hoist.
#[derive(Debug)]
pub struct Grounded {
    world: World,
    steps: Periodic,
    hoist: Option<Hoist>,
    lets_go: ReleaseCondition,
    /// Time at which the release by the hoist became due; `None` if no release is due.
    release_since: Option<SimTime>,
    fall_watch: FallWatch,
    /// Rotation from world axes to the axes in which travel is measured.
    ground_from_world: Rotation3<f64>,
    /// Torque-speed lines in channel order: stall torque, N·m, and no-load speed, rad/s.
    lines: Vec<(f64, f64)>,
    falls: Vec<Fall>,
    /// Detector of contacts with obstacles; `None` without obstacles.
    obstacle_watch: Option<ObstacleWatch>,
    /// First contact with an obstacle during each motion.
    contacts: Vec<ObstacleContact>,
    /// True if the robot has touched an obstacle during the current motion.
    has_touched: bool,
    /// True if the robot has fallen since the hoist released it.
    has_fallen: bool,
    /// True during motions that may lie on the body: all but loops.
    may_lie: bool,
    /// Latest time at which a motor had torque.
    torque_at: SimTime,
    /// Pushes on the body; times count from the start of the simulation.
    shoves: Vec<Shove>,
    /// Travel during the current motion.
    travel: Option<Travel>,
    /// Displacements during earlier motions that the caller has not fetched yet.
    travels: Vec<Travel>,
    imu: Imu,
    /// Time of the world at the previous sample, s.
    sampled_s: f64,
}

/// Sample of the body's sensors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodySample {
    /// Measurements of the IMU.
    pub imu: ImuSample,
    /// Contacts of the end effectors, one bit each, set on contact.
    pub contacts: u32,
}

impl Grounded {
    /// Creates a robot in its nominal pose in the hoist, which releases it at the first clip.
    pub fn new(robot: &Robot, ground: &Arc<dyn Ground>, shoves: Vec<Shove>) -> Self {
        Self::with(robot, ground, shoves, ReleaseCondition::WhenItPlays)
    }

    /// Creates a robot for a controller in another process, whose clips are not known here. The hoist releases the robot when its
    /// motors stand.
    pub fn of_motors(robot: &Robot, ground: &Arc<dyn Ground>, shoves: Vec<Shove>) -> Self {
        Self::with(robot, ground, shoves, ReleaseCondition::WhenItStands(StillWatch::default()))
    }

    fn with(
        robot: &Robot,
        ground: &Arc<dyn Ground>,
        shoves: Vec<Shove>,
        lets_go: ReleaseCondition,
    ) -> Self {
        let parameters = Parameters::new(robot);
        let world = World::standing(robot, ground, &parameters);
        let lines = robot.channels().map(|channel| torque_speed_line(channel.actuator())).collect();
        let (origin, _) = world.base();
        let fall_watch = FallWatch::new(&world, ground);
        Self {
            world,
            steps: Periodic::new(WORLD_RATE_HZ),
            hoist: Some(Hoist::at(origin, 0.0)),
            lets_go,
            release_since: None,
            fall_watch,
            ground_from_world: ground_from_world(ground.as_ref()),
            lines,
            falls: Vec::new(),
            obstacle_watch: ObstacleWatch::new(robot, ground.as_ref()),
            contacts: Vec::new(),
            has_touched: false,
            has_fallen: false,
            may_lie: true,
            torque_at: SimTime::ZERO,
            shoves,
            travel: None,
            travels: Vec::new(),
            imu: Imu::default(),
            sampled_s: 0.0,
        }
    }

    /// Simulated world.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// List of the falls so far.
    pub fn falls(&self) -> &[Fall] {
        &self.falls
    }

    /// First contact with an obstacle during each motion so far; `None` on ground without obstacles.
    pub fn obstacle_contacts(&self) -> Option<&[ObstacleContact]> {
        self.obstacle_watch.as_ref().map(|_| self.contacts.as_slice())
    }

    /// True if the robot has fallen since the hoist released it.
    pub fn has_fallen(&self) -> bool {
        self.has_fallen
    }

    /// True if the hoist holds the body.
    pub fn is_held(&self) -> bool {
        self.hoist.is_some()
    }

    /// Clip that the robot plays; `None` if it plays none.
    pub fn playing(&self) -> Option<ClipId> {
        self.travel.and_then(|travel| travel.clip())
    }

    /// Direction of up in body axes.
    pub fn up_in_body(&self) -> Vector3<f64> {
        self.world.base().1.transpose() * Vector3::z()
    }

    /// Samples the sensors of the body. `None` if the world has made no step since the previous sample.
    pub fn sample(&mut self) -> Option<BodySample> {
        let now_s = self.world.system().time_s();
        let step_s = now_s - self.sampled_s;
        if step_s <= 0.0 {
            return None;
        }
        self.sampled_s = now_s;
        let imu = self.imu.sample(&self.world, step_s);
        let switches = (0..u32::BITS).zip(self.world.switches());
        let contacts = switches.fold(0, |bits, (bit, is)| bits | u32::from(is) << bit);
        Some(BodySample { imu, contacts })
    }

    /// Lets go of the robot, which stands or lies.
    fn release(&mut self) {
        if self.hoist.take().is_some() {
            self.fall_watch.begin_at(&self.world);
        }
    }

    /// Releases a robot whose release is due, once its feet no longer press on the ground or [`RAISED_S`] have passed.
    fn release_at_height(&mut self, now: SimTime) {
        let is_loaded = self.hoist.as_ref().is_some_and(Hoist::is_loaded);
        let waited = |since: SimTime| (now - since).as_s() > RAISED_S;
        if self.release_since.is_some_and(|since| !is_loaded || waited(since)) {
            self.release();
        }
    }

    /// Removes and returns the travels of all motions that have ended.
    pub fn take_travels(&mut self) -> Vec<Travel> {
        std::mem::take(&mut self.travels)
    }

    /// Sets the motion of the robot. At the first motion the hoist releases the robot, as soon as its feet do not press on the
    /// ground. If `may_lie`, a robot that began on its body may lie down again.
    pub fn on_moving(&mut self, now: SimTime, motion: Option<Moving>, may_lie: bool) {
        match self.lets_go {
            ReleaseCondition::WhenItPlays if motion.is_none() => self.release_since = None,
            ReleaseCondition::WhenItPlays => {
                self.release_since.get_or_insert(now);
                self.release_at_height(now);
            }
            ReleaseCondition::WhenItStands(_) => {}
        }
        self.may_lie = may_lie;
        if may_lie {
            self.fall_watch.allow_lying();
        }
        if self.travel.map(|travel| travel.motion) != motion {
            self.travels.extend(self.travel.take());
            self.has_touched = false;
            self.travel = motion
                .map(|motion| Travel::begin(motion, now, &self.world, self.ground_from_world));
        }
    }

    /// Advances the world to `now`, with each motor under the law of its drive, and updates the plants.
    ///
    /// # Errors
    /// Returns an error if a step has no solution.
    pub fn step(&mut self, now: SimTime, servos: &mut [Servo]) -> Result<(), StepError> {
        while self.steps.next() < now {
            self.steps.advance();
            self.one_step(servos)?;
            if let Some(travel) = &mut self.travel {
                travel.add(now, STEP_S, &self.world);
            }
            self.watch(now, servos);
            self.watch_obstacles();
        }
        Ok(())
    }

    fn one_step(&mut self, servos: &mut [Servo]) -> Result<(), StepError> {
        let laws: Vec<_> = servos.iter().map(Servo::law).collect();
        for (channel, (servo, wanted)) in servos.iter().zip(&laws).enumerate() {
            self.world.set_law(
                channel,
                Law {
                    kp_nm_rad: wanted.kp_nm_rad,
                    kd_nm_s_rad: wanted.kd_nm_s_rad,
                    position_rad: wanted.position_rad,
                    speed_rad_s: wanted.speed_rad_s,
                    torque_nm: wanted.torque_nm,
                    limit_nm: servo.plant.torque_max_nm().min(wanted.torque_limit_nm),
                    line: Some(self.lines[channel]),
                },
            );
        }
        let (_, rotation) = self.world.base();
        let time_s = self.world.system().time_s();
        self.world.push(mean_force(&self.shoves, time_s, STEP_S, heading_rad(&rotation)));
        let clearance_m = self.world.clearance_m();
        if let Some(hoist) = &mut self.hoist {
            hoist.follow_feet(clearance_m, STEP_S, self.release_since.is_some());
        }
        self.world.hold(self.hoist.as_ref().map(Hoist::pose));
        self.world.step(STEP_S)?;
        for (channel, (servo, law)) in servos.iter_mut().zip(&laws).enumerate() {
            self.read(channel, law, &mut servo.plant);
        }
        Ok(())
    }

    /// Reads angle, speed and torque of a motor into its plant. Angles of wheels include whole turns.
    fn read(&self, channel: usize, law: &drives::Law, plant: &mut Plant) {
        let [angle_rad, speed_rad_s, torque_nm] = self.world.shaft(channel);
        plant.position_rad += wrapped(angle_rad - plant.position_rad);
        plant.speed_rad_s = speed_rad_s;
        plant.torque_nm = torque_nm;
        let wanted = law.kp_nm_rad * (law.position_rad - angle_rad)
            + law.kd_nm_s_rad * (law.speed_rad_s - speed_rad_s)
            + law.torque_nm;
        plant.torque_limited = (wanted - torque_nm).abs() > 1e-9 * (1.0 + wanted.abs());
    }

    /// Detects the first contact with an obstacle during a motion.
    fn watch_obstacles(&mut self) {
        if self.has_touched || self.hoist.is_some() {
            return;
        }
        let watch = self.obstacle_watch.as_ref();
        if let Some(contact) = watch.and_then(|watch| watch.check(&self.world)) {
            self.has_touched = true;
            self.contacts.push(contact);
        }
    }

    /// Detects falls, and makes the hoist pick up a robot that has been without torque for a while.
    fn watch(&mut self, now: SimTime, servos: &[Servo]) {
        let has_torque = servos.iter().any(Servo::is_driving);
        if has_torque || self.hoist.is_some() {
            self.torque_at = now;
        }
        if self.hoist.is_some() {
            self.has_fallen = false;
            if let ReleaseCondition::WhenItStands(watch) = &mut self.lets_go
                && watch.stands(now, servos)
            {
                self.release();
            }
            self.release_at_height(now);
            return;
        }
        if !self.may_lie {
            self.fall_watch.rise_to(&self.world);
        }
        let fall = self.fall_watch.check(&self.world).filter(|_| !self.has_fallen);
        // A robot that sinks after torque-off has not fallen, unless it topples.
        let is_up = match self.lets_go {
            ReleaseCondition::WhenItPlays => self.travel.is_some(),
            ReleaseCondition::WhenItStands(_) => has_torque,
        };
        if let Some(how) = fall
            && (is_up || how.is_toppled())
        {
            self.has_fallen = true;
            self.falls.push(Fall { at: now, how });
        }
        if (now - self.torque_at).as_s() > PICKED_UP_S {
            let (origin, rotation) = self.world.base();
            self.hoist = Some(Hoist::at(origin, heading_rad(&rotation)));
        }
    }
}

/// Angle between −π and π that differs from `angle_rad` by whole turns.
fn wrapped(angle_rad: f64) -> f64 {
    (angle_rad + PI).rem_euclid(2.0 * PI) - PI
}
