//! Tests of impossible robots: bodies, joints, trees, names, addresses, motors and wheels.

use super::*;
use proptest::prelude::*;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_robot::{Contact, Item, RollingDrag};

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
        "divide grams by 1000",
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
        "`cylinder_y_m` [0] is 30 m",
        "above 0 and up to 10 m; divide millimetres",
    );
    assert_fault(
        "box_m = [0.02, 0.02, 0.2]",
        "box_m = [0.02, -0.3, 0.2]",
        "  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.1]",
        "`box_m` [1] is -0.3 m",
        "above 0 and up to 10 m",
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
        "an angle beyond ±2π rad",
        "90 degrees are 1.5708",
    );
    assert_fault(
        "origin_in_parent_m = [0.1, 0.0, 0.0]",
        "origin_in_parent_m = [100, 0.0, 0.0]",
        "origin_in_parent_m",
        "is [100, 0, 0]",
        "divide millimetres by 1000",
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

    // A joint before the joint that carries its parent.
    let found = with(joint("wrist", "arm", "hand", 1));
    assert!(found[0].2.contains("move the joint that carries `arm` up"), "{found:#?}");
    assert_eq!(messages(found), ["30: joint `wrist`: `parent` `arm` is not yet part of the tree"]);
    // Two joints, each on a link of the other.
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
        "did you mean `arm`? valid names: `body`, `arm`, `left_shank`, `right_shank`",
    );
    assert_fault(
        "parent = \"mount\"",
        "parent = \"mounts\"",
        "parent = \"mounts\"",
        "joint `*_hip`: there is no link `mounts`",
        "did you mean `mount`? valid names: `mount`, `body`",
    );
    assert_fault(
        "actuator = \"servo\"\nbus = 0\nid = 1",
        "actuator = \"motor\"\nbus = 0\nid = 1",
        "actuator = \"motor\"",
        "there is no actuator `motor`",
        "valid names: `servo`",
    );
    assert_fault(
        "box_m = [0.02, 0.02, 0.2] },\n",
        "box_m = [0.02, 0.02, 0.2], actuator = \"motor\" },\n",
        "  { mass_kg = 0.1, at_m = [0.0, 0.0, -0.1], box_m",
        "there is no actuator `motor`",
        "valid names: `servo`",
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
        "digits, `_` or `-`",
    );
    // The fault is reported where it is, not at the parts that it names.
    for (from, to, words) in [
        (
            "name = \"right\"",
            "name = \"left\"",
            "limb `left`: `name` is \"left\", the name of an earlier limb",
        ),
        (
            "[[template.leg.joint]]",
            "[[template.leg.link]]\nname = \"*_shank\"\n\
             parts = [{ mass_kg = 1, at_m = [0, 0, 0], box_m = [1, 1, 1] }]\n[[template.leg.joint]]",
            "link `left_shank`: `name` is used twice",
        ),
    ] {
        let found = faults(from, to);
        assert!(found.len() == 1 && found[0].1.contains(words), "{found:#?}");
    }
}

/// Tests limits on names and models, which tables, messages and libraries display.
#[test]
fn names_and_models_are_short_and_can_be_seen() {
    let fields = [
        ("name = \"tiny\"", "tiny", "`name`"),
        ("model = \"S1\"", "S1", "`model`"),
        ("name = \"arm\"", "arm", "`name`"),
        ("name = \"shoulder\"", "shoulder", "`name`"),
        ("name = \"wheel\"", "wheel", "`name`"),
        ("name = \"*_shank\"", "*_shank", "`name`"),
        ("name = \"left\"", "left", "`name`"),
        ("template = \"leg\"", "leg", "`template`"),
        ("[actuator.servo]", "servo", "`actuator`"),
        ("[[template.leg.link]]", "leg", "`template`"),
    ];
    for (from, value, field) in fields {
        let quoted =
            if from.starts_with('[') { format!(".{value}") } else { format!("\"{value}\"") };
        let put = |text: &str| {
            let dot = if from.starts_with('[') { "." } else { "" };
            from.replace(&quoted, &format!("{dot}\"{text}\""))
        };
        for text in ["x".repeat(65), "x".repeat(5000), "x".repeat(65_536), "a\\u001b[2J".into()] {
            let found = faults(from, &put(&text));
            let of_field = |(_, message, _): &&(usize, String, String)| message.contains(field);
            let (.., message, help) = found.iter().find(of_field).unwrap_or_else(|| {
                panic!("{from} of {} characters: {found:#?}", text.len());
            });
            assert!(message.len() < 400 && !help.is_empty(), "{message}");
        }
    }
}

