//! Arming, stopping, losing things: each rule as a story on the bench.

use rollwalk_firmware::Settings;
use rollwalk_firmware::safety::{State, Torque};
use rollwalk_protocol::actuator::{ActuatorStatus, Control, JointSetpoint, WheelSetpoint};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::wire::{
    Action, CommandResult, Estop, Fault, FromController, Heartbeat, Node, Severity,
};

use crate::rig::{Rig, me};
use crate::robot::*;

fn is_setpoint(frame: &CanFrame) -> bool {
    JointSetpoint::decode(frame).is_some() || WheelSetpoint::decode(frame).is_some()
}

fn clip(rig: &Rig) -> u8 {
    rig.brain.playing().expect("it plays").clip.0
}

#[test]
fn arms_aligns_plays_and_comes_back() {
    let mut rig = Rig::ready();
    for c in 0..2 {
        assert_eq!(rig.brain.setpoint(c).unwrap().slope, 0.0);
        assert!((rig.servos[c].value - STAND[c]).abs() < 1e-3);
    }
    let ack = rig.play(CODE_DRIVE);
    assert_eq!((ack.result, ack.motion), (CommandResult::Ok, Some(DRIVE_CLIP)));
    assert_eq!(rig.brain.state(), State::Playing);
    // The answer says when: then, and not before, the motion plays.
    let ticks = 2 * u32::from(ack.value);
    rig.run(ticks - 1);
    assert_eq!(clip(&rig), STAND_TO_DRIVE);
    rig.run(2);
    assert_eq!(clip(&rig), DRIVE_CLIP);
    let fastest = (0..400).fold(0.0f32, |most, _| {
        rig.step();
        most.max(rig.servos[2].value)
    });
    assert!((8.5..=9.0).contains(&fastest), "{fastest}");
    assert_eq!(rig.brain.state(), State::Ready);
    assert_eq!(clip(&rig), STAND_CLIP);
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
    assert!((rig.servos[0].value - STAND[0]).abs() < 1e-3);
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

#[test]
fn no_enable_kick() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(100);
    rig.estop();
    rig.run(10);
    rig.clear();
    rig.run(20);
    rig.servos[2].value = 0.0;
    // Somebody moves the legs, up to the moment when torque goes on.
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
        assert!((servo.setpoints[0].0 - pose).abs() <= 2e-4, "{:?}", servo.setpoints);
    }
    let first = rig.brain.setpoint(0).unwrap();
    assert!((first.value + 0.74).abs() < 2e-4 && first.slope == 0.0, "{first:?}");
    rig.run_until(State::Ready, 1000);
}

