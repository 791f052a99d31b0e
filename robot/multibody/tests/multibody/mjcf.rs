//! MuJoCo models of robots.
//!
//! A spinning wheel becomes a separate body with a hinge. Its mass and inertia are subtracted from its link, so that link and
//! wheel together equal the link of the robot file.

use crate::robots::wheel_mass_kg;
use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::{Tree, Wheel};
use rollwalk_robot::{CrankMap, Joint, JointSpring, Robot};
use std::fmt::Write;

/// MuJoCo model of a robot with armature and spinning wheels, which are thin discs.
pub fn model(tree: &Tree) -> String {
    let mut out = format!(
        "<mujoco model=\"{}\">\n<compiler angle=\"radian\" autolimits=\"false\"/>\n<worldbody>\n\
         <body name=\"{}\">\n<freejoint/>\n",
        tree.robot().name,
        tree.robot().links[0].name
    );
    link(tree, 0, &mut out);
    out += "</worldbody>\n";
    let robot = tree.robot();
    if robot.joints.iter().any(Joint::is_coupled) {
        out += "<tendon>\n";
        for joint in robot.joints.iter().filter(|joint| joint.linkage.is_some()) {
            let name = &joint.name;
            writeln!(out, "<spatial name=\"{name}_rod\">").unwrap();
            writeln!(out, "<site site=\"{name}_pin\"/><site site=\"{name}_end\"/></spatial>")
                .unwrap();
        }
        for joint in robot.joints.iter().filter(|joint| !joint.motor_per_joint.is_empty()) {
            let armature = joint.actuator.armature_kg_m2;
            writeln!(out, "<fixed armature=\"{armature:?}\">").unwrap();
            for of in &joint.motor_per_joint {
                let (name, ratio) = (&tree.robot().joints[of.joint].name, of.ratio);
                writeln!(out, "<joint joint=\"{name}\" coef=\"{ratio:?}\"/>").unwrap();
            }
            out += "</fixed>\n";
        }
        out += "</tendon>\n<equality>\n";
        for joint in &robot.joints {
            let Some(linkage) = &joint.linkage else { continue };
            let crank = CrankMap::new(robot, joint, linkage).unwrap();
            let zero = vec![0.0; robot.joints.len()];
            let longer_m = crank.rod_m() - crank.distance_from_nominal_pin_m(&zero);
            let name = &joint.name;
            writeln!(out, "<tendon tendon1=\"{name}_rod\" polycoef=\"{longer_m:?} 0 0 0 0\"/>")
                .unwrap();
        }
        out += "</equality>\n";
    }
    out += "</mujoco>\n";
    out
}

/// Writes inertial properties, wheels and children of a link, up to the end of its body.
fn link(tree: &Tree, index: usize, out: &mut String) {
    let robot = tree.robot();
    let body = &robot.links[index];
    let wheels: Vec<&Wheel> = tree.wheels().iter().filter(|wheel| wheel.link == index).collect();
    let center = |wheel: &Wheel| robot.end_effectors[wheel.end_effector].center_in_link_m;

    let mut mass_kg = body.mass_kg;
    let mut moment = body.com_in_link_m * body.mass_kg;
    for wheel in &wheels {
        let wheel_kg = mass_of(robot, wheel);
        mass_kg -= wheel_kg;
        moment -= center(wheel) * wheel_kg;
    }
    let com = moment / mass_kg;
    let mut inertia =
        body.inertia_in_link_kg_m2 + offset(&(body.com_in_link_m - com), body.mass_kg);
    for wheel in &wheels {
        inertia -= disc(robot, wheel) + offset(&(center(wheel) - com), mass_of(robot, wheel));
    }
    inertial(mass_kg, &com, &inertia, out);
    for wheel in wheels {
        let ee = &robot.end_effectors[wheel.end_effector];
        let (name, axis) = (&ee.name, wheel.axis_in_link);
        let armature = wheel.armature_kg_m2;
        writeln!(out, "<body name=\"wheel:{name}\" pos=\"{}\">", numbers(ee.center_in_link_m))
            .unwrap();
        hinge(&format!("wheel:{name}"), &axis, armature, None, out);
        inertial(mass_of(robot, wheel), &Vector3::zeros(), &disc(robot, wheel), out);
        *out += "</body>\n";
    }
    for joint in &robot.joints {
        let (name, Some(linkage)) = (&joint.name, &joint.linkage) else { continue };
        if joint.child == index {
            let end = numbers(linkage.rod_in_child_m);
            writeln!(out, "<site name=\"{name}_end\" pos=\"{end}\"/>").unwrap();
        }
        if linkage.link != index {
            continue;
        }
        let (pivot, axis) = (numbers(linkage.pivot_in_link_m), numbers(linkage.axis_in_link));
        let pin = numbers(linkage.pin_in_link_m - linkage.pivot_in_link_m);
        let (reference, armature) = (linkage.nominal_rad, joint.actuator.armature_kg_m2);
        writeln!(
            out,
            "<body pos=\"{pivot}\"><joint name=\"{name}_servo\" axis=\"{axis}\" ref=\"{reference:?}\" \
             armature=\"{armature:?}\"/><inertial pos=\"0 0 0\" mass=\"1e-9\" \
             diaginertia=\"1e-12 1e-12 1e-12\"/><site name=\"{name}_pin\" pos=\"{pin}\"/></body>"
        )
        .unwrap();
    }
    for joint in robot.joints.iter().filter(|joint| joint.parent == index) {
        let pose = &joint.parent_from_joint;
        let q = pose.rotation.quaternion();
        let position = numbers(pose.translation.vector);
        let name = &robot.links[joint.child].name;
        let quaternion = format!("{:?} {:?} {:?} {:?}", q.w, q.i, q.j, q.k);
        writeln!(out, "<body name=\"{name}\" pos=\"{position}\" quat=\"{quaternion}\">").unwrap();
        // The rotor of a coupled motor is in its tendon.
        let armature = if joint.is_coupled() { 0.0 } else { joint.actuator.armature_kg_m2 };
        let kind = if joint.is_prismatic() { "slide" } else { "hinge" };
        movable(kind, &joint.name, &joint.axis_in_joint, armature, joint.spring, out);
        link(tree, joint.child, out);
    }
    *out += "</body>\n";
}

