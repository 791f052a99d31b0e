//! Tests of the estimator with known motions: at rest, swaying on standing feet, in flight; and with broken sensors.

use super::*;
use fastrand::Rng;
use nalgebra::{DMatrix, DVector, Rotation3};
use proptest::prelude::*;
use rollwalk_robot::{GRAVITY_M_S2, Robot};
use std::fs;

const TICK_S: f64 = 0.002;
/// Robots with driven wheels, feet, wheels that turn freely, and blades.
const ROBOTS: [&str; 4] = ["anymal_wheels", "pup", "swizzlebot", "skatebot"];

fn tree(name: &str) -> Tree {
    let path = format!("{}/../../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    let robot = Robot::from_toml(name, &fs::read_to_string(path).unwrap()).unwrap();
    Tree::new(&robot).with_spinning_wheels(|_| 5e-6)
}

/// True motion of a robot, from which its sensor readings follow.
#[derive(Clone)]
struct Truth {
    tree: Tree,
    state: State,
    acceleration_m_s2: Vector3<f64>,
    gyro_bias_rad_s: Vector3<f64>,
    touches: Vec<bool>,
    random: Rng,
    noise: f64,
}

impl Truth {
    /// Creates a robot at rest on all end effectors, with a rotated base and without noise.
    fn at_rest(name: &str, turn: Vector3<f64>) -> Self {
        let tree = tree(name);
        let mut state = State::nominal(&tree);
        state.world_from_body = Rotation3::new(turn).into_inner();
        let touches = vec![true; tree.robot().end_effectors.len()];
        let (zero, random) = (Vector3::zeros(), Rng::with_seed(1));
        let [acceleration_m_s2, gyro_bias_rad_s] = [zero, zero];
        Self { tree, state, acceleration_m_s2, gyro_bias_rad_s, touches, random, noise: 0.0 }
    }

    fn force_m_s2(&self) -> Vector3<f64> {
        let force = self.acceleration_m_s2 + Vector3::z() * GRAVITY_M_S2;
        self.state.world_from_body.tr_mul(&force)
    }

    fn gyro_rad_s(&self) -> Vector3<f64> {
        let turning = Vector3::from_column_slice(&self.state.velocity[ANGULAR..JOINTS]);
        self.state.world_from_body.tr_mul(&turning) + self.gyro_bias_rad_s
    }

    /// Runs a tick with correct sensors and uniform noise, after `change` has modified them.
    fn tick<'e>(
        &mut self,
        estimator: &'e mut Estimator,
        change: impl FnOnce(&mut Sensors<'_>),
    ) -> Result<&'e State, EstimateError> {
        let speeds = self.state.velocity[JOINTS..].to_vec();
        let (gyro, force) = (self.gyro_rad_s(), self.force_m_s2());
        // Even noise of this width has a standard deviation of 1.
        let mut noise =
            |deviation: f64| self.noise * deviation * 12_f64.sqrt() * (self.random.f64() - 0.5);
        let speeds: Vec<f64> = speeds.iter().map(|speed| speed + noise(0.05)).collect();
        let mut sensors = Sensors {
            gyro_rad_s: Some(gyro.map(|rate| rate + noise(0.02))),
            accelerometer_m_s2: Some(force.map(|force| force + noise(0.1))),
            joint_rad: &self.state.joint_rad,
            speed_rad_s: &speeds,
            touches: &self.touches,
        };
        change(&mut sensors);
        estimator.tick(&sensors, TICK_S)
    }

    /// Runs ticks for some seconds and returns the result of the final one.
    fn ticks(&mut self, estimator: &mut Estimator, seconds: f64) -> Result<(), EstimateError> {
        let count = (seconds / TICK_S).round() as usize;
        (0..count).map(|_| self.tick(estimator, |_| {}).map(|_| ())).last().unwrap_or(Ok(()))
    }

    /// Creates an estimator that has been aligned at rest.
    fn aligned(&mut self) -> Estimator {
        let mut estimator = Estimator::new(self.tree.clone());
        self.ticks(&mut estimator, 1.0).unwrap();
        estimator
    }

    /// Advances the truth by a tick. The base has the given velocities in world axes, and joints and wheels move so that all
    /// contacts stand still.
    fn sway(&mut self, velocity_m_s: Vector3<f64>, turning_rad_s: Vector3<f64>) {
        let last = Vector3::from_column_slice(&self.state.velocity[LINEAR..ANGULAR]);
        self.acceleration_m_s2 = (velocity_m_s - last) / TICK_S;
        let middle = (velocity_m_s + last) / 2.0;
        let tree = &self.tree;
        let frames = rollwalk_multibody::Frames::new(tree, &self.state.configuration());
        let (dofs, feet) = (tree.dofs(), self.touches.len());
        let mut stacked = DMatrix::zeros(3 * feet, dofs);
        let mut jacobian = Matrix3xX::zeros(dofs);
        for j in 0..feet {
            let rim = RimContact::new(tree, &frames, j, &Vector3::z()).unwrap();
            rim.material_jacobian(tree, &frames, &mut jacobian);
            stacked.rows_mut(3 * j, 3).copy_from(&jacobian);
        }
        let base =
            DVector::from_iterator(JOINTS, velocity_m_s.iter().chain(&turning_rad_s).copied());
        let by_base = stacked.columns(0, JOINTS) * &base;
        let by_joints = stacked.columns(JOINTS, dofs - JOINTS).into_owned();
        let speeds = by_joints.clone().svd(true, true).solve(&-&by_base, 1e-6).unwrap();
        let slip_m_s = (by_base + by_joints * &speeds).amax();
        assert!(slip_m_s < 1e-6, "its joints cannot sway so: {slip_m_s}");
        self.state.velocity[..JOINTS].copy_from_slice(base.as_slice());
        self.state.velocity[JOINTS..].copy_from_slice(speeds.as_slice());
        self.state.base_position_m += middle * TICK_S;
        let turn = Rotation3::new(turning_rad_s * TICK_S).into_inner();
        self.state.world_from_body = turn * self.state.world_from_body;
        for (angle, speed) in self.state.joint_rad.iter_mut().zip(speeds.iter()) {
            *angle += speed * TICK_S;
        }
    }
}

