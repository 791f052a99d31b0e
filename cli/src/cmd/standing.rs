//! Statics of a robot in its nominal pose: heights, forces, torques against limits, sag and clearance, with the warnings of
//! `rollwalk robot check`.

use super::description::name_with_unit;
use rollwalk_multibody::{PassiveLoad, Standing, Tree, passive_loads, warnings};
use rollwalk_robot::Robot;
use rollwalk_terminal::link::reach::leg_m;
use rollwalk_terminal::output::{Table, fixed};
use serde::Serialize;
use std::fmt::Write;

/// Ratio of torque to torque limit above which a joint is too weak. On two of four legs, as in a trot, it needs twice the
/// torque.
const SHARE_MAX: f64 = 0.6;
/// Distance below which two contacts count as coincident, m.
const SAME_PLACE_M: f64 = 1e-3;
/// Depth of a shape below the ground that is a rounding error, m.
const LEVEL_M: f64 = 1e-4;
/// Number of closest pairs of shapes in the table.
const PAIRS_SHOWN: usize = 5;

/// Static equilibrium of a robot in its nominal pose, with its body level, on level ground, without torque feed-forward.
#[derive(Debug, Serialize)]
pub struct StandingReport {
    /// Height of the origin of the body, m.
    body_height_m: f64,
    /// Centre of mass: forward and left of the origin of the body, and above the ground, m.
    com_m: [f64; 3],
    contacts: Vec<ContactLoad>,
    joints: Vec<Joint>,
    /// Joints without a motor; left out if there are none.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    passive_joints: Vec<PassiveJoint>,
    clearance_margin_m: f64,
    /// Distances between shapes of links, closest first.
    clearances: Vec<Clearance>,
    /// Heights of links with shapes above the ground.
    heights: Vec<Height>,
    /// Warnings about implausible values for a robot of this size; `warnings` begins with them.
    #[serde(skip)]
    implausibilities: Vec<String>,
    warnings: Vec<String>,
}

#[derive(Debug, Serialize)]
struct ContactLoad {
    name: String,
    /// Position: forward and left of the origin of the body, and above the ground, m.
    position_m: [f64; 3],
    force_n: f64,
    /// Sag of the body at this contact due to joint deflection, m.
    sag_m: f64,
    /// Length of the stretched limb from its first joint to the ground, m; 0 without joints.
    leg_m: f64,
}

#[derive(Debug, Serialize)]
struct Joint {
    name: String,
    torque_nm: f64,
    torque_max_nm: f64,
    /// `|torque| / limit`.
    share: f64,
    /// Deflection, rad: torque / stiffness.
    yields_rad: f64,
}

#[derive(Debug, Serialize)]
struct PassiveJoint {
    name: String,
    /// Name in the table.
    #[serde(skip)]
    shown: String,
    /// Torque of the spring, N·m. Torque, angle and deflection are `null` if the spring is too soft to hold the links beyond the
    /// joint.
    torque_nm: Option<f64>,
    stands_at_rad: Option<f64>,
    deflection_rad: Option<f64>,
    /// Natural frequency of the links beyond the joint, Hz, and its damping ratio.
    natural_hz: f64,
    damping_ratio: f64,
}

impl PassiveJoint {
    fn new(robot: &Robot, load: &PassiveLoad) -> Self {
        let joint = &robot.joints[load.joint];
        let spring = joint.spring.unwrap_or_default();
        Self {
            name: joint.name.clone(),
            shown: name_with_unit(joint),
            torque_nm: load.stands_at_rad.map(|at_rad| spring.torque_nm(at_rad, 0.0)),
            stands_at_rad: load.stands_at_rad,
            deflection_rad: load.stands_at_rad.map(|at_rad| at_rad - spring.rest_rad),
            natural_hz: load.natural_hz,
            damping_ratio: load.damping_ratio,
        }
    }
}

#[derive(Debug, Serialize)]
struct Clearance {
    links: [String; 2],
    distance_m: f64,
}

#[derive(Debug, Serialize)]
struct Height {
    link: String,
    /// Index of the link's lowest shape.
    #[serde(skip)]
    shape: usize,
    height_m: f64,
    /// Minimum height, m: the clearance margin, or 0 for a link with a foot or wheel.
    least_m: f64,
}

impl Height {
    /// Warning about a shape in the ground.
    fn below_ground(&self) -> String {
        format!(
            "shape {} of link `{}` is {:.1} mm below the ground in the nominal pose: shorten this entry of \
             `shapes` so that it ends above the contact, or correct `nominal_rad` or `radius_m`",
            self.shape,
            self.link,
            -1e3 * self.height_m
        )
    }
}

