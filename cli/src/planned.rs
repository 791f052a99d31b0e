//! A library against its plans: the way that each motion was planned to make, and what of it a robot makes on simulated ground.
//!
//! A library has setpoints alone. The build keeps what its plans say in the user's cache, beside the names of its motions.

use crate::terrain::FEET_MIN;
use crate::tour::{self, Options, Played};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::world::Way;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_sim_host::ground::Travel;
use rollwalk_simulate::PlannedWay;
use rollwalk_terminal::link::names;
use rollwalk_terminal::output;
use rollwalk_terminal::packed::Packed;
use rollwalk_terminal::planning::Plans;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::sync::Arc;

/// Ending of the file in the cache.
const ENDING: &str = "ways.json";
/// Periods of a motion that repeats.
const CYCLES: u32 = 5;

/// Plan of a motion or of a transition in brief.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Planned {
    /// Forward and to the left, m, and turned, rad; of a period if it repeats.
    way: [f64; 3],
    /// Flags of the components that are goals.
    goals: [bool; 3],
    /// Duration, s; of a period if it repeats.
    duration_s: f64,
    /// Whether it repeats.
    repeats: bool,
    /// Whether it is a transition, which has no goal of its own.
    joins: bool,
    /// Reason, from the motion file, why the motion needs feedback.
    needs_feedback: Option<String>,
}

/// A clip of a library against its plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Judged {
    /// Planned way, of a period if the motion repeats.
    planned: Way,
    /// Achieved way, of a period on the mean if the motion repeats.
    achieved: Way,
    /// Achieved over planned, of the goal that is missed most; null without a goal.
    pub of_plan: Option<f64>,
    /// Reason why the motion does not hold; null if it does.
    pub miss: Option<String>,
    /// Whether the motion file says that the motion needs feedback.
    pub needs_feedback: bool,
}

impl Planned {
    fn of(plan: &Plan) -> Self {
        let PlannedWay { way, goals } = PlannedWay::new(plan);
        let motion = &plan.motion;
        Self {
            way: way.values(),
            goals,
            duration_s: motion.duration_s,
            repeats: motion.ends == Ends::Periodic,
            joins: motion.ends == Ends::Prescribed,
            needs_feedback: motion.needs_feedback.clone(),
        }
    }

    /// Compares a run with the plan.
    pub fn judge(&self, travel: &Travel) -> Judged {
        let periods = match self.repeats {
            true => (travel.duration_s() / self.duration_s).round().max(1.0),
            false => 1.0,
        };
        let achieved = of_a_period(travel.way(), periods);
        let planned = PlannedWay { way: self.way.into(), goals: self.goals };
        let astray = planned.astray(&achieved).filter(|_| !self.joins);
        let ratios = (0..3).filter_map(|of| planned.ratio(&achieved, of)).filter(|_| !self.joins);
        Judged {
            planned: planned.way,
            achieved,
            of_plan: ratios.max_by(|a, b| (a - 1.0).abs().total_cmp(&(b - 1.0).abs())),
            miss: astray.map(|astray| astray.to_string()),
            needs_feedback: self.needs_feedback.is_some(),
        }
    }
}

/// The way of a period that, made so many times, leads where a way does: each begins in the heading in which the one before ended.
fn of_a_period(way: Way, periods: f64) -> Way {
    let [forward_m, left_m, turn_rad] = way.values();
    let turn_rad = turn_rad / periods;
    // The sum of all headings, as a complex number.
    let (mut re, mut im) = (0.0, 0.0);
    for period in 0..periods as u32 {
        let (sine, cosine) = (turn_rad * f64::from(period)).sin_cos();
        (re, im) = (re + cosine, im + sine);
    }
    let size = re * re + im * im;
    let ahead_m = (forward_m * re + left_m * im) / size;
    let aside_m = (left_m * re - forward_m * im) / size;
    [ahead_m, aside_m, turn_rad].into()
}

/// Plans of a library in brief, clip by clip.
pub fn of(plans: &Plans) -> Vec<Planned> {
    plans.all().map(|planned| Planned::of(&planned.plan)).collect()
}

/// Simulated run of a library.
#[derive(Debug, Serialize)]
pub struct Simulation {
    /// Motions and transitions in the order in which they were played.
    clips: Vec<Clip>,
    /// When the robot fell, s, and what it played.
    fell: Option<(f64, String)>,
    /// Reason why the tour was cut short.
    stopped: Option<String>,
}

/// A clip that was played.
#[derive(Debug, Serialize)]
struct Clip {
    name: String,
    #[serde(flatten)]
    judged: Judged,
}

