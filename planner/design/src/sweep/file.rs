//! Sweep files.
//!
//! ```toml
//! name = "thighs_and_servos"
//! design = "agilebot_legs.toml"     # robot, motions and parameters, relative to this file
//!
//! [[axis]]
//! parameter = "front_thigh"
//! from = 0.10
//! to = 0.15
//! points = 11                       # or values = [0.10, 0.12]
//!
//! [[axis]]
//! name = "servo"
//! actuator = "xm540"                # of the robot file
//! servos = ["MX-64AT", "XM540-W150-T"]
//!
//! [[axis]]
//! name = "gait"
//! motions = ["../motions/trot.toml", "../motions/walk.toml"]   # in place of the design's
//!
//! [[axis]]
//! motion_value = "goal.forward_m"   # number of all motion files
//! values = [0.1, 0.2]
//!
//! [dataset]                         # motion data of all motions that pass the checks
//! rate_hz = 50
//! length_s = 10                     # of periodic motions
//! ```
//!
//! Instead of `design`, an axis may list robots with their own motions:
//! `robots = [{ name = "two", robot = "…", motions = ["…"] }]`.

use super::Files;
use crate::catalog::Catalog;
use crate::designed::{Designed, NamedText};
use crate::parameter::{Kind, Location};
use crate::text::NoEffect;
use rollwalk_planner::export::{Length, Rate};
use rollwalk_robot::document::{Document, DocumentError, Table};

/// Maximum number of axes.
const AXES_MAX: usize = 12;
/// Maximum number of points in a sweep.
const POINTS_MAX: usize = 10_000_000;
/// Maximum number of values on an axis.
const VALUES_MAX: usize = 10_000;

/// Contents of a sweep file.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Name of the sweep.
    pub name: String,
    /// Path of the design file, relative to the sweep file.
    pub design: Option<String>,
    /// Axes; never empty.
    pub axes: Vec<Axis>,
    /// Motion data to write for all motions that pass the checks.
    pub dataset: Option<Dataset>,
}

/// Rate and length of motion data.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dataset {
    /// Frames per second.
    pub rate: Rate,
    /// Length of periodic motions; `None` for the duration of the plan.
    pub length: Option<Length>,
}

/// Axis of a sweep.
#[derive(Clone, Debug, PartialEq)]
pub enum Axis {
    /// Parameter of the design.
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Values of the parameter.
        values: Vec<f64>,
    },
    /// Number of all motion files.
    MotionValue {
        /// Path of the number in the motion file, such as `goal.forward_m`.
        path: String,
        /// Values of the number.
        values: Vec<f64>,
    },
    /// Servos of the catalogue for an actuator of the robot file.
    Servos {
        /// Name of the axis.
        name: String,
        /// Name of the actuator.
        actuator: String,
        /// Names of the servos.
        names: Vec<String>,
    },
    /// Motion files, one at a time.
    Motions {
        /// Name of the axis.
        name: String,
        /// Paths of the files, relative to the sweep file.
        files: Vec<String>,
    },
    /// Robots with their motions.
    Robots {
        /// Name of the axis.
        name: String,
        /// The robots.
        choices: Vec<RobotChoice>,
    },
}

/// Robot of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotChoice {
    /// Name of the choice.
    pub name: String,
    /// Path of the robot file, relative to the sweep file.
    pub robot: String,
    /// Paths of the motion files, relative to the sweep file.
    pub motions: Vec<String>,
}

impl Axis {
    /// Name of the axis and of its column.
    pub fn name(&self) -> &str {
        match self {
            Self::MotionValue { path, .. } => path,
            Self::Parameter { name, .. }
            | Self::Servos { name, .. }
            | Self::Motions { name, .. }
            | Self::Robots { name, .. } => name,
        }
    }

    /// Number of points on the axis.
    pub fn len(&self) -> usize {
        match self {
            Self::Parameter { values, .. } | Self::MotionValue { values, .. } => values.len(),
            Self::Servos { names, .. } => names.len(),
            Self::Motions { files, .. } => files.len(),
            Self::Robots { choices, .. } => choices.len(),
        }
    }

    /// Returns true if the axis has no points. Sweep files allow no such axis.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Values of a numeric axis; `None` for an axis of choices.
    pub fn values(&self) -> Option<&[f64]> {
        match self {
            Self::Parameter { values, .. } | Self::MotionValue { values, .. } => Some(values),
            _ => None,
        }
    }

    /// Label of a point.
    pub fn label(&self, at: usize) -> String {
        match self {
            Self::Parameter { values, .. } | Self::MotionValue { values, .. } => {
                values[at].to_string()
            }
            Self::Servos { names, .. } => names[at].clone(),
            Self::Motions { files, .. } => files[at].clone(),
            Self::Robots { choices, .. } => choices[at].name.clone(),
        }
    }
}

