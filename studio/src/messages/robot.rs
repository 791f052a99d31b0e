//! A robot at the other end of a link: orders to it, and the view of it.

use super::File;
use rollwalk_gamepads::standard::Snapshot;
use serde::{Deserialize, Serialize};

/// Connection to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// Simulated robot in the page, on level ground.
    Simulated,
    /// Serial port that carries the link.
    Serial,
    /// CAN adapter at a serial port that speaks SLCAN, at 1 Mbit/s.
    Slcan,
    /// Bus of this computer, relayed by a server.
    Relay,
}

/// Request of a page to a robot at the other end of a link.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "robot", rename_all = "snake_case")]
pub enum Wanted {
    /// Connects to the robot, in place of an earlier connection.
    Connect {
        place: Place,
        files: Vec<File>,
        /// Path of the robot file among them.
        file: String,
        /// Number of the controller.
        node: u8,
        /// True if a gamepad's deadman must be held while the robot moves.
        #[serde(default)]
        gamepad: bool,
        /// The robot's link key, for a controller that insists on one.
        #[serde(default)]
        key: Option<Key>,
    },
    /// Continues; the request carries the bytes that have arrived.
    Tick {
        /// True if the page itself, not only its link, has answered lately.
        attended: bool,
        /// Gamepad states since the last tick, in order.
        #[serde(default)]
        gamepad: Vec<Seen>,
    },
    /// Passes an order on.
    Wish(Wish),
    /// Transfers the library in the request's bytes.
    Flash,
    /// Names motions like the library in the request's bytes.
    Name,
    /// Ends the connection at once.
    Leave,
}

/// A link key, and random numbers for its use.
#[derive(Clone, Deserialize)]
pub struct Key {
    /// The text of the key file.
    pub(crate) text: String,
    /// Random, of 32 bits each: JavaScript has no integers of 64.
    pub(crate) nonce: [u32; 2],
}

impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Key(secret)")
    }
}

/// Order of the operator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "intent", rename_all = "snake_case")]
pub enum Wish {
    Arm,
    /// Play the motion with this code.
    Play {
        code: u8,
    },
    /// Halt the motion where it is, or go on.
    PauseOrResume,
    Return,
    /// Return to SAFE, then turn torque off.
    Disarm,
    /// Turn torque off at once.
    Estop,
    /// Leave an emergency stop or a latched fault.
    Clear,
    /// Set the speed of playback.
    Speed {
        /// 64ths of the planned speed, 1 to 64.
        sixty_fourths: i8,
    },
    /// The deadman is held, or was released: the robot halts.
    Deadman {
        /// True while the deadman is held.
        held: bool,
    },
    /// Return to SAFE, turn torque off and leave; the second time, leave at once.
    Quit,
}

/// State of a gamepad in the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum Seen {
    /// Buttons and axes.
    There(Snapshot),
    /// The gamepad is not visible to the page.
    Gone { gone: String },
}

/// A snapshot for the page.
#[derive(Clone, Debug, Serialize)]
pub struct RobotView {
    /// Time by the robot's clock, or the page's for a real one, s.
    pub time_s: f64,
    /// True if a frame of the controller has arrived lately.
    pub contact: bool,
    /// Time from a heartbeat to its answer, ms.
    pub round_trip_ms: Option<f64>,
    /// Status messages lost, of all.
    pub lost: [u64; 2],
    /// State in words, to follow "the robot is"; none before the first status.
    pub state: Option<String>,
    /// True if the motors have torque, or may get it without another order.
    pub torque: bool,
    /// True if the controller accepts an order to arm in this state.
    pub can_arm: bool,
    /// True if the controller accepts orders to play in this state.
    pub can_play: bool,
    /// True while the robot is halted within a motion; an order resumes it.
    pub paused: bool,
    /// Advice on the next step.
    pub advice: &'static str,
    /// Reason for which this page must not arm the controller.
    pub mismatch: Option<String>,
    /// Fault of the bus.
    pub complaint: Option<String>,
    pub faults: Vec<String>,
    /// Motions of the library in use, if the page has that library.
    pub motions: Vec<MotionOf>,
    /// The motion or transition that is being played: its name, and its frame.
    pub playing: Option<Playing>,
    /// Identity of the library in use, as eight hexadecimal digits.
    pub library: Option<String>,
    /// Bytes of a library that is being transferred: those that have arrived, and all.
    pub transfer: Option<[usize; 2]>,
    /// The order in flight, in words.
    pub asking: Option<String>,
    /// The gamepad in a few words, if one is used.
    pub gamepad: Option<String>,
    /// True while an emergency stop waits to be acknowledged.
    pub stopping: bool,
    /// Stage of the operator's exit: `no`, `when_home` or `now`.
    pub leaving: &'static str,
    /// Commanded speed, in 64ths of the planned one.
    pub speed_64ths: i8,
    /// Joints and driven wheels that were heard, in channel order.
    pub channels: Vec<ChannelOf>,
    /// Poses of the scene's bodies, world_from_body, `x y z qw qx qy qz`.
    pub poses: Vec<[f64; 7]>,
    /// State of the simulated robot: fallen, and held by the hoist.
    pub simulated: Option<Simulation>,
    /// Messages to the operator, oldest first.
    pub messages: Vec<MessageOf>,
}

/// A motion that can be played.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MotionOf {
    pub name: String,
    pub code: Option<u8>,
    pub looping: bool,
}

/// Motion or transition that is being played.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Playing {
    /// The motion, or `from → to`.
    pub name: String,
    /// Clip in the library.
    pub clip: u8,
    /// Time within it now, s: that of the last reported frame, advanced since then.
    pub time_s: f64,
    /// Playback rate: 1 at planned speed, 0 while halted.
    pub rate: f64,
}

/// Telemetry of a joint or driven wheel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelOf {
    pub name: String,
    /// Angle, rad.
    pub position_rad: f32,
    /// Speed, rad/s.
    pub speed_rad_s: f32,
    /// Torque, N·m.
    pub torque_nm: f32,
    /// Age, s.
    pub age_s: f64,
}

/// State of a simulated robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Simulation {
    /// True if the robot has fallen since the hoist released it.
    pub fallen: bool,
    /// True while the hoist holds the robot.
    pub held: bool,
}

/// A message to the operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MessageOf {
    /// Time, s.
    pub at_s: f64,
    /// `note`, `refused` or `warning`.
    pub weight: &'static str,
    pub text: String,
}
