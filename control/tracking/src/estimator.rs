//! State estimation: pose and velocity of a robot from its IMU, its encoders and the feet that touch the ground.
//!
//! An extended Kalman filter integrates gyro and accelerometer. The zero velocity of the material at each contact corrects
//! velocity, tilt and gyro bias. This is contact-aided invariant filtering after Hartley, Ghaffari, Eustice and Grizzle
//! (*Contact-aided invariant extended Kalman filtering for robot state estimation*, 2020). Velocities of contacts replace their
//! positions, because wheels roll. Contacts are rim points ([`RimContact`]), and their velocity includes the spin of the wheel. A
//! blade has zero velocity only across itself.
//!
//! - **World** has z up. The ground below the contacts is z = 0: the base height follows the mean of the contacts that touch.
//!   It does not rise on ground that rises. The first alignment places the base origin at x = y = 0 with yaw 0; later ones keep
//!   position and yaw.
//! - **Position and yaw drift**, since neither is observable. The position drifts with the velocity error and the slip of feet,
//!   the yaw with the error of the gyro bias about the vertical. The bias is estimated within a second at rest, and within
//!   several seconds in motion.
//! - **Tilt** has the error of the accelerometer's bias, which is not estimated: 1 mrad for each 0.01 m/s².

mod filter;
mod rest;

use crate::absence::Absence;
use crate::plausible;
use crate::sensors::Sensors;
use filter::{ContactKinematics, Filter};
use nalgebra::{Matrix3, Matrix3xX, Vector3};
use rest::RestDetector;
use rollwalk_multibody::{
    ANGULAR, Configuration, JOINTS, Kinematics, LINEAR, RimContact, State, Tree, rotation,
};
use std::error::Error;
use std::fmt;

/// White noise of joint and wheel speeds, rad/s.
const SPEED_RAD_S: f64 = 0.05;
/// Standard deviation of the velocity of the material at a contact, m/s: contacts yield and creep.
///
/// This value is larger than the actual velocity, because errors of the velocity persist over many ticks, whereas the filter
/// assumes independent errors.
const SLIP_M_S: f64 = 0.1;
/// Standard deviation of the velocity along a blade, m/s. So large that the measurement contains no information.
const GLIDE_M_S: f64 = 100.0;
/// Time constant with which the base height follows the contacts, s. The lag prevents a jump at touch-down.
const HEIGHT_S: f64 = 0.04;
/// Longest time without an IMU or with bad readings, s.
const WITHOUT_IMU_S: f64 = 0.05;
/// Longest flight, s.
const WITHOUT_CONTACT_S: f64 = 0.5;
/// Largest mean velocity of the material at the slowest contact, m/s. Shipped motions reach 0.01 m/s, or 0.05 m/s with slip at
/// touch-down (`flying_trot`).
const TOO_FAST_M_S: f64 = 0.1;
/// Time constant of the mean contact velocity, s.
const SLIP_S: f64 = 0.2;
/// Largest gyro bias, rad/s. A working gyro has less.
const TOO_BIASED_RAD_S: f64 = 0.1;
/// Slope of the steepest line through two contacts (22°).
const TOO_STEEP: f64 = 0.4;
/// Height difference between two contacts that is allowed for any slope, m.
const STEP_M: f64 = 0.05;
/// Longest time for which contacts may be steeper, s.
const STEEP_S: f64 = 0.1;
/// Largest difference between two gyro samples at any interval, rad/s.
const JUMP_RAD_S: f64 = 5.0;
/// Largest difference between two gyro samples per time between them, rad/s². A body of several kilograms does not accelerate
/// faster.
const JUMP_RAD_S2: f64 = 2500.0;
/// Duration of rest before an alignment, and before zero angular velocity is used as a measurement, s.
const REST_S: f64 = 0.4;
/// Largest mean gyro reading minus bias at which zero angular velocity is used as a measurement, rad/s.
const STILL_RAD_S: f64 = 0.02;

