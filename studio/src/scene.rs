//! Drawing of a robot: links with their solids, turning wheels as separate bodies, feet and blades.
//!
//! A link without solids and shapes, as in many imported robots, is drawn as bones: from its frame to its joints and end
//! effectors.

use crate::messages::{Body, EndEffector, Form, Joint, Parameter, Role, Scene, Shape};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{Frames, Standing, Tree};
use rollwalk_robot::{self as robot, Robot, Solid, shape};

/// Width of a wheel without a solid in the file, as a multiple of its radius.
const WHEEL_WIDTH: f64 = 0.4;
/// Thickness and height of a blade, as multiples of its length.
const BLADE: [f64; 2] = [0.03, 0.12];
/// Radius of a bone, as a multiple of its length.
const BONE: f64 = 0.08;
/// Tolerance within which centre and axis of a solid coincide with those of a wheel, m and rad.
const SAME: f64 = 1e-3;

/// Indices of end effectors whose wheel turns on its link, in order.
pub fn turning_wheels(robot: &Robot) -> impl Iterator<Item = usize> + '_ {
    let turns = |contact: &robot::Contact| contact.actuator().is_some() || contact.freewheels();
    let feet = robot.end_effectors.iter().enumerate();
    feet.filter(move |(_, foot)| turns(&foot.contact)).map(|(j, _)| j)
}

/// Creates the scene of a robot from the solids of its links, with its sliders.
pub fn scene(robot: &Robot, parts: &[Vec<Solid>], parameters: Vec<Parameter>) -> Scene {
    let tree = Tree::new(robot);
    let mut bodies: Vec<Body> = robot.links.iter().map(|link| Body::named(&link.name)).collect();
    for (link, solids) in parts.iter().enumerate() {
        bodies[link].shapes.extend(solids.iter().map(part));
    }
    for (body, link) in bodies.iter_mut().zip(&robot.links) {
        body.shapes.extend(link.shapes.iter().map(clearance));
    }
    for (link, body) in bodies.iter_mut().enumerate() {
        if body.shapes.is_empty() {
            body.shapes.extend(bones(robot, link));
        }
    }
    let turning: Vec<usize> = turning_wheels(robot).collect();
    let wheel_body = |j: usize| {
        turning.iter().position(|&turning| turning == j).map(|at| robot.links.len() + at)
    };
    bodies.extend(turning.iter().map(|&j| Body::named(&robot.end_effectors[j].name)));
    for (j, foot) in robot.end_effectors.iter().enumerate() {
        let turns = wheel_body(j);
        let width_m = take_wheel(&mut bodies[foot.link].shapes, foot);
        let shape = contact_shape(foot, width_m);
        let at = if turns.is_some() { Vector3::zeros() } else { foot.center_in_link_m };
        let position_m = (Vector3::from(shape.position_m) + at).into();
        bodies[turns.unwrap_or(foot.link)].shapes.push(Shape { position_m, ..shape });
    }
    let standing = Standing::new(&tree).map(|standing| {
        let still = vec![0.0; robot.end_effectors.len()];
        poses(robot, &standing.frames, &still).collect()
    });
    Scene {
        name: robot.name.clone(),
        bodies,
        standing: standing.unwrap_or_default(),
        joints: robot.joints.iter().map(joint).collect(),
        end_effectors: (0..robot.end_effectors.len())
            .map(|j| end_effector(&robot.end_effectors[j], wheel_body(j)))
            .collect(),
        mass_kg: robot.total_mass_kg(),
        parameters,
    }
}

/// Poses of all bodies, world_from_body. `wheel_rad` contains the angle of every end effector's wheel relative to its link.
pub fn poses<'a>(
    robot: &'a Robot,
    frames: &'a Frames,
    wheel_rad: &'a [f64],
) -> impl Iterator<Item = [f64; 7]> + 'a {
    let links = frames.link_origins.iter().zip(&frames.world_from_link);
    let links = links.map(|(origin, rotation)| pose(origin, rotation));
    let wheels = turning_wheels(robot).map(|j| {
        let foot = &robot.end_effectors[j];
        let axis = foot.contact.axis_in_link().copied().unwrap_or_else(Vector3::y);
        let turn = Rotation3::new(axis * wheel_rad[j]);
        let rotation = frames.world_from_link[foot.link] * turn.into_inner();
        pose(&frames.point(foot.link, &foot.center_in_link_m), &rotation)
    });
    links.chain(wheels)
}

fn pose(origin: &Vector3<f64>, rotation: &Matrix3<f64>) -> [f64; 7] {
    let rotation = Rotation3::from_matrix_unchecked(*rotation);
    let [w, x, y, z] = wxyz(&UnitQuaternion::from_rotation_matrix(&rotation));
    [origin.x, origin.y, origin.z, w, x, y, z]
}

fn wxyz(q: &UnitQuaternion<f64>) -> [f64; 4] {
    [q.w, q.i, q.j, q.k]
}

impl Body {
    fn named(name: &str) -> Self {
        Self { name: name.to_owned(), shapes: Vec::new() }
    }
}

impl Shape {
    fn at(form: Form, role: Role, position: Vector3<f64>, turn: UnitQuaternion<f64>) -> Self {
        Self { form, position_m: position.into(), orientation_wxyz: wxyz(&turn), role }
    }
}

