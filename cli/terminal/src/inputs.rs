//! Reading and validation of input files, with a hint for each kind of file.
//!
//! Motion and library files contain paths relative to themselves. Files come from the disk or from the program itself, which
//! contains the shipped robots and motions, so that the demo runs in any folder.

use crate::files::{self, PathSource};
use crate::kind::Kind;
use crate::shipped;
use miette::{Context, Report, miette};
use rollwalk_design::catalog::Catalog;
use rollwalk_design::designed::{Designed, MotionFile, NamedText};
use rollwalk_design::file::DesignFile;
use rollwalk_design::sweep::{Files, LoadedSweep, Sweep};
use rollwalk_multibody::ground::{self, Terrain};
use rollwalk_planner::building::{Contents, LibraryFiles, LibraryMismatch, LibraryRequest};
use rollwalk_planner::library_file::LibraryFile;
use rollwalk_planner::motion::Motion;
use rollwalk_planner::plan::Plan;
use rollwalk_robot::document::DocumentError;
use rollwalk_robot::{Robot, Solid};
use serde::{Deserialize, Serialize};
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

/// Source of input files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// File system. If no file exists at a path, a shipped file is read ([`files`]).
    Disk,
    /// Files inside the program, by their path in the checkout.
    Shipped,
}

/// Text of a file, with its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextFile {
    /// Name of the file in messages.
    pub path: String,
    /// Content of the file. Problem files store an array of lines, for readability.
    #[serde(rename = "lines", with = "lines")]
    pub text: String,
}

/// Serialisation of texts as arrays of lines.
mod lines {
    use serde::{Deserialize, Deserializer, Serializer};

    pub fn serialize<S: Serializer>(text: &str, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(text.split('\n'))
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
        Ok(Vec::<String>::deserialize(deserializer)?.join("\n"))
    }
}

/// Texts of a motion file and of the robot file that it names.
pub struct MotionTexts {
    pub motion: TextFile,
    pub robot: TextFile,
    /// Terrain file, if the motion file names one.
    pub terrain: Option<TextFile>,
}

impl MotionTexts {
    /// Parses and validates both files.
    ///
    /// # Errors
    /// Returns all mistakes in the robot file, else those in the terrain file, else those in the motion file.
    pub fn parse(&self) -> miette::Result<(Robot, Motion)> {
        let robot = robot(&self.robot)?;
        let TextFile { path, text } = &self.motion;
        let explain = Kind::Motion.explain(Path::new(path), text);
        let terrain = self.terrain.as_ref().map(terrain).transpose()?;
        let motion = Motion::from_toml_on(path, text, &robot, terrain.as_ref());
        Ok((robot, motion.map_err(explain)?))
    }
}

/// Parses and validates the text of a robot file.
fn robot(TextFile { path, text }: &TextFile) -> miette::Result<Robot> {
    Robot::from_toml(path, text).map_err(Kind::Robot.explain(Path::new(path), text))
}

/// Parses and validates the text of a terrain file.
fn terrain(TextFile { path, text }: &TextFile) -> miette::Result<Terrain> {
    ground::file::from_toml(path, text).map_err(Kind::Terrain.explain(Path::new(path), text))
}

/// Library file with all files that it names.
pub struct Library {
    /// The robot of the library.
    pub robot: Robot,
    /// The library file itself.
    pub file: LibraryFile,
    /// Motions in the order of the library file.
    pub motions: Vec<Motion>,
    /// Plans of the motions for which the library file names one.
    pub plans: Vec<Option<Plan>>,
    /// Text of the library file.
    pub text: TextFile,
    /// Text of the robot file.
    pub robot_text: TextFile,
}

impl Library {
    /// Planning request for the library.
    pub fn request(&self) -> LibraryRequest<'_> {
        let Self { robot, file, motions, plans, .. } = self;
        LibraryRequest { robot, file, motions, plans }
    }
}

/// Reader of the files that a library file names.
struct RelativeFiles<'l> {
    source: Source,
    path: &'l Path,
    text: &'l str,
    robot: Option<TextFile>,
}

impl RelativeFiles<'_> {
    fn text(&self, named: &str, kind: Kind) -> miette::Result<TextFile> {
        self.source.named(self.path, named, kind)
    }
}

