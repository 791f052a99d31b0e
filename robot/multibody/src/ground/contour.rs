//! Heights along one direction of the x-y plane, smoothed for one purpose: under a body, under swings, under wheels.
//!
//! A profile has walls, where it has no height and no slope. Its contours are cubic splines through dense samples of a filtered
//! profile, so that equations over them have two continuous derivatives.

use super::gaussian::{CUT_OFF, blurred};
use super::spline::Lattice;
use super::{Elevation, Profile};
use nalgebra::{Matrix2, Vector2};

/// Slope from which a part of a profile counts as an edge, and not as a ramp, in [`Filter::Highest`].
const STEEP: f64 = 0.5;
/// Number of samples per standard deviation of the final smoothing.
const SAMPLES_PER_DEVIATION: f64 = 5.0;

/// Heights along x, the same for all y; level beyond both ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    lattice: Lattice<1>,
}

/// Filter of heights before the Gaussian.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Filter {
    /// Identity.
    Plain,
    /// Maximum of the edges over the distance to both sides, m. Ramps are kept, because swings come down to them.
    Highest(f64),
    /// Closing by a disc of the given radius, m: the surface that a rolling disc can touch. Concave corners get the disc's
    /// radius, convex edges stay.
    Rolled(f64),
}

impl Contour {
    /// Filters a profile, and smooths it by a Gaussian with the given standard deviation, m.
    pub fn of(profile: &Profile, filter: Filter, deviation_m: f64) -> Self {
        let reach_m = match filter {
            Filter::Plain => 0.0,
            Filter::Highest(reach_m) | Filter::Rolled(reach_m) => reach_m,
        };
        let spacing_m = deviation_m / SAMPLES_PER_DEVIATION;
        let [first_m, last_m] = profile.extent_m();
        let beyond_m = 2.0 * reach_m + (CUT_OFF + 1.0) * deviation_m;
        let count = ((last_m - first_m + 2.0 * beyond_m) / spacing_m).ceil() as usize + 4;
        let origin_m = first_m - beyond_m;
        let sampled = |profile: &Profile| -> Vec<f64> {
            (0..count).map(|k| profile.height_m(origin_m + spacing_m * k as f64)).collect()
        };
        let plain = sampled(profile);
        let filtered = match filter {
            Filter::Plain => plain,
            Filter::Highest(reach_m) => {
                let ramps = sampled(&profile.ramps(STEEP));
                let edges: Vec<f64> = plain.iter().zip(&ramps).map(|(z, ramp)| z - ramp).collect();
                let highest = extremes(&edges, spacing_m, reach_m, |_| 0.0, 1.0);
                highest.iter().zip(&ramps).map(|(edges, ramp)| edges + ramp).collect()
            }
            Filter::Rolled(radius_m) => {
                let cap = |x: f64| (radius_m * radius_m - x * x).max(0.0).sqrt();
                let centers = extremes(&plain, spacing_m, radius_m, cap, 1.0);
                extremes(&centers, spacing_m, radius_m, cap, -1.0)
            }
        };
        let smooth = blurred(&filtered, deviation_m / spacing_m);
        let lattice = Lattice::new([origin_m], spacing_m, [count], smooth);
        Self { lattice: lattice.expect("finite heights, more than three") }
    }

    /// Height at a coordinate along x, with its derivatives.
    pub fn elevation(&self, x_m: f64) -> Elevation {
        let [first_m, last_m] = self.lattice.range(0);
        let within_m = x_m.clamp(first_m, last_m);
        let basis = [self.lattice.basis(0, within_m)];
        let [height_m, slope, bend] = [0, 1, 2].map(|order| self.lattice.sum(&basis, [order]));
        let inside = f64::from(u8::from(within_m == x_m));
        Elevation {
            height_m,
            slope: Vector2::new(inside * slope, 0.0),
            bend: Matrix2::new(inside * bend, 0.0, 0.0, 0.0),
        }
    }
}

