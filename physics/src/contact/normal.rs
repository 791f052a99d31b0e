//! Normal force of a contact: a spring, and damping that increases with depth.

/// Stiffness and damping of the normal force.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normal {
    /// Stiffness k_n, N/m.
    pub stiffness_n_m: f64,
    /// Damping k_d, N·s/m.
    pub damping_n_s_m: f64,
    /// Depth over which the damping rises to its full value, m. Damping that jumps at the surface leaves some steps without a
    /// solution. The value 0 gives such a jump, for comparisons with closed forms.
    pub ramp_m: f64,
    /// True if the contact may pull: damping exceeds the spring force when a body leaves fast. The pull grows with depth, so
    /// that a step can have several solutions and a rollout can jump with its parameters. If false, the normal force is 0
    /// instead of a pull. Friction and rolling resistance depend on the spring force in either case.
    pub pulls: bool,
}

/// Normal force at a gap and an opening speed, with derivatives.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NormalForce {
    /// Spring force alone, N; friction and rolling resistance depend on it.
    pub spring_n: f64,
    /// Total force of spring and damping, N.
    pub force_n: f64,
    /// Derivative of the force with respect to the gap, N/m.
    pub by_gap: f64,
    /// Derivative of the force with respect to the opening speed, N·s/m.
    pub by_opening: f64,
}

impl Normal {
    /// Normal force at a negative gap, m, and an opening speed, m/s.
    pub(crate) fn press(&self, gap_m: f64, opening_m_s: f64) -> NormalForce {
        let (share, share_slope) = self.damping_share(gap_m);
        let spring_n = -self.stiffness_n_m * gap_m;
        let force_n = spring_n - self.damping_n_s_m * share * opening_m_s;
        if self.lets_go(force_n) {
            return NormalForce { spring_n, force_n: 0.0, by_gap: 0.0, by_opening: 0.0 };
        }
        NormalForce {
            spring_n,
            force_n,
            by_gap: -self.stiffness_n_m - self.damping_n_s_m * share_slope * opening_m_s,
            by_opening: -self.damping_n_s_m * share,
        }
    }

    /// Derivatives of the normal force with respect to stiffness, damping and ramp.
    pub(crate) fn press_by(&self, gap_m: f64, opening_m_s: f64) -> [f64; 3] {
        let (share, share_slope) = self.damping_share(gap_m);
        let damping_n = self.damping_n_s_m * share * opening_m_s;
        if self.lets_go(-self.stiffness_n_m * gap_m - damping_n) {
            return [0.0; 3];
        }
        // On the ramp, the share is inversely proportional to the ramp.
        let by_ramp = if share_slope == 0.0 { 0.0 } else { damping_n / self.ramp_m };
        [-gap_m, -share * opening_m_s, by_ramp]
    }

    fn lets_go(&self, force_n: f64) -> bool {
        force_n < 0.0 && !self.pulls
    }

    /// Fraction of the damping at a gap, and its derivative with respect to the gap, 1/m.
    fn damping_share(&self, gap_m: f64) -> (f64, f64) {
        let ramp_m = self.ramp_m;
        if -gap_m < ramp_m { (-gap_m / ramp_m, -1.0 / ramp_m) } else { (1.0, 0.0) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NORMAL: Normal =
        Normal { stiffness_n_m: 200.0, damping_n_s_m: 3.0, ramp_m: 0.02, pulls: true };

    /// Tests depths on the ramp and below it, and bodies that approach, leave, or leave so fast that damping exceeds the spring
    /// force.
    #[test]
    fn the_force_has_its_derivatives() {
        let mut pulled = 0;
        for pulls in [true, false] {
            let normal = Normal { pulls, ..NORMAL };
            for gap_m in [-0.01, -0.03] {
                for opening_m_s in [-1.0, 0.5, 4.0] {
                    let force = |normal: Normal, gap_m, opening_m_s| {
                        normal.press(gap_m, opening_m_s).force_n
                    };
                    let h = 1e-6;
                    let by = |change: &dyn Fn(f64) -> f64| (change(h) - change(-h)) / (2.0 * h);
                    let press = normal.press(gap_m, opening_m_s);
                    let Normal { stiffness_n_m, damping_n_s_m, ramp_m, .. } = normal;
                    let numbers = normal.press_by(gap_m, opening_m_s);
                    let stiffness = |x| Normal { stiffness_n_m: stiffness_n_m + x, ..normal };
                    let damping = |x| Normal { damping_n_s_m: damping_n_s_m + x, ..normal };
                    let ramp = |x| Normal { ramp_m: ramp_m + x, ..normal };
                    for (exact, difference) in [
                        (press.by_gap, by(&|x| force(normal, gap_m + x, opening_m_s))),
                        (press.by_opening, by(&|x| force(normal, gap_m, opening_m_s + x))),
                        (numbers[0], by(&|x| force(stiffness(x), gap_m, opening_m_s))),
                        (numbers[1], by(&|x| force(damping(x), gap_m, opening_m_s))),
                        (numbers[2], by(&|x| force(ramp(x), gap_m, opening_m_s))),
                    ] {
                        let bound = 1e-7 * (1.0 + exact.abs());
                        assert!((exact - difference).abs() < bound, "{exact} {difference}");
                    }
                    assert!(pulls || press.force_n >= 0.0, "{press:?}");
                    pulled += usize::from(press.force_n < 0.0);
                }
            }
        }
        assert!(pulled == 2, "{pulled}");
    }
}
