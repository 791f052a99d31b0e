//! Report of the identification as text.

use super::document::{compared, fits};
use super::outcome::{Fit, IdentificationOutcome};
use super::source::rounded;
use rollwalk_simulate::identify::{CombinedQuantity, FittedQuantity, Quality, QuantityVerdict};
use rollwalk_terminal::output::Table;

/// Note below the values of a single run.
const ONE_RUN: &str = "\
These deviations do not contain errors of the model that persist through the run, such as errors in the slip of contacts, so the true errors can be
many times larger. To estimate these errors, record two or more other motions, and give all runs to one `rollwalk identify`.";
/// Note below the values of two runs.
const TWO_RUNS: &str = "Two runs are too few to estimate the deviation between runs, so these \
deviations are rough: record another motion.";

/// Note below the values of several runs.
const SEVERAL_RUNS: &str = "These deviations contain the differences between the runs, but not \
errors of the model that are the same in all runs.";

pub fn describe(outcome: &IdentificationOutcome) -> String {
    let mut parts: Vec<String> = Vec::new();
    let heads = outcome.fits.iter().map(head).collect::<Vec<_>>();
    parts.push(heads.join("\n"));
    parts.push(parameters(outcome));
    match &outcome.fits[..] {
        [only] => {
            parts.push(ONE_RUN.to_owned());
            parts.extend(correlations(only));
            parts.push(residuals(only));
        }
        fits => {
            parts.push(SEVERAL_RUNS.to_owned());
            if fits.len() == 2 {
                parts.push(TWO_RUNS.to_owned());
            }
            parts.push(each_alone(outcome));
            parts.extend(fits.iter().flat_map(gaps));
            parts.extend(fits.iter().flat_map(correlations));
            parts.extend(fits.iter().filter_map(comparison));
        }
    }
    parts.extend(outcome.others.iter().map(|(run, of)| prediction(run, of)));
    parts.extend(outcome.fits.iter().filter_map(warning));
    parts.join("\n\n")
}

fn head(of: &Fit) -> String {
    let [begin_s, from_s, end_s] = of.found.times_s;
    format!(
        "{}: fitted from {begin_s:.2} to {:.2} s, predicted from {from_s:.2} to {end_s:.2} s, {} rollouts",
        of.run,
        begin_s + of.found.horizon_s,
        of.found.rollouts
    )
}

/// Table of the values for the robot file, with their standard deviation between runs.
fn parameters(outcome: &IdentificationOutcome) -> String {
    let is_one = outcome.fits.len() == 1;
    let mut titles = vec!["parameter", "before", "fitted", "±", "between runs", "unit", "verdict"];
    if is_one {
        titles.remove(4);
    }
    let mut rows = vec![titles.into_iter().map(str::to_owned).collect::<Vec<_>>()];
    for combined in &outcome.together.combined {
        let of = &combined.found;
        let mut row = vec![
            of.quantity.name(),
            rounded(of.before, 0.0).to_string(),
            significant(of, of.fitted),
            significant(of, of.deviation),
        ];
        if !is_one {
            let between = combined.between;
            row.push(between.map_or("–".to_owned(), |between| significant(of, between)));
        }
        row.push(of.quantity.kind.label().1.to_owned());
        row.push(sentence(combined, outcome));
        rows.push(row);
    }
    Table::from(rows).render()
}

/// Formats a value with the digits that are significant at its deviation.
fn significant(of: &FittedQuantity, value: f64) -> String {
    if of.deviation.is_finite() {
        rounded(value, of.deviation).to_string()
    } else {
        "–".to_owned()
    }
}

