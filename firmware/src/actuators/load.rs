//! Bus capacity for the controller's commands, and commands that a protocol cannot carry.
//!
//! [`loads`] serves the controller's self test. [`examine`] serves tools that report the reasons.

use rollwalk_protocol::actuators::bus::{Bus, Buses, MAX_BUSES};
use rollwalk_protocol::actuators::traffic::Overload;
use rollwalk_protocol::actuators::{MAX_ON_LINE, Refusal, Traffic};
use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};

use super::actuator::FRESH_TICKS;

/// Load of a bus that has actuators.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BusLoad {
    /// Number of the bus.
    pub bus: u8,
    /// Configuration of the bus.
    pub kind: Bus,
    /// Number of actuators on the bus.
    pub actuators: u32,
    /// Worst-case traffic on the bus.
    pub traffic: Traffic,
    /// Fraction of the bus capacity that the traffic takes.
    pub load: f32,
    /// Reason why the bus cannot be used.
    pub problem: Option<BusProblem>,
}

/// Reason why a bus cannot be used.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BusProblem {
    /// Bus number of [`MAX_BUSES`] or more, which no controller has.
    NoSuchBus,
    /// More than [`MAX_ON_LINE`] servos on a serial line.
    TooMany,
    /// Traffic above the capacity of the bus.
    Overload(Overload),
    /// Cyclic feedback at a lower rate than the controller requires.
    TooSeldom {
        /// Smallest rate that the controller requires, Hz.
        needed_hz: u32,
    },
    /// The protocol cannot carry a command within the channel's limits.
    CannotCarry {
        /// Index of the channel.
        channel: u8,
        /// Command that the protocol refuses, with the reason.
        refusal: Refusal,
    },
}

/// Computes the load of every bus with actuators at a control rate. Reports buses whose protocol cannot carry all commands
/// within the channels' limits.
pub fn examine<'a>(
    config: &'a RobotConfig,
    buses: &'a Buses,
    control_hz: u16,
) -> impl Iterator<Item = BusLoad> + 'a {
    loads(config, buses, control_hz).map(|row| {
        let members = config.channels.iter().enumerate().filter(move |(_, c)| c.bus == row.bus);
        let mut cannot_carry = members.filter_map(|(channel, limits)| {
            let refusal = row.kind.can_drive(limits).err()?;
            Some(BusProblem::CannotCarry { channel: channel as u8, refusal })
        });
        BusLoad { problem: row.problem.or_else(|| cannot_carry.next()), ..row }
    })
}

/// Computes the loads of all buses for the controller's self test, without [`BusProblem::CannotCarry`].
///
/// That check takes flash, and its result never changes on a robot.
pub fn loads<'a>(
    config: &'a RobotConfig,
    buses: &'a Buses,
    control_hz: u16,
) -> impl Iterator<Item = BusLoad> + 'a {
    (0..=u8::MAX).filter_map(move |bus| {
        let on_bus = config.channels.iter().filter(|c| c.bus == bus);
        // No configuration has more channels. The limit proves to the compiler that sums of traffic do not overflow.
        let actuators =
            on_bus.fold(0u32, |count, _| count.saturating_add(1)).min(MAX_CHANNELS as u32);
        let kind = buses.get(usize::from(bus)).copied().unwrap_or_default();
        let traffic = kind.protocol.traffic(actuators);
        let (hz, bit_rate) = (f32::from(control_hz), kind.bit_rate as f32);
        let overload = || traffic.check(hz, bit_rate).err().map(BusProblem::Overload);
        (actuators > 0).then(|| BusLoad {
            bus,
            kind,
            actuators,
            traffic,
            load: traffic.load(hz, bit_rate),
            problem: problem(bus, &kind, actuators, control_hz).or_else(overload),
        })
    })
}

/// Finds a problem of a bus other than overload.
fn problem(bus: u8, kind: &Bus, actuators: u32, control_hz: u16) -> Option<BusProblem> {
    let needed_hz = u32::from(control_hz).div_ceil(u32::from(FRESH_TICKS));
    if usize::from(bus) >= MAX_BUSES {
        Some(BusProblem::NoSuchBus)
    } else if kind.protocol.is_serial() && actuators > MAX_ON_LINE as u32 {
        Some(BusProblem::TooMany)
    } else if kind.protocol.feedback_hz().is_some_and(|feedback_hz| feedback_hz < needed_hz) {
        Some(BusProblem::TooSeldom { needed_hz })
    } else {
        None
    }
}
