//! Growth of small errors from cycle to cycle of a periodic motion that is played open loop. The servos have the gains of the
//! robot file and the plan's torques.
//!
//! The growth is the largest Floquet multiplier of the motion ([`cycle`]). The model is a rigid body on legs that yield like
//! springs and dampers. With all joints q, gains k_p of motors and springs, and ground forces f, legs yield by
//!
//! ```text
//! (k_p − G) δq = Jᵀ δf        G = ∂(Jᵀ f)/∂q        compliance C = J (k_p − G)⁻¹ Jᵀ
//! ```
//!
//! The model separates, to first order, motions whose errors decay from motions that fall. It omits early landing of swing
//! feet, the mass of the legs, slip and torque limits.

mod cycle;

use crate::motion::Ends;
use crate::plan::Plan;
use crate::sample::PlanSpline;
use cycle::{ContactLoad, Instant, Roll, growth};
use nalgebra::{DMatrix, Matrix3xX, Vector3};
use rollwalk_multibody::{JOINTS, Kinematics, RimContact, Tree};
use rollwalk_robot::{GRAVITY_M_S2, Joint};
use serde::Serialize;
use std::fmt;

/// Number of time steps in a cycle. Forces and stances are interpolated between 24 or more samples.
const INSTANTS: usize = 240;
/// Compliance of the ground: deflection under the whole weight, relative to the height of the centre of mass. Legs that are
/// rigid in one direction, such as those with two joints, would otherwise have a singular compliance.
const GROUND_YIELDS: f64 = 1e-4;

/// Growth per cycle above which errors count as growing. The computed growth of errors that merely persist, such as those of
/// wheels that never leave the ground, reaches up to this value.
const GROWS: f64 = 1.2;
/// Growth per cycle above which the value has no meaning: errors do not remain small for a cycle.
const BEYOND_FIRST_ORDER: f64 = 10.0;
/// Growth per cycle up to which errors vanish after a few cycles.
const DIES_OUT: f64 = 0.6;

/// Factor by which the errors of a periodic motion grow in a cycle: the largest Floquet multiplier. Multipliers of shifts along
/// the ground and turns about the vertical are left out, because the robot does not respond to them. Below 1, errors decay.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Growth(pub f64);

impl Growth {
    /// Returns true if errors grow enough that the motion may require feedback.
    pub fn is_much(self) -> bool {
        self.0 > GROWS
    }

    /// Returns true if errors vanish after a few cycles.
    pub fn dies_out(self) -> bool {
        self.0 <= DIES_OUT
    }
}

impl fmt::Display for Growth {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (growth, left) = (self.0, 100.0 * self.0);
        if self.is_much() {
            let fold = match growth > BEYOND_FIRST_ORDER {
                true => format!("more than {BEYOND_FIRST_ORDER}-fold"),
                false => format!("{growth:.1}-fold"),
            };
            write!(
                f,
                "without feedback, small errors grow {fold} per cycle, unless swing feet that land \
                 early catch the robot; increase `duty`, shorten the cycle or use stiffer servos \
                 to reduce the growth"
            )
        } else {
            let how = if self.dies_out() { "decay" } else { "hardly decay" };
            write!(
                f,
                "without feedback, small errors {how}: {left:.0} % of an error remains after a \
                 cycle, to first order"
            )
        }
    }
}

/// Computes the growth in a plan. `None` if the motion is not periodic, or if a leg buckles under its load.
pub fn per_cycle(plan: &Plan) -> Option<Growth> {
    if plan.motion.ends != Ends::Periodic {
        return None;
    }
    let tree = Tree::new(&plan.robot);
    let spline = PlanSpline::new(plan);
    let mut kinematics = Kinematics::new(&tree, &spline.rates(0.0, &tree).state.configuration());
    let step_s = plan.motion.duration_s / INSTANTS as f64;
    let instants: Option<Vec<_>> = (0..INSTANTS)
        .map(|k| {
            let time_s = (k as f64 + 0.5) * step_s;
            let rates = spline.rates(time_s, &tree);
            kinematics.update(&tree, &rates.state.configuration(), &rates.state.velocity);
            instant(plan, &tree, &kinematics, &spline, time_s)
        })
        .collect();
    growth(&instants?, step_s, plan.end_placement.yaw_rad).map(Growth)
}

