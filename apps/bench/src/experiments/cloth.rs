//! Square cloth of particles and springs (thesis Figs. 4.6, 4.16 and 4.17).

use crate::experiments::parts::Link;
use nalgebra::Vector3;
use rollwalk_physics::Assembly;
use std::ops::Range;

/// Stiffness of springs, and of handles on the cloth, N/m (Table A.2).
pub(crate) const STIFFNESS_N_M: f64 = 1000.0;
/// Damping of springs, N·s/m.
const DAMPING_N_S_M: f64 = 0.1;

#[derive(Clone, Debug)]
pub(crate) struct Cloth {
    /// Indices of the particles, row by row.
    pub nodes: Range<usize>,
    count: usize,
}

impl Cloth {
    /// Adds a level cloth around a centre. `slack` is the ratio of the cloth's size to `edge_m`; 1 for a flat cloth.
    pub fn add(
        assembly: &mut Assembly,
        center: Vector3<f64>,
        edge_m: f64,
        count: usize,
        mass_kg: f64,
        slack: f64,
    ) -> Self {
        let (first, spacing) = (assembly.bodies.len(), edge_m / (count - 1) as f64);
        let of_node = mass_kg / (count * count) as f64;
        for k in 0..count * count {
            let [x, y] = [k % count, k / count].map(|k| spacing * k as f64 - 0.5 * edge_m);
            assembly.add_particle(of_node, center + Vector3::new(x, y, 0.0));
        }
        let link = Link {
            stiffness_n_m: STIFFNESS_N_M,
            damping_n_s_m: DAMPING_N_S_M,
            rest: slack,
            string: false,
        };
        let mut add = |one: usize, other: usize| {
            link.add_between(assembly, [first + one, first + other]);
        };
        for k in 0..count * count {
            let (right, up) = (k % count + 1 < count, k / count + 1 < count);
            if right {
                add(k, k + 1);
            }
            if up {
                add(k, k + count);
            }
            if right && up {
                add(k, k + 1 + count);
                add(k + 1, k + count);
            }
        }
        Self { nodes: first..first + count * count, count }
    }

    /// Index of the particle in a row and column.
    pub fn node(&self, row: usize, column: usize) -> usize {
        self.nodes.start + row * self.count + column
    }
}
