//! Motor on a hinge or prismatic joint: position and speed loop within the motor's limits, rotor inertia, and mechanical stops.

use crate::force::{Derivative, Force, Kink, StateBlock, StickingFriction, View, Wrench};
use crate::motion::BodyMotion;
use crate::slide::Slide;
use nalgebra::{Matrix3, Matrix6x3, Vector3};
use rollwalk_multibody::rotation::skew;
use rollwalk_robot::{Actuator, JointSpring, TorqueSpeedLine};
use std::f64::consts::{PI, TAU};

/// Ratio of stall torque to torque limit for an actuator without a torque-speed line. Such a motor has full torque up to 95 %
/// of its speed limit.
const ABRUPT: f64 = 20.0;

/// Stall torque, N·m, and no-load speed, rad/s, of an actuator. Without a torque-speed line in its robot file, the torque falls
/// steeply to 0 at `speed_max_rad_s`.
pub fn torque_speed_line(actuator: &Actuator) -> (f64, f64) {
    match actuator.torque_speed {
        Some(TorqueSpeedLine { stall_torque_nm, no_load_speed_rad_s }) => {
            (stall_torque_nm, no_load_speed_rad_s)
        }
        None => (ABRUPT * actuator.torque_max_nm, actuator.speed_max_rad_s),
    }
}

/// Control law of a motor, evaluated at the end of a step: τ = clamp(kp (q* − q) + kd (q̇* − q̇) + τ_ff, ±limit).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Law {
    /// Position gain, N·m/rad; 0 for a wheel.
    pub kp_nm_rad: f64,
    /// Speed gain, N·m·s/rad.
    pub kd_nm_s_rad: f64,
    /// Target angle q*, rad.
    pub position_rad: f64,
    /// Target speed q̇*, rad/s.
    pub speed_rad_s: f64,
    /// Feed-forward torque τ_ff, N·m.
    pub torque_nm: f64,
    /// Torque limit, N·m; 0 for a motor without power.
    pub limit_nm: f64,
    /// Stall torque, N·m, and no-load speed, rad/s, of the torque-speed line. `None` for full torque at any speed.
    pub line: Option<(f64, f64)>,
}

/// Torque of a motor and its derivatives with respect to angle and speed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Torque {
    /// Torque on the driven body about the axis, N·m.
    pub value_nm: f64,
    pub(crate) by_angle: f64,
    pub(crate) by_speed: f64,
    /// Derivative with respect to the torque that the control loops request: 1 within all limits, 0 at a limit.
    by_wanted: f64,
}

impl Torque {
    /// Subtracts the torque that accelerates a rotor. `gain` is the derivative of the acceleration with respect to the speed.
    pub(crate) fn with_rotor(mut self, armature_kg_m2: f64, acceleration: f64, gain: f64) -> Self {
        self.value_nm -= armature_kg_m2 * acceleration;
        self.by_speed -= armature_kg_m2 * gain;
        self
    }
}

impl Law {
    /// Servo with the gains, limits and [`torque_speed_line`] of an actuator. The target is angle 0 at rest.
    pub fn servo(actuator: &Actuator) -> Self {
        Self {
            kp_nm_rad: actuator.kp_nm_rad,
            kd_nm_s_rad: actuator.kd_nm_s_rad,
            limit_nm: actuator.torque_max_nm,
            line: Some(torque_speed_line(actuator)),
            ..Self::default()
        }
    }

