//! Transmit schedule of a bus, and the command for each channel.

use rollwalk_protocol::actuator::Feedback;
use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose};
use rollwalk_protocol::actuators::serial::ReceiveBuffer;
use rollwalk_protocol::actuators::{ActuatorCommand, Answers, Capabilities, UpdatePolicy};
use rollwalk_protocol::config::{Channel, RobotConfig};

use crate::channel_bits::{ChannelBits, bit};

use super::actuator::{Actuator, FRESH_TICKS};
use super::orders::{self, DriveRequest};

/// Interval at which the torque-on command is resent to drives that report their state on a timer only, ticks. An ODrive sends
/// a heartbeat every 100 ms.
const ENABLE_PATIENCE_TICKS: u16 = 24;

/// Interval between queries for temperature and voltage on a bus, ticks: 0.5 s at 120 Hz. Each takes the place of a query for
/// all poses, which are then one tick older.
const READINGS_TICKS: u16 = 60;

/// Content of a transmission.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Content {
    DriveRequest(DriveRequest),
    Setpoint,
}

/// Transmission in progress.
#[derive(Clone, Copy, Debug)]
pub struct Transmission {
    pub content: Content,
    /// Addressed actuators, a bit for each channel.
    pub channels: ChannelBits,
    /// Number of frames sent.
    pub sent: u8,
}

/// Transmit state of a bus.
#[derive(Clone, Debug)]
pub struct BusDriver {
    pub bus: Bus,
    pub can: Capabilities,
    /// Channels on this bus, a bit each.
    members: ChannelBits,
    /// Channel at which the next search for a set-point begins. Advancing it makes a slow bus serve all channels in turn.
    next: usize,
    pub transmission: Option<Transmission>,
    /// True if the latest search found nothing to send, and nothing was added since.
    pub idle: bool,
    /// True if the bus has sent a frame in the current control period.
    moved: bool,
    /// True if the serial line is reserved for the answer to a query until the end of the control period.
    pub listening: bool,
    /// Ticks until the next query for temperature and voltage.
    ticks_to_readings: u16,
    /// Channel whose temperature and voltage the next query requests instead of its pose.
    reading: Option<usize>,
    /// Channel whose temperature and voltage were queried most recently.
    last_read: usize,
    /// Received bytes of a serial line that do not form a complete answer yet.
    pub received: ReceiveBuffer,
}

impl BusDriver {
    /// Transmit state of bus `number` of the robot.
    // Called rarely, so one copy in the image suffices instead of one for each bus.
    #[inline(never)]
    pub fn new(bus: Bus, config: &RobotConfig, number: usize) -> Self {
        let bits = config.channels.iter().enumerate();
        let members = bits.filter(|(_, c)| usize::from(c.bus) == number);
        Self {
            bus,
            can: bus.protocol.capabilities(),
            members: members.fold(0, |bits, (i, _)| bits | bit(i)),
            next: 0,
            transmission: None,
            idle: false,
            moved: false,
            listening: false,
            ticks_to_readings: READINGS_TICKS,
            reading: None,
            last_read: 0,
            received: ReceiveBuffer::default(),
        }
    }

    /// True if `channel` is on this bus.
    pub fn has(&self, channel: usize) -> bool {
        self.members & bit(channel) != 0
    }

    /// Channel of the actuator with address `id`.
    pub fn channel_of(&self, config: &RobotConfig, id: u8) -> Option<usize> {
        channels(self.members).find(|&i| config.channels.get(i).is_some_and(|c| c.id == id))
    }

    pub fn members(&self) -> ChannelBits {
        self.members
    }

    /// True if poses on this bus are assumed, not measured.
    pub fn pose_is_assumed(&self) -> bool {
        !self.can.measures_position && self.bus.pose == Pose::AssumedSafe
    }

    /// True if the actuators answer queries. Others send their feedback on a timer, or never.
    pub fn can_be_queried(&self) -> bool {
        matches!(self.can.answers, Answers::Always | Answers::OnQuery)
    }

    /// Time that an actuator has to confirm the torque-on command, ticks.
    pub fn enable_patience_ticks(&self) -> u16 {
        if self.can.answers == Answers::Cyclic { ENABLE_PATIENCE_TICKS } else { 0 }
    }

    /// Drops the transmission in progress.
    pub fn interrupt(&mut self) {
        self.transmission = None;
        self.listening = false;
    }

    /// Drops the transmission in progress if it addresses `channel`.
    pub fn give_up(&mut self, channel: usize) {
        self.transmission =
            self.transmission.filter(|transmission| transmission.channels & bit(channel) == 0);
    }

    /// Begins a new control period. Drops a transmission that has made no progress, because its set-point is outdated.
    pub fn age(&mut self) {
        if !self.moved {
            self.transmission = None;
        }
        (self.moved, self.listening) = (false, false);
        self.ticks_to_readings = self.ticks_to_readings.saturating_sub(1);
        if self.can.query_readings && self.ticks_to_readings == 0 {
            self.ticks_to_readings = READINGS_TICKS;
            self.reading = self.turns(self.last_read.saturating_add(1)).next();
        }
    }

