//! Telemetry in files that follow each other, each of which Foxglove opens by itself.

use miette::{Report, miette};
use rollwalk_host::joints::Known;
use rollwalk_host::telemetry::Telemetry;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::wire::Node;
use rollwalk_terminal::files::{Output, Rotation, Series};
use std::fmt::Display;
use std::fs::File;
use std::io::BufWriter;
use std::mem;

/// Telemetry that is being written.
pub struct Recording<'a> {
    node: Node,
    known: Option<Known<'a>>,
    series: Series,
    telemetry: Telemetry<'a, BufWriter<File>>,
}

fn failed(error: impl Display) -> Report {
    miette!("the telemetry: {error}")
}

impl<'a> Recording<'a> {
    /// An empty file about controller `node`.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn begin(
        output: &Output,
        rotation: Rotation,
        node: Node,
        known: Option<Known<'a>>,
    ) -> miette::Result<Self> {
        let (series, file) = Series::begin(output, rotation)?;
        let telemetry = Telemetry::new(file, node, known).map_err(failed)?;
        Ok(Self { node, known, series, telemetry })
    }

    /// Takes a frame of the link, received at `at_us` microseconds since 1970.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn take(&mut self, at_us: u64, frame: &Frame) -> miette::Result<()> {
        self.telemetry.on_frame(at_us, frame).map_err(failed)?;
        self.keep()
    }

    /// Writes what waits, once a second.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn keep(&mut self) -> miette::Result<()> {
        if self.series.is_due() {
            self.telemetry.flush().map_err(failed)?;
            if let Some(file) = self.series.next_file()? {
                let next = Telemetry::new(file, self.node, self.known).map_err(failed)?;
                mem::replace(&mut self.telemetry, next).finish().map_err(failed)?;
            }
        }
        Ok(())
    }

    /// Ends the file.
    ///
    /// # Errors
    /// The operating system refuses.
    pub fn finish(self) -> miette::Result<()> {
        self.telemetry.finish().map_err(failed)
    }
}
