//! Tests of diagnoses: a verdict for every state, and the actuator or key that prevents arming.

use super::*;
use crate::fixtures::servo_line;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};
use rollwalk_protocol::faults::{FaultBits, Severity};
use rollwalk_protocol::wire::{
    ActuatorReadings, JointTelemetry, Node, Parameter, ParameterOrigin, State, Status,
};

fn hello() -> Hello {
    Hello {
        major: 1,
        minor: 0,
        schema_hash: 0,
        config_hash: 7,
        format_major: 1,
        format_minor: 1,
        library: Some(5),
        max_block: 512,
        channels: 2,
    }
}

/// Configuration of two joints with a range of ±1 rad.
fn config() -> RobotConfig {
    let channel = Channel {
        kind: ChannelKind::JointPosition,
        min: -1.0,
        max: 1.0,
        max_rate: 1.0,
        max_torque_nm: 1.0,
        kp_nm_rad: 1.0,
        kd_nm_s_rad: 0.1,
        bus: 0,
        id: 1,
    };
    let channels = [channel, Channel { id: 2, ..channel }].into_iter().collect();
    RobotConfig { robot: 0, channels }
}

fn traffic_in(state: State, faults: FaultBits, joints: u8) -> Traffic {
    let node = Node::new(1).unwrap();
    let mut heard = Traffic { span_us: 1_000_000, ..Traffic::default() };
    let severity = Severity::None;
    let status = Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 5 };
    heard.take(1, &status.encode(node));
    for channel in 0..joints {
        let joint = JointTelemetry {
            channel,
            position_rad: 0.0,
            velocity_rad_s: 0.0,
            torque_nm: 0.0,
            status: Default::default(),
        };
        heard.take(1, &joint.encode(node));
    }
    heard
}

fn findings<'a>(heard: &'a Traffic, hello: Option<&'a Hello>) -> Observations<'a> {
    Observations {
        heard,
        has_host: false,
        hello,
        refused: None,
        key: LinkKeyCheck::NotNeeded,
        transferring: false,
        gains: None,
        gains_unread: None,
        history: None,
        complaint: None,
        bitrate: 1_000_000,
        expected_config: Some(7),
        catalog: None,
        config: None,
        bus: "can:can0",
    }
}

fn diagnose(heard: &Traffic, hello: Option<&Hello>) -> String {
    text(&findings(heard, hello))
}

fn text(findings: &Observations<'_>) -> String {
    let found = findings.diagnose();
    found.iter().map(|f| format!("{:?}: {} -> {}\n", f.gravity, f.what, f.help)).collect()
}

#[test]
fn a_robot_that_is_well_is_told_so() {
    let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 2), Some(&hello()));
    assert!(text.contains("arm the robot: rollwalk send --arm"), "{text}");
    assert!(!text.contains("Wrong"), "{text}");
}

#[test]
fn a_controller_that_was_not_asked_is_not_called_silent() {
    let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    let found = Observations { transferring: true, ..findings(&heard, None) }.diagnose();
    assert!(found[0].what.contains("another program is transferring data"), "{found:?}");
    assert!(!found.iter().any(|f| f.what.contains("does not answer")), "{found:?}");
}

#[test]
fn every_fault_has_a_cause_and_a_cure() {
    for &fault in Fault::ALL {
        let faults = FaultBits::default().with(fault);
        let text = diagnose(&traffic_in(State::TorqueOff, faults, 2), Some(&hello()));
        assert!(text.contains(&format!("docs/faults.md, {} {fault:?}", fault.code())), "{text}");
        assert!(text.contains("rollwalk clear --bus can:can0"), "{text}");
    }
}

