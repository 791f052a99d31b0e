//! Sentences for the numbers in which a controller says no.

use rollwalk_protocol::wire::transport::{Reply, TransferResult};
use rollwalk_protocol::wire::{CommandResult, Fault, FaultBits, LogEvent, ParameterResult, State};

/// Why a command was not executed, and what would help.
pub fn command_refusal(result: CommandResult) -> &'static str {
    match result {
        CommandResult::Ok => "it was not refused",
        CommandResult::UnknownCode => "no motion of the active library has this code",
        CommandResult::WrongState => "this is not possible in its present state",
        CommandResult::Expired => "the command arrived too late",
        CommandResult::Unreachable => "the motion graph has no route to this motion",
        CommandResult::NotArmed => "torque is off; arm first",
        CommandResult::NoLibrary => "it has no valid library; flash one first",
        CommandResult::WrongNonce => "the confirmation did not match the request; try again",
        CommandResult::ConfigMismatch => "its library was built for another robot",
        CommandResult::PoseUnknown => {
            "an actuator does not tell its position, or one that is outside its limits"
        }
        CommandResult::OutOfOrder => "another host is sending commands, too",
        CommandResult::UnknownKind => "its firmware is older than this kind of command",
        CommandResult::FaultPresent => "a fault is still present",
        CommandResult::BadSpeed => "playback speeds are 1/64 to 64/64 of the planned one",
    }
}

/// Why a request about parameters was refused, and what would help.
pub fn parameter_refusal(result: ParameterResult, limit: f32) -> String {
    let sentence = match result {
        ParameterResult::Ok => "it was not refused",
        ParameterResult::UnknownParameter => "its firmware is older than this parameter",
        ParameterResult::UnknownChannel => "the robot has fewer channels",
        ParameterResult::OutOfRange => {
            return format!("the value is no number, or beyond the limit of {limit}");
        }
        ParameterResult::WrongState => "torque is on; disarm first",
        ParameterResult::StoreFailed => "it has no memory for parameters, or one that fails",
        ParameterResult::OutOfOrder => "another host is setting parameters, too",
        ParameterResult::UnknownRequest => "its firmware is older than this kind of request",
        ParameterResult::NotSupported => "it makes no difference to the actuator of this channel",
    };
    sentence.to_owned()
}

/// Why a request of a library transfer failed, and what would help.
pub fn transfer_refusal(reply: &Reply) -> String {
    let sentence = match reply.result {
        TransferResult::Ok => "it answers, but does not take in what it is sent",
        TransferResult::WrongState => {
            "it is not disarmed: disarm it first, or clear it if it has stopped"
        }
        TransferResult::TooLong => "the library is larger than its memory",
        TransferResult::OutOfOrder => "a part of the library is missing before this one",
        TransferResult::BadCrc => "what it stored is not what was sent",
        TransferResult::NotBegun => "it was restarted during the transfer; try again",
        TransferResult::Incomplete => "a part of the library is missing",
        TransferResult::NotFinished => "it holds another library than the one to activate",
        TransferResult::StoreFailed => "its memory cannot be written",
        TransferResult::UnknownRequest => "its firmware is older than this kind of transfer",
        TransferResult::Rejected => {
            let (section, why) = (section_name(reply.section), why_sentence(reply.why));
            return format!("{why} ({section}, byte {})", reply.next);
        }
    };
    sentence.to_owned()
}

/// A part of a library file, by [`rollwalk_protocol::library::Section::code`].
fn section_name(code: u8) -> &'static str {
    match code {
        0 => "header or section table",
        1 => "manifest",
        2 => "channel table",
        3 => "clip table",
        4 => "frames",
        5 => "transition table",
        6 => "route table",
        7 => "command code table",
        8 => "safe pose",
        9 => "names",
        255 => "footer",
        _ => "a section that this host does not know",
    }
}

/// What is wrong with a library, by [`rollwalk_protocol::library::Why::code`].
fn why_sentence(code: u8) -> String {
    let known = match code {
        0 => "the library is not signed by the owner of this controller's key",
        1 => "this is not a motion library",
        2 => "the library is truncated",
        3 => "something follows the end of the library",
        4 => "the library is corrupted: a checksum does not fit",
        5 => {
            "the library has another format version than the firmware reads: build both from the \
              same release"
        }
        9 => "the controller's own configuration is unusable",
        10 => "the library was built for another robot: build it again from this robot's file",
        15 => "a channel differs from this robot's configuration",
        19 => "a frame is outside the limits of its channel",
        20 => "a motion is faster than the limit of its channel",
        21 => "a looping motion jumps from its last frame to its first",
        22 => "a motion ends with a turning wheel",
        25 => "a transition does not meet the motion that it joins",
        26 => "a motion has no route to the safe motion",
        32 => "the safe motion does not come to rest",
        _ => return format!("the library is malformed (reason {code})"),
    };
    known.to_owned()
}

