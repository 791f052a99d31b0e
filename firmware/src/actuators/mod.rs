//! Actuators of the robot: the latest feedback and the next command of each.
//!
//! | module | contents |
//! |---|---|
//! | [`orders`] | commands for an actuator, reduced to those that its protocol can carry |
//! | [`actuator`] | one actuator: its feedback and its pending requests |
//! | [`load`] | capacity of buses and protocols for the traffic |
//! | [`driver`] | one bus: its transmit schedule, and the command for a channel |
//! | [`can`], [`serial`] | frames of CAN buses and packets of serial lines, in sequence |
//!
//! Every actuator has one slot for each kind of request and one for a set-point. A newer command replaces the pending one, and
//! nothing is queued. Commands are encoded when the bus can send. A bus that could not send for a while, for example without
//! motor power, therefore continues with current commands.

use heapless::Vec;
use rollwalk_protocol::actuator::Feedback;
use rollwalk_protocol::actuators::bus::{Buses, ControlLoop, MAX_BUSES};
use rollwalk_protocol::actuators::{Answers, Command, Decoded, Gains, UpdatePolicy};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind, MAX_CHANNELS, RobotConfig};

use rollwalk_protocol::wire::Parameter;

use crate::channel_bits::{ChannelBits, bit};
use crate::limiter::Target;

mod actuator;
mod can;
mod driver;
pub mod load;
mod orders;
mod serial;

use actuator::Actuator;
pub use actuator::{FRESH_TICKS, Readings};
use driver::BusDriver;
pub use orders::GainMode;
use orders::{DriveRequest, PendingRequests};

/// Health of all actuators together.
#[derive(Clone, Copy, Debug)]
pub struct Health {
    /// Longest silence of an actuator, ticks; `None` if an actuator has not sent any feedback yet.
    silent_ticks: Option<u16>,
    /// True if every actuator reported in its latest feedback that its torque is on.
    pub enabled: bool,
    /// True if any actuator reports a fault.
    pub faulty: bool,
}

impl Health {
    /// True if every actuator has sent feedback within `ticks` ticks.
    pub fn fresh_within(&self, ticks: u16) -> bool {
        self.silent_ticks.is_some_and(|silent| silent <= ticks)
    }
}

/// Actuators of the robot, by channel.
#[derive(Clone, Debug)]
pub struct Actuators {
    list: Vec<Actuator, MAX_CHANNELS>,
    drivers: [BusDriver; MAX_BUSES],
    /// Channel whose changed gains or limits may be sent in this control period. Only one channel has its turn, so that
    /// set-points are sent during tuning.
    turn: usize,
    /// Channels whose actuators accept torque commands, a bit each.
    torque_takers: ChannelBits,
}

impl Actuators {
    /// Actuators of a robot, without feedback.
    pub fn new(config: &RobotConfig, buses: &Buses) -> Self {
        let mut list = Vec::new();
        // A configuration never has more channels than fit.
        let _ = list.resize_default(config.channels.len().min(MAX_CHANNELS));
        let drivers: [BusDriver; MAX_BUSES] = core::array::from_fn(|number| {
            BusDriver::new(buses.get(number).copied().unwrap_or_default(), config, number)
        });
        let takers = drivers.iter().filter(|driver| driver.bus.takes_torque());
        let torque_takers = takers.fold(0, |bits, driver| bits | driver.members());
        Self { list, drivers, turn: 0, torque_takers }
    }

    fn driver(&self, bus: u8) -> Option<&BusDriver> {
        self.drivers.get(usize::from(bus))
    }

    /// Accepts a frame of an actuator bus. Ignores frames that are not feedback of this robot's actuators.
    pub fn receive(&mut self, config: &RobotConfig, bus: u8, frame: &Frame) {
        let Some(driver) = self.driver(bus) else { return };
        if let Some((id, decoded)) = driver.bus.protocol.decode_counted(frame) {
            self.on_decoded(config, bus, id, &decoded);
        }
    }

