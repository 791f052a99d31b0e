//! Memory table of Feetech's STS and SMS servos, which share addresses and units.
//!
//! Documents: Feetech, "Magnetic Encoder STS Servo, Memory Table Analysis", and its counterpart for SMS servos. Two-byte values
//! are little-endian; negative ones are a magnitude with a sign bit.

use core::f32::consts::TAU;

use crate::actuators::named::Named;

/// Operating mode, 1 byte, non-volatile: 0 position, 1 speed, 2 PWM, 3 steps.
pub const OPERATING_MODE: u8 = 33;
/// Torque switch, 1 byte: 0 off, 1 on.
pub const TORQUE_ENABLE: u8 = 40;
/// Acceleration, 1 byte, steps of 8.7 °/s²; 0 for the largest.
pub const ACCELERATION: u8 = 41;
/// Goal position, 2 bytes, 4096 steps per turn, sign in bit 15.
pub const GOAL_POSITION: u8 = 42;
/// Goal velocity, 2 bytes, steps/s, sign in bit 15. In position mode it is the largest speed. The two bytes between goal
/// position and goal velocity are for PWM, and are unused in both modes.
pub const GOAL_VELOCITY: u8 = 46;
/// Torque limit, 2 bytes, steps of 0.1 % of the stall torque.
pub const TORQUE_LIMIT: u8 = 48;
/// Present position, 2 bytes, sign in bit 15. These follow: velocity, 2 bytes, sign in bit 15; load, 2 bytes, steps of 0.1 %,
/// sign in bit 10; voltage, 1 byte, 0.1 V; temperature, 1 byte, °C.
pub const PRESENT_POSITION: u8 = 56;

/// Position in the middle of a turn, steps. This crate maps it to 0 rad.
pub const CENTRE: i32 = 2048;
/// Position step, rad; also the velocity step, rad/s.
pub const STEP_RAD: f32 = TAU / 4096.0;
/// Step of the voltage, V.
pub const VOLTAGE_STEP_V: f32 = 0.1;
/// Bit rates, bit/s, indexed by the value of the register "baud rate" (6).
pub const BIT_RATES: [u32; 8] =
    [1_000_000, 500_000, 250_000, 128_000, 115_200, 76_800, 57_600, 38_400];
/// Torque of 1 kg·cm, the unit of the data sheets, N·m.
const KG_CM_NM: f32 = 0.098_066_5;

/// Servo model at its supply voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Name of the servo, with the maker's code of the variant.
    pub name: &'static str,
    /// Speed without load, steps/s.
    pub max_velocity: i32,
    /// Stall torque, N·m: the reference of [`TORQUE_LIMIT`] and of the load. The load is the motor voltage as a fraction of the
    /// supply, so a torque computed from it is an estimate.
    pub stall_torque_nm: f32,
    /// Supply voltage of these values, V.
    pub supply_v: f32,
}

impl Model {
    /// Builds a model from its data sheet: supply in V, no-load speed in rev/min, and stall torque in kg·cm.
    const fn new(name: &'static str, supply_v: f32, rev_min: f32, kg_cm: f32) -> Self {
        let max_velocity = (rev_min * 4096.0 / 60.0) as i32;
        Self { name, max_velocity, stall_torque_nm: kg_cm * KG_CM_NM, supply_v }
    }
}

impl Named for Model {
    const ALL: &'static [Self] = &MODELS;

    fn name(&self) -> &'static str {
        self.name
    }
}

/// STS3215 at 7.4 V.
pub const STS3215_C001: Model = Model::new("STS3215-C001", 7.4, 52.0, 19.5);
/// STS3215 at 12 V.
pub const STS3215_C018: Model = Model::new("STS3215-C018", 12.0, 45.0, 30.0);
/// STS3250 at 12 V: 60° in 0.133 s.
pub const STS3250: Model = Model::new("STS3250", 12.0, 75.0, 50.0);

/// Supported models.
pub const MODELS: [Model; 3] = [STS3215_C001, STS3215_C018, STS3250];
