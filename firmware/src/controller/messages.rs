//! Messages of the host link: decodes requests and commands, executes them and produces the answers.

use rollwalk_protocol::actuator::ActuatorStatus;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::faults::{Event, Fault, FaultBits};
use rollwalk_protocol::library::{FORMAT_MAJOR, FORMAT_MINOR, NodeId, PlaceCode};
use rollwalk_protocol::wire::authentication::request_id;
use rollwalk_protocol::wire::transport::{Hello, MAX_BLOCK, Reply, TransferResult, TransportError};
use rollwalk_protocol::wire::{
    Action, ActuatorReadings, Command, CommandAck, CommandResult, DecodeError, Discovered,
    EstopAck, FaultReport, JointTelemetry, Node, PROTOCOL_MAJOR, PROTOCOL_MINOR, ParameterAck,
    ParameterRequest, Request, Response, SCHEMA_HASH, Sample, State, ToController, Torque,
};

use super::Controller;
use crate::actuators::Readings;
use crate::authentication::Admission;
use crate::gate::{Permit, Verdict};
use crate::imu::{Imu, SampleContent};
use crate::link::Outgoing;
use crate::motion::Setup;
use crate::player::PLANNED_SPEED_64THS;
use crate::store::{LibraryStore, ParameterStore};
use crate::track::Tracking;
use crate::tuning::{self, Robot};

/// Lowest rate of samples of a tracked robot, Hz.
const SLOWEST_HZ: u16 = 20;

/// Largest number of frames a second of a tracked robot's link: 95 % of 1 Mbit/s, with 8 bytes and most stuffing bits each.
const MOST_LINK_FRAMES: u32 = 7000;
/// Number of frames of a sample and its answer in addition to one JOINT and one SETPOINT for each channel.
const SAMPLE_FRAMES: u32 = 4;

/// Values acknowledged with an accepted command: the motion, and a nonce or a number of frames.
type AcknowledgedValues = (Option<NodeId>, u16);

impl<S: LibraryStore, P: ParameterStore> Controller<S, P> {
    /// Processes a frame of the link. Ignores frames for other nodes, and counts damaged ones.
    pub fn on_link_frame(&mut self, now_us: u64, frame: &Frame) {
        if self.authentication.keep(self.link.node, frame) {
            return;
        }
        let (to, message) = match ToController::decode(frame) {
            Ok(received) => received,
            Err(DecodeError::OtherMessage) => return,
            Err(DecodeError::BadLength | DecodeError::BadCrc | DecodeError::BadValue) => {
                self.link.damaged_frames = self.link.damaged_frames.saturating_add(1);
                return;
            }
        };
        if !self.link.is_for_us(to) {
            return;
        }
        match message {
            ToController::Estop => {
                self.raise(now_us, Event::EStop);
                self.link.acknowledge_estop();
            }
            ToController::Heartbeat(heartbeat) => {
                // A late heartbeat must not hide the timeout, even if it arrives before the next tick.
                self.notice_lost_host(now_us);
                let timeout_us = self.setup.settings.heartbeat_timeout_us;
                match self.admit_frame(now_us, frame) {
                    Admission::Admitted => self.link.on_heartbeat(now_us, heartbeat, timeout_us),
                    // A host without the key receives the clock. The answers to its commands then report that authentication is
                    // missing.
                    Admission::Missing => self.link.answer_heartbeat(now_us, heartbeat),
                    // Without answers, a host notices that its session has ended.
                    Admission::Wrong => {}
                }
            }
            ToController::Command(command) => {
                if self.admit_frame(now_us, frame) == Admission::Admitted {
                    self.on_command(now_us, command);
                } else {
                    self.refuse_command(command);
                }
            }
            // The transport is point to point, because answers to a broadcast would collide. Set-points are for one robot.
            ToController::Transport | ToController::Setpoint(_) if to == Node::BROADCAST => {}
            ToController::Setpoint(setpoint) => self.motion.stream(&self.setup, &setpoint),
            ToController::Transport => {
                if self.link.on_transport(now_us, frame.data()) {
                    self.on_request(now_us);
                }
            }
            ToController::Parameter(request) => {
                let ack = if self.admit_frame(now_us, frame) == Admission::Admitted {
                    self.tune(frame, request)
                } else {
                    // The request bypasses the tuning, because it must not advance the sequence of the host's requests.
                    tuning::unauthenticated(request)
                };
                self.link.acknowledge_parameter(ack);
            }
            ToController::Discover => self.link.discover(),
        }
    }

