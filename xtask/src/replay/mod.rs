//! Replay of shipped motions, and of motions of imported robots, in MuJoCo by programs that share no code with the planner:
//! `docs/replay.md`.

mod behind_firmware;
mod retargeted;
mod terrain;
mod tracked;
mod urdf;

use crate::extent::Extent;
use crate::measurement::Measurement;
use crate::workspace;
use crate::{mujoco, parallel, shell};
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::Mutex;

/// Beginnings of the names of motions that are not replayed.
const LEFT_OUT: [&str; 3] = ["test_leg_", "pup_belt_", "pup_five_bar_"];
/// Folders of motion files, relative to the root.
const MOTIONS: [&str; 2] = ["shipped/motions", "shipped/motions/table_2_1"];
/// Step rates of our own simulator, Hz.
const GROUND_RATES_HZ: [u32; 2] = [60, 240];
/// Number of periods in the level runs and in our own simulator.
const CYCLES: &str = "20";
/// Number of periods in a disturbed run, whose table lists cycles 2 to 5.
const DISTURBED_CYCLES: &str = "6";

/// Test classes of the harness that take only seconds.
const BRIEF: [&str; 5] = ["Physics", "Playing", "Files", "Libraries", "Words"];

/// Table of measurements in MuJoCo.
#[derive(Clone, Copy)]
pub enum Table {
    /// Shipped motions, with and without feed-forward, level and disturbed, in both simulators, and behind firmware and bus.
    Shipped,
    /// Controllers in closed loop and open loop, in worlds that differ from the plan, and under pushes.
    Tracked,
    /// Motions of robots without planned torques, most with softer servos, with original and retargeted plans.
    Retargeted,
    /// Robots identified from runs in MuJoCo, and predictions of other runs.
    Identified,
    /// Motions on slopes, stairs, kerbs and rough ground and among obstacles, in both simulators.
    Terrain,
}

impl Table {
    /// List of all tables.
    pub const ALL: [Self; 5] =
        [Self::Shipped, Self::Tracked, Self::Retargeted, Self::Identified, Self::Terrain];

    /// Name of the table's page.
    pub fn name(self) -> &'static str {
        match self {
            Self::Shipped => "replay",
            Self::Tracked => "tracked",
            Self::Retargeted => "retargeted",
            Self::Identified => "identified",
            Self::Terrain => "terrain",
        }
    }

    /// Title of the table's page.
    pub fn title(self) -> &'static str {
        match self {
            Self::Shipped => "Shipped motions in MuJoCo",
            Self::Tracked => "Closed loop and open loop in MuJoCo",
            Self::Retargeted => "Retargeted motions in two simulators",
            Self::Identified => "Robots identified from recordings of MuJoCo",
            Self::Terrain => "Motions on terrain in two simulators",
        }
    }
}

/// Tests the harness and the closed-loop controller; the brief form tests only parts of the harness. The full check also plans
/// and replays every shipped motion.
///
/// # Errors
/// Returns an error if a test fails, if a motion has no plan, or if the full check finds a motion that fails. If a program is
/// missing, the error contains the command that installs it.
pub fn check(extent: Extent) -> Result<(), String> {
    let replay = Replay::new()?;
    if extent == Extent::Brief {
        return shell::run(replay.python("test_replay.py").args(BRIEF));
    }
    shell::run(&mut replay.python("test_replay.py"))?;
    tracked::check(&replay)?;
    match extent {
        Extent::Brief | Extent::Short => Ok(()),
        Extent::Full => replay.shipped("all", true).map(drop),
    }
}

/// Measures a table. `urdfs` are additional robots for the tables that import robots.
///
/// # Errors
/// Returns an error if a motion has no plan, or if a program fails. If a program is missing, the error contains the command
/// that installs it.
pub fn measure(table: Table, urdfs: &[PathBuf]) -> Result<Measurement, String> {
    let mut replay = Replay::new()?;
    let results = match table {
        Table::Shipped => {
            let plans = replay.shipped("both", false)?;
            replay.grounded(&plans)?;
            behind_firmware::compare(&replay, &plans)?;
            let results = ["level.json", "disturbed.json", "ground.json", behind_firmware::RESULTS];
            let mut results = results.map(|name| replay.out.join(name)).to_vec();
            for urdf in urdfs {
                results.push(urdf::replayed(&replay, urdf)?);
            }
            results
        }
        Table::Tracked => {
            replay = replay.optimised()?;
            vec![tracked::compare(&replay, urdfs)?]
        }
        Table::Retargeted => {
            retargeted::compare(&replay)?;
            vec![replay.out.join(retargeted::RESULTS)]
        }
        Table::Identified => {
            let folder = replay.out.join("identified");
            let results = folder.join("identified.json");
            let mut identified = replay.python("identified.py");
            identified.arg(&replay.rollwalk).arg("-o").arg(&folder).arg("--json").arg(&results);
            shell::run(&mut identified)?;
            vec![results]
        }
        Table::Terrain => {
            replay = replay.optimised()?;
            vec![terrain::compare(&replay, urdfs)?]
        }
    };
    let page = shell::output(replay.python("document.py").arg(table.name()).args(results))?;
    let (verdict, text) = page.split_once('\n').unwrap_or((&page, ""));
    let command = format!("cargo xtask measured {}", table.name());
    Ok(Measurement { text: text.into(), command, verdict: verdict.into() })
}

/// Programs for replays, and the folder of their results.
struct Replay {
    /// Command line, as built for the tests.
    rollwalk: PathBuf,
    /// `PYTHONPATH` with MuJoCo.
    path: OsString,
    /// Output folder, `replay/` of the target folder.
    out: PathBuf,
}

