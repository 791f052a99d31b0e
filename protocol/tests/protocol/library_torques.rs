//! Tests of torques in a library: values return, ends of transitions join, and faults are refused.

use crate::fixture::{Fixture, encode_vec, frames, robot};
use crate::refusal::{self, expect};
use crate::reseal::{find_section, reseal};
use proptest::prelude::*;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{
    ClipCursor, ClipId, EncodeError, Library, LibrarySpec, MotionSpec, Reject, Section,
    TORQUE_BLEND_FRAMES, TransitionSpec, encode, validate,
};

/// Torques of a frame, N·m.
fn torques(library: &Library<'_>, clip: ClipId, frame: u16) -> Vec<f32> {
    let mut out = vec![f32::NAN; library.channel_count()];
    ClipCursor::new(library, clip, frame).unwrap().torques_into(library, &mut out).unwrap();
    out
}

#[test]
fn a_library_without_torques_is_written_in_the_version_before_and_reads_as_zero() {
    let f = Fixture::new();
    let bytes = f.encode();
    assert_eq!(bytes[8..12], [1, 0, 1, 0]);
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    assert!(!library.has_torques());
    assert_eq!(torques(&library, ClipId(1), 10), [0.0; 3]);
    let mut safe = [f32::NAN; 3];
    library.safe_torques_into(&mut safe).unwrap();
    assert_eq!(safe, [0.0; 3]);
}

#[test]
fn torques_come_back_in_step_with_the_frames() {
    let f = Fixture::with_torques();
    let bytes = f.encode();
    assert_eq!(bytes[8..12], [1, 0, 2, 0]);
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    assert!(library.has_torques());
    let plain = Fixture::new().encode();
    let plain_index = validate(&plain, &f.config).unwrap();
    let plain = Library::open(&plain, &plain_index).unwrap();
    for clip in (0..library.clip_count()).map(ClipId) {
        let info = library.clip(clip).unwrap();
        assert!(info.bytes > plain.clip(clip).unwrap().bytes);
        let mut cursor = ClipCursor::new(&library, clip, 0).unwrap();
        for k in 0..info.frames {
            let same = ClipCursor::new(&plain, clip, k).unwrap();
            assert!(cursor.quanta().eq(same.quanta()), "values are those without torques");
            let sought = ClipCursor::new(&library, clip, k).unwrap();
            assert!(cursor.torque_quanta().eq(sought.torque_quanta()));
            let given = &f.torques[usize::from(clip.0)][3 * usize::from(k)..][..3];
            let inner = usize::from(k.min(info.frames - 1 - k)) >= TORQUE_BLEND_FRAMES;
            for (channel, (found, given)) in
                torques(&library, clip, k).iter().zip(given).enumerate()
            {
                let quantum = library.torque_quantum(channel).unwrap();
                // Quanta of the fixture's limits, 3 and 1 N·m.
                assert_eq!(quantum, [2f32.powi(-9), 2f32.powi(-9), 2f32.powi(-10)][channel]);
                if clip.0 < 3 || inner {
                    assert!(
                        (found - given).abs() <= 0.5 * quantum,
                        "{clip:?} {k}: {found} {given}"
                    );
                }
            }
            cursor.advance(&library).unwrap();
        }
    }
    let mut safe = [f32::NAN; 3];
    library.safe_torques_into(&mut safe).unwrap();
    assert_eq!(safe.to_vec(), torques(&library, ClipId(0), 0));
}

/// Library of two motions with different torques, joined by transitions of `blend` frames with the torque `off_nm`.
fn seams(config: &RobotConfig, blend: usize, off_nm: f32) -> Result<Vec<u8>, EncodeError> {
    let (stand, still) = ([0.5], frames(blend, |_| vec![0.5]));
    let off = vec![off_nm; blend];
    let motions = [
        MotionSpec { name: "a", code: 0, looping: true, frames: &stand, torques: &[1.0] },
        MotionSpec { name: "b", code: 1, looping: true, frames: &stand, torques: &[-2.0] },
    ];
    let joins =
        |from, to| TransitionSpec { torques: &off, ..TransitionSpec::new(from, 0, to, 0, &still) };
    let transitions = [joins(0, 1), joins(1, 0)];
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut out = vec![0; 1 << 14];
    let len = encode(&spec, &mut out)?;
    out.truncate(len);
    Ok(out)
}