fn tilt_rad(one: &State, other: &State) -> f64 {
    (one.world_from_body.row(2) - other.world_from_body.row(2)).norm()
}

fn velocity_m_s(state: &State) -> Vector3<f64> {
    Vector3::from_column_slice(&state.velocity[LINEAR..ANGULAR])
}

#[test]
fn at_rest_tilt_height_and_gyro_bias_are_found() {
    for name in ROBOTS {
        let mut truth = Truth::at_rest(name, Vector3::new(0.1, -0.15, 0.0));
        truth.gyro_bias_rad_s = Vector3::new(0.02, -0.03, 0.01);
        truth.noise = 1.0;
        let mut estimator = Estimator::new(truth.tree.clone());
        assert_eq!(truth.ticks(&mut estimator, 0.3), Err(EstimateError::NotAligned), "{name}");
        truth.ticks(&mut estimator, 2.0).unwrap();
        let state = estimator.state();
        let ypr = |yaw: f64| rotation::yaw_rotation(yaw) * state.world_from_body;
        let yaw = state.world_from_body[(1, 0)].atan2(state.world_from_body[(0, 0)]);
        let off = tilt_rad(&State { world_from_body: ypr(-yaw), ..state.clone() }, &truth.state);
        assert!(off < 2e-3, "{name}: {off}");
        let off = (estimator.gyro_bias_rad_s() - truth.gyro_bias_rad_s).norm();
        assert!(off < 2e-3, "{name}: {off}");
        assert!(velocity_m_s(state).norm() < 0.01, "{name}: {}", velocity_m_s(state));
        let frames = rollwalk_multibody::Frames::new(&truth.tree, &state.configuration());
        let feet = 0..truth.touches.len();
        let height_m: f64 = feet
            .map(|j| RimContact::new(&truth.tree, &frames, j, &Vector3::z()).unwrap().position().z)
            .sum();
        assert!(height_m.abs() < 1e-3, "{name}: {height_m}");
    }
}