/// State of robot and ground at one time.
fn instant(
    plan: &Plan,
    tree: &Tree,
    kinematics: &Kinematics,
    spline: &PlanSpline,
    time_s: f64,
) -> Option<Instant> {
    let robot = tree.robot();
    let frames = &kinematics.frames;
    let com = frames.com(tree);
    let planned = spline.planned_contacts(time_s);
    let rims: Option<Vec<_>> = (0..robot.end_effectors.len())
        .map(|j| {
            let foot = &robot.end_effectors[j];
            let center = frames.point(foot.link, &foot.center_in_link_m);
            RimContact::on(tree, frames, j, &spline.ground().contact(j, true, &center))
        })
        .collect();
    let rims = rims?;
    let stands = |j: &usize| planned[*j].share >= 1.0;
    let standing: Vec<usize> = (0..rims.len()).filter(stands).collect();

    let joints = robot.joints.len();
    let mut jacobian = DMatrix::zeros(3 * standing.len(), joints);
    let mut stiffness = DMatrix::zeros(joints, joints);
    for (motor, joint) in robot.joints.iter().enumerate() {
        let ratios = frames.ratios(tree).ratios(motor);
        for a in ratios {
            for b in ratios {
                stiffness[(a.joint, b.joint)] += a.ratio * b.ratio * joint.actuator.kp_nm_rad;
            }
        }
        stiffness[(motor, motor)] += joint.spring.unwrap_or_default().stiffness_nm_rad;
    }
    let mut columns = Matrix3xX::zeros(tree.dofs());
    for (row, &j) in standing.iter().enumerate() {
        // A wheel's spin is not a joint; it yields as `Roll`.
        frames.point_jacobian(tree, rims[j].link, &rims[j].position(), &mut columns);
        jacobian.view_mut((3 * row, 0), (3, joints)).copy_from(&columns.columns(JOINTS, joints));
        // ∂J_b/∂q_a = axis_a × J_b for a joint a that carries joint b, and vice versa.
        let chain = tree.joints_to_link(rims[j].link);
        for (k, &a) in chain.iter().enumerate() {
            for &b in &chain[k..] {
                let turned = frames.joint_axes[a].cross(&columns.column(JOINTS + b));
                let softer = turned.dot(&planned[j].force_n);
                stiffness[(a, b)] -= softer;
                if a != b {
                    stiffness[(b, a)] -= softer;
                }
            }
        }
    }
    let weight_n = tree.total_mass_kg() * GRAVITY_M_S2;
    let height_m = spline.ground().body().height_above_m(&com);
    // `try_inverse` instead of `solve`, which panics for a robot without joints.
    let mut compliance = &jacobian * stiffness.try_inverse()? * jacobian.transpose();
    (0..compliance.nrows()).for_each(|k| compliance[(k, k)] += GROUND_YIELDS * height_m / weight_n);
    Some(Instant {
        mass_kg: tree.total_mass_kg(),
        com,
        com_velocity: kinematics.com_velocity(tree),
        inertia_kg_m2: frames.centroidal_inertia(tree),
        stiffness_n_m: compliance.try_inverse()?,
        damping_s: damping_s(plan),
        contacts: rims
            .iter()
            .enumerate()
            .map(|(j, rim)| ContactLoad {
                position: rim.position(),
                force_n: stands(&j).then_some(planned[j].force_n),
                roll: roll(plan, kinematics, rim, &planned[j].force_n),
            })
            .collect(),
    })
}

/// Mean ratio of damping to stiffness of the joints, s.
fn damping_s(plan: &Plan) -> f64 {
    let joints = &plan.robot.joints;
    let ratio = |joint: &Joint| {
        let spring = joint.spring.unwrap_or_default();
        let damping_nm_s_rad = joint.actuator.kd_nm_s_rad + spring.damping_nm_s_rad;
        damping_nm_s_rad / (joint.actuator.kp_nm_rad + spring.stiffness_nm_rad)
    };
    joints.iter().map(ratio).sum::<f64>() / joints.len().max(1) as f64
}

/// Rolling of a wheel or blade along the ground. `None` for a contact that does not roll.
fn roll(
    plan: &Plan,
    kinematics: &Kinematics,
    rim: &RimContact,
    force_n: &Vector3<f64>,
) -> Option<Roll> {
    let j = rim.end_effector;
    let foot = &plan.robot.end_effectors[j];
    let along = rim.axis.cross(rim.normal()).try_normalize(1e-9)?;
    let mobility_m_ns = match (foot.contact.actuator(), foot.contact.drag()) {
        (Some(motor), _) if !plan.motion.held_wheels[j] => {
            foot.radius_m.powi(2) / motor.kd_nm_s_rad
        }
        (_, Some(drag)) => {
            // Slope of Eq. 2.6 at speed, where small errors do not change the sign.
            let drag_n_s_m = drag.rolling_drag_s_m * force_n.dot(rim.normal()).max(0.0);
            1.0 / drag_n_s_m.max(LEAST_DRAG_N_S_M)
        }
        _ => return None,
    };
    let speed_m_s = kinematics.point_velocity(rim.link, &rim.center).dot(&along);
    Some(Roll { along, velocity: along * speed_m_s, mobility_m_ns })
}

/// Smallest drag of a free wheel, N·s/m, for robot files without drag.
const LEAST_DRAG_N_S_M: f64 = 1e-3;
