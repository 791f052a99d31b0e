//! A tick takes no memory.

use nalgebra::Isometry3;
use rollwalk_multibody::{State, Tree};
use rollwalk_robot::Robot;
use rollwalk_tracking::tasks::Weights;
use rollwalk_tracking::{Reference, Tracker};
use std::fs;

#[test]
fn a_tick_allocates_nothing() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/anymal_wheels.toml");
    let robot = Robot::from_toml("anymal_wheels", &fs::read_to_string(path).unwrap()).unwrap();
    let tree = Tree::new(&robot).with_spinning_wheels(|_| 1e-3).with_armature();
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
    let mut tracker = Tracker::new(tree, Weights::default(), 0.002);
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
