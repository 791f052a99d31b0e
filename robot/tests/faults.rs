//! Every class of mistake in a robot file gets an error that shows line, field, value and what would
//! be right.

use proptest::prelude::*;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_robot::{Contact, Place, Robot, RollingDrag};

/// A small robot to break: a body, one arm with a driven wheel, one limb with a foot.
const ROBOT: &str = r#"name = "tiny"

[actuator.servo]
model = "S1"
speed_max_rad_s = 5.0
torque_max_nm = 2.0
kp_nm_rad = 50.0
kd_nm_s_rad = 1.0
armature_kg_m2 = 0.005

[[link]]
name = "body"
mass_kg = 1.0
com_in_link_m = [0.0, 0.0, 0.0]
inertia_in_link_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]

[[link]]
name = "arm"
parts = [
  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.1], box_m = [0.02, 0.02, 0.2] },
  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.2], cylinder_y_m = [0.03, 0.02] },
]

[[joint]]
name = "shoulder"
parent = "body"
child = "arm"
origin_in_parent_m = [0.1, 0.0, 0.0]
origin_rpy_rad = [0.0, 0.1, 0.0]
axis_in_joint = [0.0, 2.0, 0.0]
position_min_rad = -1.0
position_max_rad = 1.0
nominal_rad = 0.0
actuator = "servo"
bus = 0
id = 1

[[end_effector]]
name = "wheel"
link = "arm"
center_in_link_m = [0.0, 0.0, -0.2]
radius_m = 0.03
friction_coefficient = 0.8
contact = "actuated_wheel"
axis_in_link = [0.0, 1.0, 0.0]
actuator = "servo"
bus = 0
id = 2

[[template.leg.link]]
name = "*_shank"
parts = [{ mass_kg = 0.1, at_m = [0.0, 0.01, -0.1], box_m = [0.02, 0.02, 0.2] }]

[[template.leg.joint]]
name = "*_hip"
parent = "mount"
child = "*_shank"
origin_in_parent_m = [0.0, 0.02, 0.0]
axis_in_joint = [1.0, 0.0, 0.0]
position_min_rad = -0.5
position_max_rad = 0.5
nominal_rad = 0.1
actuator = "servo"

[[template.leg.end_effector]]
name = "*"
link = "*_shank"
center_in_link_m = [0.0, 0.01, -0.2]
radius_m = 0.01
friction_coefficient = 0.8
contact = "point_foot"

[[limb]]
name = "left"
template = "leg"
parent = "body"
origin_in_parent_m = [-0.1, 0.1, 0.0]
side = "left"
bus = 1
first_id = 1

[[limb]]
name = "right"
template = "leg"
parent = "body"
origin_in_parent_m = [-0.1, -0.1, 0.0]
side = "right"
bus = 1
first_id = 2
"#;

fn tiny() -> Robot {
    Robot::from_toml("tiny.toml", ROBOT).unwrap()
}

/// Line, message and help of every fault after replacing `from`.
fn faults(from: &str, to: &str) -> Vec<(usize, String, String)> {
    assert!(ROBOT.contains(from), "the robot to break has changed: {from}");
    let text = ROBOT.replacen(from, to, 1);
    let error = Robot::from_toml("tiny.toml", &text).expect_err("the robot is broken");
    error.faults().map(|fault| (fault.line, fault.message.clone(), fault.help.clone())).collect()
}

/// Breaking the robot gives exactly one fault, at the line where `at` starts, with these words.
#[track_caller]
fn assert_fault(from: &str, to: &str, at: &str, message: &str, help: &str) {
    let text = ROBOT.replacen(from, to, 1);
    let line = 1 + text.lines().position(|line| line.starts_with(at)).expect("line is there");
    let found = faults(from, to);
    assert_eq!(found.len(), 1, "{found:#?}");
    assert_eq!(found[0].0, line, "{found:#?}");
    assert!(found[0].1.contains(message), "{:?} lacks {message:?}", found[0].1);
    assert!(found[0].2.contains(help), "{:?} lacks {help:?}", found[0].2);
}

