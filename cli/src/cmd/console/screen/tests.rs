//! Screens of known scenes, compared with the files in this folder; also scenes and sizes that must not panic.

use super::super::scene::{Names, Range, Scene};
use super::draw;
use proptest::prelude::*;
use ratatui::Terminal;
use ratatui::backend::TestBackend;
use rollwalk_host::actuators::{ActuatorBus, Actuators, BusKind, ChannelActuator};
use rollwalk_host::catalog::{Catalog, CatalogMotion, Transition};
use rollwalk_host::describe::state_name;
use rollwalk_host::operator::{ExitStage, FaultView, JointView, LinkView, Message, View, Weight};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::faults::{Fault, FaultBits, Severity};
use rollwalk_protocol::wire::{ActuatorReadings, JointTelemetry, State, Status};
use std::collections::BTreeMap;
use std::{env, fs};

fn render(scene: &Scene, width: u16, height: u16) -> String {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(frame, scene)).unwrap();
    let cells = terminal.backend().buffer().content();
    let rows = cells.chunks(usize::from(width)).map(|row| {
        let text: String = row.iter().map(|cell| cell.symbol()).collect();
        text.trim_end().to_owned() + "\n"
    });
    rows.collect()
}

/// Compares a screen with a file. If ROLLWALK_UPDATE_SCREENS is set, the file is rewritten.
fn compare(name: &str, screen: &str) {
    let path = format!("{}/src/cmd/console/screen/{name}.txt", env!("CARGO_MANIFEST_DIR"));
    if env::var_os("ROLLWALK_UPDATE_SCREENS").is_some() {
        fs::write(&path, screen).unwrap();
    }
    let expected = fs::read_to_string(&path).unwrap_or_default();
    assert!(screen == expected, "{name} looks otherwise:\n{screen}\nexpected:\n{expected}");
}

fn names() -> Names {
    let motion = |(name, frames, looping): (&str, u16, bool), code| CatalogMotion {
        name: name.into(),
        code: Some(code),
        frames,
        looping,
    };
    let motions = [
        ("stand", 60, false),
        ("drive_1m", 241, false),
        ("turn_in_place", 144, true),
        ("walk", 96, true),
    ];
    let edges = [(0, 1), (0, 2), (0, 3), (1, 0), (2, 0), (2, 3), (3, 0), (3, 2)];
    let channels: Vec<String> = ["front_left", "front_right", "rear_left", "rear_right"]
        .iter()
        .flat_map(|leg| ["hip", "knee", "ankle_pitch"].map(|joint| format!("{leg}_{joint}")))
        .chain(["left_wheel", "right_wheel"].map(str::to_owned))
        .collect();
    let range = Some(Range { min_rad: -1.0, max_rad: 1.0 });
    let ranges = channels.iter().map(|name| range.filter(|_| !name.contains("wheel"))).collect();
    let catalog = Catalog {
        robot: "agilebot".into(),
        config_hash: 7,
        library: 0x1234_abcd,
        motions: motions.into_iter().zip(1..).map(|(m, code)| motion(m, code)).collect(),
        transitions: edges.map(|(from, to)| Transition { from, to }).to_vec(),
        safe: 0,
        channels: channels.clone(),
        actuators: Actuators::default(),
    };
    let actuators = Actuators::default();
    Names { catalog: Some(catalog), robot: Some("agilebot".into()), channels, ranges, actuators }
}

fn view(state: State, clip: Option<u8>) -> View {
    let status = Status {
        state,
        severity: Severity::None,
        faults: FaultBits::default(),
        clip,
        frame: 40,
        counter: 3,
        library: 0xcd,
    };
    let joint = |channel: u8| JointView {
        telemetry: JointTelemetry {
            channel,
            position_rad: -1.1 + 0.2 * f32::from(channel),
            velocity_rad_s: 0.25 * f32::from(channel),
            torque_nm: -0.1 * f32::from(channel),
            status: ActuatorStatus(if channel == 3 { ActuatorStatus::OVERHEATED } else { 1 }),
        },
        age_us: if channel == 4 { 2_000_000 } else { 80_000 },
        readings: None,
    };
    let say = |at_us, weight, text: &str| {
        let text = text.into();
        Message { number: 1, at_us, weight, text, answers: None }
    };
    View {
        now_us: 65_000_000,
        node: 1,
        link: LinkView {
            contact: true,
            round_trip_us: Some(1_240),
            status_age_us: Some(31_000),
            received: 1300,
            lost: 2,
        },
        bus_lost: None,
        complaint: None,
        hello: None,
        mismatch: None,
        status: Some(status),
        condition: Some(state_name(state).to_owned()),
        faults: Vec::new(),
        advice: "play another motion, pause, or return to SAFE",
        joints: (0..14).map(|channel| (channel, joint(channel))).collect::<BTreeMap<_, _>>(),
        speed_64ths: 48,
        asked: Some((4, 48)),
        asking: None,
        stopping: false,
        deadman_held: Some(true),
        leaving: ExitStage::No,
        transfer: None,
        messages: [
            say(0, Weight::Note, "contact: the robot is disarmed"),
            say(8_200_000, Weight::Note, "armed: the robot moves to SAFE"),
            say(11_900_000, Weight::Note, "the robot is ready"),
            say(
                12_000_000,
                Weight::Refused,
                "the controller refused to play drive_1m: torque is off; arm first",
            ),
            say(64_000_000, Weight::Note, "play walk: begins in 1.2 s"),
        ]
        .into(),
    }
}

