//! Kinds of input files: their names, size limits and detection. A file of the wrong kind is reported as such, not by a list of
//! unknown keys.

use crate::shipped;
use miette::{Diagnostic, Report, miette};
use rollwalk_multibody::ground::file as terrain;
use rollwalk_planner::plan;
use rollwalk_robot::urdf;
use rollwalk_shipped::FILES;
use std::fmt;
use std::path::Path;
use toml_edit::Document;

/// Value of the field `format` in problem files.
pub const PROBLEM_FORMAT: &str = "rollwalk-problem";

/// Kinds of files that commands read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Robot,
    Motion,
    Library,
    Design,
    /// Servo catalogue.
    Servos,
    /// A sweep over designs.
    Sweep,
    Plan,
    Problem,
    /// URDF or MJCF model.
    Urdf,
    /// Side file of a URDF or MJCF model.
    Side,
    /// Gamepad mapping.
    Gamepad,
    Terrain,
    /// Log of the simulated world.
    WorldLog,
    /// Recorded run: a table, telemetry, or a bus log.
    Run,
    Packed,
    /// Cached motion names of a library.
    Names,
    /// Saved gains of a simulated controller.
    Gains,
    /// Secret that a robot shares with its hosts.
    LinkKey,
    /// Private key that signs libraries.
    PrivateKey,
    /// Public key that controllers store to verify libraries.
    PublicKey,
}

/// Name of the kind in messages.
impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Robot => "robot file (TOML)",
            Self::Motion => "motion file (TOML)",
            Self::Library => "library file (TOML)",
            Self::Design => "design file (TOML)",
            Self::Servos => "servo catalogue (TOML)",
            Self::Sweep => "sweep file (TOML)",
            Self::Plan => "plan (JSON)",
            Self::Problem => "problem file (JSON)",
            Self::Urdf => "URDF or MJCF file (XML)",
            Self::Side => "side file (TOML)",
            Self::Gamepad => "gamepad mapping (TOML)",
            Self::Terrain => "terrain file (TOML)",
            Self::WorldLog => "world log (CSV)",
            Self::Run => "recorded run (CSV, MCAP or candump log)",
            Self::Packed => "motion library",
            Self::Names => "cached list of names (JSON)",
            Self::Gains => "list of saved gains (JSON)",
            Self::LinkKey => "link key",
            Self::PrivateKey => "private key (PEM)",
            Self::PublicKey => "public key (PEM)",
        })
    }
}

impl Kind {
    /// Detects the kind of a text by strings that only one kind contains.
    pub fn of(text: &str) -> Option<Self> {
        if text.trim_start().starts_with('{') {
            // A problem may contain a plan, but with escaped quotes.
            let has = |format: &str| text.contains(&format!("\"{format}\""));
            let marks = [(PROBLEM_FORMAT, Self::Problem), (plan::FORMAT, Self::Plan)];
            return marks.into_iter().find(|(format, _)| has(format)).map(|(_, kind)| kind);
        }
        let beginning = text.trim_start().get(..5);
        if beginning.is_some_and(|start| ["<?xml", "<robo", "<mujo"].contains(&start)) {
            return Some(Self::Urdf);
        }
        // Prose, such as a README, may quote files. The first statement must therefore be one of TOML.
        let mut statements = text.lines().map(str::trim).filter(|line| !line.is_empty());
        let first = statements.find(|line| !line.starts_with('#')).unwrap_or_default();
        let is_header = first.starts_with('[') && first.ends_with(']');
        if !is_header && !first.contains('=') {
            return None;
        }
        let has = |header: &str| text.lines().any(|line| line.trim_start().starts_with(header));
        let marks = [
            ("[[link]]", Self::Robot),
            ("[[motion]]", Self::Library),
            ("[[parameter]]", Self::Design),
        ];
        let marks = marks.into_iter().chain([("[footfalls]", Self::Motion)]);
        // Tables that only side files have. A robot file without links still has joints, limbs or templates.
        let is_side = ["[lock]", "[joint]", "[joint."].into_iter().any(has)
            || has("[[end_effector]]")
                && !["[[joint]]", "[[limb]]", "[template"].into_iter().any(has);
        let marks = marks.chain(is_side.then_some(("[", Self::Side)));
        let mark = marks.into_iter().find(|(header, _)| has(header)).map(|(_, kind)| kind);
        let is_terrain =
            || has("[[obstacle]]") || terrain::kinds().any(|kind| has(&format!("[{kind}]")));
        mark.or_else(|| is_terrain().then_some(Self::Terrain))
    }

