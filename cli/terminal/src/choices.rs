//! Solver choices, as command-line options and as fields of problem files.

use rollwalk_planner::start::{Start, WarmStart};
use rollwalk_planner::{Method, Options};
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// Starting point of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartChoice {
    /// Chosen automatically for the motion; several starting points in parallel if there are several cores (default)
    #[default]
    Auto,
    /// Standing pose, moved along the path to the goal
    Standing,
    /// Standing pose with a smooth random oscillation of every joint
    Sinusoid,
    /// Plan of the same motion with half the samples
    Coarse,
    /// Warm start of the thesis: stand, sway, step in place
    Warm,
}

impl From<StartChoice> for Start {
    fn from(choice: StartChoice) -> Self {
        match choice {
            StartChoice::Auto => Self::Auto,
            StartChoice::Standing => Self::Standing,
            StartChoice::Sinusoid => Self::Sinusoid,
            StartChoice::Coarse => Self::Coarse,
            StartChoice::Warm => Self::Warm(WarmStart::default()),
        }
    }
}

/// Optimisation method of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MethodChoice {
    /// Gauss-Newton with Lagrange multipliers (default)
    #[default]
    GaussNewton,
    /// Thesis: Newton with a penalty of 10000, without second derivatives of the consistency constraints
    NewtonFiltered,
    /// Thesis: Newton with a penalty of 10000 and the true Hessian
    NewtonTrue,
    /// Thesis: L-BFGS with a penalty of 10000
    Lbfgs,
}

impl From<MethodChoice> for Method {
    fn from(choice: MethodChoice) -> Self {
        match choice {
            MethodChoice::GaussNewton => Self::GaussNewton,
            MethodChoice::NewtonFiltered => Self::NewtonFiltered,
            MethodChoice::NewtonTrue => Self::NewtonTrue,
            MethodChoice::Lbfgs => Self::Lbfgs,
        }
    }
}

/// Choices of a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// Starting point.
    pub start: StartChoice,
    /// Seed of the random numbers of the starting point.
    pub seed: u64,
    /// Optimisation method.
    pub method: MethodChoice,
    /// Maximum number of iterations of each starting point.
    pub iterations: NonZeroU32,
    /// True if the number of samples in the motion file must not be changed.
    #[serde(default)]
    pub samples_fixed: bool,
}

/// Maximum number of iterations of a solve that does not set one.
pub fn default_iterations() -> NonZeroU32 {
    let usual = Options::default().settings.iterations;
    u32::try_from(usual).ok().and_then(NonZeroU32::new).unwrap_or(NonZeroU32::MAX)
}

impl From<Choices> for Options {
    fn from(choices: Choices) -> Self {
        let Choices { start, seed, method, iterations, samples_fixed } = choices;
        let mut options =
            Self { start: start.into(), seed, refine: !samples_fixed, ..Self::default() };
        options.settings.method = method.into();
        options.settings.iterations = iterations.get() as usize;
        options
    }
}
