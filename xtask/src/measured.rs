//! `cargo xtask measured`: writes tables of measurements, one page of `docs/measured/` for each command, with commit, date,
//! processor, compiler and verdict.

use crate::docs::reference;
use crate::measurement::Measurement;
use crate::{fatrop, replay, shell, workspace};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;

/// Folder of the pages, relative to the root.
pub const FOLDER: &str = "docs/measured";
/// Folder of the benchmarks' package, and the name of its program.
const BENCHMARKS: (&str, &str) = ("apps/bench", "rollwalk-bench");

/// Options of `cargo xtask measured`.
#[derive(clap::Args)]
pub struct Options {
    /// Pages to write: the benchmarks of `rollwalk bench`, replay, tracked, retargeted, identified, terrain and fatrop. All by
    /// default.
    #[arg(value_name = "PAGE")]
    pages: Vec<String>,
    /// URDF files of robots that `replay`, `tracked` and `terrain` also import and play.
    #[arg(long, value_name = "ROBOT.urdf")]
    urdf: Vec<PathBuf>,
    /// Print the names of the pages, then exit.
    #[arg(long, exclusive = true)]
    list: bool,
}

/// Page: its name, its title, and the program that measures.
struct Page {
    name: String,
    title: String,
    source: Source,
}

enum Source {
    Benchmark,
    Replay(replay::Table),
    Fatrop,
}

/// Writes pages of [`FOLDER`].
///
/// # Errors
/// Returns an error if a page is unknown, if a program fails, or if a file cannot be written. Earlier pages are then already
/// written.
pub fn write(options: &Options) -> Result<(), String> {
    let program = workspace::optimised_program(BENCHMARKS.0, BENCHMARKS.1)?.path;
    let pages =
        pages(&shell::output(&mut shell::command(&program.to_string_lossy(), &["--help"]))?);
    let names: Vec<_> = pages.iter().map(|page| page.name.as_str()).collect();
    if options.list {
        println!("{}", names.join("\n"));
        return Ok(());
    }
    if let Some(unknown) = options.pages.iter().find(|name| !names.contains(&name.as_str())) {
        return Err(format!("there is no page `{unknown}`; choose from: {}", names.join(", ")));
    }
    let is_chosen = |page: &&Page| options.pages.is_empty() || options.pages.contains(&page.name);
    let folder = shell::workspace_root().join(FOLDER);
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    for page in pages.iter().filter(is_chosen) {
        eprintln!("{}: {}", page.name, page.title);
        let measured = match page.source {
            Source::Benchmark => benchmark(&program, &page.name)?,
            Source::Replay(table) => replay::measure(table, &options.urdf)?,
            Source::Fatrop => fatrop::measure(&program)?,
        };
        let path = folder.join(format!("{}.md", page.name));
        let text = written(page, &measured, &Origin::now()?);
        fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
        eprintln!("{}: {}", path.display(), measured.verdict);
    }
    Ok(())
}

/// Returns all pages: the benchmarks that `help` lists, the replays, and fatrop.
fn pages(help: &str) -> Vec<Page> {
    let benchmarks = reference::descriptions(help).into_iter();
    let benchmarks =
        benchmarks.map(|(name, title)| Page { name, title, source: Source::Benchmark });
    let replays = replay::Table::ALL.into_iter().map(|table| Page {
        name: table.name().into(),
        title: table.title().into(),
        source: Source::Replay(table),
    });
    let fatrop = Page {
        name: "fatrop".into(),
        title: "CPU time of the planner and of fatrop".into(),
        source: Source::Fatrop,
    };
    benchmarks.chain(replays).chain([fatrop]).collect()
}