    /// Channels on this bus in ascending order, beginning at `first` and wrapping around.
    fn turns(&self, first: usize) -> impl Iterator<Item = usize> + use<> {
        let after = ChannelBits::MAX.checked_shl(first as u32).unwrap_or(0);
        channels(self.members & after).chain(channels(self.members & !after))
    }

    /// Query for temperature and voltage that is due.
    pub fn due_reading(&self) -> Option<Transmission> {
        let content = Content::DriveRequest(DriveRequest::QueryReadings);
        self.reading.map(|channel| Transmission { content, channels: bit(channel), sent: 0 })
    }

    /// Returns the transmission to continue or to begin.
    pub fn due(&self, list: &[Actuator]) -> Option<Transmission> {
        if self.transmission.is_some() {
            return self.transmission;
        }
        let single =
            |content, channel| Some(Transmission { content, channels: bit(channel), sent: 0 });
        for channel in channels(self.members) {
            if let Some(request) = list.get(channel).and_then(|a| a.pending.first()) {
                return single(Content::DriveRequest(request), channel);
            }
        }
        let waits = |&channel: &usize| list.get(channel).is_some_and(|a| a.setpoint.is_some());
        single(Content::Setpoint, self.turns(self.next).find(waits)?)
    }

    /// Records that one of the `frames` frames of a transmission was sent. The transmission ends after its final frame, or if
    /// `frames` is zero.
    pub fn frame_sent(&mut self, list: &mut [Actuator], transmission: Transmission, frames: u8) {
        self.moved = true;
        let sent = transmission.sent.saturating_add(1);
        if sent < frames {
            self.transmission = Some(Transmission { sent, ..transmission });
            return;
        }
        self.transmission = None;
        for channel in channels(transmission.channels) {
            let Some(actuator) = list.get_mut(channel) else { continue };
            match transmission.content {
                Content::Setpoint => {
                    actuator.setpoint = None;
                    self.next = channel + 1;
                }
                Content::DriveRequest(request) => {
                    actuator.pending = actuator.pending.without(request);
                    match request {
                        DriveRequest::Disable if frames > 0 => actuator.switched_off(),
                        DriveRequest::Enable if frames > 0 => actuator.switched_on(),
                        DriveRequest::QueryReadings => {
                            (self.reading, self.last_read) = (None, channel);
                        }
                        _ => {}
                    }
                }
            }
        }
    }
}

/// Iterates over the channels whose bit is set, in ascending order.
pub fn channels(mut bits: ChannelBits) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let first = (bits != 0).then_some(bits.trailing_zeros() as usize);
        bits &= bits.wrapping_sub(1);
        first
    })
}

/// Builds the command for a channel, or `None` if the pose that it requires is unknown or outdated.
pub fn order(
    list: &[Actuator],
    config: &RobotConfig,
    bus: &Bus,
    can: &Capabilities,
    content: Content,
    channel: usize,
) -> Option<ActuatorCommand> {
    let (actuator, configured) = (list.get(channel)?, config.channels.get(channel)?);
    let Content::DriveRequest(request) = content else {
        return Some(ActuatorCommand { id: configured.id, command: actuator.setpoint? });
    };
    let max_torque_nm = actuator.torque_limit_nm.unwrap_or(configured.max_torque_nm);
    let limits = &Channel { max_torque_nm, ..*configured };
    // Torque-on needs a known pose. If the drive then holds its position at once, the pose must also be fresh. Without such a
    // pose the request is dropped, and the controller repeats it later.
    let holds =
        !(can.gains == UpdatePolicy::EverySetpoint || bus.control == ControlLoop::OnController);
    let feedback = match actuator.feedback() {
        Some(feedback) => feedback,
        None if request == DriveRequest::Enable => return None,
        None => Feedback::default(),
    };
    if request == DriveRequest::Enable && holds && actuator.silent_ticks > FRESH_TICKS {
        return None;
    }
    let command = orders::command(request, limits, bus, can, actuator.gains, &feedback);
    Some(ActuatorCommand { id: limits.id, command })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A command without frames does not change the recorded torque state: it is dropped if the pose is unknown or outdated.
    #[test]
    fn an_order_of_no_frames_switches_nothing() {
        for (request, frames, waits) in [
            (DriveRequest::Enable, 0, false),
            (DriveRequest::Enable, 1, true),
            (DriveRequest::Disable, 0, true),
            (DriveRequest::Disable, 1, false),
        ] {
            let config = RobotConfig { robot: 0, channels: heapless::Vec::new() };
            let mut driver = BusDriver::new(Bus::default(), &config, 0);
            let mut list = [Actuator::default()];
            if request == DriveRequest::Disable {
                list[0].switched_on();
            }
            let content = Content::DriveRequest(request);
            driver.frame_sent(&mut list, Transmission { content, channels: 1, sent: 0 }, frames);
            assert_eq!(list[0].waits_for_enable(1), waits, "{request:?}, {frames} frames");
        }
    }
}
