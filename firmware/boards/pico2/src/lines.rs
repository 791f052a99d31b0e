//! Two half-duplex lines of serial servos on PIO0 (RP2350 datasheet, chapter 11). In each, one state machine sends and another
//! receives.
//!
//! **The wire is never driven high.** A 0 is driven low; a pull-up produces a 1 and the idle level. Two ends never drive
//! against each other. No direction must be switched, so a servo may answer at once. A second pin is high while a byte is sent,
//! for lines that require a transceiver (RS-485).

use crate::chip::{self, CORE_HZ, FUNCTION_PIO0};
use crate::line::{Line, Transmitter};
use crate::received::{ReceiveQueue, Writer};
use cortex_m::peripheral::NVIC;
use embassy_rp::pac::{Interrupt, PIO0, RESETS, interrupt};
use embassy_rp::pio::program::pio_asm;

pub const COUNT: usize = 2;

/// Offset of the receiver in the instruction memory. The sender is at offset 0.
const RECEIVER_AT: u8 = 8;
/// Number of cycles of a bit, in both programs.
const CYCLES: u32 = 8;

/// Receive queues of the lines, each for 5 ms at 1 Mbaud.
static RECEIVED: [ReceiveQueue<512>; COUNT] = [const { ReceiveQueue::new() }; COUNT];
static WRITERS: [Writer; COUNT] = [const { Writer::new() }; COUNT];

/// Transmitter of a line.
pub struct Sender {
    number: usize,
}

/// Resets the PIO block: transmission stops at once, even within a byte, and the pins no longer drive the wires.
pub fn silence() {
    RESETS.reset().modify(|w| w.set_pio0(true));
}

/// Starts the first line, with its wire on GP2 and its direction on GP3. Returns `None` on a second call.
pub fn first(bit_rate: u32) -> Option<Line<Sender>> {
    chip::connect::<2>(FUNCTION_PIO0);
    chip::connect::<3>(FUNCTION_PIO0);
    start::<0, 1>(0, 2, bit_rate)
}

/// Starts the second line, with its wire on GP4 and its direction on GP5. Returns `None` on a second call.
pub fn second(bit_rate: u32) -> Option<Line<Sender>> {
    chip::connect::<4>(FUNCTION_PIO0);
    chip::connect::<5>(FUNCTION_PIO0);
    start::<2, 3>(1, 4, bit_rate)
}

fn start<const SENDER: usize, const RECEIVER: usize>(
    number: usize,
    pin: u8,
    bit_rate: u32,
) -> Option<Line<Sender>> {
    let received = WRITERS.get(number)?.connect(RECEIVED.get(number)?)?;
    // Clocks per cycle in units of 1/256: 16 integer and 8 fractional bits, greater than 1 (11.5.5).
    let cycles = u64::from(CYCLES) * u64::from(bit_rate);
    let divisor = (u64::from(CORE_HZ) * 256).checked_div(cycles)?;
    if !(256..1 << 24).contains(&divisor) {
        return None;
    }
    let divisor = (divisor as u32) << 8;
    let (sender, receiver) = load_programs();
    set_up_sender::<SENDER>(pin, divisor, sender);
    set_up_receiver::<RECEIVER>(pin, divisor, receiver);
    PIO0.ctrl().modify(|w| w.set_sm_enable(w.sm_enable() | 1 << SENDER | 1 << RECEIVER));
    PIO0.irqs(0).inte().modify(|w| w.0 |= 1 << RECEIVER);
    // SAFETY: the handler below touches its ends of the queues, and the receivers.
    unsafe { NVIC::unmask(Interrupt::PIO0_IRQ_0) };
    Some(Line::new(Sender { number }, received))
}

impl Transmitter for Sender {
    fn has_room(&self) -> bool {
        let sender = if self.number == 0 { 0 } else { 2 };
        PIO0.fstat().read().txfull() & 1 << sender == 0
    }

    fn write(&mut self, byte: u8) {
        // The program drives the line low for bits that are 1.
        let low = u32::from(!byte);
        match self.number {
            0 => PIO0.txf(0).write_value(low),
            _ => PIO0.txf(2).write_value(low),
        }
    }
}

