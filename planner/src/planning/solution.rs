//! Solutions: plans with their multipliers, and their JSON text, for programs that plan again later.

use crate::json::Format;
use crate::plan::{Plan, PlanError};
use crate::solve::Multipliers;
use serde::{Deserialize, Serialize};

/// A plan with its multipliers, from which [`replan`](crate::replan) starts best.
#[derive(Clone, Debug, PartialEq)]
pub struct Solution {
    /// The plan.
    pub plan: Plan,
    /// The multipliers of its constraints.
    pub multipliers: Multipliers,
}

/// The format of solutions.
const JSON: Format = Format {
    name: "rollwalk-solution",
    version: 1,
    what: "solution",
    make_again: "plan the motion once more",
    help: "solutions are read by the version that wrote them; plans are what is kept for longer",
};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept<P> {
    format: String,
    version: u32,
    plan: P,
    multipliers: Multipliers,
}

impl Solution {
    /// Returns the solution as JSON.
    pub fn to_json(&self) -> String {
        let (format, version) = (JSON.name.to_owned(), JSON.version);
        let kept =
            Kept { format, version, plan: &self.plan, multipliers: self.multipliers.clone() };
        // Only maps with non-string keys can fail to become JSON; a solution has no map.
        serde_json::to_string(&kept).unwrap_or_default()
    }

    /// Reads a solution and checks that it is whole and consistent. `file` is how errors name the text.
    ///
    /// # Errors
    /// [`PlanError`] names file, field, value and what would be right.
    pub fn from_json(file: &str, text: &str) -> Result<Self, PlanError> {
        let Kept { plan, multipliers, .. }: Kept<Plan> = JSON.read(file, text)?;
        plan.validate(file)?;
        if !multipliers.are_sound() {
            let expected = "a finite shift for every row";
            return Err(JSON.fault(file, "multipliers", "not sound", expected).into());
        }
        Ok(Self { plan, multipliers })
    }
}
