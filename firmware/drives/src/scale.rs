//! Fixed-point codes of some makers, which divide a range into steps.

/// Value of a code between −`most` and `most`.
pub fn value(code: u32, most: f64, bits: u32) -> f64 {
    share(code, bits) * 2.0 * most - most
}

/// Code as a fraction of the largest code of `bits` bits.
pub fn share(code: u32, bits: u32) -> f64 {
    f64::from(code) / f64::from((1u32 << bits) - 1)
}

/// Code of a value. Values beyond the range have the code of its nearer end.
pub fn code(value: f64, most: f64, bits: u32) -> u32 {
    let steps = f64::from((1u32 << bits) - 1);
    ((value + most) / (2.0 * most) * steps).round().clamp(0.0, steps) as u32
}
