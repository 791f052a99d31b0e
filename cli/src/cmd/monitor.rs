//! `rollwalk monitor`: listens to a link and tells what is said on it; writes logs and telemetry.

use crate::link::names::NamesArgs;
use crate::link::{Interruptible, LinkArgs};
use crate::packed::Packed;
use crate::{Exit, files, interrupt, output};
use miette::miette;
use rollwalk_bus::candump::LogEntry;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::name::BusName;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::refusal::{fault_names, state_name};
use rollwalk_host::session::Session;
use rollwalk_host::telemetry::{Known, Telemetry};
use rollwalk_host::told::{Told, told};
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::wire::{
    Action, CommandResult, FaultBits, FaultReport, FromController, JointTelemetry, State, Status,
    ToController,
};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// The joints are shown so often.
const JOINTS_PERIOD: Duration = Duration::from_secs(1);
/// Silence is told after so long, µs.
const SILENCE_US: u64 = 2_000_000;

/// Listen to a robot: states, motions, commands, faults as they come; logs and telemetry.
///
/// A monitor is no host: it commands nothing, has no heartbeat, and does not keep a robot armed. On a serial line
/// it hears the controller alone, and nobody else can use the line.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk monitor --bus can:can0
  rollwalk monitor --bus can:can0 --joints
  rollwalk monitor --bus can:can0 --log run.log --mcap run.mcap --library agilebot.rwl
  rollwalk monitor --bus sim --json | jq 'select(.message == \"fault\")'

A log is in candump's format: canplayer plays it again, docs/decode_log.py and cantools decode it with
docs/rollwalk.dbc. Foxglove opens the MCAP file: /joint_states as measured, /planned_joint_states as planned.")]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Show the joints once a second.
    #[arg(long)]
    joints: bool,
    /// Write every frame of the link, as candump does.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Write telemetry for Foxglove.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    /// End after so many seconds.
    #[arg(long = "for", value_name = "SECONDS")]
    seconds: Option<f64>,
    /// Print a JSON object for each frame.
    #[arg(long)]
    json: bool,
}

/// A frame, as `--json` prints it.
#[derive(Serialize)]
struct Line<'a> {
    /// Since 1970.
    time_s: f64,
    interface: &'a str,
    id: u16,
    data: String,
    #[serde(flatten)]
    told: Option<Told>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = match &args.names.library {
        Some(path) => Some(Packed::read(path, args.names.robot.as_deref())?),
        None => None,
    };
    let config = packed.as_ref().map(|packed| packed.robot.controller_config()).transpose();
    let config = config.map_err(|error| miette!("{error}"))?;
    let mut bus = args.link.open()?;
    // Whoever is there may say what library it has; a log that is played again does not.
    let mut library = || Session::visit(&mut bus, args.link.node).ok()?.hello().library;
    let catalog = match &packed {
        Some(packed) => Some(packed.catalog()),
        None => library().map(|library| args.names.find(library)).transpose()?.flatten(),
    };
    let mut sinks = Sinks {
        interface: interface(&args.link.bus),
        json: args.json,
        log: args.log.as_deref().map(create).transpose()?,
        mcap: match &args.mcap {
            Some(path) => {
                let known = known(catalog.as_ref(), packed.as_ref(), config.as_ref());
                Some(
                    Telemetry::new(create(path)?, args.link.node, known)
                        .map_err(|e| miette!("{e}"))?,
                )
            }
            None => None,
        },
    };
    let mut view = View::new(catalog.as_ref(), args.joints && !args.json, args.json);
    let outcome = listen(&mut bus, args, &mut sinks, &mut view);
    sinks.finish()?;
    match outcome {
        Ok(()) => Ok(Exit::Ok),
        Err(_) if interrupt::requested() => Ok(Exit::Ok),
        Err(error) => Err(error),
    }
}

fn known<'a>(
    catalog: Option<&'a Catalog>,
    packed: Option<&'a Packed>,
    config: Option<&'a RobotConfig>,
) -> Option<Known<'a>> {
    let library = packed.zip(config).map(|(packed, config)| (packed.library(), config));
    catalog.map(|catalog| Known { catalog, library })
}

