//! Text of a first side file, with a comment on every guess.

use super::draft_side::{Base, Draft};
use super::guess::EndKind;
use super::joints::{has_degrees, position_limits};
use super::model::{Joint, Kind, Urdf};
use super::side::{AXES, EndEffectorSide, MotorSide, NUMBERS, Side};
use super::stance::Stance;
use super::survey::Contact;
use super::toml_text::{array, comment, key, quoted, show};
use std::fmt::Write;

/// Contents of the template.
pub(super) struct Content<'a> {
    pub file_name: &'a str,
    pub urdf: &'a Urdf,
    /// Root, if the side file gives one or the URDF has several.
    pub root: Option<usize>,
    /// Given side file, whose values replace guesses.
    pub side: &'a Side,
    pub draft: &'a Draft,
    /// Joints that stay joints, with their angles in `stance`.
    pub moving: &'a [&'a Joint],
    pub stance: &'a Stance,
    pub contacts: &'a [Contact<'a>],
    /// Contact of a robot without feet and wheels.
    pub base: Option<Base>,
}

const HEAD: &str = "\
# Every value below is a guess: check it. Keys and defaults: docs/urdf-import.md.

";

const ACTUATORS: &str = "
# Values that the model lacks. Without them the import uses defaults.
[actuator.default]
# model = \"…\"
# speed_max_rad_s = 10.0
# torque_max_nm = 10.0
# kp_nm_rad = 100.0
# kd_nm_s_rad = 2.0
# armature_kg_m2 = 0.01
";

pub(super) fn template(content: &Content<'_>) -> String {
    let mut text = format!("# Side file for {}.\n{HEAD}", comment(content.file_name));
    head(&mut text, content);
    actuators(&mut text, content.side);
    locks(&mut text, content);
    joints(&mut text, content);
    if !content.side.end_effectors.is_empty() {
        content.side.end_effectors.iter().for_each(|end| given_end(&mut text, end));
    } else if let Some(base) = content.base {
        base_end(&mut text, content, &base);
    } else {
        content.contacts.iter().for_each(|contact| guessed_end(&mut text, content, contact));
    }
    text
}

fn head(text: &mut String, content: &Content<'_>) {
    match &content.side.name {
        Some(name) => line(text, format_args!("name = {}", quoted(name))),
        None => line(text, "# name = \"robot\"           # default: the name of the model"),
    }
    if let Some(root) = content.root {
        let root = quoted(&content.urdf.links[root].name);
        line(text, format_args!("root = {root}           # the link that is the body"));
    }
    let axes = content.draft.heading.axes;
    let given = content.side.forward.is_some() || content.side.up.is_some();
    let used = given || content.draft.heading.because.is_some();
    let mark = if used { "" } else { "# " };
    let [forward, up] = [axes.forward, axes.up].map(|axis| AXES[axis]);
    line(
        text,
        format_args!(
            "{mark}forward = \"{forward}\"           # axis of the root link that points forward"
        ),
    );
    line(
        text,
        format_args!("{mark}up = \"{up}\"                # axis of the root link that points up"),
    );
}

fn actuators(text: &mut String, side: &Side) {
    if !side.actuators.iter().any(|given| given.name == "default") {
        *text += ACTUATORS;
    }
    for given in &side.actuators {
        line(text, format_args!("\n[actuator.{}]", key(&given.name)));
        if let Some(model) = &given.model {
            line(text, format_args!("model = {}", quoted(model)));
        }
        for (key, number) in NUMBERS.iter().zip(given.numbers) {
            if let Some(number) = number {
                line(text, format_args!("{key} = {}", show(number)));
            }
        }
    }
}

fn locks(text: &mut String, content: &Content<'_>) {
    let locks = &content.draft.locks;
    if !locks.is_empty() {
        *text += "\n# Joints that become rigid at the given position (rad, m): joints that robot files do not support, passive joints,\n# and joints beyond the number of channels of a controller.\n[lock]\n";
    }
    for &(joint, position) in locks {
        let joint = &content.urdf.joints[joint];
        line(text, format_args!("{} = {}", key(&joint.name), show(position)));
    }
}

fn joints(text: &mut String, content: &Content<'_>) {
    if !content.moving.is_empty() {
        *text += "\n# Angles of the standing pose. Also: position_min_rad, position_max_rad, actuator, bus and id; for joints that slide in m, with\n# travel_m_per_rad.\n[joint]\n";
    }
    for (joint, angle) in content.moving.iter().zip(&content.stance.angles_rad) {
        let given = content.side.joints.iter().find(|given| given.joint == joint.name);
        let [min, max] = position_limits(content.urdf, joint);
        // A rounded angle may be beyond a limit.
        let rounded = (angle * 1e3).round() / 1e3;
        let guessed = if (min..=max).contains(&rounded) { rounded } else { *angle };
        let nominal = given.and_then(|given| given.nominal_rad).unwrap_or(guessed);
        let unit = if joint.kind == Kind::Prismatic { "m" } else { "rad" };
        let mut entry = format!("nominal_{unit} = {}", show(nominal));
        if let Some([min, max]) = limits(content.urdf, joint) {
            let _ = write!(
                entry,
                ", position_min_rad = {}, position_max_rad = {}",
                show(min),
                show(max)
            );
        } else if let Some(given) = given {
            for (key, limit) in [("position_min", given.min_rad), ("position_max", given.max_rad)] {
                if let Some(limit) = limit {
                    let _ = write!(entry, ", {key}_{unit} = {}", show(limit));
                }
            }
        }
        if let Some(travel) = given.and_then(|given| given.travel_m_per_rad) {
            let _ = write!(entry, ", travel_m_per_rad = {}", show(travel));
        }
        if let Some(given) = given {
            motor(&mut entry, ", ", &given.motor);
        }
        line(text, format_args!("{} = {{ {entry} }}", key(&joint.name)));
    }
}

