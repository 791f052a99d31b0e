//! A bus in real time, as a process that takes part in it has it: an outlet for what it sends, and a thread
//! that passes on what is heard. [`Live`] makes the link of a session of one.
//!
//! No queue of ours lies between a program and its bus: an outlet takes a frame only when few others are still
//! on their way, so that a value that has waited can be replaced by a newer one before it is sent, and little that
//! is stale is left to be sent when a dead bus comes back. On a CAN interface a frame is on its way until it has left;
//! on a serial line until the kernel has taken it, whose buffer comes on top. So commands expire by their date.

use crate::link::{LinkBus, LinkError};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::serial::{BusState, Report};
use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

/// What is heard on a bus.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// A frame of another node.
    Frame(Frame),
    /// A frame of ours has left; there is room for another.
    Sent,
    /// The interface is in another error state.
    State(BusState),
    /// A message of the transport, whole: a [`Hub`] has its [`Outlet`] take it apart.
    Message(u16, Vec<u8>),
    /// The board at the other end of a serial line says how it is.
    Report(Report),
}

/// The way out onto a bus.
pub trait Outlet: Send {
    /// Whether it would take a frame now. One that has to say why it takes none any more would, too.
    fn is_free(&self) -> bool;

    /// Sends a frame.
    ///
    /// # Errors
    /// [`LinkError::Busy`] when too many are on their way already, otherwise why the bus is gone.
    fn send(&mut self, frame: &Frame) -> Result<(), LinkError>;

    /// Asks the board at the other end how it is; `false` when this kind of bus cannot ask.
    ///
    /// # Errors
    /// As [`Self::send`].
    fn ask_report(&mut self) -> Result<bool, LinkError> {
        Ok(false)
    }

    /// Takes a message apart that came in whole, with the identifier of its frames.
    fn take_apart(&mut self, _id: u16, _message: &[u8]) {}

    /// A frame that did not come over the bus, but is as good as one that did: of a message that came whole, or
    /// flow control for one that goes whole.
    fn poll_inward(&mut self) -> Option<Frame> {
        None
    }

    /// Bits per second on the bus, if it is a CAN bus and they are known.
    fn bitrate(&self) -> Option<u32> {
        None
    }

    /// What is wrong with the bus, and what would help, if something is known to be.
    fn complaint(&self) -> Option<String> {
        None
    }
}

/// The way in from a bus.
pub trait Inlet: Send {
    /// The next event; `None` after some hundredths of a second without one, so that the listening thread can end.
    ///
    /// # Errors
    /// The bus is gone.
    fn hear(&mut self) -> Result<Option<Heard>, LinkError>;
}

/// Both ways.
pub struct Port {
    /// Out.
    pub outlet: Box<dyn Outlet>,
    /// In.
    pub inlet: Box<dyn Inlet>,
}

/// Time since `start`, µs.
pub(crate) fn since_us(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// Something heard on one of several buses.
type Tagged = (usize, Result<Heard, LinkError>);

/// Several buses, listened to at once.
pub struct Hub {
    /// The ways out, in the order of the ports.
    pub outlets: Vec<Box<dyn Outlet>>,
    /// What ends the thread that listens, of each.
    over: Vec<Arc<AtomicBool>>,
    heard: Receiver<Tagged>,
    sender: Sender<Tagged>,
}

impl Hub {
    /// Starts to listen.
    pub fn new(ports: impl IntoIterator<Item = Port>) -> Self {
        let (sender, heard) = channel();
        let mut hub = Self { outlets: Vec::new(), over: Vec::new(), heard, sender };
        for (index, port) in ports.into_iter().enumerate() {
            let over = hub.listen(index, port.inlet);
            hub.over.push(over);
            hub.outlets.push(port.outlet);
        }
        hub
    }

    /// Lets go of a port that is of no use any more, so that its device can be opened again.
    pub fn close(&mut self, index: usize) {
        self.over[index].store(true, Ordering::Relaxed);
        self.outlets[index] = Box::new(Closed);
    }

    /// Puts another port in the place of one that is gone.
    pub fn replace(&mut self, index: usize, port: Port) {
        self.close(index);
        self.over[index] = self.listen(index, port.inlet);
        self.outlets[index] = port.outlet;
    }

    /// Passes on what is heard, in a thread of its own, until the bus is gone or that is said to be over.
    fn listen(&self, index: usize, mut inlet: Box<dyn Inlet>) -> Arc<AtomicBool> {
        let (sender, over) = (self.sender.clone(), Arc::new(AtomicBool::new(false)));
        let is_over = Arc::clone(&over);
        thread::spawn(move || {
            while !is_over.load(Ordering::Relaxed) {
                let heard = inlet.hear().transpose();
                let is_gone = matches!(heard, Some(Err(_)));
                // Nobody to hear it is noticed in the next round.
                let _ = heard.map(|heard| sender.send((index, heard)));
                if is_gone {
                    return;
                }
            }
        });
        over
    }

    /// What is heard next and on which bus; `None` if nothing is until `deadline`. A bus that is gone says
    /// so once.
    pub fn hear(&mut self, deadline: Instant) -> Option<(usize, Result<Heard, LinkError>)> {
        loop {
            let inward = self.outlets.iter_mut().enumerate();
            let mut inward =
                inward.filter_map(|(index, outlet)| Some((index, outlet.poll_inward()?)));
            if let Some((index, frame)) = inward.next() {
                return Some((index, Ok(Heard::Frame(frame))));
            }
            // Nobody is disconnected while this has a sender itself.
            let wait = deadline.saturating_duration_since(Instant::now());
            match self.heard.recv_timeout(wait).ok()? {
                (index, Ok(Heard::Message(id, bytes))) => {
                    self.outlets[index].take_apart(id, &bytes);
                }
                heard => return Some(heard),
            }
        }
    }
}

impl Drop for Hub {
    fn drop(&mut self) {
        self.over.iter().for_each(|over| over.store(true, Ordering::Relaxed));
    }
}

/// The way out of a port that was let go of.
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
    /// Frames that came while something else was waited for.
    frames: VecDeque<Frame>,
    /// Why the bus is gone, from then on.
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

    /// Asks the board at the other end how it is; `None` if it does not say within `timeout`, or this kind
    /// of bus cannot ask.
    ///
    /// # Errors
    /// [`LinkError::Busy`] when too much is on its way already to ask now, otherwise why the bus is gone.
    pub fn report(&mut self, timeout: Duration) -> Result<Option<Report>, LinkError> {
        if !self.outlet().ask_report()? {
            return Ok(None);
        }
        let deadline = Instant::now() + timeout;
        while let Some(heard) = self.next(deadline)? {
            match heard {
                Heard::Report(report) => return Ok(Some(report)),
                Heard::Frame(frame) if frame.standard_id().is_some() => {
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

    fn next(&mut self, deadline: Instant) -> Result<Option<Heard>, LinkError> {
        if let Some(error) = &self.lost {
            return Err(error.clone());
        }
        match self.hub.hear(deadline) {
            Some((_, Ok(heard))) => Ok(Some(heard)),
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
        while let Some(heard) = self.next(deadline)? {
            if let Heard::Frame(frame) = heard
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