    /// Returns the next frame for the link; `None` if nothing is pending.
    pub fn poll_link(&mut self, now_us: u64) -> Option<Frame> {
        let node = self.link.node?;
        let channels = self.setup.config.channels.len() as u8;
        // Channels without telemetry or readings, and a missing IMU, are skipped; all other messages are sent in order.
        for _ in 0..=channels.saturating_add(3) {
            let frame = match self.link.next(now_us, channels)? {
                Outgoing::EstopAck => Some(EstopAck { state: self.state() }.encode(node)),
                Outgoing::HeartbeatReply(reply) => Some(reply.encode(node)),
                Outgoing::FaultReport { bit, counter } => {
                    self.fault_report(now_us, bit, counter).map(|report| report.encode(node))
                }
                Outgoing::Status { counter } => Some(self.status(counter).encode(node)),
                Outgoing::CommandAck(ack) => Some(ack.encode(node)),
                Outgoing::ParameterAck(ack) => Some(ack.encode(node)),
                Outgoing::Telemetry { channel } => self.telemetry(channel).map(|t| t.encode(node)),
                Outgoing::Readings { channel } => self.readings(channel).map(|r| r.encode(node)),
                Outgoing::Gyro => self.imu.sampled().gyro.map(|gyro| gyro.encode(node)),
                Outgoing::Accelerometer => {
                    self.imu.sampled().accelerometer.map(|of| of.encode(node))
                }
                Outgoing::Sample { number } => {
                    let SampleContent { answered, contacts, .. } = self.imu.sampled();
                    Some(Sample { number, answered, contacts }.encode(node))
                }
                Outgoing::Frame(frame) => Some(frame),
                Outgoing::Discovered => {
                    let uid = self.setup.settings.uid;
                    Some(Discovered { uid, protocol_major: PROTOCOL_MAJOR }.encode(node))
                }
            };
            if frame.is_some() {
                return frame;
            }
        }
        None
    }

    fn on_command(&mut self, now_us: u64, command: Command) {
        let outcome = match self.gate.judge(now_us, command) {
            Verdict::Repeat(ack) => {
                self.link.acknowledge(ack);
                return;
            }
            Verdict::Refuse(result) => Err(result),
            Verdict::Execute => self.execute(now_us, command.action),
        };
        let (result, (motion, value)) = match outcome {
            Ok(done) => (CommandResult::Ok, done),
            Err(result) => (result, (None, 0)),
        };
        let ack = CommandAck {
            seq: command.seq,
            kind: command.action.kind(),
            result,
            state: self.state(),
            motion: motion.map(|node| node.0),
            value,
        };
        self.gate.answered(now_us, command, ack);
        self.link.acknowledge(ack);
    }

    /// Refuses a command that is not authentic. The command bypasses the gate, because it must not advance the host's sequence.
    fn refuse_command(&mut self, command: Command) {
        self.link.acknowledge(CommandAck {
            seq: command.seq,
            kind: command.action.kind(),
            result: CommandResult::AuthenticationRequired,
            state: self.state(),
            motion: None,
            value: 0,
        });
    }

