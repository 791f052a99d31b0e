//! Tests of the MJCF import, for features that URDF lacks. `planner/interchange/tests/consumers.rs` compares poses and masses
//! with MuJoCo.

use rollwalk_robot::urdf::{Survey, Text, import, survey};

fn surveyed(text: &str) -> Result<Survey, String> {
    survey(Text { name: "robot.xml", text }).map_err(|error| {
        let faults: Vec<String> =
            error.faults().map(|fault| format!("{}; {}", fault.message, fault.help)).collect();
        faults.join("\n")
    })
}

/// MJCF model with the given content of its root.
fn model(inside: &str) -> String {
    format!("<mujoco model=\"m\">{inside}</mujoco>")
}

/// MJCF model of a trunk of 2 kg with the given content.
fn trunk(inside: &str) -> String {
    let ball = "<geom size=\"0.1\" mass=\"2\"/>";
    model(&format!("<worldbody><body name=\"trunk\"><freejoint/>{ball}{inside}</body></worldbody>"))
}

#[test]
fn a_body_with_two_joints_has_a_link_between_them() {
    let leg = "<body name=\"leg\"><joint name=\"roll\" axis=\"1 0 0\" range=\"-30 30\"/>\
               <joint name=\"pitch\" axis=\"0 1 0\" range=\"-60 60\"/><geom size=\"0.05\" mass=\"1\"/></body>";
    let survey = surveyed(&trunk(leg)).unwrap();
    assert_eq!(survey.links, ["trunk", "leg_1", "leg"]);
    let names: Vec<_> = survey.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["roll", "pitch"]);
    let limits = survey.joints[1].limits.map(|limit| limit.unwrap().to_degrees().round());
    assert_eq!(limits, [-60.0, 60.0]);
}

/// The hip of HyQReal 2 is turned by half a turn about x - z, where roll and yaw are not unique.
#[test]
fn frames_at_a_pitch_of_a_right_angle_keep_their_directions() {
    for (quat, left_m) in [("0 0.707107 0 -0.707107", 0.16), ("0.707107 0 0.707107 0", -0.16)] {
        let leg = format!(
            "<body name=\"hip\" quat=\"{quat}\"><joint name=\"roll\" axis=\"0 0 1\" range=\"-30 30\"/><geom size=\"0.05\" mass=\"1\"/>\
             <body name=\"thigh\" pos=\"0 -0.16 0\"><joint name=\"pitch\" axis=\"0 1 0\" range=\"-60 60\"/><geom size=\"0.05\" mass=\"1\"/></body></body>"
        );
        let text = trunk(&leg);
        let side = surveyed(&text).unwrap().template;
        let texts = [("robot.xml", &*text), ("side.toml", &*side)];
        let [model, side] = texts.map(|(name, text)| Text { name, text });
        let robot = import(model, side).unwrap().robot;
        let [hip, thigh] = &robot.joints[..] else { panic!("{:?}", robot.joints) };
        let at = hip.parent_from_joint * thigh.parent_from_joint.translation.vector;
        assert!((at - nalgebra::Vector3::new(0.0, left_m, 0.0)).norm() < 1e-6, "{quat}: {at}");
        let forward = hip.parent_from_joint * hip.axis_in_joint;
        let ahead = if left_m > 0.0 { -1.0 } else { 1.0 };
        assert!((forward - nalgebra::Vector3::new(ahead, 0.0, 0.0)).norm() < 1e-6, "{forward}");
    }
}