#[test]
fn a_wrong_tilt_comes_right() {
    let mut truth = Truth::at_rest("anymal_wheels", Vector3::new(0.05, 0.03, 0.0));
    let mut estimator = Estimator::new(truth.tree.clone());
    estimator.align(&State::nominal(&truth.tree)).unwrap();
    truth.ticks(&mut estimator, 3.0).unwrap();
    let off = tilt_rad(estimator.state(), &truth.state);
    assert!(off < 1e-3, "{off}");
}

/// Tests flight, in which only the IMU measures the motion.
#[test]
fn a_constant_rotation_is_integrated() {
    let mut truth = Truth::at_rest("pup", Vector3::new(0.1, 0.0, 0.0));
    truth.touches.fill(false);
    truth.state.velocity[ANGULAR..JOINTS].copy_from_slice(&[1.0, -2.0, 3.0]);
    let mut estimator = Estimator::new(truth.tree.clone());
    estimator.align(&truth.state).unwrap();
    let turn = Rotation3::new(Vector3::new(1.0, -2.0, 3.0) * TICK_S).into_inner();
    for _ in 0..200 {
        truth.state.world_from_body = turn * truth.state.world_from_body;
        truth.tick(&mut estimator, |_| {}).unwrap();
    }
    let there = estimator.state().world_from_body * truth.state.world_from_body.transpose();
    // Rotation of 1.5 rad.
    assert!(rotation::log(&there).norm() < 1e-3, "{there}");
    assert!(velocity_m_s(estimator.state()).norm() < 0.01);
}

/// Tests a body that sways and turns above standing feet, without IMU for 20 ms out of every 100 ms.
#[test]
fn contacts_bridge_a_short_gap_of_the_imu() {
    for name in ["anymal_wheels", "legbot"] {
        for gap in [0, 10] {
            let mut truth = Truth::at_rest(name, Vector3::zeros());
            truth.noise = 1.0;
            let mut estimator = truth.aligned();
            truth.state.base_position_m = estimator.state().base_position_m;
            let (mut tilt, mut velocity): (f64, f64) = (0.0, 0.0);
            for k in 0..1000 {
                let phase = f64::from(k) * TICK_S * 6.0;
                let sway = Vector3::new(0.1 * phase.sin(), 0.05 * phase.sin(), 0.0);
                let turning = Vector3::new(0.2 * phase.cos(), -0.3 * phase.sin(), 0.05);
                truth.sway(sway, turning);
                let state = truth.tick(&mut estimator, |sensors| {
                    if k % 50 < gap {
                        (sensors.gyro_rad_s, sensors.accelerometer_m_s2) = (None, None);
                    }
                });
                let state = state.unwrap().clone();
                tilt = tilt.max(tilt_rad(&state, &truth.state));
                velocity = velocity.max((velocity_m_s(&state) - sway).norm());
            }
            let state = estimator.state();
            let off_m = (state.base_position_m - truth.state.base_position_m).norm();
            let (most_rad, most_m_s) = if gap == 0 { (0.006, 0.03) } else { (0.015, 0.06) };
            assert!(tilt < most_rad && velocity < most_m_s, "{name}: {tilt} {velocity}");
            assert!(off_m < 0.01, "{name}: {off_m}");
        }
    }
}

