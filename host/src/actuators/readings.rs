//! Temperatures and supply voltages of actuators, and warnings before a servo switches its torque off.

use super::ServoLimits;
use rollwalk_protocol::wire::ActuatorReadings;

/// Largest margin of a hot servo to its highest temperature, °C.
const HOT_C: f32 = 10.0;
/// Largest margin of a low supply to the lowest supply voltage, as a fraction of that voltage.
const LOW_SHARE: f32 = 0.05;

/// Temperature and supply voltage, as in `41 °C, 11.9 V`; empty without either.
pub fn reading_words(readings: &ActuatorReadings) -> String {
    let temperature = readings.temperature_c.map(|of| format!("{of:.0} °C"));
    let voltage = readings.voltage_v.map(|of| format!("{of:.1} V"));
    temperature.into_iter().chain(voltage).collect::<Vec<_>>().join(", ")
}

/// Reading of a servo that is at its limits or close to them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ReadingWarning {
    /// Temperature close to the highest one, or above it.
    Hot,
    /// Supply voltage close to the lowest one, or below it.
    LowSupply,
    /// Supply voltage above the highest one.
    HighSupply,
}

impl ReadingWarning {
    /// Warnings about a servo with the given limits.
    pub fn all(readings: &ActuatorReadings, limits: ServoLimits) -> Vec<Self> {
        let ServoLimits { min_v, max_v, max_c } = limits;
        let is_hot = readings.temperature_c.is_some_and(|of| of > f32::from(max_c) - HOT_C);
        let is_low = readings.voltage_v.is_some_and(|of| of < min_v * (1.0 + LOW_SHARE));
        let is_high = readings.voltage_v.is_some_and(|of| of > max_v);
        [(is_hot, Self::Hot), (is_low, Self::LowSupply), (is_high, Self::HighSupply)]
            .into_iter()
            .filter_map(|(is, warning)| is.then_some(warning))
            .collect()
    }

    /// Description of the warning with the reading and its limit.
    pub fn words(self, readings: &ActuatorReadings, limits: ServoLimits) -> String {
        let ServoLimits { min_v, max_v, max_c } = limits;
        let (temperature_c, voltage_v) =
            (readings.temperature_c.unwrap_or(0.0), readings.voltage_v.unwrap_or(0.0));
        match self {
            Self::Hot => format!("{temperature_c:.0} °C; its torque goes off at {max_c} °C"),
            Self::LowSupply => format!("supply {voltage_v:.1} V; it needs at least {min_v} V"),
            Self::HighSupply => format!("supply {voltage_v:.1} V; it tolerates at most {max_v} V"),
        }
    }

    /// Remedy.
    pub fn help(self) -> &'static str {
        match self {
            Self::Hot => "let the servo cool; joints that carry the robot in a bent pose heat most",
            Self::LowSupply => "charge the battery, and replace thin or long wires",
            Self::HighSupply => "reduce the supply voltage; braking wheels raise it",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn servos_close_to_their_limits_are_warned_about() {
        let limits = ServoLimits { min_v: 10.0, max_v: 14.8, max_c: 80 };
        let of = |temperature_c, voltage_v| {
            let readings = ActuatorReadings { channel: 0, temperature_c, voltage_v };
            let words = ReadingWarning::all(&readings, limits).into_iter();
            words.map(|warning| warning.words(&readings, limits)).collect::<Vec<_>>().join(", ")
        };
        for (temperature_c, voltage_v, expected) in [
            (None, None, ""),
            (Some(70.0), Some(12.0), ""),
            (Some(70.5), Some(10.5), "70 °C; its torque goes off at 80 °C"),
            (Some(20.0), Some(10.4), "supply 10.4 V; it needs at least 10 V"),
            (Some(20.0), Some(14.9), "supply 14.9 V; it tolerates at most 14.8 V"),
            (
                Some(81.0),
                Some(9.0),
                "81 °C; its torque goes off at 80 °C, supply 9.0 V; it needs at least 10 V",
            ),
        ] {
            assert_eq!(of(temperature_c, voltage_v), expected);
        }
        let readings =
            |temperature_c, voltage_v| ActuatorReadings { channel: 0, temperature_c, voltage_v };
        assert_eq!(reading_words(&readings(Some(41.4), Some(11.93))), "41 °C, 11.9 V");
        assert_eq!(reading_words(&readings(None, Some(5.0))), "5.0 V");
        assert_eq!(reading_words(&readings(None, None)), "");
    }
}