impl StandingReport {
    /// Examines a valid robot; returns `None` if one of its wheels lies flat.
    pub fn new(robot: &Robot) -> Option<Self> {
        let tree = Tree::new(robot);
        let standing = Standing::new(&tree)?;
        let contacts = robot.end_effectors.iter().zip(&standing.contacts);
        let joints = robot.joints.iter().zip(&standing.torque_nm);
        let joints = joints.filter(|(joint, _)| !joint.is_passive());
        let passive = passive_loads(&tree, &standing);
        let mut clearances: Vec<_> = robot
            .clearance_pairs()
            .map(|pair| Clearance {
                links: pair.links.map(|link| robot.links[link].name.clone()),
                distance_m: standing.frames.clearance(&pair),
            })
            .collect();
        clearances.sort_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
        let links = robot.links.iter().enumerate();
        let height = |(index, link): (usize, &rollwalk_robot::Link)| {
            let (shape, height_m) = standing.frames.lowest_shape(&tree, index)?;
            let stands = robot.end_effectors.iter().any(|end| end.link == index);
            let least_m = if stands { 0.0 } else { robot.clearance_margin_m };
            Some(Height { link: link.name.clone(), shape, height_m, least_m })
        };
        let mut report = Self {
            body_height_m: standing.frames.link_origins[0].z,
            com_m: standing.com.into(),
            contacts: contacts
                .map(|(end, contact)| ContactLoad {
                    name: end.name.clone(),
                    position_m: contact.position.into(),
                    force_n: contact.force_n,
                    sag_m: contact.sag_m,
                    leg_m: leg_m(&tree, &standing, end),
                })
                .collect(),
            joints: joints
                .map(|(joint, &torque_nm)| Joint {
                    name: joint.name.clone(),
                    torque_nm,
                    torque_max_nm: joint.actuator.torque_max_nm,
                    share: torque_nm.abs() / joint.actuator.torque_max_nm,
                    yields_rad: torque_nm / joint.actuator.kp_nm_rad,
                })
                .collect(),
            passive_joints: passive.iter().map(|load| PassiveJoint::new(robot, load)).collect(),
            clearance_margin_m: robot.clearance_margin_m,
            clearances,
            heights: links.filter_map(height).collect(),
            implausibilities: Vec::new(),
            warnings: Vec::new(),
        };
        report.implausibilities = warnings(&tree, &standing);
        report.warnings = report.implausibilities.clone();
        report.warnings.extend(report.warn(standing.balanced));
        Some(report)
    }

    /// Warnings about the robot.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Warnings about implausible values for a robot of this size, with their likely causes.
    pub fn implausibilities(&self) -> &[String] {
        &self.implausibilities
    }

    /// Warning about the pairs of links that overlap in the nominal pose; `None` without overlaps.
    pub fn overlaps(&self) -> Option<String> {
        let overlapping = self.clearances.iter().filter(|near| near.distance_m < 0.0);
        let mut pairs: Vec<_> = overlapping.map(|near| near.links.join(" – ")).collect();
        pairs.dedup();
        (!pairs.is_empty()).then(|| {
            format!(
                "shapes of {} overlap in the nominal pose, so plans do not keep them apart: make \
                 these `shapes` smaller in the robot file",
                pairs.join(", ")
            )
        })
    }

    fn warn(&self, balanced: bool) -> Vec<String> {
        let mut warnings = Vec::new();
        for contact in self.contacts.iter().filter(|contact| contact.force_n == 0.0) {
            let height_mm = 1e3 * contact.position_m[2];
            warnings.push(format!(
                "end effector `{}` is {height_mm:.0} mm above the ground in the nominal pose: \
                 change `nominal_rad` of its joints if it should touch the ground",
                contact.name
            ));
        }
        let mut left: Vec<_> =
            self.contacts.iter().filter(|contact| contact.force_n > 0.0).collect();
        while let Some(first) = left.pop() {
            let at = |contact: &ContactLoad| nalgebra::Vector3::from(contact.position_m);
            let (mut same, others): (Vec<_>, Vec<_>) =
                left.into_iter().partition(|other| (at(other) - at(first)).norm() < SAME_PLACE_M);
            left = others;
            if !same.is_empty() {
                same.push(first);
                let names: Vec<_> =
                    same.iter().map(|contact| format!("`{}`", contact.name)).collect();
                warnings.push(format!(
                    "end effectors {} touch the ground at the same point: check the mounting \
                     points of their limbs",
                    names.join(" and ")
                ));
            }
        }
        if !balanced {
            let [x, y, _] = self.com_m.map(fixed::<3>);
            warnings.push(format!(
                "the robot tips, because its centre of mass is outside its support, {x} m forward \
                 and {y} m left of the body origin: change `nominal_rad` or the masses"
            ));
        }
        for joint in self.joints.iter().filter(|joint| joint.share > SHARE_MAX) {
            warnings.push(format!(
                "joint `{}` needs {:.2} N·m to stand, {:.0} % of `torque_max_nm` {}; expected at \
                 most {:.0} %: use a stronger actuator, a lighter robot or straighter legs",
                joint.name,
                joint.torque_nm.abs(),
                100.0 * joint.share,
                joint.torque_max_nm,
                100.0 * SHARE_MAX
            ));
        }
        let margin_m = self.clearance_margin_m;
        let near: Vec<_> =
            self.clearances.iter().filter(|near| near.distance_m < margin_m).collect();
        let (overlapping, close): (Vec<_>, Vec<_>) =
            near.into_iter().partition(|near| near.distance_m < 0.0);
        if !overlapping.is_empty() {
            let so = "plans do not keep them apart";
            warnings.push(self.too_near(&overlapping, so));
        }
        let so = "plans may bring them this close";
        warnings.extend(close.into_iter().map(|near| self.too_near(&[near], so)));
        for height in &self.heights {
            let Height { link, height_m, least_m, .. } = height;
            if *height_m < -LEVEL_M {
                warnings.push(height.below_ground());
            } else if height_m < least_m {
                warnings.push(format!(
                    "link `{link}` is {:.1} mm above the ground in the nominal pose, so plans may lower the link to this height; expected at least {:.1} mm: check its `shapes`, which must end above \
                     the contact",
                    1e3 * height_m,
                    1e3 * least_m
                ));
            }
        }
        if self.heights.is_empty() {
            warnings
                .push("no link has `shapes`: clearance between links is not checked".to_owned());
        }
        warnings
    }

