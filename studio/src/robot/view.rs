//! What the page shows of a robot: state and faults in words, motions, joints, and poses of its bodies.

use super::simulated::Simulated;
use crate::scene::{poses as drawn, turning_wheels};
use nalgebra::{Matrix3, Vector3};
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe;
use rollwalk_host::operator::{FaultView, Leaving, View, Weight};
use rollwalk_multibody::{Configuration, Frames, Standing, Tree};
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::{State, Torque};
use rollwalk_robot::Robot;
use serde::Serialize;
use std::collections::BTreeMap;

/// Longest time for which a motion is thought to go on as the robot last reported, µs: three of its messages.
const MOST_SINCE_US: u64 = 150_000;
/// The planned speed in 64ths.
const FULL_SPEED: i8 = 64;

/// A snapshot for the page.
#[derive(Clone, Debug, Serialize)]
pub struct RobotView {
    /// Time by the robot's clock, or the page's for a real one, s.
    pub time_s: f64,
    /// Whether the controller was heard lately.
    pub contact: bool,
    /// Time from a heartbeat to its answer, ms.
    pub round_trip_ms: Option<f64>,
    /// Status messages lost, of all.
    pub lost: [u64; 2],
    /// State in words, to follow "the robot is"; none before the first status.
    pub state: Option<&'static str>,
    /// Whether the motors have torque, or may get it without another order.
    pub torque: bool,
    /// Whether it takes an order to arm in this state.
    pub can_arm: bool,
    /// Whether it takes orders to play in this state.
    pub can_play: bool,
    /// Whether it is halted within a motion, and goes on by an order.
    pub paused: bool,
    /// What to do next.
    pub advice: &'static str,
    /// Why this page must not arm the controller.
    pub mismatch: Option<String>,
    /// What is wrong with the bus.
    pub complaint: Option<String>,
    /// Faults in words.
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
    /// Whether an emergency stop waits to be acknowledged.
    pub stopping: bool,
    /// Whether the operator is leaving: `no`, `when_home` or `now`.
    pub leaving: &'static str,
    /// Commanded speed, in 64ths of the planned one.
    pub speed_64ths: i8,
    /// Joints and driven wheels that were heard, in channel order.
    pub channels: Vec<ChannelOf>,
    /// Poses of the scene's bodies, world_from_body, `x y z qw qx qy qz`.
    pub poses: Vec<[f64; 7]>,
    /// Whether the simulated robot has fallen, and whether the hoist holds it.
    pub simulated: Option<Simulation>,
    /// Messages to the operator, oldest first.
    pub messages: Vec<MessageOf>,
}

/// A motion that can be played.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct MotionOf {
    /// Its name.
    pub name: String,
    /// Its command code.
    pub code: Option<u8>,
    /// Whether it repeats.
    pub looping: bool,
}

/// What is being played.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Playing {
    /// The motion, or `from → to`.
    pub name: String,
    /// Its clip in the library.
    pub clip: u8,
    /// Time within it now: that of the frame which the robot reported, gone on since, s.
    pub time_s: f64,
    /// Seconds of it that pass in a second: 0 while it is halted.
    pub rate: f64,
}

/// Telemetry of a joint or driven wheel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelOf {
    /// Its name.
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
    /// It has fallen since the hoist let go of it.
    pub fallen: bool,
    /// The hoist holds it.
    pub held: bool,
}

/// A message to the operator.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MessageOf {
    /// When, s.
    pub at_s: f64,
    /// `note`, `refused` or `warning`.
    pub weight: &'static str,
    /// The message.
    pub text: String,
}

