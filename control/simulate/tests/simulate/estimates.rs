//! Tests of the state estimator on shipped motions, with noisy sensors of the simulated world.

use crate::plan;
use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use rollwalk_multibody::State;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::Plan;
use rollwalk_planner::whole_body::WholeBody;
use rollwalk_simulate::{Control, Noise, Options, SimulatedSensors, play};
use rollwalk_tracking::{EstimateError, Estimator, Sensors};

/// Largest errors of the trusted estimates.
#[derive(Debug, Default)]
struct Errors {
    count: u32,
    tilt_rad: f64,
    velocity_m_s: f64,
    /// Horizontal position error, m.
    position_m: f64,
    /// Vertical position error, m.
    height_m: f64,
    yaw_rad: f64,
    /// Length of the path of the base, m.
    way_m: f64,
    /// First rejected estimate after the alignment, and its time, s.
    untrusted: Option<(EstimateError, f64)>,
}

/// Plays a plan in open loop for two periods, with the noise of MEMS gyros and encoders, until an estimate is not trusted.
///
/// A finite motion begins with a rest, in which the estimator aligns itself. The start of a periodic motion is known.
fn errors(plan: &Plan, mut change: impl FnMut(f64, &mut Sensors<'_>, &mut [bool])) -> Errors {
    let tree = WholeBody::new(plan).tree().clone();
    let mut sensors = SimulatedSensors::new(tree.clone(), Noise::USUAL, 1);
    let mut estimator = Estimator::new(tree.clone());
    let options = Options { cycles: 2, ..Options::new(Control::FeedForward, 500) };
    let (mut last_s, mut last_m) = (0.0, None);
    // Axes of the world relative to the axes of an alignment at rest.
    let mut world_from_estimate = None;
    let mut errors = Errors::default();
    let outcome = play(plan, &options, |moment| {
        let step_s = moment.done_s - last_s;
        last_s = moment.done_s;
        let truth = moment.world.state(&tree);
        let mut sample = sensors.sample(moment.world, step_s);
        let mut touches = sample.touches.to_vec();
        if plan.motion.ends == Ends::Periodic && world_from_estimate.is_none() {
            estimator.align(&truth).unwrap();
            world_from_estimate = Some(Isometry3::identity());
            return true;
        }
        change(moment.done_s, &mut sample, &mut touches);
        match estimator.tick(&Sensors { touches: &touches, ..sample }, step_s) {
            Ok(state) => {
                let there = world_from_estimate.get_or_insert_with(|| between(state, &truth));
                let way = truth.base_position_m - *last_m.get_or_insert(truth.base_position_m);
                last_m = Some(truth.base_position_m);
                errors.add(&state.clone().moved(there), &truth, way.xy().norm());
                true
            }
            Err(EstimateError::BadSensor) => true,
            Err(_) if world_from_estimate.is_none() => true,
            Err(why) => {
                errors.untrusted = Some((why, moment.done_s));
                false
            }
        }
    });
    assert_eq!(outcome.unwrap().fell_at_s, None);
    errors.tilt_rad = (errors.tilt_rad / f64::from(errors.count)).sqrt();
    errors.velocity_m_s = (errors.velocity_m_s / f64::from(errors.count)).sqrt();
    errors
}

fn yaw_rad(state: &State) -> f64 {
    state.world_from_body[(1, 0)].atan2(state.world_from_body[(0, 0)])
}

/// Turn and horizontal shift from one state to another.
fn between(from: &State, to: &State) -> Isometry3<f64> {
    let yaw_rad = yaw_rad(to) - yaw_rad(from);
    let turn = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), yaw_rad);
    let mut shift = to.base_position_m - turn * from.base_position_m;
    shift.z = 0.0;
    Isometry3::from_parts(Translation3::from(shift), turn)
}

impl Errors {
    fn add(&mut self, estimate: &State, truth: &State, way_m: f64) {
        let up = |state: &State| state.world_from_body.row(2).transpose();
        let velocity = |state: &State| Vector3::from_column_slice(&state.velocity[..3]);
        let off = estimate.base_position_m - truth.base_position_m;
        let yaw_rad = yaw_rad(estimate) - yaw_rad(truth);
        self.count += 1;
        self.tilt_rad += (up(estimate) - up(truth)).norm_squared();
        self.velocity_m_s += (velocity(estimate) - velocity(truth)).norm_squared();
        self.position_m = self.position_m.max(off.xy().norm());
        self.height_m = self.height_m.max(off.z.abs());
        self.yaw_rad = self.yaw_rad.max(yaw_rad.sin().abs());
        self.way_m += way_m;
    }
}

