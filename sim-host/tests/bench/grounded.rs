//! Demo robot on the ground: hoist, standing, falls, IMU.

use crate::agilebot::{SQUAT, agilebot, library};
use crate::{S, connect};
use rollwalk_host::session::Session;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::push::Shove;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::{ClipId, LibrarySpec, MotionSpec, TransitionSpec, encode};
use rollwalk_protocol::wire::{Action, State};
use rollwalk_sim_host::ground::{Fall, Grounded, Moving};
use rollwalk_sim_host::rig::Rig;
use std::f32::consts::TAU;
use std::sync::Arc;

/// Robot in the hoist above a plane with the slope `slope_rad`. Its library is flashed.
fn in_hoist(slope_rad: f64) -> Session<Rig> {
    pushed(slope_rad, Vec::new())
}

/// Robot in the hoist above a plane with the slope `slope_rad`, with pushes. Its library is flashed.
fn pushed(slope_rad: f64, shoves: Vec<Shove>) -> Session<Rig> {
    let robot = agilebot();
    let ground: Arc<dyn Ground> = Arc::new(Plane::rising(slope_rad));
    let rig = Rig::new(&robot).unwrap().onto_ground(&robot, &ground, shoves);
    let mut session = connect(rig);
    session.flash(&library(&robot), |_| {}).unwrap();
    session
}

fn ground(session: &Session<Rig>) -> &Grounded {
    session.bus().body().ground().unwrap()
}

/// Ratio of the force on the feet to the robot's weight.
fn weight_fraction(session: &Session<Rig>) -> f64 {
    let robot = agilebot();
    let mass_kg: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
    let touches =
        (0..robot.end_effectors.len()).map(|number| ground(session).world().touch(number));
    touches.map(|touch| touch.force.z).sum::<f64>() / (9.81 * mass_kg)
}

#[test]
fn a_robot_hangs_in_the_hoist_until_it_plays_and_again_without_torque() {
    let mut session = in_hoist(0.0);
    session.run_for(S).unwrap();
    assert!(ground(&session).is_held());
    assert!(weight_fraction(&session).abs() < 0.3, "{}", weight_fraction(&session));
    session.arm().unwrap();
    session.run_for(2 * S).unwrap();
    assert!(!ground(&session).is_held());
    assert!((weight_fraction(&session) - 1.0).abs() < 0.01, "{}", weight_fraction(&session));
    session.disarm().unwrap();
    session.run_for(5 * S).unwrap();
    assert!(ground(&session).is_held());
    assert_eq!(ground(&session).falls(), []);
}

/// A robot that is armed soon after the hoist picked it up is released at its standing height, not below.
#[test]
fn the_hoist_releases_a_robot_at_its_standing_height() {
    let mut session = in_hoist(0.0);
    session.arm().unwrap();
    session.run_for(2 * S).unwrap();
    let height_m = |session: &Session<Rig>| ground(session).world().base().0.z;
    let standing_m = height_m(&session);
    for wait_us in [3_700_000, 5 * S] {
        session.disarm().unwrap();
        session.run_for(wait_us).unwrap();
        assert!(ground(&session).is_held());
        session.arm().unwrap();
        for _ in 0..40 {
            session.run_for(S / 20).unwrap();
            if !ground(&session).is_held() {
                let off_m = height_m(&session) - standing_m;
                assert!(off_m.abs() < 0.003, "{off_m} m from its standing height");
            }
        }
        assert!(!ground(&session).is_held());
    }
    assert_eq!(ground(&session).falls(), []);
}

