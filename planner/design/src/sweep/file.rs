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
//! ```
//!
//! In place of `design` an axis may have robots, each with its own motions:
//! `robots = [{ name = "two", robot = "…", motions = ["…"] }]`.

use crate::catalog::Catalog;
use crate::designed::{Designed, NamedText};
use crate::parameter::{Kind, Place};
use rollwalk_robot::document::{Document, DocumentError, Table};

/// Most axes, and most points of a sweep.
const AXES_MAX: usize = 12;
const POINTS_MAX: usize = 10_000_000;
/// Most values of an axis.
const VALUES_MAX: usize = 10_000;

/// A sweep.
#[derive(Clone, Debug, PartialEq)]
pub struct Sweep {
    /// Name of the sweep.
    pub name: String,
    /// The design file, relative to the sweep file.
    pub design: Option<String>,
    /// The axes; never empty.
    pub axes: Vec<Axis>,
}

/// An axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Axis {
    /// A parameter of the design.
    Parameter {
        /// Name of the parameter.
        name: String,
        /// Values of the parameter.
        values: Vec<f64>,
    },
    /// Servos of the catalogue for an actuator of the robot file.
    Servos {
        /// Name of the axis.
        name: String,
        /// The actuator.
        actuator: String,
        /// Names of the servos.
        names: Vec<String>,
    },
    /// Motion files, one at a time.
    Motions {
        /// Name of the axis.
        name: String,
        /// The files, relative to the sweep file.
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

/// A robot of an axis.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotChoice {
    /// Name of the choice.
    pub name: String,
    /// Robot file, relative to the sweep file.
    pub robot: String,
    /// The motion files, relative to the sweep file.
    pub motions: Vec<String>,
}

impl Axis {
    /// Name of the axis: of its column.
    pub fn name(&self) -> &str {
        match self {
            Self::Parameter { name, .. }
            | Self::Servos { name, .. }
            | Self::Motions { name, .. }
            | Self::Robots { name, .. } => name,
        }
    }

    /// Number of its points.
    pub fn len(&self) -> usize {
        match self {
            Self::Parameter { values, .. } => values.len(),
            Self::Servos { names, .. } => names.len(),
            Self::Motions { files, .. } => files.len(),
            Self::Robots { choices, .. } => choices.len(),
        }
    }

    /// True if the axis has no points, which no sweep file allows.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Label of a point.
    pub fn label(&self, at: usize) -> String {
        match self {
            Self::Parameter { values, .. } => values[at].to_string(),
            Self::Servos { names, .. } => names[at].clone(),
            Self::Motions { files, .. } => files[at].clone(),
            Self::Robots { choices, .. } => choices[at].name.clone(),
        }
    }
}

