//! UART 0 of the board: Arm's CMSDK APB UART. The processor sleeps until a byte is there; an emulator
//! that need not run a waiting loop is several times faster.

use core::ptr::{read_volatile, write_volatile};
use cortex_m::interrupt::InterruptNumber;
use cortex_m::peripheral::NVIC;

const DATA: *mut u32 = 0x4000_4000 as *mut u32;
const STATE: *mut u32 = 0x4000_4004 as *mut u32;
const CTRL: *mut u32 = 0x4000_4008 as *mut u32;
const INTERRUPT: *mut u32 = 0x4000_400C as *mut u32;
const BAUDDIV: *mut u32 = 0x4000_4010 as *mut u32;

const STATE_TX_FULL: u32 = 1 << 0;
const STATE_RX_FULL: u32 = 1 << 1;
const CTRL_TX_ENABLE: u32 = 1 << 0;
const CTRL_RX_ENABLE: u32 = 1 << 1;
const CTRL_RX_INTERRUPT: u32 = 1 << 3;
const INTERRUPT_RX: u32 = 1 << 1;

/// Its receive interrupt.
#[derive(Clone, Copy)]
struct Received;

// SAFETY: the number in the board's interrupt table.
unsafe impl InterruptNumber for Received {
    fn number(self) -> u16 {
        0
    }
}

/// The smallest divisor that the hardware takes: 25 MHz / 16.
const DIVISOR: u32 = 16;

/// The UART. There is one; it is made once, by `main`.
pub struct Uart(());

impl Uart {
    /// Switches it on. Interrupts stay disabled: one that is pending ends a wait, none is taken.
    pub fn new() -> Self {
        cortex_m::interrupt::disable();
        // SAFETY: registers of this board, which nothing else uses; no handler will run.
        unsafe {
            write_volatile(BAUDDIV, DIVISOR);
            write_volatile(CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE | CTRL_RX_INTERRUPT);
            NVIC::unmask(Received);
        }
        Self(())
    }

    /// Waits for a byte.
    pub fn read(&mut self) -> u8 {
        // SAFETY: as above; reading DATA takes the byte.
        unsafe {
            while read_volatile(STATE) & STATE_RX_FULL == 0 {
                cortex_m::asm::wfi();
                write_volatile(INTERRUPT, INTERRUPT_RX);
                NVIC::unpend(Received);
            }
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
