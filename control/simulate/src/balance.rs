//! Rest of a robot that balances on two wheels. Plans begin and end with a lean, because the first and the last interval
//! accelerate. A robot that holds this lean rolls away, so that its reference at rest stands upright above the axle.

use nalgebra::{Rotation3, Unit, Vector3};
use rollwalk_multibody::{Frames, Tree};
use rollwalk_robot::GRAVITY_M_S2;
use rollwalk_tracking::Reference;

/// Speed below which a reference rests, rad/s and m/s.
const REST: f64 = 1e-9;

/// Turns the body of a reference at rest until the axle of its two wheels is below the centre of mass. Leaves moving references
/// and other robots unchanged.
pub(crate) fn upright(tree: &Tree, reference: &mut Reference) {
    let rests = reference.state.velocity.iter().all(|speed| speed.abs() < REST);
    if !rollwalk_tracking::balances(tree.robot()) || !rests {
        return;
    }
    let state = &mut reference.state;
    let frames = Frames::new(tree, &state.configuration());
    let ends = &tree.robot().end_effectors;
    let centers = ends.iter().map(|end| frames.point(end.link, &end.center_in_link_m));
    let axle = centers.sum::<Vector3<f64>>() / ends.len() as f64;
    let up = reference.world_from_ground.rotation * Vector3::z();
    let forward = state.world_from_body * Vector3::x();
    let Some(left) = Unit::try_new(up.cross(&forward), 1e-6) else { return };
    let lever = frames.com(tree) - axle;
    let lean_rad = lever.dot(&left.cross(&up)).atan2(lever.dot(&up));
    let turn = Rotation3::from_axis_angle(&left, -lean_rad);
    // The goal of the motion is a displacement of the centre of mass, and the wheels roll below it.
    let moved = lever - turn * lever;
    let shift = moved - up * moved.dot(&up);
    state.base_position_m = axle + turn * (state.base_position_m - axle) + shift;
    state.world_from_body = turn.matrix() * state.world_from_body;
    reference.acceleration.fill(0.0);
    let share_n = tree.total_mass_kg() * GRAVITY_M_S2 / ends.len() as f64;
    reference.force_n.fill(up * share_n);
}
