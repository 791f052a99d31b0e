//! Descriptions of the codes with which a controller refuses requests.

use crate::actuators::{UNKNOWN, fault_words};
use crate::authentication::NoSession;
use crate::catalog::{Catalog, channel_name};
use crate::describe::{fault_report_on, state_name};
use rollwalk_protocol::library::RejectReason;
use rollwalk_protocol::wire::transport::{Reply, TransferResult, UNSIGNED};
use rollwalk_protocol::wire::{CommandResult, FaultReport, ParameterResult, State};

/// Description of the refusal of a controller that accepts only hosts with its key.
const AUTHENTICATION_REQUIRED: &str = "authentication required; give the robot's link key with \
     --link-key FILE or ROLLWALK_LINK_KEY (emergency stops require none)";

/// Description of a refusal by a robot that has stopped. An answer contains the state, but not the cause of the stop.
const STOPPED: &str = "the robot has stopped, and torque is off; clear the stop first";

/// Reason why there is no authenticated session, to follow the controller's name, and remedy.
pub fn session_refusal(why: NoSession) -> &'static str {
    match why {
        NoSession::WrongKey => {
            "has another link key than the given one: give the key file that its image was built \
             with"
        }
        NoSession::NotNeeded => {
            "has no link key and accepts every host: leave out --link-key, and unset \
             ROLLWALK_LINK_KEY"
        }
        NoSession::CannotCount => {
            "accepts emergency stops only, because it cannot store its boot count: replace the \
             worn or defective flash"
        }
    }
}

/// Reason why a command was not executed, and remedy.
pub fn command_refusal(result: CommandResult) -> &'static str {
    match result {
        CommandResult::Ok => "the request was not refused",
        CommandResult::UnknownCode => {
            "no motion of the active library has this code; `rollwalk library inspect` lists the codes"
        }
        CommandResult::WrongState => "the present state of the robot does not allow this command",
        CommandResult::Expired => {
            "the command arrived too late, because this computer or the bus is busy; try again"
        }
        CommandResult::Unreachable => {
            "no transitions lead to this motion; add a [[transition]] to the library file"
        }
        CommandResult::NotArmed => "torque is off; arm first",
        CommandResult::NoLibrary => "the controller has no valid library; flash a library first",
        CommandResult::WrongNonce => "the confirmation did not match the request; try again",
        CommandResult::ConfigMismatch => {
            "the library of the controller was built for another robot; flash one for this robot"
        }
        CommandResult::PoseUnknown => {
            "an actuator does not report its position, or its joint is outside its limits; `rollwalk \
             doctor` names the joint"
        }
        CommandResult::OutOfOrder => {
            "another program sent a command at the same time; \
             try again"
        }
        CommandResult::UnknownKind => {
            "the firmware does not support this command; update the firmware"
        }
        CommandResult::FaultPresent => "a fault is still present",
        CommandResult::BadSpeed => "give a playback speed from 1/64 to 64/64 of the planned speed",
        CommandResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
        CommandResult::Unproven => {
            "the controller has a link key or a library key, so it refuses setpoints, which carry no \
             signature; play motions of its library"
        }
        CommandResult::UnfitActuators => {
            "an actuator does not accept torques or gains with its setpoints; play motions of the \
             library"
        }
        CommandResult::BadTracking => {
            "give a rate from 20 samples/s to the control rate, and gains from 0 to 100 %; with more than \
             27 channels lower the rate, so that a link of 1 Mbit/s carries samples and answers"
        }
        CommandResult::OtherPlace => {
            "the motion begins at the place in its name, after the @; put the robot there, and \
             confirm it with `rollwalk send MOTION --at PLACE`"
        }
    }
}

