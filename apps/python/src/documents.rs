//! Reading of files, and of the files that they name by relative paths.

use crate::error::{input_error, refused, refused_by_system};
use pyo3::prelude::*;
use rollwalk_design::designed::{Designed, MotionFile, NamedText};
use rollwalk_design::file::DesignFile;
use rollwalk_multibody::ground::{self, Terrain};
use rollwalk_planner::building::{Contents, LibraryFiles, LibraryMismatch};
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::Robot;
use rollwalk_robot::document::DocumentError;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Maximum size of a file, bytes; the largest possible plan has a third of it.
const BYTES_MAX: u64 = 32 << 20;

/// Source of files.
#[derive(Clone, Copy)]
pub enum Source {
    /// The file system.
    Disk,
    /// Shipped files, by their path in the repository of Rollwalk.
    Shipped,
}

impl Source {
    /// Reads the text of a file. `what` is the expected kind, for messages.
    pub fn text(self, path: &Path, what: &str) -> PyResult<NamedText> {
        let name = path.to_string_lossy().into_owned();
        let text = match self {
            Self::Shipped => {
                let text = rollwalk_shipped::text(&name);
                text.ok_or_else(|| unknown(what, path))?.to_owned()
            }
            Self::Disk => {
                let failed =
                    |error| refused_by_system(&format!("cannot read the {what}"), path, &error);
                let mut bytes = Vec::new();
                let file = File::open(path).map_err(failed)?;
                file.take(BYTES_MAX + 1).read_to_end(&mut bytes).map_err(failed)?;
                if bytes.len() as u64 > BYTES_MAX {
                    return Err(refused(format!(
                        "{name}: a {what} has at most {BYTES_MAX} bytes; check the path"
                    )));
                }
                let not_text = |_| refused(format!("{name} is not a {what}: it is not UTF-8 text"));
                String::from_utf8(bytes).map_err(not_text)?
            }
        };
        Ok(NamedText { name, text })
    }

    /// Reads a robot file.
    pub fn robot(self, path: &Path) -> PyResult<Robot> {
        let NamedText { name, text } = self.text(path, "robot file")?;
        Robot::from_toml(&name, &text).map_err(input_error)
    }

    /// Reads a motion file and the robot file that it names.
    pub fn motion(self, path: &Path) -> PyResult<(Robot, Motion)> {
        let file = self.text(path, "motion file")?;
        let terrain = self.terrain_beside(path, &file)?;
        let NamedText { name, text } = file;
        let robot = Motion::robot_path_in_toml(&name, &text).map_err(input_error)?;
        let robot = self.robot(&resolve_relative(path, &robot))?;
        let motion = Motion::from_toml_on(&name, &text, &robot, terrain.as_ref());
        Ok((robot, motion.map_err(input_error)?))
    }

    /// Reads the terrain file that a motion file at `path` names, if it names one.
    fn terrain_beside(self, path: &Path, motion: &NamedText) -> PyResult<Option<Terrain>> {
        let named = Motion::terrain_path_in_toml(&motion.name, &motion.text);
        let read = |named: String| self.terrain(&resolve_relative(path, &named));
        named.map_err(input_error)?.map(read).transpose()
    }

    /// Reads a plan.
    pub fn plan(self, path: &Path) -> PyResult<Plan> {
        let NamedText { name, text } = self.text(path, "plan")?;
        Plan::from_json(&name, &text).map_err(input_error)
    }

    /// Reads a library file and all files that it names.
    pub fn library(self, path: &Path) -> PyResult<Contents> {
        let NamedText { name, text } = self.text(path, "library file")?;
        Contents::read(&name, &text, &mut RelativeFiles { source: self, path })
    }

