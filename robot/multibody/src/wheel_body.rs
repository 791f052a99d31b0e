//! Division of links into spinning wheels and the rest. Robot files include a wheel in its link, whereas simulators need two
//! bodies.
//!
//! Robot files do not contain the mass of the wheel, so that its fraction of the link is assumed here.

use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::Robot;

/// Fraction of a link's mass that turns if all of its end effectors are spinning wheels. Each wheel has an equal part.
pub const WHEEL_MASS_SHARE: f64 = 0.1;

/// Rigid part of a link.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidPart {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass in the frame of the link, m.
    pub com_in_link_m: Vector3<f64>,
    /// Inertia about the centre of mass of the part, in link axes, kg·m².
    pub about_com_kg_m2: Matrix3<f64>,
}

/// Spinning wheels of a link, each with the index of its end effector. The wheels are thin discs with [`WHEEL_MASS_SHARE`] of
/// the link's mass. The fraction is reduced if the rest of the link would have an impossible inertia.
pub fn spinning_wheels(robot: &Robot, link: usize) -> Vec<(usize, RigidPart)> {
    let on_link = || robot.end_effectors.iter().enumerate().filter(|(_, e)| e.link == link);
    let sharing = on_link().count() as f64;
    let mut share = WHEEL_MASS_SHARE;
    loop {
        let wheels: Vec<_> = on_link()
            .filter(|(_, end_effector)| end_effector.contact.spins())
            .filter_map(|(number, end_effector)| {
                let axis = end_effector.contact.axis_in_link()?;
                let mass_kg = share * robot.links[link].mass_kg / sharing;
                let of_disc = 0.25 * mass_kg * end_effector.radius_m.powi(2);
                let about_com_kg_m2 = (Matrix3::identity() + axis * axis.transpose()) * of_disc;
                let com_in_link_m = end_effector.center_in_link_m;
                Some((number, RigidPart { mass_kg, com_in_link_m, about_com_kg_m2 }))
            })
            .collect();
        let rest = rest_of_link(robot, link, wheels.iter().map(|(_, wheel)| wheel));
        let mut moments = rest.about_com_kg_m2.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        if moments[0] > 0.0 && moments[0] + moments[1] >= moments[2] || share < 1e-6 {
            return wheels;
        }
        share *= 0.5;
    }
}

/// Mass properties of a link without some of its parts.
pub fn rest_of_link<'p>(
    robot: &Robot,
    link: usize,
    parts: impl Iterator<Item = &'p RigidPart> + Clone,
) -> RigidPart {
    let steiner = |mass_kg: f64, arm: Vector3<f64>| {
        (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass_kg
    };
    let link = &robot.links[link];
    let mut mass_kg = link.mass_kg;
    let mut moment = link.com_in_link_m * link.mass_kg;
    for part in parts.clone() {
        mass_kg -= part.mass_kg;
        moment -= part.com_in_link_m * part.mass_kg;
    }
    let com_in_link_m = moment / mass_kg;
    let mut about_com_kg_m2 =
        link.inertia_in_link_kg_m2 + steiner(link.mass_kg, link.com_in_link_m - com_in_link_m);
    for part in parts {
        about_com_kg_m2 -=
            part.about_com_kg_m2 + steiner(part.mass_kg, part.com_in_link_m - com_in_link_m);
    }
    RigidPart { mass_kg, com_in_link_m, about_com_kg_m2 }
}
