//! Tests of all reasons to refuse a library, each with its message.

use crate::fixture::{Fixture, robot};
use crate::refusal::{self, expect};
use crate::reseal::{HEADER, find_section, reseal};
use rollwalk_protocol::library::{
    Library, LibrarySpec, MotionSpec, Reject, RejectReason, Section, encode, validate,
};

/// Byte range of the payload of the section with the given tag, which must exist.
fn section(bytes: &[u8], tag: usize) -> std::ops::Range<usize> {
    find_section(bytes, tag).expect("every library has it")
}

fn good() -> (Fixture, Vec<u8>) {
    let fixture = Fixture::new();
    let bytes = fixture.encode();
    (fixture, bytes)
}

fn refusal(change: impl FnOnce(&mut Vec<u8>)) -> Reject {
    refusal::refusal(&Fixture::new(), change)
}

fn patched(tag: usize, at: usize, value: u8) -> Reject {
    refusal::patched(&Fixture::new(), tag, at, value)
}

#[test]
fn resealing_alone_changes_nothing() {
    let (_, bytes) = good();
    let mut copy = bytes.clone();
    reseal(&mut copy);
    assert_eq!(bytes, copy);
}

#[test]
fn corrupted() {
    let (fixture, bytes) = good();
    for at in 0..bytes.len() {
        for bit in 0..8 {
            let mut damaged = bytes.clone();
            damaged[at] ^= 1 << bit;
            let reject = validate(&damaged, &fixture.config).unwrap_err();
            let expected = at < 8 || matches!(reject.why, RejectReason::Corrupted { .. });
            assert!(expected, "byte {at} bit {bit}: {reject}");
        }
    }
    let mut damaged = bytes.clone();
    damaged[100] ^= 1;
    let reject = validate(&damaged, &fixture.config).unwrap_err();
    expect(reject, Section::Footer, "corrupted: the CRC-32C is 0x");
}

#[test]
fn truncated() {
    let (fixture, bytes) = good();
    for len in 0..bytes.len() {
        let reject = validate(&bytes[..len], &fixture.config).unwrap_err();
        expect(reject, Section::Header, "truncated: ");
    }
    let mut longer = bytes.clone();
    longer.push(0);
    expect(validate(&longer, &fixture.config).unwrap_err(), Section::Header, "after the library");
}

#[test]
fn not_a_library() {
    let (fixture, _) = good();
    let reject = validate(&[0x7F; 200], &fixture.config).unwrap_err();
    expect(reject, Section::Header, "not a motion library");
}

#[test]
fn a_footer_that_belongs_to_another_file() {
    for at in [0, 8] {
        let (fixture, mut bytes) = good();
        let footer = bytes.len() - 24;
        bytes[footer + at] ^= 1;
        let crc = rollwalk_protocol::crc::crc32c(&bytes[footer..footer + 20]);
        bytes[footer + 20..].copy_from_slice(&crc.to_le_bytes());
        let reject = validate(&bytes, &fixture.config).unwrap_err();
        expect(reject, Section::Footer, "not a motion library");
    }
}

#[test]
fn future_major_version() {
    let reject = refusal(|bytes| bytes[8] = 2);
    assert_eq!(reject.why, RejectReason::OtherMajor { found: 2 });
    expect(reject, Section::Header, "format version 2, but this reader supports version 1");
}

#[test]
fn future_minor_version_is_read() {
    let (fixture, mut bytes) = good();
    let old = validate(&bytes, &fixture.config).unwrap();
    // A clip table with records that are two bytes longer, and an unknown section.
    let clips = section(&bytes, 3);
    let wider: Vec<u8> =
        bytes[clips.clone()].chunks(11).flat_map(|r| [r, &[0xEE, 0xEE]].concat()).collect();
    let header = clips.start - 8;
    bytes[header + 2] = 13;
    bytes[header + 4..header + 8].copy_from_slice(&(wider.len() as u32).to_le_bytes());
    bytes.splice(clips, wider);
    let end = bytes.len() - 24;
    bytes.splice(end..end, [13, 0, 1, 0, 3, 0, 0, 0, 1, 2, 3]);
    for minor in [1, 2] {
        bytes[10] = minor;
        reseal(&mut bytes);
        let reject = validate(&bytes, &fixture.config).unwrap_err();
        expect(reject, Section::Table, "section 13 is out of order, repeated, unknown");
    }
    bytes[10] = 3;
    reseal(&mut bytes);
    let new = validate(&bytes, &fixture.config).unwrap();
    let before = good().1;
    let (before, after) =
        (Library::open(&before, &old).unwrap(), Library::open(&bytes, &new).unwrap());
    for node in before.nodes() {
        assert_eq!(before.clip(node.clip()), after.clip(node.clip()));
    }
}

