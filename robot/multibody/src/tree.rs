//! Robot prepared for kinematics and dynamics: structure, masses, degrees of freedom.

use crate::JOINTS;
use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::{EndEffector, Robot, Transmission};

/// Structure, masses and degrees of freedom of a robot, computed once.
///
/// By default, wheels turn with their links and joints have no armature. [`Self::with_spinning_wheels`] and
/// [`Self::with_armature`] add both.
#[derive(Clone, Debug)]
pub struct Tree {
    robot: Robot,
    transmission: Transmission,
    total_mass_kg: f64,
    /// Parent-from-joint rotations at angle 0.
    parent_from_joint: Vec<Matrix3<f64>>,
    /// Joints between each link and the base, base first.
    joints_to_link: Vec<Vec<usize>>,
    /// Mass of all links beyond each joint, kg.
    carried_mass_kg: Vec<f64>,
    wheels: Vec<Wheel>,
    armature: bool,
}

/// Wheel whose spin is a degree of freedom.
///
/// The mass of the wheel is part of its link, in the robot file and here. A wheel is symmetric about its axis, so that its
/// angle changes no inertia. Its spin adds only the inertia about the axis.
#[derive(Clone, Debug)]
pub struct Wheel {
    /// Index of the end effector.
    pub end_effector: usize,
    /// Index of the link that carries the wheel.
    pub link: usize,
    /// Unit axis in the link frame.
    pub axis_in_link: Vector3<f64>,
    /// Inertia of the turning parts about the axis, kg·m²; rotor and gearbox excluded.
    pub spin_inertia_kg_m2: f64,
    /// Inertia of rotor and gearbox seen at the wheel, kg·m²; 0 without a motor.
    pub armature_kg_m2: f64,
}

impl Tree {
    /// Prepares a robot. Wheels turn with their links, and joints have no armature.
    ///
    /// # Panics
    /// If couplings of the robot are not invertible, which [`Robot::validate`] refuses.
    pub fn new(robot: &Robot) -> Self {
        let mut joints_to_link = vec![Vec::new(); robot.links.len()];
        for (index, joint) in robot.joints.iter().enumerate() {
            joints_to_link[joint.child] = joints_to_link[joint.parent].clone();
            joints_to_link[joint.child].push(index);
        }
        let rotation = |pose: &nalgebra::Isometry3<f64>| pose.rotation.to_rotation_matrix();
        let joints = robot.joints.iter();
        let carried_mass_kg = (0..robot.joints.len())
            .map(|joint| {
                let carries = |link: &usize| joints_to_link[*link].contains(&joint);
                (0..robot.links.len()).filter(carries).map(|link| robot.links[link].mass_kg).sum()
            })
            .collect();
        Self {
            total_mass_kg: robot.total_mass_kg(),
            parent_from_joint: joints
                .map(|j| rotation(&j.parent_from_joint).into_inner())
                .collect(),
            joints_to_link,
            carried_mass_kg,
            wheels: Vec::new(),
            armature: false,
            transmission: robot.transmission(),
            robot: robot.clone(),
        }
    }

    /// Makes the spin of each actuated or passive wheel a degree of freedom. `spin_inertia_kg_m2` returns the inertia of the
    /// turning parts about the axis.
    ///
    /// # Panics
    /// If this inertia is not positive, or exceeds the inertia of its link. Such a wheel cannot exist, and its mass matrix
    /// would not be positive definite. The check considers each wheel alone, also if a link has several parallel wheels.
    pub fn with_spinning_wheels(
        mut self,
        spin_inertia_kg_m2: impl Fn(&EndEffector) -> f64,
    ) -> Self {
        let end_effectors = self.robot.end_effectors.iter().enumerate();
        self.wheels = end_effectors
            .filter_map(|(index, end_effector)| {
                let contact = &end_effector.contact;
                let axis = contact.axis_in_link().filter(|_| contact.spins())?;
                let spin_inertia_kg_m2 = spin_inertia_kg_m2(end_effector);
                let link = &self.robot.links[end_effector.link];
                // With room for rounding where the link is nothing but the wheel.
                let most = axis.dot(&(link.inertia_in_link_kg_m2 * axis)) * (1.0 + 1e-9);
                assert!(
                    spin_inertia_kg_m2 > 0.0 && spin_inertia_kg_m2 <= most,
                    "the wheel of `{}` has {spin_inertia_kg_m2} kg·m² about its axis; expected \
                     more than 0 and at most {most} kg·m², the inertia of its link",
                    end_effector.name
                );
                Some(Wheel {
                    end_effector: index,
                    link: end_effector.link,
                    axis_in_link: *axis,
                    spin_inertia_kg_m2,
                    armature_kg_m2: contact.actuator().map_or(0.0, |motor| motor.armature_kg_m2),
                })
            })
            .collect();
        self
    }

    /// Adds the inertia of rotor and gearbox, seen at the output, to joints and spinning wheels (RBDA sec. 9.6, without
    /// gyroscopic terms of the rotor).
    pub fn with_armature(mut self) -> Self {
        self.armature = true;
        self
    }

    /// The robot.
    pub fn robot(&self) -> &Robot {
        &self.robot
    }

    /// Map between the joints and their motors.
    pub fn transmission(&self) -> &Transmission {
        &self.transmission
    }

    /// Total mass, kg.
    pub fn total_mass_kg(&self) -> f64 {
        self.total_mass_kg
    }

    /// Length of ν: 6 + joints + spinning wheels.
    pub fn dofs(&self) -> usize {
        self.first_wheel_dof() + self.wheels.len()
    }

    /// Spinning wheels in end-effector order; empty without [`Self::with_spinning_wheels`].
    pub fn wheels(&self) -> &[Wheel] {
        &self.wheels
    }

    /// Index of a wheel's speed in ν; `None` for end effectors that do not spin.
    pub fn wheel_dof(&self, end_effector: usize) -> Option<usize> {
        let wheel = self.wheels.iter().position(|wheel| wheel.end_effector == end_effector)?;
        Some(self.first_wheel_dof() + wheel)
    }

    /// Index of the first wheel speed in ν.
    pub fn first_wheel_dof(&self) -> usize {
        JOINTS + self.robot.joints.len()
    }

    /// Joints between the base and a link, base first.
    pub fn joints_to_link(&self, link: usize) -> &[usize] {
        &self.joints_to_link[link]
    }

    /// Mass of all links beyond a joint, kg.
    pub fn carried_mass_kg(&self, joint: usize) -> f64 {
        self.carried_mass_kg[joint]
    }

    /// Parent-from-joint rotation at angle 0.
    pub(crate) fn parent_from_joint(&self, joint: usize) -> &Matrix3<f64> {
        &self.parent_from_joint[joint]
    }

    /// Armature of the motor of a joint at the motor's output, kg·m²; 0 without [`Self::with_armature`].
    pub(crate) fn motor_armature_kg_m2(&self, joint: usize) -> f64 {
        if self.armature { self.robot.joints[joint].actuator.armature_kg_m2 } else { 0.0 }
    }

    /// Armature of a wheel, kg·m²; 0 without [`Self::with_armature`].
    pub(crate) fn wheel_armature_kg_m2(&self, wheel: &Wheel) -> f64 {
        if self.armature { wheel.armature_kg_m2 } else { 0.0 }
    }
}
