//! Order of frames along the motion graph, and the curve through them.

use proptest::prelude::*;
use rollwalk_firmware::graph_cursor::{GoalError, GraphCursor};
use rollwalk_firmware::player::Player;
use rollwalk_protocol::library::{ClipCursor, ClipId, Index, Library, NodeId, validate};

use crate::robot::*;

struct LoadedLibrary {
    bytes: Vec<u8>,
    index: Index,
}

impl LoadedLibrary {
    fn new() -> Self {
        Self::from(library())
    }

    fn from(bytes: Vec<u8>) -> Self {
        let index = validate(&bytes, &config()).expect("the test library is valid");
        Self { bytes, index }
    }

    fn open(&self) -> Library<'_> {
        Library::open(&self.bytes, &self.index).unwrap()
    }

    fn frame(&self, clip: u8, frame: u16) -> [f32; CHANNELS] {
        let mut out = [0.0; CHANNELS];
        let library = self.open();
        let cursor = ClipCursor::new(&library, ClipId(clip), frame).unwrap();
        cursor.frame_into(&library, &mut out).unwrap();
        out
    }
}

fn node(lib: &Library<'_>, code: u8) -> NodeId {
    lib.node_for_code(code).unwrap()
}

/// Next `n` frames of a cursor.
fn go(walk: &mut GraphCursor, lib: &Library<'_>, n: usize) -> Vec<(u8, u16)> {
    (0..n)
        .map(|_| {
            walk.advance(lib).unwrap();
            let (clip, frame) = walk.at();
            (clip.0, frame)
        })
        .collect()
}

/// Frames of a clip in a range, as pairs of clip and frame.
fn run(clip: u8, frames: std::ops::RangeInclusive<u16>) -> Vec<(u8, u16)> {
    frames.map(|f| (clip, f)).collect()
}

#[test]
fn a_motion_that_ends_goes_back_to_safe_by_itself() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let mut walk = GraphCursor::start(&lib).unwrap();
    assert_eq!(walk.at(), (ClipId(STAND_CLIP), 1));
    assert!(walk.rests_in_safe(&lib));
    walk.set_goal(&lib, node(&lib, CODE_DRIVE)).unwrap();
    assert!(!walk.rests_in_safe(&lib));

    // The last frame of a transition is named after the frame in its target.
    let mut expected = run(STAND_TO_DRIVE, 1..=TRANSITION_FRAMES - 2);
    expected.extend(run(DRIVE_CLIP, 0..=DRIVE_FRAMES - 1));
    expected.extend(run(DRIVE_TO_STAND, 1..=TRANSITION_FRAMES - 2));
    expected.extend([(STAND_CLIP, 0), (STAND_CLIP, 1), (STAND_CLIP, 0)]);
    assert_eq!(go(&mut walk, &lib, expected.len()), expected);
    assert!(walk.rests_in_safe(&lib));
}

#[test]
fn a_loop_is_left_only_at_its_exit_frame() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let mut walk = GraphCursor::start(&lib).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_WALK)).unwrap();
    let mut expected = run(STAND_TO_WALK, 1..=TRANSITION_FRAMES - 2);
    expected.extend(run(WALK_CLIP, WALK_ENTRY..=WALK_FRAMES - 1));
    expected.extend(run(WALK_CLIP, 0..=WALK_FRAMES - 1));
    assert_eq!(go(&mut walk, &lib, expected.len()), expected);

    // Just after the exit frame, a whole cycle remains.
    assert_eq!(
        go(&mut walk, &lib, usize::from(WALK_EXIT) + 2).last(),
        Some(&(WALK_CLIP, WALK_EXIT + 1))
    );
    walk.set_goal(&lib, node(&lib, CODE_STAND)).unwrap();
    let mut expected = run(WALK_CLIP, WALK_EXIT + 2..=WALK_FRAMES - 1);
    expected.extend(run(WALK_CLIP, 0..=WALK_EXIT));
    expected.extend(run(WALK_TO_STAND, 1..=TRANSITION_FRAMES - 2));
    expected.push((STAND_CLIP, 0));
    assert_eq!(go(&mut walk, &lib, expected.len()), expected);
    assert!(walk.rests_in_safe(&lib));
}