#[test]
fn stale_command_after_power_return() {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_DRIVE);
    rig.run(2 * u32::from(ack.value) + 60);
    assert!(rig.servos[2].value > 3.0, "it drives");

    // Motor power fails: nobody takes frames, nobody answers. Meanwhile everything goes on.
    rig.buses_up = false;
    rig.servos.iter_mut().for_each(|servo| servo.enabled = false);
    let damped_after = rig.run_until(State::Damped, 100);
    assert!(damped_after <= u32::from(rig.settings.silent_ticks) + 2);
    rig.run(2);
    // Power returns for a moment: one frame each, and it is damping.
    for bus in [0, 1] {
        let mut frames = vec![];
        while let Some(frame) = rig.brain.poll_actuator(bus) {
            frames.push(frame);
        }
        assert_eq!(frames.len(), if bus == 0 { 2 } else { 1 });
        for frame in frames {
            match (JointSetpoint::decode(&frame), WheelSetpoint::decode(&frame)) {
                (Some((_, joint)), _) => assert_eq!(joint.kp_nm_rad, 0.0),
                (_, Some((_, wheel))) => assert!(wheel.speed_rad_s < 9.0, "it brakes"),
                _ => panic!("{frame:?}"),
            }
        }
    }
    rig.run_until(State::TorqueOff, 1000);
    rig.run(500);
    // Power returns for good: what comes is "off", once for each, and nothing that moves.
    for bus in [0, 1] {
        while let Some(frame) = rig.brain.poll_actuator(bus) {
            assert_eq!(Control::decode(&frame).map(|(_, c)| c), Some(Control::Disable));
        }
    }
    rig.buses_up = true;
    rig.run(500);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert!(rig.brain.faults().contains(Fault::ActuatorSilent));

    // A motion command that was stuck somewhere meanwhile is answered, not executed.
    rig.clear();
    rig.run(20);
    let stuck = rig.next_command(Action::Play { code: CODE_DRIVE, speed_64ths: 64 });
    rig.arm();
    rig.run_until(State::Ready, 1000);
    let late = rig.next_command(Action::Play { code: CODE_DRIVE, speed_64ths: 64 });
    rig.run(100);
    assert_eq!(rig.repeat(late).result, CommandResult::Expired);
    assert_eq!(rig.repeat(stuck).result, CommandResult::OutOfOrder);
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn duplicate_command_not_executed_twice() {
    let mut rig = Rig::ready();
    let mut command = rig.next_command(Action::Play { code: CODE_DRIVE, speed_64ths: 64 });
    command.valid_until_ms += 20_000;
    let first = rig.repeat(command);
    assert_eq!(first.result, CommandResult::Ok);
    let mut drives = 0;
    let mut last = STAND_CLIP;
    for tick in 0..1200 {
        if tick % 37 == 0 {
            assert_eq!(rig.repeat(command), first, "the same answer again");
        }
        rig.step();
        drives += u32::from(clip(&rig) == DRIVE_CLIP && last != DRIVE_CLIP);
        last = clip(&rig);
    }
    assert_eq!(drives, 1);
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn heartbeat_loss_returns_to_safe() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(200);
    assert_eq!(clip(&rig), WALK_CLIP);
    rig.host_alive = false;
    let after = rig.run_until(State::Returning, 100);
    // 250 ms at 120 Hz, from a heartbeat that was up to 50 ms old.
    assert!((24..=31).contains(&after), "{after}");
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::WrongState);

    let mut clips = vec![];
    let mut held = 0;
    while rig.brain.state() == State::Returning {
        if clips.last() != Some(&clip(&rig)) {
            clips.push(clip(&rig));
        }
        held += u32::from(clip(&rig) == STAND_CLIP);
        rig.step();
    }
    assert_eq!(clips, [WALK_CLIP, WALK_TO_STAND, STAND_CLIP]);
    assert!((held as i32 - 120).abs() <= 6, "held for a second, not {held} ticks");
    assert_eq!(rig.brain.state(), State::Damped);
    rig.step();
    assert!(rig.servos[..2].iter().all(|s| s.setpoints.last().unwrap().1 == 0.0), "kp 0");
    rig.run_until(State::TorqueOff, 300);

    // The host is back: nothing happens by itself.
    rig.host_alive = true;
    rig.run(500);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert!(rig.brain.faults().contains(Fault::HostLost));
    assert!(rig.servos.iter().all(|s| !s.enabled));
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::WrongState);
    rig.clear();
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
}

#[test]
fn a_repeated_heartbeat_is_no_sign_of_life() {
    let mut rig = Rig::ready();
    rig.host_alive = false;
    let stuck = Heartbeat { seq: 77, host_ms: 0 }.encode(me());
    for _ in 0..40 {
        rig.send(&stuck);
        rig.step();
    }
    assert_eq!(rig.brain.state(), State::Returning);
}

