//! Verdict on a motion in simulation. Its plan is played open loop, as a controller plays it, on contacts of the usual stiffness,
//! on softer and on harder ones.
//!
//! Plans that meet their equations are consistent, but the robot may still not follow them: errors grow or die out, feet land
//! early or late, servos yield. The stiffness of a real floor is unknown, so a motion that depends on it does not hold.

use crate::control::Control;
use crate::mismatch::Mismatch;
use crate::outcome::{Miss, Outcome};
use crate::run::{Moment, Options, play};
use rollwalk_planner::plan::Plan;
use serde::Serialize;
use std::fmt;

/// Stiffnesses of contacts over the usual one, in the order in which they are tried.
const STIFFNESSES: [f64; 3] = [1.0, 0.5, 2.0];
/// Periods of a motion that repeats, at most: the start has worn off after one, and what grows shows after some more. A run ends
/// earlier when it has settled.
const CYCLES: usize = 8;

/// Verdict on a motion in simulation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case", tag = "verdict")]
pub enum Verdict {
    /// Motion that comes where its plan says without a fall, on all contacts.
    Holds,
    /// Motion that falls or comes somewhere else.
    Fails {
        /// Stiffness of contacts over the usual one, with which it does not.
        contact_stiffness: f64,
        /// Reason why it does not hold.
        #[serde(flatten)]
        miss: Miss,
    },
    /// A step of the simulation has no solution.
    Unsolved {
        /// Stiffness of contacts over the usual one, with which it has none.
        contact_stiffness: f64,
        /// Simulated time, s.
        at_s: f64,
    },
}

impl Verdict {
    /// Plays a validated plan. Calls `goes_on` at each step with the share of all steps that are done; `None` if it returns
    /// `false`.
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
            match outcome.as_ref().map(Outcome::miss) {
                Ok(None) => {}
                Ok(Some(miss)) => return Some(Self::Fails { contact_stiffness, miss }),
                Err(_) => return Some(Self::Unsolved { contact_stiffness, at_s }),
            }
        }
        Some(Self::Holds)
    }

    /// True if the motion holds.
    pub fn holds(&self) -> bool {
        *self == Self::Holds
    }

    /// True if the robot stays on its feet and its way is near the planned one, but not near enough.
    pub fn misses_by_little(&self) -> bool {
        match self {
            Self::Fails { miss: Miss::Astray { astray, .. }, .. } => astray.is_little(),
            Self::Fails { miss: Miss::Changes { .. }, .. } => true,
            _ => false,
        }
    }

    /// True if the motion holds, or its author has declared that it needs feedback.
    pub fn is_good(&self, plan: &Plan) -> bool {
        self.holds() || plan.motion.needs_feedback.is_some()
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let on = |stiffness: f64| match stiffness {
            1.0 => String::new(),
            of => format!(", on contacts of {of} times the usual stiffness"),
        };
        match self {
            Self::Holds => write!(
                f,
                "holds in simulation, on contacts of 0.5, 1 and 2 times the usual stiffness"
            ),
            Self::Fails { contact_stiffness, miss } => {
                write!(f, "does not hold in simulation: {miss}{}", on(*contact_stiffness))
            }
            Self::Unsolved { contact_stiffness, at_s } => write!(
                f,
                "cannot be simulated: the step at {at_s:.3} s has no solution{}",
                on(*contact_stiffness)
            ),
        }
    }
}
