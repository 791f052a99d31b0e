//! Meshes of soft bodies.

use nalgebra::Vector3;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Nodes and tetrahedra of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions of the nodes at rest, m.
    pub places: Vec<Vector3<f64>>,
    /// Node indices of each element. Seen from the first node, the other three are clockwise.
    pub elements: Vec<[usize; 4]>,
}

/// Error of an invalid mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// An element has no positive volume.
    #[error(
        "the tetrahedron of nodes {nodes:?} has a volume of {volume_m3:.3e} m³; expected a volume \
         above 0 m³: swap two nodes to change the sign"
    )]
    Flat {
        /// Nodes of the element.
        nodes: [usize; 4],
        /// Volume of the element, m³.
        volume_m3: f64,
    },
}

/// Tetrahedra of a cube around its diagonal from corner 0 to corner 7. Bit k of a corner number is its coordinate on axis k.
const OF_CUBE: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 3, 2, 7], [0, 2, 6, 7], [0, 6, 4, 7], [0, 4, 5, 7], [0, 5, 1, 7]];

impl Mesh {
    /// Box from a corner, m, with given edges, m, and given numbers of cells. A cell has six elements.
    pub fn block(corner: Vector3<f64>, edges_m: Vector3<f64>, cells: [usize; 3]) -> Self {
        let [nx, ny, nz] = cells.map(|count| count + 1);
        let number = |at: [usize; 3]| at[0] + nx * (at[1] + ny * at[2]);
        let mut mesh = Self::default();
        for k in 0..nx * ny * nz {
            let at = [k % nx, k / nx % ny, k / (nx * ny)];
            let share = |axis: usize| at[axis] as f64 / cells[axis] as f64;
            let offset = Vector3::from_fn(|axis, _| share(axis) * edges_m[axis]);
            mesh.places.push(corner + offset);
            if (0..3).all(|axis| at[axis] < cells[axis]) {
                let corner = |bits: usize| {
                    number([at[0] + (bits & 1), at[1] + (bits >> 1 & 1), at[2] + (bits >> 2)])
                };
                mesh.elements.extend(OF_CUBE.map(|element| element.map(corner)));
            }
        }
        mesh
    }

    /// Ring about the z axis with a round section. `radius_m` is the distance from the origin to the middle of the section;
    /// `tube_m` is the radius of the section. `around` and `across` are the numbers of cells along the ring and in each
    /// direction of the section. A cell has six elements.
    pub fn ring(radius_m: f64, tube_m: f64, around: usize, across: usize) -> Self {
        let beam = Self::block(
            Vector3::new(0.0, -1.0, -1.0),
            Vector3::new(TAU, 2.0, 2.0),
            [around, across, across],
        );
        // The last section coincides with the first.
        let (turns, sections) = (around + 1, (across + 1) * (across + 1));
        let number = |node: usize| node / turns * around + node % turns % around;
        let bent = |place: &Vector3<f64>| {
            // A map from a square to its inscribed circle.
            let flat = Vector3::new(0.0, place.y, place.z);
            let section = flat * (tube_m * flat.amax() / flat.norm().max(f64::MIN_POSITIVE));
            let (sine, cosine) = place.x.sin_cos();
            let out = radius_m - section.y;
            Vector3::new(out * cosine, out * sine, section.z)
        };
        let mut places = vec![Vector3::zeros(); around * sections];
        for (node, place) in beam.places.iter().enumerate() {
            places[number(node)] = bent(place);
        }
        let elements = beam.elements.iter().map(|element| element.map(number)).collect();
        Self { places, elements }
    }

