//! Property tests with random frames. Each frame decodes to a message that encodes to the same frame again, or is refused, and
//! never causes a panic.

use proptest::prelude::*;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::crc::crc8_with_id;
use rollwalk_protocol::faults::{Fault, FaultBits};
use rollwalk_protocol::wire::*;

use crate::encode_again::{encode_from, encode_to};

/// Random frame, usually with the identifier of a known message, and with a valid checksum in half of the cases.
fn frame() -> impl Strategy<Value = Frame> {
    let kinds = vec![
        0x000, 0x001, 0x100, 0x101, 0x200, 0x300, 0x301, 0x302, 0x400, 0x401, 0x402, 0x403, 0x404,
        0x600, 0x601, 0x700, 0x701,
    ];
    let kind = prop_oneof![proptest::sample::select(kinds), 0u16..0x800];
    let data = proptest::collection::vec(any::<u8>(), 0..=8);
    (kind, 0u16..16, data, any::<bool>()).prop_map(|(kind, node, mut data, seal)| {
        let id = kind | node << 4;
        if seal && let Some((crc, rest)) = data.split_first_mut() {
            *crc = crc8_with_id(id, rest);
        }
        Frame::standard(id, &data).unwrap()
    })
}

/// True if the frames are equal. Exceptions are commands and parameter requests of unknown kinds, and messages with a float,
/// which may be NaN.
fn same_but_for_ignored_bits(again: Frame, frame: Frame) -> bool {
    let kind = frame.standard_id().unwrap() & 0x70F;
    let unknown_command = kind == 0x200 && frame.data()[1] >> 4 > 10;
    let unknown_parameter = kind == 0x600 && frame.data()[1] >> 4 > 4;
    let nan = matches!(kind, 0x301 | 0x600 | 0x601);
    unknown_command || unknown_parameter || nan || again == frame
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 20 } else { 5000 }))]

    #[test]
    fn any_frame(frame in frame()) {
        if let Ok((node, message)) = ToController::decode(&frame)
            && let Some(again) = encode_to(node, message)
        {
            prop_assert!(same_but_for_ignored_bits(again, frame), "{message:?}");
        }
        if let Ok((node, message)) = FromController::decode(&frame)
            && let Some(again) = encode_from(node, message)
        {
            prop_assert!(same_but_for_ignored_bits(again, frame), "{message:?}");
        }
        // No frame is both.
        let other = Err(DecodeError::OtherMessage);
        prop_assert!(
            ToController::decode(&frame).map(|_| ()) == other
                || FromController::decode(&frame).map(|_| ()) == other
        );
    }

    /// Frames with 29-bit identifiers, which belong to drives, are never messages on the link.
    #[test]
    fn no_message_has_an_identifier_of_29_bits(frame in frame(), low in 0u32..1 << 18) {
        let id = u32::from(frame.standard_id().unwrap());
        for id in [id, id << 18, id << 18 | low] {
            let extended = Frame::extended(id, frame.data()).unwrap();
            prop_assert_eq!(ToController::decode(&extended), Err(DecodeError::OtherMessage));
            prop_assert_eq!(FromController::decode(&extended), Err(DecodeError::OtherMessage));
        }
    }

    /// A sealed frame is refused if up to two bits are damaged, or if its identifier is changed.
    #[test]
    fn damage_is_noticed(
        seq in any::<u8>(), host_ms in any::<u32>(), a in 0usize..48, b in 0usize..48,
        id in 0u16..0x800,
    ) {
        let node = Node::new(1).unwrap();
        let frame = Heartbeat { seq, host_ms }.encode(node);
        let mut data: Vec<u8> = frame.data().to_vec();
        data[a / 8] ^= 1 << (a % 8);
        if a != b {
            data[b / 8] ^= 1 << (b % 8);
        }
        let damaged = Frame::new(frame.id(), &data).unwrap();
        prop_assert_eq!(Heartbeat::decode(&damaged), Err(DecodeError::BadCrc));
        let elsewhere = Frame::standard(id, frame.data()).unwrap();
        if id & 0x70F == 0x100 && Some(id) != frame.standard_id() {
            prop_assert_eq!(Heartbeat::decode(&elsewhere), Err(DecodeError::BadCrc));
        }
    }
}

