//! Codecs for servos and wheel drives of several makers. [`Codec`] has their common functions, [`CanCodec`] and [`SerialCodec`]
//! those of their transport. The makers' documents and this project's: `docs/actuators.md`.
//!
//! | module | speaks to | over |
//! |---|---|---|
//! | [`rollwalk`] | servos of the Rollwalk profile, [`crate::actuator`] | CAN, 11-bit identifiers |
//! | [`mit`] | mini cheetah drives and T-Motor's AK series | CAN, 11-bit identifiers |
//! | [`odrive`] | ODrive CANSimple, firmware 0.5 and 0.6 | CAN, 11-bit identifiers |
//! | [`cybergear`] | Xiaomi CyberGear | CAN, 29-bit identifiers |
//! | [`dynamixel`] | Dynamixel X, Protocol 2.0 | a half-duplex serial line |
//! | [`feetech`] | Feetech STS and SMS | a half-duplex serial line |
//! | [`maestro`] | hobby servos behind a Pololu Maestro | a serial line |
//! | [`list`] | the list of these, and the dispatch to their codecs | |
//! | [`bus`] | the protocol and the settings of a bus | |
//! | [`traffic`] | how much of a bus that takes | |
//!
//! Two rules hold for all. A command that the protocol cannot carry is refused, never dropped or clipped:
//! a damped hold that arrives as a stiff one breaks gears. And enabling takes the measured pose, which is
//! sent as a setpoint before torque comes on.

use core::fmt::Arguments;

use thiserror::Error;

pub mod bus;
pub mod cybergear;
pub mod dynamixel;
mod feedback;
pub mod feetech;
mod fixed;
pub mod list;
pub mod maestro;
pub mod mit;
mod named;
pub mod odrive;
pub mod rollwalk;
pub mod serial;
pub mod settings;
pub mod traffic;

pub use feedback::{Faults, Feedback};
pub use serial::{MAX_PACKET, Packet};
pub use traffic::Traffic;

use crate::can::Frame;
use serial::{Answer, ReceiveBuffer};
use settings::{Keys, Report};

/// A command for one actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActuatorCommand {
    /// Address of the actuator on its bus.
    pub id: u8,
    /// The command.
    pub command: Command,
}

/// Commands to an actuator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Switch torque off.
    Disable,
    /// Switch torque on and hold a joint at its measured position.
    EnableJoint {
        /// Measured position, rad.
        measured_rad: f32,
    },
    /// Switch torque on and hold a wheel at 0 rad/s.
    EnableWheel,
    /// Switch torque control on at 0 N·m, for [`Command::Torque`].
    EnableTorque,
    /// Request feedback; changes nothing.
    Query,
    /// Clear latched faults. Never switches torque on.
    ClearFaults,
    /// Store gains in the actuator ([`UpdatePolicy::Stored`]).
    Gains(Gains),
    /// Store limits in the actuator ([`UpdatePolicy::Stored`]).
    Limits {
        /// Largest speed, rad/s.
        speed_rad_s: f32,
        /// Largest torque, N·m.
        torque_nm: f32,
    },
    /// Setpoint of a joint: position in rad, speed in rad/s, torque in N·m.
    Joint(JointSetpoint),
    /// Setpoint of a wheel: speed in rad/s, torque in N·m.
    Wheel(WheelSetpoint),
    /// Setpoint of torque control, at any position and speed: the sender closes the loop.
    Torque {
        /// Torque, N·m.
        torque_nm: f32,
    },
}

/// Gains of torque = kp (q* − q) + kd (q̇* − q̇).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Stiffness kp, N·m/rad.
    pub kp_nm_rad: f32,
    /// Damping kd, N·m·s/rad.
    pub kd_nm_s_rad: f32,
}

/// Setpoint of a joint: torque = kp (q* − q) + kd (q̇* − q̇) + τ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSetpoint {
    /// Position q*, rad.
    pub position_rad: f32,
    /// Speed q̇*, rad/s: the slope of the positions. Protocols without a field for it leave it out.
    pub speed_rad_s: f32,
    /// Feed-forward torque τ, N·m. Not 0 only where [`Capabilities::torque`] is set.
    pub torque_nm: f32,
    /// kp and kd; present exactly where gains are [`UpdatePolicy::EverySetpoint`].
    pub gains: Option<Gains>,
}

