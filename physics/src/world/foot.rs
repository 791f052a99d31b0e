//! Soft feet: balls of soft material on rigid links, instead of rigid spheres and of wheels that do not turn.

use crate::assembly::Assembly;
use crate::body::Inertia;
use crate::contact::GroundContact;
use crate::soft::{Material, Mesh, SoftBody, SurfaceContact};
use nalgebra::{Matrix3, Rotation3, Vector3};
use rollwalk_robot::{EndEffector, SoftMaterial};
use std::ops::Range;

/// Number of cells across a foot in each direction. Two cells give 27 nodes.
const CELLS: usize = 2;
/// Stiffness of an attached node, as a fraction of a joint's stiffness. Nine nodes are attached.
pub(super) const ATTACH_SHARE: f64 = 1.0 / 9.0;
/// Smallest height above the centre of a node that is attached to the link, as a fraction of the radius.
const ATTACHED: f64 = 0.5;

/// Adds a soft ball in place of a rigid contact, and returns the force indices of its contacts.
pub(super) fn add(
    assembly: &mut Assembly,
    rigid: &GroundContact,
    soft: &SoftMaterial,
    attach_n_m: f64,
) -> Range<usize> {
    let link = rigid.body[0];
    let motion = assembly.motions[link];
    let (center, _) = motion.point(&rigid.center);
    let up = rigid.ground.at(&center).normal;
    let turn = Rotation3::rotation_between(&Vector3::z(), &up);
    let turn = turn
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let radius_m = rigid.radius_m;
    let mesh = ball(radius_m).shaped(|point| center + turn * point);
    let body =
        SoftBody::add(assembly, &mesh, &material(soft)).expect("a ball has no flat elements");
    body.launch(assembly, motion.velocity - motion.spin.cross(&motion.position), motion.spin);
    let attached = |place: &Vector3<f64>| up.dot(&(place - center)) > ATTACHED * radius_m;
    body.attach(assembly, link, attach_n_m, 0.0, attached);
    // A footprint as large as the foot's section is as stiff as the rigid foot.
    let per_area = 1.0 / (std::f64::consts::PI * radius_m * radius_m);
    let mut friction = rigid.friction;
    friction.stick_n_s_m *= per_area;
    let contact = SurfaceContact {
        stiffness_n_m3: rigid.normal.stiffness_n_m * per_area,
        damping_n_s_m3: rigid.normal.damping_n_s_m * per_area,
        ramp_m: rigid.normal.ramp_m,
        friction,
    };
    body.touch(assembly, &rigid.ground, &contact)
}

/// Mesh of a ball: a cube whose points are projected onto inscribed spheres.
fn ball(radius_m: f64) -> Mesh {
    let cube = Mesh::block(Vector3::repeat(-1.0), Vector3::repeat(2.0), [CELLS; 3]);
    cube.shaped(|point| point * (point.amax() / point.norm().max(f64::MIN_POSITIVE) * radius_m))
}

fn material(of: &SoftMaterial) -> Material {
    let elastic = Material::elastic(of.density_kg_m3, of.young_pa, of.poisson);
    Material { viscosity_pa_s: of.viscosity_pa_s, ..elastic }
}

/// Inertia of an end effector's soft foot about its centre; `None` for a rigid foot. Robot files include this inertia in the
/// link.
pub(super) fn inertia(end_effector: &EndEffector) -> Option<Inertia> {
    let soft = end_effector.soft.as_ref()?;
    let mesh = ball(end_effector.radius_m);
    let mut foot = Inertia { mass_kg: 0.0, about_com_kg_m2: Matrix3::zeros() };
    for (mass_kg, place) in mesh.masses_kg(soft.density_kg_m3).iter().zip(&mesh.places) {
        foot.mass_kg += mass_kg;
        let square = Matrix3::identity() * place.norm_squared();
        foot.about_com_kg_m2 += (square - place * place.transpose()) * *mass_kg;
    }
    Some(foot)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_robot::Robot;

    #[test]
    fn a_foot_is_what_the_rules_of_robot_files_take_it_for() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/legbot.toml");
        let robot = Robot::from_toml("legbot", &std::fs::read_to_string(path).unwrap()).unwrap();
        let foam =
            SoftMaterial { young_pa: 1e5, poisson: 0.3, density_kg_m3: 80.0, viscosity_pa_s: 5.0 };
        let foot = EndEffector { soft: Some(foam), ..robot.end_effectors[0].clone() };
        let (mass_kg, about_com_kg_m2) = foam.simulated(foot.radius_m);
        let found = inertia(&foot).unwrap();
        assert!((found.mass_kg / mass_kg - 1.0).abs() < 1e-12);
        let off = (found.about_com_kg_m2 - about_com_kg_m2).amax();
        assert!(off < 1e-12 * about_com_kg_m2.amax(), "{off}");
    }
}
