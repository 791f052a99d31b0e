//! Control table of Dynamixel's XM430-W210 and XM540-W150, which share their addresses and units.
//!
//! Document: e-Manual pages `x/xm430-w210` and `x/xm540-w150`, "Control Table of EEPROM Area" and
//! "of RAM Area". Multi-byte values are little-endian, negative ones two's complement.

use core::f32::consts::TAU;

use crate::actuators::named::Named;

/// Operating mode, 1 byte, only while torque is off: 0 current, 1 velocity, 3 position, 4 extended
/// position, 5 current-based position, 16 PWM.
pub const OPERATING_MODE: u16 = 11;
/// 1 byte: torque on, off.
pub const TORQUE_ENABLE: u16 = 64;
/// 1 byte: 0 supply voltage, 2 overheated, 3 encoder, 4 electrical shock, 5 overload, as bits.
pub const HARDWARE_ERROR: u16 = 70;
/// 2 bytes, followed by I gain and P gain of the position controller.
pub const POSITION_D_GAIN: u16 = 80;
/// 1 byte: 1 to 127 times 20 ms without a packet stop the servo; then it reads −1, and goals cannot
/// be written until 0 has been.
pub const BUS_WATCHDOG: u16 = 98;
/// 2 bytes, steps of 0.113 %.
pub const GOAL_PWM: u16 = 100;
/// 2 bytes, steps of 2.69 mA. The limit of the current in mode 5.
pub const GOAL_CURRENT: u16 = 102;
/// 4 bytes, steps of 0.229 rev/min.
pub const GOAL_VELOCITY: u16 = 104;
/// 4 bytes, steps of 0.229 rev/min; 0 is no limit.
pub const PROFILE_VELOCITY: u16 = 112;
/// 4 bytes, 4096 steps a turn.
pub const GOAL_POSITION: u16 = 116;
/// 2 bytes, steps of 2.69 mA; velocity and position follow, 4 bytes each.
pub const PRESENT_CURRENT: u16 = 126;
/// 4 bytes, steps of 0.229 rev/min.
pub const PRESENT_VELOCITY: u16 = 128;
/// 4 bytes, 4096 steps a turn.
pub const PRESENT_POSITION: u16 = 132;
/// 1 byte, °C.
pub const PRESENT_TEMPERATURE: u16 = 146;

/// Steps of position in a turn.
pub const STEPS_PER_TURN: f32 = 4096.0;
/// Position in the middle of a turn: 0 rad here.
pub const CENTRE: i32 = 2048;
/// A step of velocity, rad/s.
pub const VELOCITY_STEP_RAD_S: f32 = 0.229 * TAU / 60.0;
/// A step of current, A.
pub const CURRENT_STEP_A: f32 = 2.69e-3;
/// A step of PWM, share of the supply voltage.
pub const PWM_STEP: f32 = 1.13e-3;
/// Largest PWM, steps.
pub const MAX_PWM: i32 = 885;
/// Largest gain of the position controller.
pub const MAX_GAIN: u16 = 16_383;

/// A servo.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Its name.
    pub name: &'static str,
    /// What it answers to a ping.
    pub number: u16,
    /// Largest current, steps.
    pub max_current: i32,
    /// Largest velocity as delivered, steps.
    pub max_velocity: i32,
    /// Torque per current, N·m/A: stall torque over stall current at 12 V. An estimate, friction of
    /// the gears is in it.
    pub torque_nm_a: f32,
}

impl Named for Model {
    const ALL: &'static [Self] = &MODELS;

    fn name(&self) -> &'static str {
        self.name
    }
}

/// XM430-W210: 3.0 N·m at 2.3 A.
pub const XM430_W210: Model = Model {
    name: "XM430-W210",
    number: 1030,
    max_current: 1193,
    max_velocity: 330,
    torque_nm_a: 3.0 / 2.3,
};

/// XM540-W150: 7.3 N·m at 4.4 A.
pub const XM540_W150: Model = Model {
    name: "XM540-W150",
    number: 1130,
    max_current: 2047,
    max_velocity: 230,
    torque_nm_a: 7.3 / 4.4,
};

/// All of them.
pub const MODELS: [Model; 2] = [XM430_W210, XM540_W150];
