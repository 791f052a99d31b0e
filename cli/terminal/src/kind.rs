//! The kinds of files that are read: their names, their bounds, and what a text is. Giving one kind where another belongs
//! is an easy slip, and deserves better than a list of unknown keys.

use miette::{Diagnostic, Report, miette};
use rollwalk_multibody::ground::file as terrain;
use rollwalk_planner::plan;
use rollwalk_robot::urdf;
use std::fmt;
use std::path::Path;
use toml_edit::Document;

/// Word in the field `format` of problem files.
pub const PROBLEM_FORMAT: &str = "rollwalk-problem";

/// The kinds of files that commands read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Robot,
    Motion,
    Library,
    Design,
    /// A catalogue of servos.
    Servos,
    /// A sweep over designs.
    Sweep,
    Plan,
    Problem,
    /// A URDF, or an MJCF model.
    Urdf,
    /// A side file of a URDF.
    Side,
    /// A mapping of a gamepad.
    Gamepad,
    Terrain,
    /// A log of the simulated world.
    WorldLog,
    /// A recorded run: a table, telemetry, or a log of buses.
    Run,
    Packed,
    /// Names of a library's motions, in the user's cache.
    Names,
    /// The secret of a robot and its hosts.
    LinkKey,
    /// The half of a key pair that signs libraries.
    PrivateKey,
    /// The half of a key pair that controllers have.
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
            Self::Servos => "catalogue of servos (TOML)",
            Self::Sweep => "sweep file (TOML)",
            Self::Plan => "plan (JSON)",
            Self::Problem => "problem file (JSON)",
            Self::Urdf => "URDF or MJCF file (XML)",
            Self::Side => "side file (TOML)",
            Self::Gamepad => "gamepad mapping (TOML)",
            Self::Terrain => "terrain file (TOML)",
            Self::WorldLog => "log of a world (CSV)",
            Self::Run => "recorded run (CSV, MCAP, or a log of candump)",
            Self::Packed => "motion library",
            Self::Names => "cached list of names (JSON)",
            Self::LinkKey => "link key",
            Self::PrivateKey => "private key (PEM)",
            Self::PublicKey => "public key (PEM)",
        })
    }
}

impl Kind {
    /// Kind of a text, by words that only one kind has.
    pub fn of(text: &str) -> Option<Self> {
        if text.trim_start().starts_with('{') {
            // A problem may carry a plan; the quotes of that are escaped.
            let has = |format: &str| text.contains(&format!("\"{format}\""));
            let marks = [(PROBLEM_FORMAT, Self::Problem), (plan::FORMAT, Self::Plan)];
            return marks.into_iter().find(|(format, _)| has(format)).map(|(_, kind)| kind);
        }
        let beginning = text.trim_start().get(..5);
        if beginning.is_some_and(|start| ["<?xml", "<robo", "<mujo"].contains(&start)) {
            return Some(Self::Urdf);
        }
        let has = |header: &str| text.lines().any(|line| line.trim_start().starts_with(header));
        let marks = [
            ("[[link]]", Self::Robot),
            ("[[motion]]", Self::Library),
            ("[[parameter]]", Self::Design),
        ];
        let marks = marks.into_iter().chain([("[footfalls]", Self::Motion)]);
        let mark = marks.into_iter().find(|(header, _)| has(header)).map(|(_, kind)| kind);
        let is_terrain = || terrain::kinds().any(|kind| has(&format!("[{kind}]")));
        mark.or_else(|| is_terrain().then_some(Self::Terrain))
    }

    /// True if a text that can be a motion or a problem is meant to be a problem.
    pub fn is_problem(text: &str) -> bool {
        text.trim_start().starts_with('{') && Self::of(text) != Some(Self::Plan)
    }

    /// Most bytes of such a file; the bounds are a hundred times what robots need.
    pub fn max_bytes(self) -> u64 {
        match self {
            Self::Robot
            | Self::Motion
            | Self::Library
            | Self::Design
            | Self::Servos
            | Self::Sweep
            | Self::Side => 1 << 20,
            Self::Gamepad | Self::Names => 1 << 20,
            // A file of `--rotate`: some ten minutes.
            Self::WorldLog | Self::Run => 256 << 20,
            // 250,000 heights.
            Self::Terrain => 8 << 20,
            Self::LinkKey | Self::PrivateKey | Self::PublicKey => 1 << 10,
            // The most samples of a robot with the most joints are 10 MB.
            Self::Plan | Self::Packed => 32 << 20,
            // It may carry a plan, whose quotes are escaped.
            Self::Problem => 48 << 20,
            Self::Urdf => urdf::TEXT_MAX as u64,
        }
    }

