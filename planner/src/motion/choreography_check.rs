//! Infeasible targets and height limits, refused when the motion file is read. They contradict each other, the footfalls or the
//! ends of the motion, or are beyond the reach of the limbs.
//!
//! Every bound is conservative: a refused request is infeasible, but an accepted one may be infeasible too.

use super::swing;
use super::{Ends, HeightLimit, Moment, Motion, Subject, Target};
use rollwalk_robot::Robot;
use rollwalk_robot::document::Table;
use std::f64::consts::TAU;

/// Largest height of a swing, m, as for `swing_height_m`.
const SWING_HIGHEST_M: f64 = 1.0;
/// Difference below which two times are equal, s.
const SAME_TIME_S: f64 = 1e-6;

/// Checks the targets and height limits of a motion. `targets` and `heights` contain their tables, in the order of the motion.
pub(super) fn check(motion: &Motion, robot: &Robot, targets: &[Table<'_>], heights: &[Table<'_>]) {
    for (index, (target, table)) in motion.targets.iter().zip(targets).enumerate() {
        check_target(table, motion, robot, index, target);
    }
    for (index, (limit, table)) in motion.heights.iter().zip(heights).enumerate() {
        check_span(table, motion, robot, index, limit);
    }
}

/// Checks one target. Returns `false` after the first fault, because others may follow from it.
fn check_target(
    table: &Table<'_>,
    motion: &Motion,
    robot: &Robot,
    index: usize,
    target: &Target,
) -> bool {
    check_ends(table, motion, target)
        && check_asked_once(table, &motion.targets[..index], target)
        && check_swing(table, motion, robot, target, index)
        && check_reach(table, motion, robot, target)
        && check_within(table, motion, target)
        && check_way(table, motion, robot, index)
}

/// Refuses targets for fixed values: horizontal position and heading of the body at time 0, and speeds at an end at rest.
fn check_ends(table: &Table<'_>, motion: &Motion, target: &Target) -> bool {
    let at_start = target.at_s < SAME_TIME_S;
    let at_end = motion.duration_s - target.at_s < SAME_TIME_S;
    if motion.ends == Ends::AtRest && (at_start || at_end) {
        for (key, wanted) in
            ["speed_forward_m_s", "speed_left_m_s", "speed_up_m_s"].iter().zip(target.velocity_m_s)
        {
            if wanted.is_some() {
                let help = "choose a time between the ends, because a motion at rest stands still \
                    at both ends";
                table.fault(key, "is given for an end of the motion", "at rest", help);
                return false;
            }
        }
    }
    if target.of == Subject::Body && at_start {
        let [forward_m, left_m, _] = target.position_m;
        let own =
            [("forward_m", forward_m), ("left_m", left_m), ("heading_rad", target.heading_rad)];
        for (key, wanted) in own {
            if let Some(wanted) = wanted.filter(|&wanted| wanted != 0.0) {
                let help = "choose a later time, because positions and headings of targets are \
                    relative to the start of the body";
                table.fault(key, format!("is {wanted} at time 0; expected 0"), "the start", help);
                return false;
            }
        }
    }
    true
}

/// Refuses two targets for the same component of a subject at one time.
fn check_asked_once(table: &Table<'_>, earlier: &[Target], target: &Target) -> bool {
    let components = |t: &Target| {
        t.position_m
            .iter()
            .chain(&t.velocity_m_s)
            .chain([&t.heading_rad])
            .copied()
            .collect::<Vec<_>>()
    };
    let twice = earlier.iter().any(|other| {
        let both = components(other).into_iter().zip(components(target));
        other.of == target.of
            && (other.at_s - target.at_s).abs() < SAME_TIME_S
            && both.into_iter().any(|(a, b)| a.is_some() && b.is_some())
    });
    if twice {
        let help = "keep one of the two targets, or choose another time";
        table.fault(
            "at_s",
            format!("is {} s, as in an earlier target for the same value", target.at_s),
            "given twice",
            help,
        );
    }
    !twice
}

