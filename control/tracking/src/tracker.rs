//! Tick of the tracking controller: inverse dynamics as one quadratic program.
//!
//! The program finds the accelerations, ground forces and torques that are nearest to the desired ones within the limits of
//! floor, friction and motors.
//!
//! ```text
//! min   Σ weight |J ν̇ − wanted|²  +  weight |f − planned|²
//! with  M ν̇ + h = Σ Jᵀ f                      without a motor: base, passive joints, free wheels
//!       |M ν̇ + h − Σ Jᵀ f| ≤ torque limit     with a motor
//!       f within a friction pyramid
//! ```
//!
//! The contact of a wheel is at its rim. The material at the contact of a rolling wheel has J ν = 0, where ν includes the spin.
//! J̇ is evaluated at the contact point, which moves along the rim. At the centre, or at a point fixed to the tyre, the program
//! would request impossible forces from the wheel.

use crate::contacts::{self, Phase, PlannedContact};
use crate::correction::{Correction, TrackedPoint};
use crate::gains::Gains;
use crate::model::heading_rad;
use crate::plausible;
use crate::quadratic::{Program, SolveError, Solver};
use crate::recovery::{Errors, Recovery};
use crate::reference::Reference;
use crate::tasks::Weights;
use nalgebra::{DMatrix, DVector, Matrix3xX, Point3, Rotation3, Vector2, Vector3};
use rollwalk_multibody::{
    ANGULAR, CompositeInertia, Configuration, JOINTS, Kinematics, LINEAR, RimContact, State, Tree,
};
use rollwalk_robot::{EndEffector, GRAVITY_M_S2, JointRatio, Robot};
use thiserror::Error;

/// Ratio of the drives' kp during tracking to the kp of the robot file. The drives close this loop around the set-points
/// between ticks.
pub const KP_PART: f64 = 0.1;
/// Ratio of the drives' kd during tracking to the kd of the robot file.
pub const KD_PART: f64 = 0.2;

/// Cosine of the largest tilt relative to the plan, 1 rad, of a robot that has not fallen.
const FALLEN_COS: f64 = 0.54;
/// Largest drop of the centre of mass of a robot that has not fallen, as a fraction of the planned height.
const FALLEN_PART: f64 = 0.5;

/// Reason why a tick has no set-points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
pub enum NoSetpoints {
    /// State that is not finite, or not plausible for this robot.
    #[error(
        "the state is not plausible: a value is missing, an angle is far beyond its joint's range, \
         or a speed is beyond that of any robot"
    )]
    Implausible,
    /// Robot that has fallen, or whose pose is wrong.
    #[error(
        "the robot has fallen, or its pose is wrong: it is tilted by more than 1 rad from its \
         plan, or is below half the planned height"
    )]
    Fallen,
    /// Program without solution.
    #[error("no setpoints meet the constraints")]
    Unsolved,
}

impl From<SolveError> for NoSetpoints {
    fn from(_: SolveError) -> Self {
        Self::Unsolved
    }
}

/// Set-point of a motor until the next tick: τ = kp (q* − q) + kd (q̇* − q̇) + torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// Desired position q*, rad.
    pub position_rad: f64,
    /// Desired speed q̇*, rad/s.
    pub speed_rad_s: f64,
    /// Feed-forward torque, N·m. With it the motor has the desired torque if the tick ends as predicted.
    pub torque_nm: f64,
    /// Stiffness kp, N·m/rad.
    pub kp_nm_rad: f64,
    /// Damping kd, N·m·s/rad.
    pub kd_nm_s_rad: f64,
}

/// Motor with the degrees of freedom that it moves.
#[derive(Clone, Debug)]
struct Channel {
    /// Indices in ν, with the radians of the motor per radian of each.
    ratios: Vec<(usize, f64)>,
    /// Indices in ν, with the factors by which generalised forces add up to the torque of the motor.
    torques: Vec<(usize, f64)>,
    kp_nm_rad: f64,
    kd_nm_s_rad: f64,
    torque_max_nm: f64,
}