/// Limits of a joint that the import cannot take from the URDF as they are.
fn limits(urdf: &Urdf, joint: &Joint) -> Option<[f64; 2]> {
    let [min, max] = position_limits(urdf, joint);
    let differs = joint.kind == Kind::Revolute
        && (has_degrees(urdf, joint) || {
            let [lower, upper] = [joint.limit.lower, joint.limit.upper].map(|of| of.unwrap_or(0.0));
            lower.min(upper) > max || lower.max(upper) < min
        });
    differs.then_some([min, max])
}

fn guessed_end(text: &mut String, content: &Content<'_>, contact: &Contact<'_>) {
    let end = contact.end;
    begin_end(text, &contact.name, end.kind.contact());
    match end.axle {
        Some(axle) => {
            let joint = quoted(&content.urdf.joints[axle].name);
            line(text, format_args!("wheel_joint = {joint}"));
        }
        None => line(text, format_args!("link = {}", quoted(&content.urdf.links[end.link].name))),
    }
    line(text, format_args!("center_in_link_m = {}", array(contact.center_in_link_m.as_slice())));
    let source = match end.measured {
        true => "from its shape in the model",
        false => "the model has no shape there: measure it",
    };
    line(text, format_args!("radius_m = {}   # {source}", show(end.radius_m)));
    line(text, "friction_coefficient = 0.7");
    match end.kind {
        EndKind::FreeWheel => line(text, "rolling_resistance = 0.02"),
        EndKind::WeldedWheel(axis) => {
            line(text, format_args!("axis_in_link = {}", array(axis.as_slice())));
        }
        EndKind::Caster(axis) => {
            line(text, format_args!("axis_in_link = {}", array(axis.as_slice())));
            line(text, "rolling_resistance = 0.02");
        }
        EndKind::Foot | EndKind::DrivenWheel => {}
    }
}

fn base_end(text: &mut String, content: &Content<'_>, base: &Base) {
    *text += "\n# No part looks like a foot or a wheel. The import needs at least one: replace this point below the body by your feet or wheels.";
    begin_end(text, "base", "point_foot");
    line(text, format_args!("link = {}", quoted(&content.urdf.links[base.link].name)));
    line(text, format_args!("center_in_link_m = {}", array(base.center_m.as_slice())));
    line(text, format_args!("radius_m = {}", show(base.radius_m)));
    line(text, "friction_coefficient = 0.7");
}

fn given_end(text: &mut String, end: &EndEffectorSide) {
    begin_end(text, &end.name, end.contact);
    if let Some((joint, _)) = &end.wheel_joint {
        line(text, format_args!("wheel_joint = {}", quoted(joint)));
    }
    if let Some((link, _)) = &end.link {
        line(text, format_args!("link = {}", quoted(link)));
    }
    if let Some(center) = &end.center_m {
        line(text, format_args!("center_in_link_m = {}", array(center)));
    }
    line(text, format_args!("radius_m = {}", show(end.radius_m)));
    line(text, format_args!("friction_coefficient = {}", show(end.friction)));
    if let Some(axis) = &end.axis {
        line(text, format_args!("axis_in_link = {}", array(axis.as_slice())));
    }
    for (key, number) in &end.numbers {
        line(text, format_args!("{key} = {}", show(*number)));
    }
    let mut entry = String::new();
    motor(&mut entry, "\n", &end.motor);
    *text += entry.trim_start();
    if !entry.is_empty() {
        text.push('\n');
    }
}

fn begin_end(text: &mut String, name: &str, contact: &str) {
    line(
        text,
        format_args!("\n[[end_effector]]\nname = {}\ncontact = \"{contact}\"", quoted(name)),
    );
}

fn motor(entry: &mut String, separator: &str, motor: &MotorSide) {
    if let Some((actuator, _)) = &motor.actuator {
        let _ = write!(entry, "{separator}actuator = {}", quoted(actuator));
    }
    if let Some((bus, id)) = motor.address {
        let _ = write!(entry, "{separator}bus = {bus}{separator}id = {id}");
    }
}

fn line(text: &mut String, line: impl std::fmt::Display) {
    let _ = writeln!(text, "{line}");
}
