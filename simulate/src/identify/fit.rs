//! The search: from several numbers where the run begins and the quantities over a short horizon, then from the best all together over
//! growing horizons, and what the data tell of each.

use super::effects::Report;
use super::outcome::{Found, Identified, Stage, Unfit, Verdict};
use super::parts;
use super::quality::{self, Quality};
use super::quantity::{Kind, Model, Quantity};
use super::recording::{Recording, SHORTEST_S};
use super::rollout::{Noise, Played, Replay};
use super::start::Start;
use nalgebra::DMatrix;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::sensitivity::gauss_newton::{self, Evaluation, Fit, Penalty, minimise};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// How a fit goes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Share of the run, at its end, that takes no part, and that is predicted.
    pub held_out: f64,
    /// Most steps of the run: what comes later is left out.
    pub steps_max: usize,
    /// Most iterations of each search.
    pub iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { held_out: 0.25, steps_max: 2400, iterations: 40 }
    }
}

/// Steps at which measurements are taken, a second: fewest, most, and those of a recording with few rows.
const RATES_HZ: [f64; 3] = [100.0, 300.0, 120.0];
/// Fewest steps of the world a second: at 120 a foot that lands has an error as large as 3 % of kp.
const STEPS_HZ: f64 = 200.0;
/// Correlation from which two quantities are named.
const CORRELATED: f64 = 0.95;
/// Change, as a logarithm, to be expected of a quantity.
const EXPECTED: f64 = 1.0;
/// Shares of the coefficient of friction that are tried where nothing slips: what sticks has no derivative.
const FRICTIONS: [f64; 6] = [0.75, 0.55, 0.4, 0.3, 0.2, 1.5];
/// Stiffness and friction of contacts, by those that a simulation has, from which a search begins, too.
const FIRMNESS: f64 = 4.0;
/// Largest change of a parameter in an iteration.
const MOST: f64 = 0.3;
/// Improvement of an iteration that is too small to go on, as a share: a run has some 10,000 residuals, and a deviation of a parameter
/// changes the objective by a half.
const TOLERANCE: f64 = 1e-6;

/// Fits quantities of a robot to a recording. `goes_on` hears of each rollout, and ends the search by answering `false`.
///
/// # Errors
/// Why there is nothing to be found.
pub fn identify(
    robot: &Robot,
    recording: Recording,
    quantities: &[Quantity],
    options: &Options,
    goes_on: impl FnMut(&Stage) -> bool,
) -> Result<Identified, Unfit> {
    if let Some(link) = quantities.iter().find_map(|of| of.soft_link(robot)) {
        return Err(Unfit::Soft(link.to_owned()));
    }
    let file = Model::new(robot);
    let replay = replay(recording, &file, options)?;
    let until = replay.steps - (replay.steps as f64 * options.held_out) as usize;
    let mut search = Search::new(&replay, &file, quantities, options, goes_on);
    let quarter = (until / 4).max(((SHORTEST_S / 2.0) / replay.step_s) as usize).min(until);
    let quarter_s = quarter as f64 * replay.step_s;
    let at_first = search.begin(quarter);
    search.check()?;
    let Some(at_first) = at_first else { return Err(Unfit::Falls(quarter_s)) };
    let mut horizon = quarter;
    for steps in [(quarter + until) / 2, until] {
        search.look_for_friction(steps);
        if search.minimise("everything", steps, true, true).is_none() {
            break;
        }
        horizon = steps;
        search.learn_noise(steps);
        search.check()?;
    }
    // Once more with the noise that the fit has left, and without what the run does not tell.
    let mut found: Vec<Option<Found>> = vec![None; quantities.len()];
    let mut correlated = Vec::new();
    while !search.open.is_empty() {
        let Some(fit) = search.minimise("everything", horizon, true, true) else { break };
        search.check()?;
        search.learn_noise(horizon);
        let spreads = search.spreads(horizon);
        search.check()?;
        let judged = search.judge(&fit, &spreads);
        let drop: Vec<usize> = (judged.iter())
            .filter(|(_, found)| !matches!(found.verdict, Verdict::Changed | Verdict::Agrees))
            // What is fitted along stays as the others need it.
            .filter(|(_, found)| !found.quantity.kind.is_along())
            .map(|(number, _)| *number)
            .collect();
        for (number, of) in judged {
            found[number] = Some(of);
        }
        for pair in search.correlations(&fit) {
            if correlated
                .iter()
                .all(|(a, b, _): &(String, String, f64)| (a, b) != (&pair.0, &pair.1))
            {
                correlated.push(pair);
            }
        }
        if drop.is_empty() {
            break;
        }
        search.open.retain(|number| !drop.contains(number));
        drop.iter().for_each(|&number| search.at.quantities[number] = 0.0);
    }
    search.check()?;
    let found: Vec<Found> = found.into_iter().flatten().collect();
    let mut model = file.clone();
    for (number, of) in found.iter().enumerate() {
        if of.is_adopted() {
            of.quantity.set(&mut model, of.fitted);
        } else {
            search.at.quantities[number] = 0.0;
        }
    }
    // With the file's numbers where they agree the run may begin a little otherwise.
    search.minimise("where the run begins", horizon, false, true);
    let at_end = search.at.start.clone();
    let mut compare = |model: &Model, start: &[f64]| {
        let all = search.play(model, start, &[], false, replay.steps);
        let parts = all.or_else(|| search.play(model, start, &[], false, until));
        let of = |after: usize, to: usize| {
            let played = parts.as_ref()?;
            Some(Quality::of(played.misses(), after, to)).filter(|found| !found.rms.is_empty())
        };
        [of(0, until), of(until, replay.steps)]
    };
    let [fitted_before, predicted_before] = compare(&file, &at_first);
    let [fitted_after, predicted_after] = compare(&model, &at_end);
    search.check()?;
    let begin_s = replay.recording.span_s[0];
    let at_s = |steps: usize| begin_s + steps as f64 * replay.step_s;
    Ok(Identified {
        model,
        found,
        correlated,
        fitted: [fitted_before, fitted_after],
        predicted: [predicted_before, predicted_after],
        times_s: [begin_s, at_s(until), at_s(replay.steps)],
        horizon_s: horizon as f64 * replay.step_s,
        rollouts: search.rollouts,
    })
}

