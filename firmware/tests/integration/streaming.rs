//! Set-points that a host streams. The controller follows them by its own clock, fills or holds missing ones, and ends the
//! stream in SAFE or at a halt.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_firmware::stream::{DEPTH, MOST_GAPS};
use rollwalk_protocol::faults::{Fault, Severity};
use rollwalk_protocol::wire::{Action, CommandResult, Node, Setpoint, State};
use std::f32::consts::TAU;

/// Number of frames by which the simulated host is ahead of the controller.
const LEAD: u16 = 6;
/// Number of control periods in a frame.
const TICKS: u32 = 2;

/// Values of a stream that begins at rest in SAFE.
fn values(frame: u16) -> [f32; CHANNELS] {
    let a = TAU * f32::from(frame) / 60.0;
    let sway = 0.5 - 0.5 * a.cos();
    [STAND[0] + 0.3 * sway, STAND[1] - 0.2 * sway, 4.0 * sway]
}

fn torque_nm(frame: u16) -> f32 {
    0.3 * (TAU * f32::from(frame) / 60.0).sin()
}

fn send_to(rig: &mut Rig, to: Node, frame: u16, channels: impl IntoIterator<Item = usize>) {
    for channel in channels {
        let (value, torque_nm) = (values(frame)[channel], torque_nm(frame));
        let setpoint =
            Setpoint { frame: frame as u8, channel: channel as u8, stiff: false, value, torque_nm };
        rig.send(&setpoint.encode(to));
    }
}

fn send(rig: &mut Rig, frame: u16) {
    send_to(rig, me(), frame, 0..CHANNELS);
}

/// Robot that has begun to follow a stream, with the number of the next frame.
fn streaming() -> (Rig, u16) {
    let mut rig = Rig::ready();
    assert_eq!(rig.command(Action::Stream).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Streaming);
    (0..LEAD).for_each(|frame| send(&mut rig, frame));
    (rig, LEAD)
}

/// Streams the frames before `to`, one in each 1/60 s.
fn stream_up_to(rig: &mut Rig, from: u16, to: u16) {
    for frame in from..to {
        send(rig, frame);
        rig.run(TICKS);
    }
}

/// Number of frames taken, as reported by STATUS.
fn taken(rig: &mut Rig) -> u16 {
    rig.run(24);
    rig.statuses().last().unwrap().1.frame
}

fn joint(rig: &Rig, channel: usize) -> f32 {
    rig.brain.setpoint(channel).expect("torque is on").value
}

#[test]
fn every_frame_is_met_when_it_is_due() {
    let (mut rig, mut next) = streaming();
    // Every second tick takes a frame, and reaches it two frames later.
    for due in 0..150u16 {
        send(&mut rig, next);
        next += 1;
        rig.run(TICKS);
        if let Some(met) = due.checked_sub(2) {
            for (channel, value) in values(met).into_iter().enumerate() {
                // One step of the wire format.
                assert!((joint(&rig, channel) - value).abs() < 1e-4, "{met} {channel}");
            }
            let target = rig.brain.setpoint(0).unwrap();
            assert!((target.torque_nm - torque_nm(met)).abs() < 5e-3);
            let slope = 30.0 * (values(met + 1)[0] - values(met.max(1) - 1)[0]);
            assert!(met == 0 || (target.slope - slope).abs() < 0.02, "{met}");
        }
    }
    assert_eq!(rig.brain.state(), State::Streaming);
    let status = rig.statuses().last().unwrap().1;
    assert_eq!((status.clip, status.severity), (None, Severity::None));
    assert!((147..=150).contains(&status.frame), "{}", status.frame);
}

