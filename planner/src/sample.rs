//! A plan at any time and any rate.
//!
//! The optimiser leaves a pose every few hundredths of a second; servos want one every 16 ms, the
//! controller every few milliseconds. What moves freely (base, joints, wheel angles) is joined by
//! splines with two continuous derivatives; what follows from the pose (centre of mass, contact
//! points, wheel axes) is computed from the pose; forces are linear from sample to sample.
//!
//! Ends: a periodic motion meets its own next period in two derivatives, a motion at rest starts and
//! stops with zero speed, a prescribed end takes its speed from the samples around it, the one outside
//! the motion included.
//!
//! Wheel speeds live on intervals, so the spline goes through the wheel's accumulated **angle** and the
//! speed is its derivative: the travel over every interval is exactly the planned one.

pub mod spline;

use crate::model::{BASE_POSITION, BASE_YAW, JOINTS, Model, rotation};
use crate::motion::Ends;
use crate::plan::{EndEffectorSample, Placement, Plan, Sample};
use crate::state::{ContactFrame, tilt_and_yaw};
use nalgebra::{Complex, DVector, UnitQuaternion, Vector3};
use rollwalk_robot::{Contact, EndEffector, Robot};
use spline::Spline;

/// A plan as a function of time.
#[derive(Clone, Debug)]
pub struct PlanSpline {
    model: Model,
    ends: Ends,
    spacing_s: f64,
    duration_s: f64,
    placement: Placement,
    base_xy: Spline,
    /// Base height, yaw, pitch, roll, then joints.
    pose: Vec<Spline>,
    /// Angle of the wheel's motor since the start, for every end effector.
    motor_angle: Vec<Spline>,
    /// Wheel spin about its axis since the start, for every end effector.
    wheel_angle: Vec<Spline>,
    /// `stance[sample][end_effector]`, the end of the last interval included.
    stance: Vec<Vec<bool>>,
    /// Wheel axis yaw `[sample][end_effector]`: says which turn the yaw in between belongs to.
    yaw_rad: Vec<Vec<f64>>,
    /// `force_n[sample][end_effector]`, the end of the last interval included.
    force_n: Vec<Vec<Vector3<f64>>>,
}

/// What the controller is to command at one time, instantaneous values.
#[derive(Clone, Debug, PartialEq)]
pub struct Setpoints {
    /// Joint angles in joint order, rad.
    pub joint_rad: Vec<f64>,
    /// Joint speeds in joint order, rad/s.
    pub joint_speed_rad_s: Vec<f64>,
    /// Motor speeds of the driven wheels in end-effector order, rad/s about the axis of the robot file.
    pub motor_speed_rad_s: Vec<f64>,
}