#[test]
fn what_became_of_each_clip_in_the_world_is_told() {
    let mut session = in_hoist(0.0);
    session.arm().unwrap();
    session.select(SQUAT).unwrap();
    session.run_for(5 * S).unwrap();
    session.return_to_safe().unwrap();
    session.disarm().unwrap();
    let rig = &mut session.into_bus();
    let travels = rig.take_travels();
    let squat =
        travels.iter().find(|travel| travel.clip() == Some(ClipId(1))).expect("it was played");
    assert!(squat.duration_s() > 3.0, "{squat:?}");
    // Without a planner, the wheels roll forth and back against the swinging legs, and slip. The robot stays in place, but
    // needs work.
    let (way, totals) = (squat.displacement(), squat.totals());
    assert!(way.forward_m.hypot(way.left_m) < 0.1 && way.turn_rad.abs() < 0.2, "{way:?}");
    assert!(totals.tilt_max_rad < 0.2 && totals.slid_m > 0.1 && totals.work_j > 0.1, "{totals:?}");
    assert!(totals.force_max_n > 10.0 && totals.force_max_n < 100.0, "{totals:?}");
    assert_eq!(rig.take_travels(), []);
}

/// A robot in closed loop plays no clip. Its travel is recorded all the same.
#[test]
fn the_travel_of_a_robot_that_follows_setpoints_is_recorded() {
    let mut session = in_hoist(0.0);
    session.arm().unwrap();
    session.command("follow setpoints", Action::Stream).unwrap();
    // Without set-points the controller holds SAFE, and the robot then sinks damped.
    session.run_for(S).unwrap();
    let travels = session.bus_mut().take_travels();
    let streamed = travels.iter().find(|travel| travel.motion == Moving::Setpoints);
    let streamed = streamed.expect("it followed set-points");
    assert_eq!(streamed.clip(), None);
    assert!(streamed.duration_s() > 0.2, "{streamed:?}");
}

#[test]
fn what_is_played_on_the_ground_is_the_same_to_the_bit() {
    let run = || {
        let mut session = in_hoist(0.0);
        session.arm().unwrap();
        session.select(SQUAT).unwrap();
        session.run_for(4 * S).unwrap();
        let (origin, rotation) = ground(&session).world().base();
        assert!(rotation[(2, 2)] > 0.99, "it stands");
        (origin.map(f64::to_bits), session.bus().body().values())
    };
    assert_eq!(run(), run());
}

#[test]
fn a_robot_that_leans_too_far_is_stopped_by_its_imu() {
    // The slope exceeds the tilt that the controller allows.
    let mut session = in_hoist(0.5);
    session.arm().unwrap();
    session.run_for(S / 10).unwrap();
    assert!(!ground(&session).is_held(), "it has been set down");
    session.run_for(4 * S).unwrap();
    let status = session.status().unwrap();
    assert!(status.faults.contains(Fault::Tilt) && status.state != State::Playing, "{status:?}");
}

#[test]
fn a_robot_that_is_pushed_over_lies_until_it_has_had_no_torque_for_a_while() {
    let mut session = pushed(0.0, vec![Shove::new(4.0, 0.2, [0.0, 60.0, 0.0])]);
    session.arm().unwrap();
    while ground(&session).falls().is_empty() {
        session.run_for(S / 10).unwrap();
        assert!(session.bus().now().as_s() < 20.0, "it falls");
    }
    let [fall] = ground(&session).falls() else { panic!("it falls once") };
    assert!(fall.how.tilt_rad > 0.9 && fall.at.as_s() > 4.0, "{fall:?}");
    // The IMU has caused torque-off, and the body lies on the ground.
    session.run_for(2 * S).unwrap();
    assert!(session.status().unwrap().faults.contains(Fault::Tilt));
    let world = ground(&session).world();
    assert!(!ground(&session).is_held() && world.force_on_links().z > 5.0, "it lies");
    let (clearance_m, speed_m_s) = (world.clearance_m(), world.com().1.norm());
    assert!(clearance_m > -5e-3 && speed_m_s < 0.1, "{clearance_m} m, {speed_m_s} m/s");
    session.run_for(6 * S).unwrap();
    assert!(ground(&session).is_held());
    assert_eq!(ground(&session).falls().len(), 1);
    // In the hoist, the robot becomes upright, so that it can be armed again.
    session.clear().unwrap();
    session.arm().unwrap();
    session.run_for(3 * S).unwrap();
    assert!(!ground(&session).is_held() && ground(&session).falls().len() == 1);
    assert!((weight_fraction(&session) - 1.0).abs() < 0.02, "{}", weight_fraction(&session));
}

