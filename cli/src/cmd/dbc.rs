//! `rollwalk dbc`: writes the frames of a bus as a DBC file, for cantools, SavvyCAN, Wireshark and similar programs.

use rollwalk_host::dbc::{ChannelName, Database, RobotNames};
use rollwalk_protocol::actuators::bus::MAX_BUSES;
use rollwalk_protocol::wire::Node;
use rollwalk_robot::{Actuator, Channel, Robot};
use rollwalk_terminal::files::Output;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, output};
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Write the frames of the link or of an actuator bus as a DBC file.
///
/// Without a robot file the DBC file describes controllers at all addresses of the link, or servos of the Rollwalk profile at
/// all addresses of an actuator bus. With a robot file, messages and signals are named after its joints and wheels: JOINT then
/// contains position, velocity and torque of each by name. Link and actuator buses use the same identifiers for different
/// frames, so each needs a separate file.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk dbc -o rollwalk.dbc
  rollwalk dbc robots/agilebot.toml -o agilebot.dbc
  rollwalk dbc robots/agilebot.toml --bus 0 -o agilebot-bus0.dbc
  candump can0 | cantools decode agilebot.dbc

docs/rollwalk.dbc and docs/rollwalk-actuators.dbc are made without a robot file; docs/formats/decode_log.py
decodes logs with them. The frames are described in docs/formats/wire-format.md.")]
pub struct Args {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Bus: `link`, `actuators` for all addresses of an actuator bus, or the number of a bus of the robot.
    #[arg(long, value_name = "BUS", default_value = "link", value_parser = bus)]
    bus: Bus,
    /// Address of the robot's controller on the link, 0 to 14.
    #[arg(long, value_name = "NODE", default_value_t = 1, requires = "robot",
          value_parser = clap::value_parser!(u8).range(0..15))]
    node: u8,
    /// Output file; without this option the database is printed.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Bus {
    Link,
    Actuators,
    Number(u8),
}

fn bus(name: &str) -> Result<Bus, String> {
    match (name, name.parse()) {
        ("link", _) => Ok(Bus::Link),
        ("actuators", _) => Ok(Bus::Actuators),
        (_, Ok(number)) if usize::from(number) < MAX_BUSES => Ok(Bus::Number(number)),
        _ => Err(format!("give `link`, `actuators`, or a bus number from 0 to {}", MAX_BUSES - 1)),
    }
}

/// Runs the subcommand.
///
/// # Errors
/// Returns an error if a file cannot be read or written, or if a bus number is given without a robot. Also returns an error if
/// the robot does not have the bus, or if its actuators use another protocol than the Rollwalk profile.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let robot = args.robot.as_ref().map(|path| Source::Disk.robot(path)).transpose()?;
    let names = robot.as_ref().map(names);
    let database = match (args.bus, &names) {
        (Bus::Link, None) => Database::link(),
        (Bus::Link, Some(names)) => {
            let node = Node::new(args.node).expect("clap has checked the range");
            Database::link_of(node, names)
        }
        (Bus::Actuators, _) => Database::actuators(),
        (Bus::Number(_), None) => {
            return Err(miette::miette!(
                "--bus with a number requires a robot file: add ROBOT.toml"
            ));
        }
        (Bus::Number(bus), Some(names)) => {
            if !names.channels.iter().any(|channel| channel.bus == bus) {
                let robot = &names.robot;
                let has: BTreeSet<u8> = names.channels.iter().map(|channel| channel.bus).collect();
                let has: Vec<_> = has.iter().map(ToString::to_string).collect();
                return Err(miette::miette!(
                    help = format!("give one of its buses: {}", has.join(", ")),
                    "{robot} has no actuators on bus {bus}"
                ));
            }
            let kind = robot.as_ref().and_then(|robot| robot.buses.get(&bus));
            if let Some(kind) = kind.filter(|kind| !kind.protocol.has_dbc()) {
                let (robot, protocol) = (&names.robot, kind.protocol.name());
                return Err(miette::miette!(
                    help = "use the DBC file of the manufacturer; docs/actuators.md describes the \
                        drive",
                    "bus {bus} of {robot} uses {protocol}, but DBC files are written for the \
                     Rollwalk profile only"
                ));
            }
            Database::actuators_of(bus, names)
        }
    };
    let text = database.to_dbc();
    match &args.output {
        Some(path) => {
            let place = Output::at(path)?;
            place.write(text.as_bytes())?;
            let (messages, path) = (database.messages.len(), path.display());
            place.comment(&format!("wrote {path}: {messages} messages"))?;
        }
        None => output::print(&text)?,
    }
    Ok(Exit::Ok)
}

/// Names of the channels in the order of the controller's configuration.
fn names(robot: &Robot) -> RobotNames {
    let channels = robot.channels().map(|channel| {
        let (name, is_wheel) = match &channel {
            Channel::Joint(joint) => (joint.name.clone(), false),
            // A leg and its wheel have the same name.
            Channel::Wheel(wheel, _) => (format!("{}_wheel", wheel.name), true),
        };
        let Actuator { bus, id, .. } = *channel.actuator();
        ChannelName { name, bus, id, is_wheel }
    });
    RobotNames { robot: robot.name.clone(), channels: channels.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::config::ChannelKind;
    use std::path::Path;

    #[test]
    fn channels_of_agilebot_are_named_in_the_order_of_its_configuration() {
        let path =
            Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/agilebot.toml"));
        let robot = Source::Disk.robot(path).unwrap();
        let names = names(&robot);
        let config = robot.controller_config().unwrap();
        assert_eq!(names.channels.len(), 20);
        let mut told = BTreeSet::new();
        for (channel, name) in config.channels.iter().zip(&names.channels) {
            assert_eq!((channel.bus, channel.id), (name.bus, name.id));
            assert_eq!(channel.kind == ChannelKind::WheelSpeed, name.is_wheel);
            assert!(told.insert(&name.name));
        }
        assert_eq!(names.channels[0].name, robot.joints[0].name);
    }
}