impl LibraryFiles for RelativeFiles<'_> {
    type Error = Report;

    fn robot(&mut self, named: &str) -> miette::Result<(Robot, String)> {
        let text = self.text(named, Kind::Robot)?;
        let (robot, at) = (robot(&text)?, text.path.clone());
        self.robot = Some(text);
        Ok((robot, at))
    }

    fn motion(&mut self, named: &str) -> miette::Result<(Robot, Motion, String)> {
        let text = self.text(named, Kind::Motion)?;
        let at = text.path.clone();
        let (robot, motion) = self.source.beside_motion(text)?.parse()?;
        Ok((robot, motion, at))
    }

    fn plan(&mut self, named: &str) -> miette::Result<(Plan, String)> {
        let at = resolve_relative(self.path, named);
        let TextFile { path, text } = self.text(named, Kind::Plan)?;
        let plan = Plan::from_json(&path, &text).map_err(Kind::Plan.explain(&at, &text))?;
        Ok((plan, path))
    }

    fn faults(&mut self, error: DocumentError) -> Report {
        Kind::Library.explain(self.path, self.text)(error)
    }

    fn misfit(&mut self, error: LibraryMismatch) -> Report {
        Report::new(error)
    }
}

impl Source {
    /// Reads and validates a robot file.
    ///
    /// # Errors
    /// Returns an error if the file is missing, or all mistakes in it.
    pub fn robot(self, path: &Path) -> miette::Result<Robot> {
        Ok(self.robot_and_text(path)?.0)
    }

    /// Reads and validates a robot file, and returns its text, too.
    ///
    /// # Errors
    /// Returns the errors of [`robot`](Self::robot).
    pub fn robot_and_text(self, path: &Path) -> miette::Result<(Robot, TextFile)> {
        let text = self.text(path, PathSource::ByUser, Kind::Robot)?;
        Ok((robot(&text)?, text))
    }

    /// Reads and validates a robot file, and returns the solids of every link, too.
    ///
    /// # Errors
    /// Returns the errors of [`robot`](Self::robot).
    pub fn robot_and_parts(self, path: &Path) -> miette::Result<(Robot, Vec<Vec<Solid>>)> {
        let TextFile { path: name, text } = self.text(path, PathSource::ByUser, Kind::Robot)?;
        let explain = Kind::Robot.explain(Path::new(&name), &text);
        Robot::with_parts_from_toml(&name, &text).map_err(explain)
    }

    /// Reads and validates a motion file and the robot file that it names.
    ///
    /// # Errors
    /// Returns an error if a file is missing, or all mistakes in the first file that has any.
    pub fn motion(self, path: &Path) -> miette::Result<(Robot, Motion)> {
        self.beside_motion(self.text(path, PathSource::ByUser, Kind::Motion)?)?.parse()
    }

    /// Reads the robot file and the terrain file that a motion file names, and returns all texts.
    ///
    /// # Errors
    /// Returns an error if the motion file does not name a robot file, or if a file that it names is missing.
    pub fn beside_motion(self, motion: TextFile) -> miette::Result<MotionTexts> {
        let TextFile { path, text } = &motion;
        let explain = Kind::Motion.explain(Path::new(path), text);
        let robot = Motion::robot_path_in_toml(path, text).map_err(explain)?;
        let robot = self.named(Path::new(path), &robot, Kind::Robot)?;
        let terrain = self.terrain_beside(&motion)?;
        Ok(MotionTexts { robot, terrain, motion })
    }

    /// Reads and validates a library file, its robot and its motions.
    ///
    /// # Errors
    /// Returns an error if a file is missing or has mistakes, or if the motions do not fit together.
    pub fn library(self, path: &Path) -> miette::Result<Library> {
        let text = self.text(path, PathSource::ByUser, Kind::Library)?;
        let mut beside = RelativeFiles { source: self, path, text: &text.text, robot: None };
        let Contents { robot, file, motions, plans } =
            Contents::read(&text.path, &text.text, &mut beside)?;
        let robot_text = beside.robot.expect("its contents have a robot");
        Ok(Library { robot, file, motions, plans, text, robot_text })
    }

    /// Reads and validates a design file, its robot and its motions.
    ///
    /// # Errors
    /// Returns an error if a file is missing or has mistakes, or if a parameter does not fit the robot.
    pub fn design(self, path: &Path) -> miette::Result<Designed> {
        Ok(self.design_and_texts(path, self.text(path, PathSource::ByUser, Kind::Design)?)?.0)
    }

