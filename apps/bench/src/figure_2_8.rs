//! Figures 2.8 and 2.5 of the thesis: step-by-step repair of designs that cannot perform their motion.
//!
//! The car of sec. 2.5.1 has front wheels that are tilted by 45 degrees and hang above the ground. The walker has legs of 0.23
//! m, and its body is required to rise higher. The thesis reports the number of steps of its method; its energies are for other
//! robots and weights.

use crate::row_filter::RowFilter;
use crate::{Block, Findings, Verdict, inputs, table, unless_interrupted};
use cpu_time::ThreadTime;
use miette::IntoDiagnostic;
use rollwalk_design::repair::{BuiltDesign, Feasibility, Free, PULL, RepairProgress, repair};
use rollwalk_planner::motion::{Motion, Subject, Target};
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_planner::plot::chart::{self, Curve};
use rollwalk_planner::sensitivity::Shortfall;
use rollwalk_planner::{Method, Options, candidates, optimise};
use rollwalk_robot::{Contact, Robot};
use rollwalk_terminal::{interrupt, output};
use serde::Serialize;
use std::convert::Infallible;
use std::f64::consts::FRAC_1_SQRT_2;
use std::ops::ControlFlow;

pub const CAR: &str = "motions/car_drive.toml";
pub const WALK: &str = "motions/pup_walk.toml";
/// Required heights of the walker's body in the middle of its cycle, m.
const HEIGHTS_M: [f64; 2] = [0.26, 0.3];
/// Length of the walker's thighs and shanks, m.
const LEG_M: f64 = 0.1;
/// Bounds of the lengths of the leg's links, m.
const LEG_BOUNDS_M: [f64; 2] = [0.05, 0.18];
/// Height above the ground of wheels with a radius of 5 cm that are tilted by 45 degrees, m.
const HANGS_M: f64 = 0.05 * (1.0 - FRAC_1_SQRT_2);
/// Tolerances of a repair: front height of the car, m; relative displacement of the car; height of the walker, m.
const OFF: [f64; 3] = [2e-5, 1e-3, 2e-3];
/// Residual-to-tolerance ratio up to which a design counts as feasible.
const ABLE: f64 = 1.0;
/// Maximum number of steps until a design is feasible. The thesis's car took this number of steps.
const STEPS: usize = 3;
/// Number of iterations of the thesis's method.
const THESIS_ITERATIONS: usize = 150;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    only: RowFilter,
}

/// Intermediate design of a repair.
#[derive(Clone, Serialize)]
struct Row {
    values: Vec<f64>,
    /// Minimum energy: in the first round with a penalty on every constraint, later with multipliers.
    energy: f64,
    round: usize,
    worst_level: f64,
    worst_constraint: String,
    /// Displacement of the car, or height of the walker's body, m.
    reached_m: f64,
    newton_steps: usize,
    /// Energy and displacement, m, of a plan with the weights of the thesis; null without such a plan.
    thesis: Option<(f64, f64)>,
}

/// Measurements of one repair.
#[derive(Serialize)]
struct Case {
    name: String,
    parameters: Vec<String>,
    /// Requested displacement or height, m.
    asked_m: f64,
    rows: Vec<Row>,
    /// Constraints or parameters that the diagnosis of the original design reports as culprits.
    blamed: Vec<String>,
    outcome: String,
    values: Vec<f64>,
    reached_m: f64,
    cpu_s: f64,
    holds: bool,
}

/// Runs the benchmark.
pub fn run(args: &Args) -> miette::Result<Option<Findings>> {
    let mut cases = Vec::new();
    for which in args.only.choose(&["car", "reach"], |name| name)? {
        let found = match *which {
            "car" => vec![car()?],
            _ => HEIGHTS_M.iter().map(|up_m| reach(*up_m)).collect::<Result<_, _>>()?,
        };
        let Some(found) = found.into_iter().collect::<Option<Vec<_>>>() else { return Ok(None) };
        cases.extend(found);
    }
    let (mut blocks, mut charts) = (Vec::new(), Vec::new());
    for case in &cases {
        blocks.push(Block::Text(heading(case)));
        blocks.push(Block::Table(cells(case)));
        charts.push((format!("figure-2-8-{}.svg", case.name), draw(case)));
    }
    blocks.push(Block::Text(
        "The thesis: three design steps until the car was fixed; the walker reached its target after one, and its energy fell\n\
         on. In steps with (1) the energy is with multipliers, so that it may be higher."
            .into(),
    ));
    let holds = cases.iter().all(|case| case.holds);
    let verdict = if holds { Verdict::Passed } else { Verdict::OutOfBounds };
    Ok(Some(Findings { charts, verdict, ..Findings::new("figure-2-8", blocks, &cases) }))
}

