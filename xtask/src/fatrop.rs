//! Comparison of the planner's CPU time with that of fatrop, a solver of optimal control problems (Vanroye et al. 2023), on one
//! machine in one run: fatrop before and after Table 2.1.

use crate::measurement::Measurement;
use crate::python::Environment;
use crate::shell;
use serde_json::Value;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Package with fatrop.
const CASADI: &str = "casadi==3.8.2";
/// Number of starts of each motion of Table 2.1.
const SEEDS: &str = "3";

/// Measures both. `benchmarks` is the program of the benchmarks.
///
/// # Errors
/// Returns an error if a program fails, or if a solver fails to solve its problem.
pub fn measure(benchmarks: &Path) -> Result<Measurement, String> {
    let python = Environment::kept("fatrop", &[CASADI])?;
    let trot = || {
        let mut script = Command::new(python.program());
        shell::output(script.arg("tests/peers/fatrop_trot.py"))
    };
    let before = trot()?;
    let planner = table(benchmarks)?;
    let after = trot()?;
    let mut text = String::from(
        "Each row has the median CPU time per second of motion. The planner optimises joints, wheels, footholds, forces and \
         torques of whole robots; the row gives the median of the motions of Table 2.1. fatrop optimises the trunk, the \
         footholds and the forces of a trot, and was measured before and after the planner.\n\n\
         | solver | problem | iterations | ms/s |\n|---|---|---|---|\n",
    );
    for (what, [iterations, ms]) in [("from scratch", planner[0]), ("planned again", planner[1])] {
        let _ = writeln!(text, "| Rollwalk | Table 2.1, {what} | {iterations:.0} | {ms:.1} |");
    }
    for line in before.lines().chain(after.lines()) {
        let words: Vec<_> = line.split_whitespace().collect();
        let [intervals, iterations, ms] = words[..] else {
            return Err(format!("fatrop_trot.py printed {line:?}"));
        };
        let _ = writeln!(text, "| fatrop | trot, {intervals} intervals | {iterations} | {ms} |");
    }
    let command = "cargo xtask measured fatrop".into();
    Ok(Measurement { text, command, verdict: "compared".into() })
}

/// Medians over the rows of Table 2.1, from scratch and planned again: iterations, and CPU time per second of motion, ms.
fn table(benchmarks: &Path) -> Result<[[f64; 2]; 2], String> {
    let out = shell::target_folder().join("measured/fatrop");
    let mut run = shell::command(&benchmarks.to_string_lossy(), &["table-2-1", "--seeds", SEEDS]);
    shell::run(run.arg("--out").arg(&out).stdout(Stdio::null()))?;
    let path = out.join("table-2-1.json");
    let text = fs::read_to_string(&path).map_err(|error| format!("{}: {error}", path.display()))?;
    let table: Value =
        serde_json::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
    medians(&table).ok_or_else(|| format!("{}: rows lack a number", path.display()))
}

fn medians(table: &Value) -> Option<[[f64; 2]; 2]> {
    let rows = table.as_array()?;
    let of = |name: &str, per_second: bool| -> Option<f64> {
        let value = |row: &Value| {
            let value = row[name].as_f64()?;
            Some(if per_second { 1e3 * value / row["horizon_s"].as_f64()? } else { value })
        };
        let mut values = rows.iter().map(value).collect::<Option<Vec<_>>>()?;
        values.sort_by(f64::total_cmp);
        values.get(values.len() / 2).copied()
    };
    Some([
        [of("iterations_median", false)?, of("cold_cpu_s_median", true)?],
        [of("replan_iterations_median", false)?, of("replan_cpu_s_median", true)?],
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn medians_are_those_of_the_rows_per_second_of_motion() {
        let row = |iterations: f64, cold_s: f64| {
            json!({
                "horizon_s": 2.0, "iterations_median": iterations, "cold_cpu_s_median": cold_s,
                "replan_iterations_median": 3, "replan_cpu_s_median": 0.004,
            })
        };
        let table = json!([row(5.0, 0.02), row(1.0, 0.01), row(9.0, 0.08)]);
        assert_eq!(medians(&table), Some([[5.0, 10.0], [3.0, 2.0]]));
        assert_eq!(medians(&json!([{}])), None);
    }
}
