//! Quantities that can be fitted: kinds, values in a model, and parameters of a rollout.

use super::recording::Recording;
use nalgebra::Vector3;
use rollwalk_physics::force::Wrench;
use rollwalk_physics::sensitivity::parameter::{
    Constant, ContactParameter, ContactQuantity, MotorParameter, MotorQuantity, Parameter, Targets,
};
use rollwalk_physics::sensitivity::{Column, SolvedStep};
use rollwalk_physics::world::Parameters;
use rollwalk_physics::{Body, Scheme, World};
use rollwalk_robot::{Actuator, Robot};
use std::sync::Arc;

/// Robot with the additional parameters of its simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct SimulationModel {
    /// Robot.
    pub robot: Robot,
    /// Parameters of joints and contacts.
    pub parameters: Parameters,
    /// Delay of commands to the drives, s.
    pub delay_s: f64,
}

impl SimulationModel {
    /// Creates the model of a robot file, with an integrator and joints that do not bias fitted gains.
    ///
    /// The numerical damping of backward Euler at 120 Hz would make a fitted kd about 20 % too small, so the model uses BDF2.
    /// Compliant bearings would tilt the body as much as the drives do, so the model makes them stiffer. Contacts do not pull,
    /// because a run with pulling contacts is discontinuous in its parameters. The contact stiffness stays at the value for the
    /// robot's weight even if masses change.
    pub fn new(robot: &Robot) -> Self {
        let mut parameters = Parameters::new(robot);
        parameters.settings.scheme = Scheme::Bdf2;
        parameters.joint_n_m *= FIRMER;
        parameters.normal.pulls = false;
        Self { robot: robot.clone(), parameters, delay_s: 0.0 }
    }
}

/// Ratio of the bearing stiffness to that of other simulations.
const FIRMER: f64 = 30.0;

/// Kind of a fitted quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Friction coefficient. The ratios between end effectors are kept.
    Friction,
    /// Rolling resistance of free wheels, independent of speed.
    Resistance,
    /// Increase of the rolling resistance with speed.
    Drag,
    /// kp of a drive model.
    PositionGain,
    /// kd of a drive model.
    SpeedGain,
    /// Rotor inertia of a drive model.
    Armature,
    /// Masses and inertias of links that share a description.
    Mass,
    /// Normal stiffness of contacts.
    Stiffness,
    /// Ratio of friction to creep velocity of sticking contacts.
    Stick,
    /// Delay of commands.
    Delay,
}

struct KindProperties {
    kind: Kind,
    name: &'static str,
    /// Description and unit for [`Kind::label`].
    label: (&'static str, &'static str),
    /// True if the kind is fitted by default.
    by_default: bool,
    /// Key in the robot file; `None` if no robot file has the quantity.
    key: Option<&'static str>,
    /// Advice for a run that does not determine the quantity.
    silence: &'static str,
}

const FACTS: [KindProperties; 10] = [
    KindProperties {
        kind: Kind::Friction,
        name: "friction",
        label: ("coefficient of friction", ""),
        by_default: true,
        key: Some("friction_coefficient"),
        silence: "nothing slips in this run: push, accelerate or turn harder",
    },
    KindProperties {
        kind: Kind::Resistance,
        name: "resistance",
        label: ("rolling resistance", ""),
        by_default: true,
        key: Some("rolling_resistance"),
        silence: "no free wheel rolls",
    },
    KindProperties {
        kind: Kind::Drag,
        name: "drag",
        label: ("rolling drag", "s/m"),
        by_default: false,
        key: Some("rolling_drag_s_m"),
        silence: "no free wheel rolls",
    },
    KindProperties {
        kind: Kind::PositionGain,
        name: "kp",
        label: ("kp", "N·m/rad"),
        by_default: true,
        key: Some("kp_nm_rad"),
        silence: "the drives are at their limits or carry no load",
    },
    KindProperties {
        kind: Kind::SpeedGain,
        name: "kd",
        label: ("kd", "N·m·s/rad"),
        by_default: true,
        key: Some("kd_nm_s_rad"),
        silence: "the drives are at their limits or do not move",
    },
    KindProperties {
        kind: Kind::Armature,
        name: "armature",
        label: ("rotor inertia", "kg·m²"),
        by_default: false,
        key: Some("armature_kg_m2"),
        silence: "the drives do not accelerate",
    },
    KindProperties {
        kind: Kind::Mass,
        name: "mass",
        label: ("mass", "kg"),
        by_default: false,
        key: Some("mass_kg"),
        silence: "no measured value depends on the mass",
    },
    KindProperties {
        kind: Kind::Stiffness,
        name: "stiffness",
        label: ("stiffness of contacts", "N/m"),
        by_default: true,
        key: None,
        silence: "nothing touches the ground",
    },
    KindProperties {
        kind: Kind::Stick,
        name: "stick",
        label: ("ratio of friction to creep of sticking contacts", "N·s/m"),
        by_default: true,
        key: None,
        silence: "nothing touches the ground",
    },
    KindProperties {
        kind: Kind::Delay,
        name: "delay",
        label: ("delay of commands", "s"),
        by_default: true,
        key: None,
        silence: "the commands do not change",
    },
];

