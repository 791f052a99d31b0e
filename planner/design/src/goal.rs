//! `[goal]` table of a design file.

use rollwalk_planner::sensitivity::Objective;
use rollwalk_robot::document::{NamedNumber, Table};

/// Default pull towards the original design, per squared unit of a parameter. A change of 5 cm then costs a thousandth of the
/// objective.
const PULL: f64 = 4e-5;

/// Quantities to minimise, and bounds to keep.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Objectives with their weights. Each value is divided by its value at the original design.
    pub minimise: Vec<(Objective, f64)>,
    /// Indices of parameters with their weights. Each parameter is divided by its original value. A negative weight maximises.
    pub parameters: Vec<(usize, f64)>,
    /// Quantities with their upper bounds, which apply to every motion.
    pub keep: Vec<(Objective, f64)>,
    /// Price of a change, as a fraction of the objective per squared unit of a parameter.
    pub pull: f64,
}

/// Objective with its names and unit in design files.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quantity {
    /// Objective of the planner.
    pub objective: Objective,
    /// Name in `minimise`.
    pub name: &'static str,
    /// Name in `keep`, with its unit.
    pub bound: &'static str,
    /// Symbol of the unit; empty for dimensionless quantities.
    pub unit: &'static str,
    /// Smallest divisor of the quantity. It prevents division by a value near 0, such as the power of a motion at constant speed.
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

    /// List of the quantities, one for each objective.
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

    /// Returns the quantity of an objective.
    pub fn of(objective: Objective) -> Self {
        let found = Self::ALL.into_iter().find(|of| of.objective == objective);
        found.unwrap_or(Self::ALL[0])
    }
}

impl Goal {
    /// Parses the `[goal]` table. `parameters` are the names of the design's parameters.
    pub(crate) fn read(table: &Table<'_>, parameters: &[String]) -> Option<Self> {
        let read = |key, names: &[&'static str], parameters: &[String]| match table.has(key) {
            true => list(table, key, names, parameters),
            false => Some(Lists::default()),
        };
        let small = read("minimise", &Quantity::ALL.map(|of| of.name), parameters);
        let large = read("maximise", &[], parameters);
        let keep = read("keep", &Quantity::ALL.map(|of| of.bound), &[]);
        let pull =
            if table.has("pull") { table.number_in("pull", 0.0..=1.0, "") } else { Some(PULL) };
        table.done();
        let (Lists { quantities: minimise, parameters: small }, large) = (small?, large?);
        let large = large.parameters.into_iter().map(|(index, weight)| (index, -weight));
        let parameters: Vec<_> = small.into_iter().chain(large).collect();
        if !table.has("minimise") && !table.has("maximise") {
            table.fault(
                "minimise",
                "is missing",
                "no goal",
                "give minimise = { peak_joint_speed = 1.0 }, or maximise with a parameter",
            );
            return None;
        }
        Some(Self { minimise, parameters, keep: keep?.quantities, pull: pull? })
    }
}

/// Quantities and parameter indices, with the values of the file.
#[derive(Default)]
struct Lists {
    quantities: Vec<(Objective, f64)>,
    parameters: Vec<(usize, f64)>,
}

/// Parses an inline table of positive values, keyed by quantity or parameter.
fn list(
    table: &Table<'_>,
    key: &'static str,
    names: &[&'static str],
    parameters: &[String],
) -> Option<Lists> {
    let inner = table.table(key)?;
    let mut lists = Lists::default();
    let given = inner.named_numbers();
    if given.is_empty() {
        table.fault(key, "is empty", "nothing", "name a quantity or a parameter");
    }
    for NamedNumber { name, number, .. } in given {
        let quantity = names.iter().position(|known| *known == name);
        let parameter = parameters.iter().position(|known| known == name);
        if !(number > 0.0 && number <= 1e9) {
            inner.fault(name, format_args!("is {number}"), "not above 0", "give a number above 0");
        } else if let Some(index) = quantity {
            lists.quantities.push((Quantity::ALL[index].objective, number));
        } else if let Some(index) = parameter {
            lists.parameters.push((index, number));
        } else {
            let all = names.iter().copied().chain(parameters.iter().map(String::as_str));
            let help = format!("give one or more of {}", all.collect::<Vec<_>>().join(", "));
            inner.fault(name, "is neither a quantity nor a parameter", "unknown", help);
        }
    }
    Some(lists)
}
