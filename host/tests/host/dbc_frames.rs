//! Random frames of each message, encoded by the codecs, with the encoded values.

use proptest::prelude::*;
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, Feedback, JointSetpoint, WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::authentication::{Authenticator, Subject, TAG_LEN};
use rollwalk_protocol::wire::isotp::{Endpoint, Output, Timing};
use rollwalk_protocol::wire::transport::{frame_to_controller, frame_to_host};
use rollwalk_protocol::wire::*;

/// Name in the schema, frame, and expected values of its signals.
pub type Sample = (&'static str, Frame, Vec<(String, f64)>);

fn node() -> impl Strategy<Value = Node> {
    (0u8..15).prop_map(|number| Node::new(number).unwrap())
}

/// Address of a controller or of all controllers.
fn to() -> impl Strategy<Value = Node> {
    prop_oneof![4 => node(), 1 => Just(Node::BROADCAST)]
}

fn of<T: Copy + std::fmt::Debug>(all: &'static [T]) -> impl Strategy<Value = T> {
    prop::sample::select(all)
}

fn float() -> impl Strategy<Value = f32> {
    prop_oneof![any::<f32>(), -100.0f32..100.0]
}

/// Value from 0 to 254, or `None`.
fn option() -> impl Strategy<Value = Option<u8>> {
    any::<u8>().prop_map(|byte| (byte < 255).then_some(byte))
}

fn number(option: Option<u8>) -> f64 {
    option.map_or(255.0, f64::from)
}

fn named_values<const N: usize>(values: [(&str, f64); N]) -> Vec<(String, f64)> {
    values.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

fn sealed(schema: &'static str, frame: Frame, mut values: Vec<(String, f64)>) -> Sample {
    values.push(("crc8".into(), f64::from(frame.data()[0])));
    (schema, frame, values)
}

pub fn link() -> BoxedStrategy<Sample> {
    prop_oneof![
        safety(),
        heartbeats(),
        commands(),
        setpoints(),
        samples(),
        parameters(),
        discovery(),
        transport()
    ]
    .boxed()
}

fn safety() -> impl Strategy<Value = Sample> {
    prop_oneof![
        to().prop_map(|to| ("estop", Estop.encode(to), vec![])),
        (node(), of(State::ALL)).prop_map(|(node, state)| {
            let values = named_values([("state", state.code().into())]);
            sealed("estop_ack", EstopAck { state }.encode(node), values)
        }),
        (node(), 0u8..16, of(&Subject::ALL), any::<u8>(), any::<[u8; TAG_LEN]>()).prop_map(
            |(to, session, subject, counter, tag)| {
                let frame = Authenticator { session, subject, counter, tag }.encode(to);
                // The first byte of the tag is the most significant.
                let number = tag.iter().fold(0.0, |all, byte| 256.0 * all + f64::from(*byte));
                let values = named_values([
                    ("session", session.into()),
                    ("class", subject.class().into()),
                    ("counter", counter.into()),
                    ("tag", number),
                ]);
                ("authenticator", frame, values)
            }
        ),
    ]
}

fn heartbeats() -> impl Strategy<Value = Sample> {
    (to(), node(), any::<u8>(), any::<u32>(), any::<bool>()).prop_map(
        |(to, node, seq, ms, reply)| {
            let clock_values = |clock| named_values([("seq", seq.into()), (clock, ms.into())]);
            if reply {
                let frame = HeartbeatReply { seq, controller_ms: ms }.encode(node);
                sealed("heartbeat_reply", frame, clock_values("controller_ms"))
            } else {
                let frame = Heartbeat { seq, host_ms: ms }.encode(to);
                sealed("heartbeat", frame, clock_values("host_ms"))
            }
        },
    )
}

fn action() -> impl Strategy<Value = Action> {
    prop_oneof![
        (any::<u16>(), any::<u8>(), any::<i8>()).prop_map(|(place, code, speed)| Action::play(
            PlaceCode::from_code(place),
            code,
            speed
        )),
        of(&[
            Action::Pause,
            Action::Resume,
            Action::Return,
            Action::Disarm,
            Action::ArmRequest,
            Action::ClearRequest,
            Action::Stream
        ]),
        any::<u16>().prop_map(|nonce| Action::ArmConfirm { nonce }),
        any::<u16>().prop_map(|nonce| Action::ClearConfirm { nonce }),
        (any::<u16>(), any::<u8>(), 0u8..128).prop_map(|(rate_hz, kp_percent, kd_percent)| {
            Action::Track { rate_hz, kp_percent, kd_percent }
        }),
    ]
}

fn commands() -> impl Strategy<Value = Sample> {
    let command = (to(), 0u8..16, action(), any::<u16>()).prop_map(|(to, seq, action, until)| {
        let (code, speed, arg) = match action {
            Action::Play { code, speed_64ths } => (code, f64::from(speed_64ths) / 64.0, 0),
            Action::PlayAt { code, speed_64ths, place } => {
                (code, f64::from(speed_64ths) / 64.0, place.code())
            }
            Action::ArmConfirm { nonce } | Action::ClearConfirm { nonce } => (0, 0.0, nonce),
            Action::Track { rate_hz, kp_percent, kd_percent } => {
                (kp_percent, f64::from(kd_percent) / 64.0, rate_hz)
            }
            _ => (0, 0.0, 0),
        };
        let values = named_values([
            ("seq", seq.into()),
            ("kind", action.kind().into()),
            ("code", code.into()),
            ("speed", speed),
            ("arg", arg.into()),
            ("valid_until_ms", until.into()),
        ]);
        sealed("command", Command { seq, action, valid_until_ms: until }.encode(to), values)
    });
    let ack = (node(), 0u8..16, 0u8..11, of(CommandResult::ALL), of(State::ALL), option());
    let ack = (ack, any::<u16>()).prop_map(|((node, seq, kind, result, state, motion), value)| {
        let values = named_values([
            ("seq", seq.into()),
            ("kind", kind.into()),
            ("result", result.code().into()),
            ("state", state.code().into()),
            ("motion", number(motion)),
            ("value", value.into()),
        ]);
        let ack = CommandAck { seq, kind, result, state, motion, value };
        sealed("command_ack", ack.encode(node), values)
    });
    prop_oneof![command, ack]
}

fn setpoints() -> impl Strategy<Value = Sample> {
    // Below 2^22 steps, single precision resolves every step.
    let of = (any::<u8>(), 0u8..128, any::<bool>());
    // Beyond 163.8 N·m the torque has coarser steps.
    let torque = prop_oneof![
        (-32767i16..=32767).prop_map(|steps| ("setpoint", steps, 200.0)),
        (328i16..=32767, any::<bool>()).prop_map(|(steps, back)| (
            "wide_setpoint",
            if back { -steps } else { steps },
            2.0
        )),
    ];
    let setpoint = (node(), of, -(1i32 << 22)..1 << 22, torque);
    setpoint.prop_map(|(to, (frame, channel, stiff), value, (schema, torque, per_unit))| {
        let setpoint = Setpoint {
            frame,
            channel,
            stiff,
            value: value as f32 / 10_000.0,
            torque_nm: f32::from(torque) / per_unit,
        };
        let values = named_values([
            ("frame", frame.into()),
            ("channel", channel.into()),
            ("stiff", stiff.into()),
            ("value", f64::from(value) / 1e4),
            ("torque", f64::from(torque) / f64::from(per_unit)),
        ]);
        sealed(schema, setpoint.encode(to), values)
    })
}

fn samples() -> impl Strategy<Value = Sample> {
    prop_oneof![status(), fault(), joint(), wide_joint(), readings(), imu(), sample()]
}

fn imu() -> impl Strategy<Value = Sample> {
    let step = || -32767i16..=32767;
    (node(), [step(), step(), step()], any::<bool>()).prop_map(|(node, steps, is_gyro)| {
        let per_unit = if is_gyro { 500.0 } else { 200.0 };
        let three = steps.map(|steps| f32::from(steps) / per_unit);
        let [x, y, z] = steps.map(|steps| f64::from(steps) / f64::from(per_unit));
        let values = named_values([("x", x), ("y", y), ("z", z)]);
        if is_gyro {
            sealed("gyro", Gyro { rad_s: three }.encode(node), values)
        } else {
            sealed("accelerometer", Accelerometer { m_s2: three }.encode(node), values)
        }
    })
}

fn sample() -> impl Strategy<Value = Sample> {
    let answered = prop::option::of((any::<u8>(), any::<u8>()));
    let contacts = prop::option::of(0u32..1 << 24);
    (node(), any::<u8>(), answered, contacts).prop_map(|(node, number, answered, contacts)| {
        let values = named_values([
            ("number", number.into()),
            ("answered", answered.map_or(0, |(number, _)| number).into()),
            ("delay", f64::from(answered.map_or(0, |(_, delay)| delay)) / 5000.0),
            ("has_contacts", contacts.is_some().into()),
            ("has_answered", answered.is_some().into()),
            ("contacts", contacts.unwrap_or(0).into()),
        ]);
        let answered = answered
            .map(|(number, delay)| SampleAnswer { number, delay_s: f32::from(delay) / 5000.0 });
        let sample = rollwalk_protocol::wire::Sample { number, answered, contacts };
        sealed("sample", sample.encode(node), values)
    })
}

fn status() -> impl Strategy<Value = Sample> {
    let faults = prop::collection::vec(of(Fault::ALL), 0..5);
    let how = (of(State::ALL), of(Severity::ALL), faults, option());
    (node(), how, 0u16..4096, 0u8..16, any::<u8>()).prop_map(
        |(node, (state, severity, faults, clip), frame, counter, library)| {
            let faults = faults.into_iter().fold(FaultBits::default(), FaultBits::with);
            let mut values = named_values([
                ("state", state.code().into()),
                ("severity", severity.code().into()),
                ("clip", number(clip)),
                ("frame", frame.into()),
                ("counter", counter.into()),
                ("library", library.into()),
            ]);
            for fault in Fault::ALL {
                let mut name = String::from("fault");
                // `HostLost` becomes host_lost, `EStop` becomes estop: a word begins at an upper case letter after a lower case
                // letter.
                let text = format!("{fault:?}");
                for (i, c) in text.char_indices() {
                    let new = c.is_uppercase() && !text[..i].ends_with(char::is_uppercase);
                    name += if new { "_" } else { "" };
                    name.push(c.to_ascii_lowercase());
                }
                values.push((name, f64::from(faults.contains(*fault))));
            }
            let status = Status { state, severity, faults, clip, frame, counter, library };
            sealed("status", status.encode(node), values)
        },
    )
}

fn fault() -> impl Strategy<Value = Sample> {
    (node(), any::<u8>(), of(Fault::ALL), option(), float()).prop_map(
        |(node, counter, fault, channel, value)| {
            let values = named_values([
                ("counter", counter.into()),
                ("fault", fault.code().into()),
                ("channel", number(channel)),
                ("value", value.into()),
            ]);
            let report = FaultReport { counter, fault, channel, value };
            sealed("fault", report.encode(node), values)
        },
    )
}

/// Raw values of position, velocity and torque, and a status byte.
fn measured() -> impl Strategy<Value = ([i16; 3], u8)> {
    (prop::array::uniform3(-32767i16..=32767), 0u8..128)
}

fn measures([position, velocity, torque]: [i16; 3], status: u8) -> Vec<(String, f64)> {
    let mut values = named_values([
        ("position", f64::from(position) / 5000.0),
        ("velocity", f64::from(velocity) / 500.0),
        ("torque", f64::from(torque) / 200.0),
    ]);
    values.extend(flags(status));
    values
}

fn flags(status: u8) -> impl Iterator<Item = (String, f64)> {
    let names = [
        "enabled",
        "torque_limited",
        "position_limited",
        "timed_out",
        "overheated",
        "bad_voltage",
        "hardware",
    ];
    (0..)
        .zip(names)
        .map(move |(bit, name)| (format!("status_{name}"), f64::from(status >> bit & 1)))
}

/// Position code, speed beyond the narrow scale, short code of the torque and its sign, and a status byte.
fn wide_measured() -> impl Strategy<Value = (i16, i32, (u16, bool), u8)> {
    let speed = (32_768i32..1 << 19, any::<bool>());
    let speed = speed.prop_map(|(steps, back)| if back { -steps } else { steps });
    let torque = (0u16..1 << 11, any::<bool>()).prop_map(|(code, back)| (code, back && code > 0));
    (-32767i16..=32767, speed, torque, 0u8..128)
}

/// Torque of a short code in steps of 16 mN·m.
fn torque_nm((code, is_negative): (u16, bool)) -> f32 {
    let (mantissa, exponent) = (f32::from(code & 0x7F), i32::from(code >> 7));
    let steps =
        if exponent == 0 { mantissa } else { (128.0 + mantissa) * 2_f32.powi(exponent - 1) };
    if is_negative { -steps / 62.5 } else { steps / 62.5 }
}

fn wide_measures(
    (position, speed, (code, is_negative), status): (i16, i32, (u16, bool), u8),
) -> Vec<(String, f64)> {
    let mut values = named_values([
        ("position", f64::from(position) / 5000.0),
        ("velocity", f64::from(speed) / 500.0),
        ("torque_mantissa", f64::from(code & 0x7F)),
        ("torque_exponent", f64::from(code >> 7)),
        ("torque_sign", is_negative.into()),
    ]);
    values.extend(flags(status));
    values
}

fn readings() -> impl Strategy<Value = Sample> {
    (node(), any::<u8>(), any::<i16>(), any::<i16>()).prop_map(
        |(node, channel, temperature, voltage)| {
            let value = |steps: i16, per_unit: f32| {
                (steps != i16::MIN).then(|| f32::from(steps) / per_unit)
            };
            let readings = ActuatorReadings {
                channel,
                temperature_c: value(temperature, 10.0),
                voltage_v: value(voltage, 100.0),
            };
            let values = named_values([
                ("channel", channel.into()),
                ("temperature", f64::from(temperature) / 10.0),
                ("voltage", f64::from(voltage) / 100.0),
            ]);
            sealed("readings", readings.encode(node), values)
        },
    )
}

fn wide_joint() -> impl Strategy<Value = Sample> {
    let unanswered = any::<bool>();
    (node(), any::<u8>(), wide_measured(), unanswered).prop_map(|(node, channel, measured, u)| {
        let (position, speed, torque, status) = measured;
        let telemetry = JointTelemetry {
            channel,
            position_rad: f32::from(position) / 5000.0,
            velocity_rad_s: speed as f32 / 500.0,
            torque_nm: torque_nm(torque),
            status: ActuatorStatus(status | u8::from(u) << 7),
        };
        let mut values = wide_measures(measured);
        values.push(("status_unanswered".into(), u.into()));
        values.push(("channel".into(), channel.into()));
        ("wide_joint", telemetry.encode(node), values)
    })
}

fn joint() -> impl Strategy<Value = Sample> {
    let unanswered = any::<bool>();
    (node(), any::<u8>(), measured(), unanswered).prop_map(|(node, channel, (steps, status), u)| {
        let [position, velocity, torque] = steps.map(f32::from);
        let telemetry = JointTelemetry {
            channel,
            position_rad: position / 5000.0,
            velocity_rad_s: velocity / 500.0,
            torque_nm: torque / 200.0,
            status: ActuatorStatus(status | u8::from(u) << 7),
        };
        let mut values = measures(steps, status);
        values.push(("status_unanswered".into(), u.into()));
        values.push(("channel".into(), channel.into()));
        ("joint", telemetry.encode(node), values)
    })
}

fn parameters() -> impl Strategy<Value = Sample> {
    let action = prop_oneof![
        (0u8..16, any::<u8>())
            .prop_map(|(parameter, channel)| ParameterAction::Get { parameter, channel }),
        (0u8..16, any::<u8>(), float()).prop_map(|(parameter, channel, value)| {
            ParameterAction::Set { parameter, channel, value }
        }),
        of(&[ParameterAction::Reset, ParameterAction::Save, ParameterAction::Origin]),
    ];
    let request = (to(), 0u8..16, action).prop_map(|(to, seq, action)| {
        let (parameter, channel, value) = match action {
            ParameterAction::Get { parameter, channel } => (parameter, channel, 0.0),
            ParameterAction::Set { parameter, channel, value } => (parameter, channel, value),
            _ => (0, 0, 0.0),
        };
        let values = named_values([
            ("seq", seq.into()),
            ("kind", action.kind().into()),
            ("parameter", parameter.into()),
            ("channel", channel.into()),
            ("value", value.into()),
        ]);
        sealed("parameter", ParameterRequest { seq, action }.encode(to), values)
    });
    let ack = (node(), 0u8..16, 0u8..5, of(ParameterResult::ALL), 0u8..16, option(), float());
    let ack = ack.prop_map(|(node, seq, kind, result, parameter, channel, value)| {
        let values = named_values([
            ("seq", seq.into()),
            ("kind", kind.into()),
            ("parameter", parameter.into()),
            ("result", result.code().into()),
            ("channel", number(channel)),
            ("value", value.into()),
        ]);
        let ack = ParameterAck { seq, kind, result, parameter, channel, value };
        sealed("parameter_ack", ack.encode(node), values)
    });
    prop_oneof![request, ack]
}

fn discovery() -> impl Strategy<Value = Sample> {
    prop_oneof![
        to().prop_map(|to| ("discover", Discover.encode(to), vec![])),
        (node(), any::<[u8; 6]>(), any::<u8>()).prop_map(|(node, uid, protocol_major)| {
            let shown = uid.iter().fold(0u64, |all, byte| all << 8 | u64::from(*byte));
            let values =
                named_values([("uid", shown as f64), ("protocol_major", protocol_major.into())]);
            ("discovered", Discovered { uid, protocol_major }.encode(node), values)
        }),
    ]
}

/// Frame of an ISO-TP transfer in either direction, with values decoded by the rules of the standard.
fn transport() -> impl Strategy<Value = Sample> {
    let message = prop::collection::vec(any::<u8>(), 1..60);
    let timing = (any::<u8>(), any::<u8>());
    (node(), message, timing, any::<prop::sample::Index>(), any::<bool>()).prop_map(
        |(node, message, (block_size, st_min), which, back)| {
            let timing = Timing { block_size, st_min: st_min % 128, timeout_us: 1_000_000 };
            let mut ends = [Endpoint::<60>::new(timing), Endpoint::<60>::new(timing)];
            ends[0].send(&message).unwrap();
            let mut frames = Vec::new();
            for turn in 0..2000 {
                let Output::Send(pdu) = ends[turn % 2].poll(turn as u64 * 200_000) else {
                    continue;
                };
                ends[1 - turn % 2].on_frame(pdu.data(), turn as u64 * 200_000);
                frames.push((turn % 2 == 1, pdu));
            }
            let (other_way, pdu) = *which.get(&frames);
            let (schema, frame) = if other_way != back {
                ("transport_to_host", frame_to_host(node, &pdu))
            } else {
                ("transport_to_controller", frame_to_controller(node, &pdu))
            };
            (schema, frame, isotp_says(frame.data()))
        },
    )
}

fn isotp_says(data: &[u8]) -> Vec<(String, f64)> {
    let head = usize::from(data[0]);
    let mut values = named_values([("pci", (head >> 4) as f64)]);
    let bytes = |prefix: &str, from: usize| -> Vec<_> {
        let rest = data.get(from..).unwrap_or(&[]).iter().enumerate();
        rest.map(|(i, byte)| (format!("{prefix}_byte_{i}"), f64::from(*byte))).collect()
    };
    match head >> 4 {
        0 => {
            let (length, kind) = ((head & 0xF) as f64, f64::from(data[1]));
            values.extend(named_values([("single_length", length), ("single_type", kind)]));
            values.extend(bytes("single", 2));
        }
        1 => {
            let length = (head & 0xF) << 8 | usize::from(data[1]);
            let kind = f64::from(data[2]);
            values.extend(named_values([("first_length", length as f64), ("first_type", kind)]));
            values.extend(bytes("first", 3));
        }
        2 => {
            values.extend(named_values([("next_number", (head & 0xF) as f64)]));
            values.extend(bytes("next", 1));
        }
        _ => values.extend(named_values([
            ("flow_status", (head & 0xF) as f64),
            ("flow_block_size", data[1].into()),
            ("flow_separation", data[2].into()),
        ])),
    }
    values
}

/// Mantissa and exponent of a short floating-point number, and its value in steps.
fn short() -> impl Strategy<Value = (u8, u8, f32)> {
    (0u8..128, 0u8..12).prop_map(|(mantissa, exponent)| {
        let m = f32::from(mantissa);
        let steps =
            if exponent == 0 { m } else { (128.0 + m) * 2f32.powi(i32::from(exponent) - 1) };
        (mantissa, exponent, steps)
    })
}

fn torque() -> impl Strategy<Value = ((u8, u8, f32), bool)> {
    (short().prop_filter("0 has no such frame", |short| short.2 > 0.0), any::<bool>())
}

type Short = (u8, u8, f32);

/// Signals at the end of a set-point with torque: mantissas and exponents, and the sign of the torque.
fn shorts(
    first: &str,
    a: Short,
    kd: Short,
    torque: Short,
    is_negative: bool,
) -> Vec<(String, f64)> {
    let parts = [(first, a), ("kd", kd), ("torque", torque)];
    let mut values: Vec<_> = parts
        .into_iter()
        .flat_map(|(name, (mantissa, exponent, _))| {
            [("mantissa", mantissa), ("exponent", exponent)]
                .map(|(part, number)| (format!("{name}_{part}"), f64::from(number)))
        })
        .collect();
    values.push(("torque_sign".into(), f64::from(u8::from(is_negative))));
    values
}

fn signed_torque((_, _, steps): Short, is_negative: bool) -> f32 {
    if is_negative { -steps / 1000.0 } else { steps / 1000.0 }
}

/// Number beyond the narrow scale, in steps of a wide frame.
fn large() -> impl Strategy<Value = Short> {
    (0u8..128, 12u8..16).prop_map(|(mantissa, exponent)| {
        let steps = (128.0 + f32::from(mantissa)) * 2_f32.powi(i32::from(exponent) - 1);
        (mantissa, exponent, steps)
    })
}

/// Schema of a set-point with torque, ratio of its steps to the narrow ones, and a number that requires it.
fn schema(
    narrow: &'static str,
    wide: &'static str,
) -> impl Strategy<Value = (&'static str, f32, Short)> {
    prop_oneof![
        short().prop_map(move |short| (narrow, 1.0, short)),
        large().prop_map(move |large| (wide, 16.0, large)),
    ]
}

fn joint_with_torque() -> impl Strategy<Value = Sample> {
    let kp = schema("joint_torque_setpoint", "wide_joint_setpoint");
    let joint = (0u8..128, -32767i16..=32767, -8191i16..=8191, kp, short(), torque());
    joint.prop_map(|(id, position, velocity, (schema, wider, kp), kd, (torque, is_negative))| {
        let setpoint = JointSetpoint {
            position_rad: f32::from(position) / 5000.0,
            velocity_rad_s: f32::from(velocity) / 125.0,
            kp_nm_rad: wider * kp.2 / 1000.0,
            kd_nm_s_rad: wider * kd.2 / 10_000.0,
            torque_nm: wider * signed_torque(torque, is_negative),
        };
        let mut values = named_values([
            ("position", f64::from(position) / 5000.0),
            ("velocity", f64::from(velocity) / 125.0),
        ]);
        values.extend(shorts("kp", kp, kd, torque, is_negative));
        (schema, setpoint.encode(id).unwrap(), values)
    })
}

fn wheel_with_torque() -> impl Strategy<Value = Sample> {
    let limit = schema("wheel_torque_setpoint", "wide_wheel_setpoint");
    let wheel = (0u8..128, -(1i32 << 22)..1 << 22, limit, short(), torque());
    wheel.prop_map(|(id, speed, (schema, wider, limit), kd, (torque, is_negative))| {
        let setpoint = WheelSetpoint {
            speed_rad_s: speed as f32 / 10_000.0,
            kd_nm_s_rad: wider * kd.2 / 10_000.0,
            torque_limit_nm: wider * limit.2 / 1000.0,
            torque_nm: wider * signed_torque(torque, is_negative),
        };
        let mut values = named_values([("speed", f64::from(speed) / 1e4)]);
        values.extend(shorts("torque_limit", limit, kd, torque, is_negative));
        (schema, setpoint.encode(id).unwrap(), values)
    })
}

/// Frames of the Rollwalk servo profile.
pub fn actuators() -> BoxedStrategy<Sample> {
    let control = (0u8..128, 0usize..3).prop_map(|(id, which)| {
        let control = [Control::Disable, Control::Enable, Control::Query][which];
        ("control", control.encode(id).unwrap(), named_values([("command", which as f64)]))
    });
    let setpoint = (0u8..128, measured(), any::<u16>(), any::<u16>());
    let setpoint = setpoint.prop_map(|(id, ([position, velocity, _], _), kp, kd)| {
        let setpoint = JointSetpoint {
            position_rad: f32::from(position) / 5000.0,
            velocity_rad_s: f32::from(velocity) / 500.0,
            kp_nm_rad: f32::from(kp) / 100.0,
            kd_nm_s_rad: f32::from(kd) / 1000.0,
            torque_nm: 0.0,
        };
        let values = named_values([
            ("position", f64::from(position) / 5000.0),
            ("velocity", f64::from(velocity) / 500.0),
            ("kp", f64::from(kp) / 100.0),
            ("kd", f64::from(kd) / 1000.0),
        ]);
        ("joint_setpoint", setpoint.encode(id).unwrap(), values)
    });
    let feedback = (0u8..128, measured(), any::<u8>());
    let feedback = feedback.prop_map(|(id, (steps, status), counter)| {
        let [position, velocity, torque] = steps.map(f32::from);
        let feedback = Feedback {
            position_rad: position / 5000.0,
            velocity_rad_s: velocity / 500.0,
            torque_nm: torque / 200.0,
            status: ActuatorStatus(status),
            counter,
        };
        let mut values = measures(steps, status);
        values.push(("counter".into(), counter.into()));
        ("feedback", feedback.encode(id).unwrap(), values)
    });
    let wide_feedback = (0u8..128, wide_measured(), any::<u8>());
    let wide_feedback = wide_feedback.prop_map(|(id, measured, counter)| {
        let (position, speed, torque, status) = measured;
        let feedback = Feedback {
            position_rad: f32::from(position) / 5000.0,
            velocity_rad_s: speed as f32 / 500.0,
            torque_nm: torque_nm(torque),
            status: ActuatorStatus(status),
            counter,
        };
        let mut values = wide_measures(measured);
        values.push(("counter".into(), counter.into()));
        ("wide_feedback", feedback.encode(id).unwrap(), values)
    });
    // Below 2^22 steps, single precision resolves every step.
    let wheel = (0u8..128, -(1i32 << 22)..1 << 22, any::<u16>(), any::<u16>());
    let wheel = wheel.prop_map(|(id, speed, kd, limit)| {
        let setpoint = WheelSetpoint {
            speed_rad_s: speed as f32 / 10_000.0,
            kd_nm_s_rad: f32::from(kd) / 1000.0,
            torque_limit_nm: f32::from(limit) / 200.0,
            torque_nm: 0.0,
        };
        let values = named_values([
            ("speed", f64::from(speed) / 1e4),
            ("kd", f64::from(kd) / 1000.0),
            ("torque_limit", f64::from(limit) / 200.0),
        ]);
        ("wheel_setpoint", setpoint.encode(id).unwrap(), values)
    });
    prop_oneof![
        control,
        setpoint,
        feedback,
        wide_feedback,
        wheel,
        joint_with_torque(),
        wheel_with_torque()
    ]
    .boxed()
}
