//! Bytes on their way from an interrupt to the loop.

use core::cell::Cell;
use cortex_m::interrupt::{Mutex, free};
use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::StaticCell;

/// Queue of the bytes that a serial line has received.
pub struct Received<const N: usize> {
    queue: StaticCell<Queue<u8, N>>,
    /// The interrupt's end of it.
    writer: Mutex<Cell<Option<Producer<'static, u8>>>>,
}

impl<const N: usize> Received<N> {
    /// An empty queue.
    pub const fn new() -> Self {
        Self { queue: StaticCell::new(), writer: Mutex::new(Cell::new(None)) }
    }

    /// Returns the loop's end of the queue; once.
    pub fn reader(&'static self) -> Option<Consumer<'static, u8>> {
        let (writer, reader) = self.queue.try_init(Queue::new())?.split();
        free(|cs| self.writer.borrow(cs).set(Some(writer)));
        Some(reader)
    }

    /// Takes all bytes that the hardware has, in its interrupt.
    pub fn fill(&self, mut next: impl FnMut() -> Option<u8>) {
        free(|cs| {
            let mut writer = self.writer.borrow(cs).take();
            while let Some(byte) = next() {
                // A byte without room is lost, and the checksum of its packet shows that.
                let _ = writer.as_mut().map(|writer| writer.enqueue(byte));
            }
            self.writer.borrow(cs).set(writer);
        });
    }
}
