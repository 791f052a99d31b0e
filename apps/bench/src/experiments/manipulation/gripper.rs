//! Gripper that moves and turns, and cubes that hang on it by springs.

use crate::experiments::manipulation::{Effector, STEP_S};
use crate::experiments::parts::{self, Link, PointContact};
use nalgebra::Vector3;
use rollwalk_multibody::ground::Plane;
use rollwalk_physics::contact::Normal;
use rollwalk_physics::curve::Curve;
use rollwalk_physics::hold::{Hold, HoldGains, TargetPose};
use rollwalk_physics::sensitivity::Parameter;
use rollwalk_physics::sensitivity::parameter::Pose;
use rollwalk_physics::{Assembly, BodyMotion, Settings, System};
use std::sync::Arc;

/// Edge of a cube, m.
pub(crate) const EDGE_M: f64 = 0.05;
/// Mass of a cube, kg.
pub(crate) const CUBE_KG: f64 = 0.05;
/// Stiffness of strings and bands, N/m (Table A.2).
pub(crate) const STRING_N_M: f64 = 5.0;
/// Contact of a cube's corners with the ground (Table A.2).
const NORMAL: Normal =
    Normal { stiffness_n_m: 200.0, damping_n_s_m: 1e-3, ramp_m: 0.0, pulls: true };

/// Cube that is moved: its coordinates are position and rotation.
#[derive(Clone, Debug)]
pub(crate) struct Gripper {
    pub body: usize,
    hold: usize,
    begin: Vector3<f64>,
}

impl Gripper {
    pub fn add(assembly: &mut Assembly, at: Vector3<f64>) -> Self {
        let body = add_cube(assembly, BodyMotion::at(at));
        // A robot's arm is far stiffer than the object that it pulls.
        let grip = HoldGains {
            shift_n_m: 1e4,
            velocity_n_s_m: 0.0,
            turn_nm_rad: 10.0,
            spin_nm_s_rad: 0.0,
        };
        let place = Some(TargetPose::new(at, &Vector3::zeros()));
        let hold = assembly.add(Hold { body: [body], grip, place });
        Self { body, hold, begin: at }
    }
}

impl Effector for Gripper {
    fn coordinates(&self) -> usize {
        6
    }

    fn knot(&self, curve: &Arc<Curve>, knot: usize) -> Vec<Box<dyn Parameter>> {
        Pose::of_knot(self.hold, curve, knot)
    }

    fn set_coordinates(&self, system: &mut System, coordinates: &[f64]) {
        let [shift, turn] =
            [0, 3].map(|first| Vector3::from_column_slice(&coordinates[first..first + 3]));
        let hold = system.force_mut::<Hold>(self.hold).expect("the gripper's hold");
        hold.place = Some(TargetPose::new(self.begin + shift, &turn));
    }
}

/// Adds a cube without contacts and returns its index.
pub(crate) fn add_cube(assembly: &mut Assembly, motion: BodyMotion) -> usize {
    assembly.add_body(parts::cube(CUBE_KG, EDGE_M), motion)
}

/// Height of the centre of a cube that rests on its corners, m.
pub(crate) fn rest_m() -> f64 {
    0.5 * EDGE_M - CUBE_KG * 9.81 / (4.0 * NORMAL.stiffness_n_m)
}

/// Adds contacts between the corners of a cube and level ground.
pub(crate) fn touch_ground(assembly: &mut Assembly, cube: usize) {
    let ground = Arc::new(Plane::level());
    let touching = PointContact { normal: NORMAL, coefficient: 0.5, step_s: STEP_S, ground };
    touching.add(assembly, cube, parts::corners(EDGE_M));
}

/// Connects the lower corners of the first cube to the upper corners of the second by four springs. `stretch` is their initial
/// stretch relative to their length.
pub(crate) fn tie(assembly: &mut Assembly, bodies: [usize; 2], stretch: f64, string: bool) {
    let link = Link { stiffness_n_m: STRING_N_M, damping_n_s_m: 0.0, rest: 1.0 - stretch, string };
    for lower in parts::corners(EDGE_M).filter(|corner| corner.z < 0.0) {
        link.add(assembly, bodies, [lower, lower + Vector3::z() * EDGE_M]);
    }
}

pub(crate) fn settings() -> Settings {
    Settings { tolerance: 1e-10, ..Settings::default() }
}
