//! Experiment on the objective of a toss as a function of its forward and upward velocity (thesis Fig. 4.2), with soft and
//! stiff contacts and with hybrid friction. There are two minima: tosses with one bounce and with two.
//!
//! Contacts that are shorter than a step cause ripples. Along a line of upward velocities, the final height oscillates with
//! steps of 1 ms, and is monotonic with steps of a quarter of that (`ripples`).
//!
//! The roughness is measured between points with the spacing of the thesis's grid. A ripple is 0.008 m/s long. Points 0.02 m/s
//! apart, as on the grid here, do not resolve it: their second differences show the curvature of the valley in the forward
//! direction, which is larger with soft contacts.
//!
//! Soft contacts exceed a bound: their minima differ from those with stiff contacts by more than 5 % of the speed (`shift`
//! explains the cause).

mod shift;

use crate::experiments::ball_target::{FINE_S, LAYERS, TARGET_M, miss};
use crate::experiments::outcome::short;
use crate::experiments::throwing::{FREEDOMS, Throw};
use crate::experiments::{Chart, Check, ExperimentOutcome, Watch};
use nalgebra::Vector3;
use rollwalk_physics::friction::FrictionModel;

/// Numbers of points along both axes.
const POINTS: [usize; 2] = [11, 21];
/// Range of forward velocities, m/s, about that of the thesis's figure.
const FORWARD_M_S: [f64; 2] = [0.4, 0.6];
/// Range of upward velocities, m/s, about that of the thesis's figure.
const UPWARD_M_S: [f64; 2] = [-0.1, 0.3];
/// Numbers of points along both axes of the thesis's figure.
const THESIS_POINTS: [usize; 2] = [51, 71];
/// Number of random points at which second differences between neighbours with the thesis's spacing are evaluated.
const ROUGH_SAMPLES: usize = 40;
/// Number of random points at which the gradient is compared with finite differences.
const SAMPLES: usize = 20;
/// Step of the finite differences of velocities, m/s.
const DIFFERENCE_M_S: f64 = 1e-6;
/// Number of smoothing rounds before minima are counted.
///
/// Each round averages a point and its neighbours, 0.02 m/s to each side. That covers several ripples, because a ball with
/// 0.008 m/s more upward velocity lands one step of 1 ms later.
const ROUNDS: usize = 1;
/// Forward velocity of the line along which ripples are measured, m/s.
const LINE_FORWARD_M_S: f64 = 0.5055;
/// Range of upward velocities of the line, m/s.
const LINE_UPWARD_M_S: [f64; 2] = [0.14, 0.2];
/// Number of points on the line.
const ON_LINE: usize = 61;