/// Reason as in [`command_refusal`], with the controller's state after the command, and with the fault that the controller
/// reported beside its answer, if known. With a catalog, the fault is described in the terms of the robot's bus, and its channel
/// has a name.
pub fn command_refusal_in(
    result: CommandResult,
    state: Option<State>,
    fault: Option<FaultReport>,
    catalog: Option<&Catalog>,
) -> String {
    match (result, state, fault) {
        (CommandResult::WrongState, Some(State::EStopped | State::TorqueOff), _) => {
            STOPPED.to_owned()
        }
        (CommandResult::WrongState, Some(state), _) => {
            format!("the command is not allowed while the robot is {}", state_name(state))
        }
        (CommandResult::FaultPresent | CommandResult::PoseUnknown, _, Some(report)) => {
            let FaultReport { fault, channel, value, .. } = report;
            let names = catalog.map_or(&[][..], |catalog| &catalog.channels);
            let actuators = catalog.map_or(&UNKNOWN, |catalog| &catalog.actuators);
            let name = channel.map(|channel| channel_name(names, channel));
            let found = fault_report_on(fault, channel, name, Some(value), actuators);
            let kind = actuators.kind_for(fault, channel, Some(value));
            format!("{found}; {}", fault_words(fault, kind).advice)
        }
        _ => command_refusal(result).to_owned(),
    }
}

/// Reason why a parameter request was refused, and remedy. `state` is the state of the controller, if known.
pub fn parameter_refusal(result: ParameterResult, limit: f32, state: Option<State>) -> String {
    let sentence = match result {
        ParameterResult::Ok => "the request was not refused",
        ParameterResult::UnknownParameter => {
            "the firmware does not support this parameter; update the firmware"
        }
        ParameterResult::UnknownChannel => "the robot does not have this channel",
        ParameterResult::OutOfRange => {
            // All digits, because the limit may be the largest or the smallest value.
            return format!("the value is not a number, or is beyond the limit of {limit}");
        }
        ParameterResult::WrongState => match state {
            None => "the robot is not disarmed: disarm it first, or clear it if it has stopped",
            Some(State::EStopped | State::TorqueOff) => STOPPED,
            Some(State::Boot | State::SelfTest | State::Disarmed) => {
                "the robot was not disarmed at that moment; try again"
            }
            Some(_) => "torque is on; disarm first",
        },
        ParameterResult::StoreFailed => {
            "the controller cannot store parameters: its memory is missing or defective \
             (rollwalk-sim has one only with --library)"
        }
        ParameterResult::OutOfOrder => {
            "another program sent a request at the same time; \
             try again"
        }
        ParameterResult::UnknownRequest => {
            "the firmware does not support this request; update the firmware"
        }
        ParameterResult::NotSupported => "the actuator of this channel ignores this parameter",
        ParameterResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
    };
    sentence.to_owned()
}

/// Reason why a request of a library transfer failed, and remedy.
pub fn transfer_refusal(reply: &Reply) -> String {
    let sentence = match reply.result {
        TransferResult::Ok => "the controller answers, but does not store the data",
        TransferResult::WrongState => {
            "the robot is not disarmed: disarm it first, or clear it if it has stopped"
        }
        TransferResult::TooLong => "the library is larger than the memory of the controller",
        TransferResult::OutOfOrder => {
            "an earlier block of the library is missing; transfer the library again"
        }
        TransferResult::BadCrc => {
            "the stored data differs from the sent data; transfer the library again"
        }
        TransferResult::NotBegun => "the controller was restarted during the transfer; try again",
        TransferResult::Incomplete => {
            "a block of the library is missing; transfer the library again"
        }
        TransferResult::NotFinished => {
            "the controller stores another library than the one to activate; transfer the library again"
        }
        TransferResult::StoreFailed => "the memory of the controller cannot be written",
        TransferResult::UnknownRequest => {
            "the firmware does not support this transfer; update the firmware"
        }
        TransferResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
        TransferResult::Rejected if reply.why == UNSIGNED => {
            "the library is not signed with the key of this controller: sign it with `rollwalk \
             library sign LIB.rwl --key KEY.pem -o SIGNED.rwl`, and flash SIGNED.rwl"
        }
        TransferResult::Rejected => {
            let (section, why) = (section_name(reply.section), reject_sentence(reply.why));
            return format!("{why} ({section}, byte {})", reply.next);
        }
    };
    sentence.to_owned()
}

/// True for the refusal of a library that was built for another robot.
pub fn is_of_other_robot(reply: &Reply) -> bool {
    let reason = RejectReason::WrongRobot { library: 0, robot: 0 };
    reply.result == TransferResult::Rejected && reply.why == reason.code()
}

/// Name of a library file's section, by [`rollwalk_protocol::library::Section::code`].
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
        10 => "torque quanta",
        11 => "torque clip table",
        12 => "torques",
        255 => "footer",
        _ => "unknown section",
    }
}

