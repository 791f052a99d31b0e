//! Whole robot on the bench: firmware core, buses, servos and the host's interface, stepped in virtual time in one fixed order.
//!
//! ```text
//!   host ── link0 ── controller ─┬─ act0 ── servos ...
//!                                └─ act1 ── servos ...
//! ```
//!
//! Time advances from event to event. Events at the same time are handled in this order:
//!
//! 1. frames that end, in the order link0, act0, act1, ...; a servo answers at the end of a frame for it
//! 2. packets of serial lines that end, and servos whose turn to send begins
//! 3. delayed frames, faults that start or end, foreign nodes that send: [`crate::faults`]
//! 4. unsolicited frames of drives such as ODrives
//! 5. motors: a step of 1/[`MOTOR_RATE_HZ`]
//! 6. control period: the record of the previous one is closed, the controller's `tick` runs
//!
//! After every event of the controller, its transmit buffers are filled. Each bus has a buffer of one frame. The frame is taken
//! from the controller when the previous one has been transmitted, so that no stale frame waits in hardware. An [`Adapter`] may
//! have a deeper buffer.
//!
//! The controller is a [`Core`]: the firmware within this process, or a board elsewhere that receives time and frames.

mod fault_injection;
mod frames;
mod lines;
mod observer;

use crate::body::Body;
use crate::bus::{BusStatistics, DEFAULT_BITRATE, NodeId, TxPolicy};
use crate::clock::{Periodic, SimTime};
use crate::core::{Core, LocalController};
use crate::faults::{Faults, FramePath};
use crate::ground::{BodySample, Grounded, Moving, Travel};
use crate::interface::{Interface, LogEntry, PacketEntry};
use crate::line::LineStatistics;
use crate::record::{Recorder, TickRecord};
use crate::wire::{ActuatorBus, ActuatorLine, Wire};
use nalgebra::Vector3;
use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_firmware::Settings;
use rollwalk_firmware::player::PlaybackPosition;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::push::Shove;
use rollwalk_protocol::actuators::bus::ControlLoop;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::ClipId;
use rollwalk_protocol::tunnel::{Buses, Input, Step};
use rollwalk_protocol::wire::Node;
use rollwalk_robot::{InvalidRobot, Robot};
use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

pub use fault_injection::Adapter;
use fault_injection::Babbler;
pub use observer::Observer;

/// Rate of the steps of the motors, Hz.
pub const MOTOR_RATE_HZ: u32 = 4000;

/// Queue length of the host's CAN interface, frames; the default of Linux (`txqueuelen`).
const HOST_QUEUE: usize = 10;

/// Robot with its controller and its buses.
pub struct Rig<C = LocalController> {
    now: SimTime,
    controller: C,
    /// Error after which the controller is out of reach; `None` if it can be reached.
    lost: Option<LinkError>,
    config: RobotConfig,
    node: Node,
    link: Wire,
    host: NodeId,
    host_inbox: VecDeque<Frame>,
    /// CAN buses of actuators, by number.
    actuator_buses: BTreeMap<u8, ActuatorBus>,
    /// Serial lines of actuators, by number.
    lines: BTreeMap<u8, ActuatorLine>,
    body: Body,
    motor_step: Periodic,
    control_period: Periodic,
    recorder: Recorder,
    log: Vec<LogEntry>,
    packets: Vec<PacketEntry>,
    adapter: Adapter,
    faults: Faults,
    /// Time up to which faults have been started and ended.
    edges_until: SimTime,
    babblers: Vec<Babbler>,
    observer: Option<Box<dyn Observer>>,
}

/// Kinds of events.
enum NextEvent {
    Link,
    Actuator(u8),
    Line(u8),
    Late(FramePath),
    Edge,
    Babble(usize),
    Drives,
    Motors,
    Control,
}

impl Rig {
    /// Creates a robot in its state after power-on, in its nominal pose, without a library.
    ///
    /// # Errors
    /// Returns an error if the robot violates a rule of robot files.
    pub fn new(robot: &Robot) -> Result<Self, InvalidRobot> {
        let (config, buses) = (robot.controller_config()?, robot.controller_buses());
        Self::with_core(robot, LocalController::new(config, buses, Settings::default()))
    }

    /// Restarts the controller of the robot, as after a power cycle.
    pub fn power_cycled(self) -> Self {
        Self { controller: self.controller.power_cycled(), ..self }
    }
}

