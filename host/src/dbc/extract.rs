//! Values of a frame's signals, extracted bit by bit according to the database.

use super::{ByteOrder, Message, NumberFormat, Presence, Signal};

/// Value of a signal in a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Value<'a> {
    /// Definition of the signal.
    pub signal: &'a Signal,
    /// Bits of the signal as an unsigned integer.
    pub raw: u64,
    /// Physical value, in the signal's unit.
    pub number: f64,
}

impl Value<'_> {
    /// Name of the value; `None` if the signal does not name it.
    pub fn name(&self) -> Option<&str> {
        let named = self.signal.names.iter().find(|(number, _)| *number == self.raw);
        named.map(|(_, name)| name.as_str())
    }
}

impl Signal {
    /// Bits of the signal as an unsigned integer; `None` if `data` is too short for the signal.
    pub fn raw(&self, data: &[u8]) -> Option<u64> {
        let mut raw = 0;
        for i in 0..self.bits {
            let (at, weight) = match self.order {
                ByteOrder::Intel => (self.start + i, i),
                // From the most significant bit downwards, then from the top of the next byte.
                ByteOrder::Motorola => {
                    let from_top = 8 * (self.start / 8) + 7 - self.start % 8 + i;
                    (8 * (from_top / 8) + 7 - from_top % 8, self.bits - 1 - i)
                }
            };
            let byte = *data.get(usize::from(at / 8))?;
            raw |= u64::from(byte >> (at % 8) & 1) << weight;
        }
        Some(raw)
    }

    /// Physical value of an unsigned integer with the signal's bits.
    fn number(&self, raw: u64) -> f64 {
        let unused = 64 - u32::from(self.bits);
        let number = match self.coding {
            NumberFormat::Unsigned => raw as f64,
            NumberFormat::Signed => ((raw << unused) as i64 >> unused) as f64,
            NumberFormat::Float => f64::from(f32::from_bits(raw as u32)),
        };
        number * self.scale
    }
}

impl Message {
    /// Values of the signals present in a frame of this message.
    pub fn values(&self, data: &[u8]) -> Vec<Value<'_>> {
        let selector = self.signals.iter().find(|s| s.presence == Presence::Selector);
        let selected = selector.and_then(|signal| signal.raw(data));
        let there = |signal: &&Signal| match signal.presence {
            Presence::When(value) => selected == Some(value),
            _ => true,
        };
        let value = |signal| {
            let raw = Signal::raw(signal, data)?;
            Some(Value { signal, raw, number: signal.number(raw) })
        };
        self.signals.iter().filter(there).filter_map(value).collect()
    }
}
