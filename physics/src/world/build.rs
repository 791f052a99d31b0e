//! Construction of a robot's bodies, hinges, motors and contacts.

use super::foot;
use super::hinge::{Hinge, gyration_m, perpendicular, stops};
use super::parts::soft_feet_of;
use super::state::link_motions;
use super::{Parameters, RobotState};
use crate::assembly::Assembly;
use crate::body::Inertia;
use crate::contact::{GroundContact, Resistance, Tip};
use crate::coupled_motor::CoupledMotor;
use crate::friction::Friction;
use crate::motion::BodyMotion;
use crate::motor::Motor;
use nalgebra::Vector3;
use rollwalk_multibody::ground::{Ground, parts_of};
use rollwalk_multibody::{rest_of_link, spinning_wheels};
use rollwalk_robot::shape::Shape;
use rollwalk_robot::{CrankMap, EndEffector, Robot};
use std::ops::Range;
use std::sync::Arc;

/// Robot under construction. Its links are the first bodies, in their order.
pub(super) struct Build<'a> {
    robot: &'a Robot,
    parameters: &'a Parameters,
    pub assembly: Assembly,
    /// Centres of mass of the links' bodies, in link axes, m.
    pub centers: Vec<Vector3<f64>>,
    inertias: Vec<Inertia>,
    spinning: Vec<(usize, Inertia)>,
    /// Force index of the hinge of each joint.
    pub joints: Vec<usize>,
    /// Force index of each motor, by channel.
    pub motors: Vec<usize>,
}

impl<'a> Build<'a> {
    /// Adds the links, without their spinning wheels.
    pub fn links(robot: &'a Robot, parameters: &'a Parameters, state: &RobotState) -> Self {
        let (mut inertias, mut centers, mut spinning) = (Vec::new(), Vec::new(), Vec::new());
        for link in 0..robot.links.len() {
            let wheels = spinning_wheels(robot, link);
            let feet = soft_feet_of(robot, link);
            let apart = wheels.iter().map(|(_, wheel)| wheel).chain(&feet);
            let rest = rest_of_link(robot, link, apart);
            inertias.push(Inertia::from(&rest));
            centers.push(rest.com_in_link_m);
            spinning.extend(wheels.iter().map(|(number, wheel)| (*number, wheel.into())));
        }
        // Channels of wheels are in the order of end effectors.
        spinning.sort_by_key(|(number, _)| *number);
        let mut assembly = Assembly::default();
        for (inertia, motion) in inertias.iter().zip(link_motions(robot, state, &centers)) {
            assembly.add_body(*inertia, motion);
        }
        Self {
            robot,
            parameters,
            assembly,
            centers,
            inertias,
            spinning,
            joints: Vec::new(),
            motors: Vec::new(),
        }
    }

    /// Adds the joints and their motors.
    pub fn joints(&mut self, state: &RobotState) {
        let mut hinges = Vec::new();
        for (joint, &angle_rad) in self.robot.joints.iter().zip(&state.joint_rad) {
            let turn = joint.parent_from_joint.rotation.to_rotation_matrix();
            let across = perpendicular(&joint.axis_in_joint);
            let mount = joint.parent_from_joint.translation.vector;
            let hinge = Hinge {
                bodies: [joint.parent, joint.child],
                points: [mount - self.centers[joint.parent], -self.centers[joint.child]],
                axes: [turn * joint.axis_in_joint, joint.axis_in_joint],
                across: [turn * across, across],
                size_m: gyration_m(&self.inertias[joint.child]),
                travel_m_per_rad: joint.travel_m_per_rad,
            };
            hinge.add(&mut self.assembly, self.parameters);
            let stops = Some(stops(joint));
            let armature_kg_m2 =
                if joint.is_coupled() { 0.0 } else { joint.actuator.armature_kg_m2 };
            let motor = hinge.motor(armature_kg_m2, stops, angle_rad);
            hinges.push(motor.clone());
            self.joints.push(self.assembly.add(Motor { spring: joint.spring, ..motor }));
        }
        for index in self.robot.driven_joints() {
            let motor = self.motor(index, &hinges);
            self.motors.push(motor);
        }
    }

    /// Adds the motor of a joint, unless it is that of the joint's hinge alone.
    fn motor(&mut self, index: usize, hinges: &[Motor]) -> usize {
        let joint = &self.robot.joints[index];
        if !joint.is_coupled() {
            return self.joints[index];
        }
        let armature_kg_m2 = joint.actuator.armature_kg_m2;
        let crank = joint.linkage.as_ref().and_then(|of| CrankMap::new(self.robot, joint, of));
        let motor = match crank {
            Some(crank) => {
                let turned: Vec<_> = crank.joints().map(|joint| hinges[joint].clone()).collect();
                CoupledMotor::with_crank(crank.renumbered(), turned, armature_kg_m2)
            }
            None => {
                let ratios = joint.motor_per_joint.iter();
                let turned = ratios.map(|of| (of.ratio, hinges[of.joint].clone()));
                CoupledMotor::new(turned, armature_kg_m2)
            }
        };
        self.assembly.add(motor)
    }

