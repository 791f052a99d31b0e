//! Serial lines and sockets: reads with a short timeout, and writes that never block the caller.
//!
//! A device that accepts no bytes, such as an adapter whose CAN bus is dead, blocks the thread that writes to it indefinitely.
//! A separate thread therefore writes, from a queue of a few lines. The line counts as down if the device accepts nothing from
//! that thread. The program meanwhile continues to read keys, send heartbeats or tick a controller. Only attempts to write
//! count: a thread that waits to be scheduled on a busy computer does not indicate a dead device.
//!
//! A line counts as written when the kernel has accepted it. The kernel's buffer is additional, cannot be recalled and may
//! delay lines; commands therefore contain an expiry.

use crate::link::LinkError;
use crate::priority;
use rollwalk_protocol::wire::HOST_TIMEOUT_MS;
use std::io::{self, Read, Write};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

/// Capacity of the queue, lines. It is small because a queued line cannot be replaced by a newer one.
const WAITING: usize = 4;
/// Time without progress after which a line is down. A robot at the line has then timed out its host anyway.
const DEAD: Duration = Duration::from_millis(HOST_TIMEOUT_MS as u64);
/// Timeout of reads and writes, after which a thread checks the line again.
pub(crate) const WAIT: Duration = Duration::from_millis(50);
/// Number of consecutive write timeouts, each of [`WAIT`], that indicate a dead device.
const REFUSALS: u32 = (DEAD.as_millis() / WAIT.as_millis()) as u32;
/// Duration of a single write that indicates a dead device. Writes to some devices have no timeout.
const BLOCKED: Duration = Duration::from_secs(1);
/// Longest wait for queued lines when the writer is dropped.
const LAST_WORDS: Duration = Duration::from_millis(100);

/// Name of a simulated robot's line, which cannot be unplugged.
pub(crate) const SIMULATED: &str = "the simulated robot";

/// Writes complete lines in order.
pub(crate) struct LineWriter {
    name: String,
    /// Queue of lines; `None` while the writer ends.
    lines: Option<Sender<Vec<u8>>>,
    shared: Arc<Shared>,
    /// Channel without messages, which is disconnected when everything is written.
    done: Receiver<()>,
}

/// State shared by a writer and its thread.
struct Shared {
    /// Number of lines that are not written yet.
    waiting: AtomicUsize,
    /// Time at which the device most recently accepted bytes, or the oldest queued line was added if that is later.
    moved: Mutex<Instant>,
    /// Number of writes that have timed out since then.
    refused: AtomicU32,
    /// Start of the write in progress.
    attempt: Mutex<Option<Instant>>,
    failed: Mutex<Option<io::Error>>,
    /// True if the writer was dropped: bytes that the device does not accept at once are discarded.
    over: AtomicBool,
}

impl LineWriter {
    /// Creates a writer to a device. If the device's `write` has a timeout, the device is closed soon after the writer is
    /// dropped.
    pub fn new(name: &str, mut writer: impl Write + Send + 'static) -> Self {
        let (lines, to_write) = channel::<Vec<u8>>();
        let (working, done) = channel::<()>();
        let shared = Arc::new(Shared {
            waiting: AtomicUsize::new(0),
            moved: Mutex::new(Instant::now()),
            refused: AtomicU32::new(0),
            attempt: Mutex::new(None),
            failed: Mutex::new(None),
            over: AtomicBool::new(false),
        });
        let ours = Arc::clone(&shared);
        thread::spawn(move || {
            priority::raise();
            for line in to_write {
                if let Err(error) = ours.write_all(&mut writer, &line) {
                    *lock(&ours.failed) = Some(error);
                    break;
                }
                ours.waiting.fetch_sub(1, Ordering::Relaxed);
            }
            // The device must be closed before the writer reports that it is done.
            drop(writer);
            drop(working);
        });
        Self { name: name.to_owned(), lines: Some(lines), shared, done }
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// True if [`Self::put`] would accept a line or report that the line is down, instead of returning [`LinkError::Busy`].
    pub fn is_free(&self) -> bool {
        !matches!(self.ready(), Err(LinkError::Busy))
    }

    /// Queues a line.
    ///
    /// # Errors
    /// Returns [`LinkError::Busy`] if the queue is full, or the reason why the line is down.
    pub fn put(&mut self, line: &[u8]) -> Result<(), LinkError> {
        self.ready()?;
        self.last(line);
        Ok(())
    }

    /// Queues the final line, even if the queue is full.
    pub fn last(&mut self, line: &[u8]) {
        if self.shared.waiting.fetch_add(1, Ordering::Relaxed) == 0 {
            self.shared.has_moved();
        }
        // A thread that has ended has stored its error, which the next call returns.
        let _ = self.lines.as_ref().map(|lines| lines.send(line.to_vec()));
    }

    /// Checks if a line would be accepted now.
    ///
    /// # Errors
    /// Returns the errors of [`Self::put`].
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
        let remedy = match &**name {
            SIMULATED => "if Ctrl-Z stopped rollwalk-sim, type `fg` in its terminal",
            _ => "unplug the adapter and plug it in again",
        };
        Err(LinkError::Down(format!("{name} no longer accepts data: {remedy}")))
    }