/// Smallest rotation from one direction to another.
fn turn(from: &Vector3<f64>, to: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(from, to).unwrap_or_else(half_turn)
}

fn part(solid: &Solid) -> Shape {
    let (form, turned) = match solid.form {
        robot::Form::Box { size_m } => {
            (Form::Box { size_m: size_m.into() }, UnitQuaternion::identity())
        }
        robot::Form::Cylinder { axis, radius_m, length_m } => {
            let axis = Vector3::ith(axis, 1.0);
            (Form::Cylinder { radius_m, length_m }, turn(&Vector3::y(), &axis))
        }
    };
    Shape::at(form, Role::Part, solid.center_in_link_m, turned)
}

fn clearance(room: &shape::Shape) -> Shape {
    match *room {
        shape::Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
            capsule(from_in_link_m, to_in_link_m, radius_m, Role::Clearance)
        }
        shape::Shape::Box { center_in_link_m, size_m } => Shape::at(
            Form::Box { size_m: size_m.into() },
            Role::Clearance,
            center_in_link_m,
            UnitQuaternion::identity(),
        ),
    }
}

fn capsule(from: Vector3<f64>, to: Vector3<f64>, radius_m: f64, role: Role) -> Shape {
    let along = to - from;
    let length_m = along.norm();
    let turned = if length_m > 0.0 { turn(&Vector3::z(), &along) } else { Default::default() };
    Shape::at(Form::Capsule { radius_m, length_m }, role, (from + to) * 0.5, turned)
}

/// Capsules from a link's frame to its joints and end effectors.
fn bones(robot: &Robot, link: usize) -> impl Iterator<Item = Shape> + '_ {
    let joints = robot.joints.iter().filter(move |joint| joint.parent == link);
    let joints = joints.map(|joint| joint.parent_from_joint.translation.vector);
    let feet = robot.end_effectors.iter().filter(move |foot| foot.link == link);
    let ends = joints.chain(feet.map(|foot| foot.center_in_link_m));
    ends.filter(|end| end.norm() > SAME)
        .map(|end| capsule(Vector3::zeros(), end, BONE * end.norm(), Role::Part))
}

/// Removes the solid of an end effector's wheel from its link, and returns the width of the wheel, m.
fn take_wheel(shapes: &mut Vec<Shape>, foot: &robot::EndEffector) -> Option<f64> {
    let axis = foot.contact.axis_in_link().filter(|_| foot.contact.blade_length_m().is_none())?;
    let width_m = |shape: &Shape| match shape.form {
        Form::Cylinder { radius_m, length_m } if shape.role == Role::Part => {
            let [w, i, j, k] = shape.orientation_wxyz;
            let turned = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, i, j, k));
            let along = (turned * Vector3::y()).cross(axis).norm() < SAME;
            let centred = (Vector3::from(shape.position_m) - foot.center_in_link_m).norm() < SAME;
            (along && centred && (radius_m - foot.radius_m).abs() < SAME).then_some(length_m)
        }
        _ => None,
    };
    let at = shapes.iter().position(|shape| width_m(shape).is_some())?;
    width_m(&shapes.remove(at))
}

/// Shape of a foot, wheel or blade, centred at its origin.
fn contact_shape(foot: &robot::EndEffector, width_m: Option<f64>) -> Shape {
    let radius_m = foot.radius_m;
    let Some(axis) = foot.contact.axis_in_link() else {
        let (centre, turned) = (Vector3::zeros(), UnitQuaternion::identity());
        return Shape::at(Form::Sphere { radius_m }, Role::Foot, centre, turned);
    };
    if let (Some(blade), Some(length_m)) = (foot.blade(), foot.contact.blade_length_m()) {
        let [thick_m, high_m] = BLADE.map(|part| part * length_m);
        let up = -blade.middle_in_link;
        let axes = Matrix3::from_columns(&[axis.cross(&up), *axis, up]);
        let rotation = Rotation3::from_matrix_unchecked(axes);
        return Shape::at(
            Form::Box { size_m: [length_m, thick_m, high_m] },
            Role::Blade,
            blade.middle_in_link * (radius_m - 0.5 * high_m),
            UnitQuaternion::from_rotation_matrix(&rotation),
        );
    }
    let length_m = width_m.unwrap_or(WHEEL_WIDTH * radius_m);
    let form = Form::Cylinder { radius_m, length_m };
    Shape::at(form, Role::Wheel, Vector3::zeros(), turn(&Vector3::y(), axis))
}

fn joint(joint: &robot::Joint) -> Joint {
    Joint {
        name: joint.name.clone(),
        body: joint.child,
        position_min_rad: joint.position_min_rad,
        position_max_rad: joint.position_max_rad,
        speed_max_rad_s: joint.actuator.speed_max_rad_s,
        torque_max_nm: joint.actuator.torque_max_nm,
    }
}

fn end_effector(foot: &robot::EndEffector, wheel_body: Option<usize>) -> EndEffector {
    let motor = foot.contact.actuator();
    EndEffector {
        name: foot.name.clone(),
        contact: foot.contact.kind(),
        radius_m: foot.radius_m,
        body: foot.link,
        wheel_body,
        driven: motor.is_some(),
        friction_coefficient: foot.friction_coefficient,
        motor_speed_max_rad_s: motor.map(|motor| motor.speed_max_rad_s),
        motor_torque_max_nm: motor.map(|motor| motor.torque_max_nm),
    }
}