#[test]
fn joints_without_range_turn_without_end_and_radians_are_asked_for() {
    let leg = |compiler: &str, joint: &str| {
        trunk(&format!("<body name=\"leg\"><joint {joint}/><geom size=\"0.05\"/></body>"))
            .replace("<worldbody>", &format!("{compiler}<worldbody>"))
    };
    let radian = "<compiler angle=\"radian\"/>";
    let of = |text: String| surveyed(&text).unwrap().joints.remove(0);
    let endless = of(leg(radian, ""));
    assert_eq!((endless.kind.as_str(), endless.limits), ("continuous", [None, None]));
    assert_eq!(endless.name, "leg_joint");
    let limited = of(leg(radian, "name=\"j\" range=\"-1 1.5\""));
    assert_eq!((limited.kind.as_str(), limited.limits), ("revolute", [Some(-1.0), Some(1.5)]));
    let unlimited = of(leg("<compiler autolimits=\"false\"/>", "range=\"-1 1.5\""));
    assert_eq!(unlimited.kind, "continuous");
    assert_eq!(of(leg("", "range=\"-1 1\" limited=\"false\"")).kind, "continuous");
}

#[test]
fn a_robot_on_a_rail_is_the_body_behind_it() {
    let text = model(
        "<worldbody><body name=\"cart\"><joint name=\"rail\" type=\"slide\" range=\"-1 1\"/><geom size=\"0.1\"/></body></worldbody>",
    );
    assert_eq!(surveyed(&text).unwrap().root, "cart");
}

#[test]
fn what_stands_for_other_elements_is_named_with_what_writes_them() {
    for (inside, name) in [
        ("<include file=\"legs.xml\"/>", "include"),
        ("<worldbody><replicate count=\"4\"/></worldbody>", "replicate"),
    ] {
        let why = surveyed(&model(inside)).unwrap_err();
        assert!(
            why.contains(&format!("<{name}> stands for")) && why.contains("mj_saveLastXML"),
            "{why}"
        );
    }
}

#[test]
fn faults_name_the_element_the_value_and_what_would_be_right() {
    let cases = [
        ("<body name=\"leg\" pos=\"0 0\"/>", "body `leg`: `pos` is \"0 0\"; 3 finite numbers"),
        ("<body name=\"leg\" quat=\"0 0 0 0\"/>", "its orientation is not a rotation"),
        (
            "<body name=\"leg\"><joint name=\"j\" type=\"screw\"/></body>",
            "`type` is \"screw\"; give hinge",
        ),
        (
            "<body name=\"leg\"><joint name=\"j\" axis=\"0 0 0\"/></body>",
            "the axis has no direction",
        ),
        ("<body name=\"leg\"><inertial pos=\"0 0 0\"/></body>", "`mass` is missing"),
        ("<body name=\"leg\" childclass=\"lag\"/>", "class `lag` does not exist"),
        (
            "<body name=\"leg\"><geom size=\"nan\"/></body>",
            "`size` is \"nan\"; 1 to 3 finite numbers",
        ),
    ];
    for (inside, expected) in cases {
        let why = surveyed(&trunk(inside)).unwrap_err();
        assert!(why.contains(expected), "{why}\n{expected}");
    }
    assert!(surveyed(&model("")).unwrap_err().contains("has no <body>"));
    let global = model("<compiler coordinate=\"global\"/><worldbody><body/></worldbody>");
    assert!(surveyed(&global).unwrap_err().contains("global coordinates"));
}

#[test]
fn the_mass_of_meshes_is_said_to_be_missing() {
    let leg = "<body name=\"leg\"><joint/><geom size=\"0.05\" mass=\"1\"/><geom type=\"mesh\" mesh=\"shell\"/></body>";
    let survey = surveyed(&trunk(leg)).unwrap();
    assert!((survey.mass_kg - 3.0).abs() < 1e-12);
    assert!(
        survey.warnings.iter().any(|warning| warning.contains("without meshes")),
        "{:?}",
        survey.warnings
    );
}

