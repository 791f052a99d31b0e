//! Solutions: plans with their multipliers, and their JSON text, for programs that plan again later.

use crate::json::Format;
use crate::plan::{Plan, PlanError};
use crate::solve::Multipliers;
use serde::{Deserialize, Serialize};

/// Plan with its multipliers, the best starting point of a [`replan`](crate::replan).
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The plan.
    pub plan: Plan,
    /// Multipliers of the plan's constraints.
    pub multipliers: Multipliers,
}

/// Format of solution files.
const JSON: Format = Format {
    name: "rollwalk-solution",
    version: 1,
    what: "solution",
    make_again: "plan the motion again",
    help: "plan the motion again, because only the version of rollwalk that wrote a solution can \
        read it",
};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SolutionFile<P> {
    format: String,
    version: u32,
    plan: P,
    multipliers: Multipliers,
}

impl Solution {
    /// Returns the solution as JSON.
    pub fn to_json(&self) -> String {
        let (format, version) = (JSON.name.to_owned(), JSON.version);
        let kept = SolutionFile {
            format,
            version,
            plan: &self.plan,
            multipliers: self.multipliers.clone(),
        };
        // Only maps with non-string keys can fail to become JSON; a solution has no map.
        serde_json::to_string(&kept).unwrap_or_default()
    }

    /// Reads a solution and checks that it is complete and consistent. Errors name the text by `file`.
    ///
    /// # Errors
    /// Returns an error if the text is not a valid solution. [`PlanError`] names file, field, value and the valid range.
    pub fn from_json(file: &str, text: &str) -> Result<Self, PlanError> {
        let SolutionFile { plan, multipliers, .. }: SolutionFile<Plan> = JSON.read(file, text)?;
        plan.validate(file)?;
        if !multipliers.are_sound() {
            let expected = "a finite shift for every row";
            return Err(JSON
                .fault(file, "multipliers", "incomplete or not finite", expected)
                .into());
        }
        Ok(Self { plan, multipliers })
    }
}
