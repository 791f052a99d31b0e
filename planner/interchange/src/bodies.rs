//! Robot as rigid bodies with hinges and simple solids, the model that URDF and MJCF share.
//!
//! Each spinning wheel is a separate body, whereas a robot file counts its mass to the link. Links have the frames of the
//! robot file. The frame of a wheel is at the wheel's centre, parallel to the frame of the link.

use nalgebra::{Isometry3, Matrix3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::{RigidPart, rest_of_link, spinning_wheels};
use rollwalk_robot::shape::Shape;
use rollwalk_robot::{EndEffector, Form, Joint, Robot, Solid};
use std::collections::HashSet;

/// Frame of the ground, in which robots move.
pub const WORLD: &str = "world";
/// Half the width of a tyre, as a fraction of its radius. Tyres are ellipsoids so thin that they touch the ground at the same
/// point as a plan's disc.
pub const TYRE_HALF_WIDTH: f64 = 0.02;

/// Mass of the spinning wheel that replaces a blade, as a fraction of the link's mass.
const BLADE_SHARE: f64 = 1e-4;

/// Largest distance of a part's centre from a wheel's centre, as a fraction of the wheel's radius, at which the part belongs
/// to the wheel.
const IN_THE_WHEEL: f64 = 0.1;

/// Mounting of the curved edge of a skate.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Blades {
    /// Rigid on the link, as in robot files.
    Fixed,
    /// Nearly massless wheel in place of a blade, for simulators without contacts that glide in only one direction.
    Roll,
}

/// A rigid body.
pub struct Body<'r> {
    /// Name, unique among bodies.
    pub name: String,
    /// Mass, centre of mass and inertia in the body's frame.
    pub inertia: RigidPart,
    /// Joint or axle to the parent; `None` for the root.
    pub hinge: Option<Hinge<'r>>,
    /// Visual and collision solids.
    pub solids: Vec<PlacedSolid<'r>>,
}

/// A joint or axle.
pub struct Hinge<'r> {
    /// Name, unique among hinges.
    pub name: String,
    /// Index of the body that carries this body.
    pub parent: usize,
    /// Pose of the body in the parent at angle 0.
    pub parent_from_body: Isometry3<f64>,
    /// Unit axis in the body's frame.
    pub axis: Vector3<f64>,
    /// Joint or wheel of the robot file.
    pub of: HingeOrigin<'r>,
}

/// Joint or wheel in the robot file to which a hinge belongs.
#[derive(Clone, Copy)]
pub enum HingeOrigin<'r> {
    /// A joint.
    Joint {
        /// Index of the joint in the robot.
        number: usize,
        /// The joint.
        joint: &'r Joint,
    },
    /// The axle of a wheel.
    Wheel {
        /// Index of the end effector.
        number: usize,
        /// The wheel.
        wheel: &'r EndEffector,
    },
}

/// Solid in the frame of its body.
pub struct PlacedSolid<'r> {
    /// Pose of the solid's centre and axes.
    pub body_from_solid: Isometry3<f64>,
    /// Geometry of the solid.
    pub form: Geometry,
    /// Purpose of the solid.
    pub role: Role<'r>,
}

/// Forms that other tools support. Cylinders and capsules lie along z, tyres turn about z.
#[derive(Clone, Copy)]
pub enum Geometry {
    /// Lengths of the sides, m.
    Box(Vector3<f64>),
    /// Radius and length, m.
    Cylinder(f64, f64),
    /// Radius and length of the segment, m.
    Capsule(f64, f64),
    /// Radius, m.
    Sphere(f64),
    /// Radius, m.
    Tyre(f64),
}

/// Purpose of a solid.
#[derive(Clone, Copy)]
pub enum Role<'r> {
    /// Part of a link, for pictures.
    Part,
    /// Shape of a link for collisions.
    Room,
    /// Foot or tyre that touches the ground.
    Contact(&'r EndEffector),
}

impl HingeOrigin<'_> {
    /// Displacement per radian: 1 rad/rad, or the travel of a prismatic joint, m/rad.
    pub fn per_rad(&self) -> f64 {
        match self {
            Self::Joint { joint, .. } => joint.per_rad(),
            Self::Wheel { .. } => 1.0,
        }
    }

    /// True for a prismatic joint.
    pub fn slides(&self) -> bool {
        matches!(self, Self::Joint { joint, .. } if joint.is_prismatic())
    }

    /// Sort key for the order of channels: joints before wheels, each in the order of the robot file.
    pub fn order(&self) -> (bool, usize) {
        match *self {
            Self::Joint { number, .. } => (false, number),
            Self::Wheel { number, .. } => (true, number),
        }
    }

    /// The motor; `None` for free wheels and passive joints.
    pub fn actuator(&self) -> Option<&rollwalk_robot::Actuator> {
        match self {
            Self::Joint { joint, .. } => (!joint.is_passive()).then_some(&joint.actuator),
            Self::Wheel { wheel, .. } => wheel.contact.actuator(),
        }
    }
}

