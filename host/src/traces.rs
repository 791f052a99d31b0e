//! Commanded and measured motion of a robot's motors over time, from telemetry files and logs of actuator buses. Times are in
//! seconds since the first message.

use crate::chunks::Zstd;
use crate::telemetry::JointStates;
use mcap::McapError;
use mcap::io::MessageReader;
use mcap::sans_io::LinearReaderOptions;
use rollwalk_bus::candump::LogEntry;
use rollwalk_protocol::actuator::{Feedback, JointSetpoint, WheelSetpoint};
use rollwalk_protocol::config::{ChannelKind, RobotConfig};
use rollwalk_protocol::text::Excerpt;
use rollwalk_protocol::wire::FromController;
use std::collections::{BTreeMap, BTreeSet};
use thiserror::Error;

/// Pairs of time, s, and value.
pub type Points = Vec<(f64, f64)>;

/// Traces of a motor and its drive.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motor {
    /// Commanded angle of a joint, rad.
    pub target_rad: Points,
    /// Commanded speed, rad/s.
    pub target_rad_s: Points,
    /// Commanded torque, N·m.
    pub feedforward_nm: Points,
    /// Measured angle, rad.
    pub rad: Points,
    /// Measured speed, rad/s.
    pub rad_s: Points,
}

/// Traces of all motors of a robot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traces {
    /// Motors by channel.
    pub motors: Vec<Motor>,
    /// Time intervals in which all drives are commanded, s.
    pub commanded_s: Vec<[f64; 2]>,
}

/// Reason why a file cannot be used.
#[derive(Debug, Error)]
pub enum TraceError {
    /// Unreadable MCAP file.
    #[error("it is not a readable MCAP file: {0}")]
    Mcap(#[from] McapError),
    /// Chunks with an unsupported compression.
    #[error(
        "its chunks are compressed by `{0}`, but only zstd is supported: run `mcap compress \
         --compression zstd RUN.mcap -o NEW.mcap`"
    )]
    Compression(String),
    /// Compressed chunks that are far larger than the file.
    #[error(
        "its compressed chunks unpack to {unpacked} bytes, but the limit for a file of this size \
         is {most} bytes: record again, or split the recording with `mcap filter`"
    )]
    Unpacked {
        /// Size that the chunks declare, bytes.
        unpacked: u64,
        /// Limit of the size that is read, bytes.
        most: u64,
    },
    /// Message of a topic in another format than that of monitors.
    #[error(
        "a message of {0} is not JSON of foxglove.JointStates, as written by `rollwalk monitor \
         --mcap`"
    )]
    Message(String),
    /// Missing topic.
    #[error("it lacks the topic {0}: {1}")]
    Topic(&'static str, &'static str),
    /// Buses in the log that do not match those of the robot.
    #[error(
        "it has frames of {found} actuator buses, but the robot has {expected}: log all buses by \
         giving several interfaces to `candump -l`"
    )]
    Buses {
        /// Number of interfaces with frames of actuators.
        found: usize,
        /// Number of buses of the robot.
        expected: usize,
    },
    /// Log of the link instead of actuator buses.
    #[error(
        "it is a log of the link, which lacks the commands of the drives: log the actuator buses, \
         or record with `rollwalk monitor --mcap RUN.mcap --library LIB.rwl`"
    )]
    LinkOnly,
    /// Missing motor.
    #[error("it lacks the {what} of {name}")]
    Motor {
        /// Missing quantity.
        what: &'static str,
        /// Name of the motor.
        name: String,
    },
}

/// Limit of the size of a record, bytes. A record is kept in memory as a whole.
const RECORD_MAX: usize = 16 << 20;
/// Limit of the unpacked size of all compressed chunks, bytes: the size of the longest recording without compression.
const UNPACKED_MAX: u64 = 256 << 20;
/// Limit of the ratio of unpacked size to file size, beyond [`RECORD_MAX`]. Telemetry is compressed to a tenth.
const RATIO_MAX: u64 = 32;

