//! Diagnosis of a request that cannot be met: the contradicting constraints with their times and violations, and advice.
//! [`crate::diagnose`] computes it.

use crate::families::{Family, Kind, Unit};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Diagnosis of a request that cannot be met.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Diagnosis {
    /// Evidence against the request.
    pub verdict: Verdict,
    /// Conflicting constraints. Motors too weak for standing, obstacles across the path and joints too slow for the swings come
    /// first. Requests of the motion follow in order of the relative change that they need, then opposing limits and properties
    /// of the robot.
    pub culprits: Vec<Culprit>,
}

impl Diagnosis {
    /// Removes the feasible values.
    pub(crate) fn forget_numbers(&mut self) {
        for culprit in &mut self.culprits {
            culprit.would_do = None;
        }
    }
}

/// Evidence against a request, strongest first. No verdict is a proof: another start may lead to a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The constraints, linearised at the point with the least violation, contradict each other: no small change meets them.
    Contradiction,
    /// The constraints remain far beyond their tolerances even without costs.
    FarOff,
    /// The solve makes no more progress.
    Stuck,
}

impl Verdict {
    /// Returns true if the search ends when two starts have this verdict.
    pub fn is_grave(self) -> bool {
        match self {
            Self::Contradiction | Self::FarOff => true,
            Self::Stuck => false,
        }
    }
}

/// Constraint that takes part in the contradiction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Culprit {
    /// Family of the constraint.
    pub constraint: Family,
    /// Kind of the constraint.
    pub part: Kind,
    /// End effector, joint or direction of the constraint; `null` for the whole robot.
    pub subject: Option<String>,
    /// First and last time at which the constraint contributes to the violation, s.
    pub time_s: [f64; 2],
    /// Largest residual of the constraint at the point with the least violation.
    pub worst: f64,
    /// Unit of `worst`, `given` and `would_do`. A given duration is in seconds regardless of this unit.
    pub unit: String,
    /// Fraction of the least violation that the constraint contributes, 0 to 1.
    pub share: f64,
    /// Field of the motion or robot file with the value that the constraint compares with, or [`DURATION`]. `null` if there is
    /// no such single value.
    pub field: Option<String>,
    /// Value of that field.
    pub given: Option<f64>,
    /// Feasible value: a plan was found with it, with all else unchanged. In a robot file, it replaces the given value in every
    /// motor or foot. `null` if none was found nearby.
    pub would_do: Option<f64>,
    /// Advice on the change that would help.
    pub advice: String,
}

/// Name of the field for the duration, s, in a culprit. A longer duration may help to meet any constraint.
pub const DURATION: &str = "duration_s";

/// Fraction of its tolerance above which the diagnosis prints a residual. Smaller residuals do not violate their constraint.
const LEAST_SHOWN: f64 = 0.1;

