//! `rollwalk monitor`: listens to a link, prints its messages, and writes logs and telemetry.

mod ask;
mod recording;
mod view;

use crate::live::{self, LiveArgs};
use miette::{Report, miette};
use recording::Recording;
use rollwalk_bus::candump::LogEntry;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::name::BusName;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::decode::{DecodedFrame, decode};
use rollwalk_host::joints::{Reader, RobotContext};
use rollwalk_host::session::SessionError;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::wire::FromController;
use rollwalk_robot::{Robot, Solid};
use rollwalk_terminal::files::{Lines, Output, RotationArgs};
use rollwalk_terminal::inputs::{self, Source};
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{Interruptible, LinkArgs, report_lost_bus};
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};
use view::View;

/// Silence after which the monitor reports it, µs.
const SILENCE_US: u64 = 2_000_000;

/// Maximum duration of `--for`, s: a year.
const SECONDS_MAX: f64 = 31_536_000.0;

/// Print a robot's states, motions, commands and faults as they arrive; write logs and telemetry.
///
/// A monitor is not a host: it sends neither commands nor heartbeats, so it does not keep a robot armed. On a serial line it
/// receives only the controller's frames, and no other program can use the line.
///
/// To find names it requests the identity of robot and library from the controller once, when no other program is transferring
/// data. With --library it sends no request. With --json, which prints no names, it sends a request only for --mcap.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk monitor --bus can:can0
  rollwalk monitor --bus can:can0 --joints
  rollwalk monitor --bus can:can0 --log run.log --mcap run.mcap --library agilebot.rwl
  rollwalk monitor --bus sim --foxglove --robot robots/agilebot.toml    # the robot in 3D
  rollwalk monitor --bus sim --json | jq 'select(.message == \"fault\")'

A log is in candump's format: canplayer replays it; docs/formats/decode_log.py and cantools decode it with
docs/rollwalk.dbc. Foxglove opens the MCAP file: /joint_states has measured positions, and with
--library /planned_joint_states has planned ones. Ctrl-C, SIGTERM and SIGHUP complete both files; a
monitor that is killed otherwise loses a second.")]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Print the joints once a second.
    #[arg(long)]
    joints: bool,
    /// Write every frame of the link, as candump does.
    #[arg(long, value_name = "FILE")]
    log: Option<PathBuf>,
    /// Write telemetry for Foxglove.
    #[arg(long, value_name = "FILE")]
    mcap: Option<PathBuf>,
    #[command(flatten)]
    rotation: RotationArgs,
    #[command(flatten)]
    live: LiveArgs,
    /// End after the given number of seconds.
    #[arg(long = "for", value_name = "SECONDS", value_parser = seconds)]
    seconds: Option<f64>,
    /// Print a JSON object for each frame.
    #[arg(long)]
    json: bool,
}

fn seconds(text: &str) -> Result<f64, String> {
    inputs::number_within(text, 0.0..=SECONDS_MAX)
}

