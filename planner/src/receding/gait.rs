//! Gait of a horizon: stance and swing of each end effector over a cycle, and the sway of the body.

use crate::motion::{Ends, Footing, Goal, Motion};
use crate::plan::Placement;
use crate::plan::Plan;
use crate::problem::variables::{Layout, Lift};
use crate::start::guess;
use nalgebra::DVector;
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, Model};
use rollwalk_robot::Robot;
use thiserror::Error;

/// Reason why a motion is not a gait.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum GaitError {
    /// The motion does not repeat.
    #[error(
        "motion `{motion}` has ends = \"{ends}\" and does not repeat; give a plan with ends = \
         \"periodic\", or use the gait that stands on all end effectors"
    )]
    DoesNotRepeat {
        /// Name of the motion.
        motion: String,
        /// Ends of the motion.
        ends: Ends,
    },
    /// The sample spacing is not a positive time.
    #[error("sample spacing is {interval_s} s; expected a time above 0 s")]
    NoSpacing {
        /// Sample spacing, s.
        interval_s: f64,
    },
}

/// Cyclic footfall pattern, at the sample spacing of its horizons.
#[derive(Clone, Debug)]
pub struct Gait {
    /// Motion of one period: footfalls, swing height, posture, held wheels and reserve.
    pub(super) motion: Motion,
    /// Variables of each sample, relative to its base: the base is at the origin with heading 0.
    pub(super) cycle: Vec<DVector<f64>>,
    /// Velocity of the body in the interval after each sample, minus the mean over the cycle: along the heading and to the
    /// left, m/s, and yaw rate, rad/s.
    pub(super) sway: Vec<[f64; 3]>,
}

impl Gait {
    /// Returns the footfalls of a periodic plan, and the sway of its body. Added to the steered velocity, the sway shifts the
    /// weight to the stance feet.
    ///
    /// # Errors
    /// Returns an error if the plan is not periodic.
    pub fn of(plan: &Plan) -> Result<Self, GaitError> {
        let motion = &plan.motion;
        if motion.ends != Ends::Periodic {
            return Err(GaitError::DoesNotRepeat {
                motion: motion.name.clone(),
                ends: motion.ends,
            });
        }
        let layout = Layout::new(&Model::new(&plan.robot));
        let placed: Vec<_> =
            plan.samples.iter().chain([&plan.after]).map(|s| layout.variables_of(s)).collect();
        let velocity = |pair: &[DVector<f64>]| {
            let [from, to] = pair else { unreachable!("two samples") };
            let moved: [f64; 3] = [BASE_POSITION, BASE_POSITION + 1, BASE_YAW]
                .map(|k| (to[k] - from[k]) / plan.sample_interval_s);
            let (sin, cos) = (0.5 * (from[BASE_YAW] + to[BASE_YAW])).sin_cos();
            [cos * moved[0] + sin * moved[1], cos * moved[1] - sin * moved[0], moved[2]]
        };
        let velocities: Vec<[f64; 3]> = placed.windows(2).map(velocity).collect();
        let mean =
            |c: usize| velocities.iter().map(|v| v[c]).sum::<f64>() / velocities.len() as f64;
        let mean = [mean(0), mean(1), mean(2)];
        let sway = velocities.iter().map(|v| [0, 1, 2].map(|c| v[c] - mean[c])).collect();
        let cycle =
            placed[..motion.stance.len()].iter().map(|vars| relative_to_base(&layout, vars));
        Ok(Self { motion: motion.clone(), cycle: cycle.collect(), sway })
    }

    /// Returns a gait with all end effectors in stance, in the robot's nominal posture, for driving or standing.
    ///
    /// # Errors
    /// Returns an error if `interval_s` is not a positive time.
    pub fn standing(robot: &Robot, interval_s: f64) -> Result<Self, GaitError> {
        let nominal: Vec<f64> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        Self::standing_in(robot, interval_s, &nominal)
    }

    /// Returns a gait with all end effectors in stance, in the posture of the given joint angles, rad.
    ///
    /// # Errors
    /// Returns an error if `interval_s` is not a positive time.
    pub fn standing_in(
        robot: &Robot,
        interval_s: f64,
        joint_rad: &[f64],
    ) -> Result<Self, GaitError> {
        if !(interval_s.is_finite() && interval_s > 0.0) {
            return Err(GaitError::NoSpacing { interval_s });
        }
        let count = robot.end_effectors.len();
        let motion = Motion {
            name: "stand".into(),
            duration_s: interval_s,
            ends: Ends::Periodic,
            stance: vec![vec![true; count]],
            swing_height_m: 0.0,
            goal: Goal::default(),
            posture_rad: joint_rad.to_vec(),
            lying_rad: None,
            held_wheels: vec![false; count],
            targets: Vec::new(),
            heights: Vec::new(),
            reserve: Default::default(),
            terrain: None,
            ground: Footing::default(),
            needs_feedback: None,
            timing: Default::default(),
        };
        let model = Model::new(robot);
        let layout = Layout::new(&model);
        let mut stand = DVector::zeros(layout.len);
        stand.rows_mut(0, layout.dofs).copy_from(&model.standing_q(&motion.posture_rad));
        guess::follow_kinematics(&model, &layout, &motion.ground, &mut stand);
        Ok(Self { motion, cycle: vec![stand], sway: vec![[0.0; 3]] })
    }

    /// Number of samples in a period.
    pub fn samples(&self) -> usize {
        self.motion.stance.len()
    }

    /// Sample spacing, s.
    pub fn interval_s(&self) -> f64 {
        self.motion.interval_s()
    }
}

/// Moves variables so that the base is at the origin with heading 0.
pub(super) fn relative_to_base(layout: &Layout, vars: &DVector<f64>) -> DVector<f64> {
    Lift::PlacedBack.apply(layout, vars, &base_placement(vars))
}

/// Position of the base over the ground, and heading of the base.
pub(super) fn base_placement(vars: &DVector<f64>) -> Placement {
    Placement { offset_m: [vars[BASE_POSITION], vars[BASE_POSITION + 1]], yaw_rad: vars[BASE_YAW] }
}
