//! Search of a fit to one run, with the standard deviations of its results.
//!
//! The search applies the Gauss–Newton method to growing parts of the run, at first from several starting points.

use super::effects::SourceEstimate;
use super::outcome::{FitError, FittedQuantity, QuantityVerdict, Stage};
use super::parts;
use super::quality;
use super::quantity::{Kind, Quantity, SimulationModel};
use super::rollout::{Noise, Replay, SimulatedRun};
use nalgebra::DMatrix;
use rollwalk_physics::sensitivity::gauss_newton::{self, Evaluation, Fit, Penalty, minimise};

/// Correlation above which a pair of quantities is reported.
const CORRELATED: f64 = 0.95;
/// Expected change of a quantity, as a logarithm.
const EXPECTED: f64 = 1.0;
/// Scale factors of the friction coefficient to try. Sticking contacts have no derivative with respect to friction, so that the
/// Gauss–Newton method alone does not make them slip.
const FRICTIONS: [f64; 6] = [0.75, 0.55, 0.4, 0.3, 0.2, 1.5];
/// Scale factor of the stiffness and creep friction of contacts for additional starting points.
const FIRMNESS: f64 = 4.0;
/// Largest change of a parameter in an iteration.
const MOST: f64 = 0.3;
/// Relative improvement of an iteration below which the search ends.
///
/// A run has some 10,000 residuals, and a change of a parameter by its standard deviation changes the objective by ½.
const TOLERANCE: f64 = 1e-6;

/// Current parameters of a search.
#[derive(Clone, Debug)]
pub(super) struct SearchPoint {
    /// Parameter of each quantity: 0 is the value of the file.
    pub quantities: Vec<f64>,
    /// Parameters of the start state.
    pub start: Vec<f64>,
}

pub(super) struct Search<'a, G> {
    replay: &'a Replay,
    file: &'a SimulationModel,
    iterations: usize,
    noise: Noise,
    pub at: SearchPoint,
    all: &'a [Quantity],
    /// Indices of the quantities that are still fitted.
    pub open: Vec<usize>,
    pub rollouts: usize,
    stage: Stage,
    goes_on: G,
    is_ended: bool,
}

impl<'a, G: FnMut(&Stage) -> bool> Search<'a, G> {
    /// Creates a search that begins at the values of the file and the measured start state.
    pub fn new(
        replay: &'a Replay,
        file: &'a SimulationModel,
        all: &'a [Quantity],
        iterations: usize,
        goes_on: G,
    ) -> Self {
        let at = SearchPoint {
            quantities: vec![0.0; all.len()],
            start: vec![0.0; replay.start.count()],
        };
        Self {
            replay,
            file,
            iterations,
            noise: quality::nominal(),
            at,
            all,
            open: (0..all.len()).collect(),
            rollouts: 0,
            stage: Stage { what: "", horizon_s: 0.0, rollouts: 0 },
            goes_on,
            is_ended: false,
        }
    }

    pub fn check(&self) -> Result<(), FitError> {
        if self.is_ended { Err(FitError::Ended) } else { Ok(()) }
    }

    /// Simulates a rollout. Returns `None` if the simulated robot falls, a step has no solution, or the caller has ended the
    /// search.
    pub fn play(
        &mut self,
        model: &SimulationModel,
        start: &[f64],
        quantities: &[Quantity],
        by_start: bool,
        steps: usize,
    ) -> Option<SimulatedRun> {
        self.rollouts += 1;
        self.stage.rollouts = self.rollouts;
        self.stage.horizon_s = steps as f64 * self.replay.step_s;
        self.is_ended |= !(self.goes_on)(&self.stage);
        if self.is_ended {
            return None;
        }
        self.replay.play(model, start, quantities, by_start, steps)
    }

    fn model(&self, at: &[f64]) -> SimulationModel {
        let mut model = self.file.clone();
        for (quantity, parameter) in self.all.iter().zip(at) {
            if *parameter != 0.0 {
                let value = quantity.of_parameter(quantity.value(self.file), *parameter);
                quantity.set(&mut model, value);
            }
        }
        model
    }

