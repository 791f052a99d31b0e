//! The two ends of a serial line or socket: reading that waits a little, and writing that does not wait.
//!
//! A device that takes no bytes, such as an adapter whose CAN bus is dead, blocks whoever writes to it for as long
//! as it likes. So a thread does: what it has not written yet is a few lines, and when it gets nowhere the line is
//! down. A program that reads keys, sends heartbeats or ticks a controller goes on meanwhile.
//!
//! A line counts as written when the kernel has taken it. What waits in the kernel's buffer comes on top, is out of
//! reach and may be late: commands carry the time until which they are valid.

use crate::link::LinkError;
use rollwalk_protocol::wire::HOST_TIMEOUT_MS;
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Lines that are not written yet at most: what waits here cannot be replaced by something newer.
const WAITING: usize = 4;
/// A line that takes nothing for so long is down: by then a robot behind it has lost its host anyway.
const DEAD: Duration = Duration::from_millis(HOST_TIMEOUT_MS as u64);
/// Longest wait at the end for what is not written yet.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// Writes lines, whole and in their order.
pub(crate) struct LineWriter {
    name: String,
    /// `None` when it ends.
    lines: Option<Sender<Vec<u8>>>,
    shared: Arc<Shared>,
    /// Never says anything; hangs up when all is written.
    done: Receiver<()>,
}

/// What a writer and its thread know of one another.
struct Shared {
    /// Lines that are not written yet.
    waiting: AtomicUsize,
    /// When the device took something last, or the first of what waits was put.
    moved: Mutex<Instant>,
    failed: Mutex<Option<io::Error>>,
    /// The writer was let go of: what the device does not take at once is not said any more.
    over: AtomicBool,
}

impl LineWriter {
    /// Writes to a device. One that also returns when it takes nothing, after a while, is let go of soon after
    /// the writer.
    pub fn new(name: &str, mut writer: impl Write + Send + 'static) -> Self {
        let (lines, to_write) = channel::<Vec<u8>>();
        let (working, done) = channel::<()>();
        let shared = Arc::new(Shared {
            waiting: AtomicUsize::new(0),
            moved: Mutex::new(Instant::now()),
            failed: Mutex::new(None),
            over: AtomicBool::new(false),
        });
        let ours = Arc::clone(&shared);
        thread::spawn(move || {
            for line in to_write {
                if let Err(error) = ours.write_all(&mut writer, &line) {
                    *lock(&ours.failed) = Some(error);
                    break;
                }
                ours.waiting.fetch_sub(1, Ordering::Relaxed);
            }
            // When this is done, somebody else can have the device.
            drop(writer);
            drop(working);
        });
        Self { name: name.to_owned(), lines: Some(lines), shared, done }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether it is worth to put another line: it would be taken, or answered with why none ever will be.
    pub fn is_free(&self) -> bool {
        !matches!(self.ready(), Err(LinkError::Busy))
    }

    /// Takes a line.
    ///
    /// # Errors
    /// [`LinkError::Busy`] without room, otherwise why the line is down.
    pub fn put(&mut self, line: &[u8]) -> Result<(), LinkError> {
        self.ready()?;
        self.last(line);
        Ok(())
    }

    /// Takes the last line, room or not: nothing newer follows.
    pub fn last(&mut self, line: &[u8]) {
        if self.shared.waiting.fetch_add(1, Ordering::Relaxed) == 0 {
            self.shared.has_moved();
        }
        // Nobody to take it has failed, and says so next time.
        let _ = self.lines.as_ref().map(|lines| lines.send(line.to_vec()));
    }

    /// Whether a line would be taken now.
    ///
    /// # Errors
    /// As [`Self::put`].
    pub fn ready(&self) -> Result<(), LinkError> {
        if let Some(error) = &*lock(&self.shared.failed) {
            return Err(gone(&self.name, error));
        }
        if self.shared.waiting.load(Ordering::Relaxed) < WAITING {
            return Ok(());
        }
        if !self.shared.is_dead() {
            return Err(LinkError::Busy);
        }
        let name = &self.name;
        Err(LinkError::Down(format!(
            "{name} takes nothing any more: unplug it and plug it in again"
        )))
    }

    /// Waits until all is written, but not for a line that is dead; then the device is let go of.
    fn finish(&mut self, patience: Duration) {
        self.lines = None;
        if !self.shared.is_dead() {
            // It hangs up soon, or never will.
            let _: Result<(), RecvTimeoutError> = self.done.recv_timeout(patience);
        }
        self.shared.over.store(true, Ordering::Relaxed);
    }
}

impl Drop for LineWriter {
    fn drop(&mut self) {
        self.finish(LAST_WORDS);
    }
}

impl Shared {
    fn has_moved(&self) {
        *lock(&self.moved) = Instant::now();
    }