    /// Ball about the origin: an icosahedron of `layers` layers, each projected onto a sphere. For n layers, the surface has 10
    /// n² + 2 nearly uniform nodes, and the ball has 20 n³ elements.
    pub fn ball(radius_m: f64, layers: usize) -> Self {
        let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
        let corners: Vec<Vector3<f64>> = (0..12)
            .map(|k| {
                let [short, long] = [1, 2].map(|bit| if k & bit == 0 { 1.0 } else { -1.0 });
                let flat = [0.0, short, long * golden];
                Vector3::from_fn(|axis, _| flat[(axis + k / 4) % 3])
            })
            .collect();
        let next = |a: usize, b: usize| (corners[a] - corners[b]).norm() < 2.1;
        let mut mesh = Self::default();
        let mut numbers: BTreeMap<[i64; 3], usize> = BTreeMap::new();
        for a in 0..12 {
            for b in (0..a).filter(|&b| next(a, b)) {
                for c in (0..b).filter(|&c| next(a, c) && next(b, c)) {
                    mesh.add_wedge([a, b, c].map(|k| corners[k]), layers, &mut numbers);
                }
            }
        }
        mesh.shaped(|place| place * radius_m)
    }

    /// Adds the wedge of a unit ball between the origin and one face of the icosahedron.
    ///
    /// The nodes form a grid with steps along the edges from the origin to the first corner, to the second, and to the third.
    /// Cubes of this grid are divided as in a block. `numbers` has the indices of existing nodes by position.
    fn add_wedge(
        &mut self,
        [a, b, c]: [Vector3<f64>; 3],
        layers: usize,
        numbers: &mut BTreeMap<[i64; 3], usize>,
    ) {
        let inside = |at: [usize; 3]| layers >= at[0] && at[0] >= at[1] && at[1] >= at[2];
        let mut number = |at: [usize; 3]| {
            let [x, y, z] = at.map(|step| step as f64);
            let flat = a * (x - y) + b * (y - z) + c * z;
            let place = flat.try_normalize(0.0).unwrap_or_default() * (x / layers as f64);
            // Positions of one node from two wedges differ by rounding.
            let key = [0, 1, 2].map(|axis| (place[axis] * 1e9).round() as i64);
            *numbers.entry(key).or_insert_with(|| {
                self.places.push(place);
                self.places.len() - 1
            })
        };
        let turned = a.cross(&b).dot(&c) < 0.0;
        let mut elements = Vec::new();
        for cube in 0..layers.pow(3) {
            let low = [cube % layers, cube / layers % layers, cube / (layers * layers)];
            for of_cube in OF_CUBE {
                let corners =
                    of_cube.map(|bits| [0, 1, 2].map(|axis| low[axis] + (bits >> axis & 1)));
                if corners.iter().all(|at| inside(*at)) {
                    let [first, second, third, fourth] = corners.map(&mut number);
                    elements.push(if turned {
                        [first, second, fourth, third]
                    } else {
                        [first, second, third, fourth]
                    });
                }
            }
        }
        self.elements.extend(elements);
    }

    /// Maps the positions of the nodes, for example to bend a box into another shape.
    pub fn shaped(mut self, shape: impl Fn(Vector3<f64>) -> Vector3<f64>) -> Self {
        self.places.iter_mut().for_each(|place| *place = shape(*place));
        self
    }

    /// Mass of each node, kg: a quarter of the mass of each adjacent element.
    pub fn masses_kg(&self, density_kg_m3: f64) -> Vec<f64> {
        let mut masses = vec![0.0; self.places.len()];
        for element in &self.elements {
            let [a, b, c, d] = element.map(|node| self.places[node]);
            let volume_m3 = (b - a).cross(&(c - a)).dot(&(d - a)) / 6.0;
            element.iter().for_each(|&node| masses[node] += 0.25 * density_kg_m3 * volume_m3);
        }
        masses
    }

