//! Problem of a receding horizon, which begins in a state with given velocity, has a free end and is steered by requested
//! velocities.

use super::variables::{Layout, Lift, TimelineSample};
use super::{ContactGround, Problem, Weights};
use crate::motion::Motion;
use crate::plan::Placement;
use rollwalk_multibody::euler::Model;

/// Inputs of a horizon.
#[derive(Clone, Debug)]
pub struct HorizonGoal {
    /// Placement of the base at the first sample.
    pub start: Placement,
    /// Heights of contact points above the ground `[sample][end effector]`, m: 0 in stance.
    pub height_m: Vec<Vec<f64>>,
    /// Requested velocity of the body in the interval after each sample: along its heading and to the left, m/s, and yaw rate,
    /// rad/s.
    pub steering: Vec<[f64; 3]>,
    /// Ground at the contacts, `[sample][end effector]`; `None` on level ground.
    pub contacts: Option<Vec<Vec<ContactGround>>>,
}

impl Problem {
    /// Builds the problem of a horizon.
    ///
    /// The slots are those of the samples, then the states one interval before the first and after the last sample. The state
    /// before is given, and so is the first sample except for its ground forces and wheel speeds. The state after determines
    /// the final velocity; its pose and joints are free.
    pub fn horizon(model: Model, motion: &Motion, goal: HorizonGoal, weights: Weights) -> Self {
        let layout = Layout::new(&model);
        let samples = motion.stance.len();
        let slots = std::iter::once(samples).chain(0..samples).chain([samples + 1]);
        let timeline: Vec<_> =
            slots.map(|slot| TimelineSample { slot, lift: Lift::Identity }).collect();
        // States outside have the contacts of the samples beside them.
        let beside = |t: usize| t.clamp(1, samples) - 1;
        let around =
            |rows: &[Vec<f64>]| (0..samples + 2).map(|t| rows[beside(t)].clone()).collect();
        let contacts = goal.contacts.unwrap_or_default();
        let mut frozen = vec![vec![false; layout.len]; samples + 2];
        frozen[samples].fill(true);
        frozen[samples + 1][layout.dofs..].fill(true);
        frozen[0].fill(true);
        for force in layout.vectors() {
            frozen[0][force..force + 3].fill(false);
        }
        for wheel in layout.end_effectors.iter().filter_map(|e| e.wheel) {
            frozen[0][wheel.speed] = false;
        }
        let mut problem = Self {
            interval_s: motion.duration_s / (samples - 1) as f64,
            samples,
            ground: motion.ground.clone(),
            height_m: around(&goal.height_m),
            swing_height_m: motion.swing_height_m,
            stance: (0..samples + 2).map(|t| motion.stance[beside(t)].clone()).collect(),
            timeline,
            periodic: false,
            at_rest: false,
            frozen,
            start: goal.start,
            placement_free: false,
            held: motion.still_wheels(model.robot()),
            reserve: motion.reserve,
            goal: motion.goal,
            targets: Vec::new(),
            heights: vec![Vec::new(); samples + 2],
            posture_q: vec![model.standing_q(&motion.posture_rad); samples],
            steering: goal.steering,
            contacts: Vec::new(),
            clearance_points: Vec::new(),
            obstacle_parts: Vec::new(),
            obstacles: Vec::new(),
            weights,
            model,
            layout,
        };
        if contacts.is_empty() {
            problem.assign_footholds();
        } else {
            problem.contacts = (0..samples + 2).map(|t| contacts[beside(t)].clone()).collect();
            problem.assign_clearance();
        }
        problem
    }
}
