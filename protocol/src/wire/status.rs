//! Class 3: how the controller is.

use super::{DecodeError, Kind, Node, coded};
use crate::can::CanFrame;

const STATUS: Kind = Kind::new(3, 0);
const FAULT: Kind = Kind::new(3, 1);

/// No clip, no channel.
const NONE: u8 = 0xFF;

coded! {
    /// State of the controller.
    State {
        /// Just started.
        Boot = 0,
        /// Checks itself, its library and its actuators.
        SelfTest = 1,
        /// Torque off, ready to be armed.
        Disarmed = 2,
        /// Moves slowly from the measured pose to the safe pose.
        Aligning = 3,
        /// Stands in the safe pose, waits for a command.
        Ready = 4,
        /// Plays a motion or a transition.
        Playing = 5,
        /// Holds in the middle of a motion.
        Paused = 6,
        /// On its way to the safe motion.
        Returning = 7,
        /// No stiffness, damping only.
        Damped = 8,
        /// Torque taken away after a fault; latched.
        TorqueOff = 9,
        /// Emergency stop; latched.
        EStopped = 10,
    }
}

coded! {
    /// The strongest reaction that is called for; the most severe wins.
    Severity {
        /// All is well.
        None = 0,
        /// Something to know about; the robot goes on.
        Notice = 1,
        /// Hold and return to the safe motion.
        Return = 2,
        /// Damp all joints.
        Damp = 3,
        /// Torque off.
        TorqueOff = 4,
        /// Emergency stop.
        EStop = 5,
    }
}

coded! {
    /// Faults by their bit in [`FaultBits`].
    Fault {
        /// No library, or it was refused.
        NoLibrary = 0,
        /// The library is for another robot configuration.
        ConfigMismatch = 1,
        /// The host's heartbeat stopped.
        HostLost = 2,
        /// An actuator does not answer.
        ActuatorSilent = 3,
        /// An actuator reports a fault.
        ActuatorFault = 4,
        /// A joint or wheel does not follow.
        TrackingError = 5,
        /// A measured position is outside its limits.
        OutOfLimits = 6,
        /// The body is tilted further than its motion makes it.
        Tilt = 7,
        /// Nobody acknowledges on an actuator bus.
        BusNoAck = 9,
        /// A bus is error-passive.
        BusPassive = 10,
        /// A bus is off.
        BusOff = 11,
        /// An emergency stop was received.
        EStop = 12,
        /// The control loop missed its time.
        Overrun = 13,
        /// The library changed or cannot be read during playback.
        LibraryUnreadable = 14,
        /// A state that should not be possible.
        Internal = 15,
    }
}

/// A set of faults. Any fault anywhere shows here.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultBits(pub u16);

impl FaultBits {
    /// The set with this fault.
    #[must_use]
    pub fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1 << fault.code())
    }

    /// Whether the fault is in the set.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 >> fault.code() & 1 != 0
    }

    /// No fault.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The faults of the set.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.iter().copied().filter(move |&fault| self.contains(fault))
    }
}

/// How the controller is, every [`super::STATUS_PERIOD_MS`] and on change.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Status {
    /// State.
    pub state: State,
    /// Strongest reaction that is called for.
    pub severity: Severity,
    /// All faults.
    pub faults: FaultBits,
    /// Clip that is played: motions, then transitions, as in the library.
    pub clip: Option<u8>,
    /// Frame of that clip, 0 to 4095.
    pub frame: u16,
    /// 0 to 15, one more (and around) with each status message.
    pub counter: u8,
    /// Low byte of the active library's identity; 0 without library.
    pub library: u8,
}

impl Status {
    /// `[crc8][state 4 low bits, severity 4 high bits][faults u16][clip u8, 255 none]
    /// [frame 12 low bits, counter 4 high bits: u16][library u8]`. A frame above 4095 is sent as
    /// 4095.
    pub fn encode(self, from: Node) -> CanFrame {
        let [f0, f1] = self.faults.0.to_le_bytes();
        let place = self.frame.min(0xFFF) | u16::from(self.counter & 0xF) << 12;
        let [p0, p1] = place.to_le_bytes();
        let head = self.state.code() | self.severity.code() << 4;
        STATUS.seal(from, [0, head, f0, f1, self.clip.unwrap_or(NONE), p0, p1, self.library])
    }

    /// Sender and status.
    pub fn decode(frame: &CanFrame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, head, f0, f1, clip, p0, p1, library]) = STATUS.unseal(frame)?;
        let place = u16::from_le_bytes([p0, p1]);
        let status = Self {
            state: State::from_code(head & 0xF).ok_or(DecodeError::BadValue)?,
            severity: Severity::from_code(head >> 4).ok_or(DecodeError::BadValue)?,
            faults: FaultBits(u16::from_le_bytes([f0, f1])),
            clip: (clip != NONE).then_some(clip),
            frame: place & 0xFFF,
            counter: (place >> 12) as u8,
            library,
        };
        Ok((node, status))
    }
}

/// One fault in detail, when it appears and once a second while it lasts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FaultReport {
    /// One more (and around) with each report.
    pub counter: u8,
    /// The fault.
    pub fault: Fault,
    /// Channel that it is about.
    pub channel: Option<u8>,
    /// The offending value in SI units, 0 when there is none; `docs/wire-format.md` says which for
    /// each fault.
    pub value: f32,
}

impl FaultReport {
    /// `[crc8][counter u8][fault u8][channel u8, 255 none][value f32]`
    pub fn encode(self, from: Node) -> CanFrame {
        let [v0, v1, v2, v3] = self.value.to_le_bytes();
        let channel = self.channel.unwrap_or(NONE);
        FAULT.seal(from, [0, self.counter, self.fault.code(), channel, v0, v1, v2, v3])
    }

    /// Sender and report.
    pub fn decode(frame: &CanFrame) -> Result<(Node, Self), DecodeError> {
        let (node, [_, counter, fault, channel, v0, v1, v2, v3]) = FAULT.unseal(frame)?;
        let report = Self {
            counter,
            fault: Fault::from_code(fault).ok_or(DecodeError::BadValue)?,
            channel: (channel != NONE).then_some(channel),
            value: f32::from_le_bytes([v0, v1, v2, v3]),
        };
        Ok((node, report))
    }
}
