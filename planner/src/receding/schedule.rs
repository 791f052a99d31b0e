//! Contact schedule over time. The schedule combines the footfalls of the gait, unfinished swings of the previous gait, and
//! measured contacts.

use super::gait::Gait;
use crate::motion::swing;
use std::f64::consts::PI;
use std::ops::Range;

/// Footfalls by index of the sample, counted from the start of the first gait.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    pub gait: Gait,
    /// Sample at which the gait began.
    begun_at: i64,
    /// Sample range of each end effector's unfinished swing from the previous gait.
    earlier: Vec<Range<i64>>,
}

/// State of the contact point of an end effector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ContactState {
    /// True if the end effector touches the ground.
    pub touches: bool,
    /// Height above the ground, m.
    pub height_m: f64,
    /// Rate of the height, m/s.
    pub rises_m_s: f64,
}

/// Footfalls and heights of a horizon.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Footfalls {
    /// Stance flags `[sample][end effector]`.
    pub stance: Vec<Vec<bool>>,
    /// Contact heights `[sample][end effector]`, m.
    pub height_m: Vec<Vec<f64>>,
}

/// Height below which an end effector counts as touching the ground if the schedule requires stance, m. Contacts yield by about
/// this height.
const STANDS_BELOW_M: f64 = 0.003;

impl Schedule {
    /// Creates a schedule in which all end effectors stand, and a gait begins at sample `begun_at`.
    pub fn new(gait: Gait, begun_at: i64) -> Self {
        let earlier = vec![0..0; gait.motion.held_wheels.len()];
        Self { gait, begun_at, earlier }
    }

    /// Changes to another gait at a sample. An end effector in the air lands as in the previous gait, and then stands until its
    /// first lift-off in the new one.
    pub fn change(&mut self, gait: Gait, at: i64) {
        let swing = |j: usize| {
            let swings = |k: &i64| !self.stands(*k, j);
            let before = (0..at).rev().take_while(swings).last().unwrap_or(at);
            before..if before < at {
                (at..).find(|k| !swings(k)).expect("every swing ends")
            } else {
                at
            }
        };
        let earlier = (0..self.earlier.len()).map(swing).collect();
        *self = Self { gait, begun_at: at, earlier };
    }

    /// Returns true if end effector `j` stands at sample `at`.
    pub fn stands(&self, at: i64, j: usize) -> bool {
        if self.earlier[j].contains(&at) {
            return false;
        }
        let rows = &self.gait.motion.stance;
        let count = rows.len() as i64;
        let row = |k: i64| rows[k.rem_euclid(count) as usize][j];
        let since = at - self.begun_at;
        // Swings that began before the gait, or before another foot landed, are left out.
        let free = (self.earlier[j].end - self.begun_at).max(0);
        since < free || (free..=since.min(free + count)).all(|k| !row(k)) || row(since)
    }

    /// Index of a sample within the gait's period.
    pub fn phase(&self, at: i64) -> usize {
        (at - self.begun_at).rem_euclid(self.gait.samples() as i64) as usize
    }

    /// Footfalls of `samples` samples from sample `at`, at which the contact points have the states `places`. On terrain, a swing
    /// may begin below its envelope.
    pub fn from(
        &self,
        at: i64,
        samples: usize,
        places: &[ContactState],
        on_terrain: bool,
    ) -> Footfalls {
        let period = self.gait.samples();
        let (swing_m, h) = (self.gait.motion.swing_height_m, self.gait.interval_s());
        // With a period before and after, every swing has its lift-off and its landing.
        let around = at - period as i64..at + (samples + period) as i64;
        let here = period;
        let row = |k: i64| (0..places.len()).map(|j| self.stands(k, j)).collect();
        let mut rows: Vec<Vec<bool>> = around.map(row).collect();
        let mut late = vec![0..0; places.len()];
        for (j, place) in places.iter().enumerate() {
            let until = (here..rows.len()).find(|&k| rows[k][j]).unwrap_or(here);
            let since = (0..here).rev().find(|&k| rows[k][j]).map_or(here, |k| k + 1);
            if place.touches && until - here < here - since {
                // The foot has landed early. A foot that still touches at lift-off lifts off late.
                rows[here..until].iter_mut().for_each(|row| row[j] = true);
            } else if !place.touches && rows[here][j] && place.height_m > STANDS_BELOW_M {
                // The foot has not landed in time, and descends further, at most at the greatest speed of a swing.
                let swing_s = h * self.swing_samples(j).max(1) as f64;
                let fastest_m_s = PI * swing_m.max(STANDS_BELOW_M) / swing_s;
                let more = (place.height_m / (fastest_m_s * h)).ceil() as usize;
                late[j] = here..(here + more).min(rows.len());
                rows[late[j].clone()].iter_mut().for_each(|row| row[j] = false);
            }
        }
        let mut heights = swing::arches(&rows, swing_m);
        for (j, place) in places.iter().enumerate().filter(|(j, _)| !rows[here][*j]) {
            heights[late[j].clone()].iter_mut().for_each(|row| row[j] = 0.0);
            let until = (here..rows.len()).find(|&k| rows[k][j]).unwrap_or(rows.len());
            let rises = (heights[here + 1][j] - heights[here - 1][j]) / (2.0 * h);
            let off = [place.height_m - heights[here][j], (place.rises_m_s - rises) * h];
            // At the last sample of a swing, the foot is on the ground.
            let last = (until - 1 - here) as f64;
            for (k, row) in heights[here..until].iter_mut().enumerate() {
                row[j] += fade_out(off, k as f64, last);
            }
            let least_m = if on_terrain { place.height_m.min(0.0) } else { 0.0 };
            heights[here + 1..until].iter_mut().for_each(|row| row[j] = row[j].max(least_m));
        }
        let inside = here..here + samples;
        Footfalls { stance: rows[inside.clone()].to_vec(), height_m: heights[inside].to_vec() }
    }

