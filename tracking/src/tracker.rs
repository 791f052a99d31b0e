//! The tick: accelerations, ground forces and torques that come nearest to what is wanted and that floor, friction and motors
//! allow; inverse dynamics as one quadratic program.
//!
//! ```text
//! min   Σ weight |J ν̇ − wanted|²  +  weight |f − planned|²
//! with  M ν̇ + h = Σ Jᵀ f          where no motor is: the base, and wheels that turn freely
//!       f within a friction pyramid,   |M ν̇ + h − Σ Jᵀ f| ≤ most torque   where one is
//! ```
//!
//! The contact of a wheel is at its rim. Where the wheel rolls, the material there has J ν = 0 with the spin as a part of ν, and
//! J̇ is taken at the point of contact, which moves along the rim: at the centre, or with a point fixed to the tyre, a wheel
//! would be asked for forces that it cannot have.

use crate::contacts::{self, Phase, Planned, Recovery};
use crate::correction::{Correction, Place};
use crate::gains::Gains;
use crate::quadratic::{Program, Solver, Unsolved};
use crate::reference::Reference;
use crate::tasks::{Feedback, Squares, Weights, limited};
use nalgebra::{DMatrix, DVector, Matrix3xX, Point3, Vector2, Vector3};
use rollwalk_multibody::{
    ANGULAR, CompositeInertia, Configuration, JOINTS, Kinematics, RimContact, State, Tree, rotation,
};
use rollwalk_robot::GRAVITY_M_S2;
use std::f64::consts::FRAC_1_SQRT_2;

/// Gains that the drives themselves close around what a tick wants, as parts of those of the robot file: they act between ticks.
const KP_PART: f64 = 0.1;
const KD_PART: f64 = 0.2;

/// What a motor is to do until the next tick: τ = kp (q* − q) + kd (q̇* − q̇) + torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Setpoint {
    /// q*, rad.
    pub position_rad: f64,
    /// q̇*, rad/s.
    pub speed_rad_s: f64,
    /// On top, N·m: with it the motor has the wanted torque if the tick ends where it is expected to.
    pub torque_nm: f64,
    /// kp, N·m/rad.
    pub kp_nm_rad: f64,
    /// kd, N·m·s/rad.
    pub kd_nm_s_rad: f64,
}

/// A motor and where it is in ν.
#[derive(Clone, Copy, Debug)]
struct Channel {
    dof: usize,
    kp_nm_rad: f64,
    kd_nm_s_rad: f64,
    torque_max_nm: f64,
}

/// An end effector at this tick.
#[derive(Clone, Debug)]
struct Foot {
    phase: Phase,
    /// Whether it glides along itself.
    is_blade: bool,
    friction: f64,
    /// Friction along a blade, which hardly has any.
    friction_along: f64,
    /// Of the material at the contact.
    jacobian: Matrix3xX<f64>,
    /// Acceleration of the material there, J ν̇, that keeps it still.
    still_m_s2: Vector3<f64>,
    /// Horizontal directions: along the way of a wheel or blade, and to its side.
    along: Vector3<f64>,
    side: Vector3<f64>,
    force_n: Vector3<f64>,
    /// Contact, or lowest point, planned and measured, m.
    planned: Vector3<f64>,
    measured: Vector3<f64>,
    /// Planned height of the lowest point above the ground, m.
    height_m: f64,
}

impl Foot {
    fn stands(&self) -> bool {
        self.phase == Phase::Stance
    }
}

/// The controller of one robot.
#[derive(Clone, Debug)]
pub struct Tracker {
    tree: Tree,
    weights: Weights,
    tick_s: f64,
    channels: Vec<Channel>,
    /// Degrees of freedom without a motor besides those of the base.
    free_wheels: Vec<usize>,
    planned: Kinematics,
    measured: Kinematics,
    composite: CompositeInertia,
    mass: DMatrix<f64>,
    bias: Vec<f64>,
    jacobian: Matrix3xX<f64>,
    row: DVector<f64>,
    feet: Vec<Foot>,
    /// Normal of the ground, and planned height of the centre of mass above it, m.
    normal: Vector3<f64>,
    height_m: f64,
    program: Program,
    solver: Solver,
    setpoints: Vec<Setpoint>,
    correction: Option<Correction>,
    recovery: Recovery,
}

