//! Arming: the states from power-on to the SAFE pose, and the preconditions of torque.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_firmware::Settings;
use rollwalk_protocol::actuator::{
    ActuatorStatus, Control, JointSetpoint, KD_STEP_NM_S_RAD, KP_STEP_NM_RAD, POSITION_STEP_RAD,
    WheelSetpoint,
};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::wire::{Action, CommandResult, FromController, Heartbeat, State, Torque};

fn is_setpoint(frame: &Frame) -> bool {
    JointSetpoint::decode(frame).is_some() || WheelSetpoint::decode(frame).is_some()
}

#[test]
fn arms_aligns_plays_and_comes_back() {
    let mut rig = Rig::ready();
    assert!(rig.stands());
    for c in 0..2 {
        assert_eq!(rig.brain.setpoint(c).unwrap().slope, 0.0);
    }
    let ack = rig.play(CODE_DRIVE);
    assert_eq!((ack.result, ack.motion), (CommandResult::Ok, Some(DRIVE_CLIP)));
    assert_eq!(rig.brain.state(), State::Playing);
    // The answer contains the start: the motion plays then, and not before.
    let ticks = 2 * u32::from(ack.value);
    rig.run(ticks - 1);
    assert_eq!(rig.clip(), STAND_TO_DRIVE);
    rig.run(2);
    assert_eq!(rig.clip(), DRIVE_CLIP);
    let fastest = (0..400).fold(0.0f32, |most, _| {
        rig.step();
        most.max(rig.servos[2].value)
    });
    // 9 rad/s half way, between two frames.
    assert!((8.98..=9.0).contains(&fastest), "{fastest}");
    assert_eq!(rig.brain.state(), State::Ready);
    assert_eq!(rig.clip(), STAND_CLIP);
    assert!(rig.brain.faults().is_empty());
}

#[test]
fn a_safe_motion_that_ends_serves_as_well() {
    let mut rig = Rig::new(Some(&library_that_settles()));
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig.play(CODE_WALK);
    rig.run(300);
    rig.host_alive = false;
    rig.run_until(State::Damped, 1000);
    assert!(rig.stands());
}

#[test]
fn every_control_rate_plays_the_same_motion() {
    for control_hz in [60, 240, 480, 960] {
        let settings = Settings { control_hz, ..Settings::default() };
        let mut rig = Rig::with(config(), settings, Some(&library()));
        let seconds = |s: u32| s * u32::from(control_hz);
        rig.run(seconds(1));
        rig.arm();
        rig.run_until(State::Ready, seconds(10));
        let ack = rig.play(CODE_DRIVE);
        // The frame at which the wheel is fastest, half way through.
        let middle = u32::from(ack.value) + u32::from(DRIVE_FRAMES) / 2;
        rig.run(middle * u32::from(control_hz) / 60);
        assert!(rig.servos[2].value > 8.9, "{} at {control_hz} Hz", rig.servos[2].value);
        rig.run_until(State::Ready, seconds(10));
    }
}

/// Poses are queried at an interval, not in every control period.
#[test]
fn actuators_are_queried_at_20_hz_while_torque_is_off() {
    let mut rig = Rig::booted();
    rig.buses_up = false;
    let mut queries = 0;
    for _ in 0..rig.settings.control_hz {
        rig.step();
        while let Some(frame) = rig.brain.poll_actuator(0) {
            queries += u32::from(Control::decode(&frame).map(|(_, c)| c) == Some(Control::Query));
        }
    }
    // Two joints.
    assert_eq!(queries, 2 * 20);
}

#[test]
fn nothing_moves_before_arming() {
    let mut rig = Rig::new(Some(&library()));
    rig.buses_up = false;
    for _ in 0..100 {
        rig.step();
        while let Some(frame) = rig.brain.poll_actuator(0) {
            assert!(!is_setpoint(&frame));
            assert_ne!(Control::decode(&frame).map(|(_, c)| c), Some(Control::Enable));
        }
    }
    assert_eq!(rig.brain.state().torque(), Torque::Off);
    assert_eq!(rig.brain.playing().map(|p| p.clip), None::<ClipId>);
}

#[test]
fn scar_2_no_enable_kick() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(100);
    rig.estop();
    rig.run(10);
    rig.clear();
    rig.run(20);
    rig.servos[2].value = 0.0;
    // A person moves the legs until torque is on.
    (rig.servos[0].value, rig.servos[1].value) = (-0.7, 0.6);
    let nonce = rig.command(Action::ArmRequest).value;
    rig.servos[0].value = -0.72;
    rig.command(Action::ArmConfirm { nonce });
    rig.servos[0].value = -0.74;
    while rig.servos.iter().any(|servo| servo.setpoints.is_empty() || !servo.enabled) {
        assert_eq!(rig.brain.state(), State::Aligning);
        rig.step();
    }
    for (servo, pose) in rig.servos.iter().zip([-0.74, 0.6, 0.0]) {
        assert!((servo.setpoints[0].0 - pose).abs() <= POSITION_STEP_RAD, "{:?}", servo.setpoints);
    }
    let first = rig.brain.setpoint(0).unwrap();
    assert!((first.value + 0.74).abs() <= POSITION_STEP_RAD && first.slope == 0.0, "{first:?}");
    rig.run_until(State::Ready, 1000);
}

