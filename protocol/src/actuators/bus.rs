//! Protocol and settings of an actuator bus, from a robot file to the controller. A bus that the file omits has actuators of
//! the Rollwalk profile.

use heapless::Vec;
use serde::{Deserialize, Serialize};

pub use super::list::Protocol;
use super::{
    ActuatorCommand, Answers, Command, Gains, JointSetpoint, Refusal, UpdatePolicy, WheelSetpoint,
};
use crate::config::{Channel, ChannelKind};

/// Maximum number of actuator buses of a controller.
pub const MAX_BUSES: usize = 4;

/// Actuator buses of a controller; the index is the bus number.
pub type Buses = Vec<Bus, MAX_BUSES>;

/// Decodes buses from postcard, the encoding in firmware images. `None` if the bytes are not exactly one encoding.
pub fn decode(bytes: &[u8]) -> Option<Buses> {
    postcard::take_from_bytes(bytes).ok().and_then(|(buses, rest)| rest.is_empty().then_some(buses))
}

/// Bus with its actuators.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bus {
    /// Protocol of the actuators.
    pub protocol: Protocol,
    /// Bit rate of the bus, bit/s.
    pub bit_rate: u32,
    /// Side that computes the torque: drive or controller.
    pub control: ControlLoop,
    /// Source of the joint positions before torque is on.
    pub pose: Pose,
}

impl Default for Bus {
    /// Actuators of the Rollwalk profile at 1 Mbit/s.
    fn default() -> Self {
        Self {
            protocol: Protocol::Rollwalk,
            bit_rate: 1_000_000,
            control: ControlLoop::InDrive,
            pose: Pose::Measured,
        }
    }
}

impl Bus {
    /// True if the actuators of the bus accept torque commands.
    pub fn takes_torque(&self) -> bool {
        self.control == ControlLoop::OnController || self.protocol.capabilities().torque
    }

    /// True if the speed of a joint's set-point has an effect.
    pub fn takes_joint_speed(&self) -> bool {
        self.control == ControlLoop::OnController || self.protocol.capabilities().joint_speed
    }

    /// True if kp and kd of the actuators can be changed while they run.
    pub fn takes_gains(&self) -> bool {
        self.control == ControlLoop::OnController
            || self.protocol.capabilities().gains != UpdatePolicy::Never
    }

    /// True if a host may close a control loop over the actuators. Torque and gains must then take effect with every set-point.
    /// Gains that a drive stores do not qualify: they are sent to one actuator after the other, and may be lost.
    pub fn can_be_tracked(&self) -> bool {
        let gains = self.protocol.capabilities().gains;
        let at_once = gains == UpdatePolicy::EverySetpoint;
        self.takes_torque() && (self.control == ControlLoop::OnController || at_once)
    }

    /// Checks that the protocol can encode every command at the ends of a channel's limits.
    ///
    /// # Errors
    /// Returns the refusal of the first command that the protocol cannot encode.
    pub fn can_drive(&self, limits: &Channel) -> Result<(), Refusal> {
        let can = self.protocol.capabilities();
        let check = |command| self.protocol.check(&ActuatorCommand { id: limits.id, command });
        let wheel = limits.kind == ChannelKind::WheelSpeed;
        let fastest = if wheel { limits.max.max(-limits.min) } else { limits.max_rate };
        let Channel { kp_nm_rad, kd_nm_s_rad, max_torque_nm: torque_nm, .. } = *limits;
        check(Command::Disable)?;
        if can.query {
            check(Command::Query)?;
        }
        if can.limits == UpdatePolicy::Stored {
            check(Command::Limits { speed_rad_s: fastest, torque_nm })?;
        }
        // Stiff, damped and limp. A limp set-point replaces a query that the protocol lacks.
        let limp = can.answers == Answers::Always && !can.query;
        let gains = [(kp_nm_rad, kd_nm_s_rad), (0.0, kd_nm_s_rad), (0.0, 0.0)];
        let gains = gains.into_iter().take(if limp { 3 } else { 2 });
        let gains = gains.map(|(kp_nm_rad, kd_nm_s_rad)| Gains { kp_nm_rad, kd_nm_s_rad });
        if can.gains == UpdatePolicy::Stored {
            gains.clone().try_for_each(|gains| check(Command::Gains(gains)))?;
        }
        if self.control == ControlLoop::OnController {
            check(Command::EnableTorque)?;
            check(Command::Torque { torque_nm })?;
            return check(Command::Torque { torque_nm: -torque_nm });
        }
        // A drive that receives no torque limit delivers up to its protocol's scale, and the channel's limit is within that.
        let most_nm = if can.torque && can.limits == UpdatePolicy::Never { torque_nm } else { 0.0 };
        for (value, slope, torque_nm) in
            [(limits.min, -limits.max_rate, -most_nm), (limits.max, limits.max_rate, most_nm)]
        {
            check(if wheel {
                Command::EnableWheel
            } else {
                Command::EnableJoint { measured_rad: value }
            })?;
            for gains in gains.clone() {
                let sent = (can.gains == UpdatePolicy::EverySetpoint).then_some(gains);
                let limit =
                    (can.limits == UpdatePolicy::EverySetpoint).then_some(limits.max_torque_nm);
                check(if wheel {
                    Command::Wheel(WheelSetpoint {
                        speed_rad_s: value,
                        torque_nm,
                        kd_nm_s_rad: sent.map(|gains| gains.kd_nm_s_rad),
                        torque_limit_nm: limit,
                    })
                } else {
                    Command::Joint(JointSetpoint {
                        position_rad: value,
                        speed_rad_s: slope,
                        torque_nm,
                        gains: sent,
                    })
                })?;
            }
        }
        Ok(())
    }
}

/// Side that computes the torque: kp (q* − q) + kd (q̇* − q̇) of a joint, kd (ω* − ω) of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ControlLoop {
    /// The drive computes the torque at its own rate.
    InDrive,
    /// The controller computes the torque in each tick from the latest feedback, within the channel's limit, and sends it to
    /// the drive. Feedback older than two ticks is not used.
    OnController,
}

/// Source of the joint positions before torque is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pose {
    /// Measured by the actuators. Actuators that measure no position cannot be armed.
    Measured,
    /// Assumed, for actuators that measure no position. The first pose is SAFE, into which the operator must put the robot. Later
    /// poses are the previous set-points. A joint at another angle jumps to the assumed one.
    AssumedSafe,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Longest encoding of [`Buses`], bytes.
    const LONGEST: usize = 256;

    #[test]
    fn buses_come_back_from_their_encoding() {
        for protocol in Protocol::examples() {
            for (control, pose) in [
                (ControlLoop::InDrive, Pose::AssumedSafe),
                (ControlLoop::OnController, Pose::Measured),
            ] {
                let bus = Bus { protocol, bit_rate: 57_600, control, pose };
                let buses = Buses::from_slice(&[Bus::default(), bus, bus, bus]).unwrap();
                let mut buffer = [0; LONGEST];
                let bytes = postcard::to_slice(&buses, &mut buffer).unwrap();
                assert_eq!(decode(bytes), Some(buses), "{protocol:?}");
                // A cut packet, and a packet with trailing bytes, is not this packet.
                for cut in 0..bytes.len() {
                    assert_eq!(decode(&bytes[..cut]), None, "{protocol:?}");
                }
                let length = bytes.len();
                assert_eq!(decode(&buffer[..=length]), None, "{protocol:?}");
            }
        }
        assert_eq!(decode(&[0]), Some(Buses::new()));
        assert_eq!(decode(&[5, 0, 0, 0, 0]), None);
    }
}
