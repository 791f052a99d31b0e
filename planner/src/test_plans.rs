//! Plans in closed form, for tests of the modules after the optimiser.
//!
//! The robot is a box on four legs that swing in the pitch plane, with a driven wheel at the end of each. All legs share one
//! angle φ(t). The body moves along x, and its height follows from wheels that stay on the ground. Forces and wheel speeds make
//! every residual of the discrete equations vanish.

use crate::families::{Family, Formulation};
use crate::motion::{Ends, Footing, Goal, Motion};
use crate::plan::{
    EndEffectorSample, FORMAT, Placement, Plan, Sample, SolveSummary, Status, VERSION,
};
use crate::torque;
use nalgebra::{DMatrix, DVector, Dyn, Isometry3, Matrix3, OMatrix, RowVector6, U6, Vector3};
use rollwalk_multibody::euler::{BASE_POSITION, JOINTS, Model, Pose};
use rollwalk_robot::shape::DEFAULT_CLEARANCE_MARGIN_M;
use rollwalk_robot::{Actuator, Contact, EndEffector, GRAVITY_M_S2, Joint, Link, Robot};
use std::f64::consts::TAU;

const LEG_M: f64 = 0.2;
const RADIUS_M: f64 = 0.05;

/// Motion of the box: body x and leg angle φ as functions of time.
pub struct BoxMotion {
    /// Kind of ends.
    pub ends: Ends,
    /// Duration, s.
    pub duration_s: f64,
    /// Number of samples.
    pub samples: usize,
    /// Body x, m.
    pub x_m: fn(f64) -> f64,
    /// Leg angle, rad.
    pub leg_rad: fn(f64) -> f64,
}

/// Smooth step from 0 to 1 with two vanishing derivatives at both ends.
fn smooth_step(u: f64) -> f64 {
    let u = u.clamp(0.0, 1.0);
    u * u * u * (10.0 - 15.0 * u + 6.0 * u * u)
}

/// Plan that drives 0.5 m forward in 2 s and bows, from rest to rest.
pub fn start_stop() -> Plan {
    BoxMotion {
        ends: Ends::AtRest,
        duration_s: 2.0,
        samples: 41,
        x_m: |t| 0.5 * smooth_step(t / 2.0),
        leg_rad: |t| 0.3 + 0.3 * (smooth_step(t) - smooth_step(t - 1.0)),
    }
    .plan("start-stop")
}

/// Periodic plan that rolls at 0.4 m/s with a sway, period 1.2 s.
pub fn cruise() -> Plan {
    BoxMotion {
        ends: Ends::Periodic,
        duration_s: 1.2,
        samples: 24,
        x_m: cruise_x,
        leg_rad: cruise_leg,
    }
    .plan("cruise")
}

/// Second and third quarter of [`cruise`], with prescribed ends.
pub fn cruise_middle() -> Plan {
    BoxMotion {
        ends: Ends::Prescribed,
        duration_s: 0.6,
        samples: 13,
        x_m: |t| straight_beyond(|t| cruise_x(t + 0.3), 0.6, t),
        leg_rad: |t| straight_beyond(|t| cruise_leg(t + 0.3), 0.6, t),
    }
    .plan("cruise-middle")
}

/// Evaluates `curve` from 0 to `end`, continued along its slope outside, as are the states beyond prescribed ends.
fn straight_beyond(curve: impl Fn(f64) -> f64, end: f64, t: f64) -> f64 {
    let inside = t.clamp(0.0, end);
    let slope = (curve(inside + 1e-6) - curve(inside - 1e-6)) / 2e-6;
    curve(inside) + slope * (t - inside)
}

fn cruise_x(t: f64) -> f64 {
    0.4 * t + 0.02 * (TAU * t / 1.2).sin()
}

fn cruise_leg(t: f64) -> f64 {
    0.4 + 0.2 * (TAU * t / 1.2 + 0.7).sin()
}

