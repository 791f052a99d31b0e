//! Design files: parameters of a robot file with their bounds, and the goal of a design.
//!
//! ```toml
//! name = "agilebot_legs"
//! robot = "../robots/agilebot.toml"
//! motions = [ { file = "walk.toml" }, { file = "turn_in_place.toml", weight = 0.5 } ]
//!
//! [[parameter]]
//! name = "thigh"
//! length_of = "leg/*_thigh"   # template/link; other keys: parameter.rs
//! min_m = 0.09
//! max_m = 0.16
//! step_m = 0.001              # manufacturing step
//!
//! [[parameter]]
//! name = "track"
//! mount = "leg.y"             # template.coordinate: all its limbs move away from the middle
//! min_m = 0.07
//! max_m = 0.12
//!
//! [[parameter]]
//! name = "front_shank"
//! length_of = "leg/*_shank"
//! limbs = ["front_left", "front_right"]   # these limbs get their own template
//! min_m = 0.09
//! max_m = 0.16
//!
//! [goal]                      # for `optimise`
//! minimise = { peak_joint_speed = 1.0 }
//! keep = { peak_joint_torque_nm = 1.8 }
//!
//! [repair]                    # if the robot cannot perform a motion
//! pull = 3e-3                 # price of a change; larger prices give smaller and more even changes
//! ```

use crate::goal::Goal;
use crate::parameter::{Axis, Kind, Location};
use crate::text::NoEffect;
use rollwalk_robot::document::{Document, DocumentError, Table, in_other_unit};

/// Maximum number of parameters in a design.
const PARAMETERS_MAX: usize = 64;
/// Maximum number of motions in a design.
const MOTIONS_MAX: usize = 32;

/// Parameters of a robot, and the motions of the design.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DesignFile {
    /// Name of the design.
    pub name: String,
    /// Path of the robot file, relative to the design file.
    pub robot: String,
    /// Motions of the design, with weights.
    pub motions: Vec<WeightedMotion>,
    /// Parameters. A file has at least one.
    pub parameters: Vec<Parameter>,
    /// Goal of the optimisation, if the file has one.
    pub goal: Option<Goal>,
    /// Price of a change in a repair, per squared unit of a parameter; `None` if the file has no `[repair]`.
    pub repair_pull: Option<f64>,
}

/// Smallest manufacturing step of a parameter, in the unit of its kind.
const STEP_LEAST: f64 = 1e-6;

/// Motion of a design with its weight.
#[derive(Clone, Debug, PartialEq)]
pub struct WeightedMotion {
    /// Path of the motion file, relative to the design file.
    pub file: String,
    /// Weight of the motion in the objective.
    pub weight: f64,
}

/// Parameter with its bounds, in the unit of its kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Name in the design file.
    pub name: String,
    /// Number in the robot file or motion file that the parameter changes.
    pub place: Location,
    /// Lower bound.
    pub min: f64,
    /// Upper bound.
    pub max: f64,
    /// Manufacturing step. Results are rounded to its multiples.
    pub step: Option<f64>,
}

impl DesignFile {
    /// Parses a design file. `file_name` appears in messages only.
    ///
    /// # Errors
    /// Returns every fault of the design file itself.
    pub fn from_toml(file_name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let design = design(&document);
        document.finish(design)
    }

    /// Checks the parameters against the robot file and the motion files, and returns their present values. Each parameter must
    /// change an existing number, no two may change the same one, and the present value must be within the bounds. `value`
    /// returns the present value of a parameter.
    ///
    /// # Errors
    /// Returns the parameters that do not fit.
    pub fn check(
        &self,
        file_name: &str,
        text: &str,
        mut value: impl FnMut(&Location) -> Result<f64, NoEffect>,
    ) -> Result<Vec<f64>, DocumentError> {
        let document = Document::parse(file_name, text)?;
        let mut values = Vec::new();
        let tables = document.root().tables("parameter");
        for (index, (parameter, table)) in self.parameters.iter().zip(&tables).enumerate() {
            let Parameter { name, place, min, max, .. } = parameter;
            let key = place.kind.key();
            match value(place) {
                Err(NoEffect { problem, help }) => {
                    table.fault(
                        key,
                        format_args!("of parameter `{name}`: {problem}"),
                        "not there",
                        help,
                    );
                }
                Ok(value) if !(*min..=*max).contains(&value) => {
                    let unit = place.kind.unit().0;
                    let reach = value.abs();
                    let help = format!(
                        "widen the bounds to include {value} {unit}, the value in the file{}",
                        in_other_unit(*min, &(-reach..=reach), unit)
                    );
                    let problem = format_args!(
                        "of parameter `{name}` is {value} {unit}, outside its bounds {min} to {max}"
                    );
                    table.fault(key, problem, "outside its bounds", help);
                }
                Ok(value) => values.push(value),
            }
            if let Some(other) =
                self.parameters[..index].iter().find(|other| other.place.meets(place))
            {
                let problem = format_args!(
                    "of parameter `{name}` changes the same value as `{}`",
                    other.name
                );
                table.fault(key, problem, "again", "leave out one of the two parameters");
            }
        }
        document.finish(Some(values))
    }
}

