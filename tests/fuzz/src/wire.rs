//! Fuzz target for frames and messages of the link. Decoded ones must encode to the same bytes, and no frame may be valid in
//! both directions.

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::crc::{crc8_with_id, crc32c};
use rollwalk_protocol::wire::transport::{MAX_MESSAGE, Reply, TransferResult};
use rollwalk_protocol::wire::*;

use crate::encode_again::{encode_from, encode_to};

/// First byte of an input whose other bytes are frames.
const FRAMES: u8 = 0;
/// First byte of an input whose other bytes are frames. Their checksums are corrected.
const SEALED_FRAMES: u8 = 1;
/// First byte of an input whose other bytes are a message.
const MESSAGE: u8 = 2;
/// First byte of an input whose other bytes are a block of a library. Its checksum is corrected.
const SEALED_BLOCK: u8 = 3;

/// True if the frames are equal. Exceptions are commands and parameter requests of unknown kinds, and messages with a float,
/// which may be NaN.
fn same_but_for_ignored_bits(again: Frame, frame: Frame) -> bool {
    let kind = frame.standard_id().unwrap_or_default() & 0x70F;
    let unknown = match ToController::decode(&frame) {
        Ok((_, ToController::Command(one))) => matches!(one.action, Action::Unknown { .. }),
        Ok((_, ToController::Parameter(one))) => {
            matches!(one.action, ParameterAction::Unknown { .. })
        }
        _ => false,
    };
    let nan = matches!(kind, 0x301 | 0x600 | 0x601);
    unknown || nan || again == frame
}

fn check_frame(frame: Frame) {
    let (to, from) = (ToController::decode(&frame), FromController::decode(&frame));
    if let Ok((node, message)) = to
        && let Some(again) = encode_to(node, message)
    {
        assert!(same_but_for_ignored_bits(again, frame), "{frame:?} is {message:?}, is {again:?}");
    }
    if let Ok((node, message)) = from
        && let Some(again) = encode_from(node, message)
    {
        assert!(same_but_for_ignored_bits(again, frame), "{frame:?} is {message:?}, is {again:?}");
    }
    let other = DecodeError::OtherMessage;
    assert!(to.err() == Some(other) || from.err() == Some(other), "{frame:?} is both");
    // Start, identifier, control, CRC and end, without stuffing.
    let bits = frame.exact_bits();
    assert!(bits >= 47 + 8 * frame.data().len() as u32);
    assert!(bits <= rollwalk_protocol::can::worst_case_bits(frame.data().len() as u8));
}

fn frames(u: &mut Unstructured<'_>, seal: bool) -> Result<()> {
    while !u.is_empty() {
        let id = u.arbitrary::<u16>()? & 0x7FF;
        let len = usize::from(u.arbitrary::<u8>()? % 9).min(u.len());
        let mut data = u.bytes(len)?.to_vec();
        if seal && let Some((crc, rest)) = data.split_first_mut() {
            *crc = crc8_with_id(id, rest);
        }
        check_frame(Frame::standard(id, &data).expect("11 bits and 8 bytes"));
    }
    Ok(())
}

fn check_message(bytes: &[u8]) {
    let mut out = [0; MAX_MESSAGE];
    if let Ok(request) = Request::decode(bytes) {
        assert_eq!(request.encode(&mut out), Some(bytes), "{request:?}");
    }
    if let Ok(response) = Response::decode(bytes) {
        assert_eq!(response.encode(&mut out), Some(bytes), "{response:?}");
    }
}

/// Runs a sequence of frames, or a message.
pub fn run(data: &[u8]) {
    let Some((&how, rest)) = data.split_first() else { return };
    match how % 4 {
        how @ (FRAMES | SEALED_FRAMES) => {
            frames(&mut Unstructured::new(rest), how == SEALED_FRAMES)
                .expect("no read is longer than what is left");
        }
        SEALED_BLOCK if rest.len() > 9 => {
            let mut message = rest.to_vec();
            message[0] = 0x11;
            let crc = crc32c(&message[9..]);
            message[5..9].copy_from_slice(&crc.to_le_bytes());
            check_message(&message);
        }
        _ => check_message(rest),
    }
}

/// Seeds with a frame or message of each kind.
pub fn seeds() -> Vec<Vec<u8>> {
    let node = Node::new(3).expect("one of 15");
    let command = |action| Command { seq: 5, action, valid_until_ms: 1000 }.encode(node);
    let parameter = |action| ParameterRequest { seq: 5, action }.encode(node);
    let frames = [
        Estop.encode(Node::BROADCAST),
        Heartbeat { seq: 1, host_ms: 77 }.encode(node),
        HeartbeatReply { seq: 1, controller_ms: 77 }.encode(node),
        command(Action::Play { code: 20, speed_64ths: 64 }),
        command(Action::ArmConfirm { nonce: 0xBEEF }),
        command(Action::Pause),
        parameter(ParameterAction::Set { parameter: 1, channel: 2, value: 0.5 }),
        parameter(ParameterAction::Get { parameter: 0, channel: 1 }),
        parameter(ParameterAction::Save),
        Discover.encode(Node::BROADCAST),
    ];
    let mut seeds = Vec::new();
    for how in [FRAMES, SEALED_FRAMES] {
        let mut seed = vec![how];
        for frame in &frames {
            seed.extend(frame.standard_id().unwrap_or_default().to_le_bytes());
            seed.push(frame.data().len() as u8);
            seed.extend(frame.data());
        }
        seeds.push(seed);
    }
    // Every identifier, with a sealed payload of its length.
    for kind in [0x001u16, 0x101, 0x300, 0x301, 0x302, 0x400, 0x601, 0x701] {
        for len in [2, 7, 8] {
            let mut seed = vec![SEALED_FRAMES];
            seed.extend((kind | 0x30).to_le_bytes());
            seed.push(len);
            seed.extend(std::iter::repeat_n(0, len.into()));
            seeds.push(seed);
        }
    }
    let mut out = [0; MAX_MESSAGE];
    let requests = [
        Request::Hello { major: 1, minor: 0 },
        Request::Log { since: 3 },
        Request::Begin { len: 1000, digest: 7 },
        Request::Block { offset: 512, bytes: b"some of the library" },
        Request::Finish,
        Request::Activate { digest: 7 },
    ];
    let messages = requests.map(|r| r.encode(&mut out).expect("fits").to_vec());
    let reply = Reply::new(0x10, TransferResult::Ok, 0);
    let mut log = Log::new(77, 3, 4);
    assert!(log.push([1; LOG_ENTRY_BYTES]));
    let responses = [Response::Reply(reply), Response::Log(log)];
    let responses = responses.map(|r| r.encode(&mut out).expect("fits").to_vec());
    for message in messages.into_iter().chain(responses) {
        for how in [MESSAGE, SEALED_BLOCK] {
            seeds.push([vec![how], message.clone()].concat());
        }
    }
    seeds
}