/// Frame in the output of `--json`.
#[derive(Serialize)]
struct Line<'a> {
    /// Time since 1970, s.
    time_s: f64,
    interface: &'a str,
    id: u16,
    data: String,
    #[serde(flatten)]
    decoded: Option<DecodedFrame>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = match &args.names.library {
        Some(path) => Some(ValidatedLibrary::read(path, args.names.robot.as_deref())?),
        None => None,
    };
    let config = packed.as_ref().map(|packed| packed.robot.controller_config()).transpose();
    let config = config.map_err(|error| miette!("{error}"))?;
    let shown = shown_robot(args, packed.as_ref())?;
    let place = |path: &Option<PathBuf>| path.as_deref().map(Output::at).transpose();
    let (log, mcap) = (place(&args.log)?, place(&args.mcap)?);
    if let (Some(log), Some(mcap)) = (&log, &mcap) {
        log.apart_from(mcap)?;
    }
    let mut bus = args.link.open()?;
    if let (Some(path), None) = (&args.mcap, &packed) {
        output::print_line(format_args!(
            "{} will lack /planned_joint_states; to add this topic, give --library LIB.rwl",
            path.display()
        ));
    }
    let rotation = args.rotation.rotate;
    let log = log.as_ref().map(|output| Lines::create(output, rotation)).transpose()?;
    let (start_us, began_us) = (bus.now_us(), since_1970_us());
    let end_us =
        args.seconds.map_or(u64::MAX, |seconds| start_us.saturating_add((seconds * 1e6) as u64));
    let mut before = Vec::new();
    let catalog = match &packed {
        Some(packed) => Some(packed.catalog()),
        // Frames are printed without names.
        None if args.json && mcap.is_none() => None,
        None => {
            let hello = ask::identity(&mut bus, args.link.node, end_us, &mut before);
            args.names.look_up(hello.as_ref())?
        }
    };
    let known = known(catalog.as_ref(), packed.as_ref(), config.as_ref());
    let mcap = mcap.map(|output| Recording::begin(&output, rotation, args.link.node, known));
    let live = match &shown {
        Some((robot, parts)) => args.live.begin(robot, parts)?,
        None => None,
    };
    let mut monitor = Monitor {
        interface: interface(&args.link.bus),
        json: args.json,
        log,
        mcap: mcap.transpose()?,
        view: View::new(catalog.as_ref(), args.joints, args.json, began_us),
        node: args.link.node.number(),
        controllers: BTreeSet::new(),
        has_reported_silence: false,
        live: live.map(|view| (Reader::new(args.link.node, known), view)),
    };
    let outcome = before.iter().try_for_each(|(at_us, frame)| monitor.take(*at_us, frame));
    let outcome = outcome.and_then(|()| listen(&mut bus, args, end_us, &mut monitor));
    let was_heard = monitor.controllers.contains(&monitor.node);
    if !was_heard && outcome.is_ok() {
        monitor.report_silence(&bus, &args.link);
    }
    monitor.finish()?;
    match outcome {
        Err(error) if !interrupt::requested() => Err(error),
        _ if was_heard => Ok(Exit::Ok),
        _ => Ok(Exit::NotDone),
    }
}

/// Robot that Foxglove displays: that of the robot file, or of the library.
fn shown_robot(
    args: &Args,
    packed: Option<&ValidatedLibrary>,
) -> miette::Result<Option<(Robot, Vec<Vec<Solid>>)>> {
    if !args.live.is_asked_for() {
        return Ok(None);
    }
    match (&args.names.robot, packed) {
        (Some(path), _) => Source::Disk.robot_and_parts(path).map(Some),
        (None, Some(packed)) => Ok(Some((packed.robot.clone(), Vec::new()))),
        (None, None) => Err(miette!(
            help = "add --robot ROBOT.toml, or --library LIB.rwl, which also shows the planned \
                robot",
            "--foxglove requires the shape of the robot, which is not sent on the link"
        )),
    }
}

fn since_1970_us() -> u64 {
    SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_micros() as u64
}

fn known<'a>(
    catalog: Option<&'a Catalog>,
    packed: Option<&'a ValidatedLibrary>,
    config: Option<&'a RobotConfig>,
) -> Option<RobotContext<'a>> {
    let library = packed.zip(config).map(|(packed, config)| (packed.library(), config));
    catalog.map(|catalog| RobotContext { catalog, library })
}

fn listen(
    bus: &mut Interruptible,
    args: &Args,
    end_us: u64,
    monitor: &mut Monitor<'_>,
) -> miette::Result<()> {
    let down = |error: LinkError| Report::from(report_lost_bus(&args.link.bus, &error));
    let mut silent_us = bus.now_us();
    while bus.now_us() < end_us {
        let deadline_us = end_us.min(silent_us.saturating_add(SILENCE_US));
        if let Some(frame) = bus.receive(deadline_us).map_err(down)? {
            if monitor.is_of_controller(&frame) {
                let was_silent = std::mem::replace(&mut silent_us, bus.now_us()) == u64::MAX;
                if was_silent {
                    output::print_line(format_args!(
                        "controller {} sends frames again",
                        monitor.node
                    ));
                }
            }
            monitor.take(since_1970_us(), &frame)?;
        }
        let now_us = bus.now_us();
        if now_us >= silent_us.saturating_add(SILENCE_US) && now_us < end_us {
            monitor.report_silence(bus, &args.link);
            monitor.keep()?;
            // The silence is reported once.
            silent_us = u64::MAX;
        }
    }
    Ok(())
}

