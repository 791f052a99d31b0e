//! Elements of a URDF that close loops and that robot files lack. A warning names them.

use super::elements::tag;
use super::names::some_names;
use super::notes::Notes;
use roxmltree::Node;

/// Words in the tags of top-level elements that close loops in dialects of URDF.
const LOOPS: [&str; 3] = ["loop", "constraint", "bushing"];

/// Warns of loops.
pub(super) fn warn(root: Node<'_, '_>, notes: &mut Notes<'_>) {
    let elements = root.children().filter(|node| node.is_element());
    let loops: Vec<_> = elements.flat_map(loops).collect();
    if let Some(first) = loops.first() {
        let names: Vec<_> = loops.iter().map(|node| name(*node)).collect();
        notes.warn(&tag(*first), format_args!(
            "<{}> {} closes a loop and is not imported: lock the passive joints under [lock] of the side file. If a motor turns a joint by crank and rod, write `linkage` at this joint into the robot file",
            first.tag_name().name(),
            some_names(names.iter())
        ));
    }
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
