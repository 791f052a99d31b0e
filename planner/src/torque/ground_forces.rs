//! Ground forces nearest to the planned ones that balance the motion of the base: a small cone program at every time.
//!
//! The force of contact j is a_j B_j x_j. B has three columns for a gripping contact and two for a freely rolling one, whose
//! force along its rolling direction is drag. a is 1 in stance. While a foot lifts off or lands, a falls with the time from
//! stance and with the height of the foot. A foot above the ground carries nothing, although the plan's forces fall linearly
//! from a stance sample to zero.
//!
//! ```text
//! minimise   ½ Σ |x_j − x_j⁰|² + ½ κ |w − Σ G_j a_j B_j x_j|²      with B_j x_j in the friction cone
//! ```
//!
//! x⁰ are the planned forces of the full contacts, and G maps a force to a wrench about the centre of mass. Forces are in units
//! of the weight, moments in units of the weight times the height of the centre of mass. A wrench that contacts can supply is
//! met to about 1/κ. If they can supply it in many ways, x is unique nevertheless.

use crate::cone_program::{Accuracy, Cone, ConeProgram};
use crate::families::ROLLING_SIGN_WIDTH_M_S;
use crate::sample::PlannedContact;
use nalgebra::{DMatrix, DVector, Matrix3xX, Matrix6, Vector3, Vector6};
use rollwalk_multibody::{Kinematics, RimContact};
use rollwalk_robot::EndEffector;

/// Weight κ of the wrench against that of the planned forces.
const WRENCH_WEIGHT: f64 = 1e4;
/// Accuracy of the solver. With its default tolerances of 1e-8, forces of 60 N are off by up to 1 mN.
const ACCURACY: Accuracy = Accuracy { tolerance: 1e-10, regularisation: 1e-12 };
/// Largest height of a contact on the ground in a converged plan, m: a fifth of the tolerance.
const ON_GROUND_M: f64 = 0.0002;
/// Height above [`ON_GROUND_M`] at which a foot that lifts off or lands carries half of its force on the ground, m.
const CARRIES_HALF_AT_M: f64 = 0.0005;

/// Contact that can carry force.
pub struct Support {
    /// Matrix B: force per unknown.
    directions: Matrix3xX<f64>,
    friction_coefficient: f64,
    /// Unit normal of the ground.
    normal: Vector3<f64>,
    /// Factor a: fraction of a full contact.
    part: f64,
    /// Planned force of the full contact, N.
    planned_n: Vector3<f64>,
    /// Vector from the centre of mass to the contact, m.
    arm: Vector3<f64>,
}

/// Wrench that the motion requires from the ground.
pub struct RequiredWrench {
    /// Force, N, and moment about the centre of mass, N·m.
    pub wrench: Vector6<f64>,
    /// Weight of the robot, N: the unit of forces.
    pub weight_n: f64,
    /// Height of the centre of mass, m: the unit of levers.
    pub height_m: f64,
}

impl Support {
    /// Creates a support from a planned contact at a height above the ground.
    pub fn new(
        foot: &EndEffector,
        contact: &RimContact,
        above_m: f64,
        kinematics: &Kinematics,
        planned: &PlannedContact,
        com: &Vector3<f64>,
    ) -> Self {
        let normal = *contact.normal();
        let directions = foot.contact.drag().map_or_else(
            || Matrix3xX::identity(3),
            |drag| {
                // Eq. 2.6: the force along the rolling direction is a fraction of the load.
                let rolling = contact.axis.cross(&normal).normalize();
                let speed_m_s =
                    kinematics.point_velocity(contact.link, &contact.center).dot(&rolling);
                let sign = (speed_m_s / ROLLING_SIGN_WIDTH_M_S).tanh();
                let slowing = drag.rolling_resistance * sign + drag.rolling_drag_s_m * speed_m_s;
                let across = normal.cross(&rolling);
                Matrix3xX::from_columns(&[across, normal - rolling * slowing])
            },
        );
        let above = (above_m - ON_GROUND_M).max(0.0);
        let height = if planned.share < 1.0 { above } else { 0.0 };
        let near = 1.0 / (1.0 + (height / CARRIES_HALF_AT_M).powi(2));
        Self {
            directions,
            friction_coefficient: foot.friction_coefficient,
            normal,
            part: planned.share * near,
            planned_n: planned.force_n,
            arm: contact.position() - com,
        }
    }

    /// Two unit vectors along the ground; x and y on level ground.
    fn tangents(&self) -> [Vector3<f64>; 2] {
        let first = Vector3::y().cross(&self.normal).normalize();
        [first, self.normal.cross(&first)]
    }

    /// Force and moment about the centre of mass of a force at the contact.
    pub fn wrench(&self, force: &Vector3<f64>) -> Vector6<f64> {
        let moment = self.arm.cross(force);
        Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }
}