impl<C: Core> Rig<C> {
    /// Creates a robot like [`Rig::new`], with a given controller in its state after power-on and the default settings.
    ///
    /// # Errors
    /// Returns an error if the robot violates a rule of robot files.
    pub fn with_core(robot: &Robot, controller: C) -> Result<Self, InvalidRobot> {
        let config = robot.controller_config()?;
        let settings = Settings::default();
        let mut link = Wire::new(DEFAULT_BITRATE);
        let host = link.bus.add_node(TxPolicy::Queue { depth: HOST_QUEUE });

        let body = Body::new(robot);
        let bus_of = |bus: u8| robot.buses.get(&bus).copied().unwrap_or_default();
        let count = body.addresses().iter().map(|&(bus, _)| bus + 1).max().unwrap_or(0);
        let (serial, can): (Vec<_>, Vec<_>) =
            (0..count).map(|bus| (bus, bus_of(bus))).partition(|(_, of)| of.protocol.is_serial());
        let mut actuator_buses: BTreeMap<_, _> =
            can.iter().map(|(bus, of)| (*bus, ActuatorBus::new(of))).collect();
        let mut lines: BTreeMap<_, _> =
            serial.iter().map(|(bus, of)| (*bus, ActuatorLine::new(of))).collect();
        for (channel, (bus, _)) in body.addresses().iter().enumerate() {
            if let Some(ActuatorBus { wire, servos }) = actuator_buses.get_mut(bus) {
                servos.push((wire.bus.add_node(TxPolicy::Latest), channel));
            } else if let Some(line) = lines.get_mut(bus) {
                line.channels.push(channel);
            }
        }

        // On a bus whose control loop the controller closes, setpoints are torques.
        let controls = body.addresses().iter().map(|&(bus, _)| bus_of(bus).control);
        let takes_setpoints = controls.map(|control| control == ControlLoop::InDrive).collect();

        Ok(Self {
            now: SimTime::ZERO,
            controller,
            lost: None,
            recorder: Recorder::new(takes_setpoints),
            config,
            node: Node::new(settings.node).expect("the default node address is valid"),
            link,
            host,
            host_inbox: VecDeque::new(),
            actuator_buses,
            lines,
            body,
            motor_step: Periodic::new(MOTOR_RATE_HZ),
            control_period: Periodic::new(settings.control_hz.into()),
            log: Vec::new(),
            packets: Vec::new(),
            adapter: Adapter::default(),
            faults: Faults::default(),
            edges_until: SimTime::ZERO,
            babblers: Vec::new(),
            observer: None,
        })
    }

    /// Moves a robot in its state after power-on from the stand to the ground, in a hoist and with an IMU. Times of pushes
    /// count from the start of the simulation.
    pub fn onto_ground(self, robot: &Robot, ground: &Arc<dyn Ground>, shoves: Vec<Shove>) -> Self {
        Self { body: Body::on_ground(robot, ground, shoves), ..self }
    }

    /// Replaces the adapter of the actuator buses.
    pub fn set_adapter(&mut self, adapter: Adapter) {
        self.adapter = adapter;
    }

    /// Replaces the link by an idle one with another bitrate, bit/s.
    pub fn set_link_bitrate(&mut self, bitrate: u32) {
        self.link = Wire::new(bitrate);
        self.host = self.link.bus.add_node(TxPolicy::Queue { depth: HOST_QUEUE });
    }

    /// Seeds the random numbers of all faults. Call it before adding the first fault.
    pub fn set_fault_seed(&mut self, seed: u64) {
        self.faults = Faults::new(seed);
    }

    /// Faults and their effects.
    pub fn faults(&self) -> &Faults {
        &self.faults
    }

    /// Passes every frame and every step of the motors to an observer from now on.
    pub fn set_observer(&mut self, observer: impl Observer + 'static) {
        self.observer = Some(Box::new(observer));
    }

    /// Wire of a CAN bus.
    ///
    /// # Panics
    /// Panics if the robot has no such bus.
    fn wire(&mut self, bus: Interface) -> &mut Wire {
        match bus {
            Interface::Link => &mut self.link,
            Interface::Actuator(bus) => {
                let bus = self.actuator_buses.get_mut(&bus);
                &mut bus.expect("a CAN bus of this robot").wire
            }
        }
    }

    /// Present time.
    pub fn now(&self) -> SimTime {
        self.now
    }

    /// Configuration of the robot in its controller.
    pub fn config(&self) -> &RobotConfig {
        &self.config
    }

    /// Address of the controller on the link.
    pub fn node(&self) -> Node {
        self.node
    }

