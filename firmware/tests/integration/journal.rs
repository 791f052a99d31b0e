//! Log of the controller: reasons of stops, for a host that was absent.

use crate::rig::Rig;
use crate::robot::*;
use crate::transfer::result;
use rollwalk_firmware::{BusState, Settings};
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::crc::file_digest;
use rollwalk_protocol::faults::{Event, Fault};
use rollwalk_protocol::wire::transport::TransferResult;
use rollwalk_protocol::wire::{Action, Log, LogEntry, Request, Response, State};

fn ask(rig: &mut Rig, since: u32) -> Log {
    match rig.request(&Request::Log { since }) {
        Response::Log(log) => log,
        other => panic!("{other:?}"),
    }
}

fn entries(rig: &mut Rig) -> Vec<LogEntry> {
    ask(rig, 0).entries().map(|(_, entry)| entry).collect()
}

fn events(entries: &[LogEntry]) -> Vec<Event> {
    entries.iter().map(|entry| Event::from_code(entry.event).unwrap()).collect()
}

/// Single log entry about a fault.
#[track_caller]
fn fault(rig: &mut Rig) -> LogEntry {
    let all = entries(rig);
    let faults: Vec<_> = all.iter().filter(|entry| entry.fault.is_some()).collect();
    assert_eq!(faults.len(), 1, "{all:?}");
    *faults[0]
}

fn up(pitch_rad: f32) -> [f32; 3] {
    [-9.81 * pitch_rad.sin(), 0.0, 9.81 * pitch_rad.cos()]
}

fn tilt(rig: &mut Rig, pitch_rad: f32) {
    for _ in 0..16 {
        rig.brain.on_attitude(rig.now_us, up(pitch_rad));
        rig.step();
    }
}

#[test]
fn a_day_from_power_on_to_disarm() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(300);
    rig.command(Action::Pause);
    rig.run(50);
    rig.command(Action::Resume);
    rig.command(Action::Disarm);
    rig.run_until(State::Disarmed, 3000);
    let log = ask(&mut rig, 0);
    let all: Vec<_> = log.entries().map(|(_, entry)| entry).collect();
    use Event::*;
    let expected = [
        Started,
        SelfTestPassed,
        ArmConfirmed,
        Aligned,
        MotionStarted,
        PauseAsked,
        ResumeAsked,
        Disarm,
        HoldElapsed,
        DampingElapsed,
        FaultFree,
    ];
    assert_eq!(events(&all), expected);
    assert!(all.iter().all(|entry| entry.fault.is_none() && entry.channel.is_none()));
    let motion = rig.brain.library().unwrap().node_for_code(CODE_WALK);
    assert_eq!(all[4].motion(), motion);
    assert!(
        all.iter().all(|entry| entry.motion().is_some() == (entry.event == MotionStarted.code()))
    );
    assert!(all.windows(2).all(|w| w[0].after == w[1].before && w[0].at_ms <= w[1].at_ms));
    assert_eq!((log.first, log.next, log.now_ms), (0, 11, (rig.now_us / 1000) as u32));
    // A host that was connected before requests only new entries.
    assert_eq!(ask(&mut rig, 11).entries().count(), 0);
    rig.arm();
    let log = ask(&mut rig, 11);
    assert_eq!(log.entries().map(|(n, e)| (n, e.event)).collect::<Vec<_>>(), [(11, 16)]);
}

type Cause = fn(&mut Rig);

fn disarm(rig: &mut Rig) {
    rig.command(Action::Disarm);
}

#[test]
fn each_way_to_stop_leaves_the_entry_that_tells_why() {
    use Event::*;
    use State::*;
    type Row = (Cause, Event, State, Option<Fault>, Option<u8>, std::ops::RangeInclusive<f32>);
    let rows: [Row; 14] = [
        (Rig::estop, EStop, EStopped, Some(Fault::EStop), None, 0.0..=0.0),
        (|rig| rig.brain.estop(rig.now_us), EStop, EStopped, Some(Fault::EStop), None, 0.0..=0.0),
        (
            |rig| rig.brain.on_bus_state(rig.now_us, 1, BusState::Off),
            BusOff,
            EStopped,
            Some(Fault::BusOff),
            None,
            1.0..=1.0,
        ),
        (
            |rig| rig.servos[1].powered = false,
            FeedbackLost,
            Damped,
            Some(Fault::ActuatorSilent),
            Some(1),
            0.1..=0.2,
        ),
        (
            |rig| rig.servos[2].status = ActuatorStatus::OVERHEATED,
            ActuatorFault,
            Damped,
            Some(Fault::ActuatorFault),
            Some(2),
            17.0..=17.0,
        ),
        (
            // The servo sends nothing, and has no torque.
            |rig| (rig.servos[0].enabled, rig.servos[0].refuses) = (false, true),
            ActuatorFault,
            Damped,
            Some(Fault::ActuatorFault),
            Some(0),
            0.0..=0.0,
        ),
        (
            |rig| rig.brain.on_bus_state(rig.now_us, 1, BusState::NotAcknowledged),
            NotAcknowledged,
            Damped,
            Some(Fault::BusNoAck),
            None,
            1.0..=1.0,
        ),
        (
            |rig| rig.brain.on_bus_state(rig.now_us, 1, BusState::Passive),
            BusPassive,
            Damped,
            Some(Fault::BusPassive),
            None,
            1.0..=1.0,
        ),
        (|rig| tilt(rig, -1.2), Tipped, Damped, Some(Fault::Tilt), None, 1.19..=1.21),
        (
            |rig| rig.servos[0].jammed_at = Some(-1.4),
            NotFollowing,
            Damped,
            Some(Fault::TrackingError),
            Some(0),
            0.8..=3.0,
        ),
        (|rig| rig.now_us += 60_000, Overrun, Damped, Some(Fault::Overrun), None, 0.06..=0.07),
        (
            |rig| rig.host_alive = false,
            HostLost,
            Returning,
            Some(Fault::HostLost),
            None,
            0.25..=0.3,
        ),
        (|rig| tilt(rig, 0.5), Leaning, Returning, Some(Fault::Tilt), None, 0.49..=0.51),
        (disarm, Disarm, Returning, None, None, 0.0..=0.0),
    ];
    for (cause, event, after, fault, channel, value) in rows {
        let mut rig = Rig::ready();
        rig.play(CODE_WALK);
        rig.run(200);
        let since = ask(&mut rig, 0).next;
        cause(&mut rig);
        // Requested much later by another host.
        rig.run(2000);
        let all: Vec<_> = ask(&mut rig, since).entries().map(|(_, entry)| entry).collect();
        let why = all.first().unwrap_or_else(|| panic!("nothing about {event:?}"));
        let told = (Event::from_code(why.event), why.before, why.after, why.fault, why.channel);
        let expected = (Some(event), Playing, after, fault, channel);
        assert_eq!(told, expected, "{all:?}");
        assert!(value.contains(&why.value), "{why:?}");
    }
}

