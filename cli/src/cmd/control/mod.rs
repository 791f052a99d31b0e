//! `rollwalk control`: tracks plans in closed loop, on a robot or for another simulator.

mod beside;
mod conductor;
mod live;
mod records;
mod route;
#[cfg(test)]
mod tests;

use clap::ValueEnum;
use conductor::Conductor;
use miette::{IntoDiagnostic, Report, miette};
use rollwalk_bus::port::LiveLink;
use rollwalk_host::listener;
use rollwalk_host::operator::Operator;
use rollwalk_host::session::SessionError;
use rollwalk_host::tracking::Tracking;
use rollwalk_protocol::library::identity;
use rollwalk_robot::Robot;
use rollwalk_simulate::closed_loop::Timing;
use rollwalk_simulate::{Feedback, Sequence};
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::link::{BUS_ENV, LinkArgs, MaybeLinkArgs, cannot_open, report_failure};
use rollwalk_terminal::planning;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, files, inputs};
use rollwalk_tracking::tracker::{KD_PART, KP_PART};
use route::Play;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Control in closed loop: play motions on a robot, or track a plan for another simulator.
///
/// With a library file and --bus this command is the robot's host. It plans the motions and transitions of the library, arms
/// the robot, and plays the motions of --play in order, from SAFE to SAFE. The controller sends measurements 120 times a
/// second, or at --rate, and the program answers each with a set-point and a torque for every motor. All limits and watchdogs
/// of the controller stay in force: without answers the robot holds still, and after 1.25 s it sinks with damped joints. The
/// robot needs an IMU, motors that accept torques, and the same library in its flash. Ctrl-C completes the current cycle and
/// returns the robot to SAFE; a second Ctrl-C ends the program at once.
///
/// With a plan this command serves another simulator over standard input and output: it reads lines of measurements and writes
/// lines of set-points. The first output line describes the plan, the order of channels, joints, wheels and end effectors, and
/// the initial state of the motion. Each input line is a tick: a JSON object with the time of the motion and the measured state
/// or sensor readings. The program answers with a line of set-points of all channels for the drives' own loops: torque = kp
/// (position - angle) + kd (speed - angular speed) + torque. The program ends when its input ends. docs/tracking.md describes
/// the fields.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk control agilebot_library.toml --bus sim --play walk:5
  rollwalk control agilebot_library.toml --bus can:can0 --play walk:5 --play turn_in_place
  rollwalk control turn.plan.json < ticks.jsonl
  rollwalk control turn.plan.json --rate 400 --latency-ms 6 < ticks.jsonl
  rollwalk control turn.plan.json --feedback tasks < ticks.jsonl")]