#[test]
fn the_tiny_robot_is_valid_and_its_right_limb_is_mirrored() {
    let robot = tiny();
    let names: Vec<_> = robot.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["shoulder", "left_hip", "right_hip"]);
    // Axes of any length become unit vectors.
    assert_eq!(robot.joints[0].axis_in_joint.y, 1.0);
    let (left, right) = (&robot.joints[1], &robot.joints[2]);
    assert_eq!(left.parent_from_joint.translation.y, 0.1 + 0.02);
    assert_eq!(right.parent_from_joint.translation.y, -0.1 - 0.02);
    // Rolling the left leg outward is a turn about +x, the right leg's about −x.
    assert_eq!((left.axis_in_joint.x, right.axis_in_joint.x), (1.0, -1.0));
    assert_eq!(robot.end_effectors[2].center_in_link_m.y, -0.01);
    assert_eq!((right.actuator.bus, right.actuator.id), (1, 2));
}

#[test]
fn a_report_shows_file_line_field_value_and_help() {
    let text = ROBOT.replacen("position_max_rad = 1.0", "position_max_rad = 90.0", 1);
    let text = text.replacen("mass_kg = 1.0", "mass_kg = -1.0", 1);
    let error = Robot::from_toml("robots/tiny.toml", &text).unwrap_err();
    assert_eq!(
        error.to_string(),
        "robots/tiny.toml:13: link `body`: `mass_kg` is -1 kg (and 1 more fault)"
    );
    let theme = miette::GraphicalTheme::unicode_nocolor();
    let handler = miette::GraphicalReportHandler::new_themed(theme).with_width(100);
    let mut report = String::new();
    handler.render_report(&mut report, &error).unwrap();
    for shown in [
        "[robots/tiny.toml:13:11]",
        "mass_kg = -1.0",
        "allowed is above 0 to 1000 kg",
        "[robots/tiny.toml:32:20]",
        "position_max_rad = 90.0",
        "joint `shoulder`: `position_max_rad` is 90 rad",
        "allowed is within ±2π; 90 degrees would be 1.5708 rad",
    ] {
        assert!(report.contains(shown), "lacks {shown:?}:\n{report}");
    }
}

#[test]
fn text_that_is_not_toml() {
    let found = faults("mass_kg = 1.0", "mass_kg = ");
    assert_eq!(found[0].0, 13, "{found:#?}");
    assert!(found[0].1.contains("not TOML"), "{found:#?}");
    let found = faults("mass_kg = 1.0", "mass_kg = 1.0\nmass_kg = 2.0");
    assert_eq!(found[0].0, 14, "{found:#?}");
}

#[test]
fn unknown_keys_and_tables() {
    assert_fault(
        "bus = 0\nid = 2",
        "bus = 0\nid = 2\nradus_m = 1",
        "radus_m",
        "end effector `wheel`: unknown key `radus_m`",
        "did you mean `radius_m`?",
    );
    assert_fault(
        "[[end_effector]]",
        "[colour]\nred = 1\n[[end_effector]]",
        "[colour]",
        "unknown key `colour`",
        "`limb`",
    );
    assert_fault(
        "kp_nm_rad = 50.0",
        "kp_nm_rad = 50.0\nki = 1",
        "ki",
        "actuator `servo`: unknown key `ki`",
        "known are: `model`",
    );
    assert_fault(
        "box_m = [0.02, 0.02, 0.2] },\n",
        "box_m = [0.02, 0.02, 0.2], colour = 1 },\n",
        "  { mass_kg = 0.1",
        "unknown key `colour`",
        "known are: `mass_kg`",
    );
    // Limbs give the addresses of their motors, the template must not.
    assert_fault(
        "nominal_rad = 0.1",
        "nominal_rad = 0.1\nid = 3",
        "id = 3",
        "joint `*_hip`: unknown key `id`",
        "`actuator`",
    );
}

#[test]
fn missing_fields() {
    assert_fault(
        "radius_m = 0.03\n",
        "",
        "[[end_effector]]",
        "end effector `wheel`: `radius_m` is missing",
        "give `radius_m`, a number",
    );
    assert_fault("name = \"tiny\"\n", "", "", "`name` is missing", "a string in quotes");
    assert_fault(
        "model = \"S1\"\n",
        "",
        "[actuator.servo]",
        "actuator `servo`: `model` is missing",
        "give `model`",
    );
    assert_fault(
        "mass_kg = 1.0\ncom_in_link_m = [0.0, 0.0, 0.0]\ninertia_in_link_kg_m2 = [0.01, 0.02, 0.02, 0.0, 0.0, 0.0]\n",
        "",
        "[[link]]",
        "link `body`: `parts` is missing",
        "`inertia_in_link_kg_m2`",
    );
    assert_fault(
        ", box_m = [0.02, 0.02, 0.2] },\n",
        " },\n",
        "  { mass_kg = 0.1",
        "`shape` must be given once",
        "one of `box_m = [x, y, z]`",
    );
    assert_fault(
        "side = \"left\"\n",
        "",
        "[[limb]]",
        "limb `left`: `side` is missing",
        "give `side`",
    );
}