    /// True if [`of`](Self::of) recognises files of this kind.
    pub fn is_recognised(self) -> bool {
        match self {
            Self::Robot
            | Self::Motion
            | Self::Library
            | Self::Design
            | Self::Plan
            | Self::Problem
            | Self::Urdf
            | Self::Side
            | Self::Terrain => true,
            Self::Servos
            | Self::Sweep
            | Self::Gamepad
            | Self::WorldLog
            | Self::Run
            | Self::Packed
            | Self::Names
            | Self::Gains
            | Self::LinkKey
            | Self::PrivateKey
            | Self::PublicKey => false,
        }
    }

    /// Paths of the shipped files of this kind.
    pub fn shipped(self) -> impl Iterator<Item = &'static Path> {
        let files = FILES.iter().filter(move |(_, text)| Self::of(text) == Some(self));
        files.map(|(path, _)| Path::new(path))
    }

    /// True if rollwalk ships files of this kind that other files name.
    pub fn is_shipped(self) -> bool {
        matches!(self, Self::Robot | Self::Motion | Self::Design)
    }

    /// True if a text, given as a motion or a problem, is a problem.
    pub fn is_problem(text: &str) -> bool {
        text.trim_start().starts_with('{') && Self::of(text) != Some(Self::Plan)
    }

    /// Maximum size of a file of this kind, bytes; about a hundred times what robots need.
    pub fn max_bytes(self) -> u64 {
        match self {
            Self::Robot
            | Self::Motion
            | Self::Library
            | Self::Design
            | Self::Servos
            | Self::Sweep
            | Self::Side => 1 << 20,
            Self::Gamepad | Self::Names | Self::Gains => 1 << 20,
            // Slightly more than the default size of a file of `--rotate`.
            Self::WorldLog | Self::Run => 256 << 20,
            // 250,000 heights.
            Self::Terrain => 8 << 20,
            Self::LinkKey | Self::PrivateKey | Self::PublicKey => 1 << 10,
            // The maximum number of samples, for the maximum number of joints, takes 10 MB.
            Self::Plan | Self::Packed => 32 << 20,
            // A problem may contain a plan with escaped quotes.
            Self::Problem => 48 << 20,
            Self::Urdf => urdf::TEXT_MAX as u64,
        }
    }

    /// Extensions of files of this kind; none for keys, which may have any.
    pub fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Plan | Self::Problem | Self::Names | Self::Gains => &["json"],
            Self::Urdf => &["urdf", "xml", "mjcf"],
            Self::WorldLog => &["csv"],
            Self::Run => &["csv", "mcap", "log"],
            Self::Packed => &["rwl"],
            Self::LinkKey | Self::PrivateKey | Self::PublicKey => &[],
            _ => &["toml"],
        }
    }

    /// Kind of the file at `path` if it is a value of the command-line argument with this name in help texts, such as
    /// `PLAN.json|LIB.rwl`. `None` for other arguments, and for keys, which commands also write.
    pub fn of_argument(value_name: &str, path: &Path) -> Option<Self> {
        let kind = |name: &str| {
            Some(match name {
                "ROBOT.toml" => Self::Robot,
                "MOTION.toml" => Self::Motion,
                "LIBRARY.toml" => Self::Library,
                "DESIGN.toml" => Self::Design,
                "SWEEP.toml" => Self::Sweep,
                "PLAN.json" => Self::Plan,
                "LIB.rwl" => Self::Packed,
                "RUN.csv" => Self::WorldLog,
                "RUN" => Self::Run,
                "ROBOT.urdf" | "ROBOT.xml" => Self::Urdf,
                _ => return None,
            })
        };
        let kinds: Vec<_> = value_name.split('|').filter_map(kind).collect();
        let extension = path.extension().unwrap_or_default();
        let fits = |kind: &&Self| kind.extensions().iter().any(|known| extension == *known);
        kinds.iter().find(fits).or(kinds.first()).copied()
    }

    /// Advice for a user whose file of the kind is missing.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Robot => "give the path of a robot file, such as robots/agilebot.toml",
            Self::Motion => "write a motion file as docs/motion-files.md describes",
            Self::Library => {
                "give the path of a library file; docs/motion-files.md describes library files"
            }
            Self::Design => "write such a file as docs/design.md describes",
            Self::Servos => {
                "leave out --servos to use the shipped catalogue; docs/design.md describes the \
                 format"
            }
            Self::Sweep => "write such a file as docs/design.md describes",
            Self::Plan => "make one with `rollwalk plan MOTION.toml -o PLAN.json`",
            Self::Problem => {
                "make one with `rollwalk plan MOTION.toml -o PLAN.json --dump PROBLEM.json`"
            }
            Self::Urdf => "give the path of a URDF file",
            Self::Side => "make one with `rollwalk robot import ROBOT.urdf --template SIDE.toml`",
            Self::Gamepad => "write a gamepad mapping as docs/gamepad.md describes",
            Self::Terrain => "write a terrain file as docs/terrain-files.md describes",
            Self::WorldLog => "make one with `rollwalk simulate PLAN --world-log RUN.csv`",
            Self::Run => "record a run as docs/identification.md describes",
            Self::Packed => "make one with `rollwalk library build LIBRARY.toml -o LIB.rwl`",
            Self::Names => "build or flash the library again, which writes this list",
            Self::Gains => "save gains with `rollwalk gains save`",
            Self::LinkKey => "make one with `rollwalk keys new FILE`",
            Self::PrivateKey => "make one with `rollwalk keys new-pair KEY.pem`",
            Self::PublicKey => {
                "make a key pair with `rollwalk keys new-pair KEY.pem`; the public \
                key is KEY.pub.pem"
            }
        }
    }

    /// Kind of a text that is either a motion or a problem, from its first bytes.
    pub fn of_motion_or_problem(start: &[u8]) -> Self {
        let first = start.iter().find(|byte| !byte.is_ascii_whitespace());
        if first == Some(&b'{') { Self::Problem } else { Self::Motion }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Robot => "a robot file",
            Self::Motion => "a motion file",
            Self::Library => "a library file",
            Self::Design => "a design file",
            Self::Servos => "a servo catalogue",
            Self::Sweep => "a sweep file",
            Self::Plan => "a plan",
            Self::Problem => "a problem file",
            Self::Urdf => "a URDF",
            Self::Side => "a side file",
            Self::Gamepad => "a gamepad mapping",
            Self::Terrain => "a terrain file",
            Self::WorldLog => "a world log",
            Self::Run => "a recorded run",
            Self::Packed => "a motion library",
            Self::Names => "a list of names",
            Self::Gains => "a list of saved gains",
            Self::LinkKey => "a link key",
            Self::PrivateKey => "a private key",
            Self::PublicKey => "a public key",
        }
    }

    /// Commands and files that use a file of this kind.
    pub fn use_for(self) -> &'static str {
        match self {
            Self::Robot => {
                "use a robot file with `rollwalk robot check`, or as `robot` in motion and library \
                 files"
            }
            Self::Motion => {
                "use a motion file with `rollwalk plan`, or in [[motion]] of a library file"
            }
            Self::Library => {
                "use a library file with `rollwalk library build` or `rollwalk demo --library`"
            }
            Self::Design => "use a design file with `rollwalk design check`",
            Self::Servos => "use a servo catalogue with `rollwalk design limits --servos`",
            Self::Sweep => "use a sweep file with `rollwalk design explore`",
            Self::Plan => "use a plan with `rollwalk report`, `plot` or `export`",
            Self::Problem => "solve a problem file again with `rollwalk plan`",
            Self::Urdf => "convert a URDF to a robot file with `rollwalk robot import`",
            Self::Side => "use a side file with `rollwalk robot import --with`",
            Self::Gamepad => "use a gamepad mapping with `rollwalk console --mapping`",
            Self::Terrain => {
                "name a terrain file in `terrain` of a motion file, or use it with `--terrain` of \
                 `rollwalk-sim`, `rollwalk demo` or `rollwalk simulate`"
            }
            Self::WorldLog => "draw a world log with `rollwalk plot`",
            Self::Run => "use a recorded run with `rollwalk identify`",
            Self::Packed => {
                "use a motion library with `rollwalk library inspect` or `rollwalk flash`"
            }
            Self::Names => {
                "give another file: this is a list of motion names that rollwalk writes and reads itself"
            }
            Self::Gains => {
                "keep saved gains beside the library that `rollwalk-sim --library` names"
            }
            Self::LinkKey => "use a link key with --link-key",
            Self::PrivateKey => "use a private key with `rollwalk library sign --key`",
            Self::PublicKey => "use a public key with `rollwalk library verify --key`",
        }
    }

    /// Rejects a text that looks like another kind.
    ///
    /// # Errors
    /// Returns an error if the text is recognised as another kind.
    pub fn expect(self, path: &Path, text: &str) -> miette::Result<()> {
        Self::of(text).filter(|found| *found != self).map_or(Ok(()), |found| {
            let library = match (self, found) {
                (Self::Library, Self::Robot) => shipped::library_of(path),
                _ => None,
            };
            let help = library.map_or_else(
                || found.use_for().to_owned(),
                |library| format!("give a library of this robot, such as {}", library.display()),
            );
            let path = path.display();
            let (found, wanted) = (found.name(), self.name());
            Err(miette!(help = help, "{path} is {found}, not {wanted}"))
        })
    }

    /// Rejects the text of a file that the file at `path` names, if it looks like another kind.
    ///
    /// # Errors
    /// Returns an error if the text is recognised as another kind.
    pub fn expect_named(self, path: &Path, named: &str, text: &str) -> miette::Result<()> {
        Self::of(text).filter(|found| *found != self).map_or(Ok(()), |found| {
            let (path, found, wanted) = (path.display(), found.name(), self.name());
            let help = format!("name {wanted} there");
            Err(miette!(help = help, "{path} names `{named}`, which is {found}, not {wanted}"))
        })
    }

    /// Rejects a text that the studio cannot edit. A TOML file that cannot be parsed is accepted, because it may be a document
    /// with a mistake.
    ///
    /// # Errors
    /// Returns an error if the text is recognised as something else.
    pub fn expect_document(path: &Path, text: &str) -> miette::Result<()> {
        const DOCUMENTS: [Kind; 4] = [Kind::Robot, Kind::Motion, Kind::Library, Kind::Design];
        // Keys that only these kinds have, also if no table has the name.
        const KEYS: [&str; 5] = ["link", "footfalls", "motion", "motions", "parameter"];
        let is_toml = path.extension().is_some_and(|extension| extension == "toml");
        let is_document =
            |document: Document<&str>| KEYS.iter().any(|key| document.as_table().contains_key(key));
        let parsed = Document::parse(text);
        // Other texts get help on how to write such a file.
        let may_be = is_toml || parsed.is_ok();
        let (what, help) = match Self::of(text) {
            Some(kind) if DOCUMENTS.contains(&kind) && may_be => return Ok(()),
            Some(kind) if !DOCUMENTS.contains(&kind) => (kind.name(), kind.use_for()),
            None if is_toml && parsed.map_or(true, is_document) => return Ok(()),
            _ => (
                "a file of another kind",
                "open the shipped robots and motions with `rollwalk studio` without a file",
            ),
        };
        let path = path.display();
        Err(miette!(
            help = help,
            "{path} is {what}; the studio opens robot, motion, library and design files (TOML)"
        ))
    }

    /// Converts a parse error of this kind into a report. If the text is recognised as another kind, the report names that kind
    /// instead.
    pub fn explain<E>(self, path: &Path, text: &str) -> impl FnOnce(E) -> Report
    where
        E: Diagnostic + Send + Sync + 'static,
    {
        move |error| self.expect(path, text).err().unwrap_or_else(|| Report::new(error))
    }
}

