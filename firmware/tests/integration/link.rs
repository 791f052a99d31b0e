//! Messages on the link: commands and their answers, status, fault reports.

use crate::rig::{Rig, me};
use crate::robot::*;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::faults::{Fault, Severity};
use rollwalk_protocol::library::PlaceCode;
use rollwalk_protocol::wire::{
    Action, CommandResult, Discover, Discovered, FaultReport, FromController, Node, PROTOCOL_MAJOR,
    State,
};

#[test]
fn refusals_have_reasons() {
    let mut rig = Rig::booted();
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::NotArmed);
    assert_eq!(rig.command(Action::ClearRequest).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::ArmConfirm { nonce: 1 }).result, CommandResult::WrongNonce);
    let clear = Action::ClearConfirm { nonce: 1 };
    assert_eq!(rig.command(clear).result, CommandResult::WrongState);
    rig.arm();
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::WrongState);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::WrongState);
    rig.run_until(State::Ready, 1000);
    assert_eq!(rig.play(99).result, CommandResult::UnknownCode);
    let fast = Action::Play { code: CODE_WALK, speed_64ths: 65 };
    assert_eq!(rig.command(fast).result, CommandResult::BadSpeed);
    assert_eq!(rig.brain.state(), State::Ready);

    let mut rig = Rig::new(None);
    rig.run(20);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::NoLibrary);
    assert!(rig.brain.faults().contains(Fault::NoLibrary));
}

/// A motion for a place is played only with the confirmation that the robot stands there; each repetition needs its own.
#[test]
fn a_motion_for_a_place_needs_the_confirmation_of_this_place() {
    let mut rig = Rig::new(Some(&library_with_place()));
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    let at = |place| Action::play(Some(PlaceCode::named(place)), CODE_DRIVE, 64);
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::OtherPlace);
    assert_eq!(rig.command(at("kerb")).result, CommandResult::OtherPlace);
    rig.run(200);
    assert_eq!(rig.brain.state(), State::Ready);
    // Other motions may begin at any place.
    let walk = Action::play(Some(PlaceCode::named("stairs")), CODE_WALK, 64);
    assert_eq!(rig.command(walk).result, CommandResult::Ok);
    assert_eq!(rig.command(at("stairs")).result, CommandResult::Ok);
    while rig.clip() != DRIVE_CLIP {
        rig.step();
    }
    assert_eq!(rig.play(CODE_DRIVE).result, CommandResult::OtherPlace);
    assert_eq!(rig.command(Action::Return).result, CommandResult::Ok);
}

#[test]
fn a_motion_that_is_there_already_starts_in_no_frames() {
    let mut rig = Rig::ready();
    let ack = rig.play(CODE_STAND);
    assert_eq!((ack.result, ack.value), (CommandResult::Ok, 0));
    assert!(rig.play(CODE_WALK).value > 2);
}

#[test]
fn duplicate_command_not_executed_twice() {
    let mut rig = Rig::ready();
    let command = rig.next_command(Action::Play { code: CODE_DRIVE, speed_64ths: 64 });
    let first = rig.repeat(command);
    assert_eq!(first.result, CommandResult::Ok);
    let mut drives = 0;
    let mut last = STAND_CLIP;
    for tick in 0..1200 {
        if tick % 37 == 0 {
            assert_eq!(rig.repeat(command), first, "the same answer again");
        }
        rig.step();
        drives += u32::from(rig.clip() == DRIVE_CLIP && last != DRIVE_CLIP);
        last = rig.clip();
    }
    assert_eq!(drives, 1);
    assert_eq!(rig.brain.state(), State::Ready);
}

/// A command that waits in an unplugged adapter must not become valid again when its 16-bit time wraps.
#[test]
fn a_command_that_waited_for_long_is_not_executed() {
    let mut rig = Rig::ready();
    let play = Action::Play { code: CODE_DRIVE, speed_64ths: 64 };
    let waiting = rig.next_command(play);
    for _ in 0..64 {
        rig.run(120);
        assert_eq!(rig.repeat(waiting).result, CommandResult::Expired, "{} µs", rig.now_us);
    }
    assert_eq!(rig.brain.state(), State::Ready);
}

#[test]
fn damaged_frames_are_counted_and_do_nothing() {
    let mut rig = Rig::ready();
    let good = rig.next_command(Action::Play { code: CODE_WALK, speed_64ths: 64 }).encode(me());
    for bit in 0..64 {
        let mut data = [0; 8];
        data.copy_from_slice(good.data());
        data[bit / 8] ^= 1 << (bit % 8);
        rig.send(&Frame::new(good.id(), &data).unwrap());
    }
    assert_eq!(rig.brain.damaged_link_frames(), 64);
    // Telemetry of another controller on the same bus is valid, but not for this host.
    rig.send(&Frame::standard(0x450, &[1, 2, 3]).unwrap());
    assert_eq!(rig.brain.damaged_link_frames(), 64);
    assert_eq!(rig.brain.state(), State::Ready);
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
    // Budget: four frames in each 60 Hz period.
    for channel in 0..3 {
        let of_it = |m: &FromController| matches!(m, FromController::JointTelemetry(t) if t.channel == channel);
        assert_eq!(second.iter().filter(|(_, m)| of_it(m)).count(), 80);
    }

    rig.arm();
    let before = rig.statuses().len();
    rig.step();
    let (at, status) = rig.statuses()[before];
    assert_eq!((at, status.state), (rig.now_us, State::Aligning));
}

/// Latest fault report.
fn report(rig: &Rig) -> FaultReport {
    let report = rig.heard.iter().rev().find_map(|(_, m)| match m {
        FromController::FaultReport(report) => Some(*report),
        _ => None,
    });
    report.expect("a report")
}

