//! Tests of CANSimple against ODrive's documents: firmware 0.5.6 (`docs/can-protocol.rst`, `tools/odrive-cansimple.dbc`), the
//! DBC of 0.6.10, and a recorded bus.

use crate::actuators_all::{can_text, joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::odrive::{Odrive, Version, estop};
use rollwalk_protocol::actuators::{CanCodec, Command, Faults, Gains, Refusal};
use rollwalk_protocol::can::Frame;
use std::f32::consts::TAU;

const DRIVE: Odrive =
    Odrive { version: Version::V05, reduction: 1.0, torque_constant_nm_a: 0.1, estimates_hz: 100 };

const PRO: Odrive = Odrive { version: Version::V06, ..DRIVE };

fn frames(drive: &Odrive, id: u8, command: Command) -> Vec<String> {
    sent(drive, id, command).unwrap().iter().map(can_text).collect()
}

fn decode_answer(
    drive: &Odrive,
    id: u16,
    data: [u8; 8],
) -> (u8, rollwalk_protocol::actuators::Feedback) {
    drive.decode(&Frame::standard(id, &data).unwrap()).unwrap()
}

/// Example of can-protocol: "An axis id of 0x01 with a command of 0x0C would result in 0x2C". The position is a float, and the
/// feed-forwards are signed thousandths (DBC: `32|16@1- (0.001,0)`, `48|16@1- (0.001,0)`).
#[test]
fn set_input_pos() {
    let setpoint = joint(TAU, 1.5 * TAU, -0.25, None);
    assert_eq!(frames(&DRIVE, 1, Command::Joint(setpoint)), ["02c#0000803fdc0506ff"]);
    assert_eq!(frames(&PRO, 1, Command::Joint(setpoint)), ["02c#0000803fdc0506ff"]);
    let far = |speed, torque| sent(&DRIVE, 1, Command::Joint(joint(0.0, speed, torque, None)));
    assert!(far(32.767 * TAU, -32.767).is_ok());
    assert_eq!(far(32.8 * TAU, 0.0), Err(Refusal::OutOfRange("speed")));
    assert_eq!(far(0.0, 32.8), Err(Refusal::OutOfRange("torque")));
}

/// DBC: velocity and torque are floats.
#[test]
fn set_input_vel_is_exact_at_zero() {
    assert_eq!(
        frames(&DRIVE, 2, Command::Wheel(wheel(-TAU, None, None))),
        ["04d#000080bf00000000"]
    );
    assert_eq!(frames(&DRIVE, 2, Command::Wheel(wheel(0.0, None, None))), ["04d#0000000000000000"]);
}

/// DBC: control mode 1 is torque, and `Input_Torque` is a float. The zero torque is sent before torque is on.
#[test]
fn torque_alone() {
    assert_eq!(frames(&DRIVE, 1, Command::Torque { torque_nm: 1.5 }), ["02e#0000c03f"]);
    let enable = ["02b#0100000001000000", "02e#00000000", "027#08000000"];
    assert_eq!(frames(&DRIVE, 1, Command::EnableTorque), enable);
}

/// DBC: mode 3 is position, 2 velocity; input mode 1 is passthrough; state 8 is closed loop, 1 idle.
#[test]
fn states_limits_and_stops() {
    let enable = Command::EnableJoint { measured_rad: -TAU / 2.0 };
    assert_eq!(
        frames(&DRIVE, 0x3F, enable),
        ["7eb#0300000001000000", "7ec#000000bf00000000", "7e7#08000000"]
    );
    assert_eq!(
        frames(&DRIVE, 0, Command::EnableWheel),
        ["00b#0200000001000000", "00d#0000000000000000", "007#08000000"]
    );
    assert_eq!(frames(&DRIVE, 0, Command::Disable), ["007#01000000"]);
    assert_eq!(frames(&DRIVE, 0, Command::ClearFaults), ["018#00"]);
    assert_eq!(can_text(&estop(3)), "062#");
    // 2 turns/s; 1 N·m corresponds to 10 A.
    let limits = Command::Limits { speed_rad_s: 2.0 * TAU, torque_nm: 1.0 };
    assert_eq!(frames(&DRIVE, 1, limits), ["02f#0000004000002041"]);
    assert_eq!(sent(&DRIVE, 0x40, Command::Disable), Err(Refusal::Address));
}

/// Gains of the cascade from the gains of the impedance. kp = 20 and kd = 0.5 are 40 (turn/s)/turn and 0.5 · 2π N·m/(turn/s). A
/// motor geared 1 : 2 has a quarter of that velocity gain.
#[test]
fn gains_of_the_cascade() {
    let gains = Command::Gains(Gains { kp_nm_rad: 20.0, kd_nm_s_rad: 0.5 });
    let frames = sent(&Odrive { reduction: -2.0, ..DRIVE }, 1, gains).unwrap();
    assert_eq!(can_text(&frames[0]), "03a#00002042");
    let speed_gain = f32::from_le_bytes(frames[1].data()[..4].try_into().unwrap());
    assert!((speed_gain - 0.5 * TAU / 4.0).abs() < 1e-6);
    assert_eq!((frames[1].standard_id(), &frames[1].data()[4..]), (Some(0x3B), &[0; 4][..]));
    for (kp, kd) in [(1.0, 0.0), (-1.0, 1.0), (f32::NAN, 1.0), (1.0, f32::INFINITY)] {
        let gains = Command::Gains(Gains { kp_nm_rad: kp, kd_nm_s_rad: kd });
        assert!(matches!(sent(&DRIVE, 1, gains), Err(Refusal::OutOfRange(_))), "{kp} {kd}");
    }
}

/// Recorded bus of firmware 0.4/0.5 (ODrive forum, "CAN Interface Available for Testing"): axis 0 is idle, axis 63 in closed
/// loop.
#[test]
fn recorded_heartbeats() {
    let (node, heartbeat) = decode_answer(&DRIVE, 0x001, [0, 0, 0, 0, 1, 0, 0, 0]);
    assert_eq!((node, heartbeat.enabled, heartbeat.faults), (0, Some(false), Some(Faults::NONE)));
    let (node, heartbeat) = decode_answer(&DRIVE, 0x7E1, [0, 0, 0, 0, 8, 0, 0, 0]);
    assert_eq!((node, heartbeat.enabled, heartbeat.faults), (63, Some(true), Some(Faults::NONE)));
}

/// Equal bytes have different meanings in the two versions. Byte 5 is the motor's error flag in 0.5, and the result of a
/// procedure in 0.6. Byte 6 is the encoder's error flag in 0.5, and "trajectory done" in 0.6. Byte 7 is the controller's error
/// flag in 0.5, with "trajectory done" in its highest bit, and reserved in 0.6.
#[test]
fn heartbeats_of_0_5_and_0_6_differ() {
    let faults = |drive, data| decode_answer(drive, 0x021, data).1.faults.unwrap();
    let done_05 = [0, 0, 0, 0, 8, 0, 0, 0x80];
    assert_eq!(faults(&DRIVE, done_05), Faults::NONE);
    let done_06 = [0, 0, 0, 0, 8, 1, 1, 0];
    assert_eq!(faults(&PRO, done_06), Faults::NONE);
    assert!(faults(&DRIVE, done_06).contains(Faults::SENSOR));
    // Bit 24 is the watchdog in 0.6, bit 11 in 0.5.
    assert_eq!(faults(&PRO, [0, 0, 0, 1, 1, 0, 0, 0]), Faults::TIMED_OUT);
    assert_eq!(faults(&DRIVE, [0, 0, 0, 1, 1, 0, 0, 0]), Faults::OTHER);
    assert_eq!(faults(&DRIVE, [0, 8, 0, 0, 1, 0, 0, 0]), Faults::TIMED_OUT);
    assert_eq!(faults(&PRO, [0, 8, 0, 0, 1, 0, 0, 0]), Faults::OVERCURRENT);
    assert_eq!(faults(&DRIVE, [0, 0x40, 0, 0, 1, 0, 0, 0]), Faults::ESTOPPED);
    assert_eq!(faults(&PRO, [0, 0, 0, 2, 1, 0, 0, 0]), Faults::ESTOPPED);
}

/// ODrive issue 700: the error in the heartbeat stays 0 while motor, encoder or controller have an error. Only the flags show
/// it.
#[test]
fn heartbeat_without_axis_error_still_tells_of_a_broken_motor() {
    for byte in 5..8 {
        let mut data = [0, 0, 0, 0, 8, 0, 0, 0];
        data[byte] = 1;
        assert!(!decode_answer(&DRIVE, 0x001, data).1.faults.unwrap().none(), "{byte}");
    }
}

/// DBC: estimates are in turns and turns/s, currents in A, torques in N·m, temperatures in °C.
#[test]
fn what_it_measures() {
    let two = |low: f32, high: f32| {
        let [a, b, c, d] = low.to_le_bytes();
        let [e, f, g, h] = high.to_le_bytes();
        [a, b, c, d, e, f, g, h]
    };
    let geared = Odrive { reduction: -2.0, ..PRO };
    let (_, moved) = decode_answer(&geared, 0x029, two(1.0, -0.5));
    assert_eq!((moved.position_rad, moved.speed_rad_s), (Some(-TAU / 2.0), Some(TAU / 4.0)));
    assert_eq!(decode_answer(&geared, 0x034, two(0.0, 5.0)).1.torque_nm, Some(-1.0));
    assert_eq!(decode_answer(&geared, 0x03C, two(0.0, 0.25)).1.torque_nm, Some(-0.5));
    assert_eq!(decode_answer(&geared, 0x035, two(30.0, 45.5)).1.temperature_c, Some(45.5));
    assert_eq!(
        decode_answer(&geared, 0x023, [0, 1, 0, 0, 0, 0, 0, 0]).1.faults,
        Some(Faults::BAD_VOLTAGE)
    );
    // In 0.5 these are sensorless estimates, ADC voltages and errors of the motor.
    for id in [0x035, 0x03C, 0x023] {
        assert_eq!(DRIVE.decode(&Frame::standard(id, &two(1.0, 1.0)).unwrap()), None);
    }
    let lost = Frame::standard(0x029, &two(f32::NAN, 0.0)).unwrap();
    assert_eq!(PRO.decode(&lost), None);
    assert_eq!(PRO.decode(&Frame::standard(0x029, &[0; 7]).unwrap()), None);
}

/// Queries are refused: any frame feeds the watchdog of a drive, so no frame may be sent only to query it.
#[test]
fn nothing_is_asked() {
    assert_eq!(sent(&DRIVE, 1, Command::Query), Err(Refusal::Unsupported("query")));
}

proptest! {
    /// Errors of the axis always set a fault.
    #[test]
    fn no_error_goes_unseen(error in 1u32.., new: bool) {
        let [a, b, c, d] = error.to_le_bytes();
        let drive = if new { PRO } else { DRIVE };
        let (_, heartbeat) = decode_answer(&drive, 0x001, [a, b, c, d, 8, 0, 0, 0]);
        prop_assert!(!heartbeat.faults.unwrap().none());
    }

    #[test]
    fn positions_come_back(turns in -100.0f32..100.0, reduction in prop_oneof![-20.0f32..-0.1, 0.1f32..20.0]) {
        let drive = Odrive { reduction, ..DRIVE };
        let position = turns * TAU / reduction;
        let frame = sent(&drive, 1, Command::Joint(joint(position, 0.0, 0.0, None))).unwrap()[0];
        let estimates = Frame::standard(0x029, frame.data()).unwrap();
        // Both feed-forwards and the speed are 0.
        let (_, told) = drive.decode(&estimates).unwrap();
        prop_assert!((told.position_rad.unwrap() - position).abs() <= 1e-6 * position.abs());
        prop_assert_eq!(told.speed_rad_s.map(f32::abs), Some(0.0));
    }
}
