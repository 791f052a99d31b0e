//! Robot at rest in its nominal pose on level ground: heights, ground forces, joint torques and joint deflections.
//! Quasi-static, without feed-forward torque.

use crate::{Configuration, Frames, RimContact, Tree};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use rollwalk_robot::GRAVITY_M_S2;

/// Largest height of a contact on the ground in the standing pose, as a fraction of the height of the centre of mass.
const HANGING: f64 = 0.05;
/// Spread below which contacts stand in line, m. Such contacts cannot balance moments across the line. The centre of mass may
/// be off the line by the same distance.
const IN_LINE_M: f64 = 0.005;

/// Robot in its nominal pose on the ground plane z = 0.
#[derive(Clone, Debug)]
pub struct Standing {
    /// Frames of all links. The body axes are parallel to the world axes. The height of the body is the z coordinate of its
    /// origin.
    pub frames: Frames,
    /// Centre of mass, m.
    pub com: Vector3<f64>,
    /// Contacts, by end effector.
    pub contacts: Vec<StandingContact>,
    /// True if contact forces that only push can balance the weight. If false, all forces are equal, and the robot tips over.
    pub balanced: bool,
    /// Static torque of the motor of each joint, N·m.
    pub torque_nm: Vec<f64>,
}

/// Contact of an end effector of a [`Standing`] robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandingContact {
    /// Lowest point, m. Its z is the height above the ground.
    pub position: Vector3<f64>,
    /// Upward force of the ground, N; 0 if the contact is above the ground.
    pub force_n: f64,
    /// Distance by which the body sinks towards the contact as joints deflect by torque / stiffness, m.
    pub sag_m: f64,
}

impl Standing {
    /// Places the robot on the ground. `None` if a wheel lies flat, so that it has no lowest point.
    pub fn new(tree: &Tree) -> Option<Self> {
        let robot = tree.robot();
        let nominal: Vec<_> = robot.joints.iter().map(|joint| joint.nominal_rad).collect();
        let mut at = Configuration {
            base_position_m: Vector3::zeros(),
            world_from_body: Matrix3::identity(),
            joint_rad: &nominal,
        };
        let mut frames = Frames::new(tree, &at);
        let lowest = |frames: &Frames| {
            let rim = |index| RimContact::new(tree, frames, index, &Vector3::z());
            let points = (0..robot.end_effectors.len()).map(|index| Some(rim(index)?.position()));
            points.collect::<Option<Vec<_>>>()
        };
        let ground_m = lowest(&frames)?.iter().map(|point| point.z).reduce(f64::min)?;
        at.base_position_m.z = -ground_m;
        frames.update(tree, &at);
        let points = lowest(&frames)?;
        let com = frames.com(tree);
        let hanging_m = HANGING * com.z.abs();
        let stands: Vec<_> = points.iter().map(|point| point.z <= hanging_m).collect();
        let weight_n = tree.total_mass_kg() * GRAVITY_M_S2;
        let (forces_n, balanced) = forces(&points, &stands, &com, weight_n);
        let mut standing = Self {
            frames,
            com,
            contacts: points
                .iter()
                .zip(&forces_n)
                .map(|(&position, &force_n)| StandingContact { position, force_n, sag_m: 0.0 })
                .collect(),
            balanced,
            torque_nm: Vec::new(),
        };
        let joints_nm: Vec<_> =
            (0..nominal.len()).map(|joint| standing.torque(tree, joint)).collect();
        standing.torque_nm = standing.frames.ratios(tree).motor_torques(&joints_nm);
        for index in 0..points.len() {
            standing.contacts[index].sag_m = standing.sag(tree, index);
        }
        Some(standing)
    }