/// Formats a value with at most `digits` significant digits.
fn significant(value: f64, digits: usize) -> String {
    let rounded = format!("{value:.*e}", digits - 1).parse::<f64>();
    rounded.map_or_else(|_| value.to_string(), |rounded| rounded.to_string())
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
        let mut parts = Vec::new();
        let limit = self.given.unwrap_or(f64::INFINITY);
        if self.worst > LEAST_SHOWN * self.constraint.level().at(limit) {
            let (unit, factor) = match self.constraint.unit() {
                Unit::OfLine => ("of the line", 1.0),
                unit if self.worst >= 1.0 => (unit.symbol(), 1.0),
                unit => unit.shown(),
            };
            parts.push(format!("off by {} {unit}", significant(self.worst * factor, 2)));
        }
        if let (Some(field), Some(given)) = (&self.field, self.given) {
            let given = significant(given, 4);
            let tried = self.would_do.map(|works| significant(works, 4));
            let everywhere = self.part == Kind::Limit && field != DURATION;
            let everywhere = if everywhere {
                " if it replaces this value everywhere in the robot file"
            } else {
                ""
            };
            // A feasible value is a bound, because the search for a nearer value is limited.
            let tried = tried.map_or_else(String::new, |tried| {
                format!(
                    "; {tried} was tried and is feasible{everywhere}, and a value nearer to {given} \
                     may be too"
                )
            });
            parts.push(format!("{field} is {given}{tried}"));
        }
        let met = if parts.is_empty() { "nearly met" } else { "" };
        write!(f, ": {met}{}", parts.join("; "))?;
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
                    "no solution nearby, because these constraints stay far beyond their \
                     tolerances even without costs:",
                Verdict::Stuck =>
                    "at the point where the solver got stuck, these constraints conflict with each \
                     other or with the costs:",
            }
        )?;
        let shown: Vec<String> = self.culprits.iter().map(ToString::to_string).collect();
        for (culprit, text) in self.culprits.iter().zip(&shown) {
            // Of two culprits whose text is equal except for the field, only the one with a field is shown.
            let longer = |other: &String| other.len() > text.len() && other.starts_with(text);
            if culprit.field.is_some() || !shown.iter().any(longer) {
                writeln!(f, "  {text}")?;
            }
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
            write!(f, "possible remedies: {}", advice.join("; or "))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shown(
        constraint: Family,
        worst: f64,
        field: &str,
        given: f64,
        works: Option<f64>,
    ) -> String {
        let culprit = Culprit {
            constraint,
            part: constraint.kind(),
            subject: None,
            time_s: [0.0, 4.0],
            worst,
            unit: constraint.unit().symbol().to_owned(),
            share: 1.0,
            field: Some(field.to_owned()).filter(|field| !field.is_empty()),
            given: Some(given).filter(|_| !field.is_empty()),
            would_do: works,
            advice: String::new(),
        };
        culprit.to_string()
    }

    #[test]
    fn of_two_culprits_that_read_the_same_the_one_with_a_field_is_shown() {
        let culprit = |part, field: Option<&str>, worst| Culprit {
            constraint: Family::ContactPoint,
            part,
            subject: Some("front_left".to_owned()),
            time_s: [0.04, 0.35],
            worst,
            unit: "m".to_owned(),
            share: 0.5,
            field: field.map(str::to_owned),
            given: field.map(|_| 0.5),
            would_do: field.map(|_| 0.7),
            advice: "help".to_owned(),
        };
        let shown = |culprits: Vec<Culprit>| {
            let diagnosis = Diagnosis { verdict: Verdict::Stuck, culprits };
            diagnosis.to_string().matches("contact point of front_left").count()
        };
        let kind = Family::ContactPoint.kind();
        let named = || culprit(kind, Some("duration_s"), 1.6e-4);
        assert_eq!(shown(vec![named(), culprit(kind, None, 1.6e-4)]), 1);
        assert_eq!(shown(vec![culprit(kind, None, 1.6e-4), named()]), 1);
        assert_eq!(shown(vec![named(), culprit(kind, None, 9e-4)]), 2);
        assert_eq!(shown(vec![culprit(kind, None, 1.6e-4)]), 1);
        let other = Culprit { time_s: [0.5, 0.6], ..culprit(kind, None, 1.6e-4) };
        assert_eq!(shown(vec![named(), other]), 2);
    }

    #[test]
    fn culprits_have_the_digits_and_units_that_matter() {
        use Family::{ContactPoint, DisplacementGoal, JointSpeed, JointTorque, TorqueSpeedLine};
        assert_eq!(
            shown(DisplacementGoal, 0.1234, "forward_m", 1.5, Some(1.1)),
            "displacement goal, 0.00 to 4.00 s: off by 120 mm; forward_m is 1.5; 1.1 was tried and is feasible, and a \
             value nearer to 1.5 may be too"
        );
        // A residual that rounds to 0.000 is not printed.
        assert_eq!(
            shown(JointSpeed, 1e-4, "speed_max_rad_s", 10.5, None),
            "joint speed, 0.00 to 4.00 s: speed_max_rad_s is 10.5"
        );
        assert_eq!(
            shown(JointTorque, 0.321, "torque_max_nm", 0.35, Some(0.7)),
            "joint torque, 0.00 to 4.00 s: off by 0.32 N·m; torque_max_nm is 0.35; 0.7 was tried and is feasible if it \
             replaces this value everywhere in the robot file, and a value nearer to 0.35 may be too"
        );
        assert_eq!(
            shown(ContactPoint, 3.14e-4, "", 0.0, None),
            "contact point, 0.00 to 4.00 s: off by 0.31 mm"
        );
        assert_eq!(
            shown(ContactPoint, 3.96, "", 0.0, None),
            "contact point, 0.00 to 4.00 s: off by 4 m"
        );
        assert_eq!(
            shown(TorqueSpeedLine, 0.254, "", 0.0, None),
            "torque-speed line, 0.00 to 4.00 s: off by 0.25 of the line"
        );
        assert_eq!(
            shown(ContactPoint, 1e-9, "", 0.0, None),
            "contact point, 0.00 to 4.00 s: nearly met"
        );
    }
}
