//! Control table of Dynamixel's XL, XM and XH servos.
//!
//! All models have the same addresses. They have the same units, except for the current of an XL330 and the load of an XL430.
//!
//! Document: e-Manual pages `x/xm430-w210`, `x/xl330-m288`, and so on by the names of [`MODELS`]: "Specifications", "Control
//! Table of EEPROM Area" (Current Limit, Velocity Limit) and "of RAM Area". Multi-byte values are little-endian, negative ones
//! two's complement.

use core::f32::consts::TAU;

use crate::actuators::named::Named;

/// Bit rates, bit/s, indexed by the value of the register "Baud Rate" (8).
pub const BIT_RATES: [u32; 8] =
    [9_600, 57_600, 115_200, 1_000_000, 2_000_000, 3_000_000, 4_000_000, 4_500_000];
/// Operating mode, 1 byte, writable only while torque is off: 0 current, 1 velocity, 3 position, 4 extended position, 5
/// current-based position, 16 PWM.
pub const OPERATING_MODE: u16 = 11;
/// Torque switch, 1 byte: 0 off, 1 on.
pub const TORQUE_ENABLE: u16 = 64;
/// Hardware error bits, 1 byte: 0 supply voltage, 2 overheated, 3 encoder, 4 electrical shock, 5 overload.
pub const HARDWARE_ERROR: u16 = 70;
/// D gain of the position controller, 2 bytes. The I gain and the P gain follow.
pub const POSITION_D_GAIN: u16 = 80;
/// Timeout without a packet, 1 byte, 1 to 127 steps of 20 ms. After a timeout the servo stops, the register reads −1, and goals
/// cannot be written until 0 has been written here.
pub const BUS_WATCHDOG: u16 = 98;
/// Goal PWM, 2 bytes, steps of 0.113 %.
pub const GOAL_PWM: u16 = 100;
/// Goal current, 2 bytes, steps of 2.69 mA, or of 1 mA on an XL330. In mode 5 it is the current limit. An XL430 lacks this
/// register.
pub const GOAL_CURRENT: u16 = 102;
/// Goal velocity, 4 bytes, steps of 0.229 rev/min.
pub const GOAL_VELOCITY: u16 = 104;
/// Velocity limit of position goals, 4 bytes, steps of 0.229 rev/min; 0 for no limit.
pub const PROFILE_VELOCITY: u16 = 112;
/// Goal position, 4 bytes, 4096 steps per turn.
pub const GOAL_POSITION: u16 = 116;
/// Present current, 2 bytes, steps of 2.69 mA, or of 1 mA on an XL330. On an XL430 it is the load in steps of 0.1 %. Velocity
/// and position follow, 4 bytes each.
pub const PRESENT_CURRENT: u16 = 126;
/// Present velocity, 4 bytes, steps of 0.229 rev/min.
pub const PRESENT_VELOCITY: u16 = 128;
/// Present position, 4 bytes, 4096 steps per turn.
pub const PRESENT_POSITION: u16 = 132;
/// Present input voltage, 2 bytes, steps of 0.1 V. The present temperature follows, 1 byte, °C.
pub const PRESENT_INPUT_VOLTAGE: u16 = 144;
/// Present temperature, 1 byte, °C.
pub const PRESENT_TEMPERATURE: u16 = 146;

/// Number of position steps per turn.
pub const STEPS_PER_TURN: f32 = 4096.0;
/// Position in the middle of a turn, steps. This crate maps it to 0 rad.
pub const CENTRE: i32 = 2048;
/// Velocity step, rad/s.
pub const VELOCITY_STEP_RAD_S: f32 = 0.229 * TAU / 60.0;
/// Step of the input voltage, V.
pub const VOLTAGE_STEP_V: f32 = 0.1;
/// PWM step, fraction of the supply voltage.
pub const PWM_STEP: f32 = 1.13e-3;
/// Largest PWM, steps.
pub const MAX_PWM: i32 = 885;
/// Largest gain of the position controller.
pub const MAX_GAIN: u16 = 16_383;

