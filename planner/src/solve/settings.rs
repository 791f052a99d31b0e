//! What a caller can choose about a solve: the method, and when it stops.

/// How the energy is minimised.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Gauss-Newton on every row, with multipliers.
    #[default]
    GaussNewton,
    /// The thesis's penalty and Newton's method without the second derivatives of the consistency
    /// constraints 2.13 and 2.14 with respect to q: its Filtered Hessian.
    NewtonFiltered,
    /// The thesis's penalty and Newton's method with the true Hessian, regularised where indefinite.
    NewtonTrue,
    /// The thesis's penalty and L-BFGS.
    Lbfgs,
}

/// When to stop and how to step. The defaults suit every shipped motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How the energy is minimised. The fields below other than `iterations` are for Gauss-Newton.
    pub method: Method,
    /// Most iterations.
    pub iterations: usize,
    /// Worst constraint, as a fraction of its credible level, at which a plan is good enough.
    pub target_level: f64,
    /// Relative energy decrease of a step below which multipliers are shifted.
    pub nearly_flat: f64,
    /// Relative energy decrease of a step below which, when constraints hold, the solve ends.
    pub flat: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            iterations: 300,
            target_level: 0.05,
            nearly_flat: 0.1,
            flat: 1e-3,
        }
    }
}
