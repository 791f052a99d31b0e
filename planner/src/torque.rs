//! Motor torques of a plan as played: inverse dynamics of the whole robot, τ = M ν̇ + h − Σ Jᵀ f.
//!
//! The optimiser satisfies the dynamics in the mean around its samples, without rotors and turning wheels. The inverse dynamics
//! here use the played motion ([`crate::sample`]) at every time, with rotors and wheels. The planned ground forces therefore do
//! not exactly balance the base, which no motor drives. `ground_forces` finds the nearest forces that do. The rest, which no
//! ground contact can supply, is the unmet force and moment.

mod ground_forces;
#[cfg(test)]
mod tests;

use crate::motion::Ends;
use crate::plan::{Plan, Sample};
use crate::sample::{PlanSpline, PlannedContact, Rates};
use ground_forces::{RequiredWrench, Support};
use nalgebra::{Matrix3xX, Vector3};
use rollwalk_multibody::{JOINTS, Kinematics, RimContact, Tree, WHEEL_MASS_SHARE, about_com};
use rollwalk_robot::{EndEffector, GRAVITY_M_S2, Robot};

/// Largest share of a contact that counts as no contact, to allow for rounding of the time.
const NO_SHARE: f64 = 1e-9;

/// Smallest unit of levers, m, for a robot whose centre of mass is near the ground or below it.
const LEVER_MIN_M: f64 = 0.01;

/// Inverse dynamics along a plan.
pub struct InverseDynamics {
    tree: Tree,
    spline: PlanSpline,
    kinematics: Kinematics,
}

/// Motor torques and ground forces at one time.
#[derive(Clone, Debug, PartialEq)]
pub struct Actuation {
    /// Torque of every joint's motor, in joint order, N·m. Without a coupling, it acts about the joint's axis on the child. For
    /// a passive joint, the torque that its spring does not balance.
    pub joint_nm: Vec<f64>,
    /// Torque of every wheel's motor on the wheel about the axis in the robot file, in end-effector order, N·m. `None` without
    /// a motor.
    pub motor_nm: Vec<Option<f64>>,
    /// Force of the ground on every end effector, N, in the world frame. Forces of a periodic motion are in the frame of its
    /// first period.
    pub force_n: Vec<Vector3<f64>>,
    /// Force that the motion needs beyond the contacts, N, in the frame of `force_n`.
    pub unmet_force_n: Vector3<f64>,
    /// Moment about the centre of mass that the motion needs beyond the contacts, N·m.
    pub unmet_moment_nm: Vector3<f64>,
}

impl Actuation {
    /// Torques in channel order: joints with a motor, then driven wheels, N·m.
    pub fn channels_nm<'a>(&'a self, robot: &'a Robot) -> impl Iterator<Item = f64> + 'a {
        robot.of_driven_joints(&self.joint_nm).chain(self.motor_nm.iter().flatten().copied())
    }
}

impl InverseDynamics {
    /// Prepares a validated plan.
    pub fn new(plan: &Plan) -> Self {
        let tree = tree(&plan.robot);
        let spline = PlanSpline::new(plan);
        let kinematics = Kinematics::new(&tree, &spline.rates(0.0, &tree).state.configuration());
        Self { tree, spline, kinematics }
    }

    /// Returns the robot with its wheels and rotors as bodies.
    pub(crate) fn tree(&self) -> &Tree {
        &self.tree
    }

    /// Returns the plan as a function of time.
    pub(crate) fn spline(&self) -> &PlanSpline {
        &self.spline
    }

    /// Torques and forces at `plan_time_s`. A periodic motion repeats; other motions stay at their ends.
    pub fn at(&mut self, plan_time_s: f64) -> Actuation {
        self.moving(plan_time_s).2
    }

