//! Channels: the motors of a robot, in the order of the controller.

use crate::GRAVITY_M_S2;
use crate::actuator::Actuator;
use crate::linkage::CrankMap;
use crate::model::{EndEffector, Joint, Robot};
use rollwalk_protocol::config::{self, ChannelKind};

/// Motor-driven degree of freedom, in channel order (`docs/conventions.md`).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Channel<'r> {
    /// Joint, commanded by angle.
    Joint(&'r Joint),
    /// Actuated wheel, commanded by motor speed.
    Wheel(&'r EndEffector, &'r Actuator),
}

impl Channel<'_> {
    /// Name of the joint or end effector.
    pub fn name(&self) -> &str {
        match self {
            Channel::Joint(joint) => &joint.name,
            Channel::Wheel(wheel, _) => &wheel.name,
        }
    }

    /// Motor of the channel.
    pub fn actuator(&self) -> &Actuator {
        match self {
            Channel::Joint(joint) => &joint.actuator,
            Channel::Wheel(_, actuator) => actuator,
        }
    }

    /// Limits, gains and address of the channel of a valid robot for the controller. A coupled servo has the range that the
    /// limits of its joints allow.
    pub fn config(&self, robot: &Robot) -> config::Channel {
        let actuator = self.actuator();
        let (kind, min, max, max_rate) = match self {
            Channel::Joint(joint) => {
                let [min_rad, max_rad] = servo_range(joint, robot);
                (ChannelKind::JointPosition, min_rad, max_rad, actuator.speed_max_rad_s)
            }
            Channel::Wheel(wheel, _) => {
                let grip = wheel.friction_coefficient * GRAVITY_M_S2 / wheel.radius_m;
                let spin_up = actuator.torque_max_nm / actuator.armature_kg_m2;
                let speed = actuator.speed_max_rad_s;
                (ChannelKind::WheelSpeed, -speed, speed, grip.min(spin_up))
            }
        };
        config::Channel {
            kind,
            min: min as f32,
            max: max as f32,
            max_rate: max_rate as f32,
            max_torque_nm: actuator.torque_max_nm as f32,
            kp_nm_rad: actuator.kp_nm_rad as f32,
            kd_nm_s_rad: actuator.kd_nm_s_rad as f32,
            bus: actuator.bus,
            id: actuator.id,
        }
    }
}

/// Range of a joint's servo, rad.
pub(crate) fn servo_range(joint: &Joint, robot: &Robot) -> [f64; 2] {
    if !joint.is_coupled() {
        return [joint.position_min_rad, joint.position_max_rad];
    }
    if joint.linkage.is_some() {
        return crank_range(joint, robot).unwrap_or_default();
    }
    let end = |is_upper: bool| {
        let ratios = joint.motor_per_joint.iter();
        let terms = ratios.filter_map(|of| Some((of.ratio, robot.joints.get(of.joint)?)));
        terms
            .map(|(ratio, of)| {
                let upper = is_upper == (ratio > 0.0);
                ratio * if upper { of.position_max_rad } else { of.position_min_rad }
            })
            .sum::<f64>()
    };
    [end(false), end(true)]
}

/// Range of a servo with crank and rod over the limits of its joints, rad.
fn crank_range(joint: &Joint, robot: &Robot) -> Option<[f64; 2]> {
    let crank = CrankMap::new(robot, joint, joint.linkage.as_ref()?)?;
    let mut range_rad = [f64::INFINITY, f64::NEG_INFINITY];
    crank.for_each_pose(robot, |joint_rad| {
        let angle_rad = crank.angle_rad(joint_rad);
        range_rad = [range_rad[0].min(angle_rad), range_rad[1].max(angle_rad)];
        true
    });
    Some(range_rad)
}

impl Robot {
    /// Indices of the joints with a servo, in channel order.
    pub fn driven_joints(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.joints.len()).filter(|&joint| !self.joints[joint].is_passive())
    }

    /// Values of the joints with a servo, in channel order, from values of all joints.
    pub fn of_driven_joints<'a, T: Copy>(
        &'a self,
        of_joints: &'a [T],
    ) -> impl Iterator<Item = T> + 'a {
        self.driven_joints().map(|joint| of_joints[joint])
    }

    /// Values of all joints: those of the channels for joints with a servo, and the given ones for passive joints.
    pub fn all_joints(
        &self,
        of_channels: impl IntoIterator<Item = f64>,
        of_passive: impl Fn(usize, &Joint) -> f64,
    ) -> Vec<f64> {
        let mut of_channels = of_channels.into_iter();
        let mut value = |(index, joint): (usize, &Joint)| {
            let driven = if joint.is_passive() { None } else { of_channels.next() };
            driven.unwrap_or_else(|| of_passive(index, joint))
        };
        self.joints.iter().enumerate().map(&mut value).collect()
    }

    /// True if the speed of a channel's set-points has an effect. Some servos accept no speed for joints.
    pub fn takes_speed(&self, channel: &Channel<'_>) -> bool {
        let bus = self.buses.get(&channel.actuator().bus).copied().unwrap_or_default();
        matches!(channel, Channel::Wheel(..)) || bus.takes_joint_speed()
    }

    /// Largest time by which a joint lags behind set-points without speed, kd/kp, s. `None` if all set-points have a speed.
    pub fn joint_lag_s(&self) -> Option<f64> {
        let lagging = self.channels().filter(|channel| !self.takes_speed(channel));
        let lags = lagging.map(|channel| {
            let motor = channel.actuator();
            motor.kd_nm_s_rad / motor.kp_nm_rad
        });
        lags.reduce(f64::max)
    }

    /// Channels of the robot: joints with a servo in file order, then actuated wheels in end-effector order.
    pub fn channels(&self) -> impl Iterator<Item = Channel<'_>> {
        let wheels = self.end_effectors.iter().filter_map(|end_effector| {
            Some(Channel::Wheel(end_effector, end_effector.contact.actuator()?))
        });
        self.driven_joints().map(|joint| Channel::Joint(&self.joints[joint])).chain(wheels)
    }
}
