//! A tick takes no memory.

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