/// A fault report contains the current tilt. A body that was set upright again, with a tilt of 0.001 rad, must not be
/// called tilted.
#[test]
fn a_body_that_was_set_up_again_is_not_called_tilted() {
    let node = Node::new(1).unwrap();
    let told = |value| {
        let fault = Fault::Tilt;
        let mut heard = traffic_in(State::TorqueOff, FaultBits::default().with(fault), 2);
        let report = FaultReport { counter: 0, fault, channel: None, value };
        heard.take(1, &report.encode(node));
        diagnose(&heard, Some(&hello()))
    };
    let text = told(0.001);
    assert!(text.contains("fault 7: the body was tilted, and is level again ->"), "{text}");
    let text = told(0.5);
    assert!(text.contains("the body is tilted (29° beyond"), "{text}");
    let text = told(-1.0);
    assert!(text.contains("the IMU is silent"), "{text}");
}

#[test]
fn servos_that_do_not_always_answer_are_named() {
    let node = Node::new(1).unwrap();
    let told = |missed: u8| {
        let mut heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
        for n in 0..39 {
            let status = if n < missed { ActuatorStatus::UNANSWERED } else { 0 };
            let joint = JointTelemetry {
                channel: 1,
                position_rad: 0.0,
                velocity_rad_s: 0.0,
                torque_nm: 0.0,
                status: ActuatorStatus(status),
            };
            heard.take(1, &joint.encode(node));
        }
        diagnose(&heard, Some(&hello()))
    };
    assert!(!told(0).contains("did not answer"), "{}", told(0));
    let text = told(3);
    let expected = "Note: servos did not answer: channel 1 in 3 of 40 reports -> check";
    assert!(text.contains(expected), "{text}");
}

#[test]
fn who_is_silent_is_named() {
    let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 1), Some(&hello()));
    assert!(text.contains("no position from channel 1:"), "{text}");
    let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 0), Some(&hello()));
    assert!(text.contains("no position from any actuator:"), "{text}");
    let text = diagnose(&Traffic::default(), None);
    assert!(text.contains("there are no frames on the bus"), "{text}");
}

fn of_pup() -> Catalog {
    let channels = vec!["hip".into(), "knee".into()];
    Catalog::of_robot("pup", 7, channels).with_actuators(servo_line([1, 3]))
}

fn of_servos(heard: &Traffic) -> String {
    let (hello, catalog) = (hello(), of_pup());
    let findings = Observations { catalog: Some(&catalog), ..findings(heard, Some(&hello)) };
    text(&findings)
}

/// Diagnosis of a robot on a serial line contains no CAN terms: lost adapter, all servos silent, one silent, two with the
/// same ID, low supply, overheated.
#[test]
fn a_serial_line_is_diagnosed_in_its_own_words() {
    let node = Node::new(1).unwrap();
    let mut gone = traffic_in(State::EStopped, FaultBits::default().with(Fault::BusOff), 2);
    let report = FaultReport { counter: 0, fault: Fault::BusOff, channel: None, value: 0.0 };
    gone.take(1, &report.encode(node));
    let all_silent = traffic_in(State::Disarmed, FaultBits::default(), 0);
    let one_silent = traffic_in(State::Disarmed, FaultBits::default(), 1);
    let joint = |channel, bits| JointTelemetry {
        channel,
        position_rad: 0.0,
        velocity_rad_s: 0.0,
        torque_nm: 0.0,
        status: ActuatorStatus(bits),
    };
    let mut same_id = traffic_in(State::Disarmed, FaultBits::default(), 1);
    for n in 0..40 {
        let bits = if n % 4 == 0 { ActuatorStatus::UNANSWERED } else { 0 };
        same_id.take(1, &joint(0, bits).encode(node));
    }
    let mut brown_out = traffic_in(State::Disarmed, FaultBits::default(), 2);
    brown_out.take(1, &joint(1, ActuatorStatus::BAD_VOLTAGE).encode(node));
    let mut hot = traffic_in(State::Disarmed, FaultBits::default(), 2);
    hot.take(1, &joint(1, ActuatorStatus::OVERHEATED).encode(node));
    let mut warm = traffic_in(State::Disarmed, FaultBits::default(), 2);
    for (channel, temperature_c, voltage_v) in [(0, 31.0, 5.0), (1, 64.0, 3.8)] {
        let (temperature_c, voltage_v) = (Some(temperature_c), Some(voltage_v));
        warm.take(1, &ActuatorReadings { channel, temperature_c, voltage_v }.encode(node));
    }
    for (heard, expected) in [
        (
            gone,
            &[
                "stopped: the serial adapter of the servos is gone",
                "fault 11: the serial adapter",
                "switch motor power off, plug the adapter in",
            ][..],
        ),
        (all_silent, &["any actuator on bus 0 (Dynamixel)", "1000000 bit/s", "echo"]),
        (one_silent, &["no position from knee (bus 0, ID 3)", "new servos have ID 1"]),
        (
            same_id,
            &[
                "no position from knee (bus 0, ID 3)",
                "hip (bus 0, ID 1) misses answers, as if two servos had the same ID",
            ],
        ),
        (
            warm,
            &[
                "Fine: temperatures 31 °C (hip) to 64 °C (knee); supply voltages 3.8 V (knee) to 5.0 V (hip)",
                "Note: knee (bus 0, ID 3): 64 °C; its torque goes off at 70 °C",
                "Note: knee (bus 0, ID 3): supply 3.8 V; it needs at least 3.7 V",
                "charge the battery",
            ],
        ),
        (brown_out, &["Wrong: knee (bus 0, ID 3): supply voltage outside 3.7 to 6 V"]),
        (hot, &["Wrong: knee (bus 0, ID 3): hotter than 70 °C"]),
    ] {
        let text = of_servos(&heard);
        for words in expected {
            assert!(text.contains(words), "{words}: {text}");
        }
        // The link of these robots is on CAN, as their lines show.
        for word in ["CAN_H", "terminat", "candump", "emergency stop", "a bus is off"] {
            assert!(!text.contains(word), "{word}: {text}");
        }
    }
}

