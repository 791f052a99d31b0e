//! `rollwalk discover`: lists the controllers on a bus.

use miette::miette;
use rollwalk_bus::link::LinkBus;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open;
use rollwalk_bus::port::LiveLink;
use rollwalk_host::discover::discover;
use rollwalk_host::session::Session;
use rollwalk_protocol::wire::Node;
use rollwalk_terminal::link::{BUS_ENV, BUS_HELP, Interruptible, cannot_open};
use rollwalk_terminal::output::Table;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;

/// Time that controllers have to answer, µs.
const WAIT_US: u64 = 600_000;

/// List the controllers on a bus: address, serial number, protocol, robot and library.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk discover --bus can:can0
  rollwalk discover --bus sim --json | jq '.[].node'")]
pub struct Args {
    #[arg(long, value_name = "BUS", env = BUS_ENV, help = BUS_HELP)]
    bus: BusName,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Controller in the output of `--json`.
#[derive(Serialize)]
struct ControllerEntry {
    node: u8,
    uid: String,
    protocol_major: u8,
    /// Configuration hash; null if the controller does not answer the identity request.
    config_hash: Option<String>,
    library: Option<String>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    interrupt::install_handler();
    let port = open::open(&args.bus, 1).map_err(cannot_open)?;
    let mut bus = Interruptible::new(LiveLink::new(port));
    let controllers = match discover(&mut bus, WAIT_US) {
        Ok(controllers) => controllers,
        Err(_) if interrupt::requested() => return Ok(Exit::Interrupted),
        Err(error) => return Err(miette!("{error}")),
    };
    let mut found = Vec::new();
    for (number, uid, protocol_major) in controllers {
        let uid = uid.map(|byte| format!("{byte:02x}")).concat();
        let node = Node::new(number);
        let session = node.and_then(|node| Session::visit_in_pause(&mut bus, node).ok());
        let hello = session.map(|session| *session.hello());
        found.push(ControllerEntry {
            node: number,
            uid,
            protocol_major,
            config_hash: hello.map(|hello| format!("{:08x}", hello.config_hash)),
            library: hello.and_then(|hello| Some(format!("{:08x}", hello.library?))),
        });
    }
    if interrupt::requested() {
        return Ok(Exit::Interrupted);
    }
    if args.json {
        output::print_json(&found)?;
    } else if !found.is_empty() {
        output::print(&table(&found))?;
    }
    for pair in found.windows(2).filter(|pair| pair[0].node == pair[1].node) {
        let node = pair[0].node;
        output::print_line(format_args!(
            "two controllers have address {node}: their frames collide; change the address of one"
        ));
    }
    if found.is_empty() {
        let why = bus
            .fault_and_remedy()
            .unwrap_or_else(|| "check power, cable and bus of the controller".into());
        output::print_line(format_args!("no controller answers on {}: {why}", args.bus));
        return Ok(Exit::NotDone);
    }
    Ok(Exit::Ok)
}

fn table(found: &[ControllerEntry]) -> String {
    let mut table = Table::new(["node", "serial number", "protocol", "configuration", "library"]);
    let or_none = |text: &Option<String>| text.clone().unwrap_or_else(|| "none".into());
    for controller in found {
        table.row([
            controller.node.to_string(),
            controller.uid.clone(),
            controller.protocol_major.to_string(),
            or_none(&controller.config_hash),
            or_none(&controller.library),
        ]);
    }
    table.render()
}
