//! Tests feed-forward torques with drives of every protocol: torques hold a load, begin and end without a jump, and stay within
//! all limits.

use proptest::prelude::*;
use rollwalk_firmware::bus::{Bus, Pose, Protocol};
use rollwalk_firmware::limiter::{MAX_OFFSET_RAD, MAX_OFFSET_RAD_S};
use rollwalk_protocol::actuators::mit::AnswerId;
use rollwalk_protocol::actuators::odrive::Version;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::wire::{
    Action, CommandResult, Parameter, ParameterAction, ParameterResult, State,
};

use crate::protocols::{
    aligned, bench_with, cybergear, dynamixel, feetech, maestro, mit, odrive, slow_down,
};
use crate::rig::Rig;
use crate::robot::{self, CODE_DRIVE, CODE_WALK, STAND, library_with_torques};

const KP: f32 = 20.0;
const LOAD_NM: f32 = 1.0;

/// Library with the torque that holds the load of the first joint.
fn holding(config: &RobotConfig, speed: f32) -> Vec<u8> {
    library_with_torques(config, speed, &|_| [LOAD_NM, 0.0, 0.0])
}

/// Robot with servos of the Rollwalk profile, in SAFE.
fn ready_with(library: &[u8]) -> Rig {
    let mut rig = Rig::new(Some(library));
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig
}

/// Robot with other drives, in SAFE, whose first joint carries a load.
fn loaded(protocol: Protocol) -> Rig {
    let mut config = robot::config();
    let mut like = Bus::default();
    let mut on = [protocol; 2];
    let mut speed = 1.0;
    match protocol {
        Protocol::Dynamixel(_) | Protocol::Feetech(_) => {
            slow_down(&mut config);
            speed = 0.5;
        }
        Protocol::Maestro(_) => {
            like.pose = Pose::AssumedSafe;
            on[1] = Protocol::Rollwalk;
        }
        _ => {}
    }
    let mut rig = bench_with(config.clone(), on, like, &holding(&config, speed));
    rig.drives.list[0].motor.load_nm = -LOAD_NM;
    for drive in &mut rig.drives.list {
        drive.motor.gives_way = true;
        if matches!(protocol, Protocol::Maestro(_)) {
            drive.motor.value = STAND[usize::from(drive.motor.channel.id) - 1];
        }
    }
    aligned(rig)
}

fn set_feed_forward(rig: &mut Rig, value: f32) -> ParameterResult {
    let parameter = Parameter::FeedForward.code();
    rig.parameter(ParameterAction::Set { parameter, channel: 0, value }).result
}

/// A joint without feed-forward torque sags under a load by load / kp. With the torque, the error is below 1 % of the sag plus
/// the resolution of angles and torques in the protocol.
#[test]
fn a_load_is_held_with_every_protocol() {
    // Steps: 12 bits over ±12.5 rad and ±18 N·m; the others are finer.
    for (protocol, steps_rad) in [
        (mit(4, AnswerId::Own), 0.8e-3 + 4.4e-3 / KP),
        (odrive(Version::V06), 0.2e-3),
        (cybergear(), 0.3e-3),
        (dynamixel(), 0.8e-3),
        (feetech(), 0.8e-3),
        (maestro(), 0.6e-3),
    ] {
        let mut rig = loaded(protocol);
        rig.run(100);
        let sag = |rig: &Rig| STAND[0] - rig.drives.list[0].motor.value;
        let held = sag(&rig);
        assert!(held.abs() < 0.01 * LOAD_NM / KP + steps_rad, "{protocol:?}: {held}");
        assert_eq!(set_feed_forward(&mut rig, 0.0), ParameterResult::Ok);
        rig.run(100);
        let sagged = sag(&rig);
        assert!((sagged - LOAD_NM / KP).abs() < steps_rad + 1e-4, "{protocol:?}: {sagged}");
        assert_eq!(rig.brain.state(), State::Ready);
        // Repeatedly through a motion and back.
        assert_eq!(set_feed_forward(&mut rig, 1.0), ParameterResult::Ok);
        assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::Ok);
        rig.run(5);
        rig.run_until(State::Ready, 2000);
        rig.run(60);
        let held = sag(&rig);
        assert!(held.abs() < 0.01 * LOAD_NM / KP + steps_rad, "{protocol:?}: {held}");
    }
}

/// Load on a servo of the Rollwalk profile is held by the feed-forward torque.
#[test]
fn a_load_is_held_with_the_servo_profile() {
    let mut rig = ready_with(&holding(&robot::config(), 1.0));
    rig.servos[0].load_nm = -LOAD_NM;
    rig.run(10);
    let held = (rig.servos[0].value - STAND[0]).abs();
    // Half a percent of the torque and of the gain.
    assert!(held < 0.01 * LOAD_NM / KP + 1e-4, "{held}");
    assert_eq!(set_feed_forward(&mut rig, 0.0), ParameterResult::Ok);
    rig.run(100);
    let sagged = STAND[0] - rig.servos[0].value;
    assert!((sagged - LOAD_NM / KP).abs() < 2e-4, "{sagged}");
    assert_eq!(rig.servos[0].torques.last(), Some(&0.0));
}

/// Torque rises along the ramp to SAFE and is complete when playback can begin. The rig checks every step.
#[test]
fn the_torque_comes_in_along_the_ramp() {
    let mut rig = Rig::new(Some(&holding(&robot::config(), 1.0)));
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    let torques = rig.servos[0].torques.clone();
    assert_eq!(torques[0], 0.0);
    assert!(torques.len() > 60);
    assert!(torques.windows(2).all(|t| t[1] >= t[0] - 1e-3 && t[1] - t[0] < 0.06), "{torques:?}");
    rig.run(5);
    let ready = rig.servos[0].torques[torques.len() - 2..].to_vec();
    assert!(ready.iter().all(|t| (t - LOAD_NM).abs() < 5e-3), "{ready:?}");
}