pub fn run(watch: &dyn Watch) -> Option<ExperimentOutcome> {
    let ball = Throw::ball(LAYERS);
    let mut outcome = ExperimentOutcome {
        setup: format!(
            "the ball of ball-target, {} × {} points (thesis: {} × {}), {} to {} m/s forward, {} to {} m/s upward, BDF2, {} steps of {} ms",
            POINTS[0],
            POINTS[1],
            THESIS_POINTS[0],
            THESIS_POINTS[1],
            FORWARD_M_S[0],
            FORWARD_M_S[1],
            UPWARD_M_S[0],
            UPWARD_M_S[1],
            ball.steps,
            1e3 * ball.step_s
        ),
        ..ExperimentOutcome::default()
    };
    let variants = [
        ("k_n 100, linear", 1e2, FrictionModel::Linear),
        ("k_n 1000, linear", 1e3, FrictionModel::Linear),
        ("k_n 1000, hybrid", 1e3, FrictionModel::Hybrid),
    ];
    let (mut curves, mut curvature, mut found) = (Vec::new(), Vec::new(), Vec::new());
    let mut rough = Vec::new();
    for (name, node_stiffness_n_m, model) in variants {
        let throw = Throw { node_stiffness_n_m, model, ..ball.clone() };
        let grid = Grid::sample(&throw, name, watch)?;
        let right = share_of_right_gradients(&throw, watch)?;
        let what = format!(
            "fraction of points whose gradient agrees with finite differences to 1e-5, {name}"
        );
        outcome.checks.push(Check::at_least(&what, "", right, 0.95));
        let mut minima = grid.smoothed().minima();
        minima.sort_by(|one, other| one.1.total_cmp(&other.1));
        let places: Vec<_> =
            minima.iter().map(|at| format!("{} and {}", short(at.0), short(at.1))).collect();
        outcome.checks.extend([
            Check::new(
                &format!("local minima of the smoothed objective, {name}"),
                "2",
                "2",
                &minima.len().to_string(),
                Some(minima.len() == 2),
            ),
            Check::new(
                &format!("velocities forward and upward of the minima, m/s, {name}"),
                "two bounces and one",
                "",
                &places.join("; "),
                None,
            ),
        ]);
        curvature.push(grid.curvature());
        rough.push(roughness(&throw, watch)?);
        found.push(minima);
        curves.push((name.to_owned(), grid.lowest_by_upward()));
    }
    let sum = |of: [f64; 2]| of[0] + of[1];
    let what = "roughness of k_n 100 / roughness of k_n 1000 (mean second difference of O at the \
        point spacing of the thesis)";
    let share = sum(rough[0]) / sum(rough[1]);
    let smoother = Check::new(what, "smoother", "< 1", &short(share), Some(share < 1.0));
    outcome.checks.push(smoother);
    for (axis, name) in ["forward", "upward"].iter().enumerate() {
        let what = format!("roughness of k_n 100 / roughness of k_n 1000, {name} only");
        outcome.checks.push(Check::informative(&what, "", rough[0][axis] / rough[1][axis]));
    }
    let what = "mean second difference of O at the point spacing of this grid, which exceeds the \
        length of ripples, k_n 100 / k_n 1000";
    outcome.checks.push(Check::informative(what, "", curvature[0] / curvature[1]));
    let what = "roughness of hybrid / roughness of linear friction, k_n 1000";
    outcome.checks.push(Check::informative(what, "", sum(rough[2]) / sum(rough[1])));
    shift::measure(&ball, &found[1], &mut outcome, watch)?;
    for (at, bounces) in ["two bounces", "one bounce"].iter().enumerate() {
        let shift = match (found[2].get(at), found[1].get(at)) {
            (Some(one), Some(other)) => {
                (one.0 - other.0).hypot(one.1 - other.1) / other.0.hypot(other.1)
            }
            _ => f64::NAN,
        };
        let what = format!(
            "distance between the minima of linear and hybrid friction on the grid / speed at the \
             minimum of linear friction, {bounces}"
        );
        outcome.checks.push(Check::at_most(&what, "slight", shift, shift::SLIGHT));
    }
    outcome.charts.push(Chart {
        name: "valley".to_owned(),
        title: "Lowest objective over all velocities forward".to_owned(),
        x: "velocity upward, m/s".to_owned(),
        y: "objective, m²".to_owned(),
        logarithmic: false,
        curves,
    });
    ripples(&ball, &mut outcome, watch)?;
    Some(outcome)
}

/// Measures the ripples with two step sizes: they are due to steps longer than the contacts of nodes.
fn ripples(ball: &Throw, outcome: &mut ExperimentOutcome, watch: &dyn Watch) -> Option<()> {
    let mut curves = Vec::new();
    for step_s in [ball.step_s, FINE_S] {
        let throw = ball.clone().in_steps(step_s);
        let name = format!("steps of {} ms", 1e3 * step_s);
        watch.report(&format!("{name} along a line"));
        let [low, high] = LINE_UPWARD_M_S;
        let mut heights = Vec::with_capacity(ON_LINE);
        for k in 0..ON_LINE {
            if watch.interrupted() {
                return None;
            }
            let upward = low + (high - low) * k as f64 / (ON_LINE - 1) as f64;
            let at = throw.arrival(&FREEDOMS[..3], &[LINE_FORWARD_M_S, 0.0, upward])?;
            heights.push((upward, 1e3 * (at.z - TARGET_M.z)));
        }
        let slope =
            |of: &[(f64, f64)]| (of[of.len() - 1].1 - of[0].1) / (of[of.len() - 1].0 - of[0].0);
        let mean = slope(&heights);
        let slopes: Vec<f64> = heights.windows(2).map(slope).collect();
        let against = slopes.iter().filter(|slope| **slope * mean < 0.0).count();
        let what = format!(
            "fraction of the line on which the height changes against its mean slope, {name}"
        );
        let share = against as f64 / slopes.len() as f64;
        outcome.checks.push(Check::informative(&what, "", share));
        let what = format!("mean, least and largest slope of the height, mm/(m/s), {name}");
        let [least, largest] =
            [f64::min, f64::max].map(|of| slopes.iter().copied().reduce(of).unwrap_or(f64::NAN));
        let text = [mean, least, largest].map(short).join(", ");
        outcome.checks.push(Check::new(&what, "", "", &text, None));
        curves.push((name, heights));
    }
    outcome.charts.push(Chart {
        name: "ripples".to_owned(),
        title: format!(
            "Height above the target at the end, thrown {LINE_FORWARD_M_S} m/s forward, k_n 1000"
        ),
        x: "velocity upward, m/s".to_owned(),
        y: "height above the target, mm".to_owned(),
        logarithmic: false,
        curves,
    });
    Some(())
}

