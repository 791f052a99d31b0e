//! Robots of 48 and 64 channels on four buses in virtual time, with wheels at 200 rad/s: a library is flashed and played.

use crate::{S, connect};
use nalgebra::{Isometry3, Matrix3, Vector3};
use rollwalk_host::session::Session;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_protocol::wire::{FromController, State};
use rollwalk_robot::shape::DEFAULT_CLEARANCE_MARGIN_M;
use rollwalk_robot::{Actuator, Contact, EndEffector, Joint, Link, Robot};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::rig::Rig;
use std::collections::{BTreeMap, BTreeSet};
use std::f32::consts::TAU;

const STAND: u8 = 1;
const GO: u8 = 2;
const SPEED_RAD_S: f32 = 200.0;
/// Joints of a leg; its fourth channel is the wheel.
const JOINTS: usize = 3;
/// Frames of a ramp to [`SPEED_RAD_S`]. Grip allows μ g / r = 157 rad/s², and the ramp needs 1.5 · 200 rad/s / 2.33 s.
const RAMP: usize = 140;

/// Robot with legs of three joints and a wheel, on four buses.
fn robot(legs: usize) -> Robot {
    let actuator = |leg: usize, number: usize| Actuator {
        model: "test".into(),
        speed_max_rad_s: if number < JOINTS { 6.0 } else { 210.0 },
        torque_max_nm: 3.0,
        torque_speed: None,
        kp_nm_rad: if number < JOINTS { 60.0 } else { 0.0 },
        kd_nm_s_rad: if number < JOINTS { 1.5 } else { 0.5 },
        armature_kg_m2: 0.005,
        bus: (leg % 4) as u8,
        id: (4 * (leg / 4) + number + 1) as u8,
    };
    let link = |name: String, mass_kg: f64| Link {
        name,
        mass_kg,
        com_in_link_m: Vector3::new(0.0, 0.0, -0.03),
        inertia_in_link_kg_m2: Matrix3::from_diagonal_element(1e-3 * mass_kg),
        shapes: vec![],
    };
    let mut robot = Robot {
        name: "many_legs".into(),
        links: vec![link("body".into(), 5.0)],
        joints: vec![],
        end_effectors: vec![],
        buses: BTreeMap::new(),
        clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
    };
    for leg in 0..legs {
        for number in 0..JOINTS {
            let child = robot.links.len();
            robot.links.push(link(format!("part_{leg}_{number}"), 0.1));
            robot.joints.push(Joint {
                name: format!("joint_{leg}_{number}"),
                parent: if number == 0 { 0 } else { child - 1 },
                child,
                parent_from_joint: Isometry3::translation(0.0, 0.0, -0.06),
                axis_in_joint: Vector3::y(),
                travel_m_per_rad: None,
                position_min_rad: -1.5,
                position_max_rad: 1.5,
                nominal_rad: 0.2,
                actuator: actuator(leg, number),
                motor_per_joint: Vec::new(),
                linkage: None,
                spring: None,
            });
        }
        robot.end_effectors.push(EndEffector {
            name: format!("wheel_{leg}"),
            link: robot.links.len() - 1,
            center_in_link_m: Vector3::new(0.0, 0.0, -0.06),
            radius_m: 0.05,
            friction_coefficient: 0.8,
            contact: Contact::ActuatedWheel {
                axis_in_link: Vector3::y(),
                actuator: actuator(leg, JOINTS),
            },
            soft: None,
        });
    }
    robot
}

/// Library in which all joints swing and all wheels turn, with `share` of their amplitudes.
fn library(config: &RobotConfig, legs: usize) -> Vec<u8> {
    let frame = |phase: f32, share: f32| {
        let joint =
            move |channel: usize| 0.2 + 0.2 * share * (TAU * (phase + channel as f32 / 64.0)).sin();
        (0..JOINTS * legs).map(joint).chain((0..legs).map(move |_| share * SPEED_RAD_S))
    };
    let ramp = |is_up: bool| -> Vec<f32> {
        let at = |k: usize| {
            let u = (if is_up { k } else { RAMP - k }) as f32 / RAMP as f32;
            frame(k as f32 / 70.0, u * u * (3.0 - 2.0 * u))
        };
        (0..=RAMP).flat_map(at).collect()
    };
    let frames = [
        frame(0.0, 0.0).chain(frame(0.0, 0.0)).collect::<Vec<_>>(),
        (0..70).flat_map(|k| frame(k as f32 / 70.0, 1.0)).collect(),
    ];
    let motion =
        |name, code, frames| MotionSpec { name, code, looping: true, frames, torques: &[] };
    let motions = [motion("stand", STAND, &frames[0]), motion("go", GO, &frames[1])];
    let ramps = [ramp(true), ramp(false)];
    let transition = |from, to, frames| TransitionSpec {
        from,
        to,
        exit_frame: 0,
        entry_frame: 0,
        frames,
        torques: &[],
    };
    let transitions = [transition(0, 1, &ramps[0]), transition(1, 0, &ramps[1])];
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 1 << 18];
    let length = encode(&spec, &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

/// Flashes and plays the library of a robot; returns its session while it plays.
fn playing(legs: usize) -> Session<Rig> {
    let robot = robot(legs);
    let config = robot.controller_config().unwrap();
    assert_eq!(config.channels.len(), 4 * legs);
    let mut session = connect(Rig::new(&robot).unwrap());
    session.run_for(S / 2).unwrap();
    session.flash(&library(&config, legs), |_| {}).unwrap();
    session.arm().unwrap();
    session.select(GO).unwrap();
    session.run_for(6 * S).unwrap();
    let state = session.status().unwrap().state;
    assert_eq!(state, State::Playing);
    session
}

/// Checks that joints follow, wheels reach their speed, and the link reports every channel.
fn check(session: &mut Session<Rig>, legs: usize) {
    let rig = session.bus_mut();
    let record = rig.records().last().unwrap().clone();
    assert_eq!(record.measured.len(), 4 * legs);
    for (channel, (&is, &should)) in record.measured.iter().zip(&record.commanded).enumerate() {
        // A joint lags by a control period at 1.3 rad/s, and by its weight of up to 0.3 N·m over 60 N·m/rad.
        let most = if channel < JOINTS * legs { 0.03 } else { 0.5 };
        assert!((is - should).abs() < most, "channel {channel}: {is}, not {should}");
        assert!(channel < JOINTS * legs || is > 199.0, "channel {channel}: {is} rad/s");
    }
    let missed = rig.records().iter().filter(|record| record.missed > 0).count();
    assert_eq!(missed, 0, "of {}", rig.records().len());
    let on_link = rig.log().iter().filter(|entry| entry.interface == Interface::Link);
    let mut seen = BTreeSet::new();
    for entry in on_link {
        if let Ok((_, FromController::JointTelemetry(joint))) = FromController::decode(&entry.frame)
            && (usize::from(joint.channel) < JOINTS * legs || joint.velocity_rad_s > 199.0)
        {
            seen.insert(usize::from(joint.channel));
        }
    }
    assert_eq!(seen, (0..4 * legs).collect());
    session.return_to_safe().unwrap();
    session.disarm().unwrap();
}

#[test]
fn a_robot_of_48_channels_plays_on_four_buses() {
    let mut session = playing(12);
    let buses: Vec<_> = session.bus_mut().bus_statistics();
    assert_eq!(buses.len(), 5, "the link and four buses");
    check(&mut session, 12);
}

#[test]
fn a_robot_of_64_channels_plays() {
    check(&mut playing(16), 16);
}
