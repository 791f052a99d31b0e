//! Tests of every actuator protocol, and helpers for the tests of each protocol.

use proptest::prelude::*;
use rollwalk_protocol::actuator_protocols;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::cybergear::{CyberGear, TABLE_MAX_RAD};
use rollwalk_protocol::actuators::dynamixel::Dynamixel;
use rollwalk_protocol::actuators::dynamixel::table::XM540_W150;
use rollwalk_protocol::actuators::feetech::{Feetech, table::STS3250};
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_protocol::actuators::rollwalk::Rollwalk;
use rollwalk_protocol::actuators::traffic::MAX_LOAD;
use rollwalk_protocol::actuators::{
    ActuatorCommand, Answers, CanCodec, Codec, Command, Faults, Feedback, Gains, JointSetpoint,
    Packet, Refusal, UpdatePolicy, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;

pub fn can_text(frame: &Frame) -> String {
    frame.to_string().to_lowercase()
}

/// Frames that a command sends. A refused command must send none.
pub fn sent<P: Codec>(protocol: &P, id: u8, command: Command) -> Result<Vec<P::Sent>, Refusal> {
    let mut frames = Vec::new();
    let result = protocol.emit(&ActuatorCommand { id, command }, &mut |frame| frames.push(frame));
    assert!(result.is_ok() || frames.is_empty(), "refused, and sent all the same: {command:?}");
    result.map(|()| frames)
}

pub fn joint(p: f32, v: f32, t: f32, gains: Option<(f32, f32)>) -> JointSetpoint {
    let gains = gains.map(|(kp_nm_rad, kd_nm_s_rad)| Gains { kp_nm_rad, kd_nm_s_rad });
    JointSetpoint { position_rad: p, speed_rad_s: v, torque_nm: t, gains }
}

pub fn wheel(speed_rad_s: f32, kd: Option<f32>, limit: Option<f32>) -> WheelSetpoint {
    WheelSetpoint { speed_rad_s, torque_nm: 0.0, kd_nm_s_rad: kd, torque_limit_nm: limit }
}

const MIT: Mit = Mit { model: MODELS[4], answers_from: AnswerId::Master(0) };
const ODRIVE: Odrive =
    Odrive { version: Version::V06, reduction: 9.0, torque_constant_nm_a: 0.05, estimates_hz: 100 };
const CYBERGEAR: CyberGear = CyberGear { host: 0xFD, max_position_rad: TABLE_MAX_RAD };
const DYNAMIXEL: Dynamixel =
    Dynamixel { model: XM540_W150, watchdog_20ms: 5, return_delay_us: 20, reads_fast: false };
const FEETECH: Feetech = Feetech { model: STS3250, return_delay_us: 100 };
const MAESTRO: Maestro = Maestro {
    device: None,
    crc: true,
    set_multiple: true,
    pulse: Pulse { centre_us: 1500.0, us_per_rad: 600.0, limits_us: (500.0, 2500.0) },
};

/// Calls `$check(codec, key, bits)` for the examples of every protocol; `bits` counts the bits of a frame or packet.
macro_rules! with_all {
    ($check:ident) => {
        actuator_protocols!(with_each, $check)
    };
}

macro_rules! with_each {
    ($check:ident, $($module:ident $Codec:ident $transport:ident $key:literal,)*) => {
        $(for codec in rollwalk_protocol::actuators::$module::$Codec::EXAMPLES {
            $check(codec, $key, bits_of!($transport));
        })*
    };
}

macro_rules! bits_of {
    (can) => {
        Frame::exact_bits
    };
    (serial) => {
        |packet: &Packet| 10 * packet.len() as u32
    };
}

/// Set-point that the protocol accepts according to its capabilities.
fn usable<P: Codec>(protocol: &P, rad: f32) -> JointSetpoint {
    let each_time = protocol.capabilities().gains == UpdatePolicy::EverySetpoint;
    joint(rad, 0.1, 0.0, each_time.then_some((20.0, 0.5)))
}

fn usable_wheel<P: Codec>(protocol: &P) -> WheelSetpoint {
    let can = protocol.capabilities();
    let kd = (can.gains == UpdatePolicy::EverySetpoint).then_some(0.5);
    wheel(1.0, kd, (can.limits == UpdatePolicy::EverySetpoint).then_some(2.0))
}

/// Checks that the capabilities match the accepted commands.
#[test]
fn capabilities_are_true() {
    fn check<P: Codec<Sent: PartialEq>>(protocol: &P, name: &str, _: fn(&P::Sent) -> u32) {
        let can = protocol.capabilities();
        let does = |command| sent(protocol, 1, command).is_ok();
        let good = usable(protocol, 0.2);
        assert_eq!(does(Command::Joint(good)), can.joints, "{name}");
        assert_eq!(does(Command::EnableJoint { measured_rad: 0.2 }), can.joints, "{name}");
        assert_eq!(does(Command::Wheel(usable_wheel(protocol))), can.wheels, "{name}");
        assert_eq!(does(Command::EnableWheel), can.wheels, "{name}");
        let gains = Gains { kp_nm_rad: 20.0, kd_nm_s_rad: 0.5 };
        assert_eq!(does(Command::Gains(gains)), can.gains == UpdatePolicy::Stored, "{name}");
        let limits = Command::Limits { speed_rad_s: 2.0, torque_nm: 2.0 };
        // The Rollwalk profile has the limit in the wheel's setpoint.
        assert_eq!(does(limits), can.limits == UpdatePolicy::Stored, "{name}");
        let other = match good.gains {
            Some(_) => JointSetpoint { gains: None, ..good },
            None => JointSetpoint { gains: Some(gains), ..good },
        };
        assert!(!does(Command::Joint(other)), "{name}");
        let torque = JointSetpoint { torque_nm: 0.5, ..good };
        assert_eq!(does(Command::Joint(torque)), can.torque, "{name}");
        let still = JointSetpoint { speed_rad_s: 0.0, ..good };
        let frames = |command| sent(protocol, 1, command).unwrap();
        let differs = frames(Command::Joint(still)) != frames(Command::Joint(good));
        assert_eq!(differs, can.joint_speed, "{name}");
        assert_eq!(does(Command::EnableTorque), can.torque_alone, "{name}");
        assert_eq!(does(Command::Torque { torque_nm: -0.5 }), can.torque_alone, "{name}");
        for torque_nm in [f32::NAN, f32::INFINITY] {
            assert!(!does(Command::Torque { torque_nm }), "{name}");
        }
        assert_eq!(does(Command::Query), can.query, "{name}");
        assert_eq!(does(Command::QueryReadings), can.query_readings, "{name}");
        assert!(can.query || can.answers != Answers::OnQuery, "{name}");
        assert!(does(Command::Disable), "{name}");
        assert!(sent(protocol, can.max_id, Command::Disable).is_ok(), "{name}");
        assert_eq!(sent(protocol, can.max_id + 1, Command::Disable).err(), Some(Refusal::Address));
    }
    with_all!(check);
}

/// Enabling sends the measured pose before torque is on, or makes the actuator discard earlier set-points (Rollwalk).
#[test]
fn enabling_tells_the_measured_pose_before_torque() {
    fn check<P: Codec<Sent: PartialEq>>(protocol: &P, name: &str, _: fn(&P::Sent) -> u32) {
        let frames =
            |measured_rad| sent(protocol, 1, Command::EnableJoint { measured_rad }).unwrap();
        let (here, there) = (frames(0.3), frames(-0.4));
        if name == "rollwalk" {
            assert!(here == there);
            return;
        }
        let pose = here.iter().zip(&there).position(|(a, b)| a != b).unwrap();
        // Switching torque on does not depend on the pose. With a Maestro, pulses mean torque.
        let last_switch = here.iter().zip(&there).rposition(|(a, b)| a == b);
        assert!(name == "maestro" || Some(pose) < last_switch, "{name}");
    }
    with_all!(check);
}

/// NaN and infinity are refused in every field of every command.
#[test]
fn no_nan_and_no_infinity_is_sent() {
    fn check<P: Codec>(protocol: &P, name: &str, _: fn(&P::Sent) -> u32) {
        let can = protocol.capabilities();
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let good = usable(protocol, 0.2);
            let mut commands = vec![
                Command::Joint(JointSetpoint { position_rad: bad, ..good }),
                Command::Joint(JointSetpoint { torque_nm: bad, ..good }),
                Command::Wheel(WheelSetpoint { speed_rad_s: bad, ..usable_wheel(protocol) }),
                Command::Wheel(WheelSetpoint { torque_nm: bad, ..usable_wheel(protocol) }),
                Command::Limits { speed_rad_s: bad, torque_nm: 1.0 },
                Command::Limits { speed_rad_s: 1.0, torque_nm: bad },
                Command::Gains(Gains { kp_nm_rad: bad, kd_nm_s_rad: 1.0 }),
                Command::Gains(Gains { kp_nm_rad: 1.0, kd_nm_s_rad: bad }),
            ];
            if can.joint_speed {
                commands.push(Command::Joint(JointSetpoint { speed_rad_s: bad, ..good }));
            }
            if name != "rollwalk" {
                commands.push(Command::EnableJoint { measured_rad: bad });
            }
            if can.gains == UpdatePolicy::EverySetpoint {
                for gains in [(bad, 1.0), (1.0, bad)] {
                    commands.push(Command::Joint(joint(0.0, 0.0, 0.0, Some(gains))));
                }
                let kd_nm_s_rad = Some(bad);
                commands
                    .push(Command::Wheel(WheelSetpoint { kd_nm_s_rad, ..usable_wheel(protocol) }));
            }
            for command in commands {
                assert!(sent(protocol, 1, command).is_err(), "{name}: {command:?}");
            }
        }
    }
    with_all!(check);
}

