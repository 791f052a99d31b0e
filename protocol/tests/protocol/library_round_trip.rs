//! Round-trip tests: a library returns the values that were encoded.

use crate::fixture::{Fixture, TROT_EXIT};
use crate::reseal::{find_section, reseal};
use rollwalk_protocol::library::{
    Advance, Attitude, ClipCursor, ClipId, ClipKind, ClipRef, Edge, EdgeId, EncodeError, Entry,
    Library, LibraryReadError, LibrarySpec, NodeId, RejectReason, encode_with_attitudes, validate,
};

#[test]
fn every_value_returns_within_half_a_milliradian() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    let clips = [&f.stand, &f.trot, &f.drive, &f.to_trot, &f.from_trot, &f.to_drive, &f.from_drive];
    for (i, values) in clips.into_iter().enumerate() {
        let clip = ClipId(i as u8);
        let info = library.clip(clip).unwrap();
        assert_eq!(usize::from(info.frames), values.len() / 3);
        let mut cursor = ClipCursor::new(&library, clip, 0).unwrap();
        for (k, expected) in values.chunks(3).enumerate() {
            assert_eq!(usize::from(cursor.frame()), k);
            let mut out = [f32::NAN; 4];
            cursor.frame_into(&library, &mut out).unwrap();
            for (channel, (got, want)) in out.iter().zip(expected).enumerate() {
                // Ends of transitions are moved to the quanta of the joined motion. Both were rounded from nearly the same
                // number, so the error is up to one quantum instead of half.
                let tolerance = if i >= 3 { 1.0 } else { 0.5 } / 1024.0 + 1e-7;
                assert!((got - want).abs() <= tolerance, "{clip:?} {k} {channel}: {got} {want}");
            }
            assert!(out[3].is_nan(), "wrote beyond the channels");
            let last = k + 1 == usize::from(info.frames);
            assert_eq!(cursor.at_last_frame(), last);
            let step = cursor.advance(&library).unwrap();
            assert_eq!(
                step,
                match (last, info.looping) {
                    (false, _) => Advance::Next,
                    (true, true) => Advance::Wrapped,
                    (true, false) => Advance::AtEnd,
                }
            );
        }
        assert_eq!(cursor.frame(), if info.looping { 0 } else { info.frames - 1 });
    }
}

#[test]
fn seeking_finds_what_playing_finds() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    for i in 0..library.clip_count() {
        let clip = ClipId(i);
        let frames = library.clip(clip).unwrap().frames;
        let mut played = ClipCursor::new(&library, clip, 0).unwrap();
        let mut sought = ClipCursor::new(&library, clip, frames - 1).unwrap();
        for k in 0..frames {
            sought.seek(&library, k).unwrap();
            assert_eq!(sought.frame(), played.frame());
            assert!(sought.quanta().eq(played.quanta()));
            // After a seek to any frame, playback continues from there.
            assert_eq!(sought.advance(&library), played.advance(&library));
            assert!(sought.quanta().eq(played.quanta()));
        }
        assert_eq!(sought.seek(&library, frames), Err(LibraryReadError));
    }
}

#[test]
fn the_graph_returns() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    let [stand, trot, drive] = [NodeId(0), NodeId(1), NodeId(2)];
    assert_eq!((library.node_count(), library.edges().count(), library.clip_count()), (3, 4, 7));
    assert_eq!(library.safe_node(), stand);
    assert_eq!(library.node_for_code(1), Some(stand));
    assert_eq!(library.node_for_code(10), Some(drive));
    assert_eq!(library.node_for_code(20), Some(trot));
    assert_eq!(library.node_for_code(2), None);
    assert_eq!(library.next_hop(trot, drive), Some(EdgeId(1)));
    assert_eq!(library.next_hop(stand, drive), Some(EdgeId(2)));
    assert_eq!(library.next_hop(drive, drive), Some(EdgeId(3)), "the way round");
    assert_eq!(library.next_hop(stand, stand), Some(EdgeId(2)), "the shorter way round");
    assert_eq!(library.next_hop(stand, NodeId(3)), None);
    let edge =
        Edge { clip: ClipId(4), from: trot, exit_frame: TROT_EXIT, to: stand, entry_frame: 0 };
    assert_eq!(library.edge(EdgeId(1)), Some(edge));
    assert_eq!(library.edge(EdgeId(4)), None);
    assert_eq!(library.name(drive), Some("drive"));
    assert_eq!(library.name(NodeId(3)), None);
    assert_eq!(library.clip(ClipId(2)).unwrap().code, Some(10));
    assert_eq!(library.clip(ClipId(3)).unwrap().kind, ClipKind::Transition);
    assert_eq!(library.clip(ClipId(7)), None);
    let mut pose = [f32::NAN; 3];
    library.safe_pose_into(&mut pose).unwrap();
    assert_eq!(pose, [0.5, -1.0, 0.0]);
    assert_eq!(library.safe_pose_into(&mut pose[..2]), None);
}