/// Servo model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model {
    /// Name of the servo.
    pub name: &'static str,
    /// Model number, which the servo returns to a ping.
    pub number: u16,
    /// Largest current, steps; 0 for servos without a current sensor, which have no goal current.
    pub max_current: i32,
    /// Factory setting of the largest velocity, steps.
    pub max_velocity: i32,
    /// Torque per step of [`PRESENT_CURRENT`] and [`GOAL_CURRENT`], N·m: stall torque divided by stall current, at the
    /// recommended voltage. This is an estimate that includes the friction of the gears. Servos without a current sensor
    /// estimate their load from the motor voltage; a step is then 0.1 % of the stall torque.
    pub torque_step_nm: f32,
}

impl Model {
    /// Builds a model from the values of its data sheet page.
    const fn new(name: &'static str, number: u16, max: (i32, i32), torque_step_nm: f32) -> Self {
        let (max_current, max_velocity) = max;
        Self { name, number, max_current, max_velocity, torque_step_nm }
    }

    /// Recommended supply voltage, V.
    pub const fn supply_v(&self) -> f32 {
        if self.number == XL330_M077.number || self.number == XL330_M288.number {
            5.0
        } else {
            12.0
        }
    }

    /// True if the servo measures and controls its current.
    pub const fn has_current(&self) -> bool {
        self.max_current > 0
    }
}

impl Named for Model {
    const ALL: &'static [Self] = &MODELS;

    fn name(&self) -> &'static str {
        self.name
    }
}

/// Current step of all servos except the XL330, A.
const STEP_A: f32 = 2.69e-3;
/// Current step of the XL330, A.
const XL330_STEP_A: f32 = 1.0e-3;

/// Stall torque 0.215 N·m at 1.47 A and 5 V.
pub const XL330_M077: Model =
    Model::new("XL330-M077", 1190, (1750, 1620), XL330_STEP_A * 0.215 / 1.47);
/// Stall torque 0.52 N·m at 1.47 A and 5 V.
pub const XL330_M288: Model =
    Model::new("XL330-M288", 1200, (1750, 445), XL330_STEP_A * 0.52 / 1.47);
/// Stall torque 1.4 N·m at 11.1 V; no current sensor.
pub const XL430_W250: Model = Model::new("XL430-W250", 1060, (0, 265), 1.0e-3 * 1.4);
/// Stall torque 3.0 N·m at 2.3 A and 12 V.
pub const XM430_W210: Model = Model::new("XM430-W210", 1030, (1193, 330), STEP_A * 3.0 / 2.3);
/// Stall torque 4.1 N·m at 2.3 A and 12 V.
pub const XM430_W350: Model = Model::new("XM430-W350", 1020, (1193, 200), STEP_A * 4.1 / 2.3);
/// Stall torque 7.3 N·m at 4.4 A and 12 V.
pub const XM540_W150: Model = Model::new("XM540-W150", 1130, (2047, 230), STEP_A * 7.3 / 4.4);
/// Stall torque 10.6 N·m at 4.4 A and 12 V.
pub const XM540_W270: Model = Model::new("XM540-W270", 1120, (2047, 128), STEP_A * 10.6 / 4.4);
/// Stall torque 2.5 N·m at 1.3 A and 12 V.
pub const XH430_W210: Model = Model::new("XH430-W210", 1010, (648, 230), STEP_A * 2.5 / 1.3);
/// Stall torque 3.4 N·m at 1.3 A and 12 V.
pub const XH430_W350: Model = Model::new("XH430-W350", 1000, (648, 135), STEP_A * 3.4 / 1.3);
/// Stall torque 7.1 N·m at 4.9 A and 12 V.
pub const XH540_W150: Model = Model::new("XH540-W150", 1110, (2047, 300), STEP_A * 7.1 / 4.9);
/// Stall torque 9.9 N·m at 4.9 A and 12 V.
pub const XH540_W270: Model = Model::new("XH540-W270", 1100, (2047, 167), STEP_A * 9.9 / 4.9);

/// Supported models.
pub const MODELS: [Model; 11] = [
    XM430_W210, XM540_W150, XL330_M077, XL330_M288, XL430_W250, XM430_W350, XM540_W270, XH430_W210,
    XH430_W350, XH540_W150, XH540_W270,
];