/// Repairs the car with tilted front wheels. Its only parameter is their height.
fn car() -> miette::Result<Option<Case>> {
    let (mut robot, motion) = inputs::motion(CAR)?;
    for (wheel, side) in robot.end_effectors.iter_mut().zip([1.0, -1.0]) {
        if let Contact::ActuatedWheel { axis_in_link, .. } = &mut wheel.contact {
            *axis_in_link = [0.0, FRAC_1_SQRT_2, side * FRAC_1_SQRT_2].into();
        }
    }
    let from_m = robot.end_effectors[0].center_in_link_m.z;
    let free =
        Free { bounds: [from_m - 0.04, from_m + 0.04], ..length("front wheels, height", from_m) };
    let asked_m = motion.goal.forward_m.unwrap_or_default();
    let made = |values: &[f64]| {
        let mut robot = robot.clone();
        robot.end_effectors[..2].iter_mut().for_each(|ee| ee.center_in_link_m.z = values[0]);
        BuiltDesign { robot, motions: vec![motion.clone()] }
    };
    let Some(mut case) = work("car", &[free], &made, asked_m, displacement_m)? else {
        return Ok(None);
    };
    for row in &mut case.rows {
        let BuiltDesign { robot, motions } = made(&row.values);
        row.thesis = as_the_thesis(&robot, &motions[0]);
        if row.thesis.is_none() {
            return Ok(None);
        }
    }
    case.holds &= (case.values[0] - from_m + HANGS_M).abs() <= OFF[0]
        && (case.reached_m / asked_m - 1.0).abs() <= OFF[1];
    Ok(Some(case))
}

/// Repairs a walker on small wheels whose body should reach a height in the middle of its cycle.
///
/// The parameters are the lengths of the legs, equal on both sides.
fn reach(up_m: f64) -> miette::Result<Option<Case>> {
    let (robot, mut motion) = inputs::motion(WALK)?;
    motion.targets.push(Target {
        of: Subject::Body,
        at_s: 0.5 * motion.duration_s,
        position_m: [None, None, Some(up_m)],
        velocity_m_s: [None; 3],
        heading_rad: None,
    });
    let made = |values: &[f64]| {
        let mut robot = robot.clone();
        let of = |name: &str| if name.starts_with("front") { 0 } else { 2 };
        for knee in robot.joints.iter_mut().filter(|joint| joint.name.ends_with("_knee")) {
            knee.parent_from_joint.translation.z = -values[of(&knee.name)];
        }
        for wheel in &mut robot.end_effectors {
            wheel.center_in_link_m.z = -values[of(&wheel.name) + 1];
        }
        BuiltDesign { robot, motions: vec![motion.clone()] }
    };
    let names = ["front thigh", "front shank", "rear thigh", "rear shank"];
    let free = names.map(|name| Free { bounds: LEG_BOUNDS_M, ..length(name, LEG_M) });
    let name = format!("reach-{up_m}");
    let case = work(&name, &free, &made, up_m, height_m)?;
    Ok(case
        .map(|case| Case { holds: case.holds && (case.reached_m - up_m).abs() <= OFF[2], ..case }))
}

/// Creates a length parameter.
fn length(name: &str, original: f64) -> Free {
    Free { name: name.into(), original, bounds: [original; 2], unit: 0.01, symbol: "m" }
}

/// Repairs a design.
fn work(
    name: &str,
    free: &[Free],
    made: &dyn Fn(&[f64]) -> BuiltDesign,
    asked_m: f64,
    reached_m: fn(&Plan) -> f64,
) -> miette::Result<Option<Case>> {
    let clock = ThreadTime::now();
    let original: Vec<f64> = free.iter().map(|free| free.original).collect();
    let BuiltDesign { robot, motions } = made(&original);
    let options = Options::default();
    let plan = optimise(&robot, &motions[0], &options, &mut |_| unless_interrupted());
    output::print_line(format_args!("{name}: as designed {}", plan.solve.status));
    let mut rows: Vec<Row> = Vec::new();
    let mut blamed = Vec::new();
    let mut watch = |shown: RepairProgress<'_>| -> ControlFlow<()> {
        if let RepairProgress::Step(step, short) = shown {
            let short: &Shortfall = &short[0];
            if rows.is_empty() {
                let culprits = short.diagnosis().map(|diagnosis| diagnosis.culprits);
                blamed = culprits.unwrap_or_default().iter().map(ToString::to_string).collect();
            }
            output::print_line(format_args!(
                "{name}: step {}, energy {:.4}",
                rows.len(),
                step.energy
            ));
            rows.push(Row {
                values: step.values.clone(),
                energy: step.energy,
                round: step.round,
                worst_level: step.worst_level,
                worst_constraint: short.worst().0.to_string(),
                reached_m: reached_m(&short.plan()),
                newton_steps: step.newton_steps,
                thesis: None,
            });
        }
        unless_interrupted()
    };
    let make = |values: &[f64]| Ok::<_, Infallible>(made(values));
    let found = repair(free, &[plan], PULL, &make, &options, &mut watch).into_diagnostic()?;
    let (outcome, reached, solved) = match &found.outcome {
        Feasibility::Interrupted => return Ok(None),
        Feasibility::Nearest(nearest) => (nearest.to_string(), f64::NAN, false),
        Feasibility::Feasible(solutions) => {
            let plan = &solutions[0].plan;
            let status = plan.solve.status;
            (status.to_string(), reached_m(plan), status == Status::Converged)
        }
    };
    let able = rows.iter().position(|row| row.worst_level < ABLE);
    Ok(Some(Case {
        name: name.into(),
        parameters: free.iter().map(|free| free.name.clone()).collect(),
        asked_m,
        blamed,
        outcome,
        reached_m: reached,
        cpu_s: clock.elapsed().as_secs_f64(),
        holds: solved && able.is_some_and(|steps| name != "car" || steps <= STEPS),
        values: found.values,
        rows,
    }))
}