#[test]
fn joints_of_the_graph_have_no_gap() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    let quanta = |clip, frame| -> Vec<i16> {
        ClipCursor::new(&library, clip, frame).unwrap().quanta().collect()
    };
    for id in library.edges() {
        let edge = library.edge(id).unwrap();
        let last = library.clip(edge.clip).unwrap().frames - 1;
        assert_eq!(quanta(edge.clip, 0), quanta(edge.from.clip(), edge.exit_frame));
        assert_eq!(quanta(edge.clip, last), quanta(edge.to.clip(), edge.entry_frame));
    }
}

#[test]
fn other_bytes_do_not_open() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    assert!(Library::open(&bytes[1..], &index).is_none());
    let mut other = Fixture::new();
    other.trot[30] += 0.01;
    let other = other.encode();
    assert!(Library::open(&other, &index).is_none());
    // A cursor belongs to one library.
    let (clip, other_index) = (ClipId(1), validate(&other, &f.config).unwrap());
    let other = Library::open(&other, &other_index).unwrap();
    let mut cursor = ClipCursor::new(&Library::open(&bytes, &index).unwrap(), clip, 0).unwrap();
    assert_eq!(cursor.advance(&other), Err(LibraryReadError));
    assert_eq!(cursor.seek(&other, 0), Err(LibraryReadError));
    assert_eq!(cursor.frame_into(&other, &mut [0.0; 3]), Err(LibraryReadError));
    // Overwritten in the middle, which opening does not check; the CRC of the block detects it.
    let mut damaged = bytes.clone();
    damaged[300] ^= 4;
    let library = Library::open(&damaged, &index).unwrap();
    let unreadable = (0..library.clip_count()).any(|i| {
        let frames = library.clip(ClipId(i)).map_or(1, |info| info.frames);
        (0..frames).any(|k| ClipCursor::new(&library, ClipId(i), k).is_err())
    });
    assert!(unreadable);
}

#[test]
fn attitudes_come_back_and_a_library_without_says_none() {
    let f = Fixture::new();
    let plain = f.encode();
    let (motions, transitions) = (f.motions(), f.transitions());
    let (motions, transitions) = (&motions[..], &transitions[..]);
    let spec = LibrarySpec { config: &f.config, motions, transitions, safe: 0 };
    let told = |attitudes: &[Attitude]| {
        let mut bytes = vec![0; 1 << 16];
        let len = encode_with_attitudes(&spec, attitudes, &mut bytes)?;
        bytes.truncate(len);
        Ok::<_, EncodeError>(bytes)
    };
    let index = validate(&plain, &f.config).unwrap();
    let clips = Library::open(&plain, &index).unwrap().clip_count();
    assert_eq!(Library::open(&plain, &index).unwrap().attitude(ClipId(0)), None);

    let bowed = Attitude { up_body: [0.6, 0.0, 0.8], spread_rad: 0.25 };
    let mut attitudes = vec![Attitude::LEVEL; usize::from(clips)];
    attitudes[1] = bowed;
    let bytes = told(&attitudes).unwrap();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    assert_eq!(library.attitude(ClipId(0)), Some(Attitude::LEVEL));
    let back = library.attitude(ClipId(1)).unwrap();
    assert!(back.up_body.iter().zip(bowed.up_body).all(|(a, b)| (a - b).abs() < 1e-4));
    assert_eq!(back.spread_rad, bowed.spread_rad);
    assert_eq!(library.attitude(ClipId(clips)), None);

    for bad in [
        Attitude { spread_rad: -0.1, ..Attitude::LEVEL },
        Attitude { spread_rad: f32::NAN, ..Attitude::LEVEL },
        Attitude { spread_rad: 1.1, ..Attitude::LEVEL },
        Attitude { up_body: [0.0, 0.0, -1.0], ..Attitude::LEVEL },
        Attitude { spread_rad: 0.45, ..bowed },
        Attitude { up_body: [0.0, 0.0, 0.9], ..Attitude::LEVEL },
        Attitude { up_body: [f32::NAN; 3], ..Attitude::LEVEL },
    ] {
        attitudes[1] = bad;
        let clip = ClipRef::Motion(1);
        assert_eq!(told(&attitudes), Err(EncodeError::Attitude { clip }), "{bad:?}");
    }
    // A forged limit with valid checksums would switch tilt protection off. A direction of another length is invalid.
    let table = find_section(&bytes, 3).unwrap().start;
    for clip in 0..clips {
        for (at, value) in [
            (17, 3142_u16),
            (15, (-16384_i16) as u16),
            (15, 0),
            (15, 16000),
            (11, 16384),
            (13, 9000),
        ] {
            let mut forged = bytes.clone();
            forged[table + 19 * usize::from(clip) + at..][..2]
                .copy_from_slice(&value.to_le_bytes());
            reseal(&mut forged);
            let reject = validate(&forged, &f.config).unwrap_err();
            let refused =
                matches!(reject.why, RejectReason::BadClip { clip: found } if found.0 == clip);
            assert!(refused, "clip {clip}, byte {at}: {reject}");
        }
    }
    attitudes.truncate(1);
    assert!(matches!(told(&attitudes), Err(EncodeError::Attitude { .. })));
}

