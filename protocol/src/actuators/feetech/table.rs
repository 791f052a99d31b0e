//! Memory table of Feetech's STS and SMS servos, which share their addresses and units.
//!
//! Document: Feetech, "Magnetic Encoder STS Servo, Memory Table Analysis", and the same for SMS servos. Values of two
//! bytes are little-endian; negative ones are a magnitude with a sign bit.

use core::f32::consts::TAU;

use crate::actuators::named::Named;

/// Operating mode, 1 byte, kept without power: 0 position, 1 speed, 2 PWM, 3 steps.
pub const OPERATING_MODE: u8 = 33;
/// 1 byte: 0 torque off, 1 on.
pub const TORQUE_ENABLE: u8 = 40;
/// 1 byte, steps of 8.7 °/s²; 0 is the largest.
pub const ACCELERATION: u8 = 41;
/// 2 bytes, 4096 steps a turn, sign in bit 15.
pub const GOAL_POSITION: u8 = 42;
/// 2 bytes, steps a second, sign in bit 15. Of a servo in position mode the largest speed. Between it and the position
/// are two bytes for PWM, which neither mode looks at.
pub const GOAL_VELOCITY: u8 = 46;
/// 2 bytes, 0.1 % of the stall torque.
pub const TORQUE_LIMIT: u8 = 48;
/// 2 bytes each: position and velocity, sign in bit 15, and load in 0.1 %, sign in bit 10; then a byte of voltage, 0.1 V,
/// and a byte of temperature, °C.
pub const PRESENT_POSITION: u8 = 56;

/// Position in the middle of a turn: 0 rad here.
pub const CENTRE: i32 = 2048;
/// A step of position, rad; a step a second of velocity, rad/s.
pub const STEP_RAD: f32 = TAU / 4096.0;
/// Bits per second by the values of the baud rate (6), 0 to 7.
pub const BIT_RATES: [u32; 8] =
    [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];
/// A kg·cm, in which data sheets give torques, N·m.
const KG_CM_NM: f32 = 0.098_066_5;

/// A servo at its voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Name of the servo, with the maker's code of a variant.
    pub name: &'static str,
    /// Speed without load, steps/s.
    pub max_velocity: i32,
    /// Stall torque, N·m: the reference of [`TORQUE_LIMIT`] and load. The load is the share of the voltage at the motor, so a
    /// torque computed from it is an estimate.
    pub stall_torque_nm: f32,
}

impl Model {
    /// Builds a model from its data sheet: rev/min without load and kg·cm at stall.
    const fn new(name: &'static str, rev_min: f32, kg_cm: f32) -> Self {
        let max_velocity = (rev_min * 4096.0 / 60.0) as i32;
        Self { name, max_velocity, stall_torque_nm: kg_cm * KG_CM_NM }
    }
}

impl Named for Model {
    const ALL: &'static [Self] = &MODELS;

    fn name(&self) -> &'static str {
        self.name
    }
}

/// STS3215 at 7.4 V.
pub const STS3215_C001: Model = Model::new("STS3215-C001", 52.0, 19.5);
/// STS3215 at 12 V.
pub const STS3215_C018: Model = Model::new("STS3215-C018", 45.0, 30.0);
/// STS3250 at 12 V: 60° in 0.133 s.
pub const STS3250: Model = Model::new("STS3250", 75.0, 50.0);

/// Supported models.
pub const MODELS: [Model; 3] = [STS3215_C001, STS3215_C018, STS3250];