/// Runs a benchmark. Its page consists of the Markdown that it writes and its charts, which are copied into the same folder.
fn benchmark(program: &Path, name: &str) -> Result<Measurement, String> {
    let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    let out = shell::target_folder().join("measured").join(name);
    if out.exists() {
        fs::remove_dir_all(&out).map_err(|error| failed(&out, error))?;
    }
    fs::create_dir_all(&out).map_err(|error| failed(&out, error))?;
    let mut run = shell::command(&program.to_string_lossy(), &[name, "--out"]);
    let status = run.arg(&out).stdout(Stdio::null()).status();
    let status = status.map_err(|error| failed(program, error))?;
    let verdict = match status.code() {
        Some(0) => "passed",
        Some(3) => "a motion fails in simulation",
        Some(4) => "a limit is exceeded",
        _ => return Err(format!("`rollwalk bench {name}` failed: {status}")),
    };
    let mut text = String::new();
    let mut charts = Vec::new();
    for entry in fs::read_dir(&out).map_err(|error| failed(&out, error))? {
        let path = entry.map_err(|error| failed(&out, error))?.path();
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("md") => text = fs::read_to_string(&path).map_err(|error| failed(&path, error))?,
            Some("svg") => charts.push(path),
            _ => {}
        }
    }
    if text.is_empty() {
        return Err(format!("`rollwalk bench {name}` wrote no Markdown into {}", out.display()));
    }
    charts.sort();
    for chart in &charts {
        let file = chart.file_name().unwrap_or_default();
        let copy = shell::workspace_root().join(FOLDER).join(file);
        fs::copy(chart, &copy).map_err(|error| failed(&copy, error))?;
        let file = file.to_string_lossy();
        let _ = write!(text, "\n![{}]({file})\n", file.trim_end_matches(".svg"));
    }
    Ok(Measurement { text, command: format!("rollwalk bench {name}"), verdict: verdict.into() })
}

/// Commit, date, processor and compiler of a measurement.
struct Origin {
    commit: String,
    date: String,
    processor: String,
    compiler: String,
}

impl Origin {
    /// Returns the origin of this run.
    fn now() -> Result<Self, String> {
        let of = |program: &str, args: &[&str]| {
            shell::output(&mut shell::command(program, args)).map(|text| text.trim().to_owned())
        };
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let cpus = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
        Ok(Self {
            commit: of("git", &["describe", "--always", "--dirty", "--exclude=*"])?,
            date: of("date", &["--utc", "+%Y-%m-%d"])?,
            processor: format!("{} ({cores} cores)", processor(&cpus).unwrap_or("unknown")),
            compiler: of("rustc", &["--version"])?,
        })
    }
}

/// Returns the model of the first processor in `/proc/cpuinfo`.
fn processor(cpus: &str) -> Option<&str> {
    let line = cpus.lines().find(|line| line.starts_with("model name"))?;
    line.split_once(':').map(|(_, name)| name.trim())
}

fn written(page: &Page, measured: &Measurement, origin: &Origin) -> String {
    let mut text = format!("# {}\n\n", page.title);
    let _ = writeln!(text, "`cargo xtask measured {}` writes this page.\n", page.name);
    text.push_str(
        "| commit | date | processor | compiler | command | verdict |\n|---|---|---|---|---|---|\n",
    );
    let Origin { commit, date, processor, compiler } = origin;
    let Measurement { command, verdict, .. } = measured;
    let _ = writeln!(
        text,
        "| {commit} | {date} | {processor} | {compiler} | `{command}` | {verdict} |\n"
    );
    text + measured.text.trim() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_are_the_benchmarks_and_the_replays() {
        let help = "Usage: x\n\nCommands:\n  table-2-1  Table 2.1: its motions\n             twice\n  samples    CPU time\n  \
                    help       Print this message\n\nOptions:\n";
        let pages = pages(help);
        let names: Vec<_> = pages.iter().map(|page| page.name.as_str()).collect();
        assert_eq!(
            names,
            [
                "table-2-1",
                "samples",
                "replay",
                "tracked",
                "retargeted",
                "identified",
                "terrain",
                "fatrop"
            ]
        );
        assert_eq!(pages[0].title, "Table 2.1: its motions twice");
    }

    #[test]
    fn a_page_has_its_origin_and_its_verdict() {
        let origin = Origin {
            commit: "1234567".into(),
            date: "2026-01-02".into(),
            processor: processor("processor : 0\nmodel name\t: Chip 3\n").expect("a model").into(),
            compiler: "rustc 1".into(),
        };
        let page =
            Page { name: "samples".into(), title: "CPU time".into(), source: Source::Benchmark };
        let measured = Measurement {
            text: "a table\n\n".into(),
            command: "rollwalk bench samples".into(),
            verdict: "passed".into(),
        };
        assert_eq!(
            written(&page, &measured, &origin),
            "# CPU time\n\n`cargo xtask measured samples` writes this page.\n\n\
             | commit | date | processor | compiler | command | verdict |\n|---|---|---|---|---|---|\n\
             | 1234567 | 2026-01-02 | Chip 3 | rustc 1 | `rollwalk bench samples` | passed |\n\na table\n"
        );
    }
}