#[test]
fn another_controller_on_the_bus_is_named() {
    let mut traffic = Traffic { span_us: 1_000_000, ..Traffic::default() };
    let of_one = traffic_in(State::Disarmed, FaultBits::default(), 0);
    let status = of_one.status.unwrap();
    traffic.take(3, &status.encode(Node::new(1).unwrap()));
    let text = diagnose(&traffic, None);
    assert!(text.contains("controller 1 is on the bus"), "{text}");
    assert!(text.contains("rollwalk doctor --node 1 --bus can:can0"), "{text}");
}

#[test]
fn a_robot_that_nobody_holds_and_another_robot_are_noticed() {
    let (heard_ready, ours) = (traffic_in(State::Ready, FaultBits::default(), 2), hello());
    let nobody = findings(&heard_ready, Some(&ours));
    let told = text(&nobody);
    assert!(told.contains("no host sends heartbeats"), "{told}");
    let told = text(&Observations { has_host: true, ..nobody });
    assert!(!told.contains("no host"), "{told}");
    let other = Hello { config_hash: 8, ..hello() };
    let text = diagnose(&traffic_in(State::Disarmed, FaultBits::default(), 2), Some(&other));
    assert!(text.contains("the robot file does not fit"), "{text}");
}

fn joint(channel: u8, bits: u8) -> Frame {
    let (position_rad, velocity_rad_s, torque_nm) = (0.0, 0.0, 0.0);
    let status = ActuatorStatus(bits);
    JointTelemetry { channel, position_rad, velocity_rad_s, torque_nm, status }
        .encode(Node::new(1).unwrap())
}

fn of_line(names: &[&str]) -> Catalog {
    let actuators = servo_line(1..=names.len() as u8);
    let names = names.iter().map(|name| (*name).to_owned()).collect();
    Catalog::of_robot("pup", 7, names).with_actuators(actuators)
}

