//! Transfer of a library over the link.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::crc::{crc32c, file_digest};
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::validate;
use rollwalk_protocol::wire::transport::{MAX_BLOCK, TransferResult};
use rollwalk_protocol::wire::{Action, CommandResult, Request, Response, State};

pub fn result(response: Response) -> TransferResult {
    match response {
        Response::Reply(reply) => reply.result,
        other => panic!("{other:?}"),
    }
}

pub fn flash(rig: &mut Rig, bytes: &[u8]) -> TransferResult {
    let digest = file_digest(bytes);
    let begin = Request::Begin { len: bytes.len() as u32, digest };
    assert_eq!(result(rig.request(&begin)), TransferResult::Ok);
    for (i, block) in bytes.chunks(MAX_BLOCK).enumerate() {
        let block = Request::Block { offset: (i * MAX_BLOCK) as u32, bytes: block };
        assert_eq!(result(rig.request(&block)), TransferResult::Ok);
        rig.step();
    }
    match result(rig.request(&Request::Finish)) {
        TransferResult::Ok => result(rig.request(&Request::Activate { digest })),
        refused => refused,
    }
}

/// Found by the fault campaign: after an answer of several frames whose flow control was lost, the controller waited for a
/// second and answered no other request.
#[test]
fn who_asks_again_is_answered_although_the_last_answer_was_not_taken() {
    let mut rig = Rig::booted();
    let hello = Request::Hello { major: 1, minor: 0 };
    let mut bytes = [0; 16];
    let message = hello.encode(&mut bytes).unwrap();
    // The request fits into one frame, the answer does not.
    let mut pdu = vec![message.len() as u8];
    pdu.extend_from_slice(message);
    let frame = Frame::standard(0x500 | u16::from(me().number()) << 4, &pdu).unwrap();
    for _ in 0..3 {
        rig.brain.on_link_frame(rig.now_us, &frame);
        let answers = std::iter::from_fn(|| rig.brain.poll_link(rig.now_us));
        let transport = answers.filter(|f| f.standard_id().unwrap() & 0x70F == 0x501);
        let heads: Vec<u8> = transport.map(|frame| frame.data()[0] >> 4).collect();
        assert_eq!(heads, [1], "a first frame, which nobody takes");
        rig.now_us += 100_000;
    }
    assert!(matches!(rig.request(&hello), Response::Hello(_)));
}

#[test]
fn a_library_is_flashed_and_played() {
    let mut rig = Rig::new(None);
    rig.run(20);
    assert!(rig.brain.faults().contains(Fault::NoLibrary));
    let bytes = library();
    assert!(bytes.len() > MAX_BLOCK, "several blocks");
    assert_eq!(flash(&mut rig, &bytes), TransferResult::Ok);
    rig.run(20);
    assert!(rig.brain.faults().is_empty());

    let Response::Hello(hello) = rig.request(&Request::Hello { major: 1, minor: 0 }) else {
        panic!("no hello");
    };
    let index = validate(&bytes, &config()).unwrap();
    assert_eq!(hello.library, Some(index.id()));
    assert_eq!((hello.config_hash, hello.channels), (config().hash(), 3));
    assert_eq!(rig.statuses().last().unwrap().1.library, index.id() as u8);

    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig.play(CODE_DRIVE);
    rig.run(100);
    assert_eq!(rig.brain.playing().unwrap().clip.0, DRIVE_CLIP);

    // A transfer is refused while torque is on, and the playing library does not change.
    let begin = Request::Begin { len: 100, digest: 1 };
    assert_eq!(result(rig.request(&begin)), TransferResult::WrongState);
    rig.run(100);
    assert_eq!(rig.brain.state(), State::Playing);
    // A transfer is refused while a stop is latched.
    rig.estop();
    assert_eq!(result(rig.request(&begin)), TransferResult::WrongState);
    assert!(rig.brain.library().is_some());
}

#[test]
fn damaged_truncated_future_and_foreign_libraries_are_refused() {
    let good = library();
    let mut corrupted = good.clone();
    corrupted[200] ^= 4;
    let truncated = good[..good.len() - 7].to_vec();
    let future = of_major_2(&good);
    let mut other_robot = config();
    other_robot.channels[0].max_torque_nm = 2.5;
    let foreign = library_for(&other_robot);

    let mut rig = Rig::new(None);
    rig.run(20);
    let mut with_library = Rig::booted();
    for bytes in [&corrupted, &truncated, &future, &foreign] {
        assert_eq!(flash(&mut rig, bytes), TransferResult::Rejected);
        rig.run(2);
        assert!(rig.brain.library().is_none() && rig.brain.library_reject().is_some());
        let refused = rig.command(Action::ArmRequest).result;
        let expected = if bytes == &foreign {
            CommandResult::ConfigMismatch
        } else {
            CommandResult::NoLibrary
        };
        assert_eq!(refused, expected);
        // A library that is stored already continues.
        assert_eq!(flash(&mut with_library, bytes), TransferResult::Rejected);
        assert!(with_library.brain.library().is_some() && with_library.brain.faults().is_empty());
    }
    assert!(rig.brain.faults().contains(Fault::ConfigMismatch));
    // Another transfer discards the refused library.
    let begin = Request::Begin { len: good.len() as u32, digest: file_digest(&good) };
    assert_eq!(result(rig.request(&begin)), TransferResult::Ok);
    assert!(!rig.brain.faults().contains(Fault::ConfigMismatch));
    assert_eq!(rig.brain.library_reject(), None);
    assert_eq!(flash(&mut rig, &good), TransferResult::Ok);
    rig.run(20);
    rig.arm();
}

/// Library with major version 2 in its header and a valid checksum.
fn of_major_2(library: &[u8]) -> Vec<u8> {
    let mut bytes = library.to_vec();
    bytes[8] = 2;
    let crc = crc32c(&bytes[..20]);
    bytes[20..24].copy_from_slice(&crc.to_le_bytes());
    bytes
}

/// A CRC-32C of the whole file is the same for all headers, because the header's own checksum cancels it. A file that differed
/// from the active library only there was thus activated without being sent.
#[test]
fn a_file_with_another_header_is_another_file() {
    let good = library();
    let future = of_major_2(&good);
    let mut rig = Rig::new(None);
    rig.run(20);
    assert_eq!(flash(&mut rig, &good), TransferResult::Ok);
    let begin = Request::Begin { len: future.len() as u32, digest: file_digest(&future) };
    let reply = rig.request(&begin);
    assert!(matches!(reply, Response::Reply(reply) if reply.next == 0), "{reply:?}");
    assert_eq!(result(rig.request(&Request::Finish)), TransferResult::Incomplete);
    assert_eq!(flash(&mut rig, &future), TransferResult::Rejected);
}

#[test]
fn a_transfer_voids_the_request_to_arm() {
    let mut rig = Rig::booted();
    let nonce = rig.command(Action::ArmRequest).value;
    let begin = Request::Begin { len: 100, digest: 1 };
    assert_eq!(result(rig.request(&begin)), TransferResult::Ok);
    assert_eq!(rig.command(Action::ArmConfirm { nonce }).result, CommandResult::WrongNonce);
    // The library in use is still stored, and arming is possible.
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::Ok);
}
