//! Handles: knots of curves for positions of anchors.

use crate::anchor::Anchor;
use crate::curve::Curve;
use crate::force::Wrench;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep};
use nalgebra::Vector3;
use std::sync::Arc;

/// Knot of a curve that is added to the position of an anchor at the end of each step.
#[derive(Clone, Debug)]
pub struct Handle {
    /// Force index of the anchor.
    pub anchor: usize,
    /// Direction of the movement.
    pub axis: Vector3<f64>,
    /// Curve of the position.
    pub curve: Arc<Curve>,
    /// Index of the knot.
    pub knot: usize,
}

impl Parameter for Handle {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        let [shift, _] = self.curve.of_knot(self.knot, solved.time_s);
        if shift == 0.0 {
            return;
        }
        let anchor: &Anchor = solved.force(self.anchor);
        let force = self.axis * (shift * anchor.stiffness_n_m);
        let moment =
            solved.view(self.anchor, |view| (view.now[0].rotation * anchor.point).cross(&force));
        column.add_force(&anchor.body, &[Wrench { force, moment }]);
    }
}