#[test]
fn a_limb_is_placed_where_its_origin_says() {
    let far = "origin_in_parent_m = [200, 130, 0]";
    let found = faults(
        "origin_in_parent_m = [-0.1, 0.1, 0.0]\nside = \"left\"",
        &format!("{far}\nside = \"left\""),
    );
    assert!(found.len() == 1 && found[0].1.contains("[200, 130, 0]"), "{found:#?}");
    assert!(found[0].2.contains("millimetres"), "{found:#?}");
    let text =
        ROBOT.replacen("origin_in_parent_m = [-0.1, 0.1, 0.0]\nside", &format!("{far}\nside"), 1);
    let line = text[..text.find(far).unwrap()].lines().count() + 1;
    assert_eq!(found[0].0, line, "{found:#?}");
    let unused = faults("parent = \"mount\"", "parent = \"body\"");
    assert!(unused.iter().all(|fault| fault.1.contains("is not used by any joint")), "{unused:#?}");
    assert!(!unused.is_empty() && unused[0].2.contains("`leg`"), "{unused:#?}");
}

#[test]
fn addresses_are_given_once() {
    let wheel = faults("bus = 0\nid = 2", "bus = 0\nid = 1");
    assert_eq!(wheel.len(), 1, "{wheel:#?}");
    assert_eq!(wheel[0].0, 48);
    assert_eq!(wheel[0].1, "end effector `wheel`: `id` is 1, which another motor on bus 0 has");
    assert!(wheel[0].2.contains("joint `shoulder` has this id"), "{wheel:#?}");
    // Limbs number their motors from `first_id`, so the fault is there, and not in the template.
    let limb = faults("first_id = 2", "first_id = 1");
    assert_eq!(limb.len(), 1, "{limb:#?}");
    assert_eq!(limb[0].0, 89);
    assert_eq!(limb[0].1, "joint `right_hip`: `id` is 1, which another motor on bus 1 has");
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
    assert!(found[0].1.contains("and actuated wheels number 68"), "{found:#?}");
    assert!(found[0].2.contains("at most 64"), "{found:#?}");
}

