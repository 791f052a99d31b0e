//! Simulated servos and wheel drives of every protocol that the controller supports. They decode the bytes of their bus,
//! answer, and control their motor.
//!
//! The inputs are bytes and time, the output is a [`Law`]. The caller applies it to the shaft: the motors of the simulated
//! robot, or a test bench without inertia.
//!
//! | module | drive |
//! |---|---|
//! | [`rollwalk`] | servos of the Rollwalk profile |
//! | [`mit`] | mini cheetah drives and T-Motor's AK series |
//! | [`odrive`] | an axis of an ODrive, firmware 0.5 and 0.6 |
//! | [`cybergear`] | Xiaomi CyberGear |
//! | [`dynamixel`], [`feetech`] | Dynamixel X; Feetech STS |
//! | [`maestro`] | a hobby servo behind a Pololu Maestro |
//!
//! The drives are written from the makers' documents, independently of the codecs in
//! `rollwalk_protocol::actuators`, so that tests reveal errors of the codecs. Drives start in the state in which the maker
//! delivers them; for instance, a watchdog that is delivered switched off is off. Current loops, temperatures, self-detected
//! errors and motion profiles are not simulated.

#![warn(missing_docs)]

use rollwalk_protocol::actuator_protocols;
use rollwalk_protocol::actuators::bus::{Bus, Protocol};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};

pub mod cybergear;
pub mod dynamixel;
pub mod feetech;
pub mod maestro;
pub mod mit;
pub mod odrive;
pub mod rollwalk;
mod scale;
#[cfg(test)]
mod tests;

/// Measurements of a drive at the output of its motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// Angle, rad.
    pub position_rad: f64,
    /// Speed, rad/s.
    pub speed_rad_s: f64,
    /// Torque of the motor, N·m.
    pub torque_nm: f64,
    /// True if the control law requested more torque than the limit.
    pub torque_limited: bool,
}

/// Control law of a motor: kp (q* − q) + kd (q̇* − q̇) + τ, within a limit. The default gives no torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Law {
    /// q*, rad.
    pub position_rad: f64,
    /// q̇*, rad/s.
    pub speed_rad_s: f64,
    /// kp, N·m/rad.
    pub kp_nm_rad: f64,
    /// kd, N·m·s/rad.
    pub kd_nm_s_rad: f64,
    /// τ, N·m.
    pub torque_nm: f64,
    /// Torque limit, N·m, if below the motor's own limit.
    pub torque_limit_nm: f64,
}

impl Law {
    /// Target value, rad, or rad/s for a wheel.
    fn value(&self, is_wheel: bool) -> f32 {
        (if is_wheel { self.speed_rad_s } else { self.position_rad }) as f32
    }

    /// Converts the law to a set-point event.
    fn setpoint(&self, is_wheel: bool) -> DriveCommand {
        DriveCommand::Setpoint {
            value: self.value(is_wheel),
            kp: self.kp_nm_rad as f32,
            kd: self.kd_nm_s_rad as f32,
            torque_nm: self.torque_nm as f32,
        }
    }
}

/// Command to a drive, named as in its documents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DriveCommand {
    /// Torque off.
    Disable,
    /// Torque on.
    Enable,
    /// Set-point with gains. A drive that stores gains reports its stored ones.
    Setpoint {
        /// Target value, rad, or rad/s for a wheel.
        value: f32,
        /// Gain kp, N·m/rad.
        kp: f32,
        /// Gain kd, N·m·s/rad.
        kd: f32,
        /// Feed-forward torque, N·m.
        torque_nm: f32,
    },
    /// Torque alone, N·m.
    Torque(f32),
    /// Gains to store.
    Gains {
        /// Gain kp, N·m/rad.
        kp: f32,
        /// Gain kd, N·m·s/rad.
        kd: f32,
    },
    /// Gain of an ODrive's position loop, a factor of kp.
    PositionGain,
    /// Limits to store.
    Limits,
    /// Kind of set-point to follow.
    Mode,
    /// Timeout of the drive's watchdog.
    Watchdog,
    /// Clearing of faults.
    ClearFaults,
    /// Query of the measurements.
    Query,
    /// Unexpected command for this drive, which it ignored.
    Odd,
}

impl DriveCommand {
    /// True if the command cannot move anything by itself.
    pub fn is_harmless(self) -> bool {
        matches!(self, DriveCommand::Disable | DriveCommand::Query | DriveCommand::ClearFaults)
    }
}

/// Answer of a drive on a serial line, with its timing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// Bytes of the packet.
    pub bytes: Vec<u8>,
    /// Number of answers that precede this one. All drives behind an adapter return the adapter's single answer.
    pub turn: usize,
    /// Delay after the query or the preceding answer, µs.
    pub delay_us: u64,
    /// True for a part of a packet that all answering servos build together. The part does not include the CRC at its end; see
    /// [`Self::line_answer`].
    pub is_part: bool,
}

impl Answer {
    /// Bytes on the line in this drive's turn; `before` are the bytes of the preceding answers.
    pub fn line_answer(&self, before: &[u8]) -> Vec<u8> {
        let mut said = self.bytes.clone();
        if self.is_part {
            said.extend(dynamixel::crc16(&[before, &said].concat()).to_le_bytes());
        }
        said
    }
}

