//! Serial port of the link over USB: the hardware side of [`rollwalk_firmware::hal::usb_serial`] (RP2350 datasheet, 12.7).
//!
//! The main loop polls it in every turn, without interrupts. While the loop is busy, or stands still for the flash, the
//! hardware answers the host with NAK, so no byte is lost.

use crate::link::Port;
use core::ptr::{read_volatile, write_volatile};
use embassy_rp::pac::usb_dpram::regs::EpBufferControl;
use embassy_rp::pac::usb_dpram::vals::EpControlEndpointType;
use embassy_rp::pac::{USB, USB_DPRAM};
use heapless::Vec;
use rollwalk_firmware::hal::usb_serial::{BYTES, NOTIFICATIONS, PACKET, Reply, UsbSerial};

/// Offset of the fixed buffer of endpoint 0 in the USB controller's memory.
const CONTROL: u16 = 0x100;
const NOTIFICATION_BUFFER: u16 = 0x180;
const FROM_HOST: u16 = 0x1C0;
const TO_HOST: u16 = 0x200;

/// Number of processor cycles in which at least two cycles of the USB controller pass. A buffer's description must be written
/// this long before the buffer is released (12.7.3.7.1).
const SETTLE: u32 = 12;

/// Endpoint and direction.
#[derive(Clone, Copy)]
enum Pipe {
    ControlIn,
    ControlOut,
    Notifications,
    FromHost,
    ToHost,
}

/// Progress of an exchange at the control endpoint.
enum Stage {
    /// Waits for a request.
    Idle,
    Sends(Vec<u8, 80>),
    /// Receives bytes to be ignored.
    Receives,
    /// Has sent the handshake. Uses the given address afterwards.
    Handshake(Option<u8>),
}

pub struct Usb {
    device: UsbSerial,
    stage: Stage,
    /// Received packet that is being processed.
    received: Vec<u8, PACKET>,
    /// Number of processed bytes of that packet.
    taken: usize,
    /// True if the latest packet to the host was full.
    sent_full: bool,
}

impl Usb {
    /// Connects to the bus. The serial number is that of the chip.
    pub fn new(serial_number: [u8; 6]) -> Self {
        for place in (0..0x100).step_by(4) {
            write_word(place, 0);
        }
        USB.usb_muxing().write(|w| {
            w.set_to_phy(true);
            w.set_softcon(true);
        });
        // The board does not measure the supply of the cable.
        USB.usb_pwr().write(|w| {
            w.set_vbus_detect(true);
            w.set_vbus_detect_override_en(true);
        });
        // Also connects the transceiver, which a reset disconnects.
        USB.main_ctrl().write(|w| w.set_controller_en(true));
        USB.sie_ctrl().write(|w| w.set_pullup_en(true));
        let device = UsbSerial::new(serial_number);
        Self { device, stage: Stage::Idle, received: Vec::new(), taken: 0, sent_full: false }
    }

    /// Serves the bus. Call it in every turn of the main loop.
    pub fn work(&mut self) {
        let status = USB.sie_status().read();
        // Writing 1 clears these flags.
        if status.bus_reset() {
            USB.sie_status().write(|w| {
                w.set_bus_reset(true);
                w.set_setup_rec(true);
            });
            USB.addr_endp().write(|w| w.set_address(0));
            self.device.reset();
            self.set_in_use(false);
            self.stage = Stage::Idle;
            return;
        }
        if status.setup_rec() {
            let (low, high) = (read_word(0), read_word(4));
            USB.sie_status().write(|w| w.set_setup_rec(true));
            let ([a, b, c, d], [e, f, g, h]) = (low.to_le_bytes(), high.to_le_bytes());
            let reply = self.device.answer([a, b, c, d, e, f, g, h]);
            self.reply(reply);
            return;
        }
        match &mut self.stage {
            Stage::Idle => {}
            Stage::Sends(rest) => {
                if Pipe::ControlIn.is_busy() {
                    return;
                }
                if rest.is_empty() {
                    // Handshake of the host: an empty packet, DATA1.
                    Pipe::ControlOut.restart(true);
                    Pipe::ControlOut.release(0, false);
                    self.stage = Stage::Idle;
                } else {
                    send_part(Pipe::ControlIn, rest);
                }
            }
            Stage::Receives => {
                if !Pipe::ControlOut.is_busy() {
                    self.shake_hands(None);
                }
            }
            Stage::Handshake(address) => {
                if !Pipe::ControlIn.is_busy() {
                    if let Some(address) = *address {
                        USB.addr_endp().write(|w| w.set_address(address));
                    }
                    self.stage = Stage::Idle;
                }
            }
        }
    }

