//! View of a robot for the page: described state and faults, motions, joints, and poses of its bodies.

use super::simulated::Simulated;
use crate::messages::robot::{
    ChannelTelemetry, OperatorMessage, PlayableMotion, PlayingClip, RobotView, Simulation,
};
use crate::scene::{poses as drawn, turning_wheels};
use nalgebra::{Matrix3, Vector3};
use rollwalk_host::actuators::Actuators;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe;
use rollwalk_host::operator::{ExitStage, FaultView, View, Weight};
use rollwalk_multibody::{Configuration, Frames, Standing, Tree};
use rollwalk_protocol::library::RATE_HZ;
use rollwalk_protocol::wire::{State, Torque};
use rollwalk_robot::Robot;
use std::collections::BTreeMap;

/// Maximum time for which a motion is extrapolated from the robot's most recent report, µs: three report intervals.
const MOST_SINCE_US: u64 = 150_000;
/// Planned speed, in 64ths.
const FULL_SPEED: i8 = 64;

/// Converts an operator's view to the snapshot for the page.
pub fn robot_view(
    view: &View,
    robot: &Robot,
    actuators: &Actuators,
    catalog: Option<&Catalog>,
    simulated: Option<&Simulated>,
) -> RobotView {
    let library = view.hello.and_then(|hello| hello.library);
    let names: Vec<String> = robot.channels().map(|channel| channel.name().to_owned()).collect();
    let name = |channel: u8| names.get(usize::from(channel)).cloned();
    let fault = |fault: &FaultView| {
        let FaultView { fault, channel, value, .. } = *fault;
        describe::fault_report_on(fault, channel, channel.and_then(name), value, actuators)
    };
    let channels = view.joints.iter().map(|(&channel, joint)| ChannelTelemetry {
        name: name(channel).unwrap_or_else(|| format!("channel {channel}")),
        position_rad: joint.telemetry.position_rad,
        speed_rad_s: joint.telemetry.velocity_rad_s,
        torque_nm: joint.telemetry.torque_nm,
        age_s: seconds(joint.age_us),
        temperature_c: joint.readings.and_then(|of| of.temperature_c),
        voltage_v: joint.readings.and_then(|of| of.voltage_v),
    });
    let message = |message: &rollwalk_host::operator::Message| OperatorMessage {
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
        let name = catalog.and_then(|catalog| catalog.clip(clip));
        let name = name.unwrap_or_else(|| format!("clip {clip}"));
        let rate = match status.state {
            State::Playing => {
                f64::from(view.asked.map_or(FULL_SPEED, |(_, speed)| speed)) / f64::from(FULL_SPEED)
            }
            _ => 0.0,
        };
        let since_us = view.link.status_age_us.unwrap_or(0).min(MOST_SINCE_US);
        let time_s = f64::from(status.frame) / f64::from(RATE_HZ) + rate * seconds(since_us);
        Some(PlayingClip { name, clip, time_s, rate })
    });
    let state = view.status.map(|status| status.state);
    RobotView {
        time_s: seconds(view.now_us),
        contact: view.link.contact,
        round_trip_ms: view.link.round_trip_us.map(|us| us as f64 * 1e-3),
        lost: [view.link.lost, view.link.lost + view.link.received],
        state: view.status.map(|status| describe::state_words(&status, actuators)),
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
            ExitStage::No => "no",
            ExitStage::WhenHome => "when_home",
            ExitStage::Now => "now",
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

fn motions(catalog: &Catalog) -> Vec<PlayableMotion> {
    let motion = |motion: &rollwalk_host::catalog::CatalogMotion| PlayableMotion {
        name: motion.name.clone(),
        code: motion.code,
        looping: motion.looping,
    };
    catalog.motions.iter().map(motion).collect()
}

/// Poses of all bodies: the actual poses of a simulated robot; for a real robot, measured joint angles with the body in its
/// nominal standing pose.
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
        for (joint, angle_rad) in joint_rad.iter_mut().enumerate() {
            *angle_rad = world.joint(joint)[0];
        }
        sort_angles(robot, &mut joint_rad, &mut wheel_rad, |channel| shafts.get(&channel).copied());
    } else {
        (base_position_m, world_from_body) = match Standing::new(&tree) {
            Some(standing) => (standing.frames.link_origins[0], standing.frames.world_from_link[0]),
            None => (Vector3::zeros(), Matrix3::identity()),
        };
        sort_angles(robot, &mut joint_rad, &mut wheel_rad, |channel| {
            let joint = view.joints.get(&u8::try_from(channel).ok()?)?;
            Some(f64::from(joint.telemetry.position_rad))
        });
    }
    let at = Configuration { base_position_m, world_from_body, joint_rad: &joint_rad };
    drawn(robot, &Frames::new(&tree, &at), &wheel_rad).collect()
}

/// Sorts the angles of channels (joints with a motor, then driven wheels) into the arrays of the scene.
fn sort_angles(
    robot: &Robot,
    joint_rad: &mut [f64],
    wheel_rad: &mut [f64],
    angle_rad: impl Fn(usize) -> Option<f64>,
) {
    let joints = robot.driven_joints().count();
    let transmission = robot.transmission();
    let mut motor_rad = transmission.motors(joint_rad);
    for (channel, joint) in robot.driven_joints().enumerate() {
        motor_rad[joint] = angle_rad(channel).unwrap_or(motor_rad[joint]);
    }
    joint_rad.copy_from_slice(&transmission.joints(&motor_rad));
    let driven =
        turning_wheels(robot).filter(|&j| robot.end_effectors[j].contact.actuator().is_some());
    for (channel, j) in (joints..).zip(driven) {
        wheel_rad[j] = angle_rad(channel).unwrap_or(0.0);
    }
}
