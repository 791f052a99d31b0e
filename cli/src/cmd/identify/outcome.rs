//! Fits of all runs of a command line, separately and together, and simulations of the fitted and other runs with the fitted
//! values.

use super::runs::Run;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{
    CombinedFit, CombinedQuantity, FitError, FitResult, Options, Quality, Quantity, Recording,
    SimulationModel, Stage, combine_fits, identify, predict,
};
use std::path::PathBuf;

pub struct IdentificationOutcome {
    pub fits: Vec<Fit>,
    /// Combined fit of all runs; for a single run, its own fit.
    pub together: CombinedFit,
    /// Runs that were not fitted, simulated with the original and with the fitted values.
    pub others: Vec<(String, [Option<Quality>; 2])>,
}

/// Run, fitted separately.
pub struct Fit {
    pub run: String,
    pub found: FitResult,
    /// Comparison after the first quarter of this run: simulations with the original values, with the values fitted to this run,
    /// and with the values fitted to all runs. `None` for a single run; an inner `None` if the robot falls.
    pub compared: Option<[Option<Quality>; 3]>,
}

/// Run that cannot be fitted.
pub struct RejectedRun {
    pub path: PathBuf,
    pub reason: FitError,
}

impl IdentificationOutcome {
    /// Fits the runs and simulates the others. `goes_on` is called for each rollout with the name of its run; returning `false`
    /// ends the search.
    ///
    /// # Errors
    /// Returns an error if a run cannot be fitted, or if `goes_on` returned `false`.
    pub fn new(
        robot: &Robot,
        quantities: &[Quantity],
        runs: Vec<Run>,
        others: Vec<Run>,
        goes_on: impl Fn(&str, &Stage) -> bool,
    ) -> Result<Self, RejectedRun> {
        let options = Options::default();
        let watch = |run: &Run| {
            let (name, goes_on) = (run.name.clone(), &goes_on);
            move |stage: &Stage| goes_on(&name, stage)
        };
        let unfitted = |run: &Run| {
            let path = run.path.clone();
            |reason| RejectedRun { path, reason }
        };
        let mut found = Vec::new();
        for run in &runs {
            let of = identify(robot, run.recording.clone(), quantities, &options, watch(run));
            found.push(of.map_err(unfitted(run))?);
        }
        let file = SimulationModel::new(robot);
        let together = combine_fits(robot, quantities, &found);
        let simulated = |model: &SimulationModel, run: &Run| {
            let recording: Recording = run.recording.clone();
            predict(model, recording, &options, watch(run)).map_err(unfitted(run))
        };
        let is_one = found.len() == 1;
        let mut fits = Vec::new();
        for (run, found) in runs.iter().zip(found) {
            let with = |model| simulated(model, run);
            let compared = match is_one {
                true => None,
                false => Some([with(&file)?, with(&found.model)?, with(&together.model)?]),
            };
            fits.push(Fit { run: run.name.clone(), found, compared });
        }
        let mut predicted = Vec::new();
        for run in &others {
            let of = [simulated(&file, run)?, simulated(&together.model, run)?];
            predicted.push((run.name.clone(), of));
        }
        Ok(Self { fits, together, others: predicted })
    }

    /// Names of the runs that determine a quantity.
    pub fn names(&self, of: &CombinedQuantity) -> Vec<&str> {
        of.runs.iter().map(|&run| self.fits[run].run.as_str()).collect()
    }
}
