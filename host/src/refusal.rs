//! Sentences for the codes with which a controller refuses requests.

use crate::actuators::fault_words;
use crate::authentication::NoSession;
use crate::describe::{fault_report, state_name};
use rollwalk_protocol::wire::transport::{Reply, TransferResult, UNSIGNED};
use rollwalk_protocol::wire::{CommandResult, FaultReport, ParameterResult, State};

/// Refusal of a controller that accepts only hosts with its key.
const AUTHENTICATION_REQUIRED: &str = "authentication required; give the robot's link key, --link-key FILE or \
     ROLLWALK_LINK_KEY (emergency stops need none)";

/// Reason for which there is no authenticated session, after the controller's name, and remedy.
pub fn session_refusal(why: NoSession) -> &'static str {
    match why {
        NoSession::WrongKey => {
            "has another link key than the one given: give the file that its image was built with"
        }
        NoSession::NotNeeded => {
            "has no link key and obeys every host: leave out --link-key, and unset ROLLWALK_LINK_KEY"
        }
        NoSession::CannotCount => {
            "cannot store how often it was switched on, and so obeys emergency stops only: its flash is worn out or broken"
        }
    }
}

/// Reason for which a command was not executed, and remedy.
pub fn command_refusal(result: CommandResult) -> &'static str {
    match result {
        CommandResult::Ok => "it was not refused",
        CommandResult::UnknownCode => "no motion of the active library has this code",
        CommandResult::WrongState => "this is not possible in its present state",
        CommandResult::Expired => "the command arrived too late: this computer or the bus is busy",
        CommandResult::Unreachable => "the motion graph has no route to this motion",
        CommandResult::NotArmed => "torque is off; arm first",
        CommandResult::NoLibrary => "it has no valid library; flash one first",
        CommandResult::WrongNonce => "the confirmation did not match the request; try again",
        CommandResult::ConfigMismatch => "its library was built for another robot",
        CommandResult::PoseUnknown => {
            "an actuator does not report its position, or is outside its limits"
        }
        CommandResult::OutOfOrder => {
            "other commands came at the same time: of another program, or the last of one that has ended; try again"
        }
        CommandResult::UnknownKind => "its firmware is older than this kind of command",
        CommandResult::FaultPresent => "a fault is still present",
        CommandResult::BadSpeed => "playback speeds are 1/64 to 64/64 of the planned one",
        CommandResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
        CommandResult::Unproven => {
            "it has a key of its owner, and setpoints of a host prove nothing: play motions of its library"
        }
        CommandResult::UnfitActuators => {
            "an actuator takes no torque, or no gains with its setpoints: the robot plays motions of its library only"
        }
        CommandResult::BadTracking => {
            "a rate of 20 samples a second up to its control rate, and gains of 0 to 100 % are possible"
        }
    }
}

/// [`command_refusal`], with the controller's state after the command and the fault that it reported with its answer, where
/// the host knows them.
pub fn command_refusal_in(
    result: CommandResult,
    state: Option<State>,
    fault: Option<FaultReport>,
) -> String {
    match (result, state, fault) {
        (CommandResult::WrongState, Some(State::EStopped), _) => {
            "it is stopped by an emergency stop; clear it first".to_owned()
        }
        (CommandResult::WrongState, Some(State::TorqueOff), _) => {
            "it has stopped, torque off; clear it first".to_owned()
        }
        (CommandResult::WrongState, Some(state), _) => {
            format!("this is not possible while it is {}", state_name(state))
        }
        (CommandResult::FaultPresent | CommandResult::PoseUnknown, _, Some(report)) => {
            let FaultReport { fault, channel, value, .. } = report;
            let channel = channel.map(|channel| format!("channel {channel}"));
            let found = fault_report(fault, channel, Some(value));
            format!("{found}; {}", fault_words(fault, None).advice)
        }
        _ => command_refusal(result).to_owned(),
    }
}

