//! Choices of a solve, on the command line and in problem files.

use rollwalk_planner::start::{Start, WarmStart};
use rollwalk_planner::{Method, Options};
use serde::{Deserialize, Serialize};
use std::num::NonZeroU32;

/// Starting point of a solve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StartChoice {
    /// Chosen for the motion; several starting points at once if there are cores for them (default)
    #[default]
    Auto,
    /// Standing, carried along the way to the goal
    Standing,
    /// Standing with a smooth random swing of every joint
    Sinusoid,
    /// The plan of the same motion with half the samples
    Coarse,
    /// The thesis's warm start: stand, sway, step in place
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
    /// Gauss-Newton with multipliers (default)
    #[default]
    GaussNewton,
    /// Thesis: Newton with a penalty of 10000, without the second derivatives of consistency constraints
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

/// Everything that can be chosen about a solve.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choices {
    /// Starting point.
    pub start: StartChoice,
    /// Seed of everything random in the start.
    pub seed: u64,
    /// Optimisation method.
    pub method: MethodChoice,
    /// Most iterations of each start.
    pub iterations: NonZeroU32,
    /// True if the samples stay those of the motion file.
    #[serde(default)]
    pub samples_fixed: bool,
}

/// Most iterations of a solve that does not say otherwise.
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
