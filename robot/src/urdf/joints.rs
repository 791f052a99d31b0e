//! Ranges of joints: limits and standing angle from the side file, else from the URDF.

use super::bodies::Bodies;
use super::model::{Joint, Kind, Urdf};
use super::names::some_names;
use super::notes::Notes;
use super::side::{JointSide, Side};
use super::toml_text::{key, show};
use crate::document::Document;
use std::f64::consts::TAU;
use std::ops::RangeInclusive;

/// Limit of an endless joint, rad. It is below 2π even when written with twelve digits.
pub(super) const TURN_RAD: f64 = TAU - 1e-6;

/// Absolute values of limits that look like degrees. Real joints have three turns at most, and placeholders are larger.
const DEGREES: RangeInclusive<f64> = 19.0..=360.0;

/// True for a limited joint that turns.
fn is_limited(joint: &&Joint) -> bool {
    joint.kind == Kind::Revolute && joint.limit.lower.is_some_and(|l| Some(l) != joint.limit.upper)
}

/// True if a limit of a joint is in the range of degrees.
fn looks_like_degrees(joint: &Joint) -> bool {
    let limits = [joint.limit.lower, joint.limit.upper];
    joint.kind == Kind::Revolute
        && limits.into_iter().flatten().any(|limit| DEGREES.contains(&limit.abs()))
}

/// True if most limits of a file look like degrees.
pub(super) fn in_degrees(joints: &[Joint]) -> bool {
    let limited = || joints.iter().filter(is_limited);
    2 * limited().filter(|joint| looks_like_degrees(joint)).count() > limited().count()
}

/// True if the limits of a joint are in degrees: they look like degrees, or most limits of the file do. Limits of a possibly
/// endless joint count only in the second case.
pub(super) fn has_degrees(urdf: &Urdf, joint: &Joint) -> bool {
    if looks_like_degrees(joint) {
        !joint.is_endless() || urdf.in_degrees
    } else {
        is_limited(&joint) && urdf.in_degrees
    }
}

/// Limits of a joint for a pose: the limits of the file in rad, within a turn, or in m.
pub(super) fn position_limits(urdf: &Urdf, joint: &Joint) -> [f64; 2] {
    if joint.kind == Kind::Prismatic {
        let [lower, upper] =
            [joint.limit.lower, joint.limit.upper].map(|limit| limit.unwrap_or(0.0));
        return [lower.min(upper), lower.max(upper)];
    }
    let limits = (joint.kind != Kind::Continuous).then_some(joint.limit);
    let [lower, upper] = match limits.map(|limit| (limit.lower, limit.upper)) {
        None | Some((None, None)) => [-TURN_RAD, TURN_RAD],
        Some((lower, upper)) => [lower.unwrap_or(0.0), upper.unwrap_or(0.0)],
    };
    let [lower, upper] = match has_degrees(urdf, joint) {
        true => [lower, upper].map(f64::to_radians),
        false => [lower, upper],
    };
    let (min, max) = (lower.min(upper), lower.max(upper));
    // Limits that are shifted by a whole turn mean the same angles.
    let turns = (0.5 * (min + max) / TAU).round() * TAU;
    let [min, max] =
        if min > TURN_RAD || max < -TURN_RAD { [min - turns, max - turns] } else { [min, max] };
    [min, max].map(|limit| limit.clamp(-TURN_RAD, TURN_RAD))
}

/// Limits of a joint and its position in the standing pose, rad, or m for a prismatic joint.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Range {
    pub min_rad: f64,
    pub max_rad: f64,
    pub nominal_rad: f64,
}

/// Ranges of all joints in the order of [`Bodies::moving`]; zero for joints with a fault.
pub(super) fn ranges<'a>(
    urdf: &'a Urdf,
    side: &Side,
    document: &'a Document<'a>,
    bodies: &Bodies,
    notes: &mut Notes<'_>,
) -> Vec<Range> {
    let mut reader = Reader { urdf, document, notes, endless: Vec::new(), degrees: Vec::new() };
    let mut unposed = Vec::new();
    let mut ranges = Vec::new();
    for moving in &bodies.moving {
        let joint = &urdf.joints[moving.joint];
        let given = side.joints.iter().find(|given| given.joint == joint.name);
        reader.check_unit(joint, given);
        let Some((min_rad, max_rad)) = reader.limits(joint, given) else {
            ranges.push(Range::default());
            continue;
        };
        let nominal_rad = given.and_then(|given| given.nominal_rad).unwrap_or_else(|| {
            let rest_rad = urdf.holding_spring(joint).map(|spring| spring.rest_rad);
            let known = joint.home.or(rest_rad);
            let usual = if moving.slides { 0.5 * (min_rad + max_rad) } else { 0.0 };
            let nearest = known.unwrap_or(usual).clamp(min_rad, max_rad);
            if known.is_none() && !moving.slides {
                unposed.push((joint, nearest));
            }
            nearest
        });
        ranges.push(Range { min_rad, max_rad, nominal_rad });
    }
    reader.warn_wide();
    if let Some((first, _)) = unposed.first() {
        let names = some_names(unposed.iter().map(|(joint, _)| &joint.name));
        let shown: Vec<_> = unposed.iter().take(4).map(|(_, angle)| show(*angle)).collect();
        notes.warn(&first.span, format_args!("joint {names}: the side file has no `nominal_rad`, so the import uses the angle nearest to 0 within the limits, {} rad; give `nominal_rad` under [joint]", shown.join(", ")));
    }
    ranges
}

