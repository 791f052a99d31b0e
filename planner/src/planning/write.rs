//! Conversion from unknowns to a plan.

use crate::families::Formulation;
use crate::formulation::terms::motor_speed_rad_s;
use crate::motion::Motion;
use crate::plan::{EndEffectorSample, FORMAT, Plan, Sample, SolveSummary, VERSION};
use crate::problem::state::State;
use crate::problem::variables::WheelVars;
use crate::problem::{Problem, Unknowns};
use crate::torque;
use nalgebra::{Rotation3, UnitQuaternion};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS};
use rollwalk_multibody::rotation::nearer_quaternion;
use rollwalk_robot::Joint;

/// Converts a solution to a plan with feed-forward torques.
pub(crate) fn write_plan(
    problem: &Problem,
    motion: &Motion,
    unknowns: &Unknowns,
    solve: SolveSummary,
) -> Plan {
    let mut plan = write_samples(problem, motion, unknowns, solve);
    torque::write(&mut plan);
    plan
}

/// Converts a solution to a plan without torques.
pub(super) fn write_samples(
    problem: &Problem,
    motion: &Motion,
    unknowns: &Unknowns,
    solve: SolveSummary,
) -> Plan {
    let states = problem.states(unknowns);
    let mut samples: Vec<Sample> =
        (0..states.len()).map(|t| sample(problem, t, &states[t], states.get(t + 1))).collect();
    for t in 1..samples.len() {
        let before = samples[t - 1].base_orientation_wxyz;
        let here = &mut samples[t].base_orientation_wxyz;
        *here = nearer_quaternion(*here, &before);
    }
    let after = samples.pop().expect("the timeline has a sample after the last");
    let before = samples.remove(0);
    Plan {
        format: FORMAT.into(),
        version: VERSION,
        robot: problem.model.robot().clone(),
        motion: motion.clone(),
        sample_interval_s: problem.interval_s,
        samples,
        before,
        after,
        end_placement: unknowns.placement,
        solve,
        formulation: Formulation {
            on_terrain: motion.terrain.is_some(),
            has_passive_joints: problem.model.robot().joints.iter().any(Joint::is_passive),
            is_at_rest: problem.at_rest,
        },
    }
}

/// Converts one sample of the timeline to a sample of the plan, without torques.
fn sample(problem: &Problem, t: usize, state: &State, after: Option<&State>) -> Sample {
    let layout = &problem.layout;
    let rotation = Rotation3::from_matrix_unchecked(state.pose.frames.world_from_link[0]);
    let quaternion = UnitQuaternion::from_rotation_matrix(&rotation);
    let end_effectors = layout
        .end_effectors
        .iter()
        .enumerate()
        .map(|(j, ee)| {
            let wheel =
                |pick: fn(WheelVars) -> usize| ee.wheel.map_or(0.0, |w| state.vars[pick(w)]);
            EndEffectorSample {
                contact: problem.stance[t][j],
                position_m: state.vector(ee.position).into(),
                force_n: state.vector(ee.force).into(),
                wheel_speed_rad_s: wheel(|w| w.speed),
                // The motor speed of a held wheel is exactly 0, not just nearly.
                motor_speed_rad_s: after
                    .filter(|_| !problem.held[j])
                    .map_or(0.0, |after| motor_speed_rad_s(problem, j, state, after)),
                motor_torque_nm: None,
                tilt_rad: wheel(|w| w.tilt),
                yaw_rad: wheel(|w| w.yaw),
            }
        })
        .collect();
    Sample {
        time_s: (t as f64 - 1.0) * problem.interval_s,
        base_position_m: state.vector(BASE_POSITION).into(),
        base_yaw_pitch_roll_rad: state.vector(BASE_YAW).into(),
        base_orientation_wxyz: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
        joint_rad: state
            .vars
            .rows(JOINTS, problem.model.robot().joints.len())
            .iter()
            .copied()
            .collect(),
        joint_correction_rad: Vec::new(),
        joint_torque_nm: Vec::new(),
        com_m: state.pose.com.into(),
        end_effectors,
    }
}