/// Orders are checked before any frame is sent: one order that cannot be encoded refuses all of them.
#[test]
fn one_bad_order_stops_all() {
    fn check<P: Codec>(protocol: &P, name: &str, _: fn(&P::Sent) -> u32) {
        let go = |id, rad| ActuatorCommand { id, command: Command::Joint(usable(protocol, rad)) };
        let mut count = 0;
        let orders = [go(1, 0.1), go(2, 0.2), go(3, f32::NAN)];
        let refused = protocol.encode(&orders, &mut |_| count += 1);
        assert_eq!((refused.map_err(|(i, _)| i), count), (Err(2), 0), "{name}");
        protocol.encode(&orders[..2], &mut |_| count += 1).unwrap();
        assert!(count > 0, "{name}");
    }
    with_all!(check);
}

/// Traffic of a control period with random set-points stays within the declared worst case.
#[test]
fn traffic_is_the_worst_case() {
    fn check<P: Codec>(protocol: &P, name: &str, bits: fn(&P::Sent) -> u32) {
        let mut largest = 0.0f32;
        for n in [1u8, 6, 16] {
            for seed in 0..500u32 {
                let angle = |id: u8| {
                    let mixed = (seed * 24 + u32::from(id)).wrapping_mul(2_654_435_761) >> 8;
                    (mixed as f32 / (1 << 24) as f32 - 0.5) * 2.0
                };
                let go = |id| ActuatorCommand {
                    id,
                    command: Command::Joint(usable(protocol, angle(id))),
                };
                let orders: Vec<ActuatorCommand> = (1..=n).map(go).collect();
                let mut sum = 0;
                protocol.encode(&orders, &mut |frame| sum += bits(&frame)).unwrap();
                let worst = protocol.traffic(u32::from(n)).bits_per_period;
                assert!(sum <= worst, "{name} {n}: {sum} > {worst}");
                largest = largest.max(sum as f32 / worst as f32);
            }
        }
        // Answers use up to three quarters of it (Dynamixel, Feetech). A smaller value would be too cautious.
        assert!(largest > 0.2, "{name} {largest}");
    }
    with_all!(check);
}

