//! Optimisation problem: robot, timeline, contact schedule, goals and weights, with its variables and states.
//!
//! A problem is built from a motion goal ([`Problem::new`]), from two states of other motions ([`Problem::transition`]) or from
//! the present state of a robot ([`Problem::horizon`]). Costs and constraints are in [`crate::formulation`].

mod contact_ground;
pub(crate) mod extent;
mod footholds;
mod horizon;
mod means;
mod reach;
pub mod state;
pub mod variables;
mod weights;

pub use contact_ground::ContactGround;
pub use horizon::HorizonGoal;
pub use means::MeanWeights;
pub use weights::Weights;

use crate::motion::{Ends, Footing, Goal, HeightLimit, Moment, Motion, Reserve, Target, swing};
use crate::plan::Placement;
use nalgebra::DVector;
use rollwalk_multibody::clearance::GroundPoint;
use rollwalk_multibody::euler::Model;
use rollwalk_multibody::ground::obstacle::Obstacle;
use rollwalk_multibody::parts::Part;
use state::State;
use variables::{Layout, Lift, TimelineSample, force_scale_n};
use weights::WEIGHT_INTERVAL_S;

/// Optimisation problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Model of the robot.
    pub model: Model,
    /// Layout of a sample.
    pub layout: Layout,
    /// Sample spacing h, s.
    pub interval_s: f64,
    /// Number T of samples of the motion. The timeline has T + 2 samples; its index 0 is before the motion.
    pub samples: usize,
    /// Slot and placement of every timeline sample.
    pub timeline: Vec<TimelineSample>,
    /// Contact flags along the timeline: `[timeline sample][end effector]`.
    pub stance: Vec<Vec<bool>>,
    /// Ground under the robot.
    pub ground: Footing,
    /// Ground and borders at the contacts along the timeline: `[timeline sample][end effector]`.
    pub contacts: Vec<Vec<ContactGround>>,
    /// Points of links that must keep clear of the ground.
    pub clearance_points: Vec<GroundPoint>,
    /// Parts of the robot that must keep clear of obstacles. Empty without obstacles.
    pub obstacle_parts: Vec<Part>,
    /// Obstacles that the robot may reach.
    pub obstacles: Vec<Obstacle>,
    /// Heights of contact points above the ground along the timeline, m (Eq. 2.9).
    pub height_m: Vec<Vec<f64>>,
    /// Height w_h of a swing, m (Eq. 2.9).
    pub swing_height_m: f64,
    /// True if the motion is periodic. The intervals of a periodic motion include the one from the last sample to the next
    /// period.
    pub periodic: bool,
    /// True if the robot stands still before and after the motion.
    pub at_rest: bool,
    /// Flags of the slot entries that are not optimised: `[slot][variable]`.
    pub frozen: Vec<Vec<bool>>,
    /// Placement of the base at the first sample.
    pub start: Placement,
    /// True if the placement (D, ψ) is optimised.
    pub placement_free: bool,
    /// Flags of the end effectors whose wheel is welded to its link or held still.
    pub held: Vec<bool>,
    /// Fractions of the motors' limits that the plan may use.
    pub reserve: Reserve,
    /// Functional objectives.
    pub goal: Goal,
    /// Targets at chosen times.
    pub targets: Vec<PlacedTarget>,
    /// Height limits: `[timeline sample][limit]`.
    pub heights: Vec<Vec<HeightLimit>>,
    /// Standing configurations on the plane z = 0, the targets of the posture cost.
    pub posture_q: Vec<DVector<f64>>,
    /// Requested velocity of the body in the interval after each sample: along its heading and to the left, m/s, and yaw rate,
    /// rad/s. Empty if the motion is not steered.
    pub steering: Vec<[f64; 3]>,
    /// Weights.
    pub weights: Weights,
}

/// Unknowns of the optimisation: slots and placement.
#[derive(Clone, Debug, PartialEq)]
pub struct Unknowns {
    /// Stored samples, SI units.
    pub slots: Vec<DVector<f64>>,
    /// Placement of the end, D and ψ.
    pub placement: Placement,
}

