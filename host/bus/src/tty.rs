//! Serial lines of actuators: raw bytes in both directions.
//!
//! [`open`] opens an adapter, such as a U2D2. [`serve`] creates a pseudo-terminal that replaces an adapter, with simulated
//! servos behind it. Only one program may open the line: a second one is refused until the first has closed it or ended.

use crate::error::OpenError;
use crate::line::{LineWriter, read};
use crate::link::LinkError;
use crate::port::{Event, Inlet, Outlet, Port};
use crate::serial::open_device;
use rollwalk_protocol::can::Frame;
use std::fs;
use std::io::{Read, Write};
use std::path::{Path, PathBuf};

/// Directory of the kernel's USB serial adapters, with one folder for each.
const DEVICES: &str = "/sys/bus/usb-serial/devices";
/// Longest accepted latency of an FTDI adapter, ms. The factory setting is 16 ms, two control periods.
const LATENCY_MS: u32 = 1;

/// Opens a serial adapter at `baud` bit/s.
///
/// # Errors
/// Returns an error if the device does not exist, access is denied, or it does not support this rate.
pub fn open(device: &Path, baud: u32) -> Result<Port, OpenError> {
    let (reader, writer) = open_device(device, baud)?;
    let complaint = device.file_name().and_then(|name| {
        let name = name.to_string_lossy();
        hurry(Path::new(DEVICES), &name)
    });
    Ok(port(&device.display().to_string(), reader, writer, complaint))
}

/// FTDI latency timer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Latency {
    /// Path of the setting in sysfs.
    pub setting: PathBuf,
    /// Latency, ms.
    pub ms: u32,
}

impl Latency {
    /// Reads the latency timer of a device, such as `ttyUSB0`. Returns `None` for adapters other than FTDI, which have no such
    /// timer.
    pub fn of(name: &str) -> Option<Self> {
        Self::below(Path::new(DEVICES), name)
    }

    fn below(devices: &Path, name: &str) -> Option<Self> {
        let setting = devices.join(name).join("latency_timer");
        let ms = fs::read_to_string(&setting).ok()?.trim().parse().ok()?;
        Some(Self { setting, ms })
    }

    /// True if the latency is so long that servo positions arrive too late.
    pub fn is_long(&self) -> bool {
        self.ms > LATENCY_MS
    }

    /// Returns the command that sets the short latency.
    pub fn shorten(&self) -> String {
        format!("echo {LATENCY_MS} | sudo tee {}", self.setting.display())
    }
}

/// Sets the short latency of an FTDI adapter; returns the remedy if access is denied.
fn hurry(devices: &Path, name: &str) -> Option<String> {
    let latency = Latency::below(devices, name).filter(Latency::is_long)?;
    if fs::write(&latency.setting, LATENCY_MS.to_string()).is_ok() {
        return None;
    }
    let (ms, shorten) = (latency.ms, latency.shorten());
    Some(format!(
        "the FTDI latency timer of the adapter is {ms} ms, so poses arrive too late; shorten it: \
         {shorten}"
    ))
}

/// Creates the port of a line that carries bytes. `name` is used in messages.
pub fn port(
    name: &str,
    reader: impl Read + Send + 'static,
    writer: impl Write + Send + 'static,
    complaint: Option<String>,
) -> Port {
    let writer = LineWriter::new(name, writer);
    let inlet = TtyInlet { name: name.to_owned(), reader };
    Port { outlet: Box::new(TtyOutlet { writer, complaint }), inlet: Box::new(inlet) }
}

struct TtyOutlet {
    writer: LineWriter,
    complaint: Option<String>,
}

impl Outlet for TtyOutlet {
    fn is_free(&self) -> bool {
        self.writer.is_free()
    }

    fn send(&mut self, _frame: &Frame) -> Result<(), LinkError> {
        Err(LinkError::Down(format!("{} carries bytes, not frames", self.writer.name())))
    }