    /// Motors of the robot.
    pub fn body(&self) -> &Body {
        &self.body
    }

    /// Removes and returns the travels of all motions that have ended; empty for a robot on a stand.
    pub fn take_travels(&mut self) -> Vec<Travel> {
        self.body.ground_mut().map(Grounded::take_travels).unwrap_or_default()
    }

    /// Frames of all buses so far, in the order of completion.
    pub fn log(&self) -> &[LogEntry] {
        &self.log
    }

    /// Packets of all serial lines so far, in the order of completion.
    pub fn packets(&self) -> &[PacketEntry] {
        &self.packets
    }

    /// Removes and returns the frames so far, and drops packets and records. Call it regularly for a robot that runs for days.
    pub fn take_log(&mut self) -> Vec<LogEntry> {
        self.recorder.forget();
        self.packets.clear();
        std::mem::take(&mut self.log)
    }

    /// Commanded and measured values of every control period in which the library was played.
    pub fn records(&self) -> &[TickRecord] {
        self.recorder.records()
    }

    /// Load and latencies of every CAN bus since the start, beginning with the link.
    pub fn bus_statistics(&self) -> Vec<(Interface, BusStatistics)> {
        let link = (Interface::Link, self.link.bus.statistics().clone());
        let actuators = self
            .actuator_buses
            .iter()
            .map(|(&number, bus)| (Interface::Actuator(number), bus.wire.bus.statistics().clone()));
        std::iter::once(link).chain(actuators).collect()
    }

    /// Statistics of every serial line since the start.
    pub fn line_statistics(&self) -> Vec<(Interface, LineStatistics)> {
        let lines = self.lines.iter();
        lines.map(|(&bus, line)| (Interface::Actuator(bus), line.line.statistics())).collect()
    }

    /// Controller of the robot.
    pub fn core(&self) -> &C {
        &self.controller
    }

    /// Mutable controller of the robot.
    pub fn core_mut(&mut self) -> &mut C {
        &mut self.controller
    }

    /// Advances time to `until`, including the events at that time.
    pub fn run_until(&mut self, until: SimTime) {
        while self.step(until) {}
        self.now = self.now.max(until);
    }

    /// Handles the next event. Returns false if it is not due by `until`, or if the controller is out of reach.
    fn step(&mut self, until: SimTime) -> bool {
        let (at, next) = self.next_event();
        if at > until || self.lost.is_some() {
            return false;
        }
        self.now = at;
        let noticed = match next {
            NextEvent::Link => self.end_link_frame(),
            NextEvent::Actuator(bus) => self.end_actuator_frame(bus),
            NextEvent::Line(bus) => match self.handle_line_event(bus) {
                Ok(()) => None,
                Err(error) => {
                    self.lost = Some(error);
                    return false;
                }
            },
            NextEvent::Late(path) => match self.faults.pop(at, path) {
                Some(frame) => self.arrive(path, &frame),
                None => return true,
            },
            NextEvent::Edge => {
                self.begin_and_end_faults();
                None
            }
            NextEvent::Babble(index) => {
                self.babble(index);
                return true;
            }
            NextEvent::Drives => {
                self.send_timed_frames(at);
                return true;
            }
            NextEvent::Motors => {
                self.motor_step.advance();
                if let Err(error) = self.body.step(at, 1.0 / f64::from(MOTOR_RATE_HZ)) {
                    self.lost = Some(LinkError::Down(format!(
                        "the simulated world cannot be advanced: {error}"
                    )));
                    return false;
                }
                if let Some(observer) = &mut self.observer {
                    observer.on_motor_step(at, &self.body);
                }
                return true;
            }
            NextEvent::Control => {
                self.control_period.advance();
                self.body.update_loads();
                self.recorder.end_period();
                if let Some(ground) = self.body.ground_mut() {
                    let single = |of: Vector3<f64>| [of.x, of.y, of.z].map(|x| x as f32);
                    self.controller.on_attitude(at.as_us(), single(ground.up_in_body()));
                    if let Some(BodySample { imu, contacts }) = ground.sample() {
                        self.controller.on_contacts(contacts);
                        if let Some(force_m_s2) = imu.force_m_s2 {
                            self.controller.on_imu(single(imu.gyro_rad_s), single(force_m_s2));
                        }
                    }
                }
                Some(Input::Tick)
            }
        };
        let is_tick = matches!(noticed, Some(Input::Tick));
        let reported = if is_tick { self.report_bus_states() } else { Ok(()) };
        if let Err(error) = reported.and_then(|()| self.step_controller(at, noticed)) {
            self.lost = Some(error);
            return false;
        }
        true
    }

