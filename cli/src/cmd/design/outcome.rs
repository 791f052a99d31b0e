//! Results of a design change: a folder with robot file, plans, figures and report.

use rollwalk_design::designed::Designed;
use rollwalk_design::goal::Quantity;
use rollwalk_design::optimise::Step;
use rollwalk_design::plans::Plans;
use rollwalk_design::repair;
use rollwalk_design::rounding::BoundedQuantity;
use rollwalk_planner::Weights;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::plot::{self, JointPanels};
use rollwalk_planner::report::Report;
use rollwalk_planner::sample::resample;
use rollwalk_planner::sensitivity::Feature;
use rollwalk_simulate::Verdict;
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::output::{self, Table};
use rollwalk_terminal::{Exit, interrupt};
use serde::Serialize;
use std::path::{Path, PathBuf};
use toml_edit::{DocumentMut, Item, Value};

/// Sampling rate at which features of two plans are compared, Hz.
const RATE_HZ: f64 = 60.0;
const REPORT: [&str; 2] = ["report.md", "report.json"];
/// Figure of the robot before and after.
const ROBOT_FIGURE: &str = "robot.svg";

/// Destination and format of the results.
#[derive(clap::Args)]
pub struct Folder {
    /// Folder for the robot file, the motion files, the plans, the figures and the report; created if it is missing.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Folder whose files can all be written.
pub struct OutputFolder<'a> {
    folder: &'a Folder,
    robot: PathBuf,
    /// Names of the motion files, without extension.
    motions: Vec<String>,
}

impl Folder {
    /// Creates the folder and checks that all files in it can be written, before long work.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses, or if a file in the folder is an input.
    pub fn open(&self, designed: &Designed) -> miette::Result<OutputFolder<'_>> {
        files::make_folder(&self.output)?;
        let robot = Path::new(&designed.file.robot).file_name().unwrap_or_default();
        let robot = self.output.join(robot);
        Output::of_source(&robot)?;
        let mut motions: Vec<String> = Vec::new();
        for motion in &designed.file.motions {
            let stem = Path::new(&motion.file).file_stem().unwrap_or_default();
            let mut name = stem.to_string_lossy().into_owned();
            // The folder also contains the robot's file.
            while motions.contains(&name) || robot.with_extension("").ends_with(&name) {
                name.push('_');
            }
            motions.push(name);
        }
        for name in &motions {
            Output::of_source(&self.output.join(format!("{name}.toml")))?;
        }
        let place = OutputFolder { folder: self, robot, motions };
        for file in place.plans().chain(REPORT.map(str::to_owned)) {
            Output::at(&self.output.join(file))?;
        }
        Ok(place)
    }
}