#[test]
fn noisy_sensors_give_the_state_of_robots_that_drive_turn_and_trot() {
    for (robot, motion) in
        [("anymal_wheels", "anymal_drive"), ("anymal_wheels", "anymal_turn"), ("agilebot", "trot")]
    {
        let errors = errors(&plan(robot, motion), |_, _, _| {});
        assert_eq!(errors.untrusted, None, "{motion}: {errors:?}");
        assert!(errors.tilt_rad < 0.004 && errors.velocity_m_s < 0.01, "{motion}: {errors:?}");
        // A turn in place has no distance.
        let most_m = if motion == "anymal_turn" { 0.02 } else { 0.05 * errors.way_m };
        assert!(errors.position_m < most_m && errors.height_m < 0.005, "{motion}: {errors:?}");
        assert!(errors.yaw_rad < 0.03, "{motion}: {errors:?}");
    }
}

/// Tests faults on a trot, whose feet touch down and lift off all the time.
#[test]
fn faults_are_bridged_or_found() {
    let plan = plan("agilebot", "trot");
    const FAULT_S: f64 = 0.4;
    // No IMU for 20 ms of every 100 ms; a contact switch that is stuck closed or open.
    let gaps = errors(&plan, |time_s, sensors, _| {
        if time_s % 0.1 < 0.02 {
            (sensors.gyro_rad_s, sensors.accelerometer_m_s2) = (None, None);
        }
    });
    // An IMU at half of the tick rate.
    let mut reads = false;
    let slow = errors(&plan, |_, sensors, _| {
        reads = !reads;
        if !reads {
            (sensors.gyro_rad_s, sensors.accelerometer_m_s2) = (None, None);
        }
    });
    assert_eq!(slow.untrusted, None, "{slow:?}");
    let stuck = |value: bool| errors(&plan, |_, _, touches| touches[0] = value);
    // One wrong sample.
    let once = |gyro_rad_s: f64, force_m_s2: f64| {
        let mut is_over = false;
        errors(&plan, |time_s, sensors, _| {
            if time_s > FAULT_S && !std::mem::replace(&mut is_over, true) {
                sensors.gyro_rad_s = sensors.gyro_rad_s.map(|of| of.add_scalar(gyro_rad_s));
                sensors.accelerometer_m_s2 =
                    sensors.accelerometer_m_s2.map(|of| of.add_scalar(force_m_s2));
            }
            is_over |= time_s > FAULT_S;
        })
    };
    let spikes = [once(5.0, 0.0), once(50.0, 0.0), once(0.0, 60.0), once(0.0, 500.0)];
    for errors in spikes.into_iter().chain([gaps, stuck(true), stuck(false)]) {
        assert_eq!(errors.untrusted, None, "{errors:?}");
        assert!(errors.tilt_rad < 0.01 && errors.velocity_m_s < 0.02, "{errors:?}");
    }
    let fault = |after: &dyn Fn(&mut Sensors<'_>, &mut [bool])| {
        let errors = errors(&plan, |time_s, sensors, touches| {
            if time_s > FAULT_S {
                after(sensors, touches);
            }
        });
        let (why, at_s) = errors.untrusted.expect("the fault is found");
        (why, at_s - FAULT_S)
    };
    let (why, after_s) = fault(&|sensors, _| sensors.gyro_rad_s = None);
    assert!(why == EstimateError::ImuMissing && after_s < 0.06, "{why} {after_s}");
    let (why, after_s) = fault(&|_, touches| touches.fill(false));
    assert!(why == EstimateError::NoContact, "{why} {after_s}");
    for (gyro, force) in [(1.0, 0.0), (0.0, 3.0)] {
        let (why, after_s) = fault(&|sensors, _| {
            sensors.gyro_rad_s = sensors.gyro_rad_s.map(|rate| rate.add_scalar(gyro));
            sensors.accelerometer_m_s2 = sensors.accelerometer_m_s2.map(|of| of.add_scalar(force));
        });
        assert!(why == EstimateError::Contradiction && after_s < 0.5, "{why} {after_s}");
    }
}
