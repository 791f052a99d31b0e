//! Profile as convex parts. A wheel at the foot of a step touches both the floor and the step; the nearest point of the whole
//! profile would jump between them.

use super::{Ground, Surface};
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};
use std::sync::Arc;

pub(super) type Flat = Vector2<f64>;

/// Length of level ground before and after a profile in which the exit of a part is searched, m. A part without an exit
/// continues below the ground over half of this length.
const FAR_M: f64 = 4.0;

/// Builds the surface of a line or corner in the x-z plane. `bend` is the derivative of the normal.
pub(super) fn in_plane(gap_m: f64, normal: &Flat, bend: &Matrix2<f64>) -> Surface {
    let curvature = Matrix3::new(
        bend.m11, 0.0, bend.m12, //
        0.0, 0.0, 0.0, //
        bend.m21, 0.0, bend.m22,
    );
    Surface::exact(gap_m, Vector3::new(normal.x, 0.0, normal.y), curvature)
}

/// Convex solid with equal section for all y: the region to the right of a polyline that extends to infinity at both ends.
#[derive(Clone, Debug, PartialEq)]
struct Convex {
    /// Corners of the polyline, m.
    corners: Vec<Flat>,
    /// Unit directions of the infinite first and final segment.
    ends: [Flat; 2],
}

impl Ground for Convex {
    fn is_distance(&self) -> bool {
        true
    }

    fn at(&self, point: &Vector3<f64>) -> Surface {
        let at = Flat::new(point.x, point.z);
        let (first, last) = (self.corners[0], self.corners[self.corners.len() - 1]);
        // A point of each part of the line, its direction, and its extent backward and forward.
        let ends = [
            (first, self.ends[0], f64::NEG_INFINITY, 0.0),
            (last, self.ends[1], 0.0, f64::INFINITY),
        ];
        let parts = self.corners.windows(2).map(|pair| {
            (pair[0], (pair[1] - pair[0]).normalize(), 0.0, (pair[1] - pair[0]).norm())
        });
        let mut nearest: Option<(f64, Surface)> = None;
        for (from, along, least, most) in ends.into_iter().chain(parts) {
            let share = along.dot(&(at - from));
            let away = at - (from + along * share.clamp(least, most));
            let distance = away.norm();
            if nearest.is_some_and(|(other, _)| other <= distance) {
                continue;
            }
            let surface = if (least..=most).contains(&share) || distance == 0.0 {
                let up = Flat::new(-along.y, along.x);
                in_plane(up.dot(&away), &up, &Matrix2::zeros())
            } else {
                // A point nearest to a corner of a convex solid is outside the solid.
                let normal = away / distance;
                let bend = (Matrix2::identity() - normal * normal.transpose()) / distance;
                in_plane(distance, &normal, &bend)
            };
            nearest = Some((distance, surface));
        }
        nearest.expect("there are ends").1
    }
}

/// Divides a profile, which is level before and after its corners, at its concave corners. Each part extends below its
/// neighbours, so that its own edges are hidden.
pub(super) fn parts(corners: &[[f64; 2]]) -> Vec<Arc<dyn Ground>> {
    let corners: Vec<_> = corners.iter().copied().map(Flat::from).collect();
    let mut directions = vec![Flat::x()];
    directions.extend(corners.windows(2).map(|pair| (pair[1] - pair[0]).normalize()));
    directions.push(Flat::x());
    let is_concave = |corner: usize| directions[corner].perp(&directions[corner + 1]) > 1e-9;
    let cuts: Vec<_> = (0..corners.len()).filter(|&corner| is_concave(corner)).collect();
    let begins = std::iter::once(None).chain(cuts.iter().copied().map(Some));
    let ends = cuts.iter().copied().map(Some).chain([None]);
    let part = |(begin, end): (Option<usize>, Option<usize>)| {
        let within = begin.map_or(0, |cut| cut + 1)..end.unwrap_or(corners.len());
        let mut line = corners[within].to_vec();
        let mut directed = [Flat::x(); 2];
        if let Some(cut) = begin {
            line.insert(0, beneath(&corners, cut, -directions[cut + 1]));
            directed[0] = Flat::y();
        }
        if let Some(cut) = end {
            line.push(beneath(&corners, cut, directions[cut]));
            directed[1] = -Flat::y();
        }
        Arc::new(Convex { corners: line, ends: directed }) as Arc<dyn Ground>
    };
    begins.zip(ends).map(part).collect()
}

/// Point at which the outline of a part turns straight down. Beyond the concave corner `cut`, the outline continues in direction
/// `along`, below the neighbouring part. This point is half-way to the point at which the outline would emerge again. At a wall,
/// the outline turns down at the corner.
fn beneath(corners: &[Flat], cut: usize, along: Flat) -> Flat {
    let corner = corners[cut];
    if along.x.abs() < 1e-12 {
        return corner;
    }
    let side = along.x.signum();
    let above = |of: &Flat| of.y - (corner.y + along.y / along.x * (of.x - corner.x));
    let level = |of: &Flat| of + Flat::x() * (side * FAR_M);
    let neighbours: Vec<_> = if side > 0.0 {
        corners[cut..].iter().copied().chain(corners.last().map(level)).collect()
    } else {
        let before = corners[..=cut].iter().rev().copied();
        before.chain(corners.first().map(level)).collect()
    };
    let comes_out = neighbours.windows(2).skip(1).find(|pair| above(&pair[1]) <= 1e-9);
    let out_x = comes_out.map_or(corner.x + side * FAR_M, |pair| {
        let [before, after] = [above(&pair[0]), above(&pair[1])];
        pair[0].x + (pair[1].x - pair[0].x) * (before / (before - after)).clamp(0.0, 1.0)
    });
    corner + along * (0.5 * (out_x - corner.x) / along.x)
}