fn scene<'a>(view: &'a View, names: &'a Names) -> Scene<'a> {
    Scene { view, bus: "can:can0", names, gamepad: Some("pad: Xbox"), help: false, scroll: 0 }
}

#[test]
fn a_motion_that_plays() {
    let (view, names) = (view(State::Playing, Some(3)), names());
    for (width, height) in [(80, 24), (120, 40)] {
        compare(
            &format!("playing_{width}x{height}"),
            &render(&scene(&view, &names), width, height),
        );
    }
}

#[test]
fn a_fault_on_the_way_to_safe() {
    let names = names();
    let mut view = view(State::Returning, Some(10));
    let faults = FaultBits::default().with(Fault::HostLost);
    view.status = view.status.map(|status| Status { faults, severity: Severity::Return, ..status });
    let fault = |fault, channel, value| FaultView { fault, present: true, channel, value };
    view.faults = vec![
        fault(Fault::HostLost, None, Some(0.31)),
        fault(Fault::TrackingError, Some(2), Some(-0.91)),
    ];
    view.advice = "see why heartbeats did not arrive; clear the fault, then arm";
    view.deadman_held = Some(false);
    view.messages.push_back(Message {
        number: 2,
        at_us: 64_500_000,
        weight: Weight::Warning,
        text: "no contact: no frame arrived for 0.5 s; press the robot's own emergency stop if it moves, or release the deadman: an armed robot then returns to SAFE automatically, or halts if it was following streamed setpoints".into(),
        answers: None,
    });
    for (width, height) in [(80, 24), (120, 40)] {
        let screen = render(&scene(&view, &names), width, height);
        compare(&format!("fault_{width}x{height}"), &screen);
    }
}

#[test]
fn a_bus_that_is_lost_and_the_help() {
    let names = Names::default();
    let mut view = view(State::Paused, None);
    view.bus_lost = Some("can0 is down".into());
    view.link.contact = false;
    let lost = Scene { help: true, ..scene(&view, &names) };
    compare("lost_80x24", &render(&lost, 80, 24));
    let small = render(&lost, 40, 8);
    assert!(small.contains("SPACE: emergency stop"), "{small}");
}

/// Screen without contact: neither the stop nor the absence of faults is certain.
#[test]
fn without_contact_a_stop_and_the_faults_are_not_certain() {
    let names = names();
    let mut view = view(State::Playing, Some(3));
    (view.stopping, view.link.contact) = (true, false);
    let screen = render(&scene(&view, &names), 80, 24);
    assert!(screen.contains("STOP NOT CONFIRMED"), "{screen}");
    assert!(screen.contains("faults are unknown") && !screen.contains("no fault"), "{screen}");
    view.link.contact = true;
    assert!(render(&scene(&view, &names), 80, 24).contains("STOPPING"));
}

#[test]
fn what_is_wrong_with_the_bus_is_in_the_line_of_the_link() {
    let names = names();
    let mut view = view(State::Ready, None);
    view.complaint = Some("can0 is bus-off: look for a wrong bitrate".into());
    let link = |view: &View| {
        let screen = render(&scene(view, &names), 80, 24);
        screen.lines().nth(1).expect("the line of the link").to_owned()
    };
    let with_contact = link(&view);
    assert!(with_contact.contains("BUS: can0 is bus-off"), "{with_contact}");
    view.link.contact = false;
    view.link.status_age_us = None;
    let before = link(&view);
    assert!(before.contains("no answer yet: can0 is bus-off"), "{before}");
    view.link.status_age_us = Some(1_200_000);
    let lost = link(&view);
    assert!(lost.contains("NO CONTACT for 1.2 s: can0 is bus-off"), "{lost}");
}

