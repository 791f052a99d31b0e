//! A robot on the ground: bodies, joints, motors and contacts from its description.
//!
//! A wheel that spins is a body of its own, whose mass and inertia are taken out of its link, so that both together are the
//! link of the robot file.

mod hinge;
mod parameters;
mod state;
mod wheels;

use crate::assembly::Assembly;
use crate::body::{Body, Inertia};
use crate::contact::{Contact, Resistance, Tip};
use crate::force::Force;
use crate::friction::Friction;
use crate::ground::Ground;
use crate::hold::{Hold, Place};
use crate::motion::Motion;
use crate::motor::{Law, Motor, Stops};
use crate::system::{StepError, StepReport, System};
use crate::touch::Touch;
use hinge::{Hinge, gyration_m, perpendicular};
use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::{EndEffector, Joint, Robot};
use state::link_motions;
use std::sync::Arc;
use wheels::{Spinning, wheels_of, without};

pub use parameters::Parameters;
pub use state::RobotState;

/// Angle by which the motor's greatest torque bends a stop, rad.
const STOP_RAD: f64 = 0.02;
/// Largest angle of a stop, rad: beyond it a hinge that is pushed on would come round to the other side.
const STOP_MAX_RAD: f64 = 3.0;

/// A robot in its world.
#[derive(Debug)]
pub struct World {
    system: System,
    /// Centre of mass of the root link's body, in the link, m.
    root_center: Vector3<f64>,
    /// Body of each wheel that spins, by end effector.
    wheels: Vec<Option<usize>>,
    /// Forces that are motors, by channel.
    motors: Vec<usize>,
    /// Forces that are contacts, by end effector.
    contacts: Vec<usize>,
    /// Force that can hold the root link.
    hold: usize,
}

impl World {
    /// A robot at a state, with torque off.
    ///
    /// # Panics
    /// The state has not an entry for each joint and end effector of the robot.
    pub fn new(
        robot: &Robot,
        ground: &Arc<dyn Ground>,
        parameters: &Parameters,
        state: &RobotState,
    ) -> Self {
        let links = robot.links.len();
        let mut inertias: Vec<Inertia> = Vec::with_capacity(links);
        let mut centers: Vec<Vector3<f64>> = Vec::with_capacity(links);
        let mut spinning = Vec::new();
        for (number, link) in robot.links.iter().enumerate() {
            let wheels = wheels_of(robot, number);
            let (inertia, center) = without(robot, link, &wheels);
            inertias.push(inertia);
            centers.push(center);
            spinning.extend(wheels);
        }
        let mut motions = link_motions(robot, state, &centers);
        let mut forces: Vec<Box<dyn Force>> = Vec::new();
        let mut motors = Vec::new();
        for joint in &robot.joints {
            let turn = joint.parent_from_joint.rotation.to_rotation_matrix();
            let across = perpendicular(&joint.axis_in_joint);
            let hinge = Hinge {
                bodies: [joint.parent, joint.child],
                points: [
                    joint.parent_from_joint.translation.vector - centers[joint.parent],
                    -centers[joint.child],
                ],
                axes: [turn * joint.axis_in_joint, joint.axis_in_joint],
                across: [turn * across, across],
                size_m: gyration_m(&inertias[joint.child]),
            };
            let stops = stops(joint);
            motors.push(hinge.add(&mut forces, parameters, joint.actuator.armature_kg_m2, stops));
        }
        let mut wheels = vec![None; robot.end_effectors.len()];
        for Spinning { end_effector: number, inertia } in spinning {
            let end_effector = &robot.end_effectors[number];
            let (link, body) = (end_effector.link, inertias.len());
            wheels[number] = Some(body);
            inertias.push(inertia);
            let axis = *end_effector.contact.axis_in_link().expect("what spins has an axis");
            let mount = end_effector.center_in_link_m - centers[link];
            let (position, velocity) = motions[link].point(&mount);
            let rotation = motions[link].rotation;
            let spin = motions[link].spin + rotation * axis * state.wheel_rad_s[number];
            motions.push(Motion { position, rotation, velocity, spin });
            let across = perpendicular(&axis);
            let hinge = Hinge {
                bodies: [link, body],
                points: [mount, Vector3::zeros()],
                axes: [axis; 2],
                across: [across; 2],
                size_m: gyration_m(&inertias[body]),
            };
            if let Some(actuator) = end_effector.contact.actuator() {
                motors.push(hinge.add(&mut forces, parameters, actuator.armature_kg_m2, None));
            } else {
                hinge.add_free(&mut forces, parameters);
            }
        }
        let mut contacts = Vec::new();
        for (end_effector, wheel) in robot.end_effectors.iter().zip(&wheels) {
            contacts.push(forces.len());
            let contact = contact(end_effector, *wheel, &centers, parameters, ground);
            forces.push(Box::new(contact));
        }
        let hold = forces.len();
        forces.push(Box::new(Hold { body: [0], grip: parameters.grip, place: None }));
        let bodies = inertias.into_iter().map(Body::from).collect();
        let system = System::new(parameters.settings, Assembly { bodies, motions, forces });
        Self { system, root_center: centers[0], wheels, motors, contacts, hold }
    }

