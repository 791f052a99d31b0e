//! Soft feet: balls of soft material on rigid links, in place of rigid spheres and of wheels that do not turn.

use crate::assembly::Assembly;
use crate::contact::Contact;
use crate::soft::{Material, Mesh, SoftBody, SurfaceContact};
use nalgebra::{Rotation3, Vector3};
use std::ops::Range;

/// What feet are made of. Their mass adds to that of the robot file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SoftFeet {
    /// The material.
    pub material: Material,
    /// Elements across a foot, in each direction; two give 27 nodes.
    pub cells: usize,
    /// Stiffness that attaches each node of the upper side to the link, N/m.
    pub attach_n_m: f64,
}

/// Share of the radius above which nodes are attached to the link.
const ATTACHED: f64 = 0.5;

/// Puts a soft ball where a contact has its sphere; the forces that are its contacts.
pub(super) fn add(assembly: &mut Assembly, rigid: &Contact, soft: &SoftFeet) -> Range<usize> {
    let link = rigid.body[0];
    let motion = assembly.motions[link];
    let (center, _) = motion.point(&rigid.center);
    let up = rigid.ground.at(&center).normal;
    let turn = Rotation3::rotation_between(&Vector3::z(), &up);
    let turn = turn
        .unwrap_or_else(|| Rotation3::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI));
    let radius_m = rigid.radius_m;
    // A cube, its points drawn to the sphere inside of it.
    let cube = Mesh::block(Vector3::repeat(-1.0), Vector3::repeat(2.0), [soft.cells; 3]);
    let mesh = cube.shaped(|point| {
        let share = point.amax() / point.norm().max(f64::MIN_POSITIVE);
        center + turn * point * (share * radius_m)
    });
    let body = SoftBody::add(assembly, &mesh, &soft.material).expect("a ball has no flat elements");
    body.launch(assembly, motion.velocity - motion.spin.cross(&motion.position), motion.spin);
    let attached = |place: &Vector3<f64>| up.dot(&(place - center)) > ATTACHED * radius_m;
    body.attach(assembly, link, soft.attach_n_m, 0.0, attached);
    // A print as large as the foot's section is as stiff as the rigid foot.
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