impl Replay {
    fn new() -> Result<Self, String> {
        let out = shell::target_folder().join("replay");
        fs::create_dir_all(out.join("plans"))
            .map_err(|error| format!("{}: {error}", out.display()))?;
        let built = workspace::programs()?;
        let rollwalk = workspace::find(&built, "tests", "rollwalk-under-test", false)?.path.clone();
        Ok(Self { rollwalk, path: mujoco::path()?, out })
    }

    /// Uses an optimised build of the command line, for programs that call it at every tick.
    fn optimised(self) -> Result<Self, String> {
        let rollwalk = workspace::optimised_program("tests", "rollwalk-under-test")?.path;
        Ok(Self { rollwalk, ..self })
    }

    /// Creates a command of `rollwalk`.
    fn rollwalk(&self, args: &[impl AsRef<OsStr>]) -> Command {
        shell::command(&self.rollwalk.to_string_lossy(), args)
    }

    /// Creates a command for a program of `tests/replay`; an empty name stands for the harness itself.
    fn python(&self, program: &str) -> Command {
        let program = Path::new("tests/replay").join(program);
        let mut python = shell::command("python3", &[program]);
        python.env("PYTHONPATH", &self.path);
        python
    }

    /// Creates a command that replays plans and writes the results into a JSON file of the output folder.
    fn run(&self, options: &[&str], plans: &[PathBuf], json: &str) -> Command {
        let mut replay = self.python("");
        replay.args(options).arg("--json").arg(self.out.join(json)).args(plans);
        replay
    }

    /// Replays all shipped motions and returns their plans. With `must_hold`, a motion that fails is an error.
    fn shipped(&self, feed_forward: &str, must_hold: bool) -> Result<Vec<PathBuf>, String> {
        let failed = |error: std::io::Error| format!("motions: {error}");
        let plans: Vec<PathBuf> = motions()
            .map_err(failed)?
            .iter()
            .map(|motion| self.plan(motion))
            .collect::<Result<_, _>>()?;
        let level = self.run(&["--feed-forward", feed_forward], &plans, "level.json");
        let disturbed = ["--feed-forward", "torque", "--robustness", "--cycles", DISTURBED_CYCLES];
        let disturbed = self.run(&disturbed, &plans, "disturbed.json");
        // Level runs decide whether a motion holds. The undisturbed runs among the others are equal, but shorter.
        for (mut run, decides) in [(level, must_hold), (disturbed, false)] {
            // Exit code 1: a motion fails in MuJoCo.
            let status = run.status().map_err(|error| format!("python3: {error}"))?;
            match status.code() {
                Some(0) => {}
                Some(1) if !decides => {}
                _ => return Err("tests/replay failed, or a motion fails in MuJoCo".to_owned()),
            }
        }
        Ok(plans)
    }

    /// Simulates the plans in our own simulator, with the results in `ground.json`.
    fn grounded(&self, plans: &[PathBuf]) -> Result<(), String> {
        let simulate = |plan: &Path, rate_hz: u32| {
            let rate = rate_hz.to_string();
            let args = ["simulate", "--json", "--cycles", CYCLES, "--rate", &rate];
            let output = self.rollwalk(&args).arg(plan).output();
            let output = output.map_err(|error| format!("rollwalk: {error}"))?;
            // Exit code 3: the robot does not reach the plan's goal. A failed simulation has no outcome.
            serde_json::from_slice::<Value>(&output.stdout).map_err(|_| {
                let why = String::from_utf8_lossy(&output.stderr);
                format!("rollwalk simulate {} at {rate} Hz: {why}", plan.display())
            })
        };
        let results = Mutex::new(BTreeMap::new());
        let failures = parallel::each(plans, |plan| {
            let mut rates = Map::new();
            for rate_hz in GROUND_RATES_HZ {
                rates.insert(rate_hz.to_string(), simulate(plan, rate_hz)?);
            }
            let name = plan.file_name().unwrap_or_default().to_string_lossy().into_owned();
            let result = json!({ "plan": name, "rates": rates });
            results.lock().expect("no worker panics").insert(name, result);
            Ok(())
        });
        if let Some(why) = failures.into_iter().next() {
            return Err(why);
        }
        let results: Vec<_> =
            results.into_inner().expect("no worker panics").into_values().collect();
        let path = self.out.join("ground.json");
        fs::write(&path, Value::from(results).to_string())
            .map_err(|error| format!("{}: {error}", path.display()))
    }

    /// Plans a motion. The name of the plan begins with that of the folder, because the two folders have motions with the same
    /// names.
    fn plan(&self, motion: &Path) -> Result<PathBuf, String> {
        let name =
            |path: &Path| path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let folder = motion.parent().map(name).unwrap_or_default();
        let plan = self.out.join("plans").join(format!("{folder}-{}.json", name(motion)));
        let args = [OsStr::new("plan"), motion.as_os_str(), OsStr::new("-o"), plan.as_os_str()];
        shell::output(&mut self.rollwalk(&args))?;
        Ok(plan)
    }
}

/// Shipped motion files, except library files, those of the test leg, which cannot stand by itself, and those of robots with
/// coupled motors, which the models of `tests/replay` lack.
fn motions() -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    for folder in MOTIONS {
        for entry in fs::read_dir(shell::workspace_root().join(folder))? {
            let path = entry?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let is_motion = name.ends_with(".toml") && !name.ends_with("_library.toml");
            if is_motion && !LEFT_OUT.iter().any(|robot| name.starts_with(robot)) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
