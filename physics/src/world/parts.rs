//! What moves against the link that robot files count it to: wheels that spin, and soft feet.

use super::foot;
use crate::body::Inertia;
use nalgebra::{Matrix3, Vector3};
use rollwalk_robot::{EndEffector, Link, Robot};

/// A part of a link that is no part of its rigid body.
pub(super) struct Apart {
    pub end_effector: usize,
    pub inertia: Inertia,
}

/// Share of its link's mass that a wheel has, where the robot file does not tell.
const WHEEL_SHARE: f64 = 0.1;

/// Whether a wheel turns against its link.
fn spins(end_effector: &EndEffector) -> bool {
    end_effector.contact.actuator().is_some() || end_effector.contact.freewheels()
}

/// The wheels of a link that spin: thin discs with a tenth of its mass, less where that would leave no body.
pub(super) fn wheels_of(robot: &Robot, link: usize) -> Vec<Apart> {
    let on_link = |end_effector: &&EndEffector| end_effector.link == link;
    let sharing = robot.end_effectors.iter().filter(on_link).count() as f64;
    let mut share = WHEEL_SHARE;
    loop {
        let all = robot.end_effectors.iter().enumerate();
        let wheels: Vec<_> = all
            .filter(|(_, end_effector)| on_link(end_effector) && spins(end_effector))
            .map(|(number, end_effector)| {
                let axis = end_effector.contact.axis_in_link().expect("what spins has an axis");
                let mass_kg = share * robot.links[link].mass_kg / sharing;
                let of_disc = 0.25 * mass_kg * end_effector.radius_m.powi(2);
                let about_com_kg_m2 = (Matrix3::identity() + axis * axis.transpose()) * of_disc;
                Apart { end_effector: number, inertia: Inertia { mass_kg, about_com_kg_m2 } }
            })
            .collect();
        let left = without(robot, &robot.links[link], wheels.iter()).0.about_com_kg_m2;
        let mut moments = left.symmetric_eigenvalues();
        moments.as_mut_slice().sort_by(f64::total_cmp);
        if moments[0] > 0.0 && moments[0] + moments[1] >= moments[2] || share < 1e-6 {
            return wheels;
        }
        share *= 0.5;
    }
}

/// The soft feet of a link.
pub(super) fn soft_feet_of(robot: &Robot, link: usize) -> Vec<Apart> {
    let all = robot.end_effectors.iter().enumerate();
    let on_link = all.filter(|(_, end_effector)| end_effector.link == link);
    let soft = |(number, of)| Some(Apart { end_effector: number, inertia: foot::inertia(of)? });
    on_link.filter_map(soft).collect()
}

/// What is left of a link without some parts, and where its centre of mass lies in the link, m.
pub(super) fn without<'a>(
    robot: &Robot,
    link: &Link,
    parts: impl Iterator<Item = &'a Apart> + Clone,
) -> (Inertia, Vector3<f64>) {
    let steiner = |mass: f64, arm: Vector3<f64>| {
        (Matrix3::identity() * arm.norm_squared() - arm * arm.transpose()) * mass
    };
    let center = |part: &Apart| robot.end_effectors[part.end_effector].center_in_link_m;
    let mut mass_kg = link.mass_kg;
    let mut moment = link.com_in_link_m * link.mass_kg;
    for part in parts.clone() {
        mass_kg -= part.inertia.mass_kg;
        moment -= center(part) * part.inertia.mass_kg;
    }
    let com = moment / mass_kg;
    let mut about_com_kg_m2 =
        link.inertia_in_link_kg_m2 + steiner(link.mass_kg, link.com_in_link_m - com);
    for part in parts {
        about_com_kg_m2 -=
            part.inertia.about_com_kg_m2 + steiner(part.inertia.mass_kg, center(part) - com);
    }
    (Inertia { mass_kg, about_com_kg_m2 }, com)
}
