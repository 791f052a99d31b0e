//! Comparison of a force's derivatives with central differences, used in the tests of all forces.

use crate::force::{Derivative, Force, View, Wrench};
use crate::motion::{BodyMotion, Scheme, Weights};
use crate::motor::Law;
use crate::rotation::Increment;
use fastrand::Rng;
use nalgebra::{Matrix6, Vector3, Vector6};

/// Law of a motor away from its limit, with all terms.
pub const LAW: Law = Law {
    kp_nm_rad: 5.0,
    kd_nm_s_rad: 0.3,
    position_rad: 0.2,
    speed_rad_s: -0.4,
    torque_nm: 0.7,
    limit_nm: 1e3,
    line: None,
};

fn random(rng: &mut Rng, size: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| size * (2.0 * rng.f64() - 1.0))
}

/// Random motions of bodies near the origin.
fn motions(rng: &mut Rng, count: usize) -> Vec<BodyMotion> {
    let one = |_| BodyMotion {
        position: random(rng, 0.2),
        rotation: Increment::new(random(rng, 0.5)).rotation(),
        velocity: random(rng, 1.0),
        spin: random(rng, 2.0),
    };
    (0..count).map(one).collect()
}

/// Motion changed by `by` along one of its twelve directions.
fn moved(motion: &BodyMotion, direction: usize, by: f64) -> BodyMotion {
    let mut motion = *motion;
    let mut along = Vector3::zeros();
    along[direction % 3] = by;
    match direction / 3 {
        0 => motion.position += along,
        1 => motion.rotation = Increment::new(along).rotation() * motion.rotation,
        2 => motion.velocity += along,
        _ => motion.spin += along,
    }
    motion
}

/// Panics if a derivative of a force differs from central differences at random motions.
pub fn agrees_with_finite_differences(force: &dyn Force) {
    agrees_at(force, 20, |_| {});
}

/// Checks like [`agrees_with_finite_differences`] at `count` random motions, which `prepare` may change.
pub fn agrees_at(force: &dyn Force, count: u64, prepare: impl Fn(&mut [BodyMotion])) {
    let bodies = force.bodies().len();
    let step = 1e-6;
    for seed in 0..count {
        let mut rng = Rng::with_seed(seed);
        let [mut now, last, before] = [0; 3].map(|_| motions(&mut rng, bodies));
        prepare(&mut now);
        let weights = Weights::new(Scheme::Bdf2, 0.01);
        let wrenches = |[now, last, before]: &[Vec<BodyMotion>; 3]| {
            let mut wrenches = vec![Wrench::default(); bodies];
            let view = View { now, last, before, weights: &weights, tame: false, held: None };
            force.wrenches(&view, &mut wrenches);
            wrenches
        };
        let mut found = vec![Derivative::default(); bodies * bodies];
        let mut again = vec![Wrench::default(); bodies];
        let view = View {
            now: &now,
            last: &last,
            before: &before,
            weights: &weights,
            tame: false,
            held: None,
        };
        force.derivatives(&view, &mut again, &mut found);
        let scale = 1.0 + again.iter().map(|w| w.stacked().norm()).fold(0.0, f64::max);
        let times = [now.clone(), last.clone(), before.clone()];
        for (one, other) in wrenches(&times).iter().zip(&again) {
            assert!((one.stacked() - other.stacked()).norm() < 1e-12 * scale, "{force:?}");
        }
        let [mut by_last, mut by_before] = [0; 2].map(|_| vec![Derivative::default(); found.len()]);
        force.history(&view, &mut by_last, &mut by_before);
        for (time, found) in [found, by_last, by_before].iter().enumerate() {
            for (j, direction) in (0..bodies).flat_map(|j| (0..12).map(move |k| (j, k))) {
                let at = |by: f64| {
                    let mut times = [now.clone(), last.clone(), before.clone()];
                    times[time][j] = moved(&times[time][j], direction, by);
                    wrenches(&times)
                };
                let (ahead, behind) = (at(step), at(-step));
                for i in 0..bodies {
                    let rate: Vector6<f64> =
                        (ahead[i].stacked() - behind[i].stacked()) / (2.0 * step);
                    let derivative = &found[i * bodies + j];
                    let matrix: &Matrix6<f64> =
                        if direction < 6 { &derivative.by_pose } else { &derivative.by_rate };
                    let error = (rate - matrix.column(direction % 6)).norm();
                    let bound = 1e-6 * (scale + matrix.norm());
                    assert!(
                        error < bound,
                        "{force:?}: body {i} by direction {direction} of body {j}, {time} steps ago: \
                         {error} > {bound}"
                    );
                }
            }
        }
    }
}
