//! LPUART1, which the Nucleo's debugger presents as a serial port: 1 Mbaud, 8N1.

use crate::chip::CORE_HZ;
use crate::link::Port;
use crate::received::{ReceiveQueue, Writer};
use cortex_m::peripheral::NVIC;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::{LPUART1, interrupt};
use embassy_stm32::usart::{RxPin, TxPin};
use embassy_stm32::{Peri, peripherals};
use heapless::spsc::Consumer;

const BAUD: u32 = 1_000_000;

/// Receive queue for 5 ms of continuous data.
static RECEIVED: ReceiveQueue<512> = ReceiveQueue::new();
static WRITER: Writer = Writer::new();

pub struct Serial(Consumer<'static, u8>);

impl Serial {
    /// Switches the port on. Returns `None` on a second call.
    pub fn new(
        rx: Peri<'static, impl RxPin<peripherals::LPUART1>>,
        tx: Peri<'static, impl TxPin<peripherals::LPUART1>>,
    ) -> Option<Self> {
        let received = WRITER.connect(&RECEIVED)?;
        let (rx_function, tx_function) = (rx.af_num(), tx.af_num());
        let mut rx = Flex::new(rx);
        rx.set_as_af_unchecked(rx_function, AfType::input(Pull::Up));
        let mut tx = Flex::new(tx);
        tx.set_as_af_unchecked(tx_function, AfType::output(OutputType::PushPull, Speed::Medium));
        core::mem::forget((rx, tx));
        // LPUART_BRR is the divisor in 256ths of the clock.
        let divisor = 256 * u64::from(CORE_HZ) / u64::from(BAUD);
        LPUART1.brr().write(|w| w.0 = divisor as u32);
        LPUART1.cr1().write(|w| {
            w.set_fifoen(true);
            w.set_rxneie(true);
            w.set_te(true);
            w.set_re(true);
        });
        LPUART1.cr1().modify(|w| w.set_ue(true));
        // SAFETY: the handler below touches its end of the queue, and the receiver.
        unsafe { NVIC::unmask(interrupt::LPUART1) };
        Some(Self(received))
    }
}

impl Port for Serial {
    fn receive(&mut self) -> Option<u8> {
        self.0.dequeue()
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        let mut taken = 0;
        for &byte in bytes {
            if !LPUART1.isr().read().txe() {
                break;
            }
            LPUART1.tdr().write(|w| w.set_dr(byte.into()));
            taken += 1;
        }
        taken
    }
}

#[interrupt]
fn LPUART1() {
    WRITER.fill(|| LPUART1.isr().read().rxne().then(|| LPUART1.rdr().read().dr() as u8));
    // An uncleared overrun flag would keep the interrupt pending.
    LPUART1.icr().write(|w| w.set_ore(true));
}
