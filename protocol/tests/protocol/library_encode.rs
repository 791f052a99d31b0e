//! Tests of rounding, limits and errors of the encoder.

use crate::fixture::{Fixture, encode_vec, frames, robot};
use proptest::prelude::*;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{
    ClipCursor, ClipId, EncodeError, Library, LibrarySpec, MAX_MOTIONS, MotionSpec, TransitionSpec,
    encode, validate,
};

fn error(config: &RobotConfig, motions: &[MotionSpec], transitions: &[TransitionSpec]) -> String {
    let spec = LibrarySpec { config, motions, transitions, safe: 0 };
    encode(&spec, &mut vec![0; 1 << 20]).expect_err("must be refused").to_string()
}

fn motion(frames: &[f32], looping: bool) -> MotionSpec<'_> {
    MotionSpec { name: "m", code: 1, looping, frames, torques: &[] }
}

#[track_caller]
fn assert_contains(text: String, sentence: &str) {
    assert!(text.contains(sentence), "{text:?} does not say {sentence:?}");
}

#[test]
fn errors_say_what_is_wrong() {
    let config = robot(1, 1);
    let refuse = |frames: &[f32], looping| error(&config, &[motion(frames, looping)], &[]);
    assert_contains(error(&config, &[], &[]), "motions: 0; expected 1 to 32");
    assert_contains(
        refuse(&[0.0; 3], true),
        "motion 0: 3 values; expected 1 to 3600 frames of 2 channels",
    );
    assert_contains(refuse(&[], true), "motion 0: 0 values; expected");
    assert_contains(refuse(&vec![0.0; 7202], true), "motion 0: 7202 values; expected");
    assert_contains(
        refuse(&[f32::NAN, 0.0], true),
        "motion 0, frame 0, channel 0: NaN is outside the limits",
    );
    assert_contains(
        refuse(&[0.0, 0.0, 0.0, 8.1], true),
        "motion 0, frame 1, channel 1: 8.1 is outside",
    );
    assert_contains(
        refuse(&[0.0, 0.0, 0.5, 0.0], true),
        "the robot would refuse this library: frames",
    );
    assert_contains(
        refuse(&[0.0, 1.5], false),
        "motion 0, frame 0, channel 1: the value at this end is 1.5; expected a value within 1 of 0",
    );
    let two = [motion(&[0.0; 2], true), motion(&[0.0; 2], true)];
    assert_contains(error(&config, &two, &[]), "motions 0 and 1 have the same command code 1");
    let two = [two[0], MotionSpec { code: 2, ..two[1] }];
    assert_contains(error(&config, &two, &[]), "motions 0 and 1 have the same name");
    let two = [two[0], MotionSpec { name: "n", ..two[1] }];
    for name in ["a\0", "a\n", " a", "\u{202e}a"] {
        let unclear = [two[0], MotionSpec { name, ..two[1] }];
        assert_contains(
            error(&config, &unclear, &[]),
            "motion 1: its name has invisible characters",
        );
    }
    assert_contains(error(&config, &two, &[]), "motion 1 has no route to the safe motion 0");
    let long = "x".repeat(33);
    assert_contains(
        error(&config, &[MotionSpec { name: &long, ..two[0] }], &[]),
        "33 bytes; expected 1 to 32",
    );
    assert_contains(
        error(&config, &[MotionSpec { name: "", ..two[0] }], &[]),
        "its name has 0 bytes",
    );
    let back = |from, exit_frame, frames| TransitionSpec {
        from,
        exit_frame,
        to: 0,
        entry_frame: 0,
        frames,
        torques: &[],
    };
    assert_contains(
        error(&config, &two, &[back(1, 1, &[0.0; 4])]),
        "joins motion 1 at frame 1, which does not",
    );
    assert_contains(
        error(&config, &two, &[back(2, 0, &[0.0; 4])]),
        "joins motion 2 at frame 0, which does not",
    );
    assert_contains(
        error(&config, &two, &[back(1, 0, &[0.0; 2])]),
        "transition 0: 2 values; expected 2 to 3600",
    );
    assert_contains(
        error(&config, &two, &[back(1, 0, &[0.0, 0.0, 0.01, 0.0])]),
        "transition 0, frame 1, channel 0: the value at this end is 0.009765625; expected a value within 0.005 of 0",
    );
    let many: Vec<_> = (0..33).map(|i| MotionSpec { code: i, ..two[0] }).collect();
    assert_contains(error(&config, &many, &[]), "motions: 33; expected 1 to 32");
    let spec = LibrarySpec { config: &config, motions: &two[..1], transitions: &[], safe: 1 };
    assert_contains(
        encode(&spec, &mut [0; 999]).unwrap_err().to_string(),
        "number of the safe motion: 1",
    );
    assert_contains(
        error(&robot(0, 0), &two, &[]),
        "configuration is unusable: channel 0: channels is 0",
    );
}

#[test]
fn the_largest_step_is_the_rate_and_one_quantum() {
    // 6 rad/s at 60 Hz are 102.4 quanta of 2^-10 rad; one more is allowed for rounding.
    let config = robot(1, 0);
    let step = |quanta: f32| {
        let frames = [0.0, quanta / 1024.0];
        let spec = LibrarySpec {
            config: &config,
            motions: &[
                motion(&[0.0], true),
                MotionSpec { name: "n", code: 2, ..motion(&frames, false) },
            ],
            transitions: &[
                TransitionSpec {
                    from: 0,
                    exit_frame: 0,
                    to: 1,
                    entry_frame: 0,
                    frames: &[0.0; 2],
                    torques: &[],
                },
                TransitionSpec {
                    from: 1,
                    exit_frame: 1,
                    to: 0,
                    entry_frame: 0,
                    frames: &[quanta / 1024.0, 0.0],
                    torques: &[],
                },
            ],
            safe: 0,
        };
        encode(&spec, &mut [0; 999]).map(|_| ()).map_err(|error| error.to_string())
    };
    assert_eq!(step(103.0), Ok(()));
    assert_contains(
        step(104.0).unwrap_err(),
        "clip 1, frame 1, channel 0: the rate of change is 6.09375",
    );
}

