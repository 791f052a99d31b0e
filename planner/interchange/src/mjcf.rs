//! MJCF, the models of MuJoCo: <https://mujoco.readthedocs.io/en/stable/XMLreference.html>.
//!
//! The model contains level ground, or the terrain of its plan. Servos are its actuators. Its sensors are a gyro, an
//! accelerometer, the attitude, and the angles and speeds of all joints and axles. [`motion`] adds a plan as keyframes with the
//! controls that play it.

mod frames;
pub mod order;
mod terrain;

use crate::bodies::{
    Blades, Body, Geometry, Hinge, HingeOrigin, Names, PlacedSolid, Role, TYRE_HALF_WIDTH, bodies,
    carried,
};
use crate::xml::{Xml, numbers, vector};
use frames::{Keyframe, keyframes, standing};
use nalgebra::{Isometry3, Matrix3};
use order::{crank_name, servo_name};
use rollwalk_multibody::ground::Terrain;
use rollwalk_multibody::{Standing, Tree};
use rollwalk_planner::export::Rate;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::{CrankMap, GRAVITY_M_S2, Joint, Linkage, Robot, Solid};
use std::io;

/// Time step, s. Step and contact parameters (stiff, elliptic cones) equal those of the replays (`docs/replay.md`).
const STEP_S: f64 = 0.001;
const CONTACT_TIME_S: f64 = 0.003;
const IMPRATIO: f64 = 20.0;
/// Part of the trace of an inertia matrix that is added to each principal moment. It is larger than rounding errors and smaller
/// than any measurement of inertia.
const INERTIA_SLACK: f64 = 1e-12;

/// Writes a robot as an MJCF model with its stance as the keyframe `stand`. `parts` are the solids of each link, for
/// pictures.
///
/// # Errors
/// None: the text is written to memory.
pub fn mjcf(robot: &Robot, parts: &[Vec<Solid>]) -> io::Result<String> {
    let comment = format!("{}, written by rollwalk robot export", robot.name);
    model(robot, parts, None, &comment, standing(robot).as_slice())
}

/// Writes a plan as an MJCF model with keyframes from its beginning to its end, named by motion and number. Controls are
/// linear between keyframes.
///
/// # Errors
/// None: the text is written to memory.
pub fn motion(plan: &Plan, rate: Rate) -> io::Result<String> {
    let comment =
        format!("{} of {}, written by rollwalk export", plan.motion.name, plan.robot.name);
    model(&plan.robot, &[], plan.motion.ground.terrain(), &comment, &keyframes(plan, rate))
}

/// Writes the robot of a plan on the ground of the plan, with its stance as the keyframe `stand`.
pub fn model_of(plan: &Plan) -> io::Result<String> {
    let comment = format!("{}, written by rollwalk", plan.robot.name);
    let stand = standing(&plan.robot);
    model(&plan.robot, &[], plan.motion.ground.terrain(), &comment, stand.as_slice())
}

fn model(
    robot: &Robot,
    parts: &[Vec<Solid>],
    ground: Option<&Terrain>,
    comment: &str,
    keyframes: &[Keyframe],
) -> io::Result<String> {
    let bodies = bodies(robot, parts, Blades::Roll);
    let mut xml = Xml::new(comment)?;
    xml.element("mujoco", &[("model", robot.name.clone())], |xml| {
        xml.empty("compiler", &[("angle", "radian".into()), ("autolimits", "true".into())])?;
        let option = [
            ("timestep", STEP_S.to_string()),
            ("gravity", numbers(&[0.0, 0.0, -GRAVITY_M_S2])),
            ("cone", "elliptic".into()),
            ("impratio", IMPRATIO.to_string()),
            ("integrator", "implicitfast".into()),
        ];
        xml.empty("option", &option)?;
        defaults(xml)?;
        assets(xml, ground)?;
        xml.element("worldbody", &[], |xml| {
            xml.empty("light", &[("pos", "0 0 3".into()), ("directional", "true".into())])?;
            terrain::geoms(xml, ground)?;
            let loads_n = loads(robot);
            let tree = Bodies { robot, bodies: &bodies, loads_n: &loads_n };
            let names = terrain::names(ground);
            tree.body(xml, &mut names.iter().map(String::as_str).collect(), 0)
        })?;
        tendons(xml, robot, &bodies)?;
        rods(xml, robot, &bodies)?;
        actuators(xml, robot, &bodies)?;
        sensors(xml, &bodies)?;
        xml.element("keyframe", &[], |xml| {
            keyframes.iter().try_for_each(|frame| xml.empty("key", &frame.attributes()))
        })
    })?;
    Ok(xml.finish())
}

