//! A robot on the ground: bodies, joints, motors and contacts from its description.
//!
//! A wheel that spins is a body of its own, whose mass and inertia are taken out of its link, so that both together are the
//! link of the robot file.

use crate::contact::{Contact, Normal, Resistance, Tip, Touch};
use crate::force::Force;
use crate::friction::{Friction, Model};
use crate::ground::Ground;
use crate::joint::{Ball, ParallelAxes};
use crate::motion::Motion;
use crate::motor::{Law, Motor};
use crate::system::{Inertia, Settings, StepError, StepReport, System};
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Configuration, Frames, Tree};
use rollwalk_robot::{EndEffector, Link, Robot};
use std::sync::Arc;

/// Stiffnesses and dampings of everything that is ideal in a robot file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameters {
    /// The stepper.
    pub settings: Settings,
    /// Stiffness of a joint against its two points coming apart, N/m.
    pub joint_n_m: f64,
    /// Length by which that stiffness makes one against the axes tilting, as a multiple of the size of what turns. As
    /// large in its own unit, the latter would be far too stiff for small wheels.
    pub lever: f64,
    /// Along the normal of the ground.
    pub normal: Normal,
    /// Model of friction.
    pub friction: Model,
    /// Friction over sliding velocity of a contact that sticks, N·s/m.
    pub stick_n_s_m: f64,
}

/// Depth to which a quarter of a robot's weight presses a contact, m.
const DEPTH_M: f64 = 5e-4;
/// Time constant of a contact that bears a quarter of the weight, s: its damping over its stiffness.
const DAMPING_S: f64 = 1.5e-3;
/// Creep of a contact that bears a quarter of the weight and is pulled with as much, m/s.
const CREEP_M_S: f64 = 3.6e-3;
/// Distance by which a quarter of the weight pulls a joint apart, m.
const JOINT_GAP_M: f64 = 2e-5;

impl Parameters {
    /// For a robot's weight: the same depth, creep and gaps for all.
    pub fn new(robot: &Robot) -> Self {
        let settings = Settings::default();
        let mass_kg: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
        let quarter_n = 0.25 * mass_kg * settings.gravity_m_s2.norm();
        let stiffness_n_m = quarter_n / DEPTH_M;
        let joint_n_m = quarter_n / JOINT_GAP_M;
        Self {
            settings,
            joint_n_m,
            lever: 2.0,
            normal: Normal {
                stiffness_n_m,
                damping_n_s_m: DAMPING_S * stiffness_n_m,
                ramp_m: 0.6 * DEPTH_M,
            },
            friction: Model::Linear,
            stick_n_s_m: quarter_n / CREEP_M_S,
        }
    }
}

/// Pose and velocity of a robot.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotState {
    /// Origin of the root link in world, m.
    pub base_position_m: Vector3<f64>,
    /// World from body.
    pub world_from_body: Matrix3<f64>,
    /// Velocity of the origin of the root link, m/s.
    pub base_velocity_m_s: Vector3<f64>,
    /// Angular velocity of the root link in world axes, rad/s.
    pub base_spin_rad_s: Vector3<f64>,
    /// Angles of the joints, rad.
    pub joint_rad: Vec<f64>,
    /// Speeds of the joints, rad/s.
    pub joint_rad_s: Vec<f64>,
    /// Speeds of the end effectors' wheels about their axes, relative to their links, rad/s; 0 for what does not spin.
    pub wheel_rad_s: Vec<f64>,
}

impl RobotState {
    /// At rest in the nominal pose with the root link's origin at a place.
    pub fn nominal(robot: &Robot, base_position_m: Vector3<f64>) -> Self {
        Self {
            base_position_m,
            world_from_body: Matrix3::identity(),
            base_velocity_m_s: Vector3::zeros(),
            base_spin_rad_s: Vector3::zeros(),
            joint_rad: robot.joints.iter().map(|joint| joint.nominal_rad).collect(),
            joint_rad_s: vec![0.0; robot.joints.len()],
            wheel_rad_s: vec![0.0; robot.end_effectors.len()],
        }
    }
}