/// How far below the planned ground an end effector aims that has to land, m.
const BELOW_M: f64 = 0.02;

/// Inequalities of a contact: four sides of the pyramid, and no pull.
const OF_CONTACT: usize = 5;

impl Tracker {
    /// A controller for a robot with turning wheels and rotors, that is called every `tick_s`.
    pub fn new(tree: Tree, weights: Weights, tick_s: f64) -> Self {
        let robot = tree.robot();
        let motors = robot.channels().map(|channel| channel.actuator().clone());
        let joints = (0..robot.joints.len()).map(|joint| JOINTS + joint);
        let is_driven = |wheel: usize| robot.end_effectors[wheel].contact.actuator().is_some();
        let wheels = || tree.wheels().iter().map(|wheel| wheel.end_effector);
        let dof = |wheel: usize| tree.wheel_dof(wheel).expect("it spins");
        let driven = wheels().filter(|&wheel| is_driven(wheel)).map(dof);
        let channels: Vec<Channel> = joints
            .chain(driven)
            .zip(motors)
            .map(|(dof, motor)| Channel {
                dof,
                kp_nm_rad: KP_PART * motor.kp_nm_rad,
                kd_nm_s_rad: KD_PART * motor.kd_nm_s_rad,
                torque_max_nm: motor.torque_max_nm,
            })
            .collect();
        let free_wheels: Vec<usize> =
            wheels().filter(|&wheel| !is_driven(wheel)).map(dof).collect();
        let dofs = tree.dofs();
        let feet: Vec<Foot> = robot
            .end_effectors
            .iter()
            .map(|end_effector| {
                let friction =
                    weights.friction_part * FRAC_1_SQRT_2 * end_effector.friction_coefficient;
                let is_blade = end_effector.contact.blade_length_m().is_some();
                let drag = end_effector.contact.drag().map_or(0.0, |drag| drag.rolling_resistance);
                Foot {
                    phase: Phase::Swing,
                    is_blade,
                    friction,
                    friction_along: if is_blade { drag } else { friction },
                    jacobian: Matrix3xX::zeros(dofs),
                    still_m_s2: Vector3::zeros(),
                    along: Vector3::x(),
                    side: Vector3::y(),
                    force_n: Vector3::zeros(),
                    planned: Vector3::zeros(),
                    measured: Vector3::zeros(),
                    height_m: 0.0,
                }
            })
            .collect();
        let still = Kinematics::new(&tree, &State::nominal(&tree).configuration());
        let unknowns = dofs + 3 * feet.len();
        let equalities = JOINTS + free_wheels.len();
        let constraints = equalities + OF_CONTACT * feet.len() + 2 * channels.len();
        let mut program = Program::zeros(unknowns, constraints);
        program.equalities = equalities;
        Self {
            weights,
            tick_s,
            setpoints: vec![Setpoint::default(); channels.len()],
            channels,
            free_wheels,
            composite: CompositeInertia::new(&tree, &still.frames),
            planned: still.clone(),
            measured: still,
            mass: DMatrix::zeros(dofs, dofs),
            bias: vec![0.0; dofs],
            jacobian: Matrix3xX::zeros(dofs),
            row: DVector::zeros(dofs),
            feet,
            normal: Vector3::z(),
            height_m: 0.0,
            program,
            solver: Solver::new(unknowns, constraints),
            tree,
            correction: None,
            recovery: Recovery::default(),
        }
    }