/// Tests the rules on robots without a file, whose faults have places instead of spans.
#[test]
fn robots_without_a_file_are_judged_by_the_same_rules() {
    let robot = tiny();
    robot.validate().unwrap();
    type Breaks = fn(&mut Robot);
    let broken: [(Breaks, Item, &str); 15] = [
        (|r| r.links[0].mass_kg = f64::NAN, Item::Link(0), "mass_kg"),
        (
            |r| r.links[0].inertia_in_link_kg_m2[(0, 1)] = 1e-3,
            Item::Link(0),
            "inertia_in_link_kg_m2",
        ),
        (|r| r.links[0].com_in_link_m.x = f64::INFINITY, Item::Link(0), "com_in_link_m"),
        (|r| r.joints[0].position_min_rad = f64::NAN, Item::Joint(0), "position_min_rad"),
        (|r| r.joints[0].axis_in_joint.y = 2.0, Item::Joint(0), "axis_in_joint"),
        (|r| r.joints[1].parent = 9, Item::Joint(1), "parent"),
        (|r| r.joints[0].actuator.kd_nm_s_rad = -1.0, Item::Joint(0), "kd_nm_s_rad"),
        (|r| r.joints[0].actuator.model.clear(), Item::Joint(0), "model"),
        (|r| r.joints[0].actuator.model = "M".repeat(65_536), Item::Joint(0), "model"),
        (|r| r.joints[0].actuator.model = "M\u{1b}[2J".into(), Item::Joint(0), "model"),
        (|r| r.joints[2].actuator.id = 1, Item::Joint(2), "id"),
        (|r| r.end_effectors[0].link = 4, Item::EndEffector(0), "link"),
        (|r| r.end_effectors[1].radius_m = 0.0, Item::EndEffector(1), "radius_m"),
        (|r| r.end_effectors.clear(), Item::Robot, "end_effector"),
        (
            |r| {
                let axis_in_link = nalgebra::Vector3::zeros();
                let drag = RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m: 0.0 };
                r.end_effectors[1].contact = Contact::PassiveWheel { axis_in_link, drag }
            },
            Item::EndEffector(1),
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
    /// Tests that any damaged file gives a robot, or faults inside the text.
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

/// Limits of motors grow with the robot's mass, and wheels may be faster than joints.
#[test]
fn motors_of_large_robots_may_be_stronger() {
    let actuator = |robot: &mut Robot, torque_nm: f64, kp_nm_rad: f64| {
        let motor = &mut robot.joints[0].actuator;
        (motor.torque_max_nm, motor.kp_nm_rad, motor.kd_nm_s_rad) = (torque_nm, kp_nm_rad, 60.0);
        motor.torque_speed = None;
    };
    let heavy = |mass_kg: f64| {
        let mut robot = tiny();
        let scale = mass_kg / robot.total_mass_kg();
        for link in &mut robot.links {
            link.mass_kg *= scale;
            link.inertia_in_link_kg_m2 *= scale;
        }
        robot
    };
    for (mass_kg, most_nm, stiffest) in
        [(0.2, 160.0, 655.0), (8.0, 160.0, 1040.0), (500.0, 1e4, 6.5e4)]
    {
        let mut robot = heavy(mass_kg);
        actuator(&mut robot, 0.999 * most_nm, 0.999 * stiffest);
        robot.validate().unwrap();
        robot.controller_config().unwrap().check().unwrap();
        actuator(&mut robot, 1.001 * most_nm, 1.001 * stiffest);
        let fields: Vec<_> =
            robot.validate().unwrap_err().violations.iter().map(|of| of.field).collect();
        assert_eq!(fields, ["torque_max_nm", "kp_nm_rad"]);
    }
}

/// A servo of the catalogue supplies the fields that its table lacks.
#[test]
fn a_data_sheet_may_name_a_servo_of_the_catalogue() {
    let sheet = &ROBOT[ROBOT.find("model = ").unwrap()..ROBOT.find("\n\n[[link]]").unwrap()];
    let with = |sheet: &str, new: &str| Robot::from_toml("tiny.toml", &ROBOT.replace(sheet, new));
    let motor = |new: &str| with(sheet, new).unwrap().joints[0].actuator.clone();
    let whole = motor("servo = \"XL330-M288-T\"");
    let servo = rollwalk_robot::catalog::Catalog::shipped().get("XL330-M288-T").unwrap().clone();
    assert_eq!((whole.model.as_str(), whole.torque_max_nm), ("XL330-M288-T", servo.torque_max_nm));
    assert_eq!(whole.speed_max_rad_s, servo.speed_max_rad_s);
    assert_eq!([whole.kp_nm_rad, whole.kd_nm_s_rad, whole.armature_kg_m2], [15.0, 0.15, 0.001]);
    let line = whole.torque_speed.unwrap();
    assert_eq!(line.no_load_speed_rad_s, servo.no_load_speed_rad_s);
    let mine =
        motor("servo = \"XL330-M288-T\"\nmodel = \"mine\"\ntorque_max_nm = 0.2\nkp_nm_rad = 9.0");
    assert_eq!((mine.model.as_str(), mine.torque_max_nm, mine.kp_nm_rad), ("mine", 0.2, 9.0));
    assert_eq!(mine.speed_max_rad_s, servo.speed_max_rad_s);
    // Without gains in the catalogue, the table must have them: one fault names all.
    for (given, missing) in [
        ("", "`kp_nm_rad`, `kd_nm_s_rad`, `armature_kg_m2`"),
        ("\nkd_nm_s_rad = 1.0", "`kp_nm_rad`, `armature_kg_m2`"),
    ] {
        let error = with(sheet, &format!("servo = \"CyberGear\"{given}")).unwrap_err();
        let found: Vec<_> =
            error.faults().map(|fault| (fault.message.as_str(), fault.help.as_str())).collect();
        let message = format!(
            "actuator `servo`: `servo` is \"CyberGear\", for which the catalogue has no {missing}"
        );
        let help = format!(
            "give {missing}; docs/identification.md#measure-a-servo describes a measurement"
        );
        assert_eq!(found, [(message.as_str(), help.as_str())]);
    }
    let alone = with(sheet, "servo = \"XL330-M288\"").unwrap_err();
    assert_eq!(alone.faults().count(), 1, "{alone}");
    let found = faults("model = \"S1\"", "servo = \"XL330-M288\"\nmodel = \"S1\"");
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].1.contains("`servo` is \"XL330-M288\", which is not in the catalogue"));
    let help = &found[0].2;
    assert!(help.starts_with("did you mean `XL330-M288-T`? valid names: `XL330-M077-T`"), "{help}");
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
    assert_fault("bus = 0\nid = 2", "bus = 4\nid = 2", "bus = 4", "`bus` must be", "from 0 to 3");
    assert_fault("bus = 0\nid = 2", "bus = 0\nid = 200", "id = 200", "`id` must be", "0 to 127");
}

proptest! {
    /// Tests robots with arbitrary numbers and indices. Plan files are untrusted input, and the rules must not panic on them.
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
            // A robot that passes is usable: the controller accepts its configuration.
            prop_assert_eq!(robot.controller_config().unwrap().check(), Ok(()));
        }
    }
}