    /// Torque at an angle, rad, and a speed, rad/s.
    pub fn torque(&self, angle_rad: f64, speed_rad_s: f64) -> Torque {
        let error = self.position_rad - angle_rad;
        let wanted = self.kp_nm_rad * error
            + self.kd_nm_s_rad * (self.speed_rad_s - speed_rad_s)
            + self.torque_nm;
        let limited =
            |limit: f64, by_speed: f64| Torque { value_nm: limit, by_speed, ..Torque::default() };
        let mut torque = Torque {
            value_nm: wanted,
            by_angle: -self.kp_nm_rad,
            by_speed: -self.kd_nm_s_rad,
            by_wanted: 1.0,
        };
        if wanted.abs() > self.limit_nm {
            torque = limited(self.limit_nm.copysign(wanted), 0.0);
        }
        if let Some((stall_nm, no_load_rad_s)) = self.line {
            // While it drives its load: |τ|/stall + |speed|/no-load speed ≤ 1.
            let sign = torque.value_nm.signum();
            let available = stall_nm * (1.0 - sign * speed_rad_s / no_load_rad_s);
            if sign * speed_rad_s > 0.0 && torque.value_nm.abs() > available.max(0.0) {
                torque = if available > 0.0 {
                    limited(sign * available, -stall_nm / no_load_rad_s)
                } else {
                    limited(0.0, 0.0)
                };
            }
        }
        torque
    }
}

/// Derivatives of a motor's torque with respect to the parameters of its law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LawDerivatives {
    pub position_nm_rad: f64,
    pub speed_nm_s_rad: f64,
    pub torque: f64,
    pub kp_rad: f64,
    pub kd_rad_s: f64,
}

/// Motor of a hinge or of a prismatic joint. The first body carries the motor, and the second is driven.
#[derive(Clone, Debug)]
pub struct Motor {
    /// Indices of the carrying and the driven body.
    pub bodies: [usize; 2],
    /// Unit axis of the joint, in axes of the first body.
    pub axis: Vector3<f64>,
    /// Unit vectors across the axis, each in the axes of its body. They are parallel at angle 0.
    pub across: [Vector3<f64>; 2],
    /// Pinion of a prismatic joint; `None` for a hinge.
    pub slide: Option<Slide>,
    /// Inertia of rotor and gearbox at the output, kg·m².
    pub armature_kg_m2: f64,
    /// Mechanical stops; `None` for a hinge without stops.
    pub stops: Option<Stops>,
    /// Spring and damper beside the motor.
    pub spring: Option<JointSpring>,
    /// Angle at the end of the previous step, rad. Unlike the poses of the bodies, it includes whole turns.
    pub angle_rad: f64,
    /// Control law.
    pub law: Law,
}

/// Mechanical stops of a hinge: springs outside a range of angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stops {
    /// Lower and upper angle, rad.
    pub range_rad: [f64; 2],
    /// Stiffness, N·m/rad.
    pub stiffness_nm_rad: f64,
}

impl Stops {
    fn torque(&self, angle_rad: f64) -> Torque {
        let [min, max] = self.range_rad;
        let beyond = angle_rad - angle_rad.clamp(min, max);
        let by_angle = if beyond == 0.0 { 0.0 } else { -self.stiffness_nm_rad };
        Torque { value_nm: -self.stiffness_nm_rad * beyond, by_angle, ..Torque::default() }
    }
}

impl Motor {
    /// Unit axis of the joint, in world axes.
    pub fn axis_in_world(&self, carrier: &BodyMotion) -> Vector3<f64> {
        carrier.rotation * self.axis
    }

    /// Angle of the second body relative to the first about the axis, rad. The result is within half a turn of the angle at the
    /// end of the previous step.
    pub fn angle(&self, now: &[BodyMotion]) -> f64 {
        if let Some(slide) = &self.slide {
            return slide.angle_and_speed(&self.axis, now)[0];
        }
        let (sine, cosine, _) = self.sine_cosine(now);
        let within_turn = sine.atan2(cosine);
        let apart = self.angle_rad - within_turn;
        if apart.abs() < PI { within_turn } else { within_turn + TAU * (apart / TAU).round() }
    }

    /// Speed of the second body about the axis relative to the first, rad/s.
    pub fn speed(&self, now: &[BodyMotion]) -> f64 {
        if let Some(slide) = &self.slide {
            return slide.angle_and_speed(&self.axis, now)[1];
        }
        self.axis_in_world(&now[0]).dot(&(now[1].spin - now[0].spin))
    }

