//! Tests of error messages of imports: each class of fault has file, location, value and a remedy.

use super::{SIDE, URDF, edited, good, imported};

#[track_caller]
pub(super) fn refused(urdf: &str, side: &str, words: &[&str]) {
    let error = imported(urdf, side).expect_err("a mistake");
    let found: Vec<_> = error.faults().map(|fault| format!("{fault} ({})", fault.help)).collect();
    let found = format!("{}: {}", error.file_name(), found.join("\n"));
    for word in words {
        assert!(found.contains(word), "{word:?} is missing in\n{found}");
    }
}

#[track_caller]
fn urdf(from: &str, to: &str, words: &[&str]) {
    refused(&edited(URDF, from, to), SIDE, &[words, &["rover.urdf"]].concat());
}

#[track_caller]
fn side(from: &str, to: &str, words: &[&str]) {
    refused(URDF, &edited(SIDE, from, to), &[words, &["rover.side.toml"]].concat());
}

#[test]
fn numbers_that_are_none() {
    urdf(
        "xyz=\"-0.2 0.1 -0.1\"",
        "xyz=\"-0,2 0,1 -0,1\"",
        &["`left_arm`", "-0,2", "without commas"],
    );
    urdf(
        "xyz=\"-0.2 0.1 -0.1\"",
        "xyz=\"-0.2 0.1\"",
        &["`left_arm`", "-0.2 0.1", "3 finite numbers"],
    );
    urdf("mass value=\"5.0\"", "mass value=\"5kg\"", &["`trunk`", "5kg", "one finite number"]);
    urdf("mass value=\"5.0\"", "mass value=\"nan\"", &["`trunk`", "finite"]);
    urdf("mass value=\"5.0\"", "mass value=\"-5\"", &["`trunk`", "-5 kg", "0 or above"]);
    urdf("mass value=\"5.0\"", "mass value=\"5000\"", &["`base_link`", "5000.75 kg", "grams"]);
    urdf("mass value=\"5.0\"", "mass value=\"${m}\"", &["`trunk`", "xacro robot.urdf.xacro"]);
    urdf("<mass value=\"5.0\"/>", "", &["`trunk`", "no <mass>"]);
    urdf("axis xyz=\"0 2 0\"", "axis xyz=\"0 0 0\"", &["`left_knee`", "no direction"]);
    urdf("origin xyz=\"0 0.01 -0.2\"", "origin xyz=\"0 10 -200\"", &["`left_knee`", "millimetres"]);
}

#[test]
fn limits_in_degrees_that_leave_no_room() {
    let words = ["-150 and -50 rad exceed a turn", "give -2.6180 and -0.8727 rad under [joint]"];
    urdf("lower=\"-1\" upper=\"2\"", "lower=\"-150\" upper=\"-50\"", &words);
}

#[test]
fn numbers_say_their_unit_and_files_where_they_end() {
    urdf(
        "mass value=\"5.0\"",
        "mass value=\"heavy\"",
        &["`trunk`: <mass>", "one finite number in kg"],
    );
    urdf("ixx=\"0.03\"", "ixx=\"much\"", &["`trunk`: <inertia>", "`ixx`", "in kg·m²"]);
    urdf(
        "xyz=\"-0.2 0.1 -0.1\"",
        "xyz=\"a b c\"",
        &["`left_arm`: <origin>", "3 finite numbers in m"],
    );
    let limit = "velocity=\"1\" effort=\"10\"";
    urdf(limit, "velocity=\"1\" effort=\"ten\"", &["`mast`: <limit>", "`effort`", "in N·m"]);
    let cut = &URDF[..URDF.find("<joint name=\"left_hip\"").unwrap()];
    let fault = imported(cut, SIDE).unwrap_err().faults().next().unwrap().clone();
    assert_eq!(fault.line, cut.trim_end().lines().count(), "{fault}");
    assert!(fault.help.contains("</robot>"), "{}", fault.help);
}

#[test]
fn what_is_no_urdf() {
    refused("", SIDE, &["not XML"]);
    refused("<robot name=\"r\"><link name=\"a\">", SIDE, &["not XML"]);
    for root in ["sdf version=\"1.9\"", "world name=\"w\"", "model name=\"m\""] {
        refused(&format!("<{root}/>"), SIDE, &["this is SDF", "`sdf2mjcf robot.sdf robot.xml`"]);
    }
    refused("<mujoco/>", SIDE, &["has no <body>"]);
    refused("<robot name=\"r\"/>", SIDE, &["no <link>"]);
    refused("name = \"agilebot\"", SIDE, &["not XML", "<robot"]);
    urdf(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><xacro:leg side=\"left\"/>",
        &["xacro robot.urdf.xacro > robot.urdf"],
    );
}