impl OutputFolder<'_> {
    fn plans(&self) -> impl Iterator<Item = String> {
        self.motions.iter().map(|name| format!("{name}.plan.json"))
    }

    /// Writes all files and prints the report.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn write(
        &self,
        outcome: &DesignOutput,
        before: Option<&Plans>,
        after: &Plans,
    ) -> miette::Result<Exit> {
        let folder = &self.folder.output;
        let write =
            |name: &str, content: &str| files::write(&folder.join(name), content.as_bytes());
        Output::of_source(&self.robot)?.write(after.variant.text.as_bytes())?;
        let before = plans_of(before, after);
        for (((file, name), after), before) in
            self.plans().zip(&self.motions).zip(after.plans()).zip(&before)
        {
            write(&file, &after.to_json())?;
            let figure = before.map_or_else(
                || plot::figure(after, JointPanels::default()),
                |of| plot::comparison(of, after),
            );
            write(&format!("{name}.svg"), &figure)?;
        }
        for (name, text) in self.motions.iter().zip(&after.variant.motion_texts) {
            let place = Output::of_source(&folder.join(format!("{name}.toml")))?;
            place.write(self.of_robot(text).as_bytes())?;
        }
        let both: Vec<&Plan> =
            before.first().copied().flatten().into_iter().chain(after.plans().take(1)).collect();
        write(ROBOT_FIGURE, &plot::strip(&both, 4))?;
        let text = outcome.text();
        write(REPORT[0], &format!("```\n{text}\n```\n{}", self.figures()))?;
        let json = serde_json::to_string_pretty(outcome)
            .map_err(|error| miette::miette!("cannot write JSON: {error}"))?;
        write(REPORT[1], &json)?;
        if self.folder.json {
            output::print(&json)?;
        } else {
            let robot = self.robot.display();
            output::print(&format!(
                "{text}\nwrote {robot}, with motions, plans, figures and report.md beside it"
            ))?;
        }
        let holds = outcome.motions.iter().all(MotionComparison::holds);
        let is_kept = outcome.kept.iter().all(BoundedQuantity::is_within);
        Ok(match interrupt::requested() {
            true => Exit::Interrupted,
            false if holds && is_kept => Exit::Ok,
            false => Exit::DoesNotHold,
        })
    }

    /// Motion file with the path of the changed robot file.
    fn of_robot(&self, text: &str) -> String {
        let Ok(mut document) = text.parse::<DocumentMut>() else { return text.to_owned() };
        if let Some(value) = document.get_mut("robot").and_then(Item::as_value_mut) {
            let decor = value.decor().clone();
            let robot = self.robot.file_name().unwrap_or_default().to_string_lossy();
            *value = Value::from(robot.as_ref());
            *value.decor_mut() = decor;
        }
        document.to_string()
    }

    fn figures(&self) -> String {
        let figures = self.motions.iter().map(|name| format!("\n![{name}]({name}.svg)\n"));
        std::iter::once(format!("\n![robot]({ROBOT_FIGURE})\n")).chain(figures).collect()
    }
}

/// Results of a design change.
#[derive(Serialize)]
pub struct DesignOutput {
    command: &'static str,
    design: String,
    parameters: Vec<ParameterChange>,
    /// Replaced servos.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub servos: Vec<ServoChange>,
    /// Mass of the robot before and after, kg. `None` for a robot that cannot reach the targets of its motions.
    mass_kg: [Option<f64>; 2],
    motions: Vec<MotionComparison>,
    /// Deviation of the feature of `keep` from the original motions: after the manual change alone, and after adjusting the
    /// other parameters.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub drifts: Vec<(&'static str, Drift)>,
    /// Bounds in the goal of `optimise`.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "bounds")]
    pub kept: Vec<BoundedQuantity>,
    /// Accepted designs of `optimise`, one for each step.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "steps")]
    pub steps: Vec<Step>,
    /// True if `optimise` found a better design than the original or repaired one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub is_better: Option<bool>,
    /// True if `optimise` reached its maximum number of steps.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub is_cut_short: bool,
    /// Motions whose derivatives in `optimise` are estimates.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub estimated_motions: Vec<String>,
    /// Ratio of achieved to predicted improvement of the objective, over all steps that `optimise` tried.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gain_of_predicted: Option<f64>,
    /// Designs of `optimise` up to the first that can do all motions; empty if the original one can.
    #[serde(skip_serializing_if = "Vec::is_empty", serialize_with = "repairs")]
    pub repairs: Vec<repair::Step>,
    /// Intermediate designs that could not perform a motion.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lost: Vec<String>,
}

/// Quantity of a motion with its bound, as in JSON.
#[derive(Serialize)]
struct Bounded<'a> {
    motion: &'a str,
    quantity: &'static str,
    unit: &'static str,
    value: f64,
    bound: f64,
    is_within: bool,
}

fn bounds<S: serde::Serializer>(
    kept: &[BoundedQuantity],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(kept.iter().map(|of| Bounded {
        motion: &of.motion,
        quantity: of.quantity.name,
        unit: of.quantity.unit,
        value: of.value,
        bound: of.bound,
        is_within: of.is_within(),
    }))
}