/// How far a simulated run is from another recording, after the quarter of it in which it is fitted where the run begins; `None` if the robot
/// falls. `goes_on` as for [`identify`].
///
/// # Errors
/// The recording is too short, or the caller ended it.
pub fn predict(
    model: &Model,
    recording: Recording,
    options: &Options,
    goes_on: impl FnMut(&Stage) -> bool,
) -> Result<Option<Quality>, Unfit> {
    let replay = replay(recording, model, options)?;
    let mut search = Search::new(&replay, model, &[], options, goes_on);
    let quarter = replay.steps / 4;
    let begins = search.minimise("where the run begins", quarter, false, true);
    let start = search.at.start.clone();
    let played = begins.and_then(|_| search.play(model, &start, &[], false, replay.steps));
    search.check()?;
    Ok(played.map(|played| Quality::of(played.misses(), quarter, replay.steps)))
}

/// The recording on a grid of steps.
pub(super) fn replay(
    recording: Recording,
    file: &Model,
    options: &Options,
) -> Result<Replay, Unfit> {
    let [begin_s, end_s] = recording.span_s;
    if end_s - begin_s < SHORTEST_S {
        return Err(Unfit::Short((end_s - begin_s).max(0.0)));
    }
    let [fewest_hz, most_hz, else_hz] = RATES_HZ;
    let mut step_s = recording.interval_s;
    while step_s < 1.0 / most_hz {
        step_s *= 2.0;
    }
    if step_s > 1.0 / fewest_hz {
        step_s = 1.0 / else_hz;
    }
    let steps = ((end_s - begin_s) / step_s + 1e-3) as usize;
    let start = Start::of(&recording, file);
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let steps = steps.min(options.steps_max);
    let parts = (step_s * STEPS_HZ).ceil() as usize;
    Ok(Replay { recording: Arc::new(recording), start, step_s, parts, steps, ground })
}

/// Where a search is.
#[derive(Clone, Debug)]
struct At {
    /// A parameter for each quantity: 0 is the number of the file.
    quantities: Vec<f64>,
    /// Of the start.
    start: Vec<f64>,
}

struct Search<'a, G> {
    replay: &'a Replay,
    file: &'a Model,
    options: &'a Options,
    noise: Noise,
    at: At,
    all: &'a [Quantity],
    /// Quantities that are fitted.
    open: Vec<usize>,
    rollouts: usize,
    stage: Stage,
    goes_on: G,
    is_ended: bool,
}

