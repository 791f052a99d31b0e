//! A line of serial servos on one wire: USART3 in half duplex (RM0440, 37.5.15).
//!
//! **The wire is never driven high.** A 0 is driven low, a 1 and the rest are the pull-up's: no two ends drive against each
//! other, and there is no direction to be switched, so that a servo may answer at once.

use crate::chip::CORE_HZ;
use core::cell::Cell;
use cortex_m::interrupt::{Mutex, free};
use cortex_m::peripheral::NVIC;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::{USART3, interrupt};
use embassy_stm32::usart::TxPin;
use embassy_stm32::{Peri, peripherals};
use heapless::spsc::{Consumer, Producer, Queue};
use rollwalk_firmware::hal::servo_line::ServoLine;
use rollwalk_protocol::actuators::Packet;
use static_cell::StaticCell;

/// Least and largest divisor (USART_BRR): 2.6 kbit/s to 10.6 Mbit/s.
const DIVISORS: core::ops::RangeInclusive<u32> = 16..=0xFFFF;

/// Receive queue: 5 ms at 1 Mbaud.
static RECEIVED: StaticCell<Queue<u8, 512>> = StaticCell::new();
/// The interrupt's end of it.
static WRITER: Mutex<Cell<Option<Producer<'static, u8>>>> = Mutex::new(Cell::new(None));

/// The line.
pub struct Line {
    state: ServoLine,
    received: Consumer<'static, u8>,
}

/// Takes it off the wire, in the middle of a byte.
pub fn silence() {
    USART3.cr1().write(|_| {});
}

impl Line {
    /// Switches it on; once. `None` for a rate that it does not make.
    pub fn new(
        wire: Peri<'static, impl TxPin<peripherals::USART3>>,
        bit_rate: u32,
    ) -> Option<Self> {
        let divisor = CORE_HZ.checked_div(bit_rate).filter(|divisor| DIVISORS.contains(divisor))?;
        let (writer, received) = RECEIVED.try_init(Queue::new())?.split();
        free(|cs| WRITER.borrow(cs).set(Some(writer)));
        let function = wire.af_num();
        let mut wire = Flex::new(wire);
        let open_drain = AfType::output_pull(OutputType::OpenDrain, Speed::VeryHigh, Pull::Up);
        wire.set_as_af_unchecked(function, open_drain);
        // It stays so; dropping it would disconnect the pin.
        core::mem::forget(wire);
        USART3.brr().write(|w| w.0 = divisor);
        USART3.cr3().write(|w| w.set_hdsel(true));
        USART3.cr1().write(|w| {
            w.set_fifoen(true);
            w.set_rxneie(true);
            w.set_te(true);
            w.set_re(true);
        });
        USART3.cr1().modify(|w| w.set_ue(true));
        // SAFETY: the handler below touches its end of the queue, and the receiver.
        unsafe { NVIC::unmask(interrupt::USART3) };
        Some(Self { state: ServoLine::default(), received })
    }

    /// The next byte of a servo.
    pub fn receive(&mut self) -> Option<u8> {
        loop {
            let byte = self.received.dequeue()?;
            if let Some(byte) = self.state.receive(byte) {
                return Some(byte);
            }
        }
    }

    /// Whether the hardware has all of the packet before.
    pub fn is_free(&self) -> bool {
        self.state.is_free()
    }

    /// Sends a packet, if [`Self::is_free`].
    pub fn send(&mut self, packet: Packet) {
        self.state.send(packet);
    }

    /// Hands bytes to the hardware while it has room.
    pub fn work(&mut self) {
        while USART3.isr().read().txe()
            && let Some(byte) = self.state.next_byte()
        {
            USART3.tdr().write(|w| w.set_dr(byte.into()));
        }
    }
}

#[interrupt]
fn USART3() {
    free(|cs| {
        let mut writer = WRITER.borrow(cs).take();
        while USART3.isr().read().rxne() {
            let byte = USART3.rdr().read().dr() as u8;
            // A byte without room is lost, and the checksum of its packet shows that.
            let _ = writer.as_mut().map(|writer| writer.enqueue(byte));
        }
        WRITER.borrow(cs).set(writer);
    });
    // An overrun would hold the interrupt.
    USART3.icr().write(|w| w.set_ore(true));
}
