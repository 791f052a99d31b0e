//! Reads from the residuals where the violation is least which constraints contradict each other.
//!
//! At that point the pulls of all violated rows cancel, Jᵀy = 0 with y their residuals: rows at rest there
//! take no part in the contradiction, and the derivative of the violation E = Σ y² with respect to a
//! number p that rows compare with, of the motion or the robot file, is 2 Σ y ∂r/∂p. E grows with the
//! square of the distance to what can be met, so that p − 2E/(dE/dp) could be met, all else as it is. The
//! request that has to give way least, relative to its size, is named first.

use super::families::{self, Family};
use super::{Blame, Culprit, Part, Verdict};
use crate::formulation::TERMS;
use crate::normal::row_energy;
use crate::problem::Problem;
use crate::rows::{Given, Role, Row, Rows, Subject};
use std::collections::BTreeMap;
use std::ops::Range;

/// Most requests that are named, beside one limit and one property of the robot.
const REQUESTS: usize = 2;
/// Part of the strongest family's pull below which a family without an estimate is left out.
const LEAST_SHARE: f64 = 0.05;
/// The same for the footfalls, which balance, flight and free feet speak for together.
const LEAST_OF_FOOTFALLS: f64 = 0.3;
/// Constraints that are violated where footfalls cannot be.
const FOOTFALLS: [&str; 3] = ["angular dynamics", "linear dynamics", "swing force"];
/// Part of a group's strongest pull that counts as pulling, for the times.
const PULLING: f64 = 0.1;
/// Factors of a goal or swing height within which an estimate is believed: less, and not where even nothing
/// at all would not help.
const LESS: Range<f64> = -0.1..1.0;
/// The same for limits of the robot file: beyond that it is not the motors.
const STRONGER: Range<f64> = 1.0..4.0;
/// The same for places and heights, which can give way either way.
const ELSEWHERE: Range<f64> = f64::NEG_INFINITY..f64::INFINITY;

/// Rows of one family, about one part of the robot, that compare with one number.
struct Group {
    family: &'static Family,
    subject: Option<String>,
    /// Pull y, timeline index and residual in the family's unit of every row.
    pulls: Vec<(f64, usize, f64)>,
    /// The number.
    given: Option<(&'static str, f64)>,
    /// Σ y ∂r/∂p over the rows, with p the relative change of the number.
    slope: f64,
}

impl Group {
    fn square(&self) -> f64 {
        self.pulls.iter().map(|(y, ..)| y * y).sum()
    }

    /// Factors of its number within which an estimate is believed.
    fn believed(&self) -> Range<f64> {
        match (self.family.part, self.family.name) {
            (Part::Limit | Part::Build, _) => STRONGER,
            (_, "displacement goal" | "turning goal" | "contact height") => LESS,
            (Part::Request, _) => ELSEWHERE,
        }
    }