/// Electronics of a drive, which control its motor.
///
/// The default methods suit a drive on another kind of bus, without timers and without a watchdog.
pub trait Electronics {
    /// Processes a frame. Returns the command and the answer; `None` if the frame is for another drive.
    fn on_frame(
        &mut self,
        now_us: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        let _ = (now_us, frame, shaft);
        None
    }

    /// Processes a complete packet of a serial line. Returns the commands and the answer.
    fn on_packet(
        &mut self,
        now_us: u64,
        packet: &[u8],
        shaft: &Shaft,
    ) -> (Vec<DriveCommand>, Option<Answer>) {
        let _ = (now_us, packet, shaft);
        (vec![], None)
    }

    /// Removes the next packet and the bytes before it from the bytes of a serial line. All drives of a line extract the same
    /// packet; [`Self::on_packet`] checks its validity.
    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        let _ = line;
        None
    }

    /// Value of the set-point in a frame for this drive, rad, or rad/s for a wheel; `None` for any other frame. The call has no
    /// side effects.
    fn commanded(&self, frame: &Frame) -> Option<f32> {
        let _ = frame;
        None
    }

    /// Time of the drive's next unsolicited frame, µs; `None` if it sends none.
    fn next_timer_us(&self) -> Option<u64> {
        None
    }

    /// Returns the next unsolicited frame that is due at `now_us`; call it until it returns `None`.
    fn on_timer(&mut self, now_us: u64, shaft: &Shaft) -> Option<Frame> {
        let _ = (now_us, shaft);
        None
    }

    /// Updates the watchdog to the present time.
    fn on_time(&mut self, now_us: u64) {
        let _ = now_us;
    }

    /// Control law of the motor; `None` while torque is off.
    fn law(&self, shaft: &Shaft) -> Option<Law>;

    /// Stores a set-point from before the drive was enabled, if it keeps any. For tests.
    fn remember(&mut self, stale: Law) {
        let _ = stale;
    }
}

macro_rules! define_kind {
    (
        $profile:ident $Profile:ident can $profile_key:literal,
        $($module:ident $Codec:ident $transport:ident $key:literal,)*
    ) => {
        /// Electronics of a drive, by protocol.
        #[derive(Clone, Debug)]
        pub enum Kind {
            #[doc = concat!("See [`", stringify!($profile), "`].")]
            $Profile($profile::Drive),
            $(
                #[doc = concat!("See [`", stringify!($module), "`].")]
                $Codec($module::Drive),
            )*
        }

        impl Kind {
            fn new(bus: &Bus, channel: &Channel) -> Self {
                match bus.protocol {
                    Protocol::$Profile => Self::$Profile($profile::Drive::new(channel)),
                    $(Protocol::$Codec(settings) => {
                        Self::$Codec($module::Drive::new(settings, bus, channel))
                    })*
                }
            }

            fn electronics(&self) -> &dyn Electronics {
                match self {
                    Self::$Profile(drive) => drive,
                    $(Self::$Codec(drive) => drive,)*
                }
            }

            fn electronics_mut(&mut self) -> &mut dyn Electronics {
                match self {
                    Self::$Profile(drive) => drive,
                    $(Self::$Codec(drive) => drive,)*
                }
            }
        }
    };
}
actuator_protocols!(define_kind);

/// Drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    bus: Bus,
    channel: Channel,
    /// Electronics of the drive.
    pub kind: Kind,
}

impl Drive {
    /// Creates the drive of a channel in its state after power-on, configured for the channel with the maker's tool.
    pub fn new(bus: &Bus, channel: &Channel) -> Self {
        Self { bus: *bus, channel: *channel, kind: Kind::new(bus, channel) }
    }

    /// Cuts the power, which erases the volatile state.
    pub fn cut_power(&mut self) {
        self.kind = Kind::new(&self.bus, &self.channel);
    }
}

impl Electronics for Drive {
    fn on_frame(
        &mut self,
        now_us: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(DriveCommand, Option<Frame>)> {
        self.kind.electronics_mut().on_frame(now_us, frame, shaft)
    }

    fn on_packet(
        &mut self,
        now_us: u64,
        packet: &[u8],
        shaft: &Shaft,
    ) -> (Vec<DriveCommand>, Option<Answer>) {
        self.kind.electronics_mut().on_packet(now_us, packet, shaft)
    }

    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        self.kind.electronics().take_packet(line)
    }

    fn commanded(&self, frame: &Frame) -> Option<f32> {
        self.kind.electronics().commanded(frame)
    }

    fn next_timer_us(&self) -> Option<u64> {
        self.kind.electronics().next_timer_us()
    }

    fn on_timer(&mut self, now_us: u64, shaft: &Shaft) -> Option<Frame> {
        self.kind.electronics_mut().on_timer(now_us, shaft)
    }

    fn on_time(&mut self, now_us: u64) {
        self.kind.electronics_mut().on_time(now_us);
    }

    fn law(&self, shaft: &Shaft) -> Option<Law> {
        self.kind.electronics().law(shaft)
    }

    fn remember(&mut self, stale: Law) {
        self.kind.electronics_mut().remember(stale);
    }
}

fn is_wheel(channel: &Channel) -> bool {
    channel.kind == ChannelKind::WheelSpeed
}