    /// Wrenches on both bodies for a torque of 1 N·m.
    pub(crate) fn unit_wrenches(&self, now: &[BodyMotion]) -> [Wrench; 2] {
        if let Some(slide) = &self.slide {
            return slide.unit_wrenches(&self.axis, now);
        }
        let moment = self.axis_in_world(&now[0]);
        [-moment, moment].map(|moment| Wrench { moment, ..Wrench::default() })
    }

    /// Torque of the control law at the motions `now`, without rotor inertia, spring and stops.
    pub fn torque(&self, now: &[BodyMotion]) -> Torque {
        self.law.torque(self.angle(now), self.speed(now))
    }

    /// Derivatives of the torque at the end of a step with respect to the parameters of the law; 0 at a limit.
    pub(crate) fn law_by(&self, view: &View<'_>) -> LawDerivatives {
        let (angle, speed) = (self.angle(view.now), self.speed(view.now));
        let free = self.law.torque(angle, speed).by_wanted;
        LawDerivatives {
            position_nm_rad: free * self.law.kp_nm_rad,
            speed_nm_s_rad: free * self.law.kd_nm_s_rad,
            torque: free,
            kp_rad: free * (self.law.position_rad - angle),
            kd_rad_s: free * (self.law.speed_rad_s - speed),
        }
    }

    /// Acceleration of the second body relative to the first about the axis, from backward differences, rad/s².
    pub(crate) fn acceleration(&self, view: &View<'_>) -> f64 {
        let speed = |motions| self.speed(motions);
        view.weights.rate(speed(view.now), speed(view.last), speed(view.before))
    }

    /// Derivative of the angle with respect to a turn of the second body. The derivative for the first body has the opposite
    /// sign.
    pub(crate) fn angle_by_turn(&self, now: &[BodyMotion]) -> Vector3<f64> {
        self.sine_cosine(now).2
    }

    /// Sine and cosine of the angle, up to a common factor, and the gradient of the angle with respect to a turn of the second
    /// body.
    fn sine_cosine(&self, now: &[BodyMotion]) -> (f64, f64, Vector3<f64>) {
        let along = now[0].rotation * self.across[0];
        let normal = self.axis_in_world(&now[0]).cross(&along);
        let other = now[1].rotation * self.across[1];
        let (sine, cosine) = (normal.dot(&other), along.dot(&other));
        // δ(m·n) = (n × m)·… for a rotation of `other`: δθ·(other × normal), δθ·(other × along).
        let gradient = (other.cross(&normal) * cosine - other.cross(&along) * sine)
            / (sine * sine + cosine * cosine);
        (sine, cosine, gradient)
    }

    /// Torque of control law, spring and stops.
    fn bounded(&self, angle_rad: f64, speed_rad_s: f64) -> Torque {
        let mut torque = self.law.torque(angle_rad, speed_rad_s);
        if let Some(stops) = &self.stops {
            let stop = stops.torque(angle_rad);
            torque.value_nm += stop.value_nm;
            torque.by_angle += stop.by_angle;
        }
        if let Some(spring) = &self.spring {
            torque.value_nm += spring.torque_nm(angle_rad, speed_rad_s);
            torque.by_angle -= spring.stiffness_nm_rad;
            torque.by_speed -= spring.damping_nm_s_rad;
        }
        torque
    }

    /// Total torque on the second body about the axis, including rotor inertia.
    fn moment(&self, view: &View<'_>) -> Torque {
        let torque = self.bounded(self.angle(view.now), self.speed(view.now));
        torque.with_rotor(self.armature_kg_m2, self.acceleration(view), view.weights.gain())
    }
}

impl Force for Motor {
    fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    fn end_step(&mut self, motions: &[BodyMotion]) {
        let now = self.bodies.map(|body| motions[body]);
        self.angle_rad = self.angle(&now);
    }

    fn has_kink(&self) -> bool {
        true
    }