/// State of an end effector at a tick.
#[derive(Clone, Debug)]
struct Foot {
    phase: Phase,
    /// Radius of the usable friction cone per normal force.
    friction: f64,
    /// Friction coefficient along a blade; `None` for feet and wheels.
    drag: Option<f64>,
    /// Jacobian of the material at the contact.
    jacobian: Matrix3xX<f64>,
    /// Acceleration J ν̇ that keeps the material at the contact still, m/s².
    still_m_s2: Vector3<f64>,
    /// Horizontal unit vector along the travel of a wheel or blade.
    along: Vector3<f64>,
    /// Horizontal unit vector perpendicular to the direction of travel.
    side: Vector3<f64>,
    force_n: Vector3<f64>,
    /// Planned contact or lowest point, m.
    planned: Vector3<f64>,
    /// Measured contact or lowest point, m.
    measured: Vector3<f64>,
    /// Planned height of the lowest point above the ground, m.
    height_m: f64,
    /// Normal of the ground.
    normal: Vector3<f64>,
}

impl Foot {
    fn stands(&self) -> bool {
        self.phase == Phase::Stance
    }
}

/// Tracking controller of one robot.
#[derive(Clone, Debug)]
pub struct Tracker {
    tree: Tree,
    weights: Weights,
    tick_s: f64,
    channels: Vec<Channel>,
    /// Planned angles of the motors of joints; empty for constant ratios.
    planned_rad: Vec<f64>,
    /// Angles of the motors of joints less ratios times angles; empty for constant ratios.
    offsets_rad: Vec<f64>,
    /// Degrees of freedom of passive joints, and of wheels without motors.
    undriven: Vec<usize>,
    planned: Kinematics,
    measured: Kinematics,
    composite: CompositeInertia,
    mass: DMatrix<f64>,
    bias: Vec<f64>,
    jacobian: Matrix3xX<f64>,
    row: DVector<f64>,
    feet: Vec<Foot>,
    errors: Errors,
    program: Program,
    solver: Solver,
    setpoints: Vec<Setpoint>,
    correction: Option<Correction>,
    recovery: Recovery,
    /// Latency from a measurement until its set-points act, s.
    latency_s: f64,
    /// Predicted state at the time at which set-points act.
    ahead: State,
    /// Generalised acceleration between measurement and that time, predicted by the previous tick.
    expected: DVector<f64>,
}

mod constraints;
mod objective;

/// Degrees of freedom of joints, with their ratios.
fn dofs_of(row: &[JointRatio]) -> Vec<(usize, f64)> {
    row.iter().map(|of| (JOINTS + of.joint, of.ratio)).collect()
}

/// True for a robot that must balance: only one or two driven wheels touch the ground.
pub fn balances(robot: &Robot) -> bool {
    let is_driven = |end: &EndEffector| end.contact.rolls() && end.contact.actuator().is_some();
    robot.end_effectors.len() <= 2 && robot.end_effectors.iter().all(is_driven)
}

