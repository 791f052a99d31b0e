//! Load of a robot's actuator buses as a table, and the reasons why a bus cannot carry it.

use rollwalk_firmware::Settings;
use rollwalk_firmware::load::{BusLoad, BusProblem, examine};
use rollwalk_protocol::actuators::MAX_ON_LINE;
use rollwalk_protocol::actuators::Watchdog;
use rollwalk_protocol::actuators::bus::{MAX_BUSES, Protocol};
use rollwalk_protocol::actuators::dynamixel::Dynamixel;
use rollwalk_protocol::actuators::traffic::MAX_LOAD;
use rollwalk_robot::{InvalidRobot, Robot};
use rollwalk_terminal::output::Table;
use rollwalk_terminal::validated_library::channel_names;
use std::fmt::Write;
use std::path::Path;

/// Load of a robot's actuator buses, for a controller with default settings.
pub struct BusLoads {
    rows: Vec<BusLoad>,
    control_hz: u16,
    /// Names of the channels.
    channels: Vec<String>,
}

impl BusLoads {
    /// Computes the load of a robot's buses.
    ///
    /// # Errors
    /// Returns an error if the robot breaks the rules of robot files.
    pub fn new(robot: &Robot) -> Result<Self, InvalidRobot> {
        let (config, buses) = (robot.controller_config()?, robot.controller_buses());
        let control_hz = Settings::default().control_hz;
        let rows = examine(&config, &buses, control_hz).collect();
        let channels = channel_names(robot);
        Ok(Self { rows, control_hz, channels })
    }

    /// Checks that a controller can drive the robot.
    ///
    /// # Errors
    /// Returns the reasons of failure, one line for each bus.
    pub fn check(&self, file: &Path) -> miette::Result<()> {
        let Some(reasons) = self.refusal() else { return Ok(()) };
        let file = file.display();
        Err(miette::miette!(
            "{file}: no controller can drive the actuators of this robot\n{reasons}"
        ))
    }

    /// Formats one row for each bus.
    pub fn table(&self) -> String {
        let load = format!("load at {} Hz", self.control_hz);
        let most = format!("at most {:.0} %", 100.0 * MAX_LOAD);
        let titles = ["bus", "protocol", "actuators", "bits/period", "bits/s", &load, &most];
        let mut table = Table::new(titles);
        for row in &self.rows {
            table.row([
                row.bus.to_string(),
                format!(
                    "{}, {} kbit/s{}",
                    row.kind.protocol.name(),
                    row.kind.bit_rate / 1000,
                    match &row.kind.protocol {
                        Protocol::Dynamixel(Dynamixel { reads_fast: true, .. }) => {
                            ", fast sync read"
                        }
                        _ => "",
                    }
                ),
                row.actuators.to_string(),
                row.traffic.bits_per_period.to_string(),
                (u64::from(row.traffic.bits_per_period) * u64::from(self.control_hz)
                    + u64::from(row.traffic.bits_per_s))
                .to_string(),
                format!("{:.0} %", 100.0 * row.load),
                if row.problem.is_none() { "fits" } else { "does not fit" }.to_owned(),
            ]);
        }
        table.render()
    }

    /// Warnings about buses whose drives keep moving without a controller, because their watchdog is missing or off.
    pub fn warnings(&self) -> Vec<String> {
        let warning = |row: &BusLoad| {
            let protocol = &row.kind.protocol;
            let (lack, remedy) = match protocol {
                Protocol::Dynamixel(Dynamixel { watchdog_20ms: 0, .. }) => {
                    ("their watchdog off (`watchdog_ms = 0`)", "set `watchdog_ms`, such as 100")
                }
                _ if protocol.capabilities().watchdog == Watchdog::Missing => {
                    ("no watchdog", "add a switch within reach to their supply")
                }
                _ => return None,
            };
            Some(format!(
                "bus {}: its drives ({}) have {lack}, so joints hold and wheels keep turning if \
                 the controller or a cable fails; {remedy}",
                row.bus,
                protocol.name()
            ))
        };
        self.rows.iter().filter_map(warning).collect()
    }

    /// Reasons why a controller would refuse the robot, one line for each bus; `None` if it accepts it.
    fn refusal(&self) -> Option<String> {
        let mut text = String::new();
        for row in &self.rows {
            let why = match row.problem {
                None => continue,
                Some(BusProblem::NoSuchBus) => {
                    format!("controllers have buses 0 to {} only", MAX_BUSES - 1)
                }
                Some(BusProblem::TooMany) => format!(
                    "{} servos on a serial line, which carries at most {MAX_ON_LINE}: give each \
                     limb or side its own `[[bus]]`",
                    row.actuators
                ),
                Some(BusProblem::Overload(overload)) => format!("{overload}; {}", lighter(row)),
                Some(BusProblem::TooSeldom { needed_hz }) => {
                    format!("set the drives to report their poses at {needed_hz} Hz or more")
                }
                Some(BusProblem::CannotCarry { channel, refusal }) => {
                    format!("{}: {refusal}", self.channels[usize::from(channel)])
                }
            };
            let _ = writeln!(text, "bus {}: {why}", row.bus);
        }
        (!text.is_empty()).then_some(text)
    }
}