#[test]
fn all_mistakes_are_found_at_once_and_none_in_their_train() {
    let text = ROBOT
        .replacen("name = \"arm\"", "nam = \"arm\"", 1)
        .replacen("kp_nm_rad = 50.0", "kp_nm_rad = \"50\"", 1)
        .replacen("link = \"arm\"", "link = \"amr\"", 1)
        .replacen("template = \"leg\"", "template = \"lag\"", 2)
        .replacen("nominal_rad = 0.1", "nominal_rad = nan", 1);
    let error = Robot::from_toml("tiny.toml", &text).unwrap_err();
    let found: Vec<_> = error.faults().map(|fault| fault.message.as_str()).collect();
    // Whether a name is known is a question once all items have theirs; the template has no limb left.
    assert_eq!(
        found,
        [
            "actuator `servo`: `kp_nm_rad` must be a finite number",
            "link number 2: `name` is missing",
            "link number 2: unknown key `nam`",
            "joint `*_hip`: `nominal_rad` must be a finite number",
        ]
    );
}

#[test]
fn wrong_types() {
    assert_fault(
        "mass_kg = 1.0",
        "mass_kg = \"1.0\"",
        "mass_kg",
        "link `body`: `mass_kg` must be a finite number",
        "a finite number",
    );
    assert_fault(
        "axis_in_joint = [0.0, 2.0, 0.0]",
        "axis_in_joint = [0.0, 1.0]",
        "axis_in_joint",
        "must be an array of 3 finite numbers",
        "an array of 3",
    );
    assert_fault(
        "id = 1\n",
        "id = 1.5\n",
        "id",
        "`id` must be a whole number from 0 to 255",
        "0 to 255",
    );
    assert_fault(
        "contact = \"actuated_wheel\"",
        "contact = \"actuatedwheel\"",
        "contact",
        "`contact` cannot be \"actuatedwheel\"",
        "did you mean `actuated_wheel`?",
    );
    assert_fault(
        "side = \"left\"",
        "side = \"front\"",
        "side",
        "`side` cannot be \"front\"",
        "known are: `left`, `right`",
    );
    assert_fault(
        "[actuator.servo]",
        "[actuator]\nspare = 3\n[actuator.servo]",
        "spare",
        "`actuator` must be tables, written [actuator.NAME]",
        "expected is",
    );
}

#[test]
fn numbers_that_are_not_finite() {
    assert_fault("mass_kg = 1.0", "mass_kg = nan", "mass_kg", "must be a finite number", "finite");
    assert_fault(
        "nominal_rad = 0.0",
        "nominal_rad = -inf",
        "nominal_rad",
        "must be a finite number",
        "finite",
    );
    assert_fault(
        "com_in_link_m = [0.0, 0.0, 0.0]",
        "com_in_link_m = [0.0, nan, 0.0]",
        "com_in_link_m",
        "3 finite numbers",
        "finite",
    );
    assert_fault(
        "torque_max_nm = 2.0",
        "torque_max_nm = 1e999",
        "torque_max_nm",
        "finite number",
        "finite",
    );
}

#[test]
fn masses_and_inertias_that_no_body_has() {
    assert_fault(
        "mass_kg = 1.0",
        "mass_kg = 0.0",
        "mass_kg",
        "`mass_kg` is 0 kg",
        "above 0 to 1000 kg",
    );
    assert_fault(
        "mass_kg = 1.0",
        "mass_kg = 1500.0",
        "mass_kg",
        "`mass_kg` is 1500 kg",
        "grams need dividing by 1000",
    );
    let inertia = "[0.01, 0.02, 0.02, 0.0, 0.0, 0.0]";
    let at = "inertia_in_link_kg_m2";
    assert_fault(
        inertia,
        "[0.01, 0.02, 0.04, 0.0, 0.0, 0.0]",
        at,
        "breaks the triangle inequality",
        "1.000e-2, 2.000e-2, 4.000e-2",
    );
    assert_fault(
        inertia,
        "[0.01, 0.02, 0.02, 0.03, 0.0, 0.0]",
        at,
        "is not positive definite",
        "enlarge the diagonal",
    );
    assert_fault(
        "mass_kg = 0.1, at_m = [0.0, 0.0, -0.1]",
        "mass_kg = -0.1, at_m = [0.0, 0.0, -0.1]",
        "  { mass_kg = -0.1",
        "`mass_kg` is -0.1",
        "0.000001 to 1000 kg",
    );
    assert_fault(
        "cylinder_y_m = [0.03, 0.02]",
        "cylinder_y_m = [30, 20]",
        "  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.2]",
        "`cylinder_y_m` has no sensible size",
        "millimetres",
    );
}

