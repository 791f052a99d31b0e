//! LPUART1, which the Nucleo's debugger shows as a serial port: 1 Mbaud, 8N1.

use crate::chip::CORE_HZ;
use core::cell::Cell;
use cortex_m::interrupt::{Mutex, free};
use cortex_m::peripheral::NVIC;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::{LPUART1, interrupt};
use embassy_stm32::usart::{RxPin, TxPin};
use embassy_stm32::{Peri, peripherals};
use heapless::spsc::{Consumer, Producer, Queue};
use rollwalk_protocol::serial::{Deframer, Line, Packet};
use static_cell::StaticCell;

const BAUD: u32 = 1_000_000;

/// Receive queue: 5 ms of a line that never rests.
static RECEIVED: StaticCell<Queue<u8, 512>> = StaticCell::new();
/// The interrupt's end of it.
static WRITER: Mutex<Cell<Option<Producer<'static, u8>>>> = Mutex::new(Cell::new(None));

/// The serial line.
pub struct Serial {
    received: Consumer<'static, u8>,
    deframer: Deframer,
    line: Line,
    /// Bytes of the line that are with the hardware.
    sent: usize,
}

impl Serial {
    /// Switches it on; once.
    pub fn new(
        rx: Peri<'static, impl RxPin<peripherals::LPUART1>>,
        tx: Peri<'static, impl TxPin<peripherals::LPUART1>>,
    ) -> Option<Self> {
        let (writer, received) = RECEIVED.try_init(Queue::new())?.split();
        free(|cs| WRITER.borrow(cs).set(Some(writer)));
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
        Some(Self { received, deframer: Deframer::default(), line: Line::new(), sent: 0 })
    }

    /// The next packet that was received.
    pub fn receive(&mut self) -> Option<Packet<'_>> {
        let zero = loop {
            let byte = self.received.dequeue()?;
            if byte == 0 {
                break byte;
            }
            self.deframer.push(byte);
        };
        self.deframer.push(zero).and_then(Packet::decode)
    }

    /// Whether the packet before has been sent.
    pub fn is_free(&self) -> bool {
        self.sent >= self.line.len()
    }

    /// Sends a packet, if [`Self::is_free`].
    pub fn send(&mut self, packet: &Packet<'_>) {
        if let Some(line) = packet.encode() {
            self.line = line;
            self.sent = 0;
        }
    }

    /// Hands bytes to the hardware while it has room.
    pub fn work(&mut self) {
        while let Some(&byte) = self.line.get(self.sent)
            && LPUART1.isr().read().txe()
        {
            LPUART1.tdr().write(|w| w.set_dr(byte.into()));
            self.sent = self.sent.saturating_add(1);
        }
    }
}

#[interrupt]
fn LPUART1() {
    free(|cs| {
        let mut writer = WRITER.borrow(cs).take();
        while LPUART1.isr().read().rxne() {
            let byte = LPUART1.rdr().read().dr() as u8;
            // A byte without room is lost, and the checksum of its packet shows that.
            let _ = writer.as_mut().map(|writer| writer.enqueue(byte));
        }
        WRITER.borrow(cs).set(writer);
    });
    // An overrun would hold the interrupt.
    LPUART1.icr().write(|w| w.set_ore(true));
}