#[test]
fn trees_that_are_none() {
    urdf(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><link name=\"head\"/>",
        &["two links `head`"],
    );
    urdf("<joint name=\"left_knee\"", "<joint name=\"left_hip\"", &["two joints `left_hip`"]);
    urdf(
        "<parent link=\"left_thigh\"/>",
        "<parent link=\"left_thing\"/>",
        &["`left_thing`", "did you mean `left_thigh`"],
    );
    urdf("<child link=\"left_shank\"/>", "", &["`left_knee`", "no <child>"]);
    urdf(
        "<child link=\"right_thigh\"/>",
        "<child link=\"left_thigh\"/>",
        &["two joints", "`left_hip` and `right_hip`", "remove one of the two joints"],
    );
    urdf(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><link name=\"spare\"/>",
        &["2 roots", "`base_link`, `spare`", "`root`"],
    );
    // A loop beside the tree, and a file that is one loop.
    urdf(
        "<link name=\"base_link\"/>",
        "<link name=\"base_link\"/><link name=\"a\"/><link name=\"b\"/>
         <joint name=\"ab\" type=\"fixed\"><parent link=\"a\"/><child link=\"b\"/></joint>
         <joint name=\"ba\" type=\"fixed\"><parent link=\"b\"/><child link=\"a\"/></joint>",
        &["`a`", "loop"],
    );
    let ring = "<robot name=\"r\"><link name=\"a\"/><joint name=\"j\" type=\"fixed\"><parent link=\"a\"/><child link=\"a\"/></joint></robot>";
    refused(ring, SIDE, &["`a`", "loop"]);
    urdf("<link name=\"head\">", "<link>", &["link", "`name` is missing"]);
    urdf("type=\"prismatic\"", "type=\"slider\"", &["`mast`", "slider", "prismatic"]);
}

#[test]
fn joints_that_robot_files_do_not_have() {
    let behind = edited(SIDE, "wheel_joint = \"left_axle\"", "wheel_joint = \"left_arm\"");
    refused(URDF, &behind, &["rover.urdf", "`left_axle` moves a link that is part of a wheel"]);
}

/// Locks outside the limits of their joints are errors at the line of the side file, with the probable unit.
#[test]
fn locks_outside_the_limits_of_their_joint() {
    let help = "give a position from 0.0 to 0.3 m, or correct the limits in the model";
    for (given, slip) in [("300", "; 300 mm would be 0.3 m"), ("5.0", "; 5 mm would be 0.005 m")] {
        let file = edited(SIDE, "mast = 0.15", &format!("mast = {given}"));
        let error = imported(URDF, &file).unwrap_err();
        let faults: Vec<_> = error.faults().collect();
        let [fault] = &faults[..] else { panic!("{faults:?}") };
        let number: f64 = given.parse().unwrap();
        let message = format!("[lock]: joint `mast` is locked at {number} m, outside its limits");
        assert_eq!((error.file_name(), &fault.message), ("rover.side.toml", &message));
        let line = file.lines().position(|line| line.starts_with("mast")).unwrap();
        assert_eq!((fault.line, &fault.help), (1 + line, &format!("{help}{slip}")));
    }
    let wild = "nod = 0.3\nleft_hip = 60";
    side(
        "nod = 0.3",
        wild,
        &[
            "`left_hip` is locked at 60 rad",
            "from -1.0 to 2.0 rad",
            "; 60 degrees would be 1.0472 rad",
        ],
    );
    // Rounded limits, and limits that the exporter left blank.
    for (model, position) in [("upper=\"0.3\"", "0.3005"), ("upper=\"0\"", "0.15")] {
        let model = edited(URDF, "upper=\"0.3\"", model);
        good(&model, &edited(SIDE, "mast = 0.15", &format!("mast = {position}")));
    }
}

