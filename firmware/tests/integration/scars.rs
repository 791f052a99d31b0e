//! Failures of other robots that must not happen here. Each has a test with its number, in this file or next to its subject:
//!
//! | | failure of another robot | test |
//! |---|---|---|
//! | 1 | set-points queued for a bus without power move the robot when it returns | `scar_1_stale_command_after_power_return` |
//! | 2 | a kick to an old pose when torque is enabled | `scar_2_no_enable_kick` |
//! | 3 | the first set-point is checked after sending; an aborted motion continues | `scar_3_checked_before_it_is_sent_and_an_abort_aborts` |
//! | 4 | power cuts tested between flash operations only | `scar_4_power_cuts_within_every_write_and_erase` |
//! | 5 | a fault injector that does not fire | `scar_5_planted_bugs_are_found` |
//! | 6 | a watchdog that anything feeds, and that does not latch | `scar_6_only_new_heartbeats_feed_the_watchdog_and_its_end_latches` |
//! | 7 | "no error" while there is one | `scar_7_any_fault_shows_in_the_status_word` |
//! | 8 | a link that reorders, repeats and drops | `scar_8_a_link_that_reorders_repeats_and_drops` |
//! | 9 | a host that stalls stops the robot | `scar_9_a_host_that_stalls_does_not_disturb_the_motion` |
//! | 10 | a wheel creeps at set-point 0, which the frame cannot encode | `scar_10_a_wheel_told_zero_hardly_creeps` |

use crate::rig::{Rig, me};
use crate::robot::*;
use proptest::prelude::*;
use rollwalk_firmware::BusState;
use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::faults::{Fault, Severity};
use rollwalk_protocol::wire::{Action, CommandResult, Discover, Estop, Heartbeat, Node, State};

/// Failure known from other controllers: they check the first set-point only after sending it, and continue with an aborted
/// motion.
#[test]
fn scar_3_checked_before_it_is_sent_and_an_abort_aborts() {
    // The measured angle is out of range, so nothing is sent.
    let mut rig = Rig::booted();
    rig.servos[1].value = 1.9;
    rig.run(20);
    let from = rig.servos[1].setpoints.len();
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::PoseUnknown);
    rig.run(50);
    assert_eq!(rig.servos[1].setpoints.len(), from);
    assert!(rig.servos.iter().all(|servo| !servo.enabled));

    // A joint that does not follow ends the motion; only damping follows.
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(200);
    rig.servos[0].jammed_at = Some(-1.4);
    rig.run_until(State::Damped, 200);
    let before: Vec<usize> = rig.servos.iter().map(|servo| servo.setpoints.len()).collect();
    let held = rig.servos[1].setpoints.last().unwrap().0;
    rig.run_until(State::TorqueOff, 300);
    for (servo, from) in rig.servos[..2].iter().zip(before) {
        assert!(servo.setpoints[from + 1..].iter().all(|&(_, kp)| kp == 0.0), "let go");
    }
    assert!(rig.servos[1].setpoints.iter().rev().take(50).all(|&(value, _)| value == held));
}

/// Heartbeat numbers in steps of 16.
const EVERY_16TH: [u8; 16] =
    [0, 16, 32, 48, 64, 80, 96, 112, 128, 144, 160, 176, 192, 208, 224, 240];

