//! Panels of joints and motors: angles, speeds and torques with their limits, one panel per limb or per joint.

use super::axes::Series;
use super::panels::{EvaluatedPlan, JointPanels, Panel, distinct};
use crate::plan::Sample;
use crate::sample::driven_wheels;
use crate::torque::Actuation;
use rollwalk_multibody::euler::JOINTS;

/// Distance from the motion within which a joint limit is drawn, rad.
const LIMIT_SHOWN_WITHIN_RAD: f64 = 0.6;
/// Fraction of a motor's limit above which the limit is drawn.
const LIMIT_SHOWN_FROM_PART: f64 = 0.6;

/// Joints and driven wheels that share a panel.
pub(super) struct Group {
    name: String,
    joints: Vec<usize>,
    wheels: Vec<usize>,
}

impl EvaluatedPlan<'_> {
    /// Returns the groups of joints and driven wheels. For limb panels, each limb is a group, and joints that move no end
    /// effector form the last group. For joint panels, every joint and driven wheel is a group.
    pub(super) fn groups(&self, panels: JointPanels) -> Vec<Group> {
        let robot = &self.plan.robot;
        let wheel = |j: usize| Group {
            name: robot.end_effectors[j].name.clone(),
            joints: Vec::new(),
            wheels: vec![j],
        };
        if panels == JointPanels::Joint {
            let joint = |(k, joint): (usize, &rollwalk_robot::Joint)| Group {
                name: joint.name.clone(),
                joints: vec![k],
                wheels: Vec::new(),
            };
            let joints = robot.joints.iter().enumerate().map(joint);
            return joints.chain(driven_wheels(robot).map(wheel)).collect();
        }
        let mut limbs: Vec<Group> = Vec::new();
        for (j, end_effector) in robot.end_effectors.iter().enumerate() {
            let joints = self.joints_to(j);
            match limbs.iter_mut().find(|limb| limb.joints == joints) {
                Some(limb) => limb.name = format!("{}, {}", limb.name, end_effector.name),
                None if joints.is_empty() => {}
                None => limbs.push(Group {
                    name: end_effector.name.clone(),
                    joints,
                    wheels: Vec::new(),
                }),
            }
        }
        for j in driven_wheels(robot) {
            match limbs.iter_mut().find(|limb| limb.joints == self.joints_to(j)) {
                Some(limb) => limb.wheels.push(j),
                None => limbs.push(wheel(j)),
            }
        }
        let free = |k: &usize| !limbs.iter().any(|limb| limb.joints.contains(k));
        let rest: Vec<usize> = (0..robot.joints.len()).filter(free).collect();
        if !rest.is_empty() {
            limbs.push(Group { name: "others".to_owned(), joints: rest, wheels: Vec::new() });
        }
        limbs
    }

    /// Joints that move an end effector, base first.
    fn joints_to(&self, end_effector: usize) -> Vec<usize> {
        let dofs = &self.spline.model().chain(end_effector).dofs;
        dofs.iter().filter(|&&dof| dof >= JOINTS).map(|dof| dof - JOINTS).collect()
    }

    pub(super) fn angles(&self, groups: &[Group]) -> Vec<Panel> {
        let panels = with_joints(groups).map(|group| {
            let names = self.joint_names(group);
            let series: Vec<Series> = (group.joints.iter().zip(&names).enumerate())
                .map(|(color, (&k, name))| self.series(name, color, |s| s.joint_rad[k]))
                .collect();
            // Limits far from the curve would flatten it.
            let near = |limit: f64, curve: &Series| {
                curve.line.iter().any(|[_, angle]| (angle - limit).abs() < LIMIT_SHOWN_WITHIN_RAD)
            };
            let limits = group.joints.iter().zip(&series).flat_map(|(&k, curve)| {
                let joint = &self.plan.robot.joints[k];
                let both = [joint.position_min_rad, joint.position_max_rad].into_iter();
                both.filter(|limit| near(*limit, curve)).map(|limit| (limit, curve.color))
            });
            let limits = limits.collect();
            self.limited(format!("{} joints (rad)", group.name), series, limits, Vec::new())
        });
        panels.collect()
    }

    /// Speeds of joints, as played.
    pub(super) fn speeds(&self, groups: &[Group]) -> Vec<Panel> {
        let panels = with_joints(groups).map(|group| {
            let named = group.joints.iter().zip(self.joint_names(group));
            let driven = named.filter(|(k, _)| !self.plan.robot.joints[**k].is_passive());
            let curves = driven.enumerate().map(|(color, (&k, name))| {
                let line =
                    self.states.iter().map(|(t, _, set)| [*t, set.joint_speed_rad_s[k]]).collect();
                let limit = self.plan.robot.joints[k].actuator.speed_max_rad_s;
                (Series { name, color, line, dots: Vec::new(), dash: "" }, limit)
            });
            self.with_limits(format!("{} speeds (rad/s)", group.name), curves.collect())
        });
        panels.collect()
    }

    /// Torques of the motors of joints and driven wheels.
    pub(super) fn torques(&self, groups: &[Group]) -> Vec<Panel> {
        let robot = &self.plan.robot;
        let panels = groups.iter().map(|group| {
            let mut curves = Vec::new();
            let named = group.joints.iter().zip(self.joint_names(group));
            for (&k, name) in named.filter(|(k, _)| !robot.joints[**k].is_passive()) {
                let of = |a: &Actuation| a.joint_nm[k];
                let series = self.torque(name, curves.len(), of, |s| s.joint_torque_nm[k]);
                curves.push((series, robot.joints[k].actuator.torque_max_nm));
            }
            for &j in &group.wheels {
                let foot = &robot.end_effectors[j];
                let Some(motor) = foot.contact.actuator() else { continue };
                let of = |a: &Actuation| a.motor_nm[j].unwrap_or_default();
                let planned = |s: &Sample| s.end_effectors[j].motor_torque_nm.unwrap_or_default();
                let name = match group.joints.is_empty() {
                    true => String::new(),
                    false => format!("{} wheel", foot.name),
                };
                let series = self.torque(name, curves.len(), of, planned);
                curves.push((series, motor.torque_max_nm));
            }
            self.with_limits(format!("{} torques (N·m)", group.name), curves)
        });
        panels.collect()
    }

    /// Curve of a torque, and its dots at the samples.
    fn torque(
        &self,
        name: String,
        color: usize,
        of: impl Fn(&Actuation) -> f64,
        planned: impl Fn(&Sample) -> f64,
    ) -> Series {
        let times = self.states.iter().map(|(t, ..)| *t);
        let line = times.zip(&self.actuations).map(|(t, actuation)| [t, of(actuation)]).collect();
        let dots = self.plan.samples.iter().map(|s| [s.time_s, planned(s)]).collect();
        Series { name, color, line, dots, dash: "" }
    }

    /// Panel of curves with their limits in both directions. A limit is drawn only if its curve approaches it.
    fn with_limits(&self, title: String, curves: Vec<(Series, f64)>) -> Panel {
        let near = |(curve, limit): &(Series, f64)| {
            let most = curve.line.iter().map(|[_, value]| value.abs()).fold(0.0, f64::max);
            let is_near = most > LIMIT_SHOWN_FROM_PART * limit;
            is_near.then_some([(*limit, curve.color), (-limit, curve.color)])
        };
        let limits = curves.iter().filter_map(near).flatten().collect();
        let series = curves.into_iter().map(|(curve, _)| curve).collect();
        self.limited(title, series, limits, Vec::new())
    }

    /// Names of a group's joints for the legend. Empty for a joint that the title names.
    fn joint_names(&self, group: &Group) -> Vec<String> {
        let joints = group.joints.iter().map(|&k| &self.plan.robot.joints[k]);
        let mut names = match &group.joints[..] {
            [k] if self.plan.robot.joints[*k].name == group.name => vec![String::new()],
            _ => distinct(joints.clone().map(|joint| joint.name.as_str())),
        };
        for (name, joint) in names.iter_mut().zip(joints) {
            if let Some(travel_m_per_rad) = joint.travel_m_per_rad {
                *name += &format!(" (1 rad = {travel_m_per_rad} m)");
                *name = name.trim_start().to_owned();
            }
        }
        names
    }
}

fn with_joints(groups: &[Group]) -> impl Iterator<Item = &Group> {
    groups.iter().filter(|group| !group.joints.is_empty())
}
