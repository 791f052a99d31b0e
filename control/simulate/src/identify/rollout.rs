//! Simulation of a recorded run, and its residuals.

use super::quantity::{Quantity, SimulationModel};
use super::recording::Recording;
use super::start::Start;
use crate::script::servo;
use nalgebra::{DMatrix, Vector3};
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::World;
use rollwalk_physics::motor::{Law, Motor};
use rollwalk_physics::sensitivity::parameter::Parameter;
use rollwalk_physics::sensitivity::{Recorder, Residual, Rollout};
use rollwalk_physics::world::FallWatch;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Kind of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Signal {
    /// Angle of a joint, rad.
    Joint,
    /// Angle of a driven wheel, rad.
    Wheel,
    /// Speed of a motor whose angle was not measured, rad/s.
    Speed,
    /// Position of the body, m.
    Position,
    /// Orientation of the body, rad.
    Orientation,
    /// Angular velocity of the body, rad/s.
    Gyro,
}

impl Signal {
    /// List of all signals.
    pub const ALL: [Self; 6] =
        [Self::Joint, Self::Wheel, Self::Speed, Self::Position, Self::Orientation, Self::Gyro];

    /// Description and unit.
    pub fn label(self) -> (&'static str, &'static str) {
        match self {
            Self::Joint => ("angles of joints", "rad"),
            Self::Wheel => ("angles of wheels", "rad"),
            Self::Speed => ("speeds of motors", "rad/s"),
            Self::Position => ("position of the body", "m"),
            Self::Orientation => ("orientation", "rad"),
            Self::Gyro => ("turning rate", "rad/s"),
        }
    }

    /// Initial and smallest standard deviation of the noise. The smallest is that of values in single precision.
    pub(super) fn noise(self) -> [f64; 2] {
        match self {
            Self::Joint | Self::Wheel | Self::Orientation => [2e-3, 1e-4],
            Self::Position => [2e-3, 1e-4],
            Self::Speed | Self::Gyro => [2e-2, 1e-3],
        }
    }
}

/// Standard deviations of the measurements, in the order of [`Signal::ALL`].
pub(super) type Noise = [f64; 6];

/// Recording on a grid of steps, ready to be simulated.
#[derive(Clone, Debug)]
pub(super) struct Replay {
    pub recording: Arc<Recording>,
    pub start: Start,
    pub step_s: f64,
    /// Number of simulation steps per grid step.
    pub parts: usize,
    /// Number of grid steps of the whole recording.
    pub steps: usize,
    pub ground: Arc<dyn Ground>,
}

#[derive(Clone, Debug)]
pub(super) struct MeasurementResidual {
    pub signal: Signal,
    /// Index within the signal, such as the channel or the axis.
    pub number: usize,
    pub step: usize,
    pub residual: Residual,
}

#[derive(Debug)]
pub(super) struct SimulatedRun {
    rollout: Rollout,
    misses: Vec<MeasurementResidual>,
    /// Derivatives of the rollout that make up each search parameter: indices and factors.
    columns: Vec<Vec<(usize, f64)>>,
}

impl Replay {
    /// Simulates the first steps, with derivatives with respect to `quantities`, and to the start state if `by_start` is true.
    ///
    /// Returns `None` if the robot falls or a step has no solution.
    pub fn play(
        &self,
        model: &SimulationModel,
        changes: &[f64],
        quantities: &[Quantity],
        by_start: bool,
        steps: usize,
    ) -> Option<SimulatedRun> {
        let mut world = self.start.world(model, changes, &self.ground);
        let mut fall_watch = FallWatch::new(&world, &self.ground);
        let begin_s = self.recording.span_s[0];
        let mut parameters: Vec<Box<dyn Parameter>> = Vec::new();
        let mut columns = Vec::new();
        for quantity in quantities {
            let factor = quantity.by_parameter(quantity.value(model));
            let mut places = Vec::new();
            for (parameter, share) in quantity.parameters(&world, model, &self.recording, begin_s) {
                places.push((parameters.len(), share * factor));
                parameters.push(parameter);
            }
            columns.push(places);
        }
        if by_start {
            for parameter in self.start.parameters(model, changes, &self.ground) {
                columns.push(vec![(parameters.len(), 1.0)]);
                parameters.push(parameter);
            }
        }
        let mut recorder = Recorder::new(world.system(), parameters);
        let servos: Vec<Law> = model.robot.channels().map(|channel| servo(&channel)).collect();
        let part_s = self.step_s / self.parts as f64;
        for part in 1..=steps * self.parts {
            let time_s = begin_s + part as f64 * part_s - model.delay_s;
            for (channel, (servo, drive)) in servos.iter().zip(&self.recording.drives).enumerate() {
                let law = Law {
                    position_rad: drive.target_rad.at(time_s)[0],
                    speed_rad_s: drive.target_rad_s.at(time_s)[0],
                    torque_nm: drive.feedforward_nm.at(time_s)[0],
                    ..*servo
                };
                world.set_law(channel, law);
            }
            world.system_mut().step_recorded(part_s, &mut recorder).ok()?;
            if fall_watch.check(&world).is_some() {
                return None;
            }
        }
        let rollout = recorder.finish();
        let misses = self.misses(&world, model, &rollout, steps);
        Some(SimulatedRun { rollout, misses, columns })
    }