/// Velocities of a point of the grid, m/s.
fn velocity(at: [usize; 2]) -> [f64; 3] {
    let along =
        |k: usize, [from, to]: [f64; 2]| from + (to - from) * at[k] as f64 / (POINTS[k] - 1) as f64;
    [along(0, FORWARD_M_S), 0.0, along(1, UPWARD_M_S)]
}

/// Objective of a toss.
fn objective(throw: &Throw, velocity: &[f64]) -> Option<f64> {
    let off: Vector3<f64> = throw.arrival(&FREEDOMS[..3], velocity)? - TARGET_M;
    Some(0.5 * off.norm_squared())
}

/// Mean absolute second differences of the objective in the forward and upward direction, at random points with the spacing of
/// the thesis's grid. Points with a step that did not converge are skipped.
fn roughness(throw: &Throw, watch: &dyn Watch) -> Option<[f64; 2]> {
    let spans = [FORWARD_M_S, UPWARD_M_S];
    let mut rng = fastrand::Rng::with_seed(5);
    let of = |[forward, upward]: [f64; 2]| objective(throw, &[forward, 0.0, upward]);
    let second = |at: [f64; 2], axis: usize, middle: f64| {
        let apart = (spans[axis][1] - spans[axis][0]) / (THESIS_POINTS[axis] - 1) as f64;
        let [mut before, mut after] = [at, at];
        before[axis] -= apart;
        after[axis] += apart;
        Some((of(before)? - 2.0 * middle + of(after)?).abs())
    };
    let mut found = Vec::with_capacity(ROUGH_SAMPLES);
    for sample in 0..ROUGH_SAMPLES {
        if watch.interrupted() {
            return None;
        }
        if sample % 10 == 0 {
            watch.report(&format!("roughness: point {} of {ROUGH_SAMPLES}", sample + 1));
        }
        let at = spans.map(|[from, to]| from + (to - from) * rng.f64());
        let Some(middle) = of(at) else { continue };
        if let (Some(forward), Some(upward)) = (second(at, 0, middle), second(at, 1, middle)) {
            found.push([forward, upward]);
        }
    }
    Some([0, 1].map(|axis| found.iter().map(|of| of[axis]).sum::<f64>() / found.len() as f64))
}

/// Fraction of random points at which the adjoint gradient with respect to both velocities agrees with central differences.
fn share_of_right_gradients(throw: &Throw, watch: &dyn Watch) -> Option<f64> {
    let mut rng = fastrand::Rng::with_seed(2);
    let mut right = 0;
    for _ in 0..SAMPLES {
        if watch.interrupted() {
            return None;
        }
        let between =
            |rng: &mut fastrand::Rng, [from, to]: [f64; 2]| from + (to - from) * rng.f64();
        let at = [between(&mut rng, FORWARD_M_S), 0.0, between(&mut rng, UPWARD_M_S)];
        let Some(rollout) = throw.run(&FREEDOMS[..3], &at) else { continue };
        let gradient = rollout.gradient(&miss(&rollout));
        let agrees = [0, 2].iter().all(|&k| {
            let moved = |by: f64| {
                let mut at = at;
                at[k] += by;
                objective(throw, &at).unwrap_or(f64::NAN)
            };
            let rate = (moved(DIFFERENCE_M_S) - moved(-DIFFERENCE_M_S)) / (2.0 * DIFFERENCE_M_S);
            let size = gradient[0].hypot(gradient[2]);
            (rate - gradient[k]).abs() < 1e-5 * size
        });
        right += usize::from(agrees);
    }
    Some(right as f64 / SAMPLES as f64)
}

