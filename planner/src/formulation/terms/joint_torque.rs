//! Torque limits of joint motors: |τ| ≤ u τ_max, where u is the fraction of the limit that plans may use. One inequality row
//! per joint and sample, N·m.
//!
//! The torque of a joint balances the planned ground forces and the weight and inertia of everything beyond the joint. The torque
//! of its motor also accelerates the rotor:
//!
//! ```text
//! τ_joint = w · [ Σ m (p − o) × (p̈ − g) − Σ (e − o) × f ] − τ_spring     τ_motor = A⁻ᵀ τ_joint + I_a A q̈
//! τ_joint = s · [ Σ m (p̈ − g) − Σ f ] − τ_spring                         of a prismatic joint
//! ```
//!
//! w and o are the axis and origin of the joint, s its displacement per radian, p the points that it carries, e and f the
//! contacts beyond it, τ_spring the torque of the joint's spring and damper at the sample, I_a the inertia of rotor and gearbox,
//! and A the ratios of the motors ([`rollwalk_robot::Transmission`]). Accelerations are second differences in the mean around
//! the sample ([`crate::problem::MeanWeights`]); p × p̈ follows from the moments that the limb sweeps
//! ([`rollwalk_multibody::euler::SweptMoment`]). |τ| has a kink at 0, where the row is far from active, so that one row covers
//! both signs.

use super::motor_motion::{ratios, second_difference_rad};
use crate::families::Family;
use crate::formulation::rows::{Role, RowWriter, Subject, Window};
use crate::formulation::{Span, Term, TermInfo};
use nalgebra::Vector3;
use rollwalk_multibody::euler::{
    BASE_POSITION, BASE_YAW, CarriedPair, JOINTS, cross_sum, turned_first, turned_second,
};
use rollwalk_robot::{GRAVITY_M_S2, Ratios};

/// Constraint: torque limits of joint motors.
pub struct JointTorque;

/// Half-width of the smoothing of Eq. 2.16, as a fraction of the limit.
pub(super) const BAND_FRACTION: f64 = 0.05;

