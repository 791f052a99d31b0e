//! Splines through quantities of a plan, with the end conditions of its motion.

use super::spline::Spline;
use crate::motion::Ends;
use crate::plan::{Plan, Sample};
use nalgebra::Complex;

/// Builder of a plan's splines, with the end conditions of its motion.
pub struct Curves<'a> {
    /// Plan of the splines.
    pub plan: &'a Plan,
}

impl Curves<'_> {
    /// Spline through a real quantity of the samples that grows by `shift` over a period.
    pub fn scalar(&self, of: impl Fn(&Sample) -> f64, shift: f64) -> Spline {
        self.spline(|s| of(s).into(), 1.0.into(), shift.into())
    }

    /// Spline through a quantity that continues in the next period as v(t + H) = `turn` · v(t) + `shift`.
    pub fn spline(
        &self,
        of: impl Fn(&Sample) -> Complex<f64>,
        turn: Complex<f64>,
        shift: Complex<f64>,
    ) -> Spline {
        let values: Vec<_> = self.plan.samples.iter().map(&of).collect();
        self.through(&values, of(&self.plan.before), of(&self.plan.after), turn, shift)
    }

    /// Spline through the angle accumulated by a speed that is given per interval, rad.
    pub fn angle(&self, speed: impl Fn(&Sample) -> f64) -> Spline {
        let plan = self.plan;
        let h = plan.sample_interval_s;
        let mut angle = 0.0;
        let mut angles = Vec::with_capacity(plan.samples.len() + 1);
        for sample in &plan.samples {
            angles.push(Complex::from(angle));
            angle += speed(sample) * h;
        }
        let before = Complex::from(-speed(&plan.before) * h);
        // After the loop, `angle` is one interval after the last sample.
        self.through(&angles, before, angle.into(), 1.0.into(), angle.into())
    }

    fn through(
        &self,
        values: &[Complex<f64>],
        before: Complex<f64>,
        after: Complex<f64>,
        turn: Complex<f64>,
        shift: Complex<f64>,
    ) -> Spline {
        let plan = self.plan;
        let h = plan.sample_interval_s;
        let zero = Complex::default();
        match plan.motion.ends {
            Ends::Periodic => Spline::periodic(h, values, turn, shift),
            Ends::AtRest => Spline::clamped(h, values, zero, zero),
            // The states one interval outside give the velocities at the ends.
            Ends::Prescribed => {
                let (first, last) = (values[0], values[values.len() - 1]);
                Spline::clamped(h, values, (first - before) / h, (after - last) / h)
            }
        }
    }
}