impl PlanSpline {
    /// Splines through a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let curves = Curves { plan };
        let base_xy = |s: &Sample| Complex::new(s.base_position_m[0], s.base_position_m[1]);
        let [dx, dy] = plan.end_placement.offset_m;
        let turn = Complex::from_polar(1.0, plan.end_placement.yaw_rad);
        let mut pose = vec![
            curves.scalar(|s| s.base_position_m[2], 0.0),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[0], plan.end_placement.yaw_rad),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[1], 0.0),
            curves.scalar(|s| s.base_yaw_pitch_roll_rad[2], 0.0),
        ];
        pose.extend((0..plan.robot.joints.len()).map(|k| curves.scalar(|s| s.joint_rad[k], 0.0)));
        let end_effectors = 0..plan.robot.end_effectors.len();
        let angle = |speed: &dyn Fn(&EndEffectorSample) -> f64| {
            end_effectors.clone().map(|j| curves.angle(|s| speed(&s.end_effectors[j]))).collect()
        };
        let mut stance = plan.motion.stance.clone();
        let forces =
            |s: &Sample| s.end_effectors.iter().map(|e| Vector3::from(e.force_n)).collect();
        let mut force_n: Vec<Vec<Vector3<f64>>> = plan.samples.iter().map(forces).collect();
        if plan.motion.ends == Ends::Periodic {
            stance.push(stance[0].clone());
            let turned = rotation::yaw_rotation(plan.end_placement.yaw_rad);
            force_n.push(force_n[0].iter().map(|f| turned * f).collect());
        }
        Self {
            model: Model::new(&plan.robot),
            ends: plan.motion.ends,
            spacing_s: plan.sample_interval_s,
            duration_s: plan.motion.duration_s,
            placement: plan.end_placement,
            base_xy: curves.spline(base_xy, turn, Complex::new(dx, dy)),
            pose,
            motor_angle: angle(&|e| e.motor_speed_rad_s),
            wheel_angle: angle(&|e| e.wheel_speed_rad_s),
            yaw_rad: plan
                .samples
                .iter()
                .map(|s| s.end_effectors.iter().map(|e| e.yaw_rad).collect())
                .collect(),
            stance,
            force_n,
        }
    }

    /// Length of the motion, s; of a periodic one, its period.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The robot that the plan is for.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Setpoints at a time. A periodic motion goes on for ever, another holds its ends.
    pub fn setpoints(&self, plan_time_s: f64) -> Setpoints {
        let (time_s, _) = self.within(plan_time_s);
        let joints: Vec<_> = self.pose[4..].iter().map(|spline| spline.at(time_s)).collect();
        let driven = driven_wheels(self.model.robot());
        Setpoints {
            joint_rad: joints.iter().map(|jet| jet.value.re).collect(),
            joint_speed_rad_s: joints.iter().map(|jet| jet.rate.re).collect(),
            motor_speed_rad_s: driven.map(|j| self.motor_angle[j].at(time_s).rate.re).collect(),
        }
    }

    /// The robot at a time, in the plan's world frame. Wheel and motor speeds are instantaneous; a
    /// contact flag between two samples is set when both of them are in stance.
    pub fn sample(&self, plan_time_s: f64) -> Sample {
        let (time_s, periods) = self.within(plan_time_s);
        Sample { time_s: plan_time_s, ..self.state(time_s, &self.placement.repeated(periods)) }
    }

    /// The robot at a time of the splines, moved by `placement`.
    fn state(&self, time_s: f64, placement: &Placement) -> Sample {
        let xy = self.base_xy.at(time_s).value;
        let free: Vec<f64> = self.pose.iter().map(|spline| spline.at(time_s).value.re).collect();
        let base_position_m = placement.point([xy.re, xy.im, free[0]]);
        let ypr = [free[1] + placement.yaw_rad, free[2], free[3]];
        let joint_rad = free[4..].to_vec();

        let mut q = DVector::zeros(self.model.dofs());
        q.rows_mut(BASE_POSITION, 3).copy_from_slice(&base_position_m);
        q.rows_mut(BASE_YAW, 3).copy_from_slice(&ypr);
        q.rows_mut(JOINTS, joint_rad.len()).copy_from_slice(&joint_rad);
        let pose = self.model.pose(&q);

        let position = time_s / self.spacing_s;
        let i = (position.floor().max(0.0) as usize).min(self.force_n.len() - 2);
        let u = (position - i as f64).clamp(0.0, 1.0);
        let end_effectors = self
            .model
            .robot()
            .end_effectors
            .iter()
            .enumerate()
            .map(|(j, end_effector)| {
                let mount = &pose.end_effectors[j];
                let (tilt_rad, yaw_rad) = match end_effector.contact {
                    Contact::PointFoot => (0.0, 0.0),
                    _ => tilt_and_yaw(&mount.axis, self.yaw_rad[i][j] + placement.yaw_rad),
                };
                let frame = match end_effector.contact {
                    Contact::PointFoot => ContactFrame::foot(end_effector.radius_m),
                    _ => ContactFrame::wheel(end_effector.radius_m, tilt_rad, yaw_rad),
                };
                let force = self.force_n[i][j].lerp(&self.force_n[i + 1][j], u);
                EndEffectorSample {
                    contact: self.stands(i, u, j),
                    position_m: (mount.center + frame.to_contact).into(),
                    force_n: placement.vector(force.into()),
                    wheel_speed_rad_s: self.wheel_angle[j].at(time_s).rate.re,
                    motor_speed_rad_s: self.motor_angle[j].at(time_s).rate.re,
                    tilt_rad,
                    yaw_rad,
                }
            })
            .collect();
        Sample {
            time_s,
            base_position_m,
            base_yaw_pitch_roll_rad: ypr,
            base_orientation_wxyz: quaternion_wxyz(ypr),
            joint_rad,
            com_m: pose.com.into(),
            end_effectors,
        }
    }

    /// Angle that every end effector's wheel has turned about its motor since the start of the motion,
    /// rad; 0 without a wheel.
    pub fn motor_angles_rad(&self, plan_time_s: f64) -> Vec<f64> {
        let (time_s, periods) = self.within(plan_time_s);
        let angle = |spline: &Spline| {
            let period = spline.at(self.duration_s).value.re;
            spline.at(time_s).value.re + periods as f64 * period
        };
        self.motor_angle.iter().map(angle).collect()
    }

    /// Whether end effector `j` stands at part `u` of interval `i`.
    fn stands(&self, i: usize, u: f64, j: usize) -> bool {
        /// A time this close to a sample, as a part of the interval, is that sample's.
        const ON_SAMPLE: f64 = 1e-9;
        (u > 1.0 - ON_SAMPLE || self.stance[i][j]) && (u < ON_SAMPLE || self.stance[i + 1][j])
    }

    /// Mean wheel and motor speed of end effector `j` between two times inside the motion, rad/s.
    fn mean_speeds(&self, j: usize, from_s: f64, to_s: f64) -> (f64, f64) {
        let mean = |angle: &Spline| {
            (angle.at(to_s).value.re - angle.at(from_s).value.re) / (to_s - from_s)
        };
        (mean(&self.wheel_angle[j]), mean(&self.motor_angle[j]))
    }

    /// The time inside the motion that `plan_time_s` stands for, and how many periods later it is.
    fn within(&self, plan_time_s: f64) -> (f64, i64) {
        match self.ends {
            Ends::Periodic => {
                let periods = (plan_time_s / self.duration_s).floor();
                (plan_time_s - periods * self.duration_s, periods as i64)
            }
            Ends::AtRest | Ends::Prescribed => (plan_time_s.clamp(0.0, self.duration_s), 0),
        }
    }
}