/// Returns the nearest forces, N, one for each support.
pub fn nearest(supports: &[&Support], wanted: &RequiredWrench) -> Vec<Vector3<f64>> {
    let count: usize = supports.iter().map(|support| support.directions.ncols()).sum();
    if count == 0 {
        return Vec::new();
    }
    // Wrench per unknown, planned unknowns, and rows of the cones: μ times the normal force of each contact, and its two
    // tangential forces.
    let mut wrenches = DMatrix::zeros(6, count);
    let mut planned = DVector::zeros(count);
    let mut cones = DMatrix::zeros(3 * supports.len(), count);
    let lever = wanted.height_m;
    let scale = Vector6::new(1.0, 1.0, 1.0, 1.0 / lever, 1.0 / lever, 1.0 / lever);
    let mut first = 0;
    for (k, support) in supports.iter().enumerate() {
        let [first_tangent, second_tangent] = support.tangents();
        for (c, direction) in support.directions.column_iter().enumerate() {
            let direction = direction.into_owned();
            let unknown = first + c;
            let wrench = support.wrench(&(direction * support.part)).component_mul(&scale);
            wrenches.set_column(unknown, &wrench);
            planned[unknown] = if support.directions.ncols() == 3 {
                support.planned_n[c]
            } else if c == 0 {
                support.planned_n.dot(&direction)
            } else {
                support.planned_n.dot(&support.normal)
            } / wanted.weight_n;
            let row = 3 * k;
            cones[(row, unknown)] = support.friction_coefficient * direction.dot(&support.normal);
            cones[(row + 1, unknown)] = direction.dot(&first_tangent);
            cones[(row + 2, unknown)] = direction.dot(&second_tangent);
        }
        first += support.directions.ncols();
    }
    let wrench = wanted.wrench.component_mul(&scale) / wanted.weight_n;
    let unknowns = without_cones(&planned, &wrenches, &wrench)
        .filter(|unknowns| is_within(&(&cones * unknowns)))
        .unwrap_or_else(|| solve(&planned, &wrenches, &wrench, &cones));
    let mut rest = unknowns.as_slice();
    supports
        .iter()
        .map(|support| {
            let (own, others) = rest.split_at(support.directions.ncols());
            rest = others;
            &support.directions * DVector::from_column_slice(own) * (support.part * wanted.weight_n)
        })
        .collect()
}

/// Minimum of ½ |x − x⁰|² + ½ κ |w − G x|² in closed form: x⁰ + κ Gᵀ (1 + κ G Gᵀ)⁻¹ (w − G x⁰). If it is within the cones, it
/// is also the constrained minimum. The cone solver would take fifty times as long.
fn without_cones(
    planned: &DVector<f64>,
    wrenches: &DMatrix<f64>,
    wrench: &Vector6<f64>,
) -> Option<DVector<f64>> {
    let missing = wrench - wrenches * planned;
    let matrix: Matrix6<f64> =
        Matrix6::identity() + wrenches * wrenches.transpose() * WRENCH_WEIGHT;
    let pull = matrix.cholesky()?.solve(&missing) * WRENCH_WEIGHT;
    Some(planned + wrenches.transpose() * pull)
}

/// Returns true if every three entries are in the second-order cone, and false for NaN.
fn is_within(cones: &DVector<f64>) -> bool {
    cones.as_slice().chunks_exact(3).all(|cone| cone[1].hypot(cone[2]) <= cone[0])
}