/// Stops remove the torques at once: a lost servo, DISARM, emergency stop.
#[test]
fn no_torque_but_while_driven() {
    for stop in 0..3 {
        let mut rig = ready_with(&holding(&robot::config(), 1.0));
        assert!(rig.brain.setpoint(0).unwrap().torque_nm > 0.9);
        match stop {
            0 => rig.servos[1].powered = false,
            1 => drop(rig.command(Action::Disarm)),
            _ => rig.estop(),
        }
        if stop < 2 {
            rig.run_until(State::Damped, 600);
            let from = rig.servos[0].torques.len();
            rig.run(3);
            assert!(rig.servos[0].torques.len() > from);
            assert!(rig.servos[0].torques[from..].iter().all(|&t| t == 0.0));
            assert_eq!(rig.brain.setpoint(0).unwrap().torque_nm, 0.0);
        } else {
            assert!(rig.brain.setpoint(0).is_none());
        }
    }
}

/// Torque remains during a pause, because a halted robot must stand.
#[test]
fn a_pause_keeps_the_torque() {
    let mut rig = ready_with(&holding(&robot::config(), 1.0));
    rig.servos[0].load_nm = -LOAD_NM;
    assert_eq!(rig.play(CODE_WALK).result, CommandResult::Ok);
    rig.run(200);
    assert_eq!(rig.command(Action::Pause).result, CommandResult::Ok);
    rig.run(200);
    assert_eq!(rig.brain.state(), State::Paused);
    let target = rig.brain.setpoint(0).unwrap();
    assert!((target.torque_nm - LOAD_NM).abs() < 1e-3, "{target:?}");
    assert!((rig.servos[0].value - target.value).abs() < 0.01 * LOAD_NM / KP + 1e-4);
}

/// Wheel drives receive their torque, or a speed offset that they turn into it.
#[test]
fn wheels_are_fed_too() {
    let wheel_nm = 0.25;
    let of_wheel = |_: &[f32]| [0.0, 0.0, wheel_nm];
    let rig = ready_with(&library_with_torques(&robot::config(), 1.0, &of_wheel));
    let told = rig.servos[2].torques[rig.servos[2].torques.len() - 1];
    assert!((told - wheel_nm).abs() < 0.004 * wheel_nm, "{told}");

    let mut config = robot::config();
    slow_down(&mut config);
    let library = library_with_torques(&config, 0.5, &of_wheel);
    let rig = aligned(bench_with(config.clone(), [dynamixel(); 2], Bus::default(), &library));
    let kd = config.channels[2].kd_nm_s_rad;
    let speed = rig.brain.setpoint(2).unwrap().value;
    assert!((speed - wheel_nm / kd).abs() < 0.01, "{speed}");
}

/// Offset in place of a torque is limited.
#[test]
fn an_offset_is_limited() {
    let mut config = robot::config();
    slow_down(&mut config);
    // With kp 20 a sixth of a radian or more; with kd 0.5, 6 rad/s.
    let library = library_with_torques(&config, 0.5, &|_| [3.0, -3.0, 3.0]);
    let mut rig = aligned(bench_with(config, [dynamixel(); 2], Bus::default(), &library));
    rig.run(100);
    for (channel, (sign, safe)) in [1.0, -1.0, 1.0].into_iter().zip(STAND).enumerate() {
        let most = if channel < 2 { MAX_OFFSET_RAD } else { MAX_OFFSET_RAD_S };
        let value = rig.brain.setpoint(channel).unwrap().value;
        assert!((value - safe - sign * most).abs() < 1e-3, "{channel}: {value}");
        assert_eq!(rig.brain.setpoint(channel).unwrap().torque_nm, 0.0);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Set-points stay within position, rate and torque limits for any torques that the format permits and any settings at run
    /// time. Torques change gradually, and the pose is still reached. The rig checks every frame.
    #[test]
    fn hostile_torques_stay_within_all_limits(
        seeds in prop::array::uniform3(1.0f32..500.0),
        share in 0.0f32..=1.0,
        gain in 0.0f32..40.0,
    ) {
        let config = robot::config();
        // A different number between −limit and limit for each value.
        let wild = |frame: &[f32]| {
            let of = |i: usize| (frame[i] * seeds[i] * 1e3 + seeds[(i + 1) % 3]).sin();
            [0, 1, 2].map(|i| config.channels[i].max_torque_nm * of(i) * 0.49)
        };
        let library = library_with_torques(&config, 1.0, &wild);
        let mut rig = ready_with(&library);
        let kp = Parameter::Kp.code();
        rig.parameter(ParameterAction::Set { parameter: kp, channel: 0, value: gain });
        prop_assert_eq!(rig.play(CODE_WALK).result, CommandResult::Ok);
        rig.run(100);
        prop_assert_eq!(set_feed_forward(&mut rig, share), ParameterResult::Ok);
        rig.run(100);
        prop_assert_eq!(rig.command(Action::Play { code: CODE_DRIVE, speed_64ths: 20 }).result, CommandResult::Ok);
        rig.run(300);
        prop_assert!(matches!(rig.brain.state(), State::Playing | State::Ready));
        for (channel, servo) in rig.servos.iter().enumerate() {
            let torque_nm = rig.brain.setpoint(channel).unwrap().torque_nm;
            prop_assert!(torque_nm.abs() <= servo.channel.max_torque_nm * share + 1e-6);
        }
    }
}