    /// The same with gains of the plan that it is to track.
    pub fn with_gains(mut self, gains: Gains) -> Self {
        self.correction = Some(Correction::new(gains, &self.tree));
        self
    }

    /// The robot.
    pub fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Steps of the solver in the last tick.
    pub fn steps(&self) -> u32 {
        self.solver.steps()
    }

    /// Setpoints of all channels, in channel order, for a state that was measured, and whether each end effector touches the ground.
    ///
    /// # Errors
    /// No setpoints meet the constraints, for example because the state is not finite. The caller has to bring the robot to a safe
    /// state by other means.
    ///
    /// # Panics
    /// The reference or the state is of another robot: its vectors have other lengths.
    pub fn tick(
        &mut self,
        reference: &Reference,
        state: &State,
        touches: &[bool],
    ) -> Result<&[Setpoint], Unsolved> {
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
        let solved = self.solve(reference, state, touches);
        match solved {
            // A tick without a solution leaves no trace.
            Err(_) => self.recovery = recovery,
            Ok(()) => self.keep(),
        }
        solved.map(|()| &self.setpoints[..])
    }

    /// Finds the setpoints.
    fn solve(
        &mut self,
        reference: &Reference,
        state: &State,
        touches: &[bool],
    ) -> Result<(), Unsolved> {
        self.prepare(reference, state, touches);
        self.correct(reference);
        self.want_contacts();
        self.want_body(reference);
        self.want_feet(reference, state);
        self.want_posture(reference, state);
        self.want_forces(reference);
        self.keep_dynamics();
        self.keep_limits();
        let Self { solver, program, feet, tree, .. } = self;
        let x = solver.solve(program)?;
        for (j, foot) in feet.iter_mut().enumerate() {
            let at = tree.dofs() + 3 * j;
            foot.force_n = Vector3::new(x[at], x[at + 1], x[at + 2]);
        }
        for (channel, setpoint) in self.channels.iter().zip(&mut self.setpoints) {
            let acceleration = x[channel.dof];
            let mut torque_nm = self.bias[channel.dof];
            for (dof, row) in self.mass.row(channel.dof).iter().enumerate() {
                torque_nm += row * x[dof];
            }
            for foot in self.feet.iter().filter(|foot| foot.stands()) {
                torque_nm -= foot.jacobian.column(channel.dof).dot(&foot.force_n);
            }
            let speed = state.velocity[channel.dof];
            let speed_then = speed + self.tick_s * acceleration;
            let is_joint = channel.dof < self.tree.first_wheel_dof();
            let (position, position_then, wanted_speed) = if is_joint {
                let joint = channel.dof - JOINTS;
                let then = state.joint_rad[joint] + self.tick_s * speed_then;
                (reference.state.joint_rad[joint], then, reference.state.velocity[channel.dof])
            } else {
                // Where a wheel has turned to is nobody's plan.
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
            false => Err(Unsolved::NotConvex),
        }
    }

    /// Keeps what the next tick begins with.
    fn keep(&mut self) {
        let Self { correction, tree, planned, measured, height_m, .. } = self;
        let Some(correction) = correction else { return };
        let com = |at: &Kinematics| at.frames.com(tree).xy();
        correction.keep(com(measured) - com(planned), *height_m);
    }

    /// Kinematics and dynamics at both states, and an empty program.
    fn prepare(&mut self, reference: &Reference, state: &State, touches: &[bool]) {
        let Self { weights, tree, planned, measured, .. } = self;
        let ground_from_world = reference.world_from_ground.inverse();
        self.normal = reference.world_from_ground.rotation * Vector3::z();
        let normal = self.normal;
        // Along the ground.
        let anchor_m = self.correction.as_ref().map_or(Vector2::zeros(), |of| of.anchor_m);
        let rise_m = -normal.xy().dot(&anchor_m) / normal.z;
        let base_position_m =
            reference.state.base_position_m + Vector3::new(anchor_m.x, anchor_m.y, rise_m);
        let there = Configuration { base_position_m, ..reference.state.configuration() };
        planned.update(tree, &there, &reference.state.velocity);
        planned.accelerate(tree, &reference.acceleration);
        measured.update(tree, &state.configuration(), &state.velocity);
        self.composite.update(tree, &measured.frames);
        self.composite.mass_matrix(tree, &measured.frames, &mut self.mass);
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        measured.inverse_dynamics(tree, &gravity, &mut self.bias);
        self.program.hessian.fill(0.0);
        self.program.gradient.fill(0.0);
        self.program.normals.fill(0.0);
        for (j, foot) in self.feet.iter_mut().enumerate() {
            let of = &tree.robot().end_effectors[j];
            let lowest = |at: &Kinematics| {
                let contact = RimContact::new(tree, &at.frames, j, &normal);
                contact.map_or(at.frames.point(of.link, &of.center_in_link_m), |of| of.position())
            };
            (foot.planned, foot.measured) = (lowest(planned), lowest(measured));
            foot.height_m = (ground_from_world * Point3::from(foot.planned)).z;
        }
        let (there, here) = (planned.frames.com(tree), measured.frames.com(tree));
        let velocity = measured.com_velocity(tree) - planned.com_velocity(tree);
        self.height_m = (ground_from_world * Point3::from(there)).z;
        self.recovery.update((here - there).xy(), velocity.xy(), self.height_m);
        for (j, foot) in self.feet.iter_mut().enumerate() {
            let of = &tree.robot().end_effectors[j];
            let contact = RimContact::new(tree, &measured.frames, j, &normal);
            let center = planned.frames.point(of.link, &of.center_in_link_m);
            let as_planned = Planned {
                stands: reference.stands[j],
                height_m: foot.height_m,
                rises_m_s: planned.point_velocity(of.link, &center).dot(&normal),
            };
            // A wheel that lies flat has no contact to stand on.
            let touches = touches[j] && contact.is_some();
            foot.phase = contacts::phase(as_planned, touches, self.recovery.is_active);
            let Some(contact) = contact.filter(|_| foot.stands()) else { continue };
            contact.material_jacobian(tree, &measured.frames, &mut foot.jacobian);
            let motion = contact.motion(measured);
            foot.still_m_s2 = -motion.rolling_acceleration
                - motion.material_velocity * weights.contact_decay_per_s;
            // A foot has no way of its own: any direction along the ground is as good.
            let along = contact.axis.cross(&normal).try_normalize(1e-9);
            let along = along.or_else(|| Vector3::y().cross(&normal).try_normalize(1e-9));
            foot.along = along.unwrap_or(Vector3::x());
            foot.side = normal.cross(&foot.along);
        }
    }

    /// Computes corrections from the errors to the plan; without gains there are none.
    fn correct(&mut self, reference: &Reference) {
        let Self { correction, tree, planned, measured, mass, feet, tick_s, .. } = self;
        let Some(correction) = correction else { return };
        let places = feet.iter().zip(&reference.force_n).map(|(foot, force_n)| Place {
            planned: foot.planned,
            measured: foot.measured,
            force_n: foot.stands().then_some(*force_n),
        });
        correction.update(tree, [reference.time_s, *tick_s], [planned, measured], mass, places);
    }

    /// Contacts stay: the material at a contact that rolls or rests keeps still.
    fn want_contacts(&mut self) {
        let Self { weights, program, row, feet, normal, .. } = self;
        let mut squares = Squares { program };
        for foot in feet.iter().filter(|foot| foot.stands()) {
            if !foot.is_blade {
                squares.add(weights.contact, &foot.jacobian, &foot.still_m_s2);
                continue;
            }
            for direction in [foot.side, *normal] {
                row.gemv_tr(1.0, &foot.jacobian, &direction, 0.0);
                let still = direction.dot(&foot.still_m_s2);
                squares.add_row(weights.contact, row.as_view(), still);
            }
        }
    }

    /// Centre of mass and body follow the plan.
    fn want_body(&mut self, reference: &Reference) {
        let Self {
            weights, tree, planned, measured, program, jacobian, correction, recovery, ..
        } = self;
        let mut squares = Squares { program };
        let (there, here) = (&planned.frames, &measured.frames);
        let place = there.com(tree) - here.com(tree);
        let speed = planned.com_velocity(tree) - measured.com_velocity(tree);
        // Far from the plan its linear model says little: there each task finds its way by itself, which survives larger pushes.
        let correction = correction.as_ref().filter(|_| !recovery.is_active);
        let feedback = match correction {
            Some(correction) => limited(correction.com_m_s2, weights.com_most_m_s2),
            None => weights.com_feedback.limited(&place, &speed, weights.com_most_m_s2),
        };
        let wanted = planned.com_acceleration(tree) + feedback;
        here.com_jacobian(tree, jacobian);
        squares.add(weights.com, jacobian, &(wanted - measured.com_acceleration(tree)));
        let turn = rotation::log(&(there.world_from_link[0] * here.world_from_link[0].transpose()));
        let spin = planned.angular_velocity[0] - measured.angular_velocity[0];
        let feedback = match correction {
            Some(correction) => limited(correction.body_rad_s2, weights.body_most_rad_s2),
            None => weights.body_feedback.limited(&turn, &spin, weights.body_most_rad_s2),
        };
        for k in 0..3 {
            let wanted = reference.acceleration[ANGULAR + k] + feedback[k];
            squares.add_one(weights.body, ANGULAR + k, wanted);
        }
    }

    /// Feet in the air follow the plan; wheels on the ground go as fast as it says.
    fn want_feet(&mut self, reference: &Reference, state: &State) {
        let Self {
            weights,
            tree,
            planned,
            measured,
            program,
            jacobian,
            row,
            feet,
            correction,
            normal,
            ..
        } = self;
        for (end_effector, (j, foot)) in
            tree.robot().end_effectors.iter().zip(feet.iter().enumerate())
        {
            let link = end_effector.link;
            let center = |at: &Kinematics| at.frames.point(link, &end_effector.center_in_link_m);
            let (mut there, here) = (center(planned), center(measured));
            let mut speed =
                planned.point_velocity(link, &there) - measured.point_velocity(link, &here);
            let bias = measured.point_acceleration(link, &here);
            let mut planned_acceleration = planned.point_acceleration(link, &there);
            if let Some(correction) = correction {
                speed += correction.speed_m_s[j];
                there += correction.foothold_m[j];
            }
            let mut squares = Squares { program };
            if foot.phase == Phase::Landing {
                // Whatever height the plan has for it, and however it goes there.
                there -= *normal * (BELOW_M + foot.height_m.max(0.0));
                planned_acceleration -= *normal * planned_acceleration.dot(normal);
                speed -= *normal * (speed + measured.point_velocity(link, &here)).dot(normal);
            }
            if !foot.stands() {
                let wanted =
                    planned_acceleration + weights.swing_feedback.of(&(there - here), &speed);
                measured.frames.point_jacobian(tree, link, &here, jacobian);
                squares.add(weights.swing, jacobian, &(wanted - bias));
                if let Some(dof) = tree.wheel_dof(j) {
                    let speed = reference.state.velocity[dof] - state.velocity[dof];
                    let wanted = reference.acceleration[dof] + weights.spin_per_s * speed;
                    squares.add_one(weights.posture, dof, wanted);
                }
            } else if end_effector.contact.rolls() {
                // With gains, the place is theirs to feed back.
                let place = if correction.is_some() { Vector3::zeros() } else { there - here };
                let wanted = planned_acceleration + weights.roll_feedback.of(&place, &speed) - bias;
                measured.frames.point_jacobian(tree, link, &here, jacobian);
                row.gemv_tr(1.0, jacobian, &foot.along, 0.0);
                squares.add_row(weights.roll, row.as_view(), foot.along.dot(&wanted));
            }
        }
    }

    /// Joints stay near the planned posture where nothing else needs them.
    fn want_posture(&mut self, reference: &Reference, state: &State) {
        let Feedback { per_s2, per_s } = self.weights.posture_feedback;
        let mut squares = Squares { program: &mut self.program };
        for (joint, (there, here)) in
            reference.state.joint_rad.iter().zip(&state.joint_rad).enumerate()
        {
            let dof = JOINTS + joint;
            let speed = reference.state.velocity[dof] - state.velocity[dof];
            let wanted = reference.acceleration[dof] + per_s2 * (there - here) + per_s * speed;
            squares.add_one(self.weights.posture, dof, wanted);
        }
    }

    /// Ground forces stay near the planned ones; of feet in the air they are 0.
    fn want_forces(&mut self, reference: &Reference) {
        let weight_n = self.tree.total_mass_kg() * GRAVITY_M_S2;
        let price = self.weights.force / (weight_n * weight_n);
        let mut squares = Squares { program: &mut self.program };
        for (j, foot) in self.feet.iter().enumerate() {
            let change = self.correction.as_ref().map_or(Vector3::zeros(), |of| of.force_n[j]);
            let planned =
                if foot.stands() { reference.force_n[j] + change } else { Vector3::zeros() };
            for k in 0..3 {
                squares.add_one(price, self.tree.dofs() + 3 * j + k, planned[k]);
            }
        }
    }

    /// M ν̇ + h = Σ Jᵀ f where no motor is.
    fn keep_dynamics(&mut self) {
        let free = (0..JOINTS).chain(self.free_wheels.iter().copied());
        for (constraint, dof) in free.enumerate() {
            write_torque(&mut self.program, constraint, dof, 1.0, &self.mass, &self.feet);
            self.program.bounds[constraint] = -self.bias[dof];
        }
    }

    /// Friction, no pull of the ground, and torques within the motors' limits.
    fn keep_limits(&mut self) {
        let dofs = self.tree.dofs();
        let mut constraint = self.program.equalities;
        for (j, foot) in self.feet.iter().enumerate().filter(|(_, foot)| foot.stands()) {
            let sides = [
                self.normal * foot.friction_along - foot.along,
                self.normal * foot.friction_along + foot.along,
                self.normal * foot.friction - foot.side,
                self.normal * foot.friction + foot.side,
                self.normal,
            ];
            for side in sides {
                for k in 0..3 {
                    self.program.normals[(dofs + 3 * j + k, constraint)] = side[k];
                }
                self.program.bounds[constraint] = 0.0;
                constraint += 1;
            }
        }
        for channel in &self.channels {
            for sign in [1.0, -1.0] {
                let Self { program, mass, feet, .. } = self;
                write_torque(program, constraint, channel.dof, sign, mass, feet);
                program.bounds[constraint] = -channel.torque_max_nm - sign * self.bias[channel.dof];
                constraint += 1;
            }
        }
        self.program.constraints = constraint;
    }
}

/// Writes the torque of a degree of freedom without its bias, times a sign, as the normal of a constraint.
fn write_torque(
    program: &mut Program,
    constraint: usize,
    dof: usize,
    sign: f64,
    mass: &DMatrix<f64>,
    feet: &[Foot],
) {
    let dofs = mass.ncols();
    let mut normal = program.normals.column_mut(constraint);
    for other in 0..dofs {
        normal[other] = sign * mass[(dof, other)];
    }
    for (j, foot) in feet.iter().enumerate().filter(|(_, foot)| foot.stands()) {
        for k in 0..3 {
            normal[dofs + 3 * j + k] = -sign * foot.jacobian[(k, dof)];
        }
    }
}

#[cfg(test)]
mod tests;
