//! Simulation in real time on buses of this computer: a whole robot behind its link, its controller alone, or its motors alone.
//! The rest can then be real hardware.
//!
//! ```text
//!   [`whole`]        link ─┤ controller, simulated actuator buses, motors ├
//!   [`controller`]   link ─┤ controller ├─ actuator bus, actuator bus ...
//!   [`motors`]                           actuator bus, actuator bus ... ─┤ motors ├
//! ```
//!
//! The computer's clock is read here and nowhere else in this crate.

mod clock;
pub mod controller;
pub mod motors;
pub mod whole;

use crate::interface::Interface;
use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::{Hub, Outlet, Port};
use rollwalk_protocol::can::Frame;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Interval between attempts to reopen a lost bus. Its adapter may be plugged in again while the robot runs.
const REOPEN_PERIOD: Duration = Duration::from_millis(500);

/// Policy for a lost bus.
pub trait Reopen {
    /// Handles the loss of a bus.
    fn lost(&mut self, bus: Interface, why: &LinkError);

    /// Reopens the bus; `None` if this failed.
    fn reopen(&mut self, bus: Interface) -> Option<Port>;
}

/// Bus of a robot: a port of a hub that is reopened after a loss.
struct RobotBus {
    bus: Interface,
    /// Index of the port in the hub.
    index: usize,
    /// Time of the loss or of the previous attempt to reopen it; `None` while it is open.
    gone: Option<Instant>,
}

impl RobotBus {
    /// Creates an open bus.
    fn new(bus: Interface, index: usize) -> Self {
        Self { bus, index, gone: None }
    }

    /// True if the bus is lost.
    fn is_gone(&self) -> bool {
        self.gone.is_some()
    }

    fn lose(&mut self, hub: &mut Hub, keeper: &mut dyn Reopen, error: &LinkError) {
        if self.gone.replace(Instant::now()).is_none() {
            // An open port would keep its device from being opened again.
            hub.close(self.index);
            keeper.lost(self.bus, error);
        }
    }

    /// Tries to reopen the bus. Returns true if it can be used.
    fn reopen(&mut self, hub: &mut Hub, keeper: &mut dyn Reopen) -> bool {
        self.gone = Some(Instant::now());
        if let Some(port) = keeper.reopen(self.bus) {
            hub.replace(self.index, port);
            self.gone = None;
        }
        self.gone.is_none()
    }

    /// Returns true if the bus can be used. Tries to reopen a lost one every [`REOPEN_PERIOD`].
    fn is_there(&mut self, hub: &mut Hub, keeper: &mut dyn Reopen) -> bool {
        match self.gone {
            None => true,
            Some(since) => since.elapsed() >= REOPEN_PERIOD && self.reopen(hub, keeper),
        }
    }
}

/// Maximum number of frames that wait for a busy bus; older ones are stale.
const WAITING: usize = 64;

/// Frames that wait for a busy bus, oldest first.
#[derive(Default)]
struct FrameQueue(VecDeque<Frame>);

impl FrameQueue {
    fn push(&mut self, frame: Frame) {
        self.push_within(frame, WAITING);
    }

    /// Adds a frame. If more than `most` would wait, drops the oldest one.
    fn push_within(&mut self, frame: Frame, most: usize) {
        if self.0.len() == most {
            self.0.pop_front();
        }
        self.0.push_back(frame);
    }

    /// Sends frames until the bus accepts no more.
    fn send(&mut self, outlet: &mut dyn Outlet) -> Result<(), LinkError> {
        while let Some(frame) = self.0.front() {
            match outlet.send(frame) {
                Ok(()) => {
                    self.0.pop_front();
                }
                Err(LinkError::Busy) => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }
}