/// A table with one record too many or too few is refused.
#[test]
fn tables_have_as_many_records_as_the_manifest_says() {
    let (fixture, bytes) = good();
    for tag in [2, 3, 5, 6, 7, 8] {
        let table = section(&bytes, tag);
        let stride = usize::from(bytes[table.start - 6]);
        let last = bytes[table.end - stride..table.end].to_vec();
        for more in [true, false] {
            let mut changed = bytes.clone();
            let len = if more { table.len() + stride } else { table.len() - stride };
            changed[table.start - 4..table.start].copy_from_slice(&(len as u32).to_le_bytes());
            if more {
                changed.splice(table.end..table.end, last.iter().copied());
            } else {
                changed.drain(table.end - stride..table.end);
            }
            reseal(&mut changed);
            let reject = validate(&changed, &fixture.config).unwrap_err();
            // Channels are read one by one before tables are counted.
            let missing = tag == 2 && !more;
            let expected = if missing {
                matches!(reject.why, RejectReason::BadRecord { record: 2 })
            } else {
                matches!(reject.why, RejectReason::WrongCount { .. })
            };
            assert!(
                expected && usize::from(reject.section.code()) == tag,
                "{tag} {more}: {reject}"
            );
        }
    }
}

/// Tables that are plain arrays have no room for fields of later versions.
#[test]
fn routes_and_safe_pose_never_get_wider() {
    for (tag, len) in [(6, 1), (8, 2)] {
        let reject = refusal(|bytes| {
            bytes[10] = 1;
            let table = section(bytes, tag);
            let wider: Vec<u8> =
                bytes[table.clone()].chunks(len).flat_map(|r| [r, &[0]].concat()).collect();
            let header = table.start - 8;
            bytes[header + 2] += 1;
            bytes[header + 4..header + 8].copy_from_slice(&(wider.len() as u32).to_le_bytes());
            bytes.splice(table, wider);
        });
        assert!(matches!(reject.why, RejectReason::WrongCount { .. }), "{reject}");
        assert_eq!(usize::from(reject.section.code()), tag);
    }
}

#[test]
fn wrong_robot() {
    let (fixture, bytes) = good();
    let mut other = fixture.config.clone();
    other.channels[0].kp_nm_rad += 1.0;
    let reject = validate(&bytes, &other).unwrap_err();
    expect(reject, Section::Manifest, "built for another robot");
    assert_eq!(
        reject.why,
        RejectReason::WrongRobot { library: fixture.config.hash(), robot: other.hash() }
    );
}

#[test]
fn unusable_configuration() {
    let (_, bytes) = good();
    let reject = validate(&bytes, &robot(0, 0)).unwrap_err();
    expect(reject, Section::Manifest, "configuration is unusable");
}

#[test]
fn broken_section_table() {
    expect(refusal(|b| b[HEADER] = 2), Section::Table, "section 2 is out of order, repeated");
    expect(refusal(|b| b[HEADER + 2] = 0), Section::Table, "section 1 is out of order");
    expect(refusal(|b| b[HEADER + 7] = 0xFF), Section::Table, "extends beyond the end");
    let missing = refusal(|bytes| {
        let names = section(bytes, 9);
        bytes.drain(names.start - 8..names.end);
    });
    expect(missing, Section::Table, "section 9 is missing");
}

#[test]
fn broken_manifest() {
    expect(patched(1, 4, 50), Section::Manifest, "the frame rate is 50 Hz; expected 60 Hz");
    expect(patched(1, 6, 4), Section::Manifest, "channels: 4; expected 3 to 3");
    expect(patched(1, 7, 33), Section::Manifest, "motions: 33; expected 1 to 32");
    expect(patched(1, 7, 0), Section::Manifest, "motions: 0; expected 1 to 32");
    expect(patched(1, 8, 97), Section::Manifest, "transitions: 97; expected 0 to 96");
    expect(
        patched(1, 9, 3),
        Section::Manifest,
        "safe motion is number 3, but the library has only 3 motions",
    );
    expect(patched(1, 7, 4), Section::Clips, "7 records, but the manifest requires 8");
}