#[test]
fn whoever_disarms_has_not_just_armed() {
    let mut rig = Rig::booted();
    let nonce = rig.command(Action::ArmRequest).value;
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    let confirm = rig.command(Action::ArmConfirm { nonce });
    assert_eq!(confirm.result, CommandResult::WrongNonce);
    assert_eq!(rig.brain.state(), State::Disarmed);
}

#[test]
fn an_enable_that_has_not_left_is_dropped_by_disarming() {
    let mut rig = Rig::booted();
    rig.arm();
    rig.buses_up = false;
    rig.step();
    rig.command(Action::Disarm);
    for bus in 0..2 {
        assert_eq!(rig.brain.poll_actuator(bus), None, "nothing is meant any more");
    }
}

#[test]
fn a_joint_on_its_stop_is_led_back_into_its_range() {
    let mut rig = Rig::booted();
    rig.servos[0].value = 1.6;
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    assert!(rig.stands());
}

#[test]
fn arming_waits_until_every_actuator_has_confirmed_that_it_is_off() {
    let mut rig = Rig::ready();
    rig.estop();
    rig.clear();
    assert_eq!(rig.brain.state(), State::Disarmed);
    // "Off" is still on its way.
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.run(1);
    rig.arm();
}

/// A torque-off command received before the actuator was switched on does not confirm its later state.
#[test]
fn an_actuator_that_is_on_after_all_is_not_armed() {
    let mut rig = Rig::booted();
    // The servo got "enable" before the stop, and executes it now. Its answer to the stop came first.
    rig.servos[0].enabled = true;
    rig.carry();
    let answer = rig.servos[0].feedback();
    rig.brain.on_actuator_frame(rig.now_us, 0, &answer);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.run(2);
    assert!(!rig.servos[0].enabled, "told again");
    rig.arm();
}

/// Found by the fault campaign: a bad bus may deliver the torque-on command late, after the actuator has confirmed that its
/// torque is off. The actuator then waits for set-points and times out. The torque-off command was not sent again.
#[test]
fn an_actuator_that_timed_out_after_it_was_off_can_be_armed() {
    let mut rig = Rig::booted();
    rig.servos[1].status = ActuatorStatus::TIMED_OUT;
    // The servo is queried at 20 Hz, every 6 ticks: once until it reports torque, and again until it gets "off".
    rig.run(12);
    assert_eq!(rig.servos[1].status, 0);
    rig.arm();
    rig.run_until(State::Ready, 1000);
}

#[test]
fn arming_needs_a_host_and_actuators_that_tell_a_plausible_pose() {
    let mut rig = Rig::booted();
    rig.host_alive = false;
    rig.run(60);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::FaultPresent);

    let mut rig = Rig::booted();
    rig.servos[2].powered = false;
    rig.run(60);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);

    let mut rig = Rig::booted();
    rig.servos[0].value = 1.5 + 0.3;
    rig.run(20);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.servos[0].value = 1.5 + 0.1;
    rig.run(20);
    let nonce = rig.command(Action::ArmRequest).value;
    rig.servos[0].status = ActuatorStatus::HARDWARE;
    rig.run(20);
    let confirm = Action::ArmConfirm { nonce };
    assert_eq!(rig.command(confirm).result, CommandResult::FaultPresent, "checked again");
    assert_eq!(rig.brain.state(), State::Disarmed);
}

#[test]
fn a_change_of_mind_while_actuators_are_enabled_leaves_no_fault() {
    let mut rig = Rig::booted();
    rig.arm();
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    rig.run_until(State::Disarmed, 300);
    assert!(rig.brain.faults().is_empty());
}