#[test]
fn damaged_frames_are_counted_and_do_nothing() {
    let mut rig = Rig::ready();
    let good = rig.next_command(Action::Play { code: CODE_WALK, speed_64ths: 64 }).encode(me());
    for bit in 0..64 {
        let mut data = [0; 8];
        data.copy_from_slice(good.data());
        data[bit / 8] ^= 1 << (bit % 8);
        rig.send(&CanFrame::new(good.id(), &data).unwrap());
    }
    assert_eq!(rig.brain.damaged_link_frames(), 64);
    // Telemetry of another controller on the same bus is not damaged, only not ours.
    rig.send(&CanFrame::new(0x450, &[1, 2, 3]).unwrap());
    assert_eq!(rig.brain.damaged_link_frames(), 64);
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn estop_stops_in_one_tick_from_every_state() {
    let reach: [(State, fn() -> Rig); 9] = [
        (State::Boot, || Rig::new(Some(&library()))),
        (State::Disarmed, Rig::booted),
        (State::Aligning, || {
            let mut rig = Rig::booted();
            rig.arm();
            rig.run(30);
            rig
        }),
        (State::Ready, Rig::ready),
        (State::Playing, || {
            let mut rig = Rig::ready();
            rig.play(CODE_WALK);
            rig.run(99);
            rig
        }),
        (State::Returning, || {
            let mut rig = Rig::ready();
            rig.play(CODE_WALK);
            rig.run(99);
            rig.command(Action::Disarm);
            rig
        }),
        (State::Damped, || {
            let mut rig = Rig::ready();
            rig.servos[0].status = ActuatorStatus::OVERHEATED;
            rig.run(3);
            rig
        }),
        (State::TorqueOff, || {
            let mut rig = Rig::ready();
            rig.servos[0].status = ActuatorStatus::OVERHEATED;
            rig.run(400);
            rig
        }),
        (State::EStopped, || {
            let mut rig = Rig::ready();
            rig.estop();
            rig
        }),
    ];
    for (state, rig) in reach {
        let mut rig = rig();
        assert_eq!(rig.brain.state(), state);
        rig.brain.tick(rig.now_us);
        // The identifier alone stops; not that of another controller.
        let other = Estop.encode(Node::new(5).unwrap());
        rig.brain.on_link_frame(rig.now_us, &other);
        if state != State::EStopped {
            assert_ne!(rig.brain.state(), State::EStopped);
        }
        let id = Estop.encode(me()).id();
        let heard = rig.heard.len();
        rig.send(&CanFrame::new(id, &[1, 2, 3]).unwrap());
        assert_eq!(rig.brain.state(), State::EStopped, "from {state:?}");
        assert!(rig.heard[heard..].iter().any(|(_, m)| matches!(m, FromController::EstopAck(_))));
        let frame = rig.brain.poll_actuator(0).expect("off, at once");
        assert_eq!(Control::decode(&frame).map(|(_, c)| c), Some(Control::Disable));
        for _ in 0..300 {
            rig.step();
        }
        assert_eq!(rig.brain.state(), State::EStopped);
        assert!(rig.servos.iter().all(|s| !s.enabled));
        assert!((0..3).all(|c| rig.brain.setpoint(c).is_none()));
        assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::EStop);
    }
}

#[test]
fn estop_is_cleared_in_two_steps_with_the_right_nonce() {
    let mut rig = Rig::ready();
    rig.estop();
    rig.run(5);
    assert_eq!(rig.command(Action::ClearConfirm { nonce: 0 }).result, CommandResult::WrongNonce);
    let nonce = rig.command(Action::ClearRequest).value;
    let wrong = Action::ClearConfirm { nonce: nonce ^ 1 };
    assert_eq!(rig.command(wrong).result, CommandResult::WrongNonce);
    let right = Action::ClearConfirm { nonce };
    assert_eq!(rig.command(right).result, CommandResult::WrongNonce, "one try for a nonce");
    let nonce = rig.command(Action::ClearRequest).value;
    rig.estop();
    let confirm = Action::ClearConfirm { nonce };
    assert_eq!(rig.command(confirm).result, CommandResult::WrongNonce, "stopped again meanwhile");
    assert_eq!(rig.brain.state(), State::EStopped);
    rig.clear();
    rig.run(1);
    assert_eq!(rig.brain.state(), State::Disarmed);
    assert!(rig.brain.faults().is_empty());
}

#[test]
fn a_silent_actuator_damps_all() {
    let mut rig = Rig::ready();
    rig.servos[1].powered = false;
    let after = rig.run_until(State::Damped, 100);
    assert_eq!(after, u32::from(rig.settings.silent_ticks) + 1);
    assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::Damp);
    let report = rig.heard.iter().rev().find_map(|(_, m)| match m {
        FromController::FaultReport(report) => Some(*report),
        _ => None,
    });
    let report = report.expect("a report");
    assert_eq!((report.fault, report.channel), (Fault::ActuatorSilent, Some(1)));
    rig.step();
    assert_eq!(rig.servos[0].setpoints.last().unwrap().1, 0.0);
    rig.run_until(State::TorqueOff, 300);
    rig.run(2);
    assert!(!rig.servos[0].enabled && !rig.servos[2].enabled);
}

#[test]
fn an_actuator_that_faults_or_drops_its_torque_damps_all() {
    let mut rig = Rig::ready();
    rig.servos[2].status = ActuatorStatus::BAD_VOLTAGE;
    rig.run(2);
    assert_eq!(rig.brain.state(), State::Damped);

    let mut rig = Rig::ready();
    rig.servos[0].enabled = false;
    rig.run(2);
    assert_eq!(rig.brain.state(), State::Damped);
    assert!(rig.brain.faults().contains(Fault::ActuatorFault));
}