/// Advice on how to lower the load of a bus.
fn lighter(row: &BusLoad) -> &'static str {
    let BusLoad { kind, traffic, .. } = row;
    let bits_s = f64::from(traffic.bits_per_period) / f64::from(kind.bit_rate.max(1));
    let waits = f64::from(traffic.waiting_us_per_period) * 1e-6 > bits_s;
    // Bit rates of CAN, and of servos whose makers list them.
    let most = kind.protocol.bit_rates().iter().max().copied();
    let most = most.or((!kind.protocol.is_serial()).then_some(1_000_000));
    match &kind.protocol {
        Protocol::Dynamixel(Dynamixel { reads_fast: false, .. }) if waits => {
            "set a shorter return delay in the servos and as `return_delay_us`, or `read = \"fast\"`"
        }
        _ if waits => "set a shorter return delay in the servos and as `return_delay_us`",
        _ if most.is_some_and(|most| kind.bit_rate >= most) => "spread the motors over more buses",
        _ => {
            "raise `bit_rate` in the robot file and in the drives, or spread the motors over more buses"
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::actuators::bus::Bus;
    use rollwalk_protocol::actuators::odrive::{Odrive, Version};

    fn robots() -> impl Iterator<Item = (String, Robot)> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).filter_map(|path| {
            let name = path.file_name()?.to_str()?.to_owned();
            let text = std::fs::read_to_string(&path).unwrap();
            Some((name.clone(), Robot::from_toml(&name, &text).ok()?))
        })
    }

    fn agilebot() -> Robot {
        robots().find(|(name, _)| name == "agilebot.toml").unwrap().1
    }

    #[test]
    fn every_shipped_robot_fits_on_its_buses() {
        let mut count = 0;
        for (name, robot) in robots() {
            assert_eq!(BusLoads::new(&robot).unwrap().refusal(), None, "{name}");
            count += 1;
        }
        assert!(count > 5, "{count} robots");
    }

    #[test]
    fn agilebot_takes_a_third_of_two_buses() {
        let robot = agilebot();
        let text = BusLoads::new(&robot).unwrap().table();
        assert_eq!(robot.channels().count(), 20);
        assert_eq!(text.matches("32 %").count(), 2, "{text}");
    }

    /// Lowers the bit rate of the buses. The table must show the overload, and the refusal must contain the reasons.
    #[test]
    fn what_does_not_fit_is_refused_with_reasons() {
        let mut robot = agilebot();
        let slow = Bus { bit_rate: 250_000, ..Bus::default() };
        robot.buses = [(1, slow)].into();
        let loads = BusLoads::new(&robot).unwrap();
        assert_eq!(
            loads.refusal().as_deref(),
            Some(
                "bus 1: the bus load would be 130 %; at most 70 % is accepted; raise `bit_rate` in the robot file and in the drives, or \
                 spread the motors over more buses\n"
            )
        );
        assert!(loads.table().contains("250 kbit/s"), "{}", loads.table());
        let error = loads.check(Path::new("a.toml")).unwrap_err().to_string();
        assert!(error.starts_with("a.toml: no controller can drive"), "{error}");
    }

    #[test]
    fn what_would_help_is_said() {
        let mut robot = robots().find(|(name, _)| name == "pup.toml").unwrap().1;
        let line = robot.buses[&0];
        let Protocol::Dynamixel(of_pup) = line.protocol else { panic!("{line:?}") };
        let servos = |reads_fast, return_delay_us| {
            let servos = Dynamixel { return_delay_us, reads_fast, ..of_pup };
            Bus { protocol: Protocol::Dynamixel(servos), ..line }
        };
        let mut told = |bus| {
            robot.buses = [(0, bus)].into();
            BusLoads::new(&robot).unwrap().refusal().unwrap_or_default()
        };
        let text = told(servos(false, 500));
        assert!(text.contains("return_delay_us") && text.contains("read = \"fast\""), "{text}");
        assert_eq!(told(servos(true, 500)), "", "one delay for all");
        let text = told(Bus { bit_rate: 57_600, ..servos(true, 20) });
        assert!(text.contains("raise `bit_rate`"), "{text}");
    }

    #[test]
    fn a_watchdog_that_is_off_is_named() {
        let mut robot = robots().find(|(name, _)| name == "pup.toml").unwrap().1;
        assert!(BusLoads::new(&robot).unwrap().warnings().is_empty());
        let bus = robot.buses.get_mut(&0).unwrap();
        let Protocol::Dynamixel(servos) = bus.protocol else { panic!("Pup has Dynamixels") };
        bus.protocol = Protocol::Dynamixel(Dynamixel { watchdog_20ms: 0, ..servos });
        let warnings = BusLoads::new(&robot).unwrap().warnings();
        assert_eq!(warnings.len(), 1);
        assert!(warnings[0].starts_with("bus 0: "), "{warnings:?}");
        assert!(warnings[0].contains("watchdog off (`watchdog_ms = 0`)"), "{warnings:?}");
    }

    #[test]
    fn poses_that_are_reported_too_seldom_are_refused() {
        let mut robot = agilebot();
        let odrive = |estimates_hz| Bus {
            protocol: Protocol::Odrive(Odrive {
                version: Version::V06,
                reduction: 8.0,
                torque_constant_nm_a: 0.05,
                estimates_hz,
            }),
            ..Bus::default()
        };
        for (estimates_hz, refused) in [(59, true), (60, false)] {
            robot.buses = [(0, odrive(estimates_hz))].into();
            let refusal = BusLoads::new(&robot).unwrap().refusal();
            let expected = "bus 0: set the drives to report their poses at 60 Hz or more\n";
            assert_eq!(refusal.as_deref(), refused.then_some(expected));
        }
    }
}