/// The plan sampled at `rate_hz`, or at the nearest rate that divides its duration evenly: a plan with
/// the same meaning of every field, interval speeds as means over the new intervals.
pub fn resample(plan: &Plan, rate_hz: f64) -> Plan {
    let spline = PlanSpline::new(plan);
    let intervals = (plan.motion.duration_s * rate_hz).round().max(3.0);
    let spacing_s = plan.motion.duration_s / intervals;
    let count = match plan.motion.ends {
        Ends::Periodic => intervals as usize,
        Ends::AtRest | Ends::Prescribed => intervals as usize + 1,
    };
    let sample_at = |index: f64| {
        let time_s = index * spacing_s;
        // Which new interval, inside the splines, starts at this sample; at rest there is none outside.
        let (mut sample, interval) = match plan.motion.ends {
            Ends::Periodic => (spline.sample(time_s), Some(index.rem_euclid(intervals))),
            Ends::AtRest => {
                (spline.sample(time_s), (0.0..intervals).contains(&index).then_some(index))
            }
            // Outside a prescribed end the velocity at the end goes on.
            Ends::Prescribed => (spline.state(time_s, &Placement::default()), Some(index)),
        };
        sample.time_s = time_s;
        if let Some(start) = interval {
            for (j, end_effector) in sample.end_effectors.iter_mut().enumerate() {
                (end_effector.wheel_speed_rad_s, end_effector.motor_speed_rad_s) =
                    spline.mean_speeds(j, start * spacing_s, (start + 1.0) * spacing_s);
            }
        }
        sample
    };
    let samples: Vec<Sample> = (0..count).map(|i| sample_at(i as f64)).collect();
    let mut resampled = Plan {
        sample_interval_s: spacing_s,
        before: sample_at(-1.0),
        after: sample_at(count as f64),
        samples,
        ..plan.clone()
    };
    let stance = |s: &Sample| s.end_effectors.iter().map(|e| e.contact).collect();
    resampled.motion.stance = resampled.samples.iter().map(stance).collect();
    resampled
}

