//! Half-duplex line of serial servos on USART3 (RM0440, 37.5.15).
//!
//! **The wire is never driven high.** A 0 is driven low; a pull-up produces a 1 and the idle level. Two ends never drive
//! against each other. No direction must be switched, so a servo may answer at once.

use crate::chip::CORE_HZ;
use crate::line::{Line, Transmitter};
use crate::received::{ReceiveQueue, Writer};
use cortex_m::peripheral::NVIC;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pull, Speed};
use embassy_stm32::pac::{USART3, interrupt};
use embassy_stm32::usart::TxPin;
use embassy_stm32::{Peri, peripherals};

/// Range of the divisor (USART_BRR): 10.6 Mbit/s to 2.6 kbit/s.
const DIVISORS: core::ops::RangeInclusive<u32> = 16..=0xFFFF;

/// Receive queue for 5 ms at 1 Mbaud.
static RECEIVED: ReceiveQueue<512> = ReceiveQueue::new();
static WRITER: Writer = Writer::new();

/// Transmitter of the line.
pub struct Sender(());

/// Disconnects from the wire, even in the middle of a byte.
pub fn silence() {
    USART3.cr1().write(|_| {});
}

/// Switches the line on. Returns `None` if the USART cannot produce the bit rate, or on a second call.
pub fn start(
    wire: Peri<'static, impl TxPin<peripherals::USART3>>,
    bit_rate: u32,
) -> Option<Line<Sender>> {
    let divisor = CORE_HZ.checked_div(bit_rate).filter(|divisor| DIVISORS.contains(divisor))?;
    let received = WRITER.connect(&RECEIVED)?;
    let function = wire.af_num();
    let mut wire = Flex::new(wire);
    let open_drain = AfType::output_pull(OutputType::OpenDrain, Speed::VeryHigh, Pull::Up);
    wire.set_as_af_unchecked(function, open_drain);
    // The pin remains configured; dropping it would disconnect it.
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
    Some(Line::new(Sender(()), received))
}

impl Transmitter for Sender {
    fn has_room(&self) -> bool {
        USART3.isr().read().txe()
    }

    fn write(&mut self, byte: u8) {
        USART3.tdr().write(|w| w.set_dr(byte.into()));
    }
}

#[interrupt]
fn USART3() {
    WRITER.fill(|| USART3.isr().read().rxne().then(|| USART3.rdr().read().dr() as u8));
    // An uncleared overrun flag would keep the interrupt pending.
    USART3.icr().write(|w| w.set_ore(true));
}
