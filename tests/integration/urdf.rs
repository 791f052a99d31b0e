//! Tests of the path from a URDF to a plan: inspect it, write a side file, import, check, plan.

use crate::desk;
use std::fmt::Write;

/// Returns the URDF of a small quadruped with hip roll, hip pitch and knee in each leg.
fn quadruped() -> String {
    let inertial = |mass: f64, z: f64, i: f64| {
        format!(
            "<inertial><origin xyz=\"0 0 {z}\"/><mass value=\"{mass}\"/>\
             <inertia ixx=\"{i}\" ixy=\"0\" ixz=\"0\" iyy=\"{i}\" iyz=\"0\" izz=\"{i}\"/></inertial>"
        )
    };
    let mut urdf = format!(
        "<robot name=\"quad\">\n<link name=\"trunk\">{}</link>\n",
        inertial(4.0, 0.0, 0.05)
    );
    for (leg, x, y) in [("LF", 0.2, 0.1), ("RF", 0.2, -0.1), ("LH", -0.2, 0.1), ("RH", -0.2, -0.1)]
    {
        let joints = [
            ("HAA", "trunk".to_owned(), format!("{x} {y} 0"), "1 0 0", "-0.8", "0.8"),
            ("HFE", format!("{leg}_hip"), "0 0 0".to_owned(), "0 1 0", "-1", "3"),
            ("KFE", format!("{leg}_thigh"), "0 0 -0.2".to_owned(), "0 1 0", "-2.6", "-0.5"),
        ];
        for ((joint, parent, at, axis, min, max), child) in
            joints.iter().zip(["hip", "thigh", "shank"])
        {
            let _ = writeln!(
                urdf,
                "<link name=\"{leg}_{child}\">{}</link>\n<joint name=\"{leg}_{joint}\" type=\"revolute\">\
                 <parent link=\"{parent}\"/><child link=\"{leg}_{child}\"/><origin xyz=\"{at}\"/><axis xyz=\"{axis}\"/>\
                 <limit lower=\"{min}\" upper=\"{max}\" velocity=\"15\" effort=\"20\"/></joint>",
                inertial(0.3, -0.05, 0.001)
            );
        }
        let _ = writeln!(
            urdf,
            "<link name=\"{leg}_foot\"><collision><geometry><sphere radius=\"0.02\"/></geometry></collision></link>\n\
             <joint name=\"{leg}_ankle\" type=\"fixed\"><parent link=\"{leg}_shank\"/><child link=\"{leg}_foot\"/>\
             <origin xyz=\"0 0 -0.2\"/></joint>"
        );
    }
    urdf + "</robot>\n"
}

#[test]
fn a_urdf_becomes_a_robot_that_trots() {
    let desk = desk();
    desk.write("quad.urdf", quadruped());
    let shown = desk.run(&["robot", "import", "quad.urdf"]).succeeds();
    assert!(
        shown.contains("front_left") && shown.contains("standing height of `trunk`: 0.340 m"),
        "{shown}"
    );
    desk.run(&["robot", "import", "quad.urdf", "--template", "side.toml"]).succeeds();
    let side = desk.read("side.toml");
    // Values that a user may have entered stay.
    desk.run(&["robot", "import", "quad.urdf", "--template", "side.toml"])
        .fails(1, &["side.toml exists already", "another name"]);
    assert_eq!(desk.read("side.toml"), side);
    let made = desk.run(&[
        "robot",
        "import",
        "quad.urdf",
        "--with",
        "side.toml",
        "-o",
        "quad.toml",
        "--json",
    ]);
    let made = made.succeeds();
    assert!(made.contains("quad.toml") && made.contains("\"warnings\": []"), "{made}");
    // Gains of the import raise no warning of the check, which has only that of the absent shapes.
    let checked = desk.run(&["robot", "check", "quad.toml"]);
    assert_eq!(checked.code, 0, "{}", checked.stderr);
    assert!(!checked.stderr.contains("_nm_"), "{}", checked.stderr);
    let help = ["side.toml is a side file, not a robot file", "`rollwalk robot import --with`"];
    desk.run(&["robot", "check", "side.toml"]).fails(1, &help);
    desk.run(&["robot", "draw", "side.toml", "-o", "side.svg"]).fails(1, &help);
    // The import replaces its own output, but no edited file.
    let again = ["robot", "import", "quad.urdf", "--with", "side.toml", "-o", "quad.toml"];
    let text = desk.read_text("quad.toml");
    desk.run(&again).succeeds();
    desk.write("quad.toml", format!("{text}# mine\n"));
    let refusal = ["quad.toml exists already, and is not the unchanged output", "another name"];
    desk.run(&again).fails(1, &refusal);
    assert_eq!(desk.read_text("quad.toml"), format!("{text}# mine\n"));
    desk.write(
        "trot.toml",
        "name = \"trot\"\nrobot = \"quad.toml\"\nduration_s = 0.6\nends = \"periodic\"\nswing_height_m = 0.04\n\
         [goal]\nforward_m = 0.15\nleft_m = 0.0\nturn_rad = 0.0\n[footfalls]\ngait = \"trot\"\nduty = 0.6\n",
    );
    // Exit code 0 means a consistent plan.
    desk.run(&["plan", "trot.toml", "-o", "trot.json", "--no-simulation"]).succeeds();
}

