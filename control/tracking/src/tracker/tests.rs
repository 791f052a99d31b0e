//! Tests with shipped robots at rest, in motion and with bad measurements.

use super::*;
use crate::model::Costs;
use nalgebra::{DVector, Isometry3, Rotation3};
use proptest::prelude::*;
use rollwalk_multibody::{forward_dynamics, rotation};
use rollwalk_robot::Robot;
use std::f64::consts::{FRAC_1_SQRT_2, PI};
use std::fs;

const TICK_S: f64 = 0.002;
/// Robots with driven wheels, feet, welded wheels, wheels that turn freely, and blades.
const ROBOTS: [&str; 5] = ["anymal_wheels", "pup", "legbot", "swizzlebot", "skatebot"];

fn tree(name: &str) -> Tree {
    let path = format!("{}/../../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let robot = Robot::from_toml(name, &fs::read_to_string(path).unwrap()).unwrap();
    Tree::new(&robot).with_spinning_wheels(|_| 5e-6).with_armature()
}

fn tracker(name: &str) -> Tracker {
    Tracker::new(tree(name), Weights::default(), TICK_S)
}

/// Reference of a robot that stands on all end effectors, with an equal fraction of the weight on each.
fn standing(tree: &Tree) -> Reference {
    let feet = tree.robot().end_effectors.len();
    let part_n = tree.total_mass_kg() * GRAVITY_M_S2 / feet as f64;
    let state = State::nominal(tree);
    let frames = Kinematics::new(tree, &state.configuration()).frames;
    let contact = RimContact::new(tree, &frames, 0, &Vector3::z()).unwrap();
    Reference {
        time_s: 0.0,
        world_from_ground: Isometry3::translation(0.0, 0.0, contact.position().z),
        state,
        acceleration: vec![0.0; tree.dofs()],
        stands: vec![true; feet],
        force_n: vec![Vector3::z() * part_n; feet],
        ground_height_m: vec![0.0; feet],
        ground_normal: vec![Vector3::z(); feet],
    }
}

/// Accelerations by forward dynamics of the torques and forces of the previous tick, and accelerations that the tick expected.
fn accelerations(tracker: &Tracker) -> (DVector<f64>, DVector<f64>) {
    let dofs = tracker.tree.dofs();
    let mut generalised = DVector::zeros(dofs);
    for (channel, setpoint) in tracker.channels.iter().zip(&tracker.setpoints) {
        for (dof, ratio) in &channel.ratios {
            generalised[*dof] += ratio * setpoint.torque_nm;
        }
    }
    for foot in tracker.feet.iter().filter(|foot| foot.stands()) {
        generalised += foot.jacobian.tr_mul(&foot.force_n);
    }
    let bias = DVector::from_column_slice(&tracker.bias);
    let there = forward_dynamics(tracker.mass.clone(), &bias, &generalised).unwrap();
    (there, tracker.solver.solution().rows(0, dofs).into_owned())
}

/// Creates a tracker whose drives have no gains, so that set-points consist of torques only.
fn without_drives(name: &str) -> Tracker {
    let mut tracker = tracker(name);
    for channel in &mut tracker.channels {
        (channel.kp_nm_rad, channel.kd_nm_s_rad) = (0.0, 0.0);
    }
    tracker
}

#[test]
fn at_rest_the_ground_bears_the_weight_and_nothing_moves() {
    for name in ROBOTS {
        let mut tracker = without_drives(name);
        let reference = standing(&tracker.tree);
        let state = reference.state.clone();
        tracker.tick(&reference, &state, &reference.stands).unwrap();
        let weight_n = tracker.tree.total_mass_kg() * GRAVITY_M_S2;
        let sum: Vector3<f64> = tracker.feet.iter().map(|foot| foot.force_n).sum();
        let (there, expected) = accelerations(&tracker);
        assert!((sum - Vector3::z() * weight_n).norm() < 0.01 * weight_n, "{name}: {sum}");
        assert!((&there - &expected).amax() < 1e-6, "{name}: {there} {expected}");
        let base = there.rows(0, JOINTS).amax();
        assert!(base < 0.05, "{name}: {base} {there:.3}");
    }
}

/// State of a standing robot with moving joints and wheels, tilted and displaced.
fn moving(reference: &Reference) -> State {
    let mut state = reference.state.clone();
    state.world_from_body = Rotation3::new(Vector3::new(0.05, -0.03, 0.1)).into_inner();
    state.base_position_m += Vector3::new(0.01, -0.02, 0.005);
    state.joint_rad.iter_mut().zip(1..).for_each(|(q, k)| *q += 0.01 * f64::from(k % 5 - 2));
    state.velocity.iter_mut().zip(1..).for_each(|(v, k)| *v += 0.05 * f64::from(k % 7 - 3));
    state
}

/// Tests that drive and feed-forward torque add up to the desired torque if the tick ends as predicted.
#[test]
fn drives_and_feed_forward_add_up_at_the_end_of_a_tick() {
    let mut tracker = tracker("anymal_wheels");
    let reference = standing(&tracker.tree);
    let state = moving(&reference);
    let setpoints = tracker.tick(&reference, &state, &reference.stands).unwrap().to_vec();
    let expected = tracker.solver.solution().clone();
    let mut bare = without_drives("anymal_wheels");
    let torques = bare.tick(&reference, &state, &reference.stands).unwrap();
    for ((setpoint, bare), channel) in setpoints.iter().zip(torques).zip(&tracker.channels) {
        let speed_then =
            state.velocity[channel.ratios[0].0] + TICK_S * expected[channel.ratios[0].0];
        let (position, position_then) = match channel.ratios[0].0.checked_sub(JOINTS) {
            Some(joint) if joint < state.joint_rad.len() => {
                assert_eq!(setpoint.position_rad, reference.state.joint_rad[joint]);
                (setpoint.position_rad, state.joint_rad[joint] + TICK_S * speed_then)
            }
            _ => (0.0, 0.0),
        };
        let torque_nm = setpoint.kp_nm_rad * (position - position_then)
            + setpoint.kd_nm_s_rad * (setpoint.speed_rad_s - speed_then)
            + setpoint.torque_nm;
        assert!(setpoint.kd_nm_s_rad > 0.0);
        assert!((torque_nm - bare.torque_nm).abs() < 1e-9 * (1.0 + torque_nm.abs()));
    }
}

/// Tests that set-points with latency are computed for the predicted state: with constant velocity, and with braking in the
/// previous tick.
#[test]
fn with_a_latency_a_tick_acts_on_the_state_then() {
    const LATENCY_S: f64 = 0.01;
    let reference = standing(&tracker("anymal_wheels").tree);
    let state = moving(&reference);
    let mut late = tracker("anymal_wheels").with_latency(LATENCY_S);
    late.tick(&reference, &state, &reference.stands).unwrap();
    for (k, velocity) in state.velocity.iter().enumerate() {
        assert_eq!(late.ahead.velocity[k], *velocity);
    }
    for (joint, angle) in state.joint_rad.iter().enumerate() {
        let then = angle + LATENCY_S * state.velocity[JOINTS + joint];
        assert!((late.ahead.joint_rad[joint] - then).abs() < 1e-12);
    }
    let turned = late.ahead.world_from_body * state.world_from_body.transpose();
    let turn = rotation::log(&turned);
    let spin = Vector3::from_column_slice(&state.velocity[ANGULAR..ANGULAR + 3]);
    assert!((turn - spin * LATENCY_S).norm() < 1e-12);
    let expected = late.solver.solution().clone();
    let setpoints = late.tick(&reference, &state, &reference.stands).unwrap().to_vec();
    assert!((late.ahead.velocity[7] - state.velocity[7] - LATENCY_S * expected[7]).abs() < 1e-12);
    let ahead = late.ahead.clone();
    let mut there = tracker("anymal_wheels");
    assert_eq!(there.tick(&reference, &ahead, &reference.stands).unwrap(), setpoints);
}

/// Creates a tracker with the gains of a stand.
fn with_gains(name: &str) -> (Tracker, Reference) {
    let tracker = tracker(name);
    let reference = standing(&tracker.tree);
    let costs = Costs::default();
    let gains = Gains::new(&tracker.tree, &costs, 0.1, true, |_| reference.clone());
    (tracker.with_gains(gains), reference)
}

#[test]
fn what_is_off_the_plan_is_pushed_back() {
    for gains in [false, true] {
        let (mut tracker, reference) = with_gains("anymal_wheels");
        if !gains {
            tracker.correction = None;
        }
        let mut acceleration = |state: &State| {
            tracker.tick(&reference, state, &reference.stands).unwrap();
            tracker.solver.solution().clone()
        };
        let still = acceleration(&reference.state);
        assert!(still.rows(0, JOINTS).amax() < 0.05, "{still}");
        for dof in [1, 2, ANGULAR, ANGULAR + 1] {
            for sign in [1.0, -1.0] {
                let mut state = reference.state.clone();
                state.velocity[dof] = 0.1 * sign;
                let moving = acceleration(&state);
                assert!(moving[dof] * sign < -0.1, "{gains}, {dof}: {moving}");
            }
        }
        let mut state = reference.state.clone();
        state.world_from_body = Rotation3::new(Vector3::x() * 0.05).into_inner();
        assert!(acceleration(&state)[ANGULAR] < -0.1);
    }
}

#[test]
fn the_plan_moves_along_with_a_robot_that_is_far_away() {
    let (mut tracker, reference) = with_gains("anymal_wheels");
    let mut state = reference.state.clone();
    state.base_position_m.x += 1.0;
    for _ in 0..5 {
        tracker.tick(&reference, &state, &reference.stands).unwrap();
    }
    let anchor_m = tracker.recovery.anchor_m;
    let left_m = 1.0 - anchor_m.x;
    assert!(anchor_m.y.abs() < 1e-9 && (0.05..0.15).contains(&left_m), "{anchor_m}");
}

/// Tests that set-points do not depend on the robot's position and heading, with feet in the air, and far off its plan.
#[test]
fn setpoints_do_not_depend_on_place_and_heading() {
    let elsewhere = Isometry3::new(Vector3::new(3.0, -2.0, 0.0), Vector3::z() * 2.2);
    for (gains, pushed_m_s) in [(false, 0.1), (true, 0.1), (true, 1.5)] {
        let (mut here, reference) = with_gains("anymal_wheels");
        if !gains {
            here.correction = None;
        }
        let mut there = here.clone();
        let state = moving(&reference);
        let mut touches = reference.stands.clone();
        for tick in 0..5 {
            let mut reference = reference.clone();
            // One foot lifts off, and one lands late.
            (reference.stands[1], touches[1], touches[2]) = (tick < 2, tick < 3, tick > 3);
            let mut state = state.clone();
            state.velocity[0] += pushed_m_s;
            let moved = Reference {
                world_from_ground: elsewhere * reference.world_from_ground,
                state: reference.state.clone().moved(&elsewhere),
                force_n: reference.force_n.iter().map(|f| elsewhere.rotation * f).collect(),
                ..reference.clone()
            };
            let setpoints = here.tick(&reference, &state, &touches).unwrap();
            let same = there.tick(&moved, &state.moved(&elsewhere), &touches).unwrap();
            for (one, other) in setpoints.iter().zip(same) {
                let error = (one.torque_nm - other.torque_nm).abs();
                assert!(error < 1e-6 * (1.0 + one.torque_nm.abs()), "{tick}: {one:?} {other:?}");
            }
        }
        assert_eq!(here.recovery.is_active(), pushed_m_s > 1.0);
    }
}

/// Tests that an end effector that touches early carries the robot, and that one without contact gets no force.
#[test]
fn forces_are_where_the_robot_touches() {
    let (mut tracker, mut reference) = with_gains("anymal_wheels");
    let mut state = reference.state.clone();
    reference.stands[0] = false;
    // The knee lifts the foot off the ground.
    let knee = tracker.tree.robot().joints.iter().rposition(|joint| joint.name.ends_with("KFE"));
    state.joint_rad[knee.expect("it has knees")] *= 1.3;
    tracker.tick(&reference, &state, &[true, true, true, false]).unwrap();
    let forces: Vec<f64> = tracker.feet.iter().map(|foot| foot.force_n.z).collect();
    assert!(forces[0] > 10.0 && forces[3].abs() < 1e-6, "{forces:?}");
    // The foot that should stand is lowered.
    assert_eq!(tracker.feet[3].phase, Phase::Landing);
}

/// Tests that a hard push uses more friction than a pyramid within the cone allows, and that a soft push does not.
#[test]
fn a_robot_that_recovers_uses_all_friction() {
    for (pushed_m_s, recovers) in [(0.2, false), (1.5, true)] {
        let (mut tracker, reference) = with_gains("anymal_wheels");
        let mut state = reference.state.clone();
        state.velocity[1] += pushed_m_s;
        tracker.tick(&reference, &state, &reference.stands).unwrap();
        assert_eq!(tracker.recovery.is_active(), recovers);
        let share = |foot: &Foot| foot.force_n.dot(&foot.side).abs() / foot.force_n.z;
        let beyond = |foot: &&Foot| share(foot) > 1.01 * FRAC_1_SQRT_2 * foot.friction;
        assert_eq!(tracker.feet.iter().filter(beyond).count() > 0, recovers);
    }
}

#[test]
fn motors_that_are_too_weak_get_what_they_have() {
    let mut tracker = without_drives("anymal_wheels");
    let reference = standing(&tracker.tree);
    let state = reference.state.clone();
    let strong = tracker.tick(&reference, &state, &reference.stands).unwrap();
    let most = strong.iter().map(|setpoint| setpoint.torque_nm.abs()).fold(0.0, f64::max);
    tracker.channels.iter_mut().for_each(|channel| channel.torque_max_nm = 0.6 * most);
    let weak = tracker.tick(&reference, &state, &reference.stands).unwrap();
    let weak = weak.iter().map(|setpoint| setpoint.torque_nm.abs()).fold(0.0, f64::max);
    assert!((weak - 0.6 * most).abs() < 1e-6 * most, "{weak} of {most}");
}

#[test]
fn bad_measurements_are_an_error_and_leave_no_trace() {
    let (mut tracker, mut reference) = with_gains("anymal_wheels");
    // One foot is in the air, and the ticks move its foothold.
    reference.stands[1] = false;
    let state = reference.state.clone();
    let before = tracker.tick(&reference, &state, &reference.stands).unwrap().to_vec();
    let mut refused = |change: &dyn Fn(&mut State)| {
        let mut broken = state.clone();
        change(&mut broken);
        assert!(tracker.tick(&reference, &broken, &reference.stands).is_err());
    };
    for bad in [f64::NAN, f64::INFINITY, 1e200] {
        refused(&|state| state.velocity[7] = bad);
        refused(&|state| state.world_from_body[(0, 1)] = bad);
        refused(&|state| state.base_position_m.y = bad);
    }
    // An encoder that has lost a turn; a body that lies on its side or too low.
    for bad in [f64::NAN, f64::INFINITY, 2.0 * PI, -2.0 * PI] {
        refused(&|state| state.joint_rad[3] += bad);
    }
    let turn = |roll_rad: f64| rotation::from_yaw_pitch_roll(&Vector3::new(0.0, 0.0, roll_rad));
    for roll_rad in [1.1, -PI] {
        refused(&|state| state.world_from_body = turn(roll_rad) * state.world_from_body);
    }
    refused(&|state| state.base_position_m.z -= 0.3);
    assert_eq!(tracker.tick(&reference, &state, &reference.stands).unwrap(), before);
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 60, ..ProptestConfig::default() })]

    /// Tests states near the plan with any feet on the ground.
    ///
    /// Forces obey friction, do not pull and are zero in the air, and torques are within limits. Forward dynamics yields the
    /// accelerations that the tick expects.
    #[test]
    fn what_a_tick_wants_is_possible(
        robot in 0..ROBOTS.len(),
        errors in prop::collection::vec(-1.0..1.0_f64, 80),
        stands in prop::collection::vec(any::<bool>(), 8),
    ) {
        let mut tracker = without_drives(ROBOTS[robot]);
        let mut reference = standing(&tracker.tree);
        let feet = reference.stands.len();
        reference.stands.copy_from_slice(&stands[..feet]);
        let mut state = reference.state.clone();
        let turn = Vector3::from_column_slice(&errors[..3]) * 0.2;
        state.world_from_body = Rotation3::new(turn).into_inner();
        state.base_position_m += Vector3::from_column_slice(&errors[3..6]) * 0.03;
        let (joints, velocities) = errors[6..].split_at(20);
        state.joint_rad.iter_mut().zip(joints).for_each(|(q, error)| *q += 0.1 * error);
        state.velocity.iter_mut().zip(velocities).for_each(|(v, error)| *v += 0.3 * error);
        tracker.tick(&reference, &state, &reference.stands).unwrap();
        let weight_n = tracker.tree.total_mass_kg() * GRAVITY_M_S2;
        let slack_n = 1e-6 * weight_n;
        for foot in &tracker.feet {
            let force = &foot.force_n;
            if !foot.stands() {
                prop_assert!(force.norm() < slack_n, "{force}");
                continue;
            }
            prop_assert!(force.z > -slack_n, "{force}");
            let part = if tracker.recovery.is_active() { 1.0 } else { FRAC_1_SQRT_2 };
            let along = foot.drag.unwrap_or(part * foot.friction);
            for (direction, most) in [(foot.along, along), (foot.side, part * foot.friction)] {
                prop_assert!(force.dot(&direction).abs() < most * force.z + slack_n, "{force}");
            }
        }
        for (channel, setpoint) in tracker.channels.iter().zip(&tracker.setpoints) {
            prop_assert!(setpoint.torque_nm.abs() < channel.torque_max_nm * (1.0 + 1e-6));
        }
        let (there, expected) = accelerations(&tracker);
        prop_assert!((&there - &expected).amax() < 1e-5 * (1.0 + expected.amax()));
    }
}