/// A robot that sinks onto its links without torque has not fallen.
#[test]
fn a_robot_without_torque_sinks_down_and_is_picked_up() {
    let mut session = in_hoist(0.0);
    session.arm().unwrap();
    session.run_for(2 * S).unwrap();
    session.disarm().unwrap();
    session.run_for(2 * S).unwrap();
    assert!(!ground(&session).is_held());
    session.run_for(5 * S).unwrap();
    assert!(ground(&session).is_held());
    assert_eq!(ground(&session).falls(), []);
}

/// Falls of a robot whose SAFE motion lies on the body, in the pose in which `motions/stand_up.toml` begins. A second motion, a
/// loop if `looping`, rises to the nominal pose and lies down again.
fn falls_from_lying(looping: bool, rises: bool) -> Vec<Fall> {
    let robot = agilebot();
    let config = robot.controller_config().unwrap();
    let angle = |name: &str| -> f32 {
        let of = |front, rear| if name.starts_with("front") { front } else { rear };
        match name {
            _ if name.ends_with("roll") => of(0.89, 0.17),
            _ if name.ends_with("pitch") => of(-0.89, 1.59),
            _ if name.ends_with("knee") => of(-1.06, -0.21),
            _ => of(0.46, 0.0),
        }
    };
    let wheels = config.channels.len() - robot.joints.len();
    let pose = |up: f32| -> Vec<f32> {
        let joints = robot.joints.iter();
        let angles = joints.map(|joint| {
            let low = angle(&joint.name);
            low + up * (joint.nominal_rad as f32 - low)
        });
        angles.chain(std::iter::repeat_n(0.0, wheels)).collect()
    };
    let still = [pose(0.0), pose(0.0)].concat();
    let wave = |k: usize| 0.5 - 0.5 * (TAU * k as f32 / 240.0).cos();
    let rise: Vec<f32> = (0..240).flat_map(|k| pose(wave(k))).collect();
    let motion =
        |name, code, looping, frames| MotionSpec { name, code, looping, frames, torques: &[] };
    let spec = LibrarySpec {
        config: &config,
        motions: &[motion("lie", 1, false, &still), motion("rise", 2, looping, &rise)],
        transitions: &[
            TransitionSpec::new(0, 1, 1, 0, &still),
            TransitionSpec::new(1, if looping { 0 } else { 239 }, 0, 0, &still),
        ],
        safe: 0,
    };
    let mut bytes = vec![0; 1 << 16];
    let length = encode(&spec, &mut bytes).unwrap();
    let level: Arc<dyn Ground> = Arc::new(Plane::rising(0.0));
    let mut session = connect(Rig::new(&robot).unwrap().onto_ground(&robot, &level, Vec::new()));
    session.flash(&bytes[..length], |_| {}).unwrap();
    session.arm().unwrap();
    session.run_for(4 * S).unwrap();
    let on_body_n = ground(&session).world().force_on_links().z;
    assert!(!ground(&session).is_held() && on_body_n > 5.0, "it lies: {on_body_n}");
    if rises {
        session.select(2).unwrap();
        session.run_for(5 * S).unwrap();
    }
    ground(&session).falls().to_vec()
}

#[test]
fn a_robot_that_begins_on_its_body_has_not_fallen() {
    assert_eq!(falls_from_lying(false, false), []);
}

/// Loops are motions on the feet, so that a robot that sinks to the ground in one has fallen. Other motions may lie down.
#[test]
fn a_robot_that_has_risen_from_its_body_falls_in_loops_only() {
    let falls = falls_from_lying(true, true);
    assert!(falls.len() == 1 && !falls[0].how.is_toppled(), "{falls:?}");
    assert_eq!(falls_from_lying(false, true), []);
}