#[test]
fn a_motion_asked_for_again_is_played_again() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let mut walk = GraphCursor::start(&lib).unwrap();
    let drive = node(&lib, CODE_DRIVE);
    walk.set_goal(&lib, drive).unwrap();
    // On the way, a repeated request has no effect.
    go(&mut walk, &lib, 3);
    walk.set_goal(&lib, drive).unwrap();
    go(&mut walk, &lib, usize::from(TRANSITION_FRAMES));
    assert_eq!(walk.at().0, ClipId(DRIVE_CLIP));
    // While the motion plays, a repeated request queues it once more.
    walk.set_goal(&lib, drive).unwrap();
    let clips: Vec<u8> = go(&mut walk, &lib, 400).into_iter().map(|(clip, _)| clip).collect();
    let mut order = clips;
    order.dedup();
    assert_eq!(
        order,
        [
            DRIVE_CLIP,
            DRIVE_TO_STAND,
            STAND_CLIP,
            STAND_TO_DRIVE,
            DRIVE_CLIP,
            DRIVE_TO_STAND,
            STAND_CLIP
        ]
    );
}

#[test]
fn the_latest_goal_counts() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let mut walk = GraphCursor::start(&lib).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_DRIVE)).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_WALK)).unwrap();
    assert_eq!(go(&mut walk, &lib, 1), [(STAND_TO_WALK, 1)]);
    // The request is cancelled on the way: the robot completes the transition, then returns directly.
    walk.set_goal(&lib, node(&lib, CODE_STAND)).unwrap();
    let at: Vec<_> = go(&mut walk, &lib, 300);
    assert!(at.contains(&(WALK_CLIP, WALK_EXIT)));
    assert!(walk.rests_in_safe(&lib));
    // The request is cancelled before the robot left.
    walk.set_goal(&lib, node(&lib, CODE_DRIVE)).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_STAND)).unwrap();
    assert!(walk.rests_in_safe(&lib));
    assert_eq!(walk.set_goal(&lib, NodeId(9)), Err(GoalError::Unreachable));
}

#[test]
fn a_safe_motion_that_ends_is_played_to_its_end_and_held() {
    let loaded = LoadedLibrary::from(library_that_settles());
    let lib = loaded.open();
    let mut walk = GraphCursor::start(&lib).unwrap();
    let last = SETTLE_FRAMES - 1;
    assert_eq!(go(&mut walk, &lib, 2), [(STAND_CLIP, last), (STAND_CLIP, last)]);
    assert!(walk.rests_in_safe(&lib));
    walk.set_goal(&lib, node(&lib, CODE_DRIVE)).unwrap();
    let away = 2 * (TRANSITION_FRAMES - 1) + DRIVE_FRAMES - 1;
    assert_eq!(go(&mut walk, &lib, usize::from(away)).last(), Some(&(STAND_CLIP, 0)));
    assert!(!walk.rests_in_safe(&lib), "on its way into the pose");
    assert_eq!(go(&mut walk, &lib, usize::from(last)), run(STAND_CLIP, 1..=last));
    assert!(walk.rests_in_safe(&lib));
    // SAFE is requested while the robot moves to it.
    walk.set_goal(&lib, lib.safe_node()).unwrap();
    assert_eq!(go(&mut walk, &lib, 1), [(STAND_CLIP, last)]);
}

/// Plays every motion and transition, and calls `each` in every control period.
fn tour(ticks_per_frame: u16, mut each: impl FnMut(&Player)) {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let mut player = Player::start(&lib, ticks_per_frame).unwrap();
    for code in [CODE_DRIVE, CODE_WALK, CODE_STAND] {
        player.set_goal(&lib, node(&lib, code)).unwrap();
        for _ in 0..220 * u32::from(ticks_per_frame) {
            player.advance(&lib, &config()).unwrap();
            each(&player);
        }
    }
    assert!(player.rests_in_safe(&lib));
}

#[test]
fn every_frame_is_met_exactly() {
    let loaded = LoadedLibrary::new();
    let config = config();
    let mut frames = 0;
    tour(2, |player| {
        let now = player.playing();
        if now.phase == 0.0 {
            let frame = loaded.frame(now.clip.0, now.frame);
            for c in 0..CHANNELS {
                assert_eq!(player.target(&config, c).unwrap().value, frame[c], "{now:?}");
            }
            frames += 1;
        }
    });
    assert_eq!(frames, 3 * 220);
}