    /// Warning about pairs of links below the margin.
    fn too_near(&self, pairs: &[&Clearance], so: &str) -> String {
        let described = |near: &&Clearance| {
            let [first, second] = &near.links;
            format!("`{first}` and `{second}` {}", apart(near.distance_m))
        };
        format!(
            "links {} in the nominal pose, so {so}; expected at least {:.1} mm: check `shapes`, `nominal_rad` or `clearance_margin_m`",
            pairs.iter().map(described).collect::<Vec<_>>().join(", "),
            1e3 * self.clearance_margin_m
        )
    }

    /// Warning about the lowest shape if it is in the ground; `None` if all shapes are above.
    pub fn shape_in_ground(&self) -> Option<String> {
        let lowest = self.heights.iter().min_by(|a, b| a.height_m.total_cmp(&b.height_m))?;
        (lowest.height_m < -LEVEL_M).then(|| lowest.below_ground())
    }

    /// Formats the report as text.
    pub fn show(&self) -> String {
        let [x, y, z] = self.com_m.map(fixed::<3>);
        let height = fixed::<3>(self.body_height_m);
        let mut text = format!(
            "standing in the nominal pose: body origin {height} m high, centre of mass {z} m high, {x} m forward, {y} m left\n\n"
        );
        let mut contacts = Table::new([
            "end effector",
            "forward m",
            "left m",
            "height mm",
            "force N",
            "sag mm",
            "leg length m",
        ]);
        for ContactLoad { name, position_m: [x, y, z], force_n, sag_m, leg_m } in &self.contacts {
            contacts.row([
                name.clone(),
                fixed::<3>(*x),
                fixed::<3>(*y),
                fixed::<1>(1e3 * z),
                fixed::<1>(*force_n),
                fixed::<1>(1e3 * sag_m),
                fixed::<3>(*leg_m),
            ]);
        }
        let _ = writeln!(text, "{}", contacts.render());
        if !self.joints.is_empty() {
            let mut joints = Table::new(["joint", "standing N·m", "of limit", "deflection rad"]);
            for joint in &self.joints {
                joints.row([
                    joint.name.clone(),
                    fixed::<3>(joint.torque_nm),
                    format!("{:.0} %", 100.0 * joint.share),
                    fixed::<3>(joint.yields_rad),
                ]);
            }
            let _ = writeln!(text, "\n{}", joints.render());
        }
        if !self.passive_joints.is_empty() {
            let mut springs = Table::new([
                "spring",
                "torque N·m",
                "deflects rad",
                "stands at rad",
                "natural Hz",
                "damping ratio",
            ]);
            let or = |value: Option<f64>| value.map_or("too soft".to_owned(), fixed::<3>);
            for joint in &self.passive_joints {
                springs.row([
                    joint.shown.clone(),
                    or(joint.torque_nm),
                    or(joint.deflection_rad),
                    or(joint.stands_at_rad),
                    format!("{:.1}", joint.natural_hz),
                    fixed::<2>(joint.damping_ratio),
                ]);
            }
            let _ = writeln!(text, "\n{}", springs.render());
        }
        if !self.clearances.is_empty() {
            let margin = format!("margin {:.1} mm", 1e3 * self.clearance_margin_m);
            let mut pairs = Table::new(["closest shapes", &margin]);
            for near in self.clearances.iter().take(PAIRS_SHOWN) {
                let [first, second] = &near.links;
                let distance = format!("{:.1} mm", 1e3 * near.distance_m);
                pairs.row([format!("{first} – {second}"), distance]);
            }
            let _ = writeln!(text, "\n{}", pairs.render());
        }
        text
    }
}

fn apart(distance_m: f64) -> String {
    let mm = 1e3 * distance_m;
    if mm < 0.0 { format!("overlap by {:.1} mm", -mm) } else { format!("are {mm:.1} mm apart") }
}
