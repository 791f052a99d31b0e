//! Serial port over USB, of the device class for which every operating system has a driver (CDC 1.2, ACM).
//!
//! This module answers requests at the control endpoint. The board moves packets between the hardware and this module, and
//! bytes between the bulk endpoints and the link.

use heapless::Vec;

/// Packet size of all endpoints except that of notifications, bytes.
pub const PACKET: usize = 64;
/// Number of the notification endpoint. No notification is ever sent.
pub const NOTIFICATIONS: u8 = 1;
/// Packet size of the notification endpoint, bytes.
pub const NOTIFICATION: u8 = 8;
/// Number of the data endpoint, in both directions.
pub const BYTES: u8 = 2;

/// Vendor id of pid.codes, and its product id for tests. Boards for sale require other ids.
const VENDOR_AND_PRODUCT: [u8; 4] = [0x09, 0x12, 0x01, 0x00];

const DEVICE: [u8; 18] = {
    let [v0, v1, p0, p1] = VENDOR_AND_PRODUCT;
    // USB 2.0, class of communication, version 1.0; strings 1 to 3; one configuration.
    [18, 1, 0x00, 0x02, 2, 0, 0, PACKET as u8, v0, v1, p0, p1, 0x00, 0x01, 1, 2, 3, 1]
};

#[rustfmt::skip]
const CONFIGURATION: [u8; 67] = [
    9, 2, 67, 0, 2, 1, 0, 0x80, 50,                       // two interfaces, 100 mA from the bus
    9, 4, 0, 0, 1, 2, 2, 0, 0,                            // control: an abstract modem without commands
    5, 0x24, 0, 0x20, 0x01,                               // CDC 1.2
    5, 0x24, 1, 0, 1,                                     // no calls
    4, 0x24, 2, 2,                                        // line coding and line state
    5, 0x24, 6, 0, 1,                                     // interface 0 controls 1
    7, 5, 0x80 | NOTIFICATIONS, 3, NOTIFICATION, 0, 16,   // interrupt, 16 ms
    9, 4, 1, 0, 2, 0x0A, 0, 0, 0,                         // data
    7, 5, BYTES, 2, PACKET as u8, 0, 0,                   // bulk from the host
    7, 5, 0x80 | BYTES, 2, PACKET as u8, 0, 0,            // bulk to the host
];

/// American English, the only language.
const LANGUAGES: [u8; 4] = [4, 3, 0x09, 0x04];
const NAMES: [&str; 2] = ["Rollwalk", "Rollwalk controller"];

/// Answer to a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Reply {
    /// Send data bytes, then accept the host's handshake.
    Data(Vec<u8, 80>),
    /// Send the handshake.
    Accepted,
    /// Send the handshake, then use the given address.
    Address(u8),
    /// Send the handshake and reset the endpoints. The flag is true if the device is configured.
    Configured(bool),
    /// Send the handshake, and reset the data toggle of the endpoint with the given address to DATA0.
    Restarted(u8),
    /// Receive bytes from the host and ignore them, then send the handshake.
    Receives,
    /// Signal an error.
    Refused,
}

/// USB device.
#[derive(Clone, Debug)]
pub struct UsbSerial {
    serial_number: [u8; 6],
    is_configured: bool,
}

impl UsbSerial {
    /// Creates a device in the reset state. The serial number is that of the chip.
    pub fn new(serial_number: [u8; 6]) -> Self {
        Self { serial_number, is_configured: false }
    }

    /// True if the host has configured the device.
    pub fn is_configured(&self) -> bool {
        self.is_configured
    }

    /// Resets the device after a bus reset.
    pub fn reset(&mut self) {
        self.is_configured = false;
    }

    /// Answers a request at the control endpoint (USB 2.0, 9.3 and 9.4; PSTN 1.2, 6.3).
    pub fn answer(&mut self, request: [u8; 8]) -> Reply {
        let [kind, code, value, selector, index, _, length_low, length_high] = request;
        let length = usize::from(u16::from_le_bytes([length_low, length_high]));
        match (kind, code) {
            // GET_DESCRIPTOR
            (0x80, 6) => self.descriptor(selector, value).map_or(Reply::Refused, |mut bytes| {
                bytes.truncate(length);
                Reply::Data(bytes)
            }),
            // SET_ADDRESS
            (0x00, 5) if value < 128 => Reply::Address(value),
            // GET_CONFIGURATION, SET_CONFIGURATION
            (0x80, 8) => data(&[u8::from(self.is_configured)], length),
            (0x00, 9) if value <= 1 => {
                self.is_configured = value == 1;
                Reply::Configured(self.is_configured)
            }
            // GET_STATUS: powered by the bus, never halted
            (0x80..=0x82, 0) => data(&[0, 0], length),
            // CLEAR_FEATURE, SET_FEATURE: the halt of an endpoint
            (0x02, 1) if value == 0 => Reply::Restarted(index),
            (0x02, 3) if value == 0 => Reply::Accepted,
            // GET_INTERFACE, SET_INTERFACE
            (0x81, 10) => data(&[0], length),
            (0x01, 11) if value == 0 => Reply::Accepted,
            // SET_LINE_CODING, GET_LINE_CODING: 1 Mbaud, 8N1, whatever was set
            (0x21, 0x20) => Reply::Receives,
            (0xA1, 0x21) => data(&[0x40, 0x42, 0x0F, 0x00, 0, 0, 8], length),
            // SET_CONTROL_LINE_STATE, SEND_BREAK
            (0x21, 0x22 | 0x23) => Reply::Accepted,
            _ => Reply::Refused,
        }
    }