/// Curve is continuous in value and slope where loops repeat and clips join, and its slope is the derivative of the value.
#[test]
fn the_curve_is_c1_over_all_seams() {
    let config = config();
    let mut largest_second_difference = [0.0_f32; CHANNELS];
    let mut last_frames: Vec<[f32; CHANNELS]> = vec![];
    tour(1, |player| {
        last_frames.push(std::array::from_fn(|c| player.target(&config, c).unwrap().value));
        if let [.., a, b, d] = last_frames.as_slice() {
            for c in 0..CHANNELS {
                let second = (a[c] - 2.0 * b[c] + d[c]).abs();
                largest_second_difference[c] = largest_second_difference[c].max(second);
            }
        }
    });

    let ticks = 8;
    let dt = 1.0 / (60.0 * f32::from(ticks));
    let mut last: Option<[(f32, f32); CHANNELS]> = None;
    tour(ticks, |player| {
        let now = std::array::from_fn(|c| {
            let t = player.target(&config, c).unwrap();
            (t.value, t.slope)
        });
        if let Some(last) = last {
            for c in 0..2 {
                let ((p0, v0), (p1, v1)) = (last[c], now[c]);
                // The second derivative of the curve at a frame is 2·d1 − d2 of second differences of frames, and linear
                // between frames. It is at most three times the largest difference.
                let acceleration = 3.0 * largest_second_difference[c] * 3600.0;
                assert!((v1 - v0).abs() <= acceleration * dt * 1.01 + 1e-4, "slope jumps");
                // Trapezoid rule, exact up to dt² · change of acceleration / 12, plus rounding.
                let error = (p1 - p0 - 0.5 * dt * (v0 + v1)).abs();
                assert!(error <= acceleration * dt * dt / 6.0 + 1e-6, "slope is no derivative");
            }
        }
        last = Some(now);
    });
}

#[test]
fn wheels_are_interpolated_too_and_have_no_slope() {
    let config = config();
    let mut between = 0;
    tour(2, |player| {
        let now = player.playing();
        let wheel = player.target(&config, 2).unwrap();
        assert_eq!(wheel.slope, 0.0);
        if now.phase == 0.5 && now.clip == ClipId(WALK_CLIP) {
            let here = wheel.value;
            let a = 3.0
                + 2.0
                    * (std::f32::consts::TAU * (f32::from(now.frame) + 0.5)
                        / f32::from(WALK_FRAMES))
                    .sin();
            let inside = (WALK_ENTRY + 2..WALK_FRAMES - 2).contains(&now.frame);
            if inside {
                // A quantum of 2⁻¹⁰ rad/s and the cubic's error of 0.157⁴ · 2 / 100.
                assert!((here - a).abs() < 2e-2, "{here} {a}");
                between += 1;
            }
        }
    });
    assert!(between > 20);
}

proptest! {
    /// A motion starts after the number of frames that was reported, for any sequence of requests.
    #[test]
    fn a_motion_starts_when_it_was_said_to(
        requests in prop::collection::vec((prop_oneof![Just(CODE_STAND), Just(CODE_DRIVE), Just(CODE_WALK)], 0u16..200), 1..6),
    ) {
        let loaded = LoadedLibrary::new();
        let lib = loaded.open();
        let mut walk = GraphCursor::start(&lib).unwrap();
        for (code, wait) in requests {
            let goal = node(&lib, code);
            let on_the_spot = walk.at().0 == goal.clip();
            walk.set_goal(&lib, goal).unwrap();
            let frames = walk.frames_to_goal(&lib);
            let mut left = on_the_spot && frames > 0;
            let mut taken = 0;
            while frames > 0 && (taken == 0 || left || walk.at().0 != goal.clip()) {
                prop_assert!(taken < frames, "not there after {} frames", frames);
                walk.advance(&lib).unwrap();
                left &= walk.at().0 == goal.clip();
                taken += 1;
            }
            prop_assert_eq!((walk.at().0, taken), (goal.clip(), frames));
            go(&mut walk, &lib, usize::from(wait));
        }
    }

    /// SAFE is reached from everywhere after it is requested, for any sequence of earlier requests.
    #[test]
    fn safe_is_reached_from_everywhere(
        requests in prop::collection::vec((prop_oneof![Just(CODE_STAND), Just(CODE_DRIVE), Just(CODE_WALK)], 0usize..200), 0..12),
    ) {
        let loaded = LoadedLibrary::new();
        let lib = loaded.open();
        let mut player = Player::start(&lib, 2).unwrap();
        for (code, ticks) in requests {
            player.set_goal(&lib, node(&lib, code)).unwrap();
            for _ in 0..ticks {
                player.advance(&lib, &config()).unwrap();
            }
        }
        player.set_goal(&lib, lib.safe_node()).unwrap();
        // The longest route: a transition, a motion, a transition, and the frames ahead.
        let longest = 2 * (2 * TRANSITION_FRAMES + DRIVE_FRAMES + WALK_FRAMES + 8);
        for _ in 0..longest {
            player.advance(&lib, &config()).unwrap();
        }
        prop_assert!(player.rests_in_safe(&lib));
    }
}