/// Silence of one servo on a serial line silences all servos after it. Only the first is named, whether it has answered before
/// or not.
#[test]
fn one_silent_servo_of_a_line_is_named() {
    let catalog = of_line(&["hip", "thigh", "knee", "ankle"]);
    let hello = Hello { channels: 4, ..hello() };
    let of = |heard: &Traffic| {
        text(&Observations { catalog: Some(&catalog), ..findings(heard, Some(&hello)) })
    };
    let never = of(&traffic_in(State::Disarmed, FaultBits::default(), 1));
    let expected = "Wrong: no position from thigh (bus 0, ID 2), and therefore none from the servos \
                    behind it on the line: the robot cannot be armed";
    assert!(never.contains(expected), "{never}");
    assert!(!never.contains("knee") && !never.contains("ankle"), "{never}");
    let mut stopped = traffic_in(State::Disarmed, FaultBits::default(), 4);
    for _ in 0..10 {
        for channel in 0..4 {
            let bits = if channel == 0 { 0 } else { ActuatorStatus::UNANSWERED };
            stopped.take(1, &joint(channel, bits));
        }
    }
    let stopped = of(&stopped);
    assert!(stopped.contains(&expected.replace("position", "answer")), "{stopped}");
    assert!(!stopped.contains("knee") && !stopped.contains("did not answer"), "{stopped}");
    assert!(!stopped.contains("arm the robot"), "{stopped}");
}

/// A controller of a CAN robot marks the telemetry of a drive that has stopped answering.
#[test]
fn a_drive_that_stopped_answering_prevents_arming() {
    let mut heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    (0..10).for_each(|_| heard.take(1, &joint(1, ActuatorStatus::UNANSWERED)));
    let text = diagnose(&heard, Some(&hello()));
    assert!(text.contains("Wrong: no answer from channel 1: the robot cannot be armed"), "{text}");
    assert!(!text.contains("arm the robot"), "{text}");
}

/// Verdict for a disarmed robot changes with each finding that prevents arming.
#[test]
fn a_robot_is_not_to_be_armed_while_anything_prevents_it() {
    let (well, ours) = (traffic_in(State::Disarmed, FaultBits::default(), 2), hello());
    let good = || findings(&well, Some(&ours));
    assert!(text(&good()).contains("arm the robot: rollwalk send --arm MOTION --bus can:can0"));
    let silent = traffic_in(State::Disarmed, FaultBits::default(), 1);
    let faulty = traffic_in(State::Disarmed, FaultBits::default().with(Fault::BusNoAck), 2);
    let mut hot = well.clone();
    hot.take(1, &joint(0, ActuatorStatus::OVERHEATED));
    let mut far = well.clone();
    let node = Node::new(1).unwrap();
    let status = ActuatorStatus(0);
    let telemetry = JointTelemetry {
        channel: 1,
        position_rad: 1.3,
        velocity_rad_s: 0.0,
        torque_nm: 0.0,
        status,
    };
    far.take(1, &telemetry.encode(node));
    let config = config();
    assert!(text(&Observations { config: Some(&config), ..good() }).contains("arm the robot:"));
    for (findings, words) in [
        (Observations { heard: &silent, ..good() }, "no position from channel 1"),
        (Observations { heard: &faulty, ..good() }, "fault 9"),
        (Observations { heard: &hot, ..good() }, "channel 0: too hot"),
        (
            Observations { heard: &far, config: Some(&config), ..good() },
            "channel 1 is at 74°, outside its range of -57° to 57°",
        ),
        (Observations { key: LinkKeyCheck::Wrong, ..good() }, "another link key"),
        (Observations { key: LinkKeyCheck::GivenInVain, ..good() }, "leave out --link-key"),
        (Observations { expected_config: Some(8), ..good() }, "the robot file does not fit"),
        (Observations { complaint: Some("the bus is passive"), ..good() }, "the bus is passive"),
    ] {
        let text = text(&findings);
        assert!(text.contains(words), "{words}: {text}");
        assert!(text.contains("the robot is disarmed -> it cannot be armed: remove"), "{text}");
        assert!(!text.contains("arm the robot"), "{text}");
    }
    let keyed = text(&Observations { key: LinkKeyCheck::Missing, ..good() });
    assert!(keyed.contains("rollwalk send --arm MOTION --link-key FILE --bus can:can0"), "{keyed}");
    let held = text(&Observations { has_host: true, ..good() });
    assert!(held.contains("arm the robot in the program that is its host"), "{held}");
}

