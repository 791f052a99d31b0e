//! Servos on serial lines, as [`crate::drives`].

use std::f32::consts::{PI, TAU};

use rollwalk_protocol::actuators::dynamixel::Dynamixels;
use rollwalk_protocol::actuators::dynamixel::packet::{STATUS, packet};
use rollwalk_protocol::actuators::maestro::Maestro;

use crate::drives::{Motor, Sent};

/// A Dynamixel's control table, as far as it matters here.
#[derive(Clone, Debug)]
pub struct DynamixelServo {
    model: Dynamixels,
    goal_rad: f32,
    goal_rad_s: f32,
    watchdog_20ms: u8,
    goal_current: i16,
}

impl DynamixelServo {
    pub fn new(model: Dynamixels) -> Self {
        // A goal somewhere else, from before.
        Self { model, goal_rad: 1.2, goal_rad_s: 5.0, watchdog_20ms: 0, goal_current: 500 }
    }

    /// What it does with a packet of the line, and the bytes that it answers.
    pub fn on_packet(&mut self, motor: &mut Motor, bytes: &[u8]) -> Vec<u8> {
        assert_eq!(bytes[..5], [0xFF, 0xFF, 0xFD, 0, 0xFE], "to all");
        let p = &bytes[8..bytes.len() - 2];
        let address = u16::from_le_bytes([p[0], p[1]]);
        let count = usize::from(u16::from_le_bytes([p[2], p[3]]));
        let id = motor.channel.id;
        match bytes[7] {
            0x82 => {
                assert_eq!((address, count), (126, 10));
                if !p[4..].contains(&id) {
                    return vec![];
                }
                motor.log.push(Sent::Query);
                let (q, v) = motor.measured();
                let mut data = vec![0, 0, 0];
                data.extend(((v / (0.229 * TAU / 60.0)).round() as i32).to_le_bytes());
                data.extend(((q / TAU * 4096.0).round() as i32 + 2048).to_le_bytes());
                packet(id, STATUS, &data).unwrap().to_vec()
            }
            0x83 => {
                if let Some(mine) = p[4..].chunks(1 + count).find(|chunk| chunk[0] == id) {
                    self.write(motor, address, &mine[1..]);
                }
                vec![]
            }
            other => panic!("instruction {other:#x}"),
        }
    }

    fn write(&mut self, motor: &mut Motor, address: u16, data: &[u8]) {
        let int = || i32::from_le_bytes(data.try_into().expect("four bytes"));
        match address {
            64 => {
                motor.log.push(if data[0] == 1 { Sent::Enable } else { Sent::Disable });
                motor.enabled = data[0] == 1;
                if motor.enabled && motor.inertia_kg_m2 > 0.0 {
                    assert_eq!(self.goal_current, 0, "enabled with a torque");
                } else if motor.enabled {
                    self.follow(motor);
                    motor.log.pop();
                }
            }
            98 => {
                self.watchdog_20ms = data[0];
                assert!(data[0] == 0 || (motor.enabled && data[0] == self.model.watchdog_20ms));
            }
            102 if motor.inertia_kg_m2 > 0.0 => {
                let steps = i16::from_le_bytes([data[0], data[1]]);
                // 1.66 N·m/A.
                motor.push(f32::from(steps) * 2.69e-3 * 7.3 / 4.4);
                self.goal_current = steps;
            }
            102 | 112 => motor.log.push(Sent::Limits),
            104 => {
                self.goal_rad_s = int() as f32 * 0.229 * TAU / 60.0;
                self.follow(motor);
            }
            116 => {
                self.goal_rad = (int() - 2048) as f32 / 4096.0 * TAU;
                self.follow(motor);
            }
            other => panic!("address {other} is written"),
        }
    }

    fn follow(&self, motor: &mut Motor) {
        motor.follow(if motor.is_wheel() { self.goal_rad_s } else { self.goal_rad }, 1.0, 1.0);
    }
}

/// A hobby servo on a channel of a Maestro.
#[derive(Clone, Debug)]
pub struct MaestroServo {
    model: Maestro,
}

impl MaestroServo {
    pub fn new(model: Maestro) -> Self {
        Self { model }
    }

    /// What it does with a packet of the line, and what the board answers.
    pub fn on_packet(&mut self, motor: &mut Motor, bytes: &[u8]) -> Option<[u8; 2]> {
        assert!(self.model.device.is_none() && !self.model.crc, "the compact protocol");
        let quarters = |low: u8, high: u8| u16::from(low) | u16::from(high) << 7;
        let mine = match *bytes {
            [0x84, channel, low, high] => {
                (channel == motor.channel.id).then(|| quarters(low, high))
            }
            [0x9F, count, first, ref targets @ ..] => {
                assert_eq!(targets.len(), 2 * usize::from(count));
                let n = motor.channel.id.checked_sub(first).map(usize::from);
                n.and_then(|n| targets.chunks(2).nth(n)).map(|two| quarters(two[0], two[1]))
            }
            [0xA1] => {
                motor.log.push(Sent::Query);
                return Some([0, 0]);
            }
            _ => panic!("{bytes:x?}"),
        };
        match mine {
            None => {}
            Some(0) => {
                motor.log.push(Sent::Disable);
                motor.enabled = false;
            }
            Some(quarters_us) => {
                if !motor.enabled {
                    motor.log.push(Sent::Enable);
                }
                motor.enabled = true;
                let rad = (f32::from(quarters_us) / 4.0 - 1500.0) * (PI / 2.0) / 1000.0;
                motor.follow(rad, 1.0, 1.0);
            }
        }
        None
    }
}