#[test]
fn an_unknown_kind_of_command_can_be_answered() {
    let node = Node::new(0).unwrap();
    let command = Command { seq: 3, action: Action::Unknown { kind: 12 }, valid_until_ms: 0 };
    assert_eq!(Command::decode(&command.encode(node)), Ok((node, command)));
}

#[test]
fn unused_fields_must_be_zero() {
    let id = 0x210;
    let sealed = |rest: [u8; 7]| {
        let mut data = [0; 8];
        data[1..].copy_from_slice(&rest);
        data[0] = crc8_with_id(id, &rest);
        Frame::standard(id, &data).unwrap()
    };
    for kind in 0..=10u8 {
        for at in 1..5 {
            let mut rest = [kind << 4, 0, 0, 0, 0, 0, 0];
            assert!(Command::decode(&sealed(rest)).is_ok());
            rest[at] = 1;
            let used = match kind {
                6 | 8 => at >= 3,
                // PLAY and TRACK use all fields.
                0 | 10 => true,
                _ => false,
            };
            assert_eq!(Command::decode(&sealed(rest)).is_ok(), used, "kind {kind} byte {at}");
        }
    }
}

#[test]
fn unused_fields_of_parameter_requests_must_be_zero() {
    let id = 0x610;
    let sealed = |rest: [u8; 7]| {
        let data = [&[crc8_with_id(id, &rest)], &rest[..]].concat();
        Frame::standard(id, &data).unwrap()
    };
    for kind in 0..=4u8 {
        for (at, byte) in [(1, 1), (1, 0x10), (2, 1), (3, 1), (4, 1), (5, 1), (6, 1)] {
            let mut rest = [kind << 4, 0, 0, 0, 0, 0, 0];
            assert!(ParameterRequest::decode(&sealed(rest)).is_ok());
            rest[at] = byte;
            let used = match kind {
                0 => at <= 2 && byte == 1,
                1 => byte == 1,
                _ => false,
            };
            assert_eq!(ParameterRequest::decode(&sealed(rest)).is_ok(), used, "{kind} {at} {byte}");
        }
    }
    let action = ParameterAction::Unknown { kind: 9 };
    let request = ParameterRequest { seq: 3, action };
    let node = Node::new(0).unwrap();
    assert_eq!(ParameterRequest::decode(&request.encode(node)), Ok((node, request)));
}

#[test]
fn commands_expire_by_the_low_bits_of_the_clock() {
    let command = |valid_until_ms| Command { seq: 0, action: Action::Pause, valid_until_ms };
    assert!(!command(1000).expired(1_000_999));
    assert!(command(1000).expired(1_001_000));
    // Valid for at most one second.
    assert!(!command(2000).expired(1_000_000));
    assert!(command(2000).expired(999_999));
    // A command that has waited, for as long as the counter can express.
    assert!((1_001..65_536).all(|ms| command(1000).expired(1000 * ms)));
    assert!(!command(1000).expired(65_536_000));
    // Near the wrap at 65,536 ms.
    assert!(!command(100).expired(65_500_000));
    assert!(!command(100).expired(65_636_000));
    assert!(command(100).expired(65_637_000));
    assert!(command(65_500).expired(65_536_000));
}

#[test]
fn fault_sets() {
    let set = FaultBits::default().with(Fault::BusOff).with(Fault::NoLibrary);
    assert!(set.contains(Fault::BusOff) && !set.contains(Fault::EStop) && !set.is_empty());
    assert_eq!(set.iter().collect::<Vec<_>>(), [Fault::NoLibrary, Fault::BusOff]);
}

#[test]
fn nodes() {
    assert_eq!(Node::new(15), None);
    assert_eq!(Node::new(14).map(Node::number), Some(14));
    assert_eq!(Node::BROADCAST.number(), 15);
}
