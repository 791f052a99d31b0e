//! Tests of MIT and AK frames against the documents: bgkatz/motorcontrol `CAN_com`, and CubeMars "AK Series Actuator Driver
//! Manual V1.0.8", section 5.3 (pages 48 to 50).

use crate::actuators_all::{can_text, joint, sent, wheel};
use proptest::prelude::*;
use rollwalk_protocol::actuators::mit::{AnswerId, Codes, MODELS, Mit, Model};
use rollwalk_protocol::actuators::{
    CanCodec, Command, Faults, Feedback, Gains, JointSetpoint, Refusal, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;

fn drive(name: &str) -> Mit {
    let model = *MODELS.iter().find(|m| m.name == name).unwrap();
    Mit { model, answers_from: AnswerId::Master(0) }
}

fn frames(drive: &Mit, id: u8, command: Command) -> Vec<String> {
    sent(drive, id, command).unwrap().iter().map(can_text).collect()
}

/// Commands of the manual's "Special Can code", page 48.
#[test]
fn commands_are_those_of_the_manual() {
    let ak = drive("AK80-9");
    assert_eq!(frames(&ak, 1, Command::Disable), ["001#fffffffffffffffd"]);
    assert_eq!(can_text(&Mit::zero_here(1)), "001#fffffffffffffffe");
    let limp = "001#8000800000000800";
    let enable = [limp, "001#fffffffffffffffc", limp];
    assert_eq!(frames(&ak, 1, Command::EnableJoint { measured_rad: 0.0 }), enable);
    assert_eq!(frames(&ak, 1, Command::EnableWheel), enable);
    assert_eq!(frames(&ak, 1, Command::EnableTorque), enable);
    // A quarter of ±18 N·m, without gains.
    assert_eq!(frames(&ak, 1, Command::Torque { torque_nm: 9.0 }), ["001#8000800000000bff"]);
}

/// Ranges of the manual's table, and limits of `float_to_uint`: the ends of every scale have the first and the last code.
#[test]
fn models_reach_from_end_to_end() {
    let table = [
        ("AK10-9", 50.0, 65.0),
        ("AK60-6", 50.0, 15.0),
        ("AK70-10", 50.0, 25.0),
        ("AK80-6", 76.0, 12.0),
        ("AK80-9", 50.0, 18.0),
        ("AK80-64", 8.0, 144.0),
        ("mini-cheetah", 65.0, 18.0),
    ];
    assert_eq!(table.len(), MODELS.len());
    for (name, speed, torque) in table {
        let drive = drive(name);
        let low = joint(-12.5, -speed, -torque, Some((0.0, 0.0)));
        assert_eq!(frames(&drive, 0x7F, Command::Joint(low)), ["07f#0000000000000000"]);
        let high = joint(12.5, speed, torque, Some((500.0, 5.0)));
        assert_eq!(frames(&drive, 0x7F, Command::Joint(high)), ["07f#ffffffffffffffff"]);
        for beyond in [
            joint(12.51, 0.0, 0.0, Some((0.0, 0.0))),
            joint(0.0, speed + 0.1, 0.0, Some((0.0, 0.0))),
            joint(0.0, 0.0, -torque - 0.1, Some((0.0, 0.0))),
            joint(0.0, 0.0, 0.0, Some((500.1, 0.0))),
            joint(0.0, 0.0, 0.0, Some((0.0, 5.01))),
            joint(0.0, 0.0, 0.0, Some((-0.1, 0.0))),
            joint(f32::NAN, 0.0, 0.0, Some((0.0, 0.0))),
        ] {
            let refused = sent(&drive, 1, Command::Joint(beyond));
            assert!(matches!(refused, Err(Refusal::OutOfRange(_))), "{name} {beyond:?}");
        }
    }
}

/// Layout of `pack_cmd`: `p[15:8] p[7:0] v[11:4] v[3:0]kp[11:8] kp[7:0] kd[11:4] kd[3:0]t[11:8] t[7:0]`, tested with a
/// different digit everywhere.
#[test]
fn fields_are_where_the_documents_have_them() {
    let codes = Codes { position: 0x1234, speed: 0x567, kp: 0x89A, kd: 0xBCD, torque: 0xEF0 };
    assert_eq!(can_text(&codes.frame(3)), "003#123456789abcdef0");
    assert_eq!(Codes::of(&codes.frame(3)), Some(codes));
}

/// Layout of `pack_reply`: id, p16, v12, t12; AK drives add temperature and error (manual, page 49).
#[test]
fn answers_of_all_lengths() {
    let ak = drive("AK80-9");
    let frame = |data: &[u8]| Frame::standard(0, data).unwrap();
    let long = [5, 0xFF, 0xFF, 0x00, 0x0F, 0xFF, 41, 1];
    let (id, told) = ak.decode(&frame(&long)).unwrap();
    let expected = Feedback {
        position_rad: Some(12.5),
        speed_rad_s: Some(-50.0),
        torque_nm: Some(18.0),
        temperature_c: Some(41.0),
        voltage_v: None,
        enabled: None,
        faults: Some(Faults::OVERHEATED),
    };
    assert_eq!((id, told), (5, expected));
    for length in [6, 7] {
        let (_, told) = ak.decode(&frame(&long[..length])).unwrap();
        let short = Feedback { temperature_c: None, faults: None, ..expected };
        assert_eq!(told, short, "{length}");
    }
    assert_eq!(ak.decode(&frame(&long[..5])), None);
    // A frame with another identifier is an echo of our set-point, or another master's.
    let own = Frame::standard(5, &long).unwrap();
    assert_eq!(ak.decode(&own), None);
    let ak = Mit { answers_from: AnswerId::Own, ..ak };
    assert_eq!(ak.decode(&own), Some((5, expected)));
    assert_eq!(ak.decode(&Frame::standard(4, &long).unwrap()), None);
}

fn setpoints(model: Model) -> impl Strategy<Value = JointSetpoint> {
    let end = |max: f32| prop_oneof![4 => -max..=max, 1 => Just(max), 1 => Just(-max)];
    let gain = |max: f32| prop_oneof![4 => 0.0..=max, 1 => Just(max), 1 => Just(0.0)];
    // Near the maximum torque, set-points resemble commands.
    let torque =
        prop_oneof![end(model.max_torque_nm), 0.998 * model.max_torque_nm..=model.max_torque_nm];
    (end(12.5), end(model.max_speed_rad_s), torque, gain(500.0), gain(5.0))
        .prop_map(|(p, v, t, kp, kd)| joint(p, v, t, Some((kp, kd))))
}

fn any_model() -> impl Strategy<Value = (Mit, JointSetpoint)> {
    (0..MODELS.len()).prop_flat_map(|i| {
        let mit = Mit { model: MODELS[i], answers_from: AnswerId::Own };
        setpoints(mit.model).prop_map(move |setpoint| (mit, setpoint))
    })
}

/// Tests all torque codes, with the other fields at their largest. Exactly three of them look like commands.
#[test]
fn no_setpoint_is_a_command_exhaustively() {
    for torque in 0..=0xFFF {
        let codes = Codes { position: 0xFFFF, speed: 0xFFF, kp: 0xFFF, kd: 0xFFF, torque };
        let last = codes.frame(1).data()[7];
        assert!(!(0xFC..=0xFE).contains(&last) || torque & 0xF00 != 0xF00, "{torque:x}");
        let sent = Codes::of(&codes.frame(1)).unwrap();
        let changed = (0xFFC..=0xFFE).contains(&torque);
        assert_eq!(sent.torque, if changed { 0xFFB } else { torque });
    }
}

proptest! {
    #[test]
    fn no_setpoint_is_a_command((mit, setpoint) in any_model(), id in 0u8..=0x7F) {
        let frame = sent(&mit, id, Command::Joint(setpoint)).unwrap()[0];
        prop_assert!(Codes::of(&frame).is_some(), "{}", can_text(&frame));
    }

    /// Fields are accurate to half a step of their scale.
    #[test]
    fn fields_round_to_nearest((mit, setpoint) in any_model()) {
        let codes = mit.joint(&setpoint).unwrap();
        let Gains { kp_nm_rad, kd_nm_s_rad } = setpoint.gains.unwrap();
        let signed = |code: u16, max: f32, last: f64| (2.0 * f64::from(code) - last) / last * f64::from(max);
        let (v, t) = (mit.model.max_speed_rad_s, mit.model.max_torque_nm);
        for (sent, meant, step) in [
            (signed(codes.position, 12.5, 65535.0), setpoint.position_rad, 25.0 / 65535.0),
            (signed(codes.speed, v, 4095.0), setpoint.speed_rad_s, 2.0 * f64::from(v) / 4095.0),
            (signed(codes.torque, t, 4095.0), setpoint.torque_nm, 2.0 * f64::from(t) / 4095.0),
            (f64::from(codes.kp) * 500.0 / 4095.0, kp_nm_rad, 500.0 / 4095.0),
            (f64::from(codes.kd) * 5.0 / 4095.0, kd_nm_s_rad, 5.0 / 4095.0),
        ] {
            // A hundredth of a step for the roundings of f32: 2^-24 of at most 2^16 steps.
            prop_assert!((sent - f64::from(meant)).abs() <= 0.51 * step, "{sent} {meant}");
        }
    }

    /// The residual torque of a wheel at rest with a set-point of 0 is half a step of torque. It is not kd times half a step of
    /// speed, which would be up to 12 steps of torque.
    #[test]
    fn scar_10_a_wheel_told_zero_hardly_creeps(i in 0..MODELS.len(), kd in 0.05f32..=5.0) {
        let mit = Mit { model: MODELS[i], answers_from: AnswerId::Own };
        let codes = mit.wheel(&wheel(0.0, Some(kd), None)).unwrap();
        prop_assert_eq!(codes.kp, 0);
        let (v, t) = (f64::from(mit.model.max_speed_rad_s), f64::from(mit.model.max_torque_nm));
        let kd = f64::from(codes.kd) * 5.0 / 4095.0;
        let speed = (2.0 * f64::from(codes.speed) - 4095.0) / 4095.0 * v;
        let torque = (2.0 * f64::from(codes.torque) - 4095.0) / 4095.0 * t;
        prop_assert!((kd * speed + torque).abs() <= 0.51 * 2.0 * t / 4095.0);
    }
}

#[test]
fn what_it_has_no_place_for_is_refused() {
    let ak = drive("AK80-9");
    let bare = joint(0.0, 0.0, 0.0, None);
    assert_eq!(sent(&ak, 1, Command::Joint(bare)), Err(Refusal::Missing("gains")));
    let limited = WheelSetpoint { torque_limit_nm: Some(1.0), ..wheel(1.0, Some(1.0), None) };
    assert_eq!(sent(&ak, 1, Command::Wheel(limited)), Err(Refusal::Unsupported("torque limit")));
    let bare = wheel(1.0, None, None);
    assert_eq!(sent(&ak, 1, Command::Wheel(bare)), Err(Refusal::Missing("kd")));
    assert_eq!(sent(&ak, 0x80, Command::Disable), Err(Refusal::Address));
}
