//! Examples of the crate, run as tests.

#[path = "../../examples/read_log.rs"]
#[expect(dead_code, reason = "tests do not call the example's main")]
mod read_log;

use read_log::{LAG_S, SWING_RAD};
use std::f64::consts::{PI, SQRT_2};

/// Tests rates and state of the simulated log, and its tracking errors against the closed form of a lagging sine.
#[test]
fn read_log_finds_the_lag() {
    let summary = read_log::summary(&read_log::simulated_log()).unwrap();
    assert_eq!(summary.state.as_deref(), Some("Playing"));
    let expected =
        [("feedback", 200.0), ("heartbeat", 20.0), ("set-point", 200.0), ("status", 10.0)];
    assert_eq!(summary.rates_hz.len(), expected.len(), "{:?}", summary.rates_hz);
    for (kind, rate_hz) in expected {
        // The log lacks the last period of 10 ms of 2 s.
        assert!((summary.rates_hz[kind] / rate_hz - 1.0).abs() < 0.01, "{:?}", summary.rates_hz);
    }
    // sin ωt − sin ω(t − τ) has the amplitude 2 sin ωτ/2. Angles have steps of 0.2 mrad.
    let peak_rad = 2.0 * SWING_RAD * (PI * LAG_S).sin();
    assert_eq!(summary.joints.len(), 2);
    for (name, motor) in &summary.joints {
        let [rms, peak] = read_log::errors_rad(motor);
        assert!((rms - peak_rad / SQRT_2).abs() < 3e-4, "{name}: {rms} rad");
        assert!((peak - peak_rad).abs() < 3e-4, "{name}: {peak} rad");
        let picture = read_log::picture(name, motor).to_string();
        assert_eq!(picture.matches("<polyline").count(), 2);
        assert!(!picture.contains("NaN") && !picture.contains("inf"));
    }
}
