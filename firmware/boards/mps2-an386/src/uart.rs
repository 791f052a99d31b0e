//! UART 0 of the board: Arm's CMSDK APB UART, polled.

use core::ptr::{read_volatile, write_volatile};

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CTRL: *mut u32 = 0x4000_4008 as *mut u32;
const BAUDDIV: *mut u32 = 0x4000_4010 as *mut u32;

const STATE_TX_FULL: u32 = 1 << 0;
const STATE_RX_FULL: u32 = 1 << 1;
const CTRL_TX_ENABLE: u32 = 1 << 0;
const CTRL_RX_ENABLE: u32 = 1 << 1;
/// The smallest divisor that the hardware takes: 25 MHz / 16.
const DIVISOR: u32 = 16;

/// The UART. There is one; it is made once, by `main`.
pub struct Uart(());

impl Uart {
    /// Switches it on.
    pub fn new() -> Self {
        // SAFETY: registers of this board, which nothing else uses.
        unsafe {
            write_volatile(BAUDDIV, DIVISOR);
            write_volatile(CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE);
        }
        Self(())
    }

    /// Waits for a byte.
    pub fn read(&mut self) -> u8 {
        // SAFETY: as above; reading DATA takes the byte.
        unsafe {
            while read_volatile(STATE) & STATE_RX_FULL == 0 {}
            read_volatile(DATA) as u8
        }
    }

    /// Waits for room and sends a byte.
    pub fn write(&mut self, byte: u8) {
        // SAFETY: as above.
        unsafe {
            while read_volatile(STATE) & STATE_TX_FULL != 0 {}
            write_volatile(DATA, u32::from(byte));
        }
    }
}