/// Largest (`sign` 1) or smallest (−1) of the heights within a distance. `cap` gives the change of a height by its distance.
fn extremes(
    heights_m: &[f64],
    spacing_m: f64,
    reach_m: f64,
    cap: impl Fn(f64) -> f64,
    sign: f64,
) -> Vec<f64> {
    let reach = (reach_m / spacing_m).round() as usize;
    let caps: Vec<f64> = (0..=reach).map(|k| cap(spacing_m * k as f64)).collect();
    let last = heights_m.len() - 1;
    let at = |i: usize| {
        let near = i.saturating_sub(reach)..=(i + reach).min(last);
        let over = near.map(|k| sign * heights_m[k] + caps[k.abs_diff(i)]);
        sign * over.fold(f64::NEG_INFINITY, f64::max)
    };
    (0..=last).map(at).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_blurred_step_errs_by_the_tails_of_the_gaussian() {
        let step = Profile::step(0.3, 0.1).unwrap();
        let contour = Contour::of(&step, Filter::Plain, 0.01);
        // Error of the step at two and three standard deviations: Φ(−2) = 0.0228, Φ(−3) = 0.00135 of the riser.
        for (deviations, expected) in [(2.0, 0.0228), (3.0, 0.00135)] {
            for (side, level_m) in [(-1.0, 0.0), (1.0, 0.1)] {
                let found = contour.elevation(0.3 + side * deviations * 0.01).height_m;
                // A sample of the step is on one side of the wall: half a sample in place.
                let error = (found - level_m).abs() / 0.1;
                assert!((error - expected).abs() < 0.35 * expected, "{error}, {expected}");
            }
        }
        assert!((contour.elevation(-5.0).height_m).abs() < 1e-12);
        assert!((contour.elevation(5.0).height_m - 0.1).abs() < 1e-12);
    }

    #[test]
    fn contours_have_their_derivatives() {
        let profile = Profile::new(vec![[0.0, 0.0], [0.0, 0.1], [0.3, 0.1], [0.5, -0.1]]).unwrap();
        for filter in [Filter::Plain, Filter::Highest(0.04), Filter::Rolled(0.08)] {
            let contour = Contour::of(&profile, filter, 0.01);
            for k in 0..200 {
                let (x_m, step_m) = (-0.2 + 0.004 * f64::from(k), 1e-6);
                let [behind, here, ahead] =
                    [-step_m, 0.0, step_m].map(|by| contour.elevation(x_m + by));
                let slope = (ahead.height_m - behind.height_m) / (2.0 * step_m);
                let bend = (ahead.slope.x - behind.slope.x) / (2.0 * step_m);
                // The second derivative has kinks at the samples.
                assert!((slope - here.slope.x).abs() < 1e-6, "{filter:?} at {x_m}");
                assert!((bend - here.bend.m11).abs() < 2e-2, "{filter:?} at {x_m}");
            }
        }
    }

    #[test]
    fn a_swing_begins_to_rise_a_reach_before_the_wall() {
        let step = Profile::step(0.0, 0.1).unwrap();
        let contour = Contour::of(&step, Filter::Highest(0.04), 0.005);
        assert!(contour.elevation(-0.04 - 0.02).height_m < 1e-4);
        assert!(contour.elevation(-0.04 + 0.02).height_m > 0.1 - 1e-4);
    }

    #[test]
    fn a_swing_comes_down_to_a_ramp_and_stays_above_the_edge_at_its_end() {
        let profile = Profile::new(vec![[0.0, 0.0], [0.6, 0.1], [0.6, 0.15]]).unwrap();
        let contour = Contour::of(&profile, Filter::Highest(0.06), 0.01);
        // Within the reach of the edge, the ramp is raised by the riser of 50 mm.
        for (x_m, edge_m) in [(0.1, 0.0), (0.3, 0.0), (0.5, 0.0), (0.57, 0.05)] {
            let found_m = contour.elevation(x_m).height_m;
            // Three standard deviations and more from the edges of the envelope: 0.00135 of the riser.
            assert!((found_m - (x_m / 6.0 + edge_m)).abs() < 1e-4, "{x_m}: {found_m}");
        }
        // A steep ramp is an edge.
        let steep = Profile::ramp(0.0, 0.1, 0.1).unwrap();
        let contour = Contour::of(&steep, Filter::Highest(0.06), 0.005);
        assert!((contour.elevation(0.0).height_m - 0.06).abs() < 1e-3);
    }

    #[test]
    fn a_disc_touches_a_kerb_before_it_is_below_the_edge() {
        let (radius_m, kerb_m) = (0.095, 0.4 * 0.095);
        let step = Profile::step(0.0, kerb_m).unwrap();
        let contour = Contour::of(&step, Filter::Rolled(radius_m), 0.001);
        // At first touch the centre is √(2rk − k²) = 76 mm before the edge: floor from there on is out of reach.
        let first_m = -(2.0 * radius_m * kerb_m - kerb_m * kerb_m).sqrt();
        assert!((first_m + 0.076).abs() < 1e-12);
        assert!(contour.elevation(first_m - 0.005).height_m < 1e-5);
        // Between, the arc of the disc that touches floor and edge.
        let arc_m = radius_m - (radius_m.powi(2) - 0.038_f64.powi(2)).sqrt();
        assert!((contour.elevation(first_m + 0.038).height_m - arc_m).abs() < 2e-4);
    }
}
