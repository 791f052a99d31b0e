//! Extended Kalman filter of rotation, velocity and angular velocity of the base, and of the gyro bias.
//!
//! The velocity error is right-invariant: v = Exp(θ) v̂ + v′, where θ is the rotation error in world axes. Yaw is not
//! observable. With this error definition a pure yaw error changes no predicted measurement, so that linearisation does not
//! make yaw seem observable. The error state consists of θ (world, rad), v′ (world, m/s), the error δω of the angular velocity
//! and the error δb of the gyro bias (both body, rad/s):
//!
//! ```text
//! θ̇ = R δω      v̇′ = g × θ + v̂ × R δω + R noise      δω̇ = noise      δḃ = noise
//! ```

use nalgebra::{Matrix3, Rotation3, SMatrix, Vector3};
use rollwalk_multibody::rotation::skew;
use rollwalk_robot::GRAVITY_M_S2;

const ROTATION: usize = 0;
const VELOCITY: usize = 3;
const RATE: usize = 6;
const BIAS: usize = 9;
const ERRORS: usize = 12;

/// Process noise of the angular velocity, (rad/s²)/√Hz: 0.1 rad/s in a tick of 2 ms, as at touch-down.
const ANGULAR_ACCELERATION: f64 = 2.2;
/// Noise of the specific force, (m/s²)/√Hz: 0.5 m/s² at 500 Hz, due to the accelerometer and vibrations of the robot.
const SPECIFIC_FORCE: f64 = 0.022;
/// Specific force above which a sample may be wrong, m/s².
///
/// The product of excess and tick is an additional standard deviation of the velocity, so that contact measurements correct the
/// velocity after a wrong sample.
const OUTLIER_M_S2: f64 = 50.0;
/// Process noise of the velocity without an accelerometer, (m/s²)/√Hz: 5 m/s² at 500 Hz.
const UNMEASURED_FORCE: f64 = 0.22;
/// Random walk of the gyro bias, (rad/s)/√s.
const BIAS_WALK: f64 = 1e-4;
/// White noise of a gyro sample, rad/s.
const GYRO_RAD_S: f64 = 0.02;
/// Standard deviation of the angular velocity of a robot that stands still, rad/s.
const STILL_RAD_S: f64 = 0.02;
/// Standard deviations at the start: rotation, rad; velocity, m/s; angular velocity and gyro bias, rad/s.
const START: [f64; 4] = [0.01, 0.02, 0.1, 0.02];
/// Squared Mahalanobis distance of a contact's velocity above which its covariance is inflated: the expected value in three
/// dimensions.
const OUTLIER: f64 = 3.0;

/// Jacobian of a measured vector with respect to the error state.
type MeasurementJacobian = SMatrix<f64, 3, ERRORS>;

/// State estimate and its covariance.
#[derive(Clone, Copy, Debug)]
pub struct Filter {
    pub world_from_body: Matrix3<f64>,
    /// Velocity of the base origin in world axes, m/s.
    pub velocity_m_s: Vector3<f64>,
    /// Angular velocity in body axes, rad/s.
    pub rate_rad_s: Vector3<f64>,
    /// Gyro bias in body axes, rad/s.
    pub gyro_bias_rad_s: Vector3<f64>,
    covariance: SMatrix<f64, ERRORS, ERRORS>,
}

impl Filter {
    /// Creates a filter from a known state of the base, with the standard deviations of `START`.
    pub fn new(
        world_from_body: Matrix3<f64>,
        velocity_m_s: Vector3<f64>,
        rate_rad_s: Vector3<f64>,
        gyro_bias_rad_s: Vector3<f64>,
    ) -> Self {
        let mut covariance = SMatrix::zeros();
        for k in 0..ERRORS {
            covariance[(k, k)] = START[k / 3].powi(2);
        }
        Self { world_from_body, velocity_m_s, rate_rad_s, gyro_bias_rad_s, covariance }
    }

    /// Predicts over a tick from the mean specific force in body axes; `None` predicts at constant velocity.
    pub fn predict(&mut self, specific_force_m_s2: Option<Vector3<f64>>, tick_s: f64) {
        let gravity = Vector3::z() * -GRAVITY_M_S2;
        let turn = |share: f64| Rotation3::new(self.rate_rad_s * (share * tick_s)).into_inner();
        let midway = self.world_from_body * turn(0.5);
        let acceleration = specific_force_m_s2.map_or(Vector3::zeros(), |f| midway * f + gravity);

        let turned = self.world_from_body * tick_s;
        let mut transition = SMatrix::<f64, ERRORS, ERRORS>::identity();
        transition.fixed_view_mut::<3, 3>(ROTATION, RATE).copy_from(&turned);
        transition.fixed_view_mut::<3, 3>(VELOCITY, ROTATION).copy_from(&(skew(&gravity) * tick_s));
        transition
            .fixed_view_mut::<3, 3>(VELOCITY, RATE)
            .copy_from(&(skew(&self.velocity_m_s) * turned));
        self.covariance = transition * self.covariance * transition.transpose();
        let (force, beyond_m_s2) = match specific_force_m_s2 {
            Some(force) => (SPECIFIC_FORCE, (force.norm() - OUTLIER_M_S2).max(0.0)),
            None => (UNMEASURED_FORCE, 0.0),
        };
        let velocity = force.powi(2) * tick_s + (beyond_m_s2 * tick_s).powi(2);
        let rate_density = ANGULAR_ACCELERATION.powi(2);
        // An angular acceleration within the tick also rotates the base: with this correlation a gyro sample corrects the
        // rotation by the trapezoidal rule.
        let correlated = turned * (rate_density * tick_s / 2.0);
        let mut cross = self.covariance.fixed_view_mut::<3, 3>(ROTATION, RATE);
        cross += correlated;
        let mut cross = self.covariance.fixed_view_mut::<3, 3>(RATE, ROTATION);
        cross += correlated.transpose();
        for k in 0..3 {
            for (of, variance) in [
                (ROTATION, rate_density * tick_s.powi(3) / 3.0),
                (VELOCITY, velocity),
                (RATE, rate_density * tick_s),
                (BIAS, BIAS_WALK.powi(2) * tick_s),
            ] {
                self.covariance[(of + k, of + k)] += variance;
            }
        }
        self.world_from_body *= turn(1.0);
        self.velocity_m_s += acceleration * tick_s;
    }

