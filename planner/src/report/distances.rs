//! Smallest distances of a motion as played: swing height, between links, and between links and the ground. Residuals contain
//! only the deficits.

use super::clearance::{distance, ground_distance_m};
use super::grid::{State, Timeline, feet};
use crate::motion::Ends;
use serde::Serialize;
use std::fmt;

/// Smallest distance, with its subject and time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SmallestDistance {
    /// Distance, m. For overlapping shapes, minus the depth of the overlap.
    pub distance_m: f64,
    /// Name of the end effector, link or links.
    pub subject: String,
    /// Time of the distance, s.
    pub time_s: f64,
}

/// Smallest distances of a motion.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SmallestDistances {
    /// Lowest swing: height of the contact point at the top of the swing. `None` if nothing swings.
    pub swing: Option<SmallestDistance>,
    /// Distance between two links; `None` for robots without shapes that could meet.
    pub links: Option<SmallestDistance>,
    /// Height of a link above the ground.
    pub ground: Option<SmallestDistance>,
}

impl SmallestDistances {
    /// Computes the smallest distances at the times of a timeline.
    pub(super) fn of(timeline: &Timeline) -> Self {
        let limbs = feet(timeline).filter(|(_, foot)| !foot.contact.is_body_point());
        let swings = limbs.flat_map(|(j, foot)| {
            let highest = highest_of_swings(timeline, j);
            highest.into_iter().map(|(distance_m, time_s)| (distance_m, time_s, &foot.name))
        });
        let swing = least(swings).map(|(distance_m, time_s, name)| SmallestDistance {
            distance_m,
            subject: name.clone(),
            time_s,
        });
        let (robot, clearance) = (&timeline.plan.robot, timeline.model.clearance());
        let pairs = timeline.samples().flat_map(|w| {
            let time_s = w.here.sample.time_s;
            clearance.pairs().iter().map(move |pair| (distance(w.here, pair), time_s, pair))
        });
        let links = least(pairs).map(|(distance_m, time_s, pair)| SmallestDistance {
            distance_m,
            subject: robot.pair_name(pair.links),
            time_s,
        });
        let points = timeline.samples().flat_map(|w| {
            let time_s = w.here.sample.time_s;
            let points = clearance.points().iter();
            points.map(move |point| (ground_distance_m(w.here, point), time_s, point.link))
        });
        let ground = least(points).map(|(distance_m, time_s, link)| SmallestDistance {
            distance_m,
            subject: robot.links[link].name.clone(),
            time_s,
        });
        Self { swing, links, ground }
    }
}

/// Returns the entry with the smallest distance, or the first of equals.
fn least<T>(of: impl Iterator<Item = (f64, f64, T)>) -> Option<(f64, f64, T)> {
    of.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Height and time of the highest point of every swing of an end effector.
fn highest_of_swings(timeline: &Timeline, j: usize) -> Vec<(f64, f64)> {
    let states: Vec<&State> = timeline.samples().map(|w| w.here).collect();
    // A swing of a periodic motion may continue in the next period.
    let first = match timeline.plan.motion.ends {
        Ends::Periodic => states.iter().position(|state| state.stands(j)).unwrap_or(0),
        Ends::AtRest | Ends::Prescribed => 0,
    };
    let (end, begin) = states.split_at(first);
    let in_order: Vec<&State> = begin.iter().chain(end).copied().collect();
    let swings = in_order.split(|state| state.stands(j));
    let highest = |swing: &[&State]| {
        let heights = swing.iter().map(|state| (state.contact_height_m(j), state.sample.time_s));
        heights.max_by(|a, b| a.0.total_cmp(&b.0))
    };
    swings.filter_map(highest).collect()
}

impl fmt::Display for SmallestDistances {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines = [
            ("lowest swing", &self.swing),
            ("between links", &self.links),
            ("links above the ground", &self.ground),
        ];
        writeln!(f, "smallest distances as played, 60 Hz")?;
        for (what, least) in lines {
            let Some(SmallestDistance { distance_m, subject, time_s }) = least else { continue };
            writeln!(f, "  {what}: {:.1} mm at {time_s:.3} s, {subject}", 1e3 * distance_m)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_plans;

    #[test]
    fn the_lowest_of_the_swings_counts_by_its_highest_point() {
        let mut plan = test_plans::cruise();
        assert_eq!(SmallestDistances::of(&Timeline::new(&plan)).swing, None, "nothing swings");
        let last = plan.samples.len() - 1;
        // A swing of 30 mm, and a swing of 20 mm that continues in the next period.
        for (sample, height_m) in [(4, 0.01), (5, 0.03), (6, 0.02), (last, 0.02), (0, 0.005)] {
            let foot = &mut plan.samples[sample].end_effectors[1];
            (foot.contact, foot.position_m[2]) = (false, height_m);
        }
        let room = SmallestDistances::of(&Timeline::new(&plan));
        let swing = room.swing.clone().expect("two swings");
        assert_eq!(swing.distance_m, 0.02);
        assert_eq!(swing.time_s, plan.samples[last].time_s);
        assert_eq!(swing.subject, plan.robot.end_effectors[1].name);
        let shown = room.to_string();
        assert!(shown.contains("lowest swing: 20.0 mm at"), "{shown}");
    }
}
