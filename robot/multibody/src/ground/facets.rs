//! Surface of a terrain as quadrilaterals, for pictures.

use super::Terrain;
use super::file::Shape;
use nalgebra::{Rotation2, Vector2, Vector3};

/// Maximum number of quadrilaterals of a height field along each axis.
const FIELD_FACETS_MAX: f64 = 60.0;
/// Length of a quadrilateral of a height field, m.
const FIELD_FACET_M: f64 = 0.08;

impl Terrain {
    /// Quadrilaterals that cover at least a rectangle of the x-y plane, each with its corners in order, m.
    pub fn facets(&self, [x_m, y_m]: [[f64; 2]; 2]) -> Vec<[Vector3<f64>; 4]> {
        let turn = Rotation2::new(self.heading_rad);
        let corners = [[0, 0], [1, 0], [1, 1], [0, 1]];
        let within = corners.map(|[i, j]| turn.inverse() * Vector2::new(x_m[i], y_m[j]));
        let range = |axis: usize| {
            let along = within.iter().map(|corner| corner[axis]);
            along.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            })
        };
        let (along, across) = (range(0), range(1));
        let place = |x: f64, y: f64, z: f64| {
            let at = turn * Vector2::new(x, y);
            Vector3::new(at.x, at.y, z)
        };
        // Lines across the terrain, each with its height at both sides.
        let strip = |[[x0, z0], [x1, z1]]: [[f64; 2]; 2]| {
            let [right, left] = across;
            [place(x0, right, z0), place(x1, right, z1), place(x1, left, z1), place(x0, left, z0)]
        };
        match &self.shape {
            Shape::Level => vec![strip(along.map(|x| [x, 0.0]))],
            Shape::Slope(angle_rad) => {
                vec![strip(along.map(|x| [x, x * angle_rad.tan()]))]
            }
            Shape::Profile(profile) => {
                let line = profile.line(along);
                line.windows(2).map(|pair| strip([pair[0], pair[1]])).collect()
            }
            Shape::Field(field) => {
                let cells = |[low, high]: [f64; 2]| {
                    let count = ((high - low) / FIELD_FACET_M).ceil().clamp(1.0, FIELD_FACETS_MAX);
                    (count as usize, low, (high - low) / count)
                };
                let ((columns, x0, dx), (rows, y0, dy)) = (cells(along), cells(across));
                let corner = |i: usize, j: usize| {
                    let [x, y] = [x0 + dx * i as f64, y0 + dy * j as f64];
                    place(x, y, field.elevation(x, y).height_m)
                };
                let cell = |i: usize, j: usize| {
                    [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)]
                };
                (0..rows)
                    .flat_map(|j| (0..columns).map(move |i| (i, j)))
                    .map(|(i, j)| cell(i, j))
                    .collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::ground::file::from_toml;

    #[test]
    fn facets_lie_on_the_surface_and_cover_the_rectangle() {
        for text in [
            "[slope]\nangle_deg = 10",
            "heading_deg = 40\n[stairs]\nat_x_m = 0.3\ncount = 3\nriser_m = 0.1\ntread_m = 0.3",
            "heading_deg = -20\n[rough]\nheight_m = 0.05\nspacing_m = 0.2\nhalf_m = 2\nseed = 3",
        ] {
            let terrain = from_toml("test.toml", text).unwrap();
            let (solid, facets) = (terrain.solid(), terrain.facets([[-0.5, 1.5], [-0.4, 0.4]]));
            for corner in facets.iter().flatten() {
                assert!(solid.at(corner).gap_m.abs() < 1e-9, "{text}: {corner:?}");
            }
            for axis in 0..2 {
                let at = facets.iter().flatten().map(|corner| corner[axis]);
                let (low, high) = at.fold((9.0f64, -9.0f64), |(a, b), v| (a.min(v), b.max(v)));
                assert!(low <= [-0.5, -0.4][axis] && high >= [1.5, 0.4][axis], "{text}");
            }
        }
    }
}