/// A robot in its world.
#[derive(Debug)]
pub struct World {
    system: System,
    robot: Robot,
    /// Body of each wheel that spins, by end effector.
    wheels: Vec<Option<usize>>,
    /// Forces that are motors, by channel.
    motors: Vec<usize>,
    /// Forces that are contacts, by end effector.
    contacts: Vec<usize>,
}

/// A wheel apart from its link.
struct Spinning {
    end_effector: usize,
    inertia: Inertia,
}

/// Share of its link's mass that a wheel has, where the robot file does not tell.
const WHEEL_SHARE: f64 = 0.1;

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
            motors.push(hinge.add(&mut forces, parameters, joint.actuator.armature_kg_m2));
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
                motors.push(hinge.add(&mut forces, parameters, actuator.armature_kg_m2));
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
        let system = System::new(parameters.settings, inertias, motions, forces);
        Self { system, robot: robot.clone(), wheels, motors, contacts }
    }

    /// Advances by `step_s`.
    ///
    /// # Errors
    /// The step does not converge; the world is where it was.
    pub fn step(&mut self, step_s: f64) -> Result<StepReport, StepError> {
        self.system.step(step_s)
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
        let contact = self.system.force::<Contact>(self.contacts[end_effector]);
        let contact = contact.expect("an end effector's force is its contact");
        contact.touch(&self.system.motions()[contact.body[0]])
    }

    /// Origin of the root link, m, and world from body.
    pub fn base(&self) -> (Vector3<f64>, Matrix3<f64>) {
        let body = &self.system.motions()[0];
        // The root's own centre of mass lies where it does without its wheels.
        let (_, center) = without(&self.robot, &self.robot.links[0], &wheels_of(&self.robot, 0));
        (body.position - body.rotation * center, body.rotation)
    }

    /// Centre of mass of the robot, m, and its velocity, m/s.
    pub fn com(&self) -> (Vector3<f64>, Vector3<f64>) {
        let bodies = self.system.inertias().iter().zip(self.system.motions());
        let (mut mass, mut moment, mut momentum) = (0.0, Vector3::zeros(), Vector3::zeros());
        for (inertia, motion) in bodies {
            mass += inertia.mass_kg;
            moment += motion.position * inertia.mass_kg;
            momentum += motion.velocity * inertia.mass_kg;
        }
        (moment / mass, momentum / mass)
    }

    /// Body of a wheel that spins, of an end effector.
    pub fn wheel(&self, end_effector: usize) -> Option<usize> {
        self.wheels[end_effector]
    }
}

/// A hinge between two bodies.
struct Hinge {
    bodies: [usize; 2],
    points: [Vector3<f64>; 2],
    axes: [Vector3<f64>; 2],
    across: [Vector3<f64>; 2],
    /// Size of what turns, m.
    size_m: f64,
}

impl Hinge {
    fn add_free(&self, forces: &mut Vec<Box<dyn Force>>, parameters: &Parameters) {
        let &Self { bodies, points, axes, size_m, .. } = self;
        let lever_m = parameters.lever * size_m;
        forces.push(Box::new(Ball {
            bodies,
            points,
            stiffness_n_m: parameters.joint_n_m,
            damping_n_s_m: 0.0,
        }));
        forces.push(Box::new(ParallelAxes {
            bodies,
            axes,
            stiffness_nm_rad: parameters.joint_n_m * lever_m * lever_m,
        }));
    }

    /// With a motor; the index of its force.
    fn add(
        &self,
        forces: &mut Vec<Box<dyn Force>>,
        parameters: &Parameters,
        armature_kg_m2: f64,
    ) -> usize {
        self.add_free(forces, parameters);
        forces.push(Box::new(Motor {
            bodies: self.bodies,
            axis: self.axes[0],
            across: self.across,
            armature_kg_m2,
            law: Law::default(),
        }));
        forces.len() - 1
    }
}

/// Radius of gyration of a body, m: about its thickest axis.
fn gyration_m(inertia: &Inertia) -> f64 {
    let moments = inertia.about_com_kg_m2.symmetric_eigenvalues();
    (moments.max() / inertia.mass_kg).sqrt()
}