/// Objective on the grid, by forward, then upward velocity; infinite if a step did not converge.
struct Grid(Vec<Vec<f64>>);

impl Grid {
    fn sample(throw: &Throw, name: &str, watch: &dyn Watch) -> Option<Self> {
        let mut rows = Vec::with_capacity(POINTS[0]);
        for i in 0..POINTS[0] {
            if watch.interrupted() {
                return None;
            }
            watch.report(&format!("{name}: row {} of {}", i + 1, POINTS[0]));
            let of = |j: usize| objective(throw, &velocity([i, j])).unwrap_or(f64::INFINITY);
            rows.push((0..POINTS[1]).map(of).collect());
        }
        Some(Self(rows))
    }

    fn smoothed(&self) -> Self {
        let mut rows = self.0.clone();
        for _ in 0..ROUNDS {
            let before = rows.clone();
            for (i, row) in rows.iter_mut().enumerate() {
                for (j, value) in row.iter_mut().enumerate() {
                    let near = neighbours(&before, i, j);
                    *value = near.iter().sum::<f64>() / near.len() as f64;
                }
            }
        }
        Self(rows)
    }

    /// Forward and upward velocity and objective of each interior point that is a local minimum.
    fn minima(&self) -> Vec<(f64, f64, f64)> {
        let mut found = Vec::new();
        for (i, row) in self.0.iter().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                let inside = (1..POINTS[0] - 1).contains(&i) && (1..POINTS[1] - 1).contains(&j);
                if inside && neighbours(&self.0, i, j).iter().all(|near| *near >= value) {
                    let [forward, _, upward] = velocity([i, j]);
                    found.push((forward, upward, value));
                }
            }
        }
        found
    }

    /// Mean absolute second difference along both axes.
    fn curvature(&self) -> f64 {
        let second = |a: f64, b: f64, c: f64| (a - 2.0 * b + c).abs();
        let upward =
            (self.0.iter()).flat_map(|row| row.windows(3).map(|of| second(of[0], of[1], of[2])));
        let forward = self.0.windows(3).flat_map(|of| {
            (0..POINTS[1]).map(move |j| second(of[0][j], of[1][j], of[2][j])).collect::<Vec<_>>()
        });
        let all: Vec<f64> = upward.chain(forward).collect();
        all.iter().sum::<f64>() / all.len() as f64
    }

    fn lowest_by_upward(&self) -> Vec<(f64, f64)> {
        let lowest = |j: usize| self.0.iter().map(|row| row[j]).fold(f64::INFINITY, f64::min);
        (0..POINTS[1]).map(|j| (velocity([0, j])[2], lowest(j))).collect()
    }
}

/// Values of a point and its neighbours.
fn neighbours(rows: &[Vec<f64>], i: usize, j: usize) -> Vec<f64> {
    let near = |k: usize, count: usize| k.saturating_sub(1)..(k + 2).min(count);
    let of_row = |i: usize| near(j, rows[i].len()).map(move |j| rows[i][j]);
    near(i, rows.len()).flat_map(of_row).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests two wells with ripples: smoothing removes the ripples and keeps the wells.
    #[test]
    fn wells_are_counted_and_ripples_are_not() {
        let depth = |at: [usize; 2], ripple: f64| {
            let [forward, _, upward] = velocity(at);
            let well = |low: f64| ((forward - 0.5) / 0.1).powi(2) + ((upward - low) / 0.1).powi(2);
            well(0.0).min(well(0.2)) + ripple * ((at[0] * 5 + at[1] * 3) % 7) as f64
        };
        let grid = |ripple: f64| {
            Grid(
                (0..POINTS[0])
                    .map(|i| (0..POINTS[1]).map(|j| depth([i, j], ripple)).collect())
                    .collect(),
            )
        };
        assert!(grid(0.1).minima().len() > 2);
        assert_eq!(grid(0.1).smoothed().minima().len(), 2);
        assert!(grid(0.1).curvature() > 2.0 * grid(0.0).curvature());
    }
}
