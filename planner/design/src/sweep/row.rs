//! Rows of a sweep: one motion at one point.

use super::{Axis, LoadedSweep};
use crate::designed::Designed;
use crate::goal::Quantity;
use crate::plans::{Plans, PlansError, Watch};
use rollwalk_planner::Weights;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::report::Report;
use rollwalk_robot::document::DocumentError;
use serde::{Deserialize, Serialize};

/// Result of a motion at a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// Index of the point.
    pub point: u64,
    /// Label of the point on every axis.
    pub labels: Vec<String>,
    /// Name of the motion; empty if the robot is invalid at this point.
    pub motion: String,
    /// Status of the plan.
    pub status: String,
    /// True if the motion is solved and passes the checks.
    pub holds: bool,
    /// Diagnosis of the plan, or reason why there is no plan; empty if there is neither.
    pub reason: String,
    /// Number of planner iterations.
    pub iterations: u64,
    /// Values of all quantities, in the order of [`Quantity::ALL`]; `None` if undefined for the motion.
    pub quantities: Vec<Option<f64>>,
    /// File that the caller wrote for the plan; empty if there is none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub file: String,
}

/// Callback for every plan, with its row and the number of earlier plans at the same point for motions of the same name. The
/// callback returns the name of the file that it writes, or an empty text.
pub type Keep<'a> = dyn FnMut(&Row, usize, &Plan) -> String + 'a;

/// Computes the rows of a chain.
pub fn chain(
    ready: &LoadedSweep,
    chain: usize,
    watch: &mut Watch<'_>,
    keep: &mut Keep<'_>,
) -> Result<Vec<Row>, PlansError> {
    let sweep = &ready.sweep;
    let start = sweep.start(chain);
    let designed = ready.designed(&start);
    let mut rows = Vec::new();
    let mut before: Option<Plans> = None;
    for along in 0..sweep.chain_len() {
        let mut at = start.clone();
        if let Some(inner) = sweep.inner() {
            at[inner] = along;
        }
        let point = (chain * sweep.chain_len() + along) as u64;
        let labels: Vec<String> =
            sweep.axes.iter().zip(&at).map(|(axis, &at)| axis.label(at)).collect();
        let planned = match &designed {
            Ok(designed) => planned(designed, &sweep.axes, &at, before.as_ref(), watch),
            Err(error) => Err(PlansError::Robot(error.clone())),
        };
        match planned {
            Ok(plans) => {
                for (number, plan) in plans.plans().enumerate() {
                    let row = row(point, labels.clone(), plan);
                    let same = plans.plans().take(number);
                    let same = same.filter(|of| of.motion.name == plan.motion.name).count();
                    rows.push(Row { file: keep(&row, same, plan), ..row });
                }
                before = plans.all_solved().is_ok().then_some(plans);
            }
            Err(PlansError::Interrupted) => return Err(PlansError::Interrupted),
            Err(reason) => {
                rows.push(without_plan(point, labels, &reason));
                before = None;
            }
        }
    }
    Ok(rows)
}

/// Plans a point, starting from the plans of its neighbour if there are any.
fn planned(
    designed: &Designed,
    axes: &[Axis],
    at: &[usize],
    before: Option<&Plans>,
    watch: &mut Watch<'_>,
) -> Result<Plans, PlansError> {
    let mut values = designed.original().to_vec();
    for (axis, &at) in axes.iter().zip(at) {
        if let Axis::Parameter { name, values: along } = axis
            && let Some(index) = designed.file.parameters.iter().position(|of| of.name == *name)
        {
            values[index] = along[at];
        }
    }
    let motion_values = axes.iter().zip(at).filter_map(|(axis, &at)| match axis {
        Axis::MotionValue { path, values } => Some((path.as_str(), values[at])),
        _ => None,
    });
    let designed = &designed.clone().with_motion_values(motion_values);
    match before {
        Some(before) => designed.plan_from(before, &values, true, watch),
        None => designed.plan(&values, watch),
    }
}

fn row(point: u64, labels: Vec<String>, plan: &Plan) -> Row {
    let solve = &plan.solve;
    let is_solved = solve.status.is_solved();
    let quantity = |of: Quantity| {
        let value = is_solved.then(|| of.objective.of_plan(plan, &Weights::default()));
        value.filter(|value| value.is_finite())
    };
    let reason = solve.diagnosis.as_ref().map(ToString::to_string).unwrap_or_default();
    Row {
        point,
        labels,
        motion: plan.motion.name.clone(),
        status: solve.status.to_string(),
        holds: is_solved && Report::new(plan).judgement.is_good(),
        reason: one_line(&reason),
        iterations: solve.iterations as u64,
        quantities: Quantity::ALL.map(quantity).to_vec(),
        file: String::new(),
    }
}

fn without_plan(point: u64, labels: Vec<String>, reason: &PlansError) -> Row {
    let text = match reason {
        PlansError::Robot(error) => faults(error),
        other => other.to_string(),
    };
    Row {
        point,
        labels,
        motion: String::new(),
        status: "no such robot".to_owned(),
        holds: false,
        reason: one_line(&text),
        iterations: 0,
        quantities: vec![None; Quantity::ALL.len()],
        file: String::new(),
    }
}

fn faults(error: &DocumentError) -> String {
    error.faults().map(ToString::to_string).collect::<Vec<_>>().join("; ")
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
