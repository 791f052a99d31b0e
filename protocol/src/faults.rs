//! Catalogue of the faults and events of the safety state machine, with their texts and reactions.
//!
//! A fault consists of a row of [`Fault`], a row of the [`Event`] that raises it, and a section of `docs/faults.md`. A line of
//! firmware raises the event and measures its value. Reactions, reports, advice, the DBC files and the tables in `docs/` follow
//! from the rows. Firmware calls only the functions that return codes and severities, so that no text gets into its image.

use core::fmt;

use crate::coded::coded;

coded! {
    /// Reaction of the controller. Of several reactions, the controller takes the strongest.
    #[derive(PartialOrd, Ord)]
    Severity {
        /// Normal operation: no reaction.
        None = 0,
        /// Reported; the robot continues.
        Notice = 1,
        /// Return to the safe motion and hold there.
        Return = 2,
        /// Damp all joints.
        Damp = 3,
        /// Torque off.
        TorqueOff = 4,
        /// Emergency stop.
        EStop = 5,
    }
}

/// Texts that describe a fault in reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Short description.
    pub name: &'static str,
    /// First step of the fault's section in `docs/faults.md`.
    pub advice: &'static str,
    /// Meaning of `channel` in the fault's report; empty if the report has no channel.
    pub channel: &'static str,
    /// Meaning of `value` in the fault's report; `None` if the report has no value.
    pub value: Option<Quantity>,
}

/// Meaning of the value in a fault report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Quantity with its unit, in ASCII, and its meaning.
    Measured(&'static str, &'static str),
    /// Quantity like [`Measured`](Self::Measured). Negative values have the third text as their meaning.
    MeasuredUnless(&'static str, &'static str, &'static str),
    /// Number of an item, such as a bus.
    Number(&'static str),
    /// Byte of flags and its meaning.
    Flags(&'static str),
}

impl Quantity {
    /// Unit of the value; empty for numbers and flags.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Measured(unit, _) | Self::MeasuredUnless(unit, ..) => unit,
            Self::Number(_) | Self::Flags(_) => "",
        }
    }

    /// Text of a value with its unit and meaning.
    pub fn reading(self, value: f32) -> impl fmt::Display {
        fmt::from_fn(move |f| match self {
            Self::MeasuredUnless(_, _, negative) if value < 0.0 => f.write_str(negative),
            Self::Measured(unit, what) | Self::MeasuredUnless(unit, what, _) => {
                write!(f, "{value:.3} {unit} {what}")
            }
            Self::Number(what) => write!(f, "{what} {value}"),
            Self::Flags(what) => write!(f, "{what} {:#04x}", value as u8),
        })
    }
}

impl fmt::Display for Quantity {
    /// Writes the unit and the meaning of the value.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured(unit, what) => write!(f, "{unit} {what}"),
            Self::MeasuredUnless(unit, what, negative) => {
                write!(f, "{unit} {what}, negative: {negative}")
            }
            Self::Number(what) | Self::Flags(what) => f.write_str(what),
        }
    }
}

