//! Reads a log of a robot's buses in the format of `candump -L`, and prints messages, state and tracking errors. The picture
//! shows the commanded and the measured angle of a joint. The second argument is a log; by default the example simulates one.
//!
//! `cargo run -p rollwalk-host --example read_log -- log.svg robot.log`

use rollwalk_bus::candump::{self, LogEntry};
use rollwalk_host::decode::{Value, decode};
use rollwalk_host::traces::{self, Motor};
use rollwalk_protocol::actuator::{Feedback, JointSetpoint};
use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::faults::{FaultBits, Severity};
use rollwalk_protocol::wire::{Heartbeat, Node, State, Status};
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;
use svg::Document;
use svg::node::element::{Polyline, Rectangle, Text};

/// Amplitude of the simulated joints, rad. They swing once a second.
pub const SWING_RAD: f64 = 0.4;
/// Lag of the simulated joints behind their set-points, s.
pub const LAG_S: f64 = 0.03;

/// Content of a log.
pub struct Summary {
    /// Messages per second by kind.
    pub rates_hz: BTreeMap<&'static str, f64>,
    /// State in the last status; `None` without one.
    pub state: Option<String>,
    /// Traces of each joint, with its name.
    pub joints: Vec<(String, Motor)>,
}

/// Simulates two seconds of a robot with two joints on `can1`. The link is on `can0`.
pub fn simulated_log() -> String {
    let mut log = Vec::new();
    let mut add = |at_us: u64, interface: &str, frame| {
        log.push(LogEntry { at_us, interface: interface.to_owned(), frame });
    };
    let angle = |time_s: f64, id: u8| (SWING_RAD * (TAU * time_s + f64::from(id)).sin()) as f32;
    let node = Node::new(1).expect("addresses end at 14");
    for k in 0..200 {
        let (at_us, time_s) = (10_000 * u64::from(k), 0.01 * f64::from(k));
        if k % 5 == 0 {
            let heartbeat = Heartbeat { seq: (k / 5) as u8, host_ms: 10 * k };
            add(at_us, "can0", heartbeat.encode(node));
        }
        if k % 10 == 0 {
            let (state, severity, faults) = (State::Playing, Severity::None, FaultBits::default());
            let (clip, frame, counter) = (Some(2), (k * 3 / 5) as u16, (k / 10 % 16) as u8);
            let status = Status { state, severity, faults, clip, frame, counter, library: 7 };
            add(at_us, "can0", status.encode(node));
        }
        for id in [1, 2] {
            let setpoint = JointSetpoint {
                position_rad: angle(time_s, id),
                velocity_rad_s: 0.0,
                kp_nm_rad: 20.0,
                kd_nm_s_rad: 0.5,
                torque_nm: 0.0,
            };
            add(at_us, "can1", setpoint.encode(id).expect("it is within the scales"));
            let position_rad = angle(time_s - LAG_S, id);
            let feedback = Feedback { position_rad, ..Feedback::default() };
            add(at_us + 200, "can1", feedback.encode(id).expect("the address is below 128"));
        }
    }
    log.sort_by_key(|entry| entry.at_us);
    log.iter().map(|entry| format!("{entry}\n")).collect()
}

