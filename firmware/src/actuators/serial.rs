//! Serial lines: one packet addresses all actuators of a line, and one actuator answers at a time.
//!
//! In a control period a line carries switches, then setpoints, then one question; then the controller
//! is silent until the period is over, for the answers. A stop does not wait for them. It may collide
//! with one: it is repeated until it is confirmed.

use heapless::Vec;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::dynamixel::packet::Message;
use rollwalk_protocol::actuators::{ActuatorProtocol, Command, Order, Packet};
use rollwalk_protocol::config::{MAX_CHANNELS, RobotConfig};

use super::Actuators;
use super::actuator::Actuator;
use super::line::{About, Begun, Line, bit, channels, order};
use super::orders::Errand;

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
        if self.lines.get(usize::from(bus))?.listening {
            return None;
        }
        // It is our turn to talk: what has begun to come in does not go on.
        self.take_messages(config, bus, |line| line.deframer.take_after_silence());
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
            let packet = match &line.bus.protocol {
                Protocol::Dynamixel(p) => nth(p, &orders, begun.left),
                Protocol::Maestro(p) => {
                    // The board answers, for all of them.
                    if question {
                        orders.truncate(1);
                    }
                    nth(p, &orders, begun.left)
                }
                _ => return None,
            };
            match packet {
                Ok((packet, packets)) => {
                    line.left(&mut self.list, begun, packets);
                    if packet.is_some() {
                        (line.listening, line.half) = (question, None);
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
        let Some(protocol) = self.lines.get(usize::from(bus)).map(|line| line.bus.protocol) else {
            return;
        };
        for &byte in bytes {
            let Some(line) = self.lines.get_mut(usize::from(bus)) else { return };
            match protocol {
                Protocol::Dynamixel(_) => {
                    line.deframer.push(byte);
                    self.take_messages(config, bus, |line| line.deframer.take());
                }
                Protocol::Maestro(maestro) => match line.half.take() {
                    None if line.listening => line.half = Some(byte),
                    None => {}
                    Some(first) => {
                        let told = maestro.decode(&[first, byte]).map(|(_, news)| news);
                        let members = line.members();
                        for channel in channels(members) {
                            if let (Some(actuator), Some(news)) = (self.list.get_mut(channel), told)
                            {
                                actuator.hear_of(&news);
                            }
                        }
                    }
                },
                _ => return,
            }
        }
    }

    fn take_messages(
        &mut self,
        config: &RobotConfig,
        bus: u8,
        next: impl Fn(&mut Line) -> Option<Message>,
    ) {
        while let Some(line) = self.lines.get_mut(usize::from(bus))
            && let Protocol::Dynamixel(dynamixels) = line.bus.protocol
            && let Some(message) = next(line)
        {
            self.hear(config, bus, dynamixels.decode(&message));
        }
    }
}

/// Packet `n` of orders, and how many there are; or which order the protocol refuses.
fn nth<P: ActuatorProtocol<Sent = Packet>>(
    protocol: &P,
    orders: &[Order],
    n: u8,
) -> Result<(Option<Packet>, u8), usize> {
    let (mut packet, mut count) = (None, 0u8);
    let told = protocol.encode(orders, &mut |sent| {
        if count == n {
            packet = Some(sent);
        }
        count = count.saturating_add(1);
    });
    told.map(|()| (packet, count)).map_err(|(refused, _)| refused)
}