    /// Reads a design file, and the robot and motions that it names.
    pub fn design(self, path: &Path) -> PyResult<Designed> {
        let design = self.text(path, "design file")?;
        let file = DesignFile::from_toml(&design.name, &design.text).map_err(input_error)?;
        let robot = self.text(&resolve_relative(path, &file.robot), "robot file")?;
        let motion = |of: &rollwalk_design::file::WeightedMotion| {
            let at = resolve_relative(path, &of.file);
            let file = self.text(&at, "motion file")?;
            let terrain = self.terrain_beside(&at, &file)?;
            Ok(MotionFile { file, terrain })
        };
        let motions = file.motions.iter().map(motion).collect::<PyResult<Vec<_>>>()?;
        Designed::new(&design, robot, motions).map_err(input_error)
    }

    /// Reads a terrain file.
    pub fn terrain(self, path: &Path) -> PyResult<Terrain> {
        let NamedText { name, text } = self.text(path, "terrain file")?;
        ground::file::from_toml(&name, &text).map_err(input_error)
    }
}

/// Reader of the files that a library file names.
struct RelativeFiles<'l> {
    source: Source,
    path: &'l Path,
}

impl LibraryFiles for RelativeFiles<'_> {
    type Error = PyErr;

    fn robot(&mut self, named: &str) -> PyResult<(Robot, String)> {
        let at = resolve_relative(self.path, named);
        Ok((self.source.robot(&at)?, at.to_string_lossy().into_owned()))
    }

    fn motion(&mut self, named: &str) -> PyResult<(Robot, Motion, String)> {
        let at = resolve_relative(self.path, named);
        let (robot, motion) = self.source.motion(&at)?;
        Ok((robot, motion, at.to_string_lossy().into_owned()))
    }

    fn plan(&mut self, named: &str) -> PyResult<(Plan, String)> {
        let at = resolve_relative(self.path, named);
        Ok((self.source.plan(&at)?, at.to_string_lossy().into_owned()))
    }

    fn faults(&mut self, error: DocumentError) -> PyErr {
        input_error(error)
    }

    fn misfit(&mut self, error: LibraryMismatch) -> PyErr {
        input_error(error)
    }
}

/// Resolves a path that the file at `path` contains relative to itself. Detours `x/..` are removed, because paths of shipped
/// files have none.
fn resolve_relative(path: &Path, named: &str) -> PathBuf {
    let mut resolved = path.parent().unwrap_or(Path::new("")).to_owned();
    for part in Path::new(named).components() {
        let is_detour = part == std::path::Component::ParentDir
            && resolved.file_name().is_some_and(|folder| folder != "..");
        if is_detour {
            resolved.pop();
        } else {
            resolved.push(part);
        }
    }
    resolved
}

/// Path of the shipped file `name` in `folder`.
pub fn shipped(folder: &str, name: &str) -> PathBuf {
    Path::new(folder).join(name).with_extension("toml")
}

fn unknown(what: &str, path: &Path) -> PyErr {
    let folder = path.parent().unwrap_or(Path::new(""));
    let known = rollwalk_shipped::FILES.iter().map(|(path, _)| Path::new(path));
    let known = known.filter(|known| known.parent() == Some(folder));
    let known = known.filter_map(|path| path.file_stem()?.to_str());
    let (name, known) = (path.file_stem().unwrap_or_default(), known.collect::<Vec<_>>());
    let name = name.to_string_lossy();
    refused(format!("no {what} `{name}` ships with rollwalk: give one of {}", known.join(", ")))
}

/// Write the files that ship with Rollwalk into a folder: robots, motions, libraries and designs as starting points.
///
/// Missing folders are created. Existing files are not touched, so that your changes stay.
///
/// :param folder: destination; the files are written to `robots/`, `motions/` and `designs/` in it.
/// :returns: the paths of the files that were written.
/// :raises OSError: a folder or file cannot be written.
#[pyfunction]
pub fn write_shipped(folder: PathBuf) -> PyResult<Vec<PathBuf>> {
    let mut written = Vec::new();
    for (path, text) in rollwalk_shipped::FILES {
        let path = folder.join(path);
        let failed = |error| refused_by_system("cannot write", &path, &error);
        fs::create_dir_all(path.parent().unwrap_or(&folder)).map_err(failed)?;
        if !path.exists() {
            fs::write(&path, text).map_err(failed)?;
            written.push(path);
        }
    }
    Ok(written)
}