    fn on_decoded(&mut self, config: &RobotConfig, bus: u8, id: u8, decoded: &Decoded) {
        if let Some(driver) = self.driver(bus)
            && let Some(channel) = driver.channel_of(config, id)
        {
            let reports_enabled = driver.can.reports_enabled;
            match (self.list.get_mut(channel), decoded) {
                (Some(actuator), Decoded::Counted(feedback)) => {
                    actuator.on_counted_feedback(*feedback)
                }
                (Some(actuator), Decoded::Partial(news)) => {
                    actuator.on_feedback(news, reports_enabled)
                }
                (None, _) => {}
            }
        }
    }

    /// Begins a new control period.
    pub fn age(&mut self) {
        self.list.iter_mut().for_each(Actuator::age);
        self.drivers.iter_mut().for_each(BusDriver::age);
        let next = self.turn.saturating_add(1);
        self.turn = if next < self.list.len() { next } else { 0 };
    }

    /// Health of all actuators together.
    // One copy in the image instead of one at each call.
    #[inline(never)]
    pub fn health(&self) -> Health {
        let mut health = Health { silent_ticks: Some(0), enabled: true, faulty: false };
        for actuator in &self.list {
            let silent = actuator.is_known().then_some(actuator.silent_ticks);
            // The state of an unknown actuator is never fresh.
            health.silent_ticks = health.silent_ticks.zip(silent).map(|(a, b)| a.max(b));
            health.enabled &= actuator.enabled();
            health.faulty |= actuator.faulty();
        }
        health
    }

    /// Returns the actuator that has been silent longest, and its silence in ticks.
    ///
    /// Among actuators with the same silence, it is the first: on a serial line, a silent servo also silences all servos after
    /// it.
    pub fn most_silent(&self) -> Option<(usize, u16)> {
        let mut most = None;
        for (channel, actuator) in self.list.iter().enumerate() {
            if most.is_none_or(|(_, ticks)| actuator.silent_ticks > ticks) {
                most = Some((channel, actuator.silent_ticks));
            }
        }
        most
    }

    /// True if every actuator has confirmed the most recent torque-off command.
    pub fn are_confirmed_off(&self) -> bool {
        self.list.iter().all(|a| a.known_off)
    }

    /// Returns true if an actuator's feedback is older than `oldest_ticks`, or if an actuator on a serial line has missed an
    /// answer since the previous call.
    pub fn take_unanswered(&mut self, channel: usize, oldest_ticks: u16) -> bool {
        let actuator = self.list.get_mut(channel);
        actuator.is_some_and(|a| a.take_unanswered() || a.silent_ticks > oldest_ticks)
    }

    /// Temperature and supply voltage of an actuator; `None` if it reports neither, or if its feedback is older than
    /// `oldest_ticks`.
    pub fn readings(&self, channel: usize, oldest_ticks: u16) -> Option<Readings> {
        let actuator = self.list.get(channel).filter(|a| a.silent_ticks <= oldest_ticks)?;
        Some(actuator.readings).filter(|readings| *readings != Readings::default())
    }

    /// Latest feedback of an actuator.
    pub fn feedback(&self, channel: usize) -> Option<Feedback> {
        self.list.get(channel)?.feedback()
    }

    /// Measured position of a joint, rad, or speed of a wheel, rad/s.
    pub fn measured(&self, config: &RobotConfig, channel: usize) -> Option<f32> {
        let feedback = self.feedback(channel)?;
        Some(match config.channels.get(channel)?.kind {
            ChannelKind::JointPosition => feedback.position_rad,
            ChannelKind::WheelSpeed => feedback.velocity_rad_s,
        })
    }

    /// True if an actuator does not measure its pose and is assumed to be in the SAFE pose.
    pub fn pose_is_assumed(&self) -> bool {
        self.drivers.iter().any(BusDriver::pose_is_assumed)
    }

    /// Sets the assumed positions of actuators that do not measure them. Call it while their torque is off.
    pub fn assume(&mut self, pose: &[f32]) {
        for driver in self.drivers.iter().filter(|driver| driver.pose_is_assumed()) {
            for (channel, actuator) in self.list.iter_mut().enumerate() {
                if driver.has(channel)
                    && let Some(&value) = pose.get(channel)
                {
                    actuator.assume(value);
                }
            }
        }
    }

