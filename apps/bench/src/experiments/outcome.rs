//! Results of an experiment: measured values with their expected values, and charts.

use serde::Serialize;

/// Results of an experiment.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ExperimentOutcome {
    /// Description of the setup: bodies, steps, parameters.
    pub setup: String,
    /// Measured values with their expected values.
    pub checks: Vec<Check>,
    #[serde(skip)]
    pub charts: Vec<Chart>,
}

/// Measured value and its expected value.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Check {
    /// Name of the value, with its unit.
    pub what: String,
    /// Value of the thesis or of the closed form. Its JSON key is `expected`, as in all tables of benchmarks.
    #[serde(rename = "expected")]
    pub reference: String,
    /// Requirement as text.
    pub asked: String,
    pub found: String,
    /// True if the value meets its requirement; `None` for values without a requirement.
    pub holds: Option<bool>,
    /// Known reason why the value misses its requirement; empty if there is none.
    pub why: String,
    /// Largest value that is accepted although it misses the requirement; `None` if the requirement should be met.
    pub known: Option<f64>,
    /// True if the value misses its requirement and exceeds `known`.
    pub fails: bool,
}

impl Check {
    /// Creates a check that a value is at most `bound`.
    pub fn at_most(what: &str, reference: &str, found: f64, bound: f64) -> Self {
        let asked = format!("≤ {}", short(bound));
        Self::new(what, reference, &asked, &short(found), Some(found <= bound))
    }

    /// Creates a check that a value is at most `bound`. If it is not, values up to `known` are accepted for the reason `why`.
    pub fn at_most_known(
        what: &str,
        reference: &str,
        found: f64,
        bound: f64,
        (known, why): (f64, &str),
    ) -> Self {
        let check = Self::at_most(what, reference, found, bound);
        if !check.fails {
            return check;
        }
        let is_within = found <= known;
        Self { why: why.to_owned(), known: Some(known), fails: !is_within, ..check }
    }

    /// Creates a check that a value is at least `bound`.
    pub fn at_least(what: &str, reference: &str, found: f64, bound: f64) -> Self {
        let asked = format!("≥ {}", short(bound));
        Self::new(what, reference, &asked, &short(found), Some(found >= bound))
    }

    /// Creates a check that a value is near the expected one; `share` is the relative tolerance.
    pub fn near(what: &str, found: f64, expected: f64, share: f64) -> Self {
        let holds = (found - expected).abs() <= share * expected.abs();
        let asked = format!("within {} %", short(100.0 * share));
        Self::new(what, &short(expected), &asked, &short(found), Some(holds))
    }

    /// Creates a row for a value without a requirement.
    pub fn informative(what: &str, reference: &str, found: f64) -> Self {
        Self::new(what, reference, "", &short(found), None)
    }

    pub fn new(what: &str, reference: &str, asked: &str, found: &str, holds: Option<bool>) -> Self {
        let [what, reference, asked, found] = [what, reference, asked, found].map(str::to_owned);
        let (why, known, fails) = (String::new(), None, holds == Some(false));
        Self { what, reference, asked, found, holds, why, known, fails }
    }
}

/// Formats a value with four significant digits.
pub fn short(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        size if (1e-3..1e5).contains(&size) => {
            let digits = (3 - size.log10().floor() as i32).max(0) as usize;
            let text = format!("{value:.digits$}");
            if text.contains('.') {
                text.trim_end_matches('0').trim_end_matches('.').to_owned()
            } else {
                text
            }
        }
        _ => format!("{value:.3e}"),
    }
}

/// Chart of curves with two axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Suffix of the file name, which begins with the name of the experiment.
    pub name: String,
    pub title: String,
    /// Label of the horizontal axis, with unit.
    pub x: String,
    /// Label of the vertical axis, with unit.
    pub y: String,
    /// True if both axes are logarithmic. Values of 0 or less are then skipped.
    pub logarithmic: bool,
    pub curves: Vec<(String, Vec<(f64, f64)>)>,
}

#[cfg(test)]
mod tests {
    use super::{Check, short};

    #[test]
    fn numbers_have_four_digits() {
        let values = [0.0, 1.0, -0.034_069_77, 1234.56, 99_999.9, 3.2e-12, 2e6];
        let texts = ["0", "1", "-0.03407", "1235", "100000", "3.200e-12", "2.000e6"];
        assert_eq!(values.map(short), texts);
    }

    #[test]
    fn what_is_not_a_number_does_not_hold() {
        assert_eq!(Check::at_most("", "", f64::NAN, 1.0).holds, Some(false));
        assert_eq!(Check::near("", f64::NAN, 1.0, 1.0).holds, Some(false));
        assert_eq!(Check::near("", 1.019, 1.0, 0.02).holds, Some(true));
        assert!(Check::at_most_known("", "", f64::NAN, 1.0, (2.0, "chance")).fails);
    }

    #[test]
    fn a_known_miss_fails_when_it_is_missed_by_more() {
        let found = |value| Check::at_most_known("", "", value, 1.0, (2.0, "chance"));
        let fails = [0.9, 1.9, 2.1].map(|value| found(value).fails);
        assert_eq!(fails, [false, false, true]);
        assert_eq!([0.9, 1.9].map(|value| found(value).holds), [Some(true), Some(false)]);
        assert!(Check::at_most("", "", 1.1, 1.0).fails);
    }
}