/// A state in words, after "the robot is".
pub fn state_name(state: State) -> &'static str {
    match state {
        State::Boot => "starting",
        State::SelfTest => "testing itself",
        State::Disarmed => "disarmed",
        State::Aligning => "aligning",
        State::Ready => "ready",
        State::Playing => "playing",
        State::Paused => "paused",
        State::Returning => "returning to SAFE",
        State::Damped => "damped",
        State::TorqueOff => "stopped, torque off",
        State::EStopped => "stopped by an emergency stop",
    }
}

/// What happened, by [`LogEvent::code`].
pub fn event_sentence(code: u8) -> String {
    let known = match LogEvent::from_code(code) {
        Some(LogEvent::EStop) => "emergency stop",
        Some(LogEvent::BusOff) => "an actuator bus has gone off",
        Some(LogEvent::SelfTestFailed) => "its configuration or settings cannot be used",
        Some(LogEvent::FeedbackLost) => "an actuator did not answer",
        Some(LogEvent::ActuatorFault) => "an actuator reported a fault or dropped its torque",
        Some(LogEvent::NotAcknowledged) => "nobody acknowledged on an actuator bus",
        Some(LogEvent::BusPassive) => "an actuator bus has become error-passive",
        Some(LogEvent::Tipped) => "the body was about to fall over",
        Some(LogEvent::NotFollowing) => "a joint did not follow",
        Some(LogEvent::PlaybackFailed) => "the library could not be played",
        Some(LogEvent::Overrun) => "the control loop came too late",
        Some(LogEvent::AlignFailed) => "the SAFE pose was not reached in time",
        Some(LogEvent::HostLost) => "the host's heartbeat was lost",
        Some(LogEvent::Leaning) => "the body was tilted otherwise than its motion makes it",
        Some(LogEvent::Disarm) => "it was told to disarm",
        Some(LogEvent::ClearConfirmed) => "the operator cleared",
        Some(LogEvent::ArmConfirmed) => "it was armed",
        Some(LogEvent::Started) => "it was switched on or reset",
        Some(LogEvent::SelfTestPassed) => "the self test passed",
        Some(LogEvent::Aligned) => "the SAFE pose was reached",
        Some(LogEvent::MotionStarted) => "it was sent to a motion",
        Some(LogEvent::PauseAsked) => "it was told to pause",
        Some(LogEvent::ResumeAsked) => "it was told to go on",
        Some(LogEvent::SafeReached) => "the safe motion was reached",
        Some(LogEvent::HoldElapsed) => "SAFE was held long enough",
        Some(LogEvent::DampingElapsed) => "its joints were damped long enough",
        Some(LogEvent::FaultFree) => "torque was off and no fault left",
        None => return format!("something that this host does not know (event {code})"),
    };
    known.to_owned()
}

/// Faults in words, separated by commas; `no fault` for an empty set.
pub fn fault_names(faults: FaultBits) -> String {
    let name = |fault| match fault {
        Fault::NoLibrary => "no valid library",
        Fault::ConfigMismatch => "library for another robot",
        Fault::HostLost => "heartbeat lost",
        Fault::ActuatorSilent => "an actuator does not answer",
        Fault::ActuatorFault => "an actuator reports a fault",
        Fault::TrackingError => "a joint or wheel does not follow",
        Fault::OutOfLimits => "a joint is outside its limits",
        Fault::Tilt => "the body is tilted",
        Fault::BusNoAck => "nobody acknowledges on an actuator bus",
        Fault::BusPassive => "a bus is error-passive",
        Fault::BusOff => "a bus is off",
        Fault::EStop => "emergency stop",
        Fault::Overrun => "the control loop missed its time",
        Fault::LibraryUnreadable => "the library cannot be read",
        Fault::Internal => "internal error",
    };
    let names: Vec<_> = faults.iter().map(name).collect();
    if names.is_empty() { "no fault".to_owned() } else { names.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::library::{Reject, Section, Why};

    fn sentence(section: Section, why: Why) -> String {
        transfer_refusal(&Reply::rejected(0x12, &Reject { section, offset: 77, why }))
    }

    #[test]
    fn the_numbers_are_those_of_the_protocol() {
        for (section, why, words) in [
            (Section::Header, Why::NotALibrary, "not a motion library"),
            (Section::Header, Why::Truncated { len: 1, expected: 2 }, "truncated"),
            (Section::Footer, Why::Corrupted { stored: 1, computed: 2 }, "corrupted"),
            (Section::Header, Why::OtherMajor { found: 2 }, "another format version"),
            (Section::Manifest, Why::WrongRobot { library: 1, robot: 2 }, "another robot"),
            (Section::SafePose, Why::SafeNotAtRest { channel: 0 }, "does not come to rest"),
        ] {
            let sentence = sentence(section, why);
            assert!(sentence.contains(words), "{sentence}");
            assert!(sentence.contains("byte 77"), "{sentence}");
            if section != Section::Header {
                assert!(sentence.contains(&section.to_string()), "{sentence}");
            }
        }
    }

    #[test]
    fn faults_are_named() {
        let faults = FaultBits::default().with(Fault::HostLost).with(Fault::EStop);
        assert_eq!(fault_names(faults), "heartbeat lost, emergency stop");
        assert_eq!(fault_names(FaultBits::default()), "no fault");
    }
}