/// Description of a library's defect, by [`rollwalk_protocol::library::RejectReason::code`].
fn reject_sentence(code: u8) -> String {
    let known = match code {
        1 => "this is not a motion library",
        2 => "the library is truncated",
        3 => "there are bytes after the end of the library",
        4 => "the library is corrupted: a checksum does not match",
        5 => {
            "the library has another format version than the firmware reads: build both from the \
              same release"
        }
        9 => "the configuration of the controller is invalid",
        10 => "the library was built for another robot: build it again from this robot's file",
        15 => "a channel differs from this robot's configuration",
        19 => "a frame or a torque is outside the limits of its channel",
        20 => "a motion is faster than the limit of its channel",
        21 => "a looping motion jumps from its last frame to its first",
        22 => "a motion ends with a turning wheel",
        25 => "a transition does not begin or end with the frame of its motion",
        26 => "a motion has no route to the safe motion",
        32 => "the safe motion does not come to rest",
        _ => return format!("the library is malformed (reason {code})"),
    };
    known.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::faults::Fault;
    use rollwalk_protocol::library::{ClipId, Reject, Section};

    fn sentence(section: Section, why: RejectReason) -> String {
        transfer_refusal(&Reply::rejected(0x12, &Reject { section, offset: 77, why }))
    }

    #[test]
    fn what_a_state_does_not_allow_is_told_by_the_state() {
        let sentence = |state| parameter_refusal(ParameterResult::WrongState, 0.0, state);
        for state in [State::EStopped, State::TorqueOff] {
            assert_eq!(sentence(Some(state)), STOPPED);
            let command = command_refusal_in(CommandResult::WrongState, Some(state), None, None);
            assert_eq!(command, STOPPED);
        }
        for state in [State::Aligning, State::Ready, State::Playing, State::Damped] {
            assert_eq!(sentence(Some(state)), "torque is on; disarm first");
        }
        assert!(sentence(None).contains("disarm it first, or clear it"));
    }

    /// A controller reports the fault that prevents arming together with its answer.
    #[test]
    fn the_fault_behind_a_refusal_is_named() {
        let report = |fault, channel, value| FaultReport { counter: 0, fault, channel, value };
        let told = |fault| command_refusal_in(CommandResult::PoseUnknown, None, fault, None);
        let silent = told(Some(report(Fault::ActuatorSilent, Some(3), 0.0)));
        assert!(silent.contains("channel 3"), "{silent}");
        assert!(silent.contains(Fault::ActuatorSilent.description().name), "{silent}");
        assert!(silent.contains(Fault::ActuatorSilent.description().advice), "{silent}");
        assert_eq!(told(None), command_refusal(CommandResult::PoseUnknown));
        // A fault is unrelated to a code that does not exist.
        let unrelated = Some(report(Fault::HostLost, None, 0.0));
        let told =
            command_refusal_in(CommandResult::UnknownCode, Some(State::Ready), unrelated, None);
        assert_eq!(told, command_refusal(CommandResult::UnknownCode));
    }

    #[test]
    fn the_numbers_are_those_of_the_protocol() {
        for (section, why, words) in [
            (Section::Header, RejectReason::NotALibrary, "not a motion library"),
            (Section::Header, RejectReason::Truncated { len: 1, expected: 2 }, "truncated"),
            (Section::Footer, RejectReason::Corrupted { stored: 1, computed: 2 }, "corrupted"),
            (Section::Header, RejectReason::OtherMajor { found: 2 }, "another format version"),
            (Section::Manifest, RejectReason::WrongRobot { library: 1, robot: 2 }, "another robot"),
            (
                Section::SafePose,
                RejectReason::SafeNotAtRest { channel: 0 },
                "does not come to rest",
            ),
            (
                Section::TorqueQuanta,
                RejectReason::ChannelMismatch { channel: 0 },
                "a channel differs",
            ),
            (Section::TorqueClips, RejectReason::BadClip { clip: ClipId(0) }, "malformed"),
            (Section::Torques, RejectReason::BadBlock { clip: ClipId(0), frame: 0 }, "malformed"),
        ] {
            let sentence = sentence(section, why);
            assert!(sentence.contains(words), "{sentence}");
            assert!(sentence.contains("byte 77"), "{sentence}");
            if section != Section::Header {
                assert!(sentence.contains(&section.to_string()), "{sentence}");
            }
        }
    }
}
