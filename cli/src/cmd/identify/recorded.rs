//! Reading of recordings in all supported formats:
//!
//! | file | begins with | read by |
//! |---|---|---|
//! | telemetry of `rollwalk monitor --mcap` | the signature of MCAP | [`rollwalk_host::traces`] |
//! | log of all actuator buses, as `candump -l` writes it | `(` | [`rollwalk_host::traces`] |
//! | table (CSV) | anything else | [`Recording::from_text`] |

use miette::{IntoDiagnostic, Report, miette};
use rollwalk_bus::candump;
use rollwalk_host::traces::{self, Motor, Traces};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{DriveSeries, Recording, RequestedSpan, Series, TableError};
use rollwalk_terminal::files::{self, PathSource};
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::output;
use rollwalk_terminal::validated_library::channel_names;
use std::fmt::Display;
use std::path::Path;

const MCAP: &[u8] = b"\x89MCAP0\r\n";

/// Reads the recording of a run.
///
/// # Errors
/// Returns an error if the file cannot be read, or lacks data that a fit needs.
pub fn read(path: &Path, robot: &Robot, wanted_s: RequestedSpan) -> miette::Result<Recording> {
    let read = files::read_by(path, PathSource::ByUser, |_| Kind::Run)?;
    if read.0.starts_with(MCAP) {
        let config = robot.controller_config().into_diagnostic()?;
        let traces = traces::of_mcap(&read.0, &config, &channel_names(robot));
        let traces = traces.map_err(|error| unusable(path, robot, &error))?;
        return recording(&traces, robot, wanted_s).map_err(|error| unusable(path, robot, &error));
    }
    let text = files::text(read, path)?;
    Kind::Run.expect(path, &text)?;
    if !candump::is_of_candump(&text) {
        return Recording::from_text(&text, robot, wanted_s)
            .map_err(|error| of_table(path, robot, &error));
    }
    of_log(path, &text, robot, wanted_s).map_err(|error| unusable(path, robot, &error))
}

fn of_table(path: &Path, robot: &Robot, error: &TableError) -> Report {
    let columns = "record the columns that docs/identification.md lists; `rollwalk simulate \
        PLAN.json --world-log RUN.csv` writes all of them";
    let help = match error {
        TableError::OtherRobot { .. } => {
            format!("give the robot file of the run with `--robot`, or a run of {}", robot.name)
        }
        TableError::Missing { .. } => format!("give a run of {}; {columns}", robot.name),
        _ => columns.to_owned(),
    };
    miette!(help = help, "{}: {error}", path.display())
}

fn unusable(path: &Path, robot: &Robot, error: &dyn Display) -> Report {
    let help = format!(
        "give a run of {}: telemetry of `rollwalk monitor` (MCAP), a candump log or a table (CSV), \
         as docs/identification.md describes",
        robot.name
    );
    miette!(help = help, "{}: {error}", path.display())
}

fn of_log(
    path: &Path,
    text: &str,
    robot: &Robot,
    wanted_s: RequestedSpan,
) -> miette::Result<Recording> {
    let profile = Bus::default().protocol;
    let other = robot.channels().find_map(|channel| {
        let number = channel.actuator().bus;
        robot.buses.get(&number).filter(|bus| bus.protocol != profile).map(|_| number)
    });
    if let Some(number) = other {
        return Err(miette!(
            "the setpoints of the drives on bus {number} cannot be read, because they do not use \
             the Rollwalk servo profile: record with `rollwalk monitor --mcap RUN.mcap --library \
             LIB.rwl`"
        ));
    }
    let config = robot.controller_config().into_diagnostic()?;
    let log = candump::read(text).map_err(|error| miette!("{error}"))?;
    if log.foreign > 0 {
        output::print_line(format_args!(
            "{}: left out {} frames of CAN FD or CAN XL, which drives of the Rollwalk servo profile do not send",
            path.display(),
            log.foreign
        ));
    }
    if let Some(cut) = &log.cut {
        output::print_line(format_args!(
            "{}:{}: left out the last line, which was cut off",
            path.display(),
            cut.line
        ));
    }
    let traces = traces::of_candump(&log.entries, &config, &channel_names(robot));
    recording(&traces.map_err(|error| miette!("{error}"))?, robot, wanted_s)
}

