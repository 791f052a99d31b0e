//! Tests that mechanics, not names, decide on wheels and feet and on their places.

use super::made::{
    AXLE, CORNERS, Made, WIDE, ball, contacts, cuboid, disc, imported, solid, warned,
};
use nalgebra::Vector3;

/// Quadruped with a body of the given kind behind an endless joint at the end of each leg.
fn rolling(name: &str, joint: (&str, &str), shapes: &str, com: [f64; 3]) -> String {
    let mut made = Made::trunk();
    for (leg, x, y) in CORNERS {
        made.limb(leg, "trunk", [x, y, 0.0]);
        let (link, axle) = (format!("{leg}_{name}"), format!("{leg}_last"));
        made.link(&link, 0.5, com, 1e-3, shapes);
        let ends = [&*axle, &format!("{leg}_shank"), &link];
        made.joint(joint.0, ends, [0.0, 0.0, -0.2], [0.0, -1.0, 0.0], joint.1);
    }
    made.urdf()
}

#[test]
fn what_rolls_at_the_end_of_a_limb_is_a_wheel_whatever_its_name() {
    let mesh = "<collision><geometry><mesh filename=\"m.stl\"/></geometry></collision>";
    for name in ["toe", "paw", "foot_contact", "disc"] {
        for joint in [
            ("continuous", AXLE),
            ("revolute", AXLE),
            ("revolute", "lower=\"-1e16\" upper=\"1e16\" effort=\"5\""),
        ] {
            for (shapes, com) in [(disc(0.06, 0.02), [0.0; 3]), (mesh.to_owned(), [0.0, 0.01, 0.0])]
            {
                let (found, _) = imported(&rolling(name, joint, &shapes, com));
                let kinds: Vec<_> = contacts(&found).into_iter().map(|(_, kind)| kind).collect();
                assert_eq!(kinds, ["actuated_wheel"; 4], "{name} {joint:?} {shapes}");
            }
        }
    }
}

#[test]
fn what_swings_is_no_wheel_though_its_name_says_so() {
    // A shank behind a continuous knee, and a wheel leg with limits.
    let shank = solid("<cylinder radius=\"0.01\" length=\"0.12\"/>", [0.0, 0.0, -0.06], [0.0; 3]);
    let (found, _) = imported(&rolling("wheel", ("continuous", AXLE), &shank, [0.0, 0.0, -0.06]));
    assert!(contacts(&found).iter().all(|(_, kind)| *kind == "point_foot"), "{found:?}");
    let (found, _) = imported(&rolling("wheel", ("revolute", WIDE), &shank, [0.0, 0.0, -0.06]));
    assert!(contacts(&found).iter().all(|(_, kind)| *kind == "point_foot"), "{found:?}");
}

/// Cart with four axles whose wheels have the given links.
fn cart(wheel: impl Fn(&mut Made, &str), limits: &str) -> Made {
    let mut made = Made::trunk();
    for (name, x, y) in CORNERS {
        wheel(&mut made, name);
        made.joint(
            "continuous",
            [&format!("{name}_axle"), "trunk", &format!("{name}_hub")],
            [x, y, -0.05],
            [0.0, 1.0, 0.0],
            limits,
        );
    }
    made
}

#[test]
fn the_radius_is_that_of_the_outermost_body_on_the_axle() {
    let made = cart(
        |made, name| {
            let [hub, rim, tyre] = ["hub", "rim", "tyre"].map(|part| format!("{name}_{part}"));
            made.link(&hub, 0.2, [0.0; 3], 1e-4, &disc(0.02, 0.03));
            made.link(&rim, 0.2, [0.0; 3], 1e-4, &disc(0.05, 0.03));
            made.link(&tyre, 0.2, [0.0; 3], 1e-4, &disc(0.08, 0.03));
            made.joint(
                "fixed",
                [&format!("{rim}_fixed"), &hub, &rim],
                [0.0, 0.01, 0.0],
                [0.0, 1.0, 0.0],
                "",
            );
            made.joint(
                "fixed",
                [&format!("{tyre}_fixed"), &rim, &tyre],
                [0.0, 0.02, 0.0],
                [0.0, 1.0, 0.0],
                "",
            );
        },
        AXLE,
    );
    let (found, robot) = imported(&made.urdf());
    assert!(found.end_effectors.iter().all(|end| end.radius_m == 0.08 && end.measured));
    // Both fixed joints move the tyre outward, and its centre is given in the frame of the hub.
    let y =
        |link: &str| found.end_effectors.iter().find(|end| end.link == link).unwrap().center_m[1];
    assert!((y("LF_hub") - 0.13).abs() < 1e-12, "{found:?}");
    assert_eq!(robot.end_effectors.len(), 4);
}