    /// Validates the text of the design file at `path`, and reads the files that it names. Returns the texts of all of them,
    /// too.
    fn design_and_texts(
        self,
        path: &Path,
        design: TextFile,
    ) -> miette::Result<(Designed, Vec<String>)> {
        let explain = || Kind::Design.explain(path, &design.text);
        let file = DesignFile::from_toml(&design.path, &design.text).map_err(explain())?;
        let robot = NamedText::from(self.named(path, &file.robot, Kind::Robot)?);
        let mut texts = vec![design.text.clone(), robot.text.clone()];
        let motions = file.motions.iter();
        let motions = motions.map(|of| self.motion_with_terrain(path, &of.file, &mut texts));
        let motions = motions.collect::<miette::Result<Vec<_>>>()?;
        Ok((Designed::new(&design.into(), robot, motions).map_err(Report::new)?, texts))
    }

    /// Reads a motion file that the file at `path` names, and its terrain. Appends their texts to `texts`.
    fn motion_with_terrain(
        self,
        path: &Path,
        named: &str,
        texts: &mut Vec<String>,
    ) -> miette::Result<MotionFile> {
        let file = self.named(path, named, Kind::Motion)?;
        texts.push(file.text.clone());
        let terrain = self.terrain_beside(&file)?;
        texts.extend(terrain.iter().map(|terrain| terrain.text.clone()));
        let terrain = terrain.as_ref().map(self::terrain).transpose()?;
        Ok(MotionFile { file: file.into(), terrain })
    }

    /// Reads the terrain file that a motion file names, if it names one.
    fn terrain_beside(self, motion: &TextFile) -> miette::Result<Option<TextFile>> {
        let TextFile { path, text } = motion;
        let explain = Kind::Motion.explain(Path::new(path), text);
        let named = Motion::terrain_path_in_toml(path, text).map_err(explain)?;
        named.map(|named| self.named(Path::new(path), &named, Kind::Terrain)).transpose()
    }

    /// Reads and validates a sweep file, the files that it names, and a servo catalogue. Returns all texts, too, from which
    /// callers compute a digest.
    ///
    /// # Errors
    /// Returns an error if a file is missing or has mistakes, or if an axis does not fit.
    pub fn sweep(
        self,
        path: &Path,
        servos: Option<&Path>,
    ) -> miette::Result<(LoadedSweep, Vec<String>)> {
        let file = self.text(path, PathSource::ByUser, Kind::Sweep)?;
        let sweep = Sweep::from_toml(&file.path, &file.text)
            .map_err(Kind::Sweep.explain(path, &file.text))?;
        let mut texts = vec![file.text.clone()];
        let design = match &sweep.design {
            Some(named) => {
                let design = self.named(path, named, Kind::Design)?;
                let (design, more) =
                    self.design_and_texts(&resolve_relative(path, named), design)?;
                texts.extend(more);
                Some(design)
            }
            None => None,
        };
        let (robots, motions) = sweep.files();
        let mut files = Files::default();
        for name in robots {
            let text = self.named(path, name, Kind::Robot)?;
            texts.push(text.text.clone());
            files.robots.insert(name.clone(), text.into());
        }
        for name in motions {
            let motion = self.motion_with_terrain(path, name, &mut texts)?;
            files.motions.insert(name.clone(), motion);
        }
        let catalog = match servos {
            Some(path) => self.catalog(path)?,
            None => Catalog::shipped(),
        };
        texts.push(format!("{catalog:?}"));
        let ready = LoadedSweep::new(&file.into(), design, files, catalog).map_err(Report::new)?;
        Ok((ready, texts))
    }

    /// Reads and validates a servo catalogue.
    ///
    /// # Errors
    /// Returns an error if the file is missing, or all mistakes in it.
    pub fn catalog(self, path: &Path) -> miette::Result<Catalog> {
        let TextFile { path: name, text } = self.text(path, PathSource::ByUser, Kind::Servos)?;
        Catalog::from_toml(&name, &text).map_err(Kind::Servos.explain(path, &text))
    }

    /// Reads and validates a terrain file.
    ///
    /// # Errors
    /// Returns an error if the file is missing, or all mistakes in it.
    pub fn terrain(self, path: &Path) -> miette::Result<Terrain> {
        terrain(&self.text(path, PathSource::ByUser, Kind::Terrain)?)
    }

    /// Reads a file that the file at `path` contains as `named`.
    fn named(self, path: &Path, named: &str, kind: Kind) -> miette::Result<TextFile> {
        let text = self.text(&resolve_relative(path, named), PathSource::InFile { named }, kind);
        let text = text.wrap_err_with(|| format!("{} names `{named}`", path.display()))?;
        kind.expect_named(path, named, &text.text)?;
        Ok(text)
    }

