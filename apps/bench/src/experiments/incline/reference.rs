//! Reference simulation of particles on a plane with hard contacts and exact Coulomb friction, without penalties.
//!
//! Sequential quadratic programming with friction cones solves every step of backward Euler. Velocities v at the end of a step
//! minimise ½ (v − v_k)ᵀ H (v − v_k) + gᵀ (v − v_k), where g = M (v_k − v₀) − h f and H is its derivative. For each contact
//! with the normal velocity u_n and the tangential velocity u_t, (u_n + gap/h + μ s, μ u_t) is in the second-order cone. The
//! multiplier of the cone is the impulse, which is within the cone of Coulomb's law. With s = |u_t|, impulse and velocity obey
//! Coulomb's law. The value of s is taken from the previous program, until it converges (Acary, Cadoux, Lemaréchal & Malick, "A
//! formulation of the linear discrete Coulomb friction problem via convex optimization", 2011).

use clarabel::algebra::CscMatrix;
use clarabel::solver::{
    DefaultSettingsBuilder, DefaultSolver, IPSolver, SecondOrderConeT, SolverStatus,
};
use nalgebra::{DVector, Matrix3, Vector3};
use rollwalk_multibody::ground::{Ground, Plane};
use rollwalk_physics::force::{Derivative, View, Wrench};
use rollwalk_physics::motion::Weights;
use rollwalk_physics::{Assembly, BodyMotion, Scheme};

/// Gap above which a particle does not touch within a step, m.
const REACH_M: f64 = 0.01;
/// Maximum number of programs of a step.
const PROGRAMS: u32 = 100;
/// Tolerance of forces, N, and of s, m/s.
const TOLERANCE: f64 = 1e-8;
/// Tolerance of a program, in units of a particle's mass.
const OF_PROGRAM: f64 = 1e-12;
/// Regularisation of the solver of a program. With the default of 1e-8, programs end with particles that carry load without
/// touching, and the body creeps on them.
const REGULARISATION: f64 = 1e-12;

/// Particles with their forces, and the plane.
#[derive(Debug)]
pub struct Reference {
    pub assembly: Assembly,
    pub plane: Plane,
    pub coefficient: f64,
    pub gravity_m_s2: Vector3<f64>,
    pub step_s: f64,
}

/// Report on the solution of a step.
#[derive(Clone, Debug, Default)]
pub struct SolutionReport {
    /// Number of programs, each with updated forces and derivatives.
    pub programs: u32,
    /// Largest unbalanced force, N.
    pub residual_n: f64,
    /// Largest remaining change of s, m/s.
    pub slip_m_s: f64,
    /// Touching particles, and the impulses on them, N·s.
    pub impulses: Vec<(usize, Vector3<f64>)>,
}

impl SolutionReport {
    /// True if residual force and slip are within the tolerance.
    pub fn converged(&self) -> bool {
        self.residual_n <= TOLERANCE && self.slip_m_s <= TOLERANCE
    }
}

/// Momentum change that is not due to forces, N·s, and its derivative with respect to the velocities, as blocks by row and
/// column.
struct MomentumModel {
    excess: Vec<Vector3<f64>>,
    blocks: Vec<(usize, usize, Matrix3<f64>)>,
}

impl Reference {
    /// Advances by a step. Returns `None` if a program has no solution.
    pub fn step(&mut self) -> Option<SolutionReport> {
        let begin = self.assembly.motions.clone();
        let gap = |motion: &BodyMotion| self.plane.at(&motion.position).gap_m;
        let near: Vec<(usize, f64)> = begin.iter().map(gap).enumerate().collect();
        let near: Vec<_> = near.into_iter().filter(|(_, gap_m)| *gap_m < REACH_M).collect();
        let mut velocities: Vec<_> = begin.iter().map(|motion| motion.velocity).collect();
        let mut report = SolutionReport::default();
        let mut slips_m_s = self.slips(&near, &velocities);
        let mut model = self.model(&begin, &velocities);
        while report.programs < PROGRAMS {
            (velocities, report.impulses) = self.program(&near, &slips_m_s, &velocities, &model)?;
            report.programs += 1;
            let slips_before = std::mem::replace(&mut slips_m_s, self.slips(&near, &velocities));
            model = self.model(&begin, &velocities);
            let mut left = model.excess.clone();
            report.impulses.iter().for_each(|(particle, impulse)| left[*particle] -= impulse);
            report.residual_n =
                left.iter().map(|left| left.norm()).fold(0.0, f64::max) / self.step_s;
            let changes = slips_m_s.iter().zip(&slips_before);
            report.slip_m_s = changes.map(|(now, then)| (now - then).abs()).fold(0.0, f64::max);
            if report.converged() {
                break;
            }
        }
        self.assembly.motions = self.moved(&begin, &velocities);
        Some(report)
    }

