//! `rollwalk discover`: lists the controllers on a bus.

use rollwalk_bus::link::LinkBus;
use rollwalk_bus::name::BusName;
use rollwalk_bus::open;
use rollwalk_bus::port::LiveLink;
use rollwalk_host::discover::discover;
use rollwalk_host::session::Session;
use rollwalk_protocol::wire::Node;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_terminal::link::{
    BUS_ENV, BUS_HELP, Interruptible, cannot_open, names, report_lost_bus,
};
use rollwalk_terminal::output::Table;
use rollwalk_terminal::validated_library;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;

/// Time that controllers have to answer, µs.
const WAIT_US: u64 = 600_000;
/// Address that commands use without `--node`.
const DEFAULT_NODE: u8 = 1;

/// List the controllers on a bus: address, serial number, protocol, robot and library.
///
/// The name of a robot is known if the robot ships with rollwalk, or if its library was built or flashed on this computer.
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
    /// Name of the robot; null if it is unknown on this computer.
    robot: Option<String>,
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
        Err(error) => return Err(report_lost_bus(&args.bus, &error).into()),
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
            robot: hello.and_then(|hello| robot_name(&hello)),
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
    found.iter().for_each(|controller| output::print_line(next(controller, &args.bus)));
    if found.is_empty() {
        let why = bus
            .fault_and_remedy()
            .unwrap_or_else(|| "check power, cable and bus of the controller".into());
        output::print_line(format_args!("no controller answers on {}: {why}", args.bus));
        return Ok(Exit::NotDone);
    }
    Ok(Exit::Ok)
}

/// Name of a controller's robot: that of the library, or of a shipped robot with its configuration.
fn robot_name(hello: &Hello) -> Option<String> {
    let of_library = hello.library.and_then(names::cached).map(|catalog| catalog.robot);
    of_library.or_else(|| Some(validated_library::robot_of(hello.config_hash)?.name))
}

/// Next command for a controller.
fn next(controller: &ControllerEntry, bus: &BusName) -> String {
    let node = controller.node;
    let option = if node == DEFAULT_NODE { String::new() } else { format!(" --node {node}") };
    let (what, command) = match (&controller.config_hash, &controller.library) {
        (Some(_), None) => ("flash a library", "flash LIB.rwl"),
        _ => ("check the robot", "doctor"),
    };
    format!("next, for node {node}: {what} with `rollwalk {command} --bus {bus}{option}`")
}

fn table(found: &[ControllerEntry]) -> String {
    let heads = ["node", "serial number", "protocol", "robot", "configuration", "library"];
    let mut table = Table::new(heads);
    let or_none = |text: &Option<String>| text.clone().unwrap_or_else(|| "none".into());
    let or_unknown = |text: &Option<String>| text.clone().unwrap_or_else(|| "unknown".into());
    for controller in found {
        table.row([
            controller.node.to_string(),
            controller.uid.clone(),
            controller.protocol_major.to_string(),
            or_unknown(&controller.robot),
            or_unknown(&controller.config_hash),
            or_none(&controller.library),
        ]);
    }
    table.render()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(node: u8, library: Option<&str>) -> ControllerEntry {
        ControllerEntry {
            node,
            uid: "00".into(),
            protocol_major: 1,
            robot: Some("pup".into()),
            config_hash: Some("89abcdef".into()),
            library: library.map(str::to_owned),
        }
    }

    #[test]
    fn a_controller_has_the_name_of_its_robot_and_a_next_command() {
        let bus = "can:can0".parse().unwrap();
        assert!(table(&[entry(1, None)]).contains("pup"));
        assert_eq!(
            next(&entry(1, None), &bus),
            "next, for node 1: flash a library with `rollwalk flash LIB.rwl --bus can:can0`"
        );
        assert_eq!(
            next(&entry(3, Some("0badcafe")), &bus),
            "next, for node 3: check the robot with `rollwalk doctor --bus can:can0 --node 3`"
        );
    }

    #[test]
    fn a_shipped_robot_is_named_by_its_configuration() {
        let robot = validated_library::robot_of(hash("robots/agilebot.toml")).unwrap();
        assert_eq!(robot.name, "agilebot");
    }

    fn hash(file: &str) -> u32 {
        let robot = rollwalk_terminal::inputs::Source::Shipped.robot(file.as_ref()).unwrap();
        robot.controller_config().unwrap().hash()
    }
}