/// Box robot: hips at the corners of a 0.4 m × 0.3 m rectangle, wheels 0.2 m below.
pub fn robot() -> Robot {
    let actuator = |id: u8, kp: f64| Actuator {
        model: "test".to_owned(),
        speed_max_rad_s: if kp > 0.0 { 6.0 } else { 30.0 },
        torque_max_nm: 3.0,
        torque_speed: None,
        kp_nm_rad: kp,
        kd_nm_s_rad: 0.5,
        armature_kg_m2: 0.001,
        bus: 0,
        id,
    };
    let link = |name: &str, mass_kg: f64, com: [f64; 3], inertia: [f64; 3]| Link {
        name: name.to_owned(),
        mass_kg,
        com_in_link_m: com.into(),
        inertia_in_link_kg_m2: Matrix3::from_diagonal(&inertia.into()),
        shapes: Vec::new(),
    };
    let mut robot = Robot {
        name: "box".to_owned(),
        links: vec![link("body", 2.0, [0.0; 3], [0.02, 0.03, 0.04])],
        joints: Vec::new(),
        end_effectors: Vec::new(),
        buses: Default::default(),
        clearance_margin_m: DEFAULT_CLEARANCE_MARGIN_M,
    };
    let corners = [("fl", 0.2, 0.15), ("fr", 0.2, -0.15), ("rl", -0.2, 0.15), ("rr", -0.2, -0.15)];
    for (k, (name, x, y)) in corners.into_iter().enumerate() {
        robot.links.push(link(&format!("{name}-leg"), 0.2, [0.0, 0.0, -0.1], [7e-4, 7e-4, 1e-4]));
        robot.joints.push(Joint {
            name: format!("{name}-hip"),
            parent: 0,
            child: k + 1,
            parent_from_joint: Isometry3::translation(x, y, 0.0),
            axis_in_joint: Vector3::y(),
            travel_m_per_rad: None,
            position_min_rad: -1.0,
            position_max_rad: 1.0,
            nominal_rad: 0.3,
            actuator: actuator(k as u8 + 1, 20.0),
            motor_per_joint: Vec::new(),
            linkage: None,
            spring: None,
        });
        robot.end_effectors.push(EndEffector {
            name: format!("{name}-wheel"),
            link: k + 1,
            center_in_link_m: Vector3::new(0.0, 0.0, -LEG_M),
            radius_m: RADIUS_M,
            friction_coefficient: 0.8,
            contact: Contact::ActuatedWheel {
                axis_in_link: Vector3::y(),
                actuator: actuator(k as u8 + 11, 0.0),
            },
            soft: None,
        });
    }
    robot
}

impl BoxMotion {
    /// Forces, and their moments about the centre of mass, at the samples. They are linear in between. Their mean around every
    /// sample, with the weight 1 − |t|/h, is the change of momentum: second differences of the centre of mass, and differences
    /// of angular momentum over the intervals. `poses` begins two samples early.
    fn wrenches(&self, model: &Model, poses: &[Pose], h: f64) -> OMatrix<f64, Dyn, U6> {
        let mass_kg = model.total_mass_kg();
        let count = self.samples;
        let mut weights = DMatrix::zeros(count, count);
        let mut means = OMatrix::<f64, Dyn, U6>::zeros(count);
        for i in 0..count {
            let mut neighbours = vec![(i + count - 1) % count, (i + 1) % count];
            if self.ends != Ends::Periodic {
                neighbours.retain(|other| other.abs_diff(i) == 1);
            }
            let share = 1.0 / neighbours.len() as f64;
            for &other in &neighbours {
                weights[(i, i)] += 2.0 / 3.0 * share;
                weights[(i, other)] += 1.0 / 3.0 * share;
            }
            let k = i + 2;
            let per_mean = 2.0 * share / (h * h);
            let [before, here, after] = [&poses[k - 1], &poses[k], &poses[k + 1]];
            let change = (before.com - here.com * 2.0 + after.com) * per_mean;
            let force = (change + Vector3::z() * GRAVITY_M_S2) * mass_kg;
            let [swept_in, swept_out] = [(before, here), (here, after)]
                .map(|(from, to)| model.swept_moment(from, to).value);
            let moment = (swept_out - swept_in) * per_mean;
            let wrench = [force.x, force.y, force.z, moment.x, moment.y, moment.z];
            means.set_row(i, &RowVector6::from_row_slice(&wrench));
        }
        weights.lu().solve(&means).expect("diagonally dominant")
    }

