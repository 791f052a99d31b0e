//! Gains and torque limits that are set at run time: they affect the servos, and survive a power cycle.

use crate::robot::{self, SWING};
use crate::{S, armed, connect, rig};
use rollwalk_bus::lossy::Lossy;
use rollwalk_firmware::Settings;
use rollwalk_firmware::store::ParameterSet;
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::wire::{Parameter, ParameterOrigin, ParameterResult, State};
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::record::tracking_errors;
use rollwalk_sim_host::rig::Rig;
use std::sync::{Arc, Mutex};

const HIP: u8 = 0;
const KNEE: u8 = 1;
/// Proportional gain of half the configuration's, the softest while torque is on, N·m/rad.
const SOFT: f32 = 30.0;
/// Proportional gain of a twelfth of the configuration's, allowed only while torque is off, N·m/rad.
const LIMP: f32 = 5.0;

/// Largest error of a joint while the swing is played, rad.
fn swing_error(session: &mut Session<Rig>) -> f64 {
    let from = session.bus().records().len();
    session.select(SWING).unwrap();
    session.run_for(4 * S).unwrap();
    session.return_to_safe().unwrap();
    let records = &session.bus().records()[from..];
    let errors = tracking_errors(&robot::config(), records);
    errors.values().map(|error| error.joint_rad).fold(0.0, f64::max)
}

fn set_kp(session: &mut Session<Rig>, kp_nm_rad: f32) {
    for joint in [HIP, KNEE] {
        session.set_parameter(Parameter::Kp, joint, kp_nm_rad).unwrap();
    }
}

#[test]
fn softer_gains_follow_less_closely_and_the_configurations_as_before() {
    let mut session = armed();
    let stiff = swing_error(&mut session);
    set_kp(&mut session, SOFT);
    let soft = swing_error(&mut session);
    // Errors due to the control period stay; errors due to weight and inertia double.
    assert!(soft > 1.1 * stiff && soft < 2.0 * stiff, "{stiff} {soft} rad");
    session.reset_parameters().unwrap();
    session.run_for(S).unwrap();
    let again = swing_error(&mut session);
    assert!((again - stiff).abs() < 0.1 * stiff, "{stiff} {again}");
}

#[test]
fn a_gain_changed_while_the_robot_stands_does_not_make_it_jump() {
    let mut session = armed();
    session.run_for(S).unwrap();
    let from = session.bus().records().len();
    set_kp(&mut session, SOFT);
    session.run_for(S).unwrap();
    set_kp(&mut session, 120.0);
    session.run_for(S).unwrap();
    let records = &session.bus().records()[from..];
    let moved = |joint: usize| {
        let steps = records.windows(2).map(|r| (r[1].measured[joint] - r[0].measured[joint]).abs());
        steps.fold(0.0, f32::max)
    };
    // The robot sinks by about 2 mrad and rises again, each within half a second, 60 periods.
    for joint in [0, 1] {
        assert!(moved(joint) < 2e-3, "joint {joint}: {} rad in a period", moved(joint));
    }
    // The joints had errors before the change.
    let sags = records.iter().map(|r| (r.commanded[0] - r.measured[0]).abs());
    let (most, least) = (sags.clone().fold(0.0, f32::max), sags.fold(1.0, f32::min));
    assert!(most > 3.0 * least && most > 1e-3, "{least} to {most} rad");
}

#[test]
fn what_was_saved_is_in_force_after_a_power_cycle() {
    let mut session = armed();
    assert_eq!(session.parameter_origin(), Ok(ParameterOrigin::Configuration));
    let stiff = swing_error(&mut session);
    set_kp(&mut session, SOFT);
    let wrong = ParameterResult::WrongState;
    match session.save_parameters().unwrap_err() {
        SessionError::ParameterRefused { result, .. } => assert_eq!(result, wrong),
        error => panic!("{error}"),
    }
    session.disarm().unwrap();
    set_kp(&mut session, LIMP);
    session.save_parameters().unwrap();
    set_kp(&mut session, 40.0);

    let mut session = connect(session.into_bus().power_cycled());
    session.wait_for_state(State::Disarmed, S).unwrap();
    assert_eq!(session.parameter_origin(), Ok(ParameterOrigin::Saved));
    assert_eq!(session.parameter(Parameter::Kp, KNEE), Ok(LIMP));
    session.arm().unwrap();
    let soft = swing_error(&mut session);
    assert!(soft > 2.0 * stiff, "{stiff} {soft} rad");
}

/// A simulator without a file for gains refuses to save them, and one with a file starts with the saved set.
#[test]
fn a_set_that_cannot_be_kept_is_refused_and_a_kept_one_outlives_the_process() {
    let kept = Arc::new(Mutex::new(None));
    let core = |saved: Option<&ParameterSet>, is_kept: bool| {
        let kept = Arc::clone(&kept);
        let keep = move |set: &ParameterSet| {
            *kept.lock().unwrap() = Some(set.clone());
            is_kept
        };
        let buses = robot::robot().controller_buses();
        LocalController::new(robot::config(), buses, Settings::default())
            .keeping_parameters(saved, Box::new(keep))
    };
    let connected = |core| connect(Rig::with_core(&robot::robot(), core).unwrap());
    let mut session = connected(core(None, false));
    session.wait_for_state(State::Disarmed, S).unwrap();
    match session.save_parameters().unwrap_err() {
        SessionError::ParameterRefused { result, .. } => {
            assert_eq!(result, ParameterResult::StoreFailed);
        }
        error => panic!("{error}"),
    }
    let mut session = connected(core(None, true));
    session.wait_for_state(State::Disarmed, S).unwrap();
    set_kp(&mut session, LIMP);
    session.save_parameters().unwrap();
    let saved = kept.lock().unwrap().clone().unwrap();
    let mut session = connected(core(Some(&saved), true));
    session.wait_for_state(State::Disarmed, S).unwrap();
    assert_eq!(session.parameter_origin(), Ok(ParameterOrigin::Saved));
    assert_eq!(session.parameter(Parameter::Kp, KNEE), Ok(LIMP));
}

#[test]
fn refusals_name_the_limit() {
    let mut session = connect(rig());
    let sentence = |result: Result<(), SessionError>| result.unwrap_err().to_string();
    let text = sentence(session.set_parameter(Parameter::Kp, HIP, 500.0));
    assert!(text.contains("120"), "{text}");
    let text = sentence(session.set_parameter(Parameter::MaxTorque, HIP, f32::NAN));
    assert!(text.contains("number"), "{text}");
    assert_eq!(session.parameter(Parameter::Kp, HIP), Ok(60.0));
}

#[test]
fn a_link_that_loses_frames_sets_the_same() {
    let mut lost = 0;
    for seed in 0..20 {
        let mut session = connect(Lossy::new(rig(), 20, seed));
        for (i, kp) in [70.0, 50.0, 40.0, 45.0].into_iter().enumerate() {
            session.set_parameter(Parameter::Kp, i as u8 % 2, kp).unwrap();
        }
        assert_eq!(session.parameter(Parameter::Kp, HIP), Ok(40.0), "seed {seed}");
        assert_eq!(session.parameter(Parameter::Kp, KNEE), Ok(45.0), "seed {seed}");
        lost += session.bus().lost();
        // Another host, which does not know the last number of the first.
        let mut session = connect(session.into_bus());
        session.set_parameter(Parameter::Kp, HIP, 42.0).unwrap();
        assert_eq!(session.parameter(Parameter::Kp, HIP), Ok(42.0), "seed {seed}");
    }
    assert!(lost > 5, "{lost}");
}
