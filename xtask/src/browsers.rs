//! Checks of the studio's page: the committed files match their sources, and real browsers pass the tests of a user's actions.
//!
//! In `cargo xtask test` the page uses the native engine of `rollwalk studio`, which is built anyway; in `nightly` it also uses
//! the WebAssembly engine.

use crate::extent::Extent;
use crate::{debian, shell, studio, workspace};
use std::fs;
use std::process::Command;

/// Debian packages: browsers, Chromium first, and a display with WebGL, which Firefox requires.
const PACKAGES: [&str; 4] = ["chromium", "firefox-esr", "xvfb", "libgl1-mesa-dri"];

/// Compares the committed page with its sources, and tests it in Chromium and Firefox; the brief form runs one test in
/// Chromium.
///
/// # Errors
/// Returns the differences or the failed tests. If a program is missing, the error contains the command that installs it.
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

/// Tests robots in real time from the page; the brief form uses a simulated robot only. These tests need free processors,
/// because a late heartbeat stops a robot.
///
/// # Errors
/// Returns the errors of [`check`].
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
        // Node passes if no test matches the name.
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
        format!("the tests of the studio's page require real browsers. On Debian:\n\n    {install}")
    };
    debian::need(packages).map_err(missing)?;
    if !shell::succeeds(&mut shell::command("npm", &["--version"])) {
        debian::need(&["nodejs", "npm"]).map_err(missing)?;
    }
    shell::run(&mut npm(&["ci", "--no-audit", "--no-fund"]))
}

/// Builds the page in another folder, and checks that every committed file is identical to the byte.
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
                "studio/dist/{} differs from its sources: run `cd studio/web && npm ci && npm run \
                 build`, then commit the file",
                name.to_string_lossy()
            ));
        }
    }
    Ok(())
}
