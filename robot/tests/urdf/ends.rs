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

/// Two legs with soles and two arms beside them. With `rolls`, hips and ankles also turn about the forward axis.
fn humanoid(sole: &str, rolls: bool) -> Made {
    let mut made = Made::default();
    made.link("torso", 20.0, [0.0, 0.0, 0.3], 0.5, &cuboid([0.2, 0.3, 0.5], [0.0, 0.0, 0.3]));
    for (side, y) in [("left", 0.1), ("right", -0.1)] {
        let name = |part: &str| format!("{side}_{part}");
        let knee = "lower=\"0\" upper=\"2.5\" effort=\"80\" velocity=\"9\"";
        let (pitch, roll) = ([0.0, 1.0, 0.0], [1.0, 0.0, 0.0]);
        let (mut hip, mut hip_at, mut foot, mut ankle_at) =
            ("torso".to_owned(), [0.0, y, 0.0], name("shank"), [0.0, 0.0, -0.4]);
        made.link(&name("thigh"), 3.0, [0.0, 0.0, -0.2], 0.05, "");
        made.link(&name("shank"), 2.0, [0.0, 0.0, -0.2], 0.03, "");
        made.link(&name("end"), 0.8, [0.02, 0.0, -0.05], 2e-3, sole);
        if rolls {
            for (joint, parent, child, at) in [
                ("hip_roll", &mut hip, "hip_link", &mut hip_at),
                ("ankle_roll", &mut foot, "ankle_link", &mut ankle_at),
            ] {
                made.link(&name(child), 0.3, [0.0; 3], 1e-3, "");
                made.joint("revolute", [&name(joint), parent, &name(child)], *at, roll, WIDE);
                (*parent, *at) = (name(child), [0.0; 3]);
            }
        }
        made.joint("revolute", [&name("hip"), &hip, &name("thigh")], hip_at, pitch, WIDE);
        let ends = [name("knee"), name("thigh"), name("shank")];
        made.joint("revolute", ends.each_ref().map(String::as_str), [0.0, 0.0, -0.4], pitch, knee);
        made.joint("revolute", [&name("ankle"), &foot, &name("end")], ankle_at, pitch, WIDE);
        made.link(&name("arm"), 1.5, [0.0, 0.0, -0.15], 0.02, "");
        made.link(&name("hand"), 0.8, [0.0, 0.0, -0.15], 5e-3, &ball(0.04, [0.0, 0.0, -0.25]));
        let ends = [name("shoulder"), "torso".to_owned(), name("arm")];
        made.joint(
            "revolute",
            ends.each_ref().map(String::as_str),
            [0.0, 2.0 * y, 0.5],
            pitch,
            WIDE,
        );
        let ends = [name("elbow"), name("arm"), name("hand")];
        made.joint("revolute", ends.each_ref().map(String::as_str), [0.0, 0.0, -0.3], pitch, WIDE);
    }
    made
}

#[test]
fn a_sole_lies_flat_and_points_forward_although_its_hip_is_oblique() {
    // The axis of the hip is 21° off the lateral axis.
    let mut made = humanoid(&cuboid([0.2, 0.08, 0.03], [0.03, 0.0, -0.065]), true);
    for side in ["left", "right"] {
        let joint = format!("<joint name=\"{side}_hip\"");
        let (before, after) = made.text.split_once(&joint).unwrap();
        let turned = after.replacen("xyz=\"0 1 0\"", "xyz=\"0.25 0.93 0.25\"", 1);
        made.text = format!("{before}{joint}{turned}");
    }
    let found = imported(&made.urdf()).0;
    let bottoms = found.end_effectors.iter().map(|end| end.center_m[2] - end.radius_m);
    let [low, high] = [bottoms.clone().reduce(f64::min), bottoms.reduce(f64::max)];
    assert!(high.unwrap() - low.unwrap() < 1e-3, "{found:?}");
    let [toe, _, heel, _] = &found.end_effectors[..4] else { panic!("{found:?}") };
    assert!((toe.center_m[1] - heel.center_m[1]).abs() < 0.03, "{found:?}");
}

