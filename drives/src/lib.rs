//! Simulated servos and wheel drives of every protocol that the controller speaks: they decode the bytes
//! of their bus, answer, and control their motor. Bytes and time come in, a [`Law`] goes out; the caller
//! turns the shaft by it: the simulated robot's motors, or a test bench without inertia.
//!
//! | module | is |
//! |---|---|
//! | [`rollwalk`] | servos of the Rollwalk profile |
//! | [`mit`] | mini cheetah drives and T-Motor's AK series |
//! | [`odrive`] | an axis of an ODrive, firmware 0.5 and 0.6 |
//! | [`cybergear`] | Xiaomi CyberGear |
//! | [`dynamixel`], [`maestro`] | Dynamixel X; a hobby servo behind a Pololu Maestro |
//!
//! Written from the makers' documents (`docs/actuators.md`), apart from the codecs of
//! `rollwalk_protocol::actuators`: an error in those shows against these. A drive is as its maker
//! delivers it: a watchdog that is off from the factory is off here. Not simulated: current loops,
//! temperatures, the errors that a drive finds by itself, and profiles of its own.

use rollwalk_protocol::actuators::bus::{Bus, Protocol};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::{Channel, ChannelKind};

pub mod cybergear;
pub mod dynamixel;
pub mod maestro;
pub mod mit;
pub mod odrive;
pub mod rollwalk;
mod scale;
#[cfg(test)]
mod tests;

use cybergear::CyberGearMotor;
use dynamixel::DynamixelServo;
use maestro::MaestroServo;
use mit::MitDrive;
use odrive::OdriveAxis;
use rollwalk::RollwalkServo;

/// What a drive measures of its motor, at the output.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shaft {
    /// Angle, rad.
    pub position_rad: f64,
    /// Speed, rad/s.
    pub speed_rad_s: f64,
    /// Torque that it gives, N·m.
    pub torque_nm: f64,
    /// Its law asked for more torque than there is.
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
    /// Largest torque, N·m, if that is less than what the motor has.
    pub torque_limit_nm: f64,
}

impl Law {
    /// What it is a setpoint of: rad, or rad/s of a wheel.
    fn value(&self, is_wheel: bool) -> f32 {
        (if is_wheel { self.speed_rad_s } else { self.position_rad }) as f32
    }

    /// A drive was sent it.
    fn setpoint(&self, is_wheel: bool) -> Sent {
        Sent::Setpoint {
            value: self.value(is_wheel),
            kp: self.kp_nm_rad as f32,
            kd: self.kd_nm_s_rad as f32,
            torque_nm: self.torque_nm as f32,
        }
    }
}

/// What was sent to a drive, as its documents name it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Sent {
    /// Torque off.
    Disable,
    /// Torque on.
    Enable,
    /// A setpoint with gains; of drives that keep them, those that they have.
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
    /// The gain of an ODrive's position loop, of which kp is a multiple.
    PositionGain,
    /// Limits to keep.
    Limits,
    /// What kind of setpoint to follow.
    Mode,
    /// Timeout of the drive's watchdog.
    Watchdog,
    /// Forget faults.
    ClearFaults,
    /// Tell what you measure.
    Query,
    /// Anything else for this drive, which it did not do.
    Odd,
}

impl Sent {
    /// Cannot move anything by itself.
    pub fn is_harmless(self) -> bool {
        matches!(self, Sent::Disable | Sent::Query | Sent::ClearFaults)
    }
}

/// What a maker built around a motor.
#[derive(Clone, Debug)]
pub enum Electronics {
    /// Of the Rollwalk profile.
    Rollwalk(RollwalkServo),
    /// Mini cheetah, AK.
    Mit(MitDrive),
    /// ODrive.
    Odrive(OdriveAxis),
    /// CyberGear.
    CyberGear(CyberGearMotor),
    /// Dynamixel X.
    Dynamixel(DynamixelServo),
    /// A channel of a Maestro.
    Maestro(MaestroServo),
}

/// A drive on a bus.
#[derive(Clone, Debug)]
pub struct Drive {
    bus: Bus,
    channel: Channel,
    /// What is around its motor.
    pub electronics: Electronics,
}