#[test]
fn settings_of_the_model_change_masses_as_in_mujoco_or_are_refused() {
    let with = |compiler: &str, leg: &str| {
        let setting = format!("<compiler {compiler}/><worldbody>");
        trunk(leg).replacen("<worldbody>", &setting, 1)
    };
    let ball =
        |geom: &str| format!("<body name=\"leg\"><joint/><geom size=\"0.1\" {geom}/></body>");
    let mass_kg = |text: &str| surveyed(text).unwrap().mass_kg;
    let given = "<body name=\"leg\"><joint/><inertial pos=\"0 0 0\" mass=\"1\" diaginertia=\"1 1 1\"/>\
                 <geom size=\"0.1\" shellinertia=\"true\"/></body>";
    assert_eq!(mass_kg(&with("boundmass=\"5\"", &ball("mass=\"1\""))), 10.0);
    assert_eq!(mass_kg(&with("boundmass=\"0.5\" settotalmass=\"-1\"", given)), 3.0);
    let shell = ball("mass=\"1\" shellinertia=\"true\"");
    for (text, attribute) in
        [(with("settotalmass=\"7\"", given), "settotalmass"), (trunk(&shell), "shellinertia")]
    {
        let why = surveyed(&text).unwrap_err();
        assert!(why.contains(attribute) && why.contains("MuJoCo"), "{why}");
    }
}

#[test]
fn deep_and_broken_models_end() {
    let deep = 20_000;
    let text = trunk(&("<body>".repeat(deep) + &"</body>".repeat(deep)));
    assert!(surveyed(&text).is_err());
    let nested = "<default class=\"a\">".repeat(300) + &"</default>".repeat(300);
    let text = trunk("<body name=\"leg\" childclass=\"a\"><geom/></body>");
    assert!(surveyed(&text.replace("<worldbody>", &format!("{nested}<worldbody>"))).is_ok());
    assert!(surveyed("<mujoco").is_err());
}