fn defaults(xml: &mut Xml) -> io::Result<()> {
    let class = |name: &str| [("class", name.to_owned())];
    xml.element("default", &[], |xml| {
        let touch = [
            ("condim", "3".into()),
            ("solref", numbers(&[CONTACT_TIME_S, 1.0])),
            ("contype", "0".into()),
            ("conaffinity", "0".into()),
        ];
        xml.empty("geom", &touch)?;
        // All shapes collide with the ground, but not with the robot. Friction is that of the foot.
        xml.element("default", &class("ground"), |xml| {
            let ground = [
                ("type", "plane".into()),
                ("size", "0 0 0.05".into()),
                ("contype", "1".into()),
                ("material", "ground".into()),
            ];
            xml.empty("geom", &ground)
        })?;
        xml.element("default", &class("part"), |xml| {
            xml.empty("geom", &[("group", "2".into()), ("mass", "0".into())])
        })?;
        xml.element("default", &class("room"), |xml| {
            let room = [("group", "3".into()), ("conaffinity", "1".into())];
            xml.empty("geom", &room)
        })?;
        xml.element("default", &class("contact"), |xml| {
            let contact = [
                ("group", "1".into()),
                ("conaffinity", "1".into()),
                ("priority", "1".into()),
                ("rgba", "0.15 0.15 0.17 1".into()),
            ];
            xml.empty("geom", &contact)
        })
    })
}

fn assets(xml: &mut Xml, ground: Option<&Terrain>) -> io::Result<()> {
    xml.element("asset", &[], |xml| {
        terrain::assets(xml, ground)?;
        let texture = [
            ("name", "ground".into()),
            ("type", "2d".into()),
            ("builtin", "checker".into()),
            ("rgb1", "0.82 0.84 0.86".into()),
            ("rgb2", "0.72 0.75 0.78".into()),
            ("width", "256".into()),
            ("height", "256".into()),
        ];
        xml.empty("texture", &texture)?;
        let material = [
            ("name", "ground".into()),
            ("texture", "ground".into()),
            ("texuniform", "true".into()),
            ("texrepeat", "2 2".into()),
        ];
        xml.empty("material", &material)
    })
}

/// Load of each end effector of the standing robot, N, for the drag of free wheels. If the robot cannot stand, all loads are
/// equal.
fn loads(robot: &Robot) -> Vec<f64> {
    let even = robot.total_mass_kg() * GRAVITY_M_S2 / robot.end_effectors.len().max(1) as f64;
    let standing = Standing::new(&Tree::new(robot));
    let load = |number: usize| standing.as_ref().map_or(even, |s| s.contacts[number].force_n);
    (0..robot.end_effectors.len()).map(load).collect()
}

/// Input of the body elements.
struct Bodies<'r> {
    robot: &'r Robot,
    bodies: &'r [Body<'r>],
    loads_n: &'r [f64],
}

