//! Small dense network with exponential linear units, and its derivatives with respect to its weights.

use fastrand::Rng;

/// Sizes of all layers, including input and output.
const SIZES: [usize; 4] = [2, 8, 8, 3];

/// Network whose weights form one vector, as the optimiser requires.
#[derive(Clone, Debug)]
pub(super) struct Network {
    pub weights: Vec<f64>,
}

/// Outputs of all layers, beginning with the input.
pub(super) struct Pass {
    layers: Vec<Vec<f64>>,
}

impl Pass {
    pub fn output(&self) -> &[f64] {
        &self.layers[self.layers.len() - 1]
    }
}

fn elu(x: f64) -> f64 {
    if x > 0.0 { x } else { x.exp_m1() }
}

/// Number of inputs, number of outputs and index of the first weight of each layer. A bias follows the weights of each output.
fn layers() -> Vec<(usize, usize, usize)> {
    let mut first = 0;
    let of = SIZES.windows(2).map(|pair| {
        let layer = (pair[0], pair[1], first);
        first += pair[1] * (pair[0] + 1);
        layer
    });
    of.collect()
}

impl Network {
    /// Creates a network with random weights. `output` is its initial mean output.
    pub fn random(rng: &mut Rng, output: [f64; 3]) -> Self {
        let mut weights = Vec::new();
        for (inputs, outputs, _) in layers() {
            let size = (3.0 / inputs as f64).sqrt();
            let last = outputs == output.len();
            for k in 0..outputs {
                let size = if last { 0.1 * size } else { size };
                weights.extend((0..inputs).map(|_| size * (2.0 * rng.f64() - 1.0)));
                weights.push(if last { output[k] } else { 0.0 });
            }
        }
        Self { weights }
    }

    pub fn run(&self, input: &[f64]) -> Pass {
        let mut pass = Pass { layers: vec![input.to_vec()] };
        for (number, (inputs, outputs, first)) in layers().into_iter().enumerate() {
            let from = &pass.layers[number];
            let of_output = |k: usize| {
                let row = &self.weights[first + k * (inputs + 1)..][..inputs + 1];
                let sum: f64 = row.iter().zip(from).map(|(weight, x)| weight * x).sum();
                let sum = sum + row[inputs];
                if number + 2 == SIZES.len() { sum } else { elu(sum) }
            };
            let to = (0..outputs).map(of_output).collect();
            pass.layers.push(to);
        }
        pass
    }

    /// Adds the derivatives of a quantity with respect to the weights, given its derivatives with respect to the output.
    pub fn gradient(&self, pass: &Pass, by_output: &[f64], gradient: &mut [f64]) {
        let mut by = by_output.to_vec();
        for (number, (inputs, outputs, first)) in layers().into_iter().enumerate().rev() {
            let (from, to) = (&pass.layers[number], &pass.layers[number + 1]);
            if number + 2 < SIZES.len() {
                // Derivative of the unit from its output: e^x = output + 1.
                by.iter_mut()
                    .zip(to)
                    .for_each(|(by, y)| *by *= if *y > 0.0 { 1.0 } else { y + 1.0 });
            }
            let mut by_input = vec![0.0; inputs];
            for k in 0..outputs {
                let begin = first + k * (inputs + 1);
                for j in 0..inputs {
                    gradient[begin + j] += by[k] * from[j];
                    by_input[j] += by[k] * self.weights[begin + j];
                }
                gradient[begin + inputs] += by[k];
            }
            by = by_input;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_by_weights_agree_with_finite_differences() {
        let mut rng = Rng::with_seed(1);
        let mut network = Network::random(&mut rng, [1.0, -2.0, 0.5]);
        let (input, by_output) = ([0.3, -0.8], [0.7, -0.2, 1.1]);
        let value = |network: &Network| -> f64 {
            let pass = network.run(&input);
            pass.output().iter().zip(by_output).map(|(y, by)| y * by).sum()
        };
        let mut gradient = vec![0.0; network.weights.len()];
        network.gradient(&network.run(&input), &by_output, &mut gradient);
        for k in 0..gradient.len() {
            let step = 1e-6;
            let mut at = |by: f64| {
                network.weights[k] += by;
                let value = value(&network);
                network.weights[k] -= by;
                value
            };
            let rate = (at(step) - at(-step)) / (2.0 * step);
            assert!((rate - gradient[k]).abs() < 1e-8, "{k}: {rate}, {}", gradient[k]);
        }
    }
}