/// Target on the timeline.
#[derive(Clone, Debug)]
pub struct PlacedTarget {
    /// Target of the motion.
    pub target: Target,
    /// Timeline index of the sample in the middle of its window.
    pub middle: usize,
    /// Weights of the window's three samples at the target's time.
    pub moment: Moment,
}

/// Places the targets of a motion on its timeline.
fn placed_targets(motion: &Motion) -> Vec<PlacedTarget> {
    let place = |target: &Target| {
        let moment = Moment::of(motion, target.at_s);
        PlacedTarget { target: target.clone(), middle: moment.sample + 1, moment }
    };
    motion.targets.iter().map(place).collect()
}

/// Height limits of each timeline sample. The first and last timeline sample have none, because they are copies of others.
fn placed_heights(motion: &Motion) -> Vec<Vec<HeightLimit>> {
    let at = |sample: usize| {
        motion.heights.iter().filter(|limit| limit.holds_at(motion, sample)).cloned().collect()
    };
    let inner = (0..motion.stance.len()).map(at);
    std::iter::once(Vec::new()).chain(inner).chain([Vec::new()]).collect()
}

/// State at which a transition starts or ends, with its neighbour outside the transition.
#[derive(Clone, Debug)]
pub struct PrescribedEnd {
    /// Variables of the sample at the end.
    pub at: DVector<f64>,
    /// Variables one interval further out.
    pub beyond: DVector<f64>,
    /// Contact flags at the end.
    pub stance: Vec<bool>,
    /// Posture of the motion at the end, rad, in joint order.
    pub posture_rad: Vec<f64>,
}

/// Standing configurations on a smooth path from one posture to another, at rest at both ends.
fn blend(model: &Model, from_rad: &[f64], to_rad: &[f64], samples: usize) -> Vec<DVector<f64>> {
    (0..samples)
        .map(|i| {
            let u = i as f64 / (samples - 1) as f64;
            let share = u * u * (3.0 - 2.0 * u);
            let angles = from_rad.iter().zip(to_rad).map(|(from, to)| from + share * (to - from));
            model.standing_q(&angles.collect::<Vec<_>>())
        })
        .collect()
}

/// Slot of every sample of a timeline.
fn slots(timeline: &[TimelineSample]) -> Vec<usize> {
    timeline.iter().map(|sample| sample.slot).collect()
}

impl Problem {
    /// Builds the problem of a motion goal with periodic or at-rest ends.
    pub fn new(model: Model, motion: &Motion, weights: Weights) -> Self {
        let layout = Layout::new(&model);
        let samples = motion.stance.len();
        let periodic = motion.ends == Ends::Periodic;
        let last = samples - 1;
        let mut timeline = Vec::with_capacity(samples + 2);
        let ghost = |slot, lift| TimelineSample {
            slot,
            lift: if periodic { lift } else { Lift::Identity },
        };
        timeline.push(ghost(if periodic { last } else { 0 }, Lift::PlacedBack));
        timeline.extend((0..samples).map(|slot| TimelineSample { slot, lift: Lift::Identity }));
        timeline.push(ghost(if periodic { 0 } else { last }, Lift::Placed));
        let stance = timeline.iter().map(|s| motion.stance[s.slot].clone()).collect();
        let intervals = if periodic { samples } else { last };
        let mut problem = Self {
            interval_s: motion.duration_s / intervals as f64,
            samples,
            ground: motion.ground.clone(),
            height_m: swing::heights(&slots(&timeline), &motion.stance, motion),
            swing_height_m: motion.swing_height_m,
            timeline,
            stance,
            periodic,
            at_rest: motion.ends == Ends::AtRest,
            frozen: vec![vec![false; layout.len]; samples],
            start: Placement::default(),
            placement_free: periodic,
            held: motion.still_wheels(model.robot()),
            reserve: motion.reserve,
            goal: motion.goal,
            targets: placed_targets(motion),
            heights: placed_heights(motion),
            posture_q: motion.postures(&model),
            steering: Vec::new(),
            contacts: Vec::new(),
            clearance_points: Vec::new(),
            obstacle_parts: Vec::new(),
            obstacles: Vec::new(),
            weights,
            model,
            layout,
        };
        problem.assign_footholds();
        problem
    }

