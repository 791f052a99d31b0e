//! Survey of a URDF: its contents, and a first side file for it.

use super::draft_side::{self, Draft};
use super::guess::End;
use super::model::{Kind, MOVING_MAX, Urdf};
use super::names::{self, Names};
use super::notes::Notes;
use super::side::{self, AXES, Side};
use super::stance::{self, Stance};
use super::{Text, remarks, template, tree, xml};
use crate::document::{Document, DocumentError};
use nalgebra::{Point3, Vector3};
use rollwalk_protocol::config::MAX_CHANNELS;
use rollwalk_protocol::library::MAX_NAME;
use serde::Serialize;

/// Contents of a URDF, with guesses.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// Name of the robot.
    pub name: String,
    /// Link that becomes the body.
    pub root: String,
    /// Axes of this link that point forward and up, such as `+x` and `+z`.
    pub axes: [&'static str; 2],
    /// Mass of its tree, kg.
    pub mass_kg: f64,
    /// Links, parents first.
    pub links: Vec<String>,
    /// Joints except the fixed ones, parents first.
    pub joints: Vec<SurveyJoint>,
    /// Likely feet and wheels.
    pub end_effectors: Vec<SurveyEnd>,
    /// Height of the body's origin above the ground in the proposed standing pose, m; `None` without feet.
    pub standing_height_m: Option<f64>,
    /// Warnings.
    pub warnings: Vec<String>,
    /// Proposed side file.
    #[serde(skip)]
    pub template: String,
}

/// Joint of a [`Survey`].
#[derive(Clone, Debug, Serialize)]
pub struct SurveyJoint {
    /// Name in the URDF.
    pub name: String,
    /// Type in the URDF.
    pub kind: String,
    /// Limits of the URDF, rad or m.
    pub limits: [Option<f64>; 2],
    /// Treatment in the proposed side file.
    pub proposal: String,
}

/// Foot or wheel of a [`Survey`].
#[derive(Clone, Debug, Serialize)]
pub struct SurveyEnd {
    /// Proposed name.
    pub name: String,
    /// Link in the URDF.
    pub link: String,
    /// Proposed kind of contact.
    pub contact: String,
    /// Radius, m.
    pub radius_m: f64,
    /// True if the radius comes from the URDF.
    pub measured: bool,
    /// Centre in the frame of the body, in the proposed standing pose, m.
    pub center_m: [f64; 3],
}

/// Surveys a URDF and proposes a side file.
///
/// # Errors
/// All faults of the URDF.
pub fn survey(urdf: Text<'_>) -> Result<Survey, DocumentError> {
    survey_with(urdf, Text { name: "", text: "" })
}

/// Surveys a URDF and proposes a side file, in which the values of a given one replace guesses.
///
/// # Errors
/// All faults of the URDF or of the given side file.
pub fn survey_with(urdf: Text<'_>, given: Text<'_>) -> Result<Survey, DocumentError> {
    let document = Document::parse(given.name, given.text)?;
    let Some(side) = side::read(&document) else { return document.finish(None) };
    let text = xml::checked(urdf.name, urdf.text)?;
    let mut notes = Notes::new(urdf.name, &text);
    let mut read = xml::read(&mut notes)?;
    narrow(&mut read, &side);
    let graph = tree::graph(&read, &mut notes);
    notes.check()?;
    let Some(graph) = graph else { unreachable!("a graph without faults") };
    let named = side.root.as_ref().and_then(|(name, _)| graph.link_index.get(name).copied());
    let several = (graph.roots.len() > 1).then(|| graph.likely_root(&read));
    let explicit = named.or(several);
    let Some(tree) = tree::choose(&read, &graph, explicit, &mut notes) else {
        unreachable!("one root is given")
    };
    let draft = Draft::new(&read, &graph, &tree, &side, &mut notes);
    let moving_count = draft.bodies.moving.len();
    if moving_count > MOVING_MAX {
        let message = format!("{moving_count} joints of the robot move");
        let help = format!(
            "make other joints fixed: a controller has at most {MAX_CHANNELS} channels, and the import reads at most {MOVING_MAX} joints"
        );
        notes.fault(read.links[tree.root].span.clone(), message, "the body", help);
    }
    notes.check()?;
    let turns = stance::turns(&read, &draft.bodies);
    let tips: Vec<_> = draft.ends.iter().map(|end| end.tip).collect();
    let stance = stance::stance(&draft.bodies, &turns, &tips);
    let draft = draft.below_the_body(&stance);
    let tips: Vec<_> = draft.ends.iter().map(|end| end.tip).collect();
    let stance = stance::stance(&draft.bodies, &turns, &tips);
    remarks::warn(&read, &graph, &draft, &stance, &mut notes);
    Ok(finished(urdf.name, &read, &tree, explicit, &side, &draft, &stance, notes))
}

/// Replaces limits of the URDF by those of the side file.
fn narrow(urdf: &mut Urdf, side: &Side) {
    for given in &side.joints {
        let Some(joint) = urdf.joints.iter_mut().find(|joint| joint.name == given.joint) else {
            continue;
        };
        if joint.kind == Kind::Continuous && given.min_rad.is_some() && given.max_rad.is_some() {
            joint.kind = Kind::Revolute;
        }
        joint.limit.lower = given.min_rad.or(joint.limit.lower);
        joint.limit.upper = given.max_rad.or(joint.limit.upper);
    }
}

