//! Minimal robot and its library, for tests and for campaigns of many runs. The robot is one leg with hip, knee and an actuated
//! wheel.

use nalgebra::{Isometry3, Matrix3, Vector3};
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_robot::shape::DEFAULT_CLEARANCE_MARGIN_M;
use rollwalk_robot::{Actuator, Contact, EndEffector, Joint, Link, Robot};
use std::collections::BTreeMap;
use std::f32::consts::TAU;

/// Code of the motion that stands still.
pub const STAND: u8 = 1;
/// Code of a loop of one second that swings hip and knee.
pub const SWING: u8 = 2;
/// Code of a loop with the wheel turning at [`ROLL_RAD_S`].
pub const ROLL: u8 = 3;
/// Code of a motion that bends the leg, straightens it, and ends.
pub const BOW: u8 = 4;

/// Speed of the wheel in [`ROLL`], rad/s.
pub const ROLL_RAD_S: f32 = 4.0;

const POSE: [f32; 3] = [0.3, -0.6, 0.0];

fn actuator(bus: u8, id: u8, kp_nm_rad: f64, kd_nm_s_rad: f64) -> Actuator {
    Actuator {
        model: "test".into(),
        speed_max_rad_s: 6.0,
        torque_max_nm: 3.0,
        torque_speed: None,
        kp_nm_rad,
        kd_nm_s_rad,
        armature_kg_m2: 0.005,
        bus,
        id,
    }
}

/// Robot with hip and wheel on bus 0, and knee on bus 1.
pub fn robot() -> Robot {
    let link = |name: &str, mass_kg: f64, com_z_m: f64| Link {
        name: name.into(),
        mass_kg,
        com_in_link_m: Vector3::new(0.0, 0.0, com_z_m),
        inertia_in_link_kg_m2: Matrix3::from_diagonal_element(1e-3 * mass_kg),
        shapes: Vec::new(),
    };
    let joint = |name: &str, parent, child, z_m, nominal_rad, actuator| Joint {
        name: name.into(),
        parent,
        child,
        parent_from_joint: Isometry3::translation(0.0, 0.0, z_m),
        axis_in_joint: Vector3::y(),
        travel_m_per_rad: None,
        position_min_rad: -1.5,
        position_max_rad: 1.5,
        nominal_rad,
        actuator,
        motor_per_joint: Vec::new(),
        linkage: None,
        spring: None,
    };
    Robot {
        name: "one_leg".into(),
        links: vec![link("body", 2.0, 0.0), link("thigh", 0.3, -0.06), link("shank", 0.2, -0.08)],
        joints: vec![
            joint("hip", 0, 1, 0.0, 0.3, actuator(0, 1, 60.0, 1.5)),
            joint("knee", 1, 2, -0.12, -0.6, actuator(1, 1, 60.0, 1.5)),
        ],
        end_effectors: vec![EndEffector {
            name: "wheel".into(),
            link: 2,
            center_in_link_m: Vector3::new(0.0, 0.0, -0.12),
            radius_m: 0.05,
            friction_coefficient: 0.8,
            contact: Contact::ActuatedWheel {
                axis_in_link: Vector3::y(),
                actuator: actuator(0, 2, 0.0, 0.5),
            },
            soft: None,
        }],
        buses: BTreeMap::new(),
        clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
    }
}

/// Controller configuration of [`robot`].
pub fn config() -> RobotConfig {
    robot().controller_config().unwrap()
}

/// Frames of the motion with the given code.
///
/// # Panics
/// Panics if no motion has this code.
pub fn motion(code: u8) -> Vec<f32> {
    let frames: Vec<[f32; 3]> = match code {
        STAND => vec![POSE; 2],
        SWING => (0..60).map(|k| swing(k as f32 / 60.0, 0.25)).collect(),
        ROLL => (0..30).map(|_| [POSE[0], POSE[1], ROLL_RAD_S]).collect(),
        BOW => (0..=90).map(|k| bow(k as f32 / 90.0)).collect(),
        _ => panic!("no motion has code {code}"),
    };
    frames.concat()
}

fn swing(turn: f32, amplitude: f32) -> [f32; 3] {
    let s = amplitude * (TAU * turn).sin();
    [POSE[0] + s, POSE[1] - 1.5 * s, 0.0]
}

/// Frame of [`BOW`], which starts and ends at rest; `part` is the fraction of its duration.
fn bow(part: f32) -> [f32; 3] {
    let s = 0.5 - 0.5 * (TAU * part).cos();
    [POSE[0] + 0.5 * s, POSE[1] - 0.7 * s, 0.0]
}

/// Ramp between rest and [`ROLL`].
fn spin(up: bool) -> Vec<f32> {
    let ramp = |k: i32| {
        let u = k as f32 / 40.0;
        let s = u * u * (3.0 - 2.0 * u);
        [POSE[0], POSE[1], ROLL_RAD_S * if up { s } else { 1.0 - s }]
    };
    (0..=40).flat_map(ramp).collect()
}

/// Transition between rest and [`SWING`], lasting one second. The motion is in phase with the loop, and its amplitude grows
/// from 0 to the loop's or shrinks to 0.
fn swell(up: bool) -> Vec<f32> {
    let frame = |k: i32| {
        let u = if up { k } else { 60 - k } as f32 / 60.0;
        swing(k as f32 / 60.0, 0.25 * u * u * (3.0 - 2.0 * u))
    };
    (0..=60).flat_map(frame).collect()
}

/// Library with all four motions; transitions join STAND with each of the other three in both directions.
///
/// # Panics
/// Panics if `config` has other channels than [`robot`].
pub fn library_for(config: &RobotConfig) -> Vec<u8> {
    let codes = [(STAND, "stand"), (SWING, "swing"), (ROLL, "roll"), (BOW, "bow")];
    let frames = codes.map(|(code, _)| motion(code));
    let motions: Vec<_> = codes
        .iter()
        .zip(&frames)
        .map(|(&(code, name), frames)| MotionSpec {
            name,
            code,
            looping: code == SWING || code == ROLL,
            frames,
            torques: &[],
        })
        .collect();
    let still = [POSE; 6].concat();
    let (swell_up, swell_down, spin_up, spin_down) =
        (swell(true), swell(false), spin(true), spin(false));
    let transitions = [
        TransitionSpec::new(0, 1, 1, 0, &swell_up),
        TransitionSpec::new(1, 0, 0, 0, &swell_down),
        TransitionSpec::new(0, 1, 2, 0, &spin_up),
        TransitionSpec::new(2, 0, 0, 0, &spin_down),
        TransitionSpec::new(0, 1, 3, 0, &still),
        TransitionSpec::new(3, 90, 0, 0, &still),
    ];
    let spec = LibrarySpec { config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 1 << 16];
    let length = encode(&spec, &mut bytes).expect("the library is sound");
    bytes.truncate(length);
    bytes
}

/// Library of [`robot`].
pub fn library() -> Vec<u8> {
    library_for(&config())
}