#[test]
fn a_long_gap_of_the_imu_is_an_error_until_the_robot_has_stood_still() {
    let drop_gyro = |sensors: &mut Sensors<'_>| sensors.gyro_rad_s = None;
    let drop_force = |sensors: &mut Sensors<'_>| sensors.accelerometer_m_s2 = None;
    for drop in [drop_gyro as fn(&mut Sensors<'_>), drop_force] {
        let mut truth = Truth::at_rest("anymal_wheels", Vector3::zeros());
        let mut estimator = truth.aligned();
        for k in 1..=100 {
            let verdict = truth.tick(&mut estimator, drop).map(|_| ());
            match k {
                0..25 => assert_eq!(verdict, Ok(()), "{k}"),
                25 => {} // 0.05 s, but for rounding
                _ => assert_eq!(verdict, Err(EstimateError::ImuMissing), "{k}"),
            }
        }
        assert_eq!(truth.ticks(&mut estimator, 0.3), Err(EstimateError::NotAligned));
        truth.ticks(&mut estimator, 0.3).unwrap();
    }
    // Short gaps do not delay an alignment.
    let mut truth = Truth::at_rest("anymal_wheels", Vector3::zeros());
    let mut estimator = Estimator::new(truth.tree.clone());
    for k in 0..500 {
        let _ = truth.tick(&mut estimator, |sensors| {
            if k % 10 == 0 {
                drop_gyro(sensors);
            }
        });
    }
    truth.tick(&mut estimator, |_| {}).unwrap();
    // A tick that is this long is also a gap.
    let mut truth = Truth::at_rest("anymal_wheels", Vector3::zeros());
    let mut estimator = truth.aligned();
    let sensors = Sensors {
        gyro_rad_s: Some(Vector3::zeros()),
        accelerometer_m_s2: Some(Vector3::z() * GRAVITY_M_S2),
        joint_rad: &truth.state.joint_rad,
        speed_rad_s: &truth.state.velocity[JOINTS..],
        touches: &truth.touches,
    };
    assert_eq!(estimator.tick(&sensors, 0.06), Err(EstimateError::ImuMissing));
    for bad in [0.0, -0.002, f64::NAN, f64::INFINITY] {
        assert_eq!(estimator.tick(&sensors, bad), Err(EstimateError::BadSensor));
    }
}

#[test]
fn a_long_flight_is_an_error() {
    let mut truth = Truth::at_rest("pup", Vector3::zeros());
    let mut estimator = truth.aligned();
    truth.touches.fill(false);
    truth.ticks(&mut estimator, 0.49).unwrap();
    let verdict = (0..10).find_map(|_| truth.tick(&mut estimator, |_| {}).err());
    assert_eq!(verdict, Some(EstimateError::NoContact));
    // Back on its feet, the robot aligns again.
    truth.touches.fill(true);
    assert_eq!(truth.ticks(&mut estimator, 0.3), Err(EstimateError::NotAligned));
    truth.ticks(&mut estimator, 0.3).unwrap();
}

/// Tests that a contradiction is detected within half a second on a robot that stands still.
#[test]
fn sensors_that_contradict_each_other_are_an_error() {
    let mut truth = Truth::at_rest("anymal_wheels", Vector3::zeros());
    let contradiction = Some(EstimateError::Contradiction);
    let (x, z) = (Vector3::x(), Vector3::z());
    let zero = Vector3::zeros();
    for (turns, force, expected) in [
        (zero, zero, None),
        (x, zero, contradiction),
        (z, zero, contradiction),
        (zero, x * 3.0, contradiction),
        // An accelerometer that measures nothing.
        (zero, z * -GRAVITY_M_S2, contradiction),
    ] {
        let mut estimator = truth.aligned();
        let verdict = (0..250).find_map(|_| {
            let tick = truth.tick(&mut estimator, |sensors| {
                sensors.gyro_rad_s = sensors.gyro_rad_s.map(|rate| rate + turns);
                sensors.accelerometer_m_s2 = sensors.accelerometer_m_s2.map(|of| of + force);
            });
            tick.err()
        });
        assert_eq!(verdict, expected, "{turns} {force}");
    }
    // Feet in swing that are reported as contacts.
    let mut estimator = truth.aligned();
    truth.state.velocity[JOINTS..].fill(3.0);
    let verdict = (0..250).find_map(|_| truth.tick(&mut estimator, |_| {}).err());
    assert_eq!(verdict, contradiction);
}

/// Tests a robot that lies on its side with closed contact switches: the estimator does not align.
#[test]
fn what_is_too_steep_to_stand_on_is_no_alignment() {
    let mut truth = Truth::at_rest("anymal_wheels", Vector3::new(0.8, 0.0, 0.0));
    let mut estimator = Estimator::new(truth.tree.clone());
    assert_eq!(truth.ticks(&mut estimator, 1.0), Err(EstimateError::Contradiction));
    truth.touches.fill(false);
    assert_eq!(truth.ticks(&mut estimator, 1.0), Err(EstimateError::NotAligned));
}

/// Replaces one sensor reading by a value.
fn spoil(sensors: &mut Sensors<'_>, at: usize, value: f64, angles: &mut [f64], speeds: &mut [f64]) {
    let imu = [&mut sensors.gyro_rad_s, &mut sensors.accelerometer_m_s2];
    let all = imu.into_iter().flat_map(|of| of.iter_mut().flat_map(|of| of.iter_mut()));
    let mut all: Vec<&mut f64> = all.chain(angles).chain(speeds).collect();
    let count = all.len();
    *all[at % count] = value;
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, ..ProptestConfig::default() })]

    /// Tests that finite sensor readings yield a finite state, trusted or not.
    #[test]
    fn whatever_is_measured_the_state_is_finite(
        robot in 0..ROBOTS.len(),
        seed: u64,
        size in -3.0..300.0_f64,
        aligned: bool,
    ) {
        let mut truth = Truth::at_rest(ROBOTS[robot], Vector3::zeros());
        let mut estimator = match aligned {
            true => truth.aligned(),
            false => Estimator::new(truth.tree.clone()),
        };
        let mut random = Rng::with_seed(seed);
        let size = 10_f64.powf(if random.bool() { size } else { size.min(3.0) });
        let (joints, speeds) = (truth.state.joint_rad.len(), truth.tree.dofs() - JOINTS);
        for _ in 0..40 {
            let mut any = || size * (2.0 * random.f64() - 1.0);
            let imu = [(); 2].map(|()| Vector3::from_fn(|_, _| any()));
            let angles: Vec<f64> = (0..joints).map(|_| any()).collect();
            let rates: Vec<f64> = (0..speeds).map(|_| any()).collect();
            let tick_s = any().abs().max(1e-9);
            let touches: Vec<bool> = truth.touches.iter().map(|_| random.bool()).collect();
            let sensors = Sensors {
                gyro_rad_s: Some(imu[0]).filter(|_| random.u8(..) > 20),
                accelerometer_m_s2: Some(imu[1]).filter(|_| random.u8(..) > 20),
                joint_rad: &angles,
                speed_rad_s: &rates,
                touches: &touches,
            };
            let _ = estimator.tick(&sensors, if random.bool() { tick_s } else { TICK_S });
            let state = estimator.state();
            let base = state.base_position_m.iter().chain(&state.world_from_body);
            let mut all = base.chain(&state.joint_rad).chain(&state.velocity);
            prop_assert!(all.all(|value| value.is_finite()), "{state:?}");
            let turn = state.world_from_body;
            prop_assert!((turn * turn.transpose() - Matrix3::identity()).amax() < 1e-9);
        }
    }

    /// Tests that NaN, infinity or a huge reading of any sensor is an error of its tick only. The next tick is as good as the
    /// previous one.
    #[test]
    fn what_is_no_number_spoils_one_tick(
        robot in 0..ROBOTS.len(),
        at: usize,
        bad in prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1e300]),
    ) {
        let mut truth = Truth::at_rest(ROBOTS[robot], Vector3::zeros());
        let mut estimator = truth.aligned();
        let before = estimator.state().clone();
        let mut angles = truth.state.joint_rad.clone();
        let mut speeds = truth.state.velocity[JOINTS..].to_vec();
        let mut sensors = Sensors {
            gyro_rad_s: Some(truth.gyro_rad_s()),
            accelerometer_m_s2: Some(truth.force_m_s2()),
            joint_rad: &[],
            speed_rad_s: &[],
            touches: &truth.touches,
        };
        spoil(&mut sensors, at, bad, &mut angles, &mut speeds);
        let sensors = Sensors { joint_rad: &angles, speed_rad_s: &speeds, ..sensors };
        prop_assert_eq!(estimator.tick(&sensors, TICK_S), Err(EstimateError::BadSensor));
        let after = truth.tick(&mut estimator, |_| {}).unwrap();
        prop_assert!((after.base_position_m - before.base_position_m).norm() < 1e-6);
        prop_assert!(tilt_rad(after, &before) < 1e-6);
        let speeds = after.velocity.iter().zip(&before.velocity);
        prop_assert!(speeds.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max) < 1e-3);
    }
}