/// Checks a target of an end effector. A height requires a swing, every swing has one height, and a stance foot does not move.
fn check_swing(
    table: &Table<'_>,
    motion: &Motion,
    robot: &Robot,
    target: &Target,
    index: usize,
) -> bool {
    let Subject::EndEffector(j) = target.of else { return true };
    let foot = &robot.end_effectors[j];
    let moment = Moment::of(motion, target.at_s);
    let stands = motion.stance[moment.nearest(motion)][j];
    if let Some(wanted_m) = target.position_m[2] {
        if stands && wanted_m == 0.0 {
            return true;
        }
        let fault = |problem: String, label: &str, help: String| {
            table.fault("up_m", problem, label, help);
            false
        };
        if stands {
            return fault(
                format!("is {wanted_m} m while `{}` is on the ground", foot.name),
                "on the ground at this time",
                format!("choose a time in a swing of this foot; {}", swings(motion, j)),
            );
        }
        if wanted_m == 0.0 {
            return fault(
                format!("is 0 while `{}` swings", foot.name),
                "in the air at this time",
                "leave out `up_m`, or give the height of the foot at that time, above 0 m"
                    .to_owned(),
            );
        }
        let plain = Motion { targets: Vec::new(), ..motion.clone() };
        let peak_m = motion.swing_height_m * wanted_m / swing::height_at(&plain, j, moment);
        // The profile is not above 0 right after lift-off: such a target fails here too.
        if !(0.0..=SWING_HIGHEST_M).contains(&peak_m) {
            return fault(
                format!(
                    "is {wanted_m} m at a time too close to an end of the swing of `{}`",
                    foot.name
                ),
                "would rise too high",
                format!(
                    "choose a lower height or a time nearer to mid-swing, because the swing would \
                     rise above {SWING_HIGHEST_M} m; {}",
                    swings(motion, j)
                ),
            );
        }
        let upto = Motion { targets: motion.targets[..=index].to_vec(), ..motion.clone() };
        let reached = |t: &Target| match (t.of, t.position_m[2]) {
            (Subject::EndEffector(k), Some(up_m)) if k == j => {
                (swing::height_at(&upto, j, Moment::of(motion, t.at_s)) - up_m).abs() < 1e-6
            }
            _ => true,
        };
        if !upto.targets.iter().all(reached) {
            return fault(
                format!("is {wanted_m} m in a swing whose height an earlier target determines"),
                "another height",
                "keep one `up_m` for each swing".to_owned(),
            );
        }
    }
    let still = !foot.contact.rolls() && stands_throughout(motion, j, moment);
    let moving = target.velocity_m_s.into_iter().flatten().any(|speed| speed != 0.0);
    if still && moving {
        let help = format!("choose a time in a swing of this foot; {}", swings(motion, j));
        table.fault(
            "of",
            format!(
                "is `{}`, a point foot that cannot move while it is on the \
            ground",
                foot.name
            ),
            "stands",
            help,
        );
        return false;
    }
    true
}

/// Returns true if an end effector is in stance at the three samples around a time on the grid.
fn stands_throughout(motion: &Motion, j: usize, moment: Moment) -> bool {
    let count = motion.stance.len();
    (0..3).all(|k| motion.stance[(moment.sample + k + count - 1) % count][j])
}

/// Text with the swing times of an end effector.
fn swings(motion: &Motion, j: usize) -> String {
    let name_time = |sample: usize| format!("{:.2}", sample as f64 * motion.interval_s());
    let mut spans = Vec::new();
    let mut start = None;
    for (sample, flags) in motion.stance.iter().enumerate() {
        match (flags[j], start) {
            (false, None) => start = Some(sample),
            (true, Some(from)) => {
                spans.push(format!("{} to {} s", name_time(from), name_time(sample - 1)));
                start = None;
            }
            _ => {}
        }
    }
    if let Some(from) = start {
        spans.push(format!("{} to {} s", name_time(from), name_time(motion.stance.len() - 1)));
    }
    if spans.is_empty() {
        "the foot never swings in this motion".to_owned()
    } else {
        format!("the foot swings from {}", spans.join(", "))
    }
}

/// Largest distance of a contact point from the body's origin, with the limb stretched, m.
fn limb_m(robot: &Robot, j: usize) -> f64 {
    let foot = &robot.end_effectors[j];
    path_m(robot, foot.link) + foot.center_in_link_m.norm() + foot.radius_m
}