#[test]
fn transitions_are_led_over_to_the_torques_that_they_join() {
    let config = robot(1, 0);
    for blend in [2, 3, 6, 7, 13, 30] {
        let bytes = seams(&config, blend, 0.5).unwrap();
        let index = validate(&bytes, &config).unwrap();
        let library = Library::open(&bytes, &index).unwrap();
        let all: Vec<f32> = (0..blend as u16).map(|k| torques(&library, ClipId(2), k)[0]).collect();
        assert_eq!((all[0], all[blend - 1]), (1.0, -2.0));
        // Each end is blended linearly, and both blends may overlap.
        let frames = TORQUE_BLEND_FRAMES.min(blend - 1) as f32;
        let most = (0.5 + 2.5) / frames + 2.0 * library.torque_quantum(0).unwrap();
        assert!(all.windows(2).all(|pair| (pair[1] - pair[0]).abs() <= most), "{all:?}");
        if blend > 2 * TORQUE_BLEND_FRAMES {
            assert!(
                all[TORQUE_BLEND_FRAMES..blend - TORQUE_BLEND_FRAMES].iter().all(|t| *t == 0.5)
            );
        }
    }
    let error = seams(&config, 10, 1.5).unwrap_err().to_string();
    let sentence = "transition 0, frame 9, channel 0: the torque at this end is 1.5 N·m; expected a torque within 3 N·m of -2 N·m";
    assert!(error.contains(sentence), "{error}");
}

#[test]
fn errors_say_what_is_wrong() {
    let config = robot(1, 1);
    let error = |torques: &[f32], safe_torques: &[f32]| {
        let values = [0.0; 4];
        let stand = MotionSpec {
            name: "a",
            code: 0,
            looping: true,
            frames: &values,
            torques: safe_torques,
        };
        let motions = [stand, MotionSpec { name: "b", code: 1, torques, ..stand }];
        let still = TransitionSpec { torques: &values, ..TransitionSpec::new(0, 0, 1, 0, &values) };
        let transitions = [still, TransitionSpec { from: 1, to: 0, ..still }];
        let spec =
            LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
        encode(&spec, &mut [0; 4096]).map_err(|error| error.to_string())
    };
    let zero = [0.0; 4];
    assert_eq!(
        error(&zero, &[]),
        Err("motion 0: 0 torques; expected one for each of its 4 values".into())
    );
    assert_eq!(
        error(&[], &zero),
        Err("motion 1: 0 torques; expected one for each of its 4 values".into())
    );
    let beyond = "motion 1, frame 1, channel 0: a torque of 3.1 N·m is beyond the limit of 3 N·m";
    assert_eq!(error(&[0.0, 0.0, 3.1, 0.0], &zero), Err(beyond.into()));
    let none = "motion 1, frame 0, channel 1: a torque of NaN N·m is beyond the limit of 1 N·m";
    assert_eq!(error(&[0.0, f32::NAN, 0.0, 0.0], &zero), Err(none.into()));
    // Half a quantum beyond the limit is allowed.
    assert!(error(&[0.0, 0.0, 3.0 + 0.4 / 512.0, -1.0], &zero).is_ok());
}

fn refusal(change: impl FnOnce(&mut Vec<u8>)) -> Reject {
    refusal::refusal(&Fixture::with_torques(), change)
}

fn patched(tag: usize, at: usize, value: u8) -> Reject {
    refusal::patched(&Fixture::with_torques(), tag, at, value)
}