    fn reply(&mut self, reply: Reply) {
        // The first packet after a request is DATA1; `release` flips this.
        Pipe::ControlIn.restart(true);
        Pipe::ControlOut.restart(true);
        match reply {
            Reply::Data(mut bytes) => {
                send_part(Pipe::ControlIn, &mut bytes);
                self.stage = Stage::Sends(bytes);
            }
            Reply::Accepted => self.shake_hands(None),
            Reply::Address(address) => self.shake_hands(Some(address)),
            Reply::Configured(in_use) => {
                self.set_in_use(in_use);
                self.shake_hands(None);
            }
            Reply::Restarted(endpoint) => {
                match endpoint {
                    BYTES => Pipe::FromHost.listen(),
                    _ if endpoint == 0x80 | BYTES => Pipe::ToHost.restart(false),
                    _ => {}
                }
                self.shake_hands(None);
            }
            Reply::Receives => {
                Pipe::ControlOut.release(PACKET as u16, false);
                self.stage = Stage::Receives;
            }
            Reply::Refused => {
                USB.ep_stall_arm().write(|w| {
                    w.set_ep0_in(true);
                    w.set_ep0_out(true);
                });
                Pipe::ControlIn.set(|w| w.set_stall(true));
                Pipe::ControlOut.set(|w| w.set_stall(true));
                self.stage = Stage::Idle;
            }
        }
    }

    /// Sends the handshake of a request: an empty packet, always DATA1.
    fn shake_hands(&mut self, address: Option<u8>) {
        Pipe::ControlIn.restart(true);
        Pipe::ControlIn.release(0, true);
        self.stage = Stage::Handshake(address);
    }

    /// Enables or disables the endpoints of data and notifications.
    fn set_in_use(&mut self, in_use: bool) {
        let control = |buffer, kind| {
            let mut control = embassy_rp::pac::usb_dpram::regs::EpControl(0);
            control.set_enable(in_use);
            control.set_buffer_address(buffer);
            control.set_endpoint_type(kind);
            control
        };
        // The registers begin with endpoint 1.
        const { assert!(NOTIFICATIONS == 1 && BYTES == 2) };
        USB_DPRAM
            .ep_in_control(0)
            .write_value(control(NOTIFICATION_BUFFER, EpControlEndpointType::INTERRUPT));
        USB_DPRAM.ep_out_control(1).write_value(control(FROM_HOST, EpControlEndpointType::BULK));
        USB_DPRAM.ep_in_control(1).write_value(control(TO_HOST, EpControlEndpointType::BULK));
        Pipe::Notifications.restart(false);
        Pipe::ToHost.restart(false);
        self.received.clear();
        (self.taken, self.sent_full) = (0, false);
        if in_use {
            Pipe::FromHost.listen();
        } else {
            Pipe::FromHost.set(|_| {});
        }
    }
}

impl Port for Usb {
    fn receive(&mut self) -> Option<u8> {
        if self.taken >= self.received.len() {
            if !self.device.is_configured() || Pipe::FromHost.is_busy() {
                return None;
            }
            let length = Pipe::FromHost.state().length(0).min(PACKET as u16);
            self.received.clear();
            for place in FROM_HOST..FROM_HOST + length {
                let _ = self.received.push(read_byte(place));
            }
            self.taken = 0;
            Pipe::FromHost.release(PACKET as u16, false);
        }
        let byte = self.received.get(self.taken).copied()?;
        self.taken += 1;
        Some(byte)
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        // An empty packet ends a transfer whose last packet was full.
        let has_end = bytes.is_empty() && self.sent_full;
        if !self.device.is_configured() || Pipe::ToHost.is_busy() || bytes.is_empty() && !has_end {
            return 0;
        }
        let mut length = 0;
        for (&byte, place) in bytes.iter().zip(TO_HOST..TO_HOST + PACKET as u16) {
            write_byte(place, byte);
            length += 1;
        }
        self.sent_full = usize::from(length) == PACKET;
        Pipe::ToHost.release(length, true);
        usize::from(length)
    }
}