impl<'a, G: FnMut(&Stage) -> bool> Search<'a, G> {
    /// From the numbers of the file, and where the run was measured to begin.
    fn new(
        replay: &'a Replay,
        file: &'a Model,
        all: &'a [Quantity],
        options: &'a Options,
        goes_on: G,
    ) -> Self {
        let at = At { quantities: vec![0.0; all.len()], start: vec![0.0; replay.start.count()] };
        Self {
            replay,
            file,
            options,
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

    fn check(&self) -> Result<(), Unfit> {
        if self.is_ended { Err(Unfit::Ended) } else { Ok(()) }
    }

    /// A rollout, unless the caller has ended the search.
    fn play(
        &mut self,
        model: &Model,
        start: &[f64],
        quantities: &[Quantity],
        by_start: bool,
        steps: usize,
    ) -> Option<Played> {
        self.rollouts += 1;
        self.stage.rollouts = self.rollouts;
        self.stage.horizon_s = steps as f64 * self.replay.step_s;
        self.is_ended |= !(self.goes_on)(&self.stage);
        if self.is_ended {
            return None;
        }
        self.replay.play(model, start, quantities, by_start, steps)
    }

    fn model(&self, at: &[f64]) -> Model {
        let mut model = self.file.clone();
        for (quantity, parameter) in self.all.iter().zip(at) {
            if *parameter != 0.0 {
                let value = quantity.of_parameter(quantity.value(self.file), *parameter);
                quantity.set(&mut model, value);
            }
        }
        model
    }

    /// Minimises the error over the quantities that are not held, over the initial state, or over both. `None` if the simulated robot falls
    /// with the present values.
    fn minimise(
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
            iterations: self.options.iterations,
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
        // What the run tells, without what was expected before of the quantities.
        for k in 0..count {
            fit.hessian[(k, k)] -= 1.0 / (EXPECTED * EXPECTED);
            if fit.hessian[(k, k)] < 1e-9 {
                fit.hessian.fill_row(k, 0.0);
                fit.hessian.fill_column(k, 0.0);
            }
        }
        Some(fit)
    }

    /// Fits a short run from several numbers of what is fitted along, and goes on from the best: how firm contacts are and when commands
    /// come is unknown by factors, over which the sum of squares has several minima. Returns where the run begins with the numbers of
    /// the file; none if the robot falls with them.
    fn begin(&mut self, steps: usize) -> Option<Vec<f64>> {
        let begins = "where the run begins";
        self.minimise(begins, steps, false, true)?;
        let file = self.at.start.clone();
        let mut best = (f64::INFINITY, self.at.clone());
        for quantities in self.starts() {
            self.at = At { quantities, start: file.clone() };
            if self.minimise(begins, steps, false, true).is_none() {
                continue;
            }
            self.look_for_friction(steps);
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

    /// Parameters from which a search begins: those of the file, contacts [`FIRMNESS`] times as firm, and another delay, in all
    /// combinations of those that are fitted.
    fn starts(&self) -> Vec<Vec<f64>> {
        let commands = self.replay.recording.drives.iter();
        let interval_s = commands.filter_map(|drive| drive.target_rad.interval_s()).next();
        let mut starts = vec![vec![0.0; self.all.len()]];
        for &open in &self.open {
            let quantity = &self.all[open];
            let value = quantity.value(self.file);
            let other = match quantity.kind {
                Kind::Stiffness | Kind::Stick => Some(FIRMNESS * value),
                // Drives that hold each command until the next one are half of that time ahead of lines between them.
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

    /// Tries other coefficients of friction, one of which may slip where that of the file does not.
    fn look_for_friction(&mut self, steps: usize) {
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

    /// Takes what the fit misses for noise.
    fn learn_noise(&mut self, steps: usize) {
        let model = self.model(&self.at.quantities);
        let start = self.at.start.clone();
        if let Some(played) = self.play(&model, &start, &[], false, steps) {
            self.noise = quality::found(played.misses());
        }
    }

    /// How far the open parameters are from one another in parts of the run, each fitted alone, beyond noise.
    fn spreads(&mut self, steps: usize) -> Vec<f64> {
        let replays = parts::of(self.replay, self.file, steps);
        let mut reports: Vec<Vec<Report>> = vec![Vec::new(); self.open.len()];
        for replay in &replays {
            let goes_on = &mut self.goes_on;
            let mut of_part = Search::new(replay, self.file, self.all, self.options, goes_on);
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
            all.for_each(|((of, &value), deviation)| of.push(Report { value, deviation }));
        }
        reports.iter().map(|of| parts::spread(of)).collect()
    }

    /// What to make of each open quantity.
    fn judge(&self, fit: &Fit, spreads: &[f64]) -> Vec<(usize, Found)> {
        let deviations = fit.deviations();
        let of = |(place, &number): (usize, &usize)| {
            let quantity = &self.all[number];
            let before = quantity.value(self.file);
            let parameter = self.at.quantities[number];
            let fitted = quantity.of_parameter(before, parameter);
            let deviation = deviations[place].hypot(spreads[place]) * quantity.by_parameter(fitted);
            let verdict = Verdict::of(quantity, before, fitted, deviation);
            let quantity = quantity.clone();
            (number, Found { quantity, before, fitted, deviation, verdict })
        };
        self.open.iter().enumerate().map(of).collect()
    }

    /// Pairs of open quantities that the run hardly tells apart.
    fn correlations(&self, fit: &Fit) -> Vec<(String, String, f64)> {
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

/// Inverse of a Hessian, without the rows of what nothing depends on.
fn inverse(hessian: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut known = hessian.clone();
    for k in 0..known.nrows() {
        if known[(k, k)] == 0.0 {
            known[(k, k)] = 1.0;
        }
    }
    Some(known.cholesky()?.inverse())
}
