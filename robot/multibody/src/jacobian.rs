//! Jacobians of points, of link rotations and of the centre of mass, and their time derivatives.
//!
//! A degree of freedom with axis w through o moves a point x by w × (x − o), and rotates by w (RBDA sec. 4.1.3). A prismatic
//! joint moves all points alike. Matrices are 3 × [`Tree::dofs`], in world axes, with one column for each entry of ν. An output
//! with fewer columns causes a panic.

use crate::{ANGULAR, Frames, JOINTS, Kinematics, LINEAR, Tree};
use nalgebra::{Matrix3, Matrix3xX, Vector3};

impl Frames {
    /// Jacobian of a point of a link, ẋ = J ν, m/s. The point is in world axes.
    pub fn point_jacobian(
        &self,
        tree: &Tree,
        link: usize,
        point: &Vector3<f64>,
        out: &mut Matrix3xX<f64>,
    ) {
        out.fill(0.0);
        out.fixed_columns_mut::<3>(LINEAR).copy_from(&Matrix3::identity());
        let base = point - self.link_origins[0];
        set_base_rotation(out, &base);
        for &j in tree.joints_to_link(link) {
            let arm = point - self.link_origins[tree.robot().joints[j].child];
            out.set_column(JOINTS + j, &self.joint_displacement(j, &arm));
        }
    }

    /// Jacobian of a link's rotation: ω = J ν, rad/s.
    pub fn angular_jacobian(&self, tree: &Tree, link: usize, out: &mut Matrix3xX<f64>) {
        out.fill(0.0);
        out.fixed_columns_mut::<3>(ANGULAR).copy_from(&Matrix3::identity());
        for &j in tree.joints_to_link(link) {
            out.set_column(JOINTS + j, &self.joint_axes[j]);
        }
    }

    /// Jacobian of the robot's centre of mass, ċ = J ν, m/s.
    pub fn com_jacobian(&self, tree: &Tree, out: &mut Matrix3xX<f64>) {
        out.fill(0.0);
        out.fixed_columns_mut::<3>(LINEAR).copy_from(&Matrix3::identity());
        set_base_rotation(out, &(self.com(tree) - self.link_origins[0]));
        for (j, joint) in tree.robot().joints.iter().enumerate() {
            out.set_column(JOINTS + j, &self.com_column(tree, j, joint.child));
        }
    }

    /// Displacement of the robot's centre of mass per radian of a joint, m.
    pub(crate) fn com_column(&self, tree: &Tree, joint: usize, child: usize) -> Vector3<f64> {
        let mass_kg = tree.carried_mass_kg(joint);
        if let Some(slide) = &self.joint_slides[joint] {
            return slide * (mass_kg / tree.total_mass_kg());
        }
        let lever = self.carried_moments[child] - self.link_origins[child] * mass_kg;
        self.joint_axes[joint].cross(&lever) / tree.total_mass_kg()
    }
}

impl Kinematics {
    /// Time derivative J̇ of [`Frames::point_jacobian`] at a point that moves with `point_velocity`. For a point fixed to the
    /// link, pass [`Kinematics::point_velocity`].
    pub fn point_jacobian_derivative(
        &self,
        tree: &Tree,
        link: usize,
        point: &Vector3<f64>,
        point_velocity: &Vector3<f64>,
        out: &mut Matrix3xX<f64>,
    ) {
        out.fill(0.0);
        set_base_rotation(out, &(point_velocity - self.linear_velocity[0]));
        for &j in tree.joints_to_link(link) {
            let child = tree.robot().joints[j].child;
            let arm = point - self.frames.link_origins[child];
            let d_arm = point_velocity - self.linear_velocity[child];
            out.set_column(JOINTS + j, &self.d_displacement(j, child, &arm, &d_arm));
        }
    }

    /// Time derivative of [`Frames::angular_jacobian`].
    pub fn angular_jacobian_derivative(&self, tree: &Tree, link: usize, out: &mut Matrix3xX<f64>) {
        out.fill(0.0);
        for &j in tree.joints_to_link(link) {
            out.set_column(JOINTS + j, &self.d_axis(j, tree.robot().joints[j].child));
        }
    }

    /// Time derivative of [`Frames::com_jacobian`].
    pub fn com_jacobian_derivative(&self, tree: &Tree, out: &mut Matrix3xX<f64>) {
        out.fill(0.0);
        set_base_rotation(out, &(self.com_velocity(tree) - self.linear_velocity[0]));
        for (l, link) in tree.robot().links.iter().enumerate() {
            let com = self.frames.link_com(tree, l);
            let velocity = self.point_velocity(l, &com);
            for &j in tree.joints_to_link(l) {
                let child = tree.robot().joints[j].child;
                let arm = com - self.frames.link_origins[child];
                let d_arm = velocity - self.linear_velocity[child];
                let column = self.d_displacement(j, child, &arm, &d_arm);
                out.column_mut(JOINTS + j).axpy(link.mass_kg / tree.total_mass_kg(), &column, 1.0);
            }
        }
    }

    /// Time derivative of [`Frames::joint_displacement`] of a joint with the given child, for an arm that changes by `d_arm`.
    fn d_displacement(
        &self,
        joint: usize,
        child: usize,
        arm: &Vector3<f64>,
        d_arm: &Vector3<f64>,
    ) -> Vector3<f64> {
        match &self.frames.joint_slides[joint] {
            Some(slide) => self.angular_velocity[child].cross(slide),
            None => {
                self.d_axis(joint, child).cross(arm) + self.frames.joint_axes[joint].cross(d_arm)
            }
        }
    }

    /// Time derivative of a joint's axis. The axis is fixed to both parent and child.
    fn d_axis(&self, joint: usize, child: usize) -> Vector3<f64> {
        self.angular_velocity[child].cross(&self.frames.joint_axes[joint])
    }
}

/// Writes the columns of the base's rotation, ω × arm.
fn set_base_rotation(out: &mut Matrix3xX<f64>, arm: &Vector3<f64>) {
    out.fixed_columns_mut::<3>(ANGULAR).copy_from(&-crate::rotation::skew(arm));
}
