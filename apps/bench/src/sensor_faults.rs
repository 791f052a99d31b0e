//! Benchmark of sensor faults during motions in closed loop (docs/tracking.md). It counts robots that continue, come to rest on
//! their feet, or fall.

use crate::row_filter::RowFilter;
use crate::split::{Rows, Split};
use crate::tracking::{MOTIONS, RATE_HZ};
use crate::{Block, Findings, Table, Verdict, inputs, unless_interrupted};
use miette::IntoDiagnostic;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::{Options as SolverOptions, optimise};
use rollwalk_simulate::SensorFaultKind::{
    AccelerometerBias, AccelerometerSpike, AllSwitchesStuck, EncoderNan, EncoderOff, EncoderStuck,
    GyroBias, GyroNan, GyroSpike, NoImu, SwitchStuck,
};
use rollwalk_simulate::{
    Control, Feedback, Mismatch, Noise, Options, SensorFault, SensorFaultKind, play,
};
use rollwalk_terminal::{interrupt, output};
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Number of motions: the first ones of the tracking benchmark. Their robots do not fall in closed loop with noisy sensors.
const COUNT: usize = 12;
const KINDS: [(&str, SensorFaultKind); 16] = [
    ("no IMU", NoImu),
    ("gyro NaN", GyroNan),
    ("gyro + 0.05 rad/s", GyroBias(0.05)),
    ("gyro + 0.3 rad/s", GyroBias(0.3)),
    ("gyro + 2 rad/s", GyroBias(2.0)),
    ("accelerometer + 0.3 m/s²", AccelerometerBias(0.3)),
    ("accelerometer + 1 m/s²", AccelerometerBias(1.0)),
    ("accelerometer + 4 m/s²", AccelerometerBias(4.0)),
    ("gyro + 20 rad/s once", GyroSpike(20.0)),
    ("accelerometer + 200 m/s² once", AccelerometerSpike(200.0)),
    ("encoder NaN", EncoderNan(1)),
    ("encoder + 2π", EncoderOff(1, TAU)),
    ("encoder stuck", EncoderStuck(1)),
    ("switch closed", SwitchStuck(0, true)),
    ("switch open", SwitchStuck(0, false)),
    ("all switches open", AllSwitchesStuck(false)),
];
/// Number of times in the motion at which sensors break.
const PHASES: u32 = 4;
const CYCLES: usize = 6;
/// Number of known falls. They occur in gaits on two feet with a bias that no measurement contradicts for long
/// (docs/tracking.md).
const FALLS: u32 = 3;
/// Interval before the end of a run over which its speed is measured, s.
const REST_S: f64 = 0.1;
/// Largest speed of a robot at rest, m/s.
const REST_M_S: f64 = 0.02;

/// Options of the benchmark.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    only: RowFilter,
}

/// Outcomes of a motion for every kind of fault.
#[derive(Serialize, Deserialize)]
struct Row {
    motion: String,
    outcomes: Vec<Counts>,
}

/// Numbers of runs with a fault, by outcome.
#[derive(Default, Serialize, Deserialize)]
struct Counts {
    /// Number of runs that were tracked to the end.
    went_on: u32,
    /// Number of stopped robots at rest on their feet.
    stopped: u32,
    /// Number of stopped robots on their feet that still move.
    moves: u32,
    fell: u32,
}

/// Splits the benchmark into units, one for each motion.
///
/// # Errors
/// Returns an error if a selected row does not exist.
pub fn split(args: &Args) -> miette::Result<Box<dyn Split + '_>> {
    let mut words = vec!["sensor-faults".to_owned()];
    words.extend(args.only.words());
    Ok(Box::new(Rows {
        words,
        inputs: Vec::new(),
        is_timed: false,
        rows: args.only.choose(&MOTIONS[..COUNT], |row| row)?,
        row: Box::new(|file| row(file)),
        findings: Box::new(findings),
    }))
}

