//! Fit of one run, and prediction of other runs.
//!
//! The search starts from several points over the first quarter of the run. The best result is continued over growing parts of
//! the run, then each quantity gets a verdict.

use super::outcome::{FitError, FitResult, FittedQuantity, QuantityVerdict, Stage};
use super::quality::Quality;
use super::quantity::{Quantity, SimulationModel};
use super::recording::{Recording, SHORTEST_S};
use super::rollout::Replay;
use super::search::Search;
use super::series::Series;
use super::start::Start;
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_robot::Robot;
use std::sync::Arc;

/// Limits of a fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options {
    /// Fraction of the run at its end that is predicted instead of fitted.
    pub held_out: f64,
    /// Maximum number of steps of the run. Later steps are ignored.
    pub steps_max: usize,
    /// Maximum number of iterations of each search.
    pub iterations: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self { held_out: 0.25, steps_max: 2400, iterations: 40 }
    }
}

/// Rates at which measurements are sampled, Hz: minimum, maximum, and the rate for a recording with sparser rows.
const RATES_HZ: [f64; 3] = [100.0, 300.0, 120.0];
/// Minimum simulation rate, steps per second. At 120 Hz the error of a landing foot changes kp by up to 3 %.
const STEPS_HZ: f64 = 200.0;

/// Fits quantities of a robot to a recording.
///
/// Calls `goes_on` before each rollout; `false` ends the search.
///
/// # Errors
/// Returns an error for the mass of a link with a soft foot, for a robot with coupled motors or passive joints, or for a
/// recording that is too short. Also returns an error if the simulated robot falls at once, or if `goes_on` returns `false`.
pub fn identify(
    robot: &Robot,
    recording: Recording,
    quantities: &[Quantity],
    options: &Options,
    goes_on: impl FnMut(&Stage) -> bool,
) -> Result<FitResult, FitError> {
    if let Some(link) = quantities.iter().find_map(|of| of.soft_link(robot)) {
        return Err(FitError::Soft(link.to_owned()));
    }
    if let Some(joint) = robot.joints.iter().find(|joint| joint.is_coupled()) {
        return Err(FitError::Coupled(joint.name.clone()));
    }
    if let Some(joint) = robot.joints.iter().find(|joint| joint.is_passive()) {
        return Err(FitError::Passive(joint.name.clone()));
    }
    let file = SimulationModel::new(robot);
    let replay = replay(recording, &file, options)?;
    let until = replay.steps - (replay.steps as f64 * options.held_out) as usize;
    let mut search = Search::new(&replay, &file, quantities, options.iterations, goes_on);
    let quarter = (until / 4).max(((SHORTEST_S / 2.0) / replay.step_s) as usize).min(until);
    let quarter_s = quarter as f64 * replay.step_s;
    let at_first = search.begin(quarter);
    search.check()?;
    let Some(at_first) = at_first else { return Err(FitError::Falls(quarter_s)) };
    let mut horizon = quarter;
    for steps in [(quarter + until) / 2, until] {
        search.search_friction(steps);
        if search.minimise("everything", steps, true, true).is_none() {
            break;
        }
        horizon = steps;
        search.estimate_noise(steps);
        search.check()?;
    }
    // A second pass uses the noise of the first fit, and leaves out quantities that the run does not determine.
    let mut found: Vec<Option<FittedQuantity>> = vec![None; quantities.len()];
    let mut correlated = Vec::new();
    while !search.open.is_empty() {
        let Some(fit) = search.minimise("everything", horizon, true, true) else { break };
        search.check()?;
        search.estimate_noise(horizon);
        let spreads = search.spreads(horizon);
        search.check()?;
        let judged = search.judge(&fit, &spreads);
        let drop: Vec<usize> = (judged.iter())
            .filter(|(_, found)| {
                !matches!(found.verdict, QuantityVerdict::Changed | QuantityVerdict::Agrees)
            })
            // Auxiliary quantities remain as the others need them.
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
    let found: Vec<FittedQuantity> = found.into_iter().flatten().collect();
    let mut model = file.clone();
    for (number, of) in found.iter().enumerate() {
        if of.is_adopted() {
            of.quantity.set(&mut model, of.fitted);
        } else {
            search.at.quantities[number] = 0.0;
        }
    }
    // Quantities that agree with the file return to the file's values, so the start of the run may change a little.
    search.minimise("where the run begins", horizon, false, true);
    let at_end = search.at.start.clone();
    let mut compare = |model: &SimulationModel, start: &[f64]| {
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
    Ok(FitResult {
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

/// Simulates another recording and returns the error after its first quarter; `None` if the robot falls.
///
/// The start of the run is fitted over the first quarter. `goes_on` is called as in [`identify`].
///
/// # Errors
/// Returns an error if the recording is too short, or if `goes_on` returns `false`.
pub fn predict(
    model: &SimulationModel,
    recording: Recording,
    options: &Options,
    goes_on: impl FnMut(&Stage) -> bool,
) -> Result<Option<Quality>, FitError> {
    let replay = replay(recording, model, options)?;
    let mut search = Search::new(&replay, model, &[], options.iterations, goes_on);
    let quarter = replay.steps / 4;
    let begins = search.minimise("where the run begins", quarter, false, true);
    let start = search.at.start.clone();
    let played = begins.and_then(|_| search.play(model, &start, &[], false, replay.steps));
    search.check()?;
    Ok(played.map(|played| Quality::of(played.misses(), quarter, replay.steps)))
}

/// Resamples a recording on a grid of steps. Drops commanded speeds that the servos of the robot do not take.
pub(super) fn replay(
    mut recording: Recording,
    file: &SimulationModel,
    options: &Options,
) -> Result<Replay, FitError> {
    let [begin_s, end_s] = recording.span_s;
    if end_s - begin_s < SHORTEST_S {
        return Err(FitError::Short((end_s - begin_s).max(0.0)));
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
    for (drive, channel) in recording.drives.iter_mut().zip(file.robot.channels()) {
        if !file.robot.takes_speed(&channel) {
            drive.target_rad_s = Series::default();
        }
    }
    let start = Start::of(&recording, file);
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let steps = steps.min(options.steps_max);
    let parts = (step_s * STEPS_HZ).ceil() as usize;
    Ok(Replay { recording: Arc::new(recording), start, step_s, parts, steps, ground })
}
