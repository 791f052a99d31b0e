//! Tests of the CyberGear codec against its manual, section 4.1: identifiers, scales, bits.

use crate::actuators_all::{can_text, joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::cybergear::{
    CyberGear, MECHANICAL_POSITION, SAMPLE_MAX_RAD, TABLE_MAX_RAD,
};
use rollwalk_protocol::actuators::{CanCodec, Command, Faults, Refusal};
use rollwalk_protocol::can::Frame;

const MOTORS: CyberGear = CyberGear { host: 0xFD, max_position_rad: TABLE_MAX_RAD };

fn frames(command: Command) -> Vec<String> {
    sent(&MOTORS, 0x7F, command).unwrap().iter().map(can_text).collect()
}

/// Types 0, 3, 4, 6 (4.1.1, 4.1.4 to 4.1.6): bits 28 to 24 are the type, 15 to 8 the host, 7 to 0 the motor.
#[test]
fn commands() {
    assert_eq!(can_text(&MOTORS.get_id(0x7F)), "0000fd7f#0000000000000000");
    assert_eq!(frames(Command::Disable), ["0400fd7f#0000000000000000"]);
    assert_eq!(frames(Command::ClearFaults), ["0400fd7f#0100000000000000"]);
    assert_eq!(can_text(&MOTORS.zero_here(0x7F)), "0600fd7f#0100000000000000");
    let limp = "0180007f#8000800000000000";
    let enable = ["1200fd7f#0570000000000000", limp, "0300fd7f#0000000000000000", limp];
    assert_eq!(frames(Command::EnableWheel), enable);
    assert_eq!(frames(Command::EnableJoint { measured_rad: 0.0 }), enable);
    assert_eq!(frames(Command::EnableTorque), enable);
}

/// Type 1 (4.1.2): bits 23 to 8 are the torque; position, speed, kp and kd follow. Codes 0 and 65535 are the ends of ±4π rad,
/// ±30 rad/s, 0 to 500, 0 to 5, and ±12 N·m.
#[test]
fn setpoints_from_end_to_end() {
    let low = joint(-TABLE_MAX_RAD, -30.0, -12.0, Some((0.0, 0.0)));
    assert_eq!(frames(Command::Joint(low)), ["0100007f#0000000000000000"]);
    let high = joint(TABLE_MAX_RAD, 30.0, 12.0, Some((500.0, 5.0)));
    assert_eq!(frames(Command::Joint(high)), ["01ffff7f#ffffffffffffffff"]);
    let mixed = joint(TABLE_MAX_RAD / 2.0, -15.0, 6.0, Some((100.0, 1.0)));
    // 0.75, 0.25, 0.2, 0.2 and 0.75 of 65535, rounded.
    assert_eq!(frames(Command::Joint(mixed)), ["01bfff7f#bfff400033333333"]);
    // −0.5 of 12 N·m is a quarter of the scale; no gains.
    assert_eq!(frames(Command::Torque { torque_nm: -6.0 }), ["0140007f#8000800000000000"]);
    let quarter = wheel(15.0, Some(2.5), None);
    assert_eq!(frames(Command::Wheel(quarter)), ["0180007f#8000bfff00008000"]);
    for beyond in [
        joint(TABLE_MAX_RAD + 0.01, 0.0, 0.0, Some((0.0, 0.0))),
        joint(0.0, 30.1, 0.0, Some((0.0, 0.0))),
        joint(0.0, 0.0, 12.1, Some((0.0, 0.0))),
        joint(0.0, 0.0, 0.0, Some((501.0, 0.0))),
        joint(0.0, 0.0, 0.0, Some((0.0, f32::NAN))),
    ] {
        let refused = sent(&MOTORS, 1, Command::Joint(beyond));
        assert!(matches!(refused, Err(Refusal::OutOfRange(_))), "{beyond:?}");
    }
}

/// The sample program of 4.2.1 has ±12.5 rad where the tables have ±4π, a difference of 0.5 %.
#[test]
fn the_two_position_scales_of_the_manual() {
    let sample = CyberGear { max_position_rad: SAMPLE_MAX_RAD, ..MOTORS };
    let end = joint(12.5, 0.0, 0.0, Some((0.0, 0.0)));
    let text = |motors: &CyberGear| can_text(&sent(motors, 1, Command::Joint(end)).unwrap()[0]);
    assert_eq!(text(&sample), "01800001#ffff800000000000");
    assert_eq!(text(&MOTORS), "01800001#ff52800000000000");
}

/// Parameters are read with type 17 and written with type 18 (4.1.8, 4.1.9). Index and value are little-endian. 0x700B is the
/// torque limit, 0x7017 the speed limit.
#[test]
fn parameters() {
    let limits = Command::Limits { speed_rad_s: 10.0, torque_nm: 6.0 };
    assert_eq!(frames(limits), ["1200fd7f#0b7000000000c040", "1200fd7f#1770000000002041"]);
    for (speed_rad_s, torque_nm) in [(0.0, 1.0), (31.0, 1.0), (1.0, 12.5), (1.0, f32::NAN)] {
        assert!(sent(&MOTORS, 1, Command::Limits { speed_rad_s, torque_nm }).is_err());
    }
    let read = MOTORS.read(0x7F, MECHANICAL_POSITION);
    assert_eq!(can_text(&read), "1100fd7f#1970000000000000");
    let data = [0x19, 0x70, 0, 0, 0, 0, 0x80, 0x3F];
    let answer = Frame::extended(0x1100_7FFD, &data).unwrap();
    let value = 1.0f32.to_le_bytes();
    assert_eq!(MOTORS.parameter(&answer), Some((0x7F, MECHANICAL_POSITION, value)));
    assert_eq!(MOTORS.parameter(&read), None);
}

/// Type 2 (4.1.3): bits 15 to 8 are the motor, 21 to 16 faults, 23 to 22 the mode; the temperature is in tenths of a °C.
#[test]
fn feedback() {
    let data = [0xFF, 0xFF, 0, 0, 0xFF, 0xFF, 0x01, 0x4D];
    let told = |id| MOTORS.decode(&Frame::extended(id, &data).unwrap());
    let (motor, running) = told(0x0280_7FFD).unwrap();
    assert_eq!(motor, 0x7F);
    assert_eq!(running.position_rad, Some(TABLE_MAX_RAD));
    assert_eq!((running.speed_rad_s, running.torque_nm), (Some(-30.0), Some(12.0)));
    assert_eq!((running.temperature_c, running.enabled), (Some(33.3), Some(true)));
    assert_eq!(running.faults, Some(Faults::NONE));
    let of = [
        (1 << 16, Faults::BAD_VOLTAGE),
        (1 << 17, Faults::OVERCURRENT),
        (1 << 18, Faults::OVERHEATED),
        (1 << 19, Faults::SENSOR),
        (1 << 20, Faults::SENSOR),
        (1 << 21, Faults::SENSOR),
    ];
    for (bit, fault) in of {
        let (_, faulty) = told(0x0200_7FFD | bit).unwrap();
        assert_eq!((faulty.faults, faulty.enabled), (Some(fault), Some(false)));
    }
    // An answer to another host.
    assert_eq!(told(0x0280_7F01), None);
}

/// Type 21 (4.1.10), with its addresses in either order.
#[test]
fn fault_frames() {
    for id in [0x1500_7FFD, 0x1500_FD7F] {
        for (value, fault) in [
            (1u32, Faults::OVERHEATED),
            (1 << 1, Faults::OTHER),
            (1 << 2, Faults::BAD_VOLTAGE),
            (1 << 7, Faults::SENSOR),
            (1 << 9, Faults::OVERCURRENT),
            (1 << 16, Faults::OVERCURRENT),
            (0, Faults::NONE),
        ] {
            let [a, b, c, d] = value.to_le_bytes();
            let frame = Frame::extended(id, &[a, b, c, d, 0, 0, 0, 0]).unwrap();
            let (motor, told) = MOTORS.decode(&frame).unwrap();
            assert_eq!((motor, told.faults), (0x7F, Some(fault)), "{value:x}");
        }
    }
}

proptest! {
    #[test]
    fn measurements_and_setpoints_share_their_scales(p in -12.5f32..12.5, v in -30.0f32..30.0, t in -12.0f32..12.0) {
        let frame = sent(&MOTORS, 1, Command::Joint(joint(p, v, t, Some((1.0, 1.0))))).unwrap()[0];
        let torque = (frame.extended_id().unwrap() >> 8) as u16;
        let mut data = [0; 8];
        data[..4].copy_from_slice(&frame.data()[..4]);
        data[4..6].copy_from_slice(&torque.to_be_bytes());
        let (_, told) = MOTORS.decode(&Frame::extended(0x0280_01FD, &data).unwrap()).unwrap();
        // Half a step and the roundings of f32.
        let near = |told: Option<f32>, meant: f32, max: f32| (told.unwrap() - meant).abs() <= 0.51 * 2.0 * max / 65535.0;
        prop_assert!(near(told.position_rad, p, TABLE_MAX_RAD));
        prop_assert!(near(told.speed_rad_s, v, 30.0) && near(told.torque_nm, t, 12.0));
    }
}
