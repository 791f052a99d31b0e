//! Robot on the ground: bodies, joints, motors and contacts from its description.
//!
//! A spinning wheel is a separate body. Its mass and inertia are subtracted from its link, so that both bodies together match
//! the link of the robot file.

mod build;
mod foot;
mod hinge;
mod imu;
mod obstacles;
mod odometer;
mod parameters;
mod parts;
mod state;

use crate::body::Body;
use crate::contact::GroundContact;
use crate::coupled_motor::CoupledMotor;
use crate::force::Force;
use crate::hold::{Hold, TargetPose};
use crate::motor::{Law, Motor};
use crate::push::Push;
use crate::system::{StepError, StepReport, System};
use crate::touch::Touch;
use build::Build;
use hinge::perpendicular;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::Ground;
use rollwalk_multibody::{State, Tree};
use rollwalk_robot::{Channel, EndEffector, GRAVITY_M_S2, Robot};
use std::ops::Range;
use std::sync::Arc;

pub use imu::{Imu, ImuSample};
pub use obstacles::{ObstacleContact, ObstacleWatch};
pub use odometer::{
    Fall, FallWatch, NetDisplacement, Odometer, Totals, ground_from_world, heading_rad,
    normal_at_start,
};
pub use parameters::Parameters;
pub use state::RobotState;

/// Robot in its world.
#[derive(Debug)]
pub struct World {
    system: System,
    /// Centre of mass of the root link's body, in link axes, m.
    root_center: Vector3<f64>,
    /// Body of each spinning wheel, indexed by end effector.
    wheels: Vec<Option<usize>>,
    /// Force index of the hinge of each joint.
    joints: Vec<usize>,
    /// Force index of each motor, by channel.
    motors: Vec<usize>,
    /// Force indices of the contacts of each end effector. Soft feet and ground with several parts have several contacts.
    contacts: Vec<Range<usize>>,
    /// Force indices of the contacts of link shapes.
    shapes: Range<usize>,
    /// Links with a foot or wheel, without the root link.
    foot_links: Vec<usize>,
    /// True if the robot has contact points on its body, so that it may lie without having fallen.
    lies: bool,
    /// Force index of the hold on the root link.
    hold: usize,
    /// Force index of the push on the root link.
    push: usize,
}

impl World {
    /// Creates a robot at a state, with torque off.
    ///
    /// # Panics
    /// If the state lacks an entry for a joint or end effector of the robot.
    pub fn new(
        robot: &Robot,
        ground: &Arc<dyn Ground>,
        parameters: &Parameters,
        state: &RobotState,
    ) -> Self {
        let mut build = Build::links(robot, parameters, state);
        build.joints(state);
        let wheels = build.wheels(state);
        let contacts = build.contacts(&wheels, ground);
        let shapes = build.shapes(ground);
        let Build { mut assembly, centers, joints, motors, .. } = build;
        let hold = assembly.add(Hold { body: [0], grip: parameters.grip, place: None });
        let push = assembly.add(Push { body: [0], force_n: Vector3::zeros() });
        let system = System::new(parameters.settings, assembly);
        let foot_links = robot.end_effectors.iter().map(|end| end.link).filter(|link| *link > 0);
        let foot_links = foot_links.collect();
        Self {
            system,
            root_center: centers[0],
            wheels,
            joints,
            motors,
            contacts,
            shapes,
            foot_links,
            lies: robot.has_body_points(),
            hold,
            push,
        }
    }

    /// Creates a robot in its nominal pose with its servos on. The feet just touch the ground below the origin.
    pub fn standing(robot: &Robot, ground: &Arc<dyn Ground>, parameters: &Parameters) -> Self {
        let mut state = RobotState::nominal(robot, Vector3::zeros());
        let mut world = Self::new(robot, ground, parameters, &state);
        // Shifts along the vertical, repeatedly because the ground may be uneven.
        for _ in 0..20 {
            state.base_position_m.z -= lowest_m(world.foot_touches()).unwrap_or(0.0);
            world = Self::new(robot, ground, parameters, &state);
        }
        let nominal = robot.transmission().motors(&state.joint_rad);
        let nominal: Vec<_> = robot.of_driven_joints(&nominal).collect();
        for (number, channel) in robot.channels().enumerate() {
            let mut law = Law::servo(channel.actuator());
            if let Channel::Joint(_) = channel {
                law.position_rad = nominal[number];
            }
            world.set_law(number, law);
        }
        world
    }

    /// Advances by `step_s`.
    ///
    /// # Errors
    /// If the step does not converge. The world is then in its state before the step.
    pub fn step(&mut self, step_s: f64) -> Result<StepReport, StepError> {
        self.system.step(step_s)
    }

    /// Holds the root link with its origin at a position, m, and a rotation. `None` releases the root link.
    pub fn hold(&mut self, place: Option<(Vector3<f64>, Matrix3<f64>)>) {
        let place = place.map(|(origin, rotation)| TargetPose {
            position: origin + rotation * self.root_center,
            rotation,
        });
        let hold = self.system.force_mut::<Hold>(self.hold);
        hold.expect("the root link's hold").place = place;
    }

