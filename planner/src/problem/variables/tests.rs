//! Placement of samples, and conversion of gradients from placed to stored samples.

use super::*;
use crate::test_robots::{self, random_unknowns, uniform};

const PLACEMENT: Placement = Placement { offset_m: [0.7, -0.4], yaw_rad: 0.9 };

/// Layout and a random sample of AgileBot, whose wheels have all kinds of variables.
fn sample() -> (Layout, DVector<f64>) {
    let model = Model::new(&test_robots::all()[0]);
    let vars = random_unknowns(&model, 1, 3).slots.remove(0);
    (Layout::new(&model), vars)
}

#[test]
fn placing_turns_points_forces_and_headings_and_leaves_the_rest() {
    let (layout, mut stored) = sample();
    let ee = layout.end_effectors[0];
    let wheel = ee.wheel.expect("AgileBot has wheels");
    for (first, value) in [(ee.position, [1.0, 0.0, 0.2]), (ee.force, [0.0, 2.0, 5.0])] {
        stored.fixed_rows_mut::<3>(first).copy_from_slice(&value);
    }
    let quarter = Placement { offset_m: [10.0, 20.0], yaw_rad: std::f64::consts::FRAC_PI_2 };
    let placed = Lift::Placed.apply(&layout, &stored, &quarter);
    let at = |first: usize| Vector3::new(placed[first], placed[first + 1], placed[first + 2]);
    // A quarter turn to the left: x becomes y, y becomes −x. Rounding only.
    assert!((at(ee.position) - Vector3::new(10.0, 21.0, 0.2)).norm() < 1e-14);
    assert!((at(ee.force) - Vector3::new(-2.0, 0.0, 5.0)).norm() < 1e-14);
    for heading in [BASE_YAW, wheel.yaw] {
        assert_eq!(placed[heading], stored[heading] + quarter.yaw_rad);
    }
    let moved: Vec<usize> = layout
        .points()
        .chain(layout.vectors())
        .flat_map(|k| [k, k + 1, k + 2])
        .chain(layout.headings())
        .collect();
    for k in (0..layout.len).filter(|k| !moved.contains(k)) {
        assert_eq!(placed[k], stored[k], "{k}");
    }
}

#[test]
fn placing_back_undoes_placing() {
    let (layout, stored) = sample();
    let placed = Lift::Placed.apply(&layout, &stored, &PLACEMENT);
    assert!((&placed - &stored).norm() > 1.0);
    let back = Lift::PlacedBack.apply(&layout, &placed, &PLACEMENT);
    // Roundings of forces of tens of newtons.
    assert!((back - stored).amax() < 1e-13);
}

#[test]
fn pulled_back_gradients_match_differences() {
    let (layout, stored) = sample();
    let mut random = uniform(8);
    let weights: Vec<f64> = (0..layout.len).map(|_| random()).collect();
    let step = 1e-6; // central differences: error about step² and 1e-13/step for sums near 100
    for lift in [Lift::Identity, Lift::Placed, Lift::PlacedBack] {
        // A linear function of the lifted sample, whose gradient is `weights`.
        let value = |stored: &DVector<f64>, placement: &Placement| {
            let lifted = lift.apply(&layout, stored, placement);
            lifted.iter().zip(&weights).map(|(v, w)| v * w).sum::<f64>()
        };
        let mut gradient = weights.clone();
        let lifted = lift.apply(&layout, &stored, &PLACEMENT);
        let to_placement = lift.pull_back(&layout, &lifted, &PLACEMENT, &mut gradient);
        for k in 0..layout.len {
            let at = |offset: f64| {
                let mut moved = stored.clone();
                moved[k] += offset;
                value(&moved, &PLACEMENT)
            };
            let numeric = (at(step) - at(-step)) / (2.0 * step);
            assert!((numeric - gradient[k]).abs() < 1e-6, "{lift:?} {k}: {numeric}");
        }
        for k in 0..3 {
            let at = |offset: f64| {
                let mut moved = PLACEMENT;
                let [x, y] = &mut moved.offset_m;
                *[x, y, &mut moved.yaw_rad][k] += offset;
                value(&stored, &moved)
            };
            let numeric = (at(step) - at(-step)) / (2.0 * step);
            let exact = to_placement[k];
            assert!((numeric - exact).abs() < 1e-6, "{lift:?} placement {k}: {numeric} {exact}");
        }
    }
}
