//! Virtual machine for the tests: Debian's kernel in QEMU, with the files of this machine.
//!
//! The clock of the virtual machine counts instructions, 1 ns each (`-icount`), and skips idle time. Programs in it therefore
//! meet their deadlines however loaded this machine is. The processor of the virtual machine has 1000 MIPS. One second of its
//! clock may take several seconds of this machine's, or a hundredth of one.
//!
//! While the virtual machine waits for the host's disk, its clock jumps to the next timer. Programs must therefore read files
//! before time matters, and write to memory, except for results.

use super::{RESULTS, cache, init, kernel::Kernel, script, spawn, status, wait};
use crate::{debian, shell};
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread;
use std::time::{Duration, Instant};
use tempfile::TempDir;

const PROGRAM: &str = "qemu-system-x86_64";
const PACKAGES: [&str; 6] =
    ["busybox-static", "cpio", "iproute2", "kmod", "qemu-system-x86", "xz-utils"];
/// Memory for processes and the files that they write. The host allocates it on first use.
const MEMORY: &str = "2G";
/// Oldest processor with the instructions of current builds of numpy (x86-64-v2); newer ones boot more slowly.
const PROCESSOR: &str = "Nehalem";
/// Clock options of QEMU; see [`guest`](self). With 4 ns or 8 ns for an instruction the processor would only be slower: a
/// second at a given frame rate takes the same time here.
const CLOCK: &str = "shift=0,sleep=off";
/// Kernel arguments: exit at once on a panic, and no mitigations, because an emulated processor leaks no data.
const KERNEL_ARGS: &str = "console=ttyS0 quiet panic=-1 mitigations=off";
/// Number of final console lines that are shown after a failure.
const CONSOLE_LINES: usize = 50;

/// Virtual machine that can be started once.
pub struct Guest {
    kernel: PathBuf,
    initramfs: PathBuf,
    /// Folder shared by this machine and the virtual machine.
    folder: TempDir,
}

impl Guest {
    /// Gets the kernel and packs the initial file system.
    ///
    /// # Errors
    /// Returns the error of the package manager or of the packer. If a program is missing, the error contains the command that
    /// installs it.
    pub fn prepare() -> Result<Self, String> {
        debian::need(&PACKAGES).map_err(|install| {
            format!(
                "this kernel has no vcan, and the virtual machine with vcan requires packages. On \
                 Debian:\n\n    {install}"
            )
        })?;
        let kernel = Kernel::get()?;
        let folder = tempfile::Builder::new().prefix("run-").tempdir_in(cache()?);
        let folder = folder.map_err(|error| {
            format!(
                "cannot create a folder for the virtual \
            machine: {error}"
            )
        })?;
        let initramfs = init::pack(&kernel, folder.path())?;
        Ok(Self { kernel: kernel.image(), initramfs, folder })
    }

    /// Runs a command and returns its exit status.
    ///
    /// # Errors
    /// Returns an error if the virtual machine ended or was stopped before the command ended.
    pub fn run(
        self,
        command: &[String],
        results: Option<&Path>,
        timeout: Duration,
    ) -> Result<u8, String> {
        let exchange = self.folder.path().join("exchange");
        let failed = |error: io::Error| format!("{}: {error}", exchange.display());
        fs::create_dir(&exchange).map_err(failed)?;
        let mut environment: Vec<(String, String)> = std::env::vars().collect();
        if let Some(results) = results {
            let name = results.to_string_lossy().into_owned();
            fs::write(exchange.join("results"), &name).map_err(failed)?;
            environment.push((RESULTS.into(), name));
        }
        let script = script::of(command, &shell::workspace_root(), environment);
        fs::write(exchange.join("command"), script).map_err(failed)?;

        eprintln!("running in a virtual machine with vcan, because this kernel has no vcan");
        let start = Instant::now();
        let console = self.folder.path().join("console");
        let mut qemu = self.qemu(&exchange, &console, results);
        // Through a pipe, because QEMU would truncate a file, and make a terminal non-blocking.
        let mut child = spawn(qemu.stdin(Stdio::null()).stdout(Stdio::piped()))?;
        let mut output = child.stdout.take().expect("it is piped");
        let copy = thread::spawn(move || io::copy(&mut output, &mut io::stdout()).map(drop));
        let ended = wait(child, timeout);
        let copied = copy.join().expect("copying does not panic");
        let status = fs::read_to_string(exchange.join("status")).ok();
        let code = ended.and_then(|_| status::of_guest(status.as_deref())).map_err(|why| {
            format!(
                "{why}; the last lines of the virtual machine's console:\n{}",
                last_lines(&console)
            )
        })?;
        copied.map_err(|error| {
            format!(
                "the output of the virtual machine cannot be copied: \
            {error}"
            )
        })?;
        eprintln!("the virtual machine took {:.1} s", start.elapsed().as_secs_f64());
        Ok(code)
    }

