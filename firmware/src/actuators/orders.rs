//! Commands for an actuator.
//!
//! Turns a channel's limits and target into a command that the protocol can carry, or into the torque of the control law.

use rollwalk_protocol::actuator::Feedback;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop};
use rollwalk_protocol::actuators::{
    Capabilities, Command, Gains, JointSetpoint, UpdatePolicy, WheelSetpoint,
};
use rollwalk_protocol::config::{Channel, ChannelKind};

use crate::limiter::{Target, gains_within_torque};

/// Gains with which an actuator tracks its target.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum GainMode {
    /// Gains of the channel.
    #[default]
    Driven,
    /// Damping without stiffness for a joint; braking for a wheel.
    Damped,
}

/// Request other than a set-point, as a bit of [`PendingRequests`], in order of urgency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DriveRequest {
    Disable = 1 << 0,
    ClearFaults = 1 << 1,
    Limits = 1 << 2,
    Gains = 1 << 3,
    Enable = 1 << 4,
    Query = 1 << 5,
    QueryReadings = 1 << 6,
}

/// Pending requests to an actuator: at most one of each kind, without a queue.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PendingRequests(u8);

impl PendingRequests {
    pub const NOTHING: Self = Self(0);

    pub fn of(request: DriveRequest) -> Self {
        Self(request as u8)
    }

    pub fn and(self, request: DriveRequest) -> Self {
        Self(self.0 | request as u8)
    }

    pub fn and_if(self, condition: bool, request: DriveRequest) -> Self {
        if condition { self.and(request) } else { self }
    }

    pub fn without(self, request: DriveRequest) -> Self {
        Self(self.0 & !(request as u8))
    }

    pub fn has(self, request: DriveRequest) -> bool {
        self.0 & request as u8 != 0
    }

    /// Drops requests to switch torque or to query the pose, because a set-point replaces them.
    pub fn without_switches(self) -> Self {
        self.without(DriveRequest::Disable)
            .without(DriveRequest::Enable)
            .without(DriveRequest::Query)
    }

    /// Most urgent request.
    pub fn first(self) -> Option<DriveRequest> {
        Some(match self.0.trailing_zeros() {
            0 => DriveRequest::Disable,
            1 => DriveRequest::ClearFaults,
            2 => DriveRequest::Limits,
            3 => DriveRequest::Gains,
            4 => DriveRequest::Enable,
            5 => DriveRequest::Query,
            6 => DriveRequest::QueryReadings,
            _ => return None,
        })
    }
}

/// Builds the command for a request. `kept` are the gains to store in the drive; `None` selects those of the channel.
pub fn command(
    request: DriveRequest,
    limits: &Channel,
    bus: &Bus,
    can: &Capabilities,
    kept: Option<Gains>,
    feedback: &Feedback,
) -> Command {
    match request {
        DriveRequest::Disable => Command::Disable,
        DriveRequest::ClearFaults => Command::ClearFaults,
        DriveRequest::Limits => {
            Command::Limits { speed_rad_s: fastest(limits), torque_nm: limits.max_torque_nm }
        }
        DriveRequest::Gains => {
            Command::Gains(kept.unwrap_or_else(|| gains(limits, GainMode::Driven)))
        }
        DriveRequest::Enable if bus.control == ControlLoop::OnController => Command::EnableTorque,
        DriveRequest::Enable => match limits.kind {
            ChannelKind::JointPosition => {
                Command::EnableJoint { measured_rad: feedback.position_rad }
            }
            ChannelKind::WheelSpeed => Command::EnableWheel,
        },
        DriveRequest::QueryReadings => Command::QueryReadings,
        DriveRequest::Query if can.query => Command::Query,
        // Without a command for queries, the controller sends one that changes nothing. The actuator answers every command.
        DriveRequest::Query if feedback.status.enabled() => limp(limits, feedback),
        DriveRequest::Query => Command::Disable,
    }
}

/// Gains of a channel for a kind of hold.
pub fn gains(limits: &Channel, hold: GainMode) -> Gains {
    let kp_nm_rad = if hold == GainMode::Driven { limits.kp_nm_rad } else { 0.0 };
    Gains { kp_nm_rad, kd_nm_s_rad: limits.kd_nm_s_rad }
}