    /// Advice for a missing file of this kind.
    pub fn hint(self) -> &'static str {
        match self {
            Self::Robot => "give the path of a robot file, such as robots/agilebot.toml",
            Self::Motion => "docs/motion-files.md shows how to write one",
            Self::Library => "give the path of a library file; docs/motion-files.md describes them",
            Self::Design => "docs/design.md shows how to write one",
            Self::Servos => {
                "leave --servos out for the catalogue that ships; docs/design.md has the format"
            }
            Self::Sweep => "docs/design.md shows how to write one",
            Self::Plan => "make one with `rollwalk plan MOTION.toml -o PLAN.json`",
            Self::Problem => {
                "make one with `rollwalk plan MOTION.toml -o PLAN.json --dump PROBLEM.json`"
            }
            Self::Urdf => "give the path of a URDF file",
            Self::Side => "make one with `rollwalk robot import ROBOT.urdf --template SIDE.toml`",
            Self::Gamepad => "docs/gamepad.md shows how to write one",
            Self::Terrain => "docs/terrain-files.md shows how to write one",
            Self::WorldLog => "make one with `rollwalk simulate PLAN --world-log RUN.csv`",
            Self::Run => "docs/identification.md says how to record one",
            Self::Packed => "make one with `rollwalk library build LIBRARY.toml -o LIB.rwl`",
            Self::Names => "every build and flash of a library makes one",
            Self::LinkKey => "make one with `rollwalk keys new FILE`",
            Self::PrivateKey => "make one with `rollwalk keys new-pair KEY.pem`",
            Self::PublicKey => "`rollwalk keys new-pair KEY.pem` makes one, KEY.pub.pem",
        }
    }

    /// The kind of a text where a motion or a problem may be given, by its beginning.
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
            Self::Servos => "a catalogue of servos",
            Self::Sweep => "a sweep file",
            Self::Plan => "a plan",
            Self::Problem => "a problem file",
            Self::Urdf => "a URDF",
            Self::Side => "a side file",
            Self::Gamepad => "a gamepad mapping",
            Self::Terrain => "a terrain file",
            Self::WorldLog => "a log of a world",
            Self::Run => "a recorded run",
            Self::Packed => "a motion library",
            Self::Names => "a list of names",
            Self::LinkKey => "a link key",
            Self::PrivateKey => "a private key",
            Self::PublicKey => "a public key",
        }
    }

    fn use_for(self) -> &'static str {
        match self {
            Self::Robot => {
                "`rollwalk robot check` reads it; motion and library files name it as `robot`"
            }
            Self::Motion => "`rollwalk plan` reads it; library files name it in [[motion]]",
            Self::Library => "`rollwalk library build` and `rollwalk demo --library` read it",
            Self::Design => "`rollwalk design check` reads it",
            Self::Servos => "`rollwalk design limits --servos` reads it",
            Self::Sweep => "`rollwalk design explore` reads it",
            Self::Plan => "`rollwalk report`, `plot` and `export` read it",
            Self::Problem => "`rollwalk plan` solves it again",
            Self::Urdf => "`rollwalk robot import` makes a robot file of it",
            Self::Side => "`rollwalk robot import --with` reads it",
            Self::Gamepad => "`rollwalk console --mapping` reads it",
            Self::Terrain => {
                "`--terrain` of `rollwalk-sim`, `rollwalk demo` and `rollwalk simulate` reads it"
            }
            Self::WorldLog => "`rollwalk plot` draws it",
            Self::Run => "`rollwalk identify` reads it",
            Self::Packed => "`rollwalk library inspect` and `rollwalk flash` read it",
            Self::Names => "rollwalk keeps it for itself",
            Self::LinkKey => "--link-key takes it",
            Self::PrivateKey => "`rollwalk library sign --key` takes it",
            Self::PublicKey => "`rollwalk library verify --key` takes it",
        }
    }

    /// Rejects a text that looks like another kind.
    ///
    /// # Errors
    /// It does.
    pub fn expect(self, path: &Path, text: &str) -> miette::Result<()> {
        Self::of(text).filter(|found| *found != self).map_or(Ok(()), |found| {
            let path = path.display();
            let (found, wanted, help) = (found.name(), self.name(), found.use_for());
            Err(miette!(help = help, "{path} is {found}, not {wanted}"))
        })
    }

    /// Rejects a text that is none of the documents that the studio edits. A TOML file that cannot be parsed may be one.
    ///
    /// # Errors
    /// It is something else.
    pub fn expect_document(path: &Path, text: &str) -> miette::Result<()> {
        const DOCUMENTS: [Kind; 4] = [Kind::Robot, Kind::Motion, Kind::Library, Kind::Design];
        // Keys that only these have, also where no table has the name.
        const KEYS: [&str; 5] = ["link", "footfalls", "motion", "motions", "parameter"];
        let is_toml = path.extension().is_some_and(|extension| extension == "toml");
        let is_document =
            |document: Document<&str>| KEYS.iter().any(|key| document.as_table().contains_key(key));
        let parsed = Document::parse(text);
        // Other texts show how to write such files.
        let may_be = is_toml || parsed.is_ok();
        let (what, help) = match Self::of(text) {
            Some(kind) if DOCUMENTS.contains(&kind) && may_be => return Ok(()),
            Some(kind) if !DOCUMENTS.contains(&kind) => (kind.name(), kind.use_for()),
            None if is_toml && parsed.map_or(true, is_document) => return Ok(()),
            _ => (
                "something else",
                "without a file, `rollwalk studio` has the robots and motions that ship",
            ),
        };
        let path = path.display();
        Err(miette!(
            help = help,
            "the studio opens robot, motion, library and design files (TOML), and {path} is {what}"
        ))
    }

    /// Turns the error of a reader of this kind into a report: that the file is of another kind, if it
    /// looks so, else everything that is wrong in it.
    pub fn explain<E>(self, path: &Path, text: &str) -> impl FnOnce(E) -> Report
    where
        E: Diagnostic + Send + Sync + 'static,
    {
        move |error| self.expect(path, text).err().unwrap_or_else(|| Report::new(error))
    }
}