/// Load of 16 actuators at 1 Mbit/s: 135 bits for an 11-bit frame of 8 bytes, 160 bits for a 29-bit frame. A Dynamixel line of
/// 3 Mbit/s has 10 bits per byte.
#[test]
fn loads_of_sixteen_actuators() {
    let near = |load: f32, expected: f32| assert!((load - expected).abs() < 5e-4, "{load}");
    near(MIT.traffic(16).load(200.0, 1e6), 16.0 * 270.0 * 200e-6);
    near(CYBERGEAR.traffic(16).load(100.0, 1e6), 16.0 * 320.0 * 100e-6);
    near(Rollwalk.traffic(16).load(60.0, 1e6), 0.2592);
    // Set-points at the control rate, two messages at 100 Hz, heartbeats at 10 Hz.
    near(ODRIVE.traffic(16).load(60.0, 1e6), 16.0 * 135.0 * (60.0 + 210.0) * 1e-6);
    // 10 + 84 + 28, 10 + 20 + 6, and 16 times 10 + 11 + 3 bytes; 16 times 20 µs.
    let period_s = (122.0 + 36.0 + 16.0 * 24.0) * 10.0 / 3e6 + 16.0 * 20e-6;
    near(DYNAMIXEL.traffic(16).load(60.0, 3e6), 60.0 * period_s);
    // 2 times 8 + 48 bytes, 8 + 16, and 16 times 14; 16 times 100 µs.
    let period_s = (64.0 + 24.0 + 16.0 * 14.0) * 10.0 / 1e6 + 16.0 * 100e-6;
    near(FEETECH.traffic(16).load(60.0, 1e6), 60.0 * period_s);
    // 2 + 32 + 2 bytes with CRC, 2 to request errors, and 2 in the answer.
    near(MAESTRO.traffic(16).load(50.0, 115_200.0), 50.0 * 400.0 / 115_200.0);
    assert!(MIT.traffic(16).check(160.0, 1e6).is_ok());
    let refused = MIT.traffic(16).check(170.0, 1e6).unwrap_err();
    assert!(refused.percent > 100.0 * MAX_LOAD && refused.to_string().contains("73 %"));
    for (hz, rate) in [(f32::NAN, 1e6), (100.0, 0.0), (0.0, 1e6), (100.0, -1e6)] {
        assert!(MIT.traffic(1).check(hz, rate).is_err(), "{hz} {rate}");
    }
    assert!(MIT.traffic(u32::MAX).check(1.0, 1e6).is_err());
}

