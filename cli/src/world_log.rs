//! Log of the simulated world (`--world-log`): a table with a line for each simulation step (`docs/formats/world-log.md`).

use miette::miette;
use rollwalk_host::catalog::Catalog;
use rollwalk_physics::World;
use rollwalk_protocol::library::{ClipId, Library};
use rollwalk_robot::Robot;
use rollwalk_sim_host::body::Body;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::rig::{Observer, Rig};
use rollwalk_simulate::log::{self, Moment};
use rollwalk_terminal::files::{self, Lines, Output, Rotation};
use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::rc::Rc;

/// Option of commands that simulate a world.
#[derive(clap::Args)]
pub struct WorldLogArgs {
    /// Write the robot's motion in its world as a table, one line for each step: pose, motors, set-points, ground forces.
    #[arg(long, value_name = "FILE.csv")]
    world_log: Option<PathBuf>,
}

impl WorldLogArgs {
    /// Path of the log, if one was requested.
    pub fn path(&self) -> Option<&Path> {
        self.world_log.as_deref()
    }

    /// Starts the log, if one was requested.
    ///
    /// # Errors
    /// Returns an error if the log cannot be written.
    pub fn begin(&self, robot: &Robot, rotation: Rotation) -> miette::Result<Option<WorldLog>> {
        let Some(path) = &self.world_log else { return Ok(None) };
        files::ending(path, "a world log", &["csv"])?;
        if path.as_os_str() == "-" {
            return Err(miette!(
                help = "give a file or a pipe",
                "a world log cannot be written to standard output, which contains the report"
            ));
        }
        let lines = Lines::with_heading(&Output::at(path)?, rotation, log::heading(robot))?;
        let rows = log::Lines::default();
        Ok(Some(WorldLog { lines, rows, library: None, written_s: 0.0, failed: None }))
    }
}

/// Growing log.
pub struct WorldLog {
    lines: Lines,
    rows: log::Lines,
    /// Identity and names of the library that is playing.
    library: Option<(u32, Catalog)>,
    /// Simulated time of the previous line, s.
    written_s: f64,
    failed: Option<miette::Report>,
}

impl WorldLog {
    /// Adds a line.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn add(&mut self, moment: &Moment<'_>, world: &World) -> miette::Result<()> {
        self.lines.push(self.rows.next(moment, world))
    }

    /// Writes buffered lines to the file.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses, or refused in an earlier step.
    pub fn end(&mut self) -> miette::Result<()> {
        self.failed.take().map_or(Ok(()), Err)?;
        self.lines.flush()
    }

    /// Sets the names of the library that plays from now on.
    fn name_clips(&mut self, library: Option<&Library<'_>>) {
        let id = library.map(|library| library.index().id());
        if self.library.as_ref().map(|(known, _)| *known) != id {
            let catalog = library.and_then(|library| Catalog::of(library, "", Vec::new()));
            self.library = id.zip(catalog);
        }
    }

    fn clip_name(&self, clip: ClipId) -> Option<String> {
        self.library.as_ref()?.1.clip(clip.0)
    }
}

impl Observer for WorldLog {
    fn on_motor_step(&mut self, _: SimTime, body: &Body) {
        let Some(ground) = body.ground() else { return };
        let time_s = ground.world().system().time_s();
        // Motors make many steps in one step of the world.
        if time_s <= self.written_s || self.failed.is_some() {
            return;
        }
        self.written_s = time_s;
        let motion = ground.playing().and_then(|clip| self.clip_name(clip)).unwrap_or_default();
        let moment = Moment {
            time_s,
            motion: &motion,
            is_held: ground.is_held(),
            has_fallen: ground.has_fallen(),
        };
        self.failed = self.add(&moment, ground.world()).err();
    }
}

/// Log that an observer writes while its owner checks it.
#[derive(Clone)]
pub struct SharedLog(Rc<RefCell<WorldLog>>);

impl SharedLog {
    /// Shares a log.
    pub fn new(log: WorldLog) -> Self {
        Self(Rc::new(RefCell::new(log)))
    }

    /// Writes a line for each step of a robot's world from now on.
    pub fn attach(log: WorldLog, rig: &mut Rig<LocalController>) -> Self {
        let log = Self::new(log);
        rig.set_observer(log.clone());
        log
    }

    /// True if all lines were written.
    pub fn is_sound(&self) -> bool {
        self.0.borrow().failed.is_none()
    }

    /// Updates the names after a change of the library that plays.
    ///
    /// # Errors
    /// Returns an error if a line could not be written.
    pub fn on_time(&self, rig: &Rig<LocalController>) -> miette::Result<()> {
        let mut log = self.0.borrow_mut();
        log.name_clips(rig.core().controller().library().as_ref());
        log.failed.take().map_or(Ok(()), Err)
    }

    /// Writes buffered lines to the file.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses, or refused in an earlier step.
    pub fn end(&self) -> miette::Result<()> {
        self.0.borrow_mut().end()
    }
}

impl Observer for SharedLog {
    fn on_motor_step(&mut self, at: SimTime, body: &Body) {
        self.0.borrow_mut().on_motor_step(at, body);
    }
}
