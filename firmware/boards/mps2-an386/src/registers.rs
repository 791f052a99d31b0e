//! Registers of UART 0, Arm's CMSDK APB UART, and its receive interrupt.

use cortex_m::interrupt::InterruptNumber;

pub const DATA: *mut u32 = 0x4000_4000 as *mut u32;
pub const STATE: *mut u32 = 0x4000_4004 as *mut u32;
pub const CTRL: *mut u32 = 0x4000_4008 as *mut u32;
pub const INTERRUPT: *mut u32 = 0x4000_400C as *mut u32;
pub const BAUDDIV: *mut u32 = 0x4000_4010 as *mut u32;

pub const STATE_TX_FULL: u32 = 1 << 0;
pub const STATE_RX_FULL: u32 = 1 << 1;
pub const CTRL_TX_ENABLE: u32 = 1 << 0;
pub const CTRL_RX_ENABLE: u32 = 1 << 1;
pub const CTRL_RX_INTERRUPT: u32 = 1 << 3;
pub const INTERRUPT_RX: u32 = 1 << 1;

/// Smallest divisor that the hardware accepts, for 25 MHz / 16.
pub const DIVISOR: u32 = 16;

#[derive(Clone, Copy)]
pub struct ReceiveInterrupt;

// SAFETY: the number in the board's interrupt table.
unsafe impl InterruptNumber for ReceiveInterrupt {
    fn number(self) -> u16 {
        0
    }
}
