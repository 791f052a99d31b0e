//! Generation of robots and motions from bytes, most of them valid, for the encoder.

use std::f32::consts::TAU;

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::library::{EncodeError, LibrarySpec, MotionSpec, TransitionSpec, encode};

/// Maximum size of a library without its samples, bytes.
const OVERHEAD: usize = 4 * 1024;
/// Maximum size of a channel's value and torque in one frame, bytes.
const SAMPLE: usize = 2 * 4;
/// Names of the motions, all different, since the encoder refuses repeated ones. Their number limits the number of motions.
const NAMES: [&str; 5] = ["a", "b", "c", "d", "e"];

fn channel(u: &mut Unstructured<'_>, kind: ChannelKind, id: u8) -> Result<Channel> {
    let wheel = kind == ChannelKind::WheelSpeed;
    let (reach, rate) = if wheel { (60.0, 200.0) } else { (6.4, 30.0) };
    let part = |u: &mut Unstructured<'_>| -> Result<f32> {
        Ok((1.0 + f32::from(u.arbitrary::<u8>()?)) / 256.0)
    };
    Ok(Channel {
        kind,
        min: -reach * part(u)?,
        max: reach * part(u)?,
        max_rate: rate * part(u)?,
        max_torque_nm: 3.0,
        kp_nm_rad: if wheel { 0.0 } else { 20.0 },
        kd_nm_s_rad: 0.5,
        bus: u8::from(wheel),
        id,
    })
}

struct Motion {
    looping: bool,
    code: u8,
    values: Vec<f32>,
}

/// Motion with a wave or a bump on every channel, as large as range and rate allow, or slightly larger.
fn motion(u: &mut Unstructured<'_>, config: &RobotConfig, still: bool) -> Result<Motion> {
    let looping: bool = u.arbitrary()?;
    let frames = usize::from(u.arbitrary::<u8>()?) + 1;
    let mut waves = Vec::new();
    for c in &config.channels {
        let (at, swing) = u.arbitrary::<(u8, u8)>()?;
        let range = 0.5 * (c.max - c.min);
        let fastest = c.max_rate / 60.0 * frames as f32 / TAU;
        // 250 of 256 just fits.
        let size = range.min(fastest) * f32::from(swing) / 250.0;
        let size = if still { 0.0 } else { 0.5 * size };
        let wheel = c.kind == ChannelKind::WheelSpeed;
        let middle = c.min + size + (2.0 * range - 2.0 * size) * f32::from(at) / 255.0;
        // Wheels rest where a motion ends; a bump begins and ends at 0.
        waves.push(if wheel { (0.0, size.min(c.max), true) } else { (middle, size, !looping) });
    }
    let values = (0..frames)
        .flat_map(|k| {
            let last = (frames - 1).max(1) as f32;
            waves.iter().map(move |&(middle, size, bump)| {
                if bump {
                    middle + size * (0.5 - 0.5 * (TAU * k as f32 / last).cos())
                } else {
                    middle + size * (TAU * k as f32 / frames as f32).sin()
                }
            })
        })
        .collect();
    Ok(Motion { looping, code: u.arbitrary()?, values })
}

/// Frames from `from` to `to`, slow enough for the limits.
fn blend(config: &RobotConfig, from: &[f32], to: &[f32]) -> Vec<f32> {
    let ways = from.iter().zip(to).zip(&config.channels);
    let slowest = ways.map(|((a, b), c)| (a - b).abs() / c.max_rate).fold(0.0, f32::max);
    let frames = 2 + (slowest * 60.0 * 1.6).ceil() as usize;
    (0..frames)
        .flat_map(|k| {
            let s = k as f32 / (frames - 1) as f32;
            let s = s * s * (3.0 - 2.0 * s);
            from.iter().zip(to).map(move |(a, b)| a + s * (b - a))
        })
        .collect()
}