/// The codec of the profile sends the bytes in `docs/formats/wire-format.md`.
#[test]
fn rollwalk_profile_behind_the_trait() {
    let text = |command| can_text(&sent(&Rollwalk, 5, command).unwrap()[0]);
    assert_eq!(text(Command::Disable), "085#00");
    assert_eq!(text(Command::EnableJoint { measured_rad: 0.0 }), "085#01");
    assert_eq!(text(Command::Query), "085#02");
    let go = joint(-1.0, 2.0, 0.0, Some((20.0, 0.5)));
    assert_eq!(text(Command::Joint(go)), "105#78ece803d007f401");
    let roll = wheel(-7.5, Some(0.2), Some(1.0));
    assert_eq!(text(Command::Wheel(roll)), "205#08dbfeffc800c800");
    let feedback = Frame::standard(0x185, &[0x88, 0x13, 0, 0, 0xC8, 0, 0x11, 7]).unwrap();
    let expected = Feedback {
        position_rad: Some(1.0),
        speed_rad_s: Some(0.0),
        torque_nm: Some(1.0),
        temperature_c: None,
        voltage_v: None,
        enabled: Some(true),
        faults: Some(Faults::OVERHEATED),
    };
    assert_eq!(Rollwalk.decode(&feedback), Some((5, expected)));
}

#[test]
fn newer_feedback_takes_over_what_it_tells() {
    let mut all =
        Feedback { position_rad: Some(1.0), faults: Some(Faults::SENSOR), ..Feedback::default() };
    all.merge(&Feedback {
        speed_rad_s: Some(2.0),
        faults: Some(Faults::NONE),
        ..Feedback::default()
    });
    let expected = Feedback {
        position_rad: Some(1.0),
        speed_rad_s: Some(2.0),
        faults: Some(Faults::NONE),
        ..Feedback::default()
    };
    assert_eq!(all, expected);
}