impl Tracker {
    /// Creates a controller for a robot with turning wheels and rotors, which is called every `tick_s`.
    pub fn new(tree: Tree, mut weights: Weights, tick_s: f64) -> Self {
        let robot = tree.robot();
        if balances(robot) {
            weights.roll = weights.roll_balancing;
        }
        let motors = robot.channels().map(|channel| channel.actuator().clone());
        let ratios = tree.transmission().nominal();
        let joints = robot
            .driven_joints()
            .map(|joint| (dofs_of(ratios.ratios(joint)), dofs_of(ratios.torque_factors(joint))));
        let is_driven = |wheel: usize| robot.end_effectors[wheel].contact.actuator().is_some();
        let wheels = || tree.wheels().iter().map(|wheel| wheel.end_effector);
        let dof = |wheel: usize| tree.wheel_dof(wheel).expect("it spins");
        let driven = wheels().filter(|&wheel| is_driven(wheel)).map(dof);
        let driven = driven.map(|dof| (vec![(dof, 1.0)], vec![(dof, 1.0)]));
        let channels: Vec<Channel> = joints
            .chain(driven)
            .zip(motors)
            .map(|((ratios, torques), motor)| Channel {
                ratios,
                torques,
                kp_nm_rad: KP_PART * motor.kp_nm_rad,
                kd_nm_s_rad: KD_PART * motor.kd_nm_s_rad,
                torque_max_nm: motor.torque_max_nm,
            })
            .collect();
        let passive = (0..robot.joints.len()).filter(|&joint| robot.joints[joint].is_passive());
        let free_wheels = wheels().filter(|&wheel| !is_driven(wheel)).map(dof);
        let undriven: Vec<usize> = passive.map(|joint| JOINTS + joint).chain(free_wheels).collect();
        let dofs = tree.dofs();
        let feet: Vec<Foot> = robot
            .end_effectors
            .iter()
            .map(|end_effector| {
                let friction = weights.friction_part * end_effector.friction_coefficient;
                let is_blade = end_effector.contact.blade_length_m().is_some();
                let drag = end_effector.contact.drag().map_or(0.0, |drag| drag.rolling_resistance);
                Foot {
                    phase: Phase::Swing,
                    friction,
                    drag: is_blade.then_some(drag),
                    jacobian: Matrix3xX::zeros(dofs),
                    still_m_s2: Vector3::zeros(),
                    along: Vector3::x(),
                    side: Vector3::y(),
                    force_n: Vector3::zeros(),
                    planned: Vector3::zeros(),
                    measured: Vector3::zeros(),
                    height_m: 0.0,
                    normal: Vector3::z(),
                }
            })
            .collect();
        let drives = robot.end_effectors.iter().any(|of| of.contact.actuator().is_some());
        let nominal = State::nominal(&tree);
        let still = Kinematics::new(&tree, &nominal.configuration());
        let unknowns = dofs + 3 * feet.len();
        let equalities = JOINTS + undriven.len();
        let constraints = equalities + constraints::OF_CONTACT * feet.len() + 2 * channels.len();
        let mut program = Program::zeros(unknowns, constraints);
        program.equalities = equalities;
        Self {
            weights,
            tick_s,
            setpoints: vec![Setpoint::default(); channels.len()],
            channels,
            planned_rad: Vec::new(),
            offsets_rad: Vec::new(),
            undriven,
            composite: CompositeInertia::new(&tree, &still.frames),
            planned: still.clone(),
            measured: still,
            mass: DMatrix::zeros(dofs, dofs),
            bias: vec![0.0; dofs],
            jacobian: Matrix3xX::zeros(dofs),
            row: DVector::zeros(dofs),
            feet,
            errors: Errors::default(),
            program,
            solver: Solver::new(unknowns, constraints),
            tree,
            correction: None,
            recovery: Recovery::new(drives),
            latency_s: 0.0,
            ahead: nominal,
            expected: DVector::zeros(dofs),
        }
    }

    /// Sets the gains of the plan to track.
    pub fn with_gains(mut self, gains: Gains) -> Self {
        self.correction = Some(Correction::new(gains, &self.tree));
        self
    }

    /// Sets the latency from a measurement until set-points act, s, as on a bus.
    ///
    /// The controller acts on the state that it predicts for that time. Pass references for that time, too.
    pub fn with_latency(mut self, latency_s: f64) -> Self {
        self.latency_s = latency_s;
        self
    }

    /// Changes to the gains of a plan that begins where the previous one ends.
    ///
    /// The displacement of the plan and the foothold offsets are kept.
    pub fn change_gains(&mut self, gains: Gains) {
        match &mut self.correction {
            Some(correction) => correction.change_gains(gains),
            None => self.correction = Some(Correction::new(gains, &self.tree)),
        }
    }

    /// Sets the latency from a measurement until set-points act, s, from the next tick on.
    pub fn change_latency(&mut self, latency_s: f64) {
        self.latency_s = latency_s;
    }

    /// Displacement of the plan with the robot, m.
    pub fn anchor_m(&self) -> Vector2<f64> {
        self.recovery.anchor_m
    }

    /// Model of the robot.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Set-points of the previous tick that had a solution, in channel order.
    pub fn setpoints(&self) -> &[Setpoint] {
        &self.setpoints
    }

    /// True if the robot recovered from a push beyond the edge of its support at the previous tick.
    ///
    /// The set-points make the robot stand still. Servos that play its plan with the planned torques prevent more falls,
    /// because its steps catch it (docs/tracking.md, pushes).
    pub fn is_caught_by_steps(&self) -> bool {
        self.recovery.is_by_steps()
    }

    /// True if, at the previous tick, the robot recovered for the second time right after resuming its plan.
    ///
    /// The cause is not a push: the controller cannot track the plan, and servos that play it do better (docs/tracking.md).
    pub fn stumbles(&self) -> bool {
        self.recovery.stumbles()
    }