/// Reason why an estimate must not be used. The controller has to bring the robot to a safe state without it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EstimateError {
    /// Reading or tick duration that is not finite or out of range, an angle far beyond its joint's range, or a jump of the
    /// gyro.
    ///
    /// The tick counts as one without IMU and contacts, and the next one may be good. Bad ticks for 0.05 s, or in a third of
    /// the time, lose the alignment.
    BadSensor,
    /// Robot that has not stood still since the start or since one of the errors below. Only rest aligns the estimate again.
    NotAligned,
    /// Gyro or accelerometer that is missing for more than 0.05 s. Samples may be rarer than ticks.
    ImuMissing,
    /// Contacts that are missing for more than 0.5 s.
    NoContact,
    /// Contradiction between IMU and contacts.
    ///
    /// Limits, one of which is exceeded: 0.1 m/s for the mean estimated velocity of the material at every contact over 0.2 s,
    /// 0.1 rad/s for the estimated gyro bias, and 22° for the slope of the line through two contacts for 0.1 s. Possible causes
    /// are a wrong tilt or velocity, a false contact, or slip of all feet.
    Contradiction,
}

impl fmt::Display for EstimateError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::BadSensor => {
                "a sensor reading is not finite or is out of range, or the gyro \
                reading jumps"
            }
            Self::NotAligned => "the robot has not stood still yet",
            Self::ImuMissing => "the IMU is missing",
            Self::NoContact => "no end effector touches the ground",
            Self::Contradiction => "the IMU contradicts the contacts",
        })
    }
}

impl Error for EstimateError {}

/// State estimator of one robot.
#[derive(Clone, Debug)]
pub struct Estimator {
    tree: Tree,
    kinematics: Kinematics,
    jacobian: Matrix3xX<f64>,
    filter: Filter,
    state: State,
    rest: RestDetector,
    is_aligned: bool,
    /// Previous gyro sample, and previous accepted gyro sample, rad/s.
    gyros_rad_s: [Option<Vector3<f64>>; 2],
    /// Time since the previous gyro sample, s.
    since_gyro_s: f64,
    /// Timer of bad readings.
    bad: Absence,
    without_imu_s: f64,
    without_contact_s: f64,
    steep_s: f64,
    /// Low-passed velocity of the material at the slowest contact, m/s.
    slip_m_s: Vector3<f64>,
}

impl Estimator {
    /// Creates an estimator that aligns itself within a second of rest.
    ///
    /// If the robot has wheels, `tree` has spinning wheels ([`Tree::with_spinning_wheels`]).
    pub fn new(tree: Tree) -> Self {
        let state = State::nominal(&tree);
        let zero = Vector3::zeros();
        Self {
            kinematics: Kinematics::new(&tree, &state.configuration()),
            jacobian: Matrix3xX::zeros(tree.dofs()),
            filter: Filter::new(Matrix3::identity(), zero, zero, zero),
            state,
            rest: RestDetector::new(tree.dofs() - JOINTS),
            is_aligned: false,
            gyros_rad_s: [None; 2],
            since_gyro_s: 0.0,
            bad: Absence::default(),
            without_imu_s: 0.0,
            without_contact_s: 0.0,
            steep_s: 0.0,
            slip_m_s: zero,
            tree,
        }
    }

    /// Starts from a known state with an accuracy of 10 mrad and 20 mm/s, and the ground at z = 0.
    ///
    /// # Errors
    /// Returns an error if the state is not finite. The estimator is then unchanged.
    ///
    /// # Panics
    /// Panics if the state is for another robot.
    pub fn align(&mut self, state: &State) -> Result<(), EstimateError> {
        let (joints, dofs) = (self.state.joint_rad.len(), self.tree.dofs());
        let lengths = (state.joint_rad.len(), state.velocity.len());
        assert_eq!(lengths, (joints, dofs), "a state of another robot");
        let part = |of: usize| Vector3::from_column_slice(&state.velocity[of..of + 3]);
        let rate = state.world_from_body.tr_mul(&part(ANGULAR));
        let bias = self.filter.gyro_bias_rad_s;
        let filter = Filter::new(state.world_from_body, part(LINEAR), rate, bias);
        let others = state.base_position_m.iter().chain(&state.joint_rad).chain(&state.velocity);
        if !filter.is_finite() || !others.into_iter().all(|value| value.is_finite()) {
            return Err(EstimateError::BadSensor);
        }
        self.state.base_position_m = state.base_position_m;
        self.state.joint_rad.copy_from_slice(&state.joint_rad);
        self.state.velocity.copy_from_slice(&state.velocity);
        self.begin(filter);
        self.write();
        Ok(())
    }