const MEASURED: &str = "/joint_states";
const PLANNED: &str = "/planned_joint_states";
/// Longest interval between planned states, s. They arrive with every status.
const PLANNED_GAP_S: f64 = 0.25;
/// Longest interval between set-points of a drive, s.
const SETPOINT_GAP_S: f64 = 0.1;

/// Reads a file of `rollwalk monitor --mcap`. The file may be incomplete, or compressed with zstd by other tools.
///
/// # Errors
/// Returns an error if the file cannot be read or lacks a topic or motor.
pub fn of_mcap(bytes: &[u8], config: &RobotConfig, names: &[String]) -> Result<Traces, TraceError> {
    let most = (RECORD_MAX as u64 + RATIO_MAX * bytes.len() as u64).min(UNPACKED_MAX);
    let unpacked = unpacked_bytes(bytes);
    if unpacked > most {
        return Err(TraceError::Unpacked { unpacked, most });
    }
    // The reader takes at most the declared size out of a chunk.
    let options = LinearReaderOptions::default().with_skip_end_magic(true);
    let options = options.with_record_length_limit(RECORD_MAX);
    let mut messages = MessageReader::new_with_options(bytes, options);
    messages.add_decompressor(Zstd::default())?;
    let mut turns: BTreeMap<&str, Vec<(u64, JointStates)>> = BTreeMap::new();
    let mut cut_off = None;
    for message in messages {
        let message = match message {
            Ok(message) => message,
            Err(error) => {
                cut_off = Some(error);
                break;
            }
        };
        let known = [MEASURED, PLANNED].into_iter().find(|topic| *topic == message.channel.topic);
        let Some(topic) = known else { continue };
        let states = serde_json::from_slice(&message.data);
        let states = states.map_err(|_| TraceError::Message(topic.to_owned()))?;
        turns.entry(topic).or_default().push((message.log_time, states));
    }
    // Data before the end or the damage suffices. Otherwise the damage is the reason of the error.
    if let Some(error) = cut_off.filter(|_| turns.len() < 2) {
        return Err(match error {
            McapError::UnsupportedCompression(name) => {
                TraceError::Compression(Excerpt::start_of(&name).to_string())
            }
            error => error.into(),
        });
    }
    let mut of = |topic, why| turns.remove(topic).ok_or(TraceError::Topic(topic, why));
    let measured =
        of(MEASURED, "record telemetry of a robot with `rollwalk monitor --mcap RUN.mcap`")?;
    let planned = of(
        PLANNED,
        "to record the commands of the drives, use `rollwalk monitor --mcap RUN.mcap --library \
         LIB.rwl`",
    )?;
    let begin_ns = measured[0].0.min(planned[0].0);
    let at_s = |ns: u64| ns.saturating_sub(begin_ns) as f64 * 1e-9;
    let channel = |name: &str| {
        let number = || name.strip_prefix("channel_")?.parse().ok();
        let known = names.iter().position(|known| known == name).or_else(number);
        known.filter(|&channel| channel < names.len())
    };
    let mut motors = vec![Motor::default(); names.len()];
    for pair in measured.windows(2) {
        // The channels have reported one after the other since the previous message.
        let (from_s, to_s) = (at_s(pair[0].0), at_s(pair[1].0));
        let joints = &pair[1].1.joints;
        for (place, joint) in joints.iter().enumerate() {
            let time_s = from_s + (to_s - from_s) * place as f64 / joints.len() as f64;
            let Some(channel) = channel(&joint.name) else { continue };
            motors[channel].rad.extend(joint.position.map(|value| (time_s, value)));
            motors[channel].rad_s.extend(joint.velocity.map(|value| (time_s, value)));
        }
    }
    let mut commanded_s: Vec<[f64; 2]> = Vec::new();
    for (at_ns, states) in &planned {
        let time_s = at_s(*at_ns);
        extend(&mut commanded_s, [time_s; 2], PLANNED_GAP_S);
        for joint in &states.joints {
            let Some(channel) = channel(&joint.name) else { continue };
            motors[channel].target_rad.extend(joint.position.map(|value| (time_s, value)));
            motors[channel].target_rad_s.extend(joint.velocity.map(|value| (time_s, value)));
        }
    }
    for (motor, channel) in motors.iter_mut().zip(&config.channels) {
        if channel.kind == ChannelKind::JointPosition {
            motor.target_rad_s = slopes(&motor.target_rad);
        }
    }
    Traces { motors, commanded_s }.whole(config, names)
}

