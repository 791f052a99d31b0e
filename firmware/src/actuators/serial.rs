//! Serial lines: one packet addresses all actuators of a line, and one actuator answers at a time.
//!
//! In a control period a line carries switches, then setpoints, then one question; then the controller
//! is silent until the period is over, for the answers. A stop does not wait for them. It may collide
//! with one: it is repeated until it is confirmed.

use heapless::Vec;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::serial::Answer;
use rollwalk_protocol::actuators::{Command, Decoded, Order, Packet};
use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};

use super::actuator::Actuator;
use super::line::{About, Begun, Line, bit, channels, order};
use super::orders::Errand;
use super::{Actuators, members};

impl Line {
    /// The transmission to continue or to begin, with all actuators that it addresses.
    fn due_together(&self, list: &[Actuator]) -> Option<Begun> {
        if self.begun.is_some() {
            return self.begun;
        }
        let all = |wanted: &dyn Fn(&Actuator) -> bool, about| {
            let those = channels(self.members()).filter(|&i| list.get(i).is_some_and(wanted));
            let channels = those.fold(0, |bits, i| bits | bit(i));
            (channels != 0).then_some(Begun { about, channels, left: 0 })
        };
        let errand = |errand| all(&|a| a.todo.has(errand), About::Errand(errand));
        let setpoints = |joints: bool| {
            let wanted = move |a: &Actuator| {
                a.setpoint.is_some_and(|s| matches!(s, Command::Wheel(_)) != joints)
            };
            all(&wanted, About::Setpoint)
        };
        errand(Errand::Disable)
            .or_else(|| errand(Errand::ClearFaults))
            .or_else(|| errand(Errand::Limits))
            .or_else(|| errand(Errand::Gains))
            .or_else(|| errand(Errand::Enable))
            .or_else(|| setpoints(true))
            .or_else(|| setpoints(false))
            .or_else(|| errand(Errand::Query))
    }
}

impl Actuators {
    /// The next packet for a serial line, once the one before has gone.
    pub fn poll_serial(&mut self, config: &RobotConfig, bus: u8) -> Option<Packet> {
        let line = self.lines.get(usize::from(bus))?;
        if line.listening || !line.bus.protocol.is_serial() {
            return None;
        }
        // It is our turn to talk: what has begun to come in does not go on.
        self.take_answers(config, bus, true);
        // Every turn ends an order, or leaves an actuator out of one, if it does not return.
        loop {
            let line = self.lines.get_mut(usize::from(bus))?;
            let begun = line.due_together(&self.list)?;
            let mut orders = Vec::<Order, MAX_CHANNELS>::new();
            let mut told = 0;
            for channel in channels(begun.channels) {
                match order(&self.list, config, &line.bus, &line.can, begun.about, channel) {
                    Some(order) if orders.push(order).is_ok() => told |= bit(channel),
                    _ => {}
                }
            }
            let question = begun.about == About::Errand(Errand::Query);
            if question && line.bus.protocol.adapter_answers() {
                orders.truncate(1);
            }
            match nth(&line.bus.protocol, &orders, begun.left) {
                Ok((packet, packets)) => {
                    line.left(&mut self.list, begun, packets);
                    if packet.is_some() {
                        line.listening = question;
                        return packet;
                    }
                }
                // Left out; the others are told.
                Err(refused) => {
                    let channel = channels(told).nth(refused).map_or(begun.channels, bit);
                    line.begun = None;
                    line.left(&mut self.list, Begun { channels: channel, ..begun }, 0);
                }
            }
        }
    }

    /// Takes bytes of a serial line as they come.
    pub fn receive_serial(&mut self, config: &RobotConfig, bus: u8, bytes: &[u8]) {
        for &byte in bytes {
            let Some(line) = self.lines.get_mut(usize::from(bus)) else { return };
            line.bus.protocol.receive(&mut line.received, byte, line.listening);
            self.take_answers(config, bus, false);
        }
    }

    fn take_answers(&mut self, config: &RobotConfig, bus: u8, is_silent: bool) {
        while let Some(line) = self.lines.get_mut(usize::from(bus))
            && let Some(answer) = line.bus.protocol.take(&mut line.received, is_silent)
        {
            match answer {
                Answer::Actuator(id, feedback) => {
                    self.hear(config, bus, id, &Decoded::Partial(feedback));
                }
                Answer::Adapter(feedback) => {
                    members(&mut self.list, line).for_each(|actuator| actuator.hear_of(&feedback));
                }
            }
        }
    }
}

/// Packet `n` of orders, and how many there are; or which order the protocol refuses.
fn nth(protocol: &Protocol, orders: &[Order], n: u8) -> Result<(Option<Packet>, u8), usize> {
    let (mut packet, mut count) = (None, 0u8);
    let told = protocol.encode(orders, &mut |sent| {
        if count == n {
            packet = Some(sent);
        }
        count = count.saturating_add(1);
    });
    told.map(|()| (packet, count)).map_err(|(refused, _)| refused)
}
