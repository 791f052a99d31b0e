//! Kernel modules of the guest, in dependency order.

use super::kernel::Kernel;
use crate::shell;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// Modules for the host's files and the output port, then for CAN. `can-gw` and `can-bcm` are for can-utils and python-can,
/// `kvaser_pci` drives the two cards, and `uinput` creates gamepads.
const WANTED: [&str; 16] = [
    "virtio_pci",
    "virtio_console",
    "9pnet_virtio",
    "9p",
    "overlay",
    "can",
    "can-dev",
    "can-raw",
    "can-bcm",
    "can-isotp",
    "can-gw",
    "vcan",
    "slcan",
    "kvaser_pci",
    "evdev",
    "uinput",
];

/// Returns the files of the modules, in the order of insertion.
///
/// # Errors
/// Returns an error if the kernel lacks a module.
pub fn files(kernel: &Kernel) -> Result<Vec<PathBuf>, String> {
    let mut answers = String::new();
    for module in WANTED {
        let mut modprobe = shell::system("modprobe", &["--show-depends", "-S", &kernel.release]);
        answers += &shell::output(modprobe.arg("-d").arg(&kernel.folder).arg(module))?;
    }
    Ok(in_order(&answers))
}

/// Returns the files that `modprobe --show-depends` lists, each once. Built-in modules have no file.
fn in_order(answers: &str) -> Vec<PathBuf> {
    let mut seen = BTreeSet::new();
    let inserted = answers.lines().filter_map(|line| line.strip_prefix("insmod "));
    inserted.map(str::trim).filter(|file| seen.insert(*file)).map(PathBuf::from).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_comes_once_and_after_what_it_needs() {
        let answers = "insmod /k/virtio.ko \ninsmod /k/virtio_pci.ko \nbuiltin overlay\n\
                       insmod /k/virtio.ko \ninsmod /k/can/can.ko.xz \n";
        let files = ["/k/virtio.ko", "/k/virtio_pci.ko", "/k/can/can.ko.xz"].map(PathBuf::from);
        assert_eq!(in_order(answers), files);
    }
}
