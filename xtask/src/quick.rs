//! `cargo xtask quick`: the check of a change while working on it. Formatting, house rules, clippy, and the tests of
//! the changed crates and of those that depend on them.
//!
//! Cargo is given the whole workspace, as in `cargo xtask test`: it recompiles what has changed, and no dependency in
//! another selection of features. Only the tests to run are chosen here.

use crate::steps::test::{self, TestStep};
use crate::steps::{Run, Step};
use crate::workspace::{self, Program};
use crate::{programs, shell, tidy};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Files that no test reads. All others outside of the crates (robots, motions, documents) are read by tests of several.
const UNREAD: [&str; 7] = [
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "docs/images",
    "rustfmt.toml",
    ".gitignore",
];

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// Revision that the working tree is compared with; by default, where this branch left `main`.
    #[arg(long, value_name = "REV")]
    since: Option<String>,
}

/// Checks the changes.
///
/// # Errors
/// The failed step; or git's or cargo's errors.
pub fn run(options: &Options) -> Result<(), String> {
    let files = changed_files(options.since.as_deref())?;
    let metadata =
        shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    let metadata: Value =
        serde_json::from_str(&metadata).map_err(|error| format!("cargo metadata: {error}"))?;
    let packages = packages(&metadata).ok_or("cargo metadata: no packages")?;
    let affected = affected(&packages, &files);
    let names: Vec<&str> = affected.iter().map(|package| package.name.as_str()).collect();
    eprintln!("{} changed files; crates to test: {}", files.len(), names.join(", "));

    let mut run = Run::new("quick", 4);
    let root = shell::workspace_root();
    let _ = run.step("fmt", "formatting", test::format)
        && run.step("tidy", "house rules", || tidy::check(&root))
        && run.step("build", TestStep::Build.title(), || TestStep::Build.check())
        && run.step("test", "tests of the affected crates", || run_tests(&affected));
    run.finish()
}

/// A package of the workspace.
#[derive(Debug, PartialEq, Eq)]
struct Package {
    name: String,
    folder: PathBuf,
    /// Names of the packages that it depends on, by kind: what users get, and what only tests need.
    dependencies: BTreeSet<String>,
    test_dependencies: BTreeSet<String>,
}

fn packages(metadata: &Value) -> Option<Vec<Package>> {
    let packages = metadata["packages"].as_array()?.iter().map(|package| {
        let of_kind = |is_for_tests: bool| {
            let all = package["dependencies"].as_array().into_iter().flatten();
            let kind = all.filter(|dependency| (dependency["kind"] == "dev") == is_for_tests);
            kind.filter_map(|dependency| dependency["name"].as_str().map(str::to_owned)).collect()
        };
        Some(Package {
            name: package["name"].as_str()?.into(),
            folder: Path::new(package["manifest_path"].as_str()?).parent()?.into(),
            dependencies: of_kind(false),
            test_dependencies: of_kind(true),
        })
    });
    packages.collect()
}

/// Packages with changed files, and all whose tests use them.
fn affected<'a>(packages: &'a [Package], files: &[PathBuf]) -> Vec<&'a Package> {
    let root = shell::workspace_root();
    let owner = |file: &PathBuf| {
        let owners = packages.iter().filter(|package| file.starts_with(&package.folder));
        owners.max_by_key(|package| package.folder.as_os_str().len())
    };
    let is_read =
        |file: &&PathBuf| !UNREAD.iter().any(|unread| file.starts_with(root.join(unread)));
    if files.iter().filter(is_read).any(|file| owner(file).is_none()) {
        return packages.iter().collect();
    }
    let mut changed: BTreeSet<&str> =
        files.iter().filter_map(owner).map(|package| package.name.as_str()).collect();
    loop {
        let uses = |package: &&Package| {
            package.dependencies.iter().any(|name| changed.contains(name.as_str()))
        };
        let dependents: Vec<&str> =
            packages.iter().filter(uses).map(|package| package.name.as_str()).collect();
        let before = changed.len();
        changed.extend(dependents);
        if changed.len() == before {
            break;
        }
    }
    let is_affected = |package: &&Package| {
        changed.contains(package.name.as_str())
            || package.test_dependencies.iter().any(|name| changed.contains(name.as_str()))
    };
    packages.iter().filter(is_affected).collect()
}

/// Builds the workspace and runs the tests of some packages, but for those in real time.
fn run_tests(packages: &[&Package]) -> Result<(), String> {
    if packages.is_empty() {
        return Ok(());
    }
    test::need_python()?;
    let programs = workspace::programs()?;
    let is_affected = |program: &&Program| {
        program.is_test && packages.iter().any(|package| package.folder == program.folder)
    };
    let tests: Vec<&Program> = programs.iter().filter(is_affected).collect();
    programs::beside_each_other(&tests)
}

/// Files that differ from a revision, and those that git does not know yet.
fn changed_files(since: Option<&str>) -> Result<Vec<PathBuf>, String> {
    let git = |args: &[&str]| shell::output(&mut shell::command("git", args));
    let base = match since {
        Some(revision) => revision.to_owned(),
        // Without a branch `main`, only what is not committed yet.
        None => git(&["merge-base", "HEAD", "main"]).unwrap_or_else(|_| "HEAD".into()),
    };
    let changed = git(&["diff", "--name-only", "--no-renames", base.trim()])?;
    let new = git(&["ls-files", "--others", "--exclude-standard"])?;
    let root = shell::workspace_root();
    Ok(changed.lines().chain(new.lines()).map(|file| root.join(file)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn workspace() -> Vec<Package> {
        let root = shell::workspace_root();
        let package = |name: &str, dependencies: Value| json!({ "name": name, "manifest_path": root.join(name).join("Cargo.toml"), "dependencies": dependencies });
        let dev = |name: &str| json!({ "name": name, "kind": "dev" });
        let normal = |name: &str| json!({ "name": name, "kind": null });
        let metadata = json!({ "packages": [
            package("protocol", json!([normal("crc")])),
            package("firmware", json!([normal("protocol"), dev("drives")])),
            package("drives", json!([normal("protocol")])),
            package("simulator", json!([normal("firmware")])),
            package("firmware/boards", json!([])),
        ]});
        packages(&metadata).expect("metadata")
    }

    fn affected_by(file: &str) -> Vec<String> {
        let files = [shell::workspace_root().join(file)];
        affected(&workspace(), &files).iter().map(|package| package.name.clone()).collect()
    }

    #[test]
    fn dependents_are_affected_and_of_tests_only_the_tests() {
        assert_eq!(affected_by("protocol/src/lib.rs").len(), 4);
        assert_eq!(affected_by("firmware/src/lib.rs"), ["firmware", "simulator"]);
        // The firmware's tests drive them; what runs the firmware does not.
        assert_eq!(affected_by("firmware/drives/src/lib.rs"), ["firmware", "drives"]);
    }

    #[test]
    fn a_file_belongs_to_the_innermost_package() {
        assert_eq!(affected_by("firmware/boards/build.rs"), ["firmware/boards"]);
        assert_eq!(affected_by("CHANGELOG.md"), [""; 0]);
    }

    #[test]
    fn a_file_of_no_package_affects_all_whose_tests_may_read_it() {
        assert_eq!(affected_by("robots/agilebot.toml").len(), 5);
        assert_eq!(affected_by("Cargo.lock").len(), 5);
    }
}
