//! Fixed-point codes of drives: offset-binary codes, and rounding to the nearest integer.
//!
//! The code of a signed quantity runs from 0 for −max to 2^bits − 1 for +max. Zero has no code: it lies halfway between two.

/// Scale of a quantity from −`max` to `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Signed {
    pub max: f32,
    pub bits: u32,
}

/// Scale of a quantity from 0 to `max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Unsigned {
    pub max: f32,
    pub bits: u32,
}

fn most(bits: u32) -> f32 {
    ((1u32 << bits) - 1) as f32
}

impl Signed {
    /// Nearest code; the upper one if `value` is halfway between two. `None` if `value` is NaN or beyond the scale.
    pub fn encode(self, value: f32) -> Option<u16> {
        let most = most(self.bits);
        let scaled = (value / self.max * most + most) * 0.5 + 0.5;
        // Casts saturate: values that round beyond the last code become the last code.
        (value.abs() <= self.max).then_some((scaled as u16).min(most as u16))
    }

    /// Value of a code.
    pub fn decode(self, code: u16) -> f32 {
        // Twice the code minus `most` is an integer, and values are symmetric about 0.
        let most = most(self.bits);
        (2.0 * f32::from(code) - most) * self.max / most
    }
}

impl Unsigned {
    /// Nearest code; `None` if `value` is NaN or beyond the scale.
    pub fn encode(self, value: f32) -> Option<u16> {
        let most = most(self.bits);
        let scaled = value / self.max * most + 0.5;
        (value >= 0.0 && value <= self.max).then_some((scaled as u16).min(most as u16))
    }

    /// Value of a code.
    pub fn decode(self, code: u16) -> f32 {
        f32::from(code) * self.max / most(self.bits)
    }
}

/// Nearest integer; `None` if it is not within `min` to `max`, or if `value` is NaN.
pub(super) fn nearest(value: f32, min: i32, max: i32) -> Option<i32> {
    let rounded = if value < 0.0 { value - 0.5 } else { value + 0.5 };
    // The cast saturates, and turns NaN into 0.
    let integer = rounded as i32;
    let cast = rounded.abs() < i32::MAX as f32;
    (cast && integer >= min && integer <= max).then_some(integer)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn ends_and_middle() {
        for bits in [12, 16] {
            let last = ((1u32 << bits) - 1) as u16;
            let scale = Signed { max: 12.5, bits };
            assert_eq!((scale.encode(-12.5), scale.encode(12.5)), (Some(0), Some(last)));
            assert_eq!((scale.decode(0), scale.decode(last)), (-12.5, 12.5));
            assert_eq!(scale.encode(0.0), Some(last / 2 + 1));
            assert_eq!(scale.decode(last / 2), -scale.decode(last / 2 + 1));
            let gain = Unsigned { max: 500.0, bits };
            assert_eq!((gain.encode(0.0), gain.encode(500.0)), (Some(0), Some(last)));
            for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 500.1, -0.1] {
                assert_eq!(gain.encode(bad), None, "{bad}");
            }
            for bad in [f32::NAN, f32::INFINITY, -f32::INFINITY, 12.501, -12.501] {
                assert_eq!(scale.encode(bad), None, "{bad}");
            }
        }
        assert_eq!((nearest(2.5, -3, 3), nearest(-2.5, -3, 3)), (Some(3), Some(-3)));
        assert_eq!((nearest(3.6, -3, 3), nearest(f32::NAN, -3, 3)), (None, None));
        assert_eq!((nearest(0.4, 1, 9), nearest(0.5, 1, 9)), (None, Some(1)));
        assert_eq!(nearest(-1e30, i32::MIN + 1, i32::MAX), None);
    }

    proptest! {
        #[test]
        fn codes_are_nearest(value in -1.0f64..1.0, max in 1.0f32..200.0, wide: bool) {
            let bits = if wide { 16 } else { 12 };
            let scale = Signed { max, bits };
            let value = (value * f64::from(max)) as f32;
            let step = 2.0 * f64::from(max) / f64::from((1u32 << bits) - 1);
            let error = f64::from(scale.decode(scale.encode(value).unwrap())) - f64::from(value);
            // Half a step, and a few roundings of an f32 of that size.
            prop_assert!(error.abs() <= 0.5 * step + 4.0 * f64::from(max * f32::EPSILON));
        }

        #[test]
        fn codes_come_back(code: u16, max in 1.0f32..200.0, wide: bool) {
            let (bits, code) = if wide { (16, code) } else { (12, code & 0xFFF) };
            let scale = Signed { max, bits };
            prop_assert_eq!(scale.encode(scale.decode(code)), Some(code));
            let scale = Unsigned { max, bits };
            prop_assert_eq!(scale.encode(scale.decode(code)), Some(code));
        }
    }
}