impl Sweep {
    /// Parses a sweep file. `file_name` appears in messages only.
    ///
    /// # Errors
    /// Returns every fault of the sweep file itself.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let sweep = sweep(&document);
        document.finish(sweep)
    }

    /// Parses a sweep file, and checks it against its design, its motion files and a catalogue.
    pub(super) fn checked(
        file: &NamedText,
        design: Option<&Designed>,
        files: &Files,
        catalog: &Catalog,
    ) -> Result<Self, DocumentError> {
        let sweep = Self::from_toml(&file.name, &file.text)?;
        let document = Document::parse(&file.name, &file.text)?;
        for (axis, table) in sweep.axes.iter().zip(document.root().tables("axis")) {
            match axis {
                Axis::Parameter { name, values } => {
                    let known: Vec<_> = design.iter().flat_map(|of| &of.file.parameters).collect();
                    match known.iter().find(|of| of.name == *name) {
                        None => {
                            let names: Vec<&str> =
                                known.iter().map(|of| of.name.as_str()).collect();
                            let problem = format_args!(
                                "is `{name}`, which is not a parameter of \
                                the design"
                            );
                            table.fault(
                                "parameter",
                                problem,
                                "unknown",
                                format!("give one of {}", names.join(", ")),
                            );
                        }
                        Some(of) => {
                            if let Some(out) =
                                values.iter().find(|v| !(of.min..=of.max).contains(v))
                            {
                                let problem = format_args!(
                                    "`{name}` takes the value {out}, outside its \
                                        bounds"
                                );
                                let help = format!(
                                    "give values from {} to {}, the bounds in the \
                                    design file",
                                    of.min, of.max
                                );
                                table.fault("parameter", problem, "outside", help);
                            }
                        }
                    }
                }
                Axis::Servos { actuator, names, .. } => {
                    if let Some(name) = names.iter().find(|name| catalog.get(name).is_none()) {
                        let all: Vec<&str> =
                            catalog.servos().iter().map(|of| of.name.as_str()).collect();
                        let help = format!("give one of {}", all.join(", "));
                        table.fault(
                            "servos",
                            format_args!("contains `{name}`, which is not in the catalogue"),
                            "unknown",
                            help,
                        );
                    }
                    let place = speed_of(actuator);
                    if let Some(Err(nothing)) = design.map(|design| design.value_of(&place)) {
                        table.fault("actuator", nothing.problem, "unknown", nothing.help);
                    }
                }
                Axis::MotionValue { path, .. } => {
                    let lacks = |motion: &NamedText| {
                        let error = motion.check_motion_value(path).err()?;
                        Some((motion.name.clone(), error))
                    };
                    if let Some((name, NoEffect { problem, help })) =
                        sweep.motions(design, files).iter().find_map(lacks)
                    {
                        let problem = format_args!("does not fit {name}: {problem}");
                        table.fault("motion_value", problem, "no number", help);
                    }
                }
                Axis::Motions { .. } | Axis::Robots { .. } => {}
            }
        }
        document.finish(Some(sweep))
    }

    /// Motion files of the whole sweep.
    fn motions(&self, design: Option<&Designed>, files: &Files) -> Vec<NamedText> {
        let named = self.files().1;
        match design {
            Some(design) if named.is_empty() => design.motions(),
            _ => named
                .into_iter()
                .filter_map(|name| Some(files.motions.get(name)?.file.clone()))
                .collect(),
        }
    }

    /// Robot files and motion files of the axes.
    pub fn files(&self) -> (Vec<&String>, Vec<&String>) {
        let (mut robots, mut motions) = (Vec::new(), Vec::new());
        for axis in &self.axes {
            match axis {
                Axis::Motions { files, .. } => motions.extend(files),
                Axis::Robots { choices, .. } => {
                    robots.extend(choices.iter().map(|choice| &choice.robot));
                    motions.extend(choices.iter().flat_map(|choice| &choice.motions));
                }
                _ => {}
            }
        }
        (robots, motions)
    }

    /// Index of the last numeric axis, along which chains run. `None` if all axes are choices.
    pub fn inner(&self) -> Option<usize> {
        self.axes.iter().rposition(|axis| axis.values().is_some())
    }

    /// Number of points in a chain.
    pub fn chain_len(&self) -> usize {
        self.inner().map_or(1, |inner| self.axes[inner].len())
    }

    /// Number of chains.
    pub fn chains(&self) -> usize {
        self.axes.iter().map(Axis::len).product::<usize>() / self.chain_len()
    }

    /// Indices of a chain's first point, one for each axis. The index on the axis of the chain is 0.
    pub fn start(&self, chain: usize) -> Vec<usize> {
        let (mut rest, mut start) = (chain, vec![0; self.axes.len()]);
        for k in (0..self.axes.len()).rev().filter(|k| Some(*k) != self.inner()) {
            start[k] = rest % self.axes[k].len();
            rest /= self.axes[k].len();
        }
        start
    }
}