#[test]
fn a_robot_that_cannot_get_up_is_let_down() {
    // A joint that stays where it is: more than the tolerance from SAFE.
    let mut rig = Rig::booted();
    rig.arm();
    for _ in 0..1000 {
        rig.servos[0].value = 0.9;
        rig.servos[0].setpoints.truncate(1);
        if rig.brain.state() == State::Damped {
            break;
        }
        rig.now_us += 8333;
        let beat = Heartbeat { seq: rig.now_us as u8, host_ms: 0 };
        rig.send(&beat.encode(me()));
        rig.brain.tick(rig.now_us);
        for bus in 0..2 {
            while rig.brain.poll_actuator(bus).is_some() {}
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
}

#[test]
fn disarm_goes_home_first_and_leaves_no_fault() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(100);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Returning);
    rig.run_until(State::Damped, 1000);
    assert!((rig.servos[0].value - STAND[0]).abs() < 1e-3);
    rig.run_until(State::Disarmed, 300);
    assert!(rig.brain.faults().is_empty());
    rig.run(20);
    rig.arm();
}

#[test]
fn return_goes_home_and_stays_ready() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(200);
    let ack = rig.command(Action::Return);
    assert_eq!((ack.result, ack.motion), (CommandResult::Ok, Some(STAND_CLIP)));
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok);
    rig.run(100);
    assert_eq!(rig.brain.state(), State::Ready);
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

/// "Off" that came before the actuator took it proves nothing about afterwards.
#[test]
fn an_actuator_that_is_on_after_all_is_not_armed() {
    let mut rig = Rig::booted();
    // It was told "enable" before the stop and takes it now: its answer to the stop came first.
    rig.servos[0].enabled = true;
    rig.carry();
    let answer = rig.servos[0].feedback();
    rig.brain.on_actuator_frame(rig.now_us, 0, &answer);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.run(2);
    assert!(!rig.servos[0].enabled, "told again");
    rig.arm();
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
fn refusals_have_reasons() {
    let mut rig = Rig::booted();
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::NotArmed);
    assert_eq!(rig.command(Action::ClearRequest).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::ArmConfirm { nonce: 1 }).result, CommandResult::WrongNonce);
    rig.arm();
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::WrongState);
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.play(99).result, CommandResult::UnknownCode);
    let slow = Action::Play { code: CODE_WALK, speed_64ths: 32 };
    assert_eq!(rig.command(slow).result, CommandResult::BadSpeed);
    assert_eq!(rig.command(Action::Pause).result, CommandResult::UnknownKind);
    assert_eq!(rig.brain.state(), State::Ready);

    let mut rig = Rig::new(None);
    rig.run(20);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::NoLibrary);
    assert!(rig.brain.faults().contains(Fault::NoLibrary));
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
fn a_joint_on_its_stop_is_led_back_into_its_range() {
    let mut rig = Rig::booted();
    rig.servos[0].value = 1.6;
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    assert!((rig.servos[0].value - STAND[0]).abs() < 1e-3);
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

#[test]
fn status_comes_at_20_hz_and_on_change() {
    let mut rig = Rig::booted();
    let from = rig.heard.len();
    rig.run(120);
    let second = rig.heard.split_off(from);
    let count = |of: fn(&FromController) -> bool| second.iter().filter(|(_, m)| of(m)).count();
    // 120 ticks of 8333 µs are a little less than a second.
    let statuses = count(|m| matches!(m, FromController::Status(_)));
    assert!((19..=20).contains(&statuses), "{statuses}");
    let replies = count(|m| matches!(m, FromController::HeartbeatReply(_)));
    assert!((19..=20).contains(&replies), "{replies}");
    // Budget: four in each 60 Hz frame.
    assert_eq!(count(|m| matches!(m, FromController::JointTelemetry(_))), 240);

    rig.arm();
    let before = rig.statuses().len();
    rig.step();
    let (at, status) = rig.statuses()[before];
    assert_eq!((at, status.state), (rig.now_us, State::Aligning.into()));
}

#[test]
fn any_fault_shows_in_the_status_word() {
    type Cause = fn(&mut Rig);
    let faults: [(Cause, Fault); 3] = [
        (|rig| rig.servos[0].powered = false, Fault::ActuatorSilent),
        (|rig| rig.servos[0].status = ActuatorStatus::TIMED_OUT, Fault::ActuatorFault),
        (|rig| rig.host_alive = false, Fault::HostLost),
    ];
    for (cause, fault) in faults {
        let mut rig = Rig::ready();
        cause(&mut rig);
        rig.run(50);
        let status = rig.statuses().last().unwrap().1;
        assert!(status.faults.contains(fault) && status.severity != Severity::None, "{status:?}");
    }
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