    /// Surface area of each node, m²: a third of each adjacent triangle that belongs to one element only.
    pub fn areas_m2(&self) -> Vec<f64> {
        let mut faces: BTreeMap<[usize; 3], usize> = BTreeMap::new();
        for element in &self.elements {
            for left_out in 0..4 {
                let mut face = [1, 2, 3].map(|k| element[(left_out + k) % 4]);
                face.sort_unstable();
                *faces.entry(face).or_default() += 1;
            }
        }
        let mut areas = vec![0.0; self.places.len()];
        for (face, _) in faces.iter().filter(|(_, count)| **count == 1) {
            let [a, b, c] = face.map(|node| self.places[node]);
            let area = 0.5 * (b - a).cross(&(c - a)).norm();
            face.iter().for_each(|&node| areas[node] += area / 3.0);
        }
        areas
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assembly::Assembly;
    use crate::soft::{Material, SoftBody};

    /// Tests a ring against the volume 2 π² R r² and surface 4 π² R r of a torus. The mesh is inscribed, so that both values
    /// are smaller.
    #[test]
    fn a_ring_has_nearly_the_mass_and_the_surface_of_a_torus() {
        let (radius, tube) = (0.1, 0.03);
        let mesh = Mesh::ring(radius, tube, 48, 6);
        assert_eq!((mesh.places.len(), mesh.elements.len()), (48 * 49, 48 * 36 * 6));
        let mut assembly = Assembly::default();
        SoftBody::add(&mut assembly, &mesh, &Material::elastic(50.0, 1e4, 0.3)).unwrap();
        let mass: f64 = assembly.bodies.iter().map(|body| body.mass_kg()).sum();
        let torus = TAU * radius * 0.5 * TAU * tube * tube;
        assert!((0.95..1.0).contains(&(mass / (50.0 * torus))), "{mass}");
        let surface = mesh.areas_m2().iter().sum::<f64>() / (TAU * TAU * radius * tube);
        assert!((0.97..1.0).contains(&surface), "{surface}");
    }

    /// Tests the numbers of nodes and elements of a ball against closed forms, and its volume and surface against an inscribed
    /// sphere. The surface nodes have nearly equal areas.
    #[test]
    fn a_ball_has_nearly_the_mass_and_the_surface_of_a_sphere() {
        let radius = 0.02;
        for layers in [1, 2, 3, 4] {
            let mesh = Mesh::ball(radius, layers);
            let shells = (1..=layers).map(|n| 10 * n * n + 2).sum::<usize>() + 1;
            assert_eq!((mesh.places.len(), mesh.elements.len()), (shells, 20 * layers.pow(3)));
            let mut assembly = Assembly::default();
            SoftBody::add(&mut assembly, &mesh, &Material::elastic(50.0, 1e4, 0.3)).unwrap();
            let areas = mesh.areas_m2();
            assert_eq!(areas.iter().filter(|area| **area > 0.0).count(), 10 * layers * layers + 2);
            let com: Vector3<f64> = (mesh.masses_kg(1.0).iter().zip(&mesh.places))
                .map(|(mass, place)| place * *mass)
                .sum();
            assert!(com.norm() < 1e-15, "{com}");
            if layers == 4 {
                let mass: f64 = assembly.bodies.iter().map(|body| body.mass_kg()).sum();
                let volume = mass / 50.0 / (2.0 / 3.0 * TAU * radius.powi(3));
                assert!((0.9..1.0).contains(&volume), "{volume}");
                let surface = areas.iter().sum::<f64>() / (2.0 * TAU * radius * radius);
                assert!((0.95..1.0).contains(&surface), "{surface}");
            }
        }
    }

    #[test]
    fn a_block_has_the_mass_and_the_surface_of_a_box() {
        let edges = Vector3::new(0.2, 0.3, 0.4);
        let mesh = Mesh::block(Vector3::repeat(-0.1), edges, [2, 3, 4]);
        assert_eq!((mesh.places.len(), mesh.elements.len()), (60, 144));
        let surface = 2.0 * (0.2 * 0.3 + 0.2 * 0.4 + 0.3 * 0.4);
        assert!((mesh.areas_m2().iter().sum::<f64>() - surface).abs() < 1e-12);
        assert_eq!(mesh.areas_m2().iter().filter(|area| **area == 0.0).count(), 6);
        let mut assembly = Assembly::default();
        SoftBody::add(&mut assembly, &mesh, &Material::elastic(50.0, 1e4, 0.3)).unwrap();
        let mass: f64 = assembly.bodies.iter().map(|body| body.mass_kg()).sum();
        assert!((mass - 50.0 * 0.2 * 0.3 * 0.4).abs() < 1e-12);
    }
}