/// Torque of the motor of one joint at the middle sample of a window.
pub(super) struct MotorTorque<'w> {
    /// Torque, N·m.
    pub value_nm: f64,
    /// Factor and torque of the first joint on which the motor acts.
    first: (f64, Torque<'w>),
    /// Factors and torques of the other joints.
    others: Vec<(f64, Torque<'w>)>,
    /// Derivatives of the factors with respect to joints, times the torques of the joints, N·m/rad. Empty for constant ratios.
    by_ratios: Vec<(usize, f64)>,
    rotor: Rotor,
}

/// Inertia of the rotor of a motor.
#[derive(Clone, Copy)]
struct Rotor {
    motor: usize,
    armature_kg_m2: f64,
}

impl<'w> MotorTorque<'w> {
    /// Returns the torque of the motor of joint `motor`, N·m, with its derivative if the next row needs that.
    ///
    /// The window keeps torques without derivative, because the torque-speed line limits the same torques as this family.
    pub fn for_row(window: &'w Window<'w>, motor: usize, out: &RowWriter) -> (f64, Option<Self>) {
        if out.differentiates() {
            let torque = Self::new(window, motor);
            return (torque.value_nm, Some(torque));
        }
        let torque_nm = &window.motor_torques_nm[motor];
        (*torque_nm.get_or_init(|| Self::new(window, motor).value_nm), None)
    }

    /// Computes the torque of the motor of joint `motor`. Feet in swing carry no force.
    pub fn new(window: &'w Window<'w>, motor: usize) -> Self {
        let tree = window.problem.model.tree();
        let ratios = ratios(window, 1);
        let armature_kg_m2 = tree.robot().joints[motor].actuator.armature_kg_m2;
        let rotor = Rotor { motor, armature_kg_m2 };
        let mut factors = ratios.torque_factors(motor).iter();
        let mut next = || factors.next().map(|of| (of.ratio, Torque::new(window, of.joint)));
        let first = next().expect("a motor acts on a joint");
        let others: Vec<_> = std::iter::from_fn(next).collect();
        let all = std::iter::once(&first).chain(&others);
        let torque_nm = all.map(|(factor, torque)| factor * torque.value_nm).sum::<f64>();
        let acceleration = second_difference_rad(window, motor, first.1.per_h2);
        let value_nm = torque_nm + armature_kg_m2 * acceleration;
        let by_ratios = by_ratios(ratios, motor, window);
        Self { value_nm, first, others, by_ratios, rotor }
    }

    /// Adds `factor` times the derivative of the torque to the next row.
    pub fn differentiate(&self, factor: f64, out: &mut RowWriter) {
        if !out.differentiates() {
            return;
        }
        let (of_joint, torque) = &self.first;
        torque.differentiate(of_joint * factor, Some((factor, self.rotor)), out);
        for (of_joint, torque) in &self.others {
            torque.differentiate(of_joint * factor, None, out);
        }
        for &(joint, by) in &self.by_ratios {
            out.d(1, JOINTS + joint, factor * by);
        }
    }
}

/// Derivative of A⁻ᵀ τ with respect to joint angles at constant τ: −A⁻ᵀ dAᵀ A⁻ᵀ τ. Entries are joints and N·m/rad.
fn by_ratios(ratios: &Ratios, motor: usize, window: &Window) -> Vec<(usize, f64)> {
    let mut entries = Vec::new();
    if ratios.motor_rad(motor).is_none() {
        return entries; // All ratios are constant.
    }
    let factors = ratios.torque_factors(motor);
    for other in 0..window.problem.model.robot().joints.len() {
        let bends = ratios.bends(other);
        let factor = |joint: usize| factors.iter().find(|of| of.joint == joint).map(|of| of.ratio);
        if !bends.iter().any(|(joint, ..)| factor(*joint).is_some()) {
            continue;
        }
        let of_other = ratios.torque_factors(other).iter();
        let torque_nm: f64 =
            of_other.map(|of| of.ratio * Torque::new(window, of.joint).value_nm).sum();
        for &(joint, by, bend) in bends {
            entries.extend(factor(joint).map(|factor| (by, -factor * bend * torque_nm)));
        }
    }
    entries
}

/// Torque of one joint at the middle sample of a window, with the values that its derivative needs.
struct Torque<'w> {
    window: &'w Window<'w>,
    joint: usize,
    /// Torque that motors apply, N·m, without rotors.
    value_nm: f64,
    /// Displacement of a prismatic joint per radian, m/rad, and the inertia forces minus all other forces beyond the joint, N.
    slide: Option<(Vector3<f64>, Vector3<f64>)>,
    axis: Vector3<f64>,
    origin: Vector3<f64>,
    /// Rate of change of the angular momentum beyond the joint minus the moment of all other forces there, about its origin, N·m.
    moment: Vector3<f64>,
    /// Sum of the ground forces beyond the joint, N.
    ground_force: Vector3<f64>,
    /// Sum Σ m (p − o) before, at and after the sample, kg·m.
    arms: [Vector3<f64>; 3],
    /// Bodies that the joint carries, before and after the sample.
    carried: [CarriedPair<'w>; 2],
    /// Factor from a second difference of samples to the mean second derivative around the middle one, 1/s².
    per_h2: f64,
}

impl<'w> Torque<'w> {
    /// Computes the torque of joint `joint`. Feet in swing carry no force.
    fn new(window: &'w Window<'w>, joint: usize) -> Self {
        let problem = window.problem;
        let model = &problem.model;
        let carried = model.carried(joint);
        let child = model.robot().joints[joint].child;
        let [before, here, after] = window.states;
        let (axis, origin) =
            (here.pose.frames.joint_axes[joint], here.pose.frames.link_origins[child]);
        let second_difference = problem.mean_weights(window.at[1]).second_difference;
        let per_h2 = second_difference / problem.interval_s.powi(2);

        let pairs = [(before, here), (here, after)].map(|(from, to)| {
            let swept = from.swept_to_next.as_ref().expect("each state but the last has a next");
            CarriedPair::new(&from.pose, &to.pose, swept)
        });
        let swept = pairs.map(|pair| cross_sum(&pair.about(model, joint, &origin, &origin)));
        let arms = [before, here, after]
            .map(|state| state.pose.frames.carried_moments[child] - origin * carried.mass_kg);
        let mut moment = (swept[1] - swept[0]) * per_h2 - arms[1].cross(&gravity());
        let mut ground_force = Vector3::zeros();
        for &j in carried.end_effectors.iter().filter(|&&j| window.stance(1, j)) {
            let vars = &problem.layout.end_effectors[j];
            let f = here.vector(vars.force);
            moment -= (here.vector(vars.position) - origin).cross(&f);
            ground_force += f;
        }
        let slide = here.pose.frames.joint_slides[joint].map(|slide| {
            let bent = arms[0] - arms[1] * 2.0 + arms[2];
            (slide, bent * per_h2 - gravity() * carried.mass_kg - ground_force)
        });
        let mut value_nm = match &slide {
            Some((slide, force)) => slide.dot(force),
            None => axis.dot(&moment),
        };
        if let Some(spring) = &model.robot().joints[joint].spring {
            let angles = window.states.map(|state| state.vars[JOINTS + joint]);
            let speed_rad_s = (angles[2] - angles[0]) / (2.0 * problem.interval_s);
            value_nm -= spring.torque_nm(angles[1], speed_rad_s);
        }
        Self {
            window,
            joint,
            value_nm,
            slide,
            axis,
            origin,
            moment,
            ground_force,
            arms,
            carried: pairs,
            per_h2,
        }
    }

    /// Adds `factor` times the derivative of the torque to the next row. `rotor` contains a rotor and the factor of its torque,
    /// whose derivative is added too.
    fn differentiate(&self, factor: f64, rotor: Option<(f64, Rotor)>, out: &mut RowWriter) {
        let Self { window, joint, axis, per_h2, .. } = self;
        let model = &window.problem.model;
        let here = window.states[1];
        let rotor = rotor.map(|(factor, rotor)| (per_h2 * factor, rotor));
        if let Some(spring) = &model.robot().joints[*joint].spring {
            let by_speed = factor * spring.damping_nm_s_rad / (2.0 * window.problem.interval_s);
            let by_angle = factor * spring.stiffness_nm_rad;
            for (k, by) in [(0, -by_speed), (1, by_angle), (2, by_speed)] {
                out.d(k, JOINTS + joint, by);
            }
        }
        let (axis, per_h2) = (axis * factor, per_h2 * factor);
        if let Some((slide, force)) = &self.slide {
            self.differentiate_slide(&(slide * factor), force, out);
            self.differentiate_rotor(rotor, out);
            return;
        }
        for &j in self.standing() {
            let vars = &window.problem.layout.end_effectors[j];
            let arm = here.vector(vars.position) - self.origin;
            out.d_vector(1, vars.force, &arm.cross(&axis));
            out.d_vector(1, vars.position, &axis.cross(&here.vector(vars.force)));
        }
        // Contact points are separate variables: moving the joint's origin changes their lever arms. Points of the
        // limb move with the base.
        let d_origin = self.ground_force.cross(&axis);
        let d_shift = self.axis.cross(&self.arms[1]) * per_h2;
        out.d_vector(0, BASE_POSITION, &d_shift);
        out.d_vector(1, BASE_POSITION, &(d_origin - d_shift * 2.0));
        out.d_vector(2, BASE_POSITION, &d_shift);
        self.differentiate_rotor(rotor, out);

        let [before, here, after] = self.arms;
        let d_origin = d_origin + self.axis.cross(&(before - here * 2.0 + after)) * per_h2;
        let d_axis = axis.cross(&self.moment);
        let d_weight_arm = axis.cross(&gravity());
        for k in 0..3 {
            let pose = &window.states[k].pose;
            let mut turn =
                |dof: usize, part: usize, w: &Vector3<f64>, about: &Vector3<f64>, above: bool| {
                    let mut derivative = self.turned(k, part, w, about) * per_h2;
                    if k == 1 && above {
                        // A turn above the joint turns its axis and the lever arm of the weight, and moves its origin.
                        derivative +=
                            d_axis.dot(w) + d_origin.dot(&w.cross(&(self.origin - about)));
                        derivative += d_weight_arm.dot(&w.cross(&here));
                    } else if k == 1 {
                        let child = model.robot().joints[part].child;
                        let arm = pose.frames.carried_moments[child]
                            - about * model.carried(part).mass_kg;
                        derivative += d_weight_arm.dot(&w.cross(&arm));
                    }
                    out.d(k, dof, derivative);
                };
            let base = window.states[k].vector(BASE_POSITION);
            for (c, w) in pose.base_axes.iter().enumerate() {
                turn(BASE_YAW + c, *joint, w, &base, true);
            }
            let origin = |joint: usize| pose.frames.link_origins[model.robot().joints[joint].child];
            for &above in &model.carried(*joint).above {
                if pose.frames.joint_slides[above].is_none() {
                    let axis = &pose.frames.joint_axes[above];
                    turn(JOINTS + above, *joint, axis, &origin(above), true);
                }
            }
            for &part in std::iter::once(joint).chain(&model.carried(*joint).below) {
                if pose.frames.joint_slides[part].is_none() {
                    turn(JOINTS + part, part, &pose.frames.joint_axes[part], &origin(part), false);
                }
            }
            // A shift above the joint moves its origin with the limb, and a shift beyond it the lever arm of the weight.
            for &above in &model.carried(*joint).above {
                let Some(slide) = &pose.frames.joint_slides[above] else { continue };
                let mut derivative = self.shifted(k, *joint, slide) * per_h2;
                if k == 1 {
                    derivative += d_origin.dot(slide);
                }
                out.d(k, JOINTS + above, derivative);
            }
            for &part in &model.carried(*joint).below {
                let Some(slide) = &pose.frames.joint_slides[part] else { continue };
                let mut derivative = self.shifted(k, part, slide) * per_h2;
                if k == 1 {
                    derivative += d_weight_arm.dot(slide) * model.carried(part).mass_kg;
                }
                out.d(k, JOINTS + part, derivative);
            }
        }
    }

    /// Adds the derivative of the torque of a rotor.
    fn differentiate_rotor(&self, rotor: Option<(f64, Rotor)>, out: &mut RowWriter) {
        let Some((per_h2, Rotor { motor, armature_kg_m2 })) = rotor else { return };
        let inertia = armature_kg_m2 * per_h2;
        for (k, times) in [(0, 1.0), (1, -2.0), (2, 1.0)] {
            for of in ratios(self.window, k).ratios(motor) {
                out.d(k, JOINTS + of.joint, of.ratio * (inertia * times));
            }
        }
    }

    /// Adds the derivative of s · F of a prismatic joint. `slide` is s times a factor.
    fn differentiate_slide(&self, slide: &Vector3<f64>, force: &Vector3<f64>, out: &mut RowWriter) {
        let Self { window, joint, per_h2, .. } = self;
        let model = &window.problem.model;
        for &j in self.standing() {
            let vars = &window.problem.layout.end_effectors[j];
            out.d_vector(1, vars.force, &-slide);
        }
        let carried = model.carried(*joint);
        for (k, times) in [(0, 1.0), (1, -2.0), (2, 1.0)] {
            let frames = &window.states[k].pose.frames;
            let child = |joint: usize| model.robot().joints[joint].child;
            // Derivative of Σ m p̈ with respect to Σ m p at this sample.
            let by_moment = slide * (times * per_h2);
            out.d_vector(k, BASE_POSITION, &(by_moment * carried.mass_kg));
            let mut turn = |dof: usize, w: &Vector3<f64>, about: &Vector3<f64>| {
                let lever = frames.carried_moments[child(*joint)] - about * carried.mass_kg;
                let mut derivative = by_moment.dot(&w.cross(&lever));
                if k == 1 {
                    derivative += force.dot(&w.cross(slide));
                }
                out.d(k, dof, derivative);
            };
            let base = window.states[k].vector(BASE_POSITION);
            for (c, w) in window.states[k].pose.base_axes.iter().enumerate() {
                turn(BASE_YAW + c, w, &base);
            }
            for &above in carried.above.iter().filter(|&&j| frames.joint_slides[j].is_none()) {
                let origin = &frames.link_origins[child(above)];
                turn(JOINTS + above, &frames.joint_axes[above], origin);
            }
            for &above in &carried.above {
                let Some(shift) = &frames.joint_slides[above] else { continue };
                out.d(k, JOINTS + above, by_moment.dot(shift) * carried.mass_kg);
            }
            for &part in std::iter::once(joint).chain(&carried.below) {
                let mass_kg = model.carried(part).mass_kg;
                let arm = match frames.joint_slides[part] {
                    Some(shift) => shift * mass_kg,
                    None => {
                        let lever = frames.carried_moments[child(part)]
                            - frames.link_origins[child(part)] * mass_kg;
                        frames.joint_axes[part].cross(&lever)
                    }
                };
                out.d(k, JOINTS + part, by_moment.dot(&arm));
            }
        }
    }

    /// End effectors beyond the joint that are in stance.
    fn standing(&self) -> impl Iterator<Item = &usize> {
        let carried = self.window.problem.model.carried(self.joint);
        carried.end_effectors.iter().filter(|&&j| self.window.stance(1, j))
    }

    /// Derivative of w·Σ m (p − o) × (p₊ − 2p + p₋) with respect to a turn of the links that joint `part` carries. The turn is
    /// about an axis `turn` through `about`, at sample `k` of the window. The joint's origin is held fixed.
    fn turned(&self, k: usize, part: usize, turn: &Vector3<f64>, about: &Vector3<f64>) -> f64 {
        let model = &self.window.problem.model;
        let [into, out_of] = &self.carried;
        let first =
            |pair: &CarriedPair| turned_first(&pair.about(model, part, about, &self.origin), turn);
        let second =
            |pair: &CarriedPair| turned_second(&pair.about(model, part, &self.origin, about), turn);
        let change = match k {
            0 => -first(into),
            1 => first(out_of) - second(into),
            _ => second(out_of),
        };
        self.axis.dot(&change)
    }

    /// Derivative as in [`turned`](Self::turned), with respect to a displacement `slide` of the links that joint `part` carries.
    fn shifted(&self, k: usize, part: usize, slide: &Vector3<f64>) -> f64 {
        let model = &self.window.problem.model;
        let child = model.robot().joints[part].child;
        let mass_kg = model.carried(part).mass_kg;
        let arm = |at: usize| {
            self.window.states[at].pose.frames.carried_moments[child] - self.origin * mass_kg
        };
        let change = match k {
            0 => -slide.cross(&arm(1)),
            1 => slide.cross(&arm(2)) - arm(0).cross(slide),
            _ => arm(1).cross(slide),
        };
        self.axis.dot(&change)
    }
}

fn gravity() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, -GRAVITY_M_S2)
}

