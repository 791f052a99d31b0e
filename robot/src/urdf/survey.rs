//! Survey of a URDF: its contents, and a first side file for it.

use super::bodies::{Bodies, Rigid, merge};
use super::convert::{idle_joints, locked_position};
use super::guess::{self, End, EndKind};
use super::joints::TURN_RAD;
use super::model::{Joint, Kind, MOVING_MAX, Urdf};
use super::names::{self, Names, some_names};
use super::notes::Notes;
use super::stance::{self, Stance, Turn};
use super::{Text, template, tree, xml};
use crate::document::DocumentError;
use rollwalk_protocol::config::MAX_CHANNELS;
use serde::Serialize;

/// Contents of a URDF, with guesses.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Name of the robot.
    pub name: String,
    /// The link taken as the body.
    pub root: String,
    /// Mass of its tree, kg.
    pub mass_kg: f64,
    /// Links, parents first.
    pub links: Vec<String>,
    /// Joints except the fixed ones, parents first.
    pub joints: Vec<SurveyJoint>,
    /// Likely feet and wheels.
    pub end_effectors: Vec<SurveyEnd>,
    /// Height of the body's origin above the ground in the proposed standing pose, m; none without feet.
    pub standing_height_m: Option<f64>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// The proposed side file.
    #[serde(skip)]
    pub template: String,
}

/// A joint of a [`Survey`].
#[derive(Clone, Debug, Serialize)]
pub struct SurveyJoint {
    /// Name in the URDF.
    pub name: String,
    /// Type in the URDF.
    pub kind: String,
    /// Limits, rad or m, as written.
    pub limits: [Option<f64>; 2],
    /// Treatment in the proposed side file.
    pub proposal: String,
}

/// A foot or wheel of a [`Survey`].
#[derive(Clone, Debug, Serialize)]
pub struct SurveyEnd {
    /// Proposed name.
    pub name: String,
    /// The link in the URDF.
    pub link: String,
    /// Proposed kind of contact.
    pub contact: String,
    /// Radius, m.
    pub radius_m: f64,
    /// True if the radius comes from the URDF.
    pub measured: bool,
    /// Centre in the frame of the root, in the proposed standing pose, m.
    pub center_m: [f64; 3],
}

/// Surveys a URDF and proposes a side file.
///
/// # Errors
/// All faults of the URDF.
pub fn survey(urdf: Text<'_>) -> Result<Survey, DocumentError> {
    let text = xml::checked(urdf.name, urdf.text)?;
    let mut notes = Notes::new(urdf.name, &text);
    let read = xml::read(&mut notes)?;
    let graph = tree::graph(&read, &mut notes);
    notes.check()?;
    let Some(graph) = graph else { unreachable!("a graph without faults") };
    let explicit = (graph.roots.len() > 1).then(|| graph.likely_root(&read));
    let Some(tree) = tree::choose(&read, &graph, explicit, &mut notes) else {
        unreachable!("one root is given")
    };
    let mut locks = guess::locks(&read, &tree);
    // Warnings belong to the final guess alone.
    let first = guessed(&read, &graph, &tree, &locks, &mut Notes::new("", ""));
    let idle = first.idle_beyond_channels();
    if let Some(joint) = idle.first() {
        let names = idle.iter().map(|&joint| &read.joints[joint].name);
        let (names, channels) = (some_names(names), first.channels());
        notes.warn(&read.joints[*joint].span, format_args!("joint {names}: locked in the side file that is proposed, as they carry no foot or wheel: the robot has {channels} channels, a controller and a library have at most {MAX_CHANNELS}"));
    }
    locks.extend(idle.iter().map(|&joint| (joint, locked_position(&read.joints[joint]))));
    let guess = guessed(&read, &graph, &tree, &locks, &mut notes);
    let moving = guess.bodies.moving.len();
    if moving > MOVING_MAX {
        let message = format!("{moving} joints of the robot move");
        let help = format!(
            "a controller and a library have at most {MAX_CHANNELS} channels; at most {MOVING_MAX} joints are read: make the others fixed"
        );
        notes.fault(read.links[tree.root].span.clone(), message, "the body", help);
    }
    notes.check()?;
    if guess.channels() > MAX_CHANNELS {
        let span = &read.links[tree.root].span;
        notes.warn(span, format_args!("{} channels are left, a controller and a library have at most {MAX_CHANNELS}: lock more joints under [lock]", guess.channels()));
    }
    let Guess { rigid, bodies, ends } = guess;
    let is_free = |end: &&End| end.kind == EndKind::FreeWheel;
    let axles = ends.iter().filter(is_free).filter_map(|end| Some(&read.joints[end.axle?]));
    let free: Vec<_> = axles.filter(|joint| guess::lacks_motor(&read, joint)).collect();
    if let Some(first) = free.first() {
        let names = some_names(free.iter().map(|joint| &joint.name));
        notes.warn(&first.span, format_args!("joint {names}: taken as axles of free wheels, as the file has motors for others only: `contact = \"actuated_wheel\"` in the side file makes them driven"));
    }
    let moving: Vec<_> = bodies.moving.iter().map(|moving| &read.joints[moving.joint]).collect();
    let turns: Vec<_> = moving.iter().map(|joint| turn(joint)).collect();
    let tips: Vec<_> = ends.iter().map(|end| end.tip).collect();
    let stance = stance::stance(&bodies, &turns, &tips);
    for &missed in &stance.missed {
        let link = &read.links[ends[missed].link];
        notes.warn(&link.span, format_args!("link `{}`: no pose found that puts it below its hip: set `nominal_rad` of its joints", link.name));
    }
    let names = end_names(&stance, &ends, &read);
    let joints = tree.order.iter().map(|&index| (index, &read.joints[index]));
    let joints = joints.filter(|(_, joint)| joint.kind != Kind::Fixed).map(|(index, joint)| {
        let position = moving.iter().position(|moving| moving.name == joint.name);
        let proposal = match (position, rigid.locked.get(&index)) {
            (Some(position), _) => format!("nominal {:.3} rad", stance.angles_rad[position]),
            (None, Some(at)) => format!("locked at {at}"),
            (None, None) => "axle of a wheel".to_owned(),
        };
        let kind = format!("{:?}", joint.kind).to_ascii_lowercase();
        SurveyJoint {
            name: joint.name.clone(),
            kind,
            limits: [joint.limit.lower, joint.limit.upper],
            proposal,
        }
    });
    let joints: Vec<_> = joints.collect();
    let end_effectors: Vec<_> = ends
        .iter()
        .zip(&names)
        .zip(&stance.tips_m)
        .map(|((end, name), center)| SurveyEnd {
            name: name.clone(),
            link: read.links[end.link].name.clone(),
            contact: end.kind.contact().to_owned(),
            radius_m: end.radius_m,
            measured: end.measured,
            center_m: (*center).into(),
        })
        .collect();
    if end_effectors.is_empty() {
        notes.warn(&(0..0), "nothing looks like a foot or a wheel: give [[end_effector]] tables");
    }
    let lowest = stance.tips_m.iter().zip(&ends).map(|(tip, end)| tip.z - end.radius_m);
    let standing_height_m = lowest.reduce(f64::min).map(|lowest| 0.0 - lowest);
    let places = bodies.places.iter().enumerate().filter(|(_, place)| place.is_some());
    let template = template::template(&template::Content {
        file_name: urdf.name,
        urdf: &read,
        root: explicit,
        moving: &moving,
        stance: &stance,
        locks,
        ends: ends.iter().zip(&names).collect(),
    });
    Ok(Survey {
        name: read.name.clone(),
        root: read.links[tree.root].name.clone(),
        mass_kg: bodies.bodies.iter().map(|body| body.mass.mass_kg).sum(),
        links: places.map(|(index, _)| read.links[index].name.clone()).collect(),
        joints,
        end_effectors,
        standing_height_m,
        warnings: notes.warnings,
        template,
    })
}

