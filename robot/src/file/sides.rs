//! Sides of limbs against where they are mounted.

use super::group::ORIGIN;
use crate::document::{Document, Table};
use crate::model::Robot;

/// Distance from the middle of the body up to which a limb is on neither side, m.
const MIDDLE_M: f64 = 1e-3;
/// Distance up to which limbs are mounted at the mirror images of each other's places, m.
const COUNTERPART_M: f64 = 5e-3;

impl Robot {
    /// Doubts about limbs of a valid robot file whose `side` is not the one on which they are mounted: their template is not
    /// mirrored, or mirrored where it should not be. A [`Robot`] does not say so any more.
    pub fn side_doubts(file_name: &str, text: &str) -> Vec<String> {
        let Ok(document) = Document::parse(file_name, text) else { return Vec::new() };
        let root = document.root();
        let body = root.tables("link").first().and_then(|link| link.string("name"));
        let limbs = root.tables("limb");
        let on_body = limbs.iter().filter(|limb| limb.string("parent") == body);
        let placed: Vec<_> = on_body.filter_map(Placed::read).collect();
        placed.iter().filter_map(|limb| limb.doubt(&placed)).collect()
    }
}

/// A limb on the body.
struct Placed {
    name: String,
    side: String,
    origin_m: [f64; 3],
}

impl Placed {
    fn read(limb: &Table<'_>) -> Option<Self> {
        let (name, side) = (limb.string("name")?, limb.string("side")?);
        Some(Self { name, side, origin_m: limb.numbers::<3>(ORIGIN)? })
    }

    /// A limb without a counterpart on the other side may be as it is: it has a place and not a side.
    fn doubt(&self, all: &[Self]) -> Option<String> {
        let Self { name, side, origin_m: [x, y, z] } = self;
        let other = match side.as_str() {
            "left" if *y < -MIDDLE_M => "right",
            "right" if *y > MIDDLE_M => "left",
            _ => return None,
        };
        let mirrors = |of: &Self| {
            let off = [of.origin_m[0] - x, of.origin_m[1] + y, of.origin_m[2] - z];
            off.iter().all(|off| off.abs() < COUNTERPART_M)
        };
        all.iter().any(mirrors).then(|| {
            format!(
                "limb `{name}` has `side = \"{side}\"` and is mounted on the other side, at y = {y} m: give side = \"{other}\", or change the sign of y"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_limb_on_the_other_side_is_named() {
        let text = include_str!("../../../shipped/robots/pup.toml");
        assert_eq!(Robot::side_doubts("pup.toml", text), [""; 0]);
        let wrong = text.replacen("side = \"right\"", "side = \"left\"", 1);
        let doubts = Robot::side_doubts("pup.toml", &wrong);
        assert_eq!(doubts.len(), 1);
        assert!(doubts[0].contains("`side = \"left\"` and is mounted on the other"), "{doubts:?}");
    }
}
