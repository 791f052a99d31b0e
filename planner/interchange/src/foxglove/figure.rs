//! Messages about one robot: solids, frames of bodies, joints, ground forces.

use super::messages::{
    ArrowPrimitive, Color, CubePrimitive, CylinderPrimitive, FrameTransform, FrameTransforms,
    JointState, JointStates, Pose, Quaternion, SceneEntity, SceneUpdate, SpherePrimitive, Time,
    Vector3 as Size,
};
use crate::bodies::{
    Blades, Body, Geometry, HingeOrigin, PlacedSolid, Role, WORLD, bodies, joint_names,
};
use nalgebra::{Isometry3, Translation3, Unit, UnitQuaternion, Vector3};
use rollwalk_planner::sample::driven_wheels;
use rollwalk_robot::{Channel, Robot, Solid};

/// Length of the arrow of a force equal to the robot's weight, m.
const WEIGHT_ARROW_M: f64 = 0.5;
/// Force below which no arrow is drawn, as a fraction of the weight.
const NO_FORCE: f64 = 1e-3;
/// Diameter of the shaft of a force arrow, m.
const SHAFT_M: f64 = 0.008;
/// Drawn width of a tyre, as a multiple of its radius. The ellipsoid that touches the ground is too thin to be visible.
const TYRE_WIDTH: f64 = 0.3;

/// Robot that the messages describe.
pub struct Figure<'r> {
    robot: &'r Robot,
    bodies: Vec<Body<'r>>,
    joint_names: Vec<String>,
    prefix: String,
    color: [f64; 4],
}

/// Pose of a robot in the world.
pub struct Posture<'p> {
    /// World-from-body pose.
    pub world_from_body: Isometry3<f64>,
    /// Angles of joints in joint order, rad.
    pub joint_rad: &'p [f64],
    /// Angles of wheels relative to their links, in end-effector order, rad. Entries of other end effectors are ignored.
    pub wheel_rad: &'p [f64],
}

/// Rotation of a hinge.
fn turned(axis: &Vector3<f64>, angle_rad: f64) -> Isometry3<f64> {
    let turn = UnitQuaternion::from_axis_angle(&Unit::new_unchecked(*axis), angle_rad);
    Isometry3::from_parts(Translation3::identity(), turn)
}

impl<'r> Figure<'r> {
    /// Creates the figure of a robot with the solids of its links, in a colour (red, green, blue, opacity).
    pub fn new(robot: &'r Robot, parts: &[Vec<Solid>], prefix: &str, color: [f64; 4]) -> Self {
        let bodies = bodies(robot, parts, Blades::Fixed);
        Self { robot, bodies, joint_names: joint_names(robot), prefix: prefix.to_owned(), color }
    }

    /// Frames of all bodies at `time_s`.
    pub fn transforms(&self, posture: &Posture<'_>, time_s: f64) -> FrameTransforms {
        let transform = |body: &Body<'_>| {
            let (parent, pose) = match &body.hinge {
                None => (WORLD.to_owned(), posture.world_from_body),
                Some(hinge) => {
                    let moved = match hinge.of {
                        HingeOrigin::Joint { number, joint } if joint.is_prismatic() => {
                            joint.joint_from_child(posture.joint_rad[number])
                        }
                        HingeOrigin::Joint { number, .. } => {
                            turned(&hinge.axis, posture.joint_rad[number])
                        }
                        HingeOrigin::Wheel { number, .. } => {
                            turned(&hinge.axis, posture.wheel_rad[number])
                        }
                    };
                    (self.frame(hinge.parent), hinge.parent_from_body * moved)
                }
            };
            FrameTransform {
                timestamp: timestamp(time_s),
                parent_frame_id: parent,
                child_frame_id: format!("{}{}", self.prefix, body.name),
                translation: vector(&pose.translation.vector),
                rotation: quaternion(&pose.rotation),
            }
        };
        FrameTransforms { transforms: self.bodies.iter().map(transform).collect() }
    }

    /// Solids of all bodies, locked to their frames.
    pub fn solids(&self, time_s: f64) -> SceneUpdate {
        let entity = |(index, body): (usize, &Body<'_>)| {
            let mut entity = SceneEntity {
                timestamp: timestamp(time_s),
                frame_id: self.frame(index),
                id: self.frame(index),
                frame_locked: true,
                ..SceneEntity::default()
            };
            let has_parts = body.solids.iter().any(|solid| matches!(solid.role, Role::Part));
            for solid in &body.solids {
                match solid.role {
                    Role::Room if has_parts => {}
                    Role::Contact(_) => add(&mut entity, solid, [0.15, 0.15, 0.17, self.color[3]]),
                    Role::Part | Role::Room => add(&mut entity, solid, self.color),
                }
            }
            entity
        };
        let entities = self.bodies.iter().enumerate().map(entity).collect();
        SceneUpdate { deletions: Vec::new(), entities }
    }

    /// Positions of joints and driven wheels, rad or m, by their names in the URDF. Speeds and torques are in channel order.
    pub fn joint_states(
        &self,
        posture: &Posture<'_>,
        speed_rad_s: &[f64],
        torque_nm: &[f64],
        time_s: f64,
    ) -> JointStates {
        let wheels = driven_wheels(self.robot).map(|wheel| posture.wheel_rad[wheel]);
        let angles_rad = self.robot.of_driven_joints(posture.joint_rad).chain(wheels);
        let channels = self.robot.channels().map(|channel| match channel {
            Channel::Joint(joint) => joint.per_rad(),
            Channel::Wheel(..) => 1.0,
        });
        let names = self.joint_names.iter().zip(channels);
        let state =
            |(channel, ((name, per_rad), angle_rad)): (usize, ((&String, f64), f64))| JointState {
                name: name.clone(),
                position: Some(angle_rad * per_rad),
                velocity: speed_rad_s.get(channel).map(|speed| speed * per_rad),
                effort: torque_nm.get(channel).map(|torque| torque / per_rad),
            };
        let joints = names.zip(angles_rad).enumerate().map(state).collect();
        JointStates { timestamp: timestamp(time_s), joints }
    }

    /// Ground forces on the end effectors, N, as arrows at contact points in the world, m.
    pub fn forces(&self, at: &[([f64; 3], [f64; 3])], time_s: f64) -> SceneUpdate {
        let weight_n = self.robot.total_mass_kg() * rollwalk_robot::GRAVITY_M_S2;
        let arrow = |(point, force): &([f64; 3], [f64; 3])| {
            let force = Vector3::from(*force);
            let length_m = force.norm() / weight_n * WEIGHT_ARROW_M;
            let head_m = length_m.min(4.0 * SHAFT_M);
            let turn = UnitQuaternion::rotation_between(&Vector3::x(), &force);
            let place = Translation3::from(Vector3::from(*point));
            (force.norm() > NO_FORCE * weight_n).then(|| ArrowPrimitive {
                pose: pose(&Isometry3::from_parts(place, turn.unwrap_or_default())),
                shaft_length: length_m - head_m,
                shaft_diameter: SHAFT_M,
                head_length: head_m,
                head_diameter: 2.5 * SHAFT_M,
                color: color([0.85, 0.33, 0.1, self.color[3]]),
            })
        };
        let entity = SceneEntity {
            timestamp: timestamp(time_s),
            frame_id: WORLD.to_owned(),
            id: format!("{}forces", self.prefix),
            arrows: at.iter().filter_map(arrow).collect(),
            ..SceneEntity::default()
        };
        SceneUpdate { deletions: Vec::new(), entities: vec![entity] }
    }

    fn frame(&self, body: usize) -> String {
        format!("{}{}", self.prefix, self.bodies[body].name)
    }
}