/// Sum of the unpacked sizes that the compressed chunks of a file declare. Stops where the file is truncated or damaged.
fn unpacked_bytes(bytes: &[u8]) -> u64 {
    /// Length of the opcode and length field before every record, bytes.
    const HEAD: usize = 9;
    let mut rest = bytes.get(mcap::MAGIC.len()..).unwrap_or_default();
    let mut unpacked = 0_u64;
    let number = |bytes: &[u8], at: usize| {
        let bytes = bytes.get(at..)?.first_chunk()?;
        Some(u64::from_le_bytes(*bytes))
    };
    while let (Some(&opcode), Some(length)) = (rest.first(), number(rest, 1)) {
        let record = &rest[HEAD..];
        // Head of a chunk: two times, size, checksum, and the name of the compression, which is empty without compression.
        let is_packed = record.get(28..32).is_some_and(|length| length != [0; 4]);
        if opcode == mcap::records::op::CHUNK && is_packed {
            unpacked = unpacked.saturating_add(number(record, 16).unwrap_or(0));
        }
        let Some(next) = usize::try_from(length).ok().and_then(|length| record.get(length..))
        else {
            break;
        };
        rest = next;
    }
    unpacked
}

/// Reads a log of all actuator buses of a robot with the Rollwalk servo profile.
///
/// If the robot has several buses, the interfaces are assigned in the order of their names. Frames of the link are ignored.
///
/// # Errors
/// Returns an error if the log lacks a bus or a motor.
pub fn of_candump(
    entries: &[LogEntry],
    config: &RobotConfig,
    names: &[String],
) -> Result<Traces, TraceError> {
    let interfaces: BTreeSet<&str> = entries.iter().map(|entry| entry.interface.as_str()).collect();
    let has_feedback = |interface: &&str| {
        let own = entries.iter().filter(|entry| entry.interface == *interface);
        // Frames of the link that have identifiers of feedback are shorter.
        own.filter_map(|entry| Feedback::decode(&entry.frame)).next().is_some()
    };
    let found: Vec<&str> = interfaces.into_iter().filter(has_feedback).collect();
    let buses: BTreeSet<u8> = config.channels.iter().map(|channel| channel.bus).collect();
    if found.len() != buses.len() {
        let is_status = |entry: &LogEntry| {
            matches!(FromController::decode(&entry.frame), Ok((_, FromController::Status(_))))
        };
        let is_link = found.is_empty() && entries.iter().any(is_status);
        let counts = TraceError::Buses { found: found.len(), expected: buses.len() };
        return Err(if is_link { TraceError::LinkOnly } else { counts });
    }
    let of_interface: BTreeMap<&str, u8> = found.into_iter().zip(buses).collect();
    let of_address: BTreeMap<(u8, u8), usize> =
        (0..).zip(&config.channels).map(|(number, of)| ((of.bus, of.id), number)).collect();
    let begin_us = entries.first().map_or(0, |entry| entry.at_us);
    let mut motors = vec![Motor::default(); config.channels.len()];
    let mut setpoints: Vec<Vec<(f64, bool, [f64; 3])>> = vec![Vec::new(); motors.len()];
    for LogEntry { at_us, interface, frame } in entries {
        let Some(&bus) = of_interface.get(interface.as_str()) else { continue };
        let channel = |id: u8| of_address.get(&(bus, id)).copied();
        let time_s = at_us.saturating_sub(begin_us) as f64 * 1e-6;
        if let Some((id, feedback)) = Feedback::decode(frame) {
            let Some(channel) = channel(id) else { continue };
            motors[channel].rad.push((time_s, feedback.position_rad.into()));
            motors[channel].rad_s.push((time_s, feedback.velocity_rad_s.into()));
        } else if let Some((id, of)) = JointSetpoint::decode(frame) {
            let Some(channel) = channel(id) else { continue };
            let all = [of.position_rad, of.velocity_rad_s, of.torque_nm].map(f64::from);
            setpoints[channel].push((time_s, of.kp_nm_rad > 0.0, all));
        } else if let Some((id, of)) = WheelSetpoint::decode(frame) {
            let Some(channel) = channel(id) else { continue };
            let all = [0.0, of.speed_rad_s, of.torque_nm].map(f64::from);
            setpoints[channel].push((time_s, of.kd_nm_s_rad > 0.0, all));
        }
    }
    let mut commanded_s = vec![[0.0, f64::INFINITY]];
    for (motor, setpoints) in motors.iter_mut().zip(&setpoints) {
        let mut own_s = Vec::new();
        for pair in setpoints.windows(2) {
            let ((from_s, is_on, values), (to_s, goes_on, _)) = (pair[0], pair[1]);
            if !is_on || !goes_on || to_s - from_s > SETPOINT_GAP_S {
                continue;
            }
            extend(&mut own_s, [from_s, to_s], 0.0);
            // A command acts until the next one, and is stored at the end of that interval. Interpolation between these ends
            // yields, at the end of a step, the mean command over the step.
            let [angle, speed, torque] = values;
            motor.target_rad.push((to_s, angle));
            motor.target_rad_s.push((to_s, speed));
            motor.feedforward_nm.push((to_s, torque));
        }
        commanded_s = both(&commanded_s, &own_s);
    }
    Traces { motors, commanded_s }.whole(config, names)
}