/// Plays a library on level ground, over every transition; `None` for a robot that stands on a stand, and if SAFE itself needs
/// feedback.
///
/// # Errors
/// The controller refused the library.
pub fn simulate(packed: &Packed, planned: &[Planned]) -> miette::Result<Option<Simulation>> {
    let catalog = packed.catalog();
    let safe_needs = planned.get(catalog.safe).is_some_and(|safe| safe.needs_feedback.is_some());
    if packed.robot.end_effectors.len() < FEET_MIN || safe_needs {
        return Ok(None);
    }
    output::say("simulation on level ground, as the controller plays it:");
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let options = Options {
        ground: Some(&ground),
        shoves: Vec::new(),
        feed_forward: true,
        cycles: CYCLES,
        world_log: None,
    };
    let Played { rig, travels, stopped, .. } = tour::play(packed, options)?;
    let name = |travel: &Travel| catalog.clip(travel.clip.0).unwrap_or_default();
    let falls = rig.body().ground().map(|ground| ground.falls()).unwrap_or_default();
    let fell = falls.first().map(|fall| {
        let during = travels.iter().rev().find(|travel| travel.from <= fall.at);
        (fall.at.as_s(), during.map(name).unwrap_or_default())
    });
    let judge = |travel: &Travel| {
        let judged = planned.get(usize::from(travel.clip.0))?.judge(travel);
        Some(Clip { name: name(travel), judged })
    };
    let clips = travels.iter().filter_map(judge).collect();
    Ok(Some(Simulation { clips, fell, stopped: stopped.map(|why| why.to_string()) }))
}

impl Simulation {
    /// What does not hold, a line each.
    pub fn misses(&self) -> Vec<String> {
        let motions = self.clips.iter().filter(|clip| !clip.judged.needs_feedback);
        let astray = motions.filter_map(|Clip { name, judged }| {
            Some(format!("{name} does not hold in simulation: {}", judged.miss.as_ref()?))
        });
        let needs =
            |of: &str| self.clips.iter().any(|clip| clip.name == of && clip.judged.needs_feedback);
        let fell = self.fell.iter().filter(|(_, during)| !needs(during)).map(|(at_s, during)| {
            format!(
                "{during} does not hold in simulation: the robot falls {at_s:.2} s after power-on"
            )
        });
        let stopped = self.stopped.iter().filter(|_| self.fell.is_none());
        let stopped = stopped.map(|why| format!("the library does not hold in simulation: {why}"));
        fell.chain(stopped).chain(astray).collect()
    }
}

impl fmt::Display for Simulation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ratios = self.clips.iter().filter_map(|Clip { name, judged }| {
            let remark = if judged.needs_feedback { ", needs feedback" } else { "" };
            Some(format!("{name} {:.2}{remark}", judged.of_plan?))
        });
        let ratios: Vec<_> = ratios.collect();
        match (self.misses().is_empty(), ratios.is_empty()) {
            (true, true) => f.write_str("holds in simulation"),
            (true, false) => {
                write!(f, "holds in simulation; of their plans: {}", ratios.join(", "))
            }
            (false, true) => f.write_str("in simulation"),
            (false, false) => write!(f, "in simulation, of their plans: {}", ratios.join(", ")),
        }
    }
}

/// Goals of motions at rest that the way from SAFE and back does not leave: the body shifts over contacts that stay, and the
/// transitions shift it back.
pub fn taken_back(plans: &Plans) -> Vec<String> {
    const NAMES: [&str; 3] = ["forward_m", "left_m", "turn_rad"];
    let joined = |from: usize, to: usize| {
        let found = plans.transitions.iter().find(|of| (of.from, of.to) == (from, to));
        found.map(|of| of.planned.plan.reached())
    };
    let mut found = Vec::new();
    for (number, motion) in plans.motions.iter().enumerate() {
        let plan = &motion.plan;
        let PlannedWay { way, goals } = PlannedWay::new(plan);
        if plan.motion.ends != Ends::AtRest || !goals.contains(&true) {
            continue;
        }
        let (Some(there), Some(back)) = (joined(plans.safe, number), joined(number, plans.safe))
        else {
            continue;
        };
        let net = [there, way.values(), back].into_iter().fold([0.0; 3], then);
        for of in (0..3).filter(|&of| goals[of]) {
            let (wanted, left) = (way.values()[of], net[of]);
            if !(0.95..=1.05).contains(&(left / wanted)) {
                found.push(format!(
                    "{}: of its {} = {wanted:.3}, {left:.3} are left after SAFE, the motion and SAFE again: it shifts the body over contacts that stay, \
                     and its transitions shift it back",
                    plan.motion.name, NAMES[of]
                ));
            }
        }
    }
    found
}

/// A way, and another one after it, each in the heading in which it begins.
fn then([x_m, y_m, turned_rad]: [f64; 3], [forward_m, left_m, turn_rad]: [f64; 3]) -> [f64; 3] {
    let (sine, cosine) = turned_rad.sin_cos();
    [
        x_m + forward_m * cosine - left_m * sine,
        y_m + forward_m * sine + left_m * cosine,
        turned_rad + turn_rad,
    ]
}

/// Writes the brief plans of a library to the cache.
pub fn keep(library: u32, planned: &[Planned]) {
    names::keep_of(library, ENDING, &planned);
}

/// Brief plans of the library with this identity, from the cache.
pub fn kept(library: u32) -> Option<Vec<Planned>> {
    names::kept_of(library, ENDING)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_period_made_several_times_leads_where_all_do() {
        let period = Way { forward_m: 0.12, left_m: -0.03, turn_rad: 0.4 };
        let (mut x_m, mut y_m) = (0.0, 0.0);
        for number in 0..7 {
            let (sine, cosine) = (0.4 * f64::from(number)).sin_cos();
            x_m += period.forward_m * cosine - period.left_m * sine;
            y_m += period.forward_m * sine + period.left_m * cosine;
        }
        let found = of_a_period(Way { forward_m: x_m, left_m: y_m, turn_rad: 2.8 }, 7.0);
        for (found, expected) in found.values().into_iter().zip(period.values()) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