/// The robot of a killed host returns to SAFE and latches the fault: the operator waits, then clears. A console could not keep
/// it armed.
#[test]
fn after_a_killed_host_the_advice_is_to_wait_and_clear() {
    let lost = FaultBits::default().with(Fault::HostLost);
    for state in [State::Returning, State::Damped] {
        let text = diagnose(&traffic_in(state, lost, 2), Some(&hello()));
        let expected = "wait until torque is off, then type rollwalk clear --bus can:can0";
        assert_eq!(text.matches(expected).count(), 1, "{state:?}: {text}");
        assert!(!text.contains("console") && !text.contains("will be disarmed"), "{text}");
    }
    // Heartbeats from before the kill do not count.
    let returning = traffic_in(State::Returning, lost, 2);
    let text = text(&Observations { has_host: true, ..findings(&returning, Some(&hello())) });
    assert!(text.contains("no host sends heartbeats"), "{text}");
}

#[test]
fn every_state_of_an_armed_robot_has_a_next_command() {
    for (state, command) in [
        (State::Ready, "rollwalk send MOTION --bus can:can0"),
        (State::Playing, "rollwalk pause --bus can:can0"),
        (State::Paused, "rollwalk resume --bus can:can0"),
        (State::Paused, "rollwalk return --bus can:can0"),
        (State::Streaming, "rollwalk return --bus can:can0"),
        (State::Aligning, "wait"),
        (State::Returning, "wait"),
    ] {
        let heard = traffic_in(state, FaultBits::default(), 2);
        let text = text(&Observations { has_host: true, ..findings(&heard, Some(&hello())) });
        assert!(text.contains(command), "{state:?}: {text}");
        assert!(!text.contains("Wrong"), "{text}");
    }
}

/// A controller of another release is not called silent.
#[test]
fn another_protocol_is_named() {
    let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    let refused = Some("controller 1 uses protocol 9.0");
    let text = text(&Observations { refused, ..findings(&heard, None) });
    assert_eq!(text, "Wrong: controller 1 uses protocol 9.0 -> \n");
}

/// Feed-forward for a stand and changed gains are easily forgotten.
#[test]
fn values_that_differ_from_the_robot_file_are_listed() {
    let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    let hello = hello();
    let config = config();
    let file = &config.channels[0];
    let gains = |kp: f32, feed_forward, origin| Gains {
        origin,
        feed_forward,
        values: vec![(0, Parameter::Kp, kp), (0, Parameter::Kd, file.kd_nm_s_rad)],
    };
    let told = |gains: &Gains| {
        let findings = findings(&heard, Some(&hello));
        text(&Observations { gains: Some(gains), config: Some(&config), ..findings })
    };
    let fine = told(&gains(file.kp_nm_rad, 1.0, ParameterOrigin::Configuration));
    assert!(!fine.contains("differ") && !fine.contains("feed-forward"), "{fine}");
    let changed = told(&gains(file.kp_nm_rad + 1.0, 0.0, ParameterOrigin::Saved));
    for expected in ["channel 0: kp 2 instead of 1 N·m/rad", "feed-forward is 0", "gains save"] {
        assert!(changed.contains(expected), "{changed}");
    }
}

/// Unread values would look like those of the robot file.
#[test]
fn values_that_could_not_be_read_are_noted() {
    let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    let hello = hello();
    let gains_unread = Some("controller 1 did not answer");
    let told = text(&Observations { gains_unread, ..findings(&heard, Some(&hello)) });
    let expected = "Note: gains and limits could not be read: controller 1 did not answer -> list \
        the values: rollwalk gains show --bus can:can0\n";
    assert!(told.contains(expected), "{told}");
}

/// A fitting robot file is confirmed.
#[test]
fn a_robot_file_that_fits_is_confirmed() {
    let heard = traffic_in(State::Disarmed, FaultBits::default(), 2);
    let hello = hello();
    let told = |expected| {
        text(&Observations { expected_config: Some(expected), ..findings(&heard, Some(&hello)) })
    };
    assert!(told(hello.config_hash).contains("the robot file fits"));
    assert!(told(hello.config_hash + 1).contains("does not fit"));
}
