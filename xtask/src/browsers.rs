//! The studio's page: what is committed comes from its sources, and real browsers do with it what a user does.
//!
//! In `cargo xtask test` the page has the native engine of `rollwalk studio`, which is built in any case; in `nightly` it also
//! has the engine as WebAssembly.

use crate::extent::Extent;
use crate::{debian, shell, studio, workspace};
use std::fs;
use std::process::Command;

/// Browsers, Chromium first; and a display with WebGL for Firefox, which has none without one.
const PACKAGES: [&str; 4] = ["chromium", "firefox-esr", "xvfb", "libgl1-mesa-dri"];

/// Compares the committed page with its sources, and drives it in Chromium and Firefox; in brief drives it in Chromium, in one
/// test.
///
/// # Errors
/// What differs, what failed, or the command that installs what is missing.
pub fn check(extent: Extent) -> Result<(), String> {
    if extent == Extent::Brief {
        return brief("test/served.test.mjs", "opens the files of the command line");
    }
    install(&PACKAGES)?;
    shell::run(&mut npm(&["run", "types"]))?;
    compare_with_sources()?;
    let mut tests = tests(match extent {
        Extent::Brief | Extent::Short => &["run", "served"],
        Extent::Full => &["test"],
    })?;
    if extent == Extent::Full {
        tests.env("STUDIO_WASM", studio::engine()?);
    }
    shell::run(&mut tests)
}

/// Drives robots in real time from the page, in brief a simulated one: a heartbeat that is late for want of a processor stops
/// them.
///
/// # Errors
/// As [`check`].
pub fn check_robots(extent: Extent) -> Result<(), String> {
    if extent == Extent::Brief {
        return brief("test/bus.test.mjs", "a simulated robot is flashed");
    }
    install(&PACKAGES)?;
    shell::run(&mut tests(&["run", "robots"])?)
}

/// Runs a test of the page in Chromium alone.
fn brief(file: &str, test: &str) -> Result<(), String> {
    install(&PACKAGES[..1])?;
    let path = shell::workspace_root().join("studio/web").join(file);
    let text = fs::read_to_string(path).map_err(|error| format!("{file}: {error}"))?;
    if !text.contains(&format!("test(\"{test}")) {
        // Node passes if no test has the name.
        return Err(format!("{file} has no test \"{test}"));
    }
    let pattern = format!("--test-name-pattern={test}");
    let mut test = tests(&["run", "files", "--", &pattern, file])?;
    shell::run(test.env("STUDIO_BROWSERS", "chromium"))
}

fn tests(script: &[&str]) -> Result<Command, String> {
    let programs = workspace::programs()?;
    let rollwalk = workspace::find(&programs, "tests", "rollwalk-under-test", false)?;
    let simulator = workspace::find(&programs, "tests", "rollwalk-sim-under-test", false)?;
    let mut tests = npm(script);
    tests.env("STUDIO_ROLLWALK", &rollwalk.path).env("STUDIO_SIM", &simulator.path);
    Ok(tests)
}

fn npm(args: &[&str]) -> Command {
    let mut npm = shell::command("npm", args);
    npm.current_dir(shell::workspace_root().join("studio/web"));
    npm
}

fn install(packages: &[&str]) -> Result<(), String> {
    let missing = |install: String| {
        format!("the studio's page is tested in real browsers. On Debian:\n\n    {install}")
    };
    debian::need(packages).map_err(missing)?;
    if !shell::succeeds(&mut shell::command("npm", &["--version"])) {
        debian::need(&["nodejs", "npm"]).map_err(missing)?;
    }
    shell::run(&mut npm(&["ci", "--no-audit", "--no-fund"]))
}

/// Builds the page elsewhere: every committed file must come out to the byte.
fn compare_with_sources() -> Result<(), String> {
    let built = shell::target_folder().join("studio-page");
    let committed = shell::workspace_root().join("studio/dist");
    let failed = |error: std::io::Error| format!("the studio's page: {error}");
    shell::run(npm(&["run", "build", "--", "--out"]).arg(&built))?;
    for file in fs::read_dir(&committed).map_err(failed)? {
        let name = file.map_err(failed)?.file_name();
        let bytes = |folder: &std::path::Path| fs::read(folder.join(&name)).map_err(failed);
        if bytes(&built)? != bytes(&committed)? {
            return Err(format!(
                "studio/dist/{} is not what its sources make: cd studio/web && npm ci && npm run build, then commit it",
                name.to_string_lossy()
            ));
        }
    }
    Ok(())
}
