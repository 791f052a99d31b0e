//! Torques compared with closed forms, and the balance of power along a plan.

use super::*;
use crate::motion::Motion;
use crate::plan::Plan;
use crate::{optimise, test_plans};
use nalgebra::{DMatrix, DVector};
use rollwalk_multibody::CompositeInertia;
use std::f64::consts::TAU;
use std::ops::ControlFlow;

/// Length of a leg of the robot of [`test_plans`], m.
const LEG_M: f64 = 0.2;
/// Mass of a leg, kg.
const LEG_KG: f64 = 0.2;
/// Inertia of a leg, kg·m².
const LEG_KG_M2: f64 = 7e-4;
/// Armature of a joint, kg·m².
const ARMATURE_KG_M2: f64 = 0.001;

fn planned(robot: &str, motion: &str) -> Plan {
    let robot = Robot::from_toml("robot", robot).expect("a shipped robot");
    let motion = Motion::from_toml("motion", motion, &robot).expect("a shipped motion");
    optimise(&robot, &motion, &Default::default(), &mut |_| ControlFlow::Continue(()))
}

fn walk() -> Plan {
    let agilebot = include_str!("../../../shipped/robots/agilebot.toml");
    planned(agilebot, include_str!("../../../shipped/motions/walk.toml"))
}

fn swizzle() -> Plan {
    let swizzlebot = include_str!("../../../shipped/robots/swizzlebot.toml");
    planned(swizzlebot, include_str!("../../../shipped/motions/swizzlebot_forward.toml"))
}

#[test]
fn at_rest_motors_hold_the_weight_that_their_feet_carry() {
    let leg_rad = 0.3_f64;
    let plan = test_plans::BoxMotion {
        ends: Ends::AtRest,
        duration_s: 0.5,
        samples: 6,
        x_m: |_| 0.0,
        leg_rad: |_| 0.3,
    }
    .plan("stand");
    let mut inverse = InverseDynamics::new(&plan);
    for time_s in [0.0, 0.13, 0.5, 2.0] {
        let actuation = inverse.at(time_s);
        for (j, torque_nm) in actuation.joint_nm.iter().enumerate() {
            let load_n = plan.samples[0].end_effectors[j].force_n[2];
            let lever_m = LEG_M * leg_rad.sin();
            let expected = -lever_m * (load_n - 0.5 * LEG_KG * GRAVITY_M_S2);
            // The force solver stops at 1e-8 of the weight, 27 N.
            assert!((torque_nm - expected).abs() < 1e-6, "{time_s} {j}: {torque_nm} {expected}");
        }
        assert!(actuation.motor_nm.iter().all(|motor| motor.expect("a motor").abs() < 1e-6));
        assert!(actuation.unmet_force_n.norm() < 1e-6, "{actuation:?}");
    }
}

#[test]
fn a_leg_that_swings_is_a_pendulum() {
    let leg = |t: f64| 0.4 + 0.2 * (TAU * t / 1.2 + 0.7).sin();
    let mut plan = test_plans::BoxMotion {
        ends: Ends::Periodic,
        duration_s: 1.2,
        samples: 240,
        x_m: |_| 0.0,
        leg_rad: |t| 0.4 + 0.2 * (TAU * t / 1.2 + 0.7).sin(),
    }
    .plan("swing");
    // The robot hangs: the body does not move, no foot touches the ground, wheels rotate with their legs.
    plan.motion.stance.iter_mut().flatten().for_each(|stands| *stands = false);
    for sample in &mut plan.samples {
        sample.base_position_m[2] = 1.0;
        sample.end_effectors.iter_mut().for_each(|e| e.motor_speed_rad_s = 0.0);
    }
    let mut inverse = InverseDynamics::new(&plan);
    for k in 0..50 {
        let time_s = 0.0237 * f64::from(k);
        let bend = -0.2 * (TAU / 1.2).powi(2) * (TAU * time_s / 1.2 + 0.7).sin();
        let inertia = LEG_KG_M2 + LEG_KG * (0.5 * LEG_M).powi(2) + ARMATURE_KG_M2;
        let gravity = LEG_KG * GRAVITY_M_S2 * 0.5 * LEG_M * leg(time_s).sin();
        let expected = inertia * bend + gravity;
        let actuation = inverse.at(time_s);
        for torque_nm in &actuation.joint_nm {
            // Second derivatives of the spline: h²/12 · 0.2 · 5.2⁴ = 3e-4 rad/s², times 3.7e-3 kg·m².
            assert!((torque_nm - expected).abs() < 2e-6, "{time_s}: {torque_nm} {expected}");
        }
        let weight_n = plan.robot.total_mass_kg() * GRAVITY_M_S2;
        // The legs pull at the body as they swing. No contact carries the weight.
        assert!((actuation.unmet_force_n.z - weight_n).abs() < 0.8 * 0.1 * 6.0, "{actuation:?}");
    }
}