impl Drive {
    /// The drive of a channel on its bus, set up for it with its maker's tool, as it is after power-on.
    pub fn new(bus: &Bus, channel: &Channel) -> Self {
        let electronics = match bus.protocol {
            Protocol::Rollwalk => Electronics::Rollwalk(RollwalkServo::new(channel)),
            Protocol::Mit(mit) => Electronics::Mit(MitDrive::new(mit, channel)),
            Protocol::Odrive(odrive) => Electronics::Odrive(OdriveAxis::new(odrive, channel)),
            Protocol::CyberGear(gear) => Electronics::CyberGear(CyberGearMotor::new(gear, channel)),
            Protocol::Dynamixel(dynamixel) => {
                Electronics::Dynamixel(DynamixelServo::new(dynamixel, bus.control, channel))
            }
            Protocol::Maestro(maestro) => Electronics::Maestro(MaestroServo::new(maestro, channel)),
        };
        Self { bus: *bus, channel: *channel, electronics }
    }

    /// Its power is gone, and what it did not keep with it.
    pub fn cut_power(&mut self) {
        *self = Self::new(&self.bus, &self.channel);
    }

    /// A frame on its bus, and where its motor is: what it was sent, and what it answers. `None` if the
    /// frame is not for it.
    pub fn on_frame(
        &mut self,
        now_us: u64,
        frame: &Frame,
        shaft: &Shaft,
    ) -> Option<(Sent, Option<Frame>)> {
        match &mut self.electronics {
            Electronics::Rollwalk(servo) => {
                let (sent, answer) = servo.on_frame(now_us, frame, shaft)?;
                Some((sent, Some(answer)))
            }
            Electronics::Mit(drive) => {
                let (sent, answer) = drive.on_frame(frame, shaft)?;
                Some((sent, Some(answer)))
            }
            Electronics::Odrive(axis) => axis.on_frame(frame).map(|sent| (sent, None)),
            Electronics::CyberGear(motor) => {
                let (sent, answer) = motor.on_frame(frame, shaft)?;
                Some((sent, answer))
            }
            _ => None,
        }
    }

    /// A packet on its serial line, whole: what it was sent, and the bytes that it answers.
    pub fn on_packet(&mut self, now_us: u64, packet: &[u8], shaft: &Shaft) -> (Vec<Sent>, Vec<u8>) {
        match &mut self.electronics {
            Electronics::Dynamixel(servo) => servo.on_packet(now_us, packet, shaft),
            Electronics::Maestro(servo) => servo.on_packet(packet),
            _ => (vec![], vec![]),
        }
    }

    /// The value of the setpoint in a frame for this drive, rad or rad/s of a wheel; none in another frame.
    /// Without any effect.
    pub fn commanded(&self, frame: &Frame) -> Option<f32> {
        match &self.electronics {
            Electronics::Rollwalk(servo) => servo.commanded(frame),
            Electronics::Mit(drive) => drive.commanded(frame),
            Electronics::Odrive(axis) => axis.commanded(frame),
            Electronics::CyberGear(motor) => motor.commanded(frame),
            _ => None,
        }
    }

    /// When it will say something by itself.
    pub fn next_timer_us(&self) -> Option<u64> {
        match &self.electronics {
            Electronics::Odrive(axis) => Some(axis.next_timer_us()),
            _ => None,
        }
    }

    /// Next unsolicited frame due at `now_us`; call until `None`.
    pub fn on_timer(&mut self, now_us: u64, shaft: &Shaft) -> Option<Frame> {
        match &mut self.electronics {
            Electronics::Odrive(axis) => axis.on_timer(now_us, shaft),
            _ => None,
        }
    }

    /// Time has passed: its watchdog looks at it.
    pub fn on_time(&mut self, now_us: u64) {
        match &mut self.electronics {
            Electronics::Rollwalk(servo) => servo.on_time(now_us),
            Electronics::Dynamixel(servo) => servo.on_time(now_us),
            _ => {}
        }
    }

    /// What it has its motor do; `None` while torque is off.
    pub fn law(&self, shaft: &Shaft) -> Option<Law> {
        match &self.electronics {
            Electronics::Rollwalk(servo) => servo.law(),
            Electronics::Mit(drive) => drive.law(),
            Electronics::Odrive(axis) => axis.law(shaft),
            Electronics::CyberGear(motor) => motor.law(),
            Electronics::Dynamixel(servo) => servo.law(),
            Electronics::Maestro(servo) => servo.law(),
        }
    }
}

/// Whether a channel is a wheel.
fn is_wheel(channel: &Channel) -> bool {
    channel.kind == ChannelKind::WheelSpeed
}
