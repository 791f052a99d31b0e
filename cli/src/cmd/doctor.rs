//! `rollwalk doctor`: diagnoses a robot and suggests remedies.

use crate::system;
use miette::miette;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::authentication::Peer;
use rollwalk_host::decode::decode;
use rollwalk_host::describe::state_name;
use rollwalk_host::doctor::{Finding, Gains, Gravity, LinkKeyCheck, Observations, Traffic};
use rollwalk_host::listener::{self, Listener};
use rollwalk_host::session::{History, Session, SessionError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{Interruptible, LinkArgs, report_lost_bus};
use rollwalk_terminal::output::Table;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;

/// Listening time, µs: twice the repetition interval of fault reports.
const LISTEN_US: u64 = 2_000_000;
/// Bit rate of a bus that does not report one, bit/s.
const BITRATE: u32 = 1_000_000;

/// Diagnose a robot: why it cannot be armed, why it stopped, which motors do not answer, how high the bus load is, and which
/// commands help. With --system: check whether this computer is ready for robots.
///
/// The command listens for two seconds, then reads the controller's identity, gains and log. It sends no commands to the robot.
/// The exit code is 5 if it finds a fault.
///
/// With --system it checks only this computer: SocketCAN and CAN interfaces, access to serial devices and their latency timers,
/// real-time priority, gamepads, and programs that convert pictures. It opens no bus.
#[derive(clap::Args)]
// This mode opens no bus, but the arguments of a link require one.
#[command(mut_arg("bus", |bus| bus
    .required(false)
    .required_unless_present("system")
    .default_value_if("system", "true", "sim")))]
#[command(after_long_help = "\
Examples:
  rollwalk doctor --bus can:can0
  rollwalk doctor --bus can:can0 --expect pup.toml    # is it this robot?
  rollwalk doctor --system                            # is this computer ready?
  rollwalk doctor --bus sim --json | jq '.findings[] | select(.gravity == \"wrong\")'

