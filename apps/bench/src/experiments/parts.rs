//! Parts of scenes: cubes, springs between points, and contact points.

use nalgebra::{Matrix3, Vector3};
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::contact::{GroundContact, Normal, Resistance, Tip};
use rollwalk_physics::friction::{Friction, FrictionModel};
use rollwalk_physics::points::Points;
use rollwalk_physics::spring::Spring;
use rollwalk_physics::{Assembly, Inertia};
use std::sync::Arc;

/// Mass and inertia of a cube of uniform density.
pub(crate) fn cube(mass_kg: f64, edge_m: f64) -> Inertia {
    let about_com_kg_m2 = Matrix3::identity() * (mass_kg * edge_m * edge_m / 6.0);
    Inertia { mass_kg, about_com_kg_m2 }
}

/// Eight corners of a cube.
pub(crate) fn corners(edge_m: f64) -> impl Iterator<Item = Vector3<f64>> {
    (0..8).map(move |corner| {
        let sign = |axis: usize| if corner >> axis & 1 == 0 { -0.5 } else { 0.5 };
        Vector3::from_fn(|axis, _| sign(axis) * edge_m)
    })
}

/// Kind of spring.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Link {
    pub stiffness_n_m: f64,
    pub damping_n_s_m: f64,
    /// Rest length relative to the initial distance of the points.
    pub rest: f64,
    /// True if the spring does not push.
    pub string: bool,
}

impl Link {
    /// Connects a point of one body with a point of another.
    pub fn add(&self, assembly: &mut Assembly, bodies: [usize; 2], points: [Vector3<f64>; 2]) {
        let [from, to] = [0, 1].map(|k| assembly.motions[bodies[k]].point(&points[k]).0);
        assembly.add(Spring {
            ends: Points { bodies, points },
            rest_m: (to - from).norm() * self.rest,
            stiffness_n_m: self.stiffness_n_m,
            damping_n_s_m: self.damping_n_s_m,
            string: self.string,
        });
    }

    pub fn add_between(&self, assembly: &mut Assembly, particles: [usize; 2]) {
        self.add(assembly, particles, [Vector3::zeros(); 2]);
    }
}

/// Contact of points with the ground.
#[derive(Clone, Debug)]
pub(crate) struct PointContact {
    pub normal: Normal,
    /// Coefficient of linear friction, whose sticking stiffness is k_n h.
    pub coefficient: f64,
    pub step_s: f64,
    pub ground: Arc<dyn Ground>,
}

impl PointContact {
    /// Adds contacts between points of a body and the ground.
    pub fn add(
        &self,
        assembly: &mut Assembly,
        body: usize,
        points: impl IntoIterator<Item = Vector3<f64>>,
    ) {
        for center in points {
            assembly.add(GroundContact {
                body: [body],
                center,
                radius_m: 0.0,
                tip: Tip::Sphere,
                normal: self.normal,
                friction: Friction {
                    model: FrictionModel::Linear,
                    coefficient: self.coefficient,
                    stick_n_s_m: self.normal.stiffness_n_m * self.step_s,
                },
                resistance: Resistance::default(),
                ground: Arc::clone(&self.ground),
            });
        }
    }
}