    /// Number of solver steps in the previous tick.
    pub fn steps(&self) -> u32 {
        self.solver.steps()
    }

    /// Computes the set-points of all channels, in channel order, from the measured state and the contact flag of each end
    /// effector.
    ///
    /// # Errors
    /// Returns an error if the state is implausible, if the robot has fallen, or if no set-points satisfy the constraints. The
    /// caller has to bring the robot to a safe state by other means.
    ///
    /// # Panics
    /// Panics if the reference or the state is for another robot: its vectors have other lengths.
    pub fn tick(
        &mut self,
        reference: &Reference,
        state: &State,
        touches: &[bool],
    ) -> Result<&[Setpoint], NoSetpoints> {
        let (joints, feet) = (self.tree.robot().joints.len(), self.feet.len());
        for of in [&reference.state, state] {
            let lengths = (of.joint_rad.len(), of.velocity.len());
            assert_eq!(lengths, (joints, self.tree.dofs()), "a state of another robot");
        }
        let lengths =
            (reference.acceleration.len(), reference.stands.len(), reference.force_n.len());
        assert_eq!(lengths, (self.tree.dofs(), feet, feet), "a reference of another robot");
        assert_eq!(touches.len(), feet, "contacts of another robot");
        let recovery = self.recovery;
        self.predict_state(state);
        let solved = match plausible::state(self.tree.robot(), state) {
            true => self.solve(reference, touches),
            false => Err(NoSetpoints::Implausible),
        };
        match solved {
            // A tick without a solution changes nothing.
            Err(_) => {
                self.recovery = recovery;
                self.expected.fill(0.0);
            }
            Ok(()) => self.keep(),
        }
        if self.is_caught_by_steps() {
            // Motors that play the plan have other torques.
            self.expected.fill(0.0);
        }
        solved.map(|()| &self.setpoints[..])
    }

    /// Predicts the state at the time at which set-points will act.
    fn predict_state(&mut self, state: &State) {
        let Self { ahead, expected, latency_s, .. } = self;
        let latency_s = *latency_s;
        ahead.velocity.copy_from_slice(&state.velocity);
        for (velocity, acceleration) in ahead.velocity.iter_mut().zip(expected.iter()) {
            *velocity += latency_s * acceleration;
        }
        // Displacement at the mean of the present and the future speed.
        let way = |k: usize| 0.5 * latency_s * (state.velocity[k] + ahead.velocity[k]);
        let three = |k: usize| Vector3::new(way(k), way(k + 1), way(k + 2));
        ahead.base_position_m = state.base_position_m + three(LINEAR);
        ahead.world_from_body = Rotation3::new(three(ANGULAR)).into_inner() * state.world_from_body;
        for (joint, (then, now)) in ahead.joint_rad.iter_mut().zip(&state.joint_rad).enumerate() {
            *then = now + way(JOINTS + joint);
        }
    }