    fn moved(&self, begin: &[BodyMotion], velocities: &[Vector3<f64>]) -> Vec<BodyMotion> {
        let moved = |(motion, velocity): (&BodyMotion, &Vector3<f64>)| BodyMotion {
            position: motion.position + velocity * self.step_s,
            velocity: *velocity,
            ..*motion
        };
        begin.iter().zip(velocities).map(moved).collect()
    }

    /// Tangential speeds of the particles that may touch.
    fn slips(&self, near: &[(usize, f64)], velocities: &[Vector3<f64>]) -> Vec<f64> {
        let normal = self.plane.normal;
        let across = |velocity: Vector3<f64>| (velocity - normal * normal.dot(&velocity)).norm();
        near.iter().map(|&(particle, _)| across(velocities[particle])).collect()
    }

    fn model(&self, begin: &[BodyMotion], velocities: &[Vector3<f64>]) -> MomentumModel {
        let step_s = self.step_s;
        let now = self.moved(begin, velocities);
        let mut model = MomentumModel { excess: Vec::new(), blocks: Vec::new() };
        for (particle, body) in self.assembly.bodies.iter().enumerate() {
            let change = velocities[particle] - begin[particle].velocity;
            model.excess.push((change - self.gravity_m_s2 * step_s) * body.mass_kg());
            let block = Matrix3::identity() * body.mass_kg();
            model.blocks.push((particle, particle, block));
        }
        let weights = Weights::new(Scheme::Bdf1, step_s);
        for force in &self.assembly.forces {
            let of = |motions: &[BodyMotion]| -> Vec<BodyMotion> {
                force.bodies().iter().map(|&body| motions[body]).collect()
            };
            let (now, last) = (of(&now), of(begin));
            let view = View {
                now: &now,
                last: &last,
                before: &last,
                weights: &weights,
                tame: false,
                held: None,
            };
            let count = now.len();
            let mut wrenches = vec![Wrench::default(); count];
            let mut derivatives = vec![Derivative::default(); count * count];
            force.derivatives(&view, &mut wrenches, &mut derivatives);
            for (i, &row) in force.bodies().iter().enumerate() {
                model.excess[row] -= wrenches[i].force * step_s;
                for (j, &column) in force.bodies().iter().enumerate() {
                    let Derivative { by_pose, by_rate } = &derivatives[i * count + j];
                    let by_pose = by_pose.fixed_view::<3, 3>(0, 0);
                    let by_rate = by_rate.fixed_view::<3, 3>(0, 0);
                    model.blocks.push((row, column, -(by_pose * step_s + by_rate) * step_s));
                }
            }
        }
        model
    }

    /// Solves the program around some velocities, and returns velocities and impulses of the contacts.
    #[allow(clippy::type_complexity, reason = "the type has no other use")]
    fn program(
        &self,
        near: &[(usize, f64)],
        slips_m_s: &[f64],
        velocities: &[Vector3<f64>],
        model: &MomentumModel,
    ) -> Option<(Vec<Vector3<f64>>, Vec<(usize, Vector3<f64>)>)> {
        // Unit: mass of a particle.
        let unit_kg = model.blocks[0].2[(0, 0)];
        let size = 3 * velocities.len();
        let mut hessian = Triplets::default();
        for (row, column, block) in &model.blocks {
            for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                // The solver needs the upper triangle only.
                if 3 * row + i <= 3 * column + j {
                    hessian.add(3 * row + i, 3 * column + j, block[(i, j)] / unit_kg);
                }
            }
        }
        let gradient: Vec<f64> =
            model.excess.iter().flat_map(|of| (of / unit_kg).data.0[0]).collect();
        let axes = self.axes();
        let (mut rows, mut right) = (Triplets::default(), Vec::new());
        for (&(particle, gap_m), slip_m_s) in near.iter().zip(slips_m_s) {
            for axis in &axes {
                for k in 0..3 {
                    rows.add(right.len(), 3 * particle + k, -axis[k]);
                }
                right.push(axis.dot(&velocities[particle]));
            }
            let normal = right.len() - 3;
            right[normal] += gap_m / self.step_s + self.coefficient * slip_m_s;
        }
        let cones = vec![SecondOrderConeT(3); near.len()];
        let settings = DefaultSettingsBuilder::default()
            .verbose(false)
            .tol_gap_abs(OF_PROGRAM)
            .tol_gap_rel(OF_PROGRAM)
            .tol_feas(OF_PROGRAM)
            .static_regularization_constant(REGULARISATION)
            .build()
            .expect("the settings are those of the solver");
        let hessian = hessian.matrix(size, size);
        let rows = rows.matrix(right.len(), size);
        let solver = DefaultSolver::new(&hessian, &gradient, &rows, &right, &cones, settings);
        let mut solver = solver.expect("the sizes fit");
        solver.solve();
        let solved = [SolverStatus::Solved, SolverStatus::AlmostSolved];
        solved.contains(&solver.solution.status).then_some(())?;
        let change = DVector::from_column_slice(&solver.solution.x);
        let velocity =
            |(k, velocity): (usize, &Vector3<f64>)| velocity + change.fixed_rows::<3>(3 * k);
        let impulse = |(&(particle, _), of): (&(usize, f64), &[f64])| {
            let sum: Vector3<f64> = axes.iter().zip(of).map(|(axis, of)| axis * *of).sum();
            (particle, sum * unit_kg)
        };
        let impulses = near.iter().zip(solver.solution.z.chunks(3)).map(impulse).collect();
        Some((velocities.iter().enumerate().map(velocity).collect(), impulses))
    }

    /// Normal vector, and two tangential axes scaled by the friction coefficient.
    fn axes(&self) -> [Vector3<f64>; 3] {
        let normal = self.plane.normal;
        let across = normal.cross(&Vector3::y()).normalize();
        [normal, across * self.coefficient, normal.cross(&across) * self.coefficient]
    }
}