#[test]
fn joints_that_cannot_be() {
    assert_fault(
        "position_max_rad = 1.0",
        "position_max_rad = -1.0",
        "position_max_rad",
        "joint `shoulder`: `position_max_rad` is -1 rad",
        "above `position_min_rad` (-1 rad)",
    );
    assert_fault(
        "nominal_rad = 0.0",
        "nominal_rad = 1.1",
        "nominal_rad",
        "`nominal_rad` is 1.1 rad",
        "within the limits, -1 to 1 rad",
    );
    assert_fault(
        "axis_in_joint = [0.0, 2.0, 0.0]",
        "axis_in_joint = [0.0, 0.0, 0.0]",
        "axis_in_joint",
        "`axis_in_joint` is zero",
        "such as [0, 1, 0]",
    );
    assert_fault(
        "origin_rpy_rad = [0.0, 0.1, 0.0]",
        "origin_rpy_rad = [0, 90, 0]",
        "origin_rpy_rad",
        "an angle above 2π",
        "90 degrees are 1.5708",
    );
    assert_fault(
        "origin_in_parent_m = [0.1, 0.0, 0.0]",
        "origin_in_parent_m = [100, 0.0, 0.0]",
        "origin_in_parent_m",
        "is [100, 0, 0]",
        "millimetres need dividing by 1000",
    );
}

#[test]
fn trees_that_are_not_trees() {
    let joint = |name: &str, parent: &str, child: &str, id: u8| {
        format!(
            "[[joint]]\nname = \"{name}\"\nparent = \"{parent}\"\nchild = \"{child}\"\n\
             origin_in_parent_m = [0, 0, 0]\naxis_in_joint = [0, 0, 1]\nposition_min_rad = -1\n\
             position_max_rad = 1\nnominal_rad = 0\nactuator = \"servo\"\nbus = 2\nid = {id}\n\n"
        )
    };
    let link = "[[link]]\nname = \"hand\"\nparts = [{ mass_kg = 0.1, at_m = [0, 0, 0], box_m = [1, 1, 1] }]\n\n";
    let with = |joints: String| {
        faults(
            "[[joint]]\nname = \"shoulder\"",
            &format!("{link}{joints}[[joint]]\nname = \"shoulder\""),
        )
    };
    let messages = |found: Vec<(usize, String, String)>| -> Vec<String> {
        found.into_iter().map(|(line, message, _)| format!("{line}: {message}")).collect()
    };

    // A joint before the one that carries its parent.
    let found = with(joint("wrist", "arm", "hand", 1));
    assert!(found[0].2.contains("move the joint that carries `arm` up"), "{found:#?}");
    assert_eq!(messages(found), ["30: joint `wrist`: `parent` `arm` is not yet part of the tree"]);
    // Two joints that hang on each other's links.
    let two = link.replace("hand", "finger")
        + &joint("a", "hand", "finger", 1)
        + &joint("b", "finger", "hand", 2);
    assert_eq!(messages(with(two)), ["34: joint `a`: `parent` `hand` is not yet part of the tree"]);
    assert_eq!(messages(with(String::new())), ["25: link `hand`: `name` is the child of 0 joints"]);
    assert_eq!(
        messages(with(joint("wrist", "body", "hand", 1) + &joint("again", "arm", "hand", 2))),
        [
            "25: link `hand`: `name` is the child of 2 joints",
            "43: joint `again`: `parent` `arm` is not yet part of the tree"
        ]
    );
    assert_eq!(
        messages(faults("child = \"arm\"", "child = \"body\"")),
        [
            "18: link `arm`: `name` is the child of 0 joints",
            "27: joint `shoulder`: `child` is the root link"
        ]
    );
}

