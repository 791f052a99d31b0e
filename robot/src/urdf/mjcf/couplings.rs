//! Motors that turn several joints: actuators at fixed tendons.

use roxmltree::Node;
use std::collections::{HashMap, HashSet};

/// Actuator at a fixed tendon.
pub struct Coupling<'a, 'i> {
    /// Joint that the motor belongs to: the last joint of the tendon without another motor.
    pub joint: &'a str,
    /// Joints of the tendon, with their coefficients. The motor acts on the tendon.
    pub ratios: Vec<(&'a str, f64)>,
    pub tendon: Node<'a, 'i>,
    pub actuator: Node<'a, 'i>,
}

/// Couplings that robot files can describe.
pub fn couplings<'a, 'i>(root: Node<'a, 'i>) -> Vec<Coupling<'a, 'i>> {
    let inside = |list: &'static str| {
        let lists = root.children().filter(move |node| node.has_tag_name(list));
        lists.flat_map(|list| list.children()).filter(|node| node.is_element())
    };
    let tendons: HashMap<&str, Node<'_, '_>> = inside("tendon")
        .filter(|node| node.has_tag_name("fixed"))
        .filter_map(|node| Some((node.attribute("name")?, node)))
        .collect();
    let mut driven: HashSet<&str> =
        inside("actuator").filter_map(|node| node.attribute("joint")).collect();
    let mut found = Vec::new();
    for actuator in inside("actuator") {
        let tendon = actuator.attribute("tendon").and_then(|name| tendons.get(name));
        let Some(&tendon) = tendon else { continue };
        let ratios = tendon.children().filter(|node| node.has_tag_name("joint")).map(|node| {
            let ratio = node.attribute("coef")?.trim().parse::<f64>().ok()?;
            Some((node.attribute("joint")?, ratio))
        });
        let Some(ratios) = ratios.collect::<Option<Vec<_>>>() else { continue };
        let own = ratios.iter().rev().find(|(joint, _)| !driven.contains(joint));
        let Some(&(joint, _)) = own else { continue };
        driven.insert(joint);
        found.push(Coupling { joint, ratios, tendon, actuator });
    }
    found
}
