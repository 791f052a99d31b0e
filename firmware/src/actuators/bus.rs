//! What the actuators of a bus speak. Which protocol that is, and with what parameters, is told when
//! the controller is made; every bus that nothing is said about has actuators of the Rollwalk profile.

use heapless::Vec;
use rollwalk_protocol::actuators::cybergear::CyberGear;
use rollwalk_protocol::actuators::dynamixel::Dynamixels;
use rollwalk_protocol::actuators::maestro::Maestro;
use rollwalk_protocol::actuators::mit::Mit;
use rollwalk_protocol::actuators::odrive::Odrive;
use rollwalk_protocol::actuators::rollwalk::RollwalkServos;
use rollwalk_protocol::actuators::{ActuatorProtocol, Capabilities, Order, Refusal, Traffic};

/// Most actuator buses of a controller.
pub const MAX_BUSES: usize = 4;

/// The actuator buses of a controller, by number.
pub type Buses = Vec<Bus, MAX_BUSES>;

/// A bus and the actuators on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bus {
    /// What they speak.
    pub protocol: Protocol,
    /// Bits per second on the bus.
    pub bit_rate: u32,
    /// Who makes torque out of position and speed.
    pub control: ControlLoop,
    /// How the controller knows where joints are before their torque comes on.
    pub pose: Pose,
}

impl Default for Bus {
    /// Actuators of the Rollwalk profile at 1 Mbit/s.
    fn default() -> Self {
        Self {
            protocol: Protocol::Rollwalk,
            bit_rate: 1_000_000,
            control: ControlLoop::InDrive,
            pose: Pose::Measured,
        }
    }
}

/// Who makes torque out of position and speed: kp (q* − q) + kd (q̇* − q̇), of a wheel kd (ω* − ω).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlLoop {
    /// The drive, at its own rate.
    InDrive,
    /// The controller, at its rate and from the last feedback; the drive is told a torque, within the
    /// channel's limit. None is told from feedback that is older than two ticks.
    OnController,
}

/// How the controller knows where joints are before their torque comes on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pose {
    /// They measure it. Those that do not cannot be armed.
    Measured,
    /// Those that do not measure it are taken to be in SAFE, where an operator has put the robot, and
    /// later where they were sent last. Wherever they are, they jump there.
    AssumedSafe,
}

/// A protocol, with what has to be known of the actuators that speak it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Protocol {
    /// The Rollwalk profile; CAN.
    Rollwalk,
    /// Mini cheetah drives and T-Motor's AK series; CAN.
    Mit(Mit),
    /// ODrive; CAN.
    Odrive(Odrive),
    /// CyberGear; CAN with 29-bit identifiers.
    CyberGear(CyberGear),
    /// Dynamixel X; a serial line.
    Dynamixel(Dynamixels),
    /// Hobby servos behind a Maestro; a serial line.
    Maestro(Maestro),
}

impl Protocol {
    /// What it can do.
    pub fn capabilities(&self) -> Capabilities {
        match self {
            Protocol::Rollwalk => RollwalkServos.capabilities(),
            Protocol::Mit(p) => p.capabilities(),
            Protocol::Odrive(p) => p.capabilities(),
            Protocol::CyberGear(p) => p.capabilities(),
            Protocol::Dynamixel(p) => p.capabilities(),
            Protocol::Maestro(p) => p.capabilities(),
        }
    }

    /// Its name, for people.
    pub fn name(&self) -> &'static str {
        match self {
            Protocol::Rollwalk => "Rollwalk",
            Protocol::Mit(p) => p.model.name,
            Protocol::Odrive(_) => "ODrive",
            Protocol::CyberGear(_) => "CyberGear",
            Protocol::Dynamixel(p) => p.model.name,
            Protocol::Maestro(_) => "Maestro",
        }
    }

    /// How often actuators tell their pose that tell it on a timer, Hz.
    pub(crate) fn tells_hz(&self) -> Option<u32> {
        match self {
            Protocol::Odrive(p) => Some(p.estimates_hz),
            _ => None,
        }
    }

    /// The most that setpoints for so many actuators and their answers take of the bus.
    pub fn traffic(&self, actuators: u32) -> Traffic {
        match self {
            Protocol::Rollwalk => RollwalkServos.traffic(actuators),
            Protocol::Mit(p) => p.traffic(actuators),
            Protocol::Odrive(p) => p.traffic(actuators),
            Protocol::CyberGear(p) => p.traffic(actuators),
            Protocol::Dynamixel(p) => p.traffic(actuators),
            Protocol::Maestro(p) => p.traffic(actuators),
        }
    }

    /// Whether an order can be told.
    pub(crate) fn check(&self, order: &Order) -> Result<(), Refusal> {
        match self {
            Protocol::Rollwalk => RollwalkServos.check(order),
            Protocol::Mit(p) => p.check(order),
            Protocol::Odrive(p) => p.check(order),
            Protocol::CyberGear(p) => p.check(order),
            Protocol::Dynamixel(p) => p.check(order),
            Protocol::Maestro(p) => p.check(order),
        }
    }
}