#[test]
fn a_place_that_was_checked_ahead_is_that_place() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    for clip in (0..library.clip_count()).map(ClipId) {
        let frames = library.clip(clip).unwrap().frames;
        for frame in 0..frames {
            let plain = ClipCursor::new(&library, clip, frame).unwrap();
            for portions in [0, 1, 2, 100] {
                let mut entry = Entry::new(&library, clip, frame).unwrap();
                assert!(entry.is_at(clip, frame));
                let taken = (0..portions).filter(|_| entry.check_a_portion(&library)).count();
                assert!(portions == 0 || taken > 0);
                let entered = ClipCursor::enter(&library, &entry).unwrap();
                assert_eq!(entered.frame(), frame);
                assert!(entered.quanta().eq(plain.quanta()));
            }
        }
        assert_eq!(Entry::new(&library, clip, frames), Err(LibraryReadError));
    }
    assert_eq!(Entry::new(&library, ClipId(library.clip_count()), 0), Err(LibraryReadError));
    // An entry stays with its library.
    let mut other = Fixture::new();
    other.trot[30] += 0.01;
    let other = other.encode();
    let other_index = validate(&other, &f.config).unwrap();
    let other = Library::open(&other, &other_index).unwrap();
    let mut entry = Entry::new(&library, ClipId(1), 0).unwrap();
    assert!(!entry.check_a_portion(&other));
    assert!(ClipCursor::enter(&other, &entry).is_err());
}

/// Damaged bytes are always detected, with and without checking ahead.
#[test]
fn damage_is_found_however_much_was_checked_ahead() {
    let f = Fixture::new();
    let bytes = f.encode();
    let index = validate(&bytes, &f.config).unwrap();
    let (clip, second_block) = (ClipId(1), 60);
    let frames = Library::open(&bytes, &index).unwrap().clip(clip).unwrap().frames;
    assert!(frames > second_block);
    let (mut found, mut found_in_first) = (0, 0);
    let stride = if cfg!(miri) { 37 } else { 1 };
    for at in (0..bytes.len() - 24).step_by(stride) {
        let mut damaged = bytes.clone();
        damaged[at] ^= 0x10;
        let library = Library::open(&damaged, &index).unwrap();
        for portions in [0, 1, 100] {
            let entered = Entry::new(&library, clip, 0).and_then(|mut entry| {
                (0..portions).for_each(|_| {
                    entry.check_a_portion(&library);
                });
                ClipCursor::enter(&library, &entry)
            });
            assert_eq!(entered.is_ok(), ClipCursor::new(&library, clip, 0).is_ok());
        }
        let Ok(mut cursor) = ClipCursor::new(&library, clip, 0) else {
            // A valid block after it proves nothing about this block.
            let good = Library::open(&bytes, &index).unwrap();
            let mut cursor = ClipCursor::new(&good, clip, 0).unwrap();
            while !cursor.is_checked_ahead() {
                cursor.advance(&good).unwrap();
            }
            // A cursor that knows its clip does not read the damaged tables.
            found_in_first += usize::from(cursor.seek(&library, 1).is_err());
            continue;
        };
        let mut steps = (1..frames).map(|frame| (frame, cursor.advance(&library)));
        if let Some((frame, _)) = steps.find(|(_, step)| step.is_err()) {
            assert_eq!(frame, second_block, "byte {at}");
            found += 1;
        }
    }
    assert!(found > 20 / stride && found_in_first > 20 / stride, "{found}, {found_in_first}");
}
