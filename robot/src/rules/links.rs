//! Rules of links: mass, inertia and shapes, and mass and inertia of the rigid rest of a link with soft feet.

use super::Check;
use super::check::{Bound, LENGTH_MAX_M, RADIUS_MAX_M, show};
use super::end_effectors::SOFT_SHARE;
use crate::model::Link;
use crate::shape::Shape;
use nalgebra::{Matrix3, Vector3};
use std::fmt;

/// Maximum number of shapes of a link, which bounds the number of pairs.
const SHAPES_MAX: usize = 16;
const MASS_MAX_KG: f64 = 1000.0;

impl Check<'_> {
    pub(super) fn link(&mut self, index: usize, link: &Link) {
        let robot = self.robot;
        self.range(
            "mass_kg",
            link.mass_kg,
            Bound::Above(0.0),
            MASS_MAX_KG,
            "kg",
            "; divide grams by 1000",
        );
        self.vector("com_in_link_m", &link.com_in_link_m);
        self.inertia(&link.inertia_in_link_kg_m2);
        self.shapes(index, link);
        let carriers = robot.joints.iter().filter(|joint| joint.child == index).count();
        if index > 0 && carriers != 1 {
            let help = "make every link except the first the `child` of exactly one joint";
            self.violated("name", format_args!("is the child of {carriers} joints"), help);
        }
    }

    fn shapes(&mut self, index: usize, link: &Link) {
        const FIELD: &str = "shapes";
        if link.shapes.len() > SHAPES_MAX {
            let help = format!(
                "give at most {SHAPES_MAX} shapes: a few capsules around a link are enough"
            );
            self.violated(FIELD, format_args!("has {} entries", link.shapes.len()), help);
        }
        let far = |point: &Vector3<f64>| !point.iter().all(|value| value.abs() <= LENGTH_MAX_M);
        for (number, shape) in link.shapes.iter().enumerate() {
            let mut wrong = |key: &str, value: &dyn fmt::Display, help: String| {
                self.violated(FIELD, format_args!("[{number}].{key} is {value}"), help);
            };
            let near = format!("give each coordinate within ±{LENGTH_MAX_M} m");
            match shape {
                Shape::Capsule { from_in_link_m, to_in_link_m, radius_m } => {
                    for (key, end) in [("from_m", from_in_link_m), ("to_m", to_in_link_m)] {
                        if far(end) {
                            wrong(key, &show(end), near.clone());
                        }
                    }
                    if !(*radius_m > 0.0 && *radius_m <= RADIUS_MAX_M) {
                        let help = format!("give a radius above 0 to {RADIUS_MAX_M} m");
                        wrong("radius_m", &format_args!("{radius_m} m"), help);
                    }
                }
                Shape::Box { center_in_link_m, size_m } => {
                    if far(center_in_link_m) {
                        wrong("at_m", &show(center_in_link_m), near);
                    }
                    if !size_m.iter().all(|size| *size > 0.0 && *size <= LENGTH_MAX_M) {
                        let help = format!("give sides above 0 to {LENGTH_MAX_M} m");
                        wrong("box_m", &show(size_m), help);
                    }
                    if index > 0 {
                        let help = "give a capsule with `from_m`, `to_m` and `radius_m`: only the \
                                    body, the first link, may have boxes";
                        wrong("box_m", &"a box", help.to_owned());
                    }
                }
            }
        }
    }

    /// Checks mass and inertia of a link without the balls of its soft feet.
    pub(super) fn rigid_rest(&mut self, index: usize, link: &Link) {
        let on_link = self.robot.end_effectors.iter().filter(|of| of.link == index);
        let feet: Vec<_> = on_link
            .filter_map(|of| Some((of.center_in_link_m, of.soft?.simulated(of.radius_m))))
            .collect();
        let rest_kg = link.mass_kg - feet.iter().map(|(_, (foot_kg, _))| foot_kg).sum::<f64>();
        let is_known = link
            .inertia_in_link_kg_m2
            .iter()
            .chain(&link.com_in_link_m)
            .all(|value| value.is_finite());
        if feet.is_empty() || !is_known || !rest_kg.is_finite() {
            return;
        }
        let lighter =
            "reduce density or radius of the soft feet, or give the link more mass near the feet";
        if rest_kg < (1.0 - SOFT_SHARE) * link.mass_kg {
            let help =
                format!("only {rest_kg:.3} kg of {:.3} kg are rigid: {lighter}", link.mass_kg);
            self.violated(
                "mass_kg",
                "is hardly more than the mass of the soft feet of this link",
                help,
            );
            return;
        }
        let about = |mass_kg: f64, arm: Vector3<f64>| {
            (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass_kg
        };
        let of_feet = feet.iter().map(|(center, (foot_kg, _))| center * *foot_kg);
        let com = (link.com_in_link_m * link.mass_kg - of_feet.sum::<Vector3<f64>>()) / rest_kg;
        let mut rest = link.inertia_in_link_kg_m2 + about(link.mass_kg, link.com_in_link_m - com);
        for (center, (foot_kg, inertia)) in &feet {
            rest -= inertia + about(*foot_kg, center - com);
        }
        // The simulation needs positive moments. The triangle inequality is not required, because robot files treat the mass of
        // a rigid foot as a point.
        let moments = rest.symmetric_eigenvalues();
        if moments.min() <= 0.0 {
            let help = format!(
                "{lighter}: without the feet, the smallest principal moment of the link is {:.3e} kg·m²; expected above 0",
                moments.min()
            );
            self.violated(
                "inertia_in_link_kg_m2",
                "is smaller than the inertia of the soft feet of this link",
                help,
            );
        }
    }

    fn inertia(&mut self, inertia: &Matrix3<f64>) {
        const FIELD: &str = "inertia_in_link_kg_m2";
        if !inertia.iter().all(|value| value.is_finite()) {
            self.violated(FIELD, "is not finite", "give finite numbers in kg·m²");
            return;
        }
        let scale = inertia.amax();
        // Rounding of a product of rotations is far below one part in 10^9.
        let tolerance = 1e-9 * scale;
        if (inertia - inertia.transpose()).amax() > tolerance {
            self.violated(
                FIELD,
                "is not symmetric",
                "give an inertia matrix that equals its transpose",
            );
            return;
        }
        let mut moments = inertia.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        let [small, middle, large] = [moments[0], moments[1], moments[2]];
        let shown = format!("principal moments are {small:.3e}, {middle:.3e}, {large:.3e} kg·m²");
        if small <= 0.0 {
            let help = format!("enlarge the diagonal: {shown}; expected values above 0");
            self.violated(FIELD, "is not positive definite", help);
        } else if small + middle < large - tolerance {
            let help = format!(
                "{shown}, but none may exceed the sum of the others; check units and the order xx, yy, \
                 zz, xy, xz, yz"
            );
            self.violated(FIELD, "breaks the triangle inequality", help);
        }
    }
}
