//! Plays a motion on a controller with two ideal servos, in virtual time: arms, selects a wave, disarms. Prints states and peak
//! speeds. The picture shows the set-points of the joints over time.
//!
//! `cargo run -p rollwalk-firmware --example play -- play.svg`

use rollwalk_firmware::store::RamStore;
use rollwalk_firmware::{Controller, Settings};
use rollwalk_protocol::actuator::{ActuatorStatus, Control, Feedback, JointSetpoint};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::library::{EncodeError, LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_protocol::wire::{Action, Command, FromController, Heartbeat, Node, State};
use std::error::Error;
use std::f32::consts::TAU;
use std::path::PathBuf;
use svg::Document;
use svg::node::element::{Line, Polyline, Rectangle, Text};

/// Angles of the joints in SAFE, and when the controller starts, rad.
pub const STAND_RAD: [f32; 2] = [0.4, -0.6];
const START_RAD: [f32; 2] = [0.0, 0.0];
/// Height of the wave, rad, and its duration, s.
pub const WAVE_RAD: f32 = 0.8;
pub const WAVE_S: f32 = 2.0;
const WAVE_CODE: u8 = 2;
/// Commands of the operator with their times, s, last first.
const COMMANDS: [(f64, Action); 3] = [
    (5.0, Action::Disarm),
    (2.0, Action::Play { code: WAVE_CODE, speed_64ths: 64 }),
    (0.2, Action::ArmRequest),
];
const END_S: f64 = 7.0;

/// Course of the run.
#[derive(Default)]
pub struct Run {
    /// State changes with their times, s.
    pub states: Vec<(f64, State)>,
    /// Set-points of each joint: times, s, and angles, rad.
    pub setpoints: [Vec<(f64, f64)>; 2],
    /// Peak speed of the set-points of each joint, rad/s.
    pub peaks_rad_s: [f64; 2],
}

/// Follows a frame of the bus like a servo that reaches each set-point at once. `servo` is its latest measurement.
fn follow(servo: &mut Feedback, frame: &Frame) {
    if let Some((_, setpoint)) = JointSetpoint::decode(frame) {
        servo.position_rad = setpoint.position_rad;
    }
    match Control::decode(frame) {
        Some((_, Control::Enable)) => servo.status = ActuatorStatus(ActuatorStatus::ENABLED),
        Some((_, Control::Disable)) => servo.status = ActuatorStatus(0),
        _ => {}
    }
    servo.counter = servo.counter.wrapping_add(1);
}

fn config() -> RobotConfig {
    let joint = |id| Channel {
        kind: ChannelKind::JointPosition,
        min: -1.5,
        max: 1.5,
        max_rate: 8.0,
        max_torque_nm: 3.0,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        bus: 0,
        id,
    };
    RobotConfig { robot: 0, channels: [joint(0), joint(1)].into_iter().collect() }
}

/// Library of SAFE, the wave, and a transition from each to the other. Frames are 1/60 s apart.
fn library(config: &RobotConfig) -> Result<Vec<u8>, EncodeError> {
    let frames = (60.0 * WAVE_S) as u16;
    let bump = |i: u16| 0.5 * WAVE_RAD * (1.0 - (TAU * f32::from(i) / f32::from(frames)).cos());
    let wave = (0..=frames).flat_map(|i| [STAND_RAD[0] + bump(i), STAND_RAD[1] + 0.5 * bump(i)]);
    let (wave, still): (Vec<f32>, _) = (wave.collect(), STAND_RAD.repeat(2));
    let motion =
        |name, code, looping, frames| MotionSpec { name, code, looping, frames, torques: &[] };
    let motions = [motion("stand", 1, true, &still), motion("wave", WAVE_CODE, false, &wave)];
    let transitions =
        [TransitionSpec::new(0, 1, 1, 0, &still), TransitionSpec::new(1, frames, 0, 0, &still)];
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 4096];
    let length = encode(&spec, &mut bytes)?;
    bytes.truncate(length);
    Ok(bytes)
}