#[test]
fn a_robot_that_cannot_get_up_is_let_down() {
    // Joints that stay in place, 0.65 and 0.7 rad from SAFE, which exceeds the tolerance.
    let mut rig = Rig::booted();
    rig.arm();
    let mut strongest = 0.0f32;
    for tick in 0..1000u16 {
        rig.servos[0].value = 0.9;
        rig.servos[0].setpoints.truncate(1);
        if rig.brain.state() == State::Damped {
            break;
        }
        rig.now_us += 8333;
        let beat = Heartbeat { seq: tick as u8, host_ms: 0 };
        rig.send(&beat.encode(me()));
        rig.brain.tick(rig.now_us);
        for bus in 0..2 {
            while let Some(frame) = rig.brain.poll_actuator(bus) {
                if let (0, Some((1, s))) = (bus, JointSetpoint::decode(&frame)) {
                    // The gain would command 20 N·m/rad · 0.65 rad. Gains are rounded to their steps.
                    let torque =
                        s.kp_nm_rad * (s.position_rad - 0.9) + s.kd_nm_s_rad * s.velocity_rad_s;
                    let rounding = KP_STEP_NM_RAD * 0.65 + KD_STEP_NM_S_RAD;
                    assert!(torque.abs() <= 3.0 + rounding, "{torque} N·m by {s:?}");
                    strongest = strongest.max(torque.abs());
                }
            }
        }
        for servo in 0..3 {
            rig.servos[servo].enabled = true;
            let bus = rig.servos[servo].channel.bus;
            let answer = rig.servos[servo].feedback();
            rig.brain.on_actuator_frame(rig.now_us, bus, &answer);
        }
    }
    assert_eq!(rig.brain.state(), State::Damped);
    assert!(rig.brain.faults().contains(Fault::TrackingError));
    rig.send(&Heartbeat { seq: 0, host_ms: 0 }.encode(me()));
    let blamed = rig.heard.iter().rev().find_map(|(_, m)| match m {
        FromController::FaultReport(r) if r.fault == Fault::TrackingError => Some(*r),
        _ => None,
    });
    let blamed = blamed.expect("a report");
    assert_eq!(blamed.channel, Some(1));
    // A quantum of SAFE and a step of the measurement.
    assert!((blamed.value - 0.7).abs() < 2e-3, "{blamed:?}");
    assert!(strongest > 2.9, "it does what it may: {strongest} N·m");
}

#[test]
fn an_unusable_configuration_never_arms() {
    let mut config = config();
    config.channels[0].max_rate = f32::NAN;
    let mut rig = Rig::with(config, Settings::default(), Some(&library()));
    rig.run(20);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    rig.clear();
    rig.run(20);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::WrongState);
    assert!(rig.statuses().last().unwrap().1.faults.contains(Fault::Internal));
}

/// Alignment ramp starts when all actuators are enabled, and only from fresh poses.
#[test]
fn the_ramp_starts_from_fresh_poses_only() {
    let mut rig = Rig::booted();
    rig.arm();
    rig.servos[1].powered = false;
    rig.run(2);
    assert!(rig.servos[0].enabled && !rig.servos[1].enabled);
    rig.servos[0].powered = false;
    rig.servos[0].value = 0.5;
    rig.run(4);
    rig.servos[1].powered = true;
    rig.run(3);
    assert!(rig.servos[1].enabled);
    assert_eq!(rig.brain.setpoint(0), None);
    rig.servos[0].powered = true;
    rig.run(3);
    assert!((rig.servos[0].setpoints[0].0 - 0.5).abs() <= POSITION_STEP_RAD);
}

#[test]
fn an_actuator_that_does_not_come_on_ends_the_attempt() {
    let mut rig = Rig::booted();
    rig.servos[2].refuses = true;
    rig.arm();
    let patience = rig.settings.ticks(rig.settings.align_patience_us);
    let after = rig.run_until(State::Damped, 2 * patience);
    assert!((patience..patience + 3).contains(&after), "{after}");
    assert!(rig.brain.faults().contains(Fault::TrackingError));
    assert!(rig.servos.iter().all(|s| s.setpoints.is_empty()), "no setpoint but damping so far");
}

/// Queued commands for a dead bus are dropped on disarming. The test rig checks that actuators are enabled only in Aligning.
#[test]
fn what_waited_for_a_dead_bus_while_arming_is_dropped() {
    let mut rig = Rig::booted();
    rig.buses_up = false;
    rig.arm();
    rig.step();
    rig.command(Action::Disarm);
    rig.step();
    assert_eq!(rig.brain.state(), State::Damped);
    rig.buses_up = true;
    rig.run(5);
    assert!(rig.servos.iter().all(|servo| !servo.enabled));
}

/// Wheel braking begins at its measured speed. The test rig checks that the first set-point is close to the measured value.
#[test]
fn a_wheel_let_down_while_arming_brakes_from_its_measured_speed() {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_DRIVE);
    rig.run(2 * u32::from(ack.value) + 80);
    assert!(rig.servos[2].value > 5.0);
    rig.estop();
    rig.run(10);
    rig.servos[2].value = 0.0;
    rig.clear();
    rig.run(20);
    rig.servos[1].refuses = true;
    rig.arm();
    rig.run(3);
    assert!(rig.servos[2].enabled && rig.servos[2].setpoints.is_empty());
    rig.command(Action::Disarm);
    rig.run(3);
    assert!(rig.servos[2].setpoints.iter().all(|s| s.0 == 0.0), "{:?}", rig.servos[2].setpoints);
}
