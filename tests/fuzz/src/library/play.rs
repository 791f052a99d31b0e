//! Playback of a library: frame by frame with a cursor, and tick by tick with player and limiter.

use rollwalk_firmware::graph_cursor::GraphCursor;
use rollwalk_firmware::limiter::Limiter;
use rollwalk_firmware::player::Player;
use rollwalk_protocol::config::{ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::library::{ClipCursor, ClipId, ClipKind, Library, NodeId, RATE_HZ};

/// Length of the commands, bytes. A command is a pair of bytes: frames to wait and motion.
pub const COMMANDS: usize = 16;
const FRAMES: u16 = 10 * RATE_HZ;

type Frame = [f32; MAX_CHANNELS];

/// Commands with their waiting times, repeated endlessly.
struct Commands<'a> {
    left: std::iter::Cycle<std::slice::Iter<'a, [u8; 2]>>,
    wait: u8,
    nodes: u8,
}

impl<'a> Commands<'a> {
    fn new(bytes: &'a [u8], library: &Library<'_>) -> Self {
        let (pairs, _) = bytes.as_chunks::<2>();
        Self { left: pairs.iter().cycle(), wait: 0, nodes: library.node_count() }
    }

    /// Motion that is commanded in this frame; `None` while waiting.
    fn next(&mut self) -> Option<NodeId> {
        if let Some(wait) = self.wait.checked_sub(1) {
            self.wait = wait;
            return None;
        }
        let &[wait, node] = self.left.next()?;
        self.wait = wait;
        // One node more than exist, which is refused.
        Some(NodeId(node % (self.nodes + 1)))
    }
}

/// Plays a library for ten seconds and checks every property of a valid library.
pub fn ten_seconds(library: &Library<'_>, config: &RobotConfig, commands: &[u8]) {
    let exists = |goal: NodeId| goal.0 < library.node_count();
    for node in library.nodes() {
        assert!(library.name(node).is_some() && library.code_of(node).is_some());
        assert!(
            library.next_hop(node, library.safe_node()).is_some() || node == library.safe_node()
        );
    }
    let mut pose = [0.0; MAX_CHANNELS];
    library.safe_pose_into(&mut pose).expect("validated");

    let mut cursor = GraphCursor::start(library).expect("validated");
    let mut before = frame_at(&cursor, library);
    for (channel, limits) in config.channels.iter().enumerate() {
        let at_rest = limits.kind == ChannelKind::WheelSpeed || before[channel] == pose[channel];
        assert!(at_rest, "starts in the safe pose");
    }
    let mut todo = Commands::new(commands, library);
    // Frames until the goal is reached, if no other command arrives.
    let mut announced = None;
    for _ in 0..FRAMES {
        if let Some(goal) = todo.next() {
            let accepted = cursor.set_goal(library, goal).is_ok();
            assert!(exists(goal) || !accepted, "{goal:?} does not exist");
            if accepted {
                announced = Some((cursor.frames_to_goal(library), goal));
            }
        }
        let (clip, _) = cursor.at();
        cursor.advance(library).expect("validated");
        let now = frame_at(&cursor, library);
        assert_within(config, library, &before, &now);
        assert_joined(library, &cursor, clip, &before);
        if let Some((frames, goal)) = announced {
            announced = frames.checked_sub(1).map(|left| (left, goal));
            if frames == 1 {
                assert_eq!(cursor.at().0, goal.clip(), "the goal is entered as announced");
            }
        }
        before = now;
    }
    tick_by_tick(library, config, commands);
}

fn frame_at(cursor: &GraphCursor, library: &Library<'_>) -> Frame {
    let mut frame = [0.0; MAX_CHANNELS];
    cursor.frame_into(library, &mut frame).expect("validated");
    frame
}

/// Checks that values are in range, and that they change no faster than the robot's limits, to within a quantum.
fn assert_within(config: &RobotConfig, library: &Library<'_>, before: &Frame, now: &Frame) {
    for (channel, limits) in config.channels.iter().enumerate() {
        let (last, value) = (before[channel], now[channel]);
        assert!(value >= limits.min && value <= limits.max, "channel {channel}: {value}");
        let quantum = library.quantum(channel).expect("a channel");
        let step = limits.max_rate / f32::from(RATE_HZ) + quantum;
        assert!((value - last).abs() <= step, "channel {channel}: {last} to {value}");
    }
}

/// Checks that a transition begins with the frame in which the previous clip was left.
fn assert_joined(library: &Library<'_>, cursor: &GraphCursor, from: ClipId, before: &Frame) {
    let (clip, frame) = cursor.at();
    let kind = library.clip(clip).expect("validated").kind;
    if clip != from && kind == ClipKind::Transition {
        let first = frame.checked_sub(1).expect("frame 0 was played under another name");
        let mut values = [0.0; MAX_CHANNELS];
        let cursor = ClipCursor::new(library, clip, first).expect("validated");
        cursor.frame_into(library, &mut values).expect("validated");
        assert_eq!(values, *before, "a gap before {clip:?}");
    }
}

/// Plays tick by tick and checks the targets of the actuators.
fn tick_by_tick(library: &Library<'_>, config: &RobotConfig, commands: &[u8]) {
    let ticks_per_frame = u16::from(commands.first().copied().unwrap_or(0) % 4) + 1;
    let period_s = 1.0 / f32::from(RATE_HZ * ticks_per_frame);
    let mut player = Player::start(library, ticks_per_frame).expect("validated");
    let mut limiter = Limiter::new(period_s);
    let mut todo = Commands::new(commands, library);
    for tick in 0..FRAMES * ticks_per_frame {
        if tick % ticks_per_frame == 0
            && let Some(goal) = todo.next()
        {
            let _ = player.set_goal(library, goal);
            // Slower, a halt, or onward, depending on the tick.
            match tick % 5 {
                0 => player.halt(),
                1 => player.set_speed((tick % 80) as u8),
                _ => player.go_on(),
            }
        }
        player.advance(library, config).expect("validated");
        for (channel, limits) in config.channels.iter().enumerate() {
            let target = player.target(config, channel).expect("a channel");
            assert!(target.value.is_finite() && target.slope.is_finite());
            if tick == 0 {
                limiter.start(channel, target.value);
            }
            let last = limiter.last(channel).expect("started");
            let sent = limiter.apply(limits, channel, target, true).expect("started");
            assert!(sent.value >= limits.min && sent.value <= limits.max);
            let step = limits.max_rate * period_s;
            assert!((sent.value - last).abs() <= step * 1.0001 + 1e-6);
            assert!(sent.slope.abs() <= limits.max_rate);
            assert!(sent.torque_nm.abs() <= limits.max_torque_nm);
        }
    }
    let playing = player.playing();
    let clip = library.clip(playing.clip).expect("a clip of the library");
    assert!(playing.frame < clip.frames && (0.0..1.0).contains(&playing.phase));
}
