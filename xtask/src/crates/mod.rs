//! Checks of the crates that are published for Rust users (`docs/crates.md`): each can be packaged, and is compatible with its
//! last release.
//!
//! | module | content |
//! |---|---|
//! | [`manifest`] | metadata from cargo: the published crates, and the metadata that their users need |
//! | [`archive`] | contents of a package |
//! | [`semver`] | comparison of public items with the last release |

mod archive;
mod manifest;
mod semver;

use crate::extent::Extent;
use crate::shell;
use manifest::Published;
use std::path::PathBuf;

pub use semver::compare;

/// Checks the manifests of the published crates and, unless brief, packages each of them. The full check also builds each crate
/// from its package alone, and compares its public items with the last release.
///
/// # Errors
/// Returns an error if metadata are missing, if a crate cannot be packaged, or if a package lacks its licences. The full check
/// also returns an error if a package cannot be built, or if the version does not allow the changes.
pub fn check(extent: Extent) -> Result<(), String> {
    let metadata = metadata()?;
    let published = manifest::published(&metadata)?;
    let mut violations = manifest::violations(&metadata)?;
    if !violations.is_empty() {
        return Err(violations.join("\n"));
    }
    if extent == Extent::Brief {
        eprintln!(
            "the manifests of {} crates meet the requirements of the registry",
            published.len()
        );
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

/// Returns the metadata of the workspace from cargo.
fn metadata() -> Result<String, String> {
    shell::output(&mut shell::cargo(&["metadata", "--no-deps", "--format-version", "1"]))
}

/// Writes the packages. Cargo resolves dependencies between them in a temporary registry, so none needs to be published.
fn package(published: &[Published], extent: Extent) -> Result<(), String> {
    // Also uncommitted changes.
    let mut package = shell::cargo(&["package", "--locked", "--allow-dirty", "--target-dir"]);
    package.arg(folder());
    match extent {
        // A lock file would need the network, and the package is not built.
        Extent::Brief | Extent::Short => {
            package.args(["--quiet", "--no-verify", "--exclude-lockfile"])
        }
        Extent::Full => package.args(["--all-features"]),
    };
    package.args(published.iter().flat_map(|one| ["--package", one.name.as_str()]));
    shell::run(&mut package)
}

/// Target folder of cargo for the given packages, separate from that of `cargo xtask package`.
fn folder() -> PathBuf {
    shell::target_folder().join("crates")
}

fn archive_of(one: &Published) -> PathBuf {
    folder().join("package").join(format!("{}.crate", one.stem()))
}