    fn qemu(
        &self,
        exchange: &Path,
        console: &Path,
        results: Option<&Path>,
    ) -> std::process::Command {
        let mut qemu = shell::tied(PROGRAM);
        qemu.args(["-machine", "q35,accel=tcg", "-cpu", PROCESSOR, "-smp", "1", "-m", MEMORY]);
        qemu.args(["-icount", CLOCK, "-nodefaults", "-display", "none", "-no-reboot"]);
        qemu.arg("-kernel").arg(&self.kernel).arg("-initrd").arg(&self.initramfs);
        qemu.args(["-append", KERNEL_ARGS]);
        qemu.arg("-serial").arg(format!("file:{}", escaped(console)));
        qemu.args(["-device", "virtio-serial-pci", "-chardev", "file,id=out,path=/dev/fd/1"]);
        qemu.args(["-device", "virtserialport,chardev=out"]);
        // Two cards on one bus, `can0` and `can1`, down and without a bit rate as after plugging in.
        qemu.args(["-object", "can-bus,id=can"]);
        for _ in 0..2 {
            qemu.args(["-device", "kvaser_pci,canbus=can"]);
        }
        share(&mut qemu, "host", Path::new("/"), "readonly=on,multidevs=remap");
        share(&mut qemu, "exchange", exchange, "readonly=off");
        if let Some(results) = results {
            share(&mut qemu, "results", results, "readonly=off");
        }
        qemu
    }
}

/// Shares a folder of this machine with the guest.
fn share(qemu: &mut std::process::Command, tag: &str, folder: &Path, how: &str) {
    let path = escaped(folder);
    let source = format!("local,id={tag},path={path},security_model=none,{how}");
    qemu.args(["-fsdev", &source]);
    qemu.args(["-device", &format!("virtio-9p-pci,fsdev={tag},mount_tag={tag}")]);
}

/// Escapes a path for QEMU's options, in which commas are doubled.
fn escaped(path: &Path) -> String {
    path.to_string_lossy().replace(',', ",,")
}

fn last_lines(console: &Path) -> String {
    let text = fs::read(console).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(CONSOLE_LINES)..].join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn command_line(results: Option<&Path>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let guest = Guest { kernel: "/k".into(), initramfs: "/i".into(), folder };
        let qemu = guest.qemu(Path::new("/ex,change"), Path::new("/console"), results);
        qemu.get_args().map(|word| word.to_string_lossy()).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn the_host_is_read_only_and_the_results_are_not() {
        let line = command_line(Some(Path::new("/r")));
        assert!(line.contains("id=host,path=/,security_model=none,readonly=on"), "{line}");
        assert!(line.contains("id=exchange,path=/ex,,change,security_model=none,readonly=off"));
        assert!(line.contains("id=results,path=/r,security_model=none,readonly=off"), "{line}");
        assert!(!command_line(None).contains("results"));
    }

    #[test]
    fn one_processor_counts_instructions() {
        // QEMU does not support it with more processors.
        let line = command_line(None);
        assert!(line.contains("-icount shift=0,sleep=off") && line.contains("-smp 1"), "{line}");
        assert!(line.contains("panic=-1") && line.contains("-no-reboot"), "{line}");
    }

    #[test]
    fn the_console_is_shown_from_near_its_end() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let lines: Vec<String> = (0..100).map(|number| number.to_string()).collect();
        fs::write(file.path(), lines.join("\r\n")).unwrap();
        assert!(last_lines(file.path()).starts_with("50\n51\n"));
        assert_eq!(last_lines(Path::new("/no such file")), "");
    }
}
