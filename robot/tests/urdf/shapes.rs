//! Tests that collision geometry of a URDF becomes shapes for clearance.

use super::made::{CORNERS, Made};
use super::{SIDE, URDF, edited, good};
use nalgebra::Vector3;
use rollwalk_robot::Robot;
use rollwalk_robot::shape::Shape;

fn shapes<'r>(robot: &'r Robot, link: &str) -> &'r [Shape] {
    &robot.links.iter().find(|found| found.name == link).unwrap().shapes
}

fn with_collision(link: &str, geometry: &str) -> String {
    let tag = format!("<link name=\"{link}\">");
    edited(URDF, &tag, &format!("{tag}<collision>{geometry}</collision>"))
}

#[test]
fn feet_wheels_and_visuals_are_no_shapes() {
    assert!(good(URDF, SIDE).robot.links.iter().all(|link| link.shapes.is_empty()));
}

#[test]
fn solids_become_capsules_and_the_box_of_the_body() {
    let check = |geometry: &str, from: [f64; 3], to: [f64; 3], radius_m: f64| {
        let robot = good(&with_collision("left_thigh", geometry), SIDE).robot;
        let capsule =
            Shape::Capsule { from_in_link_m: from.into(), to_in_link_m: to.into(), radius_m };
        assert_eq!(shapes(&robot, "left_thigh"), [capsule], "{geometry}");
    };
    let origin = "<origin xyz=\"0 0.01 -0.1\"/>";
    let geometry = |solid: &str| format!("{origin}<geometry>{solid}</geometry>");
    let slim = geometry("<cylinder radius=\"0.02\" length=\"0.2\"/>");
    check(&slim, [0.0, 0.01, -0.18], [0.0, 0.01, -0.02], 0.02);
    let disc = geometry("<cylinder radius=\"0.05\" length=\"0.04\"/>");
    // (3/4 r² l)^(1/3), the sphere with the same volume.
    check(&disc, [0.0, 0.01, -0.1], [0.0, 0.01, -0.1], 0.0422);
    let sphere = geometry("<sphere radius=\"0.04\"/>");
    check(&sphere, [0.0, 0.01, -0.1], [0.0, 0.01, -0.1], 0.04);
    // Half the diagonal of 0.03 x 0.04.
    let bar = geometry("<box size=\"0.03 0.04 0.2\"/>");
    check(&bar, [0.0, 0.01, -0.175], [0.0, 0.01, -0.025], 0.025);

    // The trunk is rotated in the body; its box is the bounding box.
    let body = with_collision("trunk", "<geometry><box size=\"0.4 0.2 0.1\"/></geometry>");
    let robot = good(&body, SIDE).robot;
    let [Shape::Box { center_in_link_m, size_m }] = shapes(&robot, "base_link") else {
        panic!("{:?}", robot.links[0].shapes)
    };
    assert_eq!(*center_in_link_m, Vector3::new(0.01, 0.02, 0.03));
    assert!(size_m.x > 0.4 && size_m.y > 0.2 && size_m.z > 0.1 && size_m.norm() < 0.8, "{size_m}");
}

#[test]
fn meshes_become_the_box_of_their_inertia_with_a_warning() {
    // 0.6 kg with moments 0.002, 0.002, 0.0004: 6 (I + J − K) / m is 0.004, 0.004, 0.036 m².
    let mesh = with_collision("left_thigh", "<geometry><mesh filename=\"a.stl\"/></geometry>");
    let made = good(&mesh, SIDE);
    assert_eq!(made.warnings.len(), 1, "{:?}", made.warnings);
    let warning = &made.warnings[0];
    assert!(
        warning.contains("`left_thigh`: the import does not read collision meshes"),
        "{warning}"
    );
    let (half, radius) = (0.5 * 0.036_f64.sqrt(), 0.5 * 0.008_f64.sqrt());
    let [Shape::Capsule { from_in_link_m, to_in_link_m, radius_m }] =
        shapes(&made.robot, "left_thigh")
    else {
        panic!("{:?}", made.robot.links)
    };
    // Rounded to 0.1 mm.
    assert!((radius_m - radius).abs() < 1e-4, "{radius_m}");
    let ends = [from_in_link_m, to_in_link_m].map(|end| (end - Vector3::new(0.0, 0.01, -0.09)).z);
    for (end, sign) in [(ends[0].min(ends[1]), -1.0), (ends[0].max(ends[1]), 1.0)] {
        assert!((end - sign * (half - radius)).abs() < 2e-4, "{ends:?}");
    }
}

/// Legs of a quadruped whose shank has a mesh with its centre of mass beyond the foot.
#[test]
fn the_shape_of_a_mesh_is_between_joint_and_foot() {
    let mesh = "<collision><geometry><mesh filename=\"shank.stl\"/></geometry></collision>";
    for com_z_m in [-0.15, -0.2, -0.23, -0.28] {
        let mut made = Made::trunk();
        for (name, x, y) in CORNERS {
            made.leg(name, "trunk", [x, y, 0.0]);
        }
        let shank = "_shank\"><inertial><origin xyz=\"0 0 -0.1\"/><mass value=\"0.2\"/>\
                     <inertia ixx=\"0.0008\" ixy=\"0\" ixz=\"0\" iyy=\"0.0008\" iyz=\"0\" izz=\"0.0008\"/></inertial>";
        assert_eq!(made.text.matches(shank).count(), 4);
        let heavy = shank
            .replace("-0.1", &com_z_m.to_string())
            .replace("izz=\"0.0008\"", "izz=\"0.00002\"");
        made.text = made.text.replace(shank, &format!("{heavy}{mesh}"));
        let (_, robot) = super::made::imported(&made.urdf());
        for end in &robot.end_effectors {
            let foot_m = end.center_in_link_m.z - end.radius_m;
            for shape in &robot.links[end.link].shapes {
                let Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } = shape else {
                    panic!()
                };
                let low_m = from_in_link_m.z.min(to_in_link_m.z) - radius_m;
                assert!(low_m > foot_m, "{com_z_m}: {low_m} {foot_m}");
            }
        }
    }
}

#[test]
fn an_inertia_larger_than_the_robot_gives_no_shape() {
    let mesh = with_collision("left_thigh", "<geometry><mesh filename=\"a.stl\"/></geometry>");
    let huge = edited(
        &mesh,
        "<origin xyz=\"0 0.01 -0.09\"/>\n      <mass value=\"0.6\"/>\n      <inertia ixx=\"0.002\" ixy=\"0\" ixz=\"0\" iyy=\"0.002\"",
        "<origin xyz=\"0 0.01 -0.09\"/>\n      <mass value=\"0.6\"/>\n      <inertia ixx=\"2000\" ixy=\"0\" ixz=\"0\" iyy=\"2000\"",
    );
    let made = good(&huge, SIDE);
    assert!(shapes(&made.robot, "left_thigh").is_empty());
    assert!(
        made.warnings.iter().any(|w| w.contains("`left_thigh`: no shape")),
        "{:?}",
        made.warnings
    );
}
