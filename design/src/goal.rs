//! What a design is optimised for: the `[goal]` of a design file.

use rollwalk_planner::sensitivity::Objective;
use rollwalk_robot::document::Table;

/// Pull towards the original design, if a file names none: a part of the objective per square of a unit of a parameter. A
/// change of 5 cm counts as much as a thousandth of the objective.
const PULL: f64 = 4e-5;

/// What is to be small, and what must stay.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Objectives with their weights; each is compared with its value at the original design.
    pub minimise: Vec<(Objective, f64)>,
    /// Quantities that must not exceed a number, in their units, in any motion.
    pub keep: Vec<(Objective, f64)>,
    /// Price of a change, as a part of the objective per square of a parameter's unit.
    pub pull: f64,
}

/// An objective as people know it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// What it is.
    pub objective: Objective,
    /// Its name in `minimise`.
    pub name: &'static str,
    /// Its name in `keep`, with its unit.
    pub bound: &'static str,
    /// Symbol of its unit; empty for none.
    pub unit: &'static str,
    /// Value below which changes are not compared with it: a steady motion has next to nothing of it.
    pub little: f64,
}

impl Quantity {
    const fn new(
        objective: Objective,
        [name, bound, unit]: [&'static str; 3],
        little: f64,
    ) -> Self {
        Self { objective, name, bound, unit, little }
    }

    /// All of them.
    pub const ALL: [Self; 6] = [
        Self::new(Objective::PlanCost, ["plan_cost", "plan_cost", ""], 1e-3),
        Self::new(
            Objective::PeakJointSpeed,
            ["peak_joint_speed", "peak_joint_speed_rad_s", "rad/s"],
            0.1,
        ),
        Self::new(Objective::JointTorque, ["joint_torque", "joint_torque_nm", "N·m"], 0.01),
        Self::new(
            Objective::PeakJointTorque,
            ["peak_joint_torque", "peak_joint_torque_nm", "N·m"],
            0.01,
        ),
        Self::new(Objective::Power, ["power", "power_w", "W"], 0.1),
        Self::new(Objective::CostOfTransport, ["cost_of_transport", "cost_of_transport", ""], 0.01),
    ];

    /// That of an objective.
    pub fn of(objective: Objective) -> Self {
        let found = Self::ALL.into_iter().find(|of| of.objective == objective);
        found.unwrap_or(Self::ALL[0])
    }
}

impl Goal {
    /// Reads a `[goal]` table.
    pub(crate) fn read(table: &Table<'_>) -> Option<Self> {
        let minimise = list(table, "minimise", |of| of.name);
        let keep =
            if table.has("keep") { list(table, "keep", |of| of.bound) } else { Some(Vec::new()) };
        let pull =
            if table.has("pull") { table.number_in("pull", 0.0..=1.0, "") } else { Some(PULL) };
        table.done();
        Some(Self { minimise: minimise?, keep: keep?, pull: pull? })
    }
}

/// Objectives of an inline table, with their positive numbers.
fn list(
    table: &Table<'_>,
    key: &'static str,
    called: impl Fn(&Quantity) -> &'static str,
) -> Option<Vec<(Objective, f64)>> {
    let inner = table.table(key)?;
    let mut found = Vec::new();
    for of in &Quantity::ALL {
        if inner.has(called(of)) {
            found.push((of.objective, inner.number_in(called(of), 1e-9..=1e9, of.unit)?));
        }
    }
    inner.done();
    if found.is_empty() {
        let names: Vec<&str> = Quantity::ALL.iter().map(called).collect();
        table.fault(
            key,
            "is empty",
            "nothing",
            format!("give one or more of {}", names.join(", ")),
        );
        return None;
    }
    Some(found)
}
