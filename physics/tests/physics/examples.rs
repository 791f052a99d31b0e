//! Examples of the crate, run as tests.

#[path = "../../examples/throw_ball.rs"]
#[expect(dead_code, reason = "tests do not call the example's main")]
mod throw_ball;

use nalgebra::Vector3;
use rollwalk_robot::GRAVITY_M_S2;
use throw_ball::{FIRST_M_S, RADIUS_M, START_M, STEP_S, STEPS, TARGET_M};

/// Tests the flight and the depth of the bounce against closed forms, the derivatives against each other, and the fit.
#[test]
fn throw_ball_flies_along_a_parabola_and_hits_its_target() {
    let first = throw_ball::throw(Vector3::from(FIRST_M_S)).unwrap();
    let velocity = Vector3::from(FIRST_M_S);
    let flight = |time_s: f64| {
        START_M + velocity * time_s - Vector3::z() * (0.5 * GRAVITY_M_S2 * time_s * time_s)
    };
    let bounce = (0..STEPS).find(|&step| flight(step as f64 * STEP_S).z < RADIUS_M).unwrap();
    for step in 0..bounce {
        let time_s = step as f64 * STEP_S;
        // The first step is an implicit Euler step, whose velocity is ½ g h too high.
        let error_m = (first.motions(step)[0].position - flight(time_s)).norm();
        assert!(error_m <= 0.5 * GRAVITY_M_S2 * STEP_S * (time_s + STEP_S), "{error_m} m");
    }
    let (_, [direct, adjoint]) = throw_ball::derivatives(&first);
    assert!((&direct - adjoint).norm() < 1e-9 * direct.norm());

    let fit = throw_ball::fit().unwrap();
    let best = throw_ball::throw(Vector3::from_column_slice(&fit.parameters)).unwrap();
    let miss_m = (best.motions(STEPS)[0].position - TARGET_M).norm();
    assert!(miss_m < 1e-6, "{miss_m} m");
    // At the deepest point, the contact has the energy of the fall: depth v √(m/k) with m = 0.1 kg and k = 1 kN/m. Damping,
    // 1/40 of the critical damping, takes 4 %.
    let lowest_m = (0..=STEPS).map(|step| best.motions(step)[0].position.z).fold(1.0, f64::min);
    let fall_m = START_M.z - RADIUS_M;
    let speed_m_s = (fit.parameters[2].powi(2) + 2.0 * GRAVITY_M_S2 * fall_m).sqrt();
    let depth_m = speed_m_s * (0.1_f64 / 1e3).sqrt();
    assert!(((RADIUS_M - lowest_m) / depth_m - 1.0).abs() < 0.08, "{lowest_m} {depth_m} m");

    let picture = throw_ball::picture([("first", "red", &first), ("best", "blue", &best)]);
    let picture = picture.to_string();
    assert_eq!(picture.matches("<polyline").count(), 2);
    assert!(!picture.contains("NaN") && !picture.contains("inf"));
}