/// Verdict on a parameter as a phrase.
fn sentence(combined: &CombinedQuantity, outcome: &IdentificationOutcome) -> String {
    let of = &combined.found;
    let is_along = of.quantity.kind.is_along();
    let verdict = match of.verdict {
        QuantityVerdict::Silent => format!("not determined: {}", of.quantity.kind.silence()),
        QuantityVerdict::Changed if is_along => {
            "fitted; robot files do not contain this parameter".to_owned()
        }
        QuantityVerdict::Agrees if is_along => {
            "within the usual range of simulated robots".to_owned()
        }
        QuantityVerdict::Vague | QuantityVerdict::Absurd if is_along => {
            "uncertain; fitted only because it affects other parameters".to_owned()
        }
        QuantityVerdict::Changed => "changed".to_owned(),
        QuantityVerdict::Agrees => "agrees with the file, which is unchanged".to_owned(),
        QuantityVerdict::Vague => "too uncertain: the file is unchanged".to_owned(),
        QuantityVerdict::Absurd => {
            "implausible: a property that was not fitted probably differs".to_owned()
        }
    };
    match outcome.names(combined)[..] {
        [only] if outcome.fits.len() > 1 => {
            format!(
                "{verdict}; determined by {only} alone, so errors of the model are not included"
            )
        }
        _ => verdict,
    }
}

/// Table with a column for each run.
fn each_alone(outcome: &IdentificationOutcome) -> String {
    let runs = outcome.fits.iter().map(|of| of.run.clone());
    let mut rows = vec![["each run alone".to_owned()].into_iter().chain(runs).collect::<Vec<_>>()];
    for combined in &outcome.together.combined {
        let quantity = &combined.found.quantity;
        let cell = |fit: &Fit| match fitted_quantity(fit, combined) {
            Some(of) if of.deviation.is_finite() => {
                format!("{} ± {}", significant(of, of.fitted), significant(of, of.deviation))
            }
            _ => "–".to_owned(),
        };
        let cells = outcome.fits.iter().map(cell);
        rows.push([quantity.name()].into_iter().chain(cells).collect());
    }
    Table::from(rows).render()
}

fn fitted_quantity<'f>(fit: &'f Fit, combined: &CombinedQuantity) -> Option<&'f FittedQuantity> {
    fit.found.found.iter().find(|of| of.quantity == combined.found.quantity)
}

/// Notes on parameters that a run does not determine, if there are several runs.
fn gaps(fit: &Fit) -> impl Iterator<Item = String> {
    let run = &fit.run;
    fit.found.found.iter().filter_map(move |of| {
        let name = of.quantity.name();
        match of.verdict {
            QuantityVerdict::Silent => {
                Some(format!("{run} does not determine {name}: {}", of.quantity.kind.silence()))
            }
            QuantityVerdict::Absurd => Some(format!(
                "{run} is ignored for {name}: the search ended at the implausible value {}",
                rounded(of.fitted, 0.0)
            )),
            QuantityVerdict::Vague => Some(format!(
                "{run} hardly determines {name}: the standard deviation is large, so this run has a low weight"
            )),
            QuantityVerdict::Changed | QuantityVerdict::Agrees => None,
        }
    })
}

fn correlations(fit: &Fit) -> impl Iterator<Item = String> {
    fit.found.correlated.iter().map(move |(one, other, by)| {
        format!(
            "{one} and {other} are hardly distinguishable (correlation {by:.2}): {} determines a \
             combination of both",
            fit.run
        )
    })
}