    /// Builds the problem of a transition from `start` to `end`. `motion.stance` includes the samples at both ends. The
    /// placement of the end and the ground forces at both ends are free.
    pub fn transition(
        model: Model,
        motion: &Motion,
        start: &PrescribedEnd,
        end: &PrescribedEnd,
        weights: Weights,
    ) -> (Self, [DVector<f64>; 4]) {
        let layout = Layout::new(&model);
        let samples = motion.stance.len();
        // Slots: the samples, then the two states beyond the ends.
        let mut timeline = vec![TimelineSample { slot: samples, lift: Lift::Identity }];
        timeline.extend((0..samples).map(|slot| TimelineSample { slot, lift: Lift::Identity }));
        timeline[samples].lift = Lift::Placed;
        timeline.push(TimelineSample { slot: samples + 1, lift: Lift::Placed });
        let mut slot_stance = motion.stance.clone();
        slot_stance.push(start.stance.clone());
        slot_stance.push(end.stance.clone());
        let stance = timeline.iter().map(|s| slot_stance[s.slot].clone()).collect();
        let mut frozen = vec![vec![false; layout.len]; samples + 2];
        for slot in [samples, samples + 1] {
            frozen[slot].fill(true);
        }
        for slot in [0, samples - 1] {
            frozen[slot].fill(true);
            for force in layout.vectors() {
                frozen[slot][force..force + 3].fill(false);
            }
        }
        // The speed in the first interval is that of the first sample, and free.
        for wheel in layout.end_effectors.iter().filter_map(|e| e.wheel) {
            frozen[0][wheel.speed] = false;
        }
        let mut problem = Self {
            interval_s: motion.duration_s / (samples - 1) as f64,
            samples,
            ground: motion.ground.clone(),
            height_m: swing::heights(&slots(&timeline), &slot_stance, motion),
            swing_height_m: motion.swing_height_m,
            timeline,
            stance,
            periodic: false,
            at_rest: false,
            frozen,
            start: Placement::default(),
            placement_free: true,
            held: motion.still_wheels(model.robot()),
            reserve: motion.reserve,
            goal: motion.goal,
            targets: placed_targets(motion),
            heights: placed_heights(motion),
            posture_q: blend(&model, &start.posture_rad, &end.posture_rad, samples),
            contacts: Vec::new(),
            clearance_points: Vec::new(),
            obstacle_parts: Vec::new(),
            obstacles: Vec::new(),
            steering: Vec::new(),
            weights,
            model,
            layout,
        };
        problem.assign_footholds();
        let fixed = [start.at.clone(), end.at.clone(), start.beyond.clone(), end.beyond.clone()];
        (problem, fixed)
    }

    /// Returns true if the end effectors of a motion at rest can move by its goal: all of them step, or they roll or step
    /// straight ahead. Wheels that stay on the ground may be unable to go sideways or to turn. False for motions with `lying`.
    pub fn contacts_carry_goal(&self) -> bool {
        let ends = &self.model.robot().end_effectors;
        let steps = |j: usize| self.stance.iter().any(|flags| !flags[j]);
        let moves = |j: usize| steps(j) || (ends[j].contact.rolls() && !self.held[j]);
        let is_straight = [self.goal.left_m, self.goal.turn_rad]
            .into_iter()
            .all(|component| component.unwrap_or(0.0) == 0.0);
        self.at_rest
            && !ends.iter().any(|end| end.contact.is_body_point())
            && (0..ends.len()).all(|j| if is_straight { moves(j) } else { steps(j) })
    }

    /// Ground force Mg/n on each of n feet if all are in stance, N.
    pub fn force_scale_n(&self) -> f64 {
        force_scale_n(&self.model)
    }

