//! Tests of the size per second of motion. Lower and upper bounds detect a regression of the packing.

use crate::fixture::{encode_vec, frames, robot};
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{
    ClipId, Library, LibrarySpec, MotionSpec, TransitionSpec, validate,
};
use std::f32::consts::TAU;

/// Gait with three harmonics and a different phase for each channel, looping after 2 s.
fn gait(config: &RobotConfig) -> Vec<f32> {
    frames(120, |k| {
        let phase = |i: usize, harmonic: f32| {
            (TAU * harmonic * k as f32 / 120.0 + 0.7 * i as f32 * harmonic).sin()
        };
        let joint = |i| 0.35 * phase(i, 1.0) + 0.12 * phase(i, 2.0) + 0.04 * phase(i, 3.0);
        let wheel = |i| 4.0 + 1.5 * phase(i, 1.0) + 0.5 * phase(i, 2.0);
        let channels = config.channels.iter().enumerate();
        channels.map(|(i, c)| if c.kp_nm_rad > 0.0 { joint(i) } else { wheel(i) }).collect()
    })
}

/// Torques of a gait. Every joint is loaded for half of the time, with a step from one frame to the next, and swings freely in
/// the other half. Wheels push evenly.
fn torques(config: &RobotConfig, gait: &[f32]) -> Vec<f32> {
    let n = config.channels.len();
    let torque = |(at, value): (usize, &f32)| {
        let (channel, carries) = (at % n, (at / n + 7 * (at % n)) % 60 < 30);
        let limit = config.channels[channel].max_torque_nm;
        if config.channels[channel].kp_nm_rad == 0.0 {
            0.05 * limit * value
        } else {
            limit * (0.2 * value + if carries { 0.3 + 0.4 * value } else { 0.0 })
        }
    };
    gait.iter().enumerate().map(torque).collect()
}

fn bytes_per_second(joints: u8, wheels: u8, with_torques: bool) -> f32 {
    let config = robot(joints, wheels);
    let gait = gait(&config);
    let stand = vec![0.0; config.channels.len()];
    let frame = |k: usize| &gait[k * stand.len()..(k + 1) * stand.len()];
    let into = crate::fixture::blend(60, &stand, frame(0));
    let out = crate::fixture::blend(60, frame(0), &stand);
    let torques = |frames: &[f32]| if with_torques { torques(&config, frames) } else { vec![] };
    let of = [torques(&stand), torques(&gait), torques(&into), torques(&out)];
    let motions = [
        MotionSpec { name: "stand", code: 0, looping: true, frames: &stand, torques: &of[0] },
        MotionSpec { name: "gait", code: 1, looping: true, frames: &gait, torques: &of[1] },
    ];
    let transitions = [
        TransitionSpec { torques: &of[2], ..TransitionSpec::new(0, 0, 1, 0, &into) },
        TransitionSpec { torques: &of[3], ..TransitionSpec::new(1, 0, 0, 0, &out) },
    ];
    let bytes = encode_vec(&LibrarySpec {
        config: &config,
        motions: &motions,
        transitions: &transitions,
        safe: 0,
    });
    let index = validate(&bytes, &config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    library.clip(ClipId(1)).unwrap().bytes as f32 / 2.0
}

#[test]
fn a_second_of_gait() {
    // Measured when the format was fixed. Raw f32 values take 240 per channel.
    for (joints, wheels, measured, with_torques) in
        [(16, 0, 418.5, 1305.5), (16, 4, 565.5, 1536.0), (12, 4, 462.0, 1223.0)]
    {
        for (measured, torques) in [(measured, false), (with_torques, true)] {
            let rate = bytes_per_second(joints, wheels, torques);
            let near = measured * 0.97..measured * 1.03;
            let what = if torques { "with torques" } else { "" };
            assert!(near.contains(&rate), "{joints} joints, {wheels} wheels {what}: {rate} B/s");
        }
    }
}