    fn descriptor(&self, kind: u8, number: u8) -> Option<Vec<u8, 80>> {
        match (kind, number) {
            (1, 0) => bytes(&DEVICE),
            (2, 0) => bytes(&CONFIGURATION),
            (3, 0) => bytes(&LANGUAGES),
            (3, 1..=2) => text(NAMES.get(usize::from(number).checked_sub(1)?)?.bytes()),
            (3, 3) => text(self.serial_number.iter().flat_map(|&byte| {
                [byte >> 4, byte & 15]
                    .map(|digit| b"0123456789ABCDEF".get(usize::from(digit)).copied().unwrap_or(0))
            })),
            // No other descriptors; in particular none of a faster bus.
            _ => None,
        }
    }
}

fn bytes(all: &[u8]) -> Option<Vec<u8, 80>> {
    let mut copy = Vec::new();
    for &byte in all {
        copy.push(byte).ok()?;
    }
    Some(copy)
}

fn data(all: &[u8], length: usize) -> Reply {
    bytes(all).map_or(Reply::Refused, |mut bytes| {
        bytes.truncate(length);
        Reply::Data(bytes)
    })
}

/// String descriptor: length, kind and UTF-16 text.
fn text(ascii: impl Iterator<Item = u8>) -> Option<Vec<u8, 80>> {
    let mut bytes = Vec::new();
    bytes.push(0).ok()?;
    bytes.push(3).ok()?;
    for byte in ascii {
        bytes.push(byte).ok()?;
        bytes.push(0).ok()?;
    }
    let length = bytes.len() as u8;
    *bytes.first_mut()? = length;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn device() -> UsbSerial {
        UsbSerial::new([0x01, 0x23, 0x45, 0x67, 0x89, 0xAB])
    }

    #[track_caller]
    fn read(device: &mut UsbSerial, request: [u8; 8]) -> Vec<u8, 80> {
        match device.answer(request) {
            Reply::Data(bytes) => bytes,
            other => panic!("{other:?}"),
        }
    }

    /// Enumerates the device in the way that Linux does.
    #[test]
    fn a_host_enumerates_it() {
        let mut device = device();
        // The first 8 bytes, for the size of the packets.
        let first = read(&mut device, [0x80, 6, 0, 1, 0, 0, 8, 0]);
        assert_eq!((first.len(), first[7]), (8, 64));
        assert_eq!(device.answer([0x00, 5, 23, 0, 0, 0, 0, 0]), Reply::Address(23));
        let all = read(&mut device, [0x80, 6, 0, 1, 0, 0, 18, 0]);
        assert_eq!((all.len(), usize::from(all[0])), (18, 18));
        // No descriptor of a faster bus: this one is a full-speed device.
        assert_eq!(device.answer([0x80, 6, 0, 6, 0, 0, 10, 0]), Reply::Refused);
        let head = read(&mut device, [0x80, 6, 0, 2, 0, 0, 9, 0]);
        let total = u16::from_le_bytes([head[2], head[3]]);
        let [low, high] = total.to_le_bytes();
        let whole = read(&mut device, [0x80, 6, 0, 2, 0, 0, low, high]);
        assert_eq!(whole.len(), usize::from(total));
        assert_eq!(read(&mut device, [0x80, 6, 0, 3, 0, 0, 255, 0]), LANGUAGES);
        let serial = read(&mut device, [0x80, 6, 3, 3, 9, 4, 255, 0]);
        let letters = serial[2..].iter().copied().step_by(2);
        assert_eq!(serial.len(), usize::from(serial[0]));
        assert!(letters.eq(b"0123456789AB".iter().copied()));
        assert!(!device.is_configured());
        assert_eq!(device.answer([0x00, 9, 1, 0, 0, 0, 0, 0]), Reply::Configured(true));
        assert_eq!(read(&mut device, [0x80, 8, 0, 0, 0, 0, 1, 0]), [1]);
        // The driver of modems: line coding, line state.
        assert_eq!(device.answer([0x21, 0x20, 0, 0, 0, 0, 7, 0]), Reply::Receives);
        let coding = read(&mut device, [0xA1, 0x21, 0, 0, 0, 0, 7, 0]);
        assert_eq!(coding[..4], 1_000_000_u32.to_le_bytes());
        assert_eq!(device.answer([0x21, 0x22, 3, 0, 0, 0, 0, 0]), Reply::Accepted);
        assert_eq!(device.answer([0x02, 1, 0, 0, 0x82, 0, 0, 0]), Reply::Restarted(0x82));
        device.reset();
        assert!(!device.is_configured());
    }

    /// Lengths of all descriptors in the configuration add up, and each endpoint appears once.
    #[test]
    fn the_configuration_is_a_chain_of_descriptors() {
        let (mut rest, mut endpoints) = (&CONFIGURATION[..], endpoints());
        while let [length, kind, third, ..] = *rest {
            if kind == 5 {
                assert!(endpoints.iter_mut().any(|(address, seen)| {
                    let is_it = *address == third && !*seen;
                    *seen |= is_it;
                    is_it
                }));
            }
            rest = &rest[usize::from(length)..];
        }
        assert!(rest.is_empty() && endpoints.iter().all(|(_, seen)| *seen));
    }

    fn endpoints() -> [(u8, bool); 3] {
        [(0x80 | NOTIFICATIONS, false), (BYTES, false), (0x80 | BYTES, false)]
    }

    proptest! {
        #[test]
        fn no_request_gets_more_than_it_asked_for(request: [u8; 8]) {
            let mut device = device();
            let asked = usize::from(u16::from_le_bytes([request[6], request[7]]));
            match device.answer(request) {
                Reply::Data(bytes) => {
                    prop_assert!(request[0] & 0x80 != 0 && bytes.len() <= asked);
                }
                Reply::Refused => {}
                _ => prop_assert!(request[0] & 0x80 == 0),
            }
        }
    }
}
