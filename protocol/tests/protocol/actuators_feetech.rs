//! Tests of the Feetech codec against its manual (FT-SCS), with all examples for the instructions used here, and against the
//! memory table of the STS series.

use crate::actuators_all::{joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::feetech::Feetech;
use rollwalk_protocol::actuators::feetech::packet::{
    Answer, BROADCAST, MAX_ID, SYNC_READ, SYNC_WRITE, checksum, packet, take,
};
use rollwalk_protocol::actuators::feetech::table::{self, STS3215_C001, STS3215_C018, STS3250};
use rollwalk_protocol::actuators::serial::ReceiveBuffer;
use rollwalk_protocol::actuators::{ActuatorCommand, Codec, Command, Faults, Refusal};
use std::f32::consts::{FRAC_PI_2, PI};

const SERVOS: Feetech = Feetech { model: STS3215_C018, return_delay_us: 500 };

fn bytes(hex: &str) -> Vec<u8> {
    hex.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).unwrap()).collect()
}

fn received(stream: &[u8]) -> Vec<Answer> {
    let mut line = ReceiveBuffer::default();
    let mut found = Vec::new();
    for &byte in stream {
        line.push(byte);
        found.extend(std::iter::from_fn(|| take(&mut line, false)));
    }
    found.extend(std::iter::from_fn(|| take(&mut line, true)));
    assert_eq!(line.bytes(), []);
    found
}

fn answer(id: u8, status: u8, data: [u8; 8]) -> Vec<u8> {
    packet(id, status, &data).unwrap().to_vec()
}

/// Examples 1, 2, 4, 7 and 8 of the manual: ping, read, write, sync write, sync read.
#[test]
fn instructions_of_the_manual() {
    assert_eq!(packet(1, 1, &[]).unwrap()[..], bytes("FF FF 01 02 01 FB"));
    assert_eq!(packet(1, 2, &[0x38, 2]).unwrap()[..], bytes("FF FF 01 04 02 38 02 BE"));
    let goal = [0x2A, 0, 8, 0, 0, 0xE8, 3];
    assert_eq!(packet(1, 3, &goal).unwrap()[..], bytes("FF FF 01 09 03 2A 00 08 00 00 E8 03 D5"));
    let mut four = vec![0x2A, 6];
    (1..=4).for_each(|id| four.extend([id, 0, 8, 0, 0, 0xE8, 3]));
    assert_eq!(
        packet(BROADCAST, SYNC_WRITE, &four).unwrap()[..],
        bytes(
            "FF FF FE 20 83 2A 06 01 00 08 00 00 E8 03 02 00 08 00 00 E8 03 \
             03 00 08 00 00 E8 03 04 00 08 00 00 E8 03 58"
        )
    );
    let queries = [1, 2].map(|id| ActuatorCommand { id, command: Command::Query });
    let mut packets = Vec::new();
    SERVOS.encode(&queries, &mut |packet| packets.push(packet.to_vec())).unwrap();
    assert_eq!(packets, [bytes("FF FF FE 06 82 38 08 01 02 36")]);
    assert_eq!(packets[0][4], SYNC_READ);
}

/// Answers of example 8, and those of examples 1 and 2, which do not answer queries of this crate.
#[test]
fn answers_of_the_manual() {
    let both =
        "FF FF 01 0A 00 00 08 00 00 00 00 79 1E 55 FF FF 02 0A 00 FF 07 00 00 00 00 77 23 53";
    let told: Vec<_> = received(&bytes(both)).iter().map(|answer| SERVOS.decode(answer)).collect();
    assert_eq!(told.iter().map(|(id, _)| *id).collect::<Vec<_>>(), [1, 2]);
    assert_eq!((told[0].1.position_rad, told[0].1.temperature_c), (Some(0.0), Some(30.0)));
    assert!((told[0].1.voltage_v.unwrap() - 12.1).abs() < 1e-5);
    // A step less than the middle.
    let below = told[1].1.position_rad.unwrap();
    assert!((below + PI / 2048.0).abs() < 1e-7, "{below}");
    assert_eq!((told[1].1.torque_nm, told[1].1.faults), (Some(0.0), Some(Faults::NONE)));
    assert_eq!(told[1].1.enabled, None);
    for other in ["FF FF 01 02 00 FC", "FF FF 01 04 00 18 05 DD"] {
        assert_eq!(received(&bytes(other)), []);
    }
    // Example 7, received again on a half-duplex line, contains no answer.
    let goal = joint(0.3, 0.0, 0.0, None);
    let echo = sent(&SERVOS, 1, Command::Joint(goal)).unwrap();
    assert_eq!(received(&[&echo[0][..], &bytes(both)].concat()).len(), 2);
}

