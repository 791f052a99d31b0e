//! Set-points of the actuators: enabling, alignment, playback, damping, torque off.
//!
//! The motion is always in one stage: off, enabling, ramp to SAFE, playback, stream, tracking, or damped. In every stage a target
//! reaches an actuator only through the limiter. The limiter passes nothing for a channel whose pose was not measured since
//! torque was last off.

mod health;
mod host;
mod soft_gains;

use heapless::Vec;
use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS, RobotConfig};
use rollwalk_protocol::faults::Event;
use rollwalk_protocol::library::{Library, LibraryReadError, NodeId, RATE_HZ};

use crate::actuators::{Actuators, FRESH_TICKS, GainMode};
use crate::align::{Ramp, RampEnds};
use crate::bus::Buses;
use crate::graph_cursor::{GoalError, GraphCursor};
use crate::limiter::{Limiter, Target, within};
use crate::parameters::Parameters;
use crate::player::{PlaybackPosition, Player};
use crate::safety::EventSet;
use crate::settings::Settings;
use crate::stream::Stream;
use crate::track::{Track, Tracking};
use crate::window::WINDOW;
use soft_gains::SoftGains;

/// Rate at which each actuator is queried for its pose while torque is off, Hz.
const QUERY_HZ: u16 = 20;

#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "no allocator to box with, and there is one stage")]
enum Stage {
    Off,
    Enabling { ticks: u32 },
    Ramping { ramp: Ramp, settling_ticks: u32 },
    Playing(Player),
    Streaming(Stream),
    Tracking(Track),
    Damped,
}

/// Robot and settings, constant while the controller runs.
pub(crate) struct Setup {
    pub config: RobotConfig,
    pub buses: Buses,
    pub settings: Settings,
}

/// Motion stage, with its limiter and actuators.
pub(crate) struct Motion {
    stage: Stage,
    limiter: Limiter,
    pub actuators: Actuators,
    pub parameters: Parameters,
    emitted: [Option<Target>; MAX_CHANNELS],
    /// Ticks for which a joint has been far from its set-point.
    behind_ticks: u32,
    ticks_to_query: u16,
    /// Tracking settings of the next stream; `None` if its set-points do not answer samples.
    tracking: Option<Tracking>,
    /// Number of the sample that is due; `None` if no sample is due.
    sample: Option<u8>,
    soft_gains: SoftGains,
}

impl Motion {
    pub fn new(setup: &Setup) -> Self {
        Self {
            stage: Stage::Off,
            limiter: Limiter::new(setup.settings.period_s()),
            actuators: Actuators::new(&setup.config, &setup.buses),
            parameters: Parameters::new(&setup.config, &setup.settings),
            emitted: [None; MAX_CHANNELS],
            behind_ticks: 0,
            ticks_to_query: 0,
            tracking: None,
            sample: None,
            soft_gains: SoftGains::new(),
        }
    }

    /// Latest target sent to the actuator; `None` while torque is off.
    pub fn emitted(&self, channel: usize) -> Option<Target> {
        self.emitted.get(channel).copied().flatten()
    }

    /// Offset of the latest target that replaces a torque, rad or rad/s.
    pub fn torque_offset(&self, channel: usize) -> f32 {
        self.limiter.torque_offset(channel)
    }

    /// Clip and frame of playback.
    pub fn playing(&self) -> Option<PlaybackPosition> {
        match &self.stage {
            Stage::Playing(player) => Some(player.playing()),
            _ => None,
        }
    }

    /// True if the robot follows set-points that answer samples.
    pub fn is_tracking(&self) -> bool {
        matches!(self.stage, Stage::Tracking(_))
    }

    /// Switches torque off at once.
    pub fn cut(&mut self) {
        self.stage = Stage::Off;
        self.limiter.stop();
        self.soft_gains.reset();
        self.emitted = [None; MAX_CHANNELS];
        self.actuators.disable_all();
        self.ticks_to_query = 0;
    }

    /// Enables the actuators, then ramps from the measured pose to SAFE.
    pub fn align(&mut self) {
        self.stage = Stage::Enabling { ticks: 0 };
    }

    /// Starts playback at rest in SAFE.
    pub fn hold_safe(
        &mut self,
        setup: &Setup,
        library: Option<Library<'_>>,
    ) -> Result<(), LibraryReadError> {
        let library = library.ok_or(LibraryReadError)?;
        let player = Player::start(&library, setup.settings.ticks_per_frame())?;
        self.stage = Stage::Playing(player);
        Ok(())
    }

