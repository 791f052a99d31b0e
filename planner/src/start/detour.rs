//! Paths round the obstacles between the start and the goal of a motion.
//!
//! A solve does not move a robot through an obstacle to its other side. A detour is a start on a chosen side: the body moves
//! along an offset from the straight path, and faces along it, so that wheels roll. Below an obstacle at the height of its head,
//! it ducks.

use crate::motion::Motion;
use crate::problem::extent::{DUCK, Extent, contains};
use nalgebra::{Rotation2, Vector2};
use rollwalk_multibody::euler::Model;
use rollwalk_robot::Robot;

/// Maximum number of detours that are tried.
const DETOURS_MAX: usize = 3;
/// Ratio of the length along the path over which the offset changes to the change of the offset.
const RAMP: f64 = 1.5;
/// Ratio of the additional distance from obstacles to the robot's half width: corners swing out as the robot turns.
const SLACK: f64 = 0.15;

/// Offsets from the straight path, as functions of the distance along it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Detour {
    /// Offset to the left.
    pub aside: Offsets,
    /// Offset downwards.
    pub duck: Offsets,
}

/// Offset as a function of the distance along a path: corners of a line, m. Without corners, the offset is 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Offsets(Vec<[f64; 2]>);

impl Offsets {
    /// Offset at a distance along the path, m, and its slope.
    pub fn at(&self, along_m: f64) -> (f64, f64) {
        let after = self.0.iter().position(|[corner_m, _]| *corner_m > along_m);
        let Some(after) = after.filter(|after| *after > 0) else { return (0.0, 0.0) };
        let ([from_m, low_m], [to_m, high_m]) = (self.0[after - 1], self.0[after]);
        let u = (along_m - from_m) / (to_m - from_m);
        // Smooth, parallel to the path at both corners.
        let rise_m = high_m - low_m;
        let slope = 6.0 * u * (1.0 - u) * rise_m / (to_m - from_m);
        (low_m + rise_m * u * u * (3.0 - 2.0 * u), slope)
    }

    /// Length of the line through the corners, m.
    fn length_m(&self) -> f64 {
        self.0.windows(2).map(|pair| (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1])).sum()
    }
}

/// Obstacles as seen from a straight path.
struct PathView {
    body: Extent,
    obstacles: Vec<Extent>,
    length_m: f64,
}

impl PathView {
    /// Returns the view of a motion; `None` without obstacles or without a path.
    fn new(robot: &Robot, motion: &Motion) -> Option<Self> {
        let obstacles = motion.ground.obstacles();
        let goal =
            Vector2::new(motion.goal.forward_m.unwrap_or(0.0), motion.goal.left_m.unwrap_or(0.0));
        if obstacles.is_empty() || goal.norm() == 0.0 {
            return None;
        }
        let path_from_world = Rotation2::new(-goal.y.atan2(goal.x));
        let model = Model::new(robot);
        let q = model.standing_q(&motion.posture_rad);
        let body = Extent::of_robot(&model, &q, &path_from_world);
        let seen = obstacles.iter();
        let seen = seen.map(|of| Extent::of_obstacle(of, &motion.ground, &path_from_world));
        let obstacles = seen.map(|of| of.seen_by(&body)).collect();
        Some(Self { body, obstacles, length_m: goal.norm() })
    }

    /// Paths round the obstacles, the shortest first.
    fn round(&self) -> Vec<Offsets> {
        Corridor::new(&self.body, self.length_m, &self.obstacles).round()
    }
}

/// Detours of a motion, the shortest first. Empty if the straight path is free.
pub(crate) fn detours(robot: &Robot, motion: &Motion) -> Vec<Detour> {
    let Some(view) = PathView::new(robot, motion) else { return Vec::new() };
    let duck = ducks(&view.body, view.length_m, &view.obstacles);
    let mut aside = view.round();
    if aside.is_empty() && duck != Offsets::default() {
        aside.push(Offsets::default());
    }
    aside.into_iter().map(|aside| Detour { aside, duck: duck.clone() }).collect()
}

/// Widest obstacle in the straight path of a motion, and the lengths of the shortest path round the obstacles and of the
/// straight path, m. `None` if the straight path is free.
pub(super) fn shortest_way_round(robot: &Robot, motion: &Motion) -> Option<(usize, [f64; 2])> {
    let view = PathView::new(robot, motion)?;
    let round_m = view.round().first()?.length_m();
    let blocking = view.obstacles.iter().enumerate();
    let blocking =
        blocking.filter(|(_, of)| of.is_beside(&view.body) && of.is_in_path(view.length_m));
    let width_m = |of: &Extent| of.across_m[1] - of.across_m[0];
    let widest = blocking.max_by(|(_, one), (_, other)| width_m(one).total_cmp(&width_m(other)))?;
    Some((widest.0, [round_m, view.length_m]))
}

/// Part of the path on which an offset is needed.
#[derive(Clone, Copy, Debug)]
struct Passage {
    /// Distances along the path between which the robot is beside or below an obstacle, m.
    range_m: [f64; 2],
    /// Distance of the middle of the obstacle, within the path, m.
    middle_m: f64,
    offset_m: f64,
}

