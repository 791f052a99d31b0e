//! Elements of a URDF that constrain or drive the robot and that robot files lack. A warning names them.

use super::elements::tag;
use super::names::some_names;
use super::notes::Notes;
use roxmltree::Node;

/// Words in the tags of top-level elements that close loops in dialects of URDF.
const LOOPS: [&str; 3] = ["loop", "constraint", "bushing"];
/// Word in the type of a transmission between one motor and one joint.
const SIMPLE: &str = "simple";

/// Warns of transmissions with a ratio or several joints, and of loops.
pub(super) fn warn(root: Node<'_, '_>, notes: &mut Notes<'_>) {
    let elements = || root.children().filter(|node| node.is_element());
    let transmissions: Vec<_> =
        elements().filter(|node| node.has_tag_name("transmission") && couples(*node)).collect();
    if let Some(first) = transmissions.first() {
        let names: Vec<_> = transmissions.iter().map(|node| name(*node)).collect();
        notes.warn(&tag(*first), format_args!(
            "<transmission> {}: ratios and coupled joints are not imported. Each joint gets a motor of its own with the limits of the joint; give other limits under [joint] and [actuator.NAME] of the side file",
            some_names(names.iter())
        ));
    }
    let loops: Vec<_> = elements().flat_map(loops).collect();
    if let Some(first) = loops.first() {
        let names: Vec<_> = loops.iter().map(|node| name(*node)).collect();
        notes.warn(&tag(*first), format_args!(
            "<{}> {} closes a loop and is not imported; the linkage moves freely: lock its passive joints under [lock] of the side file",
            first.tag_name().name(),
            some_names(names.iter())
        ));
    }
}

/// True unless a transmission connects one motor to one joint with ratio 1.
fn couples(transmission: Node<'_, '_>) -> bool {
    let kind = transmission.attribute("type").map(str::to_owned).or_else(|| {
        let element = transmission.children().find(|node| node.has_tag_name("type"))?;
        element.text().map(str::to_owned)
    });
    let is_simple = kind.is_none_or(|kind| kind.to_ascii_lowercase().contains(SIMPLE));
    let count = |tag: &str| transmission.children().filter(|node| node.has_tag_name(tag)).count();
    let mut ratios = transmission
        .descendants()
        .filter(|node| node.tag_name().name().eq_ignore_ascii_case("mechanicalReduction"))
        .filter_map(|node| node.text()?.trim().parse::<f64>().ok());
    !is_simple || count("joint") > 1 || count("actuator") > 1 || ratios.any(|ratio| ratio != 1.0)
}

/// Elements of a top-level element that close a loop: those of a dialect, and SDF joints in `<gazebo>`.
fn loops<'a, 'i>(element: Node<'a, 'i>) -> Vec<Node<'a, 'i>> {
    let called = element.tag_name().name();
    if called == "gazebo" {
        let is_joint = |node: &Node<'_, '_>| {
            let has = |tag| node.children().any(|child| child.has_tag_name(tag));
            node.has_tag_name("joint") && has("parent") && has("child")
        };
        return element.descendants().filter(is_joint).collect();
    }
    if LOOPS.iter().any(|word| called.contains(word)) { vec![element] } else { Vec::new() }
}

/// Name of an element, else its tag.
fn name(node: Node<'_, '_>) -> String {
    node.attribute("name").unwrap_or(node.tag_name().name()).to_owned()
}
