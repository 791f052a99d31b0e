//! `cargo xtask quick`: the check of a change during development, with formatting, repository rules, lints of the workspace, and
//! the tests of the changed crates. Dependent crates are linted with their tests. The output lists these tests, which only
//! `cargo xtask test` runs. The ROS 2 node and the Python package are linted only if they have changed.
//!
//! Lints need no machine code, so a change of a low-level crate does not compile all crates that depend on it. The tests are
//! built for the changed crates alone, with the features that these select; a first build therefore compiles dependencies once
//! more.

use crate::steps::{Run, test};
use crate::workspace::{self, Program};
use crate::{changes, programs, shell, tidy};
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Folders with files of one crate that the tests of another read, with the name of the other.
const READERS: [(&str, &str); 3] = [
    ("shipped/robots", "rollwalk-robot"),
    ("shipped/motions", "rollwalk-planner"),
    ("shipped/designs", "rollwalk-design"),
];
/// Folder of the end-to-end tests, with a module in each file.
const END_TO_END: &str = "tests/integration";

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// Revision to compare the working tree with. The default is the commit at which this branch left `origin/main`.
    #[arg(long, value_name = "REV")]
    since: Option<String>,
}

/// Checks the changes.
///
/// # Errors
/// Returns the failed step, or the error of git or cargo.
pub fn run(options: &Options) -> Result<(), String> {
    let files = changes::files(options.since.as_deref())?;
    let metadata =
        shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))?;
    let metadata: Value =
        serde_json::from_str(&metadata).map_err(|error| format!("cargo metadata: {error}"))?;
    let packages = packages(&metadata).ok_or("cargo metadata: no packages")?;
    let changed = changed(&packages, &files);
    eprintln!("{} changed files; crates to test: {}", files.len(), names(&changed));

    let mut run = Run::new("quick", 4);
    let root = shell::workspace_root();
    let _ = run.step("fmt", "formatting", test::format)
        && run.step("tidy", "repository rules", || tidy::check(&root))
        && run.step("lint", "every target, linted without building it", workspace::lint)
        && run.step("test", "tests of the changed crates", || run_tests(&changed, &files));
    let outcome = run.finish();
    let left = dependents(&packages, &changed);
    if !left.is_empty() {
        eprintln!(
            "\nRun `cargo xtask test` for the remaining tests, which are in {}",
            names(&left)
        );
    }
    outcome
}

fn names(packages: &[&Package]) -> String {
    let names: Vec<_> = packages.iter().map(|package| package.name.as_str()).collect();
    if names.is_empty() { "none".into() } else { names.join(", ") }
}

/// Package of the workspace.
#[derive(Debug, PartialEq, Eq)]
struct Package {
    name: String,
    folder: PathBuf,
    /// Names of the packages that this package needs, apart from its tests.
    dependencies: BTreeSet<String>,
    /// Names of the packages that only the tests of this package need.
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

/// Packages with changed files, or with tests that read changed files.
fn changed<'a>(packages: &'a [Package], files: &[PathBuf]) -> Vec<&'a Package> {
    let root = shell::workspace_root();
    let names = |file: &PathBuf| {
        let owners = packages.iter().filter(|package| file.starts_with(&package.folder));
        let owner = owners.max_by_key(|package| package.folder.as_os_str().len());
        let reader = READERS.iter().find(|(folder, _)| file.starts_with(root.join(folder)));
        owner.map(|owner| owner.name.as_str()).into_iter().chain(reader.map(|(_, name)| *name))
    };
    let names: BTreeSet<_> = files.iter().flat_map(names).collect();
    packages.iter().filter(|package| names.contains(package.name.as_str())).collect()
}

