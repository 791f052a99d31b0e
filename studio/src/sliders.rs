//! Parameters of a robot that get a slider: those of its design file, or the usual ones of a robot file.

use crate::documents::Documents;
use crate::messages::{Answer, Parameter};
use rollwalk_design::file::DesignFile;
use rollwalk_design::parameter::{Axis, Kind, Location};
use rollwalk_design::text::RobotText;
use toml_edit::{Document, Item, TableLike};

/// Maximum number of sliders of a robot without a design file.
const MOST: usize = 24;
/// Range of the usual sliders, as multiples of the current value.
const RANGE: [f64; 2] = [0.5, 2.0];
/// Prefixes of links and feet of limbs that are not from a template.
const LIMBS: [&str; 6] = ["front_left", "front_right", "rear_left", "rear_right", "left", "right"];

/// Slider with the parameter that it changes.
#[derive(Clone, Debug)]
pub struct Slider {
    /// Parameter for the page.
    pub shown: Parameter,
    pub(crate) place: Location,
}

/// Sliders of the robot file at `path`. If an open design file names the robot file, its parameters are used.
pub fn sliders(documents: &Documents<'_>, path: &str, text: &str) -> Vec<Slider> {
    let Ok(mut robot) = RobotText::new(text) else { return Vec::new() };
    let designs = documents.files().iter().filter_map(|file| {
        let design = DesignFile::from_toml(&file.path, &file.text).ok()?;
        let named = documents.beside(&file.path, &design.robot)?;
        (named.path == path).then_some(design)
    });
    let designed: Vec<Slider> = designs.flat_map(|design| of_design(&design, &mut robot)).collect();
    if designed.is_empty() { usual(text, &mut robot) } else { designed }
}

/// Returns the text of a robot file after changing one parameter.
///
/// # Errors
/// Returns an error if the parameter does not exist or cannot have the value, or if the robot file is not TOML.
pub fn set(text: &str, sliders: &[Slider], name: &str, value: f64) -> Result<String, Answer> {
    let refused = |message: String, help: String| Answer::Error { message, help };
    let Some(Slider { shown, place }) = sliders.iter().find(|slider| slider.shown.name == name)
    else {
        let known: Vec<_> = sliders.iter().map(|slider| slider.shown.name.as_str()).collect();
        let help = format!("give one of {}", known.join(", "));
        return Err(refused(format!("the robot has no parameter `{name}`"), help));
    };
    if !value.is_finite() || (!place.kind.has_axis() && value <= 0.0 && place.kind != Kind::Tilt) {
        let help = format!("give a number above 0, such as {} {}", shown.value, shown.unit);
        return Err(refused(format!("{} cannot be {value} {}", shown.label, shown.unit), help));
    }
    let mut robot = RobotText::new(text).map_err(|error| {
        let help = "correct the syntax of the file first".to_owned();
        refused(format!("this is not TOML: {}", error.message()), help)
    })?;
    robot.set(place, value).map_err(|nothing| refused(nothing.problem, nothing.help))?;
    Ok(robot.to_string())
}

fn of_design(design: &DesignFile, robot: &mut RobotText) -> Vec<Slider> {
    let slider = |of: &rollwalk_design::file::Parameter| {
        let value = robot.value(&of.place).ok()?;
        let range = of.max - of.min;
        let shown = Parameter {
            name: of.name.clone(),
            label: of.name.replace('_', " "),
            unit: of.place.kind.unit().0,
            value,
            min: of.min,
            max: of.max,
            step: of.step.unwrap_or_else(|| step_of(range)),
        };
        Some(Slider { shown, place: of.place.clone() })
    };
    design.parameters.iter().filter_map(slider).collect()
}

/// Usual sliders: lengths of links, radii of feet and wheels, mounts of limbs, mass of the body, limits of servos.
fn usual(text: &str, robot: &mut RobotText) -> Vec<Slider> {
    let Ok(document) = Document::parse(text) else { return Vec::new() };
    let root = document.as_table();
    let templates = root.get("template").and_then(Item::as_table_like);
    let mut groups: Vec<(Option<&str>, &dyn TableLike)> = Vec::new();
    groups.extend(
        templates
            .into_iter()
            .flat_map(TableLike::iter)
            .filter_map(|(name, item)| Some((Some(name), item.as_table_like()?))),
    );
    groups.push((None, root));
    let mut places: Vec<Location> = Vec::new();
    let mut place = |kind, template: Option<&str>, name: String, axis| {
        let template = template.map(str::to_owned);
        let place = Location { kind, template, name, axis, limbs: Vec::new() };
        if !places.contains(&place) {
            places.push(place);
        }
    };
    for &(template, group) in &groups {
        for name in names(group, "link") {
            place(Kind::Length, template, grouped(name, template), None);
        }
        for name in names(group, "end_effector") {
            place(Kind::Radius, template, grouped(name, template), None);
        }
        if let Some(template) = template {
            for axis in [Axis::X, Axis::Y] {
                place(Kind::Mount, None, template.to_owned(), Some(axis));
            }
        }
    }
    if let Some(body) = names(root, "link").first() {
        place(Kind::Mass, None, (*body).to_owned(), None);
    }
    let actuators = root.get("actuator").and_then(Item::as_table_like);
    for (name, _) in actuators.into_iter().flat_map(TableLike::iter) {
        place(Kind::Torque, None, name.to_owned(), None);
        place(Kind::Speed, None, name.to_owned(), None);
    }
    let slider = |place: Location| {
        let motors = matches!(place.kind, Kind::Torque | Kind::Speed);
        let driven = if motors { driven_by(&groups, &place.name) } else { Vec::new() };
        slider(place, &driven, robot)
    };
    places.into_iter().filter_map(slider).take(MOST).collect()
}

