//! Progress, results and errors of a search.

use super::quality::Quality;
use super::quantity::{Kind, Quantity, SimulationModel};
use super::recording::SHORTEST_S;
use thiserror::Error;

/// Stage of a fit, for progress displays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// Name of the stage.
    pub what: &'static str,
    /// Duration of the simulated run, s.
    pub horizon_s: f64,
    /// Number of rollouts so far.
    pub rollouts: usize,
}

/// Verdict on a quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum QuantityVerdict {
    /// Value that differs from the value of the file.
    Changed,
    /// Value that agrees with the value of the file within two standard deviations.
    Agrees,
    /// Quantity that the measurements do not depend on, or only together with others.
    Silent,
    /// Value with too large a standard deviation.
    Vague,
    /// Value outside of the sensible range, at which the search ended.
    Absurd,
}

/// Ratio of standard deviation to value above which a value is too uncertain for the robot file.
const VAGUE: f64 = 0.25;
/// Standard deviation above which a delay is too uncertain, s.
const VAGUE_DELAY_S: f64 = 5e-3;
/// Number of standard deviations above which a fitted value counts as different from the file's.
const DIFFERENT: f64 = 2.0;
/// Largest sensible change, as logarithm of the ratio to the value of the file.
const ABSURD: f64 = 3.0;

impl QuantityVerdict {
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
pub struct FittedQuantity {
    /// Quantity that was fitted.
    pub quantity: Quantity,
    /// Value in the robot file.
    pub before: f64,
    /// Fitted value, adopted or not.
    pub fitted: f64,
    /// Standard deviation due to noise and to disagreement between parts of the run. Infinite if the run does not determine the
    /// quantity.
    pub deviation: f64,
    /// Verdict on the value.
    pub verdict: QuantityVerdict,
}

impl FittedQuantity {
    /// True if the value counts in the mean of several runs: the run determines it, and the search ended in the sensible range.
    ///
    /// A value that is too uncertain for the robot file also counts, with the small weight of its standard deviation.
    pub(super) fn is_counted(&self) -> bool {
        self.deviation.is_finite()
            && self.deviation > 0.0
            && self.verdict != QuantityVerdict::Absurd
    }

    /// True if the model adopts the value: it differs from the value of the file, or its kind is auxiliary
    /// ([`Kind::is_along`]).
    pub(super) fn is_adopted(&self) -> bool {
        self.verdict == QuantityVerdict::Changed || self.quantity.kind.is_along()
    }
}

/// Result of a fit.
#[derive(Clone, Debug)]
pub struct FitResult {
    /// Model with all adopted quantities.
    pub model: SimulationModel,
    /// Fitted quantities, changed or not.
    pub found: Vec<FittedQuantity>,
    /// Pairs of quantities that the run hardly distinguishes, with their correlation.
    pub correlated: Vec<(String, String, f64)>,
    /// Errors over the fitted steps, with the values of the file and with the fitted values; `None` if the robot falls.
    pub fitted: [Option<Quality>; 2],
    /// Errors over the predicted end of the run, in the order of [`fitted`](Self::fitted).
    pub predicted: [Option<Quality>; 2],
    /// Times at which the fitted part begins, the predicted part begins, and the run ends, s.
    pub times_s: [f64; 3],
    /// Duration of the fitted part of the run, s. Shorter than planned if the simulated robot falls later.
    pub horizon_s: f64,
    /// Number of simulated rollouts.
    pub rollouts: usize,
}

/// Error of a fit without result.
#[derive(Debug, Error)]
pub enum FitError {
    /// Simulated robot that falls at once.
    #[error(
        "with the values of the robot file, the simulated robot falls within {0:.2} s, although \
         the recorded robot did not fall"
    )]
    Falls(f64),
    /// Recording that is too short.
    #[error("a run of {0:.2} s is too short for a fit; record at least {SHORTEST_S} s")]
    Short(f64),
    /// Mass of a link with a soft foot, which cannot be fitted.
    #[error("the mass of {0} cannot be fitted, because its foot is soft")]
    Soft(String),
    /// Coupled motor, whose drive cannot be fitted.
    #[error(
        "the motor of joint `{0}` is coupled (`motor_per_joint` or `linkage`), and such drives \
         cannot be fitted"
    )]
    Coupled(String),
    /// Joint without a motor, whose angle is not measured.
    #[error(
        "joint `{0}` has no motor, and robots with such joints cannot be fitted; measure its spring \
         on a bench"
    )]
    Passive(String),
    /// End of the search by the caller.
    #[error("interrupted")]
    Ended,
}