/// Reason for which a parameter request was refused in a state of the controller, if that is known, and remedy.
pub fn parameter_refusal(result: ParameterResult, limit: f32, state: Option<State>) -> String {
    let sentence = match result {
        ParameterResult::Ok => "it was not refused",
        ParameterResult::UnknownParameter => "its firmware is older than this parameter",
        ParameterResult::UnknownChannel => "the robot has fewer channels",
        ParameterResult::OutOfRange => {
            // All its digits: whether it is the largest value or the smallest is not known here.
            return format!("the value is no number, or beyond the limit of {limit}");
        }
        ParameterResult::WrongState => match state {
            None => "it is not disarmed: disarm it first, or clear it if it has stopped",
            Some(State::EStopped) => "it is stopped by an emergency stop; clear it first",
            Some(State::TorqueOff) => "it has stopped; clear it first",
            Some(State::Boot | State::SelfTest | State::Disarmed) => {
                "it was not disarmed at that moment; try again"
            }
            Some(_) => "torque is on; disarm first",
        },
        ParameterResult::StoreFailed => "it has no memory for parameters, or one that fails",
        ParameterResult::OutOfOrder => {
            "other requests came at the same time: of another program, or the last of one that has ended; try again"
        }
        ParameterResult::UnknownRequest => "its firmware is older than this kind of request",
        ParameterResult::NotSupported => "it makes no difference to the actuator of this channel",
        ParameterResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
    };
    sentence.to_owned()
}

/// Reason for which a request of a library transfer failed, and remedy.
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
        TransferResult::AuthenticationRequired => AUTHENTICATION_REQUIRED,
        TransferResult::Rejected if reply.why == UNSIGNED => {
            "it is not signed with the key that this controller was built for: sign it with `rollwalk library sign \
             LIB.rwl --key KEY.pem -o SIGNED.rwl`, and flash that"
        }
        TransferResult::Rejected => {
            let (section, why) = (section_name(reply.section), why_sentence(reply.why));
            return format!("{why} ({section}, byte {})", reply.next);
        }
    };
    sentence.to_owned()
}

/// Part of a library file, by [`rollwalk_protocol::library::Section::code`].
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
        _ => "a section that this host does not know",
    }
}

/// Fault of a library, by [`rollwalk_protocol::library::Why::code`].
fn why_sentence(code: u8) -> String {
    let known = match code {
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
        19 => "a frame or a torque is outside the limits of its channel",
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

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::faults::Fault;
    use rollwalk_protocol::library::{ClipId, Reject, Section, Why};

    fn sentence(section: Section, why: Why) -> String {
        transfer_refusal(&Reply::rejected(0x12, &Reject { section, offset: 77, why }))
    }

    #[test]
    fn what_a_state_does_not_allow_is_told_by_the_state() {
        let sentence = |state| parameter_refusal(ParameterResult::WrongState, 0.0, state);
        assert!(sentence(Some(State::EStopped)).contains("emergency stop; clear it"));
        assert!(sentence(Some(State::TorqueOff)).contains("clear it"));
        for state in [State::Aligning, State::Ready, State::Playing, State::Damped] {
            assert_eq!(sentence(Some(state)), "torque is on; disarm first");
        }
        assert!(sentence(None).contains("disarm it first, or clear it"));
    }

    /// The controller reports what keeps it from arming with its answer.
    #[test]
    fn the_fault_behind_a_refusal_is_named() {
        let report = |fault, channel, value| FaultReport { counter: 0, fault, channel, value };
        let told = |fault| command_refusal_in(CommandResult::PoseUnknown, None, fault);
        let silent = told(Some(report(Fault::ActuatorSilent, Some(3), 0.0)));
        assert!(silent.contains("channel 3"), "{silent}");
        assert!(silent.contains(Fault::ActuatorSilent.description().name), "{silent}");
        assert!(silent.contains(Fault::ActuatorSilent.description().advice), "{silent}");
        assert_eq!(told(None), command_refusal(CommandResult::PoseUnknown));
        // A fault has nothing to do with a code that there is not.
        let unrelated = Some(report(Fault::HostLost, None, 0.0));
        let told = command_refusal_in(CommandResult::UnknownCode, Some(State::Ready), unrelated);
        assert_eq!(told, command_refusal(CommandResult::UnknownCode));
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
            (Section::TorqueQuanta, Why::ChannelMismatch { channel: 0 }, "a channel differs"),
            (Section::TorqueClips, Why::BadClip { clip: ClipId(0) }, "malformed"),
            (Section::Torques, Why::BadBlock { clip: ClipId(0), frame: 0 }, "malformed"),
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