#[test]
fn names_that_are_unknown_or_taken() {
    assert_fault(
        "child = \"arm\"",
        "child = \"amr\"",
        "child",
        "joint `shoulder`: there is no link `amr`",
        "did you mean `arm`? known are: `body`, `arm`, `left_shank`, `right_shank`",
    );
    assert_fault(
        "actuator = \"servo\"\nbus = 0\nid = 1",
        "actuator = \"motor\"\nbus = 0\nid = 1",
        "actuator = \"motor\"",
        "there is no actuator `motor`",
        "known are: `servo`",
    );
    assert_fault(
        "template = \"leg\"",
        "template = \"lag\"",
        "template = ",
        "limb `left`: there is no template `lag`",
        "did you mean `leg`?",
    );
    assert_fault(
        "name = \"wheel\"",
        "name = \"left\"",
        "name = \"*\"",
        "end effector `left`: `name` is used twice",
        "its own name",
    );
    assert_fault(
        "name = \"tiny\"",
        "name = \"tiny robot\"",
        "name = \"tiny robot\"",
        "cannot be \"tiny robot\"",
        "letters, digits",
    );
    // The same limb name makes the same names for all of its parts.
    let found = faults("name = \"right\"", "name = \"left\"");
    assert!(
        found.iter().all(
            |(_, message, _)| message.contains("is used twice") || message.contains("child of")
        ),
        "{found:#?}"
    );
}

#[test]
fn addresses_are_given_once() {
    let wheel = faults("bus = 0\nid = 2", "bus = 0\nid = 1");
    assert_eq!(wheel.len(), 1, "{wheel:#?}");
    assert_eq!(wheel[0].0, 48);
    assert_eq!(wheel[0].1, "end effector `wheel`: `id` is 1 on bus 0 a second time");
    assert!(wheel[0].2.starts_with("joint `shoulder` has that address"), "{wheel:#?}");
    // Limbs count their motors from `first_id`: the fault is there, not in the template.
    let limb = faults("first_id = 2", "first_id = 1");
    assert_eq!(limb.len(), 1, "{limb:#?}");
    assert_eq!(limb[0].0, 89);
    assert_eq!(limb[0].1, "joint `right_hip`: `id` is 1 on bus 1 a second time");
}

#[test]
fn more_motors_than_a_controller_has() {
    let limbs: String = (0..MAX_CHANNELS)
        .map(|n| {
            format!(
                "[[limb]]\nname = \"l{n}\"\ntemplate = \"leg\"\nparent = \"body\"\n\
                 origin_in_parent_m = [0, 0, 0]\nside = \"left\"\nbus = 3\nfirst_id = {}\n\n",
                n + 1
            )
        })
        .collect();
    let found = faults("[[limb]]", &format!("{limbs}[[limb]]"));
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].1.contains("and driven wheels number 28"), "{found:#?}");
    assert!(found[0].2.contains("at most 24"), "{found:#?}");
}

/// The same rules hold for a robot that did not come from a file, with places instead of spans.
#[test]
fn robots_without_a_file_are_judged_by_the_same_rules() {
    let robot = tiny();
    robot.validate().unwrap();
    type Breaks = fn(&mut Robot);
    let broken: [(Breaks, Place, &str); 13] = [
        (|r| r.links[0].mass_kg = f64::NAN, Place::Link(0), "mass_kg"),
        (
            |r| r.links[0].inertia_in_link_kg_m2[(0, 1)] = 1e-3,
            Place::Link(0),
            "inertia_in_link_kg_m2",
        ),
        (|r| r.links[0].com_in_link_m.x = f64::INFINITY, Place::Link(0), "com_in_link_m"),
        (|r| r.joints[0].position_min_rad = f64::NAN, Place::Joint(0), "position_min_rad"),
        (|r| r.joints[0].axis_in_joint.y = 2.0, Place::Joint(0), "axis_in_joint"),
        (|r| r.joints[1].parent = 9, Place::Joint(1), "parent"),
        (|r| r.joints[0].actuator.kd_nm_s_rad = -1.0, Place::Joint(0), "kd_nm_s_rad"),
        (|r| r.joints[0].actuator.model.clear(), Place::Joint(0), "model"),
        (|r| r.joints[2].actuator.id = 1, Place::Joint(2), "id"),
        (|r| r.end_effectors[0].link = 4, Place::EndEffector(0), "link"),
        (|r| r.end_effectors[1].radius_m = 0.0, Place::EndEffector(1), "radius_m"),
        (|r| r.end_effectors.clear(), Place::Robot, "end_effector"),
        (
            |r| {
                let axis_in_link = nalgebra::Vector3::zeros();
                let drag = RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m: 0.0 };
                r.end_effectors[1].contact = Contact::PassiveWheel { axis_in_link, drag }
            },
            Place::EndEffector(1),
            "axis_in_link",
        ),
    ];
    for (break_it, place, field) in broken {
        let mut robot = robot.clone();
        break_it(&mut robot);
        let error = robot.validate().expect_err(field);
        let found = error.violations.iter().any(|v| v.place == place && v.field == field);
        assert!(found, "{field}: {error}");
        assert!(error.to_string().starts_with("robot `tiny` is not valid"), "{error}");
        assert!(robot.controller_config().is_err(), "{field}");
    }
}