/// Entries of a sparse matrix. Entries with equal row and column are added.
#[derive(Default)]
struct Triplets {
    rows: Vec<usize>,
    columns: Vec<usize>,
    values: Vec<f64>,
}

impl Triplets {
    fn add(&mut self, row: usize, column: usize, value: f64) {
        self.rows.push(row);
        self.columns.push(column);
        self.values.push(value);
    }

    fn matrix(self, rows: usize, columns: usize) -> CscMatrix<f64> {
        CscMatrix::new_from_triplets(rows, columns, self.rows, self.columns, self.values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn on_slope(assembly: Assembly) -> Reference {
        Reference {
            assembly,
            plane: Plane::rising(10.0_f64.to_radians()),
            coefficient: 0.4,
            gravity_m_s2: Vector3::z() * -9.81,
            step_s: 5e-3,
        }
    }

    /// Tests that a particle loses the speed g (μ cos α − sin α) per second, then stands still.
    #[test]
    fn a_particle_slides_and_stops() {
        let mut assembly = Assembly::default();
        assembly.add_particle(0.2, Vector3::zeros());
        let mut reference = on_slope(assembly);
        let down = -reference.axes()[1].normalize();
        let down = down * -down.z.signum();
        reference.assembly.motions[0].velocity = down * 0.1;
        let (sine, cosine) = 10.0_f64.to_radians().sin_cos();
        let slower_m_s2 = 9.81 * (0.4 * cosine - sine);
        for step in 1..=20 {
            let report = reference.step().unwrap();
            assert!(report.converged(), "{report:?}");
            let expected = (0.1 - slower_m_s2 * 5e-3 * f64::from(step)).max(0.0);
            let velocity = reference.assembly.motions[0].velocity;
            assert!((velocity - down * expected).norm() < 1e-8, "{step}: {velocity:?}");
        }
    }

    /// Tests the impulses of a soft cell that lands tilted. They are within their cones, on the cone and against the motion of
    /// slipping particles, and zero without contact.
    #[test]
    fn impulses_obey_coulombs_law() {
        use rollwalk_physics::soft::{Material, Mesh, SoftBody};
        let mesh = Mesh::block(Vector3::new(0.0, 0.0, 1e-3), Vector3::repeat(0.02), [1; 3]);
        let mut assembly = Assembly::default();
        let soft =
            SoftBody::add(&mut assembly, &mesh, &Material::elastic(150.0, 2e3, 0.1)).unwrap();
        soft.launch(&mut assembly, Vector3::new(0.3, 0.2, -0.1), Vector3::z() * 2.0);
        let mut reference = on_slope(assembly);
        let normal = reference.plane.normal;
        let mut slipped = 0;
        for _ in 0..60 {
            let report = reference.step().unwrap();
            assert!(report.converged(), "{report:?}");
            for (particle, impulse) in report.impulses {
                let motion = reference.assembly.motions[particle];
                let gap_m = reference.plane.at(&motion.position).gap_m;
                let pushed = normal.dot(&impulse);
                assert!(
                    gap_m > -1e-9 && pushed > -1e-12 && pushed * gap_m < 1e-12,
                    "{gap_m} {pushed}"
                );
                let across = impulse - normal * pushed;
                let slip = motion.velocity - normal * normal.dot(&motion.velocity);
                assert!(across.norm() <= 0.4 * pushed + 1e-10, "{across:?} {pushed}");
                // A step may have errors of 5e-11 N·s and 1e-8 m/s.
                if pushed > 1e-6 && slip.norm() > 1e-3 {
                    slipped += 1;
                    let law = -slip.normalize() * (0.4 * pushed);
                    assert!((across - law).norm() < 1e-4 * pushed, "{across:?} {law:?}");
                }
            }
        }
        assert!(slipped > 20, "{slipped}");
    }
}
