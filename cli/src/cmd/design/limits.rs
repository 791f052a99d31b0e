//! `rollwalk design limits`: what limits a motion, and what its motors must do.

use super::{Shown, plan_original, read, report};
use crate::Exit;
use crate::output::{self, Table};
use rollwalk_design::plans::{self, Failed};
use rollwalk_planner::Options;
use rollwalk_planner::sensitivity::Price;
use serde::Serialize;
use std::path::PathBuf;

/// Constraints that are shown.
const SHOWN: usize = 12;

/// Show what limits the motions of a design.
///
/// The multipliers of a plan's constraints are prices: how much better the best plan were if a limit were less tight. What does not
/// push has no price.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design limits designs/agilebot_legs.toml")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Prices of a motion in the output of `--json`.
#[derive(Serialize)]
struct Limits {
    motion: String,
    prices: Vec<Limit>,
    /// Why the prices are estimates, if they are.
    estimated: Option<String>,
}

/// A constraint that pushes.
#[derive(Serialize)]
struct Limit {
    constraint: String,
    field: Option<&'static str>,
    value: Option<f64>,
    subjects: Vec<String>,
    cost_per_unit: f64,
    /// Part of the costs per hundredth of the field's number.
    cost_per_percent: Option<f64>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let mut shown = Shown::new("planning");
    let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
    let plans = plan_original(&designed, watch)?;
    shown.now("pricing");
    plans.all_solved().map_err(report)?;
    let mut all = Vec::new();
    for solution in &plans.solutions {
        let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
        let prices = match plans::optimal(solution, watch) {
            Ok(optimal) => (optimal.prices(), None),
            Err(Failed::Interrupted) => return Err(report(Failed::Interrupted)),
            Err(reason) => {
                let prices = solution.prices(&Options::default());
                (prices.map_err(|error| report(error.into()))?, Some(reason.to_string()))
            }
        };
        let (prices, estimated) = prices;
        let motion = solution.plan.motion.name.clone();
        let prices = prices.into_iter().map(limit).collect();
        all.push(Limits { motion, prices, estimated });
    }
    drop(shown);
    if args.json {
        output::print_json(&all)?;
    } else {
        output::print(&all.iter().map(describe).collect::<Vec<_>>().join("\n\n"))?;
    }
    Ok(Exit::Ok)
}

fn limit(price: Price) -> Limit {
    let Price { family, given, subjects, per_unit, per_percent } = price;
    Limit {
        constraint: family.to_string(),
        field: given.map(|given| given.0),
        value: given.map(|given| given.1),
        subjects,
        cost_per_unit: per_unit,
        cost_per_percent: per_percent,
    }
}

fn describe(limits: &Limits) -> String {
    if limits.prices.is_empty() {
        return format!("{}: nothing limits it but its goal", limits.motion);
    }
    let mut table = Table::new([&limits.motion, "number", "cost for 1 % of it", "where"]);
    for of in limits.prices.iter().take(SHOWN) {
        let number = match (of.field, of.value) {
            (Some(field), Some(value)) => format!("{field} = {value}"),
            _ => String::new(),
        };
        let cost = match of.cost_per_percent {
            Some(part) => format!("{:+.3} %", part * 100.0),
            None => "pushes".to_owned(),
        };
        table.row([of.constraint.clone(), number, cost, of.subjects.join(", ")]);
    }
    let note = limits.estimated.as_ref().map(|why| format!("\nonly roughly: {why}"));
    table.render() + &note.unwrap_or_default()
}