    /// Passes an input to the controller and posts its frames on the buses.
    fn step_controller(&mut self, at: SimTime, mut input: Option<Input>) -> Result<(), LinkError> {
        if let (Some(observer), Some(input)) = (&mut self.observer, input) {
            observer.on_controller_input(at, &input);
        }
        loop {
            let depth = self.adapter.depth;
            let mut free = Buses::default();
            if self.link.is_free(1) {
                free = free.with_link();
            }
            for (&bus, actuators) in &self.actuator_buses {
                if actuators.wire.is_free(depth) {
                    free = free.with_actuator(bus);
                }
            }
            let sent = self.controller.step(Step { now_us: at.as_us(), input, free })?;
            let is_tick = input.take() == Some(Input::Tick);
            if is_tick && let Some(ground) = self.body.ground_mut() {
                let clip = sent.playing.map(|(clip, ..)| Moving::Clip(ClipId(clip)));
                let is_streaming = self.controller.is_streaming();
                let loops =
                    sent.playing.is_some_and(|(clip, ..)| self.controller.is_loop(ClipId(clip)));
                let motion = clip.or(is_streaming.then_some(Moving::Setpoints));
                ground.on_moving(at, motion, !loops);
            }
            if is_tick && let Some((clip, frame, phase)) = sent.playing {
                let playing = PlaybackPosition { clip: ClipId(clip), frame, phase };
                let values = self.body.values();
                let offsets = (0..values.len()).map(|of| self.controller.torque_offset(of));
                self.recorder.begin_period(at, playing, values, offsets.collect());
            }
            if let Some(observer) = &mut self.observer {
                let actuators = (0..).map(Interface::Actuator).zip(sent.actuators);
                for (bus, frame) in actuators.chain([(Interface::Link, sent.link)]) {
                    if let Some(frame) = frame {
                        observer.on_controller_frame(at, bus, &frame, &self.body);
                    }
                }
            }
            self.link.fill(at, sent.link);
            for (&bus, actuators) in &mut self.actuator_buses {
                actuators.wire.fill(at, sent.actuators[usize::from(bus)]);
            }
            for (&bus, ActuatorLine { line, .. }) in &mut self.lines {
                if line.is_free()
                    && let Some(packet) = self.controller.poll_serial(bus)?
                {
                    line.send(at, &packet);
                }
            }
            let any = sent.actuators.iter().any(Option::is_some);
            // A deeper buffer accepts several frames at once.
            if depth == 1 || !any {
                return Ok(());
            }
        }
    }

    /// Earliest event. Events at the same time are in the documented order.
    fn next_event(&self) -> (SimTime, NextEvent) {
        let link = self.link.bus.next_completion().map(|at| (at, NextEvent::Link));
        let actuators = self.actuator_buses.iter().filter_map(|(&number, bus)| {
            Some((bus.wire.bus.next_completion()?, NextEvent::Actuator(number)))
        });
        let lines = self.lines.iter();
        let lines =
            lines.filter_map(|(&bus, of)| Some((of.line.next_event()?, NextEvent::Line(bus))));
        let late =
            self.faults.next_due().map(|(at, path)| (at.max(self.now), NextEvent::Late(path)));
        let edge = self.faults.next_edge(self.edges_until).map(|at| (at, NextEvent::Edge));
        let babblers = self.babblers.iter().enumerate().filter(|(_, b)| b.next < b.until);
        let babblers = babblers.map(|(index, b)| (b.next.max(self.now), NextEvent::Babble(index)));
        let drives = self.body.next_timer().map(|at| (at.max(self.now), NextEvent::Drives));
        let motors = (self.motor_step.next(), NextEvent::Motors);
        let control = (self.control_period.next(), NextEvent::Control);
        let frames = link.into_iter().chain(actuators).chain(lines);
        let faults = late.into_iter().chain(edge).chain(babblers);
        // `min_by_key` returns the first of several minima.
        let events = frames.chain(faults).chain(drives).chain([motors, control]);
        events.min_by_key(|&(at, _)| at).expect("control never ends")
    }
}

impl<C: Core> LinkBus for Rig<C> {
    fn now_us(&self) -> u64 {
        self.now.as_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        let queued = self.link.bus.post(self.now, self.host, *frame);
        if let (Some(observer), Ok(())) = (&mut self.observer, &queued) {
            observer.on_host_frame(self.now, frame);
        }
        queued.map_err(|_| LinkError::Busy)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
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