fn hinge(
    name: &str,
    axis: &Vector3<f64>,
    armature_kg_m2: f64,
    spring: Option<JointSpring>,
    out: &mut String,
) {
    movable("hinge", name, axis, armature_kg_m2, spring, out);
}

fn movable(
    kind: &str,
    name: &str,
    axis: &Vector3<f64>,
    armature_kg_m2: f64,
    spring: Option<JointSpring>,
    out: &mut String,
) {
    let axis = numbers(*axis);
    write!(
        out,
        "<joint name=\"{name}\" type=\"{kind}\" axis=\"{axis}\" armature=\"{armature_kg_m2:?}\""
    )
    .unwrap();
    if let Some(JointSpring { stiffness_nm_rad, rest_rad, damping_nm_s_rad }) = spring {
        write!(
            out,
            " stiffness=\"{stiffness_nm_rad:?}\" springref=\"{rest_rad:?}\" \
             damping=\"{damping_nm_s_rad:?}\""
        )
        .unwrap();
    }
    *out += "/>\n";
}

fn inertial(mass_kg: f64, com: &Vector3<f64>, inertia: &Matrix3<f64>, out: &mut String) {
    let i = |row: usize, column: usize| inertia[(row, column)];
    let full = [i(0, 0), i(1, 1), i(2, 2), i(0, 1), i(0, 2), i(1, 2)].map(|x| format!("{x:?}"));
    let (com, full) = (numbers(*com), full.join(" "));
    writeln!(out, "<inertial pos=\"{com}\" mass=\"{mass_kg:?}\" fullinertia=\"{full}\"/>").unwrap();
}

fn mass_of(robot: &Robot, wheel: &Wheel) -> f64 {
    wheel_mass_kg(robot, &robot.end_effectors[wheel.end_effector])
}

/// Inertia of a thin disc about its centre. The inertia across its axis is half of the inertia about its axis.
fn disc(robot: &Robot, wheel: &Wheel) -> Matrix3<f64> {
    let ee = &robot.end_effectors[wheel.end_effector];
    let about = 0.5 * mass_of(robot, wheel) * ee.radius_m.powi(2);
    let axis = wheel.axis_in_link;
    (Matrix3::identity() + axis * axis.transpose()) * (0.5 * about)
}

/// Inertia of a point mass at a distance.
fn offset(d: &Vector3<f64>, mass_kg: f64) -> Matrix3<f64> {
    (Matrix3::from_diagonal_element(d.norm_squared()) - d * d.transpose()) * mass_kg
}

fn numbers(v: Vector3<f64>) -> String {
    format!("{:?} {:?} {:?}", v.x, v.y, v.z)
}