#[test]
fn a_bad_urdf_or_side_file_writes_nothing() {
    let desk = desk();
    desk.write("quad.urdf", quadruped());
    desk.run(&["robot", "import", "quad.urdf", "--template", "side.toml"]).succeeds();
    let import = ["robot", "import", "quad.urdf", "--with", "side.toml", "-o", "quad.toml"];
    desk.edit("side.toml", "LF_foot", "LF_feet");
    desk.run(&import).fails(1, &["side.toml:", "`LF_feet`", "did you mean `LF_foot`"]);
    desk.edit("side.toml", "LF_feet", "LF_foot");
    desk.edit("quad.urdf", "mass value=\"4\"", "mass value=\"4,0\"");
    desk.run(&import).fails(1, &["quad.urdf:2", "link `trunk`", "\"4,0\"", "without commas"]);
    desk.write("quad.urdf", b"<robot name=\"\xff\"/>");
    desk.run(&import).fails(1, &["quad.urdf", "not UTF-8"]);
    desk.run(&["robot", "import", "qaud.urdf"]).fails(1, &["no URDF or MJCF file", "quad.urdf"]);
    desk.write("quad.urdf", quadruped());
    desk.run(&["robot", "import", "quad.urdf", "--with", "side.toml"]).fails(2, &["--output"]);
    assert!(!desk.path("quad.toml").exists());
}

#[test]
fn a_template_takes_given_axes() {
    let desk = desk();
    desk.write("quad.urdf", quadruped());
    desk.write("axes.toml", "forward = \"-x\"\n");
    let template = ["robot", "import", "quad.urdf", "--with", "axes.toml", "--template", "t.toml"];
    let shown = desk.run(&template).succeeds();
    assert!(shown.contains("root `trunk` with -x forward and +z up"), "{shown}");
    assert!(desk.read_text("t.toml").contains("\nforward = \"-x\""));
    desk.run(&["robot", "import", "quad.urdf", "--with", "t.toml", "-o", "quad.toml"]).succeeds();
    // A side file alone, without an output, has no use.
    desk.run(&["robot", "import", "quad.urdf", "--with", "t.toml"]).fails(2, &["--template"]);
}

/// Plan, export and simulation name the same shape in the ground.
#[test]
fn a_shape_in_the_ground_is_named_by_every_command() {
    let desk = desk();
    desk.write("quad.urdf", quadruped());
    desk.run(&["robot", "import", "quad.urdf", "--template", "t.toml"]).succeeds();
    desk.run(&["robot", "import", "quad.urdf", "--with", "t.toml", "-o", "quad.toml"]).succeeds();
    let shape =
        "shapes = [{ from_m = [0.0, 0.0, -0.1], to_m = [0.0, 0.0, -0.26], radius_m = 0.01 }]";
    desk.edit(
        "quad.toml",
        "name = \"LF_shank\"\nmass_kg",
        &format!("name = \"LF_shank\"\n{shape}\nmass_kg"),
    );
    desk.write(
        "stand.toml",
        "name = \"stand\"\nrobot = \"quad.toml\"\nduration_s = 1.0\nends = \"at_rest\"\n[footfalls]\nall = \"stance\"\n",
    );
    let words = "shape 0 of link `LF_shank` is";
    for command in [
        &["robot", "check", "quad.toml"][..],
        &["robot", "export", "quad.toml", "-o", "quad.xml"],
        &["plan", "stand.toml", "-o", "stand.json", "--no-simulation"],
        &["simulate", "stand.json"],
    ] {
        let outcome = desk.run(command);
        let shown = outcome.stdout + &outcome.stderr;
        assert!(shown.contains(words), "{command:?}: {shown}");
    }
}
