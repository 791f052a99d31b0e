//! Fields one after the other, the way the format page writes them down.

use super::{Coding, Order, Presence, Signal};
use std::borrow::Cow;

/// The fields of a message so far, and where the next one begins.
#[derive(Clone, Debug, Default)]
pub(super) struct Layout {
    at: u16,
    signals: Vec<Signal>,
}

impl Layout {
    pub fn new() -> Self {
        Self::default()
    }

    /// One whose first byte is the checksum.
    pub fn sealed() -> Self {
        let text =
            "CRC-8/AUTOSAR over the identifier, low byte first, and the bytes after this one";
        Self::new().unsigned("crc8", 8).comment(text)
    }

    pub fn unsigned(self, name: &str, bits: u16) -> Self {
        let max = (1u128 << bits) - 1;
        self.field(name, bits, Coding::Unsigned, 1.0, (0.0, max as f64))
    }

    /// A physical value in steps, from 0.
    pub fn steps_up(self, name: &str, bits: u16, scale: f64) -> Self {
        let max = ((1u64 << bits) - 1) as f64;
        self.field(name, bits, Coding::Unsigned, scale, (0.0, round(max * scale)))
    }

    /// A physical value in steps. The lowest integer is no value.
    pub fn steps(self, name: &str, bits: u16, scale: f64) -> Self {
        let max = round(((1u64 << (bits - 1)) - 1) as f64 * scale);
        self.field(name, bits, Coding::Signed, scale, (-max, max))
    }

    pub fn float(self, name: &str) -> Self {
        self.field(name, 32, Coding::Float, 1.0, (0.0, 0.0))
    }

    /// A bit each, from the least significant on; `width` bits in all.
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

    /// Bits that are 0.
    pub fn zero(mut self, bits: u16) -> Self {
        self.at += bits;
        self
    }

    fn field(
        mut self,
        name: &str,
        bits: u16,
        coding: Coding,
        scale: f64,
        (min, max): (f64, f64),
    ) -> Self {
        self.signals.push(Signal {
            name: name.to_owned(),
            start: self.at,
            bits,
            order: Order::Intel,
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

    /// Unit of the field before.
    pub fn unit(self, unit: &'static str) -> Self {
        self.last(|signal| signal.unit = unit)
    }

    /// Meaning of the field before.
    pub fn comment(self, text: impl Into<Cow<'static, str>>) -> Self {
        self.last(|signal| signal.comment = text.into())
    }

    /// Range of the field before.
    pub fn range(self, min: f64, max: f64) -> Self {
        self.last(|signal| (signal.min, signal.max) = (min, max))
    }

    /// Names of the numbers of the field before.
    pub fn names(self, names: impl IntoIterator<Item = (u64, String)>) -> Self {
        self.last(|signal| signal.names.extend(names))
    }

    /// 255 in the field before means none.
    pub fn or_none(self) -> Self {
        self.names([(0xFF, "none".into())])
    }

    /// The bytes of the field before come most significant first; it begins a byte or follows a nibble that
    /// is in the high half of its first byte.
    pub fn motorola(self) -> Self {
        self.last(|signal| {
            let high_nibble = signal.start % 8 == 4;
            signal.start = if high_nibble { signal.start - 1 } else { signal.start + 7 };
            signal.order = Order::Motorola;
        })
    }

    /// Makes the field before the selector of the others.
    pub fn selects(self) -> Self {
        self.last(|signal| signal.presence = Presence::Selector)
    }

    /// Adds fields that are there when the selector has a value.
    pub fn when(mut self, selected: u64, others: Vec<Signal>) -> Self {
        self.signals.extend(others.into_iter().map(|signal| {
            let presence = Presence::When(selected);
            Signal { presence, ..signal }
        }));
        self
    }

    /// The next field begins at this bit.
    pub fn at(mut self, bit: u16) -> Self {
        self.at = bit;
        self
    }

    pub fn finish(self) -> Vec<Signal> {
        self.signals
    }
}

/// Without the dust of binary fractions: 65.534, not 65.53400000000001.
fn round(value: f64) -> f64 {
    (value * 1e6).round() / 1e6
}