fn design(document: &Document<'_>) -> Option<DesignFile> {
    let root = document.root();
    let name = root.name("name");
    let robot = root.string("robot");
    let motions =
        root.tables_up_to("motions", MOTIONS_MAX).iter().map(motion).collect::<Option<_>>();
    let tables = root.tables_up_to("parameter", PARAMETERS_MAX);
    if tables.is_empty() {
        root.fault(
            "parameter",
            "is missing",
            "no parameters",
            "write at least one [[parameter]] \
            table",
        );
    }
    let parameters = tables.into_iter().map(parameter).collect::<Vec<_>>();
    let names = parameters.iter().flatten().map(|of| of.name.clone()).collect::<Vec<_>>();
    let goal = match root.has("goal") {
        true => Some(root.table("goal").and_then(|table| Goal::read(&table, &names))?),
        false => None,
    };
    let repair_pull = match root.has("repair") {
        true => Some(root.table("repair").and_then(|table| pull(&table))?),
        false => None,
    };
    root.done();
    Some(DesignFile {
        name: name?,
        robot: robot?,
        motions: motions?,
        parameters: parameters.into_iter().collect::<Option<_>>()?,
        goal,
        repair_pull,
    })
}

/// Reads the pull of `[repair]`.
fn pull(table: &Table<'_>) -> Option<f64> {
    // Without a pull, nothing decides between many repairs of one flaw.
    let pull = table.number_in("pull", 1e-9..=1.0, "");
    table.done();
    pull
}

fn motion(table: &Table<'_>) -> Option<WeightedMotion> {
    let file = table.string("file");
    let weight =
        if table.has("weight") { table.number_in("weight", 1e-6..=1e6, "") } else { Some(1.0) };
    table.done();
    Some(WeightedMotion { file: file?, weight: weight? })
}

fn parameter(mut table: Table<'_>) -> Option<Parameter> {
    let name = table.name("name")?;
    table.call(format!("parameter `{name}`"));
    let given: Vec<Kind> = Kind::ALL.into_iter().filter(|kind| table.has(kind.key())).collect();
    let [kind] = given[..] else {
        let keys: Vec<&str> = Kind::ALL.iter().map(|kind| kind.key()).collect();
        let help = format!("give exactly one of {}", keys.join(", "));
        match given[..] {
            [first, second, ..] => {
                let problem = format_args!("stands beside `{}`", first.key());
                table.fault(second.key(), problem, "one kind of change", help);
            }
            _ => {
                let problem = "belongs to a parameter that changes nothing";
                table.fault("name", problem, "one kind of change", help);
            }
        }
        return None;
    };
    let place = read_location(&table, kind);
    let [min, max, step] = kind.unit().1;
    let bounds = [min, max].map(|key| table.number(key));
    let step_given = if table.has(step) { Some(table.number(step)?) } else { None };
    table.done();
    let [min_value, max_value] = [bounds[0]?, bounds[1]?];
    if min_value >= max_value {
        let problem = format_args!("is {max_value}, not above `{min}` = {min_value}");
        table.fault(max, problem, "no room", "give a value above the lower bound");
    }
    if kind.is_positive() && min_value <= 0.0 {
        let problem = format_args!("is {min_value}; expected a value above 0");
        table.fault(
            min,
            problem,
            "not above 0",
            "give the smallest value that can be manufactured",
        );
    }
    if step_given.is_some_and(|step| step < STEP_LEAST) {
        let problem = format_args!("must be at least {STEP_LEAST}");
        let help = "give the smallest step that can be manufactured, or leave out the step";
        table.fault(step, problem, "no step", help);
    }
    let range = max_value - min_value;
    if let Some(value) = step_given.filter(|value| range > 0.0 && *value > range) {
        let problem = format_args!("is {value}, more than the range of {range:.6}");
        table.fault(step, problem, "no second value", "give a smaller step, or leave it out");
    }
    Some(Parameter { name, place: place?, min: min_value, max: max_value, step: step_given })
}

fn read_location(table: &Table<'_>, kind: Kind) -> Option<Location> {
    let key = kind.key();
    let given = table.string(key)?;
    let (part, axis) = match (kind.has_axis(), given.rsplit_once('.')) {
        (false, _) => (given.as_str(), None),
        (true, Some((part, letter))) if Axis::of(letter).is_some() => (part, Axis::of(letter)),
        (true, _) => {
            let help = format!("add the coordinate: `{given}.x`, `.y` or `.z`");
            table.fault(key, format_args!("is \"{given}\", without a coordinate"), "which?", help);
            return None;
        }
    };
    let (template, name) = match part.split_once('/') {
        Some((template, name)) => (Some(template.to_owned()), name.to_owned()),
        None => (None, part.to_owned()),
    };
    let has_limbs = kind == Kind::Mount || (template.is_some() && !kind.is_of_motion());
    let limbs = if has_limbs && table.has("limbs") { table.strings("limbs")? } else { Vec::new() };
    let limbs = limbs.into_iter().map(|(limb, _)| limb.to_owned()).collect();
    Some(Location { kind, template, name, axis, limbs })
}

#[cfg(test)]
mod tests;