/// Decodes a log of the link, of actuator buses with the Rollwalk servo profile, or of both.
pub fn summary(log: &str) -> Result<Summary, Box<dyn Error>> {
    let entries: Vec<LogEntry> = candump::parse(log)?;
    let (first, last) = entries.first().zip(entries.last()).ok_or("the log has no frames")?;
    let duration_s = last.at_us.saturating_sub(first.at_us).max(1) as f64 * 1e-6;
    let (mut rates_hz, mut state) = (BTreeMap::new(), None);
    let (mut buses, mut servos) = (BTreeSet::new(), BTreeSet::new());
    for LogEntry { interface, frame, .. } in &entries {
        let kind = if let Ok(decoded) = decode(frame) {
            if let Some(Value::Name(name)) = decoded.signals.get("state") {
                state = Some(name.clone());
            }
            decoded.message
        } else if Feedback::decode(frame).is_some() {
            buses.insert(interface.as_str());
            "feedback"
        } else if let Some((id, _)) = JointSetpoint::decode(frame) {
            servos.insert((interface.as_str(), id));
            "set-point"
        } else {
            "other"
        };
        *rates_hz.entry(kind).or_insert(0.0) += 1.0 / duration_s;
    }
    // A log contains no limits and gains, and traces do not use them.
    let channel = |&(interface, id): &(&str, u8)| Channel {
        kind: ChannelKind::JointPosition,
        min: 0.0,
        max: 0.0,
        max_rate: 0.0,
        max_torque_nm: 0.0,
        kp_nm_rad: 0.0,
        kd_nm_s_rad: 0.0,
        bus: buses.iter().take_while(|bus| **bus != interface).count() as u8,
        id,
    };
    let config =
        RobotConfig { robot: 0, channels: servos.iter().take(MAX_CHANNELS).map(channel).collect() };
    let names: Vec<String> = servos.iter().map(|(bus, id)| format!("{bus}, servo {id}")).collect();
    let motors = match servos.is_empty() {
        true => Vec::new(),
        false => traces::of_candump(&entries, &config, &names)?.motors,
    };
    Ok(Summary { rates_hz, state, joints: names.into_iter().zip(motors).collect() })
}

/// Tracking errors of a joint, rad: root mean square, and peak. Each measured angle is compared with the next set-point.
pub fn errors_rad(motor: &Motor) -> [f64; 2] {
    let errors = motor.rad.iter().filter_map(|(time_s, rad)| {
        let next = motor.target_rad.partition_point(|(until_s, _)| until_s < time_s);
        motor.target_rad.get(next).map(|(_, target_rad)| target_rad - rad)
    });
    let errors: Vec<f64> = errors.collect();
    let squares: f64 = errors.iter().map(|error| error * error).sum();
    [(squares / errors.len().max(1) as f64).sqrt(), errors.iter().fold(0.0, |a, e| e.abs().max(a))]
}

/// Chart of the commanded and the measured angle of a joint over time.
pub fn picture(name: &str, motor: &Motor) -> Document {
    let curves = [("commanded", "#d62728", &motor.target_rad), ("measured", "#1f77b4", &motor.rad)];
    let points = || curves.iter().flat_map(|(_, _, points)| points.iter());
    let end_s = points().map(|(time_s, _)| *time_s).fold(1e-3, f64::max);
    let most_rad = points().map(|(_, rad)| rad.abs()).fold(1e-3, f64::max);
    let background = Rectangle::new().set("width", 700).set("height", 300).set("fill", "white");
    let label = format!("{name}: up to {most_rad:.2} rad in {end_s:.2} s");
    let mut picture = Document::new()
        .set("viewBox", (0, 0, 700, 300))
        .set("font-family", "sans-serif")
        .add(background)
        .add(Text::new(label).set("x", 10).set("y", 20));
    for (k, (name, color, points)) in curves.into_iter().enumerate() {
        let px = |(time_s, rad): &(f64, f64)| {
            format!("{:.1},{:.1}", 10.0 + 680.0 * time_s / end_s, 160.0 - 120.0 * rad / most_rad)
        };
        let points: Vec<String> = points.iter().map(px).collect();
        let curve = Polyline::new().set("points", points.join(" ")).set("fill", "none");
        let label = Text::new(name).set("x", 450 + 110 * k).set("y", 20).set("fill", color);
        picture = picture.add(curve.set("stroke", color)).add(label);
    }
    picture
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args_os().skip(1).map(PathBuf::from);
    let path = args.next().unwrap_or_else(|| std::env::temp_dir().join("log.svg"));
    let log = args.next().map(std::fs::read_to_string).transpose()?;
    let summary = summary(&log.unwrap_or_else(simulated_log))?;
    for (kind, rate_hz) in &summary.rates_hz {
        println!("{kind:16} {rate_hz:6.1} messages/s");
    }
    println!("latest state     {}", summary.state.as_deref().unwrap_or("unknown"));
    for (name, motor) in &summary.joints {
        let [rms_rad, peak_rad] = errors_rad(motor);
        println!("{name}: tracking error {rms_rad:.4} rad RMS, {peak_rad:.4} rad peak");
    }
    if let Some((name, motor)) = summary.joints.first() {
        svg::save(&path, &picture(name, motor))?;
        println!("picture: {}", path.display());
    }
    Ok(())
}