/// Minimum of ½ |x − x⁰|² + ½ κ |w − G x|² with every three entries of C x in the second-order cone.
///
/// The missing wrench is a separate variable. With a condensed Hessian of x, whose eigenvalues span κ, some problems ended far
/// from their solution.
fn solve(
    planned: &DVector<f64>,
    wrenches: &DMatrix<f64>,
    wrench: &Vector6<f64>,
    cones: &DMatrix<f64>,
) -> DVector<f64> {
    let (count, rows) = (planned.len(), cones.nrows());
    let missing_scale = WRENCH_WEIGHT.sqrt().recip();
    // Rows: G x + missing = w, then −C x + s = 0 with s in the cones.
    let mut left = DMatrix::zeros(6 + rows, count + 6);
    left.view_mut((0, 0), (6, count)).copy_from(wrenches);
    left.view_mut((0, count), (6, 6)).fill_diagonal(missing_scale);
    left.view_mut((6, 0), (rows, count)).copy_from(&-cones);
    let mut right = vec![0.0; 6 + rows];
    right[..6].copy_from_slice(wrench.as_slice());
    let mut gradient = vec![0.0; count + 6];
    gradient.iter_mut().zip(planned).for_each(|(gradient, planned)| *gradient = -planned);
    let mut kinds = vec![Cone::Zero(6)];
    kinds.extend(vec![Cone::SecondOrder(3); rows / 3]);
    let program = ConeProgram {
        hessian: DMatrix::identity(count + 6, count + 6),
        gradient,
        rows: left,
        bounds: right,
        cones: kinds,
        accuracy: Some(ACCURACY),
    };
    let found = DVector::from_column_slice(&program.solve().x[..count]);
    // Random problems are all solved. If one failed, the planned forces would be the best guess.
    if found.iter().all(|x| x.is_finite()) { found } else { planned.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    /// Nearest point to `force` in the friction cone |f_xy| ≤ μ f_z.
    fn in_cone(force: &Vector3<f64>, friction_coefficient: f64) -> Vector3<f64> {
        let (side, mu) = (force.xy().norm(), friction_coefficient);
        if side <= mu * force.z {
            return *force;
        }
        if mu * side <= -force.z {
            return Vector3::zeros();
        }
        let load = (force.z + mu * side) / (1.0 + mu * mu);
        Vector3::new(force.x / side * mu * load, force.y / side * mu * load, load)
    }

    /// Checks that the solver terminates for any finite or infinite values. Plan files may contain any, and the forces are then
    /// meaningless.
    #[test]
    fn numbers_beyond_reason_end_with_some_force() {
        for number in [f64::NAN, f64::INFINITY, 1e300, -1e300, 1e-300] {
            let support = Support {
                directions: Matrix3xX::identity(3),
                friction_coefficient: 0.7,
                normal: Vector3::z(),
                part: 1e-12,
                planned_n: Vector3::new(number, 0.0, 10.0),
                arm: Vector3::new(0.1, number, -0.3),
            };
            let wrench = Vector6::new(0.0, 0.0, number, 0.0, 1.0, 0.0);
            let wanted = RequiredWrench { wrench, weight_n: 60.0, height_m: 0.3 };
            assert_eq!(nearest(&[&support, &support], &wanted).len(), 2);
        }
    }

    /// Checks that closed form and cone solver give the same minimum within the cones.
    #[test]
    fn the_closed_form_is_what_the_cone_solver_finds() {
        let mut random = test_robots::uniform(4);
        let mut within = 0;
        for case in 0..100 {
            let count = 3 * (1 + case % 5);
            let mut random = |scale: f64| scale * random();
            let wrenches = DMatrix::from_fn(6, count, |_, _| random(1.0));
            // Friction of 1. The wanted wrench is so far from the plan that about half of the cases end within the cones.
            let planned =
                DVector::from_fn(
                    count,
                    |c, _| {
                        if c % 3 == 2 { 1.0 + random(0.5) } else { random(0.5) }
                    },
                );
            let wrench = &wrenches * &planned + Vector6::from_fn(|_, _| random(0.5));
            let cones = DMatrix::from_fn(count, count, |row, column| {
                let of_cone = [2, 0, 1][row % 3] + row / 3 * 3;
                f64::from(u8::from(of_cone == column))
            });
            let closed = without_cones(&planned, &wrenches, &wrench).expect("it is definite");
            if !is_within(&(&cones * &closed)) {
                continue;
            }
            within += 1;
            let solved = solve(&planned, &wrenches, &wrench, &cones);
            // The solver's tolerance of the gap is 1e-10. It contains a square, so lengths are accurate to its root.
            assert!((closed - &solved).amax() < 1e-5, "{case}: {solved}");
        }
        assert!((20..80).contains(&within), "{within}");
    }

    /// Checks optimality: at the minimum of a convex function over a cone, a step against the gradient, projected to the cone,
    /// does not move.
    #[test]
    fn no_step_within_the_cones_gets_nearer() {
        let mut random = test_robots::uniform(3);
        let mut vector = |scale: f64| Vector3::from_fn(|_, _| scale * random());
        let mut at_the_edge = 0;
        for case in 0..200 {
            let supports: Vec<Support> = (0..1 + case % 5)
                .map(|_| Support {
                    directions: Matrix3xX::identity(3),
                    friction_coefficient: 0.7,
                    normal: Vector3::z(),
                    part: 1.0,
                    planned_n: vector(40.0),
                    arm: vector(0.4) - Vector3::z() * 0.3,
                })
                .collect();
            let (force, moment) = (vector(30.0) + Vector3::z() * 50.0, vector(10.0));
            let wrench = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
            let wanted = RequiredWrench { wrench, weight_n: 60.0, height_m: 0.3 };
            let forces = nearest(&supports.iter().collect::<Vec<_>>(), &wanted);
            let given: Vector6<f64> = supports.iter().zip(&forces).map(|(s, f)| s.wrench(f)).sum();
            let missing = wrench - given;
            let (linear, angular) = (missing.fixed_rows::<3>(0), missing.fixed_rows::<3>(3));
            for (support, force) in supports.iter().zip(&forces) {
                let pull = linear + angular.cross(&support.arm) / wanted.height_m.powi(2);
                let gradient = force - support.planned_n - pull * WRENCH_WEIGHT;
                let step = 1e-4;
                let moved = in_cone(&(force - gradient * step), support.friction_coefficient);
                // Tolerance of the solver: up to 1.2e-4 N of 60 N was measured.
                assert!((moved - force).norm() < 1e-3, "{case}: {force:?} {moved:?}");
                at_the_edge += usize::from((force.xy().norm() - 0.7 * force.z).abs() < 1e-4);
            }
        }
        assert!(at_the_edge > 50, "{at_the_edge}");
    }
}
