//! Attribution of the least violation to the constraints that contradict each other.
//!
//! At the point with the least violation, the pulls of all violated rows cancel: Jᵀy = 0, where y are their residuals. Rows
//! with y = 0 take no part in the contradiction. Let p be a value of the motion file or the robot file that rows compare with.
//! A change of p changes the violation E = Σ y² by dE/dp = 2 Σ y ∂r/∂p. E grows with the square of the distance to a feasible
//! request, so that p − 2E/(dE/dp) is feasible with all else unchanged. The estimate is of first order, and rough while the
//! probe has not converged. The request with the smallest relative change is named first.

use super::mobility::Mobility;
use super::narrow::{self, Violated};
use super::{slow, weak};
use crate::families::{Family, FamilySet, Kind};
use crate::formulation::rows::{ComparedField, Role, Row, Rows, Subject};
use crate::motion::{self, Reserve};
use crate::plan::{Culprit, Diagnosis, Verdict};
use crate::problem::Problem;
use crate::solve::normal::row_energy;
use std::collections::BTreeMap;
use std::ops::Range;

/// Maximum number of requests in a diagnosis, which also names up to one limit and one property of the robot.
const REQUESTS: usize = 2;
/// Smallest violation of a family that the diagnosis names even without a feasible value, as a fraction of the largest violation
/// of any family.
const LEAST_SHARE: f64 = 0.05;
/// Smallest sum of the violations of [`FOOTFALLS`] for which the diagnosis names one of them, as a fraction of the largest
/// violation of a family. Their violations are added, because lack of balance, long flights and feet off the ground violate all
/// of them.
const LEAST_OF_FOOTFALLS: f64 = 0.3;
/// Constraints that are violated if the footfalls are infeasible.
const FOOTFALLS: [Family; 3] =
    [Family::AngularDynamics, Family::LinearDynamics, Family::SwingForce];
/// Relative change of a motor limit up to which weak motors are a likely cause.
const LIKELY_CHANGE: f64 = 2.0;
/// Relative change of a motor limit up to which the limit may be a cause although it is hardly exceeded. Softer constraints are
/// violated in place of a stiff limit.
const LITTLE_CHANGE: f64 = 0.5;
/// Relative change of a goal above which the diagnosis does not name the goal as cause.
const HOPELESS_CHANGE: f64 = 1.5;
/// Rank of groups without an estimated feasible value; such groups come last.
const LAST_RANK: f64 = 1e3;
/// Fraction of a group's strongest pull above which a row belongs to the time span of the culprit.
const PULLING: f64 = 0.1;
/// Smallest divisor of a change, m or rad, so that fields with the value 0 have a relative change too.
const COMPARED_WITH: f64 = 0.1;
/// Relative excess above which a limit counts as a cause.
const LEAST_EXCESS: f64 = 1e-3;
/// Range of the ratio of an estimated limit to the limit in the robot file, within which an estimate is accepted. Outside, the
/// motors are not the cause.
const STRONGER: Range<f64> = 1.0..4.0;

/// Rows of one family and one part of the robot that compare with the same value.
struct Group {
    family: Family,
    subject: Option<String>,
    /// Index of the obstacle that the rows keep away from, in [`Problem::obstacles`].
    obstacle: Option<usize>,
    /// Pull y of every row, with its timeline index and its residual in the family's unit.
    pulls: Vec<(f64, usize, f64)>,
    /// Field that the rows compare with, and its value.
    given: Option<(&'static str, f64)>,
    /// Sum Σ y ∂r/∂p over the rows, where p is the value, or its relative change for limits.
    slope: f64,
}

/// Value with which the request would be feasible.
#[derive(Clone, Copy)]
struct Estimate {
    value: f64,
    /// Relative change from the given value.
    change: f64,
}

impl Group {
    fn square(&self) -> f64 {
        self.pulls.iter().map(|(y, ..)| y * y).sum()
    }

    /// Largest residual, in the family's unit.
    fn worst(&self) -> f64 {
        self.pulls.iter().map(|&(.., residual)| residual).fold(0.0, f64::max)
    }

    /// Returns true if the worst residual exceeds [`LEAST_EXCESS`] times the limit of the rows, or if the rows have no limit.
    fn is_exceeded(&self) -> bool {
        self.given.is_none_or(|(_, limit)| self.worst() > LEAST_EXCESS * limit)
    }