    /// Advances by `step_s`.
    ///
    /// # Errors
    /// The step does not converge; the world is where it was.
    pub fn step(&mut self, step_s: f64) -> Result<StepReport, StepError> {
        self.system.step(step_s)
    }

    /// Holds the root link with its origin at a place, m, and turned as given, or lets go of it.
    pub fn hold(&mut self, place: Option<(Vector3<f64>, Matrix3<f64>)>) {
        let place = place.map(|(origin, rotation)| Place {
            position: origin + rotation * self.root_center,
            rotation,
        });
        let hold = self.system.force_mut::<Hold>(self.hold);
        hold.expect("the root link's hold").place = place;
    }

    /// Bodies and forces.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// What the motor of a channel does from now on.
    ///
    /// # Panics
    /// The robot has no such channel.
    pub fn set_law(&mut self, channel: usize, law: Law) {
        let motor = self.system.force_mut::<Motor>(self.motors[channel]);
        motor.expect("a channel's force is its motor").law = law;
    }

    /// Angle, rad, −π to π, speed, rad/s, and torque, N·m, of the motor of a channel.
    pub fn shaft(&self, channel: usize) -> [f64; 3] {
        let motor = self.system.force::<Motor>(self.motors[channel]);
        let motor = motor.expect("a channel's force is its motor");
        let now = motor.bodies.map(|body| self.system.motions()[body]);
        [motor.angle(&now), motor.speed(&now), motor.torque(&now).value_nm]
    }

    /// Contact of an end effector.
    pub fn touch(&self, end_effector: usize) -> Touch {
        let touch = self.system.touch(self.contacts[end_effector]);
        touch.expect("an end effector's force is its contact")
    }

    /// Origin of the root link, m, and world from body.
    pub fn base(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let body = &self.system.motions()[0];
        (body.position - body.rotation * self.root_center, body.rotation)
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

    /// Body of a wheel that spins, of an end effector.
    pub fn wheel(&self, end_effector: usize) -> Option<usize> {
        self.wheels[end_effector]
    }
}

/// Stops at the limits of a joint, as far as angles between −π and π can tell.
fn stops(joint: &Joint) -> Option<Stops> {
    let range_rad = [joint.position_min_rad, joint.position_max_rad];
    let within = range_rad.iter().all(|angle| angle.abs() < STOP_MAX_RAD);
    let stiffness_nm_rad = joint.actuator.torque_max_nm / STOP_RAD;
    within.then_some(Stops { range_rad, stiffness_nm_rad })
}

fn contact(
    end_effector: &EndEffector,
    wheel: Option<usize>,
    centers: &[Vector3<f64>],
    parameters: &Parameters,
    ground: &Arc<dyn Ground>,
) -> Contact {
    let kind = &end_effector.contact;
    let tip = match kind.axis_in_link() {
        None => Tip::Sphere,
        Some(&axis) if kind.blade_length_m().is_some() => Tip::Blade { axis },
        Some(&axis) => Tip::Rim { axis },
    };
    let mount = end_effector.center_in_link_m - centers[end_effector.link];
    let drag = kind.drag();
    Contact {
        body: [wheel.unwrap_or(end_effector.link)],
        center: if wheel.is_some() { Vector3::zeros() } else { mount },
        radius_m: end_effector.radius_m,
        tip,
        normal: parameters.normal,
        friction: Friction {
            model: parameters.friction,
            coefficient: end_effector.friction_coefficient,
            stick_n_s_m: parameters.stick_n_s_m,
        },
        resistance: drag.map_or_else(Resistance::default, |drag| Resistance {
            constant: drag.rolling_resistance,
            per_speed_s_m: drag.rolling_drag_s_m,
        }),
        ground: Arc::clone(ground),
    }
}
