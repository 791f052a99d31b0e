//! Handles on particles, such as the corners of a cloth.

use crate::experiments::manipulation::Effector;
use nalgebra::Vector3;
use rollwalk_physics::anchor::Anchor;
use rollwalk_physics::curve::Curve;
use rollwalk_physics::sensitivity::Parameter;
use rollwalk_physics::sensitivity::parameter::Handle;
use rollwalk_physics::{Assembly, System};
use std::sync::Arc;

/// Particles held by springs, whose anchor positions are the coordinates.
#[derive(Clone, Debug)]
pub(crate) struct Handles {
    anchors: Vec<usize>,
    begins: Vec<Vector3<f64>>,
}

impl Handles {
    pub fn add(assembly: &mut Assembly, particles: &[usize], stiffness_n_m: f64) -> Self {
        let begins: Vec<_> =
            particles.iter().map(|&body| assembly.motions[body].position).collect();
        let anchor = |(&body, &place): (&usize, &Vector3<f64>)| {
            let point = Vector3::zeros();
            let damping_n_s_m = 0.0;
            assembly.add(Anchor { body: [body], point, place, stiffness_n_m, damping_n_s_m })
        };
        let anchors = particles.iter().zip(&begins).map(anchor).collect();
        Self { anchors, begins }
    }
}

impl Effector for Handles {
    fn coordinates(&self) -> usize {
        3 * self.anchors.len()
    }

    fn knot(&self, curve: &Arc<Curve>, knot: usize) -> Vec<Box<dyn Parameter>> {
        let of = |&anchor: &usize| {
            [Vector3::x(), Vector3::y(), Vector3::z()].map(|axis| -> Box<dyn Parameter> {
                Box::new(Handle { anchor, axis, curve: Arc::clone(curve), knot })
            })
        };
        self.anchors.iter().flat_map(of).collect()
    }

    fn set_coordinates(&self, system: &mut System, coordinates: &[f64]) {
        let shifts = coordinates.chunks(3).map(Vector3::from_column_slice);
        for ((&anchor, begin), shift) in self.anchors.iter().zip(&self.begins).zip(shifts) {
            let anchor = system.force_mut::<Anchor>(anchor).expect("a handle's anchor");
            anchor.place = begin + shift;
        }
    }
}