    fn is_swing(&self) -> bool {
        self.family == Family::ContactHeight
    }

    fn is_request(&self) -> bool {
        self.family.kind() == Kind::Request
    }

    /// Relative change from the given value to the feasible one.
    fn change(&self, violation: f64) -> f64 {
        let step = -violation / self.slope;
        let given = self.given.map_or(0.0, |(_, value)| value);
        (if !self.is_request() { step } else { step / given.abs().max(COMPARED_WITH) }).abs()
    }

    /// Returns the estimate of the feasible value if it is plausible.
    fn estimate(&self, violation: f64) -> Option<Estimate> {
        let (_, given) = self.given?;
        let step = -violation / self.slope;
        let limit = !self.is_request();
        let value = if limit { given * (1.0 + step) } else { given + step };
        let believed = if limit {
            STRONGER.contains(&(1.0 + step))
        } else if self.family.is_goal() || self.is_swing() {
            // Goals are reduced, and only if a goal of 0 would be feasible.
            value * given > 0.0 && value.abs() < given.abs()
        } else {
            // Positions and heights may change in either direction.
            value.is_finite()
        };
        believed.then(|| Estimate { value, change: self.change(violation) })
    }
}

/// Key for grouping rows: family, part of the robot, obstacle, field and bits of the value.
type Key = (Family, Subject, Option<usize>, Option<(&'static str, u64)>);

/// Half of the derivative of a row's energy by its value, in units of its scale.
fn pull(row: &Row, value: f64) -> f64 {
    match row.role {
        Role::Cost { .. } => 0.0,
        _ => row_energy(row, value, 0.0, 1.0)[1] / 2.0,
    }
}

/// Returns the swing height that determines the height in a row of a swing foot, from the motion file or from a target. The
/// height in the row is a fraction of it. `None` for a stance foot, whose height is 0.
fn swing_height(problem: &Problem, row: &Row) -> Option<ComparedField> {
    let Subject::EndEffector(j) = row.subject else { return None };
    let swings = |at: &usize| !problem.stance[*at][j];
    if !swings(&row.at) {
        return None;
    }
    let first = (0..=row.at).rev().take_while(swings).last()?;
    let swing = first..first + (first..problem.stance.len()).take_while(swings).count();
    let of_target = problem.targets.iter().find_map(|placed| {
        let of = placed.target.of == motion::Subject::EndEffector(j);
        placed.target.position_m[2].filter(|_| of && swing.contains(&placed.middle))
    });
    let height_m = problem.height_m[row.at][j];
    let highest = swing.map(|at| problem.height_m[at][j]).fold(0.0, f64::max);
    let (field, value) = of_target.map_or(("swing_height_m", highest), |up_m| ("up_m", up_m));
    (height_m > 0.0).then(|| ComparedField { field, value, slope: -height_m / value })
}

fn group(problem: &Problem, rows: &Rows) -> Vec<Group> {
    let robot = problem.model.robot();
    let mut groups: BTreeMap<Key, Group> = BTreeMap::new();
    // Rows of each part and sample are in the order of the obstacles.
    let mut next_obstacle = (0..problem.obstacles.len()).cycle();
    for (index, (row, value)) in rows.iter().enumerate() {
        let family = row.family;
        let is_clearance = family == Family::ObstacleClearance;
        let obstacle = if is_clearance { next_obstacle.next() } else { None };
        let y = pull(row, value);
        if y == 0.0 {
            continue;
        }
        let swing = || swing_height(problem, row).filter(|_| family == Family::ContactHeight);
        let given = rows.given(index).or_else(swing);
        let number = given.map(|given| (given.field, given.value.to_bits()));
        let group =
            groups.entry((family, row.subject, obstacle, number)).or_insert_with(|| Group {
                family,
                subject: row.subject.name(robot),
                obstacle,
                pulls: Vec::new(),
                given: given.map(|given| (given.field, given.value)),
                slope: 0.0,
            });
        group.pulls.push((y, row.at, y.abs() * row.scale));
        let per =
            |given: ComparedField| if family.kind() == Kind::Request { 1.0 } else { given.value };
        group.slope += given.map_or(0.0, |given| y * given.slope * per(given) / row.scale);
    }
    let mut groups: Vec<Group> = groups.into_values().collect();
    share_numbers(&mut groups);
    groups
}

/// Sums the slopes of groups that share a value. All swings share the height in the motion file; limits of motors change
/// together.
fn share_numbers(groups: &mut [Group]) {
    let shares = |group: &Group| group.family.kind() == Kind::Limit || group.is_swing();
    let key = |group: &Group| {
        let (field, value) = group.given?;
        let swing = group.is_swing().then_some(value.to_bits());
        shares(group).then_some((group.family, field, swing))
    };
    let mut slopes = BTreeMap::new();
    for group in groups.iter() {
        if let Some(key) = key(group) {
            *slopes.entry(key).or_insert(0.0) += group.slope;
        }
    }
    for group in groups {
        if let Some(key) = key(group) {
            group.slope = slopes[&key];
        }
    }
}

/// Diagnoses the violation that remains in `rows`. Returns `None` if no row is violated.
pub fn diagnose(problem: &Problem, rows: &Rows, verdict: Verdict) -> Option<Diagnosis> {
    let groups = group(problem, rows);
    let violation: f64 = groups.iter().map(Group::square).sum();
    let mut of_families: BTreeMap<Family, f64> = BTreeMap::new();
    for group in &groups {
        *of_families.entry(group.family).or_default() += group.square();
    }
    let largest = of_families.values().copied().fold(0.0, f64::max);
    if largest <= 0.0 {
        return None;
    }
    let footfalls: f64 = FOOTFALLS.iter().filter_map(|family| of_families.get(family)).sum();
    let of_obstacles = of_families.get(&Family::ObstacleClearance);
    let narrow =
        of_obstacles.filter(|square| **square >= LEAST_SHARE * largest).and_then(|square| {
            let of = groups.iter().filter(|group| group.family == Family::ObstacleClearance);
            let worst_m = of.map(Group::worst).fold(0.0, f64::max);
            narrow::across_path(problem, Violated { worst_m, share: square / violation })
        });
    let is_narrow = |group: &Group| {
        group.obstacle.zip(narrow.as_ref()).is_some_and(|(obstacle, narrow)| {
            narrow.obstacles.contains(&problem.obstacles[obstacle].name)
        })
    };
    // Each with its rank: by the estimated change, otherwise after those by its share.
    let [mut requests, mut limits, mut builds, mut goals] = [const { Vec::new() }; 4];
    for group in groups.iter().filter(|group| !is_narrow(group)) {
        let estimate = group.estimate(violation);
        let family_share = of_families[&group.family] / violation;
        let pulls = family_share * violation >= LEAST_SHARE * largest
            && (!FOOTFALLS.contains(&group.family) || footfalls >= LEAST_OF_FOOTFALLS * largest);
        let (asks, number) = (group.is_request(), group.given.is_some());
        let wanted = group.given.is_some_and(|(_, value)| value != 0.0);
        let rank = match estimate {
            Some(estimate) => estimate.change,
            // Not even a goal of 0 would be feasible.
            None if group.family.is_goal()
                && wanted
                && group.change(violation) < HOPELESS_CHANGE =>
            {
                1.0
            }
            None if pulls && !(asks && number) => LAST_RANK - family_share,
            None if group.family.is_goal() && wanted => LAST_RANK,
            None => continue,
        };
        let side = match group.family.kind() {
            // The anchor term only fixes where the motion starts.
            _ if group.family == Family::Anchor => continue,
            // A goal may be met at the expense of everything else.
            Kind::Request if group.family.is_goal() && rank == LAST_RANK => &mut goals,
            // Feet in stance do not request anything.
            Kind::Request if group.is_swing() && !number => &mut builds,
            Kind::Request if !(pulls || group.family.is_goal() || group.is_swing()) => continue,
            Kind::Request => &mut requests,
            // A limit that is hardly exceeded is not the cause, unless a little more of it would do.
            Kind::Limit if !group.is_exceeded() && rank > LITTLE_CHANGE => continue,
            Kind::Limit => &mut limits,
            Kind::Build => &mut builds,
            Kind::Cost | Kind::Check => continue,
        };
        side.push((rank, -group.square(), group, estimate));
    }
    // Goals without an estimate are named where no limit is a likely cause.
    if requests.is_empty() && !limits.iter().any(|(change, ..)| *change < LIKELY_CHANGE) {
        requests = goals;
    }
    for side in [&mut requests, &mut limits, &mut builds] {
        side.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
        // One foot or joint represents all with the same request.
        let mut named: Vec<(Family, Option<(&str, f64)>)> = Vec::new();
        side.retain(|(.., group, _)| {
            let this = (group.family, group.given);
            let is_new = !named.contains(&this);
            named.push(this);
            is_new
        });
    }
    requests.truncate(REQUESTS);
    if !requests.is_empty() {
        // Where a changed request would be feasible, motors that are far too weak are not the cause.
        let obstacle = |group: &Group| FamilySet::OBSTACLES.contains(group.family);
        limits.retain(|(change, _, group, _)| *change < 1.0 || obstacle(group));
    }
    limits.truncate(1);
    builds.truncate(1);
    let sides =
        if requests.is_empty() { [requests, limits, builds] } else { [requests, builds, limits] };
    let weak = weak::too_weak_to_stand(problem);
    let is_weak = |culprit: &Culprit| {
        weak.as_ref().is_some_and(|weak| {
            (culprit.constraint, culprit.given) == (weak.constraint, weak.given)
        })
    };
    let pulling = sides
        .into_iter()
        .flatten()
        .map(|(.., group, estimate)| culprit(problem, group, violation, estimate))
        .filter(|culprit| !is_weak(culprit));
    let culprits = pulling.collect::<Vec<_>>();
    let slow = slow::too_slow_to_step(problem);
    let is_slow =
        |culprit: &Culprit| slow.as_ref().is_some_and(|slow| culprit.constraint == slow.constraint);
    // The changed request may need less speed.
    let (requests, others): (Vec<_>, Vec<_>) = culprits
        .into_iter()
        .filter(|culprit| !is_slow(culprit))
        .partition(|culprit| culprit.part == Kind::Request);
    let first = weak.into_iter().chain(narrow.map(|narrow| narrow.culprit));
    let culprits = first.chain(requests).chain(slow.clone()).chain(others).collect();
    Some(Diagnosis { verdict, culprits })
}

fn culprit(
    problem: &Problem,
    group: &Group,
    violation: f64,
    estimate: Option<Estimate>,
) -> Culprit {
    let duration_s = problem.interval_s * (problem.last() - 1) as f64;
    let mobility = Mobility::of(problem.model.robot(), &problem.stance, &problem.goal, duration_s);
    let strongest = group.pulls.iter().map(|(y, ..)| y.abs()).fold(0.0, f64::max);
    let time_s = |at: usize| at.saturating_sub(1) as f64 * problem.interval_s;
    let pulling: Vec<f64> = group
        .pulls
        .iter()
        .filter(|(y, ..)| y.abs() >= PULLING * strongest)
        .map(|&(_, at, _)| time_s(at))
        .collect();
    // Goals concern the whole motion.
    let whole = [0.0, duration_s];
    let range = [
        pulling.iter().copied().fold(f64::INFINITY, f64::min),
        pulling.iter().copied().fold(0.0, f64::max),
    ];
    Culprit {
        constraint: group.family,
        part: group.family.kind(),
        subject: group.subject.clone(),
        time_s: if group.family.is_goal() { whole } else { range },
        worst: group.worst(),
        unit: group.family.unit().symbol().to_owned(),
        share: group.square() / violation,
        field: group.given.map(|(field, _)| field.to_owned()),
        given: group.given.map(|(_, value)| value),
        would_do: estimate.map(|estimate| estimate.value),
        advice: advice(problem, group.family, mobility),
    }
}

/// Advice on the change that would help, including a higher `torque_use` or `speed_use` of the motion if that is below 1.
fn advice(problem: &Problem, family: Family, mobility: Mobility) -> String {
    let Reserve { torque_use, speed_use } = problem.reserve;
    let share = match family {
        Family::JointTorque => Some(("torque_use", torque_use)),
        Family::JointSpeed | Family::WheelMotorSpeed => Some(("speed_use", speed_use)),
        _ => None,
    };
    let advice = mobility.advice(family);
    match share.filter(|(_, share)| *share < 1.0) {
        Some((field, share)) => {
            format!("{advice}, or a `{field}` above {share} in the motion file")
        }
        None => advice,
    }
}