fn row(file: &str) -> miette::Result<Option<Row>> {
    let (robot, motion) = inputs::motion(file)?;
    let mut watch = |_: &_| unless_interrupted();
    let plan = optimise(&robot, &motion, &SolverOptions::default(), &mut watch);
    let mut outcomes = Vec::new();
    for (name, kind) in KINDS {
        output::print_line(format_args!("{}, {name}", motion.name));
        let mut counts = Counts::default();
        for phase in 0..PHASES {
            if interrupt::requested() {
                return Ok(None);
            }
            counts.add(&plan, kind, phase)?;
        }
        outcomes.push(counts);
    }
    Ok(Some(Row { motion: motion.name.clone(), outcomes }))
}

impl Counts {
    /// Adds a run with a fault, which begins in the second period, or while a finite motion moves.
    fn add(&mut self, plan: &Plan, kind: SensorFaultKind, phase: u32) -> miette::Result<()> {
        let period_s = plan.motion.duration_s;
        let begin_s = if plan.motion.ends == Ends::Periodic { period_s } else { 1.0 };
        let from_s = begin_s + period_s * f64::from(phase) / f64::from(PHASES);
        let mismatch = Mismatch {
            noise: Some(Noise::USUAL),
            sensor_fault: Some(SensorFault { from_s, kind }),
            ..Mismatch::default()
        };
        let control = Control::Tracking(Feedback::Gains);
        let options = Options { cycles: CYCLES, mismatch, ..Options::new(control, RATE_HZ) };
        let mut last = VecDeque::new();
        let outcome = play(plan, &options, |moment| {
            last.push_back((moment.done_s, moment.world.base().0));
            while last.front().is_some_and(|(at_s, _)| moment.done_s - at_s > REST_S) {
                last.pop_front();
            }
            true
        })
        .into_diagnostic()?;
        let speed_m_s = match (last.front(), last.back()) {
            (Some((from_s, from)), Some((to_s, to))) if to_s > from_s => {
                (to - from).norm() / (to_s - from_s)
            }
            _ => 0.0,
        };
        *match (outcome.fell_at_s, outcome.stopped_at_s) {
            (Some(_), _) => &mut self.fell,
            (None, None) => &mut self.went_on,
            (None, Some(_)) if speed_m_s < REST_M_S => &mut self.stopped,
            (None, Some(_)) => &mut self.moves,
        } += 1;
        Ok(())
    }

    fn shown(&self) -> String {
        let Self { went_on, stopped, moves, fell } = self;
        let counts = [("goes on", went_on), ("stops", stopped), ("moves", moves), ("falls", fell)];
        let counts: Vec<_> = counts.iter().filter(|(_, count)| **count > 0).collect();
        match counts[..] {
            [(name, _)] => (*name).to_owned(),
            _ => counts
                .iter()
                .map(|(name, count)| format!("{name} {count}"))
                .collect::<Vec<_>>()
                .join(", "),
        }
    }
}

fn findings(rows: &[Row]) -> Findings {
    let mut outcomes: Table = vec![vec!["motion".to_owned()]];
    outcomes[0].extend(KINDS.iter().map(|(name, _)| (*name).to_owned()));
    outcomes.extend(rows.iter().map(|row| {
        let cells = row.outcomes.iter().map(Counts::shown);
        std::iter::once(row.motion.clone()).chain(cells).collect()
    }));
    let fell: u32 = rows.iter().flat_map(|row| &row.outcomes).map(|counts| counts.fell).sum();
    let runs = rows.len() * KINDS.len() * PHASES as usize;
    let text = format!(
        "{PHASES} runs for each fault, which starts at a different time in each run; all faults \
         persist except those of one sample; biases act on every axis. Tracking with gains and \
         estimator, {RATE_HZ} ticks a second.\ngoes on: tracked to the end; stops: at rest on its \
         feet; moves: on its feet and not at rest.\n{fell} of {runs} runs end in a fall."
    );
    let blocks = vec![Block::Table(outcomes), Block::Text(text)];
    let verdict = if fell <= FALLS { Verdict::Passed } else { Verdict::OutOfBounds };
    Findings { verdict, ..Findings::new("sensor_faults", blocks, &rows) }
}
