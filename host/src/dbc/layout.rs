//! Builder of a message's fields in their order in the frame, as `docs/formats/wire-format.md` lists them.

use super::{ByteOrder, NumberFormat, Presence, Signal};
use std::borrow::Cow;

/// Fields added so far, and the first bit of the next field.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    at: u16,
    signals: Vec<Signal>,
}

impl Layout {
    pub fn new() -> Self {
        Self::default()
    }

    /// Creates a layout whose first byte is the checksum.
    pub fn sealed() -> Self {
        let text =
            "CRC-8/AUTOSAR over the identifier, low byte first, and the bytes after this one";
        Self::new().unsigned("crc8", 8).comment(text)
    }

    pub fn unsigned(self, name: &str, bits: u16) -> Self {
        let max = (1u128 << bits) - 1;
        self.field(name, bits, NumberFormat::Unsigned, 1.0, (0.0, max as f64))
    }

    /// Adds a physical value in steps of `scale`, from 0.
    pub fn steps_up(self, name: &str, bits: u16, scale: f64) -> Self {
        let max = ((1u64 << bits) - 1) as f64;
        self.field(name, bits, NumberFormat::Unsigned, scale, (0.0, round(max * scale)))
    }

    /// Adds a signed physical value in steps of `scale`. The lowest integer stands for an absent value.
    pub fn steps(self, name: &str, bits: u16, scale: f64) -> Self {
        let max = round(((1u64 << (bits - 1)) - 1) as f64 * scale);
        self.field(name, bits, NumberFormat::Signed, scale, (-max, max))
    }

    pub fn float(self, name: &str) -> Self {
        self.field(name, 32, NumberFormat::Float, 1.0, (0.0, 0.0))
    }

    /// Adds a field of `width` bits with flags of one bit each. Bit numbers count from the field's least significant bit.
    pub fn flags(
        mut self,
        width: u16,
        flags: impl IntoIterator<Item = (u16, String, &'static str)>,
    ) -> Self {
        let from = self.at;
        for (bit, name, text) in flags {
            self.at = from + bit;
            self = self.unsigned(&name, 1).comment(text);
        }
        self.at = from + width;
        self
    }

    /// Adds bits that are 0.
    pub fn zero(mut self, bits: u16) -> Self {
        self.at += bits;
        self
    }

    fn field(
        mut self,
        name: &str,
        bits: u16,
        coding: NumberFormat,
        scale: f64,
        (min, max): (f64, f64),
    ) -> Self {
        self.signals.push(Signal {
            name: name.to_owned(),
            start: self.at,
            bits,
            order: ByteOrder::Intel,
            coding,
            scale,
            min,
            max,
            unit: "",
            names: Vec::new(),
            comment: Cow::default(),
            presence: Presence::Always,
        });
        self.at += bits;
        self
    }

    fn last(mut self, change: impl FnOnce(&mut Signal)) -> Self {
        change(self.signals.last_mut().expect("a field was added before"));
        self
    }

    /// Sets the unit of the previous field.
    pub fn unit(self, unit: &'static str) -> Self {
        self.last(|signal| signal.unit = unit)
    }

    /// Sets the comment of the previous field.
    pub fn comment(self, text: impl Into<Cow<'static, str>>) -> Self {
        self.last(|signal| signal.comment = text.into())
    }

    /// Sets the range of the previous field.
    pub fn range(self, min: f64, max: f64) -> Self {
        self.last(|signal| (signal.min, signal.max) = (min, max))
    }

    /// Adds names for values of the previous field.
    pub fn names(self, names: impl IntoIterator<Item = (u64, String)>) -> Self {
        self.last(|signal| signal.names.extend(names))
    }

    /// Makes 255 mean "none" in the previous field.
    pub fn or_none(self) -> Self {
        self.names([(0xFF, "none".into())])
    }

    /// Makes the previous field big-endian. The field begins at a byte, or at the low half of a byte whose high half is the
    /// field before.
    pub fn motorola(self) -> Self {
        self.last(|signal| {
            let high_nibble = signal.start % 8 == 4;
            signal.start = if high_nibble { signal.start - 1 } else { signal.start + 7 };
            signal.order = ByteOrder::Motorola;
        })
    }

    /// Makes the previous field the selector of others.
    pub fn selects(self) -> Self {
        self.last(|signal| signal.presence = Presence::Selector)
    }

    /// Adds fields that are present when the selector has the value `selected`.
    pub fn when(mut self, selected: u64, others: Vec<Signal>) -> Self {
        self.signals.extend(others.into_iter().map(|signal| {
            let presence = Presence::When(selected);
            Signal { presence, ..signal }
        }));
        self
    }

    /// Adds finished fields.
    pub fn followed_by(mut self, others: Vec<Signal>) -> Self {
        self.signals.extend(others);
        self
    }

    /// Sets the first bit of the next field.
    pub fn at(mut self, bit: u16) -> Self {
        self.at = bit;
        self
    }

    pub fn finish(self) -> Vec<Signal> {
        self.signals
    }
}

/// Rounds to 6 decimals, which removes errors of binary fractions: 65.534, not 65.53400000000001.
fn round(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}
