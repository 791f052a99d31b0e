//! Text of a robot file from a draft, with the source of each part.

use super::draft::{Draft, DraftSheet, Motor, Origin};
use super::side::NUMBERS;
use super::toml_text::{array, comment, key, quoted, show};
use crate::pose::roll_pitch_yaw;
use crate::shape::Shape;
use nalgebra::Vector3;
use rollwalk_protocol::crc::crc32c_append;
use std::fmt::Write;
use std::ops::Range;

/// Text of a robot file and sources of its parts.
#[derive(Debug)]
pub(super) struct Emitted {
    pub text: String,
    pub origins: Vec<(Range<usize>, Origin)>,
}

/// Writes the robot file. `sources` are the names of URDF and side file.
pub(super) fn emit(draft: &Draft, sources: [&str; 2]) -> Emitted {
    let mut out = Emitted { text: String::new(), origins: Vec::new() };
    let [urdf, side] = sources.map(comment);
    out.line(format_args!("# Imported from {urdf} with {side} by `rollwalk robot import`."));
    out.line("# Links and joints: from the model, rigidly connected links merged. Limits, torques and speeds: from the model");
    out.line("# unless the side file says otherwise. Gains, armature, nominal pose, end effectors: side file or");
    out.line("# defaults. Format: docs/robot-files.md; defaults: docs/urdf-import.md.");
    out.line(format_args!("{MARK}00000000"));
    out.line(format_args!("\nname = {}", quoted(&draft.name)));
    for DraftSheet { name, sheet, side } in &draft.sheets {
        let start = out.text.len();
        out.line(format_args!("\n[actuator.{name}]\nmodel = {}", quoted(&sheet.model)));
        for (key, number) in NUMBERS.iter().zip(sheet.numbers) {
            if let Some(number) = number {
                out.line(format_args!("{key} = {}", show(number)));
            }
        }
        out.came_from(start, &Origin::Side(side.clone()));
    }
    for link in &draft.links {
        let start = out.text.len();
        let from: Vec<_> = link.from.iter().map(|name| comment(name)).collect();
        out.line(format_args!("\n# from urdf: {}", from.join(" + ")));
        out.line(format_args!("[[link]]\nname = {}", quoted(&link.name)));
        let i = link.mass.inertia_kg_m2;
        let inertia = [i.m11, i.m22, i.m33, i.m12, i.m13, i.m23];
        out.line(format_args!("mass_kg = {}", show(link.mass.mass_kg)));
        out.line(format_args!("com_in_link_m = {}", array(link.mass.com_m.as_slice())));
        out.line(format_args!("inertia_in_link_kg_m2 = {}", array(&inertia)));
        if !link.shapes.is_empty() {
            let shapes: Vec<_> = link.shapes.iter().map(shape).collect();
            out.line(format_args!("shapes = [\n  {},\n]", shapes.join(",\n  ")));
        }
        out.came_from(start, &link.origin);
    }
    for joint in &draft.joints {
        let start = out.text.len();
        out.line(format_args!("\n# from urdf: joint {}", comment(&joint.from)));
        out.line(format_args!("[[joint]]\nname = {}", quoted(&joint.name)));
        let slides = joint.travel_m_per_rad.is_some();
        let unit = if slides { "m" } else { "rad" };
        if slides {
            out.line("kind = \"prismatic\"");
        }
        out.line(format_args!("parent = {}", quoted(&draft.links[joint.parent].name)));
        out.line(format_args!("child = {}", quoted(&draft.links[joint.child].name)));
        let pose = joint.parent_from_joint;
        out.line(format_args!(
            "origin_in_parent_m = {}",
            array(pose.translation.vector.as_slice())
        ));
        let rpy = roll_pitch_yaw(&pose.rotation);
        let rpy = rpy.map(|angle| if angle.abs() < 1e-12 { 0.0 } else { angle });
        if rpy != [0.0; 3] {
            out.line(format_args!("origin_rpy_rad = {}", array(&rpy)));
        }
        out.line(format_args!("axis_in_joint = {}", array(joint.axis.as_slice())));
        out.came_from(start, &Origin::Urdf(joint.urdf.clone()));
        let start = out.text.len();
        if let Some(travel) = joint.travel_m_per_rad {
            out.line(format_args!("travel_m_per_rad = {}", show(travel)));
        }
        out.line(format_args!("position_min_{unit} = {}", show(joint.range.min_rad)));
        out.line(format_args!("position_max_{unit} = {}", show(joint.range.max_rad)));
        out.line(format_args!("nominal_{unit} = {}", show(joint.range.nominal_rad)));
        if let Some(motor) = joint.motor {
            out.motor(draft, motor);
        }
        if !joint.motor_per_joint.is_empty() {
            let ratio = |(name, ratio): &(String, f64)| format!("{} = {}", key(name), show(*ratio));
            let ratios: Vec<_> = joint.motor_per_joint.iter().map(ratio).collect();
            out.line(format_args!("motor_per_joint = {{ {} }}", ratios.join(", ")));
        }
        if let Some(linkage) = &joint.linkage {
            let motor_on = quoted(&draft.links[linkage.link].name);
            let points = [linkage.pivot_m, linkage.pin_m, linkage.rod_end_m, linkage.axis];
            let [pivot, pin, end, axis] = points.map(|point| array(point.as_slice()));
            out.line(format_args!(
                "linkage = {{ motor_on = {motor_on}, pivot_m = {pivot}, pin_m = {pin}, rod_end_m = {end}, axis = {axis}, motor_nominal_rad = {} }}",
                show(linkage.nominal_rad)
            ));
        }
        if let Some(spring) = &joint.spring {
            let [stiffness, rest, damping] =
                [spring.stiffness_nm_rad, spring.rest_rad, spring.damping_nm_s_rad].map(show);
            let [stiffness_key, rest_key, damping_key] = match slides {
                true => ["stiffness_n_m", "rest_m", "damping_n_s_m"],
                false => ["stiffness_nm_rad", "rest_rad", "damping_nm_s_rad"],
            };
            let mut keys = Vec::new();
            if spring.stiffness_nm_rad != 0.0 {
                keys.push(format!("{stiffness_key} = {stiffness}, {rest_key} = {rest}"));
            }
            if spring.damping_nm_s_rad != 0.0 {
                keys.push(format!("{damping_key} = {damping}"));
            }
            out.line(format_args!("spring = {{ {} }}", keys.join(", ")));
        }
        let side = joint.side.clone().map(Origin::Side);
        out.came_from(start, &side.unwrap_or(Origin::Urdf(joint.urdf.clone())));
    }
    for end in &draft.end_effectors {
        let start = out.text.len();
        out.line(format_args!("\n# from urdf: {}", comment(&end.from)));
        out.line(format_args!("[[end_effector]]\nname = {}", quoted(&end.name)));
        out.line(format_args!("link = {}", quoted(&draft.links[end.link].name)));
        out.line(format_args!("center_in_link_m = {}", array(end.center_m.as_slice())));
        out.line(format_args!("radius_m = {}", show(end.radius_m)));
        out.line(format_args!("friction_coefficient = {}", show(end.friction)));
        out.line(format_args!("contact = \"{}\"", end.contact));
        if let Some(axis) = end.axis {
            out.line(format_args!("axis_in_link = {}", array(axis.as_slice())));
        }
        for (key, number) in &end.numbers {
            out.line(format_args!("{key} = {}", show(*number)));
        }
        if let Some(motor) = end.motor {
            out.motor(draft, motor);
        }
        out.came_from(start, &end.origin);
    }
    out.seal();
    out
}

