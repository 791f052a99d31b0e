//! Tests of flashing, arming, playing by code, and returning to SAFE.

use crate::robot::{self, BOW, ROLL, ROLL_RAD_S, STAND, SWING};
use crate::{S, armed, connect, rig};
use rollwalk_bus::candump;
use rollwalk_bus::lossy::Lossy;
use rollwalk_host::session::Session;
use rollwalk_host::transfer::Progress;
use rollwalk_protocol::actuator::POSITION_STEP_RAD;
use rollwalk_protocol::library::{ClipCursor, ClipId, Library, validate};
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::record::tracking_errors;
use rollwalk_sim_host::rig::Rig;

/// Plays each motion once by its code, returns to SAFE and switches torque off.
fn everything() -> Rig {
    let mut session = armed();
    for code in [SWING, ROLL, BOW] {
        session.select(code).unwrap();
        session.run_for(4 * S).unwrap();
    }
    session.select(STAND).unwrap();
    session.wait_for_state(State::Ready, 5 * S).unwrap();
    session.disarm().unwrap();
    session.into_bus()
}

#[test]
fn a_library_is_flashed_with_progress_and_taken_into_use() {
    let mut session = connect(rig());
    assert_eq!(session.hello().library, None);
    let library = robot::library();
    let mut seen = Vec::new();
    session.flash(&library, |progress| seen.push(progress)).unwrap();
    let index = validate(&library, &robot::config()).unwrap();
    assert_eq!(session.hello().library, Some(index.id()));
    assert_eq!(session.hello().config_hash, robot::config().hash());
    let total = library.len();
    assert_eq!(seen.first(), Some(&Progress { done: 0, total }));
    assert_eq!(seen.last(), Some(&Progress { done: total, total }));
    assert!(seen.is_sorted_by_key(|progress| progress.done));
}

#[test]
fn walks_the_graph_from_motion_to_motion_and_back_to_safe() {
    let rig = everything();
    let mut clips: Vec<u8> = rig.records().iter().map(|record| record.clip.0).collect();
    clips.dedup();
    // Motions 0 to 3 are stand, swing, roll, bow; 4 to 9 are the transitions in the library's order. After a transition, the
    // motion plays, and every way leads through stand.
    assert_eq!(clips, [0, 4, 1, 5, 0, 6, 2, 7, 0, 8, 3, 9, 0]);
    let last = rig.records().last().unwrap();
    // Half a quantum of the library, half a step of a setpoint: 0.6 mrad.
    assert!((last.commanded[0] - 0.3).abs() < 1e-3 && (last.commanded[1] + 0.6).abs() < 1e-3);
    assert_eq!(last.commanded[2], 0.0);
    let rolling = rig.records().iter().filter(|record| record.clip == ClipId(2));
    let fastest = rolling.map(|record| record.measured[2]).fold(0.0, f32::max);
    // After the ramp, the lag decays. The wheel has no load.
    assert!((fastest - ROLL_RAD_S).abs() < 0.02, "{fastest}");
}

#[test]
fn commands_on_the_bus_are_the_frames_of_the_library() {
    let rig = everything();
    let bytes = robot::library();
    let index = validate(&bytes, rig.config()).unwrap();
    let library = Library::open(&bytes, &index).unwrap();
    let mut compared = 0;
    for record in rig.records().iter().filter(|record| record.phase_frames.fract() == 0.0) {
        let cursor = ClipCursor::new(&library, record.clip, record.phase_frames as u16).unwrap();
        let mut frame = [0.0; 3];
        cursor.frame_into(&library, &mut frame).unwrap();
        for (channel, (commanded, frame)) in record.commanded.iter().zip(frame).enumerate() {
            // A set-point's step is 0.2 mrad, and smaller for a wheel. The bound is half a step, and rounding of f32.
            let error = (commanded - frame).abs();
            assert!(error < 0.501 * POSITION_STEP_RAD, "{channel} {record:?} {frame}");
            compared += 1;
        }
    }
    assert!(compared > 1000, "{compared}");
    assert!(rig.records().iter().all(|record| record.missed == 0));
}

