//! Control loop closed by the controller: drives receive torques, and joints with inertia follow.

use crate::protocols::{aligned, bench_of, cybergear, dynamixel, mit, odrive, slow_down};
use crate::rig::Rig;
use crate::robot::{self, CODE_DRIVE, STAND};
use rollwalk_drives::DriveCommand;
use rollwalk_firmware::bus::{Bus, ControlLoop, Protocol};
use rollwalk_protocol::actuators::mit::AnswerId;
use rollwalk_protocol::actuators::odrive::Version;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::{CommandResult, State};

/// Inertia of every joint and wheel, kg·m².
const INERTIA: f32 = 0.05;
/// Stiffness kp of the joints, N·m/rad.
const KP: f32 = 20.0;
/// Damping kd of the joints, N·m·s/rad.
const KD: f32 = 0.5;

fn protocols() -> [Protocol; 4] {
    [mit(4, AnswerId::Own), odrive(Version::V06), cybergear(), dynamixel()]
}

/// Largest rounding error of a commanded torque, N·m: half a step of an AK80-9's 12 bits over ±18 N·m, or a step of 2.69 mA.
const ROUNDING_NM: f32 = 4.5e-3;

fn bench(protocol: Protocol) -> Rig {
    let mut config = robot::config();
    if matches!(protocol, Protocol::Dynamixel(_)) {
        slow_down(&mut config);
    }
    let like = Bus { control: ControlLoop::OnController, ..Bus::default() };
    let mut rig = bench_of(config, [protocol; 2], like);
    for drive in &mut rig.drives.list {
        drive.motor.inertia_kg_m2 = INERTIA;
    }
    rig
}

fn ready(protocol: Protocol) -> Rig {
    aligned(bench(protocol))
}

#[test]
fn joints_follow_a_motion() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::Ok);
        let mut worst = [0.0f32; 3];
        for _ in 0..400 {
            rig.step();
            for (channel, (drive, worst)) in rig.drives.list.iter().zip(&mut worst).enumerate() {
                let target = rig.brain.setpoint(channel).unwrap().value;
                *worst = worst.max((drive.motor.value - target).abs());
            }
        }
        assert_eq!(rig.brain.state(), State::Ready);
        // kp alone accelerates the joint: with 0.05 kg·m², a bump of 0.4 rad in 1.5 s needs 0.18 N·m, 9 mrad. A wheel has no
        // integral term: an acceleration of 19 rad/s² needs an error of 1.9 rad/s.
        assert!(worst[0] < 0.04 && worst[1] < 0.04, "{protocol:?}: {worst:?}");
        assert!(worst[2] < 2.3, "{protocol:?}: {worst:?}");
        rig.run(200);
        for (drive, safe) in rig.drives.list.iter().zip(STAND).take(2) {
            // A step of position and a step of torque.
            let error = (drive.motor.value - safe).abs();
            assert!(error < 1.6e-3 + ROUNDING_NM / KP, "{protocol:?}: {error}");
        }
    }
}

/// A joint sags under a load by load / kp, with the gain kp of the channel.
#[test]
fn a_load_is_held_by_the_gain_of_the_channel() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        rig.drives.list[0].motor.load_nm = -1.0;
        rig.run(600);
        assert_eq!(rig.brain.state(), State::Ready);
        let sag = STAND[0] - rig.drives.list[0].motor.value;
        assert!((sag - 1.0 / KP).abs() < 1.6e-3 + ROUNDING_NM / KP, "{protocol:?}: {sag}");
    }
}

#[test]
fn torque_stays_within_the_channel() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        let most = rig.drives.list[0].motor.channel.max_torque_nm;
        // A load beyond the torque of the drive.
        rig.drives.list[0].motor.load_nm = -2.0 * most;
        rig.run(20);
        let largest = rig.drives.list[0].motor.largest_torque_nm;
        assert!((largest - most).abs() < ROUNDING_NM, "{protocol:?}: {largest}");
    }
}

/// An enabled drive receives no torque until the ramp begins at the measured position.
#[test]
fn no_enable_kick() {
    for protocol in protocols() {
        let mut rig = bench(protocol);
        rig.arm();
        rig.drives.clear_logs();
        rig.run(40);
        for drive in &rig.drives.list {
            let enabled = drive.motor.log.iter().position(|&s| s == DriveCommand::Enable).unwrap();
            let torques = drive.motor.log[enabled..].iter().filter_map(|s| match s {
                DriveCommand::Torque(nm) => Some(nm.abs()),
                _ => None,
            });
            let first: Vec<f32> = torques.take(3).collect();
            assert!(first.iter().all(|&nm| nm < 0.05), "{protocol:?}: {first:?}");
        }
    }
}

/// Stale measurements do not describe the current state: the controller computes no torque from them.
#[test]
fn stale_feedback_makes_no_torque() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        rig.drives.list[0].motor.load_nm = -1.0;
        rig.run(600);
        rig.drives.list[0].mute = true;
        rig.run(4);
        assert_eq!(rig.brain.state(), State::Ready);
        let torque = rig.drives.list[0].motor.torque_nm;
        assert!(torque.abs() < ROUNDING_NM, "{protocol:?}: {torque}");
        rig.run_until(State::Damped, 20);
        assert!(rig.brain.faults().contains(Fault::ActuatorSilent));
        rig.run(100);
        assert!(rig.drives.list[0].motor.torque_nm.abs() < ROUNDING_NM, "{protocol:?}");
    }
}

/// A damped joint that swings loses its speed with the time constant inertia / kd, for every drive.
#[test]
fn damping_is_the_controllers_own() {
    for protocol in protocols() {
        let mut rig = ready(protocol);
        rig.drives.list[1].mute = true;
        rig.run_until(State::Damped, 40);
        rig.drives.list[1].mute = false;
        let start = 2.0;
        rig.drives.list[0].motor.speed_rad_s = start;
        let ticks = 12;
        rig.run(ticks);
        let speed = rig.drives.list[0].motor.speed_rad_s;
        let expected = start * (-KD / INERTIA * ticks as f32 / 120.0).exp();
        // Two of twelve periods are dead time.
        assert!(
            (speed - expected).abs() < 0.2 * expected + 0.03,
            "{protocol:?}: {speed} for {expected}"
        );
    }
}