    /// Number of swing samples of an end effector in a period.
    fn swing_samples(&self, j: usize) -> usize {
        self.gait.motion.stance.iter().filter(|row| !row[j]).count()
    }
}

/// Value at `t` of the cubic that has the given value and slope at 0, and value and slope 0 at `end`. Beyond `end`, 0.
pub(super) fn fade_out([value, slope]: [f64; 2], t: f64, end: f64) -> f64 {
    if t >= end {
        return if t == 0.0 { value } else { 0.0 };
    }
    let u = t / end;
    value * (1.0 + 2.0 * u) * (1.0 - u).powi(2) + slope * t * (1.0 - u).powi(2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_robots;

    /// Gait of 10 samples at 0.1 s. The first of four end effectors swings at the dots of `row`.
    fn gait(row: &str) -> Gait {
        let robot = &test_robots::all()[0];
        let mut gait = Gait::standing(robot, 0.1).expect("a spacing");
        let stands = |mark: char| vec![mark == '#', true, true, true];
        gait.motion.stance = row.chars().map(stands).collect();
        gait.motion.duration_s = 0.1 * row.len() as f64;
        gait.motion.swing_height_m = 0.04;
        gait
    }

    fn down() -> ContactState {
        ContactState { touches: true, height_m: 0.0, rises_m_s: 0.0 }
    }

    fn flags(rows: &[Vec<bool>]) -> String {
        rows.iter().map(|row| if row[0] { '#' } else { '.' }).collect()
    }

    fn from(
        schedule: &Schedule,
        at: i64,
        samples: usize,
        first: ContactState,
    ) -> (String, Vec<f64>) {
        let footfalls = schedule.from(at, samples, &[first, down(), down(), down()], false);
        (flags(&footfalls.stance), footfalls.height_m.iter().map(|row| row[0]).collect())
    }

    #[test]
    fn a_swing_goes_on_from_where_the_foot_is() {
        let schedule = Schedule::new(gait("##.......#"), 0);
        // The foot is on its profile, 0.04 m · sin²(πu) from sample 2 to sample 8, and has its speed.
        let rises_m_s = (0.04 - 0.01) / 0.2;
        let there = ContactState { touches: false, height_m: 0.03, rises_m_s };
        let (marks, heights) = from(&schedule, 4, 7, there);
        assert_eq!(marks, ".....##");
        for (height, expected) in heights.iter().zip([0.03, 0.04, 0.03, 0.01, 0.0, 0.0, 0.0]) {
            assert!((height - expected).abs() < 1e-12, "{heights:?}"); // rounding only
        }
        // The foot is lower and slower. It returns to the profile until it lands.
        let (_, lower) =
            from(&schedule, 4, 7, ContactState { height_m: 0.01, rises_m_s: 0.0, ..there });
        assert!((lower[0] - 0.01).abs() < 1e-12); // rounding only
        assert!((1..4).all(|k| 0.0 < lower[k] && lower[k] < heights[k]), "{lower:?}");
        assert!(lower[4..].iter().all(|height| height.abs() < 1e-12), "{lower:?}");
    }

    #[test]
    fn contacts_that_differ_from_the_schedule_count() {
        let schedule = Schedule::new(gait("##.......#"), 0);
        // The foot has landed early, in the second half of its swing; in the first half it is still on the ground.
        assert_eq!(from(&schedule, 6, 8, down()).0, "######..");
        assert_eq!(from(&schedule, 3, 8, down()).0, "......##");
        // The foot has not landed in time. The descent from 20 mm at no more than π · 40 mm / 0.7 s takes two samples.
        let aloft = ContactState { touches: false, height_m: 0.02, rises_m_s: -0.1 };
        let (marks, heights) = from(&schedule, 9, 5, aloft);
        assert_eq!(marks, "..#..");
        assert_eq!(heights[..4], [0.02, 0.0, 0.0, 0.0]);
        // Within the deflection of a contact, the foot stands.
        assert_eq!(from(&schedule, 9, 5, ContactState { height_m: 0.002, ..aloft }).0, "###..");
    }

    #[test]
    fn a_swing_ends_as_it_would_have_when_the_gait_changes() {
        let mut schedule = Schedule::new(gait("##.......#"), 0);
        schedule.change(gait("..##"), 5);
        let stands: String =
            (0..20).map(|k| if schedule.stands(k, 0) { '#' } else { '.' }).collect();
        // The swing of samples 2 to 8 ends. The swing of the other gait, which has begun by then, is left out.
        assert_eq!(&stands[2..], ".......####..##..#");
    }
}