    fn carries_bytes(&self) -> bool {
        true
    }

    fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
        self.writer.put(bytes)
    }

    fn fault_and_remedy(&self) -> Option<String> {
        self.complaint.clone()
    }
}

struct TtyInlet<R> {
    name: String,
    reader: R,
}

impl<R: Read + Send> Inlet for TtyInlet<R> {
    fn next_event(&mut self) -> Result<Option<Event>, LinkError> {
        let mut bytes = [0; 256];
        let count = read(&self.name, &mut self.reader, &mut bytes)?;
        Ok((count > 0).then(|| Event::Bytes(bytes[..count].to_vec())))
    }
}

#[cfg(unix)]
pub use pseudo::serve;

/// Creates a pseudo-terminal, which this system does not support.
///
/// # Errors
/// Always returns an error.
#[cfg(not(unix))]
pub fn serve(link: &Path) -> Result<Port, OpenError> {
    let what =
        format!("`pty:{}` requires pseudo-terminals, which only Unix provides", link.display());
    Err(OpenError { what, help: "use two adapters that are connected by a cable".into() })
}

#[cfg(unix)]
mod pseudo {
    use super::*;
    use serialport::{SerialPort, TTYPort};
    use std::io;
    use std::os::unix::fs::symlink;
    use std::thread::sleep;
    use std::time::Duration;

    /// Read timeout, after which the thread checks if the port is still in use.
    const WAIT: Duration = Duration::from_millis(50);
    /// Polling interval while no program has the other end open.
    const LONELY: Duration = Duration::from_millis(5);
    /// Directory of the system's pseudo-terminals.
    const TERMINALS: &str = "/dev/pts";

    /// Creates a pseudo-terminal, and a symbolic link at `link` to the end that other programs open.
    ///
    /// The link exists as long as the port. Programs may open and close their end repeatedly.
    ///
    /// # Errors
    /// Returns an error if another file exists at `link` or the system provides no pseudo-terminal.
    pub fn serve(link: &Path) -> Result<Port, OpenError> {
        let failed = |what: String| OpenError {
            what: format!("`{}` cannot be created: {what}", link.display()),
            help: "give a path in a writable folder, such as pty:/tmp/servos".into(),
        };
        // A run that was killed has left this link.
        if fs::read_link(link).is_ok_and(|target| target.starts_with(TERMINALS)) {
            let _ = fs::remove_file(link);
        }
        let (mut near, far) = TTYPort::pair().map_err(|error| failed(error.to_string()))?;
        near.set_timeout(WAIT).map_err(|error| failed(error.to_string()))?;
        let writer = near.try_clone_native().map_err(|error| failed(error.to_string()))?;
        let device = far.name().ok_or_else(|| failed("the pseudo-terminal has no name".into()))?;
        symlink(&device, link).map_err(|error| failed(error.to_string()))?;
        let name = link.display().to_string();
        let Port { outlet, inlet } =
            port(&name, PseudoTerminal(near), PseudoTerminal(writer), None);
        Ok(Port { outlet: Box::new(Linked { outlet, link: link.to_owned(), device }), inlet })
    }

    /// End of a pseudo-terminal whose other end may be open or closed.
    struct PseudoTerminal(TTYPort);

    /// True for transient errors: interrupted, timeout, would block.
    fn passes(error: &io::Error) -> bool {
        use io::ErrorKind::{Interrupted, TimedOut, WouldBlock};
        matches!(error.kind(), Interrupted | TimedOut | WouldBlock)
    }

