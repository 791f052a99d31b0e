//! Bytes on their way from an interrupt to the loop.

use core::cell::Cell;
use cortex_m::interrupt::{Mutex, free};
use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::StaticCell;

/// Queue of the bytes that a serial line has received.
pub type Received<const N: usize> = StaticCell<Queue<u8, N>>;

/// The interrupt's end of a queue. It is a static of its own: only then can the compiler prove the queue's length, and that no
/// remainder by it panics.
pub struct Writer(Mutex<Cell<Option<Producer<'static, u8>>>>);

impl Writer {
    /// The end of no queue yet.
    pub const fn new() -> Self {
        Self(Mutex::new(Cell::new(None)))
    }

    /// Writes to a queue from now on, and returns the loop's end of it; once.
    pub fn connect<const N: usize>(
        &self,
        queue: &'static Received<N>,
    ) -> Option<Consumer<'static, u8>> {
        let (writer, reader) = queue.try_init(Queue::new())?.split();
        free(|cs| self.0.borrow(cs).set(Some(writer)));
        Some(reader)
    }

    /// Takes all bytes that the hardware has, in its interrupt.
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