/// Defines [`Fault`] by rows: bit, short description and advice, then the meanings of channel and value in its report.
macro_rules! faults {
    ($(
        $(#[$doc:meta])*
        $fault:ident = $bit:literal: $name:literal, $advice:literal
        $(, channel $channel:literal)? $(, value $value:expr)?;
    )*) => {
        coded! {
            /// Faults, numbered by their bit in [`FaultBits`].
            Fault { $($(#[$doc])* $fault = $bit,)* }
        }

        impl Fault {
            /// Texts that describe the fault in reports.
            pub const fn description(self) -> Description {
                use Quantity::{Flags, Measured, MeasuredUnless, Number};
                let (name, advice, channel, value) = match self {
                    $(Self::$fault => {
                        ($name, $advice, concat!($($channel)?), faults!(@value $($value)?))
                    })*
                };
                Description { name, advice, channel, value }
            }
        }
    };
    (@value) => { None };
    (@value $value:expr) => { Some($value) };
}

faults! {
    /// Library missing or refused.
    NoLibrary = 0: "no valid library", "flash a library, then arm";
    /// Library is for another robot configuration.
    ConfigMismatch = 1: "library for another robot",
        "flash a library that was built from this robot's file";
    /// The host's heartbeat stopped.
    HostLost = 2: "heartbeat lost", "find out why heartbeats did not arrive; clear the fault, then arm",
        value Measured("s", "since the last heartbeat");
    /// An actuator does not answer.
    ActuatorSilent = 3: "an actuator does not answer",
        "check motor power and this actuator's cable; clear the fault, then arm",
        channel "longest silent", value Measured("s", "since its last feedback");
    /// An actuator reports a fault, or dropped its torque.
    ActuatorFault = 4: "an actuator reports a fault",
        "read the drive's error code, and let the drive cool; clear the fault, then arm",
        channel "first with a fault", value Flags("status byte");
    /// A joint does not follow its set-point.
    TrackingError = 5: "a joint or wheel does not follow",
        "free the joint, and check its torque limit and gain; clear the fault, then arm",
        channel "furthest from its setpoint", value Measured("rad", "from its setpoint");
    /// A measured position is outside its limits.
    OutOfLimits = 6: "a joint is outside its limits",
        "turn the joint back into its range by hand, then arm",
        channel "first outside its limits", value Measured("rad", "measured");
    /// The body is tilted further than its motion requires.
    Tilt = 7: "the body is tilted", "set the robot upright with torque off; clear the fault, then arm",
        value MeasuredUnless("rad", "beyond the tilt of its motion", "the IMU is silent");
    /// Streamed set-points came too late.
    SetpointTimeout = 8: "streamed setpoints arrived too late",
        "find out what delays the host or the link; clear the fault, then arm",
        value Measured("s", "since the last frame of setpoints");
    /// Frames on an actuator bus lack an acknowledgement.
    BusNoAck = 9: "no node acknowledges on an actuator bus",
        "check motor power and the actuator bus; clear the fault, then arm", value Number("bus");
    /// An actuator bus is error-passive.
    BusPassive = 10: "a bus is error-passive",
        "check termination and bit rates of the actuator bus; clear the fault, then arm", value Number("bus");
    /// An actuator bus is off.
    BusOff = 11: "a bus is off", "switch motor power off, and repair the bus; clear the fault, then arm",
        value Number("bus");
    /// An emergency stop was received.
    EStop = 12: "emergency stop", "find out why the emergency stop was pressed, and inspect the \
        robot; clear the fault, then arm";
    /// The control loop missed its deadline.
    Overrun = 13: "a control period began too late",
        "find out what delays the control loop; clear the fault, then arm",
        value Measured("s", "from one tick to the next");
    /// The library changed or cannot be read during playback.
    LibraryUnreadable = 14: "the library cannot be read",
        "flash the library again; clear the fault, then arm";
    /// Configuration or settings cannot be used.
    Internal = 15: "internal error", "build the firmware again, because its configuration is \
        unusable";
}

impl Fault {
    /// Events that raise this fault.
    pub fn events(self) -> impl Iterator<Item = Event> {
        Event::ALL.iter().copied().filter(move |event| event.fault() == Some(self))
    }

    /// Weakest reaction to expect while torque is on. A fault without an event only prevents arming, and has
    /// [`Severity::Notice`].
    pub fn least_severity(self) -> Severity {
        self.events().map(Event::severity).min().unwrap_or(Severity::Notice)
    }

    /// Strongest reaction that the fault can cause.
    pub fn severity(self) -> Severity {
        self.events().map(Event::severity).max().unwrap_or(Severity::Notice)
    }
}

/// Set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultBits(pub u16);

impl FaultBits {
    /// Returns the set with `fault` added.
    #[must_use]
    pub fn with(self, fault: Fault) -> Self {
        Self(self.0 | 1 << fault.code())
    }

    /// True if the fault is in the set.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 >> fault.code() & 1 != 0
    }

    /// True if the set is empty.
    pub fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Faults of the set, in the order of their bits.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.iter().copied().filter(move |&fault| self.contains(fault))
    }

    /// Fault to repair first: the most severe one. Among equals, it is the fault whose event the controller handles first.
    pub fn first(self) -> Option<Fault> {
        let urgency = |fault: &Fault| {
            let event = fault.events().map(|event| core::cmp::Reverse(event.code())).max();
            // Without an event, the more specific fault has the higher code.
            (fault.severity(), event, fault.code())
        };
        self.iter().max_by_key(urgency)
    }
}

/// Defines [`Event`] by rows: code, severity, fault that the event raises, and description as a clause.
macro_rules! events {
    ($(
        $(#[$doc:meta])*
        $event:ident = $code:literal: $severity:ident, $fault:expr, $description:literal;
    )*) => {
        coded! {
            /// Events that can change the state of the controller, with their codes in the log.
            Event { $($(#[$doc])* $event = $code,)* }
        }

        impl Event {
            /// Reaction to the event while torque is on.
            pub const fn severity(self) -> Severity {
                match self {
                    $(Self::$event => Severity::$severity,)*
                }
            }

            /// Fault that the event raises; `None` if it raises no fault.
            pub const fn fault(self) -> Option<Fault> {
                match self {
                    $(Self::$event => $fault,)*
                }
            }

            /// Description of the event, as a clause.
            pub const fn description(self) -> &'static str {
                match self {
                    $(Self::$event => $description,)*
                }
            }
        }
    };
}

events! {
    /// Emergency stop from the link or from the board.
    EStop = 0: EStop, Some(Fault::EStop), "emergency stop";
    /// An actuator bus is off, so the controller cannot reach its actuators.
    BusOff = 1: EStop, Some(Fault::BusOff), "an actuator bus is off";
    /// Configuration or settings cannot be used.
    SelfTestFailed = 2: TorqueOff, Some(Fault::Internal),
        "the configuration or settings cannot be used";
    /// An actuator has been silent for too many ticks.
    FeedbackLost = 3: Damp, Some(Fault::ActuatorSilent), "an actuator did not answer";
    /// An actuator reports a fault or has dropped its torque.
    ActuatorFault = 4: Damp, Some(Fault::ActuatorFault),
        "an actuator reported a fault or dropped its torque";
    /// Frames on an actuator bus lack an acknowledgement.
    NotAcknowledged = 5: Damp, Some(Fault::BusNoAck), "no node acknowledged on an actuator bus";
    /// An actuator bus is error-passive, and about to go off.
    BusPassive = 6: Damp, Some(Fault::BusPassive), "an actuator bus has become error-passive";
    /// The body is tilted beyond recovery by any motion.
    Tipped = 7: Damp, Some(Fault::Tilt), "the body was about to fall over";
    /// A joint has been far from its set-point for too long.
    NotFollowing = 8: Damp, Some(Fault::TrackingError), "a joint did not follow";
    /// Playback of a validated library failed.
    PlaybackFailed = 9: Damp, Some(Fault::LibraryUnreadable), "the library could not be played";
    /// The control loop was so late that set-points are outdated.
    Overrun = 10: Damp, Some(Fault::Overrun), "a control tick was too late";
    /// The SAFE pose was not reached in time.
    AlignFailed = 11: Damp, Some(Fault::TrackingError), "the SAFE pose was not reached in time";
    /// The host's heartbeat has been missing for too long.
    HostLost = 12: Return, Some(Fault::HostLost), "the host's heartbeat was lost";
    /// The body is tilted further than its motion requires.
    Leaning = 13: Return, Some(Fault::Tilt), "the body was tilted further than its motion requires";
    /// Command DISARM.
    Disarm = 14: Return, None, "a command to disarm";
    /// Second step of command CLEAR, with the right nonce.
    ClearConfirmed = 15: None, None, "the operator cleared the faults";
    /// Second step of command ARM, with the right nonce and recent feedback of every actuator.
    ArmConfirmed = 16: None, None, "the controller was armed";
    /// First tick after power-on or reset.
    Started = 17: None, None, "the controller was switched on or reset";
    /// Configuration and settings can be used.
    SelfTestPassed = 18: None, None, "the self test passed";
    /// The SAFE pose is reached.
    Aligned = 19: None, None, "the SAFE pose was reached";
    /// A command for another motion was accepted.
    MotionStarted = 20: None, None, "a command for a motion";
    /// Command PAUSE.
    PauseAsked = 21: None, None, "a command to pause";
    /// Command RESUME, or RETURN from a pause.
    ResumeAsked = 22: None, None, "a command to resume";
    /// The player has entered the safe motion without a further target.
    SafeReached = 23: None, None, "the safe motion was reached";
    /// SAFE was held long enough after returning.
    HoldElapsed = 24: None, None, "SAFE was held long enough";
    /// Damping lasted for its full duration.
    DampingElapsed = 25: None, None, "the damping time was over";
    /// Torque is off and no fault is latched.
    FaultFree = 26: None, None, "no fault was latched";
    /// A message was refused because it does not prove that its sender has the link key. The state does not change; only the
    /// log contains the event, with the count of such messages as its value.
    Unauthenticated = 27: None, None, "unauthenticated messages were refused";
    /// Command STREAM.
    StreamStarted = 28: None, None, "a command to follow streamed setpoints";
    /// Command RETURN while streaming.
    StreamEnded = 29: None, None, "a command to end the stream of setpoints";
    /// Streamed set-points have been missing for too long.
    StreamLost = 30: Return, Some(Fault::SetpointTimeout), "streamed setpoints arrived too late";
    /// The robot has come to rest at the end of a stream of set-points.
    StreamHalted = 31: None, None, "the robot halted where its stream of setpoints ended";
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(faults: &[Fault]) -> FaultBits {
        faults.iter().fold(FaultBits::default(), |all, &fault| all.with(fault))
    }

    #[test]
    fn the_most_severe_fault_comes_first() {
        for &fault in Fault::ALL {
            assert_eq!(set(&[fault]).first(), Some(fault));
        }
        assert_eq!(
            set(&[Fault::HostLost, Fault::EStop, Fault::BusOff]).first(),
            Some(Fault::EStop)
        );
        assert_eq!(set(&[Fault::HostLost, Fault::Tilt]).first(), Some(Fault::Tilt));
        let mismatch = set(&[Fault::NoLibrary, Fault::ConfigMismatch]);
        assert_eq!(mismatch.first(), Some(Fault::ConfigMismatch));
        assert_eq!(FaultBits::default().first(), None);
    }

    #[test]
    fn a_fault_is_as_severe_as_its_events() {
        assert_eq!(Fault::Tilt.least_severity(), Severity::Return);
        assert_eq!(Fault::Tilt.severity(), Severity::Damp);
        assert_eq!(Fault::NoLibrary.severity(), Severity::Notice);
        for &event in Event::ALL {
            // Every reaction is explained by a fault, except for the reaction to a command.
            let explained = event.fault().is_some() || event == Event::Disarm;
            assert_eq!(event.severity() != Severity::None, explained, "{event:?}");
        }
    }

    /// A fault whose report has a channel also has a value.
    #[test]
    fn channels_come_with_values() {
        for fault in Fault::ALL {
            let Description { channel, value, .. } = fault.description();
            assert!(channel.is_empty() || value.is_some(), "{fault:?}");
        }
    }
}