/// Sends the bytes that fit a packet, and keeps the rest.
fn send_part(pipe: Pipe, bytes: &mut Vec<u8, 80>) {
    let mut length = 0;
    for (&byte, place) in bytes.iter().zip(CONTROL..CONTROL + PACKET as u16) {
        write_byte(place, byte);
        length += 1;
    }
    let mut rest = Vec::new();
    for &byte in bytes.iter().skip(usize::from(length)) {
        let _ = rest.push(byte);
    }
    *bytes = rest;
    pipe.release(length, true);
}

impl Pipe {
    fn state(self) -> EpBufferControl {
        match self {
            Self::ControlIn => USB_DPRAM.ep_in_buffer_control(0).read(),
            Self::ControlOut => USB_DPRAM.ep_out_buffer_control(0).read(),
            Self::Notifications => USB_DPRAM.ep_in_buffer_control(1).read(),
            Self::FromHost => USB_DPRAM.ep_out_buffer_control(2).read(),
            Self::ToHost => USB_DPRAM.ep_in_buffer_control(2).read(),
        }
    }

    /// Overwrites the description of the buffer.
    fn set(self, describe: impl FnOnce(&mut EpBufferControl)) {
        let mut state = EpBufferControl(0);
        describe(&mut state);
        match self {
            Self::ControlIn => USB_DPRAM.ep_in_buffer_control(0).write_value(state),
            Self::ControlOut => USB_DPRAM.ep_out_buffer_control(0).write_value(state),
            Self::Notifications => USB_DPRAM.ep_in_buffer_control(1).write_value(state),
            Self::FromHost => USB_DPRAM.ep_out_buffer_control(2).write_value(state),
            Self::ToHost => USB_DPRAM.ep_in_buffer_control(2).write_value(state),
        }
    }

    /// True while the buffer belongs to the USB controller.
    fn is_busy(self) -> bool {
        self.state().available(0)
    }

    /// Sets the data toggle of the next packet to DATA1 or DATA0.
    fn restart(self, data1: bool) {
        self.set(|w| w.set_pid(0, !data1));
    }

    /// Waits for a packet from the host, DATA0.
    fn listen(self) {
        self.restart(false);
        self.release(PACKET as u16, false);
    }

    /// Releases the buffer to the USB controller, which sends its packet, or receives a packet of at most `length` bytes.
    fn release(self, length: u16, sends: bool) {
        let data1 = !self.state().pid(0);
        let describe = |w: &mut EpBufferControl| {
            w.set_pid(0, data1);
            w.set_length(0, length);
            w.set_full(0, sends);
        };
        self.set(describe);
        cortex_m::asm::delay(SETTLE);
        self.set(|w| {
            describe(w);
            w.set_available(0, true);
        });
    }
}

// SAFETY of all four functions: the constants above place the accesses within the controller's memory of 4 KiB, which allows
// bytes and words.

fn read_byte(place: u16) -> u8 {
    unsafe { read_volatile(USB_DPRAM.as_ptr().cast::<u8>().wrapping_add(place.into())) }
}

fn write_byte(place: u16, byte: u8) {
    unsafe { write_volatile(USB_DPRAM.as_ptr().cast::<u8>().wrapping_add(place.into()), byte) }
}

fn read_word(place: u16) -> u32 {
    unsafe { read_volatile(USB_DPRAM.as_ptr().cast::<u8>().wrapping_add(place.into()).cast()) }
}

fn write_word(place: u16, word: u32) {
    unsafe {
        write_volatile(USB_DPRAM.as_ptr().cast::<u8>().wrapping_add(place.into()).cast(), word)
    }
}
