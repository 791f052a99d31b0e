//! Bus and operator in one thread, which sends and receives frames and reopens a lost bus.
//!
//! The single thread is deliberate. A program that cannot read keys or draw for a quarter of a second sends no heartbeat
//! either; the robot then returns to SAFE by itself, or halts if it is streaming.

use super::LinkArgs;
use crate::{Exit, output};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_bus::port::LiveLink;
use rollwalk_host::describe::{has_to_be_cleared, is_at_rest, state_name};
use rollwalk_host::operator::{Message, Operator, View, Weight};
use rollwalk_protocol::can::Frame;
use std::collections::VecDeque;
use std::thread;
use std::time::{Duration, Instant};

/// Maximum time that [`OperatedBus::receive`] listens, µs.
const LISTEN_US: u64 = 10_000;
/// Interval between attempts to open a lost bus, µs.
const REOPEN_US: u64 = 1_000_000;
/// Time between two calls of [`OperatedBus::send`] from which the program counts as suspended, µs.
const SUSPENDED_US: u64 = 1_000_000;
/// Delay before a frame is resent after a full transmit queue, µs.
const BUSY_US: u64 = 500;

/// Operator on a bus.
pub struct OperatedBus<'a> {
    link: &'a LinkArgs,
    bus: Option<LiveLink>,
    /// Operator: sends commands and tracks the state of the robot.
    pub operator: Operator,
    started: Instant,
    /// Time of the previous call of [`send`](Self::send), µs.
    sent_us: u64,
    reopen_us: u64,
    /// Frames received since the previous call of [`received_frames`](Self::received_frames); `None` before the first call.
    heard: Option<Vec<Frame>>,
}

impl<'a> OperatedBus<'a> {
    /// Starts an operator on an open bus.
    pub fn new(link: &'a LinkArgs, bus: LiveLink, operator: Operator) -> Self {
        let (bus, started) = (Some(bus), Instant::now());
        Self { link, bus, operator, started, sent_us: 0, reopen_us: 0, heard: None }
    }

    /// Frames received since the previous call, for data that the operator ignores. The first call returns none and starts the
    /// collection.
    pub fn received_frames(&mut self) -> Vec<Frame> {
        self.heard.replace(Vec::new()).unwrap_or_default()
    }

    /// Time since the start, µs; the clock of the operator.
    pub fn now_us(&self) -> u64 {
        us_since(self.started)
    }

    /// Sends all frames that the operator has ready, and reopens a lost bus.
    pub fn send(&mut self) {
        let now_us = self.now_us();
        let paused_us = now_us - std::mem::replace(&mut self.sent_us, now_us);
        if paused_us > SUSPENDED_US {
            let text = format!(
                "this program was suspended for {:.1} s, and sent no heartbeats",
                paused_us as f64 * 1e-6
            );
            self.operator.notify(now_us, Weight::Warning, text);
        }
        let Some(bus) = &mut self.bus else {
            if now_us >= self.reopen_us {
                self.reopen_us = now_us + REOPEN_US;
                if let Ok(live) = self.link.live() {
                    self.bus = Some(live);
                    self.operator.on_bus_back(now_us);
                }
            }
            return;
        };
        while let Some(frame) = self.operator.poll(now_us) {
            match bus.send(&frame) {
                Ok(()) => {}
                Err(LinkError::Busy) => {
                    self.operator.not_sent(frame);
                    let at_us = bus.now_us() + BUSY_US;
                    return self.receive_until(at_us);
                }
                Err(error) => return self.lose(&error),
            }
        }
    }

    /// Receives frames until the operator has something to do.
    pub fn receive(&mut self) {
        let now_us = self.now_us();
        let wait_us =
            self.operator.next_poll_us(now_us).saturating_sub(now_us).clamp(BUSY_US, LISTEN_US);
        match &self.bus {
            Some(bus) => {
                let until_us = bus.now_us() + wait_us;
                self.receive_until(until_us);
            }
            None => thread::sleep(Duration::from_micros(LISTEN_US)),
        }
    }

    /// Passes the diagnosis of the bus to the operator.
    pub fn diagnose(&mut self) {
        let now_us = self.now_us();
        if let Some(bus) = &self.bus {
            self.operator.on_complaint(now_us, bus.fault_and_remedy());
        }
    }

