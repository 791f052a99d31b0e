//! States of a plan with their kinematics and their neighbours in time, the input of all residuals.

use crate::families::Scales;
use crate::motion::{Ends, Footing};
use crate::plan::{Plan, Sample};
use crate::problem::state::ContactFrame;
use nalgebra::{DVector, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, BASE_YAW, JOINTS, Model, Pose};
use rollwalk_multibody::rotation;
use rollwalk_robot::{EndEffector, GRAVITY_M_S2, Link};

/// Lower bound of the height of the centre of mass in tolerances, m. An edited plan may have any height.
const HEIGHT_MIN_M: f64 = 0.01;

/// State of a timeline: one sample with its kinematics.
pub struct State<'a> {
    /// Sample of the plan.
    pub sample: &'a Sample,
    /// Kinematics of the sample's base pose and joint angles.
    pub pose: Pose,
    /// Contact frames from the plan's tilt and yaw.
    pub frames: Vec<ContactFrame>,
    /// Ground of the plan.
    pub ground: &'a Footing,
}

/// States of a plan in order of time, including one before the first sample and one after the final sample.
pub struct Timeline<'a> {
    /// Plan of the timeline.
    pub plan: &'a Plan,
    /// Model of the plan's robot.
    pub model: Model,
    /// States; `states[i + 1]` belongs to sample i.
    states: Vec<State<'a>>,
    /// Principal axes of the inertia of each link in the link's frame, with the second moments Σ m x² along the axes, kg·m².
    pub principal: Vec<[(Vector3<f64>, f64); 3]>,
}

/// Three neighbouring states around sample `index`.
pub struct Window<'a> {
    /// Index of the middle sample.
    pub index: usize,
    /// State before the sample.
    pub before: &'a State<'a>,
    /// State at the sample.
    pub here: &'a State<'a>,
    /// State after the sample.
    pub after: &'a State<'a>,
}

impl<'a> Timeline<'a> {
    /// Evaluates the kinematics of a plan.
    pub fn new(plan: &'a Plan) -> Self {
        let model = plan.motion.model(&plan.robot);
        let all = std::iter::once(&plan.before).chain(&plan.samples).chain([&plan.after]);
        let states = all.map(|sample| State::new(&model, &plan.motion.ground, sample)).collect();
        let principal = plan.robot.links.iter().map(principal).collect();
        Self { plan, model, states, principal }
    }

    /// Returns windows around all samples.
    pub fn samples(&self) -> impl Iterator<Item = Window<'_>> {
        self.states.windows(3).enumerate().map(|(index, w)| Window {
            index,
            before: &w[0],
            here: &w[1],
            after: &w[2],
        })
    }

    /// Returns windows around the samples that begin an interval of the motion. In a periodic motion these are all samples,
    /// because the final interval leads to the next period. In other motions the final sample is left out.
    pub fn intervals(&self) -> impl Iterator<Item = Window<'_>> {
        let count = match self.plan.motion.ends {
            Ends::Periodic => self.plan.samples.len(),
            Ends::AtRest | Ends::Prescribed => self.plan.samples.len() - 1,
        };
        self.samples().take(count)
    }

    /// Returns the neighbours of a sample within the motion. In a periodic motion, these are always two.
    pub fn neighbours<'b>(&self, w: &Window<'b>) -> Vec<&'b State<'b>> {
        let periodic = self.plan.motion.ends == Ends::Periodic;
        let before = (periodic || w.index > 0).then_some(w.before);
        let after = (periodic || w.index + 1 < self.plan.samples.len()).then_some(w.after);
        before.into_iter().chain(after).collect()
    }

    /// Factor from x₋ − 2x + x₊ to the mean of the second derivative around a sample, 1/s².
    pub fn mean_of_second_derivative(&self, w: &Window) -> f64 {
        2.0 / (self.neighbours(w).len() as f64 * self.spacing_s().powi(2))
    }

    /// Reference values for tolerances as played.
    pub fn scales(&self) -> Scales {
        let (samples, ground) = (&self.plan.samples, &self.plan.motion.ground);
        let above_m = |sample: &Sample| ground.body().height_above_m(&sample.com_m.into());
        let height_m = samples.iter().map(above_m).sum::<f64>() / samples.len() as f64;
        Scales {
            weight_n: self.model.total_mass_kg() * GRAVITY_M_S2,
            height_m: height_m.max(HEIGHT_MIN_M),
        }
    }

    /// Sample spacing h, s.
    pub fn spacing_s(&self) -> f64 {
        self.plan.sample_interval_s
    }
}

impl<'a> State<'a> {
    fn new(model: &Model, ground: &'a Footing, sample: &'a Sample) -> Self {
        let mut q = DVector::zeros(model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&sample.base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&sample.base_yaw_pitch_roll_rad);
        q.rows_mut(JOINTS, sample.joint_rad.len()).copy_from_slice(&sample.joint_rad);
        let frames = model
            .robot()
            .end_effectors
            .iter()
            .zip(&sample.end_effectors)
            .enumerate()
            .map(|(j, (e, s))| {
                let angles = e.contact.rolls().then_some([s.tilt_rad, s.yaw_rad]);
                let contact = s.position_m.into();
                let map = ground.contact(j, s.contact, &contact);
                ContactFrame::new(e.radius_m, angles, &map, &contact)
            })
            .collect();
        Self { sample, pose: model.pose(&q), frames, ground }
    }

    /// True if end effector `j` is in stance.
    pub fn stands(&self, j: usize) -> bool {
        self.sample.end_effectors[j].contact
    }

    /// Contact point e of end effector `j`, m.
    pub fn contact(&self, j: usize) -> Vector3<f64> {
        self.sample.end_effectors[j].position_m.into()
    }

    /// Height of the contact point of end effector `j` above the ground, m.
    pub fn contact_height_m(&self, j: usize) -> f64 {
        self.contact(j).z - self.frames[j].ground.height_m
    }

    /// Vertical depth of the contact point of end effector `j` below the ground itself, m; 0 above it. The envelope of swings, a
    /// margin of the planner, is above the ground on ramps, also at lift-off and touch-down.
    pub fn depth_m(&self, j: usize) -> f64 {
        (-self.ground.height_above_m(&self.contact(j))).max(0.0)
    }

    /// Ground force on end effector `j`, N.
    pub fn force(&self, j: usize) -> Vector3<f64> {
        self.sample.end_effectors[j].force_n.into()
    }

    /// Centre of mass of the plan, m.
    pub fn com(&self) -> Vector3<f64> {
        self.sample.com_m.into()
    }

    /// Mean angular velocity of the link that carries end effector `j` between this state and the state `to`, in the world frame,
    /// rad/s.
    pub fn link_velocity(&self, j: usize, to: &Self, spacing_s: f64) -> Vector3<f64> {
        let (from, to) = (&self.pose.end_effectors[j], &to.pose.end_effectors[j]);
        rotation::log(&(to.world_from_link * from.world_from_link.transpose())) / spacing_s
    }
}

fn principal(link: &Link) -> [(Vector3<f64>, f64); 3] {
    let inertia = &link.inertia_in_link_kg_m2;
    let found = inertia.symmetric_eigen();
    std::array::from_fn(|k| {
        (found.eigenvectors.column(k).into(), 0.5 * inertia.trace() - found.eigenvalues[k])
    })
}

/// Iterates over end effectors with their index.
pub(super) fn feet<'a>(timeline: &'a Timeline) -> impl Iterator<Item = (usize, &'a EndEffector)> {
    timeline.plan.robot.end_effectors.iter().enumerate()
}
