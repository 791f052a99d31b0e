//! The text of a first side file, with a comment on every guess.

use super::guess::{End, EndKind};
use super::model::{Joint, Urdf};
use super::stance::Stance;
use super::toml_text::{array, comment, key, quoted, show};
use std::fmt::Write;

/// Contents of the template.
pub(super) struct Content<'a> {
    pub file_name: &'a str,
    pub urdf: &'a Urdf,
    /// The root, where the URDF has several.
    pub root: Option<usize>,
    /// Joints that stay joints, with their angles in `stance`.
    pub moving: &'a [&'a Joint],
    pub stance: &'a Stance,
    pub locks: Vec<(usize, f64)>,
    pub ends: Vec<(&'a End, &'a String)>,
}

const HEAD: &str = "\
# Every value below is a guess: check it. Keys and defaults: docs/urdf-import.md.

# name = \"robot\"           # default: that of the model
# forward = \"+x\"           # axis of the root link that points forward; `up` likewise, \"+z\"
";

const ACTUATORS: &str = "
# Where the model has no speed or torque limit, and for what it never has. Left out: defaults.
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
    let links = &content.urdf.links;
    if let Some(root) = content.root {
        let _ = writeln!(
            text,
            "root = {}            # the model has several roots",
            quoted(&links[root].name)
        );
    }
    text += ACTUATORS;
    if !content.locks.is_empty() {
        text += "\n# Joints that become rigid, at this position (rad, or m): of kinds that robot files do not have,\n# or beyond the channels of a controller.\n[lock]\n";
    }
    for &(joint, position) in &content.locks {
        let joint = &content.urdf.joints[joint];
        let _ = writeln!(text, "{} = {}", key(&joint.name), show(position));
    }
    if !content.moving.is_empty() {
        text += "\n# Angles of the standing pose. Also: position_min_rad, position_max_rad, actuator, bus and id.\n[joint]\n";
    }
    for (joint, angle) in content.moving.iter().zip(&content.stance.angles_rad) {
        let rounded = (angle * 1e3).round() / 1e3;
        let _ = writeln!(text, "{} = {{ nominal_rad = {} }}", key(&joint.name), show(rounded));
    }
    if content.ends.is_empty() {
        text += "\n# Nothing looks like a foot or a wheel. Give at least one:\n# [[end_effector]]\n# name = \"foot\"\n# contact = \"point_foot\"\n# link = \"…\"\n# center_in_link_m = [0.0, 0.0, 0.0]\n# radius_m = 0.02\n# friction_coefficient = 0.7\n";
    }
    for (end, name) in &content.ends {
        let _ = writeln!(
            text,
            "\n[[end_effector]]\nname = {}\ncontact = \"{}\"",
            quoted(name),
            end.kind.contact()
        );
        match end.axle {
            Some(axle) => {
                let _ = writeln!(text, "wheel_joint = {}", quoted(&content.urdf.joints[axle].name));
            }
            None => {
                let _ = writeln!(text, "link = {}", quoted(&links[end.link].name));
            }
        }
        let _ = writeln!(text, "center_in_link_m = {}", array(end.center_in_link_m.as_slice()));
        let source = if end.measured {
            "from its shape in the model"
        } else {
            "the model has no round shape there: measure it"
        };
        let _ = writeln!(text, "radius_m = {}   # {source}", show(end.radius_m));
        text += "friction_coefficient = 0.7\n";
        match end.kind {
            EndKind::FreeWheel => text += "rolling_resistance = 0.02\n",
            EndKind::WeldedWheel(axis) => {
                let _ = writeln!(text, "axis_in_link = {}", array(axis.as_slice()));
            }
            EndKind::Foot | EndKind::DrivenWheel => {}
        }
    }
    text
}
