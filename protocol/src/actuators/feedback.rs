//! Feedback of an actuator in the units of this crate, and its faults.

/// Feedback of an actuator. In most protocols a frame contains only some of the values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Feedback {
    /// Angle, rad.
    pub position_rad: Option<f32>,
    /// Speed, rad/s.
    pub speed_rad_s: Option<f32>,
    /// Torque, N·m.
    pub torque_nm: Option<f32>,
    /// Temperature of the motor, °C.
    pub temperature_c: Option<f32>,
    /// Supply voltage, V.
    pub voltage_v: Option<f32>,
    /// True if torque is on.
    pub enabled: Option<bool>,
    /// Faults of the actuator.
    pub faults: Option<Faults>,
}

impl Feedback {
    /// Overwrites the values that `newer` contains.
    pub fn merge(&mut self, newer: &Feedback) {
        self.position_rad = newer.position_rad.or(self.position_rad);
        self.speed_rad_s = newer.speed_rad_s.or(self.speed_rad_s);
        self.torque_nm = newer.torque_nm.or(self.torque_nm);
        self.temperature_c = newer.temperature_c.or(self.temperature_c);
        self.voltage_v = newer.voltage_v.or(self.voltage_v);
        self.enabled = newer.enabled.or(self.enabled);
        self.faults = newer.faults.or(self.faults);
    }
}

/// Faults of an actuator, as bits. Every fault of the actuator's own protocol sets at least one bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Faults(pub u8);

impl Faults {
    /// Empty set of faults.
    pub const NONE: Faults = Faults(0);
    /// Watchdog of the actuator expired: no command within its timeout.
    pub const TIMED_OUT: Faults = Faults(1 << 0);
    /// Too hot.
    pub const OVERHEATED: Faults = Faults(1 << 1);
    /// Supply voltage out of range.
    pub const BAD_VOLTAGE: Faults = Faults(1 << 2);
    /// Too much current, or overload.
    pub const OVERCURRENT: Faults = Faults(1 << 3);
    /// Position sensor failed.
    pub const SENSOR: Faults = Faults(1 << 4);
    /// Stopped by an emergency stop of the drive's protocol.
    pub const ESTOPPED: Faults = Faults(1 << 5);
    /// Command refused by the actuator.
    pub const REFUSED: Faults = Faults(1 << 6);
    /// Anything else.
    pub const OTHER: Faults = Faults(1 << 7);

    /// True if there is no fault.
    pub fn none(self) -> bool {
        self.0 == 0
    }

    /// True if all faults of `other` are present.
    pub fn contains(self, other: Faults) -> bool {
        self.0 & other.0 == other.0
    }

    /// Translates an actuator's fault bits. Each row with a bit in `bits` contributes its faults. Bits in no row set
    /// [`Faults::OTHER`].
    pub(super) fn translate(bits: u32, table: &[(u32, Faults)]) -> Faults {
        let known = table.iter().filter(|(mask, _)| bits & mask != 0);
        let sum = known.fold(0, |sum, (_, fault)| sum | fault.0);
        let listed = table.iter().fold(0, |all, (mask, _)| all | mask);
        Faults(sum | if bits & !listed != 0 { Faults::OTHER.0 } else { 0 })
    }
}
