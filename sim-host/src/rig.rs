//! The whole robot on the bench: firmware core, buses, servos and the host's interface, stepped in
//! virtual time in one fixed order.
//!
//! ```text
//!   host ── link0 ── controller ─┬─ act0 ── servos ...
//!                                └─ act1 ── servos ...
//! ```
//!
//! Time jumps from event to event. Events at the same instant happen in this order:
//!
//! 1. frames that end: link0, act0, act1, ...; a servo answers at the end of a frame meant for it
//! 2. motors: a step of 1/[`MOTOR_RATE_HZ`]
//! 3. control period: the record of the past one is closed, the controller's `tick` runs
//!
//! After every event that the controller notices, its transmit buffers are filled: one frame for each
//! bus, taken from the controller when the one before has left, so that nothing stale waits in hardware.
//!
//! The controller itself is a [`Core`]: the firmware within this process, or a board elsewhere
//! ([`crate::remote`]) to which time and frames are carried.

use crate::body::Body;
use crate::bus::{BusStatistics, CanBus, DEFAULT_BITRATE, NodeId, TxPolicy};
use crate::clock::{Periodic, SimTime};
use crate::core::{Core, Local};
use crate::interface::{Interface, LogEntry};
use crate::record::{Recorder, TickRecord};
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_firmware::Settings;
use rollwalk_firmware::player::Playing;
use rollwalk_protocol::can::CanFrame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::tunnel::{Buses, Input, Step};
use rollwalk_protocol::wire::Node;
use rollwalk_robot::{InvalidRobot, Robot};
use std::collections::VecDeque;

/// Steps of the motors per second.
pub const MOTOR_RATE_HZ: u32 = 4000;

/// Frames that wait in the host's CAN interface at most; the default of Linux (`txqueuelen`).
const HOST_QUEUE: usize = 10;

/// A robot, its controller and its buses.
pub struct Rig<C = Local> {
    now: SimTime,
    controller: C,
    /// Why the controller is out of reach, from then on.
    lost: Option<LinkError>,
    config: RobotConfig,
    node: Node,
    link: Wire,
    host: NodeId,
    host_inbox: VecDeque<CanFrame>,
    actuator_buses: Vec<ActuatorBus>,
    body: Body,
    motor_step: Periodic,
    control_period: Periodic,
    recorder: Recorder,
    log: Vec<LogEntry>,
}

/// A bus and the controller's place on it.
struct Wire {
    bus: CanBus,
    controller: NodeId,
}

impl Wire {
    fn new() -> Self {
        let mut bus = CanBus::new(DEFAULT_BITRATE);
        let controller = bus.add_node(TxPolicy::Queue { depth: 1 });
        Self { bus, controller }
    }

    /// Whether the controller's transmit buffer is empty.
    fn is_free(&self) -> bool {
        self.bus.pending(self.controller) == 0
    }

    /// Fills the controller's transmit buffer, which is empty.
    fn fill(&mut self, now: SimTime, frame: Option<CanFrame>) {
        if let Some(frame) = frame {
            self.bus.post(now, self.controller, frame).expect("the buffer is empty");
        }
    }
}

/// An actuator bus with node and channel of each servo on it.
struct ActuatorBus {
    wire: Wire,
    servos: Vec<(NodeId, usize)>,
}

/// What happens next.
enum Next {
    Link,
    Actuator(usize),
    Motors,
    Control,
}

impl Rig {
    /// A robot that has just been switched on, in its nominal pose, without a library.
    ///
    /// # Errors
    /// The robot breaks a rule of robot files.
    pub fn new(robot: &Robot) -> Result<Self, InvalidRobot> {
        let local = Local::new(robot.controller_config()?, Settings::default());
        Self::with_core(robot, local)
    }

    /// The same robot after the power of its controller was off for a moment.
    pub fn power_cycled(self) -> Self {
        Self { controller: self.controller.power_cycled(), ..self }
    }
}

impl<C: Core> Rig<C> {
    /// The same with a controller elsewhere, which has just been switched on and has the default
    /// settings.
    ///
    /// # Errors
    /// The robot breaks a rule of robot files.
    pub fn with_core(robot: &Robot, controller: C) -> Result<Self, InvalidRobot> {
        let config = robot.controller_config()?;
        let settings = Settings::default();
        let mut link = Wire::new();
        let host = link.bus.add_node(TxPolicy::Queue { depth: HOST_QUEUE });

        let body = Body::new(robot);
        let count = body.addresses().iter().map(|&(bus, _)| usize::from(bus) + 1).max();
        let mut actuator_buses: Vec<_> = (0..count.unwrap_or(0))
            .map(|_| ActuatorBus { wire: Wire::new(), servos: Vec::new() })
            .collect();
        for (channel, &(bus, _)) in body.addresses().iter().enumerate() {
            let ActuatorBus { wire, servos } = &mut actuator_buses[usize::from(bus)];
            servos.push((wire.bus.add_node(TxPolicy::Latest), channel));
        }

        Ok(Self {
            now: SimTime::ZERO,
            controller,
            lost: None,
            recorder: Recorder::new(&config),
            config,
            node: Node::new(settings.node).expect("the default address is one"),
            link,
            host,
            host_inbox: VecDeque::new(),
            actuator_buses,
            body,
            motor_step: Periodic::new(MOTOR_RATE_HZ),
            control_period: Periodic::new(settings.control_hz.into()),
            log: Vec::new(),
        })
    }

    /// The present instant.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// The robot as its controller knows it.
    pub fn config(&self) -> &RobotConfig {
        &self.config
    }

    /// The controller's address on the link.
    pub fn node(&self) -> Node {
        self.node
    }

