//! Inputs that the controller must refuse, and the resulting messages to its operator.

use crate::robot::{self, SWING};
use crate::{armed, connect, rig};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::crc::crc32c;
use rollwalk_protocol::wire::{Action, CommandResult, Node, PROTOCOL_MINOR, State};
use rollwalk_sim_host::rig::Rig;

/// Flashes `bytes`, which must fail and leave no library to play. Returns the error message.
fn refusal(bytes: &[u8]) -> String {
    let mut session = connect(rig());
    let error = session.flash(bytes, |_| {}).unwrap_err();
    assert!(matches!(error, SessionError::LibraryRefused { .. }), "{error}");
    let arming = session.arm().unwrap_err();
    let expected = [CommandResult::NoLibrary, CommandResult::ConfigMismatch];
    assert!(
        matches!(arming, SessionError::Refused { result, .. } if expected.contains(&result)),
        "{arming}"
    );
    error.to_string()
}

#[test]
fn a_corrupted_library() {
    let mut bytes = robot::library();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 0x10;
    let sentence = refusal(&bytes);
    assert!(sentence.contains("refused the library"), "{sentence}");
    assert!(sentence.contains("corrupted"), "{sentence}");
}

#[test]
fn a_truncated_library() {
    let bytes = robot::library();
    let sentence = refusal(&bytes[..bytes.len() - 100]);
    assert!(sentence.contains("truncated"), "{sentence}");
}

#[test]
fn a_library_of_a_future_version() {
    let mut bytes = robot::library();
    // Header: magic 8 bytes, major u16, minor u16, length, reserved, CRC-32C of these 20 bytes.
    bytes[8] += 1;
    let crc = crc32c(&bytes[..20]).to_le_bytes();
    bytes[20..24].copy_from_slice(&crc);
    let sentence = refusal(&bytes);
    assert!(sentence.contains("another format version"), "{sentence}");
    assert!(sentence.contains("same release"), "{sentence}");
}

#[test]
fn a_library_for_another_robot() {
    let mut config = robot::config();
    config.channels[1].max = 1.4;
    let sentence = refusal(&robot::library_for(&config));
    assert!(sentence.contains("built for another robot"), "{sentence}");
    assert!(sentence.contains("build it again"), "{sentence}");
}

#[test]
fn something_that_is_no_library() {
    let sentence = refusal(&[0x55; 300]);
    assert!(sentence.contains("not a motion library"), "{sentence}");
    assert!(refusal(&[]).contains("refused the library"));
}

/// Link to a controller whose HELLO contains the next major version of the protocol.
struct Newer(Rig);

impl LinkBus for Newer {
    fn now_us(&self) -> u64 {
        self.0.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.0.send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        let frame = self.0.receive(deadline_us)?;
        Ok(frame.map(|frame| match *frame.data() {
            // First frame of a long message: length in two bytes, type of HELLO, version.
            [0x10, low, 0x81, major, a, b, c, d] if frame.standard_id() == Some(0x511) => {
                let data = [0x10, low, 0x81, major + 1, a, b, c, d];
                Frame::new(frame.id(), &data).expect("as long as before")
            }
            _ => frame,
        }))
    }
}

#[test]
fn a_controller_that_speaks_another_protocol() {
    let error = Session::connect(Newer(rig()), Node::new(1).unwrap()).err().unwrap();
    assert!(matches!(error, SessionError::ProtocolMismatch { major: 3, .. }), "{error}");
    let spoken = format!("controller 1 uses protocol 3.{PROTOCOL_MINOR} ");
    assert!(error.to_string().contains(&spoken), "{error}");
}

fn refused(session: &mut Session<Rig>, code: u8) -> (CommandResult, String) {
    let error = session.select(code).unwrap_err();
    let sentence = error.to_string();
    match error {
        SessionError::Refused { result, .. } => (result, sentence),
        _ => panic!("{sentence}"),
    }
}

/// A refusal to arm names the state of the controller, because the operator may not see the state elsewhere.
#[test]
fn what_keeps_a_robot_from_being_armed_is_said() {
    let mut session = armed();
    let why = session.arm().unwrap_err().to_string();
    assert_eq!(
        why,
        "the controller refused to arm: the command is not allowed while the robot is ready"
    );
    session.estop().unwrap();
    let why = session.arm().unwrap_err().to_string();
    let expected = "the controller refused to arm: the robot has stopped, and torque is off; clear the stop first";
    assert_eq!(why, expected);
}

#[test]
fn an_unknown_code_changes_nothing() {
    let mut session = armed();
    let (result, sentence) = refused(&mut session, 99);
    assert_eq!(result, CommandResult::UnknownCode);
    assert_eq!(
        sentence,
        "the controller refused to play the motion: no motion of the active library has this code; \
         `rollwalk library inspect` lists the codes"
    );
    session.run_for(200_000).unwrap();
    assert_eq!(session.status().unwrap().state, State::Ready);
}

#[test]
fn a_motion_before_arming() {
    let mut session = connect(rig());
    session.flash(&robot::library(), |_| {}).unwrap();
    let (result, sentence) = refused(&mut session, SWING);
    assert_eq!(result, CommandResult::NotArmed);
    assert!(sentence.ends_with("torque is off; arm first"), "{sentence}");
}

#[test]
fn arming_without_a_library() {
    let error = connect(rig()).arm().unwrap_err();
    let sentence = error.to_string();
    assert!(
        sentence.ends_with("the controller has no valid library; flash a library first"),
        "{sentence}"
    );
}

#[test]
fn a_library_while_torque_is_on() {
    let mut session = armed();
    let error = session.flash(&robot::library(), |_| {}).unwrap_err();
    assert!(error.to_string().contains("the robot is not disarmed: disarm it first"), "{error}");
}

#[test]
fn a_controller_of_another_robot_is_not_armed() {
    let mut session = connect(rig());
    session.flash(&robot::library(), |_| {}).unwrap();
    let hash = robot::config().hash();
    session.expect_robot(hash ^ 1);
    let error = session.arm().unwrap_err();
    assert_eq!(error, SessionError::OtherRobot { node: 1, found: hash, expected: hash ^ 1 });
    assert!(error.to_string().contains("is for another robot"), "{error}");
    assert!(matches!(
        session.command("arm", Action::ArmRequest).unwrap_err(),
        SessionError::OtherRobot { .. }
    ));
    session.run_for(1_000_000).unwrap();
    assert_eq!(session.status().unwrap().state, State::Disarmed);
    session.expect_robot(hash);
    session.arm().unwrap();
}