    /// Model of the robot.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Previous estimate, trusted or not; always finite.
    pub fn state(&self) -> &State {
        &self.state
    }

    /// Estimated gyro bias, body axes, rad/s.
    pub fn gyro_bias_rad_s(&self) -> Vector3<f64> {
        self.filter.gyro_bias_rad_s
    }

    /// Estimates the state from sensors that were sampled `tick_s` after those of the previous tick.
    ///
    /// Without an IMU the filter predicts at constant velocity and angular velocity, and contacts correct the prediction.
    ///
    /// # Errors
    /// Returns the reason if the estimate must not be used.
    ///
    /// # Panics
    /// Panics if the sensors are for another robot: their slices have other lengths.
    pub fn tick(&mut self, sensors: &Sensors<'_>, tick_s: f64) -> Result<&State, EstimateError> {
        let lengths = (sensors.joint_rad.len(), sensors.speed_rad_s.len(), sensors.touches.len());
        let robot = self.tree.robot();
        let own = (robot.joints.len(), self.tree.dofs() - JOINTS, robot.end_effectors.len());
        assert_eq!(lengths, own, "sensors of another robot");
        if !(tick_s > 0.0 && tick_s.is_finite()) {
            return Err(EstimateError::BadSensor);
        }
        let is_good =
            plausible::sensors(self.tree.robot(), sensors) && !self.jumps(sensors, tick_s);
        let imu = sensors.gyro_rad_s.zip(sensors.accelerometer_m_s2).filter(|_| is_good);
        if imu.is_some() {
            self.without_imu_s = 0.0;
        } else if is_good {
            self.without_imu_s += tick_s;
        }
        let lost = if self.bad.tick(is_good, tick_s, WITHOUT_IMU_S) {
            Some(EstimateError::BadSensor)
        } else {
            let is_missing = self.without_imu_s.max(tick_s) > WITHOUT_IMU_S;
            is_missing.then_some(EstimateError::ImuMissing)
        };
        if let Some(why) = lost {
            self.rest.lasts_s = 0.0;
            return self.lose(why);
        }
        if is_good {
            self.state.joint_rad.copy_from_slice(sensors.joint_rad);
            self.state.velocity[JOINTS..].copy_from_slice(sensors.speed_rad_s);
        }
        if let Some((gyro_rad_s, force_m_s2)) = imu {
            self.rest.tick(&gyro_rad_s, &force_m_s2, sensors, tick_s);
        }
        let before = (self.filter, self.state.base_position_m);
        let mut verdict = match (self.is_aligned, is_good) {
            (true, true) => self.track(sensors, tick_s),
            (true, false) => {
                self.filter.predict(None, tick_s);
                self.state.base_position_m += self.filter.velocity_m_s * tick_s;
                Err(EstimateError::BadSensor)
            }
            (false, true) => self.align_at_rest(sensors.touches),
            (false, false) => Err(EstimateError::BadSensor),
        };
        if !self.filter.is_finite() || !self.state.base_position_m.iter().all(|x| x.is_finite()) {
            (self.filter, self.state.base_position_m) = before;
            verdict = Err(EstimateError::Contradiction);
        }
        self.write();
        match verdict {
            Ok(()) => Ok(&self.state),
            Err(EstimateError::BadSensor) => Err(EstimateError::BadSensor),
            Err(why) => self.lose(why),
        }
    }

    /// True if a gyro sample is far from both the previous sample and the previous accepted one.
    ///
    /// After a single wrong sample, the next one is near the accepted one. A lasting jump is accepted at its second sample.
    fn jumps(&mut self, sensors: &Sensors<'_>, tick_s: f64) -> bool {
        self.since_gyro_s += tick_s;
        let Some(gyro_rad_s) = sensors.gyro_rad_s else { return false };
        let most_rad_s = JUMP_RAD_S.max(JUMP_RAD_S2 * std::mem::take(&mut self.since_gyro_s));
        let is_near = |of: &Vector3<f64>| (gyro_rad_s - of).norm() < most_rad_s;
        let [last, read] = &mut self.gyros_rad_s;
        let jumps = read.is_some() && !last.iter().chain(read.iter()).any(is_near);
        *last = Some(gyro_rad_s);
        if !jumps {
            *read = Some(gyro_rad_s);
        }
        jumps
    }

