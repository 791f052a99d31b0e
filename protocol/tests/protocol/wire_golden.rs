//! Golden bytes of every message of the link, protocol version 2. Do not change them: the other side may be a robot with old
//! firmware. If a test here fails, the code is wrong, or the protocol needs a new version.

use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Event, Fault, FaultBits, Severity};
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::*;

/// Identifier and payload as hexadecimal digits.
fn text(frame: Frame) -> String {
    frame.to_string().to_lowercase()
}

fn node() -> Node {
    Node::new(3).unwrap()
}

#[test]
fn schema_is_pinned() {
    assert_eq!(SCHEMA_HASH, 0xdd63_871d);
}

#[test]
fn the_documents_have_the_schema() {
    let text = include_str!("../../../docs/formats/link-schema.txt").replace("\r\n", "\n");
    assert_eq!(text, SCHEMA, "docs/formats/link-schema.txt differs");
}

#[test]
fn estop() {
    let frame = Estop.encode(Node::BROADCAST);
    assert_eq!(text(frame), "0f0#");
    assert_eq!(Estop::decode(&frame), Ok((Node::BROADCAST, Estop)));
    let any_payload = Frame::standard(0x030, &[1, 2, 3]).unwrap();
    assert_eq!(Estop::decode(&any_payload), Ok((node(), Estop)));
    let ack = EstopAck { state: State::EStopped };
    assert_eq!(text(ack.encode(node())), "031#9e0a");
    assert_eq!(EstopAck::decode(&ack.encode(node())), Ok((node(), ack)));
}

#[test]
fn heartbeat() {
    let m = Heartbeat { seq: 0x42, host_ms: 0x0403_0201 };
    assert_eq!(text(m.encode(Node::BROADCAST)), "1f0#354201020304");
    assert_eq!(Heartbeat::decode(&m.encode(node())), Ok((node(), m)));
    let m = HeartbeatReply { seq: 0x42, controller_ms: 0x0807_0605 };
    assert_eq!(text(m.encode(node())), "131#664205060708");
    assert_eq!(HeartbeatReply::decode(&m.encode(node())), Ok((node(), m)));
}

#[test]
fn command() {
    let actions = [
        (Action::Play { code: 20, speed_64ths: 64 }, "230#2305144000001027"),
        (Action::Play { code: 255, speed_64ths: -1 }, "230#7b06ffff00001027"),
        (Action::Pause, "230#8717000000001027"),
        (Action::Resume, "230#3928000000001027"),
        (Action::Return, "230#1739000000001027"),
        (Action::Disarm, "230#7c4a000000001027"),
        (Action::ArmRequest, "230#525b000000001027"),
        (Action::ArmConfirm { nonce: 0xBEEF }, "230#8c6c0000efbe1027"),
        (Action::ClearRequest, "230#af7d000000001027"),
        (Action::ClearConfirm { nonce: 0x1234 }, "230#1a8e000034121027"),
        (Action::Stream, "230#d89f000000001027"),
        (Action::Track { rate_hz: 120, kp_percent: 10, kd_percent: 20 }, "230#55a00a1478001027"),
    ];
    for (i, (action, golden)) in actions.into_iter().enumerate() {
        let command = Command { seq: (i as u8 + 5) % 16, action, valid_until_ms: 0x2710 };
        let frame = command.encode(node());
        assert_eq!(text(frame), golden, "{action:?}");
        assert_eq!(Command::decode(&frame), Ok((node(), command)));
    }
    let place = PlaceCode::named("stairs");
    let action = Action::PlayAt { code: 20, speed_64ths: 64, place };
    let command = Command { seq: 5, action, valid_until_ms: 0x2710 };
    assert_eq!(text(command.encode(node())), "230#96051440a0bf1027");
    assert_eq!(Command::decode(&command.encode(node())), Ok((node(), command)));
}

#[test]
fn command_ack() {
    let ack = CommandAck {
        seq: 9,
        kind: Action::ArmRequest.kind(),
        result: CommandResult::Ok,
        state: State::Disarmed,
        motion: None,
        value: 0xBEEF,
    };
    assert_eq!(text(ack.encode(node())), "332#6d590002ffefbe");
    assert_eq!(CommandAck::decode(&ack.encode(node())), Ok((node(), ack)));
    let ack = CommandAck { kind: 0, motion: Some(4), result: CommandResult::Unreachable, ..ack };
    assert_eq!(text(ack.encode(node())), "332#3809040204efbe");
    assert_eq!(CommandAck::decode(&ack.encode(node())), Ok((node(), ack)));
}

