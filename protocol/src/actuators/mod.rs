//! Codecs for servos and wheel drives of several makers.
//!
//! [`Codec`] contains the common functions, [`CanCodec`] and [`SerialCodec`] those of a transport. Each module names the
//! documents of the maker.
//!
//! | module | actuators | transport |
//! |---|---|---|
//! | [`rollwalk`] | servos of the Rollwalk profile, [`crate::actuator`] | CAN, 11-bit identifiers |
//! | [`mit`] | mini cheetah drives and T-Motor's AK series | CAN, 11-bit identifiers |
//! | [`odrive`] | ODrive CANSimple, firmware 0.5 and 0.6 | CAN, 11-bit identifiers |
//! | [`cybergear`] | Xiaomi CyberGear | CAN, 29-bit identifiers |
//! | [`dynamixel`] | Dynamixel X, Protocol 2.0 | a half-duplex serial line |
//! | [`feetech`] | Feetech STS and SMS | a half-duplex serial line |
//! | [`maestro`] | hobby servos behind a Pololu Maestro | a serial line |
//!
//! [`list`] dispatches to the codecs, [`bus`] contains the protocol and the settings of a bus, and [`traffic`] its load.
//!
//! Two rules apply to all codecs. A command that the protocol cannot encode is refused, never dropped or clipped: gears break
//! if a damped hold arrives as a stiff one. Enabling takes the measured pose and sends it as a set-point before torque is on.
//!
//! Steps to add a protocol:
//!
//! 1. Append a row to [`list`]: module, type, transport, name in robot files. Keep the order of the rows, because the position
//!    of a row is part of the configuration hash.
//! 2. Write the codec. It checks its keys of `[[bus]]` and has example settings for tests. Put golden bytes into
//!    `protocol/tests/protocol/`.
//! 3. Write the simulated drive in `firmware/drives/src/` from the maker's documents, not from the codec: a `Drive` that
//!    implements `Electronics`.
//! 4. Describe the protocol in `docs/actuators.md`, and its keys in `docs/robot-files.md`.

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
pub use serial::{MAX_ON_LINE, MAX_PACKET, Packet};
pub use traffic::Traffic;

use crate::can::Frame;
use serial::{Answer, ReceiveBuffer};
use settings::{Keys, Report};

/// Command for one actuator.
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
    /// Switches torque off.
    Disable,
    /// Switches torque on and holds a joint at its measured position.
    EnableJoint {
        /// Measured position, rad.
        measured_rad: f32,
    },
    /// Switches torque on and holds a wheel at 0 rad/s.
    EnableWheel,
    /// Switches torque control on at 0 N·m, for [`Command::Torque`].
    EnableTorque,
    /// Requests feedback; changes nothing.
    Query,
    /// Requests temperature and supply voltage, which the answer to [`Command::Query`] lacks; changes nothing.
    QueryReadings,
    /// Clears latched faults. Never switches torque on.
    ClearFaults,
    /// Stores gains in the actuator ([`UpdatePolicy::Stored`]).
    Gains(Gains),
    /// Stores limits in the actuator ([`UpdatePolicy::Stored`]).
    Limits {
        /// Largest speed, rad/s.
        speed_rad_s: f32,
        /// Largest torque, N·m.
        torque_nm: f32,
    },
    /// Set-point of a joint: position in rad, speed in rad/s, torque in N·m.
    Joint(JointSetpoint),
    /// Set-point of a wheel: speed in rad/s, torque in N·m.
    Wheel(WheelSetpoint),
    /// Set-point of torque control, at any position and speed. The sender closes the loop.
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

/// Set-point of a joint: torque = kp (q* − q) + kd (q̇* − q̇) + τ.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointSetpoint {
    /// Position q*, rad.
    pub position_rad: f32,
    /// Speed q̇*, rad/s, the time derivative of the position. Protocols without a speed field ignore it.
    pub speed_rad_s: f32,
    /// Feed-forward torque τ, N·m. Must be 0 unless [`Capabilities::torque`] is set.
    pub torque_nm: f32,
    /// Gains kp and kd; present if and only if gains are [`UpdatePolicy::EverySetpoint`].
    pub gains: Option<Gains>,
}