#[test]
fn channels_that_differ_from_the_robot() {
    for at in 0..8 {
        let sentence = "channel 1: kind, quantum or limits differ";
        expect(patched(2, 8 + at, 0x5A), Section::Channels, sentence);
    }
}

#[test]
fn broken_clip_table() {
    expect(patched(3, 0, 3), Section::Clips, "clip 0: invalid clip record");
    expect(patched(3, 3 * 11, 1), Section::Clips, "clip 3: invalid clip record");
    expect(patched(3, 11 + 3, 9), Section::Clips, "clip 1: invalid clip record");
    expect(patched(3, 11 + 7, 9), Section::Clips, "clip 1: invalid clip record");
    expect(patched(3, 1, 0), Section::Clips, "clip 0: 0 frames; expected 1 to 3600");
    expect(patched(3, 11 + 2, 0x0F), Section::Clips, "clip 1: 3930 frames; expected 1 to 3600");
    expect(patched(3, 3 * 11 + 1, 1), Section::Clips, "clip 3: 1 frames; expected 2 to 3600");
    expect(patched(3, 11 + 1, 91), Section::Frames, "clip 1: frame 60 cannot be decoded");
}

/// Offset of the block with a clip's frame 0.
fn block(bytes: &[u8], clip: usize) -> usize {
    let record = section(bytes, 3).start + clip * 11;
    let offset = u32::from_le_bytes(bytes[record + 3..record + 7].try_into().unwrap());
    section(bytes, 4).start + offset as usize
}

#[test]
fn broken_blocks() {
    for at in [0, 1, 2] {
        let reject = refusal(|bytes| {
            let start = block(bytes, 1);
            bytes[start + at] ^= 1;
        });
        expect(
            reject,
            Section::Frames,
            "clip 1: frame 0 cannot be decoded, because its block is damaged",
        );
    }
    // A block with a wrong checksum in a file with a right checksum.
    let (fixture, mut bytes) = good();
    let start = block(&bytes, 1);
    bytes[start + 6] ^= 1;
    let body = bytes.len() - 24;
    let crc = rollwalk_protocol::crc::crc32c(&bytes[..body]);
    bytes[body + 12..body + 16].copy_from_slice(&crc.to_le_bytes());
    let crc = rollwalk_protocol::crc::crc32c(&bytes[body..body + 20]);
    bytes[body + 20..].copy_from_slice(&crc.to_le_bytes());
    let reject = validate(&bytes, &fixture.config).unwrap_err();
    expect(reject, Section::Frames, "clip 1: frame 0 cannot be decoded");
}

#[test]
fn padding_must_be_zero_and_short() {
    // `to_drive` has 12 bits after its keyframe: 4 bits of padding in its last byte.
    let sentence = "clip 5: frame 1 cannot be decoded";
    let last = |bytes: &[u8]| {
        let start = block(bytes, 5);
        start + 10 + usize::from(bytes[start + 4]) - 1
    };
    let reject = refusal(|bytes| {
        let last = last(bytes);
        bytes[last] |= 0x80;
    });
    expect(reject, Section::Frames, sentence);
    let reject = refusal(|bytes| {
        // One more byte in the block, its clip, the following clips and the section.
        let (start, end, table) = (block(bytes, 5), last(bytes) + 1, section(bytes, 3).start);
        let frames = section(bytes, 4).start;
        bytes[start + 4] += 1;
        bytes[table + 5 * 11 + 7] += 1;
        let after = table + 6 * 11 + 3;
        let offset = u16::from_le_bytes(bytes[after..after + 2].try_into().unwrap()) + 1;
        bytes[after..after + 2].copy_from_slice(&offset.to_le_bytes());
        let len = u16::from_le_bytes(bytes[frames - 4..frames - 2].try_into().unwrap()) + 1;
        bytes[frames - 4..frames - 2].copy_from_slice(&len.to_le_bytes());
        bytes.insert(end, 0);
    });
    expect(reject, Section::Frames, sentence);
}

/// Bytes after the last frame are checked in every block, not only in the last block of a clip.
#[test]
fn no_block_has_more_than_its_frames() {
    // `trot` has two blocks.
    let sentence = "clip 1: frame 59 cannot be decoded";
    for garbage in [0x00, 0xFF] {
        let reject = refusal(|bytes| {
            let (first, table) = (block(bytes, 1), section(bytes, 3).start);
            let frames = section(bytes, 4).start;
            let mut add = |at: usize, width: usize| {
                let mut number = [0; 4];
                number[..width].copy_from_slice(&bytes[at..at + width]);
                let number = (u32::from_le_bytes(number) + 1).to_le_bytes();
                bytes[at..at + width].copy_from_slice(&number[..width]);
            };
            add(first + 4, 2);
            add(table + 11 + 7, 4);
            (2..7).for_each(|clip| add(table + clip * 11 + 3, 4));
            add(frames - 4, 4);
            let end =
                first + 10 + usize::from(u16::from_le_bytes([bytes[first + 4], bytes[first + 5]]));
            bytes.insert(end - 1, garbage);
        });
        expect(reject, Section::Frames, sentence);
    }
}

