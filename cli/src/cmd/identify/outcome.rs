//! Fits of the runs of a command line: each run alone, all together, and the simulations of each run and of others with these
//! numbers.

use super::runs::Run;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{
    Combined, Identified, Model, Options, Quality, Quantity, Recording, Stage, Together, Unfit,
    identify, predict, together,
};
use std::path::PathBuf;

pub struct Outcome {
    pub fits: Vec<Fit>,
    /// Fit of all runs together; a single run's own fit.
    pub together: Together,
    /// Runs that took no part, with the numbers of the file and with those found.
    pub others: Vec<(String, [Option<Quality>; 2])>,
}

/// A run, fitted alone.
pub struct Fit {
    pub run: String,
    pub found: Identified,
    /// Comparison after the first quarter of this run: simulations with the numbers of the file, of this run and of all runs.
    /// `None` for a single run; the inner `None` where the robot falls.
    pub compared: Option<[Option<Quality>; 3]>,
}

/// A run that cannot be fitted.
pub struct Unfitted {
    pub path: PathBuf,
    pub reason: Unfit,
}

impl Outcome {
    /// Fits and predicts. `goes_on` hears of each rollout with the name of its run, and ends the search by answering `false`.
    ///
    /// # Errors
    /// A run cannot be fitted, or the caller ended it.
    pub fn new(
        robot: &Robot,
        quantities: &[Quantity],
        runs: Vec<Run>,
        others: Vec<Run>,
        goes_on: impl Fn(&str, &Stage) -> bool,
    ) -> Result<Self, Unfitted> {
        let options = Options::default();
        let watch = |run: &Run| {
            let (name, goes_on) = (run.name.clone(), &goes_on);
            move |stage: &Stage| goes_on(&name, stage)
        };
        let unfitted = |run: &Run| {
            let path = run.path.clone();
            |reason| Unfitted { path, reason }
        };
        let mut found = Vec::new();
        for run in &runs {
            let of = identify(robot, run.recording.clone(), quantities, &options, watch(run));
            found.push(of.map_err(unfitted(run))?);
        }
        let file = Model::new(robot);
        let together = together(robot, quantities, &found);
        let simulated = |model: &Model, run: &Run| {
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

    /// Names of the runs that tell a quantity.
    pub fn names(&self, of: &Combined) -> Vec<&str> {
        of.runs.iter().map(|&run| self.fits[run].run.as_str()).collect()
    }
}