#[test]
fn status() {
    let faults = FaultBits::default().with(Fault::HostLost).with(Fault::Internal);
    let status = Status {
        state: State::Returning,
        severity: Severity::Return,
        faults,
        clip: Some(17),
        frame: 0xABC,
        counter: 0xD,
        library: 0x5A,
    };
    assert_eq!(text(status.encode(node())), "330#aa27048011bcda5a");
    assert_eq!(Status::decode(&status.encode(node())), Ok((node(), status)));
    let idle = Status { clip: None, frame: 0, faults: FaultBits(0), ..status };
    assert_eq!(text(idle.encode(node())), "330#23270000ff00d05a");
    assert_eq!(Status::decode(&idle.encode(node())), Ok((node(), idle)));
}

#[test]
fn fault_report() {
    let report =
        FaultReport { counter: 2, fault: Fault::TrackingError, channel: Some(5), value: 0.125 };
    assert_eq!(text(report.encode(node())), "331#da0205050000003e");
    assert_eq!(FaultReport::decode(&report.encode(node())), Ok((node(), report)));
}

#[test]
fn joint_telemetry() {
    let m = JointTelemetry {
        channel: 7,
        position_rad: -1.0,
        velocity_rad_s: 2.0,
        torque_nm: 0.5,
        status: ActuatorStatus(ActuatorStatus::ENABLED),
    };
    assert_eq!(text(m.encode(node())), "430#0778ece803640001");
    assert_eq!(JointTelemetry::decode(&m.encode(node())), Ok((node(), m)));
    // Speed and torque of the wide message have the layout of the wide feedback.
    let fast = JointTelemetry { position_rad: 3.0, velocity_rad_s: 200.0, torque_nm: -20.48, ..m };
    assert_eq!(text(fast.encode(node())), "436#07983aa08601a201");
    assert_eq!(JointTelemetry::decode(&fast.encode(node())), Ok((node(), fast)));
    let slow = Frame::standard(0x436, &[7, 0, 0, 1, 0, 0, 0, 0]).unwrap();
    assert_eq!(JointTelemetry::decode(&slow), Err(DecodeError::BadValue));
}

#[test]
fn setpoint() {
    for (stiff, value, torque_nm, golden) in [
        (false, -1.0, 0.5, "431#1cab07f0d8ff6400"),
        (false, 838.0, -160.0, "431#74ab0760de7f0083"),
        (true, -1.0, 0.5, "431#66ab87f0d8ff6400"),
        (true, -1.0, 1280.0, "437#92ab87f0d8ff000a"),
    ] {
        let m = Setpoint { frame: 0xAB, channel: 7, stiff, value, torque_nm };
        assert_eq!(text(m.encode(node())), golden);
        assert_eq!(Setpoint::decode(&m.encode(node())), Ok((node(), m)));
    }
    // The lowest codes mean no value.
    for (value, torque) in [([0, 0, 0x80], [0, 0]), ([0, 0, 0], [0, 0x80])] {
        let body = [1, 2, value[0], value[1], value[2], torque[0], torque[1]];
        let mut data = [0; 8];
        data[1..].copy_from_slice(&body);
        data[0] = rollwalk_protocol::crc::crc8_with_id(0x431, &body);
        let frame = Frame::standard(0x431, &data).unwrap();
        assert_eq!(Setpoint::decode(&frame), Err(DecodeError::BadValue));
    }
    // Values out of range saturate, and NaN becomes 0.
    let wild = Setpoint { frame: 0, channel: 0, stiff: false, value: 1e9, torque_nm: f32::NAN };
    let (_, read) = Setpoint::decode(&wild.encode(node())).unwrap();
    assert_eq!((read.value, read.torque_nm), (838.8607, 0.0));
}

