//! Convex hulls in the plane: outlines of the drawn robot, and support polygons.

/// Convex hull of points (Andrew's monotone chain), counter-clockwise if y points up. For points on a line, the hull is the two
/// ends; for equal points, one point.
pub fn convex_hull(mut points: Vec<[f64; 2]>) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let turns_right = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| {
        (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0
    };
    let half = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for p in points {
            while chain.len() >= 2 && turns_right(chain[chain.len() - 2], chain[chain.len() - 1], p)
            {
                chain.pop();
            }
            chain.push(p);
        }
        chain.pop();
        chain
    };
    let mut hull = half(&mut points.iter().copied());
    hull.extend(half(&mut points.iter().rev().copied()));
    if hull.is_empty() { points } else { hull }
}

/// Distance of a point from the edge of a convex hull, positive inside. The hull must be ordered as by [`convex_hull`]. `None`
/// for an empty hull.
pub fn depth(hull: &[[f64; 2]], point: [f64; 2]) -> Option<f64> {
    let edges = hull.iter().zip(hull.iter().cycle().skip(1));
    let is_left = |(a, b): (&[f64; 2], &[f64; 2])| {
        (b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) >= 0.0
    };
    let is_inside = hull.len() > 2 && edges.clone().all(is_left);
    let nearest = edges.map(|(a, b)| from_edge(*a, *b, point)).min_by(f64::total_cmp)?;
    Some(if is_inside { nearest } else { -nearest })
}

/// Distance of a point from the segment between two others.
fn from_edge(a: [f64; 2], b: [f64; 2], point: [f64; 2]) -> f64 {
    let (along, to) = ([b[0] - a[0], b[1] - a[1]], [point[0] - a[0], point[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let dot = to[0] * along[0] + to[1] * along[1];
    let part = if squared > 0.0 { (dot / squared).clamp(0.0, 1.0) } else { 0.0 };
    (to[0] - part * along[0]).hypot(to[1] - part * along[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hull_of_a_square_with_inner_points_is_the_square() {
        let points = vec![[0.0, 0.0], [1.0, 1.0], [0.5, 0.5], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0]];
        assert_eq!(convex_hull(points), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
        assert_eq!(convex_hull(vec![[2.0, 3.0]]), [[2.0, 3.0]]);
        let line = vec![[1.0, 0.0], [0.0, 0.0], [2.0, 0.0]];
        assert_eq!(convex_hull(line), [[0.0, 0.0], [2.0, 0.0]]);
    }

    #[test]
    fn the_depth_is_the_distance_from_the_nearest_edge() {
        let square = convex_hull(vec![[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]);
        assert_eq!(depth(&square, [1.5, 1.0]), Some(0.5));
        assert_eq!(depth(&square, [5.0, 6.0]), Some(-5.0));
        // A line or a point has no inside: two wheels, or one foot.
        assert_eq!(depth(&[[0.0, 0.0], [2.0, 0.0]], [1.0, 0.25]), Some(-0.25));
        assert_eq!(depth(&[[0.0, 0.0]], [3.0, 4.0]), Some(-5.0));
        assert_eq!(depth(&[], [0.0, 0.0]), None);
    }
}