#[test]
fn a_sole_that_is_oblique_while_the_joints_are_at_0_lies_flat_too() {
    // Plates that point down by 10° or 20°.
    for down_rad in [0.175, 0.35] {
        let plate = "<box size=\"0.2 0.08 0.012\"/>";
        let sole = solid(plate, [0.03, 0.0, -0.065], [0.0, down_rad, 0.0]);
        let (found, robot) = imported(&humanoid(&sole, true).urdf());
        assert_eq!(robot.end_effectors.len(), 8);
        let bottoms = found.end_effectors.iter().map(|end| end.center_m[2] - end.radius_m);
        let [low, high] = [bottoms.clone().reduce(f64::min), bottoms.reduce(f64::max)];
        assert!(high.unwrap() - low.unwrap() < 1e-3, "{found:?}");
    }
}

#[test]
fn a_sole_from_a_wrong_inertia_is_a_point() {
    let heavy = humanoid("", true).urdf().replace("ixx=\"0.002\"", "ixx=\"1\"");
    let heavy = heavy.replace("iyy=\"0.002\"", "iyy=\"1\"").replace("izz=\"0.002\"", "izz=\"1\"");
    assert_eq!(imported(&heavy).1.end_effectors.len(), 2);
}

/// Contacts of a foot in the frame of its link: name, and the sphere's centre without its radius inward and up.
fn sole_of(
    robot: &rollwalk_robot::Robot,
    foot: &str,
    middle: [f64; 2],
) -> Vec<(String, Vector3<f64>)> {
    let of_foot = robot.end_effectors.iter().filter(|end| end.name.starts_with(foot));
    of_foot
        .map(|end| {
            let at = end.center_in_link_m;
            let out = |axis: usize| match at[axis] - middle[axis] {
                away if away.abs() < 1e-9 => 0.0,
                away => end.radius_m.copysign(away),
            };
            (end.name.clone(), at + Vector3::new(out(0), out(1), -end.radius_m))
        })
        .collect()
}

#[test]
fn a_humanoid_stands_level_on_its_soles_below_its_centre_of_mass() {
    let rod = "<cylinder radius=\"0.02\" length=\"0.2\"/>";
    let lying = solid(rod, [0.03, 0.02, -0.06], [0.0, std::f64::consts::FRAC_PI_2, 0.0])
        + &solid(rod, [0.03, -0.02, -0.06], [0.0, std::f64::consts::FRAC_PI_2, 0.0]);
    let dots: String = [0.1, -0.04]
        .iter()
        .map(|x| ball(0.002, [*x, 0.02, -0.078]) + &ball(0.002, [*x, -0.02, -0.078]))
        .collect();
    for (sole, [toe, side]) in [
        (cuboid([0.2, 0.08, 0.03], [0.03, 0.0, -0.065]), [0.1, 0.04]),
        // Rods end in balls of 20 mm.
        (lying, [0.08, 0.02]),
        (dots, [0.07, 0.02]),
    ] {
        for rolls in [true, false] {
            let (found, robot) = imported(&humanoid(&sole, rolls).urdf());
            let mut expected = vec![];
            let sides: &[(&str, f64)] =
                if rolls { &[("_left", 1.0), ("_right", -1.0)] } else { &[("", 0.0)] };
            for (end, fore) in [("left_toe", 1.0), ("left_heel", -1.0)] {
                for (name, left) in sides {
                    let at = Vector3::new(0.03 + fore * toe, left * side, -0.08);
                    expected.push((format!("{end}{name}"), at));
                }
            }
            let sole = sole_of(&robot, "left", [0.03, 0.0]);
            assert_eq!(robot.end_effectors.len(), 2 * expected.len());
            for ((name, at), (expected_name, expected_at)) in sole.iter().zip(&expected) {
                assert_eq!(name, expected_name);
                // Balls lie below their centre, others reach out to the edge.
                let radius_m = robot.end_effectors[0].radius_m;
                let apart = at - expected_at;
                assert!(apart.z.abs() < 1e-9 && apart.xy().norm() < 1.5 * radius_m, "{name}: {at}");
            }
            let angle = |name: &str| {
                robot.joints.iter().find(|joint| joint.name == name).unwrap().nominal_rad
            };
            let turned = angle("left_hip") + angle("left_knee") + angle("left_ankle");
            assert!(turned.abs() < 5e-3 && angle("left_knee") > 0.3, "{turned}");
            let bottoms = found.end_effectors.iter().map(|end| end.center_m[2] - end.radius_m);
            let [low, high] = [bottoms.clone().reduce(f64::min), bottoms.reduce(f64::max)];
            assert!(high.unwrap() - low.unwrap() < 1e-3, "{found:?}");
            assert!(!warned(&found, &["above the ground"]), "{:?}", found.warnings);
        }
    }
}

