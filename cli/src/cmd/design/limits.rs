//! `rollwalk design limits`: what limits a motion, and what its motors must do.

use super::{Shown, plan_original, read, report};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::duty::{self, Duty};
use rollwalk_design::plans;
use rollwalk_planner::sensitivity::{Curvature, Price};
use rollwalk_terminal::Exit;
use rollwalk_terminal::output::{self, Table};
use serde::Serialize;
use std::path::PathBuf;

/// Constraints and servos that are shown.
const SHOWN: usize = 12;
const NAMED: usize = 4;

/// Show what limits the motions of a design.
///
/// The multipliers of a plan's constraints are prices: how much better the best plan were if a limit were less tight. What does
/// not push has no price. Then what the motors must do in all motions, and the lightest servos of a catalogue that would do.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design limits designs/agilebot_legs.toml")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Catalogue of servos (TOML) [default: the one that ships, planner/design/servos.toml].
    #[arg(long, value_name = "SERVOS.toml")]
    servos: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Document {
    motions: Vec<Limits>,
    motors: Vec<Motors>,
}

/// Requirements on the motors of one model.
#[derive(Serialize)]
struct Motors {
    model: String,
    wheels: bool,
    motors: Vec<String>,
    speed_rad_s: f64,
    torque_nm: f64,
    /// Names of servos that would do it, lightest first.
    servos: Vec<String>,
}

/// Prices of a motion in the output of `--json`.
#[derive(Serialize)]
struct Limits {
    motion: String,
    prices: Vec<Limit>,
    /// True if prices are rough, because Newton's method does not reach the optimum of the plan.
    estimated: bool,
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
    let catalog = super::catalog(args.servos.as_deref())?;
    let mut shown = Shown::new("planning");
    let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
    let plans = plan_original(&designed, watch)?;
    shown.now("pricing");
    plans.all_solved().map_err(report)?;
    let mut all = Vec::new();
    for solution in &plans.solutions {
        let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
        let optimal = plans::optimal(solution, watch).map_err(report)?;
        let estimated = optimal.curvature() == Curvature::GaussNewton;
        let prices = optimal.prices();
        let motion = solution.plan.motion.name.clone();
        let prices = prices.into_iter().map(limit).collect();
        all.push(Limits { motion, prices, estimated });
    }
    drop(shown);
    let motors: Vec<Motors> = duty::duties(&plans).iter().map(|of| motors(of, &catalog)).collect();
    if args.json {
        output::print_json(&Document { motions: all, motors })?;
    } else {
        let tables: Vec<String> = all.iter().map(describe).chain([choices(&motors)]).collect();
        output::print(&tables.join("\n\n"))?;
    }
    Ok(Exit::Ok)
}

fn motors(duty: &Duty, catalog: &Catalog) -> Motors {
    Motors {
        model: duty.model.clone(),
        wheels: duty.wheels,
        motors: duty.motors.clone(),
        speed_rad_s: duty.speed_rad_s,
        torque_nm: duty.torque_nm,
        servos: duty.servos(catalog).into_iter().map(|servo| servo.name.clone()).collect(),
    }
}

/// Table of the requirements on motors, with the lightest servos that meet them.
fn choices(motors: &[Motors]) -> String {
    let titles = ["motors", "at most rad/s", "at most N·m", "lightest servos that do it"];
    let mut table = Table::new(titles);
    for of in motors {
        let servos = match &of.servos[..] {
            [] => "none of the catalogue".to_owned(),
            some => some[..some.len().min(NAMED)].join(", "),
        };
        table.row([
            format!(
                "{} {} × {}",
                of.motors.len(),
                if of.wheels { "wheels" } else { "joints" },
                of.model
            ),
            format!("{:.2}", of.speed_rad_s),
            format!("{:.2}", of.torque_nm),
            servos,
        ]);
    }
    table.render()
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
    let note = match limits.estimated {
        true => "\nonly roughly: Newton's method does not reach the optimum of its plan",
        false => "",
    };
    if limits.prices.is_empty() {
        return format!("{}: nothing limits it but its goal{note}", limits.motion);
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
    table.render() + note
}