    /// Sends the player to SAFE.
    pub fn route_to_safe(&mut self, library: Option<Library<'_>>) -> Result<(), LibraryReadError> {
        let library = library.ok_or(LibraryReadError)?;
        self.resume();
        self.set_goal(&library, library.safe_node()).map(|_| ()).map_err(|_| LibraryReadError)
    }

    /// Requests a motion from the player; returns the number of frames until it starts.
    pub fn set_goal(&mut self, library: &Library<'_>, goal: NodeId) -> Result<u16, GoalError> {
        match &mut self.stage {
            Stage::Playing(player) => {
                player.set_goal(library, goal)?;
                Ok(player.frames_to_goal(library))
            }
            _ => Err(GoalError::Unreachable),
        }
    }

    /// Place in the motion graph; `None` unless a library plays.
    pub fn cursor(&self) -> Option<&GraphCursor> {
        match &self.stage {
            Stage::Playing(player) => Some(player.cursor()),
            _ => None,
        }
    }

    /// Sets the playback speed, in 64ths of the planned speed.
    pub fn set_speed(&mut self, speed_64ths: u8) {
        if let Stage::Playing(player) = &mut self.stage {
            player.set_speed(speed_64ths);
        }
    }

    /// Slows playback down to a halt.
    pub fn pause(&mut self) {
        if let Stage::Playing(player) = &mut self.stage {
            player.halt();
        }
    }

    /// Resumes playback.
    pub fn resume(&mut self) {
        if let Stage::Playing(player) = &mut self.stage {
            player.go_on();
        }
    }

    /// True if the player rests in SAFE and will stay there.
    pub fn rests_in_safe(&self, library: &Library<'_>) -> bool {
        matches!(&self.stage, Stage::Playing(player) if player.rests_in_safe(library))
    }

    /// Damps joints without stiffness, and brakes wheels.
    pub fn damp(&mut self, setup: &Setup) {
        for i in 0..setup.config.channels.len() {
            if self.limiter.last(i).is_none()
                && let Some(measured) = self.actuators.measured(&setup.config, i)
            {
                self.limiter.start(i, measured);
            }
        }
        self.limiter.drop_torques();
        // A pending enable would be sent after the decision to damp.
        self.actuators.drop_orders();
        self.stage = Stage::Damped;
    }

    /// Sets the commands of the actuators for the next control period.
    pub fn drive(&mut self, setup: &Setup, library: Option<Library<'_>>, events: &mut EventSet) {
        match self.stage {
            Stage::Off => {
                self.assume_safe(library);
                self.stay_off(setup);
            }
            Stage::Damped => self.emit_damping(setup),
            _ => {
                let done =
                    library.ok_or(LibraryReadError).and_then(|l| self.follow(setup, &l, events));
                if done.is_err() {
                    events.insert(Event::PlaybackFailed);
                }
            }
        }
    }

    fn follow(
        &mut self,
        setup: &Setup,
        library: &Library<'_>,
        events: &mut EventSet,
    ) -> Result<(), LibraryReadError> {
        if let Stage::Enabling { ticks } = &mut self.stage {
            *ticks = ticks.saturating_add(1);
            let late = *ticks > setup.settings.ticks(setup.settings.align_patience_us);
            let health = self.actuators.health();
            if health.enabled && health.fresh_within(FRESH_TICKS) {
                self.start_ramp(setup, library)?;
            } else if late {
                events.insert(Event::AlignFailed);
            } else {
                self.actuators.keep_enabling();
            }
        }
        if let Stage::Playing(player) = &mut self.stage {
            player.advance(library, &setup.config)?;
            if player.rests_in_safe(library) {
                events.insert(Event::SafeReached);
            }
        }
        if let Stage::Streaming(stream) = &mut self.stage {
            stream.advance(&setup.config);
            let halted = (stream.is_halted(), stream.rests());
            self.watch_host(setup, halted, events);
        }
        if let Stage::Tracking(track) = &mut self.stage {
            if track.advance(setup.settings.period_s()) {
                self.sample = Some(track.sample());
            }
            if track.begins_to_hold() {
                self.hold_joints(setup);
            }
        }
        if let Stage::Tracking(track) = &self.stage {
            if !track.holds() {
                // The set-points of an answer apply as they are, with any gains.
                self.soft_gains.drop_leans();
            }
            let periods = setup.settings.ticks_per_frame().saturating_mul(WINDOW as u16);
            let halted = (track.is_halted(), track.rests(periods));
            self.watch_host(setup, halted, events);
        }
        self.emit_targets(setup);
        if let Stage::Ramping { ramp, settling_ticks } = &mut self.stage {
            ramp.advance();
            if ramp.arrived() {
                *settling_ticks = settling_ticks.saturating_add(1);
                let patience = setup.settings.ticks(setup.settings.align_patience_us);
                if *settling_ticks > 1 && arrived(setup, ramp, &self.actuators) {
                    events.insert(Event::Aligned);
                } else if *settling_ticks > patience {
                    events.insert(Event::AlignFailed);
                }
            }
        }
        Ok(())
    }