#[test]
fn a_cylinder_across_its_axle_is_named_with_the_radius() {
    let upright = solid("<cylinder radius=\"0.07\" length=\"0.02\"/>", [0.0; 3], [0.0; 3]);
    let made =
        cart(|made, name| made.link(&format!("{name}_hub"), 0.3, [0.0; 3], 6e-4, &upright), AXLE);
    let (found, _) = imported(&made.urdf());
    assert!(
        warned(&found, &["`LF_hub`", "across the axis of joint `LF_axle`", "0.07 m"]),
        "{found:?}"
    );
    assert!(found.end_effectors.iter().all(|end| end.radius_m == 0.07));
}

#[test]
fn wheels_without_limit_are_passive_with_a_warning_if_other_joints_have_motors() {
    let wheel = |made: &mut Made, name: &str| {
        made.link(&format!("{name}_hub"), 0.3, [0.0; 3], 6e-4, &disc(0.06, 0.03));
    };
    let kinds = |text: &str, kind: &str| {
        let (found, _) = imported(text);
        (found.end_effectors.iter().filter(|end| end.contact == kind).count(), found)
    };
    // A file without motors does not describe which joints have one.
    let (driven, found) = kinds(&cart(wheel, "").urdf(), "actuated_wheel");
    assert!(driven == 4 && found.warnings.is_empty(), "{:?}", found.warnings);
    let mut made = cart(wheel, "");
    made.link("camera", 0.1, [0.0; 3], 1e-4, "");
    made.joint("revolute", ["tilt", "trunk", "camera"], [0.2, 0.0, 0.1], [0.0, 1.0, 0.0], WIDE);
    let (free, found) = kinds(&made.urdf(), "passive_wheel");
    assert_eq!(free, 4);
    assert!(warned(&found, &["`LF_axle`", "passive", "actuated_wheel"]), "{:?}", found.warnings);
}

#[test]
fn arms_heads_and_tails_are_no_feet() {
    let mut made = Made::quadruped();
    made.link("tail", 0.2, [-0.1, 0.0, 0.0], 1e-3, "");
    made.joint("revolute", ["wag", "trunk", "tail"], [-0.25, 0.0, 0.0], [0.0, 0.0, 1.0], WIDE);
    made.link("neck", 0.2, [0.0, 0.0, 0.1], 1e-3, "");
    made.link("foot_of_the_head", 0.3, [0.05, 0.0, 0.0], 1e-3, &ball(0.05, [0.05, 0.0, 0.0]));
    made.joint("revolute", ["lift", "trunk", "neck"], [0.25, 0.0, 0.0], [0.0, 1.0, 0.0], WIDE);
    made.joint(
        "revolute",
        ["nod", "neck", "foot_of_the_head"],
        [0.0, 0.0, 0.2],
        [0.0, 1.0, 0.0],
        WIDE,
    );
    let (found, robot) = imported(&made.urdf());
    let links: Vec<_> = contacts(&found).into_iter().map(|(link, _)| link).collect();
    assert_eq!(links, ["LF_ball", "LH_ball", "RF_ball", "RH_ball"]);
    assert_eq!(robot.joints.len(), 15, "the others stay joints");
}

/// A finger before the legs in the file gets the bus after theirs.
#[test]
fn legs_get_their_buses_before_arms() {
    let mut made = Made::trunk();
    made.link("finger", 0.2, [0.0, 0.0, 0.05], 1e-4, "");
    made.joint("revolute", ["press", "trunk", "finger"], [0.1, 0.0, 0.1], [0.0, 1.0, 0.0], WIDE);
    for (name, x, y) in CORNERS {
        made.leg(name, "trunk", [x, y, 0.0]);
    }
    let (_, robot) = imported(&made.urdf());
    let bus = |name: &str| {
        let joint = robot.joints.iter().find(|joint| joint.name == name).unwrap();
        joint.actuator.bus
    };
    let buses = ["LF_roll", "RF_knee", "LH_roll", "RH_knee", "press"].map(bus);
    assert_eq!(buses, [0, 0, 1, 1, 2]);
}