    impl Read for PseudoTerminal {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            match self.0.read(bytes) {
                Err(error) if !passes(&error) => {
                    sleep(LONELY);
                    Err(io::ErrorKind::TimedOut.into())
                }
                // The other end is closed.
                Ok(0) => {
                    sleep(LONELY);
                    Err(io::ErrorKind::TimedOut.into())
                }
                read => read,
            }
        }
    }

    impl Write for PseudoTerminal {
        /// Discards the bytes if no program reads them, like a wire.
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.0.write(bytes) {
                Err(error) if !passes(&error) => Ok(bytes.len()),
                written => written,
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    /// Removes the symbolic link when the port is dropped.
    struct Linked {
        outlet: Box<dyn Outlet>,
        link: PathBuf,
        device: String,
    }

    impl Outlet for Linked {
        fn is_free(&self) -> bool {
            self.outlet.is_free()
        }

        fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
            self.outlet.send(frame)
        }

        fn carries_bytes(&self) -> bool {
            true
        }

        fn send_bytes(&mut self, bytes: &[u8]) -> Result<(), LinkError> {
            self.outlet.send_bytes(bytes)
        }
    }

    impl Drop for Linked {
        fn drop(&mut self) {
            // Another run may have created its own link there.
            if fs::read_link(&self.link).is_ok_and(|target| target == Path::new(&self.device)) {
                let _ = fs::remove_file(&self.link);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::port::Hub;
    use std::time::{Duration, Instant};

    /// Timeout far longer than any operation of the tests.
    const LONG: Duration = Duration::from_secs(60);

    /// Receives at least `count` bytes from the port.
    fn received(hub: &mut Hub, count: usize) -> Vec<u8> {
        let (start, mut all) = (Instant::now(), Vec::new());
        while all.len() < count {
            assert!(start.elapsed() < LONG, "{all:?}");
            if let Some((_, Ok(Event::Bytes(bytes)))) = hub.next_event(start + LONG) {
                all.extend(bytes);
            }
        }
        all
    }

    #[test]
    fn bytes_cross_a_pseudo_terminal_and_programs_come_and_go() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("servos");
        let mut servos = Hub::new([serve(&link).unwrap()]);
        assert!(servos.outlets[0].carries_bytes());
        // No program has opened the other end.
        servos.outlets[0].send_bytes(&[1, 2]).unwrap();
        for round in 0..2u8 {
            let mut controller = Hub::new([open(&link, 1_000_000).unwrap()]);
            // A terminal would interpret some of these bytes as commands.
            let all: Vec<u8> = (round..=255).collect();
            controller.outlets[0].send_bytes(&all).unwrap();
            assert_eq!(received(&mut servos, all.len()), all);
            servos.outlets[0].send_bytes(&all).unwrap();
            // The two bytes from before may arrive first.
            let mut said = received(&mut controller, all.len());
            while !said.ends_with(&all) {
                said.extend(received(&mut controller, 1));
            }
            let busy = open(&link, 1_000_000).err().unwrap();
            assert!(busy.what.starts_with("another program uses"), "{busy}");
            drop(controller);
            // The threads release the device within their timeout.
            let start = Instant::now();
            while open(&link, 1_000_000).is_err() {
                assert!(start.elapsed() < LONG);
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        drop(servos);
        assert!(!link.exists() && fs::read_link(&link).is_err(), "the link is gone");
    }

    #[test]
    fn what_is_in_the_way_of_a_pseudo_terminal_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("servos");
        fs::write(&path, "mine").unwrap();
        let error = serve(&path).err().unwrap();
        assert!(error.what.contains("cannot be created"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "mine");
    }

    #[test]
    fn an_adapter_that_keeps_bytes_back_is_told_not_to() {
        let folder = tempfile::tempdir().unwrap();
        let setting = folder.path().join("ttyUSB7/latency_timer");
        fs::create_dir(folder.path().join("ttyUSB7")).unwrap();
        fs::write(&setting, "16\n").unwrap();
        assert_eq!(hurry(folder.path(), "ttyUSB7"), None);
        assert_eq!(fs::read_to_string(&setting).unwrap(), "1");
        assert_eq!(hurry(folder.path(), "ttyACM0"), None, "no such setting");
    }
}
