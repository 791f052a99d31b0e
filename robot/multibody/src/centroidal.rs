//! Centroidal momentum: the base rows of the mass matrix and of the bias forces, moved to the centre of mass (Orin, Goswami and
//! Lee 2013; Wensing and Orin 2016).

use crate::rotation::skew;
use crate::{ANGULAR, LINEAR};
use nalgebra::{DMatrix, Matrix6xX, Vector3, Vector6};

/// Centroidal momentum matrix A. The product A ν is the linear momentum, kg·m/s, and the angular momentum about the centre of
/// mass, kg·m²/s. `base_to_com` is the vector from the base origin to the centre of mass, in world axes, m.
pub fn centroidal_momentum_matrix(
    mass_matrix: &DMatrix<f64>,
    base_to_com: &Vector3<f64>,
    out: &mut Matrix6xX<f64>,
) {
    let shift = skew(base_to_com);
    for (dof, mut column) in out.column_iter_mut().enumerate() {
        let linear = mass_matrix.fixed_view::<3, 1>(LINEAR, dof);
        let angular = mass_matrix.fixed_view::<3, 1>(ANGULAR, dof);
        column.fixed_rows_mut::<3>(LINEAR).copy_from(&linear);
        column.fixed_rows_mut::<3>(ANGULAR).copy_from(&(angular - shift * linear));
    }
}

/// Moves the six generalised forces of the base to force and moment about the centre of mass.
///
/// Applied to [`crate::Kinematics::inverse_dynamics`] without gravity, the result is the rate of centroidal momentum A ν̇ + Ȧ
/// ν. For ν̇ = 0 it is the bias Ȧ ν.
pub fn about_com(base_force: &[f64], base_to_com: &Vector3<f64>) -> Vector6<f64> {
    let force = Vector3::from_column_slice(&base_force[LINEAR..LINEAR + 3]);
    let moment = Vector3::from_column_slice(&base_force[ANGULAR..ANGULAR + 3]);
    let moment = moment - base_to_com.cross(&force);
    Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
}