/// Runs controller, servos and operator.
pub fn run() -> Result<Run, Box<dyn Error>> {
    let (config, settings) = (config(), Settings::default());
    let store = RamStore::<4096>::holding(&library(&config)?);
    let store = store.map_err(|error| format!("the library is not stored: {error:?}"))?;
    let mut controller = Controller::new(config, store, settings);
    let node = Node::new(settings.node).ok_or("the node is above 14")?;
    let mut servos = START_RAD.map(|position_rad| Feedback { position_rad, ..Feedback::default() });
    let (mut run, mut commands, mut seq) = (Run::default(), COMMANDS.to_vec(), 0);
    for tick in 0..END_S as u64 * u64::from(settings.control_hz) {
        let now_us = tick * 1_000_000 / u64::from(settings.control_hz);
        let (now_s, now_ms) = (now_us as f64 * 1e-6, now_us / 1000);
        // Link: a heartbeat every 50 ms, and commands.
        if tick % 6 == 0 {
            let heartbeat = Heartbeat { seq: (tick / 6) as u8, host_ms: now_ms as u32 };
            controller.on_link_frame(now_us, &heartbeat.encode(node));
        }
        if let Some((_, action)) = commands.pop_if(|(at_s, _)| *at_s <= now_s) {
            seq = (seq + 1) % 16;
            let command = Command { seq, action, valid_until_ms: (now_ms + 500) as u16 };
            controller.on_link_frame(now_us, &command.encode(node));
        }
        controller.tick(now_us);
        while let Some(frame) = controller.poll_link(now_us) {
            // Torque needs a second command with the nonce from the answer to the first.
            if let Ok((_, FromController::CommandAck(ack))) = FromController::decode(&frame)
                && ack.kind == Action::ArmRequest.kind()
            {
                commands.push((now_s, Action::ArmConfirm { nonce: ack.value }));
            }
        }
        // Bus: every servo answers every frame.
        while let Some(frame) = controller.poll_actuator(0) {
            let id = frame.standard_id().unwrap_or(0) as u8 & 1;
            let servo = &mut servos[usize::from(id)];
            follow(servo, &frame);
            let answer = servo.encode(id).ok_or("the identifier is above 127")?;
            controller.on_actuator_frame(now_us, 0, &answer);
        }
        if run.states.last().is_none_or(|(_, state)| *state != controller.state()) {
            run.states.push((now_s, controller.state()));
        }
        for joint in 0..2 {
            let Some(target) = controller.setpoint(joint) else { continue };
            run.setpoints[joint].push((now_s, target.value.into()));
            run.peaks_rad_s[joint] = run.peaks_rad_s[joint].max(target.slope.abs().into());
        }
    }
    Ok(run)
}

/// Chart of the set-points over time, with the state changes. 100 px are a second, and a radian.
pub fn picture(run: &Run) -> Document {
    let background = Rectangle::new().set("y", -140).set("width", 800).set("height", 300);
    let mut picture = Document::new()
        .set("viewBox", (0, -140, 800, 300))
        .set("font-family", "sans-serif")
        .set("font-size", 12)
        .add(background.set("fill", "white"));
    for (k, (time_s, state)) in run.states.iter().enumerate() {
        let (x, label) = (100.0 * time_s, format!("{state:?} {time_s:.2} s"));
        let line = Line::new().set("x1", x).set("x2", x).set("y1", -120).set("y2", 150);
        let label = Text::new(label).set("x", x + 3.0).set("y", 110 + 14 * (k % 3));
        picture = picture.add(line.set("stroke", "#ccc")).add(label);
    }
    for (joint, color) in ["#1f77b4", "#d62728"].into_iter().enumerate() {
        let px = |(time_s, rad): &(f64, f64)| format!("{:.1},{:.1}", 100.0 * time_s, -100.0 * rad);
        let points: Vec<String> = run.setpoints[joint].iter().map(px).collect();
        let curve = Polyline::new().set("points", points.join(" ")).set("fill", "none");
        let angles = run.setpoints[joint].iter().map(|(_, rad)| *rad);
        let [low, high] = [angles.clone().fold(0.0, f64::min), angles.fold(0.0, f64::max)];
        let label = format!("joint {joint}: {low:.2} to {high:.2} rad");
        let label = Text::new(label).set("x", 10 + 200 * joint).set("y", -125);
        picture = picture.add(curve.set("stroke", color)).add(label.set("fill", color));
    }
    picture
}

fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args_os().nth(1).map(PathBuf::from);
    let path = path.unwrap_or_else(|| std::env::temp_dir().join("play.svg"));
    let run = run()?;
    for (time_s, state) in &run.states {
        println!("{time_s:5.2} s  {state:?}");
    }
    for (joint, peak_rad_s) in run.peaks_rad_s.iter().enumerate() {
        println!("joint {joint}: peak speed {peak_rad_s:.3} rad/s");
    }
    svg::save(&path, &picture(&run))?;
    println!("picture: {}", path.display());
    Ok(())
}
