//! Examples of the crate, run as tests.

#[path = "../../examples/play.rs"]
#[expect(dead_code, reason = "tests do not call the example's main")]
mod play;

use play::{STAND_RAD, WAVE_RAD, WAVE_S};
use rollwalk_firmware::Settings;
use rollwalk_protocol::wire::State;
use std::f32::consts::PI;

/// Tests the sequence of states, and speeds and angles against the closed forms of the wave and of the alignment ramp.
#[test]
fn play_waves_and_returns() {
    let run = play::run().unwrap();
    let mut states: Vec<State> = run.states.iter().map(|(_, state)| *state).collect();
    states.retain(|state| !matches!(state, State::Boot | State::SelfTest));
    let expected = [
        State::Disarmed,
        State::Aligning,
        State::Ready,
        State::Playing,
        State::Ready,
        State::Returning,
        State::Damped,
        State::TorqueOff,
        State::Disarmed,
    ];
    assert_eq!(states, expected);
    // A wave h/2 (1 − cos 2πt/T) has the peak speed πh/T. Joint 1 is faster in the alignment ramp, at its limit.
    // The slope of the cubic between frames is 60 Hz times frames with weights 1/8, −11/8, 11/8, −1/8, and rounding moves a
    // frame by 2⁻¹¹ rad at most.
    let rounding_rad_s = 60.0 * 3.0 / 2048.0;
    let [first, second] = run.peaks_rad_s;
    let wave_rad_s = f64::from(PI * WAVE_RAD / WAVE_S);
    assert!((first - wave_rad_s).abs() < rounding_rad_s, "{first} rad/s for {wave_rad_s} rad/s");
    let align_rad_s = f64::from(Settings::default().align_speed_rad_s);
    assert!((second - align_rad_s).abs() < 1e-3, "{second} rad/s for {align_rad_s} rad/s");
    let highest_rad = run.setpoints[0].iter().map(|(_, rad)| *rad).fold(0.0, f64::max);
    assert!((highest_rad - f64::from(STAND_RAD[0] + WAVE_RAD)).abs() < 2e-3, "{highest_rad} rad");
    let last_rad = run.setpoints[0].last().unwrap().1;
    assert!((last_rad - f64::from(STAND_RAD[0])).abs() < 1e-3, "{last_rad} rad");
    let picture = play::picture(&run).to_string();
    assert_eq!(picture.matches("<polyline").count(), 2);
    assert!(!picture.contains("NaN") && !picture.contains("inf"));
}