/// Shifts a value of the keyframe of a clip's block, which shifts all frames of the block.
fn shifted(clip: usize, channel: usize, by: i16) -> Reject {
    refusal(|bytes| {
        let at = block(bytes, clip) + 10 + 2 * channel;
        let value = i16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()) + by;
        bytes[at..at + 2].copy_from_slice(&value.to_le_bytes());
    })
}

#[test]
fn frames_out_of_limits() {
    let reject = shifted(1, 0, 1100);
    expect(reject, Section::Frames, "clip 1, frame 0, channel 0: 1.574");
    expect(reject, Section::Frames, "is outside the limits -1.5 to 1.5");
}

#[test]
fn frames_too_fast() {
    // The first block of `trot` is moved, the second is not: a jump between frames 59 and 60.
    let reject = shifted(1, 0, 200);
    expect(reject, Section::Frames, "clip 1, frame 60, channel 0: the rate of change is ");
    expect(reject, Section::Frames, "above the limit of 6.0");
}

#[test]
fn seam_jumps() {
    // The second block of `trot` drifts by 8 quanta per frame, which alone is not too fast.
    let reject = refusal(|bytes| {
        let first = block(bytes, 1);
        let second = first + 10 + usize::from(bytes[first + 4]);
        let at = second + 10 + 6;
        let delta = i16::from_le_bytes(bytes[at..at + 2].try_into().unwrap()) + 8;
        bytes[at..at + 2].copy_from_slice(&delta.to_le_bytes());
    });
    let RejectReason::SeamJump { channel: 0, step, max_step, .. } = reject.why else {
        panic!("{reject}")
    };
    assert!(step > max_step);
    expect(reject, Section::Frames, "the step from the last to the first frame is");
}

#[test]
fn ends_with_a_turning_wheel() {
    // `trot`, whose wheel rotates, does not loop any more.
    let reject = patched(3, 11, 0);
    expect(reject, Section::Frames, "clip 1 ends, but channel 2, a wheel, turns at");
}

#[test]
fn edges_to_nowhere() {
    let sentence = "transition 1: joins nodes or frames that do not exist";
    expect(patched(5, 6, 3), Section::Edges, sentence);
    expect(patched(5, 7, 3), Section::Edges, sentence);
    expect(patched(5, 7, 1), Section::Edges, sentence);
    expect(patched(5, 8, 90), Section::Edges, sentence);
    expect(patched(5, 10, 1), Section::Edges, sentence);
}

#[test]
fn edges_that_leave_before_the_end() {
    let sentence = "leaves its source at frame 128; expected the last frame, 129";
    expect(patched(5, 20, 128), Section::Edges, sentence);
}

#[test]
fn edges_whose_ends_do_not_meet() {
    let reject = patched(5, 8, 71);
    let sentence = "transition 1, channel 0: the first frame is 0.2";
    expect(reject, Section::Edges, sentence);
    let reject = patched(5, 4, 1);
    expect(reject, Section::Edges, "transition 0, channel 0: the last frame is 0.5");
}

#[test]
fn no_route_to_safe() {
    let reject = patched(6, 2 * 3, 0xFF);
    expect(reject, Section::Routes, "motion 2 has no route to the safe motion 0: add a transition");
}

#[test]
fn wrong_routes() {
    // From trot to drive there is one transition. The others start elsewhere, one with the right end, or do not exist.
    for value in [0xFF, 0, 2, 4] {
        let sentence = "the route from motion 1 to motion 2 is wrong";
        expect(patched(6, 3 + 2, value), Section::Routes, sentence);
    }
    // A route from stand to itself exists, by which stand plays once more.
    let sentence = "the route from motion 0 to motion 0 is wrong";
    expect(patched(6, 0, 0xFF), Section::Routes, sentence);
}