/// Name of the bus in a log.
fn interface(bus: &BusName) -> String {
    match bus {
        BusName::Can { interface, .. } => interface.clone(),
        BusName::Sim { .. } => "sim0".into(),
        BusName::Serial { .. } => "serial0".into(),
        BusName::Slcan { .. } => "slcan0".into(),
        // Serial lines of actuators, which carry no link.
        BusName::Tty { .. } | BusName::Pty { .. } => "tty0".into(),
    }
}

/// Writer of received frames: terminal, log, MCAP recording and live view.
struct Monitor<'a> {
    interface: String,
    json: bool,
    log: Option<Lines>,
    mcap: Option<Recording<'a>>,
    view: View<'a>,
    /// Address of the controller.
    node: u8,
    /// Addresses of all controllers that sent a frame.
    controllers: BTreeSet<u8>,
    /// True after the report of a controller that was never heard.
    has_reported_silence: bool,
    live: Option<(Reader<'a>, live::View<'a>)>,
}

impl Monitor<'_> {
    /// True for a frame of the monitored controller.
    fn is_of_controller(&self, frame: &Frame) -> bool {
        FromController::decode(frame).is_ok_and(|(from, _)| from.number() == self.node)
    }

    /// Error for a controller that sends nothing.
    fn silent(&self, bus: &impl LinkBus) -> SessionError {
        let other = self.controllers.iter().find(|other| **other != self.node);
        SessionError::no_frames(self.node, bus, other.copied())
    }

    /// Reports that the controller sends nothing. A controller that was never heard is reported once.
    fn report_silence(&mut self, bus: &impl LinkBus, link: &LinkArgs) {
        let error = self.silent(bus);
        if self.controllers.contains(&self.node) {
            output::print_line(error);
        } else if !std::mem::replace(&mut self.has_reported_silence, true) {
            output::print_report(&link.explain(&error, None));
        }
    }

    fn take(&mut self, at_us: u64, frame: &Frame) -> miette::Result<()> {
        if let Ok((from, _)) = FromController::decode(frame) {
            self.controllers.insert(from.number());
        }
        if let Some(log) = &mut self.log {
            let interface = self.interface.as_str();
            log.push(LogEntry { at_us, interface, frame: *frame })?;
        }
        if let Some(mcap) = &mut self.mcap {
            mcap.take(at_us, frame)?;
        }
        if let Some((reader, view)) = &mut self.live
            && let Some(joints) = reader.on_frame(frame)
        {
            view.show_joints(&joints);
        }
        if self.json
            && let Some(id) = frame.standard_id()
        {
            let line = Line {
                time_s: at_us as f64 * 1e-6,
                interface: &self.interface,
                id,
                data: frame.data().iter().map(|byte| format!("{byte:02x}")).collect(),
                decoded: decode(frame).ok(),
            };
            output::line(&serde_json::to_string(&line).map_err(|error| miette!("{error}"))?)?;
        }
        self.view.take(at_us, self.node, frame)
    }

    /// Writes buffered lines and telemetry, and rotates full files.
    fn keep(&mut self) -> miette::Result<()> {
        self.log.as_mut().map_or(Ok(()), Lines::keep)?;
        self.mcap.as_mut().map_or(Ok(()), Recording::keep)
    }

    fn finish(self) -> miette::Result<()> {
        self.log.map_or(Ok(()), |mut log| log.flush())?;
        self.mcap.map_or(Ok(()), Recording::finish)
    }
}