/// Bodies of a robot: the links in their order, then the spinning wheels in end-effector order. `parts` are the solids of
/// each link; without parts, pictures show only the shapes of links.
pub fn bodies<'r>(robot: &'r Robot, parts: &[Vec<Solid>], blades: Blades) -> Vec<Body<'r>> {
    let mut wheels = Vec::new();
    let mut bodies: Vec<_> = robot
        .links
        .iter()
        .enumerate()
        .map(|(index, link)| {
            let mut apart = spinning_wheels(robot, index);
            if blades == Blades::Roll {
                apart.extend(blade_wheels(robot, index));
            }
            let inertia = rest_of_link(robot, index, apart.iter().map(|(_, wheel)| wheel));
            wheels.extend(apart);
            let rooms = link.shapes.iter().map(room);
            Body { name: link.name.clone(), inertia, hinge: None, solids: rooms.collect() }
        })
        .collect();
    // `base` is the free joint of MJCF.
    let mut hinges = Names::from_iter(["base"]);
    for (number, joint) in robot.joints.iter().enumerate() {
        bodies[joint.child].hinge = Some(Hinge {
            name: hinges.unique(&joint.name, "_joint"),
            parent: joint.parent,
            parent_from_body: joint.parent_from_joint,
            axis: joint.axis_in_joint,
            of: HingeOrigin::Joint { number, joint },
        });
    }
    let mut names = Names::from_iter([WORLD]);
    for body in &mut bodies {
        body.name = names.unique(&body.name, "_link");
    }
    wheels.sort_by_key(|(number, _)| *number);
    let mut carriers: Vec<_> = robot.end_effectors.iter().map(|foot| foot.link).collect();
    for (number, part) in wheels {
        let wheel = &robot.end_effectors[number];
        carriers[number] = bodies.len();
        bodies.push(Body {
            name: names.unique(&wheel.name, "_wheel"),
            inertia: RigidPart { com_in_link_m: Vector3::zeros(), ..part },
            hinge: Some(Hinge {
                name: hinges.unique(&wheel.name, "_axle"),
                parent: wheel.link,
                parent_from_body: Translation3::from(wheel.center_in_link_m).into(),
                axis: wheel.contact.axis_in_link().copied().unwrap_or_else(Vector3::y),
                of: HingeOrigin::Wheel { number, wheel },
            }),
            solids: Vec::new(),
        });
    }
    for (link, solids) in parts.iter().enumerate() {
        for solid in solids {
            // A body that replaces a wheel rotates with the wheel.
            let wheel = (0..robot.end_effectors.len()).find(|&number| {
                carriers[number] >= robot.links.len()
                    && robot.end_effectors[number].link == link
                    && is_in_wheel(solid, &robot.end_effectors[number])
            });
            let carrier = wheel.map_or(link, |number| carriers[number]);
            let placed = part(solid, wheel.map(|number| &robot.end_effectors[number]));
            bodies[carrier].solids.push(placed);
        }
    }
    let contacts = robot.end_effectors.iter().zip(&carriers);
    // The shapes of the body contain the points on which it lies.
    for (end_effector, &carrier) in contacts.filter(|(end, _)| !end.contact.is_body_point()) {
        let spins = carrier >= robot.links.len();
        let center = if spins { Vector3::zeros() } else { end_effector.center_in_link_m };
        bodies[carrier].solids.push(contact(end_effector, center));
    }
    bodies
}

/// Names of joints and axles in the exported models, in channel order. They equal the names in telemetry unless a name is
/// taken.
pub fn joint_names(robot: &Robot) -> Vec<String> {
    let bodies = bodies(robot, &[], Blades::Fixed);
    let mut names: Vec<_> = driven(&bodies).map(|of| (of.of.order(), of.name.clone())).collect();
    names.sort();
    names.into_iter().map(|(_, name)| name).collect()
}

/// The hinges that have motors.
pub fn driven<'b>(bodies: &'b [Body<'b>]) -> impl Iterator<Item = &'b Hinge<'b>> {
    bodies.iter().filter_map(|body| body.hinge.as_ref()).filter(|of| of.of.actuator().is_some())
}