/// Largest speed of a channel, rad/s.
fn fastest(limits: &Channel) -> f32 {
    match limits.kind {
        ChannelKind::JointPosition => limits.max_rate,
        ChannelKind::WheelSpeed => limits.max.max(-limits.min),
    }
}

/// Zero-torque command for drives that receive gains with every set-point.
fn limp(limits: &Channel, feedback: &Feedback) -> Command {
    match limits.kind {
        ChannelKind::JointPosition => Command::Joint(JointSetpoint {
            position_rad: feedback.position_rad,
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            gains: Some(Gains { kp_nm_rad: 0.0, kd_nm_s_rad: 0.0 }),
        }),
        ChannelKind::WheelSpeed => Command::Wheel(WheelSetpoint {
            speed_rad_s: 0.0,
            torque_nm: 0.0,
            kd_nm_s_rad: Some(0.0),
            torque_limit_nm: None,
        }),
    }
}

/// Computes the torque for a target, clamped to the channel's limit.
pub fn torque(limits: &Channel, target: Target, hold: GainMode, feedback: &Feedback) -> Command {
    let Gains { kp_nm_rad: kp, kd_nm_s_rad: kd } = gains(limits, hold);
    let asked = match limits.kind {
        ChannelKind::JointPosition => {
            kp * (target.value - feedback.position_rad)
                + kd * (target.slope - feedback.velocity_rad_s)
        }
        ChannelKind::WheelSpeed => kd * (target.value - feedback.velocity_rad_s),
    };
    let asked = asked + target.torque_nm;
    // `clamp` would panic on limits that are NaN.
    let within = asked.max(-limits.max_torque_nm).min(limits.max_torque_nm);
    Command::Torque { torque_nm: if asked.is_finite() { within } else { 0.0 } }
}

/// Builds the set-point command for a target. Returns `None` for a joint that must be damped but whose drive cannot damp: it
/// must be disabled.
pub fn setpoint(
    limits: &Channel,
    can: &Capabilities,
    target: Target,
    hold: GainMode,
    feedback: &Feedback,
) -> Option<Command> {
    let Gains { kp_nm_rad: kp, kd_nm_s_rad: kd } = gains(limits, hold);
    let speed_error = |target: f32| target - feedback.velocity_rad_s;
    Some(match limits.kind {
        ChannelKind::JointPosition => {
            let (kp_nm_rad, kd_nm_s_rad, torque_nm) = gains_within_torque(
                (kp, kd, target.torque_nm),
                target.value - feedback.position_rad,
                speed_error(target.slope),
                limits.max_torque_nm,
            );
            let gains = match can.gains {
                UpdatePolicy::EverySetpoint => Some(Gains { kp_nm_rad, kd_nm_s_rad }),
                // The drive's own limit holds for the sum.
                UpdatePolicy::Stored => None,
                UpdatePolicy::Never if hold == GainMode::Damped => return None,
                UpdatePolicy::Never => None,
            };
            Command::Joint(JointSetpoint {
                position_rad: target.value,
                speed_rad_s: target.slope,
                torque_nm,
                gains,
            })
        }
        ChannelKind::WheelSpeed => {
            let most = limits.max_torque_nm;
            let (_, scaled_kd, scaled_nm) = gains_within_torque(
                (0.0, kd, target.torque_nm),
                0.0,
                speed_error(target.value),
                most,
            );
            let (kd, torque_nm, torque_limit_nm) = match can.limits {
                UpdatePolicy::EverySetpoint => (kd, target.torque_nm, Some(most)),
                // The drive has no limit of its own, or its limit may be wrong.
                UpdatePolicy::Stored | UpdatePolicy::Never => (scaled_kd, scaled_nm, None),
            };
            Command::Wheel(WheelSetpoint {
                speed_rad_s: target.value,
                torque_nm,
                kd_nm_s_rad: (can.gains == UpdatePolicy::EverySetpoint).then_some(kd),
                torque_limit_nm,
            })
        }
    })
}