#[test]
fn broken_codes() {
    expect(
        patched(7, 1, 3),
        Section::Codes,
        "command code 1 selects motion 3, but the library has only 3",
    );
    expect(patched(7, 2, 1), Section::Codes, "command code 1 is used twice");
    expect(patched(7, 0, 11), Section::Codes, "command code 10 is used twice, or is out of order");
    expect(patched(7, 3, 0), Section::Codes, "motion 0 has more than one command code");
}

#[test]
fn unsafe_safe_motion() {
    // `trot` as SAFE: every motion reaches it, but it never rests.
    let sentence = "the safe motion must end in the safe pose";
    expect(patched(1, 9, 1), Section::SafePose, sentence);
    expect(patched(8, 2, 0x11), Section::SafePose, sentence);
    expect(patched(8, 4, 1), Section::SafePose, "channel 2: the safe motion must end");
}

/// A loop that only passes through the safe pose, in its last frame, is refused.
#[test]
fn a_safe_loop_holds_still_in_all_frames() {
    let mut fixture = Fixture::new();
    let passing = [fixture.stand[0] + 0.003, fixture.stand[1], 0.0];
    fixture.stand = [&passing[..], &fixture.stand].concat();
    let (motions, transitions) = (fixture.motions(), fixture.transitions());
    let config = &fixture.config;
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let error = encode(&spec, &mut [0; 1 << 15]).unwrap_err().to_string();
    let sentence = "channel 0: the safe motion must end in the safe pose";
    assert!(error.contains(sentence), "{error}");
}

/// A loop that stays in one pose with a turning wheel is refused.
#[test]
fn a_safe_loop_has_no_turning_wheel() {
    let config = &robot(2, 1);
    let roll = MotionSpec {
        name: "roll",
        code: 1,
        looping: true,
        frames: &[0.5, -1.0, 2.0],
        torques: &[],
    };
    let spec = LibrarySpec { config, motions: &[roll], transitions: &[], safe: 0 };
    let error = encode(&spec, &mut [0; 1 << 15]).unwrap_err().to_string();
    let sentence = "channel 2: the safe motion must end in the safe pose";
    assert!(error.contains(sentence), "{error}");
}

/// Appends bytes to a section.
fn appended(tag: usize, bytes: &[u8]) -> Reject {
    refusal(|library| {
        let table = section(library, tag);
        let len = (table.len() + bytes.len()) as u32;
        library[table.start - 4..table.start].copy_from_slice(&len.to_le_bytes());
        library.splice(table.end..table.end, bytes.iter().copied());
    })
}

/// Bytes that belong to no record are refused.
#[test]
fn tables_have_whole_records() {
    for tag in [2, 3, 5, 7, 8] {
        let sentence = format!("section {tag} is out of order, repeated");
        expect(appended(tag, &[0]), Section::Table, &sentence);
    }
}

#[test]
fn nothing_follows_the_last_block() {
    let reject = appended(4, &[0; 7]);
    assert!(matches!(reject.why, RejectReason::WrongCount { .. }), "{reject}");
    assert_eq!(reject.section, Section::Frames);
}

/// Fields that the format page declares as 0, absent or of a fixed size are checked.
#[test]
fn nothing_is_hidden_between_the_fields() {
    expect(refusal(|bytes| bytes[16] = 1), Section::Header, "not a motion library");
    expect(refusal(|bytes| bytes[19] = 0x80), Section::Header, "not a motion library");
    for at in [16, 19] {
        let reject = refusal(|bytes| {
            let footer = bytes.len() - 24;
            bytes[footer + at] = 1;
        });
        expect(reject, Section::Footer, "not a motion library");
    }
    // Records that are wider than in the file's version.
    for (tag, len) in [(1, 10), (2, 8), (3, 11), (5, 6), (7, 2)] {
        let reject = refusal(|bytes| {
            let table = section(bytes, tag);
            let wider: Vec<u8> =
                bytes[table.clone()].chunks(len).flat_map(|r| [r, &[0xEE]].concat()).collect();
            let header = table.start - 8;
            bytes[header + 2] += 1;
            bytes[header + 4..header + 8].copy_from_slice(&(wider.len() as u32).to_le_bytes());
            bytes.splice(table, wider);
        });
        assert_eq!(reject.why, RejectReason::BadSection { tag: tag as u16 }, "{reject}");
    }
    // Two manifests.
    let reject = refusal(|bytes| {
        let table = section(bytes, 1);
        bytes[table.start - 4] *= 2;
        bytes.extend_from_within(table.clone());
        let copy = bytes.split_off(bytes.len() - table.len());
        bytes.splice(table.end..table.end, copy);
    });
    assert_eq!(reject.why, RejectReason::WrongCount { found: 2, expected: 1 }, "{reject}");
    // Strides of sections that are no tables.
    for tag in [4, 9] {
        let reject = refusal(|bytes| {
            let payload = section(bytes, tag);
            let stride = (2..=payload.len()).find(|n| payload.len().is_multiple_of(*n)).unwrap();
            bytes[payload.start - 6..payload.start - 4]
                .copy_from_slice(&(stride as u16).to_le_bytes());
        });
        assert_eq!(reject.why, RejectReason::BadSection { tag: tag as u16 }, "{reject}");
    }
    // Attitudes were added in version 1.1.
    let reject = refusal(|bytes| {
        let table = section(bytes, 3);
        let up = [0, 0, 0, 0, 0, 0x40, 0, 0];
        let wider: Vec<u8> =
            bytes[table.clone()].chunks(11).flat_map(|r| [r, &up].concat()).collect();
        let header = table.start - 8;
        bytes[header + 2] = 19;
        bytes[header + 4..header + 8].copy_from_slice(&(wider.len() as u32).to_le_bytes());
        bytes.splice(table, wider);
        bytes[10] = 0;
    });
    assert_eq!(reject.why, RejectReason::BadSection { tag: 3 }, "{reject}");
}

