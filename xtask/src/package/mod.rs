//! Release packages: an archive and a Debian package with static programs, manual pages, shell completions, udev rules and the
//! shipped files; and the release notes.
//!
//! | module | content |
//! |---|---|
//! | [`build`] | static programs without paths of the build machine |
//! | [`stage`] | tree of files of both packages |
//! | [`notes`] | notes of a release, from the changelog |
//! | [`clean`] | test of the Debian package on a minimal Debian |
//!
//! The same commit gives the same bytes: files are sorted, belong to root and have the date of the commit.

mod build;
mod clean;
mod notes;
mod stage;

use crate::{shell, toolchain};
use std::fs;
use std::path::{Path, PathBuf};

const CARGO_DEB: (&str, &str) = ("cargo-deb", "3.8.0");

/// Options of the packages.
#[derive(clap::Args)]
pub struct Options {
    /// Build everything a second time, in a separate target folder, and compare the bytes.
    #[arg(long)]
    twice: bool,
}

/// Paths of the packages.
struct Packages {
    archive: PathBuf,
    debian: PathBuf,
}

/// Writes the packages and the release notes into `package` of the target folder.
///
/// # Errors
/// Returns an error if a build fails or a program is not static; with `twice`, also if bytes differ. If a program is missing,
/// the error contains the command that installs it.
pub fn write(options: &Options) -> Result<(), String> {
    let folder = shell::target_folder().join("package");
    let first = package(&shell::target_folder(), &folder)?;
    if options.twice {
        let target = folder.join("again");
        let again = package(&target, &target.join("package"))?;
        for (one, other) in [(&first.archive, &again.archive), (&first.debian, &again.debian)] {
            same(one, other)?;
        }
        eprintln!("built twice: both builds have the same bytes");
    }
    Ok(())
}

/// Builds the packages, installs the Debian package on a minimal Debian, and follows the tutorial of the README there.
///
/// # Errors
/// Returns the errors of [`write()`], or an error if the installation or the tutorial fails.
pub fn check() -> Result<(), String> {
    let folder = shell::target_folder().join("package");
    let packages = package(&shell::target_folder(), &folder)?;
    clean::check(&packages.debian)
}

/// Builds below the target folder `target`, and writes the packages into `folder`.
fn package(target: &Path, folder: &Path) -> Result<Packages, String> {
    let version = version()?;
    let programs = build::programs(target)?;
    let stage = programs.folder.join(stage::FOLDER);
    stage::write(&programs, &stage)?;
    make_folder(folder)?;
    let date = shell::output(&mut shell::command("git", &["log", "-1", "--format=%ct"]))?;
    let date = date.trim();
    let packages = Packages {
        archive: archive(&stage, &format!("rollwalk-{version}-x86_64-linux"), date, folder)?,
        debian: debian(target, date, folder)?,
    };
    let changelog = read(&shell::workspace_root().join("CHANGELOG.md"))?;
    let notes = folder.join("release-notes.md");
    let text = notes::newest(&changelog).ok_or("CHANGELOG.md has no section for a release")?;
    write_file(&notes, &text)?;
    for file in [&packages.archive, &packages.debian, &notes] {
        let bytes = fs::metadata(file).map_err(|error| failed(file, &error))?.len();
        eprintln!("{}: {bytes} bytes", file.display());
    }
    Ok(packages)
}

/// Packs the tree of files as an archive with the top-level folder `name`.
fn archive(stage: &Path, name: &str, date: &str, folder: &Path) -> Result<PathBuf, String> {
    let path = folder.join(format!("{name}.tar.gz"));
    let options = ["--sort=name", "--format=ustar", "--owner=0", "--group=0", "--numeric-owner"];
    let mut tar = shell::command("tar", &options);
    tar.args(["--mode=u=rwX,go=rX", "--use-compress-program=gzip -9n"]);
    tar.arg(format!("--mtime=@{date}")).arg(format!("--transform=s,^\\.,{name},"));
    tar.arg("--directory").arg(stage).arg("--create").arg("--file").arg(&path).arg(".");
    shell::run(&mut tar)?;
    Ok(path)
}

/// Creates the Debian package from the built programs and the tree of files; `cli/Cargo.toml` defines their paths.
fn debian(target: &Path, date: &str, folder: &Path) -> Result<PathBuf, String> {
    let deb = toolchain::subcommand(CARGO_DEB)?;
    let path = folder.join("rollwalk_amd64.deb");
    let options = ["deb", "--package", "rollwalk", "--no-build", "--no-strip", "--locked"];
    let mut write = shell::command(&deb, &options);
    write.args(["--profile", build::PROFILE, "--target", build::TARGET]);
    write.arg("--output").arg(&path);
    write.env("CARGO_TARGET_DIR", target).env("SOURCE_DATE_EPOCH", date);
    shell::run(&mut write)?;
    Ok(path)
}

/// Version of the programs.
fn version() -> Result<String, String> {
    let id = shell::output(&mut shell::cargo(&["pkgid", "--package", "rollwalk"]))?;
    let version = id.trim().rsplit(['#', '@']).next().map(str::to_owned);
    version.ok_or_else(|| format!("`{id}` has no version"))
}

fn same(one: &Path, other: &Path) -> Result<(), String> {
    let bytes = |path: &Path| fs::read(path).map_err(|error| failed(path, &error));
    if bytes(one)? == bytes(other)? {
        return Ok(());
    }
    let (one, other) = (one.display(), other.display());
    Err(format!("two builds differ: {one} and {other}; compare the files with diffoscope"))
}

fn read(path: &Path) -> Result<String, String> {
    fs::read_to_string(path).map_err(|error| failed(path, &error))
}

fn write_file(path: &Path, text: &str) -> Result<(), String> {
    fs::write(path, text).map_err(|error| failed(path, &error))
}

fn make_folder(path: &Path) -> Result<(), String> {
    fs::create_dir_all(path).map_err(|error| failed(path, &error))
}

fn failed(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}