fn add(entity: &mut SceneEntity, solid: &PlacedSolid<'_>, rgba: [f64; 4]) {
    let (at, paint) = (&solid.body_from_solid, || color(rgba));
    let size = |x, y, z| Size { x, y, z };
    let cylinder = |radius_m: f64, length_m: f64| CylinderPrimitive {
        pose: pose(at),
        size: size(2.0 * radius_m, 2.0 * radius_m, length_m),
        bottom_scale: 1.0,
        top_scale: 1.0,
        color: paint(),
    };
    let ball = |at: &Isometry3<f64>, radius_m: f64| SpherePrimitive {
        pose: pose(at),
        size: size(2.0 * radius_m, 2.0 * radius_m, 2.0 * radius_m),
        color: paint(),
    };
    match solid.form {
        Geometry::Box(sides) => {
            let size = vector(&sides);
            entity.cubes.push(CubePrimitive { pose: pose(at), size, color: paint() });
        }
        Geometry::Sphere(radius_m) => entity.spheres.push(ball(at, radius_m)),
        Geometry::Cylinder(radius_m, length_m) => {
            entity.cylinders.push(cylinder(radius_m, length_m));
        }
        Geometry::Tyre(radius_m) => {
            entity.cylinders.push(cylinder(radius_m, TYRE_WIDTH * radius_m));
        }
        Geometry::Capsule(radius_m, length_m) => {
            entity.cylinders.push(cylinder(radius_m, length_m));
            for side in [-0.5, 0.5] {
                let end = at * Isometry3::translation(0.0, 0.0, side * length_m);
                entity.spheres.push(ball(&end, radius_m));
            }
        }
    }
}

/// Timestamp of a time of the motion. Recordings begin at 0.
pub fn timestamp(time_s: f64) -> Time {
    let nanoseconds = nanoseconds(time_s);
    let (seconds, rest) = (nanoseconds / 1_000_000_000, nanoseconds % 1_000_000_000);
    Time { sec: seconds as u32, nsec: rest as u32 }
}

pub fn nanoseconds(time_s: f64) -> u64 {
    (time_s * 1e9).round().max(0.0) as u64
}

fn pose(pose: &Isometry3<f64>) -> Pose {
    Pose { position: vector(&pose.translation.vector), orientation: quaternion(&pose.rotation) }
}

fn vector(v: &Vector3<f64>) -> Size {
    Size { x: v.x, y: v.y, z: v.z }
}

fn quaternion(turn: &UnitQuaternion<f64>) -> Quaternion {
    let q = turn.quaternion();
    Quaternion { x: q.i, y: q.j, z: q.k, w: q.w }
}

fn color([r, g, b, a]: [f64; 4]) -> Color {
    Color { r, g, b, a }
}
