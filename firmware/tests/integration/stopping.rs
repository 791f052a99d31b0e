//! Stops, lost hosts and actuators, and returns to SAFE: each rule as a scenario in the test rig.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_firmware::BusState;
use rollwalk_protocol::actuator::{ActuatorStatus, Control, JointSetpoint, WheelSetpoint};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Fault, Severity};
use rollwalk_protocol::wire::{
    Action, CommandResult, Estop, FromController, Heartbeat, Node, State,
};

#[test]
fn scar_1_stale_command_after_power_return() {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_DRIVE);
    rig.run(2 * u32::from(ack.value) + 60);
    assert!(rig.servos[2].value > 3.0, "it drives");

    // Motor power fails: no drive accepts frames or answers. Playback continues.
    rig.buses_up = false;
    rig.servos.iter_mut().for_each(|servo| servo.enabled = false);
    let damped_after = rig.run_until(State::Damped, 100);
    assert!(damped_after <= u32::from(rig.settings.silent_ticks) + 2);
    rig.run(2);
    // Power returns for a moment: the bus gets one damping frame for each drive.
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
    // Power returns for good: each drive gets one "off", and no command that moves it.
    for bus in [0, 1] {
        while let Some(frame) = rig.brain.poll_actuator(bus) {
            assert_eq!(Control::decode(&frame).map(|(_, c)| c), Some(Control::Disable));
        }
    }
    rig.buses_up = true;
    rig.run(500);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert!(rig.brain.faults().contains(Fault::ActuatorSilent));

    // A delayed motion command is answered, but not executed.
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
fn heartbeat_loss_returns_to_safe() {
    let mut rig = Rig::ready();
    lose_the_host(&mut rig);
    // The second time, nothing of the first time remains.
    rig.clear();
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    lose_the_host(&mut rig);
}

fn lose_the_host(rig: &mut Rig) {
    rig.play(CODE_WALK);
    rig.run(200);
    assert_eq!(rig.clip(), WALK_CLIP);
    rig.host_alive = false;
    let after = rig.run_until(State::Returning, 100);
    // 250 ms at 120 Hz, after a heartbeat that was up to 50 ms old.
    assert!((24..=31).contains(&after), "{after}");
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::WrongState);

    assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::Return);

    let mut clips = vec![];
    let mut held = 0;
    while rig.brain.state() == State::Returning {
        if clips.last() != Some(&rig.clip()) {
            clips.push(rig.clip());
        }
        held += u32::from(rig.clip() == STAND_CLIP);
        rig.step();
    }
    assert_eq!(clips, [WALK_CLIP, WALK_TO_STAND, STAND_CLIP]);
    assert!((held as i32 - 120).abs() <= 6, "held for a second, not {held} ticks");
    assert_eq!(rig.brain.state(), State::Damped);
    rig.step();
    assert!(rig.servos[..2].iter().all(|s| s.setpoints.last().unwrap().1 == 0.0), "kp 0");
    rig.run_until(State::TorqueOff, 300);

    // The host returns: the robot does nothing without a command.
    rig.host_alive = true;
    rig.run(500);
    assert_eq!(rig.brain.state(), State::TorqueOff);
    assert!(rig.brain.faults().contains(Fault::HostLost));
    assert!(rig.servos.iter().all(|s| !s.enabled));
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::WrongState);
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

/// Heartbeats with all 256 numbers in order, of which every third is lost.
#[test]
fn a_robot_plays_through_all_numbers_of_heartbeats() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.host_alive = false;
    let mut seq = rig.heartbeat_seq;
    // 300 heartbeats of 6 ticks each at 120 Hz.
    for tick in 0..1800 {
        if tick % 6 == 0 {
            seq = seq.wrapping_add(1);
            if !seq.is_multiple_of(3) {
                rig.send(&Heartbeat { seq, host_ms: 0 }.encode(me()));
            }
        }
        rig.step();
        assert_eq!(rig.brain.state(), State::Playing, "heartbeat {seq}");
    }
}