fn listen(
    bus: &mut Interruptible,
    args: &Args,
    sinks: &mut Sinks<'_>,
    view: &mut View<'_>,
) -> miette::Result<()> {
    let down = |error: LinkError| miette!("{error}");
    let end_us = args.seconds.map_or(u64::MAX, |seconds| bus.now_us() + (seconds * 1e6) as u64);
    let mut silent_us = bus.now_us();
    while bus.now_us() < end_us {
        let deadline_us = end_us.min(silent_us.saturating_add(SILENCE_US));
        match bus.receive(deadline_us).map_err(down)? {
            Some(frame) => {
                silent_us = bus.now_us();
                let at_us = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
                let at_us = at_us.as_micros() as u64;
                sinks.take(at_us, &frame)?;
                view.take(args.link.node.number(), &frame)?;
            }
            None if bus.now_us() >= silent_us.saturating_add(SILENCE_US)
                && bus.now_us() < end_us =>
            {
                let why = bus.complaint().unwrap_or_else(|| "is the robot switched on?".into());
                output::say(format_args!("silence on {}: {why}", args.link.bus));
                // Once is enough.
                silent_us = u64::MAX;
            }
            None => {}
        }
    }
    Ok(())
}

/// How a log names the bus.
fn interface(bus: &BusName) -> String {
    match bus {
        BusName::Can { interface, .. } => interface.clone(),
        BusName::Sim { .. } => "sim0".into(),
        BusName::Serial { .. } => "serial0".into(),
        BusName::Slcan { .. } => "slcan0".into(),
    }
}

fn create(path: &Path) -> miette::Result<BufWriter<File>> {
    files::prepare(files::folder(path))?;
    let file = File::create(path).map_err(|error| miette!("{}: {error}", path.display()))?;
    Ok(BufWriter::new(file))
}

/// Where frames are written to.
struct Sinks<'a> {
    interface: String,
    json: bool,
    log: Option<BufWriter<File>>,
    mcap: Option<Telemetry<'a, BufWriter<File>>>,
}

impl Sinks<'_> {
    fn take(&mut self, at_us: u64, frame: &CanFrame) -> miette::Result<()> {
        if let Some(log) = &mut self.log {
            let interface = self.interface.as_str();
            let entry = LogEntry { at_us, interface, frame: (*frame).into() };
            writeln!(log, "{entry}").map_err(|error| miette!("the log: {error}"))?;
        }
        if let Some(mcap) = &mut self.mcap {
            mcap.on_frame(at_us, frame).map_err(|error| miette!("the telemetry: {error}"))?;
        }
        if self.json {
            let line = Line {
                time_s: at_us as f64 * 1e-6,
                interface: &self.interface,
                id: frame.id(),
                data: frame.data().iter().map(|byte| format!("{byte:02x}")).collect(),
                told: told(frame).ok(),
            };
            output::print(&serde_json::to_string(&line).map_err(|error| miette!("{error}"))?)?;
        }
        Ok(())
    }

    fn finish(self) -> miette::Result<()> {
        if let Some(mut log) = self.log {
            log.flush().map_err(|error| miette!("the log: {error}"))?;
        }
        if let Some(mcap) = self.mcap {
            mcap.finish().map_err(|error| miette!("the telemetry: {error}"))?;
        }
        Ok(())
    }
}

/// What is told people: what has changed.
struct View<'a> {
    catalog: Option<&'a Catalog>,
    joints: bool,
    quiet: bool,
    start: Instant,
    state: Option<State>,
    faults: FaultBits,
    clip: Option<u8>,
    /// The command that is not answered yet, by its number.
    asked: Option<(u8, Action)>,
    measured: BTreeMap<u8, JointTelemetry>,
    shown: Instant,
}

impl<'a> View<'a> {
    fn new(catalog: Option<&'a Catalog>, joints: bool, quiet: bool) -> Self {
        let now = Instant::now();
        Self {
            catalog,
            joints,
            quiet,
            start: now,
            state: None,
            faults: FaultBits::default(),
            clip: None,
            asked: None,
            measured: BTreeMap::new(),
            shown: now,
        }
    }