    /// Advances an aligned estimator by one tick.
    fn track(&mut self, sensors: &Sensors<'_>, tick_s: f64) -> Result<(), EstimateError> {
        let velocity_before = self.filter.velocity_m_s;
        self.filter.predict(sensors.accelerometer_m_s2, tick_s);
        if let Some(gyro_rad_s) = &sensors.gyro_rad_s {
            self.filter.measure_gyro(gyro_rad_s);
            // A gyro shows a slow start of motion earlier than the mean joint speeds do.
            let turning_rad_s = (self.rest.gyro_rad_s - self.filter.gyro_bias_rad_s).norm();
            if self.rest.lasts_s > REST_S && turning_rad_s < STILL_RAD_S {
                self.filter.measure_stillness();
            }
        }
        self.move_joints();
        let (mut count, mut height_m) = (0.0, 0.0);
        let mut slowest_m_s: Option<Vector3<f64>> = None;
        for end_effector in touching(sensors.touches) {
            let Some((contact, covariance, slip_m_s)) = self.contact(end_effector) else {
                continue;
            };
            self.filter.measure_contact(&contact, &covariance);
            count += 1.0;
            height_m -= contact.lever_m.z;
            if slowest_m_s.is_none_or(|slowest| slip_m_s.norm() < slowest.norm()) {
                slowest_m_s = Some(slip_m_s);
            }
        }
        let position = &mut self.state.base_position_m;
        *position += (velocity_before + self.filter.velocity_m_s) * (tick_s / 2.0);
        if count > 0.0 {
            position.z += (height_m / count - position.z) * (tick_s / HEIGHT_S).min(1.0);
            self.without_contact_s = 0.0;
        } else {
            self.without_contact_s += tick_s;
        }
        if let Some(slip_m_s) = slowest_m_s {
            self.slip_m_s += (slip_m_s - self.slip_m_s) * (tick_s / SLIP_S).min(1.0);
        }
        let is_too_steep = self.is_too_steep(sensors.touches);
        self.steep_s = if is_too_steep { self.steep_s + tick_s } else { 0.0 };
        if self.without_contact_s > WITHOUT_CONTACT_S {
            Err(EstimateError::NoContact)
        } else if self.steep_s > STEEP_S
            || self.slip_m_s.norm() > TOO_FAST_M_S
            || self.filter.gyro_bias_rad_s.norm() > TOO_BIASED_RAD_S
        {
            Err(EstimateError::Contradiction)
        } else {
            Ok(())
        }
    }

    /// Initialises tilt and gyro bias with the mean IMU readings of a robot at rest, and the height with its contacts.
    fn align_at_rest(&mut self, touches: &[bool]) -> Result<(), EstimateError> {
        if self.rest.lasts_s <= REST_S {
            return Err(EstimateError::NotAligned);
        }
        let up = self.rest.force_m_s2.normalize();
        let there = &self.state.world_from_body;
        let yaw_rad = there[(1, 0)].atan2(there[(0, 0)]);
        let (pitch_rad, roll_rad) = (-up.x.clamp(-1.0, 1.0).asin(), up.y.atan2(up.z));
        let ypr_rad = Vector3::new(yaw_rad, pitch_rad, roll_rad);
        let world_from_body = rotation::from_yaw_pitch_roll(&ypr_rad);
        let zero = Vector3::zeros();
        let filter = Filter::new(world_from_body, zero, zero, self.rest.gyro_rad_s);
        let before = std::mem::replace(&mut self.filter, filter);
        self.move_joints();
        if self.is_too_steep(touches) {
            self.filter = before;
            return Err(EstimateError::Contradiction);
        }
        let (mut count, mut height_m) = (0.0, 0.0);
        for end_effector in touching(touches) {
            if let Some((contact, ..)) = self.contact(end_effector) {
                count += 1.0;
                height_m -= contact.lever_m.z;
            }
        }
        if count == 0.0 {
            self.filter = before;
            return Err(EstimateError::NoContact);
        }
        self.state.base_position_m.z = height_m / count;
        self.begin(filter);
        Ok(())
    }