fn steps<S: serde::Serializer>(steps: &[Step], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(steps.iter().map(|step| (&step.values, step.merit)))
}

fn repairs<S: serde::Serializer>(steps: &[repair::Step], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(steps.iter().map(|step| (&step.values, step.worst_level)))
}

/// Parameter before and after.
#[derive(Serialize)]
struct ParameterChange {
    name: String,
    unit: &'static str,
    before: f64,
    after: f64,
    min: f64,
    max: f64,
}

/// Servo model of an actuator before and after.
#[derive(Serialize)]
pub struct ServoChange {
    /// Name of the actuator in the robot file.
    pub actuator: String,
    /// Model before.
    pub before: String,
    /// Model after.
    pub after: String,
}

/// Motion before and after.
#[derive(Serialize)]
struct MotionComparison {
    motion: String,
    consistent: bool,
    /// Verdict on the plan as a sentence.
    conclusion: String,
    /// Verdicts of the simulation before and after; null for a plan that did not converge, and after Ctrl-C.
    simulated: [Option<Verdict>; 2],
    /// Reason in the motion file why the motion needs feedback.
    #[serde(skip_serializing_if = "Option::is_none")]
    needs_feedback: Option<String>,
    quantities: Vec<Pair>,
}

impl MotionComparison {
    /// True if the new plan is consistent, and if the motion passes its checks in simulation or needs feedback.
    fn holds(&self) -> bool {
        let simulated = self.simulated[1].as_ref().is_none_or(Verdict::holds);
        self.consistent && (simulated || self.needs_feedback.is_some())
    }
}

/// Quantity of a motion before and after.
#[derive(Serialize)]
struct Pair {
    name: &'static str,
    unit: &'static str,
    /// Value before; null if the plan did not converge.
    before: Option<f64>,
    /// Value after; null if the plan did not converge.
    after: Option<f64>,
    /// Ratio of after to before; null if the value before is close to zero.
    ratio: Option<f64>,
}

/// Deviation of a feature from the original motions.
#[derive(Serialize)]
pub struct Drift {
    feature: &'static str,
    unit: &'static str,
    mean: f64,
    max: f64,
}

impl Drift {
    /// Deviation between two sets of plans of the same motions.
    pub fn between(feature: Feature, before: &Plans, after: &Plans) -> Self {
        let curve = |plans: &Plans| -> Vec<f64> {
            plans.plans().flat_map(|plan| feature.of_plan(&resample(plan, RATE_HZ))).collect()
        };
        let (before, after) = (curve(before), curve(after));
        let off: Vec<f64> = before.iter().zip(&after).map(|(a, b)| (a - b).abs()).collect();
        Self {
            feature: feature.name(),
            unit: feature.unit(),
            mean: off.iter().sum::<f64>() / off.len() as f64,
            max: off.iter().copied().fold(0.0, f64::max),
        }
    }
}

impl DesignOutput {
    /// Compares two designs, and plays their plans in the simulated world. `before` is `None` if the original robot cannot
    /// reach the targets of its motions.
    pub fn new(
        command: &'static str,
        designed: &Designed,
        before: Option<&Plans>,
        after: &Plans,
    ) -> Self {
        let values = designed.original().iter().zip(&after.variant.values);
        let parameters =
            designed.file.parameters.iter().zip(values).map(|(of, values)| ParameterChange {
                name: of.name.clone(),
                unit: of.place.kind.unit().0,
                before: *values.0,
                after: *values.1,
                min: of.min,
                max: of.max,
            });
        let motions = plans_of(before, after).into_iter().zip(after.plans());
        let motions = motions.map(|(before, after)| compared(before, after));
        Self {
            command,
            design: designed.file.name.clone(),
            parameters: parameters.collect(),
            servos: Vec::new(),
            mass_kg: [before.map(mass_kg), Some(mass_kg(after))],
            motions: motions.collect(),
            drifts: Vec::new(),
            kept: Vec::new(),
            steps: Vec::new(),
            is_better: None,
            is_cut_short: false,
            estimated_motions: Vec::new(),
            gain_of_predicted: None,
            repairs: Vec::new(),
            lost: Vec::new(),
        }
    }