/// Set-point of a wheel: torque = kd (ω* − ω) + τ, within a limit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelSetpoint {
    /// Speed ω*, rad/s.
    pub speed_rad_s: f32,
    /// Feed-forward torque τ, N·m. Must be 0 unless [`Capabilities::torque`] is set.
    pub torque_nm: f32,
    /// Gain kd, N·m·s/rad; present if and only if gains are [`UpdatePolicy::EverySetpoint`].
    pub kd_nm_s_rad: Option<f32>,
    /// Torque limit, N·m; present if and only if limits are [`UpdatePolicy::EverySetpoint`].
    pub torque_limit_nm: Option<f32>,
}

/// Reason why a command cannot be encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum Refusal {
    /// The address is outside the range of the protocol.
    #[error("the address exceeds the largest address of this protocol")]
    Address,
    /// The protocol lacks a field for the named value, or lacks the named command.
    #[error("this protocol cannot carry {0}")]
    Unsupported(&'static str),
    /// The command lacks the named value, which the protocol requires.
    #[error("{0} is missing")]
    Missing(&'static str),
    /// Value is NaN, infinite or beyond the protocol's scale.
    #[error("{0} exceeds the range of this protocol")]
    OutOfRange(&'static str),
}

/// Policy by which a quantity, such as a gain, is sent to an actuator.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum UpdatePolicy {
    /// Sent in every set-point.
    EverySetpoint,
    /// Sent once, in a separate command.
    Stored,
    /// The controller never sends the value, or the drive uses other units.
    Never,
}

/// Occasion on which an actuator sends feedback.
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
    /// The drive stops, and remains stopped until an operator clears the fault.
    Latches,
    /// Switches torque off until the next set-point. The controller has to latch the timeout.
    Resumes,
    /// Moves to a configured position.
    GoesHome,
    /// Undocumented.
    Unknown,
    /// Missing watchdog: the actuator keeps following the last command.
    Missing,
}

/// Commands, values and answers that a protocol supports.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capabilities {
    /// True if joints can be commanded.
    pub joints: bool,
    /// True if wheels can be commanded.
    pub wheels: bool,
    /// Policy by which gains are sent.
    pub gains: UpdatePolicy,
    /// Largest gains that the protocol can encode.
    pub max_gains: Gains,
    /// Policy by which speed and torque limits are sent. Set-points carry only the torque limit of wheels.
    pub limits: UpdatePolicy,
    /// True if the speed of a joint's set-point has an effect.
    pub joint_speed: bool,
    /// True if feed-forward torque is supported.
    pub torque: bool,
    /// True if [`Command::Torque`] is supported.
    pub torque_alone: bool,
    /// True if a wheel stands still at a set-point of 0 rad/s. Otherwise it creeps, since 0 lies between two codes.
    pub exact_zero_speed: bool,
    /// Occasion on which actuators answer.
    pub answers: Answers,
    /// True if actuators measure their position. Otherwise the pose is assumed, and joints may jump when enabled.
    pub measures_position: bool,
    /// True if actuators measure or estimate their torque.
    pub measures_torque: bool,
    /// True if [`Command::Query`] is supported. Otherwise a command that changes nothing replaces it, if the actuator answers
    /// every command.
    pub query: bool,
    /// True if [`Command::QueryReadings`] is supported. Other actuators report temperature and voltage, if at all, with their
    /// feedback.
    pub query_readings: bool,
    /// True if actuators report whether their torque is on. Otherwise the state follows from the last command.
    pub reports_enabled: bool,
    /// True if the pose can be read while torque is off: with [`Command::Query`], with a repeated [`Command::Disable`] that is
    /// answered, or from feedback on a timer.
    pub pose_while_disabled: bool,
    /// Reaction of the watchdog. Only servos of the Rollwalk profile have it switched on as delivered.
    pub watchdog: Watchdog,
    /// Largest address.
    pub max_id: u8,
}

