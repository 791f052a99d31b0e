//! Codes of the reasons for which a controller refuses a library. Do not change them: they are on the wire and in
//! `docs/formats/motion-library.md`.

use rollwalk_protocol::config::ConfigError;
use rollwalk_protocol::library::{ClipId, EdgeId, NodeId, RejectReason, Section};

/// Reasons, each with its text on the page.
fn reasons() -> [(RejectReason, &'static str); 33] {
    let (clip, frame, channel) = (ClipId(0), 0, 0);
    let (edge, node, safe, from, to) = (EdgeId(0), NodeId(0), NodeId(0), NodeId(0), NodeId(0));
    let (value, min, max, rate, max_rate) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let (speed, step, max_step, end) = (0.0, 0.0, 0.0, "first frame");
    let bad_config = ConfigError { channel, field: "id", value, must: "" };
    [
        (RejectReason::NotALibrary, "not a library"),
        (RejectReason::Truncated { len: 0, expected: 0 }, "truncated"),
        (RejectReason::TrailingBytes { len: 0, expected: 0 }, "bytes follow"),
        (RejectReason::Corrupted { stored: 0, computed: 0 }, "corrupted"),
        (RejectReason::OtherMajor { found: 0 }, "other major version"),
        (RejectReason::SectionBeyondEnd, "section beyond the end"),
        (RejectReason::BadSection { tag: 0 }, "bad section"),
        (RejectReason::MissingSection { tag: 0 }, "section missing"),
        (RejectReason::BadConfig(bad_config), "bad configuration"),
        (RejectReason::WrongRobot { library: 0, robot: 0 }, "wrong robot"),
        (RejectReason::WrongRate { found: 0 }, "wrong rate"),
        (RejectReason::WrongCount { found: 0, expected: 0 }, "wrong number of records"),
        (
            RejectReason::CountOutOfRange { what: "", found: 0, min: 0, max: 0 },
            "count out of range",
        ),
        (RejectReason::BadRecord { record: 0 }, "record does not decode"),
        (RejectReason::ChannelMismatch { channel }, "channel differs"),
        (RejectReason::ClipLength { clip, frames: 0, min: 0 }, "clip length"),
        (RejectReason::BadClip { clip }, "bad clip record"),
        (RejectReason::BadBlock { clip, frame }, "bad block"),
        (RejectReason::OutOfLimits { clip, frame, channel, value, min, max }, "out of limits"),
        (RejectReason::TooFast { clip, frame, channel, rate, max_rate }, "too fast"),
        (RejectReason::SeamJump { clip, channel, step, max_step }, "seam jumps"),
        (RejectReason::EndsInMotion { clip, channel, speed }, "ends with a turning wheel"),
        (RejectReason::BadEdge { edge }, "transition joins nothing"),
        (RejectReason::ExitBeforeEnd { edge, exit_frame: 0, last: 0 }, "leaves before the end"),
        (
            RejectReason::EndMismatch { edge, end, channel, found: 0.0, expected: 0.0 },
            "ends do not meet",
        ),
        (RejectReason::NoRouteToSafe { node, safe }, "no route to SAFE"),
        (RejectReason::BadRoute { from, to }, "wrong route"),
        (RejectReason::CodeWithoutMotion { code: 0, node: 0, motions: 0 }, "code without motion"),
        (RejectReason::DuplicateCode { code: 0 }, "duplicate code"),
        (RejectReason::MotionWithTwoCodes { node }, "motion with two codes"),
        (RejectReason::NoSafeMotion { found: 0, motions: 0 }, "no safe motion"),
        (RejectReason::SafeNotAtRest { channel }, "safe motion does not rest"),
        (RejectReason::BadName { node }, "bad name"),
    ]
}

#[test]
fn reasons_are_pinned_and_on_the_page() {
    let page = include_str!("../../../docs/formats/motion-library.md");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for (i, (why, words)) in reasons().into_iter().enumerate() {
        assert_eq!(usize::from(why.code()), i + 1, "{why:?}");
        let listed = |end| page.contains(&format!(" {} {words}{end}", i + 1));
        assert!(listed(',') || listed('.'), "docs/formats/motion-library.md has no {words:?}");
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
