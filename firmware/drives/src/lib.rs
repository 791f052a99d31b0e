//! Simulated servos and wheel drives of every protocol that the controller supports: they decode the bytes of their bus, answer,
//! and control their motor. Bytes and time come in, a [`Law`] goes out. The caller turns the shaft by it: the simulated robot's
//! motors, or a test bench without inertia.
//!
//! | module | is |
//! |---|---|
//! | [`rollwalk`] | servos of the Rollwalk profile |
//! | [`mit`] | mini cheetah drives and T-Motor's AK series |
//! | [`odrive`] | an axis of an ODrive, firmware 0.5 and 0.6 |
//! | [`cybergear`] | Xiaomi CyberGear |
//! | [`dynamixel`], [`feetech`] | Dynamixel X; Feetech STS |
//! | [`maestro`] | a hobby servo behind a Pololu Maestro |
//!
//! Written from the makers' documents (`docs/actuators.md`), apart from the codecs of
//! `rollwalk_protocol::actuators`: an error in those shows against these. A drive is as its maker
//! delivers it: a watchdog that is off from the factory is off here. Not simulated: current loops,
//! temperatures, the errors that a drive finds by itself, and profiles of its own.

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
    /// Torque that it gives, N·m.
    pub torque_nm: f64,
    /// True if the control law asked for more torque than the limit.
    pub torque_limited: bool,
}

/// Control law of a motor: kp (q* − q) + kd (q̇* − q̇) + τ, within a limit. The default is no torque.
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
    /// Largest torque, N·m, if below the motor's own limit.
    pub torque_limit_nm: f64,
}

impl Law {
    /// Target value: rad, or rad/s of a wheel.
    fn value(&self, is_wheel: bool) -> f32 {
        (if is_wheel { self.speed_rad_s } else { self.position_rad }) as f32
    }

    /// Event for this law as a setpoint.
    fn setpoint(&self, is_wheel: bool) -> Sent {
        Sent::Setpoint {
            value: self.value(is_wheel),
            kp: self.kp_nm_rad as f32,
            kd: self.kd_nm_s_rad as f32,
            torque_nm: self.torque_nm as f32,
        }
    }
}

/// Command to a drive, by the names in its documents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sent {
    /// Torque off.
    Disable,
    /// Torque on.
    Enable,
    /// A setpoint with gains; drives that keep gains have their stored ones here.
    Setpoint {
        /// rad, or rad/s of a wheel.
        value: f32,
        /// N·m/rad.
        kp: f32,
        /// N·m·s/rad.
        kd: f32,
        /// Torque on top, N·m.
        torque_nm: f32,
    },
    /// A torque alone, N·m.
    Torque(f32),
    /// Gains to keep.
    Gains {
        /// N·m/rad.
        kp: f32,
        /// N·m·s/rad.
        kd: f32,
    },
    /// Gain of an ODrive's position loop; kp is a multiple of it.
    PositionGain,
    /// Limits to keep.
    Limits,
    /// Kind of setpoint to follow.
    Mode,
    /// Timeout of the drive's watchdog.
    Watchdog,
    /// Forget faults.
    ClearFaults,
    /// Query of the measurements.
    Query,
    /// Unexpected command for this drive, which it ignored.
    Odd,
}

impl Sent {
    /// Cannot move anything by itself.
    pub fn is_harmless(self) -> bool {
        matches!(self, Sent::Disable | Sent::Query | Sent::ClearFaults)
    }
}

/// Answer of a drive on a serial line, with its timing.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Answer {
    /// The packet.
    pub bytes: Vec<u8>,
    /// Number of answers before this one, each after the one before. An adapter's single answer is given by all drives behind it.
    pub turn: usize,
    /// Delay after the query, or after the answer before this one, µs.
    pub delay_us: u64,
    /// True for a part of a packet that all answering servos build together, without the CRC at its end: [`Self::said`].
    pub is_part: bool,
}

impl Answer {
    /// Bytes on the line in this drive's turn, after the answers before it.
    pub fn said(&self, before: &[u8]) -> Vec<u8> {
        let mut said = self.bytes.clone();
        if self.is_part {
            said.extend(dynamixel::crc16(&[before, &said].concat()).to_le_bytes());
        }
        said
    }
}

/// Electronics around a motor, as its maker built them. The defaults are those of a drive on another kind of
/// bus, without timers and without a watchdog.
pub trait Electronics {
    /// Takes a frame. Returns the command and the answer; `None` for a frame for another drive.
    fn on_frame(
        &mut self,
        now_us: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(Sent, Option<Frame>)> {
        let _ = (now_us, frame, shaft);
        None
    }

    /// Takes a whole packet of a serial line. Returns the command and the answer.
    fn on_packet(
        &mut self,
        now_us: u64,
        packet: &[u8],
        shaft: &Shaft,
    ) -> (Vec<Sent>, Option<Answer>) {
        let _ = (now_us, packet, shaft);
        (vec![], None)
    }

    /// Takes the next packet out of the bytes of a serial line, with the bytes before it. All drives of a line find the same
    /// packet; [`Self::on_packet`] checks if it is sound.
    fn take_packet(&self, line: &mut Vec<u8>) -> Option<Vec<u8>> {
        let _ = line;
        None
    }

    /// The value of the setpoint in a frame for this drive, rad or rad/s of a wheel; `None` for any other
    /// frame. Without any effect.
    fn commanded(&self, frame: &Frame) -> Option<f32> {
        let _ = frame;
        None
    }

    /// Time of its next unsolicited frame.
    fn next_timer_us(&self) -> Option<u64> {
        None
    }

    /// Next unsolicited frame due at `now_us`; call until `None`.
    fn on_timer(&mut self, now_us: u64, shaft: &Shaft) -> Option<Frame> {
        let _ = (now_us, shaft);
        None
    }

    /// Lets its watchdog look at the time.
    fn on_time(&mut self, now_us: u64) {
        let _ = now_us;
    }

    /// Control law of its motor; `None` while torque is off.
    fn law(&self, shaft: &Shaft) -> Option<Law>;

    /// Gives it a setpoint from before it was switched on, if it remembers any: for tests.
    fn remember(&mut self, stale: Law) {
        let _ = stale;
    }
}

macro_rules! define_kind {
    (
        $profile:ident $Profile:ident can $profile_key:literal,
        $($module:ident $Codec:ident $transport:ident $key:literal,)*
    ) => {
        /// The electronics of a drive, by protocol.
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

/// A drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    bus: Bus,
    channel: Channel,
    /// Electronics around the motor.
    pub kind: Kind,
}

impl Drive {
    /// The drive of a channel on its bus, set up for it with its maker's tool, as it is after power-on.
    pub fn new(bus: &Bus, channel: &Channel) -> Self {
        Self { bus: *bus, channel: *channel, kind: Kind::new(bus, channel) }
    }

    /// Cuts the power: volatile state is lost.
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
    ) -> Option<(Sent, Option<Frame>)> {
        self.kind.electronics_mut().on_frame(now_us, frame, shaft)
    }

    fn on_packet(
        &mut self,
        now_us: u64,
        packet: &[u8],
        shaft: &Shaft,
    ) -> (Vec<Sent>, Option<Answer>) {
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

/// True if a channel is a wheel.
fn is_wheel(channel: &Channel) -> bool {
    channel.kind == ChannelKind::WheelSpeed
}
