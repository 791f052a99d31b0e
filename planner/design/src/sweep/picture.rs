//! Contents of a figure of a sweep: one quantity over the axes, and the points whose motions fail the checks.
//!
//! The axes determine the kind of figure. Without a parameter axis, choices stand side by side. With one parameter axis, there
//! is a line for each combination of choices and motions. With two or more, there is a map of the last two for each
//! combination. A field of a map shows the best point along the other parameters.

use super::{Axis, LoadedSweep, Row};
use crate::goal::Quantity;
use rollwalk_planner::sensitivity::Objective;
use std::path::Path;

/// Contents of a figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Title.
    pub title: String,
    /// Quantity, with its unit.
    pub quantity: String,
    /// Axes and values.
    pub kind: Kind,
}

/// Value at one position of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Field {
    /// Best value of the points at this position that pass the checks.
    Holds(f64),
    /// Marks a position with points, none of which passes the checks.
    Lost,
    /// Marks a position without points, such as motions of other robots.
    Absent,
}

impl Field {
    /// Returns the value of a point that passes the checks.
    pub fn value(&self) -> Option<f64> {
        if let Self::Holds(value) = self { Some(*value) } else { None }
    }
}

/// Fields along an axis.
pub type Values = Vec<Field>;

/// Kind of a figure.
#[derive(Clone, Debug, PartialEq)]
pub enum Kind {
    /// Choices side by side.
    Choices {
        /// Name of the axis.
        axis: String,
        /// Labels of the points.
        labels: Vec<String>,
        /// Name and values of each combination of the other choices.
        series: Vec<(String, Values)>,
    },
    /// Lines over a parameter.
    Lines {
        /// Name of the parameter, with its unit.
        x: String,
        /// Values of the parameter.
        at: Vec<f64>,
        /// Name and values of each combination of choices.
        series: Vec<(String, Values)>,
    },
    /// Maps over two parameters.
    Maps {
        /// Names of the parameters, with their units. The second parameter is horizontal, because chains run along it.
        axes: [String; 2],
        /// Values of the parameters.
        at: [Vec<f64>; 2],
        /// Name and values of each combination of choices. A row has the values along the second parameter.
        panels: Vec<(String, Vec<Values>)>,
    },
}

impl Picture {
    /// Builds the figure of the rows of a sweep. The default quantity is the first one that the design's goal minimises.
    pub fn of(ready: &LoadedSweep, rows: &[&Row], quantity: Option<Quantity>) -> Self {
        let of = quantity.unwrap_or_else(|| preferred(ready, rows));
        let column = Quantity::ALL.iter().position(|other| *other == of).unwrap_or(0);
        let axes = &ready.sweep.axes;
        // A single value is not an axis.
        let varies = |k: &usize| axes[*k].values().is_some_and(|values| values.len() > 1);
        let parameters: Vec<usize> = (0..axes.len()).filter(varies).collect();
        // Axes of the figure: the last two parameters, the last parameter, or the longest list of choices.
        let shown: Vec<usize> = match parameters[..] {
            [.., y, x] => vec![y, x],
            [x] => vec![x],
            [] => (0..axes.len()).rev().max_by_key(|k| axes[*k].len()).into_iter().collect(),
        };
        let choices: Vec<usize> =
            (0..axes.len()).filter(|k| !shown.contains(k) && !parameters.contains(k)).collect();
        let groups = groups(axes, rows, &choices);
        let value_at = |group: &Group, at: &[usize]| {
            let fits = |row: &&&Row| {
                let there =
                    shown.iter().zip(at).all(|(k, at)| row.labels[*k] == axes[*k].label(*at));
                there && group.has(row, &choices)
            };
            let there: Vec<_> = rows.iter().filter(fits).collect();
            let held = there.iter().filter(|row| row.holds);
            match held.filter_map(|row| row.quantities[column]).reduce(f64::min) {
                Some(best) => Field::Holds(best),
                None if there.is_empty() => Field::Absent,
                None => Field::Lost,
            }
        };
        let line = |group: &Group, before: &[usize], axis: usize| -> Values {
            (0..axes[axis].len()).map(|at| value_at(group, &[before, &[at]].concat())).collect()
        };
        let lines = |axis: usize| {
            groups.iter().map(|group| (group.name.clone(), line(group, &[], axis))).collect()
        };
        let kind = match shown[..] {
            [y, x] => Kind::Maps {
                axes: [y, x].map(|k| ready.axis_title(k)),
                at: [y, x].map(|k| values_of(&axes[k])),
                panels: groups
                    .iter()
                    .map(|group| {
                        let rows = (0..axes[y].len()).map(|at| line(group, &[at], x));
                        (group.name.clone(), rows.collect())
                    })
                    .collect(),
            },
            [x] if !parameters.is_empty() => {
                Kind::Lines { x: ready.axis_title(x), at: values_of(&axes[x]), series: lines(x) }
            }
            [x, ..] => Kind::Choices {
                axis: ready.axis_title(x),
                labels: (0..axes[x].len()).map(|at| short(&axes[x].label(at))).collect(),
                series: lines(x),
            },
            [] => Kind::Choices { axis: String::new(), labels: Vec::new(), series: Vec::new() },
        };
        let hidden: Vec<&str> =
            parameters.iter().filter(|k| !shown.contains(k)).map(|k| axes[*k].name()).collect();
        let best = if hidden.is_empty() {
            String::new()
        } else {
            format!(", best value along {}", hidden.join(", "))
        };
        let unit = if of.unit.is_empty() { String::new() } else { format!(", {}", of.unit) };
        Self {
            title: format!("{}: {}{best}", ready.sweep.name, of.name),
            quantity: format!("{}{unit}", of.name),
            kind,
        }
    }
}