#[test]
fn a_sole_without_a_shape_has_the_size_of_its_inertia_above_its_lowest_frame() {
    let (found, robot) = imported(&humanoid("", true).urdf());
    assert!(found.end_effectors.iter().all(|end| !end.measured));
    // A cube of 0.8 kg and 2 g·m² about each axis.
    let half_m = (1.5 * 2e-3 / 0.8_f64).sqrt();
    for end in &robot.end_effectors {
        let at = end.center_in_link_m - Vector3::new(0.02, 0.0, -0.05);
        assert!((at.x.abs() - half_m).abs() < 1e-9 && (at.y.abs() - half_m).abs() < 1e-9, "{at}");
        assert!((at.z - end.radius_m + half_m).abs() < 1e-9, "{at}");
    }
    let mut framed = humanoid("", true);
    for side in ["left", "right"] {
        let [joint, link, sole] = ["fixed", "end", "sole"].map(|part| format!("{side}_{part}"));
        framed.text += &format!("<link name=\"{sole}\"/>");
        framed.joint("fixed", [&joint, &link, &sole], [0.0, 0.0, -0.09], [0.0, 1.0, 0.0], "");
    }
    let (_, robot) = imported(&framed.urdf());
    for end in &robot.end_effectors {
        assert!((end.center_in_link_m.z - end.radius_m + 0.09).abs() < 1e-9, "{end:?}");
    }
}

#[test]
fn the_end_of_a_shank_is_no_sole() {
    // Its box is higher than long, although the leg has three joints about the same axis.
    let shank = cuboid([0.03, 0.03, 0.16], [0.0, 0.0, -0.1]);
    let (_, robot) = imported(&humanoid(&shank, true).urdf());
    let names: Vec<_> = robot.end_effectors.iter().map(|end| end.name.as_str()).collect();
    assert_eq!(names, ["left_end", "right_end"]);
    // Without an ankle, a plate at the end of the shank is not level.
    let mut made = Made::trunk();
    for (name, x, y) in CORNERS {
        made.limb(name, "trunk", [x, y, 0.0]);
        made.link(
            &format!("{name}_plate"),
            0.05,
            [0.0; 3],
            1e-5,
            &cuboid([0.3, 0.1, 0.02], [0.0; 3]),
        );
        let ends = [&*format!("{name}_rigid"), &format!("{name}_shank"), &format!("{name}_plate")];
        made.joint("fixed", ends, [0.0, 0.0, -0.2], [0.0, 1.0, 0.0], "");
    }
    let (_, robot) = imported(&made.urdf());
    assert_eq!(robot.end_effectors.len(), 4);
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
    let sole = cuboid([0.2, 0.08, 0.03], [0.03, 0.0, -0.065]);
    let (_, robot) = imported(&humanoid(&sole, true).urdf());
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