    /// Waits until everything is written, unless the line is dead, and lets the thread close the device.
    fn finish(&mut self, patience: Duration) {
        self.lines = None;
        if !self.shared.is_dead() {
            // A disconnect or a timeout: the device is closed in both cases.
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
        self.refused.store(0, Ordering::Relaxed);
    }

    /// True if lines are queued and the device has accepted no bytes for [`DEAD`], despite attempts to write.
    fn is_dead(&self) -> bool {
        if self.waiting.load(Ordering::Relaxed) == 0 || lock(&self.moved).elapsed() < DEAD {
            return false;
        }
        let attempt = *lock(&self.attempt);
        self.refused.load(Ordering::Relaxed) >= REFUSALS
            || attempt.is_some_and(|start| start.elapsed() >= BLOCKED)
    }

    /// Writes all bytes, retrying after every timeout until the writer is dropped.
    fn write_all(&self, writer: &mut impl Write, mut bytes: &[u8]) -> io::Result<()> {
        while !bytes.is_empty() {
            *lock(&self.attempt) = Some(Instant::now());
            let written = writer.write(bytes);
            *lock(&self.attempt) = None;
            match written {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => {
                    self.has_moved();
                    bytes = &bytes[count..];
                }
                Err(error) => match error.kind() {
                    io::ErrorKind::Interrupted => {}
                    io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock
                        if !self.over.load(Ordering::Relaxed) =>
                    {
                        self.refused.fetch_add(1, Ordering::Relaxed);
                    }
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

/// Reads the available bytes; 0 after the reader's timeout.
pub(crate) fn read(
    name: &str,
    reader: &mut impl Read,
    bytes: &mut [u8],
) -> Result<usize, LinkError> {
    match reader.read(bytes) {
        Ok(0) => Err(LinkError::Down(format!("{name}: the other end closed the connection"))),
        Ok(count) => Ok(count),
        Err(error) => match error.kind() {
            io::ErrorKind::Interrupted | io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => {
                Ok(0)
            }
            _ => Err(gone(name, &error)),
        },
    }
}

/// Error of a line that has failed permanently.
fn gone(name: &str, error: &io::Error) -> LinkError {
    // `serialport` maps the errors of a device that was unplugged (`EIO`, `ENXIO`, `ENODEV`) to other kinds and
    // drops their numbers.
    let why = match error.kind() {
        io::ErrorKind::BrokenPipe | io::ErrorKind::NotFound | io::ErrorKind::Other => {
            let cause = if name == SIMULATED {
                "rollwalk-sim has probably ended"
            } else {
                "it was probably unplugged"
            };
            format!("{name} is gone: {cause} ({error})")
        }
        _ => format!("{name}: {error}"),
    };
    LinkError::Down(why)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::net::UnixStream;

    /// Timeout far longer than any operation of the tests.
    const LONG: Duration = Duration::from_secs(60);

    /// Device that accepts lines one by one while `takes` is true. `taken` is disconnected when the device is dropped.
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

    /// Line to a device, the flag that makes the device accept lines, and the accepted lines.
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
            // A caller of `is_free` also learns of it.
            if line.is_free() {
                match line.put(&[7; 500]) {
                    Ok(()) => {}
                    Err(why) => break why,
                }
            }
            assert!(start.elapsed() < LONG, "it never says so");
            thread::sleep(Duration::from_millis(1));
        };
        assert!(
            why.to_string().contains("a line no longer accepts data: unplug the adapter"),
            "{why}"
        );
        // Dropping the line does not wait for it either.
        drop(line);
        drop(far);
    }

    #[test]
    fn a_simulated_robot_is_not_unplugged() {
        let (mut line, _takes, _taken) = line(false);
        line.name = SIMULATED.to_owned();
        (0..4).for_each(|number| line.put(&[number]).unwrap());
        line.shared.refused.store(REFUSALS, Ordering::Relaxed);
        *lock(&line.shared.moved) = Instant::now() - LONG;
        let why = line.put(&[4]).unwrap_err().to_string();
        assert!(why.contains("no longer accepts data: if Ctrl-Z stopped rollwalk-sim"), "{why}");
        let why = gone(SIMULATED, &io::ErrorKind::BrokenPipe.into()).to_string();
        assert!(why.contains("is gone: rollwalk-sim has probably ended"), "{why}");
    }

    #[test]
    fn a_late_thread_says_nothing_about_the_device() {
        let shared = Shared {
            waiting: AtomicUsize::new(WAITING),
            moved: Mutex::new(Instant::now() - LONG),
            refused: AtomicU32::new(0),
            attempt: Mutex::new(None),
            failed: Mutex::new(None),
            over: AtomicBool::new(false),
        };
        assert!(!shared.is_dead(), "nothing was offered to it");
        shared.refused.store(REFUSALS - 1, Ordering::Relaxed);
        *lock(&shared.attempt) = Some(Instant::now());
        assert!(!shared.is_dead());
        shared.refused.store(REFUSALS, Ordering::Relaxed);
        assert!(shared.is_dead(), "it has taken none of them");
        shared.has_moved();
        *lock(&shared.moved) = Instant::now() - LONG;
        assert!(!shared.is_dead());
        *lock(&shared.attempt) = Some(Instant::now() - BLOCKED);
        assert!(shared.is_dead(), "it holds up the thread");
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
        // Error of `serialport` for an unplugged device.
        let said = serialport::Error::new(serialport::ErrorKind::Unknown, "I/O error");
        let why = gone("a line", &said.into()).to_string();
        assert!(why.contains("a line is gone: it was probably unplugged (I/O error)"), "{why}");
    }
}
