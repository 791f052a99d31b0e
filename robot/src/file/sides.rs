//! Check of the limbs' sides against their mounting positions.

use super::group::ORIGIN;
use crate::document::{Document, Table};
use crate::model::Robot;

/// Distance from the middle of the body below which a limb has no side, m.
const MIDDLE_M: f64 = 1e-3;
/// Tolerance for two limbs at mirrored positions, m.
const COUNTERPART_M: f64 = 5e-3;

impl Robot {
    /// Warnings about limbs of a valid robot file whose `side` contradicts their mounting position. Their template is then
    /// mirrored wrongly. A [`Robot`] no longer contains the sides.
    pub fn side_warnings(file_name: &str, text: &str) -> Vec<String> {
        let Ok(document) = Document::parse(file_name, text) else { return Vec::new() };
        let root = document.root();
        let body = root.tables("link").first().and_then(|link| link.string("name"));
        let limbs = root.tables("limb");
        let on_body = limbs.iter().filter(|limb| limb.string("parent") == body);
        let placed: Vec<_> = on_body.filter_map(PlacedLimb::read).collect();
        placed.iter().filter_map(|limb| limb.warning(&placed)).collect()
    }
}

/// Limb on the body.
struct PlacedLimb {
    name: String,
    side: String,
    origin_m: [f64; 3],
}

impl PlacedLimb {
    fn read(limb: &Table<'_>) -> Option<Self> {
        let (name, side) = (limb.string("name")?, limb.string("side")?);
        Some(Self { name, side, origin_m: limb.numbers::<3>(ORIGIN)? })
    }

    /// Warning if the limb is on the wrong side and has a counterpart at the mirrored position. A single limb may intentionally
    /// be on either side.
    fn warning(&self, all: &[Self]) -> Option<String> {
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
                "limb `{name}` has `side = \"{side}\"` but is mounted on the other side, at y = \
                 {y} m: give side = \"{other}\", or change the sign of y"
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
        assert_eq!(Robot::side_warnings("pup.toml", text), [""; 0]);
        let wrong = text.replacen("side = \"right\"", "side = \"left\"", 1);
        let warnings = Robot::side_warnings("pup.toml", &wrong);
        assert_eq!(warnings.len(), 1);
        assert!(
            warnings[0].contains("`side = \"left\"` but is mounted on the other"),
            "{warnings:?}"
        );
    }
}
