//! QEMU with an image: either with a script in its memory, or with its UART 0 as a TCP connection to this process.

use object::{Object, ObjectSymbol};
use std::io::{ErrorKind, Read};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::mpsc;
use std::thread::{self, sleep};
use std::time::{Duration, Instant};

const PROGRAM: &str = "qemu-system-arm";
/// Longest wait for QEMU to connect its UART.
const BOOT_TIMEOUT: Duration = Duration::from_secs(30);
/// Longest wait for an answer from the board.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(30);
/// Timeout of a replay, sufficient on a loaded machine.
const REPLAY_TIMEOUT: Duration = Duration::from_secs(600);
/// Logarithm to base 2 of the virtual time of an instruction in ns. The 25 MHz timer counts 25.6 times per instruction.
const ICOUNT_SHIFT: u32 = 10;
/// Logarithm to base 2 of the virtual time of an instruction in ns, for spans of up to 40 million instructions. The timer
/// counts twice in five instructions.
const COARSE_SHIFT: u32 = 4;
const TIMER_HZ: f64 = 25e6;
/// Symbol of the image at the address of its script.
const SCRIPT: &str = "_script_start";

/// Number of instructions in a span of timer counts during a [`replay`].
pub fn instructions(counts: f64) -> f64 {
    instructions_at(ICOUNT_SHIFT, counts)
}

/// Number of instructions in a span of timer counts during [`measure`].
pub fn coarse_instructions(counts: f64) -> f64 {
    instructions_at(COARSE_SHIFT, counts)
}

fn instructions_at(shift: u32, counts: f64) -> f64 {
    counts / (f64::from(1 << shift) * 1e-9 * TIMER_HZ)
}

/// Boots an image with a script in its memory and returns its console output. Virtual time counts instructions.
///
/// # Errors
/// Returns an error if QEMU fails, or if the program on the board does not end successfully.
pub fn replay(image: &Path, script: &Path) -> Result<Vec<u8>, String> {
    let address = script_address(image)?;
    let loader = format!("loader,file={},addr={address:#x},force-raw=on", script.display());
    console(command(image).args(["-device", &loader]), ICOUNT_SHIFT)
}

/// Boots an image that measures long spans and returns its console output.
///
/// # Errors
/// Returns an error if QEMU fails, or if the program on the board does not end successfully.
pub fn measure(image: &Path) -> Result<Vec<u8>, String> {
    console(&mut command(image), COARSE_SHIFT)
}

fn console(qemu: &mut Command, shift: u32) -> Result<Vec<u8>, String> {
    qemu.args(["-serial", "none", "-chardev", "stdio,id=console"]);
    qemu.args(["-semihosting-config", "enable=on,target=native,chardev=console"]);
    qemu.args(["-icount", &format!("shift={shift},sleep=off")]);
    let mut running = RunningEmulator::start(qemu.stdout(Stdio::piped()))?;
    let mut output = running.0.stdout.take().ok_or("the output of QEMU cannot be read")?;
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        let mut bytes = Vec::new();
        // After the timeout the receiver is gone.
        let _ = sender.send(output.read_to_end(&mut bytes).map(|_| bytes));
    });
    let bytes = receiver
        .recv_timeout(REPLAY_TIMEOUT)
        .map_err(|_| format!("the replay did not end within {REPLAY_TIMEOUT:?}"))?
        .map_err(|error| format!("QEMU: {error}"))?;
    let status = running.0.wait().map_err(|error| format!("QEMU: {error}"))?;
    if status.success() { Ok(bytes) } else { Err(format!("the replay failed: {status}")) }
}

fn script_address(image: &Path) -> Result<u64, String> {
    let bytes = crate::read(image)?;
    let file =
        object::File::parse(&bytes[..]).map_err(|error| format!("{}: {error}", image.display()))?;
    let symbol = file.symbols().find(|symbol| symbol.name() == Ok(SCRIPT));
    let symbol =
        symbol.ok_or_else(|| format!("{}: the symbol {SCRIPT} is missing", image.display()))?;
    Ok(symbol.address())
}

fn command(image: &Path) -> Command {
    let mut qemu = Command::new(PROGRAM);
    qemu.args(["-M", "mps2-an386", "-cpu", "cortex-m4", "-display", "none"]);
    qemu.args(["-monitor", "none", "-no-reboot", "-kernel"]).arg(image).stdin(Stdio::null());
    qemu
}

/// Process of QEMU, which ends when dropped.
struct RunningEmulator(Child);

impl RunningEmulator {
    fn start(qemu: &mut Command) -> Result<Self, String> {
        let child = qemu.spawn();
        child.map(Self).map_err(|error| format!("`{PROGRAM}` could not be started: {error}"))
    }
}

impl Drop for RunningEmulator {
    fn drop(&mut self) {
        // The emulator may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Running emulator with its UART, which stops when dropped.
pub struct Emulator {
    line: TcpStream,
    _running: RunningEmulator,
}

impl Emulator {
    /// Boots an image.
    ///
    /// # Errors
    /// Returns an error if QEMU does not start, or does not connect its UART in time.
    pub fn boot(image: &Path) -> Result<Self, String> {
        let failed = |error: std::io::Error| {
            format!(
                "cannot open a port for the board's UART: \
            {error}"
            )
        };
        let listener = TcpListener::bind(("127.0.0.1", 0)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let port = listener.local_addr().map_err(failed)?.port();
        let serial = format!("tcp:127.0.0.1:{port},nodelay=on");
        let mut running = RunningEmulator::start(command(image).args(["-serial", &serial]))?;
        let line = accept(&listener, &mut running.0)?;
        line.set_nonblocking(false)
            .and_then(|()| line.set_nodelay(true))
            .and_then(|()| line.set_read_timeout(Some(ANSWER_TIMEOUT)))
            .map_err(|error| format!("the board's UART: {error}"))?;
        Ok(Self { line, _running: running })
    }

    /// Returns a handle of the UART.
    ///
    /// # Errors
    /// Returns an error if the operating system cannot duplicate the handle.
    pub fn line(&self) -> Result<TcpStream, String> {
        self.line.try_clone().map_err(|error| format!("the board's UART: {error}"))
    }
}

fn accept(listener: &TcpListener, child: &mut Child) -> Result<TcpStream, String> {
    let start = Instant::now();
    loop {
        match listener.accept() {
            Ok((line, _)) => return Ok(line),
            Err(error) if error.kind() == ErrorKind::WouldBlock => {}
            Err(error) => return Err(format!("the board's UART: {error}")),
        }
        match child.try_wait() {
            Ok(None) if start.elapsed() < BOOT_TIMEOUT => sleep(Duration::from_millis(5)),
            Ok(None) => return Err(format!("QEMU did not start within {BOOT_TIMEOUT:?}")),
            Ok(Some(status)) => return Err(format!("QEMU ended: {status}")),
            Err(error) => return Err(format!("QEMU: {error}")),
        }
    }
}
