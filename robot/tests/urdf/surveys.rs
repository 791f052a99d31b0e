//! Tests that the survey finds feet and wheels, and that its side file imports unchanged.

use super::{URDF, edited};
use rollwalk_robot::urdf::{Survey, Text, import, is_unchanged, survey};

#[track_caller]
fn surveyed(urdf: &str) -> Survey {
    survey(Text { name: "rover.urdf", text: urdf }).unwrap()
}

#[test]
fn the_template_imports_and_stands() {
    let found = surveyed(URDF);
    let ends: Vec<_> = found
        .end_effectors
        .iter()
        .map(|end| (&*end.name, &*end.link, &*end.contact, end.radius_m, end.measured))
        .collect();
    assert_eq!(
        ends,
        [
            ("rear_right", "right_wheel", "actuated_wheel", 0.07, true),
            ("rear_left", "left_wheel", "actuated_wheel", 0.07, true),
            ("front_left", "left_foot", "point_foot", 0.025, true),
            ("front_right", "right_foot", "point_foot", 0.025, true),
        ]
    );
    let text = Text { name: "rover.urdf", text: URDF };
    let robot = import(text, Text { name: "template", text: &found.template }).unwrap().robot;
    assert_eq!(robot.joints.len(), 5);
    let toml = import(text, Text { name: "template", text: &found.template }).unwrap().toml;
    assert!(is_unchanged(&toml) && is_unchanged(&toml.replace('\n', "\r\n")), "{toml}");
    let line = toml.lines().find(|line| line.contains("is unchanged")).unwrap();
    for edited in [toml.replacen("kp_nm_rad = ", "kp_nm_rad = 1", 1), toml.replace(line, "")] {
        assert!(edited != toml && !is_unchanged(&edited), "{edited}");
    }
    assert!(found.template.contains("[lock]\nmast = 0.0\nnod = 0.0"), "{}", found.template);
    // Hips are 0.2 m ahead. Both legs, of 0.4 m and with mirrored axes, stand equally deep, and knees bend backward.
    let [left, right] = [&found.end_effectors[2].center_m, &found.end_effectors[3].center_m];
    assert!((left[0] - 0.2).abs() < 0.006 && (right[0] - 0.2).abs() < 0.006, "{left:?} {right:?}");
    assert!((left[2] - right[2]).abs() < 0.006, "{left:?} {right:?}");
    let nominal =
        |name: &str| robot.joints.iter().find(|joint| joint.name == name).unwrap().nominal_rad;
    assert!(nominal("left_hip") > 0.3 && nominal("left_knee") < -0.6);
    assert!(nominal("right_hip") < -0.3 && nominal("right_knee") > 0.6);
}

#[test]
fn limits_choose_the_side_of_the_knee() {
    let urdf = edited(URDF, "lower=\"-2.5\" upper=\"-0.3\"", "lower=\"0.3\" upper=\"2.5\"");
    let template = surveyed(&urdf).template;
    let knee = template.lines().find(|line| line.starts_with("left_knee")).unwrap();
    assert!(!knee.contains('-'), "{knee}");
}

#[test]
fn wheels_are_known_by_name_shape_or_balance() {
    let plain = URDF.replace("_wheel\"", "_disc\"");
    let bare = plain.replace(
        "<geometry><cylinder radius=\"0.07\" length=\"0.03\"/></geometry>",
        "<geometry><mesh filename=\"w.dae\"/></geometry>",
    );
    for (urdf, measured) in [(&plain, true), (&bare, false)] {
        let found = surveyed(urdf);
        let wheels: Vec<_> =
            found.end_effectors.iter().filter(|end| end.contact == "actuated_wheel").collect();
        assert_eq!(wheels.len(), 2);
        assert!(wheels.iter().all(|wheel| wheel.measured == measured));
    }
    // A continuous joint whose child hangs beside the axis is a leg.
    let leg = edited(
        URDF,
        "name=\"right_knee\" type=\"revolute\"",
        "name=\"right_knee\" type=\"continuous\"",
    );
    assert_eq!(
        surveyed(&leg).end_effectors.iter().filter(|end| end.contact == "point_foot").count(),
        2
    );
}

/// Tests axles as revolute joints, which some exporters write without limits or with limits beyond a turn.
#[test]
fn wheels_on_revolute_and_fixed_joints_are_known() {
    let axle = |kind: &str, limits: &str| {
        let urdf = edited(
            URDF,
            "name=\"left_axle\" type=\"continuous\"",
            &format!("name=\"left_axle\" type=\"{kind}\""),
        );
        let (before, after) = urdf.split_once("name=\"left_axle\"").unwrap();
        let after = after.replacen("velocity=\"30\"", &format!("{limits} velocity=\"30\""), 1);
        format!("{before}name=\"left_axle\"{after}")
    };
    let kind = |urdf: &str, link: &str| {
        let found = surveyed(urdf);
        let robot =
            import(Text { name: "u", text: urdf }, Text { name: "t", text: &found.template });
        robot.unwrap_or_else(|error| panic!("{error}\n{}", found.template));
        let end = found.end_effectors.iter().find(|end| end.link == link);
        end.map(|end| end.contact.clone())
    };
    let limits = "lower=\"-1000\" upper=\"1000\"";
    for urdf in [axle("revolute", ""), axle("revolute", limits)] {
        assert_eq!(kind(&urdf, "left_wheel").as_deref(), Some("actuated_wheel"), "{urdf}");
        // Limits of many turns count as none, and the shape identifies the wheel without its name.
        let disc = urdf.replace("\"left_wheel\"", "\"left_disc\"");
        assert_eq!(kind(&disc, "left_disc").as_deref(), Some("actuated_wheel"), "{disc}");
    }
    let welded = axle("fixed", "");
    assert_eq!(kind(&welded, "left_wheel").as_deref(), Some("welded_wheel"));
    let template = surveyed(&welded).template;
    assert!(template.contains("contact = \"welded_wheel\"\nlink = \"left_wheel\""), "{template}");
    assert!(template.contains("axis_in_link = [0.0, -1.0, "), "{template}");
}

#[test]
fn several_roots_are_settled_in_the_template() {
    let urdf = edited(
        URDF,
        "<link name=\"base_link\"/>",
        "<link name=\"spare\"/><link name=\"base_link\"/>",
    );
    let found = surveyed(&urdf);
    assert!(found.template.contains("root = \"base_link\""), "{}", found.template);
    import(Text { name: "u", text: &urdf }, Text { name: "t", text: &found.template }).unwrap();
}

#[test]
fn robots_without_feet_are_told_so() {
    let found = surveyed(
        "<robot name=\"box\"><link name=\"b\"><inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial></link></robot>",
    );
    assert!(found.warnings.iter().any(|warning| warning.contains("no part looks like a foot")));
    assert_eq!(found.standing_height_m, None);
}
