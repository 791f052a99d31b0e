//! Tests of a robot of 70 channels with two arms and hands, which exceeds the channels of a controller.

use super::{good, imported};
use rollwalk_robot::urdf::{Text, survey};
use std::fmt::Write;

/// Builder of a URDF. Links have the inertia of solid spheres.
struct Builder {
    text: String,
}

impl Builder {
    fn link(&mut self, name: &str, mass: f64) {
        let inertia = 0.4 * mass * 0.05_f64.powi(2);
        let _ = writeln!(
            self.text,
            "<link name=\"{name}\"><inertial><mass value=\"{mass}\"/>\
             <inertia ixx=\"{inertia}\" iyy=\"{inertia}\" izz=\"{inertia}\"/></inertial></link>"
        );
    }

    /// Adds a joint and its link, with related names.
    fn joint(&mut self, name: &str, parent: &str, at: [f64; 3], axis: &str, limits: &str) {
        self.link(name, 0.3);
        let kind = if limits.is_empty() { "continuous" } else { "revolute" };
        let [x, y, z] = at;
        let _ = writeln!(
            self.text,
            "<joint name=\"{name}_joint\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{name}\"/>\
             <origin xyz=\"{x} {y} {z}\"/><axis xyz=\"{axis}\"/>\
             <limit {limits} velocity=\"10\" effort=\"30\"/></joint>"
        );
    }
}

/// URDF of four legs with three joints and a wheel, and two arms with seven joints and five fingers of four joints: 16 + 14 + 40
/// channels.
fn centaur() -> String {
    let mut urdf = Builder { text: "<robot name=\"centaur\">\n".to_owned() };
    urdf.link("trunk", 20.0);
    let (leg, arm) = ("lower=\"-2.5\" upper=\"2.5\"", "lower=\"0.2\" upper=\"1.5\"");
    for (name, x, y) in
        [("fl", 0.3, 0.15), ("fr", 0.3, -0.15), ("rl", -0.3, 0.15), ("rr", -0.3, -0.15)]
    {
        urdf.joint(&format!("{name}_hip"), "trunk", [x, y, 0.0], "1 0 0", leg);
        urdf.joint(&format!("{name}_thigh"), &format!("{name}_hip"), [0.0; 3], "0 1 0", leg);
        let knee = [0.0, 0.0, -0.25];
        urdf.joint(&format!("{name}_shank"), &format!("{name}_thigh"), knee, "0 1 0", leg);
        urdf.joint(&format!("{name}_wheel"), &format!("{name}_shank"), knee, "0 1 0", "");
    }
    for side in ["left", "right"] {
        let mut parent = "trunk".to_owned();
        for number in 1..=7 {
            let name = format!("{side}_arm_{number}");
            urdf.joint(&name, &parent, [0.05, 0.0, 0.1], ["1 0 0", "0 0 1"][number % 2], arm);
            parent = name;
        }
        for finger in 1..=5 {
            let mut parent = parent.clone();
            for number in 1..=4 {
                let name = format!("{side}_finger_{finger}_{number}");
                urdf.joint(&name, &parent, [0.1, 0.0, 0.0], "1 0 0", arm);
                parent = name;
            }
        }
    }
    urdf.text + "</robot>\n"
}

#[test]
fn the_proposed_side_file_locks_the_arms() {
    let urdf = centaur();
    let found = survey(Text { name: "centaur.urdf", text: &urdf }).unwrap();
    let warning = found.warnings.join("\n");
    for words in ["centaur.urdf:", "`left_arm_1_joint`", "and 50 more", "70 channels", "at most 64"]
    {
        assert!(warning.contains(words), "{words} is missing in {warning}");
    }
    // Close to 0 within their limits.
    assert_eq!(found.template.matches("= 0.2\n").count(), 54, "{}", found.template);
    let robot = good(&urdf, &found.template).robot;
    assert_eq!(robot.channels().count(), 16);
    let config = robot.controller_config().unwrap();
    config.check().unwrap();
    // No mass is lost: locked links are part of the trunk.
    let mass = 20.0 + 70.0 * 0.3;
    assert!((robot.total_mass_kg() - mass).abs() < 1e-9, "{}", robot.total_mass_kg());
}

#[test]
fn an_import_with_too_many_channels_says_what_to_lock() {
    let urdf = centaur();
    let found = survey(Text { name: "centaur.urdf", text: &urdf }).unwrap();
    let (before, rest) = found.template.split_once("[lock]").unwrap();
    let after = rest.split_once("\n# Angles").unwrap().1;
    let side = format!("{before}\n# Angles{after}");
    let error = imported(&urdf, &side).unwrap_err();
    let fault = error.faults().next().unwrap();
    assert_eq!(error.faults().count(), 1, "{error}");
    assert_eq!(fault.line, 2, "the body");
    assert!(fault.message.contains("70 channels: 66 joints and 4 actuated wheels"), "{fault}");
    for words in [
        "at least 6 joints under [lock]",
        "54 joints carry no foot or wheel",
        "left_arm_1_joint = 0.2",
    ] {
        assert!(fault.help.contains(words), "{words} is missing in {}", fault.help);
    }
    // Some of the arms may remain.
    let few = found.template.replace("left_arm_1_joint = 0.2\n", "");
    assert_eq!(good(&urdf, &few).robot.channels().count(), 17);
}
