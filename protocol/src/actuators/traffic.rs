//! Share of a bus that a protocol takes: setpoints and answers in the worst case, stuffing and waiting included. A configuration
//! whose load is beyond [`MAX_LOAD`] is not run.

use thiserror::Error;

/// Largest share of a bus that setpoints and answers may take. The rest is for torque switches,
/// repeats after errors, and for being wrong.
pub const MAX_LOAD: f32 = 0.7;

/// Worst-case traffic on a bus.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Traffic {
    /// Bits of each control period.
    pub bits_per_period: u32,
    /// Time of each control period in which the line waits for servos to begin their answers, µs.
    pub waiting_us_per_period: u32,
    /// Bits per second of messages that come on a timer of their own.
    pub bits_per_s: u32,
}

/// More than a bus can take.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("load of the bus would be {percent:.0} %, at most 70 % is right")]
pub struct Overload {
    /// The load, %.
    pub percent: f32,
}

impl Traffic {
    /// Share of a bus of `bit_rate` bits per second that the traffic takes at `control_hz` control periods per second. 1 is all
    /// of it.
    pub fn load(&self, control_hz: f32, bit_rate: f32) -> f32 {
        let period_s =
            self.bits_per_period as f32 / bit_rate + self.waiting_us_per_period as f32 * 1e-6;
        period_s * control_hz + self.bits_per_s as f32 / bit_rate
    }

    /// Refuses traffic above [`MAX_LOAD`] of the bus, and invalid rates.
    pub fn check(&self, control_hz: f32, bit_rate: f32) -> Result<(), Overload> {
        let load = self.load(control_hz, bit_rate);
        // A NaN and a negative rate fail this.
        let fits = control_hz > 0.0 && bit_rate > 0.0 && load <= MAX_LOAD;
        if fits { Ok(()) } else { Err(Overload { percent: 100.0 * load }) }
    }
}

/// Traffic of a serial line on which all servos are commanded and queried together. A period carries `once` bytes, and `each`
/// bytes per servo. Every servo waits for its return delay before it answers.
pub(super) fn polled(actuators: u32, once: u32, each: u32, return_delay_us: u32) -> Traffic {
    // Start bit, 8 bits, stop bit.
    let bits = |bytes: u32| bytes.saturating_mul(10);
    Traffic {
        bits_per_period: bits(each.saturating_mul(actuators).saturating_add(once)),
        waiting_us_per_period: actuators.saturating_mul(return_delay_us),
        bits_per_s: 0,
    }
}