    /// Computes the set-points.
    fn solve(&mut self, reference: &Reference, touches: &[bool]) -> Result<(), NoSetpoints> {
        self.prepare(reference, touches);
        if self.has_fallen(reference) {
            return Err(NoSetpoints::Fallen);
        }
        self.correct(reference);
        self.add_contact_task();
        self.add_body_tasks(reference);
        self.add_foot_tasks(reference);
        self.add_posture_task(reference);
        self.add_force_task(reference);
        self.update_linkages(reference);
        self.add_dynamics();
        self.add_limits();
        let Self { solver, program, feet, tree, expected, .. } = self;
        let x = solver.solve(program)?;
        expected.copy_from(&x.rows(0, tree.dofs()));
        for (j, foot) in feet.iter_mut().enumerate() {
            let at = tree.dofs() + 3 * j;
            foot.force_n = Vector3::new(x[at], x[at + 1], x[at + 2]);
        }
        for (number, (channel, setpoint)) in
            self.channels.iter().zip(&mut self.setpoints).enumerate()
        {
            let generalised = |dof: usize| {
                let mut torque_nm = self.bias[dof];
                for (other, row) in self.mass.row(dof).iter().enumerate() {
                    torque_nm += row * x[other];
                }
                for foot in self.feet.iter().filter(|foot| foot.stands()) {
                    torque_nm -= foot.jacobian.column(dof).dot(&foot.force_n);
                }
                torque_nm
            };
            let torque_nm: f64 =
                channel.torques.iter().map(|(dof, factor)| factor * generalised(*dof)).sum();
            let motor = |of: &dyn Fn(usize) -> f64| -> f64 {
                channel.ratios.iter().map(|(dof, ratio)| ratio * of(*dof)).sum()
            };
            let speed_of = |dof: usize| self.ahead.velocity[dof] + self.tick_s * x[dof];
            let speed_then = motor(&speed_of);
            let is_joint = channel.ratios[0].0 < self.tree.first_wheel_dof();
            let (position, position_then, wanted_speed) = if is_joint {
                let then =
                    |dof: usize| self.ahead.joint_rad[dof - JOINTS] + self.tick_s * speed_of(dof);
                let planned = &reference.state;
                let offset_rad = self.offsets_rad.get(number).copied().unwrap_or_default();
                let position = match self.planned_rad.get(number) {
                    Some(motor_rad) => *motor_rad,
                    None => motor(&|dof| planned.joint_rad[dof - JOINTS]),
                };
                (position, motor(&then) + offset_rad, motor(&|dof| planned.velocity[dof]))
            } else {
                // The plan has no wheel angles.
                (0.0, 0.0, speed_then)
            };
            *setpoint = Setpoint {
                position_rad: position,
                speed_rad_s: wanted_speed,
                torque_nm: torque_nm
                    - channel.kp_nm_rad * (position - position_then)
                    - channel.kd_nm_s_rad * (wanted_speed - speed_then),
                kp_nm_rad: channel.kp_nm_rad,
                kd_nm_s_rad: channel.kd_nm_s_rad,
            };
        }
        match self.setpoints.iter().all(|setpoint| setpoint.torque_nm.is_finite()) {
            true => Ok(()),
            false => Err(NoSetpoints::Unsolved),
        }
    }

    /// Updates the ratios of linkages to the state ahead.
    fn update_linkages(&mut self, reference: &Reference) {
        let transmission = self.tree.transmission();
        if !transmission.has_linkages() {
            return;
        }
        let ahead_rad = &self.ahead.joint_rad;
        let ratios = transmission.at(ahead_rad);
        let driven = self.tree.robot().driven_joints();
        for (joint, channel) in driven.zip(&mut self.channels) {
            channel.ratios = dofs_of(ratios.ratios(joint));
            channel.torques = dofs_of(ratios.torque_factors(joint));
        }
        let robot = self.tree.robot();
        let planned_rad = transmission.motors(&reference.state.joint_rad);
        self.planned_rad = robot.of_driven_joints(&planned_rad).collect();
        // Angles of motors are linear around the state ahead.
        let linear = ratios.motors(ahead_rad);
        let motors = transmission.motors(ahead_rad);
        let offsets_rad: Vec<_> =
            motors.iter().zip(linear).map(|(motor, linear)| motor - linear).collect();
        self.offsets_rad = robot.of_driven_joints(&offsets_rad).collect();
    }

    /// True if the robot has fallen.
    fn has_fallen(&self, reference: &Reference) -> bool {
        let Self { planned, measured, tree, errors, .. } = self;
        let up = |of: &Kinematics| of.frames.world_from_link[0] * Vector3::z();
        let com_m = Point3::from(measured.frames.com(tree));
        let plane_m = (reference.world_from_ground.inverse() * com_m).z;
        let height_m = plane_m - mean_height_m(reference);
        let lower_m = errors.height_m - height_m;
        up(planned).dot(&up(measured)) < FALLEN_COS || lower_m > FALLEN_PART * errors.height_m.abs()
    }

    /// Stores the state for the next tick.
    fn keep(&mut self) {
        let shift_m = self.recovery.follow(&self.errors);
        if let Some(correction) = &mut self.correction {
            correction.keep(shift_m);
        }
    }

