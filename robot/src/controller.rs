//! Configuration of the controller, derived from a valid robot.

use crate::model::Robot;
use crate::rules::{self, InvalidRobot};
use crate::transmission::Transmission;
use rollwalk_protocol::actuators::bus::{Bus, Buses, MAX_BUSES};
use rollwalk_protocol::config::{RobotConfig, robot_id};
use rollwalk_protocol::crc::crc32c_append;

impl Robot {
    /// Checks all rules of robot files. For robots from other sources, such as plan files.
    ///
    /// # Errors
    /// Returns all broken rules.
    pub fn validate(&self) -> Result<(), InvalidRobot> {
        let violations = rules::violations(self);
        if violations.is_empty() {
            return Ok(());
        }
        Err(InvalidRobot { name: self.name.clone(), violations })
    }

    /// Map between the joints of a valid robot and their servos.
    ///
    /// # Panics
    /// If the couplings are not invertible, which [`Self::validate`] refuses.
    pub fn transmission(&self) -> Transmission {
        Transmission::new(self).expect("a valid robot's couplings are invertible")
    }

    /// Total mass of the links, kg.
    pub fn total_mass_kg(&self) -> f64 {
        self.links.iter().map(|link| link.mass_kg).sum()
    }

    /// Index of the end effector with the given name; `None` if there is no such end effector.
    pub fn end_effector_index(&self, name: &str) -> Option<usize> {
        self.end_effectors.iter().position(|end_effector| end_effector.name == name)
    }

    /// Configuration of the controller: limits, gains and addresses of the channels, in order.
    ///
    /// Data sheets are reduced to the limits that the controller enforces. The rate of a joint is limited to the speed limit of
    /// its actuator. The acceleration of a wheel is limited to min(μ g / r, torque / armature): the grip of its tyre, and the
    /// acceleration of its own rotor.
    ///
    /// The robot's identity ([`RobotConfig::robot`]) includes its buses. A controller with other protocols therefore rejects
    /// the robot's library and saved gains.
    ///
    /// # Errors
    /// Returns all rules that the robot breaks. A robot with more channels than a controller also breaks a rule.
    pub fn controller_config(&self) -> Result<RobotConfig, InvalidRobot> {
        self.validate()?;
        // `validate` has bounded the number of channels, so that none is dropped here.
        let channels = self.channels().map(|channel| channel.config(self)).collect();
        let buses = self.buses.iter().filter(|(_, bus)| **bus != Bus::default());
        let robot = buses.fold(robot_id(&self.name), |id, bus| crc32c_append(id, &encoded(bus)));
        Ok(RobotConfig { robot, channels })
    }

    /// Actuator buses of a valid robot for the controller.
    pub fn controller_buses(&self) -> Buses {
        let count = self.buses.keys().max().map_or(0, |last| usize::from(*last) + 1);
        // `validate` has bounded the numbers, so that none is dropped here.
        (0..count.min(MAX_BUSES) as u8)
            .map(|number| self.buses.get(&number).copied().unwrap_or_default())
            .collect()
    }
}

/// Unique encoding of a bus and its number.
fn encoded(bus: (&u8, &Bus)) -> Vec<u8> {
    let mut buffer = [0; 64];
    postcard::to_slice(&bus, &mut buffer).expect("a bus has at most 40 bytes").to_vec()
}