/// End effectors whose wheel has a motor, in channel order.
pub fn driven_wheels(robot: &Robot) -> impl Iterator<Item = usize> + '_ {
    let driven = |(_, e): &(usize, &EndEffector)| e.contact.actuator().is_some();
    robot.end_effectors.iter().enumerate().filter(driven).map(|(j, _)| j)
}

/// World-from-body rotation of intrinsic yaw, pitch and roll, `[w, x, y, z]`.
///
/// Half angles of unwrapped yaw, pitch and roll: the sign is continuous along a motion by construction.
fn quaternion_wxyz([yaw, pitch, roll]: [f64; 3]) -> [f64; 4] {
    let about = |axis, angle| *UnitQuaternion::from_axis_angle(axis, angle).quaternion();
    let q = about(&Vector3::z_axis(), yaw)
        * about(&Vector3::y_axis(), pitch)
        * about(&Vector3::x_axis(), roll);
    [q.w, q.i, q.j, q.k]
}

/// Makes the splines of a plan with the end conditions of its motion.
struct Curves<'a> {
    plan: &'a Plan,
}

impl Curves<'_> {
    /// The spline through a real quantity of the samples that grows by `shift` over a period.
    fn scalar(&self, of: impl Fn(&Sample) -> f64, shift: f64) -> Spline {
        self.spline(|s| of(s).into(), 1.0.into(), shift.into())
    }

    fn spline(
        &self,
        of: impl Fn(&Sample) -> Complex<f64>,
        turn: Complex<f64>,
        shift: Complex<f64>,
    ) -> Spline {
        let values: Vec<_> = self.plan.samples.iter().map(&of).collect();
        self.through(&values, of(&self.plan.before), of(&self.plan.after), turn, shift)
    }

    /// The spline through the angle that adds up from a speed that lives on intervals.
    fn angle(&self, speed: impl Fn(&Sample) -> f64) -> Spline {
        let plan = self.plan;
        let h = plan.sample_interval_s;
        let mut angle = 0.0;
        let mut angles = Vec::with_capacity(plan.samples.len() + 1);
        for sample in &plan.samples {
            angles.push(Complex::from(angle));
            angle += speed(sample) * h;
        }
        let before = Complex::from(-speed(&plan.before) * h);
        // After the loop `angle` is that of the sample one interval after the last.
        self.through(&angles, before, angle.into(), 1.0.into(), angle.into())
    }

    fn through(
        &self,
        values: &[Complex<f64>],
        before: Complex<f64>,
        after: Complex<f64>,
        turn: Complex<f64>,
        shift: Complex<f64>,
    ) -> Spline {
        let plan = self.plan;
        let h = plan.sample_interval_s;
        let zero = Complex::default();
        match plan.motion.ends {
            Ends::Periodic => Spline::periodic(h, values, turn, shift),
            Ends::AtRest => Spline::clamped(h, values, zero, zero),
            // The states outside lie along the velocities at the ends.
            Ends::Prescribed => {
                let (first, last) = (values[0], values[values.len() - 1]);
                Spline::clamped(h, values, (first - before) / h, (after - last) / h)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    fn plans() -> [Plan; 3] {
        [test_plans::start_stop(), test_plans::cruise(), test_plans::cruise_middle()]
    }

    /// Largest difference of two samples over positions, angles, forces and wheel axes.
    fn distance(a: &Sample, b: &Sample) -> f64 {
        let numbers = |s: &Sample| {
            let mut all = [s.base_position_m, s.base_yaw_pitch_roll_rad, s.com_m].concat();
            all.extend(s.base_orientation_wxyz.iter().chain(&s.joint_rad));
            for e in &s.end_effectors {
                all.extend(e.position_m.iter().chain(&e.force_n).chain([&e.tilt_rad, &e.yaw_rad]));
            }
            all
        };
        numbers(a).iter().zip(numbers(b)).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    }

    #[test]
    fn splines_pass_through_the_samples() {
        for plan in plans() {
            let spline = PlanSpline::new(&plan);
            for sample in &plan.samples {
                let error = distance(&spline.sample(sample.time_s), sample);
                assert!(error < 1e-12, "{} at {}: {error}", plan.motion.name, sample.time_s); // rounding
            }
        }
    }

    #[test]
    fn resampling_keeps_a_plan_valid_and_its_wheel_travel_exact() {
        for plan in plans() {
            let fine = resample(&plan, 60.0);
            fine.validate("resampled").expect("a resampled plan is a plan");
            assert!((1.0 / fine.sample_interval_s - 60.0).abs() < 1e-9);
            let travel = |plan: &Plan| -> f64 {
                let count = match plan.motion.ends {
                    Ends::Periodic => plan.samples.len(),
                    _ => plan.samples.len() - 1,
                };
                let speeds =
                    plan.samples[..count].iter().map(|s| s.end_effectors[1].motor_speed_rad_s);
                speeds.sum::<f64>() * plan.sample_interval_s
            };
            let (planned, resampled) = (travel(&plan), travel(&fine));
            assert!((planned - resampled).abs() < 1e-9, "{planned} {resampled}"); // rounding of a sum
        }
    }

    #[test]
    fn wheel_travel_over_every_planned_interval_is_preserved() {
        for plan in plans() {
            let spline = PlanSpline::new(&plan);
            let h = plan.sample_interval_s;
            for sample in &plan.samples[..plan.samples.len() - 1] {
                // Simpson's rule is exact for the piecewise quadratic speed.
                let speed = |u: f64| spline.setpoints(sample.time_s + u * h).motor_speed_rad_s[0];
                let mean = (speed(1e-12) + 4.0 * speed(0.5) + speed(1.0 - 1e-12)) / 6.0;
                let error = mean - sample.end_effectors[0].motor_speed_rad_s;
                assert!(error.abs() < 1e-9, "{} at {}: {error}", plan.motion.name, sample.time_s);
            }
        }
    }

    #[test]
    fn a_motion_at_rest_starts_and_ends_with_zero_speeds() {
        let plan = test_plans::start_stop();
        let spline = PlanSpline::new(&plan);
        for time_s in [-1.0, 0.0, plan.motion.duration_s, 9.0] {
            let setpoints = spline.setpoints(time_s);
            let speeds = setpoints.joint_speed_rad_s.iter().chain(&setpoints.motor_speed_rad_s);
            assert!(speeds.fold(0.0, |worst: f64, v| worst.max(v.abs())) < 1e-12, "{setpoints:?}");
        }
    }

    #[test]
    fn a_periodic_motion_goes_on_across_its_seam() {
        let plan = test_plans::cruise();
        let spline = PlanSpline::new(&plan);
        let period = plan.motion.duration_s;
        for k in 0..20 {
            let t = 0.071 * f64::from(k);
            let (first, third) = (spline.sample(t), spline.sample(t + 2.0 * period));
            let step = plan.end_placement.offset_m[0];
            let error = third.base_position_m[0] - first.base_position_m[0] - 2.0 * step;
            assert!(
                error.abs() < 1e-12 && (third.com_m[0] - first.com_m[0] - 2.0 * step).abs() < 1e-12
            );
            assert_eq!(first.end_effectors[0].contact, third.end_effectors[0].contact);
        }
        let (left, right) = (spline.setpoints(period - 1e-9), spline.setpoints(period));
        for (a, b) in left.joint_speed_rad_s.iter().zip(&right.joint_speed_rad_s) {
            assert!((a - b).abs() < 1e-7, "{a} {b}"); // accelerations of 10 rad/s² for 1 ns
        }
    }

    #[test]
    fn a_turning_motion_goes_round_a_circle() {
        // The whole cruise bent onto a circle: samples turned in proportion to time.
        let mut plan = test_plans::cruise();
        let radius = 0.8;
        let psi = 0.9;
        let count = plan.samples.len() as f64;
        let bend = |sample: &mut Sample, part: f64| {
            let yaw = psi * part;
            sample.base_position_m[0] = radius * yaw.sin();
            sample.base_position_m[1] = radius * (1.0 - yaw.cos());
            sample.base_yaw_pitch_roll_rad = [yaw, 0.0, 0.0];
            sample.base_orientation_wxyz = quaternion_wxyz([yaw, 0.0, 0.0]);
        };
        for (i, sample) in plan.samples.iter_mut().enumerate() {
            bend(sample, i as f64 / count);
        }
        bend(&mut plan.before, -1.0 / count);
        bend(&mut plan.after, 1.0);
        plan.end_placement =
            Placement { offset_m: [radius * psi.sin(), radius * (1.0 - psi.cos())], yaw_rad: psi };
        plan.validate("circle").expect("a plan");
        let spline = PlanSpline::new(&plan);
        for k in -50..200 {
            let t = 0.03 * f64::from(k);
            let sample = spline.sample(t);
            let [x, y, _] = sample.base_position_m;
            // Spline error on the circle: (5/384)·r·(ψ/24)⁴ = 2e-8 m.
            assert!((x.hypot(y - radius) - radius).abs() < 1e-7, "{t}");
            let yaw = psi * t / plan.motion.duration_s;
            assert!((sample.base_yaw_pitch_roll_rad[0] - yaw).abs() < 1e-12, "{t}");
            assert!((x - radius * yaw.sin()).abs() < 1e-6, "{t}");
        }
    }

    #[test]
    fn a_prescribed_motion_takes_its_end_speeds_from_the_samples_around() {
        // The same cruise, once whole and once cut out with prescribed ends.
        let (whole, part) =
            (PlanSpline::new(&test_plans::cruise()), PlanSpline::new(&test_plans::cruise_middle()));
        for k in 0..=60 {
            let t = 0.01 * f64::from(k);
            let (a, b) = (whole.setpoints(t + 0.3), part.setpoints(t));
            // Leg sine of 0.2 rad at 5.2 rad/s: a cubic's slope errs by about h³/24·0.2·5.2⁴ = 8e-4.
            assert!((a.joint_rad[0] - b.joint_rad[0]).abs() < 2e-5, "{t}");
            assert!((a.joint_speed_rad_s[0] - b.joint_speed_rad_s[0]).abs() < 2e-3, "{t}");
            // The wheel's speed outside is the mean over an interval on which the leg, 4 wheel radii
            // long, turns evenly at 0.8 rad/s: it errs by h/2·4·0.8²·sin(leg) = 3e-2.
            assert!((a.motor_speed_rad_s[0] - b.motor_speed_rad_s[0]).abs() < 4e-2, "{t}");
        }
    }

    #[test]
    fn force_and_contact_switch_between_stance_and_swing() {
        let mut plan = test_plans::cruise();
        for i in [5, 6, 7] {
            plan.motion.stance[i][2] = false;
            plan.samples[i].end_effectors[2].contact = false;
            plan.samples[i].end_effectors[2].force_n = [0.0; 3];
        }
        let spline = PlanSpline::new(&plan);
        let h = plan.sample_interval_s;
        let at = |sample: f64| spline.sample(sample * h).end_effectors[2].clone();
        assert!(
            at(4.0).contact
                && !at(4.5).contact
                && !at(5.0).contact
                && !at(7.9).contact
                && at(8.0).contact
        );
        let half = 0.5 * plan.samples[4].end_effectors[2].force_n[2];
        assert!((at(4.5).force_n[2] - half).abs() < 1e-9);
        assert_eq!(at(6.3).force_n, [0.0; 3]);
    }
}