impl Passage {
    fn new(range_m: [f64; 2], offset_m: f64, length_m: f64) -> Self {
        let middle_m = (0.5 * (range_m[0] + range_m[1])).clamp(0.0, length_m);
        Self { range_m, middle_m, offset_m }
    }
}

/// Offsets at passages in ascending order. If two passages are too close for a smooth change, the robot has the required offset
/// only at the middle of each passage.
fn through(mut passages: Vec<Passage>, length_m: f64) -> Offsets {
    passages.insert(0, Passage::new([0.0; 2], 0.0, length_m));
    passages.push(Passage::new([length_m; 2], 0.0, length_m));
    for next in 1..passages.len() {
        let [before, after] = &mut passages[next - 1..=next] else { unreachable!("two passages") };
        let need_m = RAMP * (after.offset_m - before.offset_m).abs();
        let lacks_m = need_m - (after.range_m[0] - before.range_m[1]);
        if lacks_m > 0.0 {
            before.range_m[1] = (before.range_m[1] - 0.5 * lacks_m).max(before.middle_m);
            after.range_m[0] = (before.range_m[1] + need_m).min(after.middle_m);
        }
    }
    let corners = passages.iter().flat_map(|passage| {
        let [from_m, to_m] = passage.range_m;
        [from_m.min(passage.middle_m), to_m.max(passage.middle_m)]
            .map(|at_m| [at_m, passage.offset_m])
    });
    let mut corners: Vec<_> = corners.collect();
    corners.dedup_by(|next, before| next[0] <= before[0]);
    Offsets(corners)
}

/// Offsets downwards below the obstacles at the height of the robot's head.
fn ducks(body: &Extent, length_m: f64, obstacles: &[Extent]) -> Offsets {
    let head_m = body.height_m[1];
    let above = obstacles.iter().filter(|of| (DUCK * head_m..head_m).contains(&of.height_m[0]));
    let above = above.filter(|of| of.is_in_path(length_m));
    let mut passages: Vec<Passage> =
        above.map(|of| Passage::new(of.along_m, head_m - of.height_m[0], length_m)).collect();
    if passages.is_empty() {
        return Offsets::default();
    }
    passages.sort_by(|one, other| one.range_m[0].total_cmp(&other.range_m[0]));
    passages.dedup_by(|next, before| {
        let within = next.range_m[1] <= before.range_m[1];
        if within {
            before.offset_m = before.offset_m.max(next.offset_m);
        }
        within
    });
    through(passages, length_m)
}

/// Obstacles in a straight path, with the offsets at which the robot can pass them.
struct Corridor {
    length_m: f64,
    /// Distances along the path between which the robot is beside each obstacle in the path, m, in ascending order.
    blocking: Vec<[f64; 2]>,
    /// Offsets at which the robot passes each of `blocking`, m.
    free_m: Vec<Vec<f64>>,
}

impl Corridor {
    fn new(body: &Extent, length_m: f64, obstacles: &[Extent]) -> Self {
        let slack_m = SLACK * 0.5 * (body.across_m[1] - body.across_m[0]);
        let slacken = |of: &Extent| {
            let [right_m, left_m] = of.across_m;
            Extent { across_m: [right_m - slack_m, left_m + slack_m], ..*of }
        };
        let enlarged: Vec<Extent> =
            obstacles.iter().filter(|of| of.is_beside(body)).map(slacken).collect();
        let blocking = enlarged.iter().filter(|of| of.is_in_path(length_m));
        let mut blocking: Vec<Extent> = blocking.copied().collect();
        blocking.sort_by(|one, other| one.along_m[0].total_cmp(&other.along_m[0]));
        // What is beside a longer obstacle is passed with it.
        blocking.dedup_by(|next, before| next.along_m[1] <= before.along_m[1]);
        let sides = || enlarged.iter().flat_map(|of| of.across_m).chain([0.0]);
        let free_at = |station: &Extent| {
            let beside = |of: &&Extent| {
                of.along_m[0] < station.along_m[1] && of.along_m[1] > station.along_m[0]
            };
            let free = |offset_m: &f64| {
                !enlarged.iter().filter(beside).any(|of| contains(of.across_m, *offset_m))
            };
            let mut free_m: Vec<f64> = sides().filter(free).collect();
            free_m.sort_by(f64::total_cmp);
            free_m.dedup();
            free_m
        };
        let free_m = blocking.iter().map(free_at).collect();
        Self { length_m, blocking: blocking.iter().map(|of| of.along_m).collect(), free_m }
    }

    /// Paths, the shortest first: one for each side of the first obstacle.
    fn round(&self) -> Vec<Offsets> {
        let Some(first) = self.free_m.first() else { return Vec::new() };
        let mut found: Vec<(f64, Offsets)> =
            first.iter().filter_map(|&offset_m| self.shortest(offset_m)).collect();
        found.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        found.truncate(DETOURS_MAX);
        found.into_iter().map(|(_, offsets)| offsets).collect()
    }