    /// What number would do, and its relative distance.
    fn would_do(&self, violation: f64) -> Option<(f64, f64)> {
        let (_, value) = self.given?;
        let factor = 1.0 - violation / self.slope;
        let believed = self.believed();
        let sensible = factor.is_finite() && believed.contains(&factor);
        // Nothing at all is as far as a goal can give way.
        let least = if believed == LESS { 0.0 } else { f64::NEG_INFINITY };
        sensible.then(|| (factor.max(least) * value, (factor - 1.0).abs()))
    }
}

/// What the rows of a group share: term, part of the robot, field and bits of the number.
type Key = (usize, Subject, Option<(&'static str, u64)>);

/// How hard a row pulls, over its scale.
fn pull(row: &Row) -> f64 {
    match row.role {
        Role::Cost { .. } => 0.0,
        _ => row_energy(row, 0.0, 1.0)[1] / 2.0,
    }
}

/// Height that the motion asks of a foot's swings, which the row's own height is a part of; `None` for a
/// foot that stands, which is at height 0 by nature.
fn swing_height(problem: &Problem, row: &Row) -> Option<Given> {
    let Subject::EndEffector(j) = row.subject else { return None };
    let height_m = problem.height_m[row.at][j];
    let value = problem.height_m.iter().map(|heights| heights[j]).fold(0.0, f64::max);
    (height_m > 0.0).then(|| Given { field: "swing_height_m", value, slope: -height_m / value })
}

fn group(problem: &Problem, rows: &Rows) -> Vec<Group> {
    let robot = problem.model.robot();
    let mut groups: BTreeMap<Key, Group> = BTreeMap::new();
    for row in &rows.rows {
        // Where the motion starts is nobody's fault.
        let name = TERMS[row.term].about().name;
        let Some(family) = families::of(name).filter(|_| name != "anchor") else { continue };
        let y = pull(row);
        if y == 0.0 {
            continue;
        }
        let swing = || swing_height(problem, row).filter(|_| name == "contact height");
        let given = row.given.or_else(swing);
        let number = given.map(|given| (given.field, given.value.to_bits()));
        let group = groups.entry((row.term, row.subject, number)).or_insert_with(|| Group {
            family,
            subject: match row.subject {
                Subject::Whole => None,
                Subject::EndEffector(j) => Some(robot.end_effectors[j].name.clone()),
                Subject::Joint(j) => Some(robot.joints[j].name.clone()),
            },
            pulls: Vec::new(),
            given: given.map(|given| (given.field, given.value)),
            slope: 0.0,
        });
        group.pulls.push((y, row.at, y.abs() * row.scale));
        group.slope += given.map_or(0.0, |given| y * given.slope * given.value / row.scale);
    }
    let mut groups: Vec<Group> = groups.into_values().collect();
    share_numbers(&mut groups);
    groups
}

/// One number of the motion file is the height of all swings, and motors are exchanged together.
fn share_numbers(groups: &mut [Group]) {
    let mut slopes: BTreeMap<(&str, &str), f64> = BTreeMap::new();
    for group in groups.iter() {
        if let Some((field, _)) = group.given {
            *slopes.entry((group.family.name, field)).or_default() += group.slope;
        }
    }
    for group in groups {
        let shared = group.family.part == Part::Limit || group.family.name == "contact height";
        if let Some((field, _)) = group.given.filter(|_| shared) {
            group.slope = slopes[&(group.family.name, field)];
        }
    }
}

/// Who is to blame for the violation that is left in these rows; `None` if there is none.
pub fn attribute(problem: &Problem, rows: &Rows, verdict: Verdict) -> Option<Blame> {
    let groups = group(problem, rows);
    let violation: f64 = groups.iter().map(Group::square).sum();
    let mut of_families: BTreeMap<&str, f64> = BTreeMap::new();
    for group in &groups {
        *of_families.entry(group.family.name).or_default() += group.square();
    }
    let largest = of_families.values().copied().fold(0.0, f64::max);
    if largest <= 0.0 {
        return None;
    }
    let footfalls: f64 = FOOTFALLS.iter().filter_map(|name| of_families.get(name)).sum();
    // Each with how far behind it comes: by the estimated change, else after those by share.
    let [mut requests, mut limits, mut builds] = [const { Vec::new() }; 3];
    for group in &groups {
        let would_do = group.would_do(violation);
        let family_share = of_families[group.family.name] / violation;
        let pulls = family_share * violation >= LEAST_SHARE * largest
            && (!FOOTFALLS.contains(&group.family.name)
                || footfalls >= LEAST_OF_FOOTFALLS * largest);
        let rank = match would_do {
            Some((_, change)) => change,
            None if pulls => f64::from(u8::MAX) - family_share,
            None => continue,
        };
        // Feet that stand, and goals that give way to nothing, do not ask for anything.
        let stands = group.family.name == "contact height" && group.given.is_none();
        let side = match group.family.part {
            Part::Request if stands => &mut builds,
            Part::Request if would_do.is_none() && group.given.is_some() => continue,
            Part::Request if !pulls && group.believed() == ELSEWHERE => continue,
            Part::Request => &mut requests,
            Part::Limit => &mut limits,
            Part::Build => &mut builds,
        };
        side.push((rank, -group.square(), group, would_do));
    }
    for side in [&mut requests, &mut limits, &mut builds] {
        side.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        // One foot or joint stands for all that are asked the same.
        let mut named: Vec<(&str, Option<(&str, f64)>)> = Vec::new();
        side.retain(|(.., group, _)| {
            let this = (group.family.name, group.given);
            let is_new = !named.contains(&this);
            named.push(this);
            is_new
        });
    }
    requests.truncate(REQUESTS);
    if !requests.is_empty() {
        // With a request to give way, motors that are far too weak are not the point.
        limits.retain(|(change, ..)| *change < 1.0);
    }
    limits.truncate(1);
    builds.truncate(1);
    let sides =
        if requests.is_empty() { [requests, limits, builds] } else { [requests, builds, limits] };
    let culprits = sides
        .into_iter()
        .flatten()
        .map(|(.., group, would_do)| culprit(problem, group, violation, would_do))
        .collect();
    Some(Blame { verdict, culprits })
}

fn culprit(
    problem: &Problem,
    group: &Group,
    violation: f64,
    would_do: Option<(f64, f64)>,
) -> Culprit {
    let strongest = group.pulls.iter().map(|(y, ..)| y.abs()).fold(0.0, f64::max);
    let time_s = |at: usize| at.saturating_sub(1) as f64 * problem.interval_s;
    let pulling: Vec<f64> = group
        .pulls
        .iter()
        .filter(|(y, ..)| y.abs() >= PULLING * strongest)
        .map(|&(_, at, _)| time_s(at))
        .collect();
    // Goals are about the whole motion.
    let whole = [0.0, problem.interval_s * (problem.last() - 1) as f64];
    let of_ends = matches!(group.family.name, "displacement goal" | "turning goal");
    let range = [
        pulling.iter().copied().fold(f64::INFINITY, f64::min),
        pulling.iter().copied().fold(0.0, f64::max),
    ];
    Culprit {
        constraint: group.family.name.to_owned(),
        part: group.family.part,
        subject: group.subject.clone(),
        time_s: if of_ends { whole } else { range },
        worst: group.pulls.iter().map(|&(.., residual)| residual).fold(0.0, f64::max),
        unit: group.family.unit.to_owned(),
        share: group.square() / violation,
        field: group.given.map(|(field, _)| field.to_owned()),
        given: group.given.map(|(_, value)| value),
        would_do: would_do.map(|(value, _)| value),
        advice: group.family.advice.to_owned(),
    }
}
