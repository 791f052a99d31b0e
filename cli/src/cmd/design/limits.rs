//! `rollwalk design limits`: the active constraints of each motion, and the requirements on its motors.

use super::{SolveDisplay, plan_original, read, report};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::duty::{self, Duty};
use rollwalk_design::plans;
use rollwalk_planner::sensitivity::{Curvature, Price};
use rollwalk_terminal::Exit;
use rollwalk_terminal::output::{self, Table};
use serde::Serialize;
use std::path::PathBuf;

/// Maximum number of constraints in a table.
const SHOWN: usize = 12;
/// Maximum number of servos in a row of a table.
const NAMED: usize = 4;

/// Show which constraints limit the motions of a design.
///
/// The price of a constraint is its Lagrange multiplier: the improvement of the optimal cost if the limit is relaxed by one
/// unit. Inactive constraints have no price. The command then prints the speed and torque that the motors need in all motions,
/// and the lightest servos of a catalogue that provide them.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design limits designs/agilebot_legs.toml")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Servo catalogue (TOML) [default: the one that ships, robot/servos.toml].
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
    /// Names of servos that meet the requirements, lightest first.
    servos: Vec<String>,
}

/// Prices of a motion in the output of `--json`.
#[derive(Serialize)]
struct Limits {
    motion: String,
    prices: Vec<Limit>,
    /// True if prices are rough, because Newton's method did not reach the optimum of the plan.
    estimated: bool,
}

/// Active constraint.
#[derive(Serialize)]
struct Limit {
    constraint: String,
    field: Option<&'static str>,
    value: Option<f64>,
    subjects: Vec<String>,
    cost_per_unit: f64,
    /// Relative change of cost if the value of the field changes by 1 %.
    cost_per_percent: Option<f64>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let catalog = super::catalog(args.servos.as_deref())?;
    let mut shown = SolveDisplay::new("planning");
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
    let titles = ["motors", "max rad/s", "max N·m", "lightest suitable servos"];
    let mut table = Table::new(titles);
    for of in motors {
        let servos = match &of.servos[..] {
            [] => "no servo in the catalogue".to_owned(),
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
        true => "\napproximate costs: Newton's method did not converge to the optimum of this plan",
        false => "",
    };
    if limits.prices.is_empty() {
        return format!("{}: only the goal limits this motion{note}", limits.motion);
    }
    let mut table = Table::new([&limits.motion, "value", "cost change for 1 % more", "where"]);
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
