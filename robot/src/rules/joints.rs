//! Rules of joints, and of motors of joints and wheels.

use super::check::Bound;
use super::{Check, Item};
use crate::actuator::Actuator;
use crate::document::NAME_MAX;
use crate::model::{Joint, JointRatio, TRAVEL_M_PER_RAD};
use crate::spring::JointSpring;
use crate::transmission::Transmission;
use rollwalk_protocol::actuator;
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use rollwalk_protocol::text::{Excerpt, is_plain_name};
use std::f64::consts::TAU;

/// Smallest and largest ratio of a servo to a joint.
const RATIO_MIN: f64 = 0.01;
const RATIO_MAX: f64 = 100.0;
/// Largest rest angle of a spring, rad: about three turns. Wound springs rest far from the range of their joint.
const REST_MAX_RAD: f64 = 20.0;
/// Largest speeds of joints and wheels in frames of the Rollwalk profile, rad/s. Larger numbers are usually rev/min.
pub(crate) const SPEEDS_MAX_RAD_S: [f64; 2] =
    [actuator::MAX_SPEED_RAD_S as f64, actuator::MAX_WHEEL_SPEED_RAD_S as f64];
/// Fields of the smallest, largest and nominal angle of a joint.
const ANGLES: [&str; 3] = ["position_min_rad", "position_max_rad", "nominal_rad"];
/// Fields of the smallest, largest and nominal position of a prismatic joint.
const POSITIONS: [&str; 3] = ["position_min_m", "position_max_m", "nominal_m"];
/// Number of actuator buses of a controller.
const BUSES: u8 = MAX_BUSES as u8;

/// Largest torque and gains of a robot's motors. Larger numbers are usually in other units, such as N·mm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MotorMaxima {
    pub torque_nm: f64,
    pub kp_nm_rad: f64,
    pub kd_nm_s_rad: f64,
    pub armature_kg_m2: f64,
}

impl MotorMaxima {
    /// Maxima of a robot with the given mass. From 8 kg on, a motor may lift twice the robot's weight on a lever of 1 m.
    pub fn of(mass_kg: f64) -> Self {
        // `max` ignores a NaN.
        let most =
            |per_kg: f64, least: f64, most: f32| (per_kg * mass_kg).max(least).min(most.into());
        Self {
            torque_nm: most(20.0, 160.0, actuator::MAX_TORQUE_NM),
            kp_nm_rad: most(130.0, 655.0, actuator::MAX_KP_NM_RAD),
            kd_nm_s_rad: most(10.0, 65.0, actuator::MAX_KD_NM_S_RAD),
            armature_kg_m2: most(0.2, 10.0, f32::MAX),
        }
    }
}