    /// Switches torque off at once. Drops all other commands, and repeats the torque-off command until each actuator has
    /// confirmed it.
    pub fn disable_all(&mut self) {
        self.drop_orders();
        for actuator in &mut self.list {
            actuator.known_off = false;
            actuator.pending = PendingRequests::of(DriveRequest::Disable);
        }
    }

    /// Drops pending set-points and torque commands of the previous state.
    pub fn drop_orders(&mut self) {
        for driver in &mut self.drivers {
            driver.interrupt();
            driver.idle = false;
        }
        for actuator in &mut self.list {
            actuator.setpoint = None;
            actuator.pending = actuator.pending.without_switches();
        }
    }

    /// Keeps torque off. Repeats the torque-off command to actuators that have not confirmed it.
    ///
    /// If `query` is true, also queries the pose of the other actuators and clears latched faults of their drives.
    pub fn keep_disabled(&mut self, query: bool) {
        for driver in &mut self.drivers {
            driver.idle = false;
            let on_query = driver.can.answers == Answers::OnQuery;
            for actuator in members(&mut self.list, driver) {
                actuator.pending = if !actuator.known_off {
                    PendingRequests::of(DriveRequest::Disable).and_if(on_query, DriveRequest::Query)
                } else if !query {
                    // A query that was not sent yet remains pending.
                    actuator.pending
                } else if actuator.faulty() {
                    // This also holds for the Rollwalk profile: on a bad bus, a late "enable" can time out after the motor
                    // confirmed that it is off. Some protocols have no command to clear faults: motors answer another "off",
                    // and a fault disappears when its cause does.
                    PendingRequests::of(DriveRequest::ClearFaults)
                        .and_if(!driver.can.reports_enabled, DriveRequest::Disable)
                        .and_if(on_query, DriveRequest::Query)
                } else {
                    // Actuators that do not report that they are off are disabled again. A query would feed the watchdog of an
                    // ODrive.
                    PendingRequests::NOTHING
                        .and_if(!driver.can.reports_enabled, DriveRequest::Disable)
                        .and_if(driver.can_be_queried(), DriveRequest::Query)
                };
            }
        }
    }

    /// Repeats the torque-on command to actuators whose torque is off, and queries the pose of the others.
    pub fn keep_enabling(&mut self) {
        for driver in &mut self.drivers {
            driver.idle = false;
            let on_query = driver.can.answers == Answers::OnQuery;
            let stored_gains = driver.can.gains == UpdatePolicy::Stored;
            let stored_limits = driver.can.limits == UpdatePolicy::Stored;
            let patience = driver.enable_patience_ticks();
            for actuator in members(&mut self.list, driver) {
                (actuator.gains, actuator.torque_limit_nm) = (None, None);
                if actuator.enabled() {
                    actuator.pending = PendingRequests::NOTHING
                        .and_if(driver.can_be_queried(), DriveRequest::Query);
                } else if actuator.waits_for_enable(patience) {
                    actuator.pending = actuator.pending.and_if(on_query, DriveRequest::Query);
                } else if !actuator.pending.has(DriveRequest::Enable) {
                    actuator.pending = PendingRequests::of(DriveRequest::Enable)
                        .and_if(stored_gains, DriveRequest::Gains)
                        .and_if(stored_limits, DriveRequest::Limits)
                        .and_if(on_query, DriveRequest::Query);
                }
            }
        }
    }

    /// True if a parameter of a channel affects its actuator.
    pub fn uses_parameter(
        &self,
        config: &RobotConfig,
        channel: usize,
        parameter: Parameter,
    ) -> bool {
        let driver = config.channels.get(channel).and_then(|c| self.driver(c.bus));
        driver.is_some_and(|driver| match parameter {
            Parameter::FeedForward => true,
            Parameter::Kp | Parameter::Kd => driver.bus.takes_gains(),
            Parameter::MaxTorque if driver.bus.control == ControlLoop::OnController => true,
            // If every set-point contains gains, the gains are scaled to the limit.
            Parameter::MaxTorque => {
                driver.can.limits != UpdatePolicy::Never
                    || driver.can.gains == UpdatePolicy::EverySetpoint
            }
        })
    }