/// Recording of the motors alone. Neither telemetry nor actuator buses contain the pose of the body.
fn recording(traces: &Traces, robot: &Robot, wanted_s: RequestedSpan) -> miette::Result<Recording> {
    let series = |points: &traces::Points| Series::new(points.iter().copied());
    let drive = |motor: &Motor| DriveSeries {
        target_rad: series(&motor.target_rad),
        target_rad_s: series(&motor.target_rad_s),
        feedforward_nm: series(&motor.feedforward_nm),
        rad: series(&motor.rad),
        rad_s: series(&motor.rad_s),
    };
    let drives = traces.motors.iter().map(drive).collect();
    let run = Recording::new(robot, drives, None, None, None);
    run.cut(&traces.commanded_s, wanted_s).map_err(|error| miette!("{error}"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_bus::candump::LogEntry;
    use rollwalk_protocol::actuator::{Feedback, JointSetpoint, WheelSetpoint};
    use rollwalk_protocol::config::ChannelKind;
    use rollwalk_simulate::identify::motor_names;

    const PERIOD_US: u64 = 10_000;

    /// Commanded and measured angle or speed of a channel.
    fn values(channel: usize, time_s: f64) -> [f64; 2] {
        let swing = 0.1 * (3.0 * time_s + channel as f64).sin();
        [swing, 0.98 * swing]
    }

    /// Returns one run as a table and as a log of two buses.
    fn run(robot: &Robot) -> [String; 2] {
        let config = robot.controller_config().unwrap();
        let names = motor_names(robot);
        let columns =
            names.iter().map(|name| format!(",{name}_target_rad,{name}_target_rad_s,{name}_rad"));
        let mut table = format!("time_s{}\n", columns.collect::<String>());
        let mut log = Vec::new();
        for k in 0..100_u64 {
            let at_us = 1_700_000_000_000_000 + k * PERIOD_US;
            let time_s = (k * PERIOD_US) as f64 * 1e-6;
            table += &time_s.to_string();
            for (number, channel) in config.channels.iter().enumerate() {
                let interface = format!("can{}", 1 + channel.bus);
                let [target, measured] = values(number, time_s);
                // A row contains the values that were in force during the step before it.
                let [before, _] = values(number, time_s - PERIOD_US as f64 * 1e-6);
                table += &format!(",{before},{before},{measured}");
                let value = target as f32;
                let frame = match channel.kind {
                    ChannelKind::JointPosition => JointSetpoint {
                        position_rad: value,
                        velocity_rad_s: value,
                        kp_nm_rad: 80.0,
                        kd_nm_s_rad: 1.0,
                        torque_nm: 0.0,
                    }
                    .encode(channel.id),
                    ChannelKind::WheelSpeed => WheelSetpoint {
                        speed_rad_s: value,
                        kd_nm_s_rad: 0.5,
                        torque_limit_nm: 1.0,
                        torque_nm: 0.0,
                    }
                    .encode(channel.id),
                };
                let feedback = Feedback { position_rad: measured as f32, ..Feedback::default() };
                for frame in [frame, feedback.encode(channel.id)] {
                    let interface = interface.clone();
                    log.push(LogEntry { at_us, interface, frame: frame.unwrap() });
                }
            }
            table.push('\n');
        }
        [table, log.iter().map(|entry| format!("{entry}\n")).collect()]
    }

    #[test]
    fn a_table_and_a_log_are_the_same_run() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &str| {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            path
        };
        let text = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/agilebot.toml");
        let text = std::fs::read_to_string(text).unwrap();
        let robot = Robot::from_toml("agilebot", &text).unwrap();
        let [table, log] = run(&robot);
        let wanted_s = [Some(0.1), Some(0.9)];
        let read = |name: &str, content: &str| read(&file(name, content), &robot, wanted_s);
        let [table, log] = [read("run.csv", &table), read("run.log", &log)].map(|run| run.unwrap());
        assert_eq!((table.span_s, log.span_s), ([0.1, 0.9], [0.1, 0.9]));
        for (number, (one, other)) in table.drives.iter().zip(&log.drives).enumerate() {
            for step in 10..90 {
                let time_s = f64::from(step) * 0.01;
                let off = |one: &Series, other: &Series| one.at(time_s)[0] - other.at(time_s)[0];
                assert!(off(&one.rad, &other.rad).abs() < 1.1e-4);
                let of_joint = number < robot.joints.len();
                assert!(!of_joint || off(&one.target_rad, &other.target_rad).abs() < 1.1e-4);
                assert!(off(&one.target_rad_s, &other.target_rad_s).abs() < 1.1e-3);
            }
        }
        let why = |name: &str, content: &str| read(name, content).unwrap_err().to_string();
        assert!(why("robot.csv", &text).contains("robot.csv is a robot file, not a recorded run"));
        assert!(why("cut.mcap", "\u{89}MCAP").contains("column `time_s` is missing"));
        assert!(why("odd.log", "(1.000005) act0 123\n").contains("line 1: no frame"));
        for line in ["  can0  123   [2]  11 22\n", " (000.010000)  can0  123   [2]  11 22\n"] {
            assert!(why("view.log", line).contains("view format"), "{}", why("view.log", line));
        }
        assert!(why("none.log", "(1.000005) act0 123#00\n").contains("0 actuator buses"));

        // The log of a robot with fewer buses and motors.
        let text = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/car.toml");
        let car = Robot::from_toml("car", &std::fs::read_to_string(text).unwrap()).unwrap();
        let [_, log] = run(&car);
        let error = read("car.log", &log).unwrap_err();
        assert!(error.to_string().contains("car.log"), "{error}");
        let help = error.help().unwrap().to_string();
        assert!(help.starts_with("give a run of agilebot:"), "{help}");
    }
}