#[test]
fn joints_that_cannot_move_or_follow() {
    let unlocked = edited(SIDE, "nod = 0.3", "");
    refused(URDF, &unlocked, &["rover.urdf", "`nod` follows joint `left_arm`", "[lock] nod = 0.0"]);
    let law = edited(URDF, "multiplier=\"-1\"", "multiplier=\"-2\" offset=\"0.4\"");
    refused(&law, &unlocked, &["-2.0 times its position plus 0.4", "[lock] nod = 0.4"]);
    for kind in ["planar", "floating"] {
        let other = edited(URDF, "type=\"prismatic\"", &format!("type=\"{kind}\""));
        refused(&other, SIDE, &["`mast` cannot be locked at 0.15"]);
        let unlocked = edited(SIDE, "mast = 0.15", "");
        refused(&other, &unlocked, &["`mast` is", kind, "[lock] mast = 0.0"]);
    }
    urdf(
        "lower=\"-1\" upper=\"2\"",
        "lower=\"0\" upper=\"0\"",
        &["`left_hip` cannot move", "[lock] left_hip = 0.0"],
    );
}

#[test]
fn side_files_that_do_not_fit() {
    side(
        "link = \"left_foot\"",
        "link = \"left_feet\"",
        &["front_left", "`left_feet`", "did you mean `left_foot`"],
    );
    side("mast = 0.15", "mats = 0.15", &["`mats` does not exist", "did you mean `mast`"]);
    side("mast = 0.15", "mast = 0.15\nbase_to_trunk = 0.0", &["`base_to_trunk` is already fixed"]);
    side("left_arm = {", "left_am = {", &["`left_am` does not exist", "did you mean `left_arm`"]);
    side("left_arm = {", "left_axle = {", &["`left_axle` is the axle of a wheel"]);
    side("nod = 0.3", "nod = 0.3\nleft_arm = 0.0", &["`left_arm` is locked"]);
    side(
        "wheel_joint = \"left_axle\"",
        "wheel_joint = \"left_ankle\"",
        &["`left_ankle` does not turn"],
    );
    side("wheel_joint = \"left_axle\"", "wheel_joint = \"right_axle\"", &["another end effector"]);
    side(
        "wheel_joint = \"left_axle\"",
        "link = \"left_arm_link\"",
        &["rear_left", "`axis_in_link` is missing"],
    );
    side("actuator = \"drive\"", "actuator = \"drvie\"", &["`drvie`", "did you mean `drive`"]);
    side(
        "nominal_rad = 0.7",
        "nominal_rad = 40.0",
        &["`left_hip`", "`nominal_rad` is 40", "degrees"],
    );
    // The marker is at the value in the side file.
    let wrong = SIDE.replacen("radius_m = 0.025", "radius_m = 20", 2);
    let error = imported(URDF, &wrong).unwrap_err();
    let lines: Vec<_> = wrong.lines().collect();
    let marked: Vec<_> = error.faults().map(|fault| lines[fault.line - 1]).collect();
    assert_eq!(marked, ["radius_m = 20", "radius_m = 20"]);
    side("nominal_rad = 0.7", "nominal_rad = -1.5", &["`left_hip`", "within the limits"]);
    side("bus = 3, id = 9", "bus = 4, id = 9", &["`bus` must be a whole number from 0 to 3"]);
    side("bus = 3, id = 9", "bus = 3", &["`id` is missing"]);
    side("armature_kg_m2 = 0.01", "armature_kg_m2 = 0.0", &["`armature_kg_m2` is 0"]);
    side("rolling_resistance = 0.02", "", &["`rolling_resistance` is missing"]);
    side("nod = 0.3", "nod = 0.3\n[locks]", &["unknown key `locks`", "did you mean `lock`"]);
    refused(URDF, &format!("forward = \"+z\"\n{SIDE}"), &["`forward` is along `up`"]);
    let words = ["`up` is along `forward`, which is +x by default"];
    refused(URDF, &format!("up = \"-x\"\n{SIDE}"), &words);
    refused(URDF, &format!("forward = \"x\"\n{SIDE}"), &["cannot be \"x\"", "`+x`"]);
    refused(
        URDF,
        &format!("root = \"trunc\"\n{SIDE}"),
        &["no link `trunc`", "did you mean `trunk`"],
    );
    let feetless = SIDE.split("[[end_effector]]").next().unwrap();
    refused(
        URDF,
        &edited(feetless, "mast = 0.15", "mast = 0.15\nleft_axle = 0.0"),
        &["at least one foot or wheel"],
    );
}
