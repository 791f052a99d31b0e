//! `rollwalk doctor`: diagnoses a robot and suggests remedies.

use crate::system;
use miette::miette;
use rollwalk_bus::link::LinkBus;
use rollwalk_host::decode::decode;
use rollwalk_host::describe::state_name;
use rollwalk_host::doctor::{Finding, Gravity, Observations, Traffic};
use rollwalk_host::listener::{self, Listener};
use rollwalk_host::session::{History, Session};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::State;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{Interruptible, LinkArgs};
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
/// The command listens for two seconds, then reads the controller's identity and log. It sends no commands to the robot. The
/// exit code is 5 if it finds a fault.
///
/// With --system it checks only this computer: SocketCAN and CAN interfaces, access to serial devices and their latency timers,
/// real-time priority, gamepads, and programs that convert pictures. It opens no bus.
#[derive(clap::Args)]
// No bus is opened then, but one belongs to the arguments of a link.
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

docs/faults.md has a page for every fault.")]
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
    let mut link = args.link.open()?;
    let (heard, samples, listener) = listen(args, &mut link)?;
    let has_host = listener.has_host();
    let transferring = !may_ask(&mut link, listener);
    let (hello, history) = if transferring { (None, None) } else { ask(args, &mut link) };
    let complaint = link.fault_and_remedy();
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    let catalog = args.names.look_up(hello.as_ref())?;
    let bus = args.link.bus.to_string();
    let bitrate = link.bitrate().unwrap_or(BITRATE);
    let findings = Observations {
        heard: &heard,
        has_host,
        hello: hello.as_ref(),
        transferring,
        history: history.as_ref(),
        complaint: complaint.as_deref(),
        bitrate,
        expected_config: expected,
        catalog: catalog.as_ref(),
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
fn listen(args: &Args, bus: &mut Interruptible) -> miette::Result<(Traffic, Vec<Frame>, Listener)> {
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
            Err(error) => return Err(miette!("{error}")),
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

/// Requests the controller's identity and log.
fn ask(args: &Args, bus: &mut Interruptible) -> (Option<Hello>, Option<History>) {
    let Ok(mut session) = Session::visit(bus, args.link.node) else { return (None, None) };
    (Some(*session.hello()), session.history().ok())
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
            before: logged(entry.before),
            after: logged(entry.after),
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

/// Name of a state in the log. The log event already contains the cause of a stop.
fn logged(state: State) -> &'static str {
    if state == State::EStopped { "stopped" } else { state_name(state) }
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