#[cfg(test)]
mod tests {
    use super::Kind;

    #[test]
    fn side_files_differ_from_robot_files() {
        let end = "name = \"a\"\n[[end_effector]]\nname = \"foot\"\n";
        for side in ["[lock]\nmast = 0.1\n", "[joint]\nhip = { bus = 1 }\n", "[joint.hip]\n", end] {
            assert_eq!(Kind::of(side), Some(Kind::Side), "{side}");
            assert!(Kind::Side.is_recognised());
        }
        for robot in ["[[joint]]\n[joint.spring]\n[[link]]\n", &format!("{end}[[link]]\n")] {
            assert_eq!(Kind::of(robot), Some(Kind::Robot), "{robot}");
        }
        assert_eq!(Kind::of(&format!("{end}[[limb]]\n")), None);
        let error = Kind::Robot.expect("a.side.toml".as_ref(), end).unwrap_err();
        assert_eq!(error.to_string(), "a.side.toml is a side file, not a robot file");
        let help = "use a side file with `rollwalk robot import --with`";
        assert_eq!(error.help().unwrap().to_string(), help);
    }

    #[test]
    fn a_named_file_of_another_kind_is_reported_with_the_file_that_names_it() {
        let named = |text| Kind::Robot.expect_named("walk.toml".as_ref(), "../trot.toml", text);
        assert!(named("[[link]]\n").is_ok());
        let error = named("name = \"trot\"\n[footfalls]\n").unwrap_err();
        let words = "walk.toml names `../trot.toml`, which is a motion file, not a robot file";
        assert_eq!(error.to_string(), words);
        assert_eq!(error.help().unwrap().to_string(), "name a robot file there");
    }

    #[test]
    fn a_document_that_quotes_a_file_is_none() {
        let robot = "# Pup\n\nname = \"pup\"\n[[link]]\n";
        assert_eq!(Kind::of(robot), Some(Kind::Robot));
        assert_eq!(Kind::of("[[link]]\n"), Some(Kind::Robot));
        assert_eq!(Kind::of("[[obstacle]]\n"), Some(Kind::Terrain));
        assert_eq!(Kind::of(&format!("# Pup\n\nRobots walk.\n\n```toml\n{robot}```\n")), None);
    }

    #[test]
    fn shipped_files_are_recognised() {
        for (path, text) in rollwalk_shipped::FILES {
            let kind = match path.split_once('/').unwrap() {
                ("robots", _) => Some(Kind::Robot),
                ("motions", name) if name.ends_with("_library.toml") => Some(Kind::Library),
                ("motions", _) => Some(Kind::Motion),
                ("designs", name) if !name.ends_with("_sweep.toml") => Some(Kind::Design),
                _ => None,
            };
            assert_eq!(Kind::of(text), kind, "{path}");
            assert!(kind.is_none_or(Kind::is_recognised), "{path}");
        }
    }
}