/// Largest distance of a link's frame from the body's origin, m.
fn path_m(robot: &Robot, link: usize) -> f64 {
    let joint = robot.joints.iter().find(|joint| joint.child == link);
    joint.map_or(0.0, |joint| {
        joint.parent_from_joint.translation.vector.norm() + path_m(robot, joint.parent)
    })
}

/// Largest distance of the centre of mass from the body's origin, m.
fn com_m(robot: &Robot) -> f64 {
    let mass: f64 = robot.links.iter().map(|link| link.mass_kg).sum();
    let moment = |(index, link): (usize, &rollwalk_robot::Link)| {
        link.mass_kg * (path_m(robot, index) + link.com_in_link_m.norm())
    };
    robot.links.iter().enumerate().map(moment).sum::<f64>() / mass
}

/// Largest distance of a subject from a contact point, m.
fn reach_m(robot: &Robot, of: Subject, j: usize) -> f64 {
    limb_m(robot, j) + if of == Subject::Com { com_m(robot) } else { 0.0 }
}

/// Largest distance that a subject can travel over an end effector on the ground, from behind it to ahead of it, m.
fn sway_m(robot: &Robot, of: Subject, j: usize) -> f64 {
    2.0 * reach_m(robot, of, j)
}

/// Largest distance that the centre of mass can travel beyond a wheel driven by its motor, m. The robot leans from behind to
/// ahead, and the wheel rolls as its link pitches. Zero for a periodic motion, which ends in its initial pose.
pub(super) fn lean_m(motion: &Motion, robot: &Robot, j: usize) -> f64 {
    if motion.ends == Ends::Periodic {
        return 0.0;
    }
    sway_m(robot, Subject::Com, j) + TAU * robot.end_effectors[j].radius_m
}

/// Largest height of a subject at a sample, m, with the name of the foot that limits it.
fn highest<'r>(
    motion: &Motion,
    robot: &'r Robot,
    of: Subject,
    sample: usize,
) -> Option<(f64, &'r str)> {
    let standing =
        robot.end_effectors.iter().enumerate().filter(|(j, _)| motion.stance[sample][*j]);
    standing
        .map(|(j, foot)| (reach_m(robot, of, j), foot.name.as_str()))
        .min_by(|a, b| a.0.total_cmp(&b.0))
}

fn too_high(
    table: &Table<'_>,
    key: &str,
    wanted_m: f64,
    at_s: f64,
    (highest_m, foot): (f64, &str),
) {
    let help = format!(
        "give a lower height, because `{foot}` is on the ground at {at_s:.2} s and allows at most \
         {highest_m:.3} m"
    );
    table.fault(key, format!("is {wanted_m} m"), "beyond reach", help);
}

/// Checks that heights of body and centre of mass are within reach of the feet in stance.
fn check_reach(table: &Table<'_>, motion: &Motion, robot: &Robot, target: &Target) -> bool {
    let (Some(up_m), false) = (target.position_m[2], matches!(target.of, Subject::EndEffector(_)))
    else {
        return true;
    };
    let moment = Moment::of(motion, target.at_s);
    // Between samples only a foot in stance at both limits the height.
    let on_sample = moment.fraction.fract() == 0.0;
    let highest = highest(motion, robot, target.of, moment.nearest(motion));
    if let Some(highest) = highest.filter(|highest| on_sample && up_m > highest.0) {
        too_high(table, "up_m", up_m, target.at_s, highest);
        return false;
    }
    true
}

/// Checks that a target lies between the height limits of its time.
fn check_within(table: &Table<'_>, motion: &Motion, target: &Target) -> bool {
    let Some(up_m) = target.position_m[2] else { return true };
    for limit in motion.heights.iter().filter(|limit| limit.of == target.of) {
        let above = limit.below_m.filter(|&below_m| up_m > below_m);
        let below = limit.above_m.filter(|&above_m| up_m < above_m);
        let inside = (limit.from_s..=limit.to_s).contains(&target.at_s);
        if let (true, Some(bound)) = (inside, above.or(below)) {
            let side = if above.is_some() { "below" } else { "above" };
            let help = format!(
                "give a height {side} {bound} m, the bound of a [[height]] from {} to {} s",
                limit.from_s, limit.to_s
            );
            table.fault("up_m", format!("is {up_m} m"), "outside the height limits", help);
            return false;
        }
    }
    true
}

