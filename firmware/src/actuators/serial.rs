//! Serial lines: a packet addresses all actuators of a line, and one actuator answers at a time.
//!
//! In a control period the controller sends torque commands, then set-points, then one query. The query is for all poses, or now
//! and then for temperature and voltage of one servo. The controller then stays silent until the end of the period to receive the
//! answers. A stop is sent at once and may collide with an answer, so it is repeated until confirmed.

use heapless::Vec;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::serial::Answer;
use rollwalk_protocol::actuators::{ActuatorCommand, Command, Decoded, Packet};
use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};

use super::actuator::Actuator;
use super::driver::{BusDriver, Content, Transmission, channels, order};
use super::orders::DriveRequest;
use super::{Actuators, members};
use crate::channel_bits::bit;

impl BusDriver {
    /// Returns the transmission to continue or to begin, for all actuators that have the most urgent command pending.
    fn due_together(&self, list: &[Actuator]) -> Option<Transmission> {
        if self.transmission.is_some() {
            return self.transmission;
        }
        let all = |wanted: &dyn Fn(&Actuator) -> bool, content| {
            let those = channels(self.members()).filter(|&i| list.get(i).is_some_and(wanted));
            let channels = those.fold(0, |bits, i| bits | bit(i));
            (channels != 0).then_some(Transmission { content, channels, sent: 0 })
        };
        let request = |request| all(&|a| a.pending.has(request), Content::DriveRequest(request));
        let setpoints = |joints: bool| {
            let wanted = move |a: &Actuator| {
                a.setpoint.is_some_and(|s| matches!(s, Command::Wheel(_)) != joints)
            };
            all(&wanted, Content::Setpoint)
        };
        request(DriveRequest::Disable)
            .or_else(|| request(DriveRequest::ClearFaults))
            .or_else(|| request(DriveRequest::Limits))
            .or_else(|| request(DriveRequest::Gains))
            .or_else(|| request(DriveRequest::Enable))
            .or_else(|| setpoints(true))
            .or_else(|| setpoints(false))
            .or_else(|| self.due_reading())
            .or_else(|| request(DriveRequest::Query))
    }
}

impl Actuators {
    /// Returns the next packet for a serial line. Call it after the previous packet has been sent.
    pub fn poll_serial(&mut self, config: &RobotConfig, bus: u8) -> Option<Packet> {
        let driver = self.drivers.get(usize::from(bus))?;
        if driver.listening || !driver.bus.protocol.is_serial() {
            return None;
        }
        // The controller sends next, so a partly received answer ends here.
        self.take_answers(config, bus, true);
        // Every iteration completes an order, leaves an actuator out of an order, or returns.
        loop {
            let driver = self.drivers.get_mut(usize::from(bus))?;
            let transmission = driver.due_together(&self.list)?;
            let mut orders = Vec::<ActuatorCommand, MAX_CHANNELS>::new();
            let mut ordered = 0;
            for channel in channels(transmission.channels) {
                match order(
                    &self.list,
                    config,
                    &driver.bus,
                    &driver.can,
                    transmission.content,
                    channel,
                ) {
                    Some(order) if orders.push(order).is_ok() => ordered |= bit(channel),
                    _ => {}
                }
            }
            let question = transmission.content == Content::DriveRequest(DriveRequest::Query);
            let reading =
                transmission.content == Content::DriveRequest(DriveRequest::QueryReadings);
            if question && driver.bus.protocol.adapter_answers() {
                orders.truncate(1);
            }
            match nth(&driver.bus.protocol, &orders, transmission.sent) {
                Ok((packet, packets)) => {
                    driver.frame_sent(&mut self.list, transmission, packets);
                    if packet.is_some() {
                        driver.listening = question || reading;
                        if question {
                            members(&mut self.list, driver).for_each(Actuator::record_query);
                        }
                        return packet;
                    }
                }
                // This actuator is left out; the others get their command.
                Err(refused) => {
                    let channel = channels(ordered).nth(refused).map_or(transmission.channels, bit);
                    driver.transmission = None;
                    driver.frame_sent(
                        &mut self.list,
                        Transmission { channels: channel, ..transmission },
                        0,
                    );
                }
            }
        }
    }

    /// Accepts bytes of a serial line as they arrive.
    pub fn receive_serial(&mut self, config: &RobotConfig, bus: u8, bytes: &[u8]) {
        for &byte in bytes {
            let Some(driver) = self.drivers.get_mut(usize::from(bus)) else { return };
            driver.bus.protocol.receive(&mut driver.received, byte, driver.listening);
            self.take_answers(config, bus, false);
        }
    }

    fn take_answers(&mut self, config: &RobotConfig, bus: u8, is_silent: bool) {
        while let Some(driver) = self.drivers.get_mut(usize::from(bus))
            && let Some(answer) = driver.bus.protocol.take(&mut driver.received, is_silent)
        {
            match answer {
                Answer::Actuator(id, feedback) => {
                    self.on_decoded(config, bus, id, &Decoded::Partial(feedback));
                }
                Answer::Adapter(feedback) => {
                    members(&mut self.list, driver)
                        .for_each(|actuator| actuator.on_adapter_answer(&feedback));
                }
            }
        }
    }
}

/// Returns packet `n` of commands, and their number of packets.
///
/// # Errors
///
/// Returns the index of the command that the protocol refuses.
fn nth(
    protocol: &Protocol,
    orders: &[ActuatorCommand],
    n: u8,
) -> Result<(Option<Packet>, u8), usize> {
    let (mut packet, mut count) = (None, 0u8);
    let result = protocol.encode(orders, &mut |sent| {
        if count == n {
            packet = Some(sent);
        }
        count = count.saturating_add(1);
    });
    result.map(|()| (packet, count)).map_err(|(refused, _)| refused)
}