#[expect(clippy::too_many_arguments)]
fn finished(
    file_name: &str,
    read: &Urdf,
    tree: &tree::Tree,
    root: Option<usize>,
    side: &Side,
    draft: &Draft,
    stance: &Stance,
    notes: Notes<'_>,
) -> Survey {
    let moving: Vec<_> =
        draft.bodies.moving.iter().map(|moving| &read.joints[moving.joint]).collect();
    let contacts = contacts(stance, draft, read);
    let joints = tree.order.iter().map(|&index| (index, &read.joints[index]));
    let joints = joints.filter(|(_, joint)| joint.kind != Kind::Fixed).map(|(index, joint)| {
        let position = moving.iter().position(|moving| moving.name == joint.name);
        let proposal = match (position, draft.rigid.locked.get(&index)) {
            (Some(position), _) if joint.kind == Kind::Prismatic => {
                format!("nominal {:.4} m", stance.angles_rad[position])
            }
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
    let end_effectors: Vec<_> = contacts
        .iter()
        .map(|contact| SurveyEnd {
            name: contact.name.clone(),
            link: read.links[contact.end.link].name.clone(),
            contact: contact.end.kind.contact().to_owned(),
            radius_m: contact.end.radius_m,
            measured: contact.end.measured,
            center_m: contact.center_m.into(),
        })
        .collect();
    let lowest = stance.tips_m.iter().zip(&draft.ends).map(|(tip, end)| tip.z - end.radius_m);
    let standing_height_m = lowest.reduce(f64::min).map(|lowest| 0.0 - lowest);
    let places = draft.bodies.places.iter().enumerate().filter(|(_, place)| place.is_some());
    let template = template::template(&template::Content {
        file_name,
        urdf: read,
        root,
        side,
        draft,
        moving: &moving,
        stance,
        contacts: &contacts,
        base: draft_side::base(tree.root, draft, stance),
    });
    let axes = draft.heading.axes;
    Survey {
        name: read.name.clone(),
        root: read.links[tree.root].name.clone(),
        axes: [axes.forward, axes.up].map(|axis| AXES[axis]),
        mass_kg: draft.bodies.bodies.iter().map(|body| body.mass.mass_kg).sum(),
        links: places.map(|(index, _)| read.links[index].name.clone()).collect(),
        joints,
        end_effectors,
        standing_height_m,
        warnings: notes.warnings,
        template,
    }
}

/// Contact of a foot or wheel with the ground.
pub(super) struct Contact<'a> {
    pub end: &'a End,
    pub name: String,
    pub center_in_link_m: Vector3<f64>,
    /// Centre in the frame of the root, m.
    center_m: Vector3<f64>,
}

/// Contacts of all feet and wheels: one for each, or those of its sole.
fn contacts<'a>(stance: &Stance, draft: &'a Draft, urdf: &Urdf) -> Vec<Contact<'a>> {
    let names = end_names(stance, draft, urdf);
    let mut used = Names::default();
    let mut contacts = Vec::new();
    for ((end, name), &center_m) in draft.ends.iter().zip(names).zip(&stance.tips_m) {
        if end.sole.is_empty() {
            let center_in_link_m = end.center_in_link_m;
            let name = used.unique(&name);
            contacts.push(Contact { end, name, center_in_link_m, center_m });
        }
        for corner in &end.sole {
            let suffix = corner.part.suffix();
            let kept = name.len().min(MAX_NAME - suffix.len() - 1);
            let name = used.unique(&format!("{}_{suffix}", &name[..kept]));
            let center_in_link_m = corner.center_in_link_m;
            let Some((body, pose)) = draft.bodies.places[end.link] else { continue };
            let in_root = stance.poses[body] * pose * Point3::from(center_in_link_m);
            contacts.push(Contact { end, name, center_in_link_m, center_m: in_root.coords });
        }
    }
    contacts
}

/// Names of feet and wheels: `front_left` and so on for four in four corners, as named gaits require, `left` and `right` for two
/// soles, else those of their links.
fn end_names(stance: &Stance, draft: &Draft, urdf: &Urdf) -> Vec<String> {
    let count = stance.tips_m.len() as f64;
    let middle = stance.tips_m.iter().sum::<Vector3<f64>>() / count;
    let corner = |tip: &Vector3<f64>| {
        let end = if tip.x > middle.x { "front" } else { "rear" };
        let side = if tip.y > middle.y { "left" } else { "right" };
        format!("{end}_{side}")
    };
    let corners: Vec<_> = stance.tips_m.iter().map(corner).collect();
    let mut distinct = corners.clone();
    distinct.sort();
    distinct.dedup();
    if distinct.len() == 4 && corners.len() == 4 {
        return corners;
    }
    if let [one, other] = &draft.ends[..]
        && !one.sole.is_empty()
        && !other.sole.is_empty()
        && let [Some(one), Some(other)] = [0, 1].map(|index| corners[index].split_once('_'))
        && one.1 != other.1
    {
        return [one.1, other.1].map(String::from).to_vec();
    }
    let mut names = Names::default();
    let links = draft.ends.iter().map(|end| &urdf.links[end.link].name);
    links.map(|link| names.unique(&names::allowed(link))).collect()
}