/// Guesses about the robot with some joints locked.
struct Guess {
    rigid: Rigid,
    bodies: Bodies,
    ends: Vec<End>,
}

fn guessed(
    urdf: &Urdf,
    graph: &tree::Graph,
    tree: &tree::Tree,
    locks: &[(usize, f64)],
    notes: &mut Notes<'_>,
) -> Guess {
    let mut rigid = Rigid { locked: locks.iter().copied().collect(), ..Rigid::default() };
    let axles = guess::axles(urdf, graph, tree, &rigid);
    rigid.wheels = axles.iter().copied().collect();
    let bodies = merge(urdf, graph, tree, &rigid, notes);
    let ends = guess::ends(urdf, graph, &bodies, &axles);
    Guess { rigid, bodies, ends }
}

impl Guess {
    /// Joints and actuated wheels.
    fn channels(&self) -> usize {
        let driven = self.ends.iter().filter(|end| end.kind == EndKind::DrivenWheel);
        self.bodies.moving.len() + driven.count()
    }

    /// Joints of arms and the like, if there are more channels than a controller has: indices into the URDF's.
    fn idle_beyond_channels(&self) -> Vec<usize> {
        if self.channels() <= MAX_CHANNELS {
            return Vec::new();
        }
        let tips: Vec<_> = self.ends.iter().map(|end| end.tip.body).collect();
        let idle = idle_joints(&self.bodies, &tips);
        idle.into_iter().map(|index| self.bodies.moving[index].joint).collect()
    }
}

fn turn(joint: &Joint) -> Turn {
    let limits = (joint.kind != Kind::Continuous).then_some(joint.limit);
    let (lower, upper) = match limits.map(|limit| (limit.lower, limit.upper)) {
        None | Some((None, None)) => (-TURN_RAD, TURN_RAD),
        Some((lower, upper)) => (lower.unwrap_or(0.0), upper.unwrap_or(0.0)),
    };
    let [min_rad, max_rad] =
        [lower.min(upper), lower.max(upper)].map(|l| l.clamp(-TURN_RAD, TURN_RAD));
    Turn { axis: joint.axis, min_rad, max_rad }
}

/// Names of end effectors: `front_left` and so on for four in four corners, which named gaits need; else
/// those of their links.
fn end_names(stance: &Stance, ends: &[End], urdf: &Urdf) -> Vec<String> {
    let count = stance.tips_m.len() as f64;
    let middle_m = stance.tips_m.iter().map(|tip| tip.x).sum::<f64>() / count;
    let corner = |tip: &nalgebra::Vector3<f64>| {
        let end = if tip.x > middle_m { "front" } else { "rear" };
        let side = if tip.y > 0.0 { "left" } else { "right" };
        format!("{end}_{side}")
    };
    let corners: Vec<_> = stance.tips_m.iter().map(corner).collect();
    let mut distinct = corners.clone();
    distinct.sort();
    distinct.dedup();
    if distinct.len() == 4 && corners.len() == 4 {
        return corners;
    }
    let mut names = Names::default();
    ends.iter().map(|end| names.unique(&names::allowed(&urdf.links[end.link].name))).collect()
}
