//! Combination of fits to several runs of one robot.
//!
//! If contacts of the real robot slip differently from the simulated ones, a run shifts its parameters by more than their
//! standard deviations. All parts of the run shift alike, so no estimate from this run shows the error. Other motions slip
//! differently, and their disagreement measures the error (`effects`).
//!
//! Means are taken over search parameters, which are logarithms except for delays. A standard deviation is then relative to the
//! value: of two runs with equal relative uncertainty, the one with the smaller value does not get more weight. Correlations
//! between quantities of a run are ignored.

use super::effects::{self, SourceEstimate};
use super::outcome::{FitResult, FittedQuantity, QuantityVerdict};
use super::quantity::{Quantity, SimulationModel};
use rollwalk_robot::Robot;

/// Combined result of several runs.
#[derive(Clone, Debug, PartialEq)]
pub struct CombinedFit {
    /// Model with all adopted quantities.
    pub model: SimulationModel,
    /// Combined quantities.
    pub combined: Vec<CombinedQuantity>,
}

/// Quantity from several runs.
#[derive(Clone, Debug, PartialEq)]
pub struct CombinedQuantity {
    /// Value, standard deviation and verdict. If only one run determines the quantity, they are copied from that run.
    pub found: FittedQuantity,
    /// Standard deviation of the differences between runs that the deviations of the single runs do not explain. The deviation
    /// of [`found`](Self::found) includes it.
    ///
    /// `None` if fewer than two runs determine the quantity. The deviation then does not include the error of the model.
    pub between: Option<f64>,
    /// Indices of the runs that determine the quantity.
    pub runs: Vec<usize>,
}

/// Combines fits of the same quantities of a robot to different runs.
pub fn combine_fits(robot: &Robot, quantities: &[Quantity], fits: &[FitResult]) -> CombinedFit {
    let file = SimulationModel::new(robot);
    let all: Vec<&[FittedQuantity]> = fits.iter().map(|fit| &fit.found[..]).collect();
    let combined: Vec<CombinedQuantity> =
        quantities.iter().map(|quantity| combine(quantity, quantity.value(&file), &all)).collect();
    let mut model = file;
    for CombinedQuantity { found, .. } in combined.iter().filter(|of| of.found.is_adopted()) {
        found.quantity.set(&mut model, found.fitted);
    }
    CombinedFit { model, combined }
}

/// Combines the fits of one quantity, whose value in the file is `before`.
fn combine(quantity: &Quantity, before: f64, fits: &[&[FittedQuantity]]) -> CombinedQuantity {
    let of_run = |(run, found): (usize, &&[FittedQuantity])| {
        found.iter().find(|of| of.quantity == *quantity).cloned().map(|of| (run, of))
    };
    let found: Vec<(usize, FittedQuantity)> = fits.iter().enumerate().filter_map(of_run).collect();
    let telling: Vec<&(usize, FittedQuantity)> =
        found.iter().filter(|(_, of)| of.is_counted()).collect();
    let runs: Vec<usize> = telling.iter().map(|(run, _)| *run).collect();
    if let [(_, only)] = telling[..] {
        return CombinedQuantity { found: only.clone(), between: None, runs };
    }
    let report = |(_, of): &&(usize, FittedQuantity)| SourceEstimate {
        value: quantity.to_parameter(before, of.fitted),
        deviation: of.deviation / quantity.by_parameter(of.fitted),
    };
    let reports: Vec<SourceEstimate> = telling.iter().map(report).collect();
    let Some(mean) = effects::mean(&reports) else {
        // The reason why one run does not determine a quantity is more useful than the statement that none does.
        let absurd = found.iter().find(|(_, of)| of.verdict == QuantityVerdict::Absurd);
        let found =
            absurd.or(found.first()).map_or_else(|| silent(quantity, before), |(_, of)| of.clone());
        return CombinedQuantity { found, between: None, runs };
    };
    let fitted = quantity.of_parameter(before, mean.value);
    let by = quantity.by_parameter(fitted);
    let deviation = mean.deviation * by;
    let verdict = QuantityVerdict::of(quantity, before, fitted, deviation);
    let found = FittedQuantity { quantity: quantity.clone(), before, fitted, deviation, verdict };
    CombinedQuantity { found, between: Some(mean.between * by), runs }
}