    fn kink(&self, now: &[BodyMotion], _held: Option<StickingFriction>) -> Option<Kink<'_>> {
        let levers = self.unit_wrenches(now).map(|wrench| {
            let mut lever = Matrix6x3::zeros();
            lever.set_column(0, &wrench.stacked());
            lever
        });
        let (angle, speed) = (self.angle(now), self.speed(now));
        let law = move |gain: f64, shift: &Vector3<f64>| {
            let torque = self.bounded(angle + shift.x, speed + gain * shift.x);
            let by_shift = torque.by_angle + gain * torque.by_speed;
            (
                Vector3::new(torque.value_nm, 0.0, 0.0),
                Matrix3::from_diagonal(&Vector3::new(by_shift, 0.0, 0.0)),
            )
        };
        Some(Kink { levers, directions: 1, always: false, law: Box::new(law) })
    }

    fn wrenches(&self, view: &View<'_>, wrenches: &mut [Wrench]) {
        if let Some(slide) = &self.slide {
            let torque_nm = self.moment(view).value_nm;
            for (to, unit) in wrenches.iter_mut().zip(slide.unit_wrenches(&self.axis, view.now)) {
                *to = *to + unit * torque_nm;
            }
            return;
        }
        let moment = self.axis_in_world(&view.now[0]) * self.moment(view).value_nm;
        wrenches[0].moment -= moment;
        wrenches[1].moment += moment;
    }

    fn derivatives(
        &self,
        view: &View<'_>,
        wrenches: &mut [Wrench],
        derivatives: &mut [Derivative],
    ) {
        let torque = self.moment(view);
        if let Some(slide) = &self.slide {
            self.wrenches(view, wrenches);
            let law = [torque.value_nm, torque.by_angle, torque.by_speed];
            slide.add_derivatives(&self.axis, view, law, derivatives);
            return;
        }
        let axis = self.axis_in_world(&view.now[0]);
        let gradient = self.angle_by_turn(view.now);
        wrenches[0].moment -= axis * torque.value_nm;
        wrenches[1].moment += axis * torque.value_nm;
        // Both angle and axis turn with the first body: δ(u·Δω) = Δω·(δθ × u) = δθ·(u × Δω).
        let relative = view.now[1].spin - view.now[0].spin;
        let by_angle = axis * gradient.transpose() * torque.by_angle;
        let by_speed = axis * axis.transpose() * torque.by_speed;
        let by_axis: Matrix3<f64> = axis * axis.cross(&relative).transpose() * torque.by_speed
            - skew(&axis) * torque.value_nm;
        for (i, on_i) in [(0, -1.0), (1, 1.0)] {
            let [of_first, of_second] = [2 * i, 2 * i + 1];
            derivatives[of_first].add_moment(StateBlock::Rotation, &((by_axis - by_angle) * on_i));
            derivatives[of_second].add_moment(StateBlock::Rotation, &(by_angle * on_i));
            derivatives[of_first].add_moment(StateBlock::Spin, &(by_speed * -on_i));
            derivatives[of_second].add_moment(StateBlock::Spin, &(by_speed * on_i));
        }
    }

    /// Adds the derivatives of the rotor inertia, which depends on earlier speeds.
    fn history(&self, view: &View<'_>, last: &mut [Derivative], before: &mut [Derivative]) -> bool {
        let axis_now = self.axis_in_world(&view.now[0]);
        let times = [(view.last, last), (view.before, before)];
        for ((then, derivatives), gain) in times.into_iter().zip(view.weights.earlier_gains()) {
            if let Some(slide) = &self.slide {
                let gain = -self.armature_kg_m2 * gain;
                slide.add_history(&self.axis, view, then, gain, derivatives);
                continue;
            }
            let axis = self.axis_in_world(&then[0]);
            let relative = then[1].spin - then[0].spin;
            let moment = axis_now * (-self.armature_kg_m2 * gain);
            let (by_turn, by_spin) =
                (moment * axis.cross(&relative).transpose(), moment * axis.transpose());
            for (i, on_i) in [(0, -1.0), (1, 1.0)] {
                derivatives[2 * i].add_moment(StateBlock::Rotation, &(by_turn * on_i));
                derivatives[2 * i].add_moment(StateBlock::Spin, &(by_spin * -on_i));
                derivatives[2 * i + 1].add_moment(StateBlock::Spin, &(by_spin * on_i));
            }
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{LAW, agrees_with_finite_differences};

    fn motor(law: Law) -> Motor {
        Motor {
            bodies: [0, 1],
            axis: Vector3::y(),
            across: [Vector3::x(), Vector3::z()],
            slide: None,
            armature_kg_m2: 0.02,
            stops: None,
            spring: None,
            angle_rad: 0.0,
            law,
        }
    }

    #[test]
    fn a_hinge_has_its_derivatives_at_its_stops_and_between_them() {
        for range_rad in [[-3.0, 3.0], [-0.01, 0.01]] {
            let stops = Some(Stops { range_rad, stiffness_nm_rad: 30.0 });
            agrees_with_finite_differences(&Motor { stops, ..motor(Law::default()) });
        }
    }

    #[test]
    fn a_hinge_has_its_derivatives_with_spring_and_damper() {
        let spring = JointSpring { stiffness_nm_rad: 4.0, rest_rad: -0.7, damping_nm_s_rad: 0.3 };
        agrees_with_finite_differences(&Motor { spring: Some(spring), ..motor(Law::default()) });
    }

    #[test]
    fn a_motor_has_its_derivatives_free_at_its_limit_and_on_its_line() {
        agrees_with_finite_differences(&motor(LAW));
        agrees_with_finite_differences(&motor(Law { limit_nm: 0.1, ..LAW }));
        agrees_with_finite_differences(&motor(Law { line: Some((0.5, 30.0)), ..LAW }));
    }

    #[test]
    fn a_law_is_a_spring_within_its_limits() {
        let law = Law { kp_nm_rad: 10.0, position_rad: 1.0, limit_nm: 4.0, ..Law::default() };
        assert!((law.torque(0.8, 0.0).value_nm - 2.0).abs() < 1e-12);
        assert_eq!(law.torque(0.0, 0.0).value_nm, 4.0);
        // Whole turns count.
        assert!((law.torque(1.1, 0.0).value_nm + 1.0).abs() < 1e-12);
        assert_eq!(law.torque(1.1 - TAU, 0.0).value_nm, 4.0);
        let fast = Law { line: Some((4.0, 10.0)), ..law };
        assert_eq!(fast.torque(0.0, 5.0).value_nm, 2.0);
        assert_eq!(fast.torque(0.0, 12.0).value_nm, 0.0);
        assert_eq!(fast.torque(0.0, -5.0).value_nm, 4.0, "it brakes with all it has");
    }

    #[test]
    fn a_servo_has_no_torque_beyond_its_top_speed_whether_its_file_has_a_line_or_not() {
        let actuator = Actuator {
            model: "test".into(),
            speed_max_rad_s: 8.0,
            torque_max_nm: 3.0,
            torque_speed: None,
            kp_nm_rad: 20.0,
            kd_nm_s_rad: 0.5,
            armature_kg_m2: 0.01,
            bus: 0,
            id: 5,
        };
        let torque = |actuator: &Actuator, speed_rad_s| {
            let law = Law { torque_nm: 100.0, ..Law::servo(actuator) };
            law.torque(0.0, speed_rad_s).value_nm
        };
        assert_eq!(torque(&actuator, 7.5), 3.0);
        assert!((torque(&actuator, 7.8) - 1.5).abs() < 1e-12);
        assert_eq!(torque(&actuator, 8.0), 0.0);
        let line = TorqueSpeedLine { stall_torque_nm: 4.0, no_load_speed_rad_s: 10.0 };
        let known = Actuator { torque_speed: Some(line), ..actuator };
        assert_eq!(torque(&known, 5.0), 2.0);
        assert_eq!(torque(&known, 10.0), 0.0);
    }
}
