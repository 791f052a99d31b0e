//! Tests that ticks do not allocate memory, and test of the example.

#[path = "../examples/stand.rs"]
#[expect(dead_code, reason = "tests do not call the example's main")]
mod stand;

use nalgebra::Isometry3;
use rollwalk_multibody::{JOINTS, State, Tree};
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use rollwalk_tracking::model::Costs;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Estimator, Gains, Reference, Sensors, Tracker};
use std::fs;

fn tree() -> Tree {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/anymal_wheels.toml");
    let robot = Robot::from_toml("anymal_wheels", &fs::read_to_string(path).unwrap()).unwrap();
    Tree::new(&robot).with_spinning_wheels(|_| 1e-3).with_armature()
}

#[test]
fn a_tick_allocates_nothing() {
    let tree = tree();
    let mut reference = Reference {
        time_s: 0.0,
        world_from_ground: Isometry3::identity(),
        state: State::nominal(&tree),
        acceleration: vec![0.0; tree.dofs()],
        stands: vec![true, false, true, true],
        force_n: vec![nalgebra::Vector3::z() * 100.0; 4],
        ground_height_m: vec![0.0; 4],
        ground_normal: vec![nalgebra::Vector3::z(); 4],
    };
    let mut state = reference.state.clone();
    state.velocity[0] = 0.3;
    let gains = Gains::new(&tree, &Costs::default(), 0.1, true, |_| reference.clone());
    let mut tracker = Tracker::new(tree, Weights::default(), 0.002).with_gains(gains);
    let memory = allocation_counter::measure(|| {
        for stands in [[true; 4], [true, false, true, false], [false; 4]] {
            reference.stands.copy_from_slice(&stands);
            tracker.tick(&reference, &state, &reference.stands).unwrap();
        }
        state.velocity[3] = f64::NAN;
        assert!(tracker.tick(&reference, &state, &reference.stands).is_err());
    });
    assert_eq!(memory.count_total, 0, "{memory:?}");
}

#[test]
fn an_estimate_allocates_nothing() {
    let tree = tree();
    let state = State::nominal(&tree);
    let mut estimator = Estimator::new(tree);
    let mut sensors = Sensors {
        gyro_rad_s: Some(nalgebra::Vector3::zeros()),
        accelerometer_m_s2: Some(nalgebra::Vector3::z() * GRAVITY_M_S2),
        joint_rad: &state.joint_rad,
        speed_rad_s: &state.velocity[JOINTS..],
        touches: &[true; 4],
    };
    let memory = allocation_counter::measure(|| {
        for _ in 0..500 {
            let _ = estimator.tick(&sensors, 0.002);
        }
        estimator.tick(&sensors, 0.002).unwrap();
        sensors.gyro_rad_s = None;
        estimator.tick(&sensors, 0.002).unwrap();
        sensors.accelerometer_m_s2 = Some(nalgebra::Vector3::z() * f64::NAN);
        assert!(estimator.tick(&sensors, 0.002).is_err());
        estimator.align(&state).unwrap();
    });
    assert_eq!(memory.count_total, 0, "{memory:?}");
}

/// Tests that the centre of mass moves by the feedback law of its task, and that the robot returns to its stand.
#[test]
fn stand_recovers_from_a_push() {
    let stand = stand::stand().unwrap();
    // ẍ = F/m − k x − d ẋ. The posture task and the gains of the drives add some stiffness.
    let feedback = Weights::default().com_feedback;
    let push_s = stand::PUSH_S[1] - stand::PUSH_S[0];
    let (h, mut x_m, mut v_m_s, mut peak_m, mut peak_m_s) = (1e-5, 0.0, 0.0, 0.0_f64, 0.0_f64);
    for step in 0..100_000 {
        let force_n = if f64::from(step) * h < push_s { stand::PUSH_N } else { 0.0 };
        v_m_s += h * (force_n / stand.mass_kg - feedback.per_s2 * x_m - feedback.per_s * v_m_s);
        x_m += h * v_m_s;
        (peak_m, peak_m_s) = (peak_m.max(x_m), peak_m_s.max(v_m_s));
    }
    assert!((stand.peak_m_s / peak_m_s - 1.0).abs() < 0.15, "{} {peak_m_s}", stand.peak_m_s);
    assert!((stand.peak_m / peak_m - 1.0).abs() < 0.15, "{} {peak_m}", stand.peak_m);
    let (_, way_m, tilt_rad) = stand.states.last().unwrap();
    assert!(way_m.abs() < stand::RECOVERED.0 && *tilt_rad < stand::RECOVERED.1);
    assert!((0.05..1.0).contains(&stand.recovery_s), "{} s", stand.recovery_s);
    let weight_n = stand.mass_kg * GRAVITY_M_S2;
    assert!((stand.force_n / weight_n - 1.0).abs() < 0.01, "{} of {weight_n} N", stand.force_n);
    let (torque_nm, most_nm) = stand.largest_nm;
    assert!(torque_nm > 0.0 && torque_nm <= most_nm, "{torque_nm} of {most_nm} N·m");
    let picture = stand::picture(&stand).to_string();
    assert_eq!(picture.matches("<polyline").count(), 2);
    assert!(!picture.contains("NaN") && !picture.contains("inf"));
}