    /// The motors.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Every frame of every bus so far, in the order in which they ended.
    pub fn log(&self) -> &[LogEntry] {
        &self.log
    }

    /// The log so far, which begins anew; the records are thrown away. For a robot that runs for days.
    pub fn take_log(&mut self) -> Vec<LogEntry> {
        self.recorder.forget();
        std::mem::take(&mut self.log)
    }

    /// What was commanded and measured in every control period in which the library was played.
    pub fn records(&self) -> &[TickRecord] {
        self.recorder.records()
    }

    /// Load and latencies of every bus since the start, link first.
    pub fn bus_statistics(&self) -> Vec<(Interface, BusStatistics)> {
        let link = (Interface::Link, self.link.bus.statistics().clone());
        let actuators = self.actuator_buses.iter().enumerate().map(|(index, bus)| {
            (Interface::Actuator(index as u8), bus.wire.bus.statistics().clone())
        });
        std::iter::once(link).chain(actuators).collect()
    }

    /// The controller.
    pub fn core_mut(&mut self) -> &mut C {
        &mut self.controller
    }

    /// Lets time pass up to `until`, events at that very instant included.
    pub fn run_until(&mut self, until: SimTime) {
        while self.step(until) {}
        self.now = self.now.max(until);
    }

    /// Handles the next event if it is due by `until`. Nothing happens any more once the controller is
    /// out of reach.
    fn step(&mut self, until: SimTime) -> bool {
        let (at, next) = self.next_event();
        if at > until || self.lost.is_some() {
            return false;
        }
        self.now = at;
        let input = match next {
            Next::Link => self.end_link_frame(),
            Next::Actuator(bus) => self.end_actuator_frame(bus),
            Next::Motors => {
                self.motor_step.advance();
                self.body.step(at, 1.0 / f64::from(MOTOR_RATE_HZ));
                return true;
            }
            Next::Control => {
                self.control_period.advance();
                self.body.update_loads();
                self.recorder.end_period();
                Some(Input::Tick)
            }
        };
        if let Err(error) = self.tell(at, input) {
            self.lost = Some(error);
            return false;
        }
        true
    }

    /// Tells the controller what happened, and puts on the buses what it sends.
    fn tell(&mut self, at: SimTime, input: Option<Input>) -> Result<(), LinkError> {
        let mut free = Buses::default();
        if self.link.is_free() {
            free = free.with_link();
        }
        for (bus, actuators) in (0..).zip(&self.actuator_buses) {
            if actuators.wire.is_free() {
                free = free.with_actuator(bus);
            }
        }
        let sent = self.controller.step(Step { now_us: at.as_us(), input, free })?;
        if input == Some(Input::Tick)
            && let Some((clip, frame, phase)) = sent.playing
        {
            let playing = Playing { clip: ClipId(clip), frame, phase };
            self.recorder.begin_period(at, playing, self.body.values());
        }
        self.link.fill(at, sent.link);
        for (actuators, frame) in self.actuator_buses.iter_mut().zip(sent.actuators) {
            actuators.wire.fill(at, frame);
        }
        Ok(())
    }

    /// The earliest event; of those at the same instant the first in the documented order.
    fn next_event(&self) -> (SimTime, Next) {
        let link = self.link.bus.next_completion().map(|at| (at, Next::Link));
        let actuators = self.actuator_buses.iter().enumerate().filter_map(|(index, bus)| {
            Some((bus.wire.bus.next_completion()?, Next::Actuator(index)))
        });
        let motors = (self.motor_step.next(), Next::Motors);
        let control = (self.control_period.next(), Next::Control);
        let frames = link.into_iter().chain(actuators);
        // `min_by_key` returns the first of several minima.
        frames.chain([motors, control]).min_by_key(|&(at, _)| at).expect("control never ends")
    }

    /// What the controller notices of it.
    fn end_link_frame(&mut self) -> Option<Input> {
        let delivery = self.link.bus.next_delivery(self.now)?;
        self.log.push(LogEntry {
            at_us: delivery.at.as_us(),
            interface: Interface::Link,
            frame: delivery.frame.into(),
        });
        if delivery.from == self.host {
            return Some(Input::Link(delivery.frame));
        }
        self.host_inbox.push_back(delivery.frame);
        None
    }

    /// What the controller notices of it.
    fn end_actuator_frame(&mut self, index: usize) -> Option<Input> {
        let ActuatorBus { wire, servos } = &mut self.actuator_buses[index];
        let delivery = wire.bus.next_delivery(self.now)?;
        let (frame, number) = (&delivery.frame, index as u8);
        let interface = Interface::Actuator(number);
        let entry =
            LogEntry { at_us: delivery.at.as_us(), interface, frame: delivery.frame.into() };
        self.log.push(entry);
        if delivery.from != wire.controller {
            return Some(Input::Actuator(number, *frame));
        }
        self.recorder.on_setpoint(number, frame);
        for &(node, channel) in servos.iter() {
            if let Some(answer) = self.body.on_frame(channel, self.now, frame) {
                wire.bus.post(self.now, node, answer).expect("a `Latest` node always takes frames");
            }
        }
        None
    }
}

impl<C: Core> LinkBus for Rig<C> {
    fn now_us(&self) -> u64 {
        self.now.as_us()
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), LinkError> {
        self.link.bus.post(self.now, self.host, *frame).map_err(|_| LinkError::Busy)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<CanFrame>, LinkError> {
        let deadline = SimTime::from_us(deadline_us);
        while self.host_inbox.is_empty() && self.step(deadline) {}
        if let Some(error) = &self.lost {
            return Err(error.clone());
        }
        let frame = self.host_inbox.pop_front();
        if frame.is_none() {
            self.now = self.now.max(deadline);
        }
        Ok(frame)
    }
}