/// Beginning of the line with the checksum of the other lines.
const MARK: &str = "# The import replaces this file only if it is unchanged: ";

/// Checksum of the lines of a robot file without the line of the checksum. Line endings do not affect it.
fn checksum(text: &str) -> u32 {
    let lines = text.lines().filter(|line| !line.starts_with(MARK));
    lines.fold(0, |sum, line| crc32c_append(crc32c_append(sum, line.as_bytes()), b"\n"))
}

/// True for the text of an imported robot file without later edits.
pub fn is_unchanged(text: &str) -> bool {
    let given = text.lines().find_map(|line| line.strip_prefix(MARK));
    given.is_some_and(|given| given.trim_end() == format!("{:08x}", checksum(text)))
}

impl Emitted {
    fn line(&mut self, line: impl std::fmt::Display) {
        let _ = writeln!(self.text, "{line}");
    }

    /// Enters the checksum, which has as many digits as its placeholder.
    fn seal(&mut self) {
        let sum = format!("{MARK}{:08x}", checksum(&self.text));
        self.text = self.text.replacen(&format!("{MARK}00000000"), &sum, 1);
    }

    fn motor(&mut self, draft: &Draft, motor: Motor) {
        let Motor { sheet, bus, id } = motor;
        self.line(format_args!(
            "actuator = {}\nbus = {bus}\nid = {id}",
            quoted(&draft.sheets[sheet].name)
        ));
    }

    fn came_from(&mut self, start: usize, origin: &Origin) {
        self.origins.push((start..self.text.len(), origin.clone()));
    }
}

/// Entry of `shapes`, rounded to a tenth of a millimetre.
fn shape(shape: &Shape) -> String {
    let round = |length_m: f64| (length_m * 1e4).round() / 1e4 + 0.0;
    let vector = |v: &Vector3<f64>| array(v.map(round).as_slice());
    match shape {
        Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => format!(
            "{{ from_m = {}, to_m = {}, radius_m = {} }}",
            vector(from_in_link_m),
            vector(to_in_link_m),
            show(round(*radius_m).max(1e-4))
        ),
        Shape::Box { center_in_link_m, size_m } => format!(
            "{{ at_m = {}, box_m = {} }}",
            vector(center_in_link_m),
            vector(&size_m.map(|side| side.max(1e-4)))
        ),
    }
}