/// The snapshot of an operator's view.
pub fn robot_view(
    view: &View,
    robot: &Robot,
    catalog: Option<&Catalog>,
    simulated: Option<&Simulated>,
) -> RobotView {
    let library = view.hello.and_then(|hello| hello.library);
    let catalog = catalog.filter(|catalog| Some(catalog.library) == library);
    let names: Vec<String> = robot.channels().map(|channel| channel.name().to_owned()).collect();
    let name = |channel: u8| names.get(usize::from(channel)).cloned();
    let fault = |fault: &FaultView| {
        describe::fault_report(fault.fault, fault.channel.and_then(name), fault.value)
    };
    let channels = view.joints.iter().map(|(&channel, joint)| ChannelOf {
        name: name(channel).unwrap_or_else(|| format!("channel {channel}")),
        position_rad: joint.telemetry.position_rad,
        speed_rad_s: joint.telemetry.velocity_rad_s,
        torque_nm: joint.telemetry.torque_nm,
        age_s: seconds(joint.age_us),
    });
    let message = |message: &rollwalk_host::operator::Message| MessageOf {
        at_s: seconds(message.at_us),
        weight: match message.weight {
            Weight::Note => "note",
            Weight::Refused => "refused",
            Weight::Warning => "warning",
        },
        text: message.text.clone(),
    };
    let playing = view.status.and_then(|status| {
        let clip = status.clip?;
        let name = catalog?.clip(clip)?;
        let rate = match status.state {
            State::Playing => {
                f64::from(view.asked.map_or(FULL_SPEED, |(_, speed)| speed)) / f64::from(FULL_SPEED)
            }
            _ => 0.0,
        };
        let since_us = view.link.status_age_us.unwrap_or(0).min(MOST_SINCE_US);
        let time_s = f64::from(status.frame) / f64::from(RATE_HZ) + rate * seconds(since_us);
        Some(Playing { name, clip, time_s, rate })
    });
    let state = view.status.map(|status| status.state);
    RobotView {
        time_s: seconds(view.now_us),
        contact: view.link.contact,
        round_trip_ms: view.link.round_trip_us.map(|us| us as f64 * 1e-3),
        lost: [view.link.lost, view.link.lost + view.link.received],
        state: state.map(describe::state_name),
        torque: state.is_none_or(|state| state.torque() != Torque::Off),
        can_arm: state == Some(State::Disarmed),
        can_play: matches!(state, Some(State::Ready | State::Playing | State::Paused)),
        paused: state == Some(State::Paused),
        advice: view.advice,
        mismatch: view.mismatch.clone(),
        complaint: view.bus_lost.clone().or_else(|| view.complaint.clone()),
        faults: view.faults.iter().map(fault).collect(),
        motions: catalog.map(motions).unwrap_or_default(),
        playing,
        library: library.map(|identity| format!("{identity:08x}")),
        transfer: view.transfer.map(|transfer| [transfer.done, transfer.total]),
        asking: view.asking.clone(),
        gamepad: None,
        stopping: view.stopping,
        leaving: match view.leaving {
            Leaving::No => "no",
            Leaving::WhenHome => "when_home",
            Leaving::Now => "now",
        },
        speed_64ths: view.speed_64ths,
        channels: channels.collect(),
        poses: poses(view, robot, simulated),
        simulated: simulated
            .and_then(Simulated::grounded)
            .map(|grounded| Simulation { fallen: grounded.has_fallen(), held: grounded.is_held() }),
        messages: view.messages.iter().map(message).collect(),
    }
}

fn seconds(us: u64) -> f64 {
    us as f64 * 1e-6
}

fn motions(catalog: &Catalog) -> Vec<MotionOf> {
    let motion = |motion: &rollwalk_host::catalog::Motion| MotionOf {
        name: motion.name.clone(),
        code: motion.code,
        looping: motion.looping,
    };
    catalog.motions.iter().map(motion).collect()
}

/// Poses of all bodies: of a simulated robot as it is, of a real one with its joints as they were heard, its body as it stands
/// in its nominal pose.
fn poses(view: &View, robot: &Robot, simulated: Option<&Simulated>) -> Vec<[f64; 7]> {
    let tree = Tree::new(robot);
    let mut joint_rad: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
    let mut wheel_rad = vec![0.0; robot.end_effectors.len()];
    let (base_position_m, world_from_body);
    if let Some(grounded) = simulated.and_then(Simulated::grounded) {
        let world = grounded.world();
        (base_position_m, world_from_body) = world.base();
        let shafts: BTreeMap<usize, f64> =
            world.shafts().map(|[angle_rad, ..]| angle_rad).enumerate().collect();
        place(robot, &mut joint_rad, &mut wheel_rad, |channel| shafts.get(&channel).copied());
    } else {
        (base_position_m, world_from_body) = match Standing::new(&tree) {
            Some(standing) => (standing.frames.link_origins[0], standing.frames.world_from_link[0]),
            None => (Vector3::zeros(), Matrix3::identity()),
        };
        place(robot, &mut joint_rad, &mut wheel_rad, |channel| {
            let joint = view.joints.get(&u8::try_from(channel).ok()?)?;
            Some(f64::from(joint.telemetry.position_rad))
        });
    }
    let at = Configuration { base_position_m, world_from_body, joint_rad: &joint_rad };
    drawn(robot, &Frames::new(&tree, &at), &wheel_rad).collect()
}

/// Puts the angles of channels, which are joints and then driven wheels, where the scene wants them.
fn place(
    robot: &Robot,
    joint_rad: &mut [f64],
    wheel_rad: &mut [f64],
    angle_rad: impl Fn(usize) -> Option<f64>,
) {
    let joints = joint_rad.len();
    for (channel, joint) in joint_rad.iter_mut().enumerate() {
        *joint = angle_rad(channel).unwrap_or(*joint);
    }
    let driven =
        turning_wheels(robot).filter(|&j| robot.end_effectors[j].contact.actuator().is_some());
    for (channel, j) in (joints..).zip(driven) {
        wheel_rad[j] = angle_rad(channel).unwrap_or(0.0);
    }
}