    /// Largest gains that the drive of a channel accepts; `None` if the controller closes the loop.
    pub fn max_gains(&self, config: &RobotConfig, channel: usize) -> Option<Gains> {
        let driver = self.driver(config.channels.get(channel)?.bus)?;
        (driver.bus.control == ControlLoop::InDrive).then_some(driver.can.max_gains)
    }

    /// True if a channel's actuator accepts torque commands. Other actuators receive an offset position or speed instead.
    pub fn takes_torque(&self, channel: usize) -> bool {
        self.torque_takers & bit(channel) != 0
    }

    /// Stores a target, already limited, as the next command of an actuator.
    ///
    /// `limits` is the channel with the current gains and limits, which may differ from the configuration. `meant` is the value
    /// of the target before an offset that replaces a torque.
    pub fn command(
        &mut self,
        limits: &Channel,
        channel: usize,
        (target, meant): (Target, f32),
        hold: GainMode,
    ) {
        let Some(driver) = self.drivers.get_mut(usize::from(limits.bus)) else { return };
        let Some(actuator) = self.list.get_mut(channel) else { return };
        let Some(feedback) = actuator.feedback() else { return };
        driver.idle = false;
        let on_query = driver.can.answers == Answers::OnQuery;
        let setpoint = match driver.bus.control {
            ControlLoop::InDrive => orders::setpoint(limits, &driver.can, target, hold, &feedback),
            ControlLoop::OnController if actuator.silent_ticks <= FRESH_TICKS => {
                Some(orders::torque(limits, target, hold, &feedback))
            }
            // The feedback is outdated. Zero torque is sent nevertheless, because the actuator may answer.
            ControlLoop::OnController => Some(Command::Torque { torque_nm: 0.0 }),
        };
        driver.give_up(channel);
        // An actuator that cannot be damped is disabled repeatedly until it confirms.
        let off = setpoint.is_none() && !(actuator.known_off && driver.can.reports_enabled);
        let mut pending = actuator.pending.without_switches();
        pending = pending.and_if(off, DriveRequest::Disable).and_if(on_query, DriveRequest::Query);
        let in_drive = driver.bus.control == ControlLoop::InDrive;
        if driver.can.gains == UpdatePolicy::Stored && in_drive {
            let gains = Some(orders::gains(limits, hold));
            let urgent = hold == GainMode::Damped || actuator.gains.is_none();
            // The gains of the damped stop may be lost on a disturbed bus, so they are repeated.
            let again = hold == GainMode::Damped && self.turn == channel;
            if again || actuator.gains != gains && (urgent || self.turn == channel) {
                pending = pending.and(DriveRequest::Gains);
                actuator.gains = gains;
            }
        }
        // If the controller computes the torque, the torque is within the limit already. The limit of a Dynamixel would be a
        // torque command.
        if driver.can.limits == UpdatePolicy::Stored && in_drive {
            let torque_nm = Some(limits.max_torque_nm);
            let urgent = actuator.torque_limit_nm.is_none();
            if actuator.torque_limit_nm != torque_nm && (urgent || self.turn == channel) {
                pending = pending.and(DriveRequest::Limits);
                actuator.torque_limit_nm = torque_nm;
            }
        }
        actuator.pending = pending;
        actuator.setpoint = setpoint;
        if driver.pose_is_assumed() && setpoint.is_some() {
            actuator.assume(meant);
        }
    }
}

/// Actuators of a bus.
fn members<'a>(
    list: &'a mut [Actuator],
    driver: &'a BusDriver,
) -> impl Iterator<Item = &'a mut Actuator> {
    let mut channels = 0..MAX_CHANNELS;
    list.iter_mut().filter(move |_| channels.next().is_some_and(|channel| driver.has(channel)))
}
