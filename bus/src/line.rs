//! The two ends of a serial line or socket: reading that waits a little, and writing that does not wait.
//!
//! A device that takes no bytes, such as an adapter whose CAN bus is dead, blocks whoever writes to it for as long
//! as it likes. So a thread does: what it has not written yet is a few lines, and when it gets nowhere the line is
//! down. A program that reads keys, sends heartbeats or ticks a controller goes on meanwhile.

use crate::link::LinkError;
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Lines that are not written yet at most: what waits here cannot be replaced by something newer.
const WAITING: usize = 4;
/// A line that takes nothing for so long is down: longer than a USB adapter stalls.
const DEAD: Duration = Duration::from_millis(250);
/// Longest wait at the end for what is not written yet.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// Writes lines, whole and in their order.
pub(crate) struct LineWriter {
    name: String,
    /// `None` when it ends.
    lines: Option<Sender<Vec<u8>>>,
    waiting: Arc<AtomicUsize>,
    failed: Arc<Mutex<Option<io::Error>>>,
    /// Never says anything; hangs up when all is written.
    done: Receiver<()>,
    /// Since when there has been no room.
    full_since: Option<Instant>,
}

impl LineWriter {
    pub fn new(name: &str, mut writer: impl Write + Send + 'static) -> Self {
        let (lines, to_write) = channel::<Vec<u8>>();
        let (waiting, failed) = (Arc::new(AtomicUsize::new(0)), Arc::new(Mutex::new(None)));
        let (working, done) = channel::<()>();
        let (left, failure) = (Arc::clone(&waiting), Arc::clone(&failed));
        thread::spawn(move || {
            let _working = working;
            for line in to_write {
                if let Err(error) = write_all(&mut writer, &line) {
                    *failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                    return;
                }
                left.fetch_sub(1, Ordering::Relaxed);
            }
        });
        Self { name: name.to_owned(), lines: Some(lines), waiting, failed, done, full_since: None }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether another line would be taken.
    pub fn has_room(&self) -> bool {
        self.waiting.load(Ordering::Relaxed) < WAITING
    }

    /// Takes a line.
    ///
    /// # Errors
    /// [`LinkError::Busy`] without room, otherwise why the line is down.
    pub fn put(&mut self, line: &[u8]) -> Result<(), LinkError> {
        self.ready()?;
        self.waiting.fetch_add(1, Ordering::Relaxed);
        // Nobody to take it has failed, and says so next time.
        let _ = self.lines.as_ref().map(|lines| lines.send(line.to_vec()));
        Ok(())
    }

    /// Whether a line would be taken now.
    ///
    /// # Errors
    /// As [`Self::put`].
    pub fn ready(&mut self) -> Result<(), LinkError> {
        if let Some(error) = &*self.failed.lock().unwrap_or_else(PoisonError::into_inner) {
            return Err(gone(&self.name, error));
        }
        if self.has_room() {
            self.full_since = None;
            return Ok(());
        }
        if self.full_since.get_or_insert_with(Instant::now).elapsed() < DEAD {
            return Err(LinkError::Busy);
        }
        let name = &self.name;
        Err(LinkError::Down(format!(
            "{name} takes nothing any more: unplug it and plug it in again"
        )))
    }
}

impl Drop for LineWriter {
    fn drop(&mut self) {
        self.lines = None;
        // It hangs up, or never will.
        let _: Result<(), RecvTimeoutError> = self.done.recv_timeout(LAST_WORDS);
    }
}

/// Writes all, however often the device wants to be asked again.
fn write_all(writer: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
    while !bytes.is_empty() {
        match writer.write(bytes) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(count) => bytes = &bytes[count..],
            Err(error) => match error.kind() {
                io::ErrorKind::Interrupted
                | io::ErrorKind::TimedOut
                | io::ErrorKind::WouldBlock => {}
                _ => return Err(error),
            },
        }
    }
    Ok(())
}

/// Reads what is there; 0 bytes when nothing came for a while.
pub(crate) fn read(
    name: &str,
    reader: &mut impl Read,
    bytes: &mut [u8],
) -> Result<usize, LinkError> {
    match reader.read(bytes) {
        Ok(0) => Err(LinkError::Down(format!("{name}: the other end hung up"))),
        Ok(count) => Ok(count),
        Err(error) => match error.kind() {
            io::ErrorKind::Interrupted | io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => {
                Ok(0)
            }
            _ => Err(gone(name, &error)),
        },
    }
}

/// A line failed for good.
pub(crate) fn gone(name: &str, error: &io::Error) -> LinkError {
    let unplugged = matches!(error.kind(), io::ErrorKind::BrokenPipe | io::ErrorKind::NotFound)
        || matches!(
            error.raw_os_error(),
            Some(INPUT_OUTPUT | NO_SUCH_DEVICE_OR_ADDRESS | NO_DEVICE)
        );
    let why = if unplugged {
        format!("{name} is gone: was it unplugged? ({error})")
    } else {
        format!("{name}: {error}")
    };
    LinkError::Down(why)
}

/// `EIO`, `ENXIO` and `ENODEV` of Linux: what a serial adapter says when it is not there any more.
const INPUT_OUTPUT: i32 = 5;
const NO_SUCH_DEVICE_OR_ADDRESS: i32 = 6;
const NO_DEVICE: i32 = 19;

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    #[test]
    fn lines_arrive_whole_and_in_order_also_the_last_ones() {
        let (near, mut far) = UnixStream::pair().unwrap();
        let mut line = LineWriter::new("a line", near);
        for number in 0..100u8 {
            while !line.has_room() {
                thread::yield_now();
            }
            line.put(&[number; 30]).unwrap();
        }
        drop(line);
        let mut all = Vec::new();
        far.read_to_end(&mut all).unwrap();
        let expected: Vec<u8> = (0..100).flat_map(|number| [number; 30]).collect();
        assert_eq!(all, expected);
    }

    #[test]
    fn a_device_that_takes_nothing_holds_up_nobody_and_is_down_soon() {
        let (near, far) = UnixStream::pair().unwrap();
        let mut line = LineWriter::new("a line", near);
        let start = Instant::now();
        let why = loop {
            match line.put(&[7; 500]) {
                Ok(()) => {}
                Err(LinkError::Busy) => thread::sleep(Duration::from_millis(1)),
                Err(why) => break why,
            }
            assert!(start.elapsed() < Duration::from_secs(60), "it never says so");
        };
        assert!(why.to_string().contains("a line takes nothing any more: unplug it"), "{why}");
        // Nor does the end wait for it.
        drop(line);
        drop(far);
    }

    #[test]
    fn a_line_that_fails_says_why() {
        let (near, far) = UnixStream::pair().unwrap();
        drop(far);
        let mut line = LineWriter::new("a line", near);
        let start = Instant::now();
        let why = loop {
            match line.put(&[7]) {
                Ok(()) | Err(LinkError::Busy) => thread::sleep(Duration::from_millis(1)),
                Err(why) => break why,
            }
            assert!(start.elapsed() < Duration::from_secs(60), "it never says so");
        };
        assert!(why.to_string().contains("a line is gone"), "{why}");
    }
}