#[test]
fn a_buffer_that_is_too_small_is_no_problem() {
    let f = Fixture::new();
    let (motions, transitions) = (f.motions(), f.transitions());
    let spec =
        LibrarySpec { config: &f.config, motions: &motions, transitions: &transitions, safe: 0 };
    let len = f.encode().len();
    let mut out = vec![0; len];
    for room in 0..len {
        assert_eq!(encode(&spec, &mut out[..room]), Err(EncodeError::Full { room }));
    }
    assert_eq!(encode(&spec, &mut out), Ok(len));
}

#[test]
fn the_largest_library_fits_the_format() {
    let config = robot(24, 0);
    let still = vec![0.25; 24];
    let names: Vec<String> = (0..MAX_MOTIONS).map(|i| format!("motion {i:0>25}")).collect();
    let motions: Vec<_> = (0..MAX_MOTIONS)
        .map(|i| MotionSpec {
            name: &names[i],
            code: 255 - i as u8,
            looping: true,
            frames: &still,
            torques: &[],
        })
        .collect();
    let pair = vec![0.25; 48];
    // Three rings: to the next motion, back, and across.
    let transitions: Vec<_> = (0..96)
        .map(|i| TransitionSpec {
            from: i % 32,
            exit_frame: 0,
            to: (i % 32 + [1, 31, 16][i / 32]) % 32,
            entry_frame: 0,
            frames: &pair,
            torques: &[],
        })
        .collect();
    let spec =
        LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 7 };
    let bytes = encode_vec(&spec);
    let index = validate(&bytes, &config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    // Shortest routes on this graph by breadth-first search.
    for from in library.nodes() {
        let mut distance = [u32::MAX; 32];
        distance[usize::from(from.0)] = 0;
        let mut queue = std::collections::VecDeque::from([usize::from(from.0)]);
        while let Some(at) = queue.pop_front() {
            for t in transitions.iter().filter(|t| t.from == at) {
                if distance[t.to] == u32::MAX {
                    distance[t.to] = distance[at] + 1;
                    queue.push_back(t.to);
                }
            }
        }
        for to in library.nodes().filter(|&to| to != from) {
            let (mut at, mut hops) = (from, 0);
            while at != to {
                at = library.edge(library.next_hop(at, to).unwrap()).unwrap().to;
                hops += 1;
            }
            assert_eq!(hops, distance[usize::from(to.0)], "{from:?} to {to:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Random motions within limits and speeds, with any number of channels and frames, and any limits. Decoded values are
    /// within the limits. They differ from the encoded values by at most half a quantum, or by 1.5 quanta where the limits clip
    /// them.
    #[test]
    fn any_motion_returns_within_its_limits(
        joints in 0u8..5,
        wheels in 0u8..4,
        count in 1usize..200,
        reach in 0.01f32..6.0,
        fast in 1.0f32..60.0,
        seed in any::<u64>(),
    ) {
        prop_assume!(joints + wheels > 0);
        let mut config = robot(joints, wheels);
        for channel in &mut config.channels {
            let wheel = channel.kp_nm_rad == 0.0;
            channel.min = -reach * if wheel { 10.0 } else { 1.0 };
            channel.max = reach * if wheel { 9.0 } else { 0.5 };
            channel.max_rate = fast * if wheel { 30.0 } else { 1.0 };
        }
        let mut state = seed | 1;
        let mut random = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state % 20001) as f32 / 10000.0 - 1.0
        };
        // Forward and back, so that it loops.
        let mut pose: Vec<f32> = vec![0.0; config.channels.len()];
        let mut out = Vec::new();
        for _ in 0..count {
            out.push(pose.clone());
            for (value, c) in pose.iter_mut().zip(&config.channels) {
                *value = (*value + random() * c.max_rate / 60.0).clamp(c.min, c.max);
            }
        }
        let there_and_back: Vec<f32> = out.iter().chain(out.iter().rev()).flatten().copied().collect();
        let motions = [
            MotionSpec { name: "stand", code: 0, looping: true, frames: &out[0], torques: &[] },
            MotionSpec { name: "m", code: 1, looping: true, frames: &there_and_back, torques: &[] },
        ];
        let still = frames(2, |_| out[0].clone());
        let edge = |from, to| TransitionSpec { from, exit_frame: 0, to, entry_frame: 0, frames: &still, torques: &[] };
        let transitions = [edge(0, 1), edge(1, 0)];
        let spec = LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
        let bytes = encode_vec(&spec);
        let index = validate(&bytes, &config).unwrap();
        let library = Library::open(&bytes, &index).unwrap();
        let mut cursor = ClipCursor::new(&library, ClipId(1), 0).unwrap();
        for expected in there_and_back.chunks(config.channels.len()) {
            let mut got = vec![0.0; expected.len()];
            cursor.frame_into(&library, &mut got).unwrap();
            for (i, c) in config.channels.iter().enumerate() {
                let quantum = library.quantum(i).unwrap();
                prop_assert!(got[i] >= c.min && got[i] <= c.max);
                let near_limit = expected[i] < c.min + quantum || expected[i] > c.max - quantum;
                let tolerance = if near_limit { 1.0 } else { 0.5 } * quantum + 1e-6;
                prop_assert!((got[i] - expected[i]).abs() <= tolerance);
            }
            cursor.advance(&library).unwrap();
        }
    }
}
