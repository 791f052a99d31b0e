//! Controller that tracks a plan for another simulator, over standard input and output.

use super::records::{Hello, Request, Setpoints};
use miette::{IntoDiagnostic, WrapErr, miette};
use nalgebra::Isometry3;
use rollwalk_simulate::closed_loop::{ClosedLoop, Measurement, Timing};
use rollwalk_simulate::{Feedback, Script};
use rollwalk_terminal::{Exit, inputs, output};
use serde::Serialize;
use std::io::{self, BufRead, Read};
use std::ops::RangeInclusive;
use std::path::Path;

/// Maximum length of a line, bytes. The largest robots need a few kilobytes.
const LINE_MAX: u64 = 1 << 20;

/// Maximum time of a motion, s. A client that sends nanoseconds exceeds it by far.
const TIME_MAX_S: f64 = 1e6;
/// Range of the interval between two lines that counts as one tick, in ticks. An interval of zero means that the time of the
/// motion is held.
const INTERVAL_TICKS: RangeInclusive<f64> = 0.6..=1.6;

/// Answers each line of standard input until the input ends.
///
/// # Errors
/// Returns an error if the plan cannot be used, if a line is invalid, or if standard output is closed.
pub fn run(plan: &Path, feedback: Feedback, timing: Timing) -> miette::Result<Exit> {
    let plan = inputs::plan(plan)?;
    let script = Script::new(&plan, true);
    print_record(&Hello::new(&plan, timing.tick_s))?;
    let mut controller = Controller {
        script: &script,
        feedback,
        timing,
        closed_loop: None,
        has_imu: false,
        last_s: None,
        strays: false,
    };
    let mut input = io::stdin().lock();
    let mut line = String::new();
    for number in 1.. {
        line.clear();
        let read = (&mut input).take(LINE_MAX).read_line(&mut line).into_diagnostic();
        let count = read.wrap_err_with(|| format!("line {number} of the input"))?;
        if count == 0 {
            break;
        }
        if count as u64 == LINE_MAX {
            return Err(miette!("line {number} of the input has more than {LINE_MAX} bytes"));
        }
        let setpoints = controller.answer(&line);
        print_record(&setpoints.wrap_err_with(|| format!("line {number} of the input"))?)?;
    }
    Ok(Exit::Ok)
}

/// Controller for another simulator. The first line may place the plan in the world.
struct Controller<'s, 'p> {
    script: &'s Script<'p>,
    feedback: Feedback,
    timing: Timing,
    closed_loop: Option<ClosedLoop<'s, 'p>>,
    /// True after the first line with an IMU. From then on the state is estimated; a line without an IMU has no IMU readings.
    has_imu: bool,
    /// Time of the previous line, s.
    last_s: Option<f64>,
    /// True if the interval before the previous line was not one tick.
    strays: bool,
}

impl Controller<'_, '_> {
    /// Returns the set-points of all motors for one tick.
    fn answer(&mut self, line: &str) -> miette::Result<Setpoints> {
        let request = Request::from_line(line)?;
        self.check_time(request.time_s)?;
        let placed = request.world_from_plan()?;
        if placed.is_some() && self.closed_loop.is_some() {
            return Err(miette!(
                help = "start the program again to place the plan at another pose",
                "field world_from_plan is allowed in the first line only"
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
                    // A pose with NaN cannot align the loop, and the tick reports the reason.
                    let _ = closed_loop.align(&known);
                }
                let sensed = request.sensors(closed_loop.tree())?;
                closed_loop.tick(times_s, Measurement::Sensors(&sensed.sensors()))
            }
            (false, Some(state)) => {
                closed_loop.tick(times_s, Measurement::State(&state, &request.touches))
            }
            (false, None) => {
                return Err(miette!(
                    help = "give base (measured pose and velocity), or imu (from which pose and \
                        velocity are estimated)",
                    "fields base and imu are both missing"
                ));
            }
        };
        Ok(Setpoints::new(request.time_s, &laws, untracked))
    }

    /// Checks that the time increases by one tick from line to line, or stays the same. A single deviation is accepted: at the
    /// end of a motion, or if a line is missing.
    fn check_time(&mut self, time_s: f64) -> miette::Result<()> {
        if time_s.abs() > TIME_MAX_S {
            return Err(miette!(
                help = "give time_s in s since the start of the motion",
                "field time_s is {time_s:e}; expected at most {TIME_MAX_S} s"
            ));
        }
        let Some(last_s) = self.last_s.replace(time_s) else { return Ok(()) };
        let tick_s = self.timing.tick_s;
        let strays = time_s != last_s && !INTERVAL_TICKS.contains(&((time_s - last_s) / tick_s));
        let strayed = std::mem::replace(&mut self.strays, strays);
        if time_s >= last_s && !(strays && strayed) {
            return Ok(());
        }
        Err(miette!(
            help = "send one line per tick, or give the tick rate in Hz with --rate (default 500)",
            "field time_s changes from {last_s} s to {time_s} s; expected ticks of {tick_s} s"
        ))
    }
}

fn print_record(record: &impl Serialize) -> miette::Result<()> {
    output::line(&serde_json::to_string(record).into_diagnostic()?)
}