/// Two legs with soles, two arms beside them and a head.
fn humanoid(sole: &str) -> String {
    let mut made = Made::default();
    made.link("torso", 20.0, [0.0, 0.0, 0.3], 0.5, &cuboid([0.2, 0.3, 0.5], [0.0, 0.0, 0.3]));
    for (side, y) in [("left", 0.1), ("right", -0.1)] {
        let name = |part: &str| format!("{side}_{part}");
        made.link(&name("thigh"), 3.0, [0.0, 0.0, -0.2], 0.05, "");
        made.link(&name("shank"), 2.0, [0.0, 0.0, -0.2], 0.03, "");
        made.link(&name("end"), 0.8, [0.02, 0.0, -0.05], 2e-3, sole);
        let knee = "lower=\"0\" upper=\"2.5\" effort=\"80\" velocity=\"9\"";
        made.joint(
            "revolute",
            [&name("hip"), "torso", &name("thigh")],
            [0.0, y, 0.0],
            [0.0, 1.0, 0.0],
            WIDE,
        );
        made.joint(
            "revolute",
            [&name("knee"), &name("thigh"), &name("shank")],
            [0.0, 0.0, -0.4],
            [0.0, 1.0, 0.0],
            knee,
        );
        made.joint(
            "revolute",
            [&name("ankle"), &name("shank"), &name("end")],
            [0.0, 0.0, -0.4],
            [0.0, 1.0, 0.0],
            WIDE,
        );
        made.link(&name("arm"), 1.5, [0.0, 0.0, -0.15], 0.02, "");
        made.link(&name("hand"), 0.8, [0.0, 0.0, -0.15], 5e-3, &ball(0.04, [0.0, 0.0, -0.25]));
        made.joint(
            "revolute",
            [&name("shoulder"), "torso", &name("arm")],
            [0.0, 2.0 * y, 0.5],
            [0.0, 1.0, 0.0],
            WIDE,
        );
        made.joint(
            "revolute",
            [&name("elbow"), &name("arm"), &name("hand")],
            [0.0, 0.0, -0.3],
            [0.0, 1.0, 0.0],
            WIDE,
        );
    }
    made.urdf()
}

#[test]
fn a_humanoid_stands_level_on_its_soles_below_its_centre_of_mass() {
    let rod = "<cylinder radius=\"0.02\" length=\"0.2\"/>";
    let lying = solid(rod, [0.03, 0.02, -0.06], [0.0, std::f64::consts::FRAC_PI_2, 0.0])
        + &solid(rod, [0.03, -0.02, -0.06], [0.0, std::f64::consts::FRAC_PI_2, 0.0]);
    let dots: String = [0.1, -0.04]
        .iter()
        .map(|x| ball(0.01, [*x, 0.02, -0.07]) + &ball(0.01, [*x, -0.02, -0.07]))
        .collect();
    for (sole, bottom_m, radius_m) in [
        (cuboid([0.2, 0.08, 0.03], [0.03, 0.0, -0.065]), -0.08, 0.015),
        (lying, -0.08, 0.02),
        (dots, -0.08, 0.01),
    ] {
        let (found, robot) = imported(&humanoid(&sole));
        assert_eq!(
            contacts(&found),
            [("left_end", "point_foot"), ("right_end", "point_foot")],
            "{sole}"
        );
        for end in &robot.end_effectors {
            assert!((end.radius_m - radius_m).abs() < 1e-12, "{sole}: {}", end.radius_m);
            let at = end.center_in_link_m;
            assert!(
                (at - Vector3::new(0.03, 0.0, bottom_m + radius_m)).norm() < 1e-9,
                "{sole}: {at}"
            );
        }
        let angle =
            |name: &str| robot.joints.iter().find(|joint| joint.name == name).unwrap().nominal_rad;
        let turned = angle("left_hip") + angle("left_knee") + angle("left_ankle");
        assert!(turned.abs() < 5e-3 && angle("left_knee") > 0.3, "{sole}: {turned}");
        assert!(!warned(&found, &["above the ground"]), "{:?}", found.warnings);
    }
}

#[test]
fn a_foot_without_shapes_is_where_the_limb_ends() {
    // The mirror image of the joint in the centre of mass, or a link farther out, with any name.
    let mut made = Made::trunk();
    for (name, x, y) in CORNERS {
        made.limb(name, "trunk", [x, y, 0.0]);
    }
    let (_, robot) = imported(&made.urdf());
    for end in &robot.end_effectors {
        assert!((end.center_in_link_m - Vector3::new(0.0, 0.0, -0.2)).norm() < 1e-9, "{end:?}");
    }
    let mut tipped = made.clone();
    for (name, ..) in CORNERS {
        tipped.text += &format!("<link name=\"{name}_frame\"/>");
        let ends = [&*format!("{name}_rigid"), &format!("{name}_shank"), &format!("{name}_frame")];
        tipped.joint("fixed", ends, [0.0, 0.0, -0.22], [0.0, 1.0, 0.0], "");
    }
    let (_, robot) = imported(&tipped.urdf());
    for end in &robot.end_effectors {
        assert!((end.center_in_link_m - Vector3::new(0.0, 0.0, -0.22)).norm() < 1e-9, "{end:?}");
    }
}