    /// Sets the push on the centre of mass of the root link, in world axes, N.
    pub fn push(&mut self, force_n: Vector3<f64>) {
        let push = self.system.force_mut::<Push>(self.push);
        push.expect("the root link's push").force_n = force_n;
    }

    /// Bodies and forces of the robot.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Bodies and forces of the robot, mutable for changes and for recorded steps.
    pub fn system_mut(&mut self) -> &mut System {
        &mut self.system
    }

    /// Force indices of the motors, by channel.
    pub fn motors(&self) -> &[usize] {
        &self.motors
    }

    /// Force indices of the contacts of an end effector.
    pub fn contacts(&self, end_effector: usize) -> Range<usize> {
        self.contacts[end_effector].clone()
    }

    /// Sets the control law of a channel's motor.
    ///
    /// # Panics
    /// If the robot does not have `channel`.
    pub fn set_law(&mut self, channel: usize, law: Law) {
        let force = self.motors[channel];
        match self.system.force_mut::<CoupledMotor>(force) {
            Some(motor) => motor.law = law,
            None => {
                let motor = self.system.force_mut::<Motor>(force);
                motor.expect("a channel's force is its motor").law = law;
            }
        }
    }

    /// Control law of a channel's motor.
    ///
    /// # Panics
    /// If the robot does not have `channel`.
    pub fn law(&self, channel: usize) -> Law {
        match self.coupled(channel) {
            Some(motor) => motor.law,
            None => self.hinge(self.motors[channel]).law,
        }
    }

    /// Angle, rad, speed, rad/s, and torque, N·m, of a channel's motor. The angle includes whole turns.
    pub fn shaft(&self, channel: usize) -> [f64; 3] {
        if let Some(motor) = self.coupled(channel) {
            let bodies = motor.bodies().iter();
            let now: Vec<_> = bodies.map(|&body| self.system.motions()[body]).collect();
            return [motor.angle(&now), motor.speed(&now), motor.torque(&now).value_nm];
        }
        let motor = self.hinge(self.motors[channel]);
        let now = motor.bodies.map(|body| self.system.motions()[body]);
        [motor.angle(&now), motor.speed(&now), motor.torque(&now).value_nm]
    }

    /// Angle, rad, and speed, rad/s, of a joint. The angle includes whole turns.
    pub fn joint(&self, joint: usize) -> [f64; 2] {
        let hinge = self.hinge(self.joints[joint]);
        let now = hinge.bodies.map(|body| self.system.motions()[body]);
        [hinge.angle(&now), hinge.speed(&now)]
    }

    fn coupled(&self, channel: usize) -> Option<&CoupledMotor> {
        self.system.force(self.motors[channel])
    }

    fn hinge(&self, force: usize) -> &Motor {
        self.system.force(force).expect("the force is a hinge with a motor")
    }

    /// State of an end effector's deepest contact, with the total force on the end effector.
    pub fn touch(&self, end_effector: usize) -> Touch {
        let touches = self.contacts[end_effector].clone();
        let touches = touches.map(|force| self.system.touch(force).expect("it is a contact"));
        let join = |one: Touch, other: Touch| {
            let deepest = if other.gap_m < one.gap_m { other } else { one };
            let force = one.force + other.force;
            Touch { force, normal_n: one.normal_n + other.normal_n, ..deepest }
        };
        touches.reduce(join).expect("every end effector has a contact")
    }

    /// Contact states of all end effectors, in their order.
    pub fn touches(&self) -> impl Iterator<Item = Touch> {
        (0..self.contacts.len()).map(|end_effector| self.touch(end_effector))
    }

    /// Height of the lowest foot, wheel or link above the ground, m; 0 if only walls are near.
    pub fn clearance_m(&self) -> f64 {
        lowest_m(self.foot_touches().chain(self.shape_touches())).unwrap_or(0.0)
    }

    /// Force of the ground on link shapes, N. Nonzero if the robot lies, or if the shape of a lower limb touches the ground.
    pub fn force_on_links(&self) -> Vector3<f64> {
        self.shape_touches().map(|touch| touch.force).sum()
    }

    /// Part of the robot's weight on its body and upper limbs, along the unit vector `up`. Nonzero only if the robot lies on
    /// the ground.
    pub(crate) fn weight_share_on_body(&self, up: &Vector3<f64>) -> f64 {
        let on_body = self.body_touches().map(|touch| touch.force.dot(up)).sum::<f64>();
        let mass_kg: f64 = self.system.bodies().iter().map(Body::mass_kg).sum();
        on_body / (mass_kg * GRAVITY_M_S2)
    }

    /// Height of body and upper limbs above the ground, m; `None` if they have no shapes or only walls are near.
    pub(crate) fn body_clearance_m(&self) -> Option<f64> {
        lowest_m(self.body_touches())
    }

