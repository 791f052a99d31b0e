//! Progress, results and errors of a search.

use super::quality::Quality;
use super::quantity::{Kind, Model, Quantity};
use super::recording::SHORTEST_S;
use thiserror::Error;

/// Stage of a fit, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Name of the stage.
    pub what: &'static str,
    /// Length of the simulated run, s.
    pub horizon_s: f64,
    /// Rollouts so far.
    pub rollouts: usize,
}

/// Verdict on a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Value differs from that of the file.
    Changed,
    /// Value agrees with that of the file within two standard deviations.
    Agrees,
    /// Measurements do not depend on the quantity, or only together with others.
    Silent,
    /// Value is not known well enough.
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
    /// Verdict on a value with its standard deviation.
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
    /// Quantity that was fitted.
    pub quantity: Quantity,
    /// Value of the robot file.
    pub before: f64,
    /// Fitted value, adopted or not.
    pub fitted: f64,
    /// Standard deviation of noise and of disagreement between parts of the run beyond noise; infinite if the run does not
    /// determine the quantity.
    pub deviation: f64,
    /// Verdict on the value.
    pub verdict: Verdict,
}

impl Found {
    /// True if the value takes part in the mean of several runs: the run determines it, and the search ended within sensible
    /// values. A value that is too uncertain for the robot file takes part, with the small weight of its deviation.
    pub(super) fn is_counted(&self) -> bool {
        self.deviation.is_finite() && self.deviation > 0.0 && self.verdict != Verdict::Absurd
    }

    /// True if a model adopts the value: it differs from the file's, or no file has it and the other quantities need it as it was
    /// found.
    pub(super) fn is_adopted(&self) -> bool {
        self.verdict == Verdict::Changed || self.quantity.kind.is_along()
    }
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct Identified {
    /// The robot with all quantities that changed.
    pub model: Model,
    /// Fitted quantities, changed or not.
    pub found: Vec<Found>,
    /// Pairs of quantities that the run hardly separates, with their correlation.
    pub correlated: Vec<(String, String, f64)>,
    /// Error over the steps of the fit, with the numbers of the file and with the fitted ones; `None` if the robot falls.
    pub fitted: [Option<Quality>; 2],
    /// Error over the end of the run, which took no part in the fit.
    pub predicted: [Option<Quality>; 2],
    /// Times at which the fitted part begins, the predicted part begins, and the run ends, s.
    pub times_s: [f64; 3],
    /// Time over which the robot was fitted, s: less than planned if it falls later.
    pub horizon_s: f64,
    /// Simulated rollouts.
    pub rollouts: usize,
}

/// Error of a fit without result.
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
