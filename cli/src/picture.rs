//! Pictures in other formats than SVG: PNG by `rsvg-convert`, films by `rsvg-convert` and `ffmpeg`, if they are installed.
//!
//! These are separate programs, because an SVG renderer would be a large dependency of every build.

use miette::{IntoDiagnostic, miette};
use rollwalk_terminal::interrupt;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

/// Program that converts SVG to PNG.
const RSVG: Tool =
    Tool { program: "rsvg-convert", package: "librsvg2-bin", formats: "PNG, GIF or MP4" };
/// Program that converts PNG pictures to films.
const FFMPEG: Tool = Tool { program: "ffmpeg", package: "ffmpeg", formats: "GIF or MP4" };
/// Ratio of PNG to SVG size, pixels; sharp on high-resolution displays.
const ZOOM: &str = "2";

/// Programs that some picture formats need.
pub const TOOLS: [Tool; 2] = [RSVG, FFMPEG];

/// Program that may be installed or not.
#[derive(Clone, Copy, Debug)]
pub struct Tool {
    /// Name of the program on the path.
    pub program: &'static str,
    /// Debian package with the program.
    pub package: &'static str,
    /// Formats that need it.
    formats: &'static str,
}

impl Tool {
    /// True if the program is on the path.
    pub fn is_installed(&self) -> bool {
        let path = std::env::var_os("PATH").unwrap_or_default();
        std::env::split_paths(&path).any(|folder| folder.join(self.program).is_file())
    }

    /// Consequence if the program is missing.
    pub fn lack(&self) -> String {
        format!("`rollwalk plot` can write SVG, but not {}", self.formats)
    }

    /// Command that installs the program.
    pub fn install(&self) -> String {
        format!("`sudo apt install {}` on Debian and Ubuntu", self.package)
    }

    /// Runs the program in a folder.
    fn run(&self, folder: &Path, args: &[&str]) -> miette::Result<()> {
        let mut command = Command::new(self.program);
        command.args(args).current_dir(folder).stdin(Stdio::null());
        let output = command.output().map_err(|error| {
            miette!(
                help = format!("install the program ({}), or write .svg", self.install()),
                "cannot run {}: {error}",
                self.program
            )
        })?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.trim_end().lines().last().unwrap_or_default();
        Err(miette!("{} failed ({}): {last}", self.program, output.status))
    }
}

fn svg_to_png(folder: &Path, name: &str, svg: &str) -> miette::Result<()> {
    fs::write(folder.join("picture.svg"), svg).into_diagnostic()?;
    RSVG.run(folder, &["--zoom", ZOOM, "picture.svg", "--output", name])
}

/// Converts an SVG to a PNG.
///
/// # Errors
/// Returns an error if the program is not installed or fails.
pub fn png(svg: &str) -> miette::Result<Vec<u8>> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    svg_to_png(folder.path(), "picture.png", svg)?;
    fs::read(folder.path().join("picture.png")).into_diagnostic()
}

/// Converts pictures to a looping film with `frame_s` seconds for each picture; `ending` is `gif` or `mp4`.
///
/// # Errors
/// Returns an error if a program is not installed or fails, or on Ctrl-C.
pub fn film(frame_s: f64, pictures: &[String], ending: &str) -> miette::Result<Vec<u8>> {
    let folder = tempfile::tempdir().into_diagnostic()?;
    interrupt::install_handler();
    let bar = indicatif::ProgressBar::new(pictures.len() as u64);
    for (number, svg) in pictures.iter().enumerate() {
        if interrupt::requested() {
            return Err(miette!("interrupted: nothing was written"));
        }
        svg_to_png(folder.path(), &format!("{number:05}.png"), svg)?;
        bar.inc(1);
    }
    bar.finish_and_clear();
    let rate = (1.0 / frame_s).to_string();
    let film = format!("film.{ending}");
    let make: &[&str] = match ending {
        // The palette of a GIF is chosen from all its frames.
        "gif" => {
            &["-filter_complex", "split[a][b];[a]palettegen[p];[b][p]paletteuse", "-loop", "0"]
        }
        // Players require even sizes and this pixel format.
        _ => &["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"],
    };
    let input = ["-loglevel", "error", "-framerate", &rate, "-i", "%05d.png"];
    FFMPEG.run(folder.path(), &[&input[..], make, &[&film]].concat())?;
    fs::read(folder.path().join(film)).into_diagnostic()
}
