//! Mass matrix by the composite-rigid-body algorithm (RBDA sec. 6.2), and forward dynamics from it.
//!
//! Inertias and joint motions are expressed at the base origin in world axes, so that composite inertias are plain sums. The
//! six base rows are momentum per generalised velocity.

use crate::rotation::skew;
use crate::{ANGULAR, Frames, JOINTS, LINEAR, Tree};
use nalgebra::{DMatrix, DVector, Matrix3, Vector3};
use rollwalk_robot::JointRatio;

/// Inertia of every link together with all links that it carries.
#[derive(Clone, Debug)]
pub struct CompositeInertia {
    links: Vec<SpatialInertia>,
}

/// Inertia of a rigid body about a point, in world axes (RBDA Eq. 2.63).
#[derive(Clone, Copy, Debug)]
struct SpatialInertia {
    mass_kg: f64,
    /// First moment Σ m d about the point, kg·m.
    moment: Vector3<f64>,
    /// Inertia about the point, kg·m².
    inertia: Matrix3<f64>,
}

/// Motion of a rigid body per unit speed of a joint, expressed at the base origin.
struct Screw {
    angular: Vector3<f64>,
    /// Velocity of the body's point at the base origin.
    linear: Vector3<f64>,
}

/// Momentum of a rigid body: linear, and angular about the base origin.
struct Momentum {
    linear: Vector3<f64>,
    angular: Vector3<f64>,
}

impl CompositeInertia {
    /// Composite inertias for a configuration.
    pub fn new(tree: &Tree, frames: &Frames) -> Self {
        let zero =
            SpatialInertia { mass_kg: 0.0, moment: Vector3::zeros(), inertia: Matrix3::zeros() };
        let mut composite = Self { links: vec![zero; tree.robot().links.len()] };
        composite.update(tree, frames);
        composite
    }

    /// Updates the inertias for another configuration, without allocation.
    pub fn update(&mut self, tree: &Tree, frames: &Frames) {
        for (l, link) in tree.robot().links.iter().enumerate() {
            let arm = frames.link_com(tree, l) - frames.link_origins[0];
            let cross = skew(&arm);
            self.links[l] = SpatialInertia {
                mass_kg: link.mass_kg,
                moment: arm * link.mass_kg,
                inertia: frames.link_inertia(tree, l) - cross * cross * link.mass_kg,
            };
        }
        for joint in tree.robot().joints.iter().rev() {
            let carried = self.links[joint.child];
            let parent = &mut self.links[joint.parent];
            parent.mass_kg += carried.mass_kg;
            parent.moment += carried.moment;
            parent.inertia += carried.inertia;
        }
    }

    /// Inertia about a joint's axis of all links that the joint carries, with armature if the tree has it, kg·m². For a prismatic
    /// joint, the inertia at its motor.
    pub fn joint_inertia(&self, tree: &Tree, frames: &Frames, joint: usize) -> f64 {
        let screw = screw(tree, frames, joint);
        let momentum = self.links[tree.robot().joints[joint].child].momentum(&screw);
        let ratios = frames.ratios(tree);
        let rotors = (0..tree.robot().joints.len()).flat_map(|motor| {
            let of_joint = move |of: &&JointRatio| of.joint == joint;
            let ratio = ratios.ratios(motor).iter().find(of_joint)?.ratio;
            Some(ratio * ratio * tree.motor_armature_kg_m2(motor))
        });
        screw.power(&momentum) + rotors.sum::<f64>()
    }

    /// Mass matrix M(q), [`Tree::dofs`] square: the kinetic energy is ½ νᵀ M ν, the momenta are M ν.
    ///
    /// # Panics
    /// If `out` is smaller.
    pub fn mass_matrix(&self, tree: &Tree, frames: &Frames, out: &mut DMatrix<f64>) {
        out.fill(0.0);
        let base = &self.links[0];
        let coupling = skew(&base.moment);
        set_block(out, LINEAR, LINEAR, &Matrix3::from_diagonal_element(base.mass_kg));
        set_block(out, ANGULAR, LINEAR, &coupling);
        set_block(out, LINEAR, ANGULAR, &-coupling);
        set_block(out, ANGULAR, ANGULAR, &base.inertia);
        for (j, joint) in tree.robot().joints.iter().enumerate() {
            let momentum = self.links[joint.child].momentum(&screw(tree, frames, j));
            set_column(tree, frames, out, JOINTS + j, joint.child, &momentum);
        }
        for motor in 0..tree.robot().joints.len() {
            let ratios = frames.ratios(tree).ratios(motor);
            for a in ratios {
                for b in ratios {
                    let inertia = a.ratio * b.ratio * tree.motor_armature_kg_m2(motor);
                    out[(JOINTS + a.joint, JOINTS + b.joint)] += inertia;
                }
            }
        }
        for (w, wheel) in tree.wheels().iter().enumerate() {
            let dof = tree.first_wheel_dof() + w;
            let axis = frames.world_from_link[wheel.link] * wheel.axis_in_link;
            // A pure couple: the wheel's centre does not move.
            let angular = axis * wheel.spin_inertia_kg_m2;
            let momentum = Momentum { linear: Vector3::zeros(), angular };
            set_column(tree, frames, out, dof, wheel.link, &momentum);
            out[(dof, dof)] = wheel.spin_inertia_kg_m2 + tree.wheel_armature_kg_m2(wheel);
        }
    }
}

impl SpatialInertia {
    fn momentum(&self, screw: &Screw) -> Momentum {
        Momentum {
            linear: screw.linear * self.mass_kg + screw.angular.cross(&self.moment),
            angular: self.inertia * screw.angular + self.moment.cross(&screw.linear),
        }
    }
}

impl Screw {
    fn power(&self, momentum: &Momentum) -> f64 {
        self.linear.dot(&momentum.linear) + self.angular.dot(&momentum.angular)
    }
}

fn screw(tree: &Tree, frames: &Frames, joint: usize) -> Screw {
    let angular = frames.joint_axes[joint];
    if let Some(slide) = frames.joint_slides[joint] {
        return Screw { angular, linear: slide };
    }
    let origin = frames.link_origins[tree.robot().joints[joint].child];
    Screw { angular, linear: angular.cross(&(frames.link_origins[0] - origin)) }
}

/// Writes column and row `dof` of the mass matrix. `momentum` is the momentum of `link` and the links that it carries, per unit
/// speed of `dof`. The entries belong to the base and to the joints between the base and `link`.
fn set_column(
    tree: &Tree,
    frames: &Frames,
    out: &mut DMatrix<f64>,
    dof: usize,
    link: usize,
    momentum: &Momentum,
) {
    let mut set = |row: usize, value: f64| {
        out[(row, dof)] = value;
        out[(dof, row)] = value;
    };
    for k in 0..3 {
        set(LINEAR + k, momentum.linear[k]);
        set(ANGULAR + k, momentum.angular[k]);
    }
    for &j in tree.joints_to_link(link) {
        set(JOINTS + j, screw(tree, frames, j).power(momentum));
    }
}

fn set_block(out: &mut DMatrix<f64>, row: usize, column: usize, block: &Matrix3<f64>) {
    out.fixed_view_mut::<3, 3>(row, column).copy_from(block);
}

/// Accelerations ν̇ = M⁻¹ (τ − h) under generalised forces τ; `None` if M is not positive definite.
pub fn forward_dynamics(
    mass_matrix: DMatrix<f64>,
    bias: &DVector<f64>,
    force: &DVector<f64>,
) -> Option<DVector<f64>> {
    Some(mass_matrix.cholesky()?.solve(&(force - bias)))
}