struct Reader<'a, 'n, 't> {
    urdf: &'a Urdf,
    document: &'a Document<'a>,
    notes: &'n mut Notes<'t>,
    /// Joints with a limit of a whole turn or more, or without limits.
    endless: Vec<&'a Joint>,
    /// Joints with limits in degrees.
    degrees: Vec<&'a Joint>,
}

impl<'a> Reader<'a, '_, '_> {
    /// Refuses positions in the wrong unit.
    fn check_unit(&self, joint: &Joint, given: Option<&JointSide>) {
        let Some(given) = given else { return };
        let slides = joint.kind == Kind::Prismatic;
        let (is_wrong, what, keys) = match slides {
            true => (
                given.is_angular,
                "slides, and its positions are in m",
                "`nominal_m`, `position_min_m` and `position_max_m`",
            ),
            false => (
                given.is_linear,
                "turns, and its positions are in rad",
                "`nominal_rad`, `position_min_rad` and `position_max_rad`",
            ),
        };
        if is_wrong {
            let message = format!("joint `{}` {what}", joint.name);
            self.document.fault(given.span.clone(), message, "here", format!("give {keys}"));
        }
    }

    /// Position limits of a joint from the side file, else from the URDF.
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
                self.notes.warn(&span, format_args!("joint `{}`: lower=\"{lower}\" is above upper=\"{upper}\"; the import exchanges both limits: correct the model", joint.name));
            }
            (lower, upper) = (upper, lower);
        }
        let slides = joint.kind == Kind::Prismatic;
        if slides && (joint.limit.lower.is_none() || joint.limit.upper.is_none()) {
            (lower, upper) = (joint.limit.lower.unwrap_or(0.0), joint.limit.upper.unwrap_or(0.0));
        }
        if slides {
            // A stroke has no whole turns.
        } else if (min.is_none() || max.is_none()) && has_degrees(self.urdf, joint) {
            self.degrees.push(joint);
        } else if min.is_none() && lower <= -TURN_RAD || max.is_none() && upper >= TURN_RAD {
            self.endless.push(joint);
        }
        let within = |limit: f64| if slides { limit } else { limit.clamp(-TURN_RAD, TURN_RAD) };
        let min_rad = min.unwrap_or(within(lower));
        let max_rad = max.unwrap_or(within(upper));
        if min_rad < max_rad {
            return Some((min_rad, max_rad));
        }
        if self.degrees.last().is_some_and(|last| std::ptr::eq(*last, joint)) {
            let message = format!(
                "joint `{}` cannot move: its limits of {lower} and {upper} rad exceed a turn, and look like degrees",
                joint.name
            );
            let help = format!(
                "convert the limits in the URDF to radians, or give {:.4} and {:.4} rad under [joint] of the side file",
                lower.to_radians(),
                upper.to_radians()
            );
            self.notes.fault(joint.span.clone(), message, "in degrees?", help);
            return None;
        }
        let unit = if slides { "m" } else { "rad" };
        let message = format!(
            "joint `{}` cannot move: its limits are {min_rad} and {max_rad} {unit}",
            joint.name
        );
        let help = format!(
            "lock the joint in the side file, [lock] {} = {}, or give `position_min_{unit}` and \
             `position_max_{unit}` there",
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

    fn warn_wide(&mut self) {
        if let Some(first) = self.degrees.first() {
            let names = some_names(self.degrees.iter().map(|joint| &joint.name));
            let of = |limit: Option<f64>| limit.unwrap_or_default();
            let (lower, upper) = (of(first.limit.lower), of(first.limit.upper));
            self.notes.warn(&first.span, format_args!("joint {names}: position limits of many turns, {lower} to {upper} rad, look like degrees and are imported within ±2π. Convert the limits in the URDF to radians, or give {:.3} to {:.3} rad in the side file", lower.to_radians(), upper.to_radians()));
        }
        if let Some(first) = self.endless.first() {
            let names = some_names(self.endless.iter().map(|joint| &joint.name));
            self.notes.warn(&first.span, format_args!("joint {names}: no position limits within a turn, so the import uses ±2π rad; give `position_min_rad` and `position_max_rad` in the side file if the range is smaller"));
        }
    }
}
