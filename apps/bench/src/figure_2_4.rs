//! Figure 2.4 of the thesis: longer front legs, with the other parameters unchanged or adapted to keep the body level.

use crate::{Block, Findings, Verdict, inputs, table, unless_interrupted};
use miette::IntoDiagnostic;
use rollwalk_design::keep::keep;
use rollwalk_design::plans::Plans;
use rollwalk_planner::Progress;
use rollwalk_planner::plot::chart::{self, Curve, Labels};
use rollwalk_planner::sensitivity::Feature;
use rollwalk_terminal::interrupt;
use serde::Serialize;

/// Design file.
pub const DESIGN: &str = "designs/agilebot_legs.toml";
/// Parameter that is changed.
const GIVEN: &str = "front_thigh";
/// Increase of the parameter [`GIVEN`], m.
const LONGER_M: f64 = 0.02;
/// Largest accepted change of the pitch if the other parameters compensate, degrees.
const KEPT_DEG: f64 = 0.1;
/// Smallest expected mean change of the pitch if only the given parameter changes, degrees.
const BY_HAND_DEG: f64 = 1.0;

/// Results of a method of changing the robot.
#[derive(Clone, Serialize)]
struct Row {
    way: &'static str,
    values: Vec<f64>,
    /// Mean change of the body's pitch over the motion, degrees.
    mean_deg: f64,
    /// Largest change of the body's pitch over the motion, degrees.
    max_deg: f64,
}

pub fn run() -> miette::Result<Option<Findings>> {
    let designed = inputs::design(DESIGN)?;
    let parameters = &designed.file.parameters;
    let given = parameters.iter().position(|of| of.name == GIVEN).unwrap_or(0);
    let watch = &mut |_: &str, _: &Progress| unless_interrupted();
    let worked = designed.plan(designed.original(), watch).and_then(|before| {
        let mut values = designed.original().to_vec();
        values[given] += LONGER_M;
        let by_hand = designed.plan_from(&before, &values, false, watch)?;
        let kept = keep(&designed, &before, &[(given, values[given])], Feature::Pitch, watch)?;
        Ok((before, by_hand, kept))
    });
    if interrupt::requested() {
        return Ok(None);
    }
    let (before, by_hand, kept) = worked.into_diagnostic()?;
    let ways =
        [("original", &before), ("only this parameter", &by_hand), ("others compensate", &kept)];
    let curves: Vec<Curve> = ways.map(|(way, plans)| (way.to_owned(), pitch_deg(plans))).to_vec();
    let rows: Vec<Row> = ways.map(|(way, plans)| row(way, &before, plans)).to_vec();
    let names = parameters.iter().map(|of| format!("{} mm", of.name));
    let mut table = table(["design", "mean pitch change °", "max °"]);
    table[0].extend(names);
    for row in &rows {
        let mut cells =
            vec![row.way.to_owned(), format!("{:.3}", row.mean_deg), format!("{:.3}", row.max_deg)];
        let changes = row.values.iter().zip(designed.original());
        cells.extend(changes.map(|(value, from)| format!("{:+.1}", 1e3 * (value - from))));
        table.push(cells);
    }
    let holds = rows[1].mean_deg > BY_HAND_DEG && rows[2].max_deg < KEPT_DEG;
    let text = format!(
        "Parameter {GIVEN} is {:.0} mm longer. The figure of the thesis shows the same comparison, without numbers.\n\
         Passed if the body pitches by more than {BY_HAND_DEG}° on average if only this parameter changes, and by at most {KEPT_DEG}° if the other parameters compensate.",
        1e3 * LONGER_M,
    );
    let labels = Labels {
        title: "Pitch of the body, front thighs 20 mm longer",
        x: "time, s",
        y: "pitch, degrees",
    };
    let charts = vec![("figure-2-4.svg".to_owned(), chart::linear(&labels, &curves))];
    let blocks = vec![Block::Table(table), Block::Text(text)];
    let verdict = if holds { Verdict::Passed } else { Verdict::OutOfBounds };
    Ok(Some(Findings { charts, verdict, ..Findings::new("figure-2-4", blocks, &rows) }))
}

/// Times, s, and pitches, degrees, of the first motion.
fn pitch_deg(plans: &Plans) -> Vec<(f64, f64)> {
    let of_plan = |plan| {
        let pitch = Feature::Pitch.of_plan(plan).into_iter().map(f64::to_degrees);
        plan.samples.iter().map(|sample| sample.time_s).zip(pitch).collect()
    };
    plans.plans().next().map_or(Vec::new(), of_plan)
}

fn row(way: &'static str, before: &Plans, after: &Plans) -> Row {
    let (before, now) = (pitch_deg(before), pitch_deg(after));
    let off: Vec<f64> = before.iter().zip(&now).map(|(a, b)| (a.1 - b.1).abs()).collect();
    Row {
        way,
        values: after.variant.values.clone(),
        mean_deg: off.iter().sum::<f64>() / off.len() as f64,
        max_deg: off.iter().copied().fold(0.0, f64::max),
    }
}