impl Kind {
    /// Iterates over all kinds.
    pub fn all() -> impl Iterator<Item = Self> {
        FACTS.iter().map(|facts| facts.kind)
    }

    fn facts(self) -> &'static KindProperties {
        FACTS.iter().find(|facts| facts.kind == self).expect("every kind is in the list")
    }

    /// Name in commands.
    pub fn name(self) -> &'static str {
        self.facts().name
    }

    /// Description and unit.
    pub fn label(self) -> (&'static str, &'static str) {
        self.facts().label
    }

    /// True if the kind is fitted by default.
    pub fn by_default(self) -> bool {
        self.facts().by_default
    }

    /// Key in the robot file; `None` if no robot file has the quantity.
    pub fn key(self) -> Option<&'static str> {
        self.facts().key
    }

    /// Advice for a run that does not determine the quantity.
    pub fn silence(self) -> &'static str {
        self.facts().silence
    }

    /// True for an auxiliary kind, which is fitted because other kinds depend on it although no robot file contains it.
    pub fn is_along(self) -> bool {
        self.key().is_none()
    }

    /// Scope of the kind: a drive model, a description of links, or the whole robot.
    pub fn is_of(self) -> Scope {
        match self {
            Self::PositionGain | Self::SpeedGain | Self::Armature => Scope::Drives,
            Self::Mass => Scope::Links,
            _ => Scope::Robot,
        }
    }
}

/// Scope of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Drives of a model.
    Drives,
    /// Links that share a description.
    Links,
    /// Whole robot.
    Robot,
}

/// Drives or links that share a description in the robot file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Group {
    /// Name in the robot file.
    pub name: String,
    /// Indices of the channels or links.
    pub members: Vec<usize>,
}

/// Quantity that is fitted.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Kind of the quantity.
    pub kind: Kind,
    /// Drives or links of the quantity; `None` for a quantity of the whole robot.
    pub group: Option<Group>,
}

/// Change of the delay for a change of 1 of the search parameter, s.
const DELAY_S: f64 = 0.05;

impl Quantity {
    /// Name in commands, such as `kp.xm540`.
    pub fn name(&self) -> String {
        let group = self.group.as_ref().map(|group| format!(".{}", group.name));
        format!("{}{}", self.kind.name(), group.unwrap_or_default())
    }

