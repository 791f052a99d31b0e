//! Robot at the other end of a link: requests to it, and the view of its state.

use super::File;
use rollwalk_gamepads::standard::Snapshot;
use serde::{Deserialize, Serialize};

/// Kind of connection to the robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ConnectionKind {
    /// Simulated robot in the page, on level ground.
    Simulated,
    /// Serial port with packets of the link.
    Serial,
    /// CAN adapter with the SLCAN protocol at a serial port, 1 Mbit/s.
    Slcan,
    /// Bus of this computer, relayed by a server.
    Relay,
}

/// Request of a page to a robot at the other end of a link.
#[derive(Clone, Debug, Deserialize)]
#[serde(tag = "robot", rename_all = "snake_case")]
pub enum RobotRequest {
    /// Connects to the robot, and ends an earlier connection.
    Connect {
        place: ConnectionKind,
        files: Vec<File>,
        /// Path of the robot file in `files`.
        file: String,
        /// Address of the controller.
        node: u8,
        /// True if a gamepad's deadman switch must be held while the robot moves.
        #[serde(default)]
        gamepad: bool,
        /// Link key of the robot, for a controller that requires one.
        #[serde(default)]
        key: Option<Key>,
    },
    /// Continues the connection; the request contains the bytes received from the robot.
    Tick {
        /// True if the user interface of the page is responsive, not only its link.
        attended: bool,
        /// Gamepad states since the previous tick, in order.
        #[serde(default)]
        gamepad: Vec<GamepadState>,
    },
    /// Passes an operator command to the robot.
    Wish(OperatorCommand),
    /// Transfers the library in the request's bytes.
    Flash,
    /// Takes the names of motions from the library in the bytes of the request.
    Name,
    /// Ends the connection at once.
    Leave,
}

/// Link key, and random numbers for its use.
#[derive(Clone, Deserialize)]
pub struct Key {
    /// Text of the key file.
    pub(crate) text: String,
    /// Two random values of 32 bits, because JavaScript has no 64-bit integers.
    pub(crate) nonce: [u32; 2],
}

impl std::fmt::Debug for Key {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Key(secret)")
    }
}

/// Operator command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(tag = "intent", rename_all = "snake_case")]
pub enum OperatorCommand {
    Arm,
    /// Play the motion with the given code.
    Play {
        code: u8,
    },
    /// Hold the motion at its current pose, or resume it.
    PauseOrResume,
    Return,
    /// Return to SAFE, then turn torque off.
    Disarm,
    /// Turn torque off at once.
    Estop,
    /// Clear an emergency stop or a latched fault.
    Clear,
    /// Set the speed of playback.
    Speed {
        /// Speed, in 64ths of the planned speed, 1 to 64.
        sixty_fourths: i8,
    },
    /// Report the deadman switch; its release halts the robot.
    Deadman {
        /// True while the deadman switch is held.
        held: bool,
    },
    /// Return to SAFE, turn torque off and leave; a second request leaves at once.
    Quit,
}

/// State of a gamepad in the page.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(untagged)]
pub enum GamepadState {
    /// Buttons and axes.
    There(Snapshot),
    /// Gamepad that is not visible to the page, with the reason.
    Gone { gone: String },
}

/// Snapshot of the robot for the page.
#[derive(Clone, Debug, Serialize)]
pub struct RobotView {
    /// Time, s: of the robot's clock if simulated, else of the page's clock.
    pub time_s: f64,
    /// True if a frame of the controller was received recently.
    pub contact: bool,
    /// Time from a heartbeat to its answer, ms.
    pub round_trip_ms: Option<f64>,
    /// Number of lost status messages, and number of all status messages.
    pub lost: [u64; 2],
    /// State as a phrase that follows "the robot is"; `None` before the first status.
    pub state: Option<String>,
    /// True if the motors have torque, or may get it without another command.
    pub torque: bool,
    /// True if the controller accepts a command to arm in this state.
    pub can_arm: bool,
    /// True if the controller accepts commands to play in this state.
    pub can_play: bool,
    /// True while a motion is paused and can be resumed.
    pub paused: bool,
    /// Advice on the next step.
    pub advice: &'static str,
    /// Reason why this page must not arm the controller.
    pub mismatch: Option<String>,
    /// Fault of the bus.
    pub complaint: Option<String>,
    pub faults: Vec<String>,
    /// Motions of the library in use, if the page knows that library.
    pub motions: Vec<PlayableMotion>,
    /// Motion or transition that is playing.
    pub playing: Option<PlayingClip>,
    /// Identity of the library in use, as eight hexadecimal digits.
    pub library: Option<String>,
    /// Progress of a library transfer, bytes: transferred and total.
    pub transfer: Option<[usize; 2]>,
    /// Description of the command in flight.
    pub asking: Option<String>,
    /// Short description of the gamepad; `None` if none is used.
    pub gamepad: Option<String>,
    /// True while an emergency stop is not yet acknowledged.
    pub stopping: bool,
    /// Stage of the operator's exit: `no`, `when_home` or `now`.
    pub leaving: &'static str,
    /// Commanded speed, in 64ths of the planned speed.
    pub speed_64ths: i8,
    /// Joints and driven wheels that have reported, in channel order.
    pub channels: Vec<ChannelTelemetry>,
    /// Poses of the scene's bodies, world_from_body, `x y z qw qx qy qz`.
    pub poses: Vec<[f64; 7]>,
    /// State of the simulated robot; `None` for a real robot.
    pub simulated: Option<Simulation>,
    /// Messages to the operator, oldest first.
    pub messages: Vec<OperatorMessage>,
}

/// Motion that can be played.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlayableMotion {
    pub name: String,
    pub code: Option<u8>,
    pub looping: bool,
}

/// Motion or transition that is playing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PlayingClip {
    /// Name of the motion, or `from → to` for a transition.
    pub name: String,
    /// Index of the clip in the library.
    pub clip: u8,
    /// Current time within the clip, s: that of the most recently reported frame, extrapolated to now.
    pub time_s: f64,
    /// Playback rate: 1 at planned speed, 0 while paused.
    pub rate: f64,
}

/// Telemetry of a joint or driven wheel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelTelemetry {
    pub name: String,
    /// Angle, rad.
    pub position_rad: f32,
    /// Speed, rad/s.
    pub speed_rad_s: f32,
    /// Torque, N·m.
    pub torque_nm: f32,
    /// Age of the telemetry, s.
    pub age_s: f64,
    /// Temperature, °C; `None` if the actuator does not report it.
    pub temperature_c: Option<f32>,
    /// Supply voltage, V; `None` if the actuator does not report it.
    pub voltage_v: Option<f32>,
}

/// State of a simulated robot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Simulation {
    /// True if the robot has fallen since the hoist released it.
    pub fallen: bool,
    /// True while the hoist holds the robot.
    pub held: bool,
}

/// Message to the operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OperatorMessage {
    /// Time, s.
    pub at_s: f64,
    /// `note`, `refused` or `warning`.
    pub weight: &'static str,
    pub text: String,
}
