//! Tests of the Maestro codec against Pololu's user's guide, sections 5.c to 5.e.

use crate::actuators_all::{joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::maestro::{MAX_CHANNEL, Maestro, Pulse, crc7};
use rollwalk_protocol::actuators::serial::{Answer, ReceiveBuffer};
use rollwalk_protocol::actuators::{ActuatorCommand, Codec, Command, Faults, Refusal, SerialCodec};
use std::f32::consts::FRAC_PI_2;

const PULSE: Pulse =
    Pulse { centre_us: 1500.0, us_per_rad: 1000.0 / FRAC_PI_2, limits_us: (500.0, 2500.0) };
const COMPACT: Maestro = Maestro { device: None, crc: false, set_multiple: true, pulse: PULSE };

#[test]
fn examples_of_the_guide() {
    // 5.e Set Target: channel 2 to 1500 µs; 5.c: the same for servo 0 of device 12.
    assert_eq!(COMPACT.set_target(2, 6000), [0x84, 0x02, 0x70, 0x2E]);
    let device = Maestro { device: Some(12), ..COMPACT };
    assert_eq!(device.set_target(0, 6000), [0xAA, 0x0C, 0x04, 0x00, 0x70, 0x2E]);
    // 5.e Set Multiple Targets: channel 3 off, channel 4 to 1500 µs.
    assert_eq!(COMPACT.set_targets(3, &[0, 6000]), [0x9F, 2, 3, 0, 0, 0x70, 0x2E]);
    // 5.e Set Speed: channel 5 to 140.
    assert_eq!(COMPACT.set_speed(5, 140), [0x87, 0x05, 0x0C, 0x01]);
    assert_eq!(COMPACT.set_acceleration(5, 255), [0x89, 0x05, 0x7F, 0x01]);
    assert_eq!(
        (&COMPACT.get_errors()[..], &device.get_errors()[..]),
        (&[0xA1][..], &[0xAA, 12, 0x21][..])
    );
    assert_eq!(
        (&COMPACT.go_home()[..], &device.go_home()[..]),
        (&[0xA2][..], &[0xAA, 12, 0x22][..])
    );
    // 5.d: the CRC of 83 01 is 17.
    assert_eq!(crc7(&[0x83, 0x01]), 0x17);
    let checked = Maestro { crc: true, ..COMPACT };
    let packet = checked.set_target(2, 6000);
    assert_eq!((&packet[..4], packet[4]), (&COMPACT.set_target(2, 6000)[..], crc7(&packet[..4])));
}

#[test]
fn angles_are_pulses() {
    let target = |rad| COMPACT.target(rad);
    assert_eq!(
        (target(0.0), target(FRAC_PI_2), target(-FRAC_PI_2)),
        (Ok(6000), Ok(10000), Ok(2000))
    );
    for beyond in [1.6, -1.6, f32::NAN, f32::INFINITY, -1e30] {
        assert_eq!(target(beyond), Err(Refusal::OutOfRange("position")), "{beyond}");
    }
    // A pulse of 0 would stop the servo instead.
    let short = Pulse { limits_us: (0.0, 2500.0), ..PULSE };
    let short = Maestro { pulse: short, ..COMPACT };
    assert!(short.target(-1500.0 / PULSE.us_per_rad).is_err());
}

fn order(id: u8, command: Command) -> ActuatorCommand {
    ActuatorCommand { id, command }
}

fn go(id: u8, rad: f32) -> ActuatorCommand {
    order(id, Command::Joint(joint(rad, 0.0, 0.0, None)))
}

#[test]
fn neighbours_share_a_command() {
    let orders = [go(1, 0.0), go(2, 0.0), order(3, Command::Disable), go(4, 0.0), go(7, 0.0)];
    let mut packets = Vec::new();
    COMPACT.encode(&orders, &mut |packet| packets.push(packet.to_vec())).unwrap();
    assert_eq!(
        packets,
        [
            vec![0x9F, 2, 1, 0x70, 0x2E, 0x70, 0x2E],
            vec![0x84, 3, 0, 0],
            vec![0x9F, 1, 4, 0x70, 0x2E],
            vec![0x9F, 1, 7, 0x70, 0x2E],
        ]
    );
    let micro = Maestro { set_multiple: false, ..COMPACT };
    packets.clear();
    micro.encode(&orders[..2], &mut |packet| packets.push(packet.to_vec())).unwrap();
    assert_eq!(packets, [vec![0x84, 1, 0x70, 0x2E], vec![0x84, 2, 0x70, 0x2E]]);
}

#[test]
fn all_channels_fit_and_one_bad_order_stops_all() {
    let mut orders: Vec<ActuatorCommand> = (0..=MAX_CHANNEL).map(|id| go(id, 0.1)).collect();
    let mut packets = Vec::new();
    let full = Maestro { device: Some(12), crc: true, ..COMPACT };
    full.encode(&orders, &mut |packet| packets.push(packet)).unwrap();
    assert_eq!((packets.len(), packets[0].len()), (1, 3 + 2 + 48 + 1));
    orders[23] = go(23, 3.0);
    packets.clear();
    let refused = full.encode(&orders, &mut |packet| packets.push(packet));
    assert_eq!((refused, packets.len()), (Err((23, Refusal::OutOfRange("position"))), 0));
}

#[test]
fn what_it_cannot_be_told() {
    for (command, refusal) in [
        (Command::Wheel(wheel(0.0, None, None)), Refusal::Unsupported("wheel speed")),
        (Command::Joint(joint(0.0, 0.0, 1.0, None)), Refusal::Unsupported("torque")),
        (Command::Joint(joint(0.0, 0.0, 0.0, Some((0.0, 1.0)))), Refusal::Unsupported("gains")),
    ] {
        assert_eq!(sent(&COMPACT, 0, command), Err(refusal));
    }
    assert_eq!(sent(&COMPACT, 24, Command::Disable), Err(Refusal::Address));
}

/// Bits of the error register from section 4.e of the guide.
#[test]
fn errors() {
    let faults = |bits: u16| {
        let mut buffer = ReceiveBuffer::default();
        for byte in bits.to_le_bytes() {
            COMPACT.receive(&mut buffer, byte, true);
        }
        let Some(Answer::Adapter(feedback)) = COMPACT.take(&mut buffer, false) else { panic!() };
        assert_eq!(feedback, Maestro::errors(bits.to_le_bytes()));
        assert_eq!(COMPACT.take(&mut buffer, false), None);
        feedback.faults
    };
    assert_eq!(faults(0), Some(Faults::NONE));
    assert_eq!(faults(1 << 3), Some(Faults::REFUSED));
    assert_eq!(faults(1 << 5), Some(Faults::TIMED_OUT));
    assert_eq!(faults(1 << 8), Some(Faults::OTHER));
}

proptest! {
    /// Data bytes never have the highest bit, which marks commands.
    #[test]
    fn only_the_first_byte_has_its_highest_bit(channel in 0u8..24, target: u16, device in proptest::option::of(any::<u8>()), crc: bool) {
        let maestro = Maestro { device, crc, ..COMPACT };
        for packet in [maestro.set_target(channel, target), maestro.set_targets(channel, &[target; 30])] {
            prop_assert!(packet[0] & 0x80 != 0);
            prop_assert!(packet[1..].iter().all(|byte| byte & 0x80 == 0));
        }
    }

    /// Compares the CRC with a second algorithm: long division of the bit string, as in the guide.
    #[test]
    fn crc7_is_the_remainder(bytes in proptest::collection::vec(any::<u8>(), 0..20)) {
        let mut bits: Vec<u8> = bytes.iter().flat_map(|b| (0..8).map(move |i| b >> i & 1)).collect();
        bits.extend([0; 7]);
        for i in 0..bits.len() - 7 {
            if bits[i] == 1 {
                for (k, p) in [1, 0, 0, 0, 1, 0, 0, 1].iter().enumerate() {
                    bits[i + k] ^= p;
                }
            }
        }
        let rest = &bits[bits.len() - 7..];
        let expected = rest.iter().enumerate().fold(0, |sum, (i, bit)| sum | bit << i);
        prop_assert_eq!(crc7(&bytes), expected);
    }
}
