//! Elements that constrain or drive the robot and that robot files lack. A warning names them.

use super::couplings::couplings;
use super::numbers::Reader;
use crate::urdf::elements::tag;
use crate::urdf::names::some_names;
use roxmltree::Node;

/// Attributes by which an actuator acts on something other than a joint.
const OTHER_TARGETS: [&str; 5] = ["tendon", "site", "body", "cranksite", "slidersite"];
/// Attributes that name the two sides of an equality.
const SIDES: [&str; 8] =
    ["body1", "site1", "joint1", "tendon1", "body2", "site2", "joint2", "tendon2"];

/// Warns of loops, tendons and actuators that the import drops, one line for each kind. `closed` lists the loops that were
/// imported as linkages.
pub fn warn<'a, 'i>(
    root: Node<'a, 'i>,
    closed: &[Node<'a, 'i>],
    reader: &mut Reader<'_, '_, '_, 'a, 'i>,
) {
    let inside = |list: &'static str| {
        let lists = root.children().filter(move |node| node.has_tag_name(list));
        lists.flat_map(|list| list.children()).filter(|node| node.is_element())
    };
    let couplings = couplings(root);
    for (list, kinds, effect) in [
        (
            "equality",
            &["connect", "tendon"][..],
            "a loop is imported if it has a crank with a motor, a rod, parallel axes and joints without motors, as a four-bar or five-bar leg. Lock the passive joints of this loop under [lock] of the side file; if a motor turns a joint by crank and rod, write `linkage` at this joint into the robot file",
        ),
        (
            "equality",
            &["weld", "flex"],
            "its bodies move independently: lock the joints that it holds under [lock] of the side file",
        ),
        (
            "tendon",
            &["fixed", "spatial"],
            "a tendon is imported only if it is fixed and a motor drives it. Without the tendon its joints move independently: lock the joints without a motor under [lock] of the side file",
        ),
    ] {
        for kind in kinds {
            let is_dropped = |node: &Node<'_, '_>| {
                node.has_tag_name(*kind)
                    && !closed.contains(node)
                    && couplings.iter().all(|of| of.tendon != *node)
            };
            let found: Vec<_> = inside(list).filter(is_dropped).collect();
            let Some(first) = found.first() else { continue };
            let names: Vec<_> = found.iter().map(|node| name(*node)).collect();
            let what = some_names(names.iter());
            reader
                .notes
                .warn(&tag(*first), format_args!("<{kind}> {what} is not imported; {effect}"));
        }
    }
    let other =
        |node: &Node<'_, '_>| OTHER_TARGETS.iter().any(|target| node.has_attribute(*target));
    let is_dropped =
        |node: &Node<'_, '_>| other(node) && couplings.iter().all(|of| of.actuator != *node);
    let found: Vec<_> = inside("actuator").filter(is_dropped).collect();
    if let Some(first) = found.first() {
        let names: Vec<_> = found.iter().map(|node| name(*node)).collect();
        let what = some_names(names.iter());
        reader.notes.warn(&tag(*first), format_args!(
            "<actuator> {what} acts on no joint and is not imported; replace it by a motor at a joint, or lock the joints that it drives"
        ));
    }
}

/// Name of an element, else its two sides, else its tag.
fn name(node: Node<'_, '_>) -> String {
    if let Some(name) = node.attribute("name") {
        return name.to_owned();
    }
    let sides: Vec<_> = SIDES.iter().filter_map(|side| node.attribute(*side)).collect();
    if sides.is_empty() { node.tag_name().name().to_owned() } else { sides.join(" – ") }
}
