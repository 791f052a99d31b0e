//! Linear map of small errors over one cycle of a rigid body on springs, and its largest growth.
//!
//! The errors are x = (δc, δθ, δċ, δω, a): position and rotation of the body, their rates, and the horizontal error a of every
//! contact point. A foot lands where the body's error carries it and stays there; a wheel rolls along its heading. Let r be the
//! arm from the centre of mass and f the planned force. Legs yield by u = a − δc − δθ × r, and
//!
//! ```text
//! δf = K u + D u̇ + δθ × f        u̇ = ȧ − δċ − δω × r − δθ × ṙ
//! m δc̈ = Σ δf        I δω̇ = Σ r × δf + (a − δc) × f        ȧ = δθ_z ẑ × v − (mobility) t tᵀ δf
//! ```

use nalgebra::{DMatrix, DMatrixView, Dyn, LU, Matrix3, Vector3};
use rollwalk_multibody::rotation::{skew, yaw_rotation};

/// State at one time of a cycle, in the world frame.
pub struct Instant {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Centre of mass, m.
    pub com: Vector3<f64>,
    /// Velocity of the centre of mass, m/s.
    pub com_velocity: Vector3<f64>,
    /// Inertia about the centre of mass, kg·m².
    pub inertia_kg_m2: Matrix3<f64>,
    /// Stiffness K of all stance contacts: force per deflection, three rows each, N/m.
    pub stiffness_n_m: DMatrix<f64>,
    /// Ratio of damping D to stiffness K, s.
    pub damping_s: f64,
    /// Contacts of all end effectors.
    pub contacts: Vec<ContactLoad>,
}

/// Contact of an end effector in an [`Instant`].
pub struct ContactLoad {
    /// Contact point, m.
    pub position: Vector3<f64>,
    /// Planned force, N; `None` in swing.
    pub force_n: Option<Vector3<f64>>,
    /// Rolling; `None` for a contact that does not roll.
    pub roll: Option<Roll>,
}

/// Rolling of a contact.
pub struct Roll {
    /// Unit vector of the rolling direction along the ground.
    pub along: Vector3<f64>,
    /// Planned velocity v of the contact point, m/s.
    pub velocity: Vector3<f64>,
    /// Speed per force along the rolling direction, m/s/N.
    pub mobility_m_ns: f64,
}

/// Number of errors of the body.
const BODY: usize = 12;
/// Number of neutral errors, which do not affect the motion: shifts along x and y, turns about z.
const NEUTRAL: usize = 3;
/// Coefficient γ = 1 − 1/√2 of the two-stage diagonally implicit Runge-Kutta rule of second order. The rule damps modes that
/// are too fast for its steps.
const GAMMA: f64 = 1.0 - std::f64::consts::FRAC_1_SQRT_2;

/// Largest multiplier of a cycle with equal steps, which turns the robot by `yaw_rad`. `None` if a step has no solution.
pub fn growth(instants: &[Instant], step_s: f64, yaw_rad: f64) -> Option<f64> {
    let (first, last) = (instants.first()?, instants.last()?);
    let size = BODY + 2 * first.contacts.len();
    let mut map = DMatrix::identity(size, size);
    let mut before = last;
    for instant in instants {
        land(instant, before, &mut map);
        map = step(&rates(instant, size)?, step_s, map)?;
        before = instant;
    }
    let back = yaw_rotation(-yaw_rad);
    let mut turned = DMatrix::identity(size, size);
    for k in (0..BODY).step_by(3) {
        turned.fixed_view_mut::<3, 3>(k, k).copy_from(&back);
    }
    for k in (BODY..size).step_by(2) {
        turned.fixed_view_mut::<2, 2>(k, k).copy_from(&back.fixed_view::<2, 2>(0, 0));
    }
    largest(&(turned * map), &neutral(first, size))
}

/// Largest modulus of the map's eigenvalues on the complement of the neutral errors.
fn largest(map: &DMatrix<f64>, neutral: &DMatrix<f64>) -> Option<f64> {
    // The left singular vectors of the neutral errors, filled up to a basis.
    let size = map.nrows();
    let filled =
        DMatrix::from_fn(size, size, |r, c| if c < NEUTRAL { neutral[(r, c)] } else { 0.0 });
    let basis = filled.svd(true, false).u?;
    let noticed: DMatrixView<f64> = basis.columns(NEUTRAL, size - NEUTRAL);
    let rest = noticed.transpose() * map * noticed;
    let moduli = rest.complex_eigenvalues().iter().map(|value| value.norm()).collect::<Vec<_>>();
    moduli.into_iter().reduce(f64::max)
}

