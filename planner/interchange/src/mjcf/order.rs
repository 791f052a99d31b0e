//! Bodies, joints and generalised coordinates of a model, in the order of MuJoCo.

use crate::bodies::{Body, HingeOrigin, depth_first};
use nalgebra::{Isometry3, Translation3, UnitVector3, Vector3};
use rollwalk_multibody::{ANGULAR, JOINTS, LINEAR, State};
use rollwalk_robot::{Linkage, Robot, Transmission};

/// Joint or wheel that a coordinate belongs to, with its index.
#[derive(Clone, Copy)]
enum Coordinate {
    Joint(usize),
    Wheel(usize),
    /// Crank of the servo of a joint.
    Crank(usize),
}

/// Body below the base, with the hinge that carries it.
pub struct Hinged {
    /// Name of the body.
    pub body: String,
    /// Name of the hinge.
    pub joint: String,
    /// Index of the body that carries this body: 0 for the base, n + 1 for item n.
    pub parent: usize,
    /// Pose in the parent at the angle `zero_rad`.
    pub parent_from_body: Isometry3<f64>,
    /// Axis in the body's frame.
    pub axis: UnitVector3<f64>,
    /// Coordinate of the hinge in the pose `parent_from_body`, rad.
    pub zero_rad: f64,
    /// Displacement of a prismatic joint per radian, m/rad; `None` for a hinge.
    pub travel_m_per_rad: Option<f64>,
    of: Coordinate,
}

impl Hinged {
    fn per_rad(&self) -> f64 {
        self.travel_m_per_rad.unwrap_or(1.0)
    }
}

/// Coordinates of a model after those of its base.
pub struct Order {
    /// Bodies after the base, each with one coordinate.
    pub hinged: Vec<Hinged>,
    transmission: Transmission,
}

impl Order {
    /// Order of the model that contains the given bodies.
    pub fn new(robot: &Robot, bodies: &[Body<'_>]) -> Self {
        let mut hinged = Vec::new();
        let mut places = vec![0; bodies.len()];
        for index in depth_first(bodies) {
            if let Some(hinge) = &bodies[index].hinge {
                hinged.push(Hinged {
                    body: bodies[index].name.clone(),
                    joint: hinge.name.clone(),
                    parent: places[hinge.parent],
                    parent_from_body: hinge.parent_from_body,
                    axis: UnitVector3::new_normalize(hinge.axis),
                    zero_rad: 0.0,
                    travel_m_per_rad: hinge.of.slides().then_some(hinge.of.per_rad()),
                    of: match hinge.of {
                        HingeOrigin::Joint { number, .. } => Coordinate::Joint(number),
                        HingeOrigin::Wheel { number, .. } => Coordinate::Wheel(number),
                    },
                });
                places[index] = hinged.len();
            }
            let joints = robot.joints.iter().enumerate();
            let linkages =
                joints.filter_map(|(k, joint)| Some((k, joint, joint.linkage.as_ref()?)));
            for (number, joint, linkage) in linkages.filter(|(.., of)| of.link == index) {
                let Some(hinge) = &bodies[joint.child].hinge else { continue };
                hinged.push(crank(number, &hinge.name, linkage, places[index]));
            }
        }
        Self { hinged, transmission: robot.transmission() }
    }

    /// Generalised positions of a state, m for prismatic joints. The caller keeps the sign of the quaternion `wxyz` continuous
    /// along a motion.
    pub fn positions(&self, state: &State, wxyz: [f64; 4], wheel_rad: &[f64]) -> Vec<f64> {
        let mut all: Vec<_> = state.base_position_m.iter().copied().collect();
        all.extend(wxyz);
        let motor_rad = self.transmission.motors(&state.joint_rad);
        all.extend(self.hinged.iter().map(|hinged| match hinged.of {
            Coordinate::Joint(joint) => state.joint_rad[joint] * hinged.per_rad(),
            Coordinate::Wheel(wheel) => wheel_rad[wheel],
            Coordinate::Crank(joint) => motor_rad[joint],
        }));
        all
    }

    /// Generalised velocities of a state. MuJoCo has the angular velocity of the base in body axes.
    pub fn velocities(&self, state: &State, wheel_rad_s: &[f64]) -> Vec<f64> {
        let part = |from: usize| Vector3::from_column_slice(&state.velocity[from..from + 3]);
        let spin_in_body = state.world_from_body.transpose() * part(ANGULAR);
        let mut all: Vec<_> = part(LINEAR).iter().chain(spin_in_body.iter()).copied().collect();
        let joints = &state.velocity[JOINTS..JOINTS + state.joint_rad.len()];
        let motor_rad_s = self.transmission.at(&state.joint_rad).motors(joints);
        all.extend(self.hinged.iter().map(|hinged| match hinged.of {
            Coordinate::Joint(joint) => joints[joint] * hinged.per_rad(),
            Coordinate::Wheel(wheel) => wheel_rad_s[wheel],
            Coordinate::Crank(joint) => motor_rad_s[joint],
        }));
        all
    }
}

/// Crank of a joint's servo; `name` is that of the joint.
fn crank(number: usize, name: &str, linkage: &Linkage, parent: usize) -> Hinged {
    Hinged {
        body: crank_name(name),
        joint: servo_name(name),
        parent,
        parent_from_body: Translation3::from(linkage.pivot_in_link_m).into(),
        axis: UnitVector3::new_normalize(linkage.axis_in_link),
        zero_rad: linkage.nominal_rad,
        travel_m_per_rad: None,
        of: Coordinate::Crank(number),
    }
}

/// Name of the body of a crank.
pub fn crank_name(joint: &str) -> String {
    format!("{joint}_crank")
}

/// Name of the hinge of a crank.
pub fn servo_name(joint: &str) -> String {
    format!("{joint}_servo")
}
