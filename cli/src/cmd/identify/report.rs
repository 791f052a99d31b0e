//! What was found, as tables and as JSON.

use super::source::rounded;
use crate::output::Table;
use rollwalk_simulate::identify::{Found, Identified, Quality, Signal, Verdict};
use serde::Serialize;
use std::fmt::Write;

/// Another run, simulated with the numbers of the file and with those found; `None` if the robot falls.
pub struct Prediction {
    /// Its file.
    pub run: String,
    /// Before and after.
    pub of: [Option<Quality>; 2],
}

/// Output of `--json`.
#[derive(Serialize)]
pub struct Document<'a> {
    run: &'a str,
    parameters: Vec<Parameter>,
    correlated: Vec<(&'a str, &'a str, f64)>,
    /// Root mean squares over the part of the run that was fitted, and over the part that was predicted.
    fitted: Vec<Fit>,
    predicted: Vec<Fit>,
    /// Other runs.
    others: Vec<Other<'a>>,
    begin_s: f64,
    predicted_from_s: f64,
    end_s: f64,
    /// Length of the fitted part, s. It ends before the predicted part begins if the simulated robot falls earlier.
    horizon_s: f64,
    rollouts: usize,
}

#[derive(Serialize)]
struct Other<'a> {
    run: &'a str,
    predicted: Vec<Fit>,
}

#[derive(Serialize)]
struct Parameter {
    name: String,
    unit: &'static str,
    before: f64,
    fitted: f64,
    /// None if the run does not tell.
    deviation: Option<f64>,
    verdict: &'static str,
}

/// None where the simulated robot falls.
#[derive(Serialize)]
struct Fit {
    signal: &'static str,
    unit: &'static str,
    before: Option<f64>,
    after: Option<f64>,
}

impl<'a> Document<'a> {
    /// Of a run.
    pub fn new(run: &'a str, found: &'a Identified, others: &'a [Prediction]) -> Self {
        let other = |of: &'a Prediction| Other { run: &of.run, predicted: fits(&of.of) };
        let parameter = |of: &Found| Parameter {
            name: of.quantity.name(),
            unit: of.quantity.kind.label().1,
            before: of.before,
            fitted: of.fitted,
            deviation: Some(of.deviation).filter(|deviation| deviation.is_finite()),
            verdict: word(of.verdict),
        };
        let [begin_s, predicted_from_s, end_s] = found.times_s;
        let pairs = found.correlated.iter();
        Self {
            run,
            parameters: found.found.iter().map(parameter).collect(),
            correlated: pairs.map(|(one, other, by)| (one.as_str(), other.as_str(), *by)).collect(),
            fitted: fits(&found.fitted),
            predicted: fits(&found.predicted),
            others: others.iter().map(other).collect(),
            begin_s,
            predicted_from_s,
            end_s,
            horizon_s: found.horizon_s,
            rollouts: found.rollouts,
        }
    }
}

fn fits(of: &[Option<Quality>; 2]) -> Vec<Fit> {
    let rms = |quality: &Option<Quality>, signal| {
        quality.as_ref().and_then(|quality| quality.of_signal(signal))
    };
    let fit = |signal: Signal| {
        let [before, after] = of.each_ref().map(|quality| rms(quality, signal));
        let (label, unit) = signal.label();
        (before.is_some() || after.is_some()).then_some(Fit { signal: label, unit, before, after })
    };
    Signal::ALL.into_iter().filter_map(fit).collect()
}

fn word(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Changed => "changed",
        Verdict::Agrees => "agrees",
        Verdict::Silent => "not told",
        Verdict::Vague => "uncertain",
        Verdict::Absurd => "absurd",
    }
}

/// What to make of a number, for people.
fn sentence(of: &Found) -> String {
    let is_along = of.quantity.kind.is_along();
    match of.verdict {
        Verdict::Silent => format!("not told: {}", of.quantity.kind.silence()),
        Verdict::Changed if is_along => "found; robot files do not have it".to_owned(),
        Verdict::Agrees if is_along => "as simulated elsewhere".to_owned(),
        Verdict::Vague | Verdict::Absurd if is_along => {
            "uncertain, and left free for the sake of the others".to_owned()
        }
        Verdict::Changed => "changed".to_owned(),
        Verdict::Agrees => "agrees with the file, which stays as it is".to_owned(),
        Verdict::Vague => "too uncertain: the file stays as it is".to_owned(),
        Verdict::Absurd => "makes no sense: something else is different, too".to_owned(),
    }
}

/// As text.
pub fn describe(run: &str, found: &Identified, others: &[Prediction]) -> String {
    let [begin_s, from_s, end_s] = found.times_s;
    let mut text = format!(
        "{run}: fitted from {begin_s:.2} to {:.2} s, predicted from {from_s:.2} to {end_s:.2} s, {} rollouts\n\n",
        begin_s + found.horizon_s,
        found.rollouts
    );
    let mut table = Table::new(["parameter", "before", "fitted", "±", "unit", "verdict"]);
    for of in &found.found {
        let known = of.deviation.is_finite();
        let cell = |value: f64| {
            if known { rounded(value, of.deviation).to_string() } else { "–".to_owned() }
        };
        table.row([
            of.quantity.name(),
            rounded(of.before, 0.0).to_string(),
            cell(of.fitted),
            cell(of.deviation),
            of.quantity.kind.label().1.to_owned(),
            sentence(of),
        ]);
    }
    let _ = writeln!(text, "{}\n", table.render());
    for (one, other, by) in &found.correlated {
        let _ = writeln!(
            text,
            "{one} and {other} are hardly told apart (correlation {by:.2}): this run knows a combination of them\n"
        );
    }
    let mut table = Table::new([
        "root mean square",
        "fitted before",
        "after",
        "predicted before",
        "after",
        "unit",
    ]);
    let (fitted, predicted) = (fits(&found.fitted), fits(&found.predicted));
    let cell = |rms: Option<f64>| rms.map_or("falls".to_owned(), |rms| format!("{rms:.5}"));
    for fit in &fitted {
        let other = predicted.iter().find(|of| of.signal == fit.signal);
        table.row([
            fit.signal.to_owned(),
            cell(fit.before),
            cell(fit.after),
            cell(other.and_then(|of| of.before)),
            cell(other.and_then(|of| of.after)),
            fit.unit.to_owned(),
        ]);
    }
    let _ = write!(text, "{}", table.render());
    for Prediction { run, of } in others {
        let mut table = Table::new([&format!("predicted: {run}"), "before", "after", "unit"]);
        for fit in fits(of) {
            table.row(
                [fit.signal, &cell(fit.before), &cell(fit.after), fit.unit].map(str::to_owned),
            );
        }
        let _ = write!(text, "\n\n{}", table.render());
    }
    let is_worse = |fit: &Fit| match (fit.before, fit.after) {
        (Some(before), Some(after)) => after > 1.1 * before,
        (Some(_), None) => true,
        _ => false,
    };
    if let Some(worse) = predicted.iter().find(|fit| is_worse(fit)) {
        let _ = write!(
            text,
            "\n\n{} of the end of the run, which took no part in the fit, are predicted worse than before: do not trust these numbers further than this run",
            worse.signal
        );
    }
    text
}