impl Bodies<'_> {
    /// Writes a body and all bodies that it carries, with new names for its geoms.
    fn body(&self, xml: &mut Xml, geoms: &mut Names, index: usize) -> io::Result<()> {
        let body = &self.bodies[index];
        let mut attributes = vec![("name", body.name.clone())];
        if let Some(hinge) = &body.hinge {
            attributes.extend(pose(&hinge.parent_from_body));
        }
        xml.element("body", &attributes, |xml| {
            self.joint(xml, body)?;
            inertial(xml, body)?;
            if body.hinge.is_none() {
                xml.empty("site", &[("name", "imu".into())])?;
            }
            body.solids.iter().try_for_each(|solid| geom(xml, geoms, solid))?;
            self.linkages(xml, index)?;
            carried(self.bodies, index).try_for_each(|other| self.body(xml, geoms, other))
        })
    }

    /// Writes the cranks of the servos on a link, and the rod ends of the linkages that move it.
    fn linkages(&self, xml: &mut Xml, link: usize) -> io::Result<()> {
        for (joint, linkage, name) in linkages(self.robot, self.bodies) {
            if joint.child == link {
                let end = vector(&linkage.rod_in_child_m);
                xml.empty("site", &[("name", format!("{name}_rod")), ("pos", end)])?;
            }
            if linkage.link != link {
                continue;
            }
            let crank = [("name", crank_name(name)), ("pos", vector(&linkage.pivot_in_link_m))];
            xml.element("body", &crank, |xml| {
                let servo = [
                    ("name", servo_name(name)),
                    ("axis", vector(&linkage.axis_in_link)),
                    ("ref", linkage.nominal_rad.to_string()),
                    ("armature", joint.actuator.armature_kg_m2.to_string()),
                ];
                xml.empty("joint", &servo)?;
                // MuJoCo requires a mass of what moves.
                let inertial = [
                    ("pos", "0 0 0".into()),
                    ("mass", "1e-12".into()),
                    ("diaginertia", "1e-14 1e-14 1e-14".into()),
                ];
                xml.empty("inertial", &inertial)?;
                let pin = vector(&(linkage.pin_in_link_m - linkage.pivot_in_link_m));
                xml.empty("site", &[("name", format!("{name}_pin")), ("pos", pin)])
            })?;
        }
        Ok(())
    }

    fn joint(&self, xml: &mut Xml, body: &Body<'_>) -> io::Result<()> {
        let Some(hinge) = &body.hinge else {
            return xml.empty("freejoint", &[("name", "base".into())]);
        };
        let mut attributes = vec![("name", hinge.name.clone()), ("axis", vector(&hinge.axis))];
        if hinge.of.slides() {
            attributes.push(("type", "slide".into()));
        }
        let per_rad = hinge.of.per_rad();
        let square = per_rad * per_rad;
        // The rotor of a coupled motor is in its tendon.
        if let Some(motor) = hinge.of.actuator().filter(|_| !is_coupled(hinge)) {
            attributes.push(("armature", (motor.armature_kg_m2 / square).to_string()));
        }
        match hinge.of {
            HingeOrigin::Joint { joint, .. } => {
                let range = [joint.position_min_rad, joint.position_max_rad];
                attributes.push(("range", numbers(&range.map(|angle| angle * per_rad))));
                if let Some(spring) = &joint.spring {
                    attributes.push(("stiffness", (spring.stiffness_nm_rad / square).to_string()));
                    attributes.push(("springref", (spring.rest_rad * per_rad).to_string()));
                    attributes.push(("damping", (spring.damping_nm_s_rad / square).to_string()));
                }
            }
            HingeOrigin::Wheel { number, wheel } => {
                // Drag is proportional to the load of a contact, which MJCF cannot express. The load in the standing pose is
                // used.
                if let Some(drag) = wheel.contact.drag() {
                    let lever_nm = self.loads_n[number] * wheel.radius_m;
                    let friction_nm = drag.rolling_resistance * lever_nm;
                    let damping = drag.rolling_drag_s_m * lever_nm * wheel.radius_m;
                    attributes.push(("frictionloss", friction_nm.to_string()));
                    attributes.push(("damping", damping.to_string()));
                }
            }
        }
        xml.empty("joint", &attributes)
    }
}

fn inertial(xml: &mut Xml, body: &Body<'_>) -> io::Result<()> {
    let part = &body.inertia;
    let attributes = [
        ("pos", vector(&part.com_in_link_m)),
        ("mass", part.mass_kg.to_string()),
        ("fullinertia", numbers(&full_inertia(&part.about_com_kg_m2))),
    ];
    xml.empty("inertial", &attributes)
}

/// Moments and products of inertia in the order of MuJoCo.
///
/// MuJoCo refuses bodies with a principal moment above the sum of the two others. For a thin disc both are equal, so rounding
/// alone could lead to a refusal.
fn full_inertia(about_com_kg_m2: &Matrix3<f64>) -> [f64; 6] {
    let slack_kg_m2 = INERTIA_SLACK * about_com_kg_m2.trace();
    let i = |row, column| about_com_kg_m2[(row, column)];
    let moment = |axis| i(axis, axis) + slack_kg_m2;
    [moment(0), moment(1), moment(2), i(0, 1), i(0, 2), i(1, 2)]
}