    fn execute(
        &mut self,
        now_us: u64,
        action: Action,
    ) -> Result<AcknowledgedValues, CommandResult> {
        const NOTHING_TO_SAY: AcknowledgedValues = (None, 0);
        match action {
            Action::Play { code, speed_64ths } => self.play(now_us, code, speed_64ths, None),
            Action::PlayAt { code, speed_64ths, place } => {
                self.play(now_us, code, speed_64ths, Some(place))
            }
            Action::Stream => {
                self.may_stream()?;
                self.motion.want_tracking(None);
                self.raise(now_us, Event::StreamStarted);
                Ok(NOTHING_TO_SAY)
            }
            Action::Track { rate_hz, kp_percent, kd_percent } => {
                self.may_stream()?;
                let control_hz = self.setup.settings.control_hz;
                let tracking = self.tracking(rate_hz, [kp_percent, kd_percent])?;
                self.motion.want_tracking(Some(tracking));
                // Earlier measurements belong to no sample.
                self.imu = Imu::default();
                self.raise(now_us, Event::StreamStarted);
                Ok((None, control_hz.checked_div(tracking.periods).unwrap_or(0)))
            }
            Action::Return if self.state() == State::Streaming => {
                self.raise(now_us, Event::StreamEnded);
                Ok((self.storage.library().map(|library| library.safe_node()), 0))
            }
            Action::Return => {
                let safe = self.storage.library().map(|library| library.safe_node());
                self.go(now_us, safe.ok_or(CommandResult::NoLibrary))
            }
            Action::Disarm => {
                // The operator who was about to arm has decided otherwise.
                self.gate.void();
                self.raise(now_us, Event::Disarm);
                Ok(NOTHING_TO_SAY)
            }
            Action::ArmRequest => {
                self.may_arm(now_us)?;
                Ok((None, self.gate.draw(now_us, Permit::Arm)))
            }
            Action::ArmConfirm { nonce } => {
                self.redeem(now_us, Permit::Arm, nonce)?;
                self.may_arm(now_us)?;
                self.raise(now_us, Event::ArmConfirmed);
                Ok(NOTHING_TO_SAY)
            }
            Action::ClearRequest => {
                self.may_clear()?;
                Ok((None, self.gate.draw(now_us, Permit::Clear)))
            }
            Action::ClearConfirm { nonce } => {
                self.may_clear()?;
                self.redeem(now_us, Permit::Clear, nonce)?;
                self.raise(now_us, Event::ClearConfirmed);
                Ok(NOTHING_TO_SAY)
            }
            Action::Pause => {
                self.may(State::Playing, State::Paused)?;
                self.raise(now_us, Event::PauseAsked);
                Ok(NOTHING_TO_SAY)
            }
            Action::Resume => {
                self.may(State::Paused, State::Playing)?;
                self.raise(now_us, Event::ResumeAsked);
                Ok(NOTHING_TO_SAY)
            }
            Action::Unknown { .. } => Err(CommandResult::UnknownKind),
        }
    }

    fn redeem(&mut self, now_us: u64, permit: Permit, nonce: u16) -> Result<(), CommandResult> {
        let good = self.gate.redeem(now_us, permit, nonce);
        if good { Ok(()) } else { Err(CommandResult::WrongNonce) }
    }

    /// Checks that arming is possible now. Reports the conditions that prevent it as faults.
    fn may_arm(&mut self, now_us: u64) -> Result<(), CommandResult> {
        let obstacle = |fault| (CommandResult::FaultPresent, FaultBits::default().with(fault));
        let (result, faults) = if self.state() != State::Disarmed {
            (CommandResult::WrongState, FaultBits::default())
        } else if self.storage.library().is_none() {
            let other = self.storage.is_for_another_robot();
            (
                if other { CommandResult::ConfigMismatch } else { CommandResult::NoLibrary },
                self.faults(),
            )
        } else if !self.bus_watch.faults().is_empty() {
            (CommandResult::FaultPresent, self.bus_watch.faults())
        } else if self.host_silent(now_us) {
            obstacle(Fault::HostLost)
        } else if self.setup.settings.imu_required && !self.tilt.is_awake(now_us) {
            obstacle(Fault::Tilt)
        } else if self.motion.actuators.health().faulty {
            obstacle(Fault::ActuatorFault)
        } else if !self.motion.actuators_are_fresh(&self.setup)
            // An actuator that missed "off" would resume its previous setpoint.
            || !self.motion.actuators.are_confirmed_off()
        {
            (CommandResult::PoseUnknown, FaultBits::default().with(Fault::ActuatorSilent))
        } else if self.motion.implausible(&self.setup).is_some() {
            (CommandResult::PoseUnknown, FaultBits::default().with(Fault::OutOfLimits))
        } else {
            return Ok(());
        };
        self.link.report(faults);
        Err(result)
    }

    /// Checks that the controller may go from one state to another, or is already in `to`.
    fn may(&self, from: State, to: State) -> Result<(), CommandResult> {
        match self.state() {
            state if state == from || state == to => Ok(()),
            state if state.torque() == Torque::Driven => Err(CommandResult::WrongState),
            _ => Err(CommandResult::NotArmed),
        }
    }

    /// Checks that the controller may follow streamed set-points, which carry neither signature nor authenticator.
    fn may_stream(&self) -> Result<(), CommandResult> {
        let has_owner =
            self.authentication.requires_key() || self.storage.store().requires_signatures();
        match self.state() {
            _ if has_owner => Err(CommandResult::Unproven),
            State::Ready => Ok(()),
            state if state.torque() == Torque::Driven => Err(CommandResult::WrongState),
            _ => Err(CommandResult::NotArmed),
        }
    }

