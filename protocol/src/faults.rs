//! The catalogue of faults: every fault and event of the safety state machine, with all that is known of it.
//!
//! A fault is a row here, a place in the firmware that raises its event and measures its value, and a section of
//! `docs/faults.md`. Reactions, reports, advice, the DBC files and the tables in `docs/` follow from the rows.
//! Firmware calls only what returns codes and severities, so that no text reaches its image.

use crate::wire::coded;

coded! {
    /// A reaction of the controller; of several that are called for, the strongest wins.
    #[derive(PartialOrd, Ord)]
    Severity {
        /// None.
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
        /// An actuator reports a fault, or dropped its torque.
        ActuatorFault = 4,
        /// A joint does not follow its setpoint.
        TrackingError = 5,
        /// A measured position is outside its limits.
        OutOfLimits = 6,
        /// The body is tilted further than its motion makes it.
        Tilt = 7,
        /// No node acknowledges on an actuator bus.
        BusNoAck = 9,
        /// An actuator bus is error-passive.
        BusPassive = 10,
        /// An actuator bus is off.
        BusOff = 11,
        /// An emergency stop was received.
        EStop = 12,
        /// The control loop missed its deadline.
        Overrun = 13,
        /// The library changed or cannot be read during playback.
        LibraryUnreadable = 14,
        /// Configuration or settings cannot be used.
        Internal = 15,
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
    /// A quantity with this unit, in ASCII, and what it is.
    Measured(&'static str, &'static str),
    /// As [`Measured`](Self::Measured); a negative value has the last meaning instead.
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
}

impl Fault {
    /// Description for people.
    pub const fn description(self) -> Description {
        let (name, advice) = match self {
            Self::NoLibrary => ("no valid library", "flash a library, then arm"),
            Self::ConfigMismatch => (
                "library for another robot",
                "flash a library that was built from this robot's file",
            ),
            Self::HostLost => {
                ("heartbeat lost", "see why heartbeats did not arrive; clear, then arm")
            }
            Self::ActuatorSilent => (
                "an actuator does not answer",
                "check motor power and this actuator's cable; clear, then arm",
            ),
            Self::ActuatorFault => (
                "an actuator reports a fault",
                "read the drive's own error, let it cool; clear, then arm",
            ),
            Self::TrackingError => (
                "a joint or wheel does not follow",
                "free what holds the joint; is the torque limit or the gain too low? clear, then arm",
            ),
            Self::OutOfLimits => (
                "a joint is outside its limits",
                "turn the joint back into its range by hand, then arm",
            ),
            Self::Tilt => {
                ("the body is tilted", "set the robot up, without torque; clear, then arm")
            }
            Self::BusNoAck => (
                "no node acknowledges on an actuator bus",
                "check motor power and the actuator bus; clear, then arm",
            ),
            Self::BusPassive => (
                "a bus is error-passive",
                "check termination and bit rates of the actuator bus; clear, then arm",
            ),
            Self::BusOff => ("a bus is off", "motor power off, mend the bus; clear, then arm"),
            Self::EStop => {
                ("emergency stop", "see why it was pressed, look at the robot; clear, then arm")
            }
            Self::Overrun => (
                "the control loop missed its time",
                "see what holds the control loop up; clear, then arm",
            ),
            Self::LibraryUnreadable => {
                ("the library cannot be read", "flash the library again; clear, then arm")
            }
            Self::Internal => {
                ("internal error", "the firmware's configuration is unusable: build it anew")
            }
        };
        let (channel, value) = match self {
            Self::HostLost => ("", Some(Quantity::Measured("s", "since the last heartbeat"))),
            Self::ActuatorSilent => {
                ("longest silent", Some(Quantity::Measured("s", "since its last feedback")))
            }
            Self::ActuatorFault => ("first with a fault", Some(Quantity::Flags("status byte"))),
            Self::TrackingError => {
                ("furthest from its setpoint", Some(Quantity::Measured("rad", "from its setpoint")))
            }
            Self::OutOfLimits => {
                ("first outside its limits", Some(Quantity::Measured("rad", "measured")))
            }
            Self::Tilt => {
                let tilt = "beyond the tilt of its motion";
                ("", Some(Quantity::MeasuredUnless("rad", tilt, "the IMU is silent")))
            }
            Self::BusNoAck | Self::BusPassive | Self::BusOff => ("", Some(Quantity::Number("bus"))),
            Self::Overrun => ("", Some(Quantity::Measured("s", "from one tick to the next"))),
            Self::NoLibrary
            | Self::ConfigMismatch
            | Self::EStop
            | Self::LibraryUnreadable
            | Self::Internal => ("", None),
        };
        Description { name, advice, channel, value }
    }

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

    /// Whether the fault is in the set.
    pub fn contains(self, fault: Fault) -> bool {
        self.0 >> fault.code() & 1 != 0
    }

    /// Whether the set is empty.
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

coded! {
    /// Everything that can change the controller's state. Codes are those of the log.
    Event {
        /// Emergency stop, from the link or from the board.
        EStop = 0,
        /// An actuator bus is off: no actuator on it hears the controller.
        BusOff = 1,
        /// Configuration or settings cannot be used.
        SelfTestFailed = 2,
        /// An actuator has been silent for too many ticks.
        FeedbackLost = 3,
        /// An actuator reports a fault or has dropped its torque.
        ActuatorFault = 4,
        /// No node acknowledges frames on an actuator bus.
        NotAcknowledged = 5,
        /// An actuator bus is error-passive: about to go off.
        BusPassive = 6,
        /// The body is tilted so far that no motion can save it.
        Tipped = 7,
        /// A joint has been far from its setpoint for too long.
        NotFollowing = 8,
        /// The library could not be played although it was validated.
        PlaybackFailed = 9,
        /// The control loop came so late that setpoints are outdated.
        Overrun = 10,
        /// The SAFE pose was not reached in time.
        AlignFailed = 11,
        /// The host's heartbeat has been missing for too long.
        HostLost = 12,
        /// The body is tilted further than the motion makes it.
        Leaning = 13,
        /// Command DISARM.
        Disarm = 14,
        /// Command CLEAR, second step, with the right nonce.
        ClearConfirmed = 15,
        /// Command ARM, second step, with the right nonce and every actuator fresh.
        ArmConfirmed = 16,
        /// First tick after power-on or reset.
        Started = 17,
        /// Configuration and settings can be used.
        SelfTestPassed = 18,
        /// The SAFE pose is reached.
        Aligned = 19,
        /// A command for another motion was accepted.
        MotionStarted = 20,
        /// Command PAUSE.
        PauseAsked = 21,
        /// Command RESUME, or RETURN from a pause.
        ResumeAsked = 22,
        /// The player has entered the safe motion and goes nowhere else.
        SafeReached = 23,
        /// SAFE was held long enough after returning.
        HoldElapsed = 24,
        /// Damping has lasted long enough.
        DampingElapsed = 25,
        /// Torque is off and no fault is latched.
        FaultFree = 26,
    }
}

impl Event {
    /// Reaction that the event calls for while torque is on, and fault that it raises.
    const fn consequence(self) -> (Severity, Option<Fault>) {
        match self {
            Self::EStop => (Severity::EStop, Some(Fault::EStop)),
            Self::BusOff => (Severity::EStop, Some(Fault::BusOff)),
            Self::SelfTestFailed => (Severity::TorqueOff, Some(Fault::Internal)),
            Self::FeedbackLost => (Severity::Damp, Some(Fault::ActuatorSilent)),
            Self::ActuatorFault => (Severity::Damp, Some(Fault::ActuatorFault)),
            Self::NotAcknowledged => (Severity::Damp, Some(Fault::BusNoAck)),
            Self::BusPassive => (Severity::Damp, Some(Fault::BusPassive)),
            Self::Tipped => (Severity::Damp, Some(Fault::Tilt)),
            Self::NotFollowing | Self::AlignFailed => (Severity::Damp, Some(Fault::TrackingError)),
            Self::PlaybackFailed => (Severity::Damp, Some(Fault::LibraryUnreadable)),
            Self::Overrun => (Severity::Damp, Some(Fault::Overrun)),
            Self::HostLost => (Severity::Return, Some(Fault::HostLost)),
            Self::Leaning => (Severity::Return, Some(Fault::Tilt)),
            Self::Disarm => (Severity::Return, None),
            _ => (Severity::None, None),
        }
    }

    /// Reaction that the event calls for while torque is on.
    pub const fn severity(self) -> Severity {
        self.consequence().0
    }

    /// Fault that the event raises.
    pub const fn fault(self) -> Option<Fault> {
        self.consequence().1
    }

    /// What happened, as a clause.
    pub const fn description(self) -> &'static str {
        match self {
            Self::EStop => "emergency stop",
            Self::BusOff => "an actuator bus has gone off",
            Self::SelfTestFailed => "its configuration or settings cannot be used",
            Self::FeedbackLost => "an actuator did not answer",
            Self::ActuatorFault => "an actuator reported a fault or dropped its torque",
            Self::NotAcknowledged => "no node acknowledged on an actuator bus",
            Self::BusPassive => "an actuator bus has become error-passive",
            Self::Tipped => "the body was about to fall over",
            Self::NotFollowing => "a joint did not follow",
            Self::PlaybackFailed => "the library could not be played",
            Self::Overrun => "the control loop came too late",
            Self::AlignFailed => "the SAFE pose was not reached in time",
            Self::HostLost => "the host's heartbeat was lost",
            Self::Leaning => "the body was tilted further than its motion tilts it",
            Self::Disarm => "a command to disarm",
            Self::ClearConfirmed => "the operator cleared its faults",
            Self::ArmConfirmed => "it was armed",
            Self::Started => "it was switched on or reset",
            Self::SelfTestPassed => "the self test passed",
            Self::Aligned => "the SAFE pose was reached",
            Self::MotionStarted => "a command for a motion",
            Self::PauseAsked => "a command to pause",
            Self::ResumeAsked => "a command to resume",
            Self::SafeReached => "the safe motion was reached",
            Self::HoldElapsed => "SAFE was held long enough",
            Self::DampingElapsed => "its joints were damped long enough",
            Self::FaultFree => "torque was off without a fault",
        }
    }
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
