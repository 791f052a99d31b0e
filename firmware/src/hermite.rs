//! Cubic Hermite upsampling of 60 Hz frames to position and velocity at the control rate.
//!
//! The cubic between two frames has their values and slopes at its ends. The slope at a frame is the central difference of its
//! neighbours, so one frame of look-ahead suffices. The curve is C1 everywhere, also where a loop repeats and where clips join.
//! The curve reproduces constant, linear and quadratic motions exactly.
//!
//! The planner's spline through its samples has a continuous second derivative. It requires all slopes to be solved for at once
//! (`planner/src/sample/spline.rs`).

use rollwalk_protocol::library::RATE_HZ;

/// Frames per second of every motion library.
const FRAME_HZ: f32 = RATE_HZ as f32;

/// Value and slope of a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sample {
    /// Value.
    pub value: f32,
    /// Derivative, per second.
    pub slope: f32,
}

/// Evaluates the cubic through `start` and `end`, `interval_s` apart, at the fraction `u` in 0..=1.
pub fn cubic(start: Sample, end: Sample, interval_s: f32, u: f32) -> Sample {
    let (m0, m1) = (start.slope * interval_s, end.slope * interval_s);
    let rise = end.value - start.value;
    // Powers of u relative to the start value: exact at u = 0, and small numbers stay accurate.
    let c2 = 3.0 * rise - 2.0 * m0 - m1;
    let c3 = m0 + m1 - 2.0 * rise;
    Sample {
        value: start.value + u * (m0 + u * (c2 + u * c3)),
        slope: (m0 + u * (2.0 * c2 + u * 3.0 * c3)) / interval_s,
    }
}

/// Evaluates the segment between `frames[1]` and `frames[2]` of four consecutive 60 Hz values at the fraction `u`.
pub fn between(frames: [f32; 4], u: f32) -> Sample {
    let [before, from, to, after] = frames;
    let slope = |a: f32, b: f32| (b - a) * (0.5 * FRAME_HZ);
    cubic(
        Sample { value: from, slope: slope(before, to) },
        Sample { value: to, slope: slope(from, after) },
        1.0 / FRAME_HZ,
        u,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The Hermite cubic reproduces a cubic from its end values and slopes.
        #[test]
        fn reproduces_cubics(c in prop::array::uniform4(-3.0f32..3.0), h in 0.01f32..2.0, u in 0.0f32..=1.0) {
            let at = |t: f32| Sample {
                value: c[0] + t * (c[1] + t * (c[2] + t * c[3])),
                slope: c[1] + t * (2.0 * c[2] + t * 3.0 * c[3]),
            };
            let (got, want) = (cubic(at(0.0), at(h), h, u), at(u * h));
            // f32 rounding of numbers up to 45, the slope divided by h >= 0.01 once.
            prop_assert!((got.value - want.value).abs() < 1e-4, "{got:?} {want:?}");
            prop_assert!((got.slope - want.slope).abs() < 5e-3, "{got:?} {want:?}");
        }

        /// Central differences of the frames reproduce a quadratic motion.
        #[test]
        fn reproduces_quadratics_from_frames(a in -2.0f32..2.0, b in -2.0f32..2.0, c in -2.0f32..2.0, u in 0.0f32..=1.0) {
            let at = |i: f32| a + i * (b + i * c);
            let got = between([at(-1.0), at(0.0), at(1.0), at(2.0)], u);
            prop_assert!((got.value - at(u)).abs() < 1e-5);
            prop_assert!((got.slope - FRAME_HZ * (b + 2.0 * c * u)).abs() < 2e-3);
        }

        /// Value and slope agree where two segments meet.
        #[test]
        fn joins_are_c1(f in prop::array::uniform5(-3.0f32..3.0)) {
            let left = between([f[0], f[1], f[2], f[3]], 1.0);
            let right = between([f[1], f[2], f[3], f[4]], 0.0);
            prop_assert_eq!(right.value, f[2]);
            // Rounding of values up to 6, and of slopes up to 180 rad/s.
            prop_assert!((left.value - right.value).abs() < 1e-5);
            prop_assert!((left.slope - right.slope).abs() < 1e-3);
        }

        /// The slope is the derivative of the value.
        #[test]
        fn slope_is_the_derivative(f in prop::array::uniform4(-1.0f64..1.0), u in 0.05f64..0.95) {
            let f32s = f.map(|x| x as f32);
            let exact = |u: f64| {
                let (m0, m1) = ((f[2] - f[0]) / 2.0, (f[3] - f[1]) / 2.0);
                let (a, b) = (f[1], f[2]);
                // The curve in the standard basis functions, for comparison.
                let (u2, u3) = (u * u, u * u * u);
                (2.0 * u3 - 3.0 * u2 + 1.0) * a + (u3 - 2.0 * u2 + u) * m0
                    + (3.0 * u2 - 2.0 * u3) * b + (u3 - u2) * m1
            };
            let got = between(f32s, u as f32);
            let d = 1e-5;
            let slope = (exact(u + d) - exact(u - d)) / (2.0 * d) * 60.0;
            prop_assert!((f64::from(got.value) - exact(u)).abs() < 1e-5);
            prop_assert!((f64::from(got.slope) - slope).abs() < 1e-3 * (1.0 + slope.abs()));
        }
    }
}
