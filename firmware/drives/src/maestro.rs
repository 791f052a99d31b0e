//! Hobby servo on a channel of a Pololu Maestro. Document: "Pololu Maestro Servo Controller User's Guide", sections 5.c to 5.e.
//!
//! The servo measures nothing. It follows its pulses with the gains of the robot file.

use crate::{Answer, DriveCommand, Electronics, Law, Shaft};
use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_protocol::actuators::maestro::Maestro;
use rollwalk_protocol::config::Channel;

/// Servo with its channel of the board.
#[derive(Clone, Debug)]
pub struct Drive {
    board: Maestro,
    channel: u8,
    gains: (f64, f64),
    /// Target of the pulses, rad; `None` without pulses.
    target_rad: Option<f64>,
}

impl Drive {
    /// Creates the servo of a channel.
    pub fn new(board: Maestro, _: &Bus, channel: &Channel) -> Self {
        let gains = (channel.kp_nm_rad.into(), channel.kd_nm_s_rad.into());
        Self { board, channel: channel.id, gains, target_rad: None }
    }

    /// Command and data of a packet, without header and CRC.
    fn unwrapped<'b>(&self, bytes: &'b [u8]) -> Option<(u8, &'b [u8])> {
        let bytes = match self.board.crc {
            true => bytes.split_last().filter(|(crc, rest)| **crc == crc7(rest))?.1,
            false => bytes,
        };
        match (self.board.device, bytes) {
            (Some(device), [0xAA, number, command, data @ ..]) => {
                (device == *number).then_some((command | 0x80, data))
            }
            (None, [command, data @ ..]) => Some((*command, data)),
            _ => None,
        }
    }

    fn aim(&mut self, quarters_us: u16) -> Vec<DriveCommand> {
        if quarters_us == 0 {
            self.target_rad = None;
            return vec![DriveCommand::Disable];
        }
        let pulse = &self.board.pulse;
        let us = f64::from(quarters_us) / 4.0 - f64::from(pulse.centre_us);
        let value = us / f64::from(pulse.us_per_rad);
        let setpoint = self.towards(value).setpoint(false);
        match self.target_rad.replace(value) {
            None => vec![DriveCommand::Enable, setpoint],
            Some(_) => vec![setpoint],
        }
    }

    fn towards(&self, position_rad: f64) -> Law {
        let (kp_nm_rad, kd_nm_s_rad) = self.gains;
        let torque_limit_nm = f64::INFINITY;
        Law { position_rad, kp_nm_rad, kd_nm_s_rad, torque_limit_nm, ..Law::default() }
    }
}

impl Electronics for Drive {
    /// Processes a packet. The board answers queries, so all its servos return the same answer.
    fn on_packet(
        &mut self,
        _: u64,
        bytes: &[u8],
        _: &Shaft,
    ) -> (Vec<DriveCommand>, Option<Answer>) {
        let Some((command, data)) = self.unwrapped(bytes) else { return (vec![], None) };
        let target = match (command, data) {
            (0xA1, []) => {
                let answer = Answer { bytes: vec![0, 0], turn: 0, delay_us: 0, is_part: false };
                return (vec![DriveCommand::Query], Some(answer));
            }
            (0x84, [channel, low, high]) if *channel == self.channel => quarters(*low, *high),
            (0x9F, [_, first, targets @ ..]) => {
                let mine = self.channel.checked_sub(*first).map(usize::from);
                let Some([low, high]) = mine.and_then(|n| targets.chunks_exact(2).nth(n)) else {
                    return (vec![], None);
                };
                quarters(*low, *high)
            }
            (0x84, _) => return (vec![], None),
            _ => return (vec![DriveCommand::Odd], None),
        };
        (self.aim(target), None)
    }

    /// Removes the next command. The highest bit is set in its first byte, and clear in its data.
    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        let is_numbered = self.board.device.is_some();
        let begins = |byte: &u8| if is_numbered { *byte == 0xAA } else { byte & 0x80 != 0 };
        line.drain(..line.iter().position(begins).unwrap_or(line.len()));
        let (head, command, data) = match line[..] {
            [_, _, command, ref data @ ..] if is_numbered => (3, command | 0x80, data),
            [command, ref data @ ..] if !is_numbered => (1, command, data),
            _ => return None,
        };
        let count = match command {
            0x84 | 0x87 | 0x89 => 3,
            0x9F => 2 + 2 * usize::from(*data.first()?),
            _ => 0,
        };
        let whole = head + count + usize::from(self.board.crc);
        (line.len() >= whole).then(|| line.drain(..whole).collect())
    }

    fn law(&self, _: &Shaft) -> Option<Law> {
        self.target_rad.map(|target_rad| self.towards(target_rad))
    }
}

fn quarters(low: u8, high: u8) -> u16 {
    u16::from(low) | u16::from(high) << 7
}

/// CRC of the guide's appendix: polynomial 0x91, least significant bit first.
pub(crate) fn crc7(bytes: &[u8]) -> u8 {
    let mut crc = 0u8;
    for byte in bytes {
        crc ^= byte;
        for _ in 0..8 {
            if crc & 1 == 1 {
                crc ^= 0x91;
            }
            crc >>= 1;
        }
    }
    crc
}