    fn text(&self) -> String {
        let mut table = Table::new(["parameter", "before", "after", "change", "unit", "bounds"]);
        for of in &self.parameters {
            let at = match of.after {
                after if after <= of.min => "at its minimum",
                after if after >= of.max => "at its maximum",
                _ => "",
            };
            table.row([
                of.name.clone(),
                digits(of.before),
                digits(of.after),
                format!("{:+.4}", of.after - of.before),
                of.unit.to_owned(),
                at.to_owned(),
            ]);
        }
        let mut parts = vec![format!("{}: {}", self.design, self.command), table.render()];
        let swapped = self
            .servos
            .iter()
            .map(|of| format!("{}: {}, was {}\n", of.actuator, of.after, of.before));
        let kg = |mass_kg: Option<f64>| mass_kg.map(|mass_kg| format!("{mass_kg:.3} kg"));
        let masses = self.mass_kg.map(kg).into_iter().rev().flatten().collect::<Vec<_>>();
        parts.push(format!("{}mass: {}", swapped.collect::<String>(), masses.join(", was ")));
        for motion in &self.motions {
            let mut table = Table::new([&motion.motion, "before", "after", "change", "unit"]);
            for of in &motion.quantities {
                table.row([
                    of.name.to_owned(),
                    of.before.map_or("no plan".to_owned(), digits),
                    of.after.map_or("no plan".to_owned(), digits),
                    of.ratio
                        .map_or(String::new(), |ratio| format!("{:+.1} %", (ratio - 1.0) * 100.0)),
                    of.unit.to_owned(),
                ]);
            }
            let [before, after] = &motion.simulated;
            let simulated = |of: &Option<Verdict>| {
                of.as_ref().map_or("not simulated".to_owned(), Verdict::to_string)
            };
            let needs = motion.needs_feedback.as_ref().map_or(String::new(), |why| {
                format!("\nthe motion needs feedback according to its file: {why}")
            });
            let before = match before == after {
                true => ", as before".to_owned(),
                false => format!("; before: {}", simulated(before)),
            };
            parts.push(format!(
                "{}\n{}\n{}{before}{needs}",
                table.render(),
                motion.conclusion,
                simulated(after)
            ));
        }
        if !self.kept.is_empty() {
            let mut table = Table::new(["kept", "after", "bound", "unit", ""]);
            for of in &self.kept {
                let beyond = match of.is_within() {
                    true => "within".to_owned(),
                    false if of.value.is_nan() => "no plan".to_owned(),
                    false => format!("beyond by {:.2} %", of.excess() * 100.0),
                };
                table.row([
                    format!("{}, {}", of.quantity.name, of.motion),
                    digits(of.value),
                    digits(of.bound),
                    of.quantity.unit.to_owned(),
                    beyond,
                ]);
            }
            parts.push(table.render());
        }
        if !self.drifts.is_empty() {
            let mut table = Table::new(["change of", "mean", "largest", "unit"]);
            for (name, drift) in &self.drifts {
                table.row([
                    format!("{}, {name}", drift.feature),
                    digits(drift.mean),
                    digits(drift.max),
                    drift.unit.to_owned(),
                ]);
            }
            parts.push(table.render());
        }
        if !self.repairs.is_empty() {
            let rows =
                self.repairs.iter().map(|step| (format!("{:.3}", step.worst_level), &step.values));
            parts.push(self.steps_table("repair", "worst residual / tolerance", rows).render());
        }
        if !self.steps.is_empty() {
            let rows = self.steps.iter().map(|step| (format!("{:.4}", step.merit), &step.values));
            parts.push(self.steps_table("step", "objective", rows).render());
        }
        if !self.estimated_motions.is_empty() {
            let gain = self.gain_of_predicted.map_or(String::new(), |part| {
                format!("; steps achieved {:.0} % of the predicted gain", part * 100.0)
            });
            parts.push(format!(
                "derivatives of {} are Gauss-Newton estimates, because no optimum with positive \
                 second derivatives was found near its plan{gain}",
                self.estimated_motions.join(", ")
            ));
        }
        if self.is_cut_short {
            let taken = self.steps.len() - 1;
            parts.push(format!(
                "stopped after {taken} steps: to continue, optimise the design again from the \
                 written robot"
            ));
        }
        if self.is_better == Some(false) {
            let stays = match self.repairs.is_empty() {
                true => "the robot is unchanged",
                false => "the repaired robot is written",
            };
            parts.push(format!(
                "no better design was found within the bounds of the parameters: {stays}"
            ));
        }
        parts.extend(self.lost.iter().map(|lost| format!("during the optimisation: {lost}")));
        parts.join("\n\n")
    }