    /// Tracking settings for a host's request, within the abilities of this robot.
    fn tracking(&self, rate_hz: u16, percent: [u8; 2]) -> Result<Tracking, CommandResult> {
        let Setup { config, settings, .. } = &self.setup;
        let fits = |bus: u8| {
            self.setup.buses.get(usize::from(bus)).copied().unwrap_or_default().can_be_tracked()
        };
        if !config.channels.iter().all(|channel| fits(channel.bus)) {
            return Err(CommandResult::UnfitActuators);
        }
        let control_hz = settings.control_hz;
        let is_rate = (SLOWEST_HZ..=control_hz).contains(&rate_hz);
        if !is_rate || percent.iter().any(|&part| part > 100) {
            return Err(CommandResult::BadTracking);
        }
        // The next higher rate that divides the control rate.
        let mut periods = control_hz.checked_div(rate_hz).unwrap_or(1).max(1);
        while periods > 1 && !control_hz.is_multiple_of(periods) {
            periods -= 1;
        }
        let channels = config.channels.len().min(MAX_CHANNELS) as u32;
        let frames = channels.saturating_mul(2).saturating_add(SAMPLE_FRAMES);
        let taken_hz = u32::from(control_hz.checked_div(periods).unwrap_or(control_hz));
        if frames.saturating_mul(taken_hz) > MOST_LINK_FRAMES {
            return Err(CommandResult::BadTracking);
        }
        Ok(Tracking { periods, parts: percent.map(|part| f32::from(part) / 100.0) })
    }

    fn may_clear(&self) -> Result<(), CommandResult> {
        let latched = matches!(self.state(), State::EStopped | State::TorqueOff);
        if latched { Ok(()) } else { Err(CommandResult::WrongState) }
    }

    fn play(
        &mut self,
        now_us: u64,
        code: u8,
        speed_64ths: i8,
        place: Option<PlaceCode>,
    ) -> Result<AcknowledgedValues, CommandResult> {
        let speed = u8::try_from(speed_64ths).ok();
        let speed = speed.filter(|speed| (1..=PLANNED_SPEED_64THS).contains(speed));
        let speed = speed.ok_or(CommandResult::BadSpeed)?;
        let node = match self.storage.library() {
            None => Err(CommandResult::NoLibrary),
            Some(library) => {
                // A motion whose name cannot be read may be one for a place.
                let is_here = |entered| {
                    library.name(entered).is_some_and(|name| {
                        let of_motion = PlaceCode::of_motion(name);
                        of_motion.is_none() || of_motion == place
                    })
                };
                // Without a cursor, the motion is refused anyway.
                let may_enter = |node| {
                    let cursor = self.motion.cursor();
                    cursor.is_none_or(|cursor| cursor.may_enter(&library, node, is_here))
                };
                match library.node_for_code(code) {
                    None => Err(CommandResult::UnknownCode),
                    Some(node) if may_enter(node) => Ok(node),
                    Some(_) => Err(CommandResult::OtherPlace),
                }
            }
        };
        if self.state() == State::Paused {
            return Err(CommandResult::WrongState);
        }
        let done = self.go(now_us, node)?;
        self.motion.set_speed(speed);
        Ok(done)
    }

    /// Sends the player to a node, if the state permits it.
    fn go(
        &mut self,
        now_us: u64,
        node: Result<NodeId, CommandResult>,
    ) -> Result<AcknowledgedValues, CommandResult> {
        if !self.state().accepts_motions() && self.state() != State::Paused {
            let armed = self.state().torque() == Torque::Driven;
            return Err(if armed { CommandResult::WrongState } else { CommandResult::NotArmed });
        }
        let node = node?;
        let library = self.storage.library().ok_or(CommandResult::NoLibrary)?;
        let frames =
            self.motion.set_goal(&library, node).map_err(|_| CommandResult::Unreachable)?;
        let moves = !self.motion.rests_in_safe(&library);
        // Ends a pause; in other states this has no effect.
        self.raise(now_us, Event::ResumeAsked);
        if moves {
            let before = self.state();
            self.raise(now_us, Event::MotionStarted);
            self.journal.record_motion(now_us, [before, self.state()], node);
        }
        Ok((Some(node), frames))
    }

    fn tune(&mut self, frame: &Frame, request: ParameterRequest) -> ParameterAck {
        let state = self.state();
        let Self { setup, motion, gate, tuning, .. } = self;
        tuning.answer(frame, request, Robot { state, setup, motion, gate })
    }