    /// Corrects the estimate with a gyro sample in body axes.
    pub fn measure_gyro(&mut self, gyro_rad_s: &Vector3<f64>) {
        let mut jacobian = MeasurementJacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, RATE).fill_with_identity();
        jacobian.fixed_view_mut::<3, 3>(0, BIAS).fill_with_identity();
        let innovation = gyro_rad_s - self.rate_rad_s - self.gyro_bias_rad_s;
        self.correct(&jacobian, &innovation, &(Matrix3::identity() * GYRO_RAD_S.powi(2)));
    }

    /// Corrects the estimate with zero angular velocity.
    pub fn measure_stillness(&mut self) {
        let mut jacobian = MeasurementJacobian::zeros();
        jacobian.fixed_view_mut::<3, 3>(0, RATE).fill_with_identity();
        let innovation = -self.rate_rad_s;
        self.correct(&jacobian, &innovation, &(Matrix3::identity() * STILL_RAD_S.powi(2)));
    }

    /// Corrects the estimate with zero velocity of the material at a contact, and the covariance of this measurement.
    pub fn measure_contact(&mut self, contact: &ContactKinematics, covariance: &Matrix3<f64>) {
        let innovation = -contact.velocity(self);
        let mut jacobian = MeasurementJacobian::zeros();
        // However the body tilts, the rim moves parallel to the ground at the contact: of the rotation error, only yaw
        // turns the velocity by spin.
        let about_vertical = Vector3::z() * Vector3::z().transpose();
        let spin = skew(&contact.spin_m_s);
        let rigid = skew(&(contact.velocity(self) - contact.spin_m_s));
        jacobian.fixed_view_mut::<3, 3>(0, ROTATION).copy_from(&-(rigid + spin * about_vertical));
        jacobian.fixed_view_mut::<3, 3>(0, VELOCITY).fill_with_identity();
        jacobian
            .fixed_view_mut::<3, 3>(0, RATE)
            .copy_from(&-(skew(&contact.lever_m) * self.world_from_body));
        // The weight of a foot that slips, lands or does not touch decreases with its innovation.
        let expected = jacobian * self.covariance * jacobian.transpose() + covariance;
        let Some(expected) = expected.cholesky() else { return };
        let squares = innovation.dot(&expected.solve(&innovation));
        self.correct(&jacobian, &innovation, &(covariance * (squares / OUTLIER).max(1.0)));
    }

    fn correct(
        &mut self,
        jacobian: &MeasurementJacobian,
        innovation: &Vector3<f64>,
        covariance: &Matrix3<f64>,
    ) {
        let cross = self.covariance * jacobian.transpose();
        let Some(expected) = (jacobian * cross + covariance).cholesky() else { return };
        let gain = expected.solve(&cross.transpose()).transpose();
        let kept = SMatrix::<f64, ERRORS, ERRORS>::identity() - gain * jacobian;
        // Joseph's form keeps the covariance positive definite in spite of rounding.
        self.covariance =
            kept * self.covariance * kept.transpose() + gain * covariance * gain.transpose();
        let error = gain * innovation;
        let part = |of: usize| error.fixed_rows::<3>(of).into_owned();
        let turn = Rotation3::new(part(ROTATION)).into_inner();
        self.world_from_body = turn * self.world_from_body;
        // Keeps the matrix orthogonal in spite of rounding.
        let square = self.world_from_body.tr_mul(&self.world_from_body);
        self.world_from_body *= (Matrix3::identity() * 3.0 - square) * 0.5;
        self.velocity_m_s = turn * self.velocity_m_s + part(VELOCITY);
        self.rate_rad_s += part(RATE);
        self.gyro_bias_rad_s += part(BIAS);
    }

    /// Angular velocity in world axes, rad/s.
    pub fn angular_velocity_rad_s(&self) -> Vector3<f64> {
        self.world_from_body * self.rate_rad_s
    }

    /// True if estimate and covariance are finite.
    pub fn is_finite(&self) -> bool {
        let vectors = [self.velocity_m_s, self.rate_rad_s, self.gyro_bias_rad_s];
        let mut all = vectors.iter().flatten().chain(&self.world_from_body).chain(&self.covariance);
        all.all(|value| value.is_finite())
    }
}

/// Contact from forward kinematics, in world axes.
#[derive(Clone, Copy, Debug)]
pub struct ContactKinematics {
    /// Vector from the base origin to the contact, m.
    pub lever_m: Vector3<f64>,
    /// Velocity of the material at the contact due to the joints alone, m/s.
    pub by_joints_m_s: Vector3<f64>,
    /// Velocity of the material due to the spin of the wheel alone, m/s.
    pub spin_m_s: Vector3<f64>,
}

impl ContactKinematics {
    /// Estimated velocity of the material in world axes, m/s.
    pub fn velocity(&self, filter: &Filter) -> Vector3<f64> {
        let by_base = filter.velocity_m_s + filter.angular_velocity_rad_s().cross(&self.lever_m);
        by_base + self.by_joints_m_s + self.spin_m_s
    }
}
