//! The host's end of the link, as a session uses it over any kind of bus.

use rollwalk_protocol::can::Frame;

/// Reason for which a frame cannot be sent or received.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// The transmit queue is full; try again after a while.
    #[error("the link's transmit queue is full")]
    Busy,
    /// The bus or its interface is gone.
    #[error("the link is down: {0}")]
    Down(String),
}

/// A CAN bus with the controller on it, seen from the host.
///
/// The bus does the waiting: a real one sleeps, the simulated one advances virtual time. So the same
/// session runs on both.
pub trait LinkBus {
    /// Microseconds since some fixed instant; never goes back.
    fn now_us(&self) -> u64;

    /// Queues a frame.
    fn send(&mut self, frame: &Frame) -> Result<(), LinkError>;

    /// A known fault of the bus and its remedy, for messages about a controller that does not answer.
    fn complaint(&self) -> Option<String> {
        None
    }

    /// The next frame from the controller, or `None` if none comes until `deadline_us`.
    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError>;
}

/// Lets a session borrow its bus, which outlives it.
impl<B: LinkBus + ?Sized> LinkBus for &mut B {
    fn now_us(&self) -> u64 {
        (**self).now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        (**self).send(frame)
    }

    fn complaint(&self) -> Option<String> {
        (**self).complaint()
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        (**self).receive(deadline_us)
    }
}