    fn text(self, path: &Path, named: PathSource<'_>, kind: Kind) -> miette::Result<TextFile> {
        match self {
            Source::Disk => text(path, named, |_| kind),
            Source::Shipped => {
                let text = shipped::text(path);
                let missing = || miette!("rollwalk ships no {kind} named {}", path.display());
                Ok(TextFile::new(path, text.ok_or_else(missing)?.to_owned()))
            }
        }
    }
}

impl From<TextFile> for NamedText {
    fn from(TextFile { path, text }: TextFile) -> Self {
        Self { name: path, text }
    }
}

impl TextFile {
    fn new(path: &Path, text: String) -> Self {
        Self { path: path.to_string_lossy().into_owned(), text }
    }
}

fn text(
    path: &Path,
    named: PathSource<'_>,
    kind_of: impl Fn(&[u8]) -> Kind,
) -> miette::Result<TextFile> {
    let text = files::text(files::read_by(path, named, kind_of)?, path)?;
    Ok(TextFile::new(path, text))
}

/// Reads the text of a motion file or a problem file.
///
/// # Errors
/// Returns an error if the file is missing, too large or not text.
pub fn motion_or_problem(path: &Path) -> miette::Result<TextFile> {
    text(path, PathSource::ByUser, Kind::of_motion_or_problem)
}

/// Checks that the file at a path is not recognised as another kind. Files that are not regular are not read, because their
/// content may be read only once.
///
/// # Errors
/// Returns an error if the file has another kind, is too large or is not text.
pub fn expect(path: &Path, kind: Kind) -> miette::Result<()> {
    let is_text = kind.is_recognised() && !path.metadata().is_ok_and(|found| !found.is_file());
    if !is_text {
        return Ok(());
    }
    let kind_of = |start: &[u8]| match kind {
        Kind::Motion => Kind::of_motion_or_problem(start),
        kind => kind,
    };
    let TextFile { text, .. } = text(path, PathSource::ByUser, kind_of)?;
    let is_problem = kind == Kind::Motion && Kind::is_problem(&text);
    if is_problem { Ok(()) } else { kind.expect(path, &text) }
}

/// Reads and validates a plan.
///
/// # Errors
/// Returns an error if the file is missing, or is not a plan that this version can read.
pub fn plan(path: &Path) -> miette::Result<Plan> {
    let TextFile { path: name, text } = plan_text(path)?;
    Plan::from_json(&name, &text).map_err(Kind::Plan.explain(path, &text))
}

/// Reads the text of a plan.
///
/// # Errors
/// Returns an error if the file is missing, too large or not text.
pub fn plan_text(path: &Path) -> miette::Result<TextFile> {
    text(path, PathSource::ByUser, |_| Kind::Plan)
}

/// Parses the numeric value of an option.
///
/// # Errors
/// Returns an error if the text is not a number or is outside `range`.
pub fn number_within(text: &str, range: RangeInclusive<f64>) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| "is not a number".to_owned())?;
    match range.contains(&value) {
        true => Ok(value),
        false => Err(format!("must be from {} to {}", range.start(), range.end())),
    }
}

/// Resolves a path that the file at `path` contains relative to itself, without `x/..` detours.
pub fn resolve_relative(path: &Path, named: &str) -> PathBuf {
    let mut resolved = path.parent().unwrap_or(Path::new("")).to_owned();
    for part in Path::new(named).components() {
        let detour = part == std::path::Component::ParentDir
            && resolved.file_name().is_some_and(|folder| folder != "..");
        if detour {
            resolved.pop();
        } else {
            resolved.push(part);
        }
    }
    resolved
}

#[cfg(test)]
mod tests {
    use super::resolve_relative;
    use std::path::Path;

    #[test]
    fn named_files_lie_relative_to_the_file_that_names_them() {
        for (from, named, expected) in [
            ("motions/demo.toml", "walk.toml", "motions/walk.toml"),
            ("motions/demo.toml", "../robots/a.toml", "robots/a.toml"),
            ("demo.toml", "../robots/a.toml", "../robots/a.toml"),
            ("../motions/demo.toml", "../robots/a.toml", "../robots/a.toml"),
            ("../../demo.toml", "../a.toml", "../../../a.toml"),
        ] {
            assert_eq!(
                resolve_relative(Path::new(from), named),
                Path::new(expected),
                "{from} {named}"
            );
        }
    }
}