/// MJCF quadruped with motors for its legs, a rod at each thigh, and more elements.
fn linked(more: &str, joint: &str) -> String {
    let mut legs = String::new();
    let mut motors = String::new();
    for (leg, x, y) in [("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1)]
    {
        legs += &format!(
            "<body name=\"{leg}_thigh\" pos=\"{x} {y} 0\"><joint name=\"{leg}_hip\" axis=\"0 1 0\" range=\"-90 90\"/>\
             <geom type=\"capsule\" size=\"0.02\" fromto=\"0 0 0 0 0 -0.2\"/>\
             <body name=\"{leg}_rod\" pos=\"0.03 0 0\"><joint name=\"{leg}_pin\" axis=\"0 1 0\" {joint}/>\
             <geom type=\"capsule\" size=\"0.005\" fromto=\"0 0 0 0 0 -0.2\"/></body>\
             <body name=\"{leg}_shank\" pos=\"0 0 -0.2\"><joint name=\"{leg}_knee\" axis=\"0 1 0\" range=\"-150 -20\"/>\
             <geom type=\"capsule\" size=\"0.02\" fromto=\"0 0 0 0 0 -0.2\"/></body></body>"
        );
        motors += &format!(
            "<motor joint=\"{leg}_hip\" ctrlrange=\"-9 9\"/><motor joint=\"{leg}_knee\" ctrlrange=\"-9 9\"/>"
        );
    }
    trunk(&legs).replace("</mujoco>", &format!("<actuator>{motors}</actuator>{more}</mujoco>"))
}

#[test]
fn loops_and_tendons_are_named_and_joints_without_motor_and_spring_locked() {
    let connect =
        "<equality><connect body1=\"fl_rod\" body2=\"fl_shank\" anchor=\"0 0 -0.2\"/></equality>";
    let weld = "<equality><weld name=\"glue\" body1=\"fl_rod\" body2=\"fl_shank\"/></equality>";
    let tendon =
        "<tendon><fixed name=\"belt\"><joint joint=\"fl_hip\" coef=\"1\"/></fixed></tendon>";
    for (more, joint, words) in [
        (connect, "", ["<connect> `fl_rod – fl_shank`", "[lock]"]),
        (weld, "", ["<weld> `glue`", "[lock]"]),
        (tendon, "", ["<fixed> `belt`", "imported only if it is fixed"]),
        (
            "<actuator><motor name=\"pull\" tendon=\"belt\"/></actuator>",
            "",
            ["<actuator> `pull`", "no joint"],
        ),
    ] {
        let survey = surveyed(&linked(more, joint)).unwrap();
        let has = |words: &[&str]| {
            survey.warnings.iter().any(|warning| words.iter().all(|word| warning.contains(word)))
        };
        assert!(has(&words), "{words:?}: {:?}", survey.warnings);
        assert!(has(&["`fl_pin`", "no actuator", "[lock]"]), "{:?}", survey.warnings);
        assert_eq!(survey.end_effectors.len(), 4);
        assert!(survey.end_effectors.iter().all(|end| end.link.ends_with("_shank")));
        assert!(survey.template.contains("fl_pin = 0.0"), "{}", survey.template);
    }
}

#[test]
fn a_motor_at_a_fixed_tendon_turns_its_joints() {
    let legs = linked("", "");
    let belt = "<tendon><fixed name=\"belt\" armature=\"0.003\"><joint joint=\"fl_hip\" coef=\"1.5\"/>\
                <joint joint=\"fl_knee\" coef=\"-1.25\"/></fixed></tendon></mujoco>";
    let text = legs
        .replace(
            "<motor joint=\"fl_knee\" ctrlrange=\"-9 9\"/>",
            "<motor tendon=\"belt\" gear=\"2\" ctrlrange=\"-3 3\"/>",
        )
        .replace("</mujoco>", belt);
    let survey = surveyed(&text).unwrap();
    assert!(
        !survey.warnings.iter().any(|warning| warning.contains("belt")),
        "{:?}",
        survey.warnings
    );
    let side = Text { name: "side.toml", text: &survey.template };
    let robot = import(Text { name: "robot.xml", text: &text }, side).unwrap().robot;
    let index = |name: &str| robot.joints.iter().position(|joint| joint.name == name).unwrap();
    let (hip, knee) = (index("fl_hip"), index("fl_knee"));
    let ratios = |joint: usize| -> Vec<_> {
        let ratios = robot.joints[joint].motor_per_joint.iter();
        ratios.map(|of| (of.joint, of.ratio)).collect()
    };
    assert_eq!((ratios(hip), ratios(knee)), (vec![], vec![(hip, 1.5), (knee, -1.25)]));
    let motor = &robot.joints[knee].actuator;
    assert_eq!((motor.torque_max_nm, motor.armature_kg_m2), (6.0, 0.003));
}

#[test]
fn springs_and_dampers_are_those_of_their_joints_unless_they_stand_for_a_servo() {
    let text = linked("", "");
    let spring = "name=\"fl_knee\" stiffness=\"3\" springref=\"-60\" ref=\"-15\" damping=\"0.2\"";
    let damper = "name=\"fr_knee\" damping=\"0.4\"";
    let text = text
        .replace("name=\"fl_knee\"", spring)
        .replace("name=\"fr_knee\"", damper)
        .replace("name=\"rl_knee\"", &damper.replace("fr", "rl"))
        .replace("<motor joint=\"rl_knee\"", "<position kp=\"20\" joint=\"rl_knee\"")
        .replace("name=\"rr_knee\"", &damper.replace("fr", "rr"))
        .replace("<motor joint=\"rr_knee\"", "<position kp=\"20\" kv=\"1\" joint=\"rr_knee\"");
    let survey = surveyed(&text).unwrap();
    let warned = |name: &str| {
        survey.warnings.iter().any(|w| w.contains(name) && w.contains("`damping` is not imported"))
    };
    assert!(warned("`rl_knee`") && !warned("`rr_knee`"), "{:?}", survey.warnings);
    let side = Text { name: "side.toml", text: &survey.template };
    let robot = import(Text { name: "robot.xml", text: &text }, side).unwrap().robot;
    let spring = |name: &str| {
        let joint = robot.joints.iter().find(|joint| joint.name == name);
        joint.unwrap().spring.map(|of| {
            [of.stiffness_nm_rad, of.rest_rad, of.damping_nm_s_rad].map(|x| (x * 1e6).round())
        })
    };
    let rest_rad = -45f64.to_radians();
    assert_eq!(spring("fl_knee"), Some([3.0, rest_rad, 0.2].map(|x: f64| (x * 1e6).round())));
    assert_eq!(spring("fr_knee"), Some([0.0, 0.0, 4e5]));
    assert_eq!(spring("rr_knee"), Some([0.0, 0.0, 4e5]));
    assert_eq!((spring("rl_knee"), spring("fl_hip")), (None, None));
}

#[test]
fn a_joint_with_a_spring_and_no_actuator_becomes_passive() {
    let text = linked("", "stiffness=\"5\" springref=\"20\" damping=\"0.1\"");
    let survey = surveyed(&text).unwrap();
    let warned = |words: &str| survey.warnings.iter().any(|warning| warning.contains(words));
    assert!(
        warned("has a spring and no motor, so only its spring holds it"),
        "{:?}",
        survey.warnings
    );
    assert!(!survey.template.contains("fl_pin = 0"), "{}", survey.template);
    let imported = |side: &str| {
        let side = Text { name: "side.toml", text: side };
        import(Text { name: "robot.xml", text: &text }, side).unwrap()
    };
    let import = imported(&survey.template);
    let pin = import.robot.joints.iter().find(|joint| joint.name == "fl_pin").unwrap();
    assert!(pin.is_passive());
    assert!((pin.nominal_rad - 20f64.to_radians()).abs() < 1e-3, "{}", pin.nominal_rad);
    let spring = pin.spring.unwrap();
    assert_eq!((spring.stiffness_nm_rad, spring.damping_nm_s_rad), (5.0, 0.1));
    assert!((spring.rest_rad - 20f64.to_radians()).abs() < 1e-9);
    assert_eq!(import.robot.channels().count(), 8, "the motors of the legs");

    let driven = survey.template.replacen("fl_pin = { ", "fl_pin = { actuator = \"default\", ", 1);
    assert_ne!(driven, survey.template);
    let robot = imported(&driven).robot;
    assert_eq!(robot.channels().count(), 9, "the side file gives the joint a motor");
}

#[test]
fn a_servo_with_kv_0_leaves_its_damping_to_the_joint() {
    let text = linked("", "")
        .replace("name=\"rl_knee\"", "name=\"rl_knee\" damping=\"0.4\"")
        .replace("<motor joint=\"rl_knee\"", "<position kp=\"20\" kv=\"0\" joint=\"rl_knee\"");
    let warnings = surveyed(&text).unwrap().warnings;
    let is_of_servo =
        |w: &String| w.contains("`rl_knee`") && w.contains("`damping` is not imported");
    assert!(warnings.iter().any(is_of_servo), "{warnings:?}");
}

#[test]
fn a_curved_equality_of_joints_is_shown_as_a_polynomial() {
    let text = linked(
        "<equality><joint joint1=\"fl_pin\" joint2=\"fl_hip\" polycoef=\"0.1 2 0.5\"/></equality>",
        "",
    );
    let side = surveyed(&text).unwrap().template.replace("fl_pin = 0.1\n", "");
    let side = Text { name: "side.toml", text: &side };
    let error = import(Text { name: "robot.xml", text: &text }, side).unwrap_err().to_string();
    assert!(error.contains("the polynomial [0.1, 2.0, 0.5, 0.0, 0.0] of its position"), "{error}");
}

#[test]
fn the_keyframe_home_is_the_standing_pose() {
    let home = |legs: &str| {
        format!("<keyframe><key name=\"home\" qpos=\"0 0 0.3 1 0 0 0 {legs}\"/></keyframe>")
    };
    // Thigh, rod and shank of each leg, in the order of the bodies.
    let standing = surveyed(&linked(&home(&"0.7 0 -1.4 ".repeat(4)), "")).unwrap();
    let nominal = |survey: &Survey, name: &str| {
        let joint = survey.joints.iter().find(|joint| joint.name == name).unwrap();
        joint.proposal.clone()
    };
    assert_eq!(nominal(&standing, "rr_hip"), "nominal 0.700 rad");
    assert_eq!(nominal(&standing, "rr_knee"), "nominal -1.400 rad");
    // The front of this robot lies on the ground.
    let lying = "1.5 0 -2.5 1.5 0 -2.5 0.7 0 -1.4 0.7 0 -1.4";
    let survey = surveyed(&linked(&home(lying), "")).unwrap();
    assert_ne!(nominal(&survey, "fl_hip"), "nominal 1.500 rad");
    let short = surveyed(&linked(&home("0.7 0"), "")).unwrap();
    assert!(
        short.warnings.iter().any(|w| w.contains("`qpos` has 9 numbers, but the joints need 19"))
    );
}

/// MJCF quadruped whose knees have motors at the hips, with parallelograms of crank and rod. The rod is a body of the crank, or
/// else of the shank.
fn cranked(rod_on_crank: bool) -> String {
    let (mut legs, mut motors, mut loops) = (String::new(), String::new(), String::new());
    for (leg, x, y) in [("fl", 0.2, 0.1), ("fr", 0.2, -0.1), ("rl", -0.2, 0.1), ("rr", -0.2, -0.1)]
    {
        let rod = |pos: &str, to: &str| {
            format!(
                "<body name=\"{leg}_rod\" pos=\"{pos}\"><joint name=\"{leg}_pin\" axis=\"0 1 0\"/>\
                 <geom type=\"capsule\" size=\"0.005\" fromto=\"0 0 0 {to}\" mass=\"0.04\"/></body>"
            )
        };
        let (on_crank, on_shank) = match rod_on_crank {
            true => (rod("0.04 0 0", "0 0 -0.2"), String::new()),
            false => (String::new(), rod("0.04 0 0", "0 0 0.2")),
        };
        legs += &format!(
            "<body name=\"{leg}_thigh\" pos=\"{x} {y} 0\"><joint name=\"{leg}_hip\" axis=\"0 1 0\" range=\"-60 60\"/>\
             <geom type=\"capsule\" size=\"0.02\" fromto=\"0 0 0 0 0 -0.2\" mass=\"0.3\"/>\
             <body name=\"{leg}_shank\" pos=\"0 0 -0.2\"><joint name=\"{leg}_knee\" axis=\"0 1 0\" range=\"-70 60\"/>\
             <geom type=\"capsule\" size=\"0.02\" fromto=\"0 0 0 0 0 -0.2\" mass=\"0.2\"/>{on_shank}</body></body>\
             <body name=\"{leg}_crank\" pos=\"{x} {y} 0\"><joint name=\"{leg}_servo\" axis=\"0 1 0\" armature=\"0.002\"/>\
             <geom type=\"capsule\" size=\"0.005\" fromto=\"0 0 0 0.04 0 0\" mass=\"0.02\"/>{on_crank}</body>"
        );
        motors += &format!(
            "<motor joint=\"{leg}_hip\" ctrlrange=\"-9 9\"/><motor joint=\"{leg}_servo\" ctrlrange=\"-7 7\"/>"
        );
        loops += &match rod_on_crank {
            true => {
                format!("<connect body1=\"{leg}_rod\" body2=\"{leg}_shank\" anchor=\"0 0 -0.2\"/>")
            }
            false => {
                format!("<connect body1=\"{leg}_crank\" body2=\"{leg}_rod\" anchor=\"0.04 0 0\"/>")
            }
        };
    }
    let lists = format!("<actuator>{motors}</actuator><equality>{loops}</equality></mujoco>");
    trunk(&legs).replace("</mujoco>", &lists)
}

#[test]
fn loops_of_crank_and_rod_become_linkages() {
    for rod_on_crank in [true, false] {
        let text = cranked(rod_on_crank);
        let survey = surveyed(&text).unwrap();
        let warned = |word: &str| survey.warnings.iter().any(|warning| warning.contains(word));
        assert!(warned("crank and rod become its `linkage`"), "{:?}", survey.warnings);
        assert!(!warned("<connect>") && !warned("[lock]"), "{:?}", survey.warnings);
        let side = Text { name: "side.toml", text: &survey.template };
        let imported = import(Text { name: "robot.xml", text: &text }, side)
            .unwrap_or_else(|error| panic!("{error}\n{}", survey.template));
        let robot = imported.robot;
        assert_eq!(robot.joints.len(), 8);
        assert!((robot.total_mass_kg() - (2.0 + 4.0 * 0.56)).abs() < 1e-9);
        let index = |name: &str| robot.joints.iter().position(|joint| joint.name == name).unwrap();
        let (hip, knee) = (index("rl_hip"), index("rl_knee"));
        assert!(robot.joints[knee].linkage.is_some() && robot.joints[hip].linkage.is_none());
        assert_eq!(robot.joints[knee].actuator.torque_max_nm, 7.0);
        // The crank of 0.02 kg and 0.04 m, and half of the rod of 0.04 kg at its end.
        let rotor = robot.joints[knee].actuator.armature_kg_m2 - 0.002;
        assert!((4e-5..6e-5).contains(&rotor), "{rotor}");
        // A parallelogram: the motor turns as far as the shank.
        let map = robot.transmission();
        let mut angles = vec![0.0; robot.joints.len()];
        for (hip_rad, knee_rad) in [(0.0, 0.0), (0.6, -0.9), (-0.5, 0.4)] {
            (angles[hip], angles[knee]) = (hip_rad, knee_rad);
            let motors = map.motors(&angles);
            assert!((motors[knee] - hip_rad - knee_rad).abs() < 1e-9, "{rod_on_crank} {motors:?}");
        }
    }
}

#[test]
fn limits_that_a_loop_does_not_allow_are_narrowed() {
    let text = cranked(true).replace(" range=\"-70 60\"", "");
    let survey = surveyed(&text).unwrap();
    let side = Text { name: "side.toml", text: &survey.template };
    let imported = import(Text { name: "robot.xml", text: &text }, side).unwrap();
    let narrows = |warning: &String| warning.contains("`fl_knee`") && warning.contains("narrows");
    assert!(imported.warnings.iter().any(narrows), "{:?}", imported.warnings);
    let knee = imported.robot.joints.iter().find(|joint| joint.name == "fl_knee").unwrap();
    // The parallelogram is singular where shank and thigh are in line with the crank, at a quarter of a turn.
    let range = [knee.position_min_rad, knee.position_max_rad];
    assert!(range[0] > -1.5 && range[1] < 1.5 && range[1] - range[0] > 0.3, "{range:?}");
}

#[test]
fn loops_with_other_motors_or_axes_are_named() {
    let text = cranked(true);
    for (from, to) in [
        ("<motor joint=\"fl_servo\" ctrlrange=\"-7 7\"/>", ""),
        ("name=\"fl_pin\" axis=\"0 1 0\"", "name=\"fl_pin\" axis=\"1 0 0\""),
        (
            "<motor joint=\"fl_servo\"",
            "<motor joint=\"fl_knee\" ctrlrange=\"-7 7\"/><motor joint=\"fl_servo\"",
        ),
    ] {
        assert!(text.contains(from));
        let survey = surveyed(&text.replace(from, to)).unwrap();
        let names = |warning: &String| {
            warning.contains("<connect> `fl_rod – fl_shank`") && warning.contains("write `linkage`")
        };
        assert!(survey.warnings.iter().any(names), "{to}: {:?}", survey.warnings);
        assert!(
            survey.warnings.iter().any(|w| w.contains("`rr_knee`") || w.contains("and rod become"))
        );
    }
}
