//! Verdict on a motion in simulation: its plan is played in open loop on contacts of usual, lower and higher stiffness.
//!
//! A plan that satisfies its equations is consistent, but the robot may still deviate from it: errors grow, feet land early or
//! late, servos yield. The stiffness of a real floor is unknown, so a motion that depends on it fails.

use crate::control::Control;
use crate::mismatch::Mismatch;
use crate::outcome::{MotionFailure, RunOutcome};
use crate::run::{Moment, Options, play};
use rollwalk_planner::plan::Plan;
use serde::Serialize;
use std::fmt;

/// Scale factors of the usual contact stiffness, in the order in which they are simulated.
const STIFFNESSES: [f64; 3] = [1.0, 0.5, 2.0];
/// Maximum number of periods of a periodic motion.
///
/// Effects of the start last for one period, and growing errors show after some more. A run ends earlier when it has settled.
const CYCLES: usize = 8;

/// Verdict on a motion in simulation.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "verdict")]
pub enum Verdict {
    /// Motion that covers its planned displacement without a fall, on all contacts.
    Holds,
    /// Motion that falls, or deviates from its planned displacement.
    Fails {
        /// Scale factor of the usual contact stiffness at which the motion fails.
        contact_stiffness: f64,
        /// Reason of the failure.
        #[serde(flatten)]
        miss: MotionFailure,
    },
    /// Step of the simulation without a solution.
    Unsolved {
        /// Scale factor of the usual contact stiffness at which the step has no solution.
        contact_stiffness: f64,
        /// Simulated time, s.
        at_s: f64,
    },
}

impl Verdict {
    /// Plays a validated plan on all contacts and returns the verdict.
    ///
    /// Calls `goes_on` at each step with the completed fraction of all steps. If `goes_on` returns `false` the result is
    /// `None`.
    pub fn of(plan: &Plan, mut goes_on: impl FnMut(f64) -> bool) -> Option<Self> {
        for (number, contact_stiffness) in STIFFNESSES.into_iter().enumerate() {
            let control = Control::FeedForward;
            let mut options = Options::new(control, control.usual_rate_hz());
            options.cycles = CYCLES;
            options.mismatch = Mismatch { contact_stiffness, ..Mismatch::default() };
            let (mut stopped, mut at_s) = (false, 0.0);
            let watch = |moment: &Moment<'_>| {
                at_s = moment.done_s;
                let done = (number as f64 + at_s / moment.all_s) / STIFFNESSES.len() as f64;
                stopped = !goes_on(done);
                !stopped && !moment.has_settled
            };
            let outcome = play(plan, &options, watch);
            if stopped {
                return None;
            }
            match outcome.as_ref().map(RunOutcome::miss) {
                Ok(None) => {}
                Ok(Some(miss)) => return Some(Self::Fails { contact_stiffness, miss }),
                Err(_) => return Some(Self::Unsolved { contact_stiffness, at_s }),
            }
        }
        Some(Self::Holds)
    }

    /// Largest number of periods of a periodic motion that the verdict is about.
    pub const CYCLES: usize = CYCLES;

    /// Scale factor of the usual contact stiffness at which the motion fails; `None` for a motion that passes.
    pub fn failing_stiffness(&self) -> Option<f64> {
        match self {
            Self::Holds => None,
            Self::Fails { contact_stiffness, .. } | Self::Unsolved { contact_stiffness, .. } => {
                Some(*contact_stiffness)
            }
        }
    }

    /// True if the motion passes on all contacts.
    pub fn holds(&self) -> bool {
        *self == Self::Holds
    }

    /// True if the robot does not fall, and its displacement is near the planned one without being accepted.
    pub fn misses_by_little(&self) -> bool {
        match self {
            Self::Fails { miss: MotionFailure::Astray { astray, .. }, .. } => astray.is_little(),
            Self::Fails { miss: MotionFailure::Changes { .. }, .. } => true,
            _ => false,
        }
    }

    /// True if the motion passes, or if its author has declared that it needs feedback.
    pub fn is_good(&self, plan: &Plan) -> bool {
        self.holds() || plan.motion.needs_feedback.is_some()
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = |stiffness: f64| match stiffness {
            1.0 => String::new(),
            of => format!(", with contacts of {of} times the usual stiffness"),
        };
        match self {
            Self::Holds => write!(
                f,
                "passes the simulation: no fall, 95 to 105 % of each goal, with contacts of 0.5, 1 and 2 times the usual stiffness"
            ),
            Self::Fails { contact_stiffness, miss } => {
                write!(f, "fails in simulation: {miss}{}", on(*contact_stiffness))
            }
            Self::Unsolved { contact_stiffness, at_s } => write!(
                f,
                "cannot be simulated: the step at {at_s:.3} s has no solution{}",
                on(*contact_stiffness)
            ),
        }
    }
}
