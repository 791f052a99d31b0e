//! Received bytes on their way from an interrupt to the main loop.

use core::cell::Cell;
use cortex_m::interrupt::{Mutex, free};
use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::StaticCell;

/// Queue of the bytes that a serial line has received.
pub type ReceiveQueue<const N: usize> = StaticCell<Queue<u8, N>>;

/// Interrupt's end of a queue.
///
/// The queue is a separate static: only then can the compiler prove its length, and that a remainder by the length does not
/// panic.
pub struct Writer(Mutex<Cell<Option<Producer<'static, u8>>>>);

impl Writer {
    /// Creates a writer without a queue.
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Connects the writer to a queue, and returns the main loop's end of it. Returns `None` if the queue is already in use.
    pub fn connect<const N: usize>(
        &self,
        queue: &'static ReceiveQueue<N>,
    ) -> Option<Consumer<'static, u8>> {
        let (writer, reader) = queue.try_init(Queue::new())?.split();
        free(|cs| self.0.borrow(cs).set(Some(writer)));
        Some(reader)
    }

    /// Queues all bytes that the hardware has received. Call it in the interrupt.
    pub fn fill(&self, mut next: impl FnMut() -> Option<u8>) {
        free(|cs| {
            let mut writer = self.0.borrow(cs).take();
            while let Some(byte) = next() {
                // A byte without room is lost, and the checksum of its packet shows that.
                let _ = writer.as_mut().map(|writer| writer.enqueue(byte));
            }
            self.0.borrow(cs).set(writer);
        });
    }
}
