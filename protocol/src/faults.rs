//! Catalogue of faults: every fault and event of the safety state machine, with its texts and reactions.
//!
//! A fault is a row of [`Fault`] and a row of the [`Event`] that raises it, a line of firmware that raises the event and measures
//! its value, and a section of `docs/faults.md`. Reactions, reports, advice, the DBC files and the tables in `docs/` follow from
//! the rows. Firmware calls only the functions that return codes and severities, so that no text reaches its image.

use core::fmt;

use crate::coded::coded;

coded! {
    /// A reaction of the controller; of several that are called for, the strongest wins.
    #[derive(PartialOrd, Ord)]
    Severity {
        /// Normal operation: no reaction.
        None = 0,
        /// Reported; the robot goes on.
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

/// Description of a fault for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Description {
    /// Short description.
    pub name: &'static str,
    /// First step of its section in `docs/faults.md`.
    pub advice: &'static str,
    /// Meaning of `channel` in its report; empty when the report names none.
    pub channel: &'static str,
    /// Meaning of `value` in its report; `None` when the report has none.
    pub value: Option<Quantity>,
}

/// Meaning of the value in a fault report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A quantity: its unit, in ASCII, and its meaning.
    Measured(&'static str, &'static str),
    /// Quantity like [`Measured`](Self::Measured), whose negative values have the last meaning instead.
    MeasuredUnless(&'static str, &'static str, &'static str),
    /// Number of something.
    Number(&'static str),
    /// Byte of flags.
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

    /// A value with its unit and its meaning, for people.
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
    /// The unit and the meaning of the value.
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

/// Defines [`Fault`] by rows: bit, short description, advice, and of its report the meanings of channel and value.
macro_rules! faults {
    ($(
        $(#[$doc:meta])*
        $fault:ident = $bit:literal: $name:literal, $advice:literal
        $(, channel $channel:literal)? $(, value $value:expr)?;
    )*) => {
        coded! {
            /// Faults by their bit in [`FaultBits`].
            Fault { $($(#[$doc])* $fault = $bit,)* }
        }

        impl Fault {
            /// Description for people.
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
    /// The library is for another robot configuration.
    ConfigMismatch = 1: "library for another robot",
        "flash a library that was built from this robot's file";
    /// The host's heartbeat stopped.
    HostLost = 2: "heartbeat lost", "see why heartbeats did not arrive; clear, then arm",
        value Measured("s", "since the last heartbeat");
    /// An actuator does not answer.
    ActuatorSilent = 3: "an actuator does not answer",
        "check motor power and this actuator's cable; clear, then arm",
        channel "longest silent", value Measured("s", "since its last feedback");
    /// An actuator reports a fault, or dropped its torque.
    ActuatorFault = 4: "an actuator reports a fault",
        "read the drive's own error, let it cool; clear, then arm",
        channel "first with a fault", value Flags("status byte");
    /// A joint does not follow its setpoint.
    TrackingError = 5: "a joint or wheel does not follow",
        "free what holds the joint; is the torque limit or the gain too low? clear, then arm",
        channel "furthest from its setpoint", value Measured("rad", "from its setpoint");
    /// A measured position is outside its limits.
    OutOfLimits = 6: "a joint is outside its limits",
        "turn the joint back into its range by hand, then arm",
        channel "first outside its limits", value Measured("rad", "measured");
    /// The body is tilted further than its motion makes it.
    Tilt = 7: "the body is tilted", "set the robot up, without torque; clear, then arm",
        value MeasuredUnless("rad", "beyond the tilt of its motion", "the IMU is silent");
    /// Streamed setpoints did not come in time.
    SetpointTimeout = 8: "streamed setpoints came too late",
        "see what holds up the host or the link; clear, then arm",
        value Measured("s", "since the last frame of setpoints");
    /// Frames on an actuator bus without acknowledgement by any node.
    BusNoAck = 9: "no node acknowledges on an actuator bus",
        "check motor power and the actuator bus; clear, then arm", value Number("bus");
    /// An actuator bus is error-passive.
    BusPassive = 10: "a bus is error-passive",
        "check termination and bit rates of the actuator bus; clear, then arm", value Number("bus");
    /// An actuator bus is off.
    BusOff = 11: "a bus is off", "motor power off, mend the bus; clear, then arm",
        value Number("bus");
    /// An emergency stop was received.
    EStop = 12: "emergency stop", "see why it was pressed, look at the robot; clear, then arm";
    /// The control loop missed its deadline.
    Overrun = 13: "the control loop missed its time",
        "see what holds the control loop up; clear, then arm",
        value Measured("s", "from one tick to the next");
    /// The library changed or cannot be read during playback.
    LibraryUnreadable = 14: "the library cannot be read",
        "flash the library again; clear, then arm";
    /// Configuration or settings cannot be used.
    Internal = 15: "internal error", "the firmware's configuration is unusable: build it anew";
}

impl Fault {
    /// Events that raise this fault.
    pub fn events(self) -> impl Iterator<Item = Event> {
        Event::ALL.iter().copied().filter(move |event| event.fault() == Some(self))
    }

    /// The weakest reaction to expect while torque is on: [`Severity::Notice`] for a fault that no event raises,
    /// which bars arming only.
    pub fn least_severity(self) -> Severity {
        self.events().map(Event::severity).min().unwrap_or(Severity::Notice)
    }

    /// The strongest reaction that it can cause.
    pub fn severity(self) -> Severity {
        self.events().map(Event::severity).max().unwrap_or(Severity::Notice)
    }
}

/// A set of faults.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultBits(pub u16);

impl FaultBits {
    /// The set with this fault.
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

    /// The faults of the set, by their bits.
    pub fn iter(self) -> impl Iterator<Item = Fault> {
        Fault::ALL.iter().copied().filter(move |&fault| self.contains(fault))
    }

    /// The fault to attend to first: the most severe one, of several the one whose event the controller handles first.
    pub fn first(self) -> Option<Fault> {
        let urgency = |fault: &Fault| {
            let event = fault.events().map(|event| core::cmp::Reverse(event.code())).max();
            // Without an event the more specific one has the higher code.
            (fault.severity(), event, fault.code())
        };
        self.iter().max_by_key(urgency)
    }
}

/// Defines [`Event`] by rows: code, severity, the fault that it raises, and its description as a clause.
macro_rules! events {
    ($(
        $(#[$doc:meta])*
        $event:ident = $code:literal: $severity:ident, $fault:expr, $description:literal;
    )*) => {
        coded! {
            /// Everything that can change the controller's state. Codes are those of the log.
            Event { $($(#[$doc])* $event = $code,)* }
        }

        impl Event {
            /// Reaction that the event calls for while torque is on.
            pub const fn severity(self) -> Severity {
                match self {
                    $(Self::$event => Severity::$severity,)*
                }
            }

            /// Fault that the event raises.
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
    /// Emergency stop, from the link or from the board.
    EStop = 0: EStop, Some(Fault::EStop), "emergency stop";
    /// An actuator bus is off: the controller reaches no actuator on it.
    BusOff = 1: EStop, Some(Fault::BusOff), "an actuator bus has gone off";
    /// Configuration or settings cannot be used.
    SelfTestFailed = 2: TorqueOff, Some(Fault::Internal),
        "its configuration or settings cannot be used";
    /// An actuator has been silent for too many ticks.
    FeedbackLost = 3: Damp, Some(Fault::ActuatorSilent), "an actuator did not answer";
    /// An actuator reports a fault or has dropped its torque.
    ActuatorFault = 4: Damp, Some(Fault::ActuatorFault),
        "an actuator reported a fault or dropped its torque";
    /// Frames on an actuator bus without acknowledgement by any node.
    NotAcknowledged = 5: Damp, Some(Fault::BusNoAck), "no node acknowledged on an actuator bus";
    /// An actuator bus is error-passive: about to go off.
    BusPassive = 6: Damp, Some(Fault::BusPassive), "an actuator bus has become error-passive";
    /// The body is tilted so far that no motion can save it.
    Tipped = 7: Damp, Some(Fault::Tilt), "the body was about to fall over";
    /// A joint has been far from its setpoint for too long.
    NotFollowing = 8: Damp, Some(Fault::TrackingError), "a joint did not follow";
    /// The library could not be played although it was validated.
    PlaybackFailed = 9: Damp, Some(Fault::LibraryUnreadable), "the library could not be played";
    /// The control loop came so late that setpoints are outdated.
    Overrun = 10: Damp, Some(Fault::Overrun), "the control loop came too late";
    /// The SAFE pose was not reached in time.
    AlignFailed = 11: Damp, Some(Fault::TrackingError), "the SAFE pose was not reached in time";
    /// The host's heartbeat has been missing for too long.
    HostLost = 12: Return, Some(Fault::HostLost), "the host's heartbeat was lost";
    /// The body is tilted further than the motion makes it.
    Leaning = 13: Return, Some(Fault::Tilt), "the body was tilted further than its motion tilts it";
    /// Command DISARM.
    Disarm = 14: Return, None, "a command to disarm";
    /// Command CLEAR, second step, with the right nonce.
    ClearConfirmed = 15: None, None, "the operator cleared its faults";
    /// Command ARM, second step, with the right nonce and every actuator fresh.
    ArmConfirmed = 16: None, None, "it was armed";
    /// First tick after power-on or reset.
    Started = 17: None, None, "it was switched on or reset";
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
    /// The player has entered the safe motion and goes nowhere else.
    SafeReached = 23: None, None, "the safe motion was reached";
    /// SAFE was held long enough after returning.
    HoldElapsed = 24: None, None, "SAFE was held long enough";
    /// Damping has lasted long enough.
    DampingElapsed = 25: None, None, "the time of damping was over";
    /// Torque is off and no fault is latched.
    FaultFree = 26: None, None, "no fault was latched";
    /// A message was refused because nothing proved that its sender has the link key. Changes no state; only the log has
    /// it, with the count of such messages as its value.
    Unauthenticated = 27: None, None, "messages were refused that were not authenticated";
    /// Command STREAM.
    StreamStarted = 28: None, None, "a command to follow streamed setpoints";
    /// Command RETURN while streaming.
    StreamEnded = 29: None, None, "a command to end the stream of setpoints";
    /// The next streamed setpoints are missing for too long.
    StreamLost = 30: Return, Some(Fault::SetpointTimeout), "streamed setpoints came too late";
    /// A stream of setpoints that had to end has come to rest.
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
            // Each reaction is explained by a fault, but for that to a command.
            let explained = event.fault().is_some() || event == Event::Disarm;
            assert_eq!(event.severity() != Severity::None, explained, "{event:?}");
        }
    }

    /// A report without channel and value is one of a fault that has none.
    #[test]
    fn channels_come_with_values() {
        for fault in Fault::ALL {
            let Description { channel, value, .. } = fault.description();
            assert!(channel.is_empty() || value.is_some(), "{fault:?}");
        }
    }
}
