//! Tilt of the body, measured by an IMU, that differs from the motion's own.

use crate::rig::Rig;
use crate::robot::*;
use rollwalk_firmware::Settings;
use rollwalk_protocol::faults::Fault;
use rollwalk_protocol::wire::{Action, CommandResult, State};

fn up(pitch_rad: f32) -> [f32; 3] {
    [-9.81 * pitch_rad.sin(), 0.0, 9.81 * pitch_rad.cos()]
}

fn run(rig: &mut Rig, pitch_rad: f32, ticks: u32) {
    for _ in 0..ticks {
        rig.brain.on_attitude(rig.now_us, up(pitch_rad));
        rig.step();
    }
}

#[test]
fn a_lean_leads_home_and_a_fall_is_let_down() {
    let mut rig = Rig::ready();
    run(&mut rig, 0.3, 100);
    assert_eq!(rig.brain.state(), State::Ready);
    rig.play(CODE_WALK);
    run(&mut rig, 0.0, 100);
    // A push.
    run(&mut rig, 0.5, 10);
    run(&mut rig, 0.0, 50);
    assert_eq!(rig.brain.state(), State::Playing);
    run(&mut rig, 0.5, 16);
    assert_eq!(rig.brain.state(), State::Returning);
    let report = rig.fault_report(Fault::Tilt);
    assert!((report.value - 0.5).abs() < 1e-3, "{report:?}");

    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    run(&mut rig, 0.0, 100);
    run(&mut rig, -1.2, 16);
    assert_eq!(rig.brain.state(), State::Damped);
    rig.run_until(State::TorqueOff, 300);
    assert!(rig.brain.faults().contains(Fault::Tilt));
}

/// Returning at 1/64 of the speed would take minutes.
#[test]
fn a_slow_robot_that_leans_goes_home_at_the_planned_speed() {
    let mut rig = Rig::ready();
    let slow = Action::Play { code: CODE_WALK, speed_64ths: 1 };
    assert_eq!(rig.command(slow).result, CommandResult::Ok);
    run(&mut rig, 0.0, 600);
    run(&mut rig, 0.5, 16);
    assert_eq!(rig.brain.state(), State::Returning);
    let mut leaning = || {
        run(&mut rig, 0.5, 1);
        rig.brain.state()
    };
    let ticks = (0..1000).take_while(|_| leaning() != State::Damped).count();
    // Transition, gait and transition of 91 frames with two ticks each, 0.4 s of acceleration, and a hold of one second.
    assert!(ticks < 2 * 91 + 60 + 130, "{ticks}");
}

#[test]
fn the_library_says_how_a_motion_tilts_the_body() {
    // The walk plans a lean of 0.6 rad, and the library contains it.
    let mut rig = Rig::new(Some(&library_with_attitudes(CODE_WALK, 0.6, 0.1)));
    rig.run(20);
    rig.arm();
    rig.run_until(State::Ready, 1000);
    rig.play(CODE_WALK);
    while rig.clip() != WALK_CLIP {
        run(&mut rig, 0.0, 1);
    }
    run(&mut rig, 0.6, 300);
    assert_eq!((rig.brain.state(), rig.clip()), (State::Playing, WALK_CLIP));
    // An upright robot deviates from the planned lean.
    run(&mut rig, 0.0, 16);
    assert_eq!(rig.brain.state(), State::Returning);
}

/// Attitude of SAFE applies before anything is played, while the joints move to SAFE.
#[test]
fn the_library_says_how_safe_tilts_the_body() {
    for (pitch_rad, is_well) in [(0.6, true), (0.0, false)] {
        let mut rig = Rig::new(Some(&library_with_attitudes(CODE_STAND, 0.6, 0.1)));
        rig.run(20);
        run(&mut rig, pitch_rad, 5);
        rig.arm();
        for _ in 0..300 {
            run(&mut rig, pitch_rad, 1);
        }
        assert_eq!(rig.brain.state() == State::Ready, is_well, "{pitch_rad} rad");
        assert_eq!(!rig.brain.faults().contains(Fault::Tilt), is_well, "{pitch_rad} rad");
    }
}

/// Repeated leans that are each shorter than the timeout are treated as steps.
#[test]
fn leans_that_end_in_time_lead_nowhere() {
    let mut rig = Rig::ready();
    rig.play(CODE_WALK);
    let lean_rad = rig.settings.lean_rad + 0.05;
    let most = rig.settings.tilt_patience_us / 8_334;
    for _ in 0..20 {
        run(&mut rig, lean_rad, most - 1);
        run(&mut rig, 0.0, 2);
    }
    assert_eq!(rig.brain.state(), State::Playing);
    run(&mut rig, lean_rad, most + 4);
    assert_eq!(rig.brain.state(), State::Returning);
}

#[test]
fn an_imu_that_is_required_must_be_awake() {
    let settings = Settings { imu_required: true, ..Settings::default() };
    let mut rig = Rig::with(config(), settings, Some(&library()));
    rig.run(20);
    assert_eq!(rig.command(Action::ArmRequest).result, CommandResult::FaultPresent);
    assert_eq!(rig.fault_report(Fault::Tilt).value, -1.0);
    run(&mut rig, 0.0, 5);
    rig.arm();
    for _ in 0..1000 {
        run(&mut rig, 0.0, 1);
    }
    assert_eq!(rig.brain.state(), State::Ready);
    // 0.1 s until the IMU counts as silent, and 0.1 s of delay.
    let after = rig.run_until(State::Returning, 100);
    assert!((22..=28).contains(&after), "{after}");
}