impl Term for JointTorque {
    fn info(&self) -> TermInfo {
        TermInfo { family: Family::JointTorque, span: Span::Samples }
    }

    fn write(&self, window: &Window, out: &mut RowWriter) {
        let robot = window.problem.model.robot();
        for (j, joint) in robot.driven_joints().map(|j| (j, &robot.joints[j])) {
            let limit = joint.actuator.torque_max_nm;
            let role = Role::Inequality { band: BAND_FRACTION };
            out.set(limit, role);
            if out.skips_row() {
                continue;
            }
            let (torque_nm, derivative) = MotorTorque::for_row(window, j, out);
            if let Some(derivative) = derivative {
                derivative.differentiate(torque_nm.signum(), out);
            }
            let usable = window.problem.reserve.torque_use;
            out.given("torque_max_nm", limit, -usable);
            out.row_of(Subject::Joint(j), torque_nm.abs() - usable * limit);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::problem::{Problem, Weights};
    use crate::start::guess;
    use crate::{test_plans, test_robots};
    use rollwalk_multibody::euler::Model;

    /// Torque of the front left hip of the box of [`test_plans`], N·m, for a leg angle and a ground force.
    fn hip_torque_nm(leg_rad: f64, force_n: Vector3<f64>) -> f64 {
        let robot = test_plans::robot();
        let mut motion = test_robots::motion(&robot, Ends::AtRest);
        motion.posture_rad = vec![leg_rad; 4];
        motion.stance.iter_mut().for_each(|flags| flags.fill(true));
        motion.goal = Default::default();
        let problem = Problem::new(Model::new(&robot), &motion, Weights::default());
        let mut unknowns = guess::from_standing(&problem);
        let force = problem.layout.end_effectors[0].force;
        unknowns.slots[0].fixed_rows_mut::<3>(force).copy_from(&force_n);
        let states = problem.states(&unknowns);
        MotorTorque::new(&Window::new(&problem, [0, 1, 2], &states, &[]), 0).value_nm
    }

    #[test]
    fn a_static_leg_holds_what_its_levers_say() {
        // Leg of 0.2 m with its mass of 0.2 kg in its middle, wheel of 0.05 m below it; positive angles
        // swing it back, so the wheel is behind the hip.
        let (sin, cos) = 0.4f64.sin_cos();
        let weight = -0.2 * GRAVITY_M_S2 * -0.1 * sin;
        let near = |torque: f64, expected: f64| {
            assert!((torque - expected).abs() < 1e-12, "{torque} {expected}") // rounding only
        };
        // In the air the motor holds the leg up and back.
        near(hip_torque_nm(0.4, Vector3::zeros()), weight);
        // The ground pushes the wheel up and the leg further back: the motor swings it forward.
        near(hip_torque_nm(0.4, Vector3::new(0.0, 0.0, 10.0)), weight - 10.0 * 0.2 * sin);
        // A push forward, with the height of the hip as its lever, pulls the leg forward.
        let height_m = 0.2 * cos + 0.05;
        near(hip_torque_nm(0.4, Vector3::new(10.0, 0.0, 0.0)), weight + 10.0 * height_m);
        // A force across the leg's plane has no effect.
        near(hip_torque_nm(0.4, Vector3::new(0.0, 10.0, 0.0)), weight);
    }
}