#[test]
fn return_leads_to_safe_without_a_jump_and_motions_play_again() {
    let (mut rig, next) = streaming();
    stream_up_to(&mut rig, next, 40);
    let before = [0, 1].map(|channel| joint(&rig, channel));
    assert!((before[0] - STAND[0]).abs() > 0.1, "away from SAFE");
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Aligning);
    rig.run(1);
    for channel in [0, 1] {
        // The joint was moving. It starts from rest at that position.
        assert!((joint(&rig, channel) - before[channel]).abs() < 0.03);
    }
    rig.run_until(State::Ready, 1000);
    assert!(rig.stands());
    assert_eq!(rig.play(CODE_WALK).result, CommandResult::Ok);
    // A new stream contains nothing of the previous stream.
    rig.command(Action::Return);
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.command(Action::Stream).result, CommandResult::Ok);
    rig.run(4);
    assert!(rig.stands());
}

#[test]
fn a_lost_message_is_filled_and_a_few_lost_frames_are() {
    let (mut rig, next) = streaming();
    for frame in next..60 {
        match frame {
            20 => send_to(&mut rig, me(), frame, [0, 2]),
            30..33 => {}
            _ => send(&mut rig, frame),
        }
        rig.run(TICKS);
    }
    assert_eq!(taken(&mut rig), 60);
    assert_eq!(rig.brain.state(), State::Streaming);
}

#[test]
fn more_gaps_than_may_be_filled_hold_the_stream() {
    let (mut rig, next) = streaming();
    let gap = 20..20 + u16::from(MOST_GAPS) + 1;
    for frame in next..gap.end + 6 {
        let channels = if gap.contains(&frame) { 0..1 } else { 0..CHANNELS };
        send_to(&mut rig, me(), frame, channels);
        rig.run(TICKS);
    }
    assert_eq!(taken(&mut rig), gap.end - 1);
}

#[test]
fn what_comes_late_is_played_late_and_nothing_jumps() {
    let (mut rig, next) = streaming();
    stream_up_to(&mut rig, next, 20);
    // The buffered frames play, and the last frame is held.
    rig.run(TICKS * u32::from(LEAD) + 8);
    let held = joint(&rig, 0);
    assert!((held - values(19)[0]).abs() < 1e-4);
    rig.run(10);
    assert_eq!(joint(&rig, 0), held);
    assert_eq!(rig.brain.setpoint(0).unwrap().slope, 0.0);
    assert_eq!(rig.brain.state(), State::Streaming);
    let (mut last, mut most) = (held, held);
    for frame in 20..40 {
        send(&mut rig, frame);
        for _ in 0..TICKS {
            rig.run(1);
            let now = joint(&rig, 0);
            // Maximum speed of the stream, 0.94 rad/s, in a control period.
            assert!((now - last).abs() < 0.94 / 120.0 + 1e-3, "{frame}: {last} to {now}");
            (last, most) = (now, most.max(now));
        }
    }
    assert!((most - values(30)[0]).abs() < 1e-4, "it goes on where it was: {most}");
}

#[test]
fn a_stream_that_ends_halts_the_robot_holds_it_and_lets_it_down() {
    let (mut rig, next) = streaming();
    stream_up_to(&mut rig, next, 30);
    let ticks = rig.run_until(State::Returning, 100);
    // The buffered frames, then 0.25 s.
    let expected = TICKS * (u32::from(LEAD) + 15);
    assert!(ticks.abs_diff(expected) <= 2 * TICKS, "{ticks}");
    assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::Return);
    let report = rig.fault_report(Fault::SetpointTimeout);
    assert_eq!(report.channel, None);
    assert!((0.25..0.4).contains(&report.value), "{}", report.value);
    rig.run(20);
    assert_eq!(joint(&rig, 2), 0.0, "wheels stand");
    assert!((joint(&rig, 0) - values(29)[0]).abs() < 1e-4, "joints hold");
    // Set-points have no effect now.
    (30..40).for_each(|frame| send(&mut rig, frame));
    rig.run(20);
    assert!((joint(&rig, 0) - values(29)[0]).abs() < 1e-4);
    assert_eq!(rig.brain.state(), State::Returning);
    rig.run_until(State::Damped, 130);
    rig.run_until(State::TorqueOff, 200);
    // The state is latched.
    rig.run(300);
    assert_eq!(rig.brain.state(), State::TorqueOff);
}

