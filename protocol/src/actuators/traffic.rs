//! Worst-case load of a bus: set-points and answers, with bit stuffing and waiting times. A configuration whose load is above
//! [`MAX_LOAD`] is refused.

use thiserror::Error;

/// Largest load of a bus by set-points and answers, as a fraction of its capacity. The rest is for torque switches and repeats
/// after errors, and a margin for wrong assumptions.
pub const MAX_LOAD: f32 = 0.7;

/// Worst-case traffic on a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bits per control period.
    pub bits_per_period: u32,
    /// Time per control period in which the line waits for servos to begin their answers, µs.
    pub waiting_us_per_period: u32,
    /// Bits per second of messages that actuators send on their own timers.
    pub bits_per_s: u32,
}

/// Error for a load above [`MAX_LOAD`].
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("the bus load would be {percent:.0} %; at most 70 % is accepted")]
pub struct Overload {
    /// Load, %.
    pub percent: f32,
}

impl Traffic {
    /// Load as a fraction of the capacity of a bus with `bit_rate` bit/s, at `control_hz` control periods per second.
    pub fn load(&self, control_hz: f32, bit_rate: f32) -> f32 {
        let period_s =
            self.bits_per_period as f32 / bit_rate + self.waiting_us_per_period as f32 * 1e-6;
        period_s * control_hz + self.bits_per_s as f32 / bit_rate
    }

    /// Refuses a load above [`MAX_LOAD`], and invalid rates.
    pub fn check(&self, control_hz: f32, bit_rate: f32) -> Result<(), Overload> {
        let load = self.load(control_hz, bit_rate);
        // A NaN and a negative rate fail the comparison.
        let fits = control_hz > 0.0 && bit_rate > 0.0 && load <= MAX_LOAD;
        if fits { Ok(()) } else { Err(Overload { percent: 100.0 * load }) }
    }
}

/// Traffic of a serial line whose servos are commanded and queried together. A control period has `once` bytes, and `each`
/// bytes more per servo. Each servo waits for its return delay before it answers.
pub(super) fn polled(actuators: u32, once: u32, each: u32, return_delay_us: u32) -> Traffic {
    // Start bit, 8 bits, stop bit.
    let bits = |bytes: u32| bytes.saturating_mul(10);
    Traffic {
        bits_per_period: bits(each.saturating_mul(actuators).saturating_add(once)),
        waiting_us_per_period: actuators.saturating_mul(return_delay_us),
        bits_per_s: 0,
    }
}
