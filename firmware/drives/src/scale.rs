//! Fixed-point numbers of some makers: a range in steps.

/// The value of a code between −`most` and `most`.
pub fn value(code: u32, most: f64, bits: u32) -> f64 {
    share(code, bits) * 2.0 * most - most
}

/// A code as a share of the largest.
pub fn share(code: u32, bits: u32) -> f64 {
    f64::from(code) / f64::from((1u32 << bits) - 1)
}

/// The code of a value; beyond the ends, that of the end.
pub fn code(value: f64, most: f64, bits: u32) -> u32 {
    let steps = f64::from((1u32 << bits) - 1);
    ((value + most) / (2.0 * most) * steps).round().clamp(0.0, steps) as u32
}