/// Root mean square errors before and after the fit, over the fitted and over the predicted part of a run.
fn residuals(fit: &Fit) -> String {
    let titles =
        ["root mean square", "fitted before", "after", "predicted before", "after", "unit"];
    let mut table = Table::new(titles);
    let predicted = fits(&fit.found.predicted);
    for fit in fits(&fit.found.fitted) {
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
    table.render()
}

/// Table of one of several runs: root mean square errors with the original values, with the values fitted to the run, and with
/// the values fitted to all runs.
fn comparison(fit: &Fit) -> Option<String> {
    let title = format!("{} after its first quarter", fit.run);
    let mut table = Table::new([&title, "before", "alone", "together", "unit"]);
    for of in compared(fit.compared.as_ref()?) {
        let [before, alone, together] = [of.before, of.alone, of.together].map(cell);
        table.row([of.signal.to_owned(), before, alone, together, of.unit.to_owned()]);
    }
    Some(table.render())
}

fn prediction(run: &str, of: &[Option<Quality>; 2]) -> String {
    let mut table = Table::new([&format!("predicted: {run}"), "before", "after", "unit"]);
    for fit in fits(of) {
        table.row([fit.signal, &cell(fit.before), &cell(fit.after), fit.unit].map(str::to_owned));
    }
    table.render()
}

fn cell(rms: Option<f64>) -> String {
    rms.map_or("falls".to_owned(), |rms| format!("{rms:.5}"))
}

/// Warning if the fitted values predict a signal worse than the original ones.
fn warning(fit: &Fit) -> Option<String> {
    let is_worse = |before: Option<f64>, after: Option<f64>| match (before, after) {
        (Some(before), Some(after)) => after > 1.1 * before,
        (Some(_), None) => true,
        _ => false,
    };
    let run = &fit.run;
    match &fit.compared {
        None => fits(&fit.found.predicted).into_iter().find(|of| is_worse(of.before, of.after)).map(|of| {
            format!(
                "the fitted values predict {} worse than the robot file does, at the end of the \
                 run, which was not fitted: use these values for this run only",
                of.signal
            )
        }),
        Some(all) => compared(all).into_iter().find(|of| is_worse(of.before, of.together)).map(|of| {
            format!(
                "the values fitted to all runs predict {} of {run} worse than the robot file does: \
                 the runs are inconsistent, so fit each run alone",
                of.signal
            )
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::super::document::Document;
    use super::*;
    use rollwalk_robot::Robot;
    use rollwalk_simulate::identify::{
        FitResult, Kind, Quantity, Signal, SimulationModel, combine_fits,
    };
    use serde_json::{Value, json};

    const FRICTION: Quantity = Quantity { kind: Kind::Friction, group: None };
    const DELAY: Quantity = Quantity { kind: Kind::Delay, group: None };

    /// Outcome of runs with a friction and its deviation, for a robot with an original friction of 0.8. Only the last run
    /// determines the delay.
    fn outcome(runs: &[(&str, f64, f64)]) -> IdentificationOutcome {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/agilebot.toml");
        let robot = Robot::from_toml("agilebot", &std::fs::read_to_string(path).unwrap()).unwrap();
        let quality = |rms| Some(Quality { rms: vec![(Signal::Position, rms)] });
        let found = |(number, &(_, fitted, deviation)): (usize, &(&str, f64, f64))| {
            let told = deviation.is_finite();
            let verdict = if told { QuantityVerdict::Changed } else { QuantityVerdict::Silent };
            let friction =
                FittedQuantity { quantity: FRICTION, before: 0.8, fitted, deviation, verdict };
            let (deviation, verdict) = match number + 1 == runs.len() {
                true => (1e-4, QuantityVerdict::Changed),
                false => (f64::INFINITY, QuantityVerdict::Silent),
            };
            let delay =
                FittedQuantity { quantity: DELAY, before: 0.0, fitted: 4e-3, deviation, verdict };
            FitResult {
                model: SimulationModel::new(&robot),
                found: vec![friction, delay],
                correlated: vec![("friction".into(), "delay".into(), 0.97)],
                fitted: [quality(0.004), quality(0.002)],
                predicted: [quality(0.005), None],
                times_s: [0.3, 3.0, 4.0],
                horizon_s: 2.7,
                rollouts: 321,
            }
        };
        let found: Vec<FitResult> = runs.iter().enumerate().map(found).collect();
        let together = combine_fits(&robot, &[FRICTION, DELAY], &found);
        let compared = (runs.len() > 1).then(|| [quality(0.004), quality(0.002), quality(0.003)]);
        let fits = runs.iter().zip(found).map(|((run, ..), found)| Fit {
            run: (*run).to_owned(),
            found,
            compared: compared.clone(),
        });
        IdentificationOutcome {
            fits: fits.collect(),
            together,
            others: vec![("trot.csv".into(), [None, None])],
        }
    }

    fn json_of(outcome: &IdentificationOutcome) -> Value {
        serde_json::to_value(Document::new(outcome)).unwrap()
    }

    #[test]
    fn a_single_run_does_not_hide_that_errors_of_the_model_are_missing() {
        let one = outcome(&[("walk.csv", 0.3, 0.01)]);
        let text = describe(&one);
        assert!(text.contains("do not contain errors of the model"), "{text}");
        assert!(text.contains("record two or more other motions"), "{text}");
        assert!(!text.contains("between runs") && !text.contains("alone"), "{text}");
        assert!(text.contains("worse than the robot file does"), "{text}");
        let found = json_of(&one);
        let expected = json!({
            "name": "friction", "unit": "", "before": 0.8, "fitted": 0.3, "deviation": 0.01,
            "verdict": "changed", "between_runs": null, "runs": ["walk.csv"],
        });
        assert_eq!(found["parameters"][0], expected);
        assert_eq!(found["runs"][0]["compared"], json!([]));
    }

    #[test]
    fn several_runs_have_their_spread_and_what_each_cannot_tell() {
        let none = f64::INFINITY;
        let of = [("slalom.csv", 0.3, 0.01), ("turn.csv", 0.8, none), ("walk.csv", 0.34, 0.01)];
        let three = outcome(&of);
        let text = describe(&three);
        assert!(!text.contains("do not contain errors of the model"), "{text}");
        assert!(text.contains("not errors of the model that are the same in all runs"), "{text}");
        assert!(text.contains("turn.csv does not determine friction: nothing slips"), "{text}");
        assert!(
            text.contains("determined by walk.csv alone, so errors of the model are not included"),
            "{text}"
        );
        assert!(text.contains("0.3 ± 0.01") && text.contains("0.34 ± 0.01"), "{text}");
        assert!(text.contains("(correlation 0.97): walk.csv determines a combination"), "{text}");
        assert!(text.contains("turn.csv after its first quarter"), "{text}");
        let found = json_of(&three);
        let [friction, delay] = [0, 1].map(|number| &found["parameters"][number]);
        assert_eq!(friction["runs"], json!(["slalom.csv", "walk.csv"]));
        let between = friction["between_runs"].as_f64().unwrap();
        // Two logarithms differ by d, and each has a standard deviation s: τ² = d²/2 − s².
        let (d, s) = ((0.34_f64 / 0.3).ln(), [0.01 / 0.3, 0.01 / 0.34]);
        assert!((between / 0.3193 - (0.5 * d * d - s[0] * s[1]).sqrt()).abs() < 1e-3, "{friction}");
        assert!(friction["deviation"].as_f64().unwrap() > between);
        assert_eq!((&delay["runs"], &delay["between_runs"]), (&json!(["walk.csv"]), &Value::Null));
        // An unknown value has no deviation.
        assert_eq!(found["runs"][1]["parameters"][0]["deviation"], Value::Null);
        assert_eq!(found["runs"][1]["parameters"][0]["verdict"], "not told");
        let place = json!({
            "signal": Signal::Position.label().0, "unit": "m", "before": 0.004, "alone": 0.002,
            "together": 0.003,
        });
        assert_eq!(found["runs"][2]["compared"], json!([place]));
    }

    #[test]
    fn two_runs_are_few() {
        let two = describe(&outcome(&[("a.csv", 0.3, 0.01), ("b.csv", 0.34, 0.01)]));
        assert!(
            two.contains("Two runs are too few to estimate the deviation between runs"),
            "{two}"
        );
    }

    #[test]
    fn numbers_that_simulate_a_run_worse_than_the_file_are_a_warning() {
        let mut two = outcome(&[("a.csv", 0.3, 0.01), ("b.csv", 0.34, 0.01)]);
        assert!(!describe(&two).contains("the runs are inconsistent"));
        // The robot falls with the fitted parameters.
        two.fits[1].compared.as_mut().unwrap()[2] = None;
        let text = describe(&two);
        assert!(text.contains("of b.csv worse than the robot file does"), "{text}");
        assert!(text.contains("falls"), "{text}");
    }
}