/// Other controllers feed the watchdog with any message, and start again if a message arrives later.
#[test]
fn scar_6_only_new_heartbeats_feed_the_watchdog_and_its_end_latches() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    rig.run(200);
    rig.host_alive = false;
    let stuck = Heartbeat { seq: 9, host_ms: 1 }.encode(me());
    let mut damaged = Heartbeat { seq: 0, host_ms: 0 }.encode(me());
    for tick in 0..60u8 {
        // An old heartbeat, a damaged heartbeat, commands, requests, discovery: messages, but no host.
        rig.send(&stuck);
        let mut data = [0; 8];
        let len = damaged.data().len();
        data[..len].copy_from_slice(damaged.data());
        data[1] = tick;
        damaged = rollwalk_protocol::can::Frame::new(damaged.id(), &data[..len]).unwrap();
        rig.send(&damaged);
        rig.send(&Discover.encode(Node::BROADCAST));
        rig.command(Action::Unknown { kind: 12 });
        rig.send_message(&[0x01, 1, 0]);
        rig.step();
    }
    assert_eq!(rig.brain.state(), State::Returning);
    rig.host_alive = true;
    rig.run_until(State::TorqueOff, 2000);
    rig.run(500);
    assert_eq!(rig.brain.state(), State::TorqueOff, "it stays off when the host is back");
    assert!(rig.brain.faults().contains(Fault::HostLost));

    // A bridge repeats the last few messages, in any order, and across the wrap of their numbers.
    for pattern in [
        &[9, 10][..],
        &[10, 9],
        &[255, 0],
        &[254, 255, 0, 1],
        &[3, 90, 60, 120],
        &[0, 100, 200],
        &[0, 86, 172],
        &[0, 51, 102, 153, 204],
        &EVERY_16TH,
    ] {
        // As fast as possible, and every 50 ms like a host.
        for ticks in [1, 6] {
            let mut rig = Rig::ready();
            rig.play(CODE_WALK);
            rig.run(200);
            rig.host_alive = false;
            let mut lost = None;
            for tick in 0..240 {
                if tick % ticks == 0 {
                    let seq = pattern[tick / ticks % pattern.len()];
                    rig.send(&Heartbeat { seq, host_ms: seq.into() }.encode(me()));
                }
                rig.step();
                lost = lost.or((rig.brain.state() == State::Returning).then_some(tick));
            }
            // 250 ms are 30 ticks at 120 Hz, and the first round of the messages may be new.
            let in_time = lost.is_some_and(|tick| tick <= 31 + ticks * pattern.len());
            assert!(in_time, "{pattern:?}: {lost:?}, {:?}", rig.brain.state());
        }
    }
}

/// Counter of a restarted host begins at 0, whatever its value was before.
#[test]
fn a_host_that_was_started_again_is_heard_within_the_timeout() {
    for before in (0..=255).step_by(5) {
        let mut rig = Rig::booted();
        rig.host_alive = false;
        rig.send(&Heartbeat { seq: before, host_ms: 5000 }.encode(me()));
        let mut heard = None;
        for beat in 0..12u8 {
            rig.run(5);
            rig.send(&Heartbeat { seq: beat, host_ms: 50 * u32::from(beat) }.encode(me()));
            let ok = rig.command(Action::ArmRequest).result == CommandResult::Ok;
            heard = heard.or((ok && beat > 6).then_some(beat));
        }
        assert_eq!(heard, Some(7), "after {before}");
    }
}

/// Failure known from other firmware: it reports no fault while the robot lies on the floor.
#[test]
fn scar_7_any_fault_shows_in_the_status_word() {
    type Cause = fn(&mut Rig);
    let faults: [(Cause, Fault); 11] = [
        (|rig| rig.servos[0].powered = false, Fault::ActuatorSilent),
        (|rig| rig.servos[0].status = ActuatorStatus::TIMED_OUT, Fault::ActuatorFault),
        (|rig| rig.servos[1].enabled = false, Fault::ActuatorFault),
        (|rig| rig.host_alive = false, Fault::HostLost),
        (|rig| rig.servos[0].jammed_at = Some(-1.4), Fault::TrackingError),
        (|rig| rig.brain.on_bus_state(rig.now_us, 0, BusState::NotAcknowledged), Fault::BusNoAck),
        (|rig| rig.brain.on_bus_state(rig.now_us, 1, BusState::Passive), Fault::BusPassive),
        (|rig| rig.brain.on_bus_state(rig.now_us, 1, BusState::Off), Fault::BusOff),
        (|rig| rig.now_us += 200_000, Fault::Overrun),
        (|rig| rig.send(&Estop.encode(Node::BROADCAST)), Fault::EStop),
        (
            |rig| {
                for _ in 0..20 {
                    rig.brain.on_attitude(rig.now_us, [1.0, 0.0, 0.0]);
                    rig.step();
                }
            },
            Fault::Tilt,
        ),
    ];
    for (cause, fault) in faults {
        let mut rig = Rig::ready();
        cause(&mut rig);
        rig.run(100);
        let status = rig.statuses().last().unwrap().1;
        assert!(status.faults.contains(fault), "{fault:?}: {status:?}");
        assert!(status.severity.code() > Severity::Notice.code(), "{fault:?}: {status:?}");
        // The state remains after the causes are gone.
        rig.servos.iter_mut().for_each(|servo| (servo.powered, servo.status) = (true, 0));
        rig.run(700);
        assert!(rig.statuses().last().unwrap().1.faults.contains(fault), "{fault:?}");
    }
}

