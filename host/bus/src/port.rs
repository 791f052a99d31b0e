//! Buses in real time: an outlet that sends frames, and a thread that receives them. [`LiveLink`] turns a port into the link of a
//! session.
//!
//! There is no transmit queue between a program and its bus: an outlet accepts a frame only while few others are in flight. A
//! waiting set-point can therefore be replaced by a newer one, and few stale frames are sent when a dead bus recovers.
//!
//! On a CAN interface, a frame is in flight until it is transmitted. On a serial line, it is in flight until the kernel has
//! accepted it, and the kernel's buffer is additional. Commands therefore contain an expiry.

use crate::link::{LinkBus, LinkError};
use crate::priority;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{BoardReport, BusState};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// Event on a bus.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// Frame of another node.
    Frame(Frame),
    /// Transmission of a frame of this program; there is room for another.
    Sent,
    /// Change of the interface's error state.
    State(BusState),
    /// Complete transport message with its identifier. A [`Hub`] lets its [`Outlet`] segment the message into frames.
    Message(u16, Vec<u8>),
    /// Status report of the board at the other end of a serial line.
    Report(BoardReport),
    /// Bytes of a serial line of actuators, in chunks of any size.
    Bytes(Vec<u8>),
}

/// Transmitting end of a bus.
pub trait Outlet: Send {
    /// True if [`Self::send`] would accept a frame or report that the bus is lost, instead of returning [`LinkError::Busy`].
    fn is_free(&self) -> bool;

    /// Sends a frame.
    ///
    /// # Errors
    /// Returns [`LinkError::Busy`] if too many frames are in flight, or the reason why the bus is lost.
    fn send(&mut self, frame: &Frame) -> Result<(), LinkError>;

    /// True for a serial line of actuators, which carries bytes instead of frames.
    fn carries_bytes(&self) -> bool {
        false
    }

    /// Sends a packet of bytes.
    ///
    /// # Errors
    /// Returns the errors of [`Self::send`], or an error if this bus carries frames.
    fn send_bytes(&mut self, _bytes: &[u8]) -> Result<(), LinkError> {
        Err(LinkError::Down("this bus carries frames, not bytes".into()))
    }

    /// Requests a status report from the board at the other end; returns false if this kind of bus cannot request one.
    ///
    /// # Errors
    /// Returns the errors of [`Self::send`].
    fn ask_report(&mut self) -> Result<bool, LinkError> {
        Ok(false)
    }

    /// Segments a complete message into frames with identifier `id`, for [`Self::poll_inward`].
    fn take_apart(&mut self, _id: u16, _message: &[u8]) {}

    /// Returns the next frame that was generated at this end instead of received. Such frames are segments of a complete
    /// received message, and flow control for a message that is sent as a whole.
    fn poll_inward(&mut self) -> Option<Frame> {
        None
    }

    /// Bitrate of the bus, bit/s; `None` if it is unknown or the bus is not a CAN bus.
    fn bitrate(&self) -> Option<u32> {
        None
    }

    /// Known fault of the bus and its remedy.
    fn fault_and_remedy(&self) -> Option<String> {
        None
    }
}

/// Receiving end of a bus.
pub trait Inlet: Send {
    /// Waits for the next event. Returns `None` after some hundredths of a second without an event, so that the receiving
    /// thread can end.
    ///
    /// # Errors
    /// Returns an error if the bus is lost.
    fn next_event(&mut self) -> Result<Option<Event>, LinkError>;
}

/// Transmitting and receiving ends of a bus.
pub struct Port {
    /// Transmitting end.
    pub outlet: Box<dyn Outlet>,
    /// Receiving end.
    pub inlet: Box<dyn Inlet>,
}

