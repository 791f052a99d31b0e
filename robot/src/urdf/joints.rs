//! Ranges of joints: limits from the side file, else from the URDF, and the standing angle within them.

use super::bodies::Bodies;
use super::model::{Joint, Kind, Urdf};
use super::names::some_names;
use super::notes::Notes;
use super::side::{JointSide, Side};
use super::toml_text::{key, show};
use crate::document::Document;

/// Limit of a joint that turns without end: below 2π also when written with twelve digits.
pub(super) const TURN_RAD: f64 = std::f64::consts::TAU - 1e-6;

/// Limits of a joint and its angle in the standing pose, rad.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Range {
    pub min_rad: f64,
    pub max_rad: f64,
    pub nominal_rad: f64,
}

/// Ranges of all joints in the order of [`Bodies::moving`]; zero where there is a fault.
pub(super) fn ranges(
    urdf: &Urdf,
    side: &Side,
    document: &Document<'_>,
    bodies: &Bodies,
    notes: &mut Notes<'_>,
) -> Vec<Range> {
    let mut reader = Reader { document, notes, endless: Vec::new() };
    let mut unposed = Vec::new();
    let mut ranges = Vec::new();
    for moving in &bodies.moving {
        let joint = &urdf.joints[moving.joint];
        let given = side.joints.iter().find(|given| given.joint == joint.name);
        let Some((min_rad, max_rad)) = reader.limits(joint, given) else {
            ranges.push(Range::default());
            continue;
        };
        let nominal_rad = given.and_then(|given| given.nominal_rad).unwrap_or_else(|| {
            let nearest = 0.0_f64.clamp(min_rad, max_rad);
            unposed.push((joint, nearest));
            nearest
        });
        ranges.push(Range { min_rad, max_rad, nominal_rad });
    }
    reader.warn_endless();
    if let Some((first, _)) = unposed.first() {
        let names = some_names(unposed.iter().map(|(joint, _)| &joint.name));
        let shown: Vec<_> = unposed.iter().take(4).map(|(_, angle)| show(*angle)).collect();
        notes.warn(&first.span, format_args!("joint {names}: no `nominal_rad` in the side file: taken as {} rad, next to 0 within the limits", shown.join(", ")));
    }
    ranges
}

struct Reader<'a, 'n, 't> {
    document: &'a Document<'a>,
    notes: &'n mut Notes<'t>,
    /// Joints without limits within a turn.
    endless: Vec<&'a Joint>,
}

impl<'a> Reader<'a, '_, '_> {
    /// Position limits of a joint, from the side file, else from the URDF.
    fn limits(&mut self, joint: &'a Joint, given: Option<&JointSide>) -> Option<(f64, f64)> {
        let (mut lower, mut upper) = match (joint.kind, joint.limit.lower, joint.limit.upper) {
            (Kind::Continuous, _, _) | (_, None, None) => (-TURN_RAD, TURN_RAD),
            // Absent limits are 0 in URDF.
            (_, lower, upper) => (lower.unwrap_or(0.0), upper.unwrap_or(0.0)),
        };
        let (min, max) = given.map_or((None, None), |given| (given.min_rad, given.max_rad));
        if lower > upper {
            if min.is_none() || max.is_none() {
                let span = joint.span.clone();
                self.notes.warn(&span, format_args!("joint `{}`: lower=\"{lower}\" is above upper=\"{upper}\": taken the other way round", joint.name));
            }
            (lower, upper) = (upper, lower);
        }
        if min.is_none() && lower <= -TURN_RAD || max.is_none() && upper >= TURN_RAD {
            self.endless.push(joint);
        }
        let min_rad = min.unwrap_or(lower.clamp(-TURN_RAD, TURN_RAD));
        let max_rad = max.unwrap_or(upper.clamp(-TURN_RAD, TURN_RAD));
        if min_rad < max_rad {
            return Some((min_rad, max_rad));
        }
        let message = format!(
            "joint `{}` cannot move: its limits are {min_rad} and {max_rad} rad",
            joint.name
        );
        let help = format!(
            "lock it in the side file, [lock] {} = {}, or give it `position_min_rad` and \
             `position_max_rad` there",
            key(&joint.name),
            show(min_rad)
        );
        match given {
            Some(given) if min.is_some() || max.is_some() => {
                self.document.fault(given.span.clone(), message, "here", help);
            }
            _ => self.notes.fault(joint.span.clone(), message, "no room between its limits", help),
        }
        None
    }

    fn warn_endless(&mut self) {
        if let Some(first) = self.endless.first() {
            let names = some_names(self.endless.iter().map(|joint| &joint.name));
            self.notes.warn(&first.span, format_args!("joint {names}: no position limits within a turn: taken as ±2π; give `position_min_rad` and `position_max_rad` in the side file where the robot is narrower"));
        }
    }
}
