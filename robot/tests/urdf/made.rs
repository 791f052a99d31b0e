//! Small robots for tests of guesses, written link by link.

use rollwalk_robot::Robot;
use rollwalk_robot::urdf::{Survey, Text, import, survey};
use std::fmt::Write;

/// Limits of a joint that turns both ways.
pub const WIDE: &str = "lower=\"-2\" upper=\"2\" effort=\"12\" velocity=\"9\"";
/// Limits of a knee that bends one way.
pub const KNEE: &str = "lower=\"-2.6\" upper=\"-0.3\" effort=\"12\" velocity=\"9\"";
/// Limits of an axle.
pub const AXLE: &str = "effort=\"5\" velocity=\"30\"";

/// URDF under construction.
#[derive(Clone, Default)]
pub struct Made {
    pub text: String,
}

impl Made {
    /// Link with a centre of mass and a solid inertia; `shapes` are `<collision>` elements.
    pub fn link(&mut self, name: &str, mass_kg: f64, com: [f64; 3], moment: f64, shapes: &str) {
        let [x, y, z] = com;
        let _ = writeln!(
            self.text,
            "<link name=\"{name}\"><inertial><origin xyz=\"{x} {y} {z}\"/><mass value=\"{mass_kg}\"/>\
             <inertia ixx=\"{moment}\" ixy=\"0\" ixz=\"0\" iyy=\"{moment}\" iyz=\"0\" izz=\"{moment}\"/></inertial>{shapes}</link>"
        );
    }

    pub fn joint(
        &mut self,
        kind: &str,
        ends: [&str; 3],
        at: [f64; 3],
        axis: [f64; 3],
        limits: &str,
    ) {
        let ([name, parent, child], [x, y, z], [a, b, c]) = (ends, at, axis);
        let limit = if limits.is_empty() { String::new() } else { format!("<limit {limits}/>") };
        let _ = writeln!(
            self.text,
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <origin xyz=\"{x} {y} {z}\"/><axis xyz=\"{a} {b} {c}\"/>{limit}</joint>"
        );
    }

    /// Leg of hip roll, hip pitch and knee with a ball foot.
    pub fn leg(&mut self, name: &str, parent: &str, at: [f64; 3]) {
        self.limb(name, parent, at);
        self.link(&format!("{name}_ball"), 0.05, [0.0; 3], 1e-5, &ball(0.02, [0.0; 3]));
        let ends = [format!("{name}_end"), format!("{name}_shank"), format!("{name}_ball")];
        self.joint(
            "fixed",
            ends.each_ref().map(String::as_str),
            [0.0, 0.0, -0.2],
            [0.0, 1.0, 0.0],
            "",
        );
    }

    /// Leg of hip roll, hip pitch and knee that ends with its shank.
    pub fn limb(&mut self, name: &str, parent: &str, at: [f64; 3]) {
        let side = 0.04 * at[1].signum();
        let names = ["hip", "thigh", "shank"].map(|part| format!("{name}_{part}"));
        self.link(&names[0], 0.4, [0.0; 3], 8e-4, "");
        self.link(&names[1], 0.6, [0.0, 0.0, -0.1], 2e-3, "");
        self.link(&names[2], 0.2, [0.0, 0.0, -0.1], 8e-4, "");
        let joints = ["roll", "pitch", "knee"].map(|part| format!("{name}_{part}"));
        let [roll, pitch, knee] = joints.each_ref().map(String::as_str);
        let [hip, thigh, shank] = names.each_ref().map(String::as_str);
        self.joint("revolute", [roll, parent, hip], at, [1.0, 0.0, 0.0], WIDE);
        self.joint("revolute", [pitch, hip, thigh], [0.0, side, 0.0], [0.0, 1.0, 0.0], WIDE);
        self.joint("revolute", [knee, thigh, shank], [0.0, 0.0, -0.2], [0.0, 1.0, 0.0], KNEE);
    }

    /// Trunk with four legs.
    pub fn quadruped() -> Self {
        let mut made = Self::trunk();
        for (name, x, y) in CORNERS {
            made.leg(name, "trunk", [x, y, 0.0]);
        }
        made
    }

    /// Trunk without legs.
    pub fn trunk() -> Self {
        let mut made = Self::default();
        made.link("trunk", 6.0, [0.0; 3], 0.1, &cuboid([0.4, 0.2, 0.1], [0.0; 3]));
        made
    }

    pub fn urdf(&self) -> String {
        format!("<robot name=\"made\">{}</robot>", self.text)
    }
}

/// Names of legs with the places of their hips.
pub const CORNERS: [(&str, f64, f64); 4] =
    [("LF", 0.2, 0.1), ("RF", 0.2, -0.1), ("LH", -0.2, 0.1), ("RH", -0.2, -0.1)];

/// Collision sphere.
pub fn ball(radius_m: f64, at: [f64; 3]) -> String {
    solid(&format!("<sphere radius=\"{radius_m}\"/>"), at, [0.0; 3])
}

/// Collision box.
pub fn cuboid([x, y, z]: [f64; 3], at: [f64; 3]) -> String {
    solid(&format!("<box size=\"{x} {y} {z}\"/>"), at, [0.0; 3])
}

/// Collision cylinder along y.
pub fn disc(radius_m: f64, length_m: f64) -> String {
    let cylinder = format!("<cylinder radius=\"{radius_m}\" length=\"{length_m}\"/>");
    solid(&cylinder, [0.0; 3], [std::f64::consts::FRAC_PI_2, 0.0, 0.0])
}

/// Collision geometry at a place, turned by roll, pitch and yaw.
pub fn solid(geometry: &str, [x, y, z]: [f64; 3], [roll, pitch, yaw]: [f64; 3]) -> String {
    format!(
        "<collision><origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/><geometry>{geometry}</geometry></collision>"
    )
}

/// Survey of a text, and the robot that its template imports to.
#[track_caller]
pub fn imported(text: &str) -> (Survey, Robot) {
    let urdf = Text { name: "made", text };
    let found = survey(urdf).unwrap_or_else(|error| panic!("{error}"));
    let side = Text { name: "template", text: &found.template };
    match import(urdf, side) {
        Ok(made) => (found, made.robot),
        Err(error) => panic!("{error}\n{}", found.template),
    }
}

/// Links and kinds of contact, sorted.
pub fn contacts(found: &Survey) -> Vec<(&str, &str)> {
    let ends = found.end_effectors.iter();
    let mut contacts: Vec<_> = ends.map(|end| (&*end.link, &*end.contact)).collect();
    contacts.sort_unstable();
    contacts
}

/// Warnings that contain all words.
pub fn warned(found: &Survey, words: &[&str]) -> bool {
    found.warnings.iter().any(|warning| words.iter().all(|word| warning.contains(word)))
}
