//! Angular momentum over an interval between two poses: Σ m r × r₊ in world axes, kg·m². The vectors from the centre of mass to
//! each point of the robot are r at the beginning and r₊ at the end of the interval.
//!
//! Divided by the length h of the interval, this is the mean angular momentum about the centre of mass, if points move in
//! straight lines (Kepler: twice the area that r sweeps, times the mass). Differences between intervals give the rate of
//! angular momentum. Limbs count with their full inertia, instead of the single body with constant inertia of Eq. 2.4.
//!
//! The moment is the antisymmetric part of S = Σ m r r₊ᵀ. A rigid link of mass m with its centre of mass at p has S = m p p₊ᵀ +
//! R J R₊ᵀ. J is its second moment Σ m x xᵀ about p in link axes. A subtree has the sum of its links.

use super::{JOINTS, Model, Pose};
use nalgebra::{Matrix3, Vector3};

/// Moment Σ m r × r₊ with its derivatives.
#[derive(Clone, Debug, Default)]
pub struct SweptMoment {
    /// Moment Σ m r × r₊ in world axes, kg·m².
    pub value: Vector3<f64>,
    /// Derivatives with respect to yaw, pitch, roll and joints at the beginning. The position of the base has no effect.
    pub d_from: Vec<Vector3<f64>>,
    /// Derivatives with respect to yaw, pitch, roll and joints at the end.
    pub d_to: Vec<Vector3<f64>>,
    /// Matrix Σ m r r₊ᵀ of each link with all links that it carries, kg·m².
    carried: Vec<Matrix3<f64>>,
}

/// Sum Σ m (w × a) × b, from S = Σ m a bᵀ.
pub fn turned_first(s: &Matrix3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    s * w - w * s.trace()
}

/// Sum Σ m a × (w × b), from S = Σ m a bᵀ.
pub fn turned_second(s: &Matrix3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
    w * s.trace() - s.tr_mul(w)
}

/// Subtrees at both ends of an interval.
#[derive(Clone, Copy, Debug)]
pub struct CarriedPair<'a> {
    from: &'a Pose,
    to: &'a Pose,
    swept: &'a SweptMoment,
}

/// Sum Σ m a × b, from S = Σ m a bᵀ.
pub fn cross_sum(s: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(s[(1, 2)] - s[(2, 1)], s[(2, 0)] - s[(0, 2)], s[(0, 1)] - s[(1, 0)])
}

impl Model {
    /// Computes the swept moment between two poses, with derivatives.
    pub fn swept_moment(&self, from: &Pose, to: &Pose) -> SweptMoment {
        let mut swept = self.swept_moment_value(from, to);
        swept.differentiate(self, from, to);
        swept
    }

    /// Computes the swept moment. The vectors of derivatives stay empty until [`SweptMoment::differentiate`].
    pub fn swept_moment_value(&self, from: &Pose, to: &Pose) -> SweptMoment {
        let mut swept = SweptMoment::default();
        self.update_swept_moment(from, to, &mut swept);
        swept
    }

    /// Updates a swept moment for other poses. Its vectors of derivatives become empty and keep their memory.
    pub fn update_swept_moment(&self, from: &Pose, to: &Pose, swept: &mut SweptMoment) {
        let SweptMoment { value, d_from, d_to, carried } = swept;
        d_from.clear();
        d_to.clear();
        let robot = self.robot();
        let center = |pose: &Pose, l: usize| pose.frames.link_com(self.tree(), l);
        // Positions relative to the centre of mass, so that numbers stay small far from the origin.
        carried.clear();
        carried.extend((0..robot.links.len()).map(|l| {
            let (p, next) = (center(from, l) - from.com, center(to, l) - to.com);
            let turning = from.frames.world_from_link[l] * self.second_moment(l);
            p * next.transpose() * robot.links[l].mass_kg
                + turning * to.frames.world_from_link[l].transpose()
        }));
        for joint in robot.joints.iter().rev() {
            let sum = carried[joint.child];
            carried[joint.parent] += sum;
        }
        *value = cross_sum(&carried[0]);
    }
}

impl SweptMoment {
    /// Computes the derivatives unless they exist.
    pub fn differentiate(&mut self, model: &Model, from: &Pose, to: &Pose) {
        if !self.d_from.is_empty() {
            return;
        }
        let Self { d_from, d_to, carried: sums, .. } = self;
        // A rotation w about o moves a point at one end by w × (r − o). The first moment Σ m r of the robot about its centre of
        // mass is zero, so a rotation of the whole robot needs no origin, and the motion of the centre of mass cancels.
        d_from.reserve_exact(model.dofs() - 3);
        d_to.reserve_exact(model.dofs() - 3);
        d_from.extend(from.base_axes.iter().map(|w| turned_first(&sums[0], w)));
        d_to.extend(to.base_axes.iter().map(|w| turned_second(&sums[0], w)));
        for (j, joint) in model.robot().joints.iter().enumerate() {
            let child = joint.child;
            let mass = model.tree().carried_mass_kg(j);
            let moment = |pose: &Pose| pose.frames.carried_moments[child] - pose.com * mass;
            if let (Some(slide), Some(next)) =
                (&from.frames.joint_slides[j], &to.frames.joint_slides[j])
            {
                d_from.push(slide.cross(&moment(to)));
                d_to.push(moment(from).cross(next));
                continue;
            }
            let arm = |pose: &Pose| pose.frames.link_origins[child] - pose.com;
            let first = sums[child] - arm(from) * moment(to).transpose();
            let second = sums[child] - moment(from) * arm(to).transpose();
            d_from.push(turned_first(&first, &from.frames.joint_axes[j]));
            d_to.push(turned_second(&second, &to.frames.joint_axes[j]));
        }
        debug_assert_eq!(d_from.len(), JOINTS - 3 + model.robot().joints.len());
    }
}

impl<'a> CarriedPair<'a> {
    /// Combines two poses and the swept moment between them.
    pub fn new(from: &'a Pose, to: &'a Pose, swept: &'a SweptMoment) -> Self {
        Self { from, to, swept }
    }

    /// Matrix Σ m (p − o) (p₊ − o₊)ᵀ of the subtree beyond joint `joint`, in world axes, kg·m². Points p and origin o belong to
    /// the beginning of the interval, p₊ and o₊ to its end.
    pub fn about(
        &self,
        model: &Model,
        joint: usize,
        origin: &Vector3<f64>,
        origin_next: &Vector3<f64>,
    ) -> Matrix3<f64> {
        let child = model.robot().joints[joint].child;
        let mass = model.tree().carried_mass_kg(joint);
        let moment = |pose: &Pose| pose.frames.carried_moments[child] - pose.com * mass;
        let (shift, next) = (self.from.com - origin, self.to.com - origin_next);
        self.swept.carried[child]
            + (moment(self.from) + shift * mass) * next.transpose()
            + shift * moment(self.to).transpose()
    }
}