docs/faults.md has a section for every fault.")]
pub struct Args {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Robot file (TOML) for which the controller's firmware should have been built.
    #[arg(long = "expect", value_name = "ROBOT.toml")]
    expected: Option<std::path::PathBuf>,
    /// Check this computer instead of a robot.
    #[arg(long, conflicts_with_all = ["node", "expected", "robot", "library"])]
    system: bool,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct DoctorOutput {
    findings: Vec<Finding>,
    log: Vec<Entry>,
    load_percent: f64,
    load: Vec<Load>,
}

/// Output of `--system --json`.
#[derive(Serialize)]
struct SystemReport {
    findings: Vec<Finding>,
}

/// Entry of the controller's log.
#[derive(Serialize)]
struct Entry {
    seconds_ago: f64,
    event: String,
    before: &'static str,
    after: &'static str,
}

/// Frames with the same identifier.
#[derive(Serialize)]
struct Load {
    id: String,
    message: Option<&'static str>,
    per_second: f64,
    percent: f64,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if args.system {
        let report = SystemReport { findings: system::findings() };
        if args.json {
            output::print_json(&report)?;
        } else {
            output::print(&lines(&report.findings).join("\n"))?;
        }
        return Ok(exit_code(&report.findings));
    }
    let expected = args.expected.as_deref().map(|path| -> miette::Result<u32> {
        let robot = Source::Disk.robot(path)?;
        let config = robot.controller_config().map_err(|error| miette!("{error}"))?;
        Ok(config.hash())
    });
    let expected = expected.transpose()?;
    let peer = args.link.peer()?;
    let mut link = args.link.open()?;
    let (heard, samples, listener) = match listen(args, &mut link) {
        Ok(heard) => heard,
        Err(error) => return Err(report_lost_bus(&args.link.bus, &error).into()),
    };
    let has_host = listener.has_host();
    let transferring = !may_ask(&mut link, listener);
    let asked =
        if transferring { ControllerAnswers::default() } else { ask(&peer, has_host, &mut link) };
    let ControllerAnswers { hello, gains, gains_unread, history, refused, key } = asked;
    let complaint = link.fault_and_remedy();
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    let names = names(args, expected, hello.as_ref());
    let catalog = names.look_up(hello.as_ref())?;
    let robot = hello.map(|hello| names.robot(hello.config_hash)).transpose()?.flatten();
    let config = robot.map(|(robot, _)| robot.controller_config()).transpose();
    let config = config.map_err(|error| miette!("{error}"))?;
    let bus = args.link.bus.to_string();
    let bitrate = link.bitrate().unwrap_or(BITRATE);
    let findings = Observations {
        heard: &heard,
        has_host,
        hello: hello.as_ref(),
        refused: refused.as_deref(),
        key,
        transferring,
        gains: gains.as_ref(),
        gains_unread: gains_unread.as_deref(),
        history: history.as_ref(),
        complaint: complaint.as_deref(),
        bitrate,
        expected_config: expected,
        catalog: catalog.as_ref(),
        config: config.as_ref(),
        bus: &bus,
    };
    let report = report(&findings, history.as_ref(), &heard, &samples, bitrate);
    if args.json {
        output::print_json(&report)?;
    } else {
        output::print(&text(&report))?;
    }
    Ok(exit_code(&report.findings))
}

fn exit_code(findings: &[Finding]) -> Exit {
    let is_wrong = findings.iter().any(|finding| finding.gravity == Gravity::Wrong);
    if is_wrong { Exit::NotDone } else { Exit::Ok }
}

/// Listens to the bus. Returns its traffic, one frame of each identifier, and the listener that detects other hosts.
fn listen(
    args: &Args,
    bus: &mut Interruptible,
) -> Result<(Traffic, Vec<Frame>, Listener), LinkError> {
    output::print_line(format_args!(
        "listening to {} for {} s",
        args.link.bus,
        LISTEN_US / 1_000_000
    ));
    let (start_us, node) = (bus.now_us(), args.link.node.number());
    let (mut traffic, mut samples) = (Traffic::default(), Vec::<Frame>::new());
    let mut listener = Listener::new(start_us, args.link.node);
    loop {
        match bus.receive(start_us + LISTEN_US) {
            Ok(Some(frame)) => {
                if frame.standard_id().is_some_and(|id| !traffic.by_id.contains_key(&id)) {
                    samples.push(frame);
                }
                traffic.take(node, &frame);
                listener.take(bus.now_us(), &frame);
            }
            Ok(None) => break,
            Err(_) if interrupt::requested() => break,
            Err(error) => return Err(error),
        }
    }
    traffic.span_us = bus.now_us() - start_us;
    Ok((traffic, samples, listener))
}

/// Waits up to [`listener::PAUSE_TIMEOUT_US`] for a pause in another host's transfer. Returns true if a request would not
/// disturb it.
fn may_ask(bus: &mut Interruptible, listener: Listener) -> bool {
    listener::find_pause(bus, listener, listener::PAUSE_TIMEOUT_US)
        .is_ok_and(|listener| listener.may_ask(bus.now_us()))
}

/// Sources of names: those that the user named, or else the expected robot if the controller's firmware was built for it.
fn names(args: &Args, expected: Option<u32>, hello: Option<&Hello>) -> NamesArgs {
    let NamesArgs { library, robot } = args.names.clone();
    let is_it = expected.is_some() && expected == hello.map(|hello| hello.config_hash);
    let robot = robot.or_else(|| args.expected.clone().filter(|_| is_it));
    NamesArgs { library, robot }
}

/// Answers of the controller.
#[derive(Default)]
struct ControllerAnswers {
    hello: Option<Hello>,
    gains: Option<Gains>,
    /// Reason why the gains could not be read.
    gains_unread: Option<String>,
    history: Option<History>,
    /// Reason why the controller's identity cannot be used.
    refused: Option<String>,
    key: LinkKeyCheck,
}

/// Requests the controller's identity, gains and log, and checks the link key. The check begins a session, so it is left out if
/// the controller has another host, which may be about to begin one.
fn ask(peer: &Peer, has_host: bool, bus: &mut Interruptible) -> ControllerAnswers {
    let (hello, history) = match Session::visit(&mut *bus, peer.node) {
        Ok(mut session) => (*session.hello(), session.history().ok()),
        Err(error @ SessionError::ProtocolMismatch { .. }) => {
            return ControllerAnswers {
                refused: Some(error.to_string()),
                ..ControllerAnswers::default()
            };
        }
        Err(_) => return ControllerAnswers::default(),
    };
    let (key, read) = match has_host {
        true => (LinkKeyCheck::Unknown, gains_beside_host(peer, bus)),
        false => gains(peer, bus),
    };
    let (gains, gains_unread) = match read {
        Ok(gains) => (Some(gains), None),
        Err(why) => (None, Some(why)),
    };
    ControllerAnswers { hello: Some(hello), gains, gains_unread, history, refused: None, key }
}

/// Checks the link key, and reads the gains or returns the reason why that is impossible.
fn gains(peer: &Peer, bus: &mut Interruptible) -> (LinkKeyCheck, Result<Gains, String>) {
    let (key, session) = LinkKeyCheck::of(bus, peer);
    let read = match (session, key) {
        (Some(mut session), _) => Gains::read(&mut session).map_err(|error| error.to_string()),
        // The controller would log a request without a valid key.
        (None, LinkKeyCheck::Missing | LinkKeyCheck::Wrong) => {
            Err("the controller shows them only to hosts with its link key".into())
        }
        (None, LinkKeyCheck::NoSessions) => {
            Err("the controller begins no sessions, which protect them".into())
        }
        (None, _) => gains_without_key(peer.node, bus),
    };
    (key, read)
}

/// Reads the gains of a controller that has a host, without a session.
fn gains_beside_host(peer: &Peer, bus: &mut Interruptible) -> Result<Gains, String> {
    match peer.credentials {
        Some(_) => Err("the controller has another host, whose session would end".into()),
        None => gains_without_key(peer.node, bus),
    }
}

fn gains_without_key(node: Node, bus: &mut Interruptible) -> Result<Gains, String> {
    let session = Session::visit(bus, node);
    session.and_then(|mut session| Gains::read(&mut session)).map_err(|error| error.to_string())
}

fn report(
    findings: &Observations<'_>,
    history: Option<&History>,
    heard: &Traffic,
    samples: &[Frame],
    bitrate: u32,
) -> DoctorOutput {
    let log = history.into_iter().flat_map(|history| {
        history.entries.iter().rev().map(|(_, entry)| Entry {
            seconds_ago: f64::from(history.age_ms(entry)) * 1e-3,
            event: findings.entry_sentence(entry) + &findings.entry_detail(entry),
            before: state_name(entry.before),
            after: state_name(entry.after),
        })
    });
    let seconds = heard.span_us.max(1) as f64 * 1e-6;
    let load = heard.by_id.iter().map(|(&id, &(frames, bits))| Load {
        id: format!("{id:03X}"),
        message: samples
            .iter()
            .find(|f| f.standard_id() == Some(id))
            .and_then(|f| Some(decode(f).ok()?.message)),
        per_second: frames as f64 / seconds,
        percent: 100.0 * bits as f64 / (f64::from(bitrate) * seconds),
    });
    let load = load.collect();
    let load_percent = heard.load_percent(bitrate);
    let findings = findings.diagnose().into_iter().chain(system::priority_note()).collect();
    DoctorOutput { findings, log: log.collect(), load_percent, load }
}

/// Formats findings, each with its remedy below.
fn lines(findings: &[Finding]) -> Vec<String> {
    let mut lines = Vec::new();
    for Finding { gravity, what, help } in findings {
        let mark = match gravity {
            Gravity::Fine => '✓',
            Gravity::Note => '·',
            Gravity::Wrong => '✗',
        };
        lines.push(format!("{mark} {what}"));
        if !help.is_empty() {
            lines.push(format!("    {help}"));
        }
    }
    lines
}

fn text(report: &DoctorOutput) -> String {
    let mut lines = lines(&report.findings);
    if !report.log.is_empty() {
        let mut table = Table::new(["log of the controller", "s ago", "", ""]);
        for entry in &report.log {
            table.row([
                entry.event.clone(),
                format!("{:.2}", entry.seconds_ago),
                entry.before.to_owned(),
                if entry.before == entry.after {
                    String::new()
                } else {
                    format!("→ {}", entry.after)
                },
            ]);
        }
        lines.extend([String::new(), table.render()]);
    }
    if !report.load.is_empty() {
        let mut table = Table::new(["id", "message", "frames/s", "% of the bus"]);
        for load in &report.load {
            table.row([
                load.id.clone(),
                load.message.unwrap_or("other").to_owned(),
                format!("{:.1}", load.per_second),
                format!("{:.2}", load.percent),
            ]);
        }
        lines.extend([String::new(), table.render()]);
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::Parser;
    use std::path::Path;

    #[derive(Parser)]
    struct Line {
        #[command(flatten)]
        args: Args,
    }

    fn args(more: &[&str]) -> Args {
        Line::parse_from([&["doctor", "--bus", "sim", "--expect", "pup.toml"], more].concat()).args
    }

    fn hello(config_hash: u32) -> Hello {
        Hello {
            major: 2,
            minor: 0,
            schema_hash: 0,
            config_hash,
            format_major: 1,
            format_minor: 1,
            library: None,
            max_block: 512,
            channels: 2,
        }
    }

    /// Before a library is flashed, the expected robot file is the only source of names.
    #[test]
    fn the_expected_robot_names_the_channels_of_its_controller() {
        let robot = |args: &Args, hash| names(args, Some(7), Some(&hello(hash))).robot;
        assert_eq!(robot(&args(&[]), 7).as_deref(), Some(Path::new("pup.toml")));
        assert_eq!(robot(&args(&[]), 8), None, "names of another robot would be wrong");
        let named = args(&["--robot", "own.toml"]);
        assert_eq!(robot(&named, 7).as_deref(), Some(Path::new("own.toml")));
    }
}