#[test]
fn what_ends_before_the_robot_stands_is_told_too() {
    let mut rig = Rig::booted();
    rig.servos[2].refuses = true;
    rig.arm();
    rig.run(2000);
    let why = fault(&mut rig);
    assert_eq!(Event::from_code(why.event), Some(Event::AlignFailed));
    assert_eq!((why.fault, why.after), (Some(Fault::TrackingError), State::Damped));

    let settings = Settings { control_hz: 50, ..Settings::default() };
    let mut rig = Rig::with(config(), settings, Some(&library()));
    rig.run(20);
    let why = fault(&mut rig);
    assert_eq!(Event::from_code(why.event), Some(Event::SelfTestFailed));
    assert_eq!((why.fault, why.after), (Some(Fault::Internal), State::TorqueOff));
}

/// Two faults are recorded once each. Lasting and repeated faults add no entry.
#[test]
fn what_is_no_news_leaves_no_entry() {
    let mut rig = Rig::ready();
    rig.servos[1].powered = false;
    rig.host_alive = false;
    rig.run(1000);
    for _ in 0..50 {
        rig.estop();
        rig.step();
    }
    let all = entries(&mut rig);
    use Event::*;
    let expected = [FeedbackLost, HostLost, DampingElapsed, EStop];
    assert_eq!(events(&all)[4..], expected, "{all:?}");
    let lost = all[5];
    assert_eq!((lost.before, lost.after), (State::Damped, State::Damped));
}

#[test]
fn asking_is_possible_in_every_state_and_changes_nothing() {
    let mut rig = Rig::booted();
    let same = |rig: &mut Rig| {
        let (state, playing) = (rig.brain.state(), rig.brain.playing());
        for since in [0, 7, u32::MAX] {
            ask(rig, since);
        }
        assert_eq!((state, playing), (rig.brain.state(), rig.brain.playing()));
    };
    same(&mut rig);
    // Between the steps of arming:
    let nonce = rig.command(Action::ArmRequest).value;
    same(&mut rig);
    rig.command(Action::ArmConfirm { nonce });
    assert_eq!(rig.brain.state(), State::Aligning);
    same(&mut rig);
    rig.run_until(State::Ready, 1000);
    same(&mut rig);
    rig.play(CODE_WALK);
    for _ in 0..300 {
        rig.step();
        same(&mut rig);
    }
    rig.command(Action::Pause);
    same(&mut rig);
    rig.command(Action::Return);
    same(&mut rig);
    rig.estop();
    same(&mut rig);
    assert_eq!(rig.brain.state(), State::EStopped);
}

#[test]
fn asking_does_not_disturb_a_transfer() {
    let mut rig = Rig::new(None);
    rig.run(20);
    let bytes = library();
    let digest = file_digest(&bytes);
    let begin = Request::Begin { len: bytes.len() as u32, digest };
    assert_eq!(result(rig.request(&begin)), TransferResult::Ok);
    for (i, block) in bytes.chunks(100).enumerate() {
        ask(&mut rig, 0);
        let block = Request::Block { offset: 100 * i as u32, bytes: block };
        assert_eq!(result(rig.request(&block)), TransferResult::Ok);
    }
    ask(&mut rig, 0);
    assert_eq!(result(rig.request(&Request::Finish)), TransferResult::Ok);
    ask(&mut rig, 0);
    assert_eq!(result(rig.request(&Request::Activate { digest })), TransferResult::Ok);
}

#[test]
fn requests_of_another_length_are_refused() {
    let mut rig = Rig::ready();
    for message in [&[2][..], &[2, 0], &[2, 0, 0, 0], &[2, 0, 0, 0, 0, 0], &[2; 60]] {
        rig.send_message(message);
    }
    assert_eq!(rig.brain.state(), State::Ready);
    assert_eq!(entries(&mut rig).len(), 4);
}