    /// Decides on admission of a frame that requires authentication.
    fn admit_frame(&mut self, now_us: u64, frame: &Frame) -> Admission {
        let id = frame.standard_id().unwrap_or_default();
        let admission = self.authentication.admit(now_us, id, frame.data());
        self.log_refusal(now_us, admission);
        admission
    }

    /// Decides on admission of the complete request of a transfer.
    fn admit_request(&mut self, now_us: u64) -> Admission {
        let id = self.link.node.map_or(0, request_id);
        let admission = self.authentication.admit(now_us, id, self.link.request());
        self.log_refusal(now_us, admission);
        admission
    }

    fn log_refusal(&mut self, now_us: u64, admission: Admission) {
        if admission != Admission::Admitted
            && let Some(count) = self.authentication.count_refused()
        {
            self.journal.record_refusals(now_us, self.state(), count);
        }
    }

    fn on_request(&mut self, now_us: u64) {
        let next = self.storage.next();
        if self.authentication.answer_session_request(now_us, &mut self.link, next) {
            return;
        }
        let kind = self.link.request().first().copied().unwrap_or(0);
        if Request::is_transfer(kind) && self.admit_request(now_us) != Admission::Admitted {
            let required = TransferResult::AuthenticationRequired;
            let reply = Reply::new(kind, required, self.storage.next());
            return self.link.respond(&Response::Reply(reply));
        }
        let config = &self.setup.config;
        let may_write = self.state() == State::Disarmed;
        let response = match Request::decode(self.link.request()) {
            Ok(Request::Hello { .. }) => Response::Hello(Hello {
                major: PROTOCOL_MAJOR,
                minor: PROTOCOL_MINOR,
                schema_hash: SCHEMA_HASH,
                config_hash: config.hash(),
                format_major: FORMAT_MAJOR,
                format_minor: FORMAT_MINOR,
                library: self.storage.library().map(|library| library.index().id()),
                max_block: MAX_BLOCK as u16,
                channels: config.channels.len() as u8,
            }),
            Ok(Request::Log { since }) => return self.send_log(now_us, since),
            Ok(request) => {
                // The operator who was about to arm expected another library.
                self.gate.void();
                if matches!(request, Request::Activate { .. }) {
                    self.journal.forget_motions();
                }
                Response::Reply(self.storage.handle(&request, may_write, config))
            }
            Err(error) => Response::Reply(Reply::new(kind, unreadable(error), self.storage.next())),
        };
        self.link.respond(&response);
    }

    /// Sends the log.
    ///
    /// The log is the longest answer. Other requests need the deepest stack, because they validate libraries. A separate function
    /// keeps the buffer of the log off that stack.
    #[inline(never)]
    fn send_log(&mut self, now_us: u64, since: u32) {
        self.link.respond(&Response::Log(self.journal.since(now_us, since)));
    }

    fn telemetry(&mut self, channel: u8) -> Option<JointTelemetry> {
        let oldest_ticks = self.motion.patience_ticks(&self.setup);
        let actuators = &mut self.motion.actuators;
        let mut feedback = actuators.feedback(usize::from(channel))?;
        if actuators.take_unanswered(usize::from(channel), oldest_ticks) {
            feedback.status.0 |= ActuatorStatus::UNANSWERED;
        }
        Some(JointTelemetry {
            channel,
            position_rad: feedback.position_rad,
            velocity_rad_s: feedback.velocity_rad_s,
            torque_nm: feedback.torque_nm,
            status: feedback.status,
        })
    }

    fn readings(&self, channel: u8) -> Option<ActuatorReadings> {
        let oldest_ticks = self.motion.patience_ticks(&self.setup);
        let readings = self.motion.actuators.readings(usize::from(channel), oldest_ticks)?;
        let Readings { temperature_c, voltage_v } = readings;
        Some(ActuatorReadings { channel, temperature_c, voltage_v })
    }

    fn fault_report(&self, now_us: u64, bit: u8, counter: u8) -> Option<FaultReport> {
        let fault = Fault::from_code(bit)?;
        let (channel, value) = self.details(now_us, fault);
        Some(FaultReport { counter, fault, channel, value })
    }
}

fn unreadable(error: TransportError) -> TransferResult {
    match error {
        TransportError::BadCrc => TransferResult::BadCrc,
        TransportError::UnknownType(_) | TransportError::BadLength | TransportError::BadValue => {
            TransferResult::UnknownRequest
        }
    }
}