/// Energy and displacement, m, of a design by the thesis's method; `None` after an interrupt.
///
/// The method has penalties of 10 000, goals as objectives of weight 50, and Newton's method with the true Hessian.
fn as_the_thesis(robot: &Robot, motion: &Motion) -> Option<(f64, f64)> {
    let mut options = Options { refine: false, ..Options::default() };
    options.settings.method = Method::NewtonTrue;
    options.settings.iterations = THESIS_ITERATIONS;
    let options = candidates(robot, motion, &options).swap_remove(0);
    let plan = optimise(robot, motion, &options, &mut |_| unless_interrupted());
    (!interrupt::requested()).then(|| (plan.solve.energy, displacement_m(&plan)))
}

/// Displacement of the centre of mass along x, m.
fn displacement_m(plan: &Plan) -> f64 {
    let at = |sample: Option<&rollwalk_planner::plan::Sample>| sample.map_or(0.0, |s| s.com_m[0]);
    at(plan.samples.last()) - at(plan.samples.first())
}

/// Height of the body at the middle of the motion, m.
fn height_m(plan: &Plan) -> f64 {
    plan.samples[plan.samples.len() / 2].base_position_m[2]
}

fn heading(case: &Case) -> String {
    let changes = case.values.iter().zip(&case.rows[0].values);
    let changes: Vec<String> = case
        .parameters
        .iter()
        .zip(changes)
        .map(|(name, (to, from))| format!("{name} {:+.3} mm", 1e3 * (to - from)))
        .collect();
    format!(
        "{}: {:.3} m requested, {:.4} m planned in the last step ({}), {:.1} s of CPU time\n{}\nas \
         designed:\n  {}",
        case.name,
        case.asked_m,
        case.reached_m,
        case.outcome,
        case.cpu_s,
        changes.join(", "),
        case.blamed.join("\n  "),
    )
}

fn cells(case: &Case) -> Vec<Vec<String>> {
    let mut cells =
        table(["step", "energy", "level", "worst constraint", "reached m", "changes mm", "Newton"]);
    if case.rows[0].thesis.is_some() {
        cells[0].extend(["thesis: energy", "m"].map(str::to_owned));
    }
    for (step, row) in case.rows.iter().enumerate() {
        let changes = row.values.iter().zip(&case.rows[0].values);
        let changes: Vec<String> =
            changes.map(|(to, from)| format!("{:+.2}", 1e3 * (to - from))).collect();
        let mut line = vec![
            if row.round > 0 { format!("{step} ({})", row.round) } else { step.to_string() },
            format!("{:.5}", row.energy),
            format!("{:.3}", row.worst_level),
            row.worst_constraint.clone(),
            format!("{:.4}", row.reached_m),
            changes.join(" "),
            row.newton_steps.to_string(),
        ];
        if let Some((energy, reached_m)) = row.thesis {
            line.extend([format!("{energy:.4}"), format!("{reached_m:.4}")]);
        }
        cells.push(line);
    }
    cells
}

/// Draws energy and achieved displacement or height against the design steps, like the thesis's figure.
fn draw(case: &Case) -> String {
    let curve = |name: &str, of: fn(&Row) -> Option<f64>| -> Curve {
        let points = case.rows.iter().enumerate();
        let points = points.filter_map(|(step, row)| Some((step as f64, of(row)?)));
        (name.into(), points.collect())
    };
    let asked = vec![(0.0, case.asked_m), (case.rows.len() as f64 - 1.0, case.asked_m)];
    let (title, what) = match case.name.as_str() {
        "car" => ("The car with tilted wheels".to_owned(), "displacement, m"),
        _ => (format!("The walker that is to reach {} m", case.asked_m), "height of the body, m"),
    };
    let mut energies = vec![curve("ours", |row| Some(row.energy))];
    let mut reached = vec![curve("ours", |row| Some(row.reached_m))];
    if case.rows[0].thesis.is_some() {
        energies.push(curve("weights of the thesis", |row| Some(row.thesis?.0)));
        reached.push(curve("weights of the thesis", |row| Some(row.thesis?.1)));
    }
    reached.push(("requested".into(), asked));
    let panels = [("energy".to_owned(), energies), (what.to_owned(), reached)];
    chart::panels(&title, "design step", &panels, &[])
}
