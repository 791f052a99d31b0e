//! Results of each motion on the ground, compared with its plan.

use crate::excursion::{self, Excursion};
use rollwalk_physics::world::{NetDisplacement, ObstacleContact, Totals};
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_sim_host::ground::{Grounded, Travel};
use rollwalk_simulate::PlannedDisplacement;
use rollwalk_terminal::planning::Plans;
use serde::Serialize;

/// Results on the ground.
#[derive(Serialize)]
pub struct World {
    /// Motions and transitions in the order of playing.
    pub travels: Vec<Row>,
    /// Net displacements from SAFE to SAFE.
    pub excursions: Vec<Excursion>,
    pub falls: usize,
    /// First contact with an obstacle during each motion; null without obstacles.
    pub obstacle_contacts: Option<Vec<ObstacleContact>>,
}

/// Motion or transition that was played.
#[derive(Serialize)]
pub struct Row {
    pub name: String,
    /// Playing time, s.
    pub played_s: f64,
    /// Number of consecutive cycles.
    pub cycles: f64,
    /// Planned displacement of all cycles.
    pub planned: NetDisplacement,
    /// Measured displacement of the robot.
    pub achieved: NetDisplacement,
    /// Worst relative error of the displacement in directions with a planned goal. Null without goals, and for a loop that
    /// ended in mid-cycle.
    pub goal_error: Option<f64>,
    /// Totals of tilt, slip, force and work.
    #[serde(flatten)]
    pub totals: Totals,
}

impl World {
    /// Compares the displacement of each played clip with its plan.
    pub fn new(plans: &Plans, travels: &[Travel], ground: &Grounded) -> Self {
        let motions = plans.motions.iter().map(|planned| planned.plan.motion.name.as_str());
        let excursions = excursion::of_tour(travels, &motions.collect::<Vec<_>>(), plans.safe);
        let plans: Vec<&Plan> = plans.all().map(|planned| &planned.plan).collect();
        let row = |travel: &Travel| Some(row(plans.get(usize::from(travel.clip()?.0))?, travel));
        Self {
            travels: travels.iter().filter_map(row).collect(),
            excursions,
            falls: ground.falls().len(),
            obstacle_contacts: ground.obstacle_contacts().map(<[_]>::to_vec),
        }
    }

    /// Maximum relative error over all goals.
    pub fn goal_error(&self) -> f64 {
        self.travels.iter().filter_map(|row| row.goal_error).fold(0.0, f64::max)
    }
}

fn row(plan: &Plan, travel: &Travel) -> Row {
    let planned = PlannedDisplacement::new(plan);
    // A finite motion was played once, and held at its end.
    let cycles = match plan.motion.ends {
        Ends::Periodic => (travel.duration_s() / plan.motion.duration_s).round().max(1.0),
        _ => 1.0,
    };
    let achieved = travel.displacement();
    let mean: NetDisplacement = achieved.values().map(|value| value / cycles).into();
    let errors = (0..3).filter_map(|of| Some((planned.ratio(&mean, of)? - 1.0).abs()));
    // If a loop was left before its end, its distance cannot be compared with the goal.
    let is_whole = (travel.duration_s() / plan.motion.duration_s - cycles).abs() < 0.05
        || plan.motion.ends != Ends::Periodic;
    Row {
        name: plan.motion.name.clone(),
        played_s: travel.duration_s(),
        cycles,
        planned: planned.way.values().map(|value| cycles * value).into(),
        achieved,
        goal_error: errors.reduce(f64::max).filter(|_| is_whole),
        totals: travel.totals(),
    }
}
