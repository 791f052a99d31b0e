//! Simulation of a library on level ground over every transition, compared with its plans.

use super::{ClipResult, PlanSummary};
use crate::terrain::FEET_MIN;
use crate::tour::{self, Options, TourResult};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_planner::plan::Plan;
use rollwalk_sim_host::ground::Travel;
use rollwalk_simulate::Verdict;
use rollwalk_terminal::planning::Plans;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;
use std::fmt;
use std::sync::Arc;

/// Number of periods of a periodic motion.
const CYCLES: u32 = 5;

/// Simulated run of a library.
#[derive(Debug, Serialize)]
pub struct Simulation {
    /// Motions and transitions in the order of playing.
    clips: Vec<Clip>,
    /// Time of the fall, s, and the clip during which it happened.
    fell: Option<(f64, String)>,
    /// Reason why the tour ended early.
    stopped: Option<String>,
    /// Motions for a terrain, each played alone on its terrain.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    on_terrain: Vec<OnTerrain>,
}

/// Motion that was played alone on its terrain.
#[derive(Debug, Serialize)]
struct OnTerrain {
    name: String,
    #[serde(flatten)]
    verdict: Verdict,
    /// True for a motion with `needs_feedback` in its file.
    needs_feedback: bool,
}

/// A clip that was played.
#[derive(Debug, Serialize)]
struct Clip {
    name: String,
    #[serde(flatten)]
    judged: ClipResult,
}

/// Plays a library on level ground, over every transition, and each motion for a terrain alone on its terrain. Returns `None`
/// for a robot with too few feet to stand, and if SAFE itself needs feedback.
///
/// # Errors
/// Returns an error if the controller refused the library.
pub fn simulate(
    packed: &ValidatedLibrary,
    plans: &Plans,
    planned: &[PlanSummary],
) -> miette::Result<Option<Simulation>> {
    let catalog = packed.catalog();
    let safe_needs = planned.get(catalog.safe).is_some_and(|safe| safe.needs_feedback.is_some());
    if packed.robot.end_effectors.len() < FEET_MIN || safe_needs {
        return Ok(None);
    }
    output::print_line("simulation of the library on level ground:");
    let ground: Arc<dyn Ground> = Arc::new(Plane::level());
    let options = Options {
        ground: Some(&ground),
        shoves: Vec::new(),
        feed_forward: true,
        cycles: CYCLES,
        at_places: false,
        world_robot: None,
        world_log: None,
    };
    let TourResult { rig, travels, stopped, .. } = tour::play(packed, options)?;
    let name =
        |travel: &Travel| travel.clip().and_then(|clip| catalog.clip(clip.0)).unwrap_or_default();
    let falls = rig.body().ground().map(|ground| ground.falls()).unwrap_or_default();
    let fell = falls.first().map(|fall| {
        let during = travels.iter().rev().find(|travel| travel.from <= fall.at);
        (fall.at.as_s(), during.map(name).unwrap_or_default())
    });
    let judge = |travel: &Travel| {
        let judged = planned.get(usize::from(travel.clip()?.0))?.compare(travel);
        Some(Clip { name: name(travel), judged })
    };
    let clips = travels.iter().filter_map(judge).collect();
    let stopped = stopped.map(|why| why.to_string());
    Ok(Some(Simulation { clips, fell, stopped, on_terrain: on_terrain(plans) }))
}

/// Verdicts of the motions for a terrain. Ends early after Ctrl-C.
fn on_terrain(plans: &Plans) -> Vec<OnTerrain> {
    let plans = plans.motions.iter().map(|motion| &motion.plan);
    let judge = |plan: &Plan| {
        Some(OnTerrain {
            name: plan.motion.name.clone(),
            verdict: Verdict::of(plan, |_| !interrupt::requested())?,
            needs_feedback: plan.motion.needs_feedback.is_some(),
        })
    };
    plans.filter(|plan| plan.motion.terrain.is_some()).filter_map(judge).collect()
}

impl Simulation {
    /// Motions that failed their checks, one line each with the reason.
    pub fn misses(&self) -> Vec<String> {
        let motions = self.clips.iter().filter(|clip| !clip.judged.needs_feedback);
        let astray = motions.filter_map(|Clip { name, judged }| {
            Some(format!("{name} fails in simulation: {}", judged.miss.as_ref()?))
        });
        let needs =
            |of: &str| self.clips.iter().any(|clip| clip.name == of && clip.judged.needs_feedback);
        let fell = self.fell.iter().filter(|(_, during)| !needs(during)).map(|(at_s, during)| {
            format!("{during} fails in simulation: the robot falls {at_s:.2} s after power-on")
        });
        let stopped = self.stopped.iter().filter(|_| self.fell.is_none());
        let stopped = stopped.map(|why| format!("the library fails in simulation: {why}"));
        let off = self.on_terrain.iter().filter(|of| !of.verdict.holds() && !of.needs_feedback);
        let off =
            off.map(|OnTerrain { name, verdict, .. }| format!("{name}, on its terrain: {verdict}"));
        fell.chain(stopped).chain(astray).chain(off).collect()
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
            (true, true) => f.write_str("passes the simulation"),
            (true, false) => {
                write!(
                    f,
                    "passes the simulation; achieved fraction of the planned distance or turn: {}",
                    ratios.join(", ")
                )
            }
            (false, true) => f.write_str("in simulation"),
            (false, false) => {
                write!(
                    f,
                    "in simulation, achieved fraction of the planned distance or turn: {}",
                    ratios.join(", ")
                )
            }
        }
    }
}