#[test]
fn a_wheel_that_speeds_up_takes_the_inertia_of_its_motor() {
    let mut plan = test_plans::cruise();
    let turn = TAU / 1.2;
    let mut added = plan.clone();
    for (k, sample) in added.samples.iter_mut().enumerate() {
        // Means of 3 sin(turn t) over the intervals.
        let h = plan.sample_interval_s;
        let at = |k: usize| -(turn * k as f64 * h).cos() * 3.0 / turn;
        sample.end_effectors[2].motor_speed_rad_s += (at(k + 1) - at(k)) / h;
    }
    plan.before = added.before.clone();
    let [mut without, mut with] = [&plan, &added].map(InverseDynamics::new);
    let disc = 0.5 * WHEEL_MASS_SHARE * LEG_KG * 0.05_f64.powi(2);
    for k in 0..20 {
        let time_s = 0.06 * f64::from(k);
        let [without, with] = [&mut without, &mut with].map(|inverse| inverse.at(time_s));
        let more = with.motor_nm[2].expect("a motor") - without.motor_nm[2].expect("a motor");
        // The moment that the wheel takes from the robot also changes the contact forces, but by far less.
        let moved = (with.force_n[2].x - without.force_n[2].x) * 0.05;
        let expected = (disc + ARMATURE_KG_M2) * 3.0 * turn * (turn * time_s).cos();
        assert!((more - moved - expected).abs() < 2e-4, "{time_s}: {more} {moved} {expected}");
    }
}

/// Kinetic and potential energy, from the mass matrix.
fn energy(inverse: &InverseDynamics, time_s: f64) -> f64 {
    let tree = &inverse.tree;
    let rates = inverse.spline.rates(time_s, tree);
    let kinematics = Kinematics::new(tree, &rates.state.configuration());
    let mut mass = DMatrix::zeros(tree.dofs(), tree.dofs());
    CompositeInertia::new(tree, &kinematics.frames).mass_matrix(
        tree,
        &kinematics.frames,
        &mut mass,
    );
    let velocity = DVector::from_vec(rates.state.velocity);
    let height = kinematics.frames.com(tree).z;
    0.5 * velocity.dot(&(&mass * &velocity)) + tree.total_mass_kg() * GRAVITY_M_S2 * height
}

