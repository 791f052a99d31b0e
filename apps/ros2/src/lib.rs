//! `rollwalk-ros2`: a robot as a node of ROS 2, a program beside `rollwalk` and `rollwalk-sim`.
//!
//! The node is a host of the robot whose interface is ROS. It publishes joint states, URDF and diagnostics, and receives
//! operator commands. The robot plays whole motions from its own library, and its firmware enforces all limits; so the node
//! sends motion codes, not joint angles. If the robot is driven by velocities, the node plans its motion continuously.
//!
//! The package for colcon, with its launch file, is in `apps/packaging/rollwalk_ros2/`.
//!
//! | module | content |
//! |---|---|
//! | `environment`, `names`, `parameters` | environment variables and arguments of ROS |
//! | `messages` | messages of ROS |
//! | `convert` | conversion of the host's view to messages |
//! | `graph` | topics and services |
//! | `commanded` | the velocity command in force |
//! | `driving` | the pilot that follows velocities |
//! | `bridge` | the loop |

mod bridge;
mod commanded;
mod convert;
mod driving;
mod environment;
mod graph;
mod messages;
mod names;
mod parameters;

use bridge::Bridge;
use clap::{CommandFactory, FromArgMatches, Parser};
use driving::NodePilot;
use environment::Environment;
use graph::Graph;
use miette::miette;
use names::Names;
use rollwalk_host::listener;
use rollwalk_host::operator::Operator;
use rollwalk_host::session::SessionError;
use rollwalk_terminal::generated::{self, Shell};
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::steering::{GIVE_GAIT, SteeringArgs};
use rollwalk_terminal::link::{LinkArgs, cannot_open, report_failure};
use rollwalk_terminal::{Exit, end, interrupt, output, with_common_help};
use std::path::PathBuf;
use std::process::ExitCode;

/// A robot as a node of ROS 2: publishes joint states, URDF and diagnostics, and receives operator commands.
///
/// The node is the robot's only host: it sends the heartbeat that keeps an armed robot armed. It arms only after a call of its
/// service `arm`, and follows velocities only after a call of its service `drive`. Ctrl-C and SIGTERM return the robot to SAFE
/// and disarm it; if the node ends in any other way, the robot does the same automatically.
///
/// The node does not need an installation of ROS. It uses ROS_DOMAIN_ID, ROS_AUTOMATIC_DISCOVERY_RANGE, ROS_LOCALHOST_ONLY and
/// RMW_IMPLEMENTATION (rmw_fastrtps_cpp or rmw_cyclonedds_cpp), and the names of node and topics after --ros-args.
#[derive(Parser)]
#[command(name = "rollwalk-ros2", version, max_term_width = 100)]
#[command(after_long_help = "\
Examples:
  rollwalk-ros2 --bus can:can0
  rollwalk-ros2 --bus serial:/dev/ttyUSB0 --library pup.rwl --robot pup.toml
  rollwalk-ros2 --bus can:can0 --library agilebot.rwl --gait walk.plan.json     # follows /cmd_vel
  rollwalk-ros2 --bus sim --ros-args -r __ns:=/lab -r __node:=agilebot

Then, in another terminal:
  ros2 service call /rollwalk/arm std_srvs/srv/Trigger
  ros2 topic pub --once /rollwalk/play std_msgs/msg/String '{data: walk}'
  ros2 service call /rollwalk/return std_srvs/srv/Trigger

All topics and services are in docs/ros2.md.")]
struct Cli {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    #[command(flatten)]
    steering: SteeringArgs,
    /// Write the manual page into this folder, then exit.
    #[arg(long, value_name = "FOLDER", exclusive = true)]
    man: Option<PathBuf>,
    /// Print a completion script for this shell, then exit.
    #[arg(long, value_name = "SHELL", exclusive = true)]
    completions: Option<Shell>,
}

/// Command line; its long help ends with the exit codes.
pub fn command_line() -> clap::Command {
    with_common_help(Cli::command(), &|_| &[Exit::Ok, Exit::NotDone])
}

/// Parses the command line and runs the node.
pub fn main() -> ExitCode {
    end(Names::split(std::env::args_os()).and_then(|(names, arguments)| {
        let matches = command_line().get_matches_from(arguments);
        // These commands need no options of a robot.
        if let Some(folder) = matches.get_one::<PathBuf>("man") {
            return generated::manual(command_line(), folder).map(|()| Exit::Ok);
        }
        if let Some(shell) = matches.get_one::<Shell>("completions") {
            return generated::completions(&mut command_line(), *shell).map(|()| Exit::Ok);
        }
        run(&Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit()), &names)
    }))
}

fn run(cli: &Cli, names: &Names) -> miette::Result<Exit> {
    let environment = Environment::read()?;
    if let Some(warning) = environment::other_distribution() {
        output::print_warnings(&[warning]);
    }
    let operator = Operator::new(cli.link.peer()?, cli.names.config_hash()?).unwatched();
    let prepared = match &cli.names.library {
        Some(library) => Some(cli.steering.prepare(library, cli.names.robot.as_deref())?),
        None if cli.steering.gait.is_some() => {
            return Err(miette!(
                help = "add --library LIB.rwl, because driving begins and ends at the SAFE pose of \
                    the library",
                "--gait requires the motion library of the controller"
            ));
        }
        None => None,
    };
    // The library also names the motions of a robot that cannot be driven.
    let prepared = prepared.filter(|prepared| {
        let goes = prepared.check_goes();
        if let Err(why) = &goes {
            output::print_line(format_args!(
                "~/drive and cmd_vel are not available: {why}\n  {GIVE_GAIT}"
            ));
        }
        goes.is_ok()
    });
    interrupt::install_handler();
    let mut bus = cli.link.live().map_err(cannot_open)?;
    let node = cli.link.node;
    // If the bus has been lost by now, the bridge waits for it.
    if listener::find_host(&mut bus, node).is_ok_and(|listener| listener.has_host()) {
        return Ok(report_failure(&cli.link, &SessionError::HasHost { node: node.number() }));
    }
    let graph = Graph::join(&environment, names, prepared.is_some())?;
    output::print_line(format_args!("node {} in ROS domain {}", graph.name(), environment.domain));
    let timeout_s = names.parameters.cmd_vel_timeout_s;
    let driving = prepared.map(|it| NodePilot::new(it, cli.steering.budget(), timeout_s));
    Ok(Bridge::new(&cli.link, &cli.names, bus, operator, graph, driving).run())
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_command_line_is_consistent() {
        super::command_line().debug_assert();
    }

    #[test]
    fn a_page_and_completions_need_no_robot() {
        for words in [["--man", "man1"], ["--completions", "fish"]] {
            let words = ["rollwalk-ros2"].into_iter().chain(words);
            assert!(super::command_line().try_get_matches_from(words).is_ok());
        }
        assert!(super::command_line().try_get_matches_from(["rollwalk-ros2"]).is_err());
    }

    #[test]
    fn the_package_of_ros_has_the_version_of_the_crate() {
        let version = format!("<version>{}</version>", env!("CARGO_PKG_VERSION"));
        assert!(
            include_str!("../../packaging/rollwalk_ros2/package.xml").contains(&version),
            "{version}"
        );
    }
}