/// Positions and speeds have the sign in bit 15, loads in bit 10.
#[test]
fn signs_are_bits() {
    let decode = |data| SERVOS.decode(&Answer { id: 1, status: 0, data }).1;
    let told = decode([0, 0x0C, 0xE8, 0x83, 0xF4, 0x05, 74, 35]);
    let near = |told: Option<f32>, meant: f32| (told.unwrap() - meant).abs() < 1e-4 * meant.abs();
    assert!(near(told.position_rad, FRAC_PI_2), "{told:?}");
    assert!(near(told.speed_rad_s, -1000.0 * PI / 2048.0), "{told:?}");
    // −50.0 % of 30 kg·cm.
    assert!(near(told.torque_nm, -0.5 * 2.942), "{told:?}");
    // A servo that counts turns may report a position below its first step.
    let told = decode([1, 0x80, 0, 0, 0, 0, 74, 35]);
    assert!(near(told.position_rad, -2049.0 * PI / 2048.0), "{told:?}");
}

#[test]
fn status_bits() {
    let faults = |status| SERVOS.decode(&Answer { id: 1, status, data: [0; 8] }).1.faults.unwrap();
    for (status, meant) in [
        (1, Faults::BAD_VOLTAGE),
        (2, Faults::SENSOR),
        (4, Faults::OVERHEATED),
        (8, Faults::OVERCURRENT),
        (32, Faults::OVERCURRENT),
        (64, Faults::OTHER),
    ] {
        assert_eq!(faults(status), meant, "{status}");
    }
    // As in the manual: 4 + 1.
    assert_eq!(faults(5), Faults(Faults::BAD_VOLTAGE.0 | Faults::OVERHEATED.0));
}

/// Addresses of the memory table, and speeds and torques of the data sheets.
#[test]
fn memory_table() {
    let addresses = [
        (table::OPERATING_MODE, 33),
        (table::TORQUE_ENABLE, 40),
        (table::ACCELERATION, 41),
        (table::GOAL_POSITION, 42),
        (table::GOAL_VELOCITY, 46),
        (table::TORQUE_LIMIT, 48),
        (table::PRESENT_POSITION, 56),
    ];
    assert!(addresses.iter().all(|(ours, theirs)| ours == theirs));
    for (model, rev_min, nm) in
        [(STS3215_C001, 52.0, 1.912), (STS3215_C018, 45.0, 2.942), (STS3250, 75.0, 4.903)]
    {
        let fastest = model.max_velocity as f32 * table::STEP_RAD * 30.0 / PI;
        assert!((fastest - rev_min).abs() < 0.015, "{}: {fastest}", model.name);
        assert!((model.stall_torque_nm - nm).abs() < 1e-3, "{}", model.name);
    }
}

#[test]
fn units() {
    let position = |rad| SERVOS.goal_position(rad).map(u16::from_le_bytes);
    assert_eq!(
        (position(0.0), position(FRAC_PI_2), position(-PI)),
        (Some(2048), Some(3072), Some(0))
    );
    // Half a turn further is the first step again.
    assert_eq!((position(3.1408), position(PI), position(-3.1424)), (Some(4095), None, None));
    let velocity = |rev_min: f32| SERVOS.goal_velocity(rev_min * PI / 30.0).map(u16::from_le_bytes);
    // "50 steps/s = 0.732 RPM".
    assert_eq!((velocity(0.7324), velocity(-0.7324)), (Some(50), Some(0x8032)));
    assert_eq!((velocity(0.0), velocity(45.0), velocity(45.1)), (Some(0), Some(3072), None));
    let limit = |nm| SERVOS.torque_limit(nm).map(u16::from_le_bytes);
    assert_eq!((limit(1.471), limit(2.942), limit(2.95)), (Some(500), Some(1000), None));
    // 0 would mean no torque.
    assert_eq!((limit(0.001), limit(f32::NAN)), (None, None));
}

fn written(orders: &[ActuatorCommand]) -> Vec<(u8, Vec<u8>)> {
    let mut writes = Vec::new();
    SERVOS
        .encode(orders, &mut |packet| {
            let [0xFF, 0xFF, BROADCAST, length, _, address, _, rest @ .., sum] = &packet[..] else {
                panic!("{packet:x?}");
            };
            assert_eq!(usize::from(*length) + 4, packet.len());
            assert_eq!(checksum(&packet[2..packet.len() - 1]), *sum);
            writes.push((*address, rest.to_vec()));
        })
        .unwrap();
    writes
}

