//! Reader for the `shapes` of a link, with one entry for each capsule or box.

use super::fields::{number, vector};
use super::group::Group;
use super::parts::sizes;
use crate::document::Table;
use crate::shape::Shape;

/// Reads one entry of `shapes`. On a mirrored limb, the shape is mirrored too.
pub(super) fn shape(group: &Group<'_, '_>, table: &Table<'_>) -> Option<Shape> {
    let capsule = ["from_m", "to_m", "radius_m"].map(|key| table.has(key)).contains(&true);
    let shape = match (capsule, table.has("box_m")) {
        (true, false) => Some(Shape::Capsule {
            from_in_link_m: group.point(vector(table, "from_m")),
            to_in_link_m: group.point(vector(table, "to_m")),
            radius_m: number(table, "radius_m"),
        }),
        (false, true) => Some(Shape::Box {
            center_in_link_m: group.point(vector(table, "at_m")),
            size_m: sizes::<3>(table, "box_m").unwrap_or_default().into(),
        }),
        _ => {
            let help = "give a capsule with `from_m`, `to_m` and `radius_m`, or a box with `at_m` \
                        and `box_m = [x, y, z]`";
            table.fault("shape", "must be given once", "needs one shape", help);
            None
        }
    };
    table.done();
    shape
}