    /// Time since the latest set-points of the host, s.
    pub fn starved_s(&self, settings: &Settings) -> f32 {
        match &self.stage {
            Stage::Streaming(stream) => f32::from(stream.starved()) / f32::from(RATE_HZ),
            Stage::Tracking(track) => f32::from(track.starved()) * settings.period_s(),
            _ => 0.0,
        }
    }

    /// Raises events if a stream has ended or its set-points no longer arrive.
    fn watch_host(&self, setup: &Setup, (is_halted, rests): (bool, bool), events: &mut EventSet) {
        let patience_s = setup.settings.heartbeat_timeout_us as f32 * 1e-6;
        if rests {
            events.insert(Event::StreamHalted);
        } else if !is_halted && self.starved_s(&setup.settings) > patience_s {
            events.insert(Event::StreamLost);
        }
    }

    /// Value at which a channel can rest without a change of its torque ([`SoftGains::rest`]).
    #[inline(never)]
    fn rest(&mut self, setup: &Setup, channel: usize) -> Option<f32> {
        let meant = self.limiter.without_offset(channel)?;
        let is_joint = setup.config.channels.get(channel)?.kind == ChannelKind::JointPosition;
        let measured = self.actuators.measured(&setup.config, channel).filter(|_| is_joint);
        self.soft_gains.rest(channel, meant, measured)
    }

    /// Sets the joints of a tracked robot to rest where they are, without a change of torque.
    fn hold_joints(&mut self, setup: &Setup) {
        for (i, channel) in setup.config.channels.iter().enumerate() {
            let rest = self.rest(setup, i);
            if let (Stage::Tracking(track), Some(rest), ChannelKind::JointPosition) =
                (&mut self.stage, rest, channel.kind)
            {
                track.rest_at(i, rest);
            }
        }
    }

    fn start_ramp(&mut self, setup: &Setup, library: &Library<'_>) -> Result<(), LibraryReadError> {
        let (actuators, limiter) = (&self.actuators, &mut self.limiter);
        let feed_forward = self.parameters.feed_forward();
        let ramp = ramp_to_safe(setup, library, feed_forward, |i| {
            let from = actuators.measured(&setup.config, i)?;
            limiter.start(i, from);
            Some((from, 0.0))
        })?;
        self.stage = Stage::Ramping { ramp, settling_ticks: 0 };
        Ok(())
    }

    fn emit_targets(&mut self, setup: &Setup) {
        // Feed-forward share of a library's torques. Torques of a ramp contain the share already.
        let feed_forward = match self.stage {
            Stage::Playing(_) | Stage::Streaming(_) => self.parameters.feed_forward(),
            _ => 1.0,
        };
        let period_s = setup.settings.period_s();
        // With full gains, the loop below skips the fractions.
        let may_be_soft = self.soft_gains.take_soft() || self.is_tracking();
        for i in 0..setup.config.channels.len() {
            let mut wanted = [1.0; 2];
            let target = match &self.stage {
                Stage::Ramping { ramp, .. } => ramp.target(i),
                Stage::Playing(player) => player.target(&setup.config, i),
                Stage::Streaming(stream) => stream.target(&setup.config, i),
                Stage::Tracking(track) => track.target(&setup.config, i).map(|(target, of)| {
                    wanted = of;
                    target
                }),
                Stage::Off | Stage::Enabling { .. } | Stage::Damped => None,
            };
            if let Some(mut target) = target {
                target.torque_nm *= feed_forward;
                let mut parts = None;
                if may_be_soft {
                    let most = self.parameters.driven(i).map_or(0.0, |limits| limits.max_rate);
                    let (acting, off_rad) =
                        self.soft_gains.advance(period_s, most * period_s, i, wanted);
                    target.value += off_rad;
                    parts = Some(acting);
                }
                self.emit(setup, i, target, GainMode::Driven, parts);
            }
        }
    }

    fn emit_damping(&mut self, setup: &Setup) {
        for (i, channel) in setup.config.channels.iter().enumerate() {
            let value = match channel.kind {
                // Without stiffness the position has no effect; the last value cannot jump.
                ChannelKind::JointPosition => self.limiter.last(i),
                ChannelKind::WheelSpeed => Some(0.0),
            };
            if let Some(value) = value {
                let still = Target { value, slope: 0.0, torque_nm: 0.0 };
                self.emit(setup, i, still, GainMode::Damped, None);
            }
        }
    }