    /// Residuals of all measurements in the first steps.
    fn misses(
        &self,
        world: &World,
        model: &SimulationModel,
        rollout: &Rollout,
        steps: usize,
    ) -> Vec<MeasurementResidual> {
        let recording = &self.recording;
        let joints = model.robot.joints.len();
        let motors: Vec<&Motor> = (world.motors().iter())
            .map(|&motor| world.system().force(motor).expect("a channel's force is its motor"))
            .collect();
        // Origin of the root link in the frame of its body.
        let (origin, rotation) = world.base();
        let in_body = rotation.tr_mul(&(origin - world.system().motions()[0].position));
        let half_s = 0.5 * self.step_s;
        let mut misses = Vec::new();
        for step in 1..=steps {
            let time_s = recording.span_s[0] + step as f64 * self.step_s;
            let at = step * self.parts;
            let mut add = |signal, number, residual| {
                misses.push(MeasurementResidual { signal, number, step, residual });
            };
            for (channel, (drive, motor)) in recording.drives.iter().zip(&motors).enumerate() {
                let is_joint = channel < joints;
                if !drive.rad.is_empty() {
                    if let Some(angle_rad) = drive.rad.value_near(time_s, half_s) {
                        let zero = if is_joint { 0.0 } else { self.start.wheel_rad[channel] };
                        let residual = Residual::angle(rollout, at, motor, angle_rad - zero, 1.0);
                        add(
                            if is_joint { Signal::Joint } else { Signal::Wheel },
                            channel,
                            residual,
                        );
                    }
                } else if let Some(speed_rad_s) = drive.rad_s.value_near(time_s, half_s) {
                    let residual = Residual::speed(rollout, at, motor, speed_rad_s, 1.0);
                    add(Signal::Speed, channel, residual);
                }
            }
            let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
            if let Some(place) = Recording::vector_at(recording.position_m.as_ref(), time_s, half_s)
            {
                for (number, axis) in axes.into_iter().enumerate() {
                    let residual = origin_residual(rollout, at, &in_body, &place, axis);
                    add(Signal::Position, number, residual);
                }
            }
            if let Some(turned) = recording.orientation_at(time_s, half_s) {
                let residuals = Residual::orientation(rollout, at, 0, &turned, 1.0);
                for (number, residual) in residuals.into_iter().enumerate() {
                    add(Signal::Orientation, number, residual);
                }
            }
            if let Some(rate) = Recording::vector_at(recording.gyro_rad_s.as_ref(), time_s, half_s)
            {
                for (number, axis) in axes.into_iter().enumerate() {
                    let residual = Residual::gyroscope(rollout, at, 0, &axis, rate[number], 1.0);
                    add(Signal::Gyro, number, residual);
                }
            }
        }
        misses
    }
}

/// Residual along an axis between a point of the first body and a target. `in_body` is the point in body coordinates.
fn origin_residual(
    rollout: &Rollout,
    step: usize,
    in_body: &Vector3<f64>,
    target: &Vector3<f64>,
    axis: Vector3<f64>,
) -> Residual {
    let arm = rollout.motions(step)[0].rotation * in_body;
    let mut residual = Residual::position(rollout, step, 0, &(target - arm), axis);
    // δ(R b) = δθ × R b.
    residual.by[0].2.turn = arm.cross(&axis);
    residual
}

impl SimulatedRun {
    /// Residuals of the rollout.
    pub fn misses(&self) -> &[MeasurementResidual] {
        &self.misses
    }

    /// Residuals in units of their noise, and a function that computes their Jacobian with respect to the search parameters.
    /// Each row is a residual.
    pub fn weighted(self, noise: &Noise) -> (Vec<f64>, impl FnOnce() -> DMatrix<f64> + use<>) {
        let weights: Vec<f64> =
            self.misses.iter().map(|miss| 1.0 / noise[miss.signal as usize]).collect();
        let mut values: Vec<f64> = self.misses.iter().map(|miss| miss.residual.value).collect();
        let turning = turning(&self.misses);
        center(&turning, &mut values);
        values.iter_mut().zip(&weights).for_each(|(value, weight)| *value *= weight);
        let jacobian = move || {
            let Self { rollout, misses, columns } = self;
            let residuals: Vec<Residual> = misses.into_iter().map(|miss| miss.residual).collect();
            let by = rollout.jacobian(&residuals);
            let mut jacobian = DMatrix::zeros(residuals.len(), columns.len());
            for (mut column, parts) in jacobian.column_iter_mut().zip(&columns) {
                for &(place, factor) in parts {
                    column.axpy(factor, &by.column(place), 1.0);
                }
                center(&turning, column.as_mut_slice());
                column.iter_mut().zip(&weights).for_each(|(part, weight)| *part *= weight);
            }
            jacobian
        };
        (values, jacobian)
    }
}

/// Groups the rows of wheel angles by wheel.
fn turning(misses: &[MeasurementResidual]) -> Vec<Vec<usize>> {
    let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (row, miss) in misses.iter().enumerate().filter(|(_, miss)| miss.signal == Signal::Wheel) {
        rows.entry(miss.number).or_default().push(row);
    }
    rows.into_values().collect()
}

/// Subtracts the mean of each wheel, because the zero of its encoder is unknown.
fn center(turning: &[Vec<usize>], values: &mut [f64]) {
    for rows in turning {
        let mean = rows.iter().map(|&row| values[row]).sum::<f64>() / rows.len() as f64;
        rows.iter().for_each(|&row| values[row] -= mean);
    }
}

/// Residuals without the unknown zero of wheel encoders.
pub(super) fn centered(misses: &[MeasurementResidual]) -> Vec<f64> {
    let mut values: Vec<f64> = misses.iter().map(|miss| miss.residual.value).collect();
    center(&turning(misses), &mut values);
    values
}