    /// Adds the spinning wheels, their hinges and their motors. Returns the body of each wheel, by end effector.
    pub fn wheels(&mut self, state: &RobotState) -> Vec<Option<usize>> {
        let mut wheels = vec![None; self.robot.end_effectors.len()];
        for &(number, inertia) in &self.spinning {
            let end_effector = &self.robot.end_effectors[number];
            let link = end_effector.link;
            let axis = *end_effector.contact.axis_in_link().expect("what spins has an axis");
            let mount = end_effector.center_in_link_m - self.centers[link];
            let carrier = self.assembly.motions[link];
            let (position, velocity) = carrier.point(&mount);
            let rotation = carrier.rotation;
            let spin = carrier.spin + rotation * axis * state.wheel_rad_s[number];
            let motion = BodyMotion { position, rotation, velocity, spin };
            let body = self.assembly.add_body(inertia, motion);
            wheels[number] = Some(body);
            let across = perpendicular(&axis);
            let hinge = Hinge {
                bodies: [link, body],
                points: [mount, Vector3::zeros()],
                axes: [axis; 2],
                across: [across; 2],
                size_m: gyration_m(&inertia),
                travel_m_per_rad: None,
            };
            hinge.add(&mut self.assembly, self.parameters);
            if let Some(actuator) = end_effector.contact.actuator() {
                let motor = hinge.motor(actuator.armature_kg_m2, None, 0.0);
                self.motors.push(self.assembly.add(motor));
            }
        }
        wheels
    }

    /// Adds the contacts of each end effector, and soft feet. Returns their force indices.
    pub fn contacts(
        &mut self,
        wheels: &[Option<usize>],
        ground: &Arc<dyn Ground>,
    ) -> Vec<Range<usize>> {
        let mut contacts = Vec::new();
        for (end_effector, wheel) in self.robot.end_effectors.iter().zip(wheels) {
            let contact = self.contact(end_effector, *wheel, ground);
            contacts.push(match &end_effector.soft {
                Some(soft) => {
                    let attach_n_m = foot::ATTACH_SHARE * self.parameters.joint_n_m;
                    foot::add(&mut self.assembly, &contact, soft, attach_n_m)
                }
                None => self.add_contact(&contact),
            });
        }
        contacts
    }

    /// Adds contacts of the links' shapes, which touch the ground when the robot lies: the ends of capsules and the corners of
    /// boxes. Returns their force indices.
    pub fn shapes(&mut self, ground: &Arc<dyn Ground>) -> Range<usize> {
        let before = self.assembly.forces.len();
        for (number, link) in self.robot.links.iter().enumerate() {
            let points = link.shapes.iter().flat_map(Shape::points);
            // Points on which a motion lies are contacts of end effectors.
            for (point, radius_m) in points.filter(|at| !self.robot.lies_on(number, at)) {
                self.add_contact(&GroundContact {
                    body: [number],
                    center: point - self.centers[number],
                    radius_m,
                    tip: Tip::Sphere,
                    normal: self.parameters.normal,
                    friction: Friction {
                        model: self.parameters.friction,
                        coefficient: self.parameters.shape_friction,
                        stick_n_s_m: self.parameters.stick_n_s_m,
                    },
                    resistance: Resistance::default(),
                    ground: Arc::clone(ground),
                });
            }
        }
        before..self.assembly.forces.len()
    }

    /// Adds a contact with each part of its ground, and returns the force indices.
    fn add_contact(&mut self, contact: &GroundContact) -> Range<usize> {
        let before = self.assembly.forces.len();
        for ground in parts_of(&contact.ground) {
            self.assembly.add(GroundContact { ground, ..contact.clone() });
        }
        before..self.assembly.forces.len()
    }

    fn contact(
        &self,
        end_effector: &EndEffector,
        wheel: Option<usize>,
        ground: &Arc<dyn Ground>,
    ) -> GroundContact {
        let kind = &end_effector.contact;
        let tip = match kind.axis_in_link() {
            None => Tip::Sphere,
            Some(&axis) if kind.blade_length_m().is_some() => Tip::Blade { axis },
            Some(&axis) => Tip::Rim { axis },
        };
        let mount = end_effector.center_in_link_m - self.centers[end_effector.link];
        GroundContact {
            body: [wheel.unwrap_or(end_effector.link)],
            center: if wheel.is_some() { Vector3::zeros() } else { mount },
            radius_m: end_effector.radius_m,
            tip,
            normal: self.parameters.normal,
            friction: Friction {
                model: self.parameters.friction,
                coefficient: end_effector.friction_coefficient,
                stick_n_s_m: self.parameters.stick_n_s_m,
            },
            resistance: kind.drag().map_or_else(Resistance::default, |drag| Resistance {
                constant: drag.rolling_resistance,
                per_speed_s_m: drag.rolling_drag_s_m,
            }),
            ground: Arc::clone(ground),
        }
    }
}