    /// Limits a target and passes it to the actuator. `parts` are the fractions of kp and kd that act; `None` selects the full
    /// gains.
    fn emit(
        &mut self,
        setup: &Setup,
        channel: usize,
        target: Target,
        hold: GainMode,
        parts: Option<[f32; 2]>,
    ) {
        let damped;
        let soft;
        let limits = match hold {
            GainMode::Driven => self.parameters.driven(channel),
            GainMode::Damped => {
                damped = self.parameters.damped(&setup.config, channel);
                damped.as_ref()
            }
        };
        let Some(mut limits) = limits else { return };
        if let Some([kp, kd]) = parts {
            soft = Channel {
                kp_nm_rad: kp * limits.kp_nm_rad,
                kd_nm_s_rad: kd * limits.kd_nm_s_rad,
                ..*limits
            };
            limits = &soft;
        }
        let takes_torque = self.actuators.takes_torque(channel);
        let mut limited = self.limiter.apply(limits, channel, target, takes_torque);
        if let (Some(limited), Some(_), ChannelKind::JointPosition) =
            (&mut limited, parts, limits.kind)
            && target.slope.is_finite()
        {
            // The set-point may be far from the joint's position, and jump. Its change in a period is then no speed of the joint,
            // so the slope of the target applies.
            limited.slope = within(target.slope, -limits.max_rate, limits.max_rate);
        }
        if let (Some(target), Some(slot)) = (limited, self.emitted.get_mut(channel)) {
            let meant = self.limiter.without_offset(channel).unwrap_or(target.value);
            self.actuators.command(limits, channel, (target, meant), hold);
            *slot = Some(target);
        }
    }

    /// Sets SAFE as the assumed pose of actuators that do not measure their pose.
    fn assume_safe(&mut self, library: Option<Library<'_>>) {
        let mut safe = [0.0; MAX_CHANNELS];
        if self.actuators.pose_is_assumed()
            && library.and_then(|library| library.safe_pose_into(&mut safe)).is_some()
        {
            self.actuators.assume(&safe);
        }
    }

    fn stay_off(&mut self, setup: &Setup) {
        let query = self.ticks_to_query == 0;
        self.ticks_to_query = match self.ticks_to_query {
            0 => (setup.settings.control_hz / QUERY_HZ).saturating_sub(1),
            n => n - 1,
        };
        self.actuators.keep_disabled(query);
    }
}

/// Values and torques of the SAFE pose.
fn safe(
    library: &Library<'_>,
) -> Result<([f32; MAX_CHANNELS], [f32; MAX_CHANNELS]), LibraryReadError> {
    let (mut pose, mut torques) = ([0.0; MAX_CHANNELS], [0.0; MAX_CHANNELS]);
    library.safe_pose_into(&mut pose).ok_or(LibraryReadError)?;
    library.safe_torques_into(&mut torques)?;
    Ok((pose, torques))
}

/// Creates a ramp to SAFE from the value and torque that `from` returns for each channel. The torques of SAFE are scaled by
/// `feed_forward`.
fn ramp_to_safe(
    setup: &Setup,
    library: &Library<'_>,
    feed_forward: f32,
    mut from: impl FnMut(usize) -> Option<(f32, f32)>,
) -> Result<Ramp, LibraryReadError> {
    let (pose, torques) = safe(library)?;
    let Setup { config, settings, .. } = setup;
    let mut ends: Vec<RampEnds, MAX_CHANNELS> = Vec::new();
    for (i, (to, to_nm)) in pose.into_iter().zip(torques).enumerate().take(config.channels.len()) {
        let (from, from_nm) = from(i).ok_or(LibraryReadError)?;
        let torques_nm = [from_nm, to_nm * feed_forward];
        ends.push(RampEnds { from, to, torques_nm }).map_err(|_| LibraryReadError)?;
    }
    Ok(Ramp::new(config, ends, settings.align_speed_rad_s, settings.period_s()))
}

/// True if the measured position of every joint is close to the end of the ramp.
fn arrived(setup: &Setup, ramp: &Ramp, actuators: &Actuators) -> bool {
    setup.config.channels.iter().enumerate().all(|(i, channel)| {
        let error = ramp.target(i).zip(actuators.measured(&setup.config, i));
        channel.kind == ChannelKind::WheelSpeed
            || error.is_some_and(|(target, measured)| {
                (target.value - measured).abs() <= setup.settings.align_tolerance_rad
            })
    })
}