/// Parameter for the speed limit of an actuator.
pub fn speed_of(actuator: &str) -> Location {
    Location {
        kind: Kind::Speed,
        template: None,
        name: actuator.to_owned(),
        axis: None,
        limbs: Vec::new(),
    }
}

fn sweep(document: &Document<'_>) -> Option<Sweep> {
    let root = document.root();
    let name = root.name("name");
    let design = if root.has("design") { Some(root.string("design")?) } else { None };
    let tables = root.tables_up_to("axis", AXES_MAX);
    if tables.is_empty() {
        root.fault("axis", "is missing", "one point", "write at least one [[axis]] table");
    }
    let axes: Vec<Option<Axis>> = tables.iter().map(axis).collect();
    let dataset = match root.has("dataset") {
        true => Some(root.table("dataset").and_then(|table| dataset(&table))?),
        false => None,
    };
    root.done();
    let axes: Vec<Axis> = axes.into_iter().collect::<Option<_>>()?;
    let robots = axes.iter().filter(|axis| matches!(axis, Axis::Robots { .. })).count();
    if robots + usize::from(design.is_some()) != 1 {
        let help = "give `design`, or one [[axis]] with robots that have their own motions";
        root.fault(
            "design",
            "or an axis with robots is required, and not both",
            "design or robots",
            help,
        );
    }
    let points = axes.iter().try_fold(1_usize, |all, axis| all.checked_mul(axis.len()));
    if points.is_none_or(|points| points > POINTS_MAX) {
        root.fault(
            "axis",
            format_args!("tables give more than {POINTS_MAX} points"),
            "too many",
            "give fewer values on the axes",
        );
    }
    for (index, axis) in axes.iter().enumerate() {
        if axes[..index].iter().any(|other| other.name() == axis.name()) {
            let problem = format_args!("is `{}`, the name of an earlier axis", axis.name());
            tables[index].fault("name", problem, "again", "give each axis its own name");
        }
    }
    Some(Sweep { name: name?, design, axes, dataset })
}

fn dataset(table: &Table<'_>) -> Option<Dataset> {
    let rate_hz = table.number_in("rate_hz", 1.0..=Rate::MAX_HZ, "Hz");
    let length_s = match table.has("length_s") {
        true => Some(table.number_in("length_s", 0.1..=Length::MAX_S, "s")?),
        false => None,
    };
    table.done();
    let length = length_s.and_then(|length_s| Length::new(length_s).ok());
    Some(Dataset { rate: Rate::new(rate_hz?).ok()?, length })
}

fn axis(table: &Table<'_>) -> Option<Axis> {
    if let Some(key) = ["parameter", "motion_value"].into_iter().find(|key| table.has(key)) {
        let name = table.string(key);
        let values = if table.has("values") {
            table.list("values", 1..=VALUES_MAX)
        } else {
            evenly(
                table.number("from")?,
                table.number("to")?,
                table.integer("points", 2..=VALUES_MAX as u32)?,
            )
        };
        table.done();
        let (name, values) = (name?, values?);
        return Some(match key {
            "parameter" => Axis::Parameter { name, values },
            _ => Axis::MotionValue { path: name, values },
        });
    }
    let name = table.name("name")?;
    let strings = |key| -> Option<Vec<String>> {
        let strings: Vec<String> =
            table.strings(key)?.into_iter().map(|(text, _)| text.to_owned()).collect();
        if strings.is_empty() {
            table.fault(key, "is empty", "no point", "give at least one entry");
        }
        Some(strings)
    };
    let axis = if table.has("servos") {
        let actuator = table.string("actuator");
        Axis::Servos { name, actuator: actuator?, names: strings("servos")? }
    } else if table.has("motions") {
        Axis::Motions { name, files: strings("motions")? }
    } else {
        let choices = table.tables_up_to("robots", VALUES_MAX);
        if choices.is_empty() {
            let help = "give parameter, motion_value, servos, motions or robots";
            table.fault("robots", "is missing", "an axis without values", help);
        }
        let choices = choices.iter().map(choice).collect::<Option<_>>();
        Axis::Robots { name, choices: choices? }
    };
    table.done();
    Some(axis)
}

fn choice(table: &Table<'_>) -> Option<RobotChoice> {
    let (name, robot) = (table.name("name"), table.string("robot"));
    let motions = table.strings("motions")?.into_iter().map(|(text, _)| text.to_owned()).collect();
    table.done();
    Some(RobotChoice { name: name?, robot: robot?, motions })
}

/// Evenly spaced values from `from` to `to`, rounded to nine decimals.
fn evenly(from: f64, to: f64, points: u32) -> Option<Vec<f64>> {
    let value = |k: u32| from + (to - from) * f64::from(k) / f64::from(points - 1);
    let rounded = |value: f64| (value * 1e9).round() / 1e9;
    Some((0..points).map(|k| rounded(value(k))).collect())
}