/// Actuator protocol with the settings of the actuators on one bus.
pub trait Codec: Copy + 'static {
    /// Unit of transmission: a CAN frame, or a packet for a serial line.
    type Sent;

    /// Practical settings, for tests.
    const EXAMPLES: &'static [Self];

    /// Name of the protocol or of the actuator model, for messages.
    fn name(&self) -> &'static str;

    /// Commands and settings that the protocol supports.
    fn capabilities(&self) -> Capabilities;

    /// True if `rollwalk dbc` describes the frames.
    fn has_dbc(&self) -> bool {
        false
    }

    /// Rate of the feedback that actuators send on a timer, Hz; `None` if they answer commands instead.
    fn feedback_hz(&self) -> Option<u32> {
        None
    }

    /// Passes the frames of an order to `send`, in the sequence of transmission.
    ///
    /// # Errors
    /// Returns the reason if the protocol cannot encode the order; `send` is then not called.
    fn emit(
        &self,
        order: &ActuatorCommand,
        send: &mut dyn FnMut(Self::Sent),
    ) -> Result<(), Refusal>;

    /// Refuses an order that [`Self::emit`] would refuse.
    ///
    /// # Errors
    /// Returns the reason if the protocol cannot encode the order.
    fn check(&self, order: &ActuatorCommand) -> Result<(), Refusal> {
        self.emit(order, &mut |_| {})
    }

    /// Passes the frames of many orders to `send`, at most one order for each actuator.
    ///
    /// # Errors
    /// Returns the index of the first refused order and the reason; `send` is then not called.
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

    /// Maximum traffic of the set-points and answers of `actuators` actuators.
    fn traffic(&self, actuators: u32) -> Traffic;

    /// Reads the settings from a robot file.
    fn from_keys(keys: &dyn Keys) -> Self;

    /// Bit rates that the actuators can be set to, bit/s; empty if the maker publishes no list.
    fn bit_rates(&self) -> &'static [u32] {
        &[]
    }

    /// Reports settings that no actuator can have.
    fn check_settings(&self, report: &mut dyn Report) {
        let _ = report;
    }

    /// Reports the range of a quantity, if the codec has more detail than [`Capabilities`]. `quantity` is the name in
    /// [`Refusal::OutOfRange`].
    fn explain_range(&self, quantity: &'static str, report: &mut dyn FnMut(Arguments<'_>)) {
        let _ = (quantity, report);
    }
}

/// Feedback in a CAN frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decoded {
    /// Complete feedback, with a counter.
    Counted(crate::actuator::Feedback),
    /// Incomplete feedback, or feedback without a counter.
    Partial(Feedback),
}

/// Codec of CAN frames.
pub trait CanCodec: Codec<Sent = Frame> {
    /// Decodes the address and the feedback of a frame. `None` if the frame is not feedback of the protocol, or if its
    /// identifier has another length.
    fn decode(&self, received: &Frame) -> Option<(u8, Feedback)>;

    /// Decodes the feedback with its counter, if the protocol has complete and counted frames; otherwise as [`Self::decode`].
    fn decode_counted(&self, received: &Frame) -> Option<(u8, Decoded)> {
        self.decode(received).map(|(id, feedback)| (id, Decoded::Partial(feedback)))
    }
}

/// Codec of packets on a serial line.
pub trait SerialCodec: Codec<Sent = Packet> {
    /// True if an adapter between the line and its actuators answers for all of them, so that one query is enough.
    const ADAPTER_ANSWERS: bool = false;

    /// Stores a received byte; `is_awaited` is true while an answer is due.
    fn receive(&self, buffer: &mut ReceiveBuffer, byte: u8, is_awaited: bool);

    /// Removes the next answer from the buffer; call it until it returns `None`. `is_silent` is true if the line has been quiet
    /// for longer than a byte takes. An incomplete answer is then dropped.
    fn take(&self, buffer: &mut ReceiveBuffer, is_silent: bool) -> Option<Answer>;
}

/// Refuses an address above `most`.
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