#[test]
fn motors_and_ground_supply_the_change_of_energy() {
    for plan in [walk(), swizzle(), test_plans::start_stop()] {
        let mut inverse = InverseDynamics::new(&plan);
        for k in 1..40 {
            let time_s = plan.motion.duration_s * f64::from(k) / 40.3;
            let actuation = inverse.at(time_s);
            let (tree, kinematics) = (&inverse.tree, &inverse.kinematics);
            let velocity = inverse.spline.rates(time_s, tree).state.velocity;
            let joints = &velocity[JOINTS..tree.first_wheel_dof()];
            let mut power: f64 =
                joints.iter().zip(&actuation.joint_nm).map(|(speed, torque)| speed * torque).sum();
            for wheel in tree.wheels() {
                let dof = tree.wheel_dof(wheel.end_effector).expect("it spins");
                let motor = actuation.motor_nm[wheel.end_effector];
                power += motor.map_or(0.0, |torque_nm| torque_nm * velocity[dof]);
            }
            for (j, force) in actuation.force_n.iter().enumerate() {
                let contact = RimContact::new(tree, &kinematics.frames, j, &Vector3::z());
                let contact = contact.expect("no wheel lies flat");
                let mut jacobian = Matrix3xX::zeros(tree.dofs());
                contact.material_jacobian(tree, &kinematics.frames, &mut jacobian);
                if tree.robot().end_effectors[j].contact.drag().is_some() {
                    // No motor holds a free wheel; the ground rotates it.
                    let dof = tree.wheel_dof(j).expect("it spins");
                    jacobian.column_mut(dof).fill(0.0);
                }
                power += force.dot(&(jacobian * DVector::from_column_slice(&velocity)));
            }
            let base_to_com = kinematics.frames.com(tree) - kinematics.frames.link_origins[0];
            let [linear, angular] =
                [0, 3].map(|first| Vector3::from_column_slice(&velocity[first..first + 3]));
            power += actuation.unmet_force_n.dot(&(linear + angular.cross(&base_to_com)))
                + actuation.unmet_moment_nm.dot(&angular);
            // The spin of a free wheel also takes its power from the ground.
            let spin: f64 = tree
                .wheels()
                .iter()
                .filter(|wheel| actuation.motor_nm[wheel.end_effector].is_none())
                .map(|wheel| spin_power(&inverse, wheel.end_effector, time_s))
                .sum();
            let step_s = 1e-5;
            let change = energy(&inverse, time_s + step_s) - energy(&inverse, time_s - step_s);
            let change = change / (2.0 * step_s);
            // Central differences of the Jacobian over 1e-5 s: rounding 1e-15/1e-5, and step² times third derivatives.
            let scale = 1.0 + change.abs();
            let name = &plan.motion.name;
            assert!(
                (power + spin - change).abs() < 1e-6 * scale,
                "{name} {time_s}: {power} {change}"
            );
        }
    }
}

/// Power that accelerates the spin of a wheel relative to its link.
fn spin_power(inverse: &InverseDynamics, end_effector: usize, time_s: f64) -> f64 {
    let (tree, spline) = (&inverse.tree, &inverse.spline);
    let rates = spline.rates(time_s, tree);
    let mut kinematics = Kinematics::new(tree, &rates.state.configuration());
    kinematics.update(tree, &rates.state.configuration(), &rates.state.velocity);
    kinematics.accelerate(tree, &rates.acceleration);
    let mut generalised = vec![0.0; tree.dofs()];
    kinematics.inverse_dynamics(tree, &Vector3::zeros(), &mut generalised);
    let dof = tree.wheel_dof(end_effector).expect("it spins");
    generalised[dof] * rates.state.velocity[dof]
}

#[test]
fn forces_stay_in_their_cones_and_near_the_plan() {
    for plan in [walk(), swizzle()] {
        let weight_n = plan.robot.total_mass_kg() * GRAVITY_M_S2;
        let mut inverse = InverseDynamics::new(&plan);
        for (i, sample) in plan.samples.iter().enumerate() {
            for part in [0.0, 0.3, 0.5, 0.9] {
                let actuation = inverse.at(sample.time_s + part * plan.sample_interval_s);
                let feet = plan.robot.end_effectors.iter().zip(&sample.end_effectors);
                for (j, (foot, planned)) in feet.enumerate() {
                    let force = actuation.force_n[j];
                    let side = force.xy().norm();
                    assert!(side <= foot.friction_coefficient * force.z + 1e-6 * weight_n);
                    if part == 0.0 && !planned.contact {
                        assert_eq!(force, Vector3::zeros(), "sample {i}");
                    }
                    if part == 0.0 && planned.contact {
                        let off = (force - Vector3::from(planned.force_n)).norm();
                        assert!(off < 0.15 * weight_n, "sample {i}: {off}");
                    }
                }
                // These motions have enough feet to take what the plan's model neglects.
                assert!(actuation.unmet_force_n.norm() < 1e-3 * weight_n, "sample {i}");
            }
        }
    }
}

#[test]
fn plans_carry_the_torques_of_their_samples() {
    for plan in [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()] {
        let mut inverse = InverseDynamics::new(&plan);
        for sample in &plan.samples {
            let actuation = inverse.at(sample.time_s);
            assert_eq!(sample.joint_torque_nm, actuation.joint_nm);
            let motors = sample.end_effectors.iter().map(|e| e.motor_torque_nm);
            assert!(motors.eq(actuation.motor_nm), "{}", plan.motion.name);
        }
    }
}