fn geom(xml: &mut Xml, names: &mut Names, solid: &PlacedSolid<'_>) -> io::Result<()> {
    let (kind, size) = match solid.form {
        Geometry::Box(size_m) => ("box", vector(&(size_m * 0.5))),
        Geometry::Cylinder(radius_m, length_m) => {
            ("cylinder", numbers(&[radius_m, 0.5 * length_m]))
        }
        Geometry::Capsule(radius_m, length_m) => ("capsule", numbers(&[radius_m, 0.5 * length_m])),
        Geometry::Sphere(radius_m) => ("sphere", numbers([&radius_m])),
        Geometry::Tyre(radius_m) => {
            ("ellipsoid", numbers(&[radius_m, radius_m, TYRE_HALF_WIDTH * radius_m]))
        }
    };
    let mut attributes = Vec::new();
    match solid.role {
        Role::Part => attributes.push(("class", "part".into())),
        Role::Room => attributes.push(("class", "room".into())),
        Role::Contact(foot) => {
            attributes.push(("name", names.unique(&foot.name, "_foot")));
            attributes.push(("class", "contact".into()));
            attributes.push(("friction", foot.friction_coefficient.to_string()));
        }
    }
    attributes.extend([("type", kind.into()), ("size", size)]);
    attributes.extend(pose(&solid.body_from_solid));
    xml.empty("geom", &attributes)
}

fn pose(pose: &Isometry3<f64>) -> [(&'static str, String); 2] {
    let q = pose.rotation.quaternion();
    [("pos", vector(&pose.translation.vector)), ("quat", numbers(&[q.w, q.i, q.j, q.k]))]
}

/// Couplings as fixed tendons, whose length is the angle of the motor, and rods as spatial tendons.
fn tendons(xml: &mut Xml, robot: &Robot, bodies: &[Body<'_>]) -> io::Result<()> {
    if !robot.joints.iter().any(Joint::is_coupled) {
        return Ok(());
    }
    let of_joint = |joint: usize| bodies[robot.joints[joint].child].hinge.as_ref();
    xml.element("tendon", &[], |xml| {
        for (_, _, name) in linkages(robot, bodies) {
            xml.element("spatial", &[("name", format!("{name}_rod"))], |xml| {
                ["pin", "rod"]
                    .iter()
                    .try_for_each(|site| xml.empty("site", &[("site", format!("{name}_{site}"))]))
            })?;
        }
        for (number, joint) in robot.joints.iter().enumerate() {
            let couples = !joint.motor_per_joint.is_empty();
            let Some(hinge) = of_joint(number).filter(|_| couples) else { continue };
            let armature = joint.actuator.armature_kg_m2.to_string();
            let attributes = [("name", hinge.name.clone()), ("armature", armature)];
            xml.element("fixed", &attributes, |xml| {
                joint.motor_per_joint.iter().try_for_each(|of| {
                    let name = of_joint(of.joint).map_or_else(String::new, |of| of.name.clone());
                    xml.empty("joint", &[("joint", name), ("coef", of.ratio.to_string())])
                })
            })?;
        }
        Ok(())
    })
}

/// Joints with crank and rod, and their names in the model.
fn linkages<'b>(
    robot: &'b Robot,
    bodies: &'b [Body<'b>],
) -> impl Iterator<Item = (&'b Joint, &'b Linkage, &'b str)> {
    robot.joints.iter().filter_map(|joint| {
        let hinge = bodies[joint.child].hinge.as_ref()?;
        Some((joint, joint.linkage.as_ref()?, &*hinge.name))
    })
}