    /// Minimises the error over the open quantities, the start state, or both. Returns `None` if the simulated robot falls with
    /// the present values.
    pub fn minimise(
        &mut self,
        what: &'static str,
        steps: usize,
        by_quantities: bool,
        by_start: bool,
    ) -> Option<Fit> {
        self.stage.what = what;
        let open = if by_quantities { self.open.clone() } else { Vec::new() };
        let quantities: Vec<Quantity> = open.iter().map(|&k| self.all[k].clone()).collect();
        let count = open.len();
        let mut begin: Vec<f64> = open.iter().map(|&k| self.at.quantities[k]).collect();
        let mut penalties = Penalty::small(count, 1.0 / (EXPECTED * EXPECTED));
        if by_start {
            begin.extend(&self.at.start);
            penalties.extend(self.replay.start.penalties(count));
        }
        let search = gauss_newton::Options {
            iterations: self.iterations,
            tolerance: TOLERANCE,
            most: MOST,
            ..gauss_newton::Options::default()
        };
        let noise = self.noise;
        let fixed = self.at.clone();
        let fit = minimise(&begin, &penalties, &search, |parameters| {
            let mut at = fixed.clone();
            open.iter().zip(parameters).for_each(|(&k, value)| at.quantities[k] = *value);
            if by_start {
                at.start.copy_from_slice(&parameters[count..]);
            }
            let model = self.model(&at.quantities);
            let played = self.play(&model, &at.start, &quantities, by_start, steps)?;
            let (values, jacobian) = played.weighted(&noise);
            Some(Evaluation { values, jacobian: Box::new(jacobian) })
        });
        let mut fit = fit?;
        open.iter().zip(&fit.parameters).for_each(|(&k, value)| self.at.quantities[k] = *value);
        if by_start {
            self.at.start.copy_from_slice(&fit.parameters[count..]);
        }
        // Information of the run without the prior of the quantities.
        for k in 0..count {
            fit.hessian[(k, k)] -= 1.0 / (EXPECTED * EXPECTED);
            if fit.hessian[(k, k)] < 1e-9 {
                fit.hessian.fill_row(k, 0.0);
                fit.hessian.fill_column(k, 0.0);
            }
        }
        Some(fit)
    }

    /// Searches the first `steps` of the run from each of several starting points ([`Self::starts`]), and continues from the
    /// result with the smallest sum of squares.
    ///
    /// Robot files contain neither the stiffness and creep of contacts nor the delay of commands. Initial assumptions may be
    /// wrong by large factors, and the sum of squares has several minima over such a range. A single search would end in the
    /// minimum next to its starting point.
    ///
    /// Returns the start state that is fitted with the values of the file; `None` if the robot falls with them.
    pub fn begin(&mut self, steps: usize) -> Option<Vec<f64>> {
        let begins = "where the run begins";
        self.minimise(begins, steps, false, true)?;
        let file = self.at.start.clone();
        let mut best = (f64::INFINITY, self.at.clone());
        for quantities in self.starts() {
            self.at = SearchPoint { quantities, start: file.clone() };
            if self.minimise(begins, steps, false, true).is_none() {
                continue;
            }
            self.search_friction(steps);
            self.minimise("quantities", steps, true, false);
            let Some(fit) = self.minimise("everything", steps, true, true) else { continue };
            let cost = fit.costs[fit.costs.len() - 1];
            if cost < best.0 {
                best = (cost, self.at.clone());
            }
        }
        self.at = best.1;
        Some(file)
    }