    /// Table of intermediate designs; `judged_by` is the title of the column with their verdict.
    fn steps_table<'a>(
        &self,
        number: &str,
        judged_by: &str,
        steps: impl Iterator<Item = (String, &'a Vec<f64>)>,
    ) -> Table {
        let names = self.parameters.iter().map(|of| of.name.clone());
        let titles = [number, judged_by].map(str::to_owned).into_iter().chain(names).collect();
        let row = |(number, (judged, values)): (usize, (String, &Vec<f64>))| {
            let values = values.iter().map(|value| digits(*value));
            [number.to_string(), judged].into_iter().chain(values).collect()
        };
        let rows: Vec<Vec<String>> =
            std::iter::once(titles).chain(steps.enumerate().map(row)).collect();
        Table::from(rows)
    }
}

/// Mass of a robot, kg.
fn mass_kg(plans: &Plans) -> f64 {
    plans.variant.robot.links.iter().map(|link| link.mass_kg).sum()
}

/// Original plan for each plan after the change; `None` where it is missing.
fn plans_of<'p>(before: Option<&'p Plans>, after: &Plans) -> Vec<Option<&'p Plan>> {
    let count = after.solutions.len();
    let before = before.into_iter().flat_map(Plans::plans).map(Some);
    before.chain(std::iter::repeat(None)).take(count).collect()
}

fn compared(before: Option<&Plan>, after: &Plan) -> MotionComparison {
    let weights = Weights::default();
    let is_solved = |plan: &&Plan| plan.solve.status.is_solved();
    let of = |quantity: Quantity| {
        let Quantity { objective, name, unit, little, .. } = quantity;
        let of = |plan: &Plan| objective.of_plan(plan, &weights);
        let [before, after] = [before, Some(after)].map(|plan| plan.filter(is_solved).map(of));
        let ratio = before.zip(after).filter(|(before, _)| *before > little);
        let ratio = ratio.map(|(before, after)| after / before);
        Pair { name, unit, before, after, ratio }
    };
    let all = Quantity::ALL.into_iter();
    let quantities = all.filter(|of| of.objective.is_defined(&after.motion)).map(of);
    let report = Report::new(after);
    let simulated = |plan: Option<&Plan>| {
        plan.filter(is_solved).and_then(|plan| Verdict::of(plan, |_| !interrupt::requested()))
    };
    MotionComparison {
        motion: after.motion.name.clone(),
        consistent: report.judgement.is_good(),
        conclusion: report.words(&after.solve),
        simulated: [simulated(before), simulated(Some(after))],
        needs_feedback: after.motion.needs_feedback.clone(),
        quantities: quantities.collect(),
    }
}

/// Formats a value with four significant digits, without an exponent.
fn digits(value: f64) -> String {
    let magnitude = if value == 0.0 { 0 } else { value.abs().log10().floor() as i32 };
    format!("{value:.*}", (3 - magnitude).clamp(0, 6) as usize)
}