/// Neutral errors: shifts along x and y, and a turn about the vertical through the world's origin.
fn neutral(at: &Instant, size: usize) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(size, NEUTRAL);
    let up = Vector3::z();
    for (k, shift) in [Vector3::x(), Vector3::y()].iter().enumerate() {
        out.fixed_view_mut::<3, 1>(0, k).copy_from(shift);
        for (j, _) in at.contacts.iter().enumerate() {
            out.fixed_view_mut::<2, 1>(BODY + 2 * j, k).copy_from(&shift.xy());
        }
    }
    out.fixed_view_mut::<3, 1>(0, 2).copy_from(&up.cross(&at.com));
    out.fixed_view_mut::<3, 1>(3, 2).copy_from(&up);
    out.fixed_view_mut::<3, 1>(6, 2).copy_from(&up.cross(&at.com_velocity));
    for (j, contact) in at.contacts.iter().enumerate() {
        let turned = up.cross(&contact.position);
        out.fixed_view_mut::<2, 1>(BODY + 2 * j, 2).copy_from(&turned.xy());
    }
    out
}

/// Sets the error of each landing contact to the error of the body at its position.
fn land(now: &Instant, before: &Instant, map: &mut DMatrix<f64>) {
    for (j, (contact, was)) in now.contacts.iter().zip(&before.contacts).enumerate() {
        if contact.force_n.is_some() && was.force_n.is_none() {
            let carried = body_to_point(&(contact.position - now.com)) * map.rows(0, 6);
            map.rows_mut(BODY + 2 * j, 2).copy_from(&carried.rows(0, 2));
        }
    }
}

/// Jacobian of the motion δc + δθ × r of a point of the body.
fn body_to_point(arm: &Vector3<f64>) -> nalgebra::Matrix3x6<f64> {
    let mut out = nalgebra::Matrix3x6::zeros();
    out.fixed_view_mut::<3, 3>(0, 0).copy_from(&Matrix3::identity());
    out.fixed_view_mut::<3, 3>(0, 3).copy_from(&-skew(arm));
    out
}

/// Matrix A of ẋ = A x.
fn rates(at: &Instant, size: usize) -> Option<DMatrix<f64>> {
    let standing: Vec<(usize, Vector3<f64>, &ContactLoad, Vector3<f64>)> = at
        .contacts
        .iter()
        .enumerate()
        .filter_map(|(j, contact)| Some((j, contact.position - at.com, contact, contact.force_n?)))
        .collect();
    let rows = 3 * standing.len();
    // Rows of u, of its rate except for rolling under a force, of δθ × f, and of that rolling per force.
    let (mut yields, mut d_yields) = (DMatrix::zeros(rows, size), DMatrix::zeros(rows, size));
    let (mut turned, mut rolls) = (DMatrix::zeros(rows, size), DMatrix::zeros(rows, rows));
    for (row, (j, arm, contact, force_n)) in standing.iter().enumerate() {
        let row = 3 * row;
        let point = body_to_point(arm);
        yields.fixed_view_mut::<3, 6>(row, 0).copy_from(&-point);
        yields.fixed_view_mut::<2, 2>(row, BODY + 2 * j).fill_with_identity();
        d_yields.fixed_view_mut::<3, 6>(row, 6).copy_from(&-point);
        // The arm changes, because the contact stands or rolls on while the body moves.
        let velocity = contact.roll.as_ref().map_or_else(Vector3::zeros, |roll| roll.velocity);
        d_yields.fixed_view_mut::<3, 3>(row, 3).copy_from(&skew(&(velocity - at.com_velocity)));
        turned.fixed_view_mut::<3, 3>(row, 3).copy_from(&-skew(force_n));
        if let Some(roll) = &contact.roll {
            let mut heading = d_yields.fixed_view_mut::<3, 1>(row, 5);
            heading += Vector3::z().cross(&roll.velocity);
            let along = roll.along * roll.along.transpose() * roll.mobility_m_ns;
            rolls.fixed_view_mut::<3, 3>(row, row).copy_from(&along);
        }
    }
    let damping = &at.stiffness_n_m * at.damping_s;
    let force = &at.stiffness_n_m * yields + &damping * d_yields + turned;
    // `try_inverse` instead of `solve`, which panics without rows, as in flight.
    let force = (DMatrix::identity(rows, rows) + damping * rolls).try_inverse()? * force;

    let mut out = DMatrix::zeros(size, size);
    out.view_mut((0, 6), (6, 6)).fill_with_identity();
    let per_inertia = at.inertia_kg_m2.try_inverse()?;
    for (row, (j, arm, contact, force_n)) in standing.iter().enumerate() {
        let force = force.rows(3 * row, 3);
        let mut linear = out.rows_mut(6, 3);
        linear += force / at.mass_kg;
        let mut moment = skew(arm) * force;
        let lever = skew(force_n);
        let mut of_com = moment.columns_mut(0, 3);
        of_com += lever;
        let mut of_point = moment.columns_mut(BODY + 2 * j, 2);
        of_point -= lever.fixed_columns::<2>(0);
        let mut angular = out.rows_mut(9, 3);
        angular += per_inertia * moment;
        if let Some(roll) = &contact.roll {
            let speed = roll.along.transpose() * force * -roll.mobility_m_ns;
            let mut point = out.rows_mut(BODY + 2 * j, 2);
            point += roll.along.xy() * speed;
            let mut heading = point.column_mut(5);
            heading += Vector3::z().cross(&roll.velocity).xy();
        }
    }
    Some(out)
}

