//! UART 0 for requests and answers.
//!
//! The processor sleeps until a byte arrives, because an emulator that does not execute a waiting loop is several times faster.

use crate::registers::{
    BAUDDIV, CTRL, CTRL_RX_ENABLE, CTRL_RX_INTERRUPT, CTRL_TX_ENABLE, DATA, DIVISOR, INTERRUPT,
    INTERRUPT_RX, ReceiveInterrupt, STATE, STATE_RX_FULL, STATE_TX_FULL,
};
use core::ptr::{read_volatile, write_volatile};
use cortex_m::peripheral::NVIC;

/// UART 0. `main` creates the only one.
pub struct Uart(());

impl Uart {
    /// Switches the UART on. Interrupts stay disabled: a pending one ends a wait without being taken.
    pub fn new() -> Self {
        cortex_m::interrupt::disable();
        // SAFETY: registers of this board, which nothing else uses; no handler will run.
        unsafe {
            write_volatile(BAUDDIV, DIVISOR);
            write_volatile(CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE | CTRL_RX_INTERRUPT);
            NVIC::unmask(ReceiveInterrupt);
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
                NVIC::unpend(ReceiveInterrupt);
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