/// Names of the joints and wheels that an actuator drives; corresponding ones of all limbs share a name.
fn driven_by(groups: &[(Option<&str>, &dyn TableLike)], actuator: &str) -> Vec<String> {
    let mut driven = Vec::new();
    for &(template, group) in groups {
        for key in ["joint", "end_effector"] {
            let tables = group.get(key).and_then(Item::as_array_of_tables).into_iter().flatten();
            for table in tables {
                let is = |key| table.get(key).and_then(Item::as_str);
                let Some(name) = is("name").filter(|_| is("actuator") == Some(actuator)) else {
                    continue;
                };
                let name = plain(&grouped(name, template), template.unwrap_or_default());
                if !driven.contains(&name) {
                    driven.push(name);
                }
            }
        }
    }
    driven
}

fn slider(place: Location, driven: &[String], robot: &mut RobotText) -> Option<Slider> {
    let value = robot.value(&place).ok().filter(|value| *value > 0.0)?;
    let step = step_of(value);
    let [min, max] = RANGE.map(|part| rounded(part * value, step));
    let shown = Parameter {
        name: place.to_string(),
        label: label(&place, driven),
        unit: place.kind.unit().0,
        value,
        min,
        max,
        step,
    };
    Some(Slider { shown, place })
}

/// Label for users: `thigh length`, `xm430 torque limit`.
fn label(place: &Location, driven: &[String]) -> String {
    let template = place.template.as_deref().unwrap_or("robot");
    let part = plain(&place.name, template);
    let of = match driven {
        [] => String::new(),
        [first, second, _, ..] => format!(" ({first}, {second}, …)"),
        few => format!(" ({})", few.join(", ")),
    };
    match (place.kind, place.axis) {
        (Kind::Length, _) => format!("{part} length"),
        (Kind::Radius, _) => format!("{part} contact radius"),
        (Kind::Mass, _) => format!("{part} mass (heaviest part)"),
        (Kind::Speed, _) => format!("{part} speed limit{of}"),
        (Kind::Torque, _) => format!("{part} torque limit{of}"),
        (Kind::Mount, Some(Axis::Y)) => {
            format!("{part} mounts: half the distance from left to right")
        }
        (Kind::Mount, _) => format!("{part} mounts: half the distance from front to rear"),
        (kind, _) => format!("{part} {}", kind.key()),
    }
}

/// Name without the prefix of its limb; the name of the template if nothing is left.
fn plain(name: &str, template: &str) -> String {
    let part = name.trim_start_matches(['*', '_']);
    if part.is_empty() { template } else { part }.replace('_', " ")
}

/// Names of the tables of a kind.
fn names<'t>(table: &'t dyn TableLike, key: &str) -> Vec<&'t str> {
    let tables = table.get(key).and_then(Item::as_array_of_tables).into_iter().flatten();
    tables.filter_map(|table| table.get("name")?.as_str()).collect()
}

/// Name that stands for the corresponding parts of all limbs, with `*` for the limb; names in templates already contain `*`.
fn grouped(name: &str, template: Option<&str>) -> String {
    let rest = LIMBS.iter().find_map(|limb| name.strip_prefix(limb));
    match rest {
        Some(rest) if template.is_none() && (rest.is_empty() || rest.starts_with('_')) => {
            format!("*{rest}")
        }
        _ => name.to_owned(),
    }
}

/// Slider step: a hundredth of the decade of a value, such as 0.001 for 0.12.
fn step_of(value: f64) -> f64 {
    10f64.powf(value.abs().log10().floor() - 2.0)
}

fn rounded(value: f64, step: f64) -> f64 {
    let per = (1.0 / step).round();
    if per >= 1.0 { (value * per).round() / per } else { (value / step).round() * step }
}
