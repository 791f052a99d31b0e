//! Assignment of a robot's buses to a board's ports.
//!
//! CAN buses take the board's CAN ports, and serial lines its serial ports, in ascending order of bus number. Boards use this
//! module, and so does the tool that prints a robot's wiring.

use crate::bus::{Bus, Buses, MAX_BUSES};
use heapless::Vec;
use rollwalk_protocol::config::RobotConfig;

/// Kind of a port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transport {
    /// CAN.
    Can,
    /// A serial line for servos.
    Serial,
}

/// Buses of one kind that have motors on them, with their bus numbers. The first is at the board's first port, and so on.
pub fn assigned(
    config: &RobotConfig,
    buses: &Buses,
    transport: Transport,
) -> Vec<(u8, Bus), MAX_BUSES> {
    let mut assigned = Vec::new();
    for number in 0..MAX_BUSES as u8 {
        let bus = buses.get(usize::from(number)).copied().unwrap_or_default();
        let is_used = config.channels.iter().any(|channel| channel.bus == number);
        if is_used && bus.protocol.is_serial() == (transport == Transport::Serial) {
            // Buses beyond the capacity are dropped.
            let _ = assigned.push((number, bus));
        }
    }
    assigned
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::actuators::bus::Protocol;
    use rollwalk_protocol::config::{Channel, ChannelKind};

    #[test]
    fn buses_take_ports_of_their_kind_in_order() {
        let serial = Protocol::examples().find(Protocol::is_serial).unwrap();
        let serial = Bus { protocol: serial, ..Bus::default() };
        let on_bus = |bus| Channel {
            kind: ChannelKind::JointPosition,
            min: -1.0,
            max: 1.0,
            max_rate: 1.0,
            max_torque_nm: 1.0,
            kp_nm_rad: 1.0,
            kd_nm_s_rad: 1.0,
            bus,
            id: 1,
        };
        let config =
            RobotConfig { robot: 0, channels: [3, 0, 1, 0].into_iter().map(on_bus).collect() };
        // Bus 2 has no motors. Bus 3 is not in the table, so it is CAN.
        let buses = Buses::from_slice(&[serial, Bus::default(), serial]).unwrap();
        let can = Bus::default();
        assert_eq!(assigned(&config, &buses, Transport::Can), [(1, can), (3, can)]);
        assert_eq!(assigned(&config, &buses, Transport::Serial), [(0, serial)]);
        let all = [(0, can), (1, can), (3, can)];
        assert_eq!(assigned(&config, &Buses::new(), Transport::Can), all);
    }
}
