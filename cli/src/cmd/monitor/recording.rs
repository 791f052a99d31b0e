//! Telemetry in a series of files; Foxglove can open each file separately.

use miette::{Report, miette};
use rollwalk_host::joints::RobotContext;
use rollwalk_host::telemetry::Telemetry;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_terminal::files::{Output, Rotation, Series};
use std::error::Error;
use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::{iter, mem};

/// Telemetry file that is being written.
pub struct Recording<'a> {
    node: Node,
    known: Option<RobotContext<'a>>,
    path: PathBuf,
    series: Series,
    telemetry: Telemetry<'a, BufWriter<File>>,
}

/// Error of a write to the telemetry file, with the reason of the operating system.
fn cannot_write(path: &Path, error: &(dyn Error + 'static)) -> Report {
    let reason = iter::successors(Some(error), |&error| error.source()).last().unwrap_or(error);
    miette!("cannot write the telemetry to {}: {reason}", path.display())
}

impl<'a> Recording<'a> {
    /// Creates an empty file for the telemetry of controller `node`.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn begin(
        output: &Output,
        rotation: Rotation,
        node: Node,
        known: Option<RobotContext<'a>>,
    ) -> miette::Result<Self> {
        let (series, file) = Series::begin(output, rotation)?;
        let path = output.path().to_owned();
        let telemetry = Telemetry::new(file, node, known).map_err(|e| cannot_write(&path, &e))?;
        Ok(Self { node, known, path, series, telemetry })
    }

    /// Records a frame of the link, received at `at_us` microseconds since 1970.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn take(&mut self, at_us: u64, frame: &Frame) -> miette::Result<()> {
        self.telemetry.on_frame(at_us, frame).map_err(|e| cannot_write(&self.path, &e))?;
        self.keep()
    }

    /// Writes buffered telemetry once a second, and starts the next file if this one is full.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn keep(&mut self) -> miette::Result<()> {
        let failed = |e| cannot_write(&self.path, &e);
        if self.series.is_due() {
            self.telemetry.flush().map_err(failed)?;
            if let Some(file) = self.series.next_file()? {
                let next = Telemetry::new(file, self.node, self.known).map_err(failed)?;
                mem::replace(&mut self.telemetry, next).finish().map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// Returns an error if the operating system refuses.
    pub fn finish(self) -> miette::Result<()> {
        self.telemetry.finish().map_err(|e| cannot_write(&self.path, &e))
    }
}
