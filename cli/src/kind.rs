//! What kind of file a text is: giving one kind where another belongs is an easy slip, and deserves
//! better than a list of unknown keys.

use crate::problem;
use miette::{Diagnostic, Report, miette};
use rollwalk_planner::plan;
use std::path::Path;

/// The kinds of text that commands read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A robot file.
    Robot,
    /// A motion file.
    Motion,
    /// A library file.
    Library,
    /// A plan.
    Plan,
    /// A problem file.
    Problem,
    /// A URDF.
    Urdf,
}

impl Kind {
    /// What a text looks like by the words that only one kind has.
    fn of(text: &str) -> Option<Self> {
        if text.trim_start().starts_with('{') {
            // A problem may carry a plan; the quotes of that are escaped.
            let has = |format: &str| text.contains(&format!("\"{format}\""));
            let marks = [(problem::FORMAT, Self::Problem), (plan::FORMAT, Self::Plan)];
            return marks.into_iter().find(|(format, _)| has(format)).map(|(_, kind)| kind);
        }
        let beginning = text.trim_start().get(..5);
        if beginning.is_some_and(|start| start == "<?xml" || start == "<robo") {
            return Some(Self::Urdf);
        }
        let has = |header: &str| text.lines().any(|line| line.trim_start().starts_with(header));
        let marks = [("[[link]]", Self::Robot), ("[[motion]]", Self::Library)];
        let marks = marks.into_iter().chain([("[footfalls]", Self::Motion)]);
        marks.into_iter().find(|(header, _)| has(header)).map(|(_, kind)| kind)
    }

    /// Whether a text that can be a motion or a problem is meant to be a problem.
    pub fn is_problem(text: &str) -> bool {
        text.trim_start().starts_with('{') && Self::of(text) != Some(Self::Plan)
    }

    fn name(self) -> &'static str {
        match self {
            Self::Robot => "a robot file",
            Self::Motion => "a motion file",
            Self::Library => "a library file",
            Self::Plan => "a plan",
            Self::Problem => "a problem file",
            Self::Urdf => "a URDF",
        }
    }

    fn use_for(self) -> &'static str {
        match self {
            Self::Robot => {
                "`rollwalk robot check` reads it; motion and library files name it as `robot`"
            }
            Self::Motion => "`rollwalk plan` reads it; library files name it in [[motion]]",
            Self::Library => "`rollwalk library build` and `rollwalk demo --library` read it",
            Self::Plan => "`rollwalk report`, `plot` and `export` read it",
            Self::Problem => "`rollwalk plan` solves it again",
            Self::Urdf => "`rollwalk robot import` makes a robot file of it",
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

    /// Turns the error of a reader of this kind into a report: that the file is of another kind, if it
    /// looks so, else everything that is wrong in it.
    pub fn explain<E>(self, path: &Path, text: &str) -> impl FnOnce(E) -> Report
    where
        E: Diagnostic + Send + Sync + 'static,
    {
        move |error| self.expect(path, text).err().unwrap_or_else(|| Report::new(error))
    }
}