pub struct Args {
    /// Library file (TOML) for a robot on a bus, or a plan (JSON) for another simulator.
    #[arg(value_name = "LIBRARY.toml|PLAN.json")]
    file: PathBuf,
    #[command(flatten)]
    link: MaybeLinkArgs,
    /// Motion of the library and its number of cycles (1 if left out); give the option several times to play several motions in
    /// order.
    #[arg(long, value_name = "MOTION:CYCLES")]
    play: Vec<Play>,
    /// Ticks per second [default: 120 on a robot, else 500]. On a robot 60 to 960: the control rate of its controller (120 on
    /// our boards), or that rate divided by an integer.
    #[arg(long, value_name = "HZ", value_parser = clap::value_parser!(u32).range(30..=10_000))]
    rate: Option<u32>,
    /// Latency beyond one tick, from a measurement until the motors act on the answer, in milliseconds [default: 0]; measured
    /// on a robot.
    #[arg(long, value_name = "MS", value_parser = latency_ms)]
    latency_ms: Option<f64>,
    /// Feedback that returns the robot to the plan [default: gains]; always gains on a robot.
    #[arg(long, value_enum)]
    feedback: Option<FeedbackMethod>,
    /// Print the counts of answered samples as JSON, at the end of a run on a robot.
    #[arg(long)]
    json: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum FeedbackMethod {
    /// Separate feedback on the centre of mass, the body and the wheels.
    Tasks,
    /// Feedback on the whole state, with gains from a linear model of the plan.
    Gains,
}

/// Maximum latency, ms. At higher latencies a falling robot cannot be caught.
const LATENCY_MAX_MS: f64 = 50.0;
/// Default tick rate for another simulator, Hz.
const RATE_HZ: u32 = 500;
/// Default sample rate of a robot, Hz.
const SAMPLES_HZ: u32 = 120;
/// Range of the sample rate on a robot, Hz. Robots fall at lower rates, because answers act 50 ms late; no controller supports
/// higher rates.
const SAMPLES_RANGE_HZ: RangeInclusive<u32> = 60..=960;

fn latency_ms(text: &str) -> Result<f64, String> {
    inputs::number_within(text, 0.0..=LATENCY_MAX_MS)
}

/// Error for a file that is not a plan, without a bus.
fn of_no_bus(file: &Path) -> Report {
    inputs::expect(file, Kind::Library).err().unwrap_or_else(|| {
        miette!(
            help = "give the bus of the robot with --bus, or a plan (JSON) for another simulator",
            "{} is not a plan, and --bus is missing",
            file.display()
        )
    })
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    // A plan is JSON.
    let is_plan = files::read(&args.file, Kind::Plan)?.trim_ascii_start().starts_with(b"{");
    let link = args.link.link();
    match (link, is_plan) {
        // A bus from the environment is meant for other commands.
        (Some(_), true) if std::env::var_os(BUS_ENV).is_none() => Err(miette!(
            help = "give a library file (TOML) to control the robot on that bus; a plan is tracked for another simulator, over standard input and output",
            "--bus requires a library file, but {} is a plan",
            args.file.display()
        )),
        (_, true) if args.play.is_empty() => {
            if args.json {
                return Err(miette!(
                    help = "leave out --json: lines for another simulator are always JSON",
                    "--json is for a robot on a bus"
                ));
            }
            let feedback = match args.feedback {
                Some(FeedbackMethod::Tasks) => Feedback::Tasks,
                Some(FeedbackMethod::Gains) | None => Feedback::Gains,
            };
            let tick_s = 1.0 / f64::from(args.rate.unwrap_or(RATE_HZ));
            let timing = Timing { tick_s, latency_s: 1e-3 * args.latency_ms.unwrap_or(0.0) };
            beside::run(&args.file, feedback, timing)
        }
        (Some(link), false) => on_robot(args, &link),
        (None, false) => Err(of_no_bus(&args.file)),
        (_, true) => Err(miette!(
            help = "give the library file (TOML) that contains the motions",
            "--play requires a library file, but {} is a plan",
            args.file.display()
        )),
    }
}

/// Plays motions of a library on a robot.
fn on_robot(args: &Args, link: &LinkArgs) -> miette::Result<Exit> {
    if args.latency_ms.is_some() || args.feedback.is_some() {
        return Err(miette!(
            "leave out --latency-ms and --feedback: on a robot, latency is measured and feedback \
             uses gains"
        ));
    }
    if args.play.is_empty() {
        return Err(miette!(
            help = "give a motion with --play MOTION:CYCLES, such as --play walk:5",
            "there is no motion to play"
        ));
    }
    let rate_hz = args.rate.unwrap_or(SAMPLES_HZ);
    if !SAMPLES_RANGE_HZ.contains(&rate_hz) {
        return Err(miette!(
            "--rate {rate_hz}: for a robot, give {} to {} samples/s",
            SAMPLES_RANGE_HZ.start(),
            SAMPLES_RANGE_HZ.end()
        ));
    }
    let library = inputs::Source::Disk.library(&args.file)?;
    check(&library.robot)?;
    route::check(&library, &args.play)?;
    let peer = link.streaming_peer()?;
    let host = SessionError::HasHost { node: link.node.number() };
    // Planning may take minutes, and another host may start meanwhile. Errors that exist already are reported first.
    if has_host(&mut open(link)?, link) {
        return Ok(report_failure(link, &host));
    }
    let Some(plans) = planning::plan_all(&library, false)? else { return Ok(Exit::Interrupted) };
    let built = plans.pack(&library)?;
    let legs = route::legs(&library, &plans, &args.play)?;
    let sequence = Sequence::new(legs, timing(rate_hz)).into_diagnostic()?;
    let robot = &library.robot;
    let wheels = conductor::wheels(robot, sequence.tree());
    let id = identity(&built.bytes).expect("it was just built");
    let mut conductor = Conductor::new(sequence, robot, wheels, tracking(rate_hz), id);
    let catalog = ValidatedLibrary::new(robot.clone(), built.bytes)?.catalog();
    let mut bus = open(link)?;
    if has_host(&mut bus, link) {
        return Ok(report_failure(link, &host));
    }
    let mut operator = Operator::new(peer, Some(catalog.config_hash));
    operator = operator.scripted();
    operator.set_catalog(Some(catalog));
    live::run(link, bus, operator, &mut conductor, args.json)
}

fn open(link: &LinkArgs) -> miette::Result<LiveLink> {
    link.live().map_err(cannot_open)
}

fn has_host(bus: &mut LiveLink, link: &LinkArgs) -> bool {
    listener::find_host(bus, link.node).is_ok_and(|listener| listener.has_host())
}

/// Timing before the latency is measured. It assumes two ticks: one for the age of the measurements, and one for the delay of
/// the answer.
fn timing(rate_hz: u32) -> Timing {
    let tick_s = 1.0 / f64::from(rate_hz);
    Timing { tick_s, latency_s: 2.0 * tick_s }
}

/// Tracking request for the controller: the sample rate, and gains in per cent of the gains in the robot file.
fn tracking(rate_hz: u32) -> Tracking {
    let percent = |part: f64| (100.0 * part).round() as u8;
    Tracking { rate_hz: rate_hz as u16, kp_percent: percent(KP_PART), kd_percent: percent(KD_PART) }
}

/// Checks that the robot has the encoders and motors that tracking needs.
///
/// # Errors
/// Returns an error if a wheel or a joint has no encoder, or if the bus of a channel does not support torques or gains.
pub(super) fn check(robot: &Robot) -> miette::Result<()> {
    if let Some(wheel) = robot.end_effectors.iter().find(|of| of.contact.freewheels()) {
        return Err(no_encoder(robot, &wheel.name));
    }
    if let Some(joint) = robot.joints.iter().find(|joint| joint.is_passive()) {
        return Err(miette!(
            help = "play its motions without feedback, with `rollwalk send` or `rollwalk console`",
            "joint `{}` of {} has no motor and no encoder, so the state of the robot cannot be estimated",
            joint.name,
            robot.name
        ));
    }
    let unfit = robot.channels().find(|channel| {
        let bus = robot.buses.get(&channel.actuator().bus).copied().unwrap_or_default();
        !bus.can_be_tracked()
    });
    match unfit {
        None => Ok(()),
        Some(channel) => Err(miette!(
            help = "play its motions without feedback, with `rollwalk send` or `rollwalk console`",
            "the drive of `{}` of {} does not accept torques or gains with its setpoints, and \
             cannot be controlled in closed loop",
            channel.name(),
            robot.name
        )),
    }
}

fn no_encoder(robot: &Robot, wheel: &str) -> Report {
    miette!(
        help = "play its motions without feedback, with `rollwalk send` or `rollwalk console`",
        "wheel `{wheel}` of {} turns freely without an encoder, so the state of the robot cannot \
         be estimated",
        robot.name
    )
}