impl Traces {
    /// Returns the traces if every drive is commanded and at least one motor is measured.
    fn whole(self, config: &RobotConfig, names: &[String]) -> Result<Self, TraceError> {
        let all = self.motors.iter().zip(&config.channels).zip(names);
        for ((motor, channel), name) in all {
            let (target, what) = match channel.kind {
                ChannelKind::JointPosition => (&motor.target_rad, "commanded angle"),
                ChannelKind::WheelSpeed => (&motor.target_rad_s, "commanded speed"),
            };
            if target.is_empty() {
                return Err(TraceError::Motor { what, name: name.clone() });
            }
        }
        if self.motors.iter().all(|motor| motor.rad.is_empty()) {
            let name = names.first().cloned().unwrap_or_default();
            return Err(TraceError::Motor { what: "measured angle", name });
        }
        Ok(self)
    }
}

/// Extends the final interval if the new one begins at most `gap_s` after it; otherwise appends the new one.
fn extend(stretches_s: &mut Vec<[f64; 2]>, [from_s, to_s]: [f64; 2], gap_s: f64) {
    match stretches_s.last_mut() {
        Some(last) if from_s - last[1] <= gap_s => last[1] = to_s,
        _ => stretches_s.push([from_s, to_s]),
    }
}

/// Intersection of two lists of time intervals.
fn both(ones: &[[f64; 2]], others: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let pairs = ones.iter().flat_map(|one| others.iter().map(move |other| (one, other)));
    let common = pairs.map(|(one, other)| [one[0].max(other[0]), one[1].min(other[1])]);
    common.filter(|[from_s, to_s]| from_s < to_s).collect()
}