#[test]
fn a_refused_request_to_arm_is_followed_by_the_reason() {
    type Cause = fn(&mut Rig);
    let obstacles: [(Cause, Fault, Option<u8>, std::ops::Range<f32>); 4] = [
        (|rig| rig.host_alive = false, Fault::HostLost, None, 0.4..0.6),
        (|rig| rig.servos[2].powered = false, Fault::ActuatorSilent, Some(2), 0.4..0.6),
        (
            |rig| rig.servos[1].status = ActuatorStatus::HARDWARE,
            Fault::ActuatorFault,
            Some(1),
            64.0..64.1,
        ),
        (|rig| rig.servos[0].value = 1.8, Fault::OutOfLimits, Some(0), 1.79..1.81),
    ];
    for (cause, fault, channel, value) in obstacles {
        let mut rig = Rig::booted();
        cause(&mut rig);
        // Half a second.
        rig.run(60);
        assert!(rig.brain.faults().is_empty(), "none while torque is off");
        assert_ne!(rig.command(Action::ArmRequest).result, CommandResult::Ok);
        let report = report(&rig);
        assert_eq!((report.fault, report.channel), (fault, channel));
        assert!(value.contains(&report.value), "{report:?}");
    }
}

/// The telemetry of an actuator is marked as unanswered while its feedback is too old to arm the robot. A host thereby knows the
/// actuator without a request to arm.
#[test]
fn telemetry_of_an_actuator_that_prevents_arming_is_marked() {
    let mut rig = Rig::booted();
    let marked = |rig: &mut Rig| {
        let from = rig.heard.len();
        rig.run(60);
        let joints = rig.heard[from..].iter().filter_map(|(_, m)| match m {
            FromController::JointTelemetry(joint) => Some(*joint),
            _ => None,
        });
        let silent = joints.filter(|joint| joint.status.is_unanswered());
        let mut channels: Vec<_> = silent.map(|joint| joint.channel).collect();
        channels.dedup();
        channels
    };
    assert_eq!(marked(&mut rig), []);
    rig.servos[1].powered = false;
    rig.run(30);
    assert_eq!(marked(&mut rig), [1]);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.servos[1].powered = true;
    rig.run(30);
    assert_eq!(marked(&mut rig), []);
    rig.arm();
    assert_eq!(marked(&mut rig), []);
}

/// Report of actuators that fall silent together names the first, which on a serial line silences the others.
#[test]
fn of_actuators_that_fall_silent_together_the_first_is_reported() {
    let mut rig = Rig::booted();
    rig.servos[1].powered = false;
    rig.servos[2].powered = false;
    rig.run(60);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    assert_eq!(report(&rig).channel, Some(1));
}

/// Torque was off while the host was absent, so no clear is required.
#[test]
fn a_host_that_was_away_while_torque_was_off_may_arm() {
    let mut rig = Rig::booted();
    rig.host_alive = false;
    rig.run(200);
    rig.host_alive = true;
    rig.run(20);
    assert_eq!(rig.statuses().last().unwrap().1.severity, Severity::None);
    rig.arm();
}

#[test]
fn a_fault_that_lasts_is_reported_every_second() {
    let mut rig = Rig::ready();
    rig.servos[0].status = ActuatorStatus::OVERHEATED;
    let from = rig.heard.len();
    rig.run(5 * 120);
    let reports = rig.heard[from..].iter().filter(|(_, m)| match m {
        FromController::FaultReport(r) => (r.fault, r.channel) == (Fault::ActuatorFault, Some(0)),
        _ => false,
    });
    // At the start, and for five seconds.
    let count = reports.count();
    assert!((5..=6).contains(&count), "{count}");
}

#[test]
fn of_more_answers_than_there_is_room_for_the_latest_are_kept() {
    let mut rig = Rig::ready();
    let commands: Vec<_> = (0..6).map(|_| rig.next_command(Action::Return)).collect();
    for command in &commands {
        rig.brain.on_link_frame(rig.now_us, &command.encode(me()));
    }
    let from = rig.heard.len();
    rig.step();
    let acks = rig.heard[from..].iter().filter_map(|(_, m)| match m {
        FromController::CommandAck(ack) => Some(ack.seq),
        _ => None,
    });
    let latest: Vec<_> = commands[2..].iter().map(|command| command.seq).collect();
    assert_eq!(acks.collect::<Vec<_>>(), latest);
}

#[test]
fn a_question_to_all_is_answered_by_its_own_address_and_no_conversation_is_with_all() {
    let mut rig = Rig::booted();
    let from = rig.heard.len();
    rig.send(&Discover.encode(Node::BROADCAST));
    rig.send(&Discover.encode(me()));
    rig.send(&Discover.encode(Node::new(9).unwrap()));
    let answers = rig.heard[from..].iter().filter_map(|(_, m)| match m {
        FromController::Discovered(answer) => Some(*answer),
        _ => None,
    });
    let answer = Discovered { uid: rig.settings.uid, protocol_major: PROTOCOL_MAJOR };
    assert_eq!(answers.collect::<Vec<_>>(), [answer, answer]);

    // HELLO_REQUEST in a single frame.
    let hello = |id| Frame::standard(id, &[3, 1, 1, 0]).unwrap();
    rig.brain.on_link_frame(rig.now_us, &hello(0x5F0));
    assert_eq!(rig.brain.poll_link(rig.now_us), None);
    rig.brain.on_link_frame(rig.now_us, &hello(0x510));
    assert_eq!(rig.brain.poll_link(rig.now_us).and_then(|frame| frame.standard_id()), Some(0x511));
}