/// Advances all columns of `map` by a step of ẋ = A x: (1 − γ h A)⁻² (1 + (1 − 2γ) h A).
fn step(rates: &DMatrix<f64>, step_s: f64, map: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let identity = DMatrix::identity(rates.nrows(), rates.ncols());
    let implicit: LU<f64, Dyn, Dyn> = (&identity - rates * (GAMMA * step_s)).lu();
    let explicit = identity + rates * ((1.0 - 2.0 * GAMMA) * step_s);
    implicit.solve(&implicit.solve(&(explicit * map))?)
}

#[cfg(test)]
mod tests {
    use super::*;

    const MASS_KG: f64 = 3.0;
    const HEIGHT_M: f64 = 0.3;
    const GRAVITY_M_S2: f64 = 9.8;

    /// Body above contacts that share its weight, with stiff legs and moment of inertia m (0.1 m)² about all axes.
    fn standing(contacts: &[(f64, f64)], stiffness_n_m: f64) -> Instant {
        let share = Vector3::z() * (MASS_KG * GRAVITY_M_S2 / contacts.len() as f64);
        Instant {
            mass_kg: MASS_KG,
            com: Vector3::new(0.0, 0.0, HEIGHT_M),
            com_velocity: Vector3::zeros(),
            inertia_kg_m2: Matrix3::identity() * MASS_KG * 0.01,
            stiffness_n_m: DMatrix::identity(3 * contacts.len(), 3 * contacts.len())
                * stiffness_n_m,
            damping_s: 0.05,
            contacts: contacts
                .iter()
                .map(|&(x, y)| ContactLoad {
                    position: Vector3::new(x, y, 0.0),
                    force_n: Some(share),
                    roll: None,
                })
                .collect(),
        }
    }

    /// Growth during `duration_s`.
    fn growth_of(instant: impl Fn() -> Instant, duration_s: f64) -> f64 {
        let instants: Vec<_> = (0..400).map(|_| instant()).collect();
        growth(&instants, duration_s / 400.0, 0.0).expect("a map")
    }

    const FOUR: [(f64, f64); 4] = [(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)];

    #[test]
    fn a_body_on_two_stiff_legs_falls_over_their_line_as_a_pendulum() {
        let grown = growth_of(|| standing(&[(0.2, 0.0), (-0.2, 0.0)], 1e6), 0.5);
        let about_line = MASS_KG * (0.01 + HEIGHT_M * HEIGHT_M);
        let rate = (MASS_KG * GRAVITY_M_S2 * HEIGHT_M / about_line).sqrt();
        let expected = (rate * 0.5).exp();
        assert!((grown / expected - 1.0).abs() < 1e-3, "{grown}, {expected} expected");
    }

    #[test]
    fn a_body_on_four_legs_stands_unless_they_are_too_soft() {
        // Points that never leave the ground keep their errors.
        let stiff = growth_of(|| standing(&FOUR, 3e3), 1.0);
        assert!((stiff - 1.0).abs() < 1e-6, "{stiff}");
        // About x, four springs at 0.1 m resist with 4 K (0.1 m)² per radian, and the weight tips with m g h.
        let tips = || standing(&FOUR, 0.9 * MASS_KG * GRAVITY_M_S2 * HEIGHT_M / (4.0 * 0.01));
        let soft = growth_of(tips, 1.0);
        assert!(soft > 1.05, "{soft}");
    }

    #[test]
    fn stepping_in_place_forgets_errors_of_the_feet() {
        // All feet are lifted for an instant and put down again. The legs have not damped the remaining error.
        let instants: Vec<_> = (0..400)
            .map(|k| {
                let mut instant = standing(&FOUR, 3e3);
                if k == 0 {
                    instant.contacts.iter_mut().for_each(|contact| contact.force_n = None);
                    instant.stiffness_n_m = DMatrix::zeros(0, 0);
                }
                instant
            })
            .collect();
        let left = growth(&instants, 1.0 / 400.0, 0.0).expect("a map");
        assert!(left < 0.1, "{left}");
    }

    fn size_of(instant: &Instant) -> usize {
        BODY + 2 * instant.contacts.len()
    }

    #[test]
    fn shifts_and_turns_are_not_noticed() {
        let speed = Vector3::x() * 0.7;
        let at = |time_s: f64| {
            let mut instant = standing(&FOUR, 3e3);
            instant.com += speed * time_s;
            instant.com_velocity = speed;
            for contact in &mut instant.contacts {
                contact.position += speed * time_s;
                let along = Vector3::x();
                contact.roll = Some(Roll { along, velocity: speed, mobility_m_ns: 0.1 });
            }
            neutral(&instant, size_of(&instant))
        };
        let mut instant = standing(&FOUR, 3e3);
        instant.com_velocity = speed;
        for contact in &mut instant.contacts {
            contact.roll = Some(Roll { along: Vector3::x(), velocity: speed, mobility_m_ns: 0.1 });
        }
        let rates = rates(&instant, size_of(&instant)).expect("rates");
        let difference = rates * at(0.0) - (at(1.0) - at(0.0));
        assert!(difference.amax() < 1e-9, "{difference}");
    }
}