#[test]
fn servos_follow_within_what_their_gains_promise() {
    let rig = everything();
    let errors = tracking_errors(rig.config(), rig.records());
    assert_eq!(errors.len(), 10, "every clip was played");
    for (clip, error) in errors {
        // Hip and knee rotate at no more than 2.4 rad/s: half a control period (1/240 s) of delay is 10 mrad. A weight of 0.4
        // N·m with kp 60 is 7 mrad.
        assert!(error.joint_rad > 1e-4 && error.joint_rad < 0.025, "{clip:?} {error:?}");
        // The wheel accelerates at no more than 9 rad/s²: delay 1/120 s, time constant 5 mN·m·s² / 0.5.
        assert!(error.wheel_rad_s < 0.2, "{clip:?} {error:?}");
    }
}

#[test]
fn the_same_run_twice_gives_the_same_bytes_on_every_bus() {
    let log = || {
        let mut text = Vec::new();
        candump::write(everything().log(), &mut text).unwrap();
        text
    };
    let (first, second) = (log(), log());
    assert!(first == second);
    let entries = candump::parse::<Interface>(str::from_utf8(&first).unwrap()).unwrap();
    assert!(entries.is_sorted_by_key(|entry| entry.at_us));
    for interface in [Interface::Link, Interface::Actuator(0), Interface::Actuator(1)] {
        assert!(entries.iter().any(|entry| entry.interface == interface));
    }
}

#[test]
fn bus_load_is_what_the_frames_take() {
    let mut session = armed();
    let before = session.bus().bus_statistics();
    let start = session.bus().now();
    session.run_for(S).unwrap();
    let span = session.bus().now() - start;
    for ((interface, after), (_, before)) in session.bus().bus_statistics().iter().zip(&before) {
        let statistics = after.since(before);
        let (channels, frames) = match interface {
            Interface::Link => continue,
            Interface::Actuator(0) => (2, 480),
            Interface::Actuator(_) => (1, 240),
        };
        // A set-point and a feedback for each channel at 120 Hz; one frame more or less at the ends.
        let count = statistics.frames();
        assert!(count.abs_diff(frames) <= 2 * channels, "{interface}: {count}");
        // Each frame has 8 bytes: 111 to 135 bits with intermission.
        let load = statistics.load(span);
        let bounds = count as f64 * 111e-6..=count as f64 * 135e-6;
        assert!(bounds.contains(&load), "{interface}: {load}");
    }
}

#[test]
fn a_link_that_loses_frames_delays_but_does_not_derail() {
    for seed in 0..10 {
        let mut session = connect(Lossy::new(rig(), 30, seed));
        session.flash(&robot::library(), |_| {}).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        play_through(&mut session).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        assert!(session.bus().lost() > 0);
        let mut clips: Vec<u8> = session.bus().inner().records().iter().map(|r| r.clip.0).collect();
        clips.dedup();
        assert_eq!(clips, [0, 4, 1, 5, 0], "seed {seed}: every command was executed once");
    }
}

fn play_through(
    session: &mut Session<Lossy<Rig>>,
) -> Result<(), rollwalk_host::session::SessionError> {
    session.arm()?;
    session.select(SWING)?;
    session.run_for(2 * S)?;
    session.return_to_safe()?;
    session.disarm()
}

#[test]
fn a_motion_pauses_goes_on_and_plays_slower() {
    let mut session = armed();
    session.select_at(ROLL, 32).unwrap();
    session.run_for(4 * S).unwrap();
    session.pause().unwrap();
    session.run_for(3 * S).unwrap();
    assert_eq!(session.status().unwrap().state, State::Paused);
    session.resume().unwrap();
    session.run_for(2 * S).unwrap();
    session.return_to_safe().unwrap();
    let rig = session.into_bus();
    let rolling = rig.records().iter().filter(|record| record.clip == ClipId(2));
    let speeds: Vec<f32> = rolling.map(|record| record.measured[2]).collect();
    let fastest = speeds.iter().copied().fold(0.0, f32::max);
    assert!((fastest - 0.5 * ROLL_RAD_S).abs() < 0.02, "{fastest}");
    let stood = speeds.iter().filter(|speed| speed.abs() < 0.01).count();
    // 3 s minus the time of the halt, 120 times per second.
    assert!((200..360).contains(&stood), "{stood}");
}