/// Checks that the screen of a stopped robot names the fault that stopped it.
#[test]
fn what_stopped_a_robot_is_not_mistaken_for_another_cause() {
    let mut names = names();
    names.actuators = of_a_serial_line();
    let head = |faults: FaultBits| {
        let mut view = view(State::EStopped, None);
        let severity = Severity::EStop;
        view.status = view.status.map(|status| Status { faults, severity, ..status });
        let fault = |fault| FaultView { fault, present: true, channel: None, value: Some(0.0) };
        view.faults = faults.iter().map(fault).collect();
        render(&scene(&view, &names), 120, 24).lines().take(6).collect::<Vec<_>>().join("\n")
    };
    let pressed = head(FaultBits::default().with(Fault::EStop));
    assert!(pressed.contains("EMERGENCY STOP") && pressed.contains("torque is off"), "{pressed}");
    assert!(!pressed.contains("has to be"), "{pressed}");
    let lost = head(FaultBits::default().with(Fault::BusOff));
    assert!(lost.contains("STOPPED") && !lost.contains("EMERGENCY"), "{lost}");
    assert!(lost.contains("FAULT: the serial adapter of the servos is gone"), "{lost}");
}

/// The screen shows the limits of the data sheet.
#[test]
fn a_servo_that_is_too_hot_is_named_with_its_limit() {
    let mut names = names();
    names.actuators = of_a_serial_line();
    let screen = render(&scene(&view(State::TorqueOff, None), &names), 120, 24);
    let expected = "WARNING: front_right_hip: hotter than 70 °C, torque is off";
    assert!(screen.contains(expected), "{screen}");
}

/// Readings of servos are shown, and a servo close to a limit is a warning.
#[test]
fn temperatures_and_supply_are_shown() {
    let mut names = names();
    names.actuators = of_a_serial_line();
    let mut view = view(State::Ready, None);
    for (&channel, joint) in &mut view.joints {
        joint.telemetry.status = ActuatorStatus(1);
        let temperature_c = Some(if channel == 2 { 66.0 } else { 41.0 });
        let voltage_v = Some(4.5 + 0.1 * f32::from(channel));
        joint.readings = Some(ActuatorReadings { channel, temperature_c, voltage_v });
    }
    let screen = render(&scene(&view, &names), 160, 40);
    let name = &names.channels[2];
    for expected in [
        &format!("WARNING: {name}: 66 °C; its torque goes off at 70 °C"),
        "supply 4.5 to 5.8 V",
        "age   °C",
        "0.1   41",
        "0.1   66",
    ] {
        assert!(screen.contains(expected), "{expected}: {screen}");
    }
}

fn of_a_serial_line() -> Actuators {
    let bit_rate = 1_000_000;
    let bus = ActuatorBus { kind: BusKind::ServoLine, protocol: "Dynamixel".into(), bit_rate };
    let of = |id| ChannelActuator { bus: 0, id, model: "XL330-M288-T".into() };
    Actuators { buses: vec![bus], channels: (1..15).map(of).collect() }
}

/// Checks that the text alone distinguishes the states, without colours.
#[test]
fn every_state_has_words_of_its_own() {
    let names = names();
    let screens: Vec<_> = State::ALL
        .iter()
        .map(|&state| render(&scene(&view(state, None), &names), 80, 24))
        .collect();
    for (index, screen) in screens.iter().enumerate() {
        assert!(!screens[..index].contains(screen), "{:?}", State::ALL[index]);
    }
}

proptest! {
    #[test]
    fn any_size_and_place_can_be_drawn(
        width in 0u16..200,
        height in 0u16..70,
        clip in any::<Option<u8>>(),
        frame in any::<u16>(),
        scroll in 0usize..100,
        help in any::<bool>(),
        motions in 0usize..33,
        named in any::<bool>(),
        position_rad in any::<f32>(),
    ) {
        let mut names = if named { names() } else { Names::default() };
        if let Some(catalog) = &mut names.catalog {
            let motion = catalog.motions[0].clone();
            catalog.motions.resize(motions, motion);
        }
        let mut view = view(State::Playing, clip);
        view.status = view.status.map(|status| Status { frame, ..status });
        for joint in view.joints.values_mut() {
            joint.telemetry.position_rad = position_rad;
        }
        let scene = Scene { scroll, help, ..scene(&view, &names) };
        if width > 0 && height > 0 {
            render(&scene, width, height);
        }
    }
}