    /// Torque that, together with the joint's spring, balances ground forces and weight beyond the joint:
    /// τ = −w · [Σ (e − o) × f + (x_c − o) × m_c g] − τ_spring, or −s · [Σ f + m_c g] − τ_spring for a prismatic joint.
    fn torque(&self, tree: &Tree, joint: usize) -> f64 {
        let child = tree.robot().joints[joint].child;
        let origin = self.frames.link_origins[child];
        let mass_kg = tree.carried_mass_kg(joint);
        let lever = self.frames.carried_moments[child] - origin * mass_kg;
        let mut moment = lever.cross(&(Vector3::z() * -GRAVITY_M_S2));
        let mut force = Vector3::z() * (-GRAVITY_M_S2 * mass_kg);
        for (contact, end) in self.contacts.iter().zip(&tree.robot().end_effectors) {
            if tree.joints_to_link(end.link).contains(&joint) {
                let of_ground = Vector3::z() * contact.force_n;
                moment += (contact.position - origin).cross(&of_ground);
                force += of_ground;
            }
        }
        let torque_nm = match &self.frames.joint_slides[joint] {
            Some(slide) => -slide.dot(&force),
            None => -self.frames.joint_axes[joint].dot(&moment),
        };
        let of = &tree.robot().joints[joint];
        of.spring.map_or(torque_nm, |spring| torque_nm - spring.torque_nm(of.nominal_rad, 0.0))
    }

    /// Sag of the body towards a contact, m. Each motor deviates from its set-point by −τ / kp, which lifts the contact towards
    /// the body.
    fn sag(&self, tree: &Tree, end_effector: usize) -> f64 {
        let robot = tree.robot();
        let joints = tree.joints_to_link(robot.end_effectors[end_effector].link).iter();
        let lift = |&joint: &usize| {
            let arm = self.contacts[end_effector].position
                - self.frames.link_origins[robot.joints[joint].child];
            let motors = self.frames.ratios(tree).motor_ratios(joint).iter();
            let off_rad: f64 = motors
                .map(|of| {
                    let stiffness_nm_rad = robot.joints[of.joint].stiffness_nm_rad();
                    of.ratio * (-self.torque_nm[of.joint] / stiffness_nm_rad)
                })
                .sum();
            self.frames.joint_displacement(joint, &arm).z * off_rad
        };
        joints.map(lift).sum()
    }
}

/// Upward forces of the contacts, and true if they balance weight and moments. Balancing forces are as equal as possible: the
/// mean plus a term linear in position. Without balance, as with the centre of mass outside the contacts, all forces are equal.
fn forces(
    points: &[Vector3<f64>],
    stands: &[bool],
    com: &Vector3<f64>,
    weight_n: f64,
) -> (Vec<f64>, bool) {
    let count = stands.iter().filter(|stands| **stands).count() as f64;
    let standing = || points.iter().zip(stands).filter(|(_, stands)| **stands).map(|(p, _)| p.xy());
    let middle = standing().sum::<Vector2<f64>>() / count;
    let spread: Matrix2<f64> = standing().map(|p| (p - middle) * (p - middle).transpose()).sum();
    let inverse = spread
        .pseudo_inverse(count * IN_LINE_M.powi(2))
        .expect("the smallest singular value is not negative");
    let slope = inverse * (com.xy() - middle) * weight_n;
    let force =
        |p: &Vector3<f64>, slope: &Vector2<f64>| weight_n / count + slope.dot(&(p.xy() - middle));
    let even = |slope: Vector2<f64>| -> Vec<f64> {
        let each = points.iter().zip(stands);
        each.map(|(p, stands)| if *stands { force(p, &slope) } else { 0.0 }).collect()
    };
    let balancing = even(slope);
    let center: Vector2<f64> =
        points.iter().zip(&balancing).map(|(p, f)| p.xy() * (f / weight_n)).sum();
    let beyond_m = (com.xy() - center).norm();
    if balancing.iter().all(|force| *force >= 0.0) && beyond_m <= IN_LINE_M {
        (balancing, true)
    } else {
        (even(Vector2::zeros()), false)
    }
}