    /// Plan of this drive on [`robot`].
    pub fn plan(&self, name: &str) -> Plan {
        let robot = robot();
        let model = Model::new(&robot);
        let intervals = match self.ends {
            Ends::Periodic => self.samples,
            Ends::AtRest | Ends::Prescribed => self.samples - 1,
        };
        let h = self.duration_s / intervals as f64;
        // Samples from one before to two after: forces need neighbours, speeds the next sample.
        let grid: Vec<(f64, f64)> = (-2..=self.samples as i64 + 1)
            .map(|i| {
                let t = i as f64 * h;
                let t = if self.ends == Ends::AtRest { t.clamp(0.0, self.duration_s) } else { t };
                ((self.x_m)(t), (self.leg_rad)(t))
            })
            .collect();
        let poses: Vec<Pose> =
            grid.iter().map(|&(x, leg)| model.pose(&q(&model, x, leg))).collect();
        let wrenches = self.wrenches(&model, &poses, h);
        let sample = |k: usize| {
            let (x, leg) = grid[k];
            let pose = &poses[k];
            // Beyond the ends those of the next period; at other ends they mean nothing.
            let wrench = wrenches.row((k + self.samples - 2) % self.samples).transpose();
            let force: Vector3<f64> = wrench.fixed_rows::<3>(0).into();
            let contacts: Vec<_> =
                pose.end_effectors.iter().map(|e| e.center - Vector3::z() * RADIUS_M).collect();
            // Front and rear share the vertical force so that the pitching moment Σ (z f_x − x f_z) about the centre of
            // mass is that of the legs.
            let (front, rear) = (contacts[0].x - pose.com.x, contacts[2].x - pose.com.x);
            let needed = -pose.com.z * force.x - wrench[4];
            let front_force = (needed - rear * force.z) / (front - rear);
            // The body and the swing of the leg move the wheel centres.
            let travel = |k: usize| grid[k].0 - LEG_M * grid[k].1.sin();
            let wheel_speed_rad_s = (travel(k + 1) - travel(k)) / h / RADIUS_M;
            let leg_speed = (grid[k + 1].1 - grid[k].1) / h;
            let end_effectors = contacts
                .iter()
                .enumerate()
                .map(|(j, contact)| EndEffectorSample {
                    contact: true,
                    position_m: (*contact).into(),
                    force_n: [
                        force.x / 4.0,
                        0.0,
                        if j < 2 { front_force / 2.0 } else { (force.z - front_force) / 2.0 },
                    ],
                    wheel_speed_rad_s,
                    motor_speed_rad_s: wheel_speed_rad_s - leg_speed,
                    motor_torque_nm: None,
                    tilt_rad: 0.0,
                    yaw_rad: 0.0,
                })
                .collect();
            Sample {
                time_s: (k as f64 - 2.0) * h,
                base_position_m: [x, 0.0, RADIUS_M + LEG_M * leg.cos()],
                base_yaw_pitch_roll_rad: [0.0; 3],
                base_orientation_wxyz: [1.0, 0.0, 0.0, 0.0],
                joint_rad: vec![leg; 4],
                joint_correction_rad: Vec::new(),
                joint_torque_nm: Vec::new(),
                com_m: pose.com.into(),
                end_effectors,
            }
        };
        let last = self.samples - 1;
        let samples: Vec<Sample> = (0..self.samples).map(|i| sample(i + 2)).collect();
        let outside = |k: usize, copied: usize| match self.ends {
            Ends::AtRest => Sample { time_s: (k as f64 - 2.0) * h, ..samples[copied].clone() },
            Ends::Periodic | Ends::Prescribed => sample(k),
        };
        let mut plan = Plan {
            format: FORMAT.to_owned(),
            version: VERSION,
            motion: Motion {
                name: name.to_owned(),
                duration_s: self.duration_s,
                ends: self.ends,
                stance: vec![vec![true; 4]; self.samples],
                swing_height_m: 0.03,
                goal: Goal::default(),
                posture_rad: vec![cruise_leg(0.0); 4],
                lying_rad: None,
                held_wheels: vec![false; 4],
                targets: Vec::new(),
                heights: Vec::new(),
                reserve: Default::default(),
                terrain: None,
                ground: Footing::default(),
                needs_feedback: None,
                timing: Default::default(),
            },
            sample_interval_s: h,
            before: outside(1, 0),
            after: outside(self.samples + 2, last),
            samples,
            end_placement: Placement {
                offset_m: match self.ends {
                    Ends::Periodic => [grid[self.samples + 2].0 - grid[2].0, 0.0],
                    Ends::AtRest | Ends::Prescribed => [grid[last + 2].0 - grid[2].0, 0.0],
                },
                yaw_rad: 0.0,
            },
            solve: SolveSummary {
                status: Status::Converged,
                iterations: 0,
                energy: 0.0,
                worst_level: 0.0,
                worst_constraint: Family::LinearDynamics,
                start: Default::default(),
                diagnosis: None,
                refinements: Vec::new(),
                timing: None,
            },
            formulation: Formulation::default(),
            robot,
        };
        torque::write(&mut plan);
        plan
    }
}

fn q(model: &Model, x_m: f64, leg_rad: f64) -> DVector<f64> {
    let mut q = DVector::zeros(model.dofs());
    q[BASE_POSITION] = x_m;
    q[BASE_POSITION + 2] = RADIUS_M + LEG_M * leg_rad.cos();
    q.rows_mut(JOINTS, 4).fill(leg_rad);
    q
}