/// Setpoint of a wheel: torque = kd (ω* − ω) + τ, within a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSetpoint {
    /// Speed ω*, rad/s.
    pub speed_rad_s: f32,
    /// Feed-forward torque τ, N·m. Not 0 only where [`Capabilities::torque`] is set.
    pub torque_nm: f32,
    /// kd, N·m·s/rad; present exactly where gains are [`UpdatePolicy::EverySetpoint`].
    pub kd_nm_s_rad: Option<f32>,
    /// Torque limit, N·m; present exactly where limits are [`UpdatePolicy::EverySetpoint`].
    pub torque_limit_nm: Option<f32>,
}

/// Reason why a command cannot be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// The protocol has no such address.
    #[error("address is beyond the largest of this protocol")]
    Address,
    /// The protocol has no field for this value, or no such command.
    #[error("this protocol cannot carry {0}")]
    Unsupported(&'static str),
    /// The protocol needs this value in every such command.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// NaN, infinite or beyond the protocol's scale.
    #[error("{0} is beyond its scale")]
    OutOfRange(&'static str),
}

/// Time at which a quantity is sent to an actuator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdatePolicy {
    /// Sent in every setpoint.
    EverySetpoint,
    /// Sent once, in a separate command.
    Stored,
    /// Never sent, or not in the units of this crate.
    Never,
}

/// Time at which an actuator sends feedback.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answers {
    /// After every command.
    Always,
    /// Sent on a timer of the actuator.
    Cyclic,
    /// After [`Command::Query`] only.
    OnQuery,
    /// Never.
    Never,
}

/// Reaction of an actuator's watchdog to missing commands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Watchdog {
    /// Stops, and stays stopped until it is cleared.
    Latches,
    /// Takes torque away until the next setpoint. The controller has to do the latching.
    Resumes,
    /// Moves to a position that was configured beforehand.
    GoesHome,
    /// Undocumented.
    Unknown,
    /// Absent: the actuator keeps following the last command.
    Missing,
}

/// Commands, values and answers that a protocol supports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// Joints can be commanded.
    pub joints: bool,
    /// Wheels can be commanded.
    pub wheels: bool,
    /// Time at which gains are sent.
    pub gains: UpdatePolicy,
    /// The largest gains that the protocol can carry.
    pub max_gains: Gains,
    /// Time at which speed and torque limits are sent; setpoints carry only the torque limit of wheels.
    pub limits: UpdatePolicy,
    /// The speed of a joint's setpoint has an effect.
    pub joint_speed: bool,
    /// Feed-forward torque is possible.
    pub torque: bool,
    /// [`Command::Torque`] is possible.
    pub torque_alone: bool,
    /// A wheel at a setpoint of 0 rad/s stands still. Where not, it creeps, by less than a step of its scale.
    pub exact_zero_speed: bool,
    /// Time at which actuators answer.
    pub answers: Answers,
    /// True if actuators measure their position. Otherwise the pose can only be assumed, and enabling may jump.
    pub measures_position: bool,
    /// True if actuators measure or estimate their torque.
    pub measures_torque: bool,
    /// [`Command::Query`] is possible. Where not, and it answers every command, a command that changes
    /// nothing takes its place.
    pub query: bool,
    /// True if actuators report whether their torque is on. Otherwise the state is taken from the last command.
    pub reports_enabled: bool,
    /// The pose can be read while torque is off: by [`Command::Query`], by [`Command::Disable`]
    /// again where that is answered, or because it comes on a timer.
    pub pose_while_disabled: bool,
    /// Reaction of the watchdog. Only the Rollwalk profile's watchdog is on from the factory.
    pub watchdog: Watchdog,
    /// Largest address.
    pub max_id: u8,
}