    /// Motion, planned contacts, torques and forces at `plan_time_s`.
    pub(crate) fn moving(&mut self, plan_time_s: f64) -> (Rates, Vec<PlannedContact>, Actuation) {
        let (tree, kinematics) = (&self.tree, &mut self.kinematics);
        let rates = self.spline.rates(plan_time_s, tree);
        kinematics.update(tree, &rates.state.configuration(), &rates.state.velocity);
        kinematics.accelerate(tree, &rates.acceleration);
        let mut generalised = vec![0.0; tree.dofs()];
        let gravity = Vector3::new(0.0, 0.0, -GRAVITY_M_S2);
        kinematics.inverse_dynamics(tree, &gravity, &mut generalised);

        let com = kinematics.frames.com(tree);
        let base_to_com = com - kinematics.frames.link_origins[0];
        let planned = self.spline.planned_contacts(plan_time_s);
        let ground = self.spline.ground();
        let contacts: Vec<(RimContact, Support)> = planned
            .iter()
            .enumerate()
            .filter(|(_, planned)| planned.share > NO_SHARE)
            .filter_map(|(j, planned)| {
                let end = &tree.robot().end_effectors[j];
                let center = kinematics.frames.point(end.link, &end.center_in_link_m);
                let map = ground.contact(j, true, &center);
                let contact = RimContact::on(tree, &kinematics.frames, j, &map)?;
                let foot = &tree.robot().end_effectors[j];
                let above_m = map.height_above_m(&contact.position());
                let support = Support::new(foot, &contact, above_m, kinematics, planned, &com);
                Some((contact, support))
            })
            .collect();
        let wanted = RequiredWrench {
            wrench: about_com(&generalised, &base_to_com),
            weight_n: tree.total_mass_kg() * GRAVITY_M_S2,
            height_m: ground.body().height_above_m(&com).max(LEVER_MIN_M),
        };
        let supports: Vec<&Support> = contacts.iter().map(|(_, support)| support).collect();
        let forces = ground_forces::nearest(&supports, &wanted);

        let mut unmet = wanted.wrench;
        let mut force_n = vec![Vector3::zeros(); tree.robot().end_effectors.len()];
        let mut jacobian = Matrix3xX::zeros(tree.dofs());
        for ((contact, support), force) in contacts.iter().zip(&forces) {
            contact.material_jacobian(tree, &kinematics.frames, &mut jacobian);
            for (dof, column) in jacobian.column_iter().enumerate().skip(JOINTS) {
                generalised[dof] -= column.dot(force);
            }
            unmet -= support.wrench(force);
            force_n[contact.end_effector] = *force;
        }
        let joints = tree.robot().joints.len();
        let feet = tree.robot().end_effectors.iter().enumerate();
        let motor = |(j, foot): (usize, &EndEffector)| {
            foot.contact.actuator().and_then(|_| tree.wheel_dof(j)).map(|dof| generalised[dof])
        };
        let actuation = Actuation {
            motor_nm: feet.map(motor).collect(),
            joint_nm: (kinematics.frames.ratios(tree))
                .motor_torques(&generalised[JOINTS..JOINTS + joints]),
            force_n,
            unmet_force_n: unmet.fixed_rows::<3>(0).into(),
            unmet_moment_nm: unmet.fixed_rows::<3>(3).into(),
        };
        (rates, planned, actuation)
    }
}

/// Writes the torques of a plan into its samples, and into the states before and after it.
pub(crate) fn write(plan: &mut Plan) {
    let mut inverse = InverseDynamics::new(plan);
    for sample in &mut plan.samples {
        let actuation = inverse.at(sample.time_s);
        sample.joint_torque_nm = actuation.joint_nm;
        for (end_effector, torque_nm) in sample.end_effectors.iter_mut().zip(actuation.motor_nm) {
            end_effector.motor_torque_nm = torque_nm;
        }
    }
    let [first, last] = [0, plan.samples.len() - 1].map(|index| plan.samples[index].clone());
    let [before, after] = match plan.motion.ends {
        Ends::Periodic => [&last, &first],
        Ends::AtRest | Ends::Prescribed => [&first, &last],
    };
    copy(before, &mut plan.before);
    copy(after, &mut plan.after);
}

/// Copies the torques of a sample.
fn copy(from: &Sample, to: &mut Sample) {
    to.joint_torque_nm.clone_from(&from.joint_torque_nm);
    for (from, to) in from.end_effectors.iter().zip(&mut to.end_effectors) {
        to.motor_torque_nm = from.motor_torque_nm;
    }
}

/// Builds the robot with its wheels and rotors as bodies. A wheel is a thin disc with a fraction of its link's mass, divided
/// among the wheels of the link. The inertia of the wheels is at most half of the link's.
pub(crate) fn tree(robot: &Robot) -> Tree {
    let disc = |foot: &EndEffector| {
        let link = &robot.links[foot.link];
        let sharing = robot.end_effectors.iter().filter(|other| other.link == foot.link).count();
        let axis = foot.contact.axis_in_link().copied().unwrap_or_else(Vector3::zeros);
        let link_about_axis = axis.dot(&(link.inertia_in_link_kg_m2 * axis));
        let mass_kg = WHEEL_MASS_SHARE * link.mass_kg / sharing as f64;
        (0.5 * mass_kg * foot.radius_m.powi(2)).min(0.5 * link_about_axis / sharing as f64)
    };
    Tree::new(robot).with_spinning_wheels(disc).with_armature()
}