    /// Shortest path that passes the first obstacle at an offset, and the sum of its offsets, m. `None` if an obstacle cannot
    /// be passed.
    fn shortest(&self, first_m: f64) -> Option<(f64, Offsets)> {
        // For each offset at the present obstacle: sum of changes so far, and the offsets until there.
        let mut ends = vec![(first_m.abs(), vec![first_m])];
        for free_m in &self.free_m[1..] {
            let reach = |&offset_m: &f64| {
                let to = |(sum_m, offsets): &(f64, Vec<f64>)| {
                    sum_m + (offset_m - offsets[offsets.len() - 1]).abs()
                };
                let before = ends.iter().min_by(|one, other| to(one).total_cmp(&to(other)))?;
                let offsets = before.1.iter().copied().chain([offset_m]).collect();
                Some((to(before), offsets))
            };
            ends = free_m.iter().filter_map(reach).collect();
        }
        let total =
            |(sum_m, offsets): (f64, Vec<f64>)| (sum_m + offsets[offsets.len() - 1].abs(), offsets);
        let all = ends.into_iter().map(total);
        let (sum_m, offsets) = all.min_by(|(one, _), (other, _)| one.total_cmp(other))?;
        Some((sum_m, self.through(&offsets)))
    }

    /// Path with the given offsets at the obstacles.
    fn through(&self, offsets_m: &[f64]) -> Offsets {
        let beside = self.blocking.iter().zip(offsets_m);
        let passages =
            beside.map(|(range_m, offset_m)| Passage::new(*range_m, *offset_m, self.length_m));
        through(passages.collect(), self.length_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Footing;

    fn corridor(obstacles: &[([f64; 2], [f64; 2])]) -> Corridor {
        let body = Extent { along_m: [-0.2, 0.2], across_m: [-0.1, 0.1], height_m: [0.0, 0.4] };
        let boxes = obstacles.iter().map(|([x, y], [length, width])| {
            format!(
                "[[obstacle]]\nbox_m = [{length}, {width}, 0.3]\nat_m = [{x}, {y}, 0.15]\n\
                 margin_m = 0\n"
            )
        });
        let text: String = boxes.collect();
        let terrain = rollwalk_multibody::ground::file::from_toml("test.toml", &text).unwrap();
        let (ground, ahead) = (Footing::default(), Rotation2::identity());
        let seen = terrain.obstacles.iter();
        let seen = seen.map(|of| Extent::of_obstacle(of, &ground, &ahead).seen_by(&body));
        let seen: Vec<_> = seen.collect();
        Corridor::new(&body, 3.0, &seen)
    }

    #[test]
    fn a_box_beside_a_longer_wall_is_passed_with_it() {
        let found = corridor(&[([1.5, 0.05], [1.6, 0.2]), ([1.4, 0.0], [0.2, 0.1])]).round();
        for at_m in [0.8, 1.4, 1.9, 2.2] {
            let offset_m = found[0].at(at_m).0;
            assert!((offset_m + 0.165).abs() < 1e-9, "{at_m}: {offset_m}");
        }
    }

    #[test]
    fn a_free_way_has_no_detour() {
        assert!(corridor(&[([1.0, 0.5], [0.2, 0.2])]).round().is_empty());
        assert!(corridor(&[([4.0, 0.0], [0.2, 0.2])]).round().is_empty());
    }

    #[test]
    fn the_shorter_side_comes_first() {
        let found = corridor(&[([1.5, 0.05], [0.2, 0.2])]).round();
        let offsets: Vec<f64> = found.iter().map(|detour| detour.at(1.5).0).collect();
        // The box is 0.15 m on the left and 0.05 m on the right; the robot is 0.1 m wide, with a slack of 15 mm.
        assert!(
            (offsets[0] + 0.165).abs() < 1e-12 && (offsets[1] - 0.265).abs() < 1e-12,
            "{offsets:?}"
        );
        let (start, end) = (found[0].at(0.0), found[0].at(3.0));
        assert_eq!([start, end], [(0.0, 0.0); 2]);
    }

    #[test]
    fn a_slalom_alternates_and_a_wall_with_a_gap_is_passed_in_its_gap() {
        let found = corridor(&[([1.0, 0.12], [0.1, 0.2]), ([2.0, -0.12], [0.1, 0.2])]).round();
        assert!(found[0].at(1.0).0 < 0.0 && found[0].at(2.0).0 > 0.0);
        let wall = corridor(&[([1.5, 0.9], [0.1, 1.0]), ([1.5, -1.0], [0.1, 2.2])]).round();
        // The gap is from 0.1 to 0.4 m.
        let offset_m = wall[0].at(1.5).0;
        assert!((0.215..=0.285).contains(&offset_m), "{offset_m}");
    }

    #[test]
    fn an_offset_changes_smoothly() {
        let found = corridor(&[([1.5, 0.0], [0.2, 0.2])]).round();
        for k in 1..300 {
            let (along_m, step_m) = (0.01 * f64::from(k), 1e-5);
            let [before, here, after] = [-step_m, 0.0, step_m].map(|by| found[0].at(along_m + by));
            let slope = (after.0 - before.0) / (2.0 * step_m);
            assert!((slope - here.1).abs() < 1e-3, "{along_m}: {slope}, {here:?}");
        }
    }
}