impl Check<'_> {
    pub(super) fn joint(&mut self, index: usize, joint: &Joint) {
        let robot = self.robot;
        let earlier = &robot.joints[..index];
        let links = robot.links.len();
        for (field, link) in [("parent", joint.parent), ("child", joint.child)] {
            if link >= links {
                let help = format!("the robot has links 0 to {}", links.saturating_sub(1));
                self.violated(field, format_args!("is link {link}"), help);
            }
        }
        if joint.child == 0 {
            let help = "give another link: the first link is the root, and no joint carries it";
            self.violated("child", "is the root link", help);
        } else if joint.parent != 0 && !earlier.iter().any(|other| other.child == joint.parent) {
            let name = robot.links.get(joint.parent).map_or("?", |link| link.name.as_str());
            let help = format!(
                "move the joint that carries `{name}` up, or break the loop: a parent is the root or \
                 the child of an earlier joint"
            );
            self.violated("parent", format_args!("`{name}` is not yet part of the tree"), help);
        }
        self.vector("origin_in_parent_m", &joint.parent_from_joint.translation.vector);
        let rotation = joint.parent_from_joint.rotation.norm();
        if (rotation - 1.0).abs() > 1e-9 || rotation.is_nan() {
            let help = "normalise the quaternion of the rotation";
            self.violated(
                "parent_from_joint",
                format_args!("has a rotation of norm {rotation}"),
                help,
            );
        }
        self.unit_axis("axis_in_joint", &joint.axis_in_joint);
        if let Some(travel) = joint.travel_m_per_rad {
            let (least, most) = TRAVEL_M_PER_RAD.into_inner();
            self.range("travel_m_per_rad", travel, Bound::AtLeast(least), most, "m/rad", "");
        }
        self.joint_range(joint);
        let before = self.count();
        if joint.is_passive() {
            self.passive(joint);
        } else {
            self.actuator(&joint.actuator, SPEEDS_MAX_RAD_S[0]);
        }
        if !joint.is_passive() && joint.actuator.kp_nm_rad <= 0.0 {
            let help = "give a stiffness above 0 N·m/rad, with which the joint holds its position";
            self.violated("kp_nm_rad", "is 0", help);
        }
        if let Some(spring) = &joint.spring {
            self.spring(spring);
        }
        if let Some(travel) = joint.travel_m_per_rad {
            let help = format!(
                "; the joint slides {travel} m per radian of its motor, so 1 rad/s is {travel} m/s, 1 N·m is {} N and 1 N·m/rad is \
                 {} N/m",
                rounded(1.0 / travel),
                rounded(1.0 / (travel * travel))
            );
            self.add_help(before, &help);
        }
        self.coupling(index, joint);
        if let Some(linkage) = &joint.linkage {
            self.linkage(joint, linkage);
        }
    }

    /// Checks a joint without a servo.
    fn passive(&mut self, joint: &Joint) {
        // False for NaN.
        let holds = joint.spring.is_some_and(|spring| spring.stiffness_nm_rad > 0.0);
        if !holds {
            let help = "give a spring with `stiffness_nm_rad` above 0, or `actuator` with its `bus` and `id`";
            self.violated("spring", "does not hold the joint, which has no `actuator`", help);
        }
        if joint.linkage.is_some() {
            let help = "give the joint an `actuator`, or leave out `linkage`";
            self.violated("linkage", "has no motor, because the joint has no `actuator`", help);
        }
        if !joint.motor_per_joint.is_empty() {
            let help = "give the joint an `actuator`, or leave out `motor_per_joint`";
            self.violated(
                "motor_per_joint",
                "has no motor, because the joint has no `actuator`",
                help,
            );
        }
    }

    fn spring(&mut self, spring: &JointSpring) {
        let MotorMaxima { kp_nm_rad, kd_nm_s_rad, .. } =
            MotorMaxima::of(self.robot.total_mass_kg());
        let JointSpring { stiffness_nm_rad, rest_rad, damping_nm_s_rad } = *spring;
        let zero = Bound::AtLeast(0.0);
        let degree = "; 1 N·m per degree is 57.3 N·m/rad";
        self.range("stiffness_nm_rad", stiffness_nm_rad, zero, kp_nm_rad, "N·m/rad", degree);
        self.range("damping_nm_s_rad", damping_nm_s_rad, zero, kd_nm_s_rad, "N·m·s/rad", "");
        // False for NaN.
        let fits = rest_rad.abs() <= REST_MAX_RAD;
        if !fits {
            let help = format!(
                "give an angle within ±{REST_MAX_RAD} rad; {rest_rad} degrees would be {:.4} rad",
                rest_rad.to_radians()
            );
            self.violated("rest_rad", format_args!("is {rest_rad} rad"), help);
        }
    }

    fn coupling(&mut self, index: usize, joint: &Joint) {
        let field = "motor_per_joint";
        let known = |of: &JointRatio| self.robot.joints.get(of.joint).map(|of| of.name.as_str());
        let names: Vec<_> =
            joint.motor_per_joint.iter().map(|of| known(of).unwrap_or("?")).collect();
        for (number, (of, name)) in joint.motor_per_joint.iter().zip(names).enumerate() {
            // The comparison is false for NaN.
            if !(RATIO_MIN..=RATIO_MAX).contains(&of.ratio.abs()) {
                let help = format!(
                    "give radians of the motor per radian of the joint, of magnitude {RATIO_MIN} to \
                     {RATIO_MAX}; leave out a joint that the motor does not turn"
                );
                self.violated(field, format_args!("of `{name}` is {}", of.ratio), help);
            }
            if self.robot.joints.get(of.joint).is_some_and(Joint::is_prismatic) {
                let help = "leave out `motor_per_joint`: the motor of a prismatic joint moves that joint alone, by \
                    `travel_m_per_rad`";
                self.violated(field, format_args!("names `{name}`, a prismatic joint"), help);
            }
            if self.robot.joints.get(of.joint).is_some_and(Joint::is_passive) && of.joint != index {
                let help = "couple motors with joints that have an `actuator`";
                self.violated(field, format_args!("names `{name}`, a joint without a motor"), help);
            }
            let joints = self.robot.joints.len();
            let is_again = joint.motor_per_joint[..number].iter().any(|it| it.joint == of.joint);
            if of.joint >= joints || is_again {
                let help = format!("name each of the joints 0 to {} at most once", joints - 1);
                let problem = format_args!("names joint {} twice, or no joint", of.joint);
                self.violated(field, problem, help);
            }
        }
        let couples = !joint.motor_per_joint.is_empty();
        if couples && !joint.motor_per_joint.iter().any(|of| of.joint == index) {
            let help = format!("add `{} = 1.0`, or another ratio", joint.name);
            self.violated(field, "lacks the joint itself", help);
        }
    }

    /// Checks that the servos determine the joints. Requires couplings that break no other rule.
    pub(super) fn couplings(&mut self) {
        if Transmission::new(self.robot).is_some() {
            return;
        }
        let joints = self.robot.joints.iter().enumerate();
        let mut coupled = joints.filter(|(_, joint)| joint.is_coupled());
        let Some((index, joint)) = coupled.next_back() else { return };
        self.at(Item::Joint(index), format!("joint `{}`", joint.name));
        let help = "give the motors linearly independent ratios, such as { a = 1, b = 1 } and \
            { a = 1, b = -1 }";
        self.violated("motor_per_joint", "lets joints move while no motor turns", help);
    }

    fn joint_range(&mut self, joint: &Joint) {
        let (min, max) = (joint.position_min_rad, joint.position_max_rad);
        let nominal = joint.nominal_rad;
        if let Some(travel) = joint.travel_m_per_rad {
            return self.stroke([min, max, nominal], travel);
        }
        let mut sound = true;
        for (field, angle) in ANGLES.into_iter().zip([min, max, nominal]) {
            // The comparison is false for NaN.
            let fits = angle.abs() <= TAU;
            if !fits {
                let help = format!(
                    "give an angle within ±2π rad; {angle} degrees would be {:.4} rad",
                    angle.to_radians()
                );
                self.violated(field, format_args!("is {angle} rad"), help);
            }
            sound &= fits;
        }
        if !sound {
            return;
        }
        self.order(ANGLES, [min, max, nominal], "an angle", "rad");
    }

    /// Checks that the minimum is below the maximum, and the nominal position between them. `fields` names minimum, maximum and
    /// nominal position.
    fn order(
        &mut self,
        fields: [&'static str; 3],
        [min, max, nominal]: [f64; 3],
        kind: &str,
        unit: &str,
    ) {
        if min >= max {
            let help = format!("give a value above `{}` ({min} {unit})", fields[0]);
            self.violated(fields[1], format_args!("is {max} {unit}"), help);
        } else if !(min..=max).contains(&nominal) {
            let help = format!("give {kind} within the limits, {min} to {max} {unit}");
            self.violated(fields[2], format_args!("is {nominal} {unit}"), help);
        }
    }

    /// Checks limits and nominal position of a prismatic joint, whose angles at its motor are given.
    fn stroke(&mut self, angles: [f64; 3], travel_m_per_rad: f64) {
        let [min_m, max_m, nominal_m] = angles.map(|angle| rounded(angle * travel_m_per_rad));
        let mut sound = true;
        let most_m = (travel_m_per_rad * TAU * 1e4).floor() / 1e4;
        let positions_m = [min_m, max_m, nominal_m];
        for ((field, angle), position_m) in POSITIONS.into_iter().zip(angles).zip(positions_m) {
            // The comparison is false for NaN.
            let fits = angle.abs() <= TAU;
            if !fits {
                let help = format!(
                    "give a position within ±{most_m} m, or a `travel_m_per_rad` of at least {} m/rad: set-points of servos \
                     reach ±2π rad",
                    (position_m.abs() / TAU * 1e5).ceil() / 1e5
                );
                let problem = format!("is {position_m} m, {} rad of the motor", rounded(angle));
                self.violated(field, problem, help);
            }
            sound &= fits;
        }
        if !sound {
            return;
        }
        self.order(POSITIONS, positions_m, "a position", "m");
    }

    pub(super) fn actuator(&mut self, motor: &Actuator, speed_max_rad_s: f64) {
        let maxima = MotorMaxima::of(self.robot.total_mass_kg());
        let model = &motor.model;
        if model.is_empty() {
            self.violated("model", "is empty", "give the motor's model, such as \"XM430-W210-T\"");
        } else if model.len() > NAME_MAX || !is_plain_name(model) {
            let help = format!(
                "give the motor's model, such as \"XM430-W210-T\": 1 to {NAME_MAX} bytes of visible characters"
            );
            self.violated("model", format_args!("is \"{}\"", Excerpt::start_of(model)), help);
        }
        let rpm = "; 1 rev/min is 0.10472 rad/s";
        let zero = Bound::AtLeast(0.0);
        let positive = Bound::Above(0.0);
        self.range(
            "speed_max_rad_s",
            motor.speed_max_rad_s,
            positive,
            speed_max_rad_s,
            "rad/s",
            rpm,
        );
        let mm = "; divide N·mm by 1000";
        self.range("torque_max_nm", motor.torque_max_nm, positive, maxima.torque_nm, "N·m", mm);
        if let Some(line) = &motor.torque_speed {
            let stall_nm = line.stall_torque_nm;
            self.range(
                "stall_torque_nm",
                stall_nm,
                positive,
                maxima.torque_nm.max(1000.0),
                "N·m",
                mm,
            );
            let free_rad_s = line.no_load_speed_rad_s;
            self.range("no_load_speed_rad_s", free_rad_s, positive, 1000.0, "rad/s", rpm);
            // The line bounds the motor's capability: limits beyond its ends have no effect.
            if (f64::MIN_POSITIVE..motor.torque_max_nm).contains(&stall_nm) {
                let help = format!("give at most {stall_nm} N·m, or correct `stall_torque_nm`");
                let problem = format_args!("is {} N·m", motor.torque_max_nm);
                self.violated("torque_max_nm", problem, help);
            }
            if (f64::MIN_POSITIVE..motor.speed_max_rad_s).contains(&free_rad_s) {
                let help = format!(
                    "give at most {free_rad_s} rad/s, or correct `no_load_speed_rad_s`{rpm}"
                );
                let problem = format_args!("is {} rad/s", motor.speed_max_rad_s);
                self.violated("speed_max_rad_s", problem, help);
            }
        }
        self.range("kp_nm_rad", motor.kp_nm_rad, zero, maxima.kp_nm_rad, "N·m/rad", "");
        self.range("kd_nm_s_rad", motor.kd_nm_s_rad, zero, maxima.kd_nm_s_rad, "N·m·s/rad", "");
        let armature_max = maxima.armature_kg_m2;
        self.range("armature_kg_m2", motor.armature_kg_m2, positive, armature_max, "kg·m²", "");
        if motor.bus >= BUSES {
            let help = format!("a controller has buses 0 to {}", BUSES - 1);
            self.violated("bus", format_args!("is {}", motor.bus), help);
        }
        if motor.id > actuator::MAX_ID {
            let help = format!("motor addresses are 0 to {}", actuator::MAX_ID);
            self.violated("id", format_args!("is {}", motor.id), help);
        }
    }
}

/// Number without the rounding errors of a conversion.
fn rounded(value: f64) -> f64 {
    (value * 1e9).round() / 1e9
}
