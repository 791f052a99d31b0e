//! Tests of damaged and forged libraries. They are refused, or played within all limits, and never cause a panic.

use crate::fixture::Fixture;
use crate::reseal::{FOOTER, HEADER, reseal};
use proptest::prelude::*;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{
    ClipCursor, ClipId, EdgeId, Entry, Index, Library, NodeId, validate,
};
use std::sync::OnceLock;

fn golden() -> &'static (Fixture, Vec<u8>) {
    static GOLDEN: OnceLock<(Fixture, Vec<u8>)> = OnceLock::new();
    GOLDEN.get_or_init(|| {
        let fixture = Fixture::with_torques();
        let bytes = fixture.encode();
        (fixture, bytes)
    })
}

/// Reads everything that a player could request from a validated library.
fn assert_playable(bytes: &[u8], index: &Index, config: &RobotConfig) {
    let library = Library::open(bytes, index).expect("the same bytes");
    for clip in (0..library.clip_count()).map(ClipId) {
        let mut cursor = ClipCursor::new(&library, clip, 0).expect("validated");
        let mut pose = [0.0; 24];
        for _ in 0..library.clip(clip).expect("validated").frames {
            cursor.frame_into(&library, &mut pose).expect("validated");
            for (value, c) in pose.iter().zip(&config.channels) {
                assert!(*value >= c.min && *value <= c.max);
            }
            cursor.torques_into(&library, &mut pose).expect("validated");
            for (torque, c) in pose.iter().zip(&config.channels) {
                assert!(torque.abs() <= c.max_torque_nm);
            }
            cursor.advance(&library).expect("validated");
        }
    }
    for node in library.nodes() {
        assert!(library.name(node).is_some());
        assert!(library.code_of(node).is_some());
        let mut at = node;
        for _ in 0..library.node_count() {
            if at != library.safe_node() {
                let hop = library.next_hop(at, library.safe_node()).expect("validated");
                at = library.edge(hop).expect("validated").to;
            }
        }
        assert_eq!(at, library.safe_node(), "SAFE is reached");
    }
    library.safe_pose_into(&mut [0.0; 24]).expect("validated");
    library.safe_torques_into(&mut [0.0; 24]).expect("validated");
}

fn refused_or_playable(bytes: &[u8], config: &RobotConfig) {
    if let Ok(index) = validate(bytes, config) {
        assert_playable(bytes, &index, config);
    }
}

#[test]
fn the_good_one_is_playable() {
    let (fixture, bytes) = golden();
    let index = validate(bytes, &fixture.config).unwrap();
    assert_playable(bytes, &index, &fixture.config);
}

/// Forges every single byte with several values, and corrects the checksums. Miri is a hundred times slower and takes a sample.
#[test]
fn every_forged_byte() {
    let (fixture, bytes) = golden();
    let mut accepted = 0;
    for at in (HEADER..bytes.len() - FOOTER).step_by(if cfg!(miri) { 1999 } else { 1 }) {
        for change in [0x01, 0x80, 0xFF] {
            let mut forged = bytes.clone();
            forged[at] ^= change;
            reseal(&mut forged);
            refused_or_playable(&forged, &fixture.config);
            accepted += u32::from(forged != *bytes && validate(&forged, &fixture.config).is_ok());
        }
    }
    // A library with small changes of frames and names is still valid.
    assert!(accepted > 10 || cfg!(miri), "nothing behind the checksums was reached");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(if cfg!(miri) { 1 } else { 2000 }))]

    #[test]
    fn many_forged_bytes(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let (fixture, bytes) = golden();
        let mut forged = bytes.clone();
        for (at, value) in changes {
            let at = HEADER + at.index(forged.len() - HEADER - FOOTER);
            forged[at] = value;
        }
        reseal(&mut forged);
        refused_or_playable(&forged, &fixture.config);
    }

    #[test]
    fn missing_and_extra_pieces(
        from in any::<prop::sample::Index>(),
        count in 0usize..40,
        insert in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let (fixture, bytes) = golden();
        let mut forged = bytes.clone();
        let from = HEADER + from.index(forged.len() - HEADER - FOOTER);
        let to = (from + count).min(forged.len() - FOOTER);
        forged.splice(from..to, insert);
        reseal(&mut forged);
        refused_or_playable(&forged, &fixture.config);
    }

    #[test]
    fn arbitrary_bytes(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(validate(&bytes, &golden().0.config).is_err());
    }

    /// The bytes are overwritten while a cursor plays from them.
    #[test]
    fn bytes_that_change_during_playback(
        changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..50),
        clip in 0u8..8,
        frame in 0u16..200,
        // Blocks that were valid before may have changed since.
        played in 0..120,
        portions in 0..20,
    ) {
        let (fixture, bytes) = golden();
        let index = validate(bytes, &fixture.config).unwrap();
        let library = Library::open(bytes, &index).unwrap();
        let Ok(mut cursor) = ClipCursor::new(&library, ClipId(clip), frame) else { return Ok(()) };
        let mut entry = Entry::new(&library, ClipId(clip), frame).unwrap();
        for _ in 0..played {
            cursor.advance(&library).unwrap();
        }
        for _ in 0..portions {
            entry.check_a_portion(&library);
        }
        let mut forged = bytes.clone();
        for (at, value) in changes {
            let at = at.index(forged.len() - FOOTER);
            forged[at] = value;
        }
        let library = Library::open(&forged, &index).unwrap();
        for _ in 0..100 {
            let _ = cursor.frame_into(&library, &mut [0.0; 3]);
            let _ = cursor.torques_into(&library, &mut [0.0; 3]);
            let _ = cursor.advance(&library);
        }
        let _ = cursor.seek(&library, frame);
        if let Ok(mut cursor) = ClipCursor::enter(&library, &entry) {
            for _ in 0..100 {
                let _ = cursor.advance(&library);
            }
        }
        entry.check_all(&library);
        for i in 0..=u8::MAX {
            let _ = (library.clip(ClipId(i)), library.edge(EdgeId(i)), library.name(NodeId(i)));
            let _ = (library.node_for_code(i), library.next_hop(NodeId(i), NodeId(1)));
        }
    }
}