/// Speeds of planned angles, from differences of neighbouring samples. Differences do not span a pause of the recording.
fn slopes(points: &[(f64, f64)]) -> Points {
    let near = |one: usize, other: usize| points[other].0 - points[one].0 <= PLANNED_GAP_S;
    let slope = |k: usize| {
        let before = if k > 0 && near(k - 1, k) { k - 1 } else { k };
        let after = if k + 1 < points.len() && near(k, k + 1) { k + 1 } else { k };
        let (from, to) = (points[before], points[after]);
        let slope = if after > before { (to.1 - from.1) / (to.0 - from.0) } else { 0.0 };
        (points[k].0, slope)
    };
    (0..points.len()).map(slope).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Catalog;
    use crate::joints::RobotContext;
    use crate::telemetry::Telemetry;
    use mcap::{Compression, MessageStream, WriteOptions};
    use rollwalk_protocol::actuator::ActuatorStatus;
    use rollwalk_protocol::config::Channel;
    use rollwalk_protocol::wire::{JointTelemetry, Node, State, Status};
    use std::io::Cursor;

    fn robot() -> (RobotConfig, Vec<String>) {
        let channel = |kind, bus, id| Channel {
            kind,
            min: -1.0,
            max: 1.0,
            max_rate: 1.0,
            max_torque_nm: 1.0,
            kp_nm_rad: 10.0,
            kd_nm_s_rad: 1.0,
            bus,
            id,
        };
        let (joint, wheel) = (ChannelKind::JointPosition, ChannelKind::WheelSpeed);
        let channels = [channel(joint, 0, 1), channel(joint, 1, 1), channel(wheel, 1, 2)];
        let config = RobotConfig { robot: 1, channels: channels.into_iter().collect() };
        (config, ["hip", "knee", "wheel"].map(str::to_owned).to_vec())
    }

    fn angle(channel: usize, time_s: f64) -> f64 {
        0.3 * (2.0 * time_s + channel as f64).sin()
    }

    fn near(points: &Points, of: impl Fn(f64) -> f64, within: f64) {
        assert!(points.len() > 20);
        for &(time_s, value) in points {
            assert!((value - of(time_s)).abs() < within, "{value} at {time_s} s, {}", of(time_s));
        }
    }

    #[test]
    fn telemetry_has_what_was_planned_and_measured() {
        let (config, names) = robot();
        let catalog = Catalog::of_robot("three", 0, names.clone());
        let node = Node::new(1).unwrap();
        let mut file = Cursor::new(Vec::new());
        let known = RobotContext { catalog: &catalog, library: None };
        let mut telemetry = Telemetry::new(&mut file, node, Some(known)).unwrap();
        for k in 0..600_u64 {
            let (at_us, channel) = (1_700_000_000_000_000 + k * 5000, (k % 3) as usize);
            let position_rad = angle(channel, k as f64 * 0.005) as f32;
            let measured = JointTelemetry {
                channel: channel as u8,
                position_rad,
                velocity_rad_s: 0.0,
                torque_nm: 0.0,
                status: ActuatorStatus(1),
            };
            telemetry.on_frame(at_us, &measured.encode(node)).unwrap();
        }
        telemetry.finish().unwrap();
        let bytes = file.into_inner();
        let error = of_mcap(&bytes, &config, &names).unwrap_err().to_string();
        assert!(error.contains("/planned_joint_states") && error.contains("--library"), "{error}");
        // Planned states as in a library, with a pause.
        let planned = |k: u64| {
            let time_s = k as f64 * 0.05;
            let state = |name: &str, position: Option<f64>, velocity: Option<f64>| serde_json::json!({ "name": name, "position": position, "velocity": velocity });
            let joints = [
                state("hip", Some(angle(0, time_s)), None),
                state("knee", Some(angle(1, time_s)), None),
                state("wheel", None, Some(2.0)),
            ];
            serde_json::json!({ "timestamp": { "sec": 0, "nsec": 0 }, "joints": joints })
        };
        let mut file = Cursor::new(Vec::new());
        // Compressed as by `mcap filter` and similar tools.
        let compressed = WriteOptions::new().compression(Some(Compression::Zstd));
        let mut writer = compressed.create(&mut file).unwrap();
        for message in MessageStream::new(&bytes).unwrap() {
            writer.write(&message.unwrap()).unwrap();
        }
        for k in (0..20).chain(30..60) {
            let schema = writer.add_schema("foxglove.JointStates", "jsonschema", b"{}").unwrap();
            let channel = writer.add_channel(schema, PLANNED, "json", &BTreeMap::new()).unwrap();
            let log_time = (1_700_000_000_000_000 + k * 50_000) * 1000;
            let header = mcap::records::MessageHeader {
                channel_id: channel,
                sequence: 0,
                log_time,
                publish_time: log_time,
            };
            let data = serde_json::to_vec(&planned(k)).unwrap();
            writer.write_to_known_channel(&header, &data).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let mut bytes = file.into_inner();
        let traces = of_mcap(&bytes, &config, &names).unwrap();
        assert_eq!(traces.commanded_s.len(), 2);
        assert!((traces.commanded_s[1][0] - 1.5).abs() < 1e-6);
        for channel in 0..2 {
            let motor = &traces.motors[channel];
            // Accurate to the wire's step of 0.2 mrad: each channel at its own time, not at the time of the last report.
            near(&motor.rad, |time_s| angle(channel, time_s), 1.1e-4);
            near(&motor.target_rad, |time_s| angle(channel, time_s), 1e-9);
            let slope = |time_s: f64| 0.6 * (2.0 * time_s + channel as f64).cos();
            near(&motor.target_rad_s, slope, 0.04);
        }
        near(&traces.motors[2].target_rad_s, |_| 2.0, 1e-9);
        assert!(of_mcap(b"time_s,x", &config, &names).is_err());
        // Half of the file, which ends within a compressed chunk.
        assert!(of_mcap(&bytes[..bytes.len() / 2], &config, &names).is_err());
        while let Some(at) = bytes.windows(4).position(|name| name == b"zstd") {
            bytes[at..at + 4].copy_from_slice(b"lz4f");
        }
        let error = of_mcap(&bytes, &config, &names).unwrap_err().to_string();
        assert!(
            error.contains("`lz4f`, but only zstd") && error.contains("mcap compress"),
            "{error}"
        );
    }

    /// File of one compressed chunk, which declares `declared` bytes and contains `zeros` bytes.
    fn bomb(zeros: u64, declared: u64) -> Vec<u8> {
        let mut file = Cursor::new(Vec::new());
        let options = WriteOptions::new().compression(Some(Compression::Zstd)).chunk_size(None);
        let mut writer = options.create(&mut file).unwrap();
        let schema = writer.add_schema("foxglove.JointStates", "jsonschema", b"{}").unwrap();
        let channel = writer.add_channel(schema, MEASURED, "json", &BTreeMap::new()).unwrap();
        let header = mcap::records::MessageHeader {
            channel_id: channel,
            sequence: 0,
            log_time: 0,
            publish_time: 0,
        };
        for _ in 0..zeros.div_ceil(1 << 20) {
            writer.write_to_known_channel(&header, &vec![b' '; 1 << 20]).unwrap();
        }
        writer.finish().unwrap();
        drop(writer);
        let mut bytes = file.into_inner();
        // The header, then the chunk.
        let header = u64::from_le_bytes(*bytes[9..].first_chunk().unwrap()) as usize;
        let chunk = mcap::MAGIC.len() + 9 + header;
        assert_eq!(bytes[chunk], mcap::records::op::CHUNK);
        if declared != zeros {
            bytes[chunk + 9 + 16..][..8].copy_from_slice(&declared.to_le_bytes());
        }
        bytes
    }

    #[test]
    fn chunks_unpack_to_no_more_than_a_recording_has() {
        let (config, names) = robot();
        let why = |bytes: &[u8]| of_mcap(bytes, &config, &names).unwrap_err().to_string();
        let honest = bomb(64 << 20, 64 << 20);
        assert!(honest.len() < 100_000, "{}", honest.len());
        let error = why(&honest);
        assert!(
            error.contains("unpack to 67") && error.contains("limit for a file of this size is 1"),
            "{error}"
        );
        // The reader stops at the size that a chunk declares.
        let error = why(&bomb(64 << 20, 1000));
        assert!(error.contains("decompress"), "{error}");
        // Many chunks, each with an allowed size.
        let small = bomb(8 << 20, 8 << 20);
        let chunk =
            mcap::MAGIC.len() + 9 + u64::from_le_bytes(*small[9..].first_chunk().unwrap()) as usize;
        let length = 9 + u64::from_le_bytes(*small[chunk + 1..].first_chunk().unwrap()) as usize;
        let mut in_turn = small[..chunk].to_vec();
        for _ in 0..20 {
            in_turn.extend_from_slice(&small[chunk..chunk + length]);
        }
        let error = why(&in_turn);
        assert!(error.contains("unpack to 167"), "{error}");
        // A record without compression has a separate limit.
        let mut long = small[..chunk].to_vec();
        long.push(mcap::records::op::MESSAGE);
        long.extend_from_slice(&(1_u64 << 40).to_le_bytes());
        assert!(why(&long).contains("record"), "{}", why(&long));
    }

    #[test]
    fn logs_of_actuator_buses_have_setpoints_and_feedback() {
        let (config, names) = robot();
        let mut entries = Vec::new();
        let mut add = |at_us: u64, interface: &str, frame| {
            entries.push(LogEntry { at_us: 5_000_000 + at_us, interface: interface.into(), frame });
        };
        for k in 0..100_u64 {
            let (at_us, time_s) = (k * 10_000, k as f64 * 0.01);
            for (interface, id, channel) in [("can1", 1, 0), ("can2", 1, 1)] {
                let position_rad = angle(channel, time_s) as f32;
                // The joint is limp in the middle.
                let kp_nm_rad = if k == 60 && channel == 1 { 0.0 } else { 10.0 };
                let torque_nm = if k > 30 { 0.5 } else { 0.0 };
                let setpoint = JointSetpoint {
                    position_rad,
                    velocity_rad_s: 0.2,
                    kp_nm_rad,
                    kd_nm_s_rad: 1.0,
                    torque_nm,
                };
                add(at_us, interface, setpoint.encode(id).unwrap());
                let feedback = Feedback { position_rad, ..Feedback::default() };
                add(at_us, interface, feedback.encode(id).unwrap());
            }
            let wheel = WheelSetpoint {
                speed_rad_s: 3.0,
                kd_nm_s_rad: 0.5,
                torque_limit_nm: 1.0,
                torque_nm: 0.0,
            };
            add(at_us, "can2", wheel.encode(2).unwrap());
        }
        let traces = of_candump(&entries, &config, &names).unwrap();
        assert_eq!(traces.commanded_s, [[0.0, 0.59], [0.61, 0.99]]);
        for channel in 0..2 {
            let motor = &traces.motors[channel];
            near(&motor.rad, |time_s| angle(channel, time_s), 1.1e-4);
            near(&motor.target_rad, |time_s| angle(channel, time_s - 0.01), 1.1e-4);
            near(&motor.feedforward_nm, |time_s| if time_s > 0.315 { 0.5 } else { 0.0 }, 3e-3);
        }
        near(&traces.motors[2].target_rad_s, |_| 3.0, 1e-4);
        let fails = |entries: &[LogEntry]| of_candump(entries, &config, &names).unwrap_err();
        let one: Vec<LogEntry> =
            entries.iter().filter(|entry| entry.interface == "can1").cloned().collect();
        assert!(matches!(fails(&one), TraceError::Buses { found: 1, expected: 2 }));
        let status = Status {
            state: State::Playing,
            severity: rollwalk_protocol::faults::Severity::None,
            faults: Default::default(),
            clip: Some(0),
            frame: 1,
            counter: 0,
            library: 1,
        };
        let frame = status.encode(Node::new(1).unwrap());
        let link = LogEntry { at_us: 0, interface: "can0".into(), frame };
        assert!(matches!(fails(std::slice::from_ref(&link)), TraceError::LinkOnly));
        let with_link: Vec<LogEntry> = std::iter::once(link).chain(entries.clone()).collect();
        assert_eq!(of_candump(&with_link, &config, &names).unwrap().motors.len(), 3);
    }
}
