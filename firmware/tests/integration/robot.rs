//! Robot with two joints and a wheel, and a library with one motion of each kind.

use std::f32::consts::TAU;

use rollwalk_protocol::config::{Channel, ChannelKind, RobotConfig};
use rollwalk_protocol::library::{
    Attitude, LibrarySpec, MotionSpec, TransitionSpec, encode_with_attitudes,
};

pub const CHANNELS: usize = 3;
pub const STAND: [f32; CHANNELS] = [0.25, -0.5, 0.0];

pub const CODE_STAND: u8 = 1;
pub const CODE_DRIVE: u8 = 10;
pub const CODE_WALK: u8 = 20;

/// Clip of the SAFE motion. Motions, which are the graph's nodes, come first, then the transitions.
pub const STAND_CLIP: u8 = 0;
pub const DRIVE_CLIP: u8 = 1;
pub const WALK_CLIP: u8 = 2;
pub const STAND_TO_DRIVE: u8 = 3;
pub const DRIVE_TO_STAND: u8 = 4;
pub const STAND_TO_WALK: u8 = 5;
pub const WALK_TO_STAND: u8 = 6;

pub const DRIVE_FRAMES: u16 = 90;
pub const WALK_FRAMES: u16 = 40;
pub const WALK_EXIT: u16 = 30;
pub const WALK_ENTRY: u16 = 7;
pub const TRANSITION_FRAMES: u16 = 25;

pub fn config() -> RobotConfig {
    let joint = |id| Channel {
        kind: ChannelKind::JointPosition,
        min: -1.5,
        max: 1.5,
        max_rate: 8.0,
        max_torque_nm: 3.0,
        kp_nm_rad: 20.0,
        kd_nm_s_rad: 0.5,
        bus: 0,
        id,
    };
    let wheel = Channel {
        kind: ChannelKind::WheelSpeed,
        min: -15.0,
        max: 15.0,
        max_rate: 60.0,
        kp_nm_rad: 0.0,
        bus: 1,
        id: 1,
        ..joint(1)
    };
    RobotConfig { robot: 0, channels: [joint(1), joint(2), wheel].into_iter().collect() }
}

/// SAFE as a loop that holds still.
fn stand() -> Vec<f32> {
    [STAND, STAND].concat()
}

/// Number of frames of SAFE in the variant where it is a motion that settles into the pose.
pub const SETTLE_FRAMES: u16 = 20;

fn settle() -> Vec<f32> {
    (0..SETTLE_FRAMES)
        .flat_map(|i| {
            let left = 1.0 - f32::from(i) / f32::from(SETTLE_FRAMES - 1);
            [STAND[0] + 0.1 * left * left, STAND[1], 0.0]
        })
        .collect()
}

fn drive() -> Vec<f32> {
    let last = f32::from(DRIVE_FRAMES - 1);
    (0..DRIVE_FRAMES)
        .flat_map(|i| {
            let bump = 0.5 - 0.5 * (TAU * f32::from(i) / last).cos();
            [STAND[0] + 0.4 * bump, STAND[1] - 0.2 * bump, 9.0 * bump]
        })
        .collect()
}

fn walk_at(frame: f32) -> [f32; CHANNELS] {
    let a = TAU * frame / f32::from(WALK_FRAMES);
    [0.1 + 0.4 * a.sin(), -0.6 + 0.3 * a.cos(), 3.0 + 2.0 * a.sin()]
}

fn walk() -> Vec<f32> {
    (0..WALK_FRAMES).flat_map(|i| walk_at(f32::from(i))).collect()
}

/// Frames from one pose to another along a smooth step. Only the start and the end matter.
fn transition(from: [f32; CHANNELS], to: [f32; CHANNELS]) -> Vec<f32> {
    (0..TRANSITION_FRAMES)
        .flat_map(|i| {
            let u = f32::from(i) / f32::from(TRANSITION_FRAMES - 1);
            let s = u * u * (3.0 - 2.0 * u);
            std::array::from_fn::<_, CHANNELS, _>(|c| from[c] + s * (to[c] - from[c]))
        })
        .collect()
}

/// Name of the drive.
const DRIVE: &str = "drive";

/// Encoded test library.
pub fn library() -> Vec<u8> {
    library_for(&config())
}

pub fn library_for(config: &RobotConfig) -> Vec<u8> {
    build(config, &stand(), true)
}

/// Test library for slow actuators: half the wheel speed.
pub fn calm_library(config: &RobotConfig) -> Vec<u8> {
    build_at(config, &stand(), true, 0.5)
}

