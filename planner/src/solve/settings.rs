//! Settings of a solve: the method, and when it stops.

/// Method of minimising the energy.
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

/// Stop criteria and step control. The defaults suit every shipped motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Method of minimising the energy. Fields other than `iterations` apply to Gauss-Newton only.
    pub method: Method,
    /// Iteration limit.
    pub iterations: usize,
    /// Constraint residual, as a fraction of its tolerance, at which a plan is accepted.
    pub target_level: f64,
    /// Relative energy decrease of a step below which multipliers are shifted.
    pub nearly_flat: f64,
    /// Relative energy decrease of a step below which the solve ends if the constraints hold.
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
