//! Joints of a robot: constraints of hinges and prismatic joints, and motor.

use crate::assembly::Assembly;
use crate::body::Inertia;
use crate::joint::{Ball, ParallelAxes};
use crate::motor::{Law, Motor, Stops};
use crate::points::Points;
use crate::slide::{Slide, Track};
use crate::world::Parameters;
use nalgebra::Vector3;
use rollwalk_robot::Joint;

/// Deflection of a stop under the motor's maximum torque, or that of the spring of a passive joint, rad.
const STOP_RAD: f64 = 0.02;

/// Hinge or prismatic joint between two bodies.
pub(super) struct Hinge {
    pub bodies: [usize; 2],
    pub points: [Vector3<f64>; 2],
    pub axes: [Vector3<f64>; 2],
    pub across: [Vector3<f64>; 2],
    /// Size of the moved part, m.
    pub size_m: f64,
    /// Displacement of a prismatic joint per radian of its motor, m/rad; `None` for a hinge.
    pub travel_m_per_rad: Option<f64>,
}

impl Hinge {
    /// Adds the forces that connect the two bodies.
    pub fn add(&self, assembly: &mut Assembly, parameters: &Parameters) {
        let &Self { bodies, points, axes, across, size_m, .. } = self;
        let lever_m = parameters.lever * size_m;
        let stiffness_n_m = parameters.joint_n_m;
        let ends = Points { bodies, points };
        let parallel = |axes| ParallelAxes {
            bodies,
            axes,
            stiffness_nm_rad: stiffness_n_m * lever_m * lever_m,
            damping_nm_s_rad: 0.0,
        };
        if self.travel_m_per_rad.is_some() {
            assembly.add(Track { ends, axis: axes[0], stiffness_n_m });
            assembly.add(parallel(across));
        } else {
            assembly.add(Ball { ends, stiffness_n_m, damping_n_s_m: 0.0 });
        }
        assembly.add(parallel(axes));
    }

    /// Creates the motor of the joint without power or spring, at an angle, rad.
    pub fn motor(&self, armature_kg_m2: f64, stops: Option<Stops>, angle_rad: f64) -> Motor {
        let &Self { bodies, points, axes, across, travel_m_per_rad, .. } = self;
        let (axis, law) = (axes[0], Law::default());
        let slide = travel_m_per_rad.map(|travel_m_per_rad| Slide { points, travel_m_per_rad });
        Motor { bodies, axis, across, slide, armature_kg_m2, stops, spring: None, angle_rad, law }
    }
}

/// Mechanical stops at the limits of a joint.
pub(super) fn stops(joint: &Joint) -> Stops {
    let range_rad = [joint.position_min_rad, joint.position_max_rad];
    // A stop of a passive joint holds as much as its spring at the farther limit.
    let spring_nm = |angle_rad| joint.spring.map_or(0.0, |of| of.torque_nm(angle_rad, 0.0).abs());
    let most_nm = match joint.is_passive() {
        true => range_rad.map(spring_nm).into_iter().fold(0.0, f64::max),
        false => joint.actuator.torque_max_nm,
    };
    Stops { range_rad, stiffness_nm_rad: most_nm / STOP_RAD }
}

/// Radius of gyration of a body about the axis of largest inertia, m.
pub(super) fn gyration_m(inertia: &Inertia) -> f64 {
    let moments = inertia.about_com_kg_m2.symmetric_eigenvalues();
    (moments.max() / inertia.mass_kg).sqrt()
}

/// Unit vector perpendicular to `axis`.
pub(super) fn perpendicular(axis: &Vector3<f64>) -> Vector3<f64> {
    let least = if axis.x.abs() < 0.6 { Vector3::x() } else { Vector3::z() };
    (least - axis * axis.dot(&least)).normalize()
}