#[test]
fn names_are_all_that_their_section_has() {
    let sentence = "the name of motion 2 is empty, too long or not valid text";
    expect(appended(9, &[0]), Section::Names, sentence);
    expect(appended(9, b"\x04more"), Section::Names, sentence);
    // A length that uses more bytes than necessary.
    let reject = refusal(|bytes| {
        let names = section(bytes, 9);
        bytes[names.start - 4] += 1;
        bytes[names.start] |= 0x80;
        bytes.insert(names.start + 1, 0);
    });
    expect(reject, Section::Names, "the name of motion 0 is empty, too long or not valid text");
}

/// A longer route that also arrives is refused.
#[test]
fn routes_are_the_shortest_ones() {
    let (fixture, bytes) = good();
    let (routes, edges) = (section(&bytes, 6), section(&bytes, 5));
    let mut refused = 0;
    for cell in 0..routes.len() {
        for edge in 0..edges.len() / 6 {
            let mut changed = bytes.clone();
            if changed[routes.start + cell] == edge as u8 {
                continue;
            }
            changed[routes.start + cell] = edge as u8;
            reseal(&mut changed);
            let reject = validate(&changed, &fixture.config).unwrap_err();
            assert!(matches!(reject.why, RejectReason::BadRoute { .. }), "{reject}");
            refused += 1;
        }
    }
    assert!(refused > 20);
}

/// A first difference is refused if the next frame does not follow it, or if there is no next frame.
#[test]
fn first_differences_lead_to_the_next_frame() {
    let reject = refusal(|bytes| {
        let difference = block(bytes, 1) + 10 + 6;
        bytes[difference] = bytes[difference].wrapping_add(1);
        // A second difference of -1 reverses it. It follows three widths of 4 bits.
        let stream = difference + 6;
        assert!(bytes[stream] & 0x0F > 0 && bytes[stream + 1] & 0x10 == 0);
        bytes[stream + 1] |= 0x10;
    });
    expect(reject, Section::Frames, "clip 1: frame 1 cannot be decoded");
    let reject = refusal(|bytes| {
        let difference = block(bytes, 0) + 10 + 6;
        bytes[difference] = 1;
    });
    expect(reject, Section::Frames, "clip 0: frame 0 cannot be decoded");
}

#[test]
fn broken_names() {
    expect(
        patched(9, 1, 0xFF),
        Section::Names,
        "the name of motion 0 is empty, too long or not valid text",
    );
    expect(
        patched(9, 0, 0),
        Section::Names,
        "the name of motion 0 is empty, too long or not valid text",
    );
    expect(
        patched(9, 6, 100),
        Section::Names,
        "the name of motion 1 is empty, too long or not valid text",
    );
    // One byte longer than allowed.
    let reject = refusal(|bytes| {
        let names = section(bytes, 9);
        let longer = [&[5][..], b"stand", &[33], &[b'x'; 33], &[5], b"drive"].concat();
        let len = (longer.len() as u32).to_le_bytes();
        bytes[names.start - 4..names.start].copy_from_slice(&len);
        bytes.splice(names, longer);
    });
    expect(reject, Section::Names, "the name of motion 1 is empty, too long or not valid text");
}