/// Before torque is on, the goal is set to the measured pose, and limits left by another program are removed. An acceleration
/// of 0 means the largest one. The speed is the motor's largest.
#[test]
fn enabling_writes_in_order() {
    let command = Command::EnableJoint { measured_rad: FRAC_PI_2 };
    let orders = [
        ActuatorCommand { id: 1, command },
        ActuatorCommand { id: 2, command: Command::EnableWheel },
    ];
    assert_eq!(
        written(&orders),
        [
            (41, vec![2, 0]),
            (41, vec![1, 0, 0, 0x0C, 0, 0, 0, 0x0C]),
            (40, vec![1, 1]),
            (46, vec![2, 0, 0]),
            (40, vec![2, 1]),
        ]
    );
}

#[test]
fn one_packet_for_all_servos() {
    let go = |id| ActuatorCommand { id, command: Command::Joint(joint(0.0, 0.0, 0.0, None)) };
    let roll = |id| ActuatorCommand { id, command: Command::Wheel(wheel(-1.0, None, None)) };
    let off = |id| ActuatorCommand { id, command: Command::Disable };
    // 652 steps per second.
    let mixed = [go(1), roll(3), off(4), go(2)];
    let expected = [(40, vec![4, 0]), (42, vec![1, 0, 8, 2, 0, 8]), (46, vec![3, 0x8C, 0x82])];
    assert_eq!(written(&mixed), expected);
    // A torque limit is sent; a speed limit does not apply to a wheel.
    let limits = Command::Limits { speed_rad_s: 1.0, torque_nm: 1.471 };
    assert_eq!(written(&[ActuatorCommand { id: 1, command: limits }]), [(48, vec![1, 0xF4, 1])]);
    let orders: Vec<_> = (0..60).map(go).collect();
    assert_eq!(written(&orders).len(), 3);
    assert!(matches!(sent(&SERVOS, MAX_ID + 1, Command::Disable), Err(Refusal::Address)));
    for refused in [
        Command::Joint(joint(0.0, 0.0, 0.0, Some((0.0, 1.0)))),
        Command::Joint(joint(0.0, 0.0, 0.1, None)),
        Command::Wheel(wheel(1.0, None, Some(1.0))),
        Command::EnableTorque,
    ] {
        assert!(matches!(sent(&SERVOS, 1, refused), Err(Refusal::Unsupported(_))), "{refused:?}");
    }
}

/// Answers are extracted after any bytes without a header of their own. A false header at the end of a period hides no answer
/// of the next period.
#[test]
fn answers_survive_what_is_none() {
    let whole = answer(7, 0, [1, 2, 3, 4, 5, 6, 7, 8]);
    for before in ["FF", "FF FF", "FF FF FF", "00 FF FF 03", "FF FF 01 F0", "FF FF FD 0B 00"] {
        let found = received(&[bytes(before), whole.clone()].concat());
        assert_eq!(found.len(), 1, "{before}");
    }
    // The header of a cut packet: the bytes of the next packet follow as its data, with a wrong checksum.
    let cut = [&whole[..9], &whole].concat();
    assert_eq!(received(&cut).len(), 1);
    // A cut echo waits for its end until the line is silent.
    let mut line = ReceiveBuffer::default();
    bytes("FF FF FE 20 83 2A 06 01").iter().for_each(|&byte| line.push(byte));
    whole.iter().for_each(|&byte| line.push(byte));
    assert_eq!(take(&mut line, false), None);
    assert!(take(&mut line, true).is_some());
}

proptest! {
    #[test]
    fn answers_come_back(id in 0..=MAX_ID, status: u8, data: [u8; 8]) {
        prop_assert_eq!(received(&answer(id, status, data)), [Answer { id, status, data }]);
    }

    /// A single wrong byte hides the answer, unless it makes another header.
    #[test]
    fn a_wrong_byte_is_noticed(id in 0..=MAX_ID, data: [u8; 8], at in 2usize..14, bits in 1u8..) {
        let mut wrong = answer(id, 0, data);
        wrong[at] ^= bits;
        let as_sent = Answer { id, status: 0, data };
        prop_assert!(!received(&wrong).contains(&as_sent));
    }

    /// Answers that are extracted from random bytes are on the line, one after the other.
    #[test]
    fn any_bytes_do(stream in proptest::collection::vec(
        prop_oneof![3 => Just(0xFFu8), 2 => Just(10), 1 => Just(BROADCAST), 4 => any::<u8>()], 0..600)
    ) {
        let mut from = 0;
        for told in received(&stream) {
            let whole = answer(told.id, told.status, told.data);
            let found = stream[from..].windows(14).position(|window| window == whole);
            from += found.expect("what was taken was on the line") + 14;
            let (_, feedback) = SERVOS.decode(&told);
            prop_assert!(feedback.position_rad.is_some_and(f32::is_finite));
        }
    }
}
