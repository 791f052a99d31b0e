//! Recorded runs of a command line, cut to `--from` and `--to`, with short names for the report.

use super::recorded;
use miette::miette;
use rollwalk_robot::Robot;
use rollwalk_simulate::identify::{Recording, RequestedSpan};
use std::path::{Path, PathBuf};

pub struct Run {
    /// Path of the recording.
    pub path: PathBuf,
    /// File name, preceded by as many folders as distinguish it from the other runs. Robot files contain this name and are copied
    /// to other computers.
    pub name: String,
    pub recording: Recording,
}

/// Reads the runs that are fitted together. `from_s` and `to_s` have no element, one for all runs, or one for each run.
///
/// # Errors
/// Returns an error if a file cannot be read or lacks data, if a run is given twice, or if the number of times does not match
/// the number of runs.
pub fn read(
    paths: &[PathBuf],
    robot: &Robot,
    from_s: &[f64],
    to_s: &[f64],
) -> miette::Result<Vec<Run>> {
    let wanted_s = requested_spans(paths.len(), from_s, to_s)?;
    let mut runs: Vec<Run> = Vec::new();
    for ((path, name), wanted_s) in paths.iter().zip(names(paths)).zip(wanted_s) {
        let recording = recorded::read(path, robot, wanted_s)?;
        if let Some(same) = runs.iter().find(|run| is_same(run, path, &recording)) {
            return Err(miette!(
                help = "leave out one of them, because counting a run twice makes the deviations \
                    too small",
                "{} and {} are the same run",
                same.path.display(),
                path.display()
            ));
        }
        runs.push(Run { path: path.clone(), name, recording });
    }
    Ok(runs)
}

/// Reads runs that are only predicted, without cutting them.
///
/// # Errors
/// Returns an error if a file cannot be read or lacks data.
pub fn read_others(paths: &[PathBuf], robot: &Robot) -> miette::Result<Vec<Run>> {
    let read = |(path, name): (&PathBuf, String)| {
        let recording = recorded::read(path, robot, [None; 2])?;
        Ok(Run { path: path.clone(), name, recording })
    };
    paths.iter().zip(names(paths)).map(read).collect()
}

/// True if both are the same file, or have the same measurements.
fn is_same(run: &Run, path: &Path, recording: &Recording) -> bool {
    let is_file = same_file::is_same_file(&run.path, path).unwrap_or(false);
    is_file || run.recording == *recording
}

/// Times from `--from` and `--to` for each run.
fn requested_spans(
    runs: usize,
    from_s: &[f64],
    to_s: &[f64],
) -> miette::Result<Vec<RequestedSpan>> {
    let each = |option: &str, times_s: &[f64]| match times_s {
        [] => Ok(vec![None; runs]),
        [of_all] => Ok(vec![Some(*of_all); runs]),
        of_each if of_each.len() == runs => Ok(of_each.iter().copied().map(Some).collect()),
        _ => Err(miette!(
            help = format!(
                "give {option} once for all runs, or once for each run in the order of the runs"
            ),
            "{option} is given {} times for {}",
            times_s.len(),
            if runs == 1 { "1 run".to_owned() } else { format!("{runs} runs") }
        )),
    };
    Ok(each("--from", from_s)?.into_iter().zip(each("--to", to_s)?).map(<[_; 2]>::from).collect())
}

/// Distinct names of files: their file names, preceded by as many folders as are needed to distinguish them.
fn names(paths: &[PathBuf]) -> Vec<String> {
    let name = |path: &PathBuf, parts: usize| {
        let all: Vec<_> = path.components().collect();
        let last: PathBuf = all[all.len().saturating_sub(parts)..].iter().collect();
        last.to_string_lossy().into_owned()
    };
    let most = paths.iter().map(|path| path.components().count()).max().unwrap_or(1);
    let with = |parts| -> Vec<String> { paths.iter().map(|path| name(path, parts)).collect() };
    let differ = |names: &Vec<String>| (1..names.len()).all(|k| !names[..k].contains(&names[k]));
    (1..most).map(with).find(differ).unwrap_or_else(|| with(most))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(of: &[&str]) -> Vec<PathBuf> {
        of.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn names_are_as_short_as_they_differ() {
        assert_eq!(names(&paths(&["/logs/monday/walk.csv"])), ["walk.csv"]);
        assert_eq!(names(&paths(&["a/walk.csv", "b/slalom.csv"])), ["walk.csv", "slalom.csv"]);
        assert_eq!(names(&paths(&["a/walk.csv", "b/walk.csv"])), ["a/walk.csv", "b/walk.csv"]);
        assert_eq!(names(&paths(&["x/a/walk.csv", "walk.csv"])), ["a/walk.csv", "walk.csv"]);
        assert_eq!(names(&paths(&["a.csv", "a.csv"])), ["a.csv", "a.csv"]);
    }

    #[test]
    fn times_are_of_all_runs_or_of_each() {
        assert_eq!(requested_spans(2, &[], &[]).unwrap(), [[None; 2]; 2]);
        assert_eq!(requested_spans(2, &[0.3], &[]).unwrap(), [[Some(0.3), None]; 2]);
        let each = requested_spans(2, &[0.3, 1.0], &[8.0]).unwrap();
        assert_eq!(each, [[Some(0.3), Some(8.0)], [Some(1.0), Some(8.0)]]);
        let error = requested_spans(3, &[], &[0.3, 1.0]).unwrap_err();
        assert_eq!(error.to_string(), "--to is given 2 times for 3 runs");
        assert!(error.help().unwrap().to_string().contains("once for each run"));
    }
}
