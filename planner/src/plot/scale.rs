//! Scales of axes: coordinates of values, ranges, ticks and their labels.

/// Spacing of the values on an axis.
#[derive(Clone, Debug, PartialEq)]
pub enum Scale {
    /// Equal spacing of equal differences.
    Linear,
    /// Equal spacing of equal ratios.
    Logarithmic,
    /// Names at 0, 1, 2 …
    Names(Vec<String>),
}

impl Scale {
    /// Converts a value to a coordinate that is linear on the page.
    pub fn coordinate(&self, value: f64) -> f64 {
        if *self == Self::Logarithmic { value.ln() } else { value }
    }

    /// Returns about `wanted` ticks with their labels.
    pub fn ticks(&self, range: [f64; 2], wanted: usize) -> Vec<(f64, String)> {
        let [low, high] = range;
        match self {
            Self::Linear => {
                let label = |value| (value, number(value, high - low));
                ticks(range, wanted).into_iter().map(label).collect()
            }
            Self::Logarithmic => logarithmic_ticks(range, wanted),
            Self::Names(names) => {
                names.iter().enumerate().map(|(k, name)| (k as f64, name.clone())).collect()
            }
        }
    }
}

/// Returns the range of the values with a margin. The range is never empty.
pub fn padded_range(values: impl Iterator<Item = f64>, margin: f64, scale: &Scale) -> [f64; 2] {
    let (low, high) =
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
    if *scale == Scale::Logarithmic {
        return if low > high { [0.1, 10.0] } else { [0.7 * low, 1.4 * high] };
    }
    if low > high {
        return [-1.0, 1.0];
    }
    let margin = margin.max(0.07 * (high - low)).max(1e-3 * high.abs().max(low.abs()));
    if margin > 0.0 { [low - margin, high + margin] } else { [-1.0, 1.0] }
}

/// Returns about `wanted` round values inside a range, in steps of 1, 2 or 5 times a power of ten.
fn ticks([low, high]: [f64; 2], wanted: usize) -> Vec<f64> {
    let rough = (high - low) / wanted as f64;
    // Values that differ by less than their rounding have no ticks.
    if rough <= f64::EPSILON * high.abs().max(low.abs()) || rough < f64::MIN_POSITIVE {
        return Vec::new();
    }
    let power = 10.0_f64.powf(rough.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough).unwrap_or(rough);
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(|k| k as f64 * step).collect()
}

/// Returns about `wanted` powers of ten inside a range, with their labels. A range of few powers also has 2 and 5 times each.
fn logarithmic_ticks([low, high]: [f64; 2], wanted: usize) -> Vec<(f64, String)> {
    let (first, last) = (low.log10().floor() as i32, high.log10().ceil() as i32);
    let decades = (last - first) as usize;
    let multiples: &[f64] = if 2 * decades <= wanted { &[1.0, 2.0, 5.0] } else { &[1.0] };
    (first..=last)
        .step_by(decades.div_ceil(wanted).max(1))
        // Quotients of integers are the nearest floating-point numbers, and print with few digits.
        .flat_map(|power| {
            let ten = 10.0_f64.powi(power.abs());
            multiples.iter().map(move |m| if power < 0 { m / ten } else { m * ten })
        })
        .filter(|value| (low..=high).contains(value))
        .map(|value| {
            let is_short = (1e-3..1e5).contains(&value);
            (value, if is_short { value.to_string() } else { format!("{value:e}") })
        })
        .collect()
}

/// Formats the value of a tick with enough decimals to differ from its neighbours.
fn number(value: f64, span: f64) -> String {
    let decimals = (1.0 - (span / 4.0).log10().floor()).clamp(0.0, 6.0) as usize;
    let text = format!("{value:.decimals$}");
    let text =
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.replace('-', "−") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([0.0, 2.0], 4), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(ticks([-0.31, 0.29], 4), [-0.2, 0.0, 0.2]);
        assert_eq!(ticks([0.0, 30.0], 7), [0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0]);
    }

    #[test]
    fn numbers_carry_the_decimals_they_need() {
        assert_eq!(number(0.05, 0.2), "0.05");
        assert_eq!(number(-0.5, 2.0), "−0.5");
        assert_eq!(number(-0.0, 2.0), "0");
        assert_eq!(number(20.0, 60.0), "20");
    }

    #[test]
    fn a_constant_still_has_a_range() {
        for constant in [0.3, 1e-9, 0.0] {
            let [low, high] = padded_range([constant; 5].into_iter(), 0.0, &Scale::Linear);
            assert!(low < constant && high > constant);
        }
    }

    #[test]
    fn small_values_fill_the_axis_unless_they_count_as_equal() {
        let range = |margin| padded_range([0.0, 1e-5].into_iter(), margin, &Scale::Linear);
        let [low, high] = range(0.0);
        assert!(high - low < 1.2e-5, "{low} {high}");
        assert_eq!(range(1e-3), [-1e-3, 1e-5 + 1e-3]);
    }

    #[test]
    fn logarithmic_ticks_are_powers_of_ten() {
        let of = |range, wanted| -> Vec<String> {
            logarithmic_ticks(range, wanted).into_iter().map(|(_, text)| text).collect()
        };
        assert_eq!(of([3e-8, 40.0], 5), ["1e-6", "1e-4", "0.01", "1"]);
        assert_eq!(of([0.04, 3.0], 7), ["0.05", "0.1", "0.2", "0.5", "1", "2"]);
    }
}
