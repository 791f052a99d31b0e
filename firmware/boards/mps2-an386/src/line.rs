//! UART 0 as a line in real time.
//!
//! An interrupt receives bytes, and bytes are sent as the hardware has room. A host that does not read therefore delays only
//! its own frames.

use crate::registers::{
    BAUDDIV, CTRL, CTRL_RX_ENABLE, CTRL_RX_INTERRUPT, CTRL_TX_ENABLE, DATA, DIVISOR, INTERRUPT,
    INTERRUPT_RX, ReceiveInterrupt, STATE, STATE_RX_FULL, STATE_TX_FULL,
};
use core::cell::Cell;
use core::ptr::{read_volatile, write_volatile};
use core::sync::atomic::{AtomicBool, Ordering};
use cortex_m::interrupt::{InterruptNumber, Mutex, free};
use cortex_m::peripheral::NVIC;
use cortex_m_rt::exception;
use heapless::Deque;
use heapless::spsc::{Consumer, Producer, Queue};
use rollwalk_protocol::slcan::Line as Text;
use static_cell::StaticCell;

const CTRL_TX_INTERRUPT: u32 = 1 << 2;
const INTERRUPT_TX: u32 = 1 << 0;

/// Length of the transmit queue, bytes: room for two frames. Further frames wait in the controller, where newer ones replace
/// them.
const SEND_BYTES: usize = 2 * FRAME_BYTES;
/// Length of the longest line of the link, bytes: `t`, identifier, length, 8 data bytes.
const FRAME_BYTES: usize = 22;

/// Receive queue for 100 ms at the 10 kB/s that QEMU delivers. Nothing is read from it while a library is checked.
static RECEIVED: StaticCell<Queue<u8, 1024>> = StaticCell::new();
/// Interrupt's end of the receive queue.
static WRITER: Mutex<Cell<Option<Producer<'static, u8>>>> = Mutex::new(Cell::new(None));
/// True if received bytes did not fit in the queue.
static LOST: AtomicBool = AtomicBool::new(false);

/// Transmit interrupt of the UART, which wakes the processor when there is room again.
#[derive(Clone, Copy)]
struct TransmitInterrupt;

// SAFETY: the number in the board's interrupt table.
unsafe impl InterruptNumber for TransmitInterrupt {
    fn number(self) -> u16 {
        1
    }
}

pub struct Line {
    received: Consumer<'static, u8>,
    waiting: Deque<u8, SEND_BYTES>,
}

impl Line {
    /// Switches the line on. Returns `None` on a second call.
    pub fn new() -> Option<Self> {
        let (writer, received) = RECEIVED.try_init(Queue::new())?.split();
        free(|cs| WRITER.borrow(cs).set(Some(writer)));
        // SAFETY: registers of this board, which nothing else uses; the handler below only takes what was
        // received.
        unsafe {
            write_volatile(BAUDDIV, DIVISOR);
            let interrupts = CTRL_RX_INTERRUPT | CTRL_TX_INTERRUPT;
            write_volatile(CTRL, CTRL_TX_ENABLE | CTRL_RX_ENABLE | interrupts);
            NVIC::unmask(ReceiveInterrupt);
            NVIC::unmask(TransmitInterrupt);
        }
        Some(Self { received, waiting: Deque::new() })
    }

    /// Returns the next received byte.
    pub fn receive(&mut self) -> Option<u8> {
        self.received.dequeue()
    }

    /// Returns true if bytes were lost since the previous call.
    pub fn has_lost(&mut self) -> bool {
        LOST.swap(false, Ordering::AcqRel)
    }

    /// True if there is room for a frame.
    pub fn is_free(&self) -> bool {
        self.room() >= FRAME_BYTES
    }

    /// Sends a line of text if there is room for it. Otherwise drops it.
    pub fn send(&mut self, text: &Text) {
        if text.len() <= self.room() {
            for &byte in text {
                let _ = self.waiting.push_back(byte);
            }
        }
        self.work();
    }

    fn room(&self) -> usize {
        SEND_BYTES.saturating_sub(self.waiting.len())
    }

    /// Passes bytes to the hardware while it has room.
    pub fn work(&mut self) {
        while has_room()
            && let Some(byte) = self.waiting.pop_front()
        {
            // SAFETY: as in `new`.
            unsafe { write_volatile(DATA, byte.into()) };
        }
    }

    /// True if there is work that does not depend on another interrupt.
    pub fn is_busy(&self) -> bool {
        self.received.ready() || (!self.waiting.is_empty() && has_room())
    }
}

fn has_room() -> bool {
    // SAFETY: a register of this board; reading it changes nothing.
    unsafe { read_volatile(STATE) & STATE_TX_FULL == 0 }
}

/// Handles the two enabled interrupts. No crate names the interrupts of this board.
#[exception]
unsafe fn DefaultHandler(_number: i16) {
    free(|cs| {
        let mut writer = WRITER.borrow(cs).take();
        // SAFETY: registers of this board; reading DATA takes the byte.
        unsafe {
            write_volatile(INTERRUPT, INTERRUPT_RX | INTERRUPT_TX);
            while read_volatile(STATE) & STATE_RX_FULL != 0 {
                let byte = read_volatile(DATA) as u8;
                if writer.as_mut().is_none_or(|writer| writer.enqueue(byte).is_err()) {
                    LOST.store(true, Ordering::Release);
                }
            }
        }
        WRITER.borrow(cs).set(writer);
    });
}