/// Other packages that depend on changed ones, directly or for tests.
fn dependents<'a>(packages: &'a [Package], changed: &[&Package]) -> Vec<&'a Package> {
    let of = |names: &BTreeSet<&str>, used: &BTreeSet<String>| {
        used.iter().any(|name| names.contains(name.as_str()))
    };
    let first: BTreeSet<_> = changed.iter().map(|package| package.name.as_str()).collect();
    let mut names = first.clone();
    loop {
        let using = packages.iter().filter(|package| of(&names, &package.dependencies));
        let before = names.len();
        let using: Vec<_> = using.map(|package| package.name.as_str()).collect();
        names.extend(using);
        if names.len() == before {
            break;
        }
    }
    let is_left = |package: &&Package| {
        let is_affected =
            names.contains(package.name.as_str()) || of(&names, &package.test_dependencies);
        is_affected && !first.contains(package.name.as_str())
    };
    packages.iter().filter(is_left).collect()
}

/// Builds and runs the tests of some packages. Of the end-to-end tests, only those in changed files are run, without the
/// real-time ones.
fn run_tests(packages: &[&Package], files: &[PathBuf]) -> Result<(), String> {
    if packages.is_empty() {
        return Ok(());
    }
    test::need_python()?;
    let names: Vec<_> = packages.iter().map(|package| package.name.as_str()).collect();
    let built = workspace::tests_of(&names)?;
    let is_test = |program: &&Program| {
        program.is_test && packages.iter().any(|package| package.folder == program.folder)
    };
    let folder = shell::workspace_root().join(END_TO_END);
    let is_end_to_end = |program: &&Program| folder.parent() == Some(&*program.folder);
    let (end_to_end, tests): (Vec<_>, Vec<_>) =
        built.iter().filter(is_test).partition(is_end_to_end);
    let file_name = |file: &PathBuf| file.file_stem().map(|name| name.to_string_lossy().into());
    let modules: Vec<String> =
        files.iter().filter(|file| file.starts_with(&folder)).filter_map(file_name).collect();
    programs::beside_each_other(&tests)?;
    programs::modules(&end_to_end, &modules)
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
            package("shipped", json!([])),
            package("rollwalk-robot", json!([])),
        ]});
        packages(&metadata).expect("metadata")
    }

    fn names_of(packages: &[&Package]) -> Vec<String> {
        packages.iter().map(|package| package.name.clone()).collect()
    }

    fn changed_by(file: &str) -> Vec<String> {
        names_of(&changed(&workspace(), &[shell::workspace_root().join(file)]))
    }

    fn left_by(file: &str) -> Vec<String> {
        let (packages, file) = (workspace(), shell::workspace_root().join(file));
        names_of(&dependents(&packages, &changed(&packages, &[file])))
    }

    #[test]
    fn a_file_belongs_to_the_innermost_package() {
        assert_eq!(changed_by("firmware/src/lib.rs"), ["firmware"]);
        assert_eq!(changed_by("firmware/boards/build.rs"), ["firmware/boards"]);
        assert_eq!(changed_by("CHANGELOG.md"), [""; 0]);
    }

    #[test]
    fn a_robot_file_is_read_by_the_tests_of_robots() {
        assert_eq!(changed_by("shipped/robots/agilebot.toml"), ["shipped", "rollwalk-robot"]);
    }

    #[test]
    fn tests_of_dependents_are_left_and_of_tests_only_the_tests() {
        assert_eq!(left_by("protocol/src/lib.rs"), ["firmware", "drives", "simulator"]);
        assert_eq!(left_by("firmware/src/lib.rs"), ["simulator"]);
        // The tests of the firmware drive them; programs that run the firmware do not.
        assert_eq!(left_by("drives/src/lib.rs"), ["firmware"]);
    }

    #[test]
    fn the_crates_that_read_files_exist() {
        let metadata = shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]);
        let metadata = shell::output(&mut { metadata }).expect("cargo metadata");
        for (folder, name) in READERS {
            assert!(shell::workspace_root().join(folder).exists(), "{folder}");
            assert!(metadata.contains(&format!("\"name\":\"{name}\"")), "{name}");
        }
        assert!(shell::workspace_root().join(END_TO_END).exists());
    }
}
