//! URDF: <https://wiki.ros.org/urdf/XML>.
//!
//! Feet, blades and welded wheels become links on fixed joints, so that they have frames. Joints and axles have the same names as
//! in telemetry. Limits of speed and torque are those of the joints, also if their motors are coupled. URDF cannot express kinds
//! of contacts, friction, gains, rotors, torque-speed lines, couplings, springs and buses; `rollwalk robot import` reads most of
//! these from a side file.

use crate::bodies::{
    Blades, Body, Geometry, Hinge, HingeOrigin, Names, PlacedSolid, Role, WORLD, bodies,
};
use crate::xml::{Xml, numbers, vector};
use nalgebra::Isometry3;
use rollwalk_multibody::RigidPart;
use rollwalk_robot::{Ratios, Robot, Solid, roll_pitch_yaw};
use std::io;

/// Writes a robot as URDF. `parts` are the solids of each link, for pictures.
///
/// # Errors
/// None: the text is written to memory.
pub fn urdf(robot: &Robot, parts: &[Vec<Solid>]) -> io::Result<String> {
    urdf_with(robot, parts, |_, _| Ok(()))
}

/// Writes a robot as URDF, with the elements that `more` adds at the end.
pub fn urdf_with(
    robot: &Robot,
    parts: &[Vec<Solid>],
    more: impl FnOnce(&mut Xml, &[Body<'_>]) -> io::Result<()>,
) -> io::Result<String> {
    let mut xml = Xml::new(&format!("{}, written by rollwalk robot export", robot.name))?;
    let bodies = bodies(robot, parts, Blades::Fixed);
    xml.element("robot", &[("name", robot.name.clone())], |xml| {
        let links = bodies.iter().map(|body| body.name.as_str());
        let mut names = Names::from_iter(links.chain([WORLD]));
        let hinges = bodies.iter().filter_map(|body| body.hinge.as_ref());
        let mut joints = Names::from_iter(hinges.map(|hinge| hinge.name.as_str()));
        for body in &bodies {
            link(xml, body)?;
        }
        let transmission = robot.transmission();
        for body in &bodies {
            if let Some(of) = &body.hinge {
                joint(xml, &bodies, body, of, limits(robot, transmission.nominal(), of))?;
            }
        }
        for foot in robot.end_effectors.iter().filter(|foot| !foot.contact.spins()) {
            let name = names.unique(&foot.name, "_foot");
            xml.empty("link", &[("name", name.clone())])?;
            let place = Isometry3::from(foot.center_in_link_m);
            let mount = joints.unique(&format!("{name}_mount"), "_joint");
            let attributes = [("name", mount), ("type", "fixed".into())];
            xml.element("joint", &attributes, |xml| {
                xml.empty("parent", &[("link", bodies[foot.link].name.clone())])?;
                xml.empty("child", &[("link", name.clone())])?;
                origin(xml, &place)
            })?;
        }
        more(xml, &bodies)
    })?;
    Ok(xml.finish())
}

fn link(xml: &mut Xml, body: &Body<'_>) -> io::Result<()> {
    xml.element("link", &[("name", body.name.clone())], |xml| {
        inertial(xml, &body.inertia)?;
        let has_parts = body.solids.iter().any(|solid| matches!(solid.role, Role::Part));
        for solid in &body.solids {
            let (seen, collides) = match solid.role {
                Role::Part => (true, false),
                Role::Room => (!has_parts, true),
                Role::Contact(_) => (true, true),
            };
            for (element, _) in [("visual", seen), ("collision", collides)].iter().filter(|e| e.1) {
                geometry(xml, element, solid)?;
            }
        }
        Ok(())
    })
}

fn inertial(xml: &mut Xml, inertia: &RigidPart) -> io::Result<()> {
    xml.element("inertial", &[], |xml| {
        origin(xml, &Isometry3::from(inertia.com_in_link_m))?;
        xml.empty("mass", &[("value", inertia.mass_kg.to_string())])?;
        let i = |row, column| numbers([&inertia.about_com_kg_m2[(row, column)]]);
        let entries = [
            ("ixx", i(0, 0)),
            ("ixy", i(0, 1)),
            ("ixz", i(0, 2)),
            ("iyy", i(1, 1)),
            ("iyz", i(1, 2)),
            ("izz", i(2, 2)),
        ];
        xml.empty("inertia", &entries)
    })
}

/// Writes the geometry of a solid. URDF has no capsules, so a capsule becomes a cylinder with two spheres.
fn geometry(xml: &mut Xml, element: &str, solid: &PlacedSolid<'_>) -> io::Result<()> {
    let at = &solid.body_from_solid;
    let mut one = |at: &Isometry3<f64>, name: &str, attributes: &[(&str, String)]| {
        xml.element(element, &[], |xml| {
            origin(xml, at)?;
            xml.element("geometry", &[], |xml| xml.empty(name, attributes))
        })
    };
    let radius = |radius_m: f64| ("radius", radius_m.to_string());
    match solid.form {
        Geometry::Box(size_m) => one(at, "box", &[("size", vector(&size_m))]),
        Geometry::Sphere(radius_m) => one(at, "sphere", &[radius(radius_m)]),
        Geometry::Cylinder(radius_m, length_m) => {
            one(at, "cylinder", &[radius(radius_m), ("length", length_m.to_string())])
        }
        Geometry::Tyre(radius_m) => {
            let length = 2.0 * crate::bodies::TYRE_HALF_WIDTH * radius_m;
            one(at, "cylinder", &[radius(radius_m), ("length", length.to_string())])
        }
        Geometry::Capsule(radius_m, length_m) => {
            one(at, "cylinder", &[radius(radius_m), ("length", length_m.to_string())])?;
            for side in [-0.5, 0.5] {
                let end = at * Isometry3::translation(0.0, 0.0, side * length_m);
                one(&end, "sphere", &[radius(radius_m)])?;
            }
            Ok(())
        }
    }
}

/// Largest torque, N·m, and speed, rad/s, of a hinge; `None` without a motor.
fn limits(robot: &Robot, ratios: &Ratios, of: &Hinge<'_>) -> Option<[f64; 2]> {
    match of.of {
        HingeOrigin::Joint { number, .. } => of.of.actuator().map(|_| {
            [ratios.joint_torque_max_nm(robot, number), ratios.joint_speed_max_rad_s(robot, number)]
        }),
        HingeOrigin::Wheel { .. } => {
            of.of.actuator().map(|motor| [motor.torque_max_nm, motor.speed_max_rad_s])
        }
    }
}

fn joint(
    xml: &mut Xml,
    bodies: &[Body<'_>],
    body: &Body<'_>,
    of: &Hinge<'_>,
    most: Option<[f64; 2]>,
) -> io::Result<()> {
    let per_rad = of.of.per_rad();
    let kind = match of.of {
        HingeOrigin::Joint { joint, .. } if joint.is_prismatic() => "prismatic",
        HingeOrigin::Joint { .. } => "revolute",
        HingeOrigin::Wheel { .. } => "continuous",
    };
    xml.element("joint", &[("name", of.name.clone()), ("type", kind.into())], |xml| {
        xml.empty("parent", &[("link", bodies[of.parent].name.clone())])?;
        xml.empty("child", &[("link", body.name.clone())])?;
        origin(xml, &of.parent_from_body)?;
        xml.empty("axis", &[("xyz", vector(&of.axis))])?;
        let mut limits = Vec::new();
        if let HingeOrigin::Joint { joint, .. } = of.of {
            limits.push(("lower", (joint.position_min_rad * per_rad).to_string()));
            limits.push(("upper", (joint.position_max_rad * per_rad).to_string()));
        }
        if let Some([torque_nm, speed_rad_s]) = most {
            limits.push(("effort", (torque_nm / per_rad).to_string()));
            limits.push(("velocity", (speed_rad_s * per_rad).to_string()));
        }
        if !limits.is_empty() {
            xml.empty("limit", &limits)?;
        }
        match of.of {
            HingeOrigin::Joint { joint, .. } => joint.spring.map_or(Ok(()), |spring| {
                let damping = spring.damping_nm_s_rad / (per_rad * per_rad);
                xml.empty("dynamics", &[("damping", damping.to_string())])
            }),
            HingeOrigin::Wheel { .. } => Ok(()),
        }
    })
}

fn origin(xml: &mut Xml, pose: &Isometry3<f64>) -> io::Result<()> {
    let xyz = vector(&pose.translation.vector);
    let rpy = numbers(&roll_pitch_yaw(&pose.rotation));
    xml.empty("origin", &[("xyz", xyz), ("rpy", rpy)])
}