    /// Updates kinematics and dynamics of the planned and the predicted state, and clears the program.
    fn prepare(&mut self, reference: &Reference, touches: &[bool]) {
        let Self { weights, tree, planned, measured, ahead, .. } = self;
        let ground_from_world = reference.world_from_ground.inverse();
        // Displacement along the plane of the ground.
        let normal = reference.world_from_ground.rotation * Vector3::z();
        let anchor_m = self.recovery.anchor_m;
        let rise_m = -normal.xy().dot(&anchor_m) / normal.z;
        let base_position_m =
            reference.state.base_position_m + Vector3::new(anchor_m.x, anchor_m.y, rise_m);
        let there = Configuration { base_position_m, ..reference.state.configuration() };
        planned.update(tree, &there, &reference.state.velocity);
        planned.accelerate(tree, &reference.acceleration);
        measured.update(tree, &ahead.configuration(), &ahead.velocity);
        self.composite.update(tree, &measured.frames);
        self.composite.mass_matrix(tree, &measured.frames, &mut self.mass);
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        measured.inverse_dynamics(tree, &gravity, &mut self.bias);
        self.program.hessian.fill(0.0);
        self.program.gradient.fill(0.0);
        self.program.normals.fill(0.0);
        for (j, foot) in self.feet.iter_mut().enumerate() {
            let of = &tree.robot().end_effectors[j];
            foot.normal = reference.world_from_ground.rotation * reference.ground_normal[j];
            let lowest = |at: &Kinematics| {
                let contact = RimContact::new(tree, &at.frames, j, &foot.normal);
                contact.map_or(at.frames.point(of.link, &of.center_in_link_m), |of| of.position())
            };
            (foot.planned, foot.measured) = (lowest(planned), lowest(measured));
            let plane_m = (ground_from_world * Point3::from(foot.planned)).z;
            foot.height_m = plane_m - reference.ground_height_m[j];
        }
        let (there, here) = (planned.frames.com(tree), measured.frames.com(tree));
        let height_m = (ground_from_world * Point3::from(there)).z - mean_height_m(reference);
        self.errors = Errors {
            from_plan_m: (here - there).xy(),
            velocity_m_s: measured.com_velocity(tree).xy(),
            planned_m_s: planned.com_velocity(tree).xy(),
            height_m,
            heading_rad: heading_rad(&planned.frames.world_from_link[0]),
        };
        self.recovery.update(&self.errors, self.tick_s);
        for (j, foot) in self.feet.iter_mut().enumerate() {
            let of = &tree.robot().end_effectors[j];
            let normal = foot.normal;
            let contact = RimContact::new(tree, &measured.frames, j, &normal);
            let center = planned.frames.point(of.link, &of.center_in_link_m);
            let as_planned = PlannedContact {
                stands: reference.stands[j],
                rises: planned.point_velocity(of.link, &center).dot(&normal) > 0.0,
            };
            let recovers = self.recovery.is_active();
            let is_needed = as_planned.stands || recovers;
            let plane_m = (ground_from_world * Point3::from(foot.measured)).z;
            let above_m = plane_m - reference.ground_height_m[j];
            let touches = contacts::touches(touches[j], is_needed, above_m / height_m);
            // A wheel whose axis is vertical has no contact point.
            foot.phase = contacts::phase(as_planned, touches && contact.is_some(), recovers);
            let Some(contact) = contact.filter(|_| foot.stands()) else { continue };
            contact.material_jacobian(tree, &measured.frames, &mut foot.jacobian);
            let motion = contact.motion(measured);
            foot.still_m_s2 = -motion.rolling_acceleration
                - motion.material_velocity * weights.contact_decay_per_s;
            // A foot has no rolling direction, so any direction along the ground serves.
            let along = contact.axis.cross(&normal).try_normalize(1e-9);
            let along = along.or_else(|| Vector3::y().cross(&normal).try_normalize(1e-9));
            foot.along = along.unwrap_or(Vector3::x());
            foot.side = normal.cross(&foot.along);
        }
    }

    /// Computes corrections from the deviations from the plan; without gains there are no corrections.
    fn correct(&mut self, reference: &Reference) {
        let Self { correction, tree, planned, measured, mass, feet, tick_s, .. } = self;
        let Some(correction) = correction else { return };
        let places = feet.iter().zip(&reference.force_n).map(|(foot, force_n)| TrackedPoint {
            planned: foot.planned,
            measured: foot.measured,
            force_n: foot.stands().then_some(*force_n),
        });
        let times = [reference.time_s, *tick_s];
        correction.update(tree, times, [planned, measured], mass, places);
    }
}

/// Mean height of the ground at the end effectors above its plane z = 0, m.
fn mean_height_m(reference: &Reference) -> f64 {
    let heights_m = &reference.ground_height_m;
    heights_m.iter().sum::<f64>() / heights_m.len() as f64
}

#[cfg(test)]
mod tests;