fn any_command() -> impl Strategy<Value = Command> {
    let value = || prop_oneof![any::<f32>(), -20.0f32..20.0, any::<u32>().prop_map(f32::from_bits)];
    let gains = (value(), value());
    let setpoint = (value(), value(), value(), proptest::option::of(gains))
        .prop_map(|(p, v, t, gains)| Command::Joint(joint(p, v, t, gains)));
    let roll = (value(), value(), proptest::option::of(value()), proptest::option::of(value()))
        .prop_map(|(v, t, kd, limit)| {
            Command::Wheel(WheelSetpoint { torque_nm: t, ..wheel(v, kd, limit) })
        });
    prop_oneof![
        setpoint,
        roll,
        value().prop_map(|measured_rad| Command::EnableJoint { measured_rad }),
        (value(), value())
            .prop_map(|(speed_rad_s, torque_nm)| Command::Limits { speed_rad_s, torque_nm }),
        (value(), value())
            .prop_map(|(kp_nm_rad, kd_nm_s_rad)| Command::Gains(Gains { kp_nm_rad, kd_nm_s_rad })),
        Just(Command::Disable),
        Just(Command::EnableWheel),
        Just(Command::Query),
        Just(Command::QueryReadings),
        Just(Command::ClearFaults),
    ]
}

/// True if every value is finite.
fn finite(told: Option<(u8, Feedback)>) -> bool {
    told.is_none_or(|(_, f)| {
        let all = [f.position_rad, f.speed_rad_s, f.torque_nm, f.temperature_c, f.voltage_v];
        all.into_iter().flatten().all(f32::is_finite)
    })
}

proptest! {
    /// A random command for any address gives frames or a refusal.
    #[test]
    fn any_command_does(command in any_command(), id: u8) {
        for protocol in Protocol::examples() {
            let mut count = 0;
            let order = ActuatorCommand { id, command };
            let emitted = protocol.emit(&order, &mut |_| count += 1);
            let encoded = protocol.encode(&[order], &mut |_| count += 1).map_err(|(_, why)| why);
            let taken = emitted.and(encoded);
            prop_assert_eq!(taken, protocol.check(&order), "{:?}", protocol);
            let fits = id <= protocol.capabilities().max_id && count <= 4;
            prop_assert!(if taken.is_ok() { fits } else { count == 0 }, "{:?}", protocol);
        }
    }

    /// A random frame gives finite feedback or `None`.
    #[test]
    fn any_frame_does(id in 0u32..1 << 29, data in proptest::collection::vec(prop_oneof![any::<u8>(), Just(0xFF), Just(0x7F)], 0..=8)) {
        let frame = Frame::standard(id as u16 & 0x7FF, &data).unwrap();
        let master = Frame::standard(0, &data).unwrap();
        for frame in [frame, master] {
            prop_assert!(finite(Rollwalk.decode(&frame)) && finite(MIT.decode(&frame)));
            // Huge floats, which gearing increases, and a reduction of zero.
            let old = Odrive { version: Version::V05, reduction: 1e-30, ..ODRIVE };
            for drive in [ODRIVE, old, Odrive { reduction: 0.0, ..ODRIVE }] {
                prop_assert!(finite(drive.decode(&frame)));
            }
        }
        let extended = Frame::extended(id, &data).unwrap();
        prop_assert!(finite(CYBERGEAR.decode(&extended)));
        let _ = CYBERGEAR.parameter(&extended);
        // The same number, shortened to the bits of other drives' identifiers, belongs to no drive.
        prop_assert_eq!(CYBERGEAR.decode(&frame), None);
        for id in [id & 0x7FF, (id & 0x7FF) << 18, id] {
            let extended = Frame::extended(id, &data).unwrap();
            for drive in [MIT, Mit { answers_from: AnswerId::Own, ..MIT }] {
                prop_assert_eq!(drive.decode(&extended), None);
            }
            prop_assert_eq!(ODRIVE.decode(&extended), None);
            prop_assert_eq!(Rollwalk.decode(&extended), None);
        }
    }
}
