//! Codec of the Rollwalk servo profile. [`crate::actuator`] defines its frames and units.

use super::settings::Keys;
use super::{
    ActuatorCommand, Answers, CanCodec, Capabilities, Codec, Command, Decoded, Faults, Feedback,
    Refusal, Traffic, UpdatePolicy, Watchdog,
};
use crate::actuator::{self, ActuatorStatus, Control};
use crate::can::{Frame, worst_case_bits};

/// Servos and wheel drives of the Rollwalk profile.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Rollwalk;

/// Faults for the bits of [`ActuatorStatus`].
const FAULTS: [(u32, Faults); 4] = [
    (ActuatorStatus::TIMED_OUT as u32, Faults::TIMED_OUT),
    (ActuatorStatus::OVERHEATED as u32, Faults::OVERHEATED),
    (ActuatorStatus::BAD_VOLTAGE as u32, Faults::BAD_VOLTAGE),
    (ActuatorStatus::HARDWARE as u32, Faults::OTHER),
];

fn frame(id: u8, command: &Command) -> Result<Frame, Refusal> {
    let control = |control: Control| control.encode(id).ok_or(Refusal::Address);
    match *command {
        // Disabling clears a timeout. Enabling forgets earlier setpoints, so it needs no pose.
        Command::Disable | Command::ClearFaults => control(Control::Disable),
        Command::EnableJoint { .. } | Command::EnableWheel => control(Control::Enable),
        Command::Query => control(Control::Query),
        Command::QueryReadings => Err(Refusal::Unsupported("readings")),
        Command::Gains(_) => Err(Refusal::Unsupported("gains outside setpoints")),
        Command::Limits { .. } => Err(Refusal::Unsupported("limits outside setpoints")),
        Command::EnableTorque | Command::Torque { .. } => Err(Refusal::Unsupported("torque")),
        Command::Joint(joint) => {
            let gains = joint.gains.ok_or(Refusal::Missing("gains"))?;
            let setpoint = actuator::JointSetpoint {
                position_rad: joint.position_rad,
                velocity_rad_s: joint.speed_rad_s,
                kp_nm_rad: gains.kp_nm_rad,
                kd_nm_s_rad: gains.kd_nm_s_rad,
                torque_nm: joint.torque_nm,
            };
            setpoint.encode(id).ok_or(Refusal::OutOfRange("setpoint"))
        }
        Command::Wheel(wheel) => {
            let setpoint = actuator::WheelSetpoint {
                speed_rad_s: wheel.speed_rad_s,
                kd_nm_s_rad: wheel.kd_nm_s_rad.ok_or(Refusal::Missing("kd"))?,
                torque_limit_nm: wheel.torque_limit_nm.ok_or(Refusal::Missing("torque limit"))?,
                torque_nm: wheel.torque_nm,
            };
            setpoint.encode(id).ok_or(Refusal::OutOfRange("setpoint"))
        }
    }
}

impl Codec for Rollwalk {
    type Sent = Frame;

    const EXAMPLES: &'static [Self] = &[Self];

    fn name(&self) -> &'static str {
        "Rollwalk"
    }

    fn has_dbc(&self) -> bool {
        true
    }

    fn capabilities(&self) -> Capabilities {
        Capabilities {
            joints: true,
            wheels: true,
            gains: UpdatePolicy::EverySetpoint,
            max_gains: super::Gains {
                kp_nm_rad: actuator::MAX_KP_NM_RAD,
                kd_nm_s_rad: actuator::MAX_KD_NM_S_RAD,
            },
            limits: UpdatePolicy::EverySetpoint,
            joint_speed: true,
            torque: true,
            torque_alone: false,
            exact_zero_speed: true,
            answers: Answers::Always,
            measures_position: true,
            measures_torque: true,
            query: true,
            query_readings: false,
            reports_enabled: true,
            pose_while_disabled: true,
            watchdog: Watchdog::Latches,
            max_id: actuator::MAX_ID,
        }
    }

    fn emit(&self, order: &ActuatorCommand, send: &mut dyn FnMut(Frame)) -> Result<(), Refusal> {
        super::address(order.id, actuator::MAX_ID)?;
        send(frame(order.id, &order.command)?);
        Ok(())
    }

    fn traffic(&self, actuators: u32) -> Traffic {
        let bits_per_period = actuators.saturating_mul(2 * worst_case_bits(8));
        Traffic { bits_per_period, ..Traffic::default() }
    }

    fn from_keys(_: &dyn Keys) -> Self {
        Self
    }
}

impl CanCodec for Rollwalk {
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)> {
        let (id, feedback) = actuator::Feedback::decode(received)?;
        let feedback = Feedback {
            position_rad: Some(feedback.position_rad),
            speed_rad_s: Some(feedback.velocity_rad_s),
            torque_nm: Some(feedback.torque_nm),
            temperature_c: None,
            voltage_v: None,
            enabled: Some(feedback.status.enabled()),
            faults: Some(Faults::translate(
                u32::from(feedback.status.0 & ActuatorStatus::FAULTS),
                &FAULTS,
            )),
        };
        Some((id, feedback))
    }

    fn decode_counted(&self, received: &Frame) -> Option<(u8, Decoded)> {
        actuator::Feedback::decode(received).map(|(id, feedback)| (id, Decoded::Counted(feedback)))
    }
}