/// A unit vector across another.
fn perpendicular(axis: &Vector3<f64>) -> Vector3<f64> {
    let least = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::z() };
    (least - axis * axis.dot(&least)).normalize()
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

/// Whether a wheel turns against its link.
fn spins(end_effector: &EndEffector) -> bool {
    end_effector.contact.actuator().is_some() || end_effector.contact.freewheels()
}

/// The wheels of a link that spin: thin discs with a tenth of its mass, less where that would leave no body.
fn wheels_of(robot: &Robot, link: usize) -> Vec<Spinning> {
    let on_link = |end_effector: &&EndEffector| end_effector.link == link;
    let sharing = robot.end_effectors.iter().filter(on_link).count() as f64;
    let mut share = WHEEL_SHARE;
    loop {
        let all = robot.end_effectors.iter().enumerate();
        let wheels: Vec<_> = all
            .filter(|(_, end_effector)| on_link(end_effector) && spins(end_effector))
            .map(|(number, end_effector)| {
                let axis = end_effector.contact.axis_in_link().expect("what spins has an axis");
                let mass_kg = share * robot.links[link].mass_kg / sharing;
                let of_disc = 0.25 * mass_kg * end_effector.radius_m.powi(2);
                let about_com_kg_m2 = (Matrix3::identity() + axis * axis.transpose()) * of_disc;
                Spinning { end_effector: number, inertia: Inertia { mass_kg, about_com_kg_m2 } }
            })
            .collect();
        let left = without(robot, &robot.links[link], &wheels).0.about_com_kg_m2;
        let mut moments = left.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        if moments[0] > 0.0 && moments[0] + moments[1] >= moments[2] || share < 1e-6 {
            return wheels;
        }
        share *= 0.5;
    }
}

/// What is left of a link without its wheels, and where its centre of mass lies in the link, m.
fn without(robot: &Robot, link: &Link, wheels: &[Spinning]) -> (Inertia, Vector3<f64>) {
    let steiner = |mass: f64, arm: Vector3<f64>| {
        (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass
    };
    let center = |wheel: &Spinning| robot.end_effectors[wheel.end_effector].center_in_link_m;
    let mut mass_kg = link.mass_kg;
    let mut moment = link.com_in_link_m * link.mass_kg;
    for wheel in wheels {
        mass_kg -= wheel.inertia.mass_kg;
        moment -= center(wheel) * wheel.inertia.mass_kg;
    }
    let com = moment / mass_kg;
    let mut about_com_kg_m2 =
        link.inertia_in_link_kg_m2 + steiner(link.mass_kg, link.com_in_link_m - com);
    for wheel in wheels {
        about_com_kg_m2 -=
            wheel.inertia.about_com_kg_m2 + steiner(wheel.inertia.mass_kg, center(wheel) - com);
    }
    (Inertia { mass_kg, about_com_kg_m2 }, com)
}

/// Motions of the links' bodies, whose centres of mass are at `centers` in their links.
fn link_motions(robot: &Robot, state: &RobotState, centers: &[Vector3<f64>]) -> Vec<Motion> {
    let tree = Tree::new(robot);
    let at = Configuration {
        base_position_m: state.base_position_m,
        world_from_body: state.world_from_body,
        joint_rad: &state.joint_rad,
    };
    let frames = Frames::new(&tree, &at);
    // Of the origins of the links first.
    let mut motions: Vec<Motion> = (0..robot.links.len())
        .map(|link| Motion {
            position: frames.link_origins[link],
            rotation: frames.world_from_link[link],
            velocity: state.base_velocity_m_s,
            spin: state.base_spin_rad_s,
        })
        .collect();
    for (number, joint) in robot.joints.iter().enumerate() {
        let parent = motions[joint.parent];
        let (_, velocity) = parent.point(&joint.parent_from_joint.translation.vector);
        let child = &mut motions[joint.child];
        child.velocity = velocity;
        child.spin = parent.spin + frames.joint_axes[number] * state.joint_rad_s[number];
    }
    for (motion, center) in motions.iter_mut().zip(centers) {
        (motion.position, motion.velocity) = motion.point(center);
    }
    motions
}