impl Sweep {
    /// Reads a sweep file. `file_name` is for messages only.
    ///
    /// # Errors
    /// Everything that is wrong with the file itself.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let sweep = sweep(&document);
        document.finish(sweep)
    }

    /// Reads a sweep file, and checks it against its design and a catalogue.
    pub(super) fn checked(
        file: &NamedText,
        design: Option<&Designed>,
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
                            let problem = format_args!("is `{name}`, no parameter of the design");
                            table.fault(
                                "parameter",
                                problem,
                                "unknown",
                                format!("it has {}", names.join(", ")),
                            );
                        }
                        Some(of) => {
                            if let Some(out) =
                                values.iter().find(|v| !(of.min..=of.max).contains(v))
                            {
                                let problem =
                                    format_args!("`{name}` goes to {out}, outside its bounds");
                                let help = format!("{} to {} in the design file", of.min, of.max);
                                table.fault("parameter", problem, "outside", help);
                            }
                        }
                    }
                }
                Axis::Servos { actuator, names, .. } => {
                    if let Some(name) = names.iter().find(|name| catalog.get(name).is_none()) {
                        let all: Vec<&str> =
                            catalog.servos().iter().map(|of| of.name.as_str()).collect();
                        let help = format!("it has {}", all.join(", "));
                        table.fault(
                            "servos",
                            format_args!("names `{name}`, not in the catalogue"),
                            "unknown",
                            help,
                        );
                    }
                    let place = speed_of(actuator);
                    if let Some(Err(nothing)) = design.map(|design| design.value_of(&place)) {
                        table.fault("actuator", nothing.problem, "unknown", nothing.help);
                    }
                }
                Axis::Motions { .. } | Axis::Robots { .. } => {}
            }
        }
        document.finish(Some(sweep))
    }

    /// The files that it names besides its design.
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

    /// The axis along which chains go, if there is one of a parameter: the last.
    pub fn inner(&self) -> Option<usize> {
        self.axes.iter().rposition(|axis| matches!(axis, Axis::Parameter { .. }))
    }

    /// Points along a chain.
    pub fn chain_len(&self) -> usize {
        self.inner().map_or(1, |inner| self.axes[inner].len())
    }

    /// Number of chains.
    pub fn chains(&self) -> usize {
        self.axes.iter().map(Axis::len).product::<usize>() / self.chain_len()
    }

    /// The first point of a chain: a place on every axis, 0 on that along which it goes.
    pub fn start(&self, chain: usize) -> Vec<usize> {
        let (mut rest, mut start) = (chain, vec![0; self.axes.len()]);
        for k in (0..self.axes.len()).rev().filter(|k| Some(*k) != self.inner()) {
            start[k] = rest % self.axes[k].len();
            rest /= self.axes[k].len();
        }
        start
    }
}

/// The speed limit of an actuator.
pub fn speed_of(actuator: &str) -> Place {
    Place {
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
        root.fault("axis", "is missing", "one point", "write [[axis]] tables");
    }
    let axes: Vec<Option<Axis>> = tables.iter().map(axis).collect();
    root.done();
    let axes: Vec<Axis> = axes.into_iter().collect::<Option<_>>()?;
    let robots = axes.iter().filter(|axis| matches!(axis, Axis::Robots { .. })).count();
    if robots + usize::from(design.is_some()) != 1 {
        let help = "give `design`, or one [[axis]] with robots that have their own motions";
        root.fault("design", "and robots: one of them is needed", "which robot?", help);
    }
    let points = axes.iter().try_fold(1_usize, |all, axis| all.checked_mul(axis.len()));
    if points.is_none_or(|points| points > POINTS_MAX) {
        root.fault(
            "axis",
            format_args!("have more than {POINTS_MAX} points"),
            "too many",
            "take fewer values",
        );
    }
    for (index, axis) in axes.iter().enumerate() {
        if axes[..index].iter().any(|other| other.name() == axis.name()) {
            let problem = format_args!("`{}` is there twice", axis.name());
            tables[index].fault("name", problem, "again", "give each axis a name of its own");
        }
    }
    Some(Sweep { name: name?, design, axes })
}

fn axis(table: &Table<'_>) -> Option<Axis> {
    if table.has("parameter") {
        let name = table.string("parameter");
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
        return Some(Axis::Parameter { name: name?, values: values? });
    }
    let name = table.name("name")?;
    let strings = |key| -> Option<Vec<String>> {
        let strings: Vec<String> =
            table.strings(key)?.into_iter().map(|(text, _)| text.to_owned()).collect();
        if strings.is_empty() {
            table.fault(key, "is empty", "no point", "give one or more");
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
            let help = "give parameter, servos, motions or robots";
            table.fault("robots", "is missing", "an axis of what?", help);
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

/// Values from one to another, rounded to what people write.
fn evenly(from: f64, to: f64, points: u32) -> Option<Vec<f64>> {
    let value = |k: u32| from + (to - from) * f64::from(k) / f64::from(points - 1);
    let rounded = |value: f64| (value * 1e9).round() / 1e9;
    Some((0..points).map(|k| rounded(value(k))).collect())
}
