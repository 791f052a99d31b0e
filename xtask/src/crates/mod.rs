//! Crates that are published for users of Rust (`docs/crates.md`): each can be packaged, and keeps its promises to them.
//!
//! | module | is |
//! |---|---|
//! | [`manifest`] | what cargo says of the workspace: which crates are published, and what their users must find |
//! | [`archive`] | what a package has in it |
//! | [`semver`] | public items compared with those of the last release |

mod archive;
mod manifest;
mod semver;

use crate::extent::Extent;
use crate::shell;
use manifest::Published;
use std::path::PathBuf;

pub use semver::compare;

/// Checks the manifests of the published crates and, unless brief, packages each. The full check also builds each from its
/// package alone, and compares its public items with the last release.
///
/// # Errors
/// Metadata that is missing, a crate that cannot be packaged, a package without its licences; then also one that does not
/// build, and changes that the version does not allow.
pub fn check(extent: Extent) -> Result<(), String> {
    let metadata = metadata()?;
    let published = manifest::published(&metadata)?;
    let mut violations = manifest::violations(&metadata)?;
    if !violations.is_empty() {
        return Err(violations.join("\n"));
    }
    if extent == Extent::Brief {
        eprintln!("the manifests of {} crates have what the registry asks for", published.len());
        return Ok(());
    }
    package(&published, extent)?;
    for one in &published {
        violations.extend(archive::violations(one, &archive_of(one))?);
    }
    if !violations.is_empty() {
        return Err(violations.join("\n"));
    }
    eprintln!("{} crates can be packaged", published.len());
    if extent == Extent::Full { compare(None) } else { Ok(()) }
}

/// Metadata of the workspace, from cargo.
fn metadata() -> Result<String, String> {
    shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))
}

/// Writes the packages. Those that do not depend on each other alone are found in a registry that cargo makes for this, so that
/// none needs to be published.
fn package(published: &[Published], extent: Extent) -> Result<(), String> {
    // Of a change, too, before it is committed.
    let mut package = shell::cargo(&["package", "--locked", "--allow-dirty", "--target-dir"]);
    package.arg(folder());
    match extent {
        // A lock file would take answers from the network, and there is nothing to build with it.
        Extent::Brief | Extent::Short => {
            package.args(["--quiet", "--no-verify", "--exclude-lockfile"])
        }
        Extent::Full => package.args(["--all-features"]),
    };
    package.args(published.iter().flat_map(|one| ["--package", one.name.as_str()]));
    shell::run(&mut package)
}

/// Cargo's target folder for packages: those of `cargo xtask package` are in the other one.
fn folder() -> PathBuf {
    shell::target_folder().join("crates")
}

fn archive_of(one: &Published) -> PathBuf {
    folder().join("package").join(format!("{}.crate", one.stem()))
}