/// A heartbeat that arrives late, between two control periods, does not prevent `HostLost`.
#[test]
fn a_late_heartbeat_does_not_hide_that_the_host_was_lost() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.host_alive = false;
    let next = rig.heartbeat_seq.wrapping_add(1);
    let beat = |seq| Heartbeat { seq, host_ms: 0 }.encode(me());
    rig.send(&beat(next));
    let lost_us = rig.now_us + u64::from(rig.settings.heartbeat_timeout_us) + 1;
    while rig.now_us + 8_400 < lost_us {
        rig.step();
    }
    assert_eq!(rig.brain.state(), State::Playing);
    rig.now_us = lost_us;
    rig.send(&beat(next.wrapping_add(1)));
    assert_eq!(rig.brain.state(), State::Returning);
    assert!(rig.brain.faults().contains(Fault::HostLost));
}

/// A restarted host counts from 0, which may also be the number of its latest heartbeat before.
#[test]
fn a_host_that_starts_again_is_heard_at_once() {
    let mut rig = Rig::booted();
    rig.host_alive = false;
    rig.send(&Heartbeat { seq: 0, host_ms: 1000 }.encode(me()));
    rig.run(60);
    rig.send(&Heartbeat { seq: 0, host_ms: 1500 }.encode(me()));
    rig.arm();
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
        // The identifier alone stops this controller; the identifier of another controller does not.
        let other = Estop.encode(Node::new(5).unwrap());
        rig.brain.on_link_frame(rig.now_us, &other);
        if state != State::EStopped {
            assert_ne!(rig.brain.state(), State::EStopped);
        }
        let id = Estop.encode(me()).id();
        let heard = rig.heard.len();
        rig.send(&Frame::new(id, &[1, 2, 3]).unwrap());
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
    rig.servos[1].enabled = false;
    rig.run(2);
    assert_eq!(rig.brain.state(), State::Damped);
    assert!(rig.brain.faults().contains(Fault::ActuatorFault));
    // The fault names the bus. After all buses are off, the cause is unknown.
    rig.run(400);
    let blamed = rig.heard.iter().filter_map(|(_, m)| match m {
        FromController::FaultReport(r) if r.fault == Fault::ActuatorFault => Some(r.channel),
        _ => None,
    });
    let blamed: Vec<_> = blamed.collect();
    assert_eq!((blamed[0], blamed[blamed.len() - 1]), (Some(1), None));
}

#[test]
fn disarm_goes_home_first_and_leaves_no_fault() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(100);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Returning);
    while rig.clip() != STAND_CLIP {
        rig.step();
    }
    // The operator waits: the robot does not hold its pose after the buffered frames.
    assert!(rig.run_until(State::Damped, 1000) <= 8);
    assert!(rig.stands());
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
    assert_eq!(rig.brain.state(), State::Ready, "it is there already");
    rig.run(100);
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn feedback_that_repeats_itself_is_no_sign_of_life() {
    let mut rig = Rig::ready();
    rig.servos[1].powered = false;
    let stuck = rig.servos[1].feedback();
    for _ in 0..=rig.settings.silent_ticks + 1 {
        rig.brain.on_actuator_frame(rig.now_us, 0, &stuck);
        rig.step();
    }
    assert_eq!(rig.brain.state(), State::Damped);
    assert!(rig.brain.faults().contains(Fault::ActuatorSilent));
}

#[test]
fn wheels_brake_while_damped() {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_DRIVE);
    rig.run(2 * u32::from(ack.value) + 80);
    let speed = rig.servos[2].value;
    assert!(speed > 5.0);
    rig.servos[0].status = ActuatorStatus::OVERHEATED;
    rig.run_until(State::Damped, 5);
    // With the deceleration of 60 rad/s², 120 times per second.
    rig.run((speed / 60.0 * 120.0) as u32 + 3);
    assert_eq!(rig.brain.state(), State::Damped);
    assert_eq!(rig.servos[2].value, 0.0);
}