/// Default quantity: the first one that the goal minimises, else the cost of transport if a row has one, else the plan cost.
fn preferred(ready: &LoadedSweep, rows: &[&Row]) -> Quantity {
    if let Some((objective, _)) = ready.goal().and_then(|goal| goal.minimise.first()) {
        return Quantity::of(*objective);
    }
    let of = Quantity::of(Objective::CostOfTransport);
    let column = Quantity::ALL.iter().position(|other| *other == of);
    let is_there = |row: &&Row| column.is_some_and(|k| row.quantities[k].is_some());
    if rows.iter().any(is_there) { of } else { Quantity::of(Objective::PlanCost) }
}

/// Combination of choices and a motion.
struct Group {
    labels: Vec<String>,
    motion: String,
    name: String,
}

impl Group {
    fn has(&self, row: &Row, choices: &[usize]) -> bool {
        // Rows without a robot have no motion, and belong to all figures.
        (row.motion == self.motion || row.motion.is_empty())
            && choices.iter().zip(&self.labels).all(|(k, label)| row.labels[*k] == *label)
    }
}

/// Combinations in the rows, in the order of the rows.
fn groups(axes: &[Axis], rows: &[&Row], choices: &[usize]) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for with_motion in [true, false] {
        for row in rows.iter().filter(|row| row.motion.is_empty() != with_motion) {
            let labels: Vec<String> = choices.iter().map(|k| row.labels[*k].clone()).collect();
            let known = |of: &Group| {
                of.labels == labels && (of.motion == row.motion || row.motion.is_empty())
            };
            if !groups.iter().any(known) {
                groups.push(Group { labels, motion: row.motion.clone(), name: String::new() });
            }
        }
    }
    // The name of the motion tells which motion file was chosen.
    let is_named: Vec<bool> =
        choices.iter().map(|k| !matches!(axes[*k], Axis::Motions { .. })).collect();
    let differs: Vec<bool> = (0..choices.len())
        .map(|k| is_named[k] && groups.iter().any(|of| of.labels[k] != groups[0].labels[k]))
        .collect();
    let motions_differ = groups.iter().any(|of| of.motion != groups[0].motion);
    for group in &mut groups {
        let choices = group.labels.iter().zip(&differs).filter(|(_, differs)| **differs);
        let mut words: Vec<String> = choices.map(|(label, _)| short(label)).collect();
        if motions_differ || words.is_empty() {
            words.insert(0, group.motion.clone());
        }
        group.name = words.join(", ");
    }
    groups
}

fn values_of(axis: &Axis) -> Vec<f64> {
    axis.values().map(<[f64]>::to_vec).unwrap_or_default()
}

/// Stem of a TOML file name; other labels stay unchanged.
fn short(label: &str) -> String {
    let stem = label.strip_suffix(".toml").and_then(|path| Path::new(path).file_name());
    stem.map_or_else(|| label.to_owned(), |stem| stem.to_string_lossy().into_owned())
}