/// Result for a quantity that no run contains.
fn silent(quantity: &Quantity, before: f64) -> FittedQuantity {
    let (quantity, deviation) = (quantity.clone(), f64::INFINITY);
    FittedQuantity { quantity, before, fitted: before, deviation, verdict: QuantityVerdict::Silent }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::identify::Kind;

    fn quantity(kind: Kind) -> Quantity {
        Quantity { kind, group: None }
    }

    /// Result of a run whose standard deviation is given relative to the value, or in s for a delay.
    fn run_result(kind: Kind, before: f64, fitted: f64, share: f64) -> FittedQuantity {
        let quantity = quantity(kind);
        let deviation = share * if kind == Kind::Delay { 1.0 } else { fitted };
        let verdict = QuantityVerdict::of(&quantity, before, fitted, deviation);
        FittedQuantity { quantity, before, fitted, deviation, verdict }
    }

    fn friction(fitted: f64, share: f64) -> [FittedQuantity; 1] {
        [run_result(Kind::Friction, 0.8, fitted, share)]
    }

    fn combined(kind: Kind, before: f64, runs: &[[FittedQuantity; 1]]) -> CombinedQuantity {
        let runs: Vec<&[FittedQuantity]> = runs.iter().map(|found| &found[..]).collect();
        combine(&quantity(kind), before, &runs)
    }

    fn near(found: f64, expected: f64) {
        assert!((found - expected).abs() < 1e-12 * expected.abs().max(1.0), "{found}, {expected}");
    }

    #[test]
    fn runs_that_disagree_have_their_geometric_mean_and_their_spread() {
        // Logarithms differ by 2 d, so that their variance is 2 d².
        let (d, own) = (0.2_f64, 0.05);
        let of = |by: f64| friction(0.3 * by.exp(), own);
        let all = combined(Kind::Friction, 0.8, &[of(d), of(-d)]);
        near(all.found.fitted, 0.3);
        let variance = 2.0 * d * d - own * own;
        near(all.between.unwrap(), 0.3 * variance.sqrt());
        near(all.found.deviation, 0.3 * ((variance + own * own) / 2.0 + variance).sqrt());
        assert_eq!(all.runs, [0, 1]);
        // More than a quarter of the value.
        assert_eq!(all.found.verdict, QuantityVerdict::Vague);
    }

    #[test]
    fn delays_are_no_logarithms() {
        let of = |delay_s| [run_result(Kind::Delay, 0.0, delay_s, 1e-4)];
        let all = combined(Kind::Delay, 0.0, &[of(-4e-3), of(2e-3)]);
        near(all.found.fitted, -1e-3);
        near(all.between.unwrap(), (18e-6_f64 - 1e-8).sqrt());
    }

    #[test]
    fn runs_that_agree_are_surer_than_each() {
        let all = combined(Kind::Friction, 0.8, &[friction(0.3, 0.02), friction(0.3, 0.02)]);
        near(all.found.fitted, 0.3);
        near(all.found.deviation, 0.3 * 0.02 / 2.0_f64.sqrt());
        assert_eq!((all.between, all.found.verdict), (Some(0.0), QuantityVerdict::Changed));
    }

    #[test]
    fn a_run_that_cannot_tell_does_not_count() {
        let [known, other] = [friction(0.3, 0.02), friction(0.32, 0.02)];
        let silent = friction(0.5, f64::INFINITY);
        // So far off that the search has diverged.
        let absurd = friction(0.8 * 4.0_f64.exp(), 1e-6);
        let both = combined(Kind::Friction, 0.8, &[known.clone(), other.clone()]);
        let more = [silent.clone(), known.clone(), absurd.clone(), other];
        let all = combined(Kind::Friction, 0.8, &more);
        assert_eq!(all.found, both.found);
        assert_eq!((all.between, all.runs), (both.between, vec![1, 3]));
        // A single run that determines the quantity decides alone, without a spread between runs.
        let one = combined(Kind::Friction, 0.8, &[silent.clone(), known.clone()]);
        assert_eq!(one, CombinedQuantity { found: known[0].clone(), between: None, runs: vec![1] });
        // If no run determines the quantity, the file's value stays, and the verdict gives the reason.
        let none = combined(Kind::Friction, 0.8, &[silent.clone(), absurd]);
        assert_eq!((none.found.verdict, none.runs), (QuantityVerdict::Absurd, Vec::new()));
        let none = combined(Kind::Friction, 0.8, &[silent.clone(), silent]);
        assert_eq!((none.found.verdict, none.between), (QuantityVerdict::Silent, None));
        assert_eq!(combined(Kind::Delay, 0.0, &[known]).found.verdict, QuantityVerdict::Silent);
    }

    #[test]
    fn the_spread_decides_whether_a_number_changed() {
        let sure = friction(0.7, 0.01);
        assert_eq!(sure[0].verdict, QuantityVerdict::Changed);
        let all = combined(
            Kind::Friction,
            0.8,
            &[sure.clone(), friction(0.9, 0.01), friction(0.78, 0.01)],
        );
        assert_eq!(all.found.verdict, QuantityVerdict::Agrees, "{all:?}");
        let alone = combined(Kind::Friction, 0.8, std::slice::from_ref(&sure));
        assert_eq!(alone.found, sure[0]);
    }

    #[test]
    fn the_model_has_what_changed_and_what_is_fitted_along() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shipped/robots/agilebot.toml");
        let robot = Robot::from_toml("agilebot", &std::fs::read_to_string(path).unwrap()).unwrap();
        let file = SimulationModel::new(&robot);
        let stiffness = quantity(Kind::Stiffness).value(&file);
        let fit = |friction: f64| FitResult {
            model: file.clone(),
            found: vec![
                run_result(Kind::Friction, 0.8, friction, 0.01),
                // Uncertain, and fitted as auxiliary quantity.
                run_result(Kind::Stiffness, stiffness, 2.0 * stiffness, 0.5),
            ],
            correlated: Vec::new(),
            fitted: [None, None],
            predicted: [None, None],
            times_s: [0.0; 3],
            horizon_s: 0.0,
            rollouts: 0,
        };
        let quantities = [Kind::Friction, Kind::Stiffness].map(quantity);
        let all = combine_fits(&robot, &quantities, &[fit(0.3), fit(0.3)]);
        near(all.model.robot.end_effectors[0].friction_coefficient, 0.3);
        near(all.model.parameters.normal.stiffness_n_m / stiffness, 2.0);
        let all = combine_fits(&robot, &quantities, &[fit(0.8), fit(0.8)]);
        near(all.model.robot.end_effectors[0].friction_coefficient, 0.8);
        // Without any fit, the model is the file.
        assert_eq!(combine_fits(&robot, &quantities, &[]).model, file);
    }
}