/// Indices of the bodies that a body carries.
pub fn carried<'b>(bodies: &'b [Body<'b>], parent: usize) -> impl Iterator<Item = usize> + 'b {
    let carries = move |body: &Body<'_>| body.hinge.as_ref().is_some_and(|h| h.parent == parent);
    (0..bodies.len()).filter(move |&index| carries(&bodies[index]))
}

/// Indices of all bodies, branch by branch, each body before the bodies that it carries.
pub fn depth_first(bodies: &[Body<'_>]) -> Vec<usize> {
    let mut order = Vec::new();
    let mut waiting = vec![0];
    while let Some(next) = waiting.pop() {
        order.push(next);
        let mut children: Vec<_> = carried(bodies, next).collect();
        children.reverse();
        waiting.extend(children);
    }
    order
}

/// Names in use.
pub struct Names(HashSet<String>);

impl<N: Into<String>> FromIterator<N> for Names {
    fn from_iter<T: IntoIterator<Item = N>>(names: T) -> Self {
        Self(names.into_iter().map(N::into).collect())
    }
}

impl Names {
    /// Name with suffixes appended until it is unique.
    pub fn unique(&mut self, name: &str, ending: &str) -> String {
        let mut name = name.to_owned();
        while !self.0.insert(name.clone()) {
            name += ending;
        }
        name
    }
}

/// Wheels that replace the blades of a link.
fn blade_wheels(robot: &Robot, link: usize) -> Vec<(usize, RigidPart)> {
    let blades = robot.end_effectors.iter().enumerate();
    let blades =
        blades.filter(|(_, foot)| foot.link == link && foot.contact.blade_length_m().is_some());
    let wheel = |(number, foot): (usize, &EndEffector)| {
        let mass_kg = BLADE_SHARE * robot.links[link].mass_kg;
        // A ball as large as the blade, not as its curvature. Its inertia is almost zero.
        let radius_m = foot.clearance_radius_m();
        let about_com_kg_m2 = Matrix3::from_diagonal_element(0.4 * mass_kg * radius_m.powi(2));
        (number, RigidPart { mass_kg, com_in_link_m: foot.center_in_link_m, about_com_kg_m2 })
    };
    blades.map(wheel).collect()
}

fn is_in_wheel(solid: &Solid, wheel: &EndEffector) -> bool {
    let apart_m = (solid.center_in_link_m - wheel.center_in_link_m).norm();
    let round = matches!((solid.form, wheel.contact.axis_in_link()),
        (Form::Cylinder { axis, .. }, Some(of_wheel)) if of_wheel[axis].abs() > 1.0 - 1e-9);
    round && apart_m < IN_THE_WHEEL * wheel.radius_m
}

fn part<'r>(solid: &Solid, wheel: Option<&EndEffector>) -> PlacedSolid<'r> {
    let origin = wheel.map_or_else(Vector3::zeros, |wheel| wheel.center_in_link_m);
    let at = Translation3::from(solid.center_in_link_m - origin);
    let (turn, form) = match solid.form {
        Form::Box { size_m } => (UnitQuaternion::identity(), Geometry::Box(size_m)),
        Form::Cylinder { axis, radius_m, length_m } => {
            let along = Vector3::ith(axis, 1.0);
            (turn_z_to(&along), Geometry::Cylinder(radius_m, length_m))
        }
    };
    PlacedSolid { body_from_solid: Isometry3::from_parts(at, turn), form, role: Role::Part }
}

fn room<'r>(shape: &Shape) -> PlacedSolid<'r> {
    let (at, turn, form) = match *shape {
        Shape::Box { center_in_link_m, size_m } => {
            (center_in_link_m, UnitQuaternion::identity(), Geometry::Box(size_m))
        }
        Shape::Capsule { from_in_link_m: from, to_in_link_m: to, radius_m } => {
            let (along, middle) = (to - from, (from + to) * 0.5);
            match along.norm() {
                0.0 => (middle, UnitQuaternion::identity(), Geometry::Sphere(radius_m)),
                length_m => (middle, turn_z_to(&along), Geometry::Capsule(radius_m, length_m)),
            }
        }
    };
    PlacedSolid { body_from_solid: Isometry3::from_parts(at.into(), turn), form, role: Role::Room }
}

fn contact(end_effector: &EndEffector, center: Vector3<f64>) -> PlacedSolid<'_> {
    let radius_m = end_effector.radius_m;
    let (turn, form) = match end_effector.contact.axis_in_link() {
        Some(axis) => (turn_z_to(axis), Geometry::Tyre(radius_m)),
        None => (UnitQuaternion::identity(), Geometry::Sphere(radius_m)),
    };
    let body_from_solid = Isometry3::from_parts(center.into(), turn);
    PlacedSolid { body_from_solid, form, role: Role::Contact(end_effector) }
}

/// Shortest rotation from z to a direction.
fn turn_z_to(direction: &Vector3<f64>) -> UnitQuaternion<f64> {
    let half_turn = || UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
    UnitQuaternion::rotation_between(&Vector3::z(), direction).unwrap_or_else(half_turn)
}