    /// Name of a link with a soft foot, if the quantity is its mass.
    ///
    /// Such a mass cannot be fitted: it moves the centre of mass of the rigid part, and a rollout has no derivative with
    /// respect to that.
    pub(super) fn soft_link<'r>(&self, robot: &'r Robot) -> Option<&'r str> {
        let is_soft = |&&link: &&usize| {
            robot.end_effectors.iter().any(|of| of.link == link && of.soft.is_some())
        };
        let links = self.members().iter().filter(|_| self.kind == Kind::Mass);
        links.filter(is_soft).map(|&link| robot.links[link].name.as_str()).next()
    }

    fn members(&self) -> &[usize] {
        self.group.as_ref().map_or(&[], |group| &group.members)
    }

    /// Value in a model: the sum for masses, the first member for kinds that keep ratios, or 0 if the robot lacks the quantity.
    pub fn value(&self, model: &SimulationModel) -> f64 {
        let robot = &model.robot;
        let drive = |of: fn(&Actuator) -> f64| {
            let number = self.members().first();
            number.and_then(|&k| robot.channels().nth(k)).map_or(0.0, |c| of(c.actuator()))
        };
        let drag = || robot.end_effectors.iter().find_map(|of| of.contact.drag());
        match self.kind {
            Kind::Friction => {
                robot.end_effectors.first().map_or(0.0, |first| first.friction_coefficient)
            }
            Kind::Resistance => drag().map_or(0.0, |drag| drag.rolling_resistance),
            Kind::Drag => drag().map_or(0.0, |drag| drag.rolling_drag_s_m),
            Kind::PositionGain => drive(|actuator| actuator.kp_nm_rad),
            Kind::SpeedGain => drive(|actuator| actuator.kd_nm_s_rad),
            Kind::Armature => drive(|actuator| actuator.armature_kg_m2),
            Kind::Mass => self.members().iter().map(|&link| robot.links[link].mass_kg).sum(),
            Kind::Stiffness => model.parameters.normal.stiffness_n_m,
            Kind::Stick => model.parameters.stick_n_s_m,
            Kind::Delay => model.delay_s,
        }
    }

    /// Sets the value in a model.
    pub fn set(&self, model: &mut SimulationModel, value: f64) {
        let share = value / self.value(model);
        let robot = &mut model.robot;
        let members = self.members().to_vec();
        match self.kind {
            Kind::Friction => {
                robot.end_effectors.iter_mut().for_each(|of| of.friction_coefficient *= share);
            }
            Kind::Resistance | Kind::Drag => {
                for of in &mut robot.end_effectors {
                    if let Some(drag) = of.contact.drag_mut() {
                        match self.kind {
                            Kind::Resistance => drag.rolling_resistance *= share,
                            _ => drag.rolling_drag_s_m *= share,
                        }
                    }
                }
            }
            Kind::PositionGain | Kind::SpeedGain | Kind::Armature => {
                for (_, actuator) in
                    actuators(robot).enumerate().filter(|(number, _)| members.contains(number))
                {
                    match self.kind {
                        Kind::PositionGain => actuator.kp_nm_rad = value,
                        Kind::SpeedGain => actuator.kd_nm_s_rad = value,
                        _ => actuator.armature_kg_m2 = value,
                    }
                }
            }
            Kind::Mass => {
                for link in members {
                    robot.links[link].mass_kg *= share;
                    robot.links[link].inertia_in_link_kg_m2 *= share;
                }
            }
            Kind::Stiffness => {
                // Damping begins at a fraction of the depth, so contacts keep their time constant.
                let normal = &mut model.parameters.normal;
                normal.stiffness_n_m = value;
                normal.damping_n_s_m *= share;
                normal.ramp_m /= share;
            }
            Kind::Stick => model.parameters.stick_n_s_m = value,
            Kind::Delay => model.delay_s = value,
        }
    }

    /// Value for a search parameter, relative to the value of the file. The parameter is a logarithm, except for the delay.
    pub(super) fn of_parameter(&self, file: f64, parameter: f64) -> f64 {
        if self.kind == Kind::Delay { file + DELAY_S * parameter } else { file * parameter.exp() }
    }

    /// Search parameter for a value.
    pub(super) fn to_parameter(&self, file: f64, value: f64) -> f64 {
        if self.kind == Kind::Delay { (value - file) / DELAY_S } else { (value / file).ln() }
    }

    /// Derivative of the value with respect to the search parameter.
    pub(super) fn by_parameter(&self, value: f64) -> f64 {
        if self.kind == Kind::Delay { DELAY_S } else { value }
    }

    /// Rollout parameters that the quantity changes, each with the factor for the derivative with respect to the value.
    pub(super) fn parameters(
        &self,
        world: &World,
        model: &SimulationModel,
        recording: &Arc<Recording>,
        begin_s: f64,
    ) -> Vec<(Box<dyn Parameter>, f64)> {
        let robot = &model.robot;
        let contacts = |dragging: bool| -> Vec<usize> {
            let of = robot.end_effectors.iter().enumerate();
            let of = of.filter(|(_, of)| !dragging || of.contact.drag().is_some());
            of.flat_map(|(number, _)| world.contacts(number)).collect()
        };
        // Nodes of soft feet share the value of their foot.
        let touching = |dragging: bool, of: ContactQuantity, number: f64| {
            let contacts = ContactParameter::new(world.system(), contacts(dragging), of);
            let share = contacts.value(world.system()) / number;
            (Box::new(contacts) as Box<dyn Parameter>, share)
        };
        let value = self.value(model);
        let drive = |of: MotorQuantity| -> Vec<(Box<dyn Parameter>, f64)> {
            let motors = self.members().iter().map(|&channel| world.motors()[channel]).collect();
            vec![(Box::new(MotorParameter { motors, of }), 1.0)]
        };
        match self.kind {
            Kind::Friction => vec![touching(false, ContactQuantity::Friction, value)],
            Kind::Resistance => vec![touching(true, ContactQuantity::Resistance, value)],
            Kind::Drag => vec![touching(true, ContactQuantity::ResistancePerSpeed, value)],
            Kind::PositionGain => drive(MotorQuantity::PositionGain),
            Kind::SpeedGain => drive(MotorQuantity::SpeedGain),
            Kind::Armature => drive(MotorQuantity::Armature),
            Kind::Mass => {
                // Wheels that spin are separate bodies after the links.
                let of_links = self.members().iter().copied();
                let wheels = robot.end_effectors.iter().enumerate();
                let wheels = wheels.filter(|(_, of)| self.members().contains(&of.link));
                let wheels = wheels.filter_map(|(number, _)| world.wheel(number));
                let bodies = of_links.chain(wheels).collect();
                vec![(Box::new(MassChange { bodies }), 1.0 / value)]
            }
            Kind::Stick => vec![touching(false, ContactQuantity::Stick, value)],
            Kind::Stiffness => {
                let (ramp, share) = touching(false, ContactQuantity::Ramp, value);
                let of = [ContactQuantity::Stiffness, ContactQuantity::Damping];
                let of = of.map(|of| touching(false, of, value));
                of.into_iter().chain([(ramp, -share)]).collect()
            }
            Kind::Delay => {
                let recording = Arc::clone(recording);
                let delay_s = model.delay_s;
                let by = move |channel: usize, time_s: f64| {
                    let drive = &recording.drives[channel];
                    let then_s = begin_s + time_s - delay_s;
                    let all = [&drive.target_rad, &drive.target_rad_s, &drive.feedforward_nm];
                    all.map(|series| -series.at(then_s)[1])
                };
                vec![(Box::new(Targets { motors: world.motors().to_vec(), by: Arc::new(by) }), 1.0)]
            }
        }
    }
}

/// Actuators in channel order.
fn actuators(robot: &mut Robot) -> impl Iterator<Item = &mut Actuator> {
    let joints = robot.joints.iter_mut().map(|joint| &mut joint.actuator);
    let wheels = robot.end_effectors.iter_mut().filter_map(|of| of.contact.actuator_mut());
    joints.chain(wheels)
}

/// Relative change of the masses and inertias of bodies.
#[derive(Clone, Debug)]
struct MassChange {
    bodies: Vec<usize>,
}

impl Parameter for MassChange {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        for &body in &self.bodies {
            let of = solved.body(body);
            let force = solved.resisted_m_s2(body) * of.mass_kg();
            let moment = solved.rate(body, |motion| match of {
                Body::Rigid(inertia) => {
                    motion.rotation
                        * (inertia.about_com_kg_m2 * motion.rotation.tr_mul(&motion.spin))
                }
                Body::Particle { .. } => Vector3::zeros(),
            });
            column.add(body, &Wrench { force, moment });
        }
    }
}