/// Robot with its library; `None` for the library if the encoder refuses it.
pub fn encoded(u: &mut Unstructured<'_>) -> Result<(RobotConfig, Option<Vec<u8>>)> {
    let (joints, wheels) = (u.int_in_range(0..=5)?, u.int_in_range(0..=3)?);
    let mut config = RobotConfig { robot: 0, channels: Default::default() };
    for id in 0..joints {
        let joint = channel(u, ChannelKind::JointPosition, id)?;
        config.channels.push(joint).expect("there is room");
    }
    for id in 0..wheels {
        let wheel = channel(u, ChannelKind::WheelSpeed, id)?;
        config.channels.push(wheel).expect("there is room");
    }
    if config.channels.is_empty() {
        return Ok((config, None));
    }
    let mut motions = vec![motion(u, &config, true)?];
    for _ in 1..u.int_in_range(1..=NAMES.len())? {
        motions.push(motion(u, &config, false)?);
    }
    let n = config.channels.len();
    let frame = |i: usize, k: u16| &motions[i].values[usize::from(k) * n..][..n];
    let count = |i: usize| (motions[i].values.len() / n) as u16;
    // To SAFE and back for each motion, and some others.
    let mut pairs: Vec<(usize, usize)> =
        (1..motions.len()).flat_map(|i| [(0, i), (i, 0)]).collect();
    for _ in 0..u.int_in_range(0..=4)? {
        pairs.push((u.choose_index(motions.len())?, u.choose_index(motions.len())?));
    }
    let mut transitions = Vec::new();
    for (from, to) in pairs {
        let last = count(from) - 1;
        let exit = if motions[from].looping { u.int_in_range(0..=last)? } else { last };
        let entry = u.int_in_range(0..=count(to) - 1)?;
        transitions.push((
            from,
            exit,
            to,
            entry,
            blend(&config, frame(from, exit), frame(to, entry)),
        ));
    }
    // Torques are a function of the values, so they join wherever values do.
    let with_torques: bool = u.arbitrary()?;
    let torques = |values: &[f32]| -> Vec<f32> {
        let count = if with_torques { values.len() } else { 0 };
        values.iter().take(count).map(|value| 3.0 * value.sin()).collect()
    };
    let of_motions: Vec<_> = motions.iter().map(|m| torques(&m.values)).collect();
    let of_transitions: Vec<_> = transitions.iter().map(|t| torques(&t.4)).collect();
    // Slow joints with a wide range take minutes from one pose to another.
    let samples = motions.iter().map(|m| m.values.len()).sum::<usize>()
        + transitions.iter().map(|t| t.4.len()).sum::<usize>();
    let motions: Vec<MotionSpec<'_>> = motions
        .iter()
        .zip(&of_motions)
        .zip(NAMES)
        .map(|((m, torques), name)| MotionSpec {
            name,
            code: m.code,
            looping: m.looping,
            frames: &m.values,
            torques,
        })
        .collect();
    let transitions: Vec<TransitionSpec<'_>> = transitions
        .iter()
        .zip(&of_transitions)
        .map(|(&(from, exit_frame, to, entry_frame, ref frames), torques)| TransitionSpec {
            from,
            exit_frame,
            to,
            entry_frame,
            frames,
            torques,
        })
        .collect();
    let spec =
        LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; OVERHEAD + SAMPLE * samples];
    let library = match encode(&spec, &mut bytes) {
        Ok(len) => {
            bytes.truncate(len);
            Some(bytes)
        }
        Err(why) => {
            // Robots are valid, and the buffer is large enough.
            assert!(!matches!(why, EncodeError::Config(_) | EncodeError::Full { .. }), "{why}");
            None
        }
    };
    Ok((config, library))
}

/// Smallest possible library: a single motion of one frame, for the robot of the firmware's tests.
pub fn smallest() -> Vec<u8> {
    let config = crate::robot::config();
    let motions = [MotionSpec {
        name: "s",
        code: 1,
        looping: true,
        frames: &crate::robot::STAND,
        torques: &[],
    }];
    let spec = LibrarySpec { config: &config, motions: &motions, transitions: &[], safe: 0 };
    let mut bytes = vec![0; 1024];
    let len = encode(&spec, &mut bytes).expect("sound");
    bytes.truncate(len);
    bytes
}