proptest! {
    /// Whatever bytes a file has, reading it ends with a robot or with faults inside the text.
    #[test]
    fn damaged_files_never_panic(at in 0..ROBOT.len(), cut in 0..40usize, put in ".{0,12}") {
        let end = (at + cut).min(ROBOT.len());
        let text = format!("{}{put}{}", &ROBOT[..at], &ROBOT[end..]);
        if let Err(error) = Robot::from_toml("tiny.toml", &text) {
            for fault in error.faults() {
                prop_assert!(fault.span.end <= text.len());
                prop_assert!(fault.line <= 1 + text.lines().count());
            }
            let theme = miette::GraphicalTheme::unicode_nocolor();
            let handler = miette::GraphicalReportHandler::new_themed(theme);
            let mut report = String::new();
            prop_assert!(handler.render_report(&mut report, &error).is_ok());
        }
    }
}

#[test]
fn motors_and_wheels_out_of_range() {
    assert_fault(
        "speed_max_rad_s = 5.0",
        "speed_max_rad_s = 77",
        "speed_max_rad_s",
        "is 77 rad/s",
        "1 rev/min is 0.10472 rad/s",
    );
    assert_fault("kp_nm_rad = 50.0", "kp_nm_rad = 0", "kp_nm_rad", "`kp_nm_rad` is 0", "above 0");
    assert_fault(
        "armature_kg_m2 = 0.005",
        "armature_kg_m2 = 0",
        "armature_kg_m2",
        "is 0 kg·m²",
        "above 0 to 10 kg·m²",
    );
    assert_fault(
        "radius_m = 0.03",
        "radius_m = 30",
        "radius_m",
        "`radius_m` is 30 m",
        "millimetres",
    );
    assert_fault(
        "friction_coefficient = 0.8",
        "friction_coefficient = 0",
        "friction_coefficient",
        "is 0",
        "above 0 to 2",
    );
    assert_fault("bus = 0\nid = 2", "bus = 4\nid = 2", "bus = 4", "`bus` is 4", "buses 0 to 3");
    assert_fault("bus = 0\nid = 2", "bus = 0\nid = 200", "id = 200", "`id` is 200", "0 to 127");
}

proptest! {
    /// Robots in plan files are hostile input too: any numbers and indices are judged, not tripped over.
    #[test]
    fn robots_with_any_numbers_are_judged_without_panic(
        number in prop::num::f64::ANY,
        index in any::<usize>(),
        field in 0..9usize,
    ) {
        let mut robot = tiny();
        match field {
            0 => robot.links[1].mass_kg = number,
            1 => robot.links[1].inertia_in_link_kg_m2[(1, 2)] = number,
            2 => robot.joints[1].parent = index,
            3 => robot.joints[1].child = index,
            4 => robot.joints[0].axis_in_joint.x = number,
            5 => robot.joints[0].position_max_rad = number,
            6 => robot.joints[0].parent_from_joint.translation.z = number,
            7 => robot.end_effectors[0].link = index,
            _ => robot.end_effectors[0].radius_m = number,
        }
        if robot.validate().is_ok() {
            // What passes can be used: the controller accepts its configuration.
            prop_assert_eq!(robot.controller_config().unwrap().check(), Ok(()));
        }
    }
}

/// The tiny robot with another kind of contact in place of its foot.
fn with_contact(lines: &str) -> Robot {
    let text = ROBOT.replacen("contact = \"point_foot\"", lines, 1);
    Robot::from_toml("tiny.toml", &text).unwrap()
}