/// Test library with one changed byte near the end of the frames, which makes only this clip unreadable.
fn with_damaged(clip: u8) -> LoadedLibrary {
    let mut loaded = LoadedLibrary::new();
    let clips = loaded.open().clip_count();
    for at in (0..loaded.bytes.len() - 24).rev() {
        loaded.bytes[at] ^= 0x10;
        let library = loaded.open();
        let unreadable = |i: &u8| ClipCursor::new(&library, ClipId(*i), 0).is_err();
        if (0..clips).filter(unreadable).eq([clip]) {
            return loaded;
        }
        loaded.bytes[at] ^= 0x10;
    }
    panic!("every byte of clip {clip} is part of its CRC");
}

/// Advances into a clip; returns false if a damaged clip is detected before.
fn gets_into(clip: u8, mut walk: GraphCursor, lib: &Library<'_>) -> bool {
    for _ in 0..200 {
        if walk.advance(lib).is_err() {
            return false;
        }
        if walk.at().0 == ClipId(clip) {
            return true;
        }
    }
    panic!("never gets to clip {clip}");
}

#[test]
fn the_way_to_a_goal_is_checked_when_it_is_set() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    let damaged = with_damaged(STAND_TO_WALK);
    let mut walk = GraphCursor::start(&lib).unwrap();
    // A block that was damaged before its check is found at the latest on entry.
    walk.set_goal(&damaged.open(), node(&lib, CODE_WALK)).unwrap();
    assert!(!gets_into(STAND_TO_WALK, walk.clone(), &damaged.open()));
    // A block that was damaged after its check: the frame of the exit checks nothing.
    walk.set_goal(&lib, node(&lib, CODE_STAND)).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_WALK)).unwrap();
    assert!(gets_into(STAND_TO_WALK, walk.clone(), &damaged.open()));

    // The same holds for a goal that is set during the last frame of a transition.
    let damaged = with_damaged(WALK_TO_STAND);
    go(&mut walk, &lib, usize::from(TRANSITION_FRAMES) - 2);
    assert_eq!(walk.at().0, ClipId(STAND_TO_WALK));
    let mut late = walk.clone();
    late.set_goal(&damaged.open(), node(&lib, CODE_STAND)).unwrap();
    assert!(!gets_into(WALK_TO_STAND, late, &damaged.open()));
    walk.set_goal(&lib, node(&lib, CODE_STAND)).unwrap();
    assert!(gets_into(WALK_TO_STAND, walk, &damaged.open()));
}

#[test]
fn what_comes_by_itself_is_checked_on_the_way() {
    let loaded = LoadedLibrary::new();
    let lib = loaded.open();
    // The damage is in the target of the transition.
    let damaged = with_damaged(WALK_CLIP);
    let mut walk = GraphCursor::start(&lib).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_WALK)).unwrap();
    assert!(!gets_into(WALK_CLIP, walk.clone(), &damaged.open()));
    go(&mut walk, &lib, usize::from(TRANSITION_FRAMES) - 3);
    assert!(gets_into(WALK_CLIP, walk, &damaged.open()));

    // The damage is in the transition after a finite motion.
    let damaged = with_damaged(DRIVE_TO_STAND);
    let mut walk = GraphCursor::start(&lib).unwrap();
    walk.set_goal(&lib, node(&lib, CODE_DRIVE)).unwrap();
    go(&mut walk, &lib, 2);
    assert!(!gets_into(DRIVE_TO_STAND, walk.clone(), &damaged.open()));
    go(&mut walk, &lib, usize::from(TRANSITION_FRAMES + DRIVE_FRAMES) - 10);
    assert!(gets_into(DRIVE_TO_STAND, walk, &damaged.open()));
}