/// Time since `start`, µs.
pub(crate) fn since_us(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// Event, with the index of its bus.
type BusEvent = (usize, Result<Event, LinkError>);

/// Several buses that are received concurrently.
pub struct Hub {
    /// Outlets, in the order of the ports.
    pub outlets: Vec<Box<dyn Outlet>>,
    /// Stop flags of the receiving threads.
    over: Vec<Arc<AtomicBool>>,
    events: Receiver<BusEvent>,
    sender: Sender<BusEvent>,
}

impl Hub {
    /// Starts a receiving thread for each port.
    pub fn new(ports: impl IntoIterator<Item = Port>) -> Self {
        let (sender, events) = channel();
        let mut hub = Self { outlets: Vec::new(), over: Vec::new(), events, sender };
        for (index, port) in ports.into_iter().enumerate() {
            let over = hub.listen(index, port.inlet);
            hub.over.push(over);
            hub.outlets.push(port.outlet);
        }
        hub
    }

    /// Closes a port that has failed, so that its device can be opened again.
    pub fn close(&mut self, index: usize) {
        self.over[index].store(true, Ordering::Relaxed);
        self.outlets[index] = Box::new(ClosedOutlet);
    }

    /// Replaces a port that has failed.
    pub fn replace(&mut self, index: usize, port: Port) {
        self.close(index);
        self.over[index] = self.listen(index, port.inlet);
        self.outlets[index] = port.outlet;
    }

    /// Starts a thread that forwards the inlet's events until the bus is lost or the returned flag is set.
    fn listen(&self, index: usize, mut inlet: Box<dyn Inlet>) -> Arc<AtomicBool> {
        let (sender, over) = (self.sender.clone(), Arc::new(AtomicBool::new(false)));
        let is_over = Arc::clone(&over);
        thread::spawn(move || {
            priority::raise();
            while !is_over.load(Ordering::Relaxed) {
                let event = inlet.next_event().transpose();
                let is_gone = matches!(event, Some(Err(_)));
                // A dropped hub has set the flag, which ends the next iteration.
                let _ = event.map(|event| sender.send((index, event)));
                if is_gone {
                    return;
                }
            }
        });
        over
    }

    /// Returns the next event and the index of its bus; `None` at `deadline`. Reports the loss of a bus once.
    pub fn next_event(&mut self, deadline: Instant) -> Option<(usize, Result<Event, LinkError>)> {
        loop {
            let inward = self.outlets.iter_mut().enumerate();
            let mut inward =
                inward.filter_map(|(index, outlet)| Some((index, outlet.poll_inward()?)));
            if let Some((index, frame)) = inward.next() {
                return Some((index, Ok(Event::Frame(frame))));
            }
            // The channel stays connected, because the hub keeps a sender itself.
            let wait = deadline.saturating_duration_since(Instant::now());
            match self.events.recv_timeout(wait).ok()? {
                (index, Ok(Event::Message(id, bytes))) => {
                    self.outlets[index].take_apart(id, &bytes);
                }
                event => return Some(event),
            }
        }
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        self.over.iter().for_each(|over| over.store(true, Ordering::Relaxed));
    }
}

/// Outlet of a closed port.
struct ClosedOutlet;

impl Outlet for ClosedOutlet {
    fn is_free(&self) -> bool {
        false
    }

    fn send(&mut self, _frame: &Frame) -> Result<(), LinkError> {
        Err(LinkError::Down("this bus is closed".into()))
    }
}

/// Link in real time.
pub struct LiveLink {
    hub: Hub,
    /// Frames that arrived while [`Self::report`] waited.
    frames: VecDeque<Frame>,
    /// Reason why the bus is lost; `None` if it is not.
    lost: Option<LinkError>,
    started: Instant,
}

impl LiveLink {
    /// Creates the link over a port.
    pub fn new(port: Port) -> Self {
        let (frames, started) = (VecDeque::new(), Instant::now());
        Self { hub: Hub::new([port]), frames, lost: None, started }
    }

    fn outlet(&mut self) -> &mut dyn Outlet {
        self.hub.outlets[0].as_mut()
    }

    /// Requests the status report of the board at the other end. Returns `None` without an answer within `timeout`, or if this
    /// kind of bus cannot request a report.
    ///
    /// # Errors
    /// Returns [`LinkError::Busy`] if too many frames are in flight, or the reason why the bus is lost.
    pub fn report(&mut self, timeout: Duration) -> Result<Option<BoardReport>, LinkError> {
        if !self.outlet().ask_report()? {
            return Ok(None);
        }
        let deadline = Instant::now() + timeout;
        while let Some(event) = self.next(deadline)? {
            match event {
                Event::Report(report) => return Ok(Some(report)),
                Event::Frame(frame) if frame.standard_id().is_some() => {
                    self.frames.push_back(frame)
                }
                _ => {}
            }
        }
        Ok(None)
    }

    /// Bitrate of the bus, bit/s; `None` if it is unknown or the bus is not a CAN bus.
    pub fn bitrate(&self) -> Option<u32> {
        self.hub.outlets[0].bitrate()
    }

    fn next(&mut self, deadline: Instant) -> Result<Option<Event>, LinkError> {
        if let Some(error) = &self.lost {
            return Err(error.clone());
        }
        match self.hub.next_event(deadline) {
            Some((_, Ok(event))) => Ok(Some(event)),
            Some((_, Err(error))) => Err(self.lost.insert(error).clone()),
            None => Ok(None),
        }
    }
}

impl LinkBus for LiveLink {
    fn now_us(&self) -> u64 {
        since_us(self.started)
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        self.outlet().send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        if let Some(frame) = self.frames.pop_front() {
            return Ok(Some(frame));
        }
        let deadline = self.started + Duration::from_micros(deadline_us);
        while let Some(event) = self.next(deadline)? {
            if let Event::Frame(frame) = event
                && frame.standard_id().is_some()
            {
                return Ok(Some(frame));
            }
        }
        Ok(None)
    }

    fn fault_and_remedy(&self) -> Option<String> {
        self.hub.outlets[0].fault_and_remedy()
    }
}