    /// Starting points of the search, as all combinations of alternatives for the fitted quantities.
    ///
    /// The alternatives are the value of the file, [`FIRMNESS`] times the stiffness and creep friction of contacts, and commands
    /// that are earlier by half the interval between commands.
    fn starts(&self) -> Vec<Vec<f64>> {
        let commands = self.replay.recording.drives.iter();
        let interval_s = commands.filter_map(|drive| drive.target_rad.interval_s()).next();
        let mut starts = vec![vec![0.0; self.all.len()]];
        for &open in &self.open {
            let quantity = &self.all[open];
            let value = quantity.value(self.file);
            let other = match quantity.kind {
                Kind::Stiffness | Kind::Stick => Some(FIRMNESS * value),
                // Drives that hold each command until the next are half an interval ahead of a line between commands.
                Kind::Delay => interval_s.map(|interval_s| value - 0.5 * interval_s),
                _ => None,
            };
            let Some(other) = other else { continue };
            let moved = |start: &Vec<f64>| {
                let mut start = start.clone();
                start[open] = quantity.to_parameter(value, other);
                start
            };
            let more: Vec<_> = starts.iter().map(moved).collect();
            starts.extend(more);
        }
        starts
    }

    /// Tries other friction coefficients, with which contacts may slip that stick with the coefficient of the robot file.
    pub fn search_friction(&mut self, steps: usize) {
        let friction = self.open.iter().find(|&&k| self.all[k].kind == Kind::Friction);
        let Some(&friction) = friction else { return };
        self.stage.what = "friction";
        let cost = |search: &mut Self, parameter: f64| {
            let mut at = search.at.clone();
            at.quantities[friction] = parameter;
            let model = search.model(&at.quantities);
            let played = search.play(&model, &at.start, &[], false, steps)?;
            let noise = search.noise;
            let (values, _) = played.weighted(&noise);
            let off = parameter / EXPECTED;
            Some(values.iter().map(|value| value * value).sum::<f64>() + off * off)
        };
        let now = self.at.quantities[friction];
        let Some(mut least) = cost(self, now) else { return };
        for share in FRICTIONS {
            let parameter = now + f64::ln(share);
            if let Some(cost) = cost(self, parameter).filter(|cost| *cost < least) {
                least = cost;
                self.at.quantities[friction] = parameter;
            }
        }
    }

    /// Estimates the noise of each signal from the residuals of the fit.
    pub fn estimate_noise(&mut self, steps: usize) {
        let model = self.model(&self.at.quantities);
        let start = self.at.start.clone();
        if let Some(played) = self.play(&model, &start, &[], false, steps) {
            self.noise = quality::estimate_noise(played.misses());
        }
    }

    /// Standard deviation of each fitted parameter between separately fitted parts of the run, as far as noise does not explain
    /// it.
    pub fn spreads(&mut self, steps: usize) -> Vec<f64> {
        let replays = parts::of(self.replay, self.file, steps);
        let mut reports: Vec<Vec<SourceEstimate>> = vec![Vec::new(); self.open.len()];
        for replay in &replays {
            let goes_on = &mut self.goes_on;
            let mut of_part = Search::new(replay, self.file, self.all, self.iterations, goes_on);
            of_part.at.quantities.clone_from(&self.at.quantities);
            of_part.open.clone_from(&self.open);
            (of_part.noise, of_part.rollouts) = (self.noise, self.rollouts);
            let what = "parts of the run";
            let begins = of_part.minimise(what, replay.steps, false, true);
            let fit = begins.and_then(|_| of_part.minimise(what, replay.steps, true, true));
            (self.rollouts, self.is_ended) = (of_part.rollouts, self.is_ended | of_part.is_ended);
            if self.is_ended {
                break;
            }
            let Some(fit) = fit else { continue };
            let all = reports.iter_mut().zip(&fit.parameters).zip(fit.deviations());
            all.for_each(|((of, &value), deviation)| of.push(SourceEstimate { value, deviation }));
        }
        reports.iter().map(|of| parts::spread(of)).collect()
    }

