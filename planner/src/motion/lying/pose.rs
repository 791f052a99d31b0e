//! Pose of a robot on its body: the body level on its lowest points, the feet on the ground near their standing positions, and
//! the limbs clear of each other and of the ground.
//!
//! Limbs are independent, because the body does not move. Each limb is searched on a grid of its joint angles; the best points
//! of the grid are improved by damped Gauss-Newton steps.

use nalgebra::{DMatrix, DVector, Vector3};
use rollwalk_multibody::clearance::Pair;
use rollwalk_multibody::euler::{BASE_POSITION, JOINTS, Model};
use rollwalk_multibody::{Frames, RimContact};
use rollwalk_robot::Robot;
use std::ops::ControlFlow;

/// Weight of the conditions of the pose relative to its preferences. Residuals of conditions are distances over the standing
/// height.
const MUST: f64 = 100.0;
/// Weight of missing clearance.
const MARGIN: f64 = 5.0;
/// Weight of the sine of the angle between a wheel's axis and its axis in the standing robot.
const ROLLING: f64 = 1.0;
/// Weight of feet nearer to the middle of the body than in the standing robot. Such feet cannot lift the body without tipping it.
const INWARD: f64 = 1.5;
/// Weight of joint angles off their nominal values, per rad.
const NOMINAL: f64 = 0.3;
/// Largest angle of a joint off its nominal value, rad.
const TURN_RAD: f64 = 2.8;
/// Desired number of points of a limb's grid.
const GRID: usize = 3000;
/// Maximum number of grid points of a limb with many joints, for each of which the grid has two angles.
const GRID_MAX: usize = 10 * GRID;
/// Largest number of angles of a joint in the grid.
const ANGLES: usize = 24;
/// Number of points of the grid that are improved.
const IMPROVED: usize = 12;
/// Number of damped Gauss-Newton steps.
const STEPS: usize = 40;
/// Damping factor beyond which no step helps.
const DAMPING_MAX: f64 = 1e8;
/// Step of joint angles for differences, rad.
const DIFFERENCE_RAD: f64 = 1e-6;
/// Largest accepted deviation of the pose from its conditions, as a fraction of the standing height. A plan meets the conditions
/// exactly.
const TOLERANCE: f64 = 0.02;

/// Pose of a robot on its body.
pub(super) struct LyingPose {
    /// Joint angles, rad.
    pub joint_rad: Vec<f64>,
    /// Worst part that does not fit.
    pub misfit: Option<Misfit>,
}

/// Part of a robot that does not fit on the ground beside its body.
pub(super) struct Misfit {
    /// Name of the part.
    pub part: String,
    /// Distance by which it is off, m.
    pub off_m: f64,
}

/// Limb: joints beyond one joint of the body, with the feet and shapes that they carry.
#[derive(Clone)]
struct Limb<'m> {
    model: &'m Model,
    joints: Vec<usize>,
    /// Joints with a servo. Springs hold the others at rest.
    driven: Vec<usize>,
    feet: Vec<usize>,
    pairs: Vec<&'m Pair>,
    /// Contact position, m, and wheel axis of each foot or wheel of the standing robot.
    nominal: Vec<[Vector3<f64>; 2]>,
    height_m: f64,
}

impl LyingPose {
    /// Finds the pose of a robot with points on which its body lies. Limbs with joints for which `is_given` is true have no
    /// misfits, because the motion file gives their angles.
    pub fn find(model: &Model, is_given: impl Fn(usize) -> bool) -> Self {
        let robot = model.robot();
        let mut q = model.nominal_q().clone();
        let height_m = q[BASE_POSITION + 2];
        let nominal = model.frames(&q);
        q[BASE_POSITION + 2] = height_m_of(robot);
        for (j, joint) in robot.joints.iter().enumerate().filter(|(_, joint)| joint.is_passive()) {
            let rest_rad = joint.spring.map_or(joint.nominal_rad, |spring| spring.rest_rad);
            q[JOINTS + j] = rest_rad.clamp(joint.position_min_rad, joint.position_max_rad);
        }
        let mut misfits = Vec::new();
        let roots = (0..robot.joints.len()).filter(|&j| robot.joints[j].parent == 0);
        for root in roots {
            let limb = Limb::new(model, root, &nominal, height_m);
            limb.fold(&mut q);
            if !limb.joints.iter().any(|&j| is_given(j)) {
                misfits.extend(limb.misfits(&q));
            }
        }
        let frames = model.frames(&q);
        let feet = robot.end_effectors.iter().enumerate();
        for (j, foot) in feet.filter(|(_, end)| end.link == 0 && !end.contact.is_body_point()) {
            let off_m = contact(model, &frames, j).z.abs();
            misfits.push(Misfit { part: format!("`{}`", foot.name), off_m });
        }
        let worst = misfits.into_iter().max_by(|a, b| a.off_m.total_cmp(&b.off_m));
        Self {
            joint_rad: q.as_slice()[JOINTS..].to_vec(),
            misfit: worst.filter(|misfit| misfit.off_m > TOLERANCE * height_m),
        }
    }
}

