//! What the actuator buses of a robot have to carry, as a table, and what of it they cannot.

use crate::output::Table;
use rollwalk_firmware::load::{BusLoad, BusProblem, examine};
use rollwalk_firmware::{Buses, Settings};
use rollwalk_protocol::actuators::traffic::MAX_LOAD;
use rollwalk_protocol::config::RobotConfig;
use std::fmt::Write;

/// The buses of a robot as a controller with default settings would have them.
pub struct Examined {
    rows: Vec<BusLoad>,
    control_hz: u16,
}

impl Examined {
    /// Looks at the buses of a robot.
    pub fn new(config: &RobotConfig) -> Self {
        let control_hz = Settings::default().control_hz;
        Self { rows: examine(config, &Buses::new(), control_hz).collect(), control_hz }
    }

    /// One row for each bus.
    pub fn table(&self) -> String {
        let load = format!("load at {} Hz", self.control_hz);
        let most = format!("at most {:.0} %", 100.0 * MAX_LOAD);
        let titles = ["bus", "speaks", "actuators", "bits a period", "bits a second", &load, &most];
        let mut table = Table::new(titles);
        for row in &self.rows {
            table.row([
                row.bus.to_string(),
                format!("{}, {} kbit/s", row.kind.protocol.name(), row.kind.bit_rate / 1000),
                row.actuators.to_string(),
                row.traffic.bits_per_period.to_string(),
                row.traffic.bits_per_s.to_string(),
                format!("{:.0} %", 100.0 * row.load),
                if row.problem.is_none() { "fits" } else { "does not" }.to_owned(),
            ]);
        }
        table.render()
    }

    /// Why a controller would refuse the robot, one line for each bus; nothing if it would not.
    pub fn refusal(&self) -> Option<String> {
        let mut text = String::new();
        for row in &self.rows {
            let why = match row.problem {
                None => continue,
                Some(BusProblem::NoSuchBus) => "a controller has no bus of that number".to_owned(),
                Some(BusProblem::Overload(overload)) => overload.to_string(),
                Some(BusProblem::TooSeldom { needed_hz }) => {
                    format!("poses have to be told at least {needed_hz} times a second")
                }
                Some(BusProblem::CannotTell { channel, refusal }) => {
                    format!("channel {channel}: {refusal}")
                }
            };
            let _ = writeln!(text, "bus {}: {why}", row.bus);
        }
        (!text.is_empty()).then_some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_robot::Robot;

    fn robots() -> impl Iterator<Item = (String, RobotConfig)> {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../robots");
        let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
        files.filter(|path| path.extension().is_some_and(|e| e == "toml")).filter_map(|path| {
            let name = path.file_name()?.to_str()?.to_owned();
            let text = std::fs::read_to_string(&path).unwrap();
            let robot = Robot::from_toml(&name, &text).ok()?;
            Some((name, robot.controller_config().unwrap()))
        })
    }

    #[test]
    fn every_shipped_robot_fits_on_its_buses() {
        let mut count = 0;
        for (name, config) in robots() {
            assert_eq!(Examined::new(&config).refusal(), None, "{name}");
            count += 1;
        }
        assert!(count > 5, "{count} robots");
    }

    #[test]
    fn agilebot_takes_a_third_of_two_buses() {
        let (_, config) = robots().find(|(name, _)| name == "agilebot.toml").unwrap();
        let text = Examined::new(&config).table();
        assert_eq!(config.channels.len(), 20);
        assert_eq!(text.matches("32 %").count(), 2, "{text}");
    }

    /// All on one bus, and more of them: the table says how much, the refusal why.
    #[test]
    fn what_does_not_fit_is_refused_with_reasons() {
        let (_, mut config) = robots().find(|(name, _)| name == "agilebot.toml").unwrap();
        for (id, channel) in (1..).zip(&mut config.channels) {
            (channel.bus, channel.id) = (1, id);
        }
        let more: Vec<_> = (21..).zip(&config.channels).take(4).map(|(id, c)| (id, *c)).collect();
        for (id, channel) in more {
            let _ = config.channels.push(rollwalk_protocol::config::Channel { id, ..channel });
        }
        let examined = Examined::new(&config);
        assert_eq!(
            examined.refusal().as_deref(),
            Some("bus 1: load of the bus would be 78 %, at most 70 % is right\n")
        );
        assert!(examined.table().contains("6480"), "{}", examined.table());
    }
}
