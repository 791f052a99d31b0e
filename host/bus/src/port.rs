//! Buses in real time: an outlet that sends frames, and a thread that receives them. [`Live`] turns one into the
//! link of a session.
//!
//! There is no transmit queue between a program and its bus: an outlet accepts a frame only while few others are in
//! flight. A waiting setpoint can therefore be superseded by a newer one, and few stale frames go out when a dead bus
//! recovers. On a CAN interface a frame is in flight until it is transmitted; on a serial line until the kernel has
//! accepted it, whose buffer comes on top. So commands carry a time at which they expire.

use crate::link::{LinkBus, LinkError};
use crate::priority;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{BusState, Report};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// An event on a bus.
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A frame of another node.
    Frame(Frame),
    /// A frame of ours was transmitted; there is room for another.
    Sent,
    /// The interface has changed its error state.
    State(BusState),
    /// A whole message of the transport, by identifier: a [`Hub`] has its [`Outlet`] segment it into frames.
    Message(u16, Vec<u8>),
    /// Status report of the board at the other end of a serial line.
    Report(Report),
    /// Bytes of a serial line of actuators, in portions of any size.
    Bytes(Vec<u8>),
}

/// Transmitting end of a bus.
pub trait Outlet: Send {
    /// True if [`Self::send`] would not return [`LinkError::Busy`]: it would take a frame, or report that the bus is gone.
    fn is_free(&self) -> bool;

    /// Sends a frame.
    ///
    /// # Errors
    /// [`LinkError::Busy`] when too many frames are in flight, otherwise why the bus is gone.
    fn send(&mut self, frame: &Frame) -> Result<(), LinkError>;

    /// True for a serial line of actuators, which carries bytes instead of frames.
    fn carries_bytes(&self) -> bool {
        false
    }

    /// Sends a packet of bytes.
    ///
    /// # Errors
    /// As [`Self::send`]; this bus carries frames.
    fn send_bytes(&mut self, _bytes: &[u8]) -> Result<(), LinkError> {
        Err(LinkError::Down("it carries frames, no bytes".into()))
    }

    /// Requests a status report from the board at the other end; `false` when this kind of bus cannot.
    ///
    /// # Errors
    /// As [`Self::send`].
    fn ask_report(&mut self) -> Result<bool, LinkError> {
        Ok(false)
    }

    /// Segments a message that arrived whole into frames with identifier `id`, for [`Self::poll_inward`].
    fn take_apart(&mut self, _id: u16, _message: &[u8]) {}

    /// The next frame made at this end instead of received: of a message that arrived whole, or flow control for one
    /// that is sent whole.
    fn poll_inward(&mut self) -> Option<Frame> {
        None
    }

    /// Bits per second on the bus, if it is a CAN bus and they are known.
    fn bitrate(&self) -> Option<u32> {
        None
    }

    /// A known fault of the bus and its remedy.
    fn complaint(&self) -> Option<String> {
        None
    }
}

/// Receiving end of a bus.
pub trait Inlet: Send {
    /// The next event; `None` after some hundredths of a second without one, so that the listening thread can end.
    ///
    /// # Errors
    /// The bus is gone.
    fn next_event(&mut self) -> Result<Option<Event>, LinkError>;
}

/// Transmitting and receiving ends of a bus.
pub struct Port {
    /// Transmits.
    pub outlet: Box<dyn Outlet>,
    /// Receives.
    pub inlet: Box<dyn Inlet>,
}

/// Time since `start`, µs.
pub(crate) fn since_us(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// An event with the index of its bus.
type Tagged = (usize, Result<Event, LinkError>);

/// Several buses, listened to at once.
pub struct Hub {
    /// Outlets, in the order of the ports.
    pub outlets: Vec<Box<dyn Outlet>>,
    /// Flag of each listening thread that ends it.
    over: Vec<Arc<AtomicBool>>,
    events: Receiver<Tagged>,
    sender: Sender<Tagged>,
}

impl Hub {
    /// Starts a listening thread for each port.
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
        self.outlets[index] = Box::new(Closed);
    }

    /// Replaces a port that has failed.
    pub fn replace(&mut self, index: usize, port: Port) {
        self.close(index);
        self.over[index] = self.listen(index, port.inlet);
        self.outlets[index] = port.outlet;
    }

    /// Starts a thread that passes on the inlet's events until the bus is gone or the returned flag is set.
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

    /// The next event and the index of its bus; `None` at `deadline`. A bus that is gone reports it once.
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
struct Closed;

impl Outlet for Closed {
    fn is_free(&self) -> bool {
        false
    }

    fn send(&mut self, _frame: &Frame) -> Result<(), LinkError> {
        Err(LinkError::Down("it is closed".into()))
    }
}

/// A link in real time.
pub struct Live {
    hub: Hub,
    /// Frames that arrived while [`Self::report`] waited.
    frames: VecDeque<Frame>,
    /// Reason for which the bus is gone, if it is.
    lost: Option<LinkError>,
    started: Instant,
}

impl Live {
    /// The link over a port.
    pub fn new(port: Port) -> Self {
        let (frames, started) = (VecDeque::new(), Instant::now());
        Self { hub: Hub::new([port]), frames, lost: None, started }
    }

    fn outlet(&mut self) -> &mut dyn Outlet {
        self.hub.outlets[0].as_mut()
    }

    /// Requests the status report of the board at the other end; `None` without an answer within `timeout`, or if
    /// this kind of bus cannot ask.
    ///
    /// # Errors
    /// [`LinkError::Busy`] when too many frames are in flight to ask now, otherwise why the bus is gone.
    pub fn report(&mut self, timeout: Duration) -> Result<Option<Report>, LinkError> {
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

    /// Bits per second on the bus, if it is a CAN bus and they are known.
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

impl LinkBus for Live {
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

    fn complaint(&self) -> Option<String> {
        self.hub.outlets[0].complaint()
    }
}
