//! QEMU with the image in it, its UART 0 a TCP connection to this process.

use crate::{debian, shell};
use std::io::ErrorKind;
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const PROGRAM: &str = "qemu-system-arm";
/// Longest wait for QEMU to connect its UART.
const BOOT_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest wait for an answer of the board.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// An instruction takes 2 to the power of this many ns of virtual time: so long that the 25 MHz timer
/// counts 25.6 times in each.
const ICOUNT_SHIFT: u32 = 10;
const TIMER_HZ: f64 = 25e6;

/// What makes the emulated time go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// The host's clock: as fast as it can.
    Host,
    /// Instructions: timers count them.
    Instructions,
}

/// Instructions in a span of the board's timer, under [`Clock::Instructions`].
pub fn instructions(counts: f64) -> f64 {
    counts / (f64::from(1 << ICOUNT_SHIFT) * 1e-9 * TIMER_HZ)
}

/// A running emulator; stops when dropped.
pub struct Emulator {
    child: Child,
    line: TcpStream,
}

impl Emulator {
    /// Boots an image.
    ///
    /// # Errors
    /// The one command that installs QEMU, or what it said.
    pub fn boot(image: &Path, clock: Clock) -> Result<Self, String> {
        if !shell::succeeds(&mut shell::command(PROGRAM, &["--version"])) {
            debian::need(&[PROGRAM]).map_err(|install| {
                format!("the board runs in QEMU. On Debian:\n\n    {install}")
            })?;
        }
        let failed = |error: std::io::Error| format!("no port for the board's UART: {error}");
        let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();

        let mut qemu = Command::new(PROGRAM);
        qemu.args(["-M", "mps2-an386", "-cpu", "cortex-m4", "-display", "none"]);
        qemu.args(["-monitor", "none", "-no-reboot"]);
        qemu.args(["-serial", &format!("tcp:127.0.0.1:{port},nodelay=on")]);
        if clock == Clock::Instructions {
            qemu.args(["-icount", &format!("shift={ICOUNT_SHIFT},sleep=off")]);
        }
        qemu.arg("-kernel").arg(image).stdin(Stdio::null());
        let child = qemu.spawn().map_err(|e| format!("`{PROGRAM}` could not be started: {e}"))?;
        accept(&listener, child)
    }

    /// The UART.
    ///
    /// # Errors
    /// The operating system's.
    pub fn line(&self) -> Result<TcpStream, String> {
        self.line.try_clone().map_err(|error| format!("the board's UART: {error}"))
    }
}

fn accept(listener: &TcpListener, mut child: Child) -> Result<Emulator, String> {
    let start = Instant::now();
    let line = loop {
        match listener.accept() {
            Ok((line, _)) => break Ok(line),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => break Err(format!("the board's UART: {error}")),
        }
        match child.try_wait() {
            Ok(None) if start.elapsed() < BOOT_TIMEOUT => sleep(Duration::from_millis(5)),
            Ok(None) => break Err(format!("QEMU did not start within {BOOT_TIMEOUT:?}")),
            Ok(Some(status)) => break Err(format!("QEMU ended: {status}")),
            Err(error) => break Err(format!("QEMU: {error}")),
        }
    };
    let set_up = line.and_then(|line| {
        line.set_nonblocking(false)
            .and_then(|()| line.set_nodelay(true))
            .and_then(|()| line.set_read_timeout(Some(ANSWER_TIMEOUT)))
            .map_err(|error| format!("the board's UART: {error}"))?;
        Ok(line)
    });
    match set_up {
        Ok(line) => Ok(Emulator { child, line }),
        Err(why) => {
            stop(&mut child);
            Err(why)
        }
    }
}

fn stop(child: &mut Child) {
    // It may have ended by itself.
    let _ = child.kill();
    let _ = child.wait();
}

impl Drop for Emulator {
    fn drop(&mut self) {
        stop(&mut self.child);
    }
}