#[test]
fn every_kind_of_contact_is_read_and_mirrored() {
    let axis = "axis_in_link = [0.3, 0.0, 0.4]";
    let left = nalgebra::Vector3::new(0.6, 0.0, 0.8);
    let check = |lines: &str, of: &dyn Fn(nalgebra::Vector3<f64>) -> Contact| {
        let robot = with_contact(&format!("{lines}\n{axis}"));
        assert_eq!(robot.end_effectors[1].contact, of(left));
        // Mirrored axes turn into −M a, so that an axis across the limb keeps its sign.
        assert_eq!(robot.end_effectors[2].contact, of(-left));
        // No motor, no channel: the shoulder, its wheel and two hips.
        assert_eq!(robot.controller_config().unwrap().channels.len(), 4);
    };
    check("contact = \"welded_wheel\"", &|axis_in_link| Contact::WeldedWheel { axis_in_link });
    let drag = |rolling_drag_s_m| RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m };
    check("contact = \"passive_wheel\"\nrolling_resistance = 0.02", &|axis_in_link| {
        Contact::PassiveWheel { axis_in_link, drag: drag(0.0) }
    });
    let skate = "contact = \"skate\"\nrolling_resistance = 0.02\nrolling_drag_s_m = 0.1\n\
                 blade_length_m = 0.12";
    check(skate, &|axis_in_link| Contact::Skate {
        axis_in_link,
        blade_length_m: 0.12,
        drag: drag(0.1),
    });
    let robot = with_contact(&format!("{skate}\n{axis}"));
    assert_eq!(robot.end_effectors[1].clearance_radius_m(), 0.06);
    assert_eq!(robot.end_effectors[0].clearance_radius_m(), 0.03);
}

#[test]
fn a_torque_speed_line_has_two_ends_beyond_the_limits() {
    let line = "stall_torque_nm = 3.0\nno_load_speed_rad_s = 8.0";
    let with = |line: &str| format!("torque_max_nm = 2.0\n{line}");
    let text = ROBOT.replacen("torque_max_nm = 2.0", &with(line), 1);
    let robot = Robot::from_toml("tiny.toml", &text).unwrap();
    let motor = robot.joints[0].actuator.torque_speed.unwrap();
    assert_eq!((motor.stall_torque_nm, motor.no_load_speed_rad_s), (3.0, 8.0));
    assert_eq!(tiny().joints[0].actuator.torque_speed, None);

    let fault = |line: &str| faults("torque_max_nm = 2.0", &with(line));
    let half = fault("stall_torque_nm = 3.0");
    assert_eq!(half.len(), 1, "{half:?}");
    assert!(half[0].1.contains("given without `no_load_speed_rad_s`"), "{half:?}");
    // The same data sheet serves several motors; each says so.
    let weak = fault("stall_torque_nm = 1.0\nno_load_speed_rad_s = 8.0");
    assert!(weak[0].1.contains("`stall_torque_nm` is 1 N·m"), "{weak:?}");
    assert!(weak[0].2.contains("from 2 to"), "{weak:?}");
    let slow = fault("stall_torque_nm = 3.0\nno_load_speed_rad_s = 4.0");
    assert!(slow[0].1.contains("`no_load_speed_rad_s` is 4 rad/s"), "{slow:?}");
}

#[test]
fn the_middle_of_a_blade_is_below_its_link() {
    let skate = |axis: &str| {
        let lines = "contact = \"skate\"\nrolling_resistance = 0.02\nblade_length_m = 0.01";
        let text = format!("{lines}\naxis_in_link = {axis}");
        Robot::from_toml("tiny.toml", &ROBOT.replacen("contact = \"point_foot\"", &text, 1))
    };
    let blade = skate("[0.0, 0.8, 0.6]").unwrap().end_effectors[1].blade().unwrap();
    // Square to the axis; a radius of 0.01 m and half a blade of 0.005 m: 0.5 rad.
    assert!((blade.middle_in_link - nalgebra::Vector3::new(0.0, 0.6, -0.8)).norm() < 1e-12);
    assert!((blade.reach_m - 0.01 * 0.5f64.sin()).abs() < 1e-15);
    assert_eq!(tiny().end_effectors[0].blade(), None);
    let error = skate("[0.0, 0.1, 1.0]").unwrap_err();
    assert!(error.faults().any(|f| f.help.contains("no vertical of the link")), "{error}");
}
