//! Correction of a single plan.

use super::{Args, CorrectedPlan, STEADIER, falls, on};
use crate::played::ratios;
use miette::miette;
use rollwalk_planner::plan::Plan;
use rollwalk_simulate::retarget::RetargetResult;
use rollwalk_terminal::files::Output;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, inputs, output};

/// Corrects the plan and writes it.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let mut plan = inputs::plan(&args.input)?;
    if let Some(path) = &args.robot {
        plan = on(plan, Source::Disk.robot(path)?, path)?;
    }
    let place = Output::at(&args.output)?;
    let Some(corrected) = CorrectedPlan::find(&plan, args, !args.no_feed_forward)? else {
        return Ok(Exit::Interrupted);
    };
    let Some(found) = &corrected.found else {
        return Err(miette!(help = STEADIER, "{}", falls(&plan)));
    };
    place.write(found.plan.to_json().as_bytes())?;
    if args.json {
        output::print_json(&corrected.document(&plan))?;
    } else {
        place.comment(&describe(&plan, found, &corrected))?;
        place.comment(&format!("wrote {}", args.output.display()))?;
    }
    Ok(if corrected.holds() { Exit::Ok } else { Exit::DoesNotHold })
}

fn describe(plan: &Plan, found: &RetargetResult, corrected: &CorrectedPlan) -> String {
    format!(
        "{} of {}\nbefore: {}\nafter:  {}\nobjective {:.4} to {:.6} in {} iterations, {} rollouts; \
         setpoints moved by at most {:.3} rad",
        plan.motion.name,
        plan.robot.name,
        ratios(&corrected.before),
        ratios(&corrected.after),
        found.costs[0],
        found.costs[found.costs.len() - 1],
        found.costs.len() - 1,
        found.rollouts,
        found.largest_rad
    )
}