/// Checks that body and centre of mass can reach the target from the previous target or the start, given the end effectors that
/// never leave the ground.
fn check_way(table: &Table<'_>, motion: &Motion, robot: &Robot, index: usize) -> bool {
    let target = &motion.targets[index];
    if matches!(target.of, Subject::EndEffector(_)) {
        return true;
    }
    let start = Target {
        of: target.of,
        at_s: 0.0,
        position_m: [Some(0.0), Some(0.0), None],
        velocity_m_s: [None; 3],
        heading_rad: None,
    };
    // The centre of mass starts within its greatest distance from the body.
    let slack_m = if target.of == Subject::Com { com_m(robot) } else { 0.0 };
    let others = motion.targets.iter().filter(|other| other.of == target.of);
    let befores = others.map(|other| (other, 0.0)).chain([(&start, slack_m)]);
    let before = befores
        .filter(|(other, _)| other.at_s < target.at_s)
        .max_by(|a, b| a.0.at_s.total_cmp(&b.0.at_s));
    let Some((before, slack_m)) = before else { return true };
    let apart = |c: usize| Some(target.position_m[c]? - before.position_m[c]?);
    let distance_m = apart(0).unwrap_or(0.0).hypot(apart(1).unwrap_or(0.0));
    let time_s = target.at_s - before.at_s;
    for (j, foot) in robot.end_effectors.iter().enumerate() {
        if motion.stance.iter().any(|flags| !flags[j]) {
            continue;
        }
        // A wheel rolls further as its link pitches.
        let sway_m = sway_m(robot, target.of, j) + slack_m;
        let rolls_m = if !foot.contact.rolls() {
            0.0
        } else if foot.contact.rolls_with_link() || motion.held_wheels[j] {
            TAU * foot.radius_m
        } else if let Some(actuator) = foot.contact.actuator() {
            foot.radius_m * (TAU + actuator.speed_max_rad_s * time_s)
        } else {
            continue;
        };
        if distance_m > sway_m + rolls_m {
            let help = format!(
                "{distance_m:.2} m in {time_s:.2} s is too far with `{}` on the ground all the \
                 time, which allows at most {:.2} m; give this foot a swing, or choose a later \
                 time or a nearer target",
                foot.name,
                sway_m + rolls_m
            );
            table.fault("at_s", format!("is {} s", target.at_s), "too far", help);
            return false;
        }
    }
    true
}

/// Checks that overlapping height limits are compatible, and within reach of the feet in stance.
fn check_span(
    table: &Table<'_>,
    motion: &Motion,
    robot: &Robot,
    index: usize,
    limit: &HeightLimit,
) {
    let held: Vec<usize> =
        (0..motion.stance.len()).filter(|&sample| limit.holds_at(motion, sample)).collect();
    for other in motion.heights[..index].iter().filter(|other| other.of == limit.of) {
        if !held.iter().any(|&sample| other.holds_at(motion, sample)) {
            continue;
        }
        let contradicts = [
            ("below_m", limit.below_m, other.above_m, -1.0),
            ("above_m", limit.above_m, other.below_m, 1.0),
        ];
        for (key, own_m, other_m, sign) in contradicts {
            if let (Some(own_m), Some(other_m)) = (own_m, other_m)
                && sign * (own_m - other_m) > 0.0
            {
                let side = if sign > 0.0 { "below" } else { "above" };
                let help = format!(
                    "an earlier [[height]] requires a height {side} {other_m} m from {} to {} s; \
                     change one of the limits, or move the spans apart (each is extended to the \
                     next samples)",
                    other.from_s, other.to_s
                );
                table.fault(key, format!("is {own_m} m"), "contradicts another height", help);
                return;
            }
        }
    }
    if let Some(above_m) = limit.above_m {
        for &sample in &held {
            if let Some(highest) =
                highest(motion, robot, limit.of, sample).filter(|highest| above_m > highest.0)
            {
                let at_s = sample as f64 * motion.interval_s();
                return too_high(table, "above_m", above_m, at_s, highest);
            }
        }
    }
}
