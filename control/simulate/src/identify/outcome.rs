//! What a search says while it goes on, what it found in the end, or why it found nothing.

use super::quality::Quality;
use super::quantity::{Kind, Model, Quantity};
use super::recording::SHORTEST_S;
use thiserror::Error;

/// What is being done, for who waits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// In words.
    pub what: &'static str,
    /// Length of the simulated run, s.
    pub horizon_s: f64,
    /// Rollouts so far.
    pub rollouts: usize,
}

/// What became of a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It is another one than in the file.
    Changed,
    /// It is that of the file, within its deviation.
    Agrees,
    /// Nothing that was measured depends on it, or only together with others.
    Silent,
    /// It is not known well enough.
    Vague,
    /// The search did not come to an end within sensible values.
    Absurd,
}

/// Share of a value above which its deviation is too large to write it down, and deviation of a delay, s.
const VAGUE: f64 = 0.25;
const VAGUE_DELAY_S: f64 = 5e-3;
/// Deviations by which a value differs that is another one.
const DIFFERENT: f64 = 2.0;
/// Change, as a logarithm, beyond which a search has lost its way.
const ABSURD: f64 = 3.0;

impl Verdict {
    /// On a value with its deviation.
    pub(super) fn of(quantity: &Quantity, before: f64, fitted: f64, deviation: f64) -> Self {
        let is_delay = quantity.kind == Kind::Delay;
        let most = if is_delay { VAGUE_DELAY_S } else { VAGUE * fitted };
        if !deviation.is_finite() {
            Self::Silent
        } else if !is_delay && quantity.to_parameter(before, fitted).abs() > ABSURD {
            Self::Absurd
        } else if deviation > most {
            Self::Vague
        } else if (fitted - before).abs() > DIFFERENT * deviation {
            Self::Changed
        } else {
            Self::Agrees
        }
    }
}

/// A fitted quantity: its value, its deviation and the verdict on it.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// Which.
    pub quantity: Quantity,
    /// Of the robot file.
    pub before: f64,
    /// As fitted, whether it is to be used or not.
    pub fitted: f64,
    /// Standard deviation, of noise and of what parts of the run disagree about beyond it; infinite if the run does not tell.
    pub deviation: f64,
    /// What to make of it.
    pub verdict: Verdict,
}

impl Found {
    /// Whether the value takes part in the mean of several runs: the run determines it, and the search ended within sensible values. A value that is
    /// too uncertain for the robot file takes part, with the little weight that its deviation gives it.
    pub(super) fn is_counted(&self) -> bool {
        self.deviation.is_finite() && self.deviation > 0.0 && self.verdict != Verdict::Absurd
    }

    /// Whether a model takes it: it is another number than the file's, or one that no file has, which the others need as it was found.
    pub(super) fn is_adopted(&self) -> bool {
        self.verdict == Verdict::Changed || self.quantity.kind.is_along()
    }
}

/// What was found.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The robot with all quantities that changed.
    pub model: Model,
    /// All of them.
    pub found: Vec<Found>,
    /// Pairs of quantities that the run hardly tells apart, with their correlation.
    pub correlated: Vec<(String, String, f64)>,
    /// Of the steps of the fit, with the numbers of the file and with those found; `None` if the robot falls.
    pub fitted: [Option<Quality>; 2],
    /// Of the end of the run, which took no part.
    pub predicted: [Option<Quality>; 2],
    /// Times at which the fitted part begins, the predicted part begins, and the run ends, s.
    pub times_s: [f64; 3],
    /// Time over which the robot was fitted, s: less than planned if it falls later.
    pub horizon_s: f64,
    /// Simulated rollouts.
    pub rollouts: usize,
}

/// Why nothing can be found.
#[derive(Debug, Error)]
pub enum Unfit {
    /// The robot falls at once.
    #[error(
        "with the numbers of its file the simulated robot falls within {0:.2} s, though the recorded one did not"
    )]
    Falls(f64),
    /// The recording is too short.
    #[error("{0:.2} s are too short for a fit: it takes {SHORTEST_S} s")]
    Short(f64),
    /// The mass of a link with a soft foot.
    #[error("the mass of {0} cannot be fitted, because its foot is soft")]
    Soft(String),
    /// The caller ended it.
    #[error("interrupted")]
    Ended,
}
