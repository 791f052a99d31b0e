//! Predictive control of a plan's linear model ([`crate::model`]): the inputs of the next moments that cost least, with ground forces
//! within their friction cones and end effectors within reach. Without these limits it is the feedback of [`crate::gains`].

use crate::gains::Gains;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SolverStatus, SupportedConeT,
};
use nalgebra::DVector;

/// Intervals of the gains that are looked ahead.
const AHEAD: usize = 40;
/// In how many of them it is looked ahead once.
pub(crate) const EVERY: u64 = 2;
/// How far an end effector may be from its planned place, seen from the body, m, and the price of more, per m².
const REACH_M: f64 = 0.25;
const BEYOND: f64 = 6000.0;

/// States and inputs that are predicted, in axes of the planned heading of each interval.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    /// The interval at which it begins, counted on.
    pub from: i64,
    pub states: Vec<DVector<f64>>,
    pub inputs: Vec<DVector<f64>>,
}

/// Rows or entries of a sparse matrix.
#[derive(Default)]
struct Entries {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Entries {
    fn add(&mut self, row: usize, column: usize, value: f64) {
        if value != 0.0 {
            self.rows.push(row);
            self.columns.push(column);
            self.values.push(value);
        }
    }

    fn matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

/// What costs least from an error at the beginning of an interval on.
pub(crate) fn predict(
    gains: &Gains,
    friction: &[f64],
    from: i64,
    error: &DVector<f64>,
) -> Option<Prediction> {
    let (n, feet) = (error.len(), friction.len());
    let m = 5 * feet;
    let width = m + n + feet;
    let unknowns = AHEAD * width;
    let node = |k: usize| &gains.nodes[gains.place(from + k as i64)];
    let (mut cost, mut rows) = (Entries::default(), Entries::default());
    let mut bounds: Vec<f64> = Vec::new();
    for k in 0..AHEAD {
        let (at, now) = (k * width, node(k));
        for i in 0..m {
            cost.add(at + i, at + i, 2.0 * now.stage.r[(i, i)]);
        }
        let price = if k + 1 == AHEAD { &node(k + 1).value } else { &node(k + 1).stage.q };
        for j in 0..n {
            for i in 0..=j {
                cost.add(at + m + i, at + m + j, 2.0 * price[(i, j)]);
            }
        }
        for i in 0..feet {
            cost.add(at + m + n + i, at + m + n + i, 2.0 * BEYOND * gains.interval_s());
        }
        // x' − A x − B u = 0.
        let first = bounds.len();
        let begin = &now.stage.a * error;
        for i in 0..n {
            rows.add(first + i, at + m + i, 1.0);
            for j in 0..m {
                rows.add(first + i, at + j, -now.stage.b[(i, j)]);
            }
            if k > 0 {
                for j in 0..n {
                    rows.add(first + i, at - width + m + j, -now.stage.a[(i, j)]);
                }
            }
            bounds.push(if k == 0 { begin[i] } else { 0.0 });
        }
    }
    let mut cones = vec![SupportedConeT::ZeroConeT(bounds.len())];
    for k in 0..AHEAD {
        let (at, now) = (k * width, node(k));
        for (j, (force_n, friction)) in now.force_n.iter().zip(friction).enumerate() {
            let Some(force_n) = force_n else { continue };
            let first = bounds.len();
            rows.add(first, at + 3 * j + 2, -friction);
            bounds.push(friction * force_n.z);
            for i in 0..2 {
                rows.add(first + 1 + i, at + 3 * j + i, -1.0);
                bounds.push(force_n[i]);
            }
            cones.push(SupportedConeT::SecondOrderConeT(3));
        }
    }
    let first = bounds.len();
    for k in 0..AHEAD {
        let (at, then) = (k * width, node(k + 1));
        for row in 0..2 * feet {
            for sign in [-1.0, 1.0] {
                for i in 0..n {
                    rows.add(bounds.len(), at + m + i, sign * then.reach[(row, i)]);
                }
                rows.add(bounds.len(), at + m + n + row / 2, -1.0);
                bounds.push(REACH_M);
            }
        }
    }
    cones.push(SupportedConeT::NonnegativeConeT(bounds.len() - first));
    let settings = DefaultSettingsBuilder::default().verbose(false).max_iter(60).build().ok()?;
    let (cost, rows) = (cost.matrix(unknowns, unknowns), rows.matrix(bounds.len(), unknowns));
    let slope = vec![0.0; unknowns];
    let mut solver = DefaultSolver::new(&cost, &slope, &rows, &bounds, &cones, settings).ok()?;
    solver.solve();
    let solution = &solver.solution;
    if !matches!(solution.status, SolverStatus::Solved | SolverStatus::AlmostSolved) {
        return None;
    }
    let part = |at: usize, count: usize| DVector::from_column_slice(&solution.x[at..at + count]);
    let mut states = vec![error.clone()];
    states.extend((0..AHEAD).map(|k| part(k * width + m, n)));
    let inputs = (0..AHEAD).map(|k| part(k * width, m)).collect();
    Some(Prediction { from, states, inputs })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::{self, COM, Costs, VELOCITY};
    use crate::reference::Reference;
    use nalgebra::{Isometry3, Vector3};
    use rollwalk_multibody::{State, Tree};
    use rollwalk_robot::{GRAVITY_M_S2, Robot};

    const FRICTION: f64 = 0.7;

    /// Of ANYmal on wheels at rest, on all four.
    fn standing() -> (Gains, f64) {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots/anymal_wheels.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let robot = Robot::from_toml("anymal_wheels", &text).unwrap();
        let tree = Tree::new(&robot).with_spinning_wheels(|_| 1e-3).with_armature();
        let part_n = tree.total_mass_kg() * GRAVITY_M_S2 / 4.0;
        let reference = |time_s| Reference {
            time_s,
            world_from_ground: Isometry3::identity(),
            state: State::nominal(&tree),
            acceleration: vec![0.0; tree.dofs()],
            stands: vec![true; 4],
            force_n: vec![Vector3::z() * part_n; 4],
        };
        (Gains::new(&tree, &Costs::default(), 1.0, false, reference), part_n)
    }

    fn from(error: &DVector<f64>) -> (Prediction, Gains, f64) {
        let (gains, part_n) = standing();
        let prediction = predict(&gains, &[FRICTION; 4], 0, error).expect("it can be solved");
        (prediction, gains, part_n)
    }

    #[test]
    fn within_all_limits_it_is_the_feedback_of_the_gains() {
        let mut error = DVector::zeros(model::states(4));
        (error[COM], error[COM + 1], error[VELOCITY + 1]) = (0.01, -0.005, 0.05);
        let (prediction, gains, part_n) = from(&error);
        for (k, (state, input)) in prediction.states.iter().zip(&prediction.inputs).enumerate() {
            let feedback = -gains.at((k as f64 + 0.5) * gains.interval_s()) * state;
            assert!((input - feedback).amax() < 1e-3 * part_n, "{k}");
        }
    }

    #[test]
    fn forces_stay_within_friction_where_the_gains_do_not() {
        let mut error = DVector::zeros(model::states(4));
        error[VELOCITY + 1] = 1.0;
        let (prediction, gains, part_n) = from(&error);
        let beyond = |input: &DVector<f64>| {
            let feet = (0..4).map(|j| {
                let change = input.fixed_rows::<3>(3 * j);
                change.xy().norm() - FRICTION * (part_n + change.z)
            });
            feet.fold(f64::NEG_INFINITY, f64::max)
        };
        assert!(beyond(&(-gains.at(0.01) * &error)) > 0.1 * part_n);
        assert!(prediction.inputs.iter().all(|input| beyond(input) < 1e-3 * part_n));
        // The robot is brought to rest all the same.
        assert!(prediction.states[AHEAD][VELOCITY + 1].abs() < 0.2);
    }
}