/// Constraints that keep the length of the rods' tendons constant.
fn rods(xml: &mut Xml, robot: &Robot, bodies: &[Body<'_>]) -> io::Result<()> {
    if linkages(robot, bodies).next().is_none() {
        return Ok(());
    }
    xml.element("equality", &[], |xml| {
        for (joint, linkage, name) in linkages(robot, bodies) {
            let Some(crank) = CrankMap::new(robot, joint, linkage) else { continue };
            // MuJoCo counts from the length with all joints at 0, and the crank where the file has it.
            let zero = vec![0.0; robot.joints.len()];
            let longer_m = crank.rod_m() - crank.distance_from_nominal_pin_m(&zero);
            let rod = [
                ("tendon1", format!("{name}_rod")),
                ("polycoef", numbers(&[longer_m, 0.0, 0.0, 0.0, 0.0])),
                ("solref", numbers(&[2.0 * STEP_S, 1.0])),
                ("solimp", "0.9999 0.9999 0.001".into()),
            ];
            xml.empty("tendon", &rod)?;
        }
        Ok(())
    })
}

fn is_coupled(hinge: &Hinge<'_>) -> bool {
    matches!(hinge.of, HingeOrigin::Joint { joint, .. } if joint.is_coupled())
}

/// Servos of joints and drives of wheels, in channel order: torque = kp (control − angle) − kd speed, or kd (control − speed).
/// The gear of a prismatic joint makes its controls the angles of its motor.
fn actuators(xml: &mut Xml, robot: &Robot, bodies: &[Body<'_>]) -> io::Result<()> {
    xml.element("actuator", &[], |xml| {
        for hinge in channels(robot, bodies) {
            let Some(motor) = hinge.of.actuator() else { continue };
            let limit_nm = motor.torque_max_nm;
            let (kind, gains) = match hinge.of {
                HingeOrigin::Joint { .. } => ("position", Some(("kp", motor.kp_nm_rad))),
                HingeOrigin::Wheel { .. } => ("velocity", None),
            };
            let gains = gains.into_iter().chain([("kv", motor.kd_nm_s_rad)]);
            let driven = match hinge.of {
                HingeOrigin::Joint { joint, .. } if joint.linkage.is_some() => {
                    ("joint", servo_name(&hinge.name))
                }
                _ if is_coupled(hinge) => ("tendon", hinge.name.clone()),
                _ => ("joint", hinge.name.clone()),
            };
            let mut attributes = vec![("name", hinge.name.clone()), driven];
            attributes.extend(gains.map(|(name, gain)| (name, gain.to_string())));
            attributes.push(("forcerange", numbers(&[-limit_nm, limit_nm])));
            if hinge.of.slides() {
                attributes.push(("gear", (1.0 / hinge.of.per_rad()).to_string()));
            }
            xml.empty(kind, &attributes)?;
        }
        Ok(())
    })
}

/// Hinges with and without motors, in channel order: joints, then wheels.
pub fn channels<'b>(
    robot: &'b Robot,
    bodies: &'b [Body<'b>],
) -> impl Iterator<Item = &'b Hinge<'b>> {
    let joints = robot.joints.iter().map(|joint| joint.child);
    let wheels = robot.links.len()..bodies.len();
    joints.chain(wheels).filter_map(|body| bodies[body].hinge.as_ref())
}

fn sensors(xml: &mut Xml, bodies: &[Body<'_>]) -> io::Result<()> {
    xml.element("sensor", &[], |xml| {
        for (kind, name) in [("gyro", "imu_gyro"), ("accelerometer", "imu_acceleration")] {
            xml.empty(kind, &[("name", name.into()), ("site", "imu".into())])?;
        }
        let attitude = [
            ("name", "imu_attitude".into()),
            ("objtype", "site".into()),
            ("objname", "imu".into()),
        ];
        xml.empty("framequat", &attitude)?;
        for hinge in bodies.iter().filter_map(|body| body.hinge.as_ref()) {
            for (kind, what) in [("jointpos", "position"), ("jointvel", "speed")] {
                let name = format!("{}_{what}", hinge.name);
                xml.empty(kind, &[("name", name), ("joint", hinge.name.clone())])?;
            }
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::full_inertia;
    use crate::xml::numbers;
    use nalgebra::{Matrix3, Rotation3, Vector3};

    #[test]
    fn moments_of_thin_discs_with_any_axis_are_ones_that_mujoco_takes() {
        let mut random = fastrand::Rng::with_seed(1);
        for _ in 0..1000 {
            let turn = Rotation3::from_scaled_axis(Vector3::from_fn(|_, _| 6.0 * random.f64()));
            let disc = Matrix3::from_diagonal(&(Vector3::new(1.0, 1.0, 2.0) * random.f64()));
            let text = numbers(&full_inertia(&(turn * disc * turn.transpose())));
            let read: Vec<f64> = text.split(' ').map(|number| number.parse().unwrap()).collect();
            let [a, b, c, ab, ac, bc] = read[..] else { panic!("{text}") };
            let moments = Matrix3::new(a, ab, ac, ab, b, bc, ac, bc, c).symmetric_eigenvalues();
            assert!(moments.sum() >= 2.0 * moments.max(), "{turn} {moments}");
        }
    }
}
