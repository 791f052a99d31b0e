//! Noise of the measurements, and error of a simulated run.

use super::rollout::{MeasurementResidual, Noise, Signal, centered};
use std::collections::BTreeMap;

/// Root-mean-square error of each signal of a simulated run, over some of its steps.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Quality {
    /// Measured signals and their root-mean-square errors.
    pub rms: Vec<(Signal, f64)>,
}

impl Quality {
    /// Errors in the steps `after + 1` to `until`.
    pub(super) fn of(misses: &[MeasurementResidual], after: usize, until: usize) -> Self {
        let values = centered(misses);
        let rms = Signal::ALL.into_iter().filter_map(|signal| {
            let within = |(miss, _): &(&MeasurementResidual, &f64)| {
                miss.signal == signal && miss.step > after && miss.step <= until
            };
            let of_signal = misses.iter().zip(&values).filter(within);
            let squares: Vec<f64> = of_signal.map(|(_, value)| value.powi(2)).collect();
            let mean = squares.iter().sum::<f64>() / squares.len() as f64;
            (!squares.is_empty()).then(|| (signal, mean.sqrt()))
        });
        Self { rms: rms.collect() }
    }

    /// Root-mean-square error of a signal; `None` if the signal was not measured.
    pub fn of_signal(&self, signal: Signal) -> Option<f64> {
        self.rms.iter().find(|(known, _)| *known == signal).map(|(_, rms)| *rms)
    }
}

/// Standard deviations at the start of a search.
pub(super) fn nominal() -> Noise {
    Signal::ALL.map(|signal| signal.noise()[0])
}

/// Standard deviations of the residuals, enlarged for the correlation between consecutive residuals.
///
/// Model errors persist over several steps. With a correlation ρ from one residual to the next, n residuals contain as much
/// information as n (1 − ρ) / (1 + ρ) independent ones. Their standard deviation is hence multiplied by √((1 + ρ) / (1 − ρ)).
pub(super) fn estimate_noise(misses: &[MeasurementResidual]) -> Noise {
    let mut last: BTreeMap<(usize, usize), f64> = BTreeMap::new();
    let mut sums = [[0.0_f64; 3]; 6];
    for (miss, value) in misses.iter().zip(centered(misses)) {
        let signal = miss.signal as usize;
        sums[signal][0] += value * value;
        sums[signal][1] += 1.0;
        if let Some(before) = last.insert((signal, miss.number), value) {
            sums[signal][2] += before * value;
        }
    }
    let mut noise = nominal();
    for ((signal, deviation), [square, count, product]) in
        Signal::ALL.into_iter().zip(&mut noise).zip(sums)
    {
        if square > 0.0 {
            let most = 1.0 - 2.0 / count;
            let correlation = (product / square).clamp(0.0, most.max(0.0));
            let lasting = (1.0 + correlation) / (1.0 - correlation);
            *deviation = ((square / count) * lasting).sqrt().max(signal.noise()[1]);
        }
    }
    noise
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_physics::sensitivity::Residual;

    fn misses(values: impl IntoIterator<Item = f64>) -> Vec<MeasurementResidual> {
        let of = |(step, value)| MeasurementResidual {
            signal: Signal::Joint,
            number: 0,
            step,
            residual: Residual { value, by: Vec::new() },
        };
        (1..).zip(values).map(of).collect()
    }

    #[test]
    fn what_lasts_counts_for_less() {
        let sign = |k: i32, every: i32| if (k / every) % 2 == 0 { 0.01 } else { -0.01 };
        let quick = estimate_noise(&misses((0..1000).map(|k| sign(k, 1))))[Signal::Joint as usize];
        assert!((quick - 0.01).abs() < 1e-9);
        // A sign that changes every 20th sample has ρ = 0.9.
        let slow = estimate_noise(&misses((0..1000).map(|k| sign(k, 20))))[Signal::Joint as usize];
        assert!((slow / 0.01 / 19_f64.sqrt() - 1.0).abs() < 0.02, "{slow}");
    }

    #[test]
    fn root_mean_squares_are_of_their_steps() {
        let quality = Quality::of(&misses([1.0, 3.0, 4.0]), 1, 3);
        assert_eq!(quality.of_signal(Signal::Joint), Some(12.5_f64.sqrt()));
        assert_eq!(quality.of_signal(Signal::Gyro), None);
    }
}