    /// Judges each open quantity and returns its index and result.
    pub fn judge(&self, fit: &Fit, spreads: &[f64]) -> Vec<(usize, FittedQuantity)> {
        let deviations = fit.deviations();
        let of = |(place, &number): (usize, &usize)| {
            let quantity = &self.all[number];
            let before = quantity.value(self.file);
            let parameter = self.at.quantities[number];
            let fitted = quantity.of_parameter(before, parameter);
            let deviation = deviations[place].hypot(spreads[place]) * quantity.by_parameter(fitted);
            let verdict = QuantityVerdict::of(quantity, before, fitted, deviation);
            let quantity = quantity.clone();
            (number, FittedQuantity { quantity, before, fitted, deviation, verdict })
        };
        self.open.iter().enumerate().map(of).collect()
    }

    /// Pairs of fitted quantities that the run hardly distinguishes, with their correlation.
    pub fn correlations(&self, fit: &Fit) -> Vec<(String, String, f64)> {
        let Some(covariance) = inverse(&fit.hessian) else { return Vec::new() };
        let mut pairs = Vec::new();
        for (i, &one) in self.open.iter().enumerate() {
            for (j, &other) in self.open.iter().enumerate().skip(i + 1) {
                let size = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
                let correlation = covariance[(i, j)] / size;
                if correlation.abs() > CORRELATED {
                    pairs.push((self.all[one].name(), self.all[other].name(), correlation));
                }
            }
        }
        pairs
    }
}

/// Inverse of a Hessian, in which parameters without effect get a diagonal of 1. Returns `None` if it is not positive definite.
fn inverse(hessian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut known = hessian.clone();
    for k in 0..known.nrows() {
        if known[(k, k)] == 0.0 {
            known[(k, k)] = 1.0;
        }
    }
    Some(known.cholesky()?.inverse())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::fit::{Options, replay};
    use crate::identify::{DriveSeries, Recording, Series};
    use rollwalk_robot::Robot;

    #[test]
    fn a_search_begins_from_all_combinations_of_what_no_file_has() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/car.toml");
        let robot = Robot::from_toml("car", &std::fs::read_to_string(path).unwrap()).unwrap();
        // Commands every 10 ms.
        let series = Series::new((0..=100).map(|k| (f64::from(k) * 0.01, 0.0)));
        let drive = DriveSeries {
            target_rad: series.clone(),
            target_rad_s: series.clone(),
            rad: series,
            ..DriveSeries::default()
        };
        let drives = vec![drive; robot.channels().count()];
        let run = Recording::new(&robot, drives, None, None, None);
        let run = run.cut(&[[0.0, 1.0]], [None; 2]).unwrap();
        let (file, options) = (SimulationModel::new(&robot), Options::default());
        let replay = replay(run, &file, &options).unwrap();
        let kinds = [Kind::Friction, Kind::Stiffness, Kind::Stick, Kind::Delay];
        let quantities = kinds.map(|kind| Quantity { kind, group: None });
        let mut search =
            Search::new(&replay, &file, &quantities, options.iterations, |_: &Stage| true);
        let starts = search.starts();
        assert_eq!(starts.len(), 8);
        assert_eq!(starts[0], [0.0; 4]);
        let value = |of: usize, start: &[f64]| {
            let before = quantities[of].value(&file);
            quantities[of].of_parameter(before, start[of]) - before
        };
        for (number, start) in starts.iter().enumerate() {
            assert_eq!(start[0], 0.0, "friction has a search of its own");
            for (place, of) in [1, 2].into_iter().enumerate() {
                let is_firm = number >> place & 1 == 1;
                let expected = if is_firm { 3.0 * quantities[of].value(&file) } else { 0.0 };
                assert!((value(of, start) - expected).abs() < 1e-9 * expected.max(1.0));
            }
            let expected_s = if number >> 2 & 1 == 1 { -5e-3 } else { 0.0 };
            assert!((value(3, start) - expected_s).abs() < 1e-12, "{start:?}");
        }
        // Quantities that are not fitted keep their values.
        search.open = vec![0, 3];
        assert_eq!(search.starts().len(), 2);
    }
}
