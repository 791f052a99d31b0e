//! UART0 as a second port of the link: 1 Mbaud, 8N1, to the UART of a debug probe or any 3.3 V adapter.

use crate::chip::{self, CORE_HZ};
use crate::link::Port;
use crate::received::{ReceiveQueue, Writer};
use cortex_m::peripheral::NVIC;
use embassy_rp::pac::{Interrupt, UART0, interrupt};
use heapless::spsc::Consumer;

const BAUD: u32 = 1_000_000;
/// Baud-rate divisor, in 64ths of 16 clock cycles (RP2350 datasheet, 12.1.7.1).
const DIVISOR: u32 = CORE_HZ * 4 / BAUD;

/// Transmit pin GP0, at pin 1 of the board.
const TX: usize = 0;
/// Receive pin GP1, at pin 2 of the board.
const RX: usize = 1;

/// Receive queue for 10 ms of continuous data.
static RECEIVED: ReceiveQueue<1024> = ReceiveQueue::new();
static WRITER: Writer = Writer::new();

pub struct Uart(Consumer<'static, u8>);

impl Uart {
    /// Switches the UART on. Returns `None` on a second call.
    pub fn new() -> Option<Self> {
        let received = WRITER.connect(&RECEIVED)?;
        chip::connect::<TX>(chip::FUNCTION_UART);
        chip::connect::<RX>(chip::FUNCTION_UART);
        UART0.uartibrd().write(|w| w.set_baud_divint((DIVISOR >> 6) as u16));
        UART0.uartfbrd().write(|w| w.set_baud_divfrac((DIVISOR & 63) as u8));
        // A write to this register activates the divisor.
        UART0.uartlcr_h().write(|w| {
            w.set_wlen(3);
            w.set_fen(true);
        });
        // The interrupt occurs when 4 of 32 bytes have arrived, or when the line is idle.
        UART0.uartifls().write(|w| w.set_rxiflsel(0));
        UART0.uartimsc().write(|w| {
            w.set_rxim(true);
            w.set_rtim(true);
        });
        UART0.uartcr().write(|w| {
            w.set_uarten(true);
            w.set_txe(true);
            w.set_rxe(true);
        });
        // SAFETY: the handler below touches its end of the queue, and the receiver.
        unsafe { NVIC::unmask(Interrupt::UART0_IRQ) };
        Some(Self(received))
    }
}

impl Port for Uart {
    fn receive(&mut self) -> Option<u8> {
        self.0.dequeue()
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        let mut taken = 0;
        for &byte in bytes {
            if UART0.uartfr().read().txff() {
                break;
            }
            UART0.uartdr().write(|w| w.set_data(byte));
            taken += 1;
        }
        taken
    }
}

#[interrupt]
fn UART0_IRQ() {
    WRITER.fill(|| (!UART0.uartfr().read().rxfe()).then(|| UART0.uartdr().read().data()));
    // The timeout ends when the FIFO is empty. Both flags are cleared here.
    UART0.uarticr().write(|w| {
        w.set_rxic(true);
        w.set_rtic(true);
    });
}