/// Effect of a bad link on a frame.
#[derive(Clone, Copy, Debug)]
enum LinkEffect {
    Arrives,
    IsLost,
    ArrivesTwice,
    /// Arrives after the given number of later frames.
    IsOvertaken(usize),
}

fn fate() -> impl Strategy<Value = LinkEffect> {
    prop_oneof![
        3 => Just(LinkEffect::Arrives),
        1 => Just(LinkEffect::IsLost),
        1 => Just(LinkEffect::ArrivesTwice),
        2 => (1usize..4).prop_map(LinkEffect::IsOvertaken),
    ]
}

proptest! {
    /// Adapters reorder, repeat and drop frames. A command takes effect at most once and in order. The final one that arrives
    /// in order counts.
    #[test]
    fn scar_8_a_link_that_reorders_repeats_and_drops(fates in prop::collection::vec(fate(), 1..12)) {
        let mut rig = Rig::ready();
        let codes = [CODE_WALK, CODE_DRIVE, CODE_STAND];
        let mut line: Vec<(usize, usize)> = vec![];
        for (i, fate) in fates.iter().enumerate() {
            match *fate {
                LinkEffect::Arrives => line.push((i, i)),
                LinkEffect::IsLost => {}
                LinkEffect::ArrivesTwice => line.extend([(i, i), (i, i)]),
                LinkEffect::IsOvertaken(by) => line.push((i + by, i)),
            }
        }
        line.sort_by_key(|&(at, _)| at);
        let commands: Vec<_> = (0..fates.len())
            .map(|i| rig.next_command(Action::Play { code: codes[i % 3], speed_64ths: 64 }))
            .collect();
        let mut newest = None;
        for (_, i) in line {
            let ack = rig.repeat(commands[i]);
            let in_order = newest.is_none_or(|newest| i >= newest);
            prop_assert_eq!(ack.result == CommandResult::Ok, in_order, "{} after {:?}", i, newest);
            prop_assert!(in_order || ack.result == CommandResult::OutOfOrder);
            newest = newest.max(Some(i));
        }
        if let Some(newest) = newest {
            rig.run(1200);
            // DRIVE and STAND end in SAFE; WALK repeats.
            let walks = codes[newest % 3] == CODE_WALK;
            prop_assert_eq!(rig.clip() == WALK_CLIP, walks);
            prop_assert_eq!(rig.brain.state() == State::Playing, walks);
        }
    }
}

/// Other robots follow streamed set-points, so a host that stalls briefly stops the robot or lets it fall.
///
/// A motion on the controller is independent of the host: a stall shorter than the timeout changes no set-point, and a longer
/// one leads to SAFE along the graph.
#[test]
fn scar_9_a_host_that_stalls_does_not_disturb_the_motion() {
    let play = |stall_ticks: std::ops::Range<u32>| {
        let mut rig = Rig::ready();
        rig.play(CODE_WALK);
        let mut way = vec![];
        for tick in 0..600 {
            rig.host_alive = !stall_ticks.contains(&tick);
            rig.step();
            way.push(rig.servos.iter().map(|servo| servo.value).collect::<Vec<_>>());
        }
        (rig.brain.state(), way)
    };
    let (state, undisturbed) = play(0..0);
    assert_eq!(state, State::Playing);
    // 0.2 s.
    assert_eq!(play(300..324), (State::Playing, undisturbed.clone()));
    // 0.6 s, the timeout without the requirement: return, then torque off.
    let (state, way) = play(200..272);
    assert_ne!(state, State::Playing);
    assert_eq!(way[..225], undisturbed[..225], "until the timeout");
}