#[test]
fn readings() {
    for (temperature_c, voltage_v, golden) in [
        (Some(41.5), Some(11.9), "435#67059f01a604"),
        (Some(-5.0), None, "435#0e05ceff0080"),
        (None, Some(5.0), "435#8d050080f401"),
        (None, None, "435#680500800080"),
    ] {
        let m = ActuatorReadings { channel: 5, temperature_c, voltage_v };
        assert_eq!(text(m.encode(node())), golden);
        assert_eq!(ActuatorReadings::decode(&m.encode(node())), Ok((node(), m)));
    }
    // Values out of range saturate, and NaN becomes 0.
    let (temperature_c, voltage_v) = (Some(f32::NEG_INFINITY), Some(f32::NAN));
    let wild = ActuatorReadings { channel: 0, temperature_c, voltage_v };
    let read = ActuatorReadings::decode(&wild.encode(node())).unwrap().1;
    assert_eq!((read.temperature_c, read.voltage_v), (Some(-3276.7), Some(0.0)));
}

#[test]
fn sample() {
    let gyro = Gyro { rad_s: [0.5, -1.0, 0.002] };
    assert_eq!(text(gyro.encode(node())), "432#f5fa000cfe0100");
    assert_eq!(Gyro::decode(&gyro.encode(node())), Ok((node(), gyro)));
    let accelerometer = Accelerometer { m_s2: [0.0, -1.0, 9.805] };
    assert_eq!(text(accelerometer.encode(node())), "433#c1000038ffa907");
    assert_eq!(Accelerometer::decode(&accelerometer.encode(node())), Ok((node(), accelerometer)));
    let answered = |number, delay_s| Some(SampleAnswer { number, delay_s });
    for (answered, contacts, golden) in [
        (answered(0xFE, 0.0166), Some(0b1010), "434#3dfffe530a000003"),
        (None, None, "434#12ff000000000000"),
        (None, Some(0), "434#3dff000000000001"),
        (answered(0, 0.051), Some(0xFF_FFFF), "434#edff00ffffffff03"),
    ] {
        let sample = Sample { number: 0xFF, answered, contacts };
        assert_eq!(text(sample.encode(node())), golden);
        assert_eq!(Sample::decode(&sample.encode(node())), Ok((node(), sample)));
    }
    // An unknown flag, and values without their flags.
    for body in
        [[1, 0, 0, 0, 0, 0, 4], [1, 1, 0, 0, 0, 0, 0], [1, 0, 1, 0, 0, 0, 0], [1, 0, 0, 1, 0, 0, 0]]
    {
        let mut data = [0; 8];
        data[1..].copy_from_slice(&body);
        data[0] = rollwalk_protocol::crc::crc8_with_id(0x434, &body);
        let frame = Frame::standard(0x434, &data).unwrap();
        assert_eq!(Sample::decode(&frame), Err(DecodeError::BadValue));
    }
    let long = Sample { number: 0, answered: answered(0, 9.0), contacts: None };
    let read = Sample::decode(&long.encode(node())).unwrap().1;
    assert_eq!(read.answered.unwrap().delay_s, 0.051);
    // Values out of range saturate, and NaN becomes 0.
    let wild = Gyro { rad_s: [f32::INFINITY, f32::NAN, -1e9] };
    let read = Gyro::decode(&wild.encode(node())).unwrap().1;
    assert_eq!(read.rad_s, [65.534, 0.0, -65.534]);
}

#[test]
fn parameter() {
    let actions = [
        (ParameterAction::Get { parameter: 1, channel: 23 }, "630#0105011700000000"),
        (ParameterAction::Set { parameter: 0, channel: 4, value: 37.5 }, "630#0816000400001642"),
        (
            ParameterAction::Set { parameter: 15, channel: 255, value: -0.25 },
            "630#e0170fff000080be",
        ),
        (ParameterAction::Reset, "630#1d28000000000000"),
        (ParameterAction::Save, "630#3339000000000000"),
        (ParameterAction::Origin, "630#584a000000000000"),
    ];
    for (i, (action, golden)) in actions.into_iter().enumerate() {
        let request = ParameterRequest { seq: i as u8 + 5, action };
        let frame = request.encode(node());
        assert_eq!(text(frame), golden, "{action:?}");
        assert_eq!(ParameterRequest::decode(&frame), Ok((node(), request)));
    }
}

