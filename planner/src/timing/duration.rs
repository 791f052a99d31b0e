//! Search over the duration of the whole motion, in library frames.
//!
//! A plan from a neighbouring duration takes a few iterations, less than the multipliers need to become as accurate as the
//! costs. The search therefore compares costs only: logarithms of costs over those of durations are nearly parabolas.

use super::candidates::Candidates;
use crate::motion::Motion;

/// Factor between successive durations while no plan is found.
const LONGER: f64 = 1.1;
/// Distance of durations that are not worth another plan, as a fraction of the given duration.
const CLOSE: f64 = 0.02;
/// Maximum number of durations to try between the bounds, in addition to the given one.
const MOST: usize = 4;

/// Duration in frames, and its plan with the costs. Durations without a plan have infinite costs.
#[derive(Clone, Copy)]
struct Point {
    frames: usize,
    index: Option<usize>,
    cost: f64,
}

/// Seeks the cheapest duration of a motion with certain footfalls. Stores all plans in `candidates`.
pub fn search(candidates: &mut Candidates<'_>, motion: &Motion) {
    let (given, allowed) = (candidates.given().frames(), candidates.given().frames_allowed());
    let (shortest, longest) = (*allowed.start(), *allowed.end());
    let mut here = point(candidates, motion, motion.frames(), None);
    let mut points = vec![here];
    while here.index.is_none() && here.frames < longest && !candidates.interrupted() {
        let next = (LONGER * here.frames as f64).ceil() as usize;
        here = point(candidates, motion, next.min(longest), None);
        points.push(here);
    }
    if here.index.is_none() {
        return;
    }
    if points.len() == 1 && shortest < here.frames {
        points.insert(0, point(candidates, motion, shortest, here.index));
    }
    if here.frames < longest {
        points.push(point(candidates, motion, longest, here.index));
    }
    let close = (CLOSE * given as f64).max(1.0);
    for _ in 0..MOST {
        let Some(frames) = next(&points, close) else { return };
        if candidates.interrupted() {
            return;
        }
        let nearest = points.iter().filter(|point| point.index.is_some());
        let nearest = nearest.min_by_key(|point| point.frames.abs_diff(frames));
        let found = point(candidates, motion, frames, nearest.and_then(|point| point.index));
        let at = points.partition_point(|point| point.frames < frames);
        points.insert(at, found);
    }
}

/// Plans a motion in a number of frames.
fn point(
    candidates: &mut Candidates<'_>,
    motion: &Motion,
    frames: usize,
    from: Option<usize>,
) -> Point {
    let same = frames == motion.frames();
    let motion = if same { motion.clone() } else { motion.stretched_to(frames) };
    let index = candidates.solve(motion, from);
    let cost = index.map_or(f64::INFINITY, |index| candidates.at(index).cost());
    Point { frames, index, cost }
}

/// Next duration to try: the lowest point of the parabola through the cheapest duration and its neighbours. If the shortest or
/// the longest of the three has no plan, the middle between it and the next one. `None` if the result is too close to a known
/// duration.
fn next(points: &[Point], close: f64) -> Option<usize> {
    let best = (0..points.len()).min_by(|&a, &b| points[a].cost.total_cmp(&points[b].cost))?;
    let first = best.saturating_sub(1).min(points.len().saturating_sub(3));
    let near = points.get(first..first + 3)?;
    let frames = if near.iter().all(|point| point.cost.is_finite()) {
        lowest(near)?
    } else {
        // The cheapest durations begin where plans begin to exist.
        let [a, b] = match near {
            [a, b, _] if a.index.is_none() => [a, b],
            [_, b, c] => [b, c],
            _ => return None,
        };
        0.5 * (a.frames + b.frames) as f64
    };
    let inside = (near[0].frames as f64) < frames && frames < near[2].frames as f64;
    let far = |point: &Point| (point.frames as f64 - frames).abs() >= close;
    (inside && points.iter().all(far)).then_some(frames.round() as usize)
}

/// Abscissa of the minimum of the parabola through three points, on logarithmic scales. `None` if the parabola has no minimum.
fn lowest(points: &[Point]) -> Option<f64> {
    let at = |k: usize| ((points[k].frames as f64).ln(), points[k].cost.ln());
    let [(x0, y0), (x1, y1), (x2, y2)] = [at(0), at(1), at(2)];
    let [left, right] = [(y1 - y0) / (x1 - x0), (y2 - y1) / (x2 - x1)];
    let bend = (right - left) / (x2 - x0);
    // Slope at the middle between the first two points, where the parabola has the slope of their chord.
    let lowest = 0.5 * (x0 + x1) - left / (2.0 * bend);
    (bend > 0.0).then(|| lowest.exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(frames: usize, cost: f64) -> Point {
        Point { frames, index: cost.is_finite().then_some(0), cost }
    }

    #[test]
    fn the_next_duration_is_where_the_parabola_is_lowest() {
        // ln cost = 3 (ln frames − ln 40)².
        let cost = |frames: usize| (3.0 * (frames as f64 / 40.0).ln().powi(2)).exp();
        let points = [28, 48, 67].map(|frames| point(frames, cost(frames)));
        assert_eq!(next(&points, 1.0), Some(40));
        let points = [28, 40, 48, 67].map(|frames| point(frames, cost(frames)));
        assert_eq!(next(&points, 1.0), None, "the lowest point is known");
        let falling = [28, 48, 67].map(|frames| point(frames, 1.0 / frames as f64));
        assert_eq!(next(&falling, 1.0), None, "costs fall up to the bound");
    }

    #[test]
    fn beside_durations_without_a_plan_the_middle_is_next() {
        let points = [point(48, f64::INFINITY), point(53, 2.0), point(67, 3.0)];
        assert_eq!(next(&points, 1.0), Some(51));
        let points = [point(28, 3.0), point(48, 2.0), point(67, f64::INFINITY)];
        assert_eq!(next(&points, 1.0), Some(58));
    }
}
