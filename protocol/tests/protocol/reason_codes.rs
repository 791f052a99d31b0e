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
        (RejectReason::Truncated { len: 0, expected: 0 }, "the file is truncated"),
        (RejectReason::TrailingBytes { len: 0, expected: 0 }, "data after the end of the file"),
        (RejectReason::Corrupted { stored: 0, computed: 0 }, "a checksum differs"),
        (RejectReason::OtherMajor { found: 0 }, "other major version"),
        (RejectReason::SectionBeyondEnd, "section beyond the end of the file"),
        (
            RejectReason::BadSection { tag: 0 },
            "section out of order, repeated, unknown or of a wrong size",
        ),
        (RejectReason::MissingSection { tag: 0 }, "section missing"),
        (RejectReason::BadConfig(bad_config), "unusable configuration of the reader"),
        (RejectReason::WrongRobot { library: 0, robot: 0 }, "other robot"),
        (RejectReason::WrongRate { found: 0 }, "other sample rate"),
        (RejectReason::WrongCount { found: 0, expected: 0 }, "wrong number or size of records"),
        (
            RejectReason::CountOutOfRange { what: "", found: 0, min: 0, max: 0 },
            "count out of range",
        ),
        (RejectReason::BadRecord { record: 0 }, "record cannot be decoded"),
        (RejectReason::ChannelMismatch { channel }, "channel differs from the robot's"),
        (
            RejectReason::ClipLength { clip, frames: 0, min: 0 },
            "clip with too few or too many frames",
        ),
        (RejectReason::BadClip { clip }, "malformed clip record"),
        (RejectReason::BadBlock { clip, frame }, "damaged block of frames"),
        (
            RejectReason::OutOfLimits { clip, frame, channel, value, min, max },
            "angle, speed or torque out of limits",
        ),
        (
            RejectReason::TooFast { clip, frame, channel, rate, max_rate },
            "change between frames too fast",
        ),
        (RejectReason::SeamJump { clip, channel, step, max_step }, "jump at the seam of a loop"),
        (RejectReason::EndsInMotion { clip, channel, speed }, "clip ends with a turning wheel"),
        (
            RejectReason::BadEdge { edge },
            "transition joins nodes or frames that do not exist, or a motion to itself",
        ),
        (
            RejectReason::ExitBeforeEnd { edge, exit_frame: 0, last: 0 },
            "transition leaves a motion that does not loop before its last frame",
        ),
        (
            RejectReason::EndMismatch { edge, end, channel, found: 0.0, expected: 0.0 },
            "ends of a transition and a motion differ",
        ),
        (RejectReason::NoRouteToSafe { node, safe }, "no route to SAFE"),
        (RejectReason::BadRoute { from, to }, "wrong route"),
        (RejectReason::CodeWithoutMotion { code: 0, node: 0, motions: 0 }, "code without a motion"),
        (RejectReason::DuplicateCode { code: 0 }, "code given twice"),
        (RejectReason::MotionWithTwoCodes { node }, "motion with two codes"),
        (RejectReason::NoSafeMotion { found: 0, motions: 0 }, "no safe motion"),
        (RejectReason::SafeNotAtRest { channel }, "safe motion is not at rest"),
        (RejectReason::BadName { node }, "invalid name"),
    ]
}

#[test]
fn reasons_are_pinned_and_on_the_page() {
    let page = include_str!("../../../docs/formats/motion-library.md");
    let (_, page) = page.split_once("\n## Validation\n").expect("a section on validation");
    for (i, (why, words)) in reasons().into_iter().enumerate() {
        assert_eq!(usize::from(why.code()), i + 1, "{why:?}");
        let row = format!("\n| {} | {words} |\n", i + 1);
        assert_eq!(
            page.matches(&row).count(),
            1,
            "docs/formats/motion-library.md has no row {row:?}"
        );
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
