//! In real time, on buses of this computer: a whole robot behind its link, its controller alone, or its
//! motors alone. So any of them can be replaced by the real one.
//!
//! ```text
//!   [`whole`]        link ─┤ controller, simulated actuator buses, motors ├
//!   [`controller`]   link ─┤ controller ├─ actuator bus, actuator bus ...
//!   [`motors`]                           actuator bus, actuator bus ... ─┤ motors ├
//! ```
//!
//! The computer's clock is read here and nowhere else in this crate.

pub mod controller;
pub mod motors;
pub mod whole;

use rollwalk_bus::link::LinkError;
use rollwalk_bus::port::Outlet;
use rollwalk_protocol::can::CanFrame;
use std::collections::VecDeque;

/// Frames that wait for a busy bus at most: what is older than so many has no worth any more.
const WAITING: usize = 64;

/// What waits for a busy bus, oldest first.
#[derive(Default)]
struct Waiting(VecDeque<CanFrame>);

impl Waiting {
    fn push(&mut self, frame: CanFrame) {
        if self.0.len() == WAITING {
            self.0.pop_front();
        }
        self.0.push_back(frame);
    }

    /// Sends as much as the bus takes.
    fn send(&mut self, outlet: &mut dyn Outlet) -> Result<(), LinkError> {
        while let Some(frame) = self.0.front() {
            match outlet.send(&(*frame).into()) {
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
