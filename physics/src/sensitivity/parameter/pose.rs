//! Poses: knots of curves for the pose of a hold, such as a robot's gripper.

use crate::curve::Curve;
use crate::force::Wrench;
use crate::hold::Hold;
use crate::sensitivity::parameter::{Column, Parameter, SolvedStep};
use nalgebra::Vector3;
use rollwalk_multibody::rotation::skew;
use std::sync::Arc;

/// Knot of a curve that is added to a coordinate of a hold's pose at the end of each step.
#[derive(Clone, Debug)]
pub struct Pose {
    /// Force index of the hold.
    pub hold: usize,
    /// Coordinate of the pose.
    pub coordinate: Coordinate,
    /// Curve of the coordinate.
    pub curve: Arc<Curve>,
    /// Index of the knot.
    pub knot: usize,
}

/// Coordinate of a pose, as in [`TargetPose::new`](crate::hold::TargetPose::new).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coordinate {
    /// Position along a direction, m.
    Shift(Vector3<f64>),
    /// Yaw, rad.
    Yaw,
    /// Pitch, rad.
    Pitch,
    /// Roll, rad.
    Roll,
}

impl Pose {
    /// Creates parameters for one knot of curves of position, yaw, pitch and roll.
    pub fn of_knot(hold: usize, curve: &Arc<Curve>, knot: usize) -> Vec<Box<dyn Parameter>> {
        let shifts = [Vector3::x(), Vector3::y(), Vector3::z()].map(Coordinate::Shift);
        let turns = [Coordinate::Yaw, Coordinate::Pitch, Coordinate::Roll];
        let of = |coordinate| -> Box<dyn Parameter> {
            Box::new(Self { hold, coordinate, curve: Arc::clone(curve), knot })
        };
        shifts.into_iter().chain(turns).map(of).collect()
    }
}

impl Parameter for Pose {
    fn residual(&self, solved: &SolvedStep<'_>, column: &mut Column) {
        let [share, _] = self.curve.of_knot(self.knot, solved.time_s);
        let hold: &Hold = solved.force(self.hold);
        let Some(place) = hold.place.filter(|_| share != 0.0) else { return };
        let mut wrench = Wrench::default();
        let axis = match self.coordinate {
            Coordinate::Shift(along) => {
                wrench.force = along * (share * hold.grip.shift_n_m);
                Vector3::zeros()
            }
            Coordinate::Yaw => Vector3::z(),
            // Roll turns about the x axis of the pose, pitch about the horizontal axis across it.
            Coordinate::Pitch => Vector3::z().cross(&place.rotation.column(0)).normalize(),
            Coordinate::Roll => place.rotation.column(0).into_owned(),
        };
        let now = solved.view(self.hold, |view| view.now[0].rotation);
        for k in 0..3 {
            // The target b* of the body's axis b changes by δb* = δθ* × b*.
            let moved = axis.cross(&place.rotation.column(k));
            let arm = skew(&now.column(k).into_owned());
            wrench.moment += arm * moved * (0.5 * share * hold.grip.turn_nm_rad);
        }
        column.add_force(&hold.body, &[wrench]);
    }
}