#[test]
fn a_slow_bus_serves_all_actuators_in_turn() {
    let mut rig = Rig::ready();
    rig.buses_up = false;
    let mut served = vec![];
    for _ in 0..6 {
        rig.step();
        // The bus has room for one frame per period.
        let frame = rig.brain.poll_actuator(0).expect("there is always something to say");
        served.push(JointSetpoint::decode(&frame).expect("a setpoint").0);
    }
    assert!(served.windows(2).all(|pair| pair[0] != pair[1]), "{served:?}");
}

#[test]
fn a_leg_that_is_held_fast_is_not_pushed_for_long() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(200);
    // An obstacle holds the joint where no motion of the library moves it.
    rig.servos[0].jammed_at = Some(-1.4);
    let after = rig.run_until(State::Damped, 200);
    assert!((60..=130).contains(&after), "{after}");
    assert!(rig.brain.faults().contains(Fault::TrackingError));
    rig.run(2);
    let report = rig.fault_report(Fault::TrackingError);
    assert_eq!(report.channel, Some(0));
    assert!(report.value > rig.settings.follow_tolerance_rad);

    // A short jam does not stop the robot.
    let mut rig = Rig::ready();
    rig.servos[0].jammed_at = Some(-1.4);
    rig.run(50);
    rig.servos[0].jammed_at = None;
    rig.run(200);
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn a_control_loop_that_comes_too_late_damps() {
    let mut rig = Rig::ready();
    rig.now_us += 40_000;
    rig.step();
    assert_eq!(rig.brain.state(), State::Ready);
    rig.now_us += 60_000;
    rig.step();
    assert_eq!(rig.brain.state(), State::Damped);
    assert!(rig.brain.faults().contains(Fault::Overrun));
    let report = rig.fault_report(Fault::Overrun);
    assert!((report.value - 0.068).abs() < 1e-3, "{report:?}");
    // Torque is off: a board that writes its flash may be late.
    let mut rig = Rig::booted();
    rig.now_us += 500_000;
    rig.run(20);
    assert_eq!((rig.brain.state(), rig.brain.faults().is_empty()), (State::Disarmed, true));
}

#[test]
fn a_bus_that_nobody_acknowledges_damps_and_bus_off_stops() {
    for (state, fault, ticks) in
        [(BusState::NotAcknowledged, Fault::BusNoAck, 3), (BusState::Passive, Fault::BusPassive, 1)]
    {
        let mut rig = Rig::ready();
        rig.brain.on_bus_state(rig.now_us, 1, state);
        assert_eq!(rig.run_until(State::Damped, 10), ticks);
        assert!(rig.brain.faults().contains(fault));
        assert_eq!(rig.fault_report(fault).value, 1.0);
        rig.run_until(State::TorqueOff, 300);
        // The stop is cleared, but arming is refused while the cause lasts.
        rig.clear();
        rig.run(20);
        assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::FaultPresent);
        rig.brain.on_bus_state(rig.now_us, 1, BusState::Active);
        rig.arm();
    }

    // One bus goes off while the other waits for its restart.
    let mut rig = Rig::ready();
    rig.brain.on_bus_state(rig.now_us, 1, BusState::Off);
    rig.run(20);
    rig.clear();
    rig.brain.on_bus_state(rig.now_us, 0, BusState::Off);
    assert_eq!(rig.brain.state(), State::EStopped);

    let mut rig = Rig::ready();
    rig.play(CODE_DRIVE);
    rig.run(150);
    rig.brain.on_bus_state(rig.now_us, 0, BusState::Off);
    assert_eq!(rig.brain.state(), State::EStopped, "before the call returns");
    rig.run(500);
    assert!(!rig.brain.take_bus_restart(0), "no recovery by itself");
    rig.clear();
    rig.run(20);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::FaultPresent);
    assert!(rig.brain.take_bus_restart(0) && !rig.brain.take_bus_restart(0));
    rig.arm();
}