    /// Factor that makes the cost of differences of order k independent of the sample spacing h. Orders are 0 for values, 1 for
    /// speeds and 2 for accelerations. With Δᵏq = hᵏ dᵏq/dtᵏ, Σ w (Δᵏq)² then approximates ∫ w' (dᵏq/dtᵏ)² dt. The factor is 1
    /// at the spacing at which the weights were tuned.
    pub fn per_time(&self, order: i32) -> f64 {
        (self.interval_s / WEIGHT_INTERVAL_S).powi(1 - 2 * order)
    }

    /// Placement of the goal, with 0 for its free components.
    pub fn goal_placement(&self) -> Placement {
        let goal = &self.goal;
        Placement {
            offset_m: [goal.forward_m.unwrap_or(0.0), goal.left_m.unwrap_or(0.0)],
            yaw_rad: goal.turn_rad.unwrap_or(0.0),
        }
    }

    /// Timeline index of the sample at which the motion's displacement is measured.
    pub fn last(&self) -> usize {
        if self.periodic { self.samples + 1 } else { self.samples }
    }

    /// Weights of the samples around timeline index `t` in the dynamics at that sample.
    pub fn mean_weights(&self, t: usize) -> MeanWeights {
        let [before, after] = [t > 1, t < self.samples].map(|inside| inside || self.periodic);
        MeanWeights::new(before, after)
    }

    /// Sets the force and moment sums of every slot to those of its ground forces.
    pub fn add_up(&self, unknowns: &mut Unknowns) {
        for slot in &mut unknowns.slots {
            // Sums of forces do not depend on the ground.
            let state = State::new(&self.model, &self.layout, &self.contacts[0], slot.clone());
            let [force, moment] = state.wrench(&self.layout);
            slot.fixed_rows_mut::<3>(self.layout.wrench).copy_from(&force);
            slot.fixed_rows_mut::<3>(self.layout.wrench + 3).copy_from(&moment);
        }
    }

    /// Evaluates the whole timeline, without derivatives of its kinematics.
    pub fn states(&self, unknowns: &Unknowns) -> Vec<State> {
        self.states_in(unknowns, Vec::new())
    }

    /// Evaluates the timeline as [`states`](Self::states) does, in the memory of earlier states.
    pub fn states_in(&self, unknowns: &Unknowns, mut states: Vec<State>) -> Vec<State> {
        let Self { model, layout, contacts, timeline, .. } = self;
        let is_of = |state: &State| state.is_of(model, layout);
        if states.len() == timeline.len() && states.iter().all(is_of) {
            for ((state, sample), contacts) in states.iter_mut().zip(timeline).zip(contacts) {
                let stored = &unknowns.slots[sample.slot];
                state.vars.copy_from(stored);
                sample.lift.lift(layout, stored, &unknowns.placement, &mut state.vars);
                state.update(model, layout, contacts);
            }
        } else {
            states.clear();
            states.extend(timeline.iter().zip(contacts).map(|(sample, contacts)| {
                let stored = &unknowns.slots[sample.slot];
                let vars = sample.lift.apply(layout, stored, &unknowns.placement);
                State::new(model, layout, contacts, vars)
            }));
        }
        for t in 1..states.len() {
            let [from, to] = &mut states[t - 1..=t] else { unreachable!("two states") };
            let swept = from.swept_to_next.get_or_insert_default();
            model.update_swept_moment(&from.pose, &to.pose, swept);
        }
        states
    }

    /// Computes the derivatives of the kinematics of a timeline that are not computed yet.
    pub fn differentiate(&self, states: &mut [State]) {
        for state in states.iter_mut() {
            state.pose.differentiate(&self.model);
        }
        for t in 1..states.len() {
            let [from, to] = &mut states[t - 1..=t] else { unreachable!("two states") };
            if let Some(swept) = &mut from.swept_to_next {
                swept.differentiate(&self.model, &from.pose, &to.pose);
            }
        }
    }
}