#[test]
fn a_lost_host_and_disarm_end_a_stream_too() {
    let (mut rig, next) = streaming();
    rig.host_alive = false;
    // Set-points do not replace heartbeats.
    for frame in next..next + 45 {
        send(&mut rig, frame);
        rig.run(TICKS);
    }
    assert_eq!(rig.brain.state(), State::Returning);
    assert!(rig.brain.faults().contains(Fault::HostLost));
    rig.run_until(State::TorqueOff, 400);

    let (mut rig, next) = streaming();
    stream_up_to(&mut rig, next, 30);
    assert_eq!(rig.command(Action::Disarm).result, CommandResult::Ok);
    assert_eq!(rig.brain.state(), State::Returning);
    rig.run_until(State::Damped, 40);
    // Without a fault, no clear is necessary.
    rig.run_until(State::Disarmed, 400);
}

#[test]
fn a_stream_begins_in_ready_at_safe_and_nowhere_else() {
    let mut rig = Rig::booted();
    assert_eq!(rig.command(Action::Stream).result, CommandResult::NotArmed);
    rig.arm();
    assert_eq!(rig.command(Action::Stream).result, CommandResult::WrongState);
    rig.run_until(State::Ready, 1000);
    // Set-points without a STREAM command.
    (0..6).for_each(|frame| send(&mut rig, frame + 20));
    rig.run(30);
    assert_eq!(rig.brain.state(), State::Ready);
    assert!(rig.stands());
    rig.play(CODE_WALK);
    assert_eq!(rig.command(Action::Stream).result, CommandResult::WrongState);
    rig.command(Action::Return);
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.command(Action::Stream).result, CommandResult::Ok);
    // Set-points that start too far from SAFE, that are for all controllers, or that are further ahead than the buffer.
    for frame in 0..6 {
        send_to(&mut rig, me(), u16::from(frame), 1..CHANNELS);
        for off in [0.4, -0.4] {
            let value = STAND[0] + off;
            let far = Setpoint { frame, channel: 0, stiff: false, value, torque_nm: 0.0 };
            rig.send(&far.encode(me()));
        }
    }
    send_to(&mut rig, Node::BROADCAST, 0, 0..CHANNELS);
    send(&mut rig, DEPTH as u16);
    rig.run(TICKS * 10);
    assert_eq!(taken(&mut rig), 0);
    assert!(rig.stands());
    assert_eq!(rig.play(CODE_WALK).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::Pause).result, CommandResult::WrongState);
}

/// Limits of playback apply to a stream too.
#[test]
fn a_joint_that_does_not_follow_and_a_motor_without_torque_end_a_stream() {
    type Cause = fn(&mut Rig);
    let causes: [(Cause, Fault); 2] = [
        (|rig| rig.servos[0].jammed_at = Some(-1.4), Fault::TrackingError),
        (|rig| rig.servos[1].enabled = false, Fault::ActuatorFault),
    ];
    for (cause, fault) in causes {
        let (mut rig, next) = streaming();
        stream_up_to(&mut rig, next, 30);
        assert_eq!(rig.brain.state(), State::Streaming);
        cause(&mut rig);
        for frame in 30..150 {
            send(&mut rig, frame);
            rig.run(TICKS);
        }
        assert!(rig.brain.faults().contains(fault), "{fault:?}: {:?}", rig.brain.faults());
        assert!(!matches!(rig.brain.state(), State::Streaming | State::Ready), "{fault:?}");
    }
}

#[test]
fn an_emergency_stop_ends_a_stream_at_once() {
    let (mut rig, next) = streaming();
    stream_up_to(&mut rig, next, 30);
    rig.estop();
    assert_eq!(rig.brain.state(), State::EStopped);
    assert_eq!(rig.brain.setpoint(0), None);
}