#[test]
fn what_is_wrong_with_torques_is_refused() {
    // Older readers do not know these sections, and a part of them is useless.
    expect(
        refusal(|bytes| bytes[10] = 1),
        Section::Table,
        "section 10 is out of order, repeated, unknown",
    );
    for tag in [10, 11, 12] {
        let reject = refusal(|bytes| {
            let gone = find_section(bytes, tag).unwrap();
            bytes.drain(gone.start - 8..gone.end);
        });
        expect(reject, Section::Table, &format!("section {tag} is missing"));
    }
    expect(
        patched(10, 1, 0xF0),
        Section::TorqueQuanta,
        "channel 1: kind, quantum or limits differ",
    );
    expect(patched(11, 0, 1), Section::TorqueClips, "clip 0: invalid clip record");
    expect(patched(11, 8 + 4, 1), Section::TorqueClips, "clip 1: invalid clip record");
    expect(patched(12, 0, 1), Section::Torques, "clip 0: frame 0 cannot be decoded");
    // Keyframe of the first clip, of one frame, far beyond the limit of 3 N·m.
    let reject = patched(12, 10 + 1, 0x7F);
    expect(reject, Section::Torques, "clip 0, frame 0, channel 0: 63.");
    expect(
        reject,
        Section::Torques,
        "is outside the limits -3 to 3 (rad, rad/s for a wheel, N·m in the torques)",
    );
    // Within the limit, but different from the start of the transitions.
    expect(patched(12, 10, 0), Section::Edges, "transition 0, channel 0: the first torque is ");
    // One byte more than the clips need.
    let longer = refusal(|bytes| {
        let torques = find_section(bytes, 12).unwrap();
        let len = (torques.len() as u32 + 1).to_le_bytes();
        bytes[torques.start - 4..torques.start].copy_from_slice(&len);
        bytes.insert(torques.end, 0);
    });
    expect(longer, Section::Torques, "but the manifest requires");
    // A plain array has a fixed stride.
    let wider = refusal(|bytes| {
        let quanta = find_section(bytes, 10).unwrap();
        bytes[quanta.start - 6] = 3;
    });
    expect(wider, Section::TorqueQuanta, "1 records, but the manifest requires 3");
}

/// A library of a later minor version can be read: known fields are read from its wider records, also those of torques.
#[test]
fn wider_records_of_a_later_version_are_read() {
    let fixture = Fixture::with_torques();
    let mut bytes = fixture.encode();
    let clips = find_section(&bytes, 11).unwrap();
    let wider: Vec<u8> =
        bytes[clips.clone()].chunks(8).flat_map(|r| [r, &[0xEE]].concat()).collect();
    let header = clips.start - 8;
    bytes[header + 2] = 9;
    bytes[header + 4..header + 8].copy_from_slice(&(wider.len() as u32).to_le_bytes());
    bytes.splice(clips, wider);
    bytes[10] = 3;
    reseal(&mut bytes);
    let index = validate(&bytes, &fixture.config).unwrap();
    assert!(Library::open(&bytes, &index).unwrap().has_torques());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Random torques within any limit. Decoded torques are within the limit. They differ from the encoded torques by at most
    /// half a quantum, or by a whole quantum where the limit clips them. The limit is 1024 to 2047 quanta.
    #[test]
    fn any_torques_return_within_their_limits(
        channels in 1u8..6,
        count in 1usize..150,
        limit in prop_oneof![1e-4f32..1.0, 1.0f32..160.0, Just(160.0), Just(2.0), Just(1e-7)],
        parts in proptest::collection::vec(-1.0f32..=1.0, 900),
    ) {
        let mut config = robot(channels, 0);
        config.channels.iter_mut().for_each(|c| c.max_torque_nm = limit);
        let n = usize::from(channels);
        let values = vec![0.0; count * n];
        let torques: Vec<f32> = parts.iter().take(count * n).map(|x| x * limit).collect();
        let motion =
            MotionSpec { name: "m", code: 1, looping: true, frames: &values, torques: &torques };
        let spec = LibrarySpec { config: &config, motions: &[motion], transitions: &[], safe: 0 };
        let bytes = encode_vec(&spec);
        let index = validate(&bytes, &config).unwrap();
        let library = Library::open(&bytes, &index).unwrap();
        let quantum = library.torque_quantum(0).unwrap();
        prop_assert!(limit < 6e-5 || (1024.0..2048.0).contains(&(limit / quantum)), "{limit} {quantum}");
        let mut cursor = ClipCursor::new(&library, ClipId(0), 0).unwrap();
        for given in torques.chunks(n) {
            let mut found = vec![f32::NAN; n];
            cursor.torques_into(&library, &mut found).unwrap();
            for (found, given) in found.iter().zip(given) {
                prop_assert!(found.abs() <= limit);
                let tolerance = if given.abs() > limit - quantum { 1.0 } else { 0.5 } * quantum;
                prop_assert!((found - given).abs() <= 1.000_1 * tolerance, "{found} {given} {quantum}");
            }
            cursor.advance(&library).unwrap();
        }
    }
}