/// Offsets of the first and the last instruction of a program.
type Wrap = (u8, u8);

/// Writes both programs. For the second line, they are already there.
fn load_programs() -> (Wrap, Wrap) {
    // A driven pin is low: the value of the output stays 0, and its direction carries the bits.
    let sender = pio_asm!(
        ".side_set 1",
        ".wrap_target",
        "pull block        side 0",
        "set x, 7          side 1",
        "set pindirs, 1    side 1 [7]", // start bit
        "bit:",
        "out pindirs, 1    side 1",
        "jmp x-- bit       side 1 [6]",
        "set pindirs, 0    side 1 [5]", // stop bit, with the two instructions above
        ".wrap",
    );
    // The receiver of pico-examples. It drops a byte without stop bit.
    let receiver = pio_asm!(
        ".wrap_target",
        "start:",
        "wait 0 pin 0",
        "set x, 7          [10]", // to the middle of the first bit
        "bit:",
        "in pins, 1",
        "jmp x-- bit       [6]",
        "jmp pin good",
        "wait 1 pin 0",
        "jmp start",
        "good:",
        "push noblock",
        ".wrap",
    );
    (load(&sender.program.code, 0), load(&receiver.program.code, RECEIVER_AT))
}

/// Writes a program at an offset of the instruction memory, which has 32 instructions.
fn load(code: &[u16], at: u8) -> Wrap {
    for (place, &word) in (at..32).zip(code) {
        // Targets of jumps, which have the opcode 0, are relocated.
        let moved = if word >> 13 == 0 { word.saturating_add(u16::from(at)) } else { word };
        PIO0.instr_mem(usize::from(place & 31)).write(|w| w.set_instr_mem(moved));
    }
    (at, at.saturating_add((code.len() as u8).saturating_sub(1)))
}

fn set_up_sender<const SM: usize>(pin: u8, divisor: u32, (first, last): Wrap) {
    let sm = PIO0.sm(SM);
    sm.clkdiv().write(|w| w.0 = divisor);
    sm.execctrl().write(|w| {
        w.set_wrap_bottom(first);
        w.set_wrap_top(last);
    });
    sm.shiftctrl().write(|w| w.set_out_shiftdir(true));
    sm.pinctrl().write(|w| {
        w.set_out_base(pin);
        w.set_out_count(1);
        w.set_set_base(pin);
        w.set_set_count(1);
        w.set_sideset_base(pin + 1);
        w.set_sideset_count(1);
    });
    // `set pins, 0`, `set pindirs, 0` and `jmp first`, as in the program. `set` briefly acts on the direction pin, which is
    // always driven.
    sm.instr().write(|w| w.set_instr(0xE000));
    sm.instr().write(|w| w.set_instr(0xE080));
    sm.pinctrl().modify(|w| w.set_set_base(pin + 1));
    sm.instr().write(|w| w.set_instr(0xE081));
    sm.pinctrl().modify(|w| w.set_set_base(pin));
    sm.instr().write(|w| w.set_instr(u16::from(first)));
}

fn set_up_receiver<const SM: usize>(pin: u8, divisor: u32, (first, last): Wrap) {
    let sm = PIO0.sm(SM);
    sm.clkdiv().write(|w| w.0 = divisor);
    sm.execctrl().write(|w| {
        w.set_jmp_pin(pin);
        w.set_wrap_bottom(first);
        w.set_wrap_top(last);
    });
    sm.shiftctrl().write(|w| {
        w.set_in_shiftdir(true);
        w.set_fjoin_rx(true);
    });
    sm.pinctrl().write(|w| w.set_in_base(pin));
    sm.instr().write(|w| w.set_instr(u16::from(first)));
}

#[interrupt]
fn PIO0_IRQ_0() {
    let [first, second] = &WRITERS;
    first.fill(next::<1>);
    second.fill(next::<3>);
}

/// Returns the next byte of a receiver.
fn next<const SM: usize>() -> Option<u8> {
    let is_empty = PIO0.fstat().read().rxempty() & 1 << SM != 0;
    // Bits are shifted in from the top.
    (!is_empty).then(|| (PIO0.rxf(SM).read() >> 24) as u8)
}
