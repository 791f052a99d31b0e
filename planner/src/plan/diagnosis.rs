//! The diagnosis of a request that cannot be met: which constraints contradict each other, where, by how much,
//! and what to change. [`crate::diagnose`] makes it.

use crate::families::{Family, Kind};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Diagnosis of a request that cannot be met.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Diagnosis {
    /// Evidence against the request.
    pub verdict: Verdict,
    /// The constraints that conflict: what the motion asks for first, the easiest to give
    /// way before the others, then what stands against it, the hardest pulling first.
    pub culprits: Vec<Culprit>,
}

/// Evidence against a request, the strongest first. None is a proof: another start may lead to a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The constraints, linearised at the nearest point, contradict each other: no small change meets them.
    Contradiction,
    /// Even without any regard for costs the constraints stay far beyond their credible levels.
    FarOff,
    /// The solve has stopped getting anywhere.
    Stuck,
}

impl Verdict {
    /// Whether a second start that ends like this is enough to give up.
    pub fn is_grave(self) -> bool {
        match self {
            Self::Contradiction | Self::FarOff => true,
            Self::Stuck => false,
        }
    }
}

/// A constraint that takes part in the contradiction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Culprit {
    /// The constraint.
    pub constraint: Family,
    /// What it is to the user.
    pub part: Kind,
    /// End effector, joint or direction that it is about; `null` for the whole robot.
    pub subject: Option<String>,
    /// When it pulls, first and last time, s.
    pub time_s: [f64; 2],
    /// Its largest residual at the nearest point.
    pub worst: f64,
    /// Unit of `worst`, `given` and `would_do`.
    pub unit: String,
    /// Its part of the violation at the nearest point, 0 to 1.
    pub share: f64,
    /// Field of the motion or robot file that says how much, where it is one number.
    pub field: Option<String>,
    /// That number.
    pub given: Option<f64>,
    /// The number that would do, all else as it is: estimated to first order from how the violation changes
    /// with it. `null` where no estimate makes sense.
    pub would_do: Option<f64>,
    /// What to change.
    pub advice: String,
}

impl fmt::Display for Culprit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.constraint)?;
        if let Some(subject) = &self.subject {
            write!(f, " of {subject}")?;
        }
        let [from, to] = self.time_s;
        if to > from {
            write!(f, ", {from:.2} to {to:.2} s")?;
        } else {
            write!(f, ", at {from:.2} s")?;
        }
        write!(f, ": off by {:.3} {}", self.worst, self.unit)?;
        if let (Some(field), Some(given)) = (&self.field, self.given) {
            write!(f, "; {field} is {given:.3}")?;
        }
        if let Some(would_do) = self.would_do {
            write!(f, ", about {would_do:.3} would do")?;
        }
        Ok(())
    }
}

impl fmt::Display for Diagnosis {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{}",
            match self.verdict {
                Verdict::Contradiction => "these constraints contradict each other:",
                Verdict::FarOff =>
                    "no solution near: even without costs these constraints stay far beyond their levels:",
                Verdict::Stuck => "where it got stuck, these constraints conflict:",
            }
        )?;
        for culprit in &self.culprits {
            writeln!(f, "  {culprit}")?;
        }
        // One piece of advice for each kind of constraint: a request, a limit, the build of the robot.
        let mut parts: Vec<&Culprit> = Vec::new();
        for culprit in &self.culprits {
            let new =
                |other: &&Culprit| other.part != culprit.part && other.advice != culprit.advice;
            if parts.iter().all(new) {
                parts.push(culprit);
            }
        }
        let advice: Vec<&str> = parts.iter().map(|culprit| culprit.advice.as_str()).collect();
        if advice.is_empty() {
            Ok(())
        } else {
            write!(f, "what would help: {}", advice.join("; or "))
        }
    }
}
