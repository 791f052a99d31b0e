//! `rollwalk control`: the controller that tracks a plan, for simulators of others, over standard input and output.

mod records;

use crate::{Exit, inputs, output};
use clap::ValueEnum;
use miette::{IntoDiagnostic, WrapErr, miette};
use nalgebra::Isometry3;
use records::{Hello, Request, Setpoints};
use rollwalk_simulate::closed_loop::{ClosedLoop, Measured, Timing};
use rollwalk_simulate::{Feedback, Script};
use serde::Serialize;
use std::io::{self, BufRead, Read};
use std::path::PathBuf;

/// Most bytes of a line; a robot with the most joints needs some kilobytes.
const LINE_MAX: u64 = 1 << 20;

/// Run the controller that tracks a plan, for another simulator: a line of measurements in, a line of setpoints out.
///
/// Its first line says what the plan is, in which order channels, joints, wheels and end effectors are, and the state in which the motion begins.
/// Each line on standard input is a tick: a JSON object with the time of the motion and the measured state or sensor readings. The program answers it
/// with a line of setpoints of all channels for the drives' own loops: torque = kp (position - angle) + kd (speed - angular speed) + torque. The program ends
/// with its input. docs/tracking.md describes the fields.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk control turn.plan.json < ticks.jsonl
  rollwalk control turn.plan.json --rate 400 --latency-ms 6 < ticks.jsonl
  rollwalk control turn.plan.json --feedback tasks < ticks.jsonl")]
pub struct Args {
    /// Plan (JSON).
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Ticks per second.
    #[arg(long, value_name = "HZ", default_value_t = 500, value_parser = clap::value_parser!(u32).range(30..=10_000))]
    rate: u32,
    /// Time from a measurement until the motors act on the answer, in milliseconds, beyond a tick.
    #[arg(long, value_name = "MS", default_value_t = 0.0, value_parser = latency_ms)]
    latency_ms: f64,
    /// How the robot is brought back to the plan.
    #[arg(long, value_enum, default_value = "gains")]
    feedback: Way,
}

#[derive(Clone, Copy, ValueEnum)]
enum Way {
    /// Centre of mass, body and wheels each by itself.
    Tasks,
    /// All of them together, by gains of the plan's linear model.
    Gains,
}

/// Most latency, ms: in more a robot that falls is on its way to the ground.
const LATENCY_MAX_MS: f64 = 50.0;

fn latency_ms(text: &str) -> Result<f64, String> {
    inputs::number_within(text, 0.0..=LATENCY_MAX_MS)
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let plan = inputs::plan(&args.plan)?;
    let script = Script::new(&plan, true);
    let feedback = match args.feedback {
        Way::Tasks => Feedback::Tasks,
        Way::Gains => Feedback::Gains,
    };
    let timing = Timing { tick_s: 1.0 / f64::from(args.rate), latency_s: 1e-3 * args.latency_ms };
    say(&Hello::new(&plan, timing.tick_s))?;
    let mut controller =
        Controller { script: &script, feedback, timing, closed_loop: None, has_imu: false };
    let mut input = io::stdin().lock();
    let mut line = String::new();
    for number in 1.. {
        line.clear();
        let count = (&mut input).take(LINE_MAX).read_line(&mut line).into_diagnostic()?;
        if count == 0 {
            break;
        }
        if count as u64 == LINE_MAX {
            return Err(miette!("line {number} of the input has more than {LINE_MAX} bytes"));
        }
        let setpoints = controller.answer(&line);
        say(&setpoints.wrap_err_with(|| format!("line {number} of the input"))?)?;
    }
    Ok(Exit::Ok)
}

/// The controller from its first line on, which says where the plan lies.
struct Controller<'s, 'p> {
    script: &'s Script<'p>,
    feedback: Feedback,
    timing: Timing,
    closed_loop: Option<ClosedLoop<'s, 'p>>,
    /// Whether a line had an IMU: the state is estimated since, and a line without one has no reading of it.
    has_imu: bool,
}

impl Controller<'_, '_> {
    /// What the motors do in a tick.
    fn answer(&mut self, line: &str) -> miette::Result<Setpoints> {
        let request = Request::from_line(line)?;
        let placed = request.world_from_plan()?;
        if placed.is_some() && self.closed_loop.is_some() {
            return Err(miette!(
                help = "start the program again to place the plan elsewhere",
                "field world_from_plan is only for the first line"
            ));
        }
        let closed_loop = self.closed_loop.get_or_insert_with(|| {
            let placed = placed.unwrap_or_else(Isometry3::identity);
            ClosedLoop::new(self.script, self.feedback, placed, self.timing)
        });
        let times_s = [request.time_s, request.time_s + self.timing.tick_s];
        let state = request.state(closed_loop.tree())?;
        self.has_imu |= request.has_imu();
        let (laws, untracked) = match (self.has_imu, state) {
            (true, known) => {
                if let Some(known) = known {
                    // One that is not finite aligns nothing, and the tick says why.
                    let _ = closed_loop.align(&known);
                }
                let sensed = request.sensors(closed_loop.tree())?;
                closed_loop.tick(times_s, Measured::Sensors(&sensed.sensors()))
            }
            (false, Some(state)) => {
                closed_loop.tick(times_s, Measured::State(&state, &request.touches))
            }
            (false, None) => {
                return Err(miette!(
                    help = "give base, the measured pose and velocity, or imu, from which they are estimated",
                    "fields base and imu are both missing"
                ));
            }
        };
        Ok(Setpoints::new(request.time_s, &laws, untracked))
    }
}

fn say(record: &impl Serialize) -> miette::Result<()> {
    output::line(&serde_json::to_string(record).into_diagnostic()?)
}