/// Height of the origin of a body that lies level, m.
pub(super) fn height_m_of(robot: &Robot) -> f64 {
    let points = robot.end_effectors.iter().filter(|end| end.contact.is_body_point());
    let bottoms_m = points.map(|end| end.radius_m - end.center_in_link_m.z);
    bottoms_m.reduce(f64::max).unwrap_or_default()
}

/// Contact point of an end effector with level ground, m.
fn contact(model: &Model, frames: &Frames, j: usize) -> Vector3<f64> {
    let end = &model.robot().end_effectors[j];
    let rim = RimContact::new(model.tree(), frames, j, &Vector3::z());
    rim.map_or_else(|| frames.point(end.link, &end.center_in_link_m), |rim| rim.position())
}

/// Axis of a wheel in world axes; zero for a foot.
fn axis_of(model: &Model, frames: &Frames, j: usize) -> Vector3<f64> {
    let axis_in_link = model.wheel_axis_in_link(j).unwrap_or_default();
    frames.world_from_link[model.robot().end_effectors[j].link] * axis_in_link
}

impl<'m> Limb<'m> {
    fn new(model: &'m Model, root: usize, nominal: &Frames, height_m: f64) -> Self {
        let robot = model.robot();
        let carried = |link: usize| model.tree().joints_to_link(link).contains(&root);
        let joints: Vec<_> =
            (0..robot.joints.len()).filter(|&j| carried(robot.joints[j].child)).collect();
        let ends = 0..robot.end_effectors.len();
        let feet: Vec<usize> = ends.filter(|&j| carried(robot.end_effectors[j].link)).collect();
        let own = |pair: &&Pair| {
            let is_own = |link: &usize| *link == 0 || carried(*link);
            pair.links.iter().all(is_own)
        };
        Self {
            model,
            driven: joints.iter().copied().filter(|&j| !robot.joints[j].is_passive()).collect(),
            joints,
            nominal: feet
                .iter()
                .map(|&j| [contact(model, nominal, j), axis_of(model, nominal, j)])
                .collect(),
            feet,
            pairs: model.clearance().pairs().iter().filter(own).collect(),
            height_m,
        }
    }

    /// Deviations of the limb from the conditions: heights of feet, overlaps of limbs with each other and depths in the ground.
    /// The function `each` receives the distance by which a part is off, m, the missing clearance, m, and the name of the part.
    fn musts(&self, frames: &Frames, mut each: impl FnMut(f64, f64, &dyn Fn() -> String)) {
        let (robot, clearance) = (self.model.robot(), self.model.clearance());
        for &j in &self.feet {
            let name = || format!("`{}`", robot.end_effectors[j].name);
            each(contact(self.model, frames, j).z, 0.0, &name);
        }
        let carried = |link: usize| self.joints.iter().any(|&j| robot.joints[j].child == link);
        for point in clearance.points().iter().filter(|point| carried(point.link)) {
            let lowest_m = point.center(frames).z - point.radius_m;
            let name = || format!("`{}`", robot.links[point.link].name);
            each((-lowest_m).max(0.0), (point.least_m - lowest_m).max(0.0), &name);
        }
        let placed = clearance.placed(frames);
        for pair in &self.pairs {
            let near = placed.distance(pair, pair.least_m);
            let [inside_m, missing_m] = near.map_or([0.0; 2], |near| {
                [(-near.distance_m).max(0.0), pair.least_m - near.distance_m]
            });
            each(inside_m, missing_m, &|| robot.pair_name(pair.links));
        }
    }

    fn residuals(&self, q: &DVector<f64>) -> DVector<f64> {
        let frames = self.model.frames(q);
        let mut found = Vec::new();
        self.musts(&frames, |off_m, missing_m, _| {
            found.extend([MUST * off_m / self.height_m, MARGIN * missing_m / self.height_m]);
        });
        let robot = self.model.robot();
        for (&j, [nominal, axis]) in self.feet.iter().zip(&self.nominal) {
            let moved = (contact(self.model, &frames, j) - nominal) / self.height_m;
            for c in 0..2 {
                let inward = (-moved[c] * nominal[c].signum()).max(0.0);
                found.extend([moved[c], INWARD * inward]);
            }
            found.push(ROLLING * axis.xy().perp(&axis_of(self.model, &frames, j).xy()));
        }
        let off = |&j: &usize| NOMINAL * (q[JOINTS + j] - robot.joints[j].nominal_rad);
        found.extend(self.joints.iter().map(off));
        DVector::from_vec(found)
    }

    /// Range of a joint near its nominal angle, rad.
    fn range_rad(&self, j: usize) -> [f64; 2] {
        let joint = &self.model.robot().joints[j];
        [
            joint.position_min_rad.max(joint.nominal_rad - TURN_RAD),
            joint.position_max_rad.min(joint.nominal_rad + TURN_RAD),
        ]
    }