    /// Largest depth of the robot in the ground, m; 0 if it is above the ground.
    pub fn depth_m(&self) -> f64 {
        let touches = self.foot_touches().chain(self.shape_touches());
        touches.map(|touch| -touch.gap_m).fold(0.0, f64::max)
    }

    /// Contact states of the feet on all parts of the ground.
    fn foot_touches(&self) -> impl Iterator<Item = Touch> {
        self.contacts.iter().flat_map(Clone::clone).filter_map(|force| self.system.touch(force))
    }

    fn shape_touches(&self) -> impl Iterator<Item = Touch> {
        self.shapes.clone().filter_map(|force| self.system.touch(force))
    }

    /// Contact states of the shapes of the root link and of links without an end effector. Shapes of the link of a foot or wheel
    /// reach down to the ground in many robot files.
    fn body_touches(&self) -> impl Iterator<Item = Touch> {
        let carries = |force: &usize| {
            let contact = self.system.force::<GroundContact>(*force);
            contact.is_some_and(|of| !self.foot_links.contains(&of.body[0]))
        };
        self.shapes.clone().filter(carries).filter_map(|force| self.system.touch(force))
    }

    /// [`shaft`](Self::shaft) of each channel, in their order.
    pub fn shafts(&self) -> impl Iterator<Item = [f64; 3]> {
        (0..self.motors.len()).map(|channel| self.shaft(channel))
    }

    /// Position of the root link's origin, m, and its rotation to world axes.
    pub fn base(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let body = &self.system.motions()[0];
        (body.position - body.rotation * self.root_center, body.rotation)
    }

    /// Velocity of the origin of the root link, m/s, and its angular velocity, rad/s, in world axes.
    pub fn base_velocity(&self) -> (Vector3<f64>, Vector3<f64>) {
        let base = &self.system.motions()[0];
        (base.point(&-self.root_center).1, base.spin)
    }

    /// State of the robot in the generalised velocities of a tree of the same robot.
    pub fn state(&self, tree: &Tree) -> State {
        let (base_position_m, world_from_body) = self.base();
        let (base_velocity, spin) = self.base_velocity();
        let joints = tree.robot().joints.len();
        let mut velocity: Vec<f64> = base_velocity.iter().chain(spin.iter()).copied().collect();
        velocity.extend((0..joints).map(|joint| self.joint(joint)[1]));
        velocity.extend(tree.wheels().iter().map(|wheel| {
            let motions = self.system.motions();
            let body = self.wheels[wheel.end_effector].expect("a wheel that spins is a body");
            let axis = motions[wheel.link].rotation * wheel.axis_in_link;
            axis.dot(&(motions[body].spin - motions[wheel.link].spin))
        }));
        let joint_rad = (0..joints).map(|joint| self.joint(joint)[0]).collect();
        State { base_position_m, world_from_body, joint_rad, velocity }
    }

    /// Centre of mass of the robot, m, and its velocity, m/s.
    pub fn com(&self) -> (Vector3<f64>, Vector3<f64>) {
        let bodies = self.system.bodies().iter().zip(self.system.motions());
        let (mut mass, mut moment) = (0.0, Vector3::zeros());
        for (body, motion) in bodies {
            mass += body.mass_kg();
            moment += motion.position * body.mass_kg();
        }
        (moment / mass, self.system.momentum() / mass)
    }

    /// Angle of a spinning wheel relative to its link, −π to π, with or without a motor. `None` if the wheel does not spin.
    pub fn wheel_rad(&self, end_effector: usize, wheel: &EndEffector) -> Option<f64> {
        let axis = wheel.contact.axis_in_link()?;
        let [link, body] = [wheel.link, self.wheels[end_effector]?];
        let motions = self.system.motions();
        let turn = motions[link].rotation.transpose() * motions[body].rotation;
        let across = perpendicular(axis);
        let turned = turn * across;
        Some(axis.dot(&across.cross(&turned)).atan2(across.dot(&turned)))
    }

    /// Body of an end effector's spinning wheel; `None` if the wheel does not spin.
    pub fn wheel(&self, end_effector: usize) -> Option<usize> {
        self.wheels[end_effector]
    }
}

/// Smallest vertical component of a ground normal that counts for the height above ground.
const STEEPEST: f64 = 0.1;

/// Smallest vertical distance of the contact points from the ground, m. Walls are ignored, unless the robot has penetrated
/// them. Returns `None` if no contact point counts.
fn lowest_m(touches: impl Iterator<Item = Touch>) -> Option<f64> {
    let height = |touch: Touch| match touch.normal.z > STEEPEST || touch.gap_m < 0.0 {
        true => touch.gap_m / touch.normal.z.max(STEEPEST),
        false => f64::INFINITY,
    };
    let lowest = touches.map(height).fold(f64::INFINITY, f64::min);
    lowest.is_finite().then_some(lowest)
}
