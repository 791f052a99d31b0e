//! Division of times in microseconds.
//!
//! The compiler's division of 64-bit integers takes 900 bytes of flash on a processor with 32-bit division. Times are the only
//! 64-bit values that the controller divides.

/// Divides a time by a small divisor of at least 1, and rounds down: microseconds to milliseconds by 1000.
// One copy in the image instead of one at each call.
#[inline(never)]
pub fn divided(time: u64, by: u16) -> u64 {
    let by = u32::from(by.max(1));
    let mut rest = 0;
    let digits = [48, 32, 16, 0].map(|shift| time.wrapping_shr(shift) as u32 & 0xFFFF);
    digits.into_iter().fold(0, |quotient, digit| {
        let part = rest << 16 | digit;
        rest = part % by;
        quotient << 16 | u64::from(part / by)
    })
}

/// Converts microseconds to milliseconds, rounded down; wraps after 49 days.
pub fn wrapping_ms(time_us: u64) -> u32 {
    divided(time_us, 1000) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn divides(time: u64, by in 1u16..) {
            prop_assert_eq!(divided(time, by), time / u64::from(by));
        }
    }

    #[test]
    fn milliseconds() {
        assert_eq!(wrapping_ms(1_999), 1);
        assert_eq!(wrapping_ms((1 << 32) * 1000 + 7_000), 7);
        assert_eq!(divided(9, 0), 9);
    }
}
