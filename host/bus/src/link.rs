//! Link of a session to its controller, over any kind of bus.

use rollwalk_protocol::can::Frame;

/// Reason why a frame cannot be sent or received.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LinkError {
    /// Full transmit queue; try again later.
    #[error("the link's transmit queue is full")]
    Busy,
    /// Lost bus or interface.
    #[error("the link is down: {0}")]
    Down(String),
}

/// CAN bus between a host and a controller.
///
/// The bus implements waiting: a real bus sleeps, and a simulated bus advances virtual time. The same session code therefore
/// runs on both.
pub trait LinkBus {
    /// Time since a fixed instant, µs. It never decreases.
    fn now_us(&self) -> u64;

    /// Queues a frame.
    fn send(&mut self, frame: &Frame) -> Result<(), LinkError>;

    /// Known fault of the bus and its remedy, for messages about a controller that does not answer.
    fn fault_and_remedy(&self) -> Option<String> {
        None
    }

    /// Receives the next frame from the controller; `None` if no frame arrives before `deadline_us`.
    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError>;
}

/// Implementation for a borrowed bus, which outlives the session.
impl<B: LinkBus + ?Sized> LinkBus for &mut B {
    fn now_us(&self) -> u64 {
        (**self).now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        (**self).send(frame)
    }

    fn fault_and_remedy(&self) -> Option<String> {
        (**self).fault_and_remedy()
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        (**self).receive(deadline_us)
    }
}
