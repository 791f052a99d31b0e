//! Settings of a solve: method and stop criteria.

/// Method of minimising the energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Gauss-Newton on every row, with multipliers.
    #[default]
    GaussNewton,
    /// Penalty of the thesis, and Newton's method with its Filtered Hessian, which omits the second derivatives of the
    /// consistency constraints 2.13 and 2.14 with respect to q.
    NewtonFiltered,
    /// Penalty of the thesis, and Newton's method with the true Hessian, regularised if indefinite.
    NewtonTrue,
    /// Penalty of the thesis, and L-BFGS.
    Lbfgs,
}

/// Stop criteria and step control. The defaults suit every shipped motion.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Method of minimising the energy. Fields other than `iterations` apply to Gauss-Newton only.
    pub method: Method,
    /// Iteration limit.
    pub iterations: usize,
    /// Residual-to-tolerance ratio of the worst constraint below which a solve may end.
    pub target_level: f64,
    /// Relative energy decrease of a step below which multipliers are shifted.
    pub nearly_flat: f64,
    /// Relative energy decrease of a step below which the solve ends if all constraints are met.
    pub flat: f64,
    /// Relative change of the costs in an iteration below which the solve ends if all constraints are met.
    ///
    /// The costs become flat before the energy. The remaining energy belongs mostly to inequalities that a step has moved
    /// into the smoothing of ψ, and that exert no force. Newton's method leaves an eighth of their cubic part in each
    /// iteration, while the motion does not change.
    pub flat_cost: f64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            iterations: 300,
            target_level: 0.05,
            nearly_flat: 0.1,
            flat: 1e-3,
            flat_cost: 3e-3,
        }
    }
}