/// An actuator protocol with the settings of the actuators on one bus.
pub trait Codec: Copy + 'static {
    /// Unit of transmission: a CAN frame, or a packet for a serial line.
    type Sent;

    /// Settings as in practice, for tests.
    const EXAMPLES: &'static [Self];

    /// The name of the protocol or of the model, for people.
    fn name(&self) -> &'static str;

    /// Commands and settings that the protocol supports.
    fn capabilities(&self) -> Capabilities;

    /// True if `rollwalk dbc` describes the frames.
    fn has_dbc(&self) -> bool {
        false
    }

    /// Rate of the feedback that actuators send on a timer, Hz; `None` for those that answer.
    fn feedback_hz(&self) -> Option<u32> {
        None
    }

    /// Hands `send` the frames of one order, in the order in which they have to go out.
    ///
    /// # Errors
    /// The protocol has no frames for it; `send` was handed none.
    fn emit(
        &self,
        order: &ActuatorCommand,
        send: &mut dyn FnMut(Self::Sent),
    ) -> Result<(), Refusal>;

    /// Refuses an order that [`Self::emit`] would refuse.
    ///
    /// # Errors
    /// As [`Self::emit`].
    fn check(&self, order: &ActuatorCommand) -> Result<(), Refusal> {
        self.emit(order, &mut |_| {})
    }

    /// Hands `send` the frames of many orders, at most one for each actuator.
    ///
    /// # Errors
    /// The first order that is refused, by its place; `send` was handed nothing.
    fn encode(
        &self,
        orders: &[ActuatorCommand],
        send: &mut dyn FnMut(Self::Sent),
    ) -> Result<(), (usize, Refusal)> {
        for (i, order) in orders.iter().enumerate() {
            self.check(order).map_err(|refusal| (i, refusal))?;
        }
        for (i, order) in orders.iter().enumerate() {
            self.emit(order, send).map_err(|refusal| (i, refusal))?;
        }
        Ok(())
    }

    /// Largest traffic of setpoints for `actuators` actuators and of their answers.
    fn traffic(&self, actuators: u32) -> Traffic;

    /// Reads the settings from a robot file.
    fn from_keys(keys: &dyn Keys) -> Self;

    /// Bit rates that the actuators can be set to; empty where their makers name no list.
    fn bit_rates(&self) -> &'static [u32] {
        &[]
    }

    /// Reports settings that no actuator can have.
    fn check_settings(&self, report: &mut dyn Report) {
        let _ = report;
    }

    /// Reports the range of a quantity, by its name in [`Refusal::OutOfRange`], where the codec gives more detail than
    /// [`Capabilities`].
    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        let _ = (quantity, report);
    }
}

/// Feedback in a CAN frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decoded {
    /// Complete feedback, with a counter.
    Counted(crate::actuator::Feedback),
    /// Part of the feedback.
    Partial(Feedback),
}

/// A codec of CAN frames.
pub trait CanCodec: Codec<Sent = Frame> {
    /// The address and the feedback of a frame; `None` for frames that are none of the protocol's
    /// feedback, among them all whose identifier has another length.
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)>;

    /// Decodes the same feedback, with the counter of protocols whose frames are complete and counted.
    fn decode_counted(&self, received: &Frame) -> Option<(u8, Decoded)> {
        self.decode(received).map(|(id, feedback)| (id, Decoded::Partial(feedback)))
    }
}

/// A codec of packets on a serial line.
pub trait SerialCodec: Codec<Sent = Packet> {
    /// An adapter between the line and its actuators answers for all of them: one query is enough.
    const ADAPTER_ANSWERS: bool = false;

    /// Takes a received byte; `is_awaited` while an answer is due.
    fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, is_awaited: bool);

    /// Removes the next answer from the buffer; call again until `None`. When `is_silent`, the line has been
    /// quiet for longer than a byte takes, and an incomplete answer is dropped.
    fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer>;
}

/// Refuses addresses above `most`.
fn address(id: u8, most: u8) -> Result<(), Refusal> {
    if id <= most { Ok(()) } else { Err(Refusal::Address) }
}

/// Refuses a value that the protocol has no field for.
fn without<T>(value: Option<T>, name: &'static str) -> Result<(), Refusal> {
    if value.is_none() { Ok(()) } else { Err(Refusal::Unsupported(name)) }
}

/// Refuses a torque other than 0, for protocols without torque.
fn without_torque(torque_nm: f32) -> Result<(), Refusal> {
    if torque_nm == 0.0 { Ok(()) } else { Err(Refusal::Unsupported("torque")) }
}