#[test]
fn an_empty_link_called_foot_does_not_beat_the_ball_beside_it() {
    let mut made = Made::quadruped();
    for (name, ..) in CORNERS {
        made.text += &format!("<link name=\"{name}_foot\"/>");
        let ends = [&*format!("{name}_rigid"), &format!("{name}_shank"), &format!("{name}_foot")];
        made.joint("fixed", ends, [0.0, 0.0, -0.19], [0.0, 1.0, 0.0], "");
    }
    let (found, _) = imported(&made.urdf());
    assert!(
        found.end_effectors.iter().all(|end| end.radius_m == 0.02 && end.link.ends_with("_ball"))
    );
}

#[test]
fn robots_without_feet_import_too() {
    let mut arm = Made::trunk();
    arm.link("upper", 1.0, [0.0, 0.0, 0.1], 1e-2, "");
    arm.link("gripper", 0.5, [0.0, 0.0, 0.1], 1e-2, "");
    arm.joint("revolute", ["yaw", "trunk", "upper"], [0.0, 0.0, 0.05], [0.0, 0.0, 1.0], WIDE);
    arm.joint("revolute", ["pitch", "upper", "gripper"], [0.0, 0.0, 0.2], [0.0, 1.0, 0.0], WIDE);
    let (found, robot) = imported(&arm.urdf());
    assert!(found.end_effectors.is_empty() && warned(&found, &["no part looks like a foot"]));
    assert_eq!(robot.joints.len(), 2);
}

#[test]
fn a_ball_at_the_height_of_the_wheels_is_a_caster_and_settles_their_radius() {
    let cart = |wheel: &str| {
        let mut made = Made::trunk();
        for (name, y) in [("left", 0.1), ("right", -0.1)] {
            made.link(&format!("{name}_hub"), 0.3, [0.0; 3], 6e-4, wheel);
            let ends = [&*format!("{name}_axle"), "trunk", &format!("{name}_hub")];
            made.joint("continuous", ends, [0.05, y, -0.02], [0.0, 1.0, 0.0], AXLE);
        }
        made.link("prop", 0.1, [0.0; 3], 1e-5, &ball(0.02, [0.0; 3]));
        made.joint(
            "fixed",
            ["prop_fixed", "trunk", "prop"],
            [-0.15, 0.0, -0.06],
            [0.0, 1.0, 0.0],
            "",
        );
        made.link("lidar", 0.1, [0.0; 3], 1e-5, &ball(0.04, [0.0; 3]));
        made.joint(
            "fixed",
            ["lidar_fixed", "trunk", "lidar"],
            [0.1, 0.0, 0.1],
            [0.0, 1.0, 0.0],
            "",
        );
        made.urdf()
    };
    let mesh = "<collision><geometry><mesh filename=\"w.stl\"/></geometry></collision>";
    for wheel in [disc(0.06, 0.02), mesh.to_owned()] {
        let (found, robot) = imported(&cart(&wheel));
        assert_eq!(
            contacts(&found),
            [
                ("left_hub", "actuated_wheel"),
                ("prop", "passive_wheel"),
                ("right_hub", "actuated_wheel")
            ]
        );
        let wheel = robot.end_effectors.iter().find(|end| end.name == "left_hub").unwrap();
        assert!((wheel.radius_m - 0.06).abs() < 1e-12, "{}", wheel.radius_m);
    }
}

/// A shape that lies on the ground would keep the planner from every motion.
#[test]
fn soles_are_no_shapes_and_shanks_end_above_their_feet() {
    let (_, robot) = imported(&humanoid(&cuboid([0.2, 0.08, 0.03], [0.03, 0.0, -0.065])));
    for end in &robot.end_effectors {
        assert!(robot.links[end.link].shapes.is_empty(), "{:?}", robot.links[end.link]);
    }
    let mut made = Made::trunk();
    let rod = solid("<cylinder radius=\"0.02\" length=\"0.2\"/>", [0.0, 0.0, -0.1], [0.0; 3]);
    for (name, x, y) in CORNERS {
        made.limb(name, "trunk", [x, y, 0.0]);
        let shank = format!("<link name=\"{name}_shank\">");
        made.text = made.text.replace(&shank, &format!("{shank}{rod}"));
    }
    let (_, robot) = imported(&made.urdf());
    for end in &robot.end_effectors {
        let [rollwalk_robot::shape::Shape::Capsule { to_in_link_m, from_in_link_m, radius_m }] =
            robot.links[end.link].shapes[..]
        else {
            panic!("{:?}", robot.links[end.link].shapes)
        };
        let low_m = to_in_link_m.z.min(from_in_link_m.z) - radius_m;
        assert!(low_m > end.center_in_link_m.z - end.radius_m && low_m < -0.1, "{low_m}");
    }
}