    fn begin(&mut self, filter: Filter) {
        self.filter = filter;
        self.is_aligned = true;
        self.bad = Absence::default();
        (self.without_imu_s, self.without_contact_s, self.steep_s) = (0.0, 0.0, 0.0);
        self.slip_m_s.fill(0.0);
    }

    fn lose(&mut self, why: EstimateError) -> Result<&State, EstimateError> {
        self.is_aligned = false;
        Err(why)
    }

    /// Updates the kinematics for a base at rest at the origin, with the estimated rotation.
    fn move_joints(&mut self) {
        let Self { tree, kinematics, filter, state, .. } = self;
        state.velocity[..JOINTS].fill(0.0);
        let at = Configuration {
            base_position_m: Vector3::zeros(),
            world_from_body: filter.world_from_body,
            joint_rad: &state.joint_rad,
        };
        kinematics.update(tree, &at, &state.velocity);
    }

    /// Contact of an end effector, covariance of the velocity of its material, and estimated velocity, m/s, without the
    /// component along a blade.
    ///
    /// `None` if a wheel lies flat.
    fn contact(
        &mut self,
        end_effector: usize,
    ) -> Option<(ContactKinematics, Matrix3<f64>, Vector3<f64>)> {
        let Self { tree, kinematics, jacobian, state, filter, .. } = self;
        let rim = RimContact::new(tree, &kinematics.frames, end_effector, &Vector3::z())?;
        let spin_m_s = rim
            .wheel_dof
            .map_or(Vector3::zeros(), |dof| rim.axis.cross(&rim.lever) * state.velocity[dof]);
        let contact = ContactKinematics {
            lever_m: rim.position(),
            by_joints_m_s: rim.motion(kinematics).material_velocity - spin_m_s,
            spin_m_s,
        };
        rim.material_jacobian(tree, &kinematics.frames, jacobian);
        let by_speeds = jacobian.columns_range(JOINTS..);
        let mut covariance = Matrix3::identity() * SLIP_M_S.powi(2);
        for column in by_speeds.column_iter() {
            covariance += column * column.transpose() * SPEED_RAD_S.powi(2);
        }
        let mut slip_m_s = contact.velocity(filter);
        let is_blade = tree.robot().end_effectors[end_effector].contact.blade_length_m().is_some();
        let along = rim.axis.cross(&Vector3::z()).try_normalize(1e-9).filter(|_| is_blade);
        if let Some(along) = along {
            covariance += along * along.transpose() * GLIDE_M_S.powi(2);
            slip_m_s -= along * along.dot(&slip_m_s);
        }
        Some((contact, covariance, slip_m_s))
    }

    /// True if the line through two contacts is too steep.
    fn is_too_steep(&self, touches: &[bool]) -> bool {
        let frames = &self.kinematics.frames;
        let point = |end_effector: usize| {
            RimContact::new(&self.tree, frames, end_effector, &Vector3::z())
                .map(|rim| rim.position())
        };
        touching(touches).filter_map(point).any(|one| {
            touching(touches).filter_map(point).any(|other| {
                let apart = other - one;
                apart.z > STEP_M + TOO_STEEP * apart.xy().norm()
            })
        })
    }

    fn write(&mut self) {
        let Self { filter, state, .. } = self;
        state.world_from_body = filter.world_from_body;
        let turning = filter.angular_velocity_rad_s();
        state.velocity[LINEAR..ANGULAR].copy_from_slice(filter.velocity_m_s.as_slice());
        state.velocity[ANGULAR..JOINTS].copy_from_slice(turning.as_slice());
    }
}

fn touching(touches: &[bool]) -> impl Iterator<Item = usize> + '_ {
    (0..touches.len()).filter(|&end_effector| touches[end_effector])
}

#[cfg(test)]
mod tests;
