//! Generalised forces by the Newton–Euler method (RBDA sec. 5.3): force and moment of each link, projected onto the base and
//! onto the joints between base and link.

use crate::{ANGULAR, JOINTS, Kinematics, LINEAR, Tree};
use nalgebra::Vector3;

impl Kinematics {
    /// Generalised forces τ = M ν̇ + h that, together with springs and dampers at joints, produce the present acceleration ν̇
    /// under gravity (world axes, m/s²).
    ///
    /// After [`Kinematics::update`], with ν̇ = 0, the result is the bias force h: Coriolis, centrifugal and gyroscopic forces,
    /// weight, and the opposite of the torques of springs and dampers. `out` has [`Tree::dofs`] entries, N and N·m.
    ///
    /// # Panics
    /// If `out` is shorter.
    pub fn inverse_dynamics(&self, tree: &Tree, gravity_m_s2: &Vector3<f64>, out: &mut [f64]) {
        out.fill(0.0);
        for (l, link) in tree.robot().links.iter().enumerate() {
            let com = self.frames.link_com(tree, l);
            let force = (self.point_acceleration(l, &com) - gravity_m_s2) * link.mass_kg;
            let inertia = self.frames.link_inertia(tree, l);
            let w = self.angular_velocity[l];
            let moment = inertia * self.angular_acceleration[l] + w.cross(&(inertia * w));
            self.project(tree, l, &com, &force, &moment, out);
        }
        for (w, wheel) in tree.wheels().iter().enumerate() {
            let dof = tree.first_wheel_dof() + w;
            let (speed, acceleration) = (self.velocity[dof], self.acceleration[dof]);
            let axis = self.frames.world_from_link[wheel.link] * wheel.axis_in_link;
            let spin_inertia = wheel.spin_inertia_kg_m2;
            // Rate of change of the spin's angular momentum J s a; J ω of the link has the rest.
            let turning = self.angular_velocity[wheel.link].cross(&axis) * speed;
            let moment = (axis * acceleration + turning) * spin_inertia;
            let center = self.frames.link_origins[wheel.link];
            self.project(tree, wheel.link, &center, &Vector3::zeros(), &moment, out);
            let carrier = axis.dot(&self.angular_acceleration[wheel.link]);
            out[dof] = spin_inertia * (carrier + acceleration)
                + tree.wheel_armature_kg_m2(wheel) * acceleration;
        }
        for motor in 0..tree.robot().joints.len() {
            let torque_nm = tree.motor_armature_kg_m2(motor) * self.motor_acceleration(tree, motor);
            for of in self.frames.ratios(tree).ratios(motor) {
                out[JOINTS + of.joint] += of.ratio * torque_nm;
            }
        }
        for (joint, of) in tree.robot().joints.iter().enumerate() {
            if let Some(spring) = &of.spring {
                let dof = JOINTS + joint;
                out[dof] -= spring.torque_nm(self.joint_rad[joint], self.velocity[dof]);
            }
        }
    }

    /// Acceleration of the motor of a joint, rad/s².
    fn motor_acceleration(&self, tree: &Tree, motor: usize) -> f64 {
        let of_pose = self.frames.ratios(tree);
        let ratios = of_pose.ratios(motor).iter();
        let bends = of_pose.bends(motor).iter();
        ratios.map(|of| of.ratio * self.acceleration[JOINTS + of.joint]).sum::<f64>()
            + bends
                .map(|(j, k, by)| by * self.velocity[JOINTS + j] * self.velocity[JOINTS + k])
                .sum::<f64>()
    }

    /// Adds to `out` the generalised forces of a wrench on a link: `force` at `point`, and `moment`. Vectors are in world axes.
    fn project(
        &self,
        tree: &Tree,
        link: usize,
        point: &Vector3<f64>,
        force: &Vector3<f64>,
        moment: &Vector3<f64>,
        out: &mut [f64],
    ) {
        let about = |origin: &Vector3<f64>| moment + (point - origin).cross(force);
        let base = about(&self.frames.link_origins[0]);
        for k in 0..3 {
            out[LINEAR + k] += force[k];
            out[ANGULAR + k] += base[k];
        }
        for &j in tree.joints_to_link(link) {
            if let Some(slide) = &self.frames.joint_slides[j] {
                out[JOINTS + j] += slide.dot(force);
                continue;
            }
            let origin = self.frames.link_origins[tree.robot().joints[j].child];
            out[JOINTS + j] += self.frames.joint_axes[j].dot(&about(&origin));
        }
    }
}