/// Test library whose SAFE is a finite motion.
pub fn library_that_settles() -> Vec<u8> {
    build(&config(), &settle(), false)
}

/// Test library in which the motion with `code` is pitched nose-down by `pitch_rad`, with a deviation of up to `spread_rad`.
pub fn library_with_attitudes(code: u8, pitch_rad: f32, spread_rad: f32) -> Vec<u8> {
    let level = Attitude { spread_rad, ..Attitude::LEVEL };
    let up_body = [-pitch_rad.sin(), 0.0, pitch_rad.cos()];
    let bowed = Attitude { up_body, spread_rad };
    let motions =
        [CODE_STAND, CODE_DRIVE, CODE_WALK].map(|c| if c == code { bowed } else { level });
    let attitudes = [&motions[..], &[level; 4]].concat();
    build_from(&config(), &stand(), true, 1.0, DRIVE, &attitudes, &|_| vec![])
}

/// Test library whose drive begins at the place `stairs`.
pub fn library_with_place() -> Vec<u8> {
    build_from(&config(), &stand(), true, 1.0, "drive@stairs", &[], &|_| vec![])
}

/// Test library with torques, which `torques` computes from the values of each frame.
pub fn library_with_torques(
    config: &RobotConfig,
    speed: f32,
    torques: &dyn Fn(&[f32]) -> [f32; CHANNELS],
) -> Vec<u8> {
    let of = |frames: &[f32]| frames.chunks(CHANNELS).flat_map(torques).collect();
    build_from(config, &stand(), true, speed, DRIVE, &[], &of)
}

fn build(config: &RobotConfig, stand: &[f32], looping: bool) -> Vec<u8> {
    build_at(config, stand, looping, 1.0)
}

/// Test library with the wheel speed scaled by `speed`.
fn build_at(config: &RobotConfig, stand: &[f32], looping: bool, speed: f32) -> Vec<u8> {
    build_from(config, stand, looping, speed, DRIVE, &[], &|_| vec![])
}

fn build_from(
    config: &RobotConfig,
    stand: &[f32],
    looping: bool,
    speed: f32,
    drive_name: &str,
    attitudes: &[Attitude],
    torques: &dyn Fn(&[f32]) -> Vec<f32>,
) -> Vec<u8> {
    let slower = |mut frames: Vec<f32>| {
        frames.chunks_mut(CHANNELS).for_each(|frame| frame[2] *= speed);
        frames
    };
    let (drive, walk) = (slower(drive()), slower(walk()));
    let entry = [stand[0], stand[1], stand[2]];
    let last = (stand.len() / CHANNELS - 1) as u16;
    let of_motions = [torques(stand), torques(&drive), torques(&walk)];
    let motions = [
        MotionSpec {
            name: "stand",
            code: CODE_STAND,
            looping,
            frames: stand,
            torques: &of_motions[0],
        },
        MotionSpec {
            name: drive_name,
            code: CODE_DRIVE,
            looping: false,
            frames: &drive,
            torques: &of_motions[1],
        },
        MotionSpec {
            name: "walk",
            code: CODE_WALK,
            looping: true,
            frames: &walk,
            torques: &of_motions[2],
        },
    ];
    let still = transition(STAND, STAND);
    let out_of_drive = transition(STAND, entry);
    let into_walk = slower(transition(STAND, walk_at(f32::from(WALK_ENTRY))));
    let out_of_walk = slower(transition(walk_at(f32::from(WALK_EXIT)), entry));
    let clips = [&still, &out_of_drive, &into_walk, &out_of_walk];
    let of = clips.map(|frames| torques(frames));
    let transitions = [
        TransitionSpec { torques: &of[0], ..TransitionSpec::new(0, last, 1, 0, &still) },
        TransitionSpec {
            torques: &of[1],
            ..TransitionSpec::new(1, DRIVE_FRAMES - 1, 0, 0, &out_of_drive)
        },
        TransitionSpec {
            torques: &of[2],
            ..TransitionSpec::new(0, last, 2, WALK_ENTRY, &into_walk)
        },
        TransitionSpec { torques: &of[3], ..TransitionSpec::new(2, WALK_EXIT, 0, 0, &out_of_walk) },
    ];
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 64 * 1024];
    let len =
        encode_with_attitudes(&spec, attitudes, &mut bytes).expect("the test library encodes");
    bytes.truncate(len);
    bytes
}