    fn receive_until(&mut self, until_us: u64) {
        let Some(bus) = &mut self.bus else { return };
        let mut until_us = until_us;
        loop {
            match bus.receive(until_us) {
                Ok(Some(frame)) => {
                    self.operator.on_frame(us_since(self.started), &frame);
                    self.heard.iter_mut().for_each(|heard| heard.push(frame));
                    // Reads the frames that have already arrived, because an answer may be due at once.
                    if bus.now_us() >= until_us {
                        return;
                    }
                    until_us = bus.now_us();
                }
                Ok(None) => return,
                Err(error) => return self.lose(&error),
            }
        }
    }

    fn lose(&mut self, error: &LinkError) {
        let why = match error {
            LinkError::Down(why) => why.clone(),
            LinkError::Busy => error.to_string(),
        };
        let now_us = self.now_us();
        self.bus = None;
        self.reopen_us = now_us + REOPEN_US;
        self.operator.on_bus_lost(now_us, &why);
    }
}

fn us_since(start: Instant) -> u64 {
    u64::try_from(start.elapsed().as_micros()).unwrap_or(u64::MAX)
}

/// Prints the state in which an operator left the robot. Returns [`Exit::NotDone`] if the robot was stopped, still has torque
/// or never answered.
pub fn report_exit(view: &View) -> Exit {
    let (Some(status), Some(condition)) = (view.status, &view.condition) else {
        output::print_line("the controller never answered; `rollwalk doctor` finds the cause");
        return Exit::NotDone;
    };
    if is_at_rest(&status) {
        output::print_line(format_args!("the robot is {}", state_name(status.state)));
        return Exit::Ok;
    }
    if has_to_be_cleared(&status) {
        output::print_line(format_args!(
            "the robot is {condition}; type `rollwalk clear` before arming it"
        ));
    } else {
        output::print_line(format_args!(
            "the program ends while the robot is {condition}: without heartbeats the robot returns \
             to SAFE and switches torque off; type `rollwalk clear` before arming it"
        ));
    }
    Exit::NotDone
}

/// Prints the operator's messages that were not printed yet.
pub fn print_new_messages(said: &mut Option<Message>, messages: &VecDeque<Message>) {
    let known = |message: &Message| said.as_ref() == Some(message);
    let next = messages.iter().rposition(known).map_or(0, |last| last + 1);
    for message in messages.iter().skip(next) {
        output::print_line(format_args!("{:7.1} s: {}", message.at_us as f64 * 1e-6, message.text));
    }
    *said = messages.back().cloned();
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_protocol::faults::{Fault, FaultBits};
    use rollwalk_protocol::wire::{Node, State, Status};

    /// The exit code follows from the state in which the robot was left.
    #[test]
    fn only_a_robot_at_rest_is_done() {
        let node = Node::new(1).unwrap();
        assert_eq!(report_exit(&Operator::new(node, None).view(0)), Exit::NotDone);
        let left = |state: State, faults: FaultBits| {
            let mut operator = Operator::new(node, None);
            let severity = state.severity(faults);
            let status =
                Status { state, severity, faults, clip: None, frame: 0, counter: 0, library: 0 };
            operator.on_frame(0, &status.encode(node));
            report_exit(&operator.view(0))
        };
        let none = FaultBits::default();
        for state in [State::Boot, State::SelfTest, State::Disarmed, State::TorqueOff] {
            assert_eq!(left(state, none), Exit::Ok, "{state:?}");
        }
        assert_eq!(left(State::Disarmed, none.with(Fault::NoLibrary)), Exit::Ok);
        for fault in [Fault::HostLost, Fault::ActuatorFault, Fault::SetpointTimeout] {
            assert_eq!(left(State::TorqueOff, none.with(fault)), Exit::NotDone, "{fault:?}");
        }
        for fault in [Fault::EStop, Fault::BusOff] {
            assert_eq!(left(State::EStopped, none.with(fault)), Exit::NotDone, "{fault:?}");
        }
        for state in
            [State::Ready, State::Playing, State::Streaming, State::Returning, State::Damped]
        {
            assert_eq!(left(state, none), Exit::NotDone, "{state:?}");
        }
    }
}
