//! `<transmission>`: two motors that turn two joints, by a differential or by a belt past the first joint.
//!
//! The types are those of ROS: <https://docs.ros.org/en/noetic/api/transmission_interface/html/c++/>. With the reductions n of
//! the joints and motor angles x at the output of the gearboxes,
//!
//! ```text
//! differential       x₁ = n₁ q₁ + n₂ q₂     x₂ = n₁ q₁ − n₂ q₂
//! four-bar linkage   x₁ = n₁ q₁             x₂ = q₁ + n₂ q₂
//! ```
//!
//! Reductions of the actuators have no effect, because motors of robot files have the angles of their gearbox outputs.

use super::elements::tag;
use super::model::{ITEMS_MAX, Urdf};
use super::names::some_names;
use super::notes::Notes;
use roxmltree::Node;

/// Word in the type of a transmission between one motor and one joint.
const SIMPLE: &str = "simple";

/// Two joints of a transmission with the ratios of their motors.
struct Coupling<'a> {
    joints: [&'a str; 2],
    /// Ratios of each motor to both joints.
    rows: [[f64; 2]; 2],
    /// Number of motors that share the load of a joint.
    sharing: f64,
}

/// Couples the motors of joints. Warns of the change, and of transmissions that robot files lack.
pub(super) fn couple(root: Node<'_, '_>, urdf: &mut Urdf, notes: &mut Notes<'_>) {
    let (mut coupled, mut geared, mut dropped) = (Vec::new(), Vec::new(), Vec::new());
    let all = root.descendants().filter(|node| node.has_tag_name("transmission"));
    for node in all.take(ITEMS_MAX) {
        match coupling(node) {
            Some(coupling) if apply(&coupling, urdf) => coupled.push(node),
            _ if !is_simple(node) => dropped.push(node),
            _ if reductions(node).any(|ratio| ratio != 1.0) => geared.push(node),
            _ => {}
        }
    }
    let mut warn = |nodes: &[Node<'_, '_>], text: &str| {
        let Some(first) = nodes.first() else { return };
        let name =
            |node: &Node<'_, '_>| node.attribute("name").unwrap_or("transmission").to_owned();
        let names: Vec<_> = nodes.iter().map(name).collect();
        let names = some_names(names.iter());
        notes.warn(&tag(*first), format_args!("<transmission> {names}: {text}"));
    };
    warn(
        &coupled,
        "the motors turn both joints (`motor_per_joint`). The limits of the motors follow from the limits of the joints: check them, and give other limits under [actuator.NAME] of the side file",
    );
    warn(
        &geared,
        "the reduction is not imported, because the values of motors are those at the gearbox output; drives that count turns of the motor have `reduction` in [[bus]]",
    );
    warn(
        &dropped,
        "coupled joints of this type are not imported. Each joint gets a motor of its own with the limits of the joint; write `motor_per_joint` into the robot file",
    );
}

/// Type or plugin of a transmission in small letters.
fn kind(transmission: Node<'_, '_>) -> Option<String> {
    let inside = |tag: &str| {
        let child = transmission.children().find(|node| node.has_tag_name(tag))?;
        child.text().map(str::to_owned)
    };
    let written = transmission.attribute("type").map(str::to_owned);
    let kind = written.or_else(|| inside("type")).or_else(|| inside("plugin"))?;
    Some(kind.to_ascii_lowercase())
}

/// Children of a transmission with the given tag.
fn parts<'a, 'i>(
    transmission: Node<'a, 'i>,
    tag: &'static str,
) -> impl Iterator<Item = Node<'a, 'i>> {
    transmission.children().filter(move |node| node.has_tag_name(tag))
}

/// True for a transmission between one motor and one joint.
fn is_simple(transmission: Node<'_, '_>) -> bool {
    kind(transmission).is_none_or(|kind| kind.contains(SIMPLE))
        && ["joint", "actuator"].into_iter().all(|tag| parts(transmission, tag).count() <= 1)
}

/// Reductions of all parts.
fn reductions(part: Node<'_, '_>) -> impl Iterator<Item = f64> {
    let is_reduction = |node: &Node<'_, '_>| {
        let name = node.tag_name().name().to_ascii_lowercase();
        name == "mechanicalreduction" || name == "mechanical_reduction"
    };
    part.descendants()
        .filter(is_reduction)
        .filter_map(|node| node.text()?.trim().parse::<f64>().ok())
        .filter(|ratio| ratio.is_finite())
}

/// Coupling of a transmission; `None` for other types and for zero reductions.
fn coupling<'a>(transmission: Node<'a, '_>) -> Option<Coupling<'a>> {
    let kind = kind(transmission)?;
    let with_role = |number: usize| {
        let role = format!("joint{}", number + 1);
        let has_role = |node: &Node<'_, '_>| {
            let inside = node.children().find(|child| child.has_tag_name("role"));
            let inside = inside.and_then(|role| role.text());
            node.attribute("role").or(inside).map(str::trim) == Some(role.as_str())
        };
        let in_order = || parts(transmission, "joint").nth(number);
        parts(transmission, "joint").find(has_role).or_else(in_order)
    };
    let [first, second] = [with_role(0)?, with_role(1)?];
    let ratio = |node: Node<'_, '_>| reductions(node).next().unwrap_or(1.0);
    let [n1, n2] = [ratio(first), ratio(second)];
    let joints = [first.attribute("name")?, second.attribute("name")?];
    let (rows, sharing) = if kind.contains("differential") {
        ([[n1, n2], [n1, -n2]], 2.0)
    } else if kind.contains("fourbarlinkage") {
        ([[n1, 0.0], [1.0, n2]], 1.0)
    } else {
        return None;
    };
    (n1 != 0.0 && n2 != 0.0 && joints[0] != joints[1]).then_some(Coupling { joints, rows, sharing })
}

/// Couples the motors of two joints, and converts the limits of the joints to those of the motors. Returns false if a joint
/// does not exist or has another coupling.
fn apply(coupling: &Coupling<'_>, urdf: &mut Urdf) -> bool {
    let find = |name: &&str| urdf.joints.iter().position(|joint| joint.name == **name);
    let indices: Option<Vec<_>> = coupling.joints.iter().map(find).collect();
    let Some(indices) = indices else { return false };
    if indices.iter().any(|&joint| !urdf.joints[joint].motor_per_joint.is_empty()) {
        return false;
    }
    for (number, (&index, row)) in indices.iter().zip(&coupling.rows).enumerate() {
        let joint = &mut urdf.joints[index];
        let own = row[number].abs();
        joint.limit.effort = joint.limit.effort.map(|nm| nm / (own * coupling.sharing));
        joint.limit.velocity = joint.limit.velocity.map(|rad_s| rad_s * own);
        let ratios = coupling.joints.iter().zip(row).filter(|(_, ratio)| **ratio != 0.0);
        let ratios: Vec<_> = ratios.map(|(name, ratio)| ((*name).to_owned(), *ratio)).collect();
        if ratios.len() > 1 || own != 1.0 {
            joint.motor_per_joint = ratios;
        }
    }
    true
}
