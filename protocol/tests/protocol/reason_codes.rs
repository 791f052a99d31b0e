//! Codes of the reasons for which a controller refuses a library. Do not change them: they are on the wire and in
//! `docs/formats/motion-library.md`.

use rollwalk_protocol::config::ConfigError;
use rollwalk_protocol::library::{ClipId, EdgeId, NodeId, Section, Why};

/// Reasons, each with its text on the page.
fn reasons() -> [(Why, &'static str); 33] {
    let (clip, frame, channel) = (ClipId(0), 0, 0);
    let (edge, node, safe, from, to) = (EdgeId(0), NodeId(0), NodeId(0), NodeId(0), NodeId(0));
    let (value, min, max, rate, max_rate) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let (speed, step, max_step, end) = (0.0, 0.0, 0.0, "first frame");
    let bad_config = ConfigError { channel, field: "id", value, must: "" };
    [
        (Why::NotALibrary, "not a library"),
        (Why::Truncated { len: 0, expected: 0 }, "truncated"),
        (Why::TrailingBytes { len: 0, expected: 0 }, "bytes follow"),
        (Why::Corrupted { stored: 0, computed: 0 }, "corrupted"),
        (Why::OtherMajor { found: 0 }, "other major version"),
        (Why::SectionBeyondEnd, "section beyond the end"),
        (Why::BadSection { tag: 0 }, "bad section"),
        (Why::MissingSection { tag: 0 }, "section missing"),
        (Why::BadConfig(bad_config), "bad configuration"),
        (Why::WrongRobot { library: 0, robot: 0 }, "wrong robot"),
        (Why::WrongRate { found: 0 }, "wrong rate"),
        (Why::WrongCount { found: 0, expected: 0 }, "wrong number of records"),
        (Why::CountOutOfRange { what: "", found: 0, min: 0, max: 0 }, "count out of range"),
        (Why::BadRecord { record: 0 }, "record does not decode"),
        (Why::ChannelMismatch { channel }, "channel differs"),
        (Why::ClipLength { clip, frames: 0, min: 0 }, "clip length"),
        (Why::BadClip { clip }, "bad clip record"),
        (Why::BadBlock { clip, frame }, "bad block"),
        (Why::OutOfLimits { clip, frame, channel, value, min, max }, "out of limits"),
        (Why::TooFast { clip, frame, channel, rate, max_rate }, "too fast"),
        (Why::SeamJump { clip, channel, step, max_step }, "seam jumps"),
        (Why::EndsInMotion { clip, channel, speed }, "ends with a turning wheel"),
        (Why::BadEdge { edge }, "transition joins nothing"),
        (Why::ExitBeforeEnd { edge, exit_frame: 0, last: 0 }, "leaves before the end"),
        (Why::EndMismatch { edge, end, channel, found: 0.0, expected: 0.0 }, "ends do not meet"),
        (Why::NoRouteToSafe { node, safe }, "no route to SAFE"),
        (Why::BadRoute { from, to }, "wrong route"),
        (Why::CodeWithoutMotion { code: 0, node: 0, motions: 0 }, "code without motion"),
        (Why::DuplicateCode { code: 0 }, "duplicate code"),
        (Why::MotionWithTwoCodes { node }, "motion with two codes"),
        (Why::NoSafeMotion { found: 0, motions: 0 }, "no safe motion"),
        (Why::SafeNotAtRest { channel }, "safe motion does not rest"),
        (Why::BadName { node }, "bad name"),
    ]
}

#[test]
fn reasons_are_pinned_and_on_the_page() {
    let page = include_str!("../../../docs/formats/motion-library.md");
    for (i, (why, words)) in reasons().into_iter().enumerate() {
        assert_eq!(usize::from(why.code()), i + 1, "{why:?}");
        let cell = format!("| {} {words} |", i + 1);
        assert!(page.contains(&cell), "docs/formats/motion-library.md has no {cell:?}");
    }
}

#[test]
fn sections_are_pinned() {
    use Section::*;
    let tagged = [Manifest, Channels, Clips, Frames, Edges, Routes, Codes, SafePose, Names];
    for (i, section) in tagged.into_iter().enumerate() {
        assert_eq!(usize::from(section.code()), i + 1);
    }
    assert_eq!([Header, Table, Footer].map(Section::code), [0, 0, 255]);
}