    /// Whether lines wait and the device has taken nothing for long.
    fn is_dead(&self) -> bool {
        self.waiting.load(Ordering::Relaxed) > 0 && lock(&self.moved).elapsed() >= DEAD
    }

    /// Writes all, however often the device wants to be asked again, until the writer is let go of.
    fn write_all(&self, writer: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            match writer.write(bytes) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => {
                    self.has_moved();
                    bytes = &bytes[count..];
                }
                Err(error) => match error.kind() {
                    io::ErrorKind::Interrupted => {}
                    io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock
                        if !self.over.load(Ordering::Relaxed) => {}
                    _ => return Err(error),
                },
            }
        }
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
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
fn gone(name: &str, error: &io::Error) -> LinkError {
    // `serialport` tells most of what a device says that is not there any more, `EIO`, `ENXIO` and `ENODEV`, as
    // something else, and keeps no number.
    let why = match error.kind() {
        io::ErrorKind::BrokenPipe | io::ErrorKind::NotFound | io::ErrorKind::Other => {
            format!("{name} is gone: was it unplugged? ({error})")
        }
        _ => format!("{name}: {error}"),
    };
    LinkError::Down(why)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    /// Far longer than anything takes.
    const LONG: Duration = Duration::from_secs(60);

    /// A device that takes lines one by one when it may; it hangs up when it is let go of.
    struct Device {
        takes: Arc<AtomicBool>,
        taken: Sender<Vec<u8>>,
    }

    impl Write for Device {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            thread::sleep(Duration::from_millis(1));
            if !self.takes.load(Ordering::Relaxed) {
                return Err(io::ErrorKind::TimedOut.into());
            }
            self.taken.send(bytes.to_vec()).unwrap();
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// A line to a device, whether that takes anything, and what it has taken.
    fn line(takes: bool) -> (LineWriter, Arc<AtomicBool>, Receiver<Vec<u8>>) {
        let (taken, has_taken) = channel();
        let takes = Arc::new(AtomicBool::new(takes));
        let device = Device { takes: Arc::clone(&takes), taken };
        (LineWriter::new("a line", device), takes, has_taken)
    }

    #[test]
    fn lines_arrive_whole_and_in_order() {
        let (near, mut far) = UnixStream::pair().unwrap();
        let mut line = LineWriter::new("a line", near);
        for number in 0..100u8 {
            while !line.is_free() {
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
    fn at_the_end_it_waits_for_the_last_lines() {
        let (mut line, _, taken) = line(true);
        (0..4).for_each(|number| line.put(&[number]).unwrap());
        line.finish(LONG);
        assert_eq!(taken.try_iter().collect::<Vec<_>>(), [[0], [1], [2], [3]]);
    }

    #[test]
    fn the_last_line_is_taken_also_without_room() {
        let (mut line, takes, taken) = line(false);
        (0..4).for_each(|number| line.put(&[number]).unwrap());
        assert!(line.put(&[4]).is_err());
        line.last(&[4]);
        takes.store(true, Ordering::Relaxed);
        line.finish(LONG);
        assert_eq!(taken.try_iter().collect::<Vec<_>>(), [[0], [1], [2], [3], [4]]);
    }

    #[test]
    fn a_device_that_takes_nothing_is_let_go_of() {
        let (mut line, _takes, taken) = line(false);
        line.put(&[7]).unwrap();
        drop(line);
        assert_eq!(taken.recv_timeout(LONG), Err(RecvTimeoutError::Disconnected));
    }

    #[test]
    fn a_device_that_takes_nothing_holds_up_nobody_and_is_down_soon() {
        let (near, far) = UnixStream::pair().unwrap();
        let mut line = LineWriter::new("a line", near);
        let start = Instant::now();
        let why = loop {
            // Also to whoever asks first.
            if line.is_free() {
                match line.put(&[7; 500]) {
                    Ok(()) => {}
                    Err(why) => break why,
                }
            }
            assert!(start.elapsed() < LONG, "it never says so");
            thread::sleep(Duration::from_millis(1));
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
            assert!(start.elapsed() < LONG, "it never says so");
        };
        assert!(why.to_string().contains("a line is gone"), "{why}");
        assert!(line.is_free(), "or it would not be asked again");
    }

    #[test]
    fn an_adapter_that_was_unplugged_is_called_that() {
        // As `serialport` passes on what the kernel says of a device that is not there any more.
        let said = serialport::Error::new(serialport::ErrorKind::Unknown, "I/O error");
        let why = gone("a line", &said.into()).to_string();
        assert!(why.contains("a line is gone: was it unplugged? (I/O error)"), "{why}");
    }
}
