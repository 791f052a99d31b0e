//! Comparison of the published crates' public items with the last release by cargo-semver-checks. A breaking change needs a
//! version number that announces it.

use super::manifest::{self, Published};
use super::metadata;
use crate::{shell, toolchain};

const CARGO_SEMVER_CHECKS: (&str, &str) = ("cargo-semver-checks", "0.51.0");
const TAGS: &str = "v[0-9]*";

/// Compares with a revision, or else with the last release before this commit. Prints a note if there is no release.
///
/// # Errors
/// Returns an error if the version does not allow the changes, which are printed on the terminal, or if the revision has none
/// of the crates. If cargo-semver-checks is missing, the error contains the command that installs it.
pub fn compare(since: Option<&str>) -> Result<(), String> {
    let revision = match since {
        Some(revision) => Some(revision.to_owned()),
        None => last_release()?,
    };
    let Some(revision) = revision else {
        eprintln!(
            "public items are NOT compared, because no release tag `{TAGS}` precedes this commit; \
             run `cargo xtask semver --since REVISION` to compare with another revision"
        );
        return Ok(());
    };
    let commit = format!("{revision}^{{commit}}");
    shell::output(&mut shell::command("git", &["rev-parse", "--verify", "--quiet", &commit]))
        .map_err(|_| format!("`{revision}` is not a revision of this checkout"))?;
    let published = manifest::published(&metadata()?)?;
    let (old, new): (Vec<_>, Vec<_>) =
        published.iter().partition(|one| is_in(&revision, one).unwrap_or(false));
    if old.is_empty() {
        return Err(format!("`{revision}` contains none of the published crates"));
    }
    for one in new {
        eprintln!("{}: this crate is not in {revision}, so there is nothing to compare", one.name);
    }
    let checks = toolchain::subcommand(CARGO_SEMVER_CHECKS)?;
    let mut check = shell::command(&checks, &["semver-checks", "--baseline-rev", &revision]);
    check.args(old.iter().flat_map(|one| ["--package", one.name.as_str()]));
    shell::run(&mut check)
}

/// Tag of the last release before this commit.
fn last_release() -> Result<Option<String>, String> {
    // A release sorts after its candidates, `v1.0.0-rc.1`.
    let mut git = shell::command("git", &["-c", "versionsort.suffix=-", "tag", "--list", TAGS]);
    let tags = shell::output(git.args(["--merged", "HEAD", "--sort=-version:refname"]))?;
    Ok(tags.lines().next().map(str::to_owned))
}

/// True if the revision has this crate, in the same folder.
fn is_in(revision: &str, one: &Published) -> Result<bool, String> {
    let folder = one.folder.strip_prefix(shell::workspace_root()).map_err(|e| e.to_string())?;
    let manifest = format!("{revision}:{}/Cargo.toml", folder.display());
    let manifest = shell::output(&mut shell::command("git", &["show", &manifest]))?;
    Ok(manifest.contains(&format!("name = \"{}\"", one.name)))
}