    /// Sets the limb's angles in `q` to those of the best pose.
    fn fold(&self, q: &mut DVector<f64>) {
        let mut starts: Vec<(f64, DVector<f64>)> = Vec::new();
        self.for_each_of_grid(q, |q| {
            let cost = self.residuals(q).norm_squared();
            let place = starts.partition_point(|(other, _)| *other <= cost);
            if place < IMPROVED {
                starts.insert(place, (cost, q.clone()));
                starts.truncate(IMPROVED);
            }
        });
        let improved = starts.into_iter().map(|(_, start)| self.improved(start));
        if let Some((_, best)) = improved.min_by(|a, b| a.0.total_cmp(&b.0)) {
            q.copy_from(&best);
        }
    }

    fn for_each_of_grid(&self, q: &DVector<f64>, mut each: impl FnMut(&DVector<f64>)) {
        let joints = self.driven.len().max(1);
        let angles = ((GRID as f64).powf(1.0 / joints as f64) as usize).clamp(2, ANGLES);
        // Joints beyond the largest grid keep their nominal angles.
        let in_grid = joints.min(GRID_MAX.ilog(angles) as usize);
        let mut q = q.clone();
        for index in 0..angles.pow(in_grid as u32) {
            let mut rest = index;
            for &j in self.driven.iter().take(in_grid) {
                let [least, most] = self.range_rad(j);
                let u = (rest % angles) as f64 / (angles - 1) as f64;
                q[JOINTS + j] = least + u * (most - least);
                rest /= angles;
            }
            each(&q);
        }
    }

    /// Minimises the residuals within the joint limits by damped Gauss-Newton steps.
    fn improved(&self, start: DVector<f64>) -> (f64, DVector<f64>) {
        let mut q = start;
        let mut residuals = self.residuals(&q);
        let mut damping = 1e-3;
        for _ in 0..STEPS {
            let mut jacobian = DMatrix::zeros(residuals.len(), self.driven.len());
            for (column, &j) in self.driven.iter().enumerate() {
                let mut moved = q.clone();
                moved[JOINTS + j] += DIFFERENCE_RAD;
                jacobian
                    .set_column(column, &((self.residuals(&moved) - &residuals) / DIFFERENCE_RAD));
            }
            let gradient = jacobian.tr_mul(&residuals);
            let stepped = (0..).try_for_each(|_| {
                let matrix = jacobian.tr_mul(&jacobian)
                    + DMatrix::from_diagonal_element(self.driven.len(), self.driven.len(), damping);
                let mut trial = q.clone();
                if let Some(matrix) = matrix.cholesky() {
                    let step = matrix.solve(&gradient);
                    for (&j, step) in self.driven.iter().zip(step.iter()) {
                        let [least, most] = self.range_rad(j);
                        trial[JOINTS + j] = (q[JOINTS + j] - step).clamp(least, most);
                    }
                }
                let found = self.residuals(&trial);
                if found.norm_squared() < residuals.norm_squared() {
                    (q, residuals, damping) = (trial, found, 0.2 * damping);
                    return ControlFlow::Break(true);
                }
                damping *= 5.0;
                if damping > DAMPING_MAX {
                    ControlFlow::Break(false)
                } else {
                    ControlFlow::Continue(())
                }
            });
            if stepped != ControlFlow::Break(true) {
                break;
            }
        }
        (residuals.norm_squared(), q)
    }

    fn misfits(&self, q: &DVector<f64>) -> Vec<Misfit> {
        let mut found = Vec::new();
        self.musts(&self.model.frames(q), |off_m, _, name| {
            found.push(Misfit { part: name(), off_m: off_m.abs() });
        });
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(name: &str) -> Model {
        let path = format!("{}/../shipped/robots/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let robot = Robot::from_toml(name, &std::fs::read_to_string(path).unwrap()).unwrap();
        Model::new(&robot.with_body_points().unwrap())
    }

    #[test]
    fn the_grid_of_a_limb_with_many_joints_is_limited() {
        let model = model("anymal_wheels");
        let q = model.nominal_q().clone();
        let limb = Limb::new(&model, 0, &model.frames(&q), 1.0);
        for (joints, expected) in [(1, 24), (3, 14 * 14 * 14), (14, 1 << 14), (64, 1 << 14)] {
            let limb = Limb { driven: vec![0; joints], pairs: Vec::new(), ..limb.clone() };
            let mut points = 0;
            limb.for_each_of_grid(&q, |_| points += 1);
            assert_eq!(points, expected, "{joints} joints");
        }
    }

    #[test]
    fn springs_hold_passive_joints_of_the_lying_robot_at_rest() {
        let model = model("pup_toes");
        let pose = LyingPose::find(&model, |_| false);
        let joints = model.robot().joints.iter().zip(&pose.joint_rad);
        let passive: Vec<_> = joints.filter(|(joint, _)| joint.is_passive()).collect();
        assert!(!passive.is_empty());
        for (joint, &angle_rad) in passive {
            let rest_rad = joint.spring.unwrap().rest_rad;
            let rest_rad = rest_rad.clamp(joint.position_min_rad, joint.position_max_rad);
            assert_eq!(angle_rad, rest_rad, "{}", joint.name);
        }
    }
}