#[test]
fn parameter_ack() {
    let ack = ParameterAck {
        seq: 6,
        kind: 1,
        result: ParameterResult::OutOfRange,
        parameter: Parameter::MaxTorque.code(),
        channel: Some(4),
        value: 3.0,
    };
    assert_eq!(text(ack.encode(node())), "631#1416320400004040");
    assert_eq!(ParameterAck::decode(&ack.encode(node())), Ok((node(), ack)));
    let result = ParameterResult::StoreFailed;
    let ack = ParameterAck { seq: 9, kind: 3, result, parameter: 0, channel: None, value: 0.0 };
    assert_eq!(text(ack.encode(node())), "631#463950ff00000000");
    assert_eq!(ParameterAck::decode(&ack.encode(node())), Ok((node(), ack)));
}

#[test]
fn discovery() {
    assert_eq!(text(Discover.encode(Node::BROADCAST)), "7f0#");
    let m = Discovered { uid: [1, 2, 3, 4, 5, 6], protocol_major: 1 };
    assert_eq!(text(m.encode(node())), "731#01020304050601");
    assert_eq!(Discovered::decode(&m.encode(node())), Ok((node(), m)));
}

/// Codes on the wire, which must not change.
#[test]
fn codes_are_pinned() {
    let check = |all: Vec<(u8, String)>, expected: &str| {
        let text: Vec<String> = all.iter().map(|(code, name)| format!("{code} {name}")).collect();
        assert_eq!(text.join(", "), expected);
    };
    check(
        State::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Boot, 1 SelfTest, 2 Disarmed, 3 Aligning, 4 Ready, 5 Playing, 6 Paused, 7 Returning, \
         8 Damped, 9 TorqueOff, 10 EStopped, 11 Streaming",
    );
    check(
        Severity::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 None, 1 Notice, 2 Return, 3 Damp, 4 TorqueOff, 5 EStop",
    );
    check(
        Fault::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 NoLibrary, 1 ConfigMismatch, 2 HostLost, 3 ActuatorSilent, 4 ActuatorFault, \
         5 TrackingError, 6 OutOfLimits, 7 Tilt, 8 SetpointTimeout, 9 BusNoAck, \
         10 BusPassive, 11 BusOff, 12 EStop, 13 Overrun, 14 LibraryUnreadable, 15 Internal",
    );
    check(
        CommandResult::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Ok, 1 UnknownCode, 2 WrongState, 3 Expired, 4 Unreachable, 5 NotArmed, 6 NoLibrary, \
         7 WrongNonce, 8 ConfigMismatch, 9 PoseUnknown, 10 OutOfOrder, 11 UnknownKind, \
         12 FaultPresent, 13 BadSpeed, 14 AuthenticationRequired, 15 Unproven, 16 UnfitActuators, \
         17 BadTracking, 18 OtherPlace",
    );
    check(
        Event::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 EStop, 1 BusOff, 2 SelfTestFailed, 3 FeedbackLost, 4 ActuatorFault, 5 NotAcknowledged, \
         6 BusPassive, 7 Tipped, 8 NotFollowing, 9 PlaybackFailed, 10 Overrun, 11 AlignFailed, \
         12 HostLost, 13 Leaning, 14 Disarm, 15 ClearConfirmed, 16 ArmConfirmed, 17 Started, \
         18 SelfTestPassed, 19 Aligned, 20 MotionStarted, 21 PauseAsked, 22 ResumeAsked, \
         23 SafeReached, 24 HoldElapsed, 25 DampingElapsed, 26 FaultFree, 27 Unauthenticated, \
         28 StreamStarted, 29 StreamEnded, 30 StreamLost, 31 StreamHalted",
    );
    check(
        Parameter::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Kp, 1 Kd, 2 MaxTorque, 3 FeedForward",
    );
    check(
        ParameterOrigin::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Configuration, 1 Saved, 2 OtherConfiguration, 3 OutOfRange",
    );
    check(
        ParameterResult::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Ok, 1 UnknownParameter, 2 UnknownChannel, 3 OutOfRange, 4 WrongState, 5 StoreFailed, \
         6 OutOfOrder, 7 UnknownRequest, 8 NotSupported, 9 AuthenticationRequired",
    );
    check(
        transport::TransferResult::ALL.iter().map(|x| (x.code(), format!("{x:?}"))).collect(),
        "0 Ok, 1 WrongState, 2 TooLong, 3 OutOfOrder, 4 BadCrc, 5 NotBegun, 6 Incomplete, \
         7 Rejected, 8 NotFinished, 9 StoreFailed, 10 UnknownRequest, 11 AuthenticationRequired",
    );
}