    fn take(&mut self, node: u8, frame: &CanFrame) -> miette::Result<()> {
        if self.quiet {
            return Ok(());
        }
        if let Ok((to, message)) = ToController::decode(frame)
            && (to.number() == node || to.number() == 15)
        {
            match message {
                ToController::Estop => self.say("EMERGENCY STOP is sent")?,
                // A command that is repeated is told once.
                ToController::Command(command)
                    if self.asked != Some((command.seq, command.action)) =>
                {
                    self.asked = Some((command.seq, command.action));
                }
                _ => {}
            }
            return Ok(());
        }
        let Ok((from, message)) = FromController::decode(frame) else { return Ok(()) };
        if from.number() != node {
            return Ok(());
        }
        match message {
            FromController::Status(status) => self.status(&status),
            FromController::FaultReport(report) => self.fault(&report),
            FromController::EstopAck(_) => self.say("the emergency stop is acknowledged"),
            FromController::CommandAck(ack) => {
                let asked = self.asked.take().filter(|(seq, _)| *seq == ack.seq);
                match asked {
                    Some((_, action)) => self.command(action, ack.result),
                    None => Ok(()),
                }
            }
            FromController::JointTelemetry(joint) => {
                self.measured.insert(joint.channel, joint);
                self.show_joints()
            }
            _ => Ok(()),
        }
    }

    fn say(&self, what: &str) -> miette::Result<()> {
        output::print(&format!("{:9.3} s  {what}", self.start.elapsed().as_secs_f64()))
    }

    fn status(&mut self, status: &Status) -> miette::Result<()> {
        let clip = status.clip.filter(|_| status.state != State::Disarmed);
        let is_new = self.state.replace(status.state) != Some(status.state);
        let is_other = std::mem::replace(&mut self.clip, clip) != clip;
        if is_new || is_other && clip.is_some() {
            let clip = clip.map_or_else(String::new, |clip| format!(": {}", self.clip_name(clip)));
            self.say(&format!("{}{clip}", state_name(status.state)))?;
        }
        if std::mem::replace(&mut self.faults, status.faults) != status.faults {
            self.say(&format!("faults: {}", fault_names(status.faults)))?;
        }
        Ok(())
    }

    fn fault(&self, report: &FaultReport) -> miette::Result<()> {
        let faults = fault_names(FaultBits::default().with(report.fault));
        let channel = report.channel.map_or_else(String::new, |channel| {
            format!(" ({}, {})", self.channel_name(channel), report.value)
        });
        self.say(&format!("fault: {faults}{channel}"))
    }

    fn command(&self, action: Action, result: CommandResult) -> miette::Result<()> {
        let what = match action {
            Action::Play { code, speed_64ths } => {
                let motions = self.catalog.into_iter().flat_map(|catalog| &catalog.motions);
                let name = motions.filter(|motion| motion.code == Some(code)).map(|m| &m.name);
                let name = name.map(|name| format!(" ({name})")).next().unwrap_or_default();
                format!("play {code}{name} at {speed_64ths}/64")
            }
            Action::Pause => "pause".into(),
            Action::Resume => "resume".into(),
            Action::Return => "return".into(),
            Action::Disarm => "disarm".into(),
            Action::ArmRequest => "arm".into(),
            Action::ArmConfirm { .. } => "arm, confirmed".into(),
            Action::ClearRequest => "clear".into(),
            Action::ClearConfirm { .. } => "clear, confirmed".into(),
            Action::Unknown { kind, .. } => format!("of unknown kind {kind}"),
        };
        match result {
            CommandResult::Ok => self.say(&format!("command: {what}")),
            _ => self.say(&format!(
                "command: {what}: refused, {}",
                rollwalk_host::refusal::command_refusal(result)
            )),
        }
    }

    fn show_joints(&mut self) -> miette::Result<()> {
        if !self.joints || self.shown.elapsed() < JOINTS_PERIOD {
            return Ok(());
        }
        self.shown = Instant::now();
        let mut table = output::Table::new(["", "rad", "rad/s", "N·m"]);
        for (&channel, joint) in &self.measured {
            table.row([
                self.channel_name(channel),
                format!("{:.3}", joint.position_rad),
                format!("{:.2}", joint.velocity_rad_s),
                format!("{:.2}", joint.torque_nm),
            ]);
        }
        output::print(&table.render())
    }

    fn clip_name(&self, clip: u8) -> String {
        let name = self.catalog.and_then(|catalog| catalog.clip(clip));
        name.unwrap_or_else(|| format!("clip {clip}"))
    }

    fn channel_name(&self, channel: u8) -> String {
        let name = self.catalog.and_then(|c| c.channels.get(usize::from(channel)));
        name.cloned().unwrap_or_else(|| format!("channel {channel}"))
    }
}
