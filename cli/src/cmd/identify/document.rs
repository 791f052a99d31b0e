//! Identification results as JSON.

use super::outcome::{self, IdentificationOutcome};
use rollwalk_simulate::identify::{
    CombinedQuantity, FittedQuantity, Quality, QuantityVerdict, Signal,
};
use serde::Serialize;

/// Output of `--json`.
#[derive(Serialize)]
pub struct Document<'a> {
    /// Parameters from all runs combined.
    parameters: Vec<CombinedParameter<'a>>,
    /// Runs, each fitted separately.
    runs: Vec<Run<'a>>,
    /// Runs that were not fitted, only predicted.
    others: Vec<PredictedRun<'a>>,
}

#[derive(Serialize)]
struct CombinedParameter<'a> {
    #[serde(flatten)]
    of: Parameter,
    /// Standard deviation of the value between runs, beyond the effect of noise (τ). `None` if fewer than two runs determine
    /// the value; `deviation` then contains no model error.
    between_runs: Option<f64>,
    /// Runs that determine the value.
    runs: Vec<&'a str>,
}

#[derive(Serialize)]
struct Parameter {
    name: String,
    unit: &'static str,
    before: f64,
    fitted: f64,
    /// Standard deviation; null if no run determines the value.
    deviation: Option<f64>,
    verdict: &'static str,
}

#[derive(Serialize)]
struct Run<'a> {
    run: &'a str,
    parameters: Vec<Parameter>,
    correlated: Vec<(&'a str, &'a str, f64)>,
    /// Root mean square errors over the fitted part of the run.
    fitted: Vec<Fit>,
    /// Root mean square errors over the predicted part of the run.
    predicted: Vec<Fit>,
    /// Errors after the first quarter, simulated with the values fitted to this run and with the values fitted to all runs; empty
    /// for a single run.
    compared: Vec<SignalErrors>,
    begin_s: f64,
    predicted_from_s: f64,
    end_s: f64,
    /// Length of the fitted part, s. Shorter than the available part if the simulated robot falls earlier.
    horizon_s: f64,
    rollouts: usize,
}

#[derive(Serialize)]
struct PredictedRun<'a> {
    run: &'a str,
    predicted: Vec<Fit>,
}

/// Root mean square errors of a signal with the original values and with the fitted values; null where the simulated robot falls.
#[derive(Serialize)]
pub struct Fit {
    pub signal: &'static str,
    pub unit: &'static str,
    pub before: Option<f64>,
    pub after: Option<f64>,
}

/// Root mean square errors of a signal: with the original values, with the values fitted to this run alone, and with those fitted
/// to all runs.
#[derive(Serialize)]
pub struct SignalErrors {
    pub signal: &'static str,
    pub unit: &'static str,
    pub before: Option<f64>,
    pub alone: Option<f64>,
    pub together: Option<f64>,
}

impl<'a> Document<'a> {
    /// Converts an outcome to a document.
    pub fn new(of: &'a IdentificationOutcome) -> Self {
        let together = |combined: &'a CombinedQuantity| CombinedParameter {
            of: Parameter::new(&combined.found),
            between_runs: combined.between,
            runs: of.names(combined),
        };
        let others = of.others.iter();
        Self {
            parameters: of.together.combined.iter().map(together).collect(),
            runs: of.fits.iter().map(Run::new).collect(),
            others: others.map(|(run, of)| PredictedRun { run, predicted: fits(of) }).collect(),
        }
    }
}

impl<'a> Run<'a> {
    fn new(of: &'a outcome::Fit) -> Self {
        let found = &of.found;
        let [begin_s, predicted_from_s, end_s] = found.times_s;
        let pairs = found.correlated.iter();
        Self {
            run: &of.run,
            parameters: found.found.iter().map(Parameter::new).collect(),
            correlated: pairs.map(|(one, other, by)| (one.as_str(), other.as_str(), *by)).collect(),
            fitted: fits(&found.fitted),
            predicted: fits(&found.predicted),
            compared: of.compared.as_ref().map(compared).unwrap_or_default(),
            begin_s,
            predicted_from_s,
            end_s,
            horizon_s: found.horizon_s,
            rollouts: found.rollouts,
        }
    }
}

impl Parameter {
    fn new(of: &FittedQuantity) -> Self {
        Self {
            name: of.quantity.name(),
            unit: of.quantity.kind.label().1,
            before: of.before,
            fitted: of.fitted,
            deviation: Some(of.deviation).filter(|deviation| deviation.is_finite()),
            verdict: word(of.verdict),
        }
    }
}

/// Root mean square errors before and after the fit, for each measured signal.
pub fn fits(of: &[Option<Quality>; 2]) -> Vec<Fit> {
    let fit = |row: Row<2>| {
        let Row { signal, unit, rms: [before, after] } = row;
        Fit { signal, unit, before, after }
    };
    rows(of).map(fit).collect()
}

/// Root mean square errors of each measured signal: with the original values, with the values fitted to one run, and with those
/// fitted to all runs.
pub fn compared(of: &[Option<Quality>; 3]) -> Vec<SignalErrors> {
    let compared = |row: Row<3>| {
        let Row { signal, unit, rms: [before, alone, together] } = row;
        SignalErrors { signal, unit, before, alone, together }
    };
    rows(of).map(compared).collect()
}

/// Root mean square errors of a signal, one for each simulation of the run.
struct Row<const N: usize> {
    signal: &'static str,
    unit: &'static str,
    rms: [Option<f64>; N],
}

/// Root mean square errors of each measured signal.
fn rows<const N: usize>(of: &[Option<Quality>; N]) -> impl Iterator<Item = Row<N>> {
    Signal::ALL.into_iter().filter_map(move |signal| {
        let rms = of.each_ref().map(|quality| quality.as_ref()?.of_signal(signal));
        let (label, unit) = signal.label();
        rms.iter().any(Option::is_some).then_some(Row { signal: label, unit, rms })
    })
}

fn word(verdict: QuantityVerdict) -> &'static str {
    match verdict {
        QuantityVerdict::Changed => "changed",
        QuantityVerdict::Agrees => "agrees",
        QuantityVerdict::Silent => "not told",
        QuantityVerdict::Vague => "uncertain",
        QuantityVerdict::Absurd => "absurd",
    }
}
