//! Adam: steps along gradients of small samples, each parameter scaled by the magnitude of its past gradients (thesis 4.7.5;
//! Kingma & Ba 2015).
//!
//! Adam suits problems beyond Gauss–Newton's method, such as the weights of a controller that is trained on many rollouts, a
//! few in each step.

/// Step length and decay rates of Adam.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Approximate maximum change of a parameter in a step.
    pub step: f64,
    /// Decay rate β₁ of the mean gradient.
    pub mean: f64,
    /// Decay rate β₂ of the mean squared gradient.
    pub square: f64,
    /// Constant ε, added to the root of the mean square.
    pub least: f64,
}

impl Default for Rates {
    fn default() -> Self {
        Self { step: 1e-3, mean: 0.9, square: 0.999, least: 1e-8 }
    }
}

/// State of Adam: means of gradients and of their squares.
#[derive(Clone, Debug)]
pub struct Adam {
    /// Rates. The caller may reduce the step during training.
    pub rates: Rates,
    means: Vec<f64>,
    squares: Vec<f64>,
    /// Powers of β₁ and β₂ with the number of steps as the exponent.
    kept: [f64; 2],
}

impl Adam {
    /// Creates the state before the first step, for a given number of parameters.
    pub fn new(parameters: usize, rates: Rates) -> Self {
        Self { rates, means: vec![0.0; parameters], squares: vec![0.0; parameters], kept: [1.0; 2] }
    }

    /// Moves the parameters against a gradient.
    ///
    /// # Panics
    /// If the number of parameters or derivatives differs from that in [`new`](Self::new).
    pub fn step(&mut self, parameters: &mut [f64], gradient: &[f64]) {
        let counts = [parameters.len(), gradient.len()];
        assert_eq!(counts, [self.means.len(); 2], "a derivative for each parameter");
        let Rates { step, mean, square, least } = self.rates;
        self.kept = [self.kept[0] * mean, self.kept[1] * square];
        let moments = self.means.iter_mut().zip(&mut self.squares);
        for ((parameter, by), (of_mean, of_square)) in
            parameters.iter_mut().zip(gradient).zip(moments)
        {
            *of_mean += (1.0 - mean) * (by - *of_mean);
            *of_square += (1.0 - square) * (by * by - *of_square);
            // Both averages began at 0, and this bias is divided out.
            let [unbiased, root] =
                [*of_mean / (1.0 - self.kept[0]), (*of_square / (1.0 - self.kept[1])).sqrt()];
            *parameter -= step * unbiased / (root + least);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Tests that the first step has the length of the rate for any gradient, and compares the second step with its closed
    /// form.
    #[test]
    fn steps_are_those_of_the_formulas() {
        let rates = Rates { step: 0.1, mean: 0.95, square: 0.999, least: 0.0 };
        let mut adam = Adam::new(2, rates);
        let mut at = [1.0, 2.0];
        adam.step(&mut at, &[1e-3, -40.0]);
        assert!((at[0] - 0.9).abs() < 1e-12 && (at[1] - 2.1).abs() < 1e-12, "{at:?}");
        adam.step(&mut at, &[2e-3, 0.0]);
        let mean = |first: f64, second: f64| {
            (0.95 * 0.05 * first + 0.05 * second) / (1.0 - 0.95_f64.powi(2))
        };
        let root = |first: f64, second: f64| {
            let of = 0.999 * 0.001 * first * first + 0.001 * second * second;
            (of / (1.0 - 0.999_f64.powi(2))).sqrt()
        };
        let expected = [
            0.9 - 0.1 * mean(1.0, 2.0) / root(1.0, 2.0),
            2.1 + 0.1 * mean(1.0, 0.0) / root(1.0, 0.0),
        ];
        assert!((at[0] - expected[0]).abs() < 1e-9, "{at:?}, {expected:?}");
        assert!((at[1] - expected[1]).abs() < 1e-9, "{at:?}, {expected:?}");
    }

    #[test]
    fn it_finds_the_lowest_point_of_a_narrow_valley_from_noisy_gradients() {
        let mut rng = fastrand::Rng::with_seed(1);
        let mut at = [3.0, -2.0];
        let mut adam = Adam::new(2, Rates { step: 0.1, ..Rates::default() });
        for epoch in 0..8 {
            adam.rates.step = 0.1 * 0.5_f64.powi(epoch);
            for _ in 0..200 {
                let mut noise = || rng.f64() - 0.5;
                let by = [(at[0] - 1.0) + 0.1 * noise(), 100.0 * (at[1] - 0.5) + 10.0 * noise()];
                adam.step(&mut at, &by);
            }
        }
        assert!((at[0] - 1.0).abs() < 0.02 && (at[1] - 0.5).abs() < 0.02, "{at:?}");
    }
}
