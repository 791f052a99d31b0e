//! Initial file system of the guest: a static busybox, modules, and `init.sh`, which mounts the host's files.

use super::{kernel::Kernel, modules};
use crate::shell::{self, command};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

const INIT: &str = include_str!("init.sh");
/// Path of busybox in Debian's package busybox-static.
const BUSYBOX: &str = "/bin/busybox";

/// Packs the file system in a folder. This takes a second, so the result is not kept between runs.
///
/// # Errors
/// Returns an error of the file system or of the packer.
pub fn pack(kernel: &Kernel, folder: &Path) -> Result<PathBuf, String> {
    let tree = folder.join("initramfs");
    let failed = |error: std::io::Error| format!("{}: {error}", tree.display());
    for name in ["bin", "modules", "proc", "sys", "dev", "host", "exchange", "layer", "machine"] {
        fs::create_dir_all(tree.join(name)).map_err(failed)?;
    }
    fs::copy(BUSYBOX, tree.join("bin/busybox")).map_err(|error| format!("{BUSYBOX}: {error}"))?;
    fs::write(tree.join("init"), INIT).map_err(failed)?;
    fs::set_permissions(tree.join("init"), PermissionsExt::from_mode(0o755)).map_err(failed)?;
    for (index, file) in modules::files(kernel)?.iter().enumerate() {
        let target = tree.join("modules").join(format!("{index:02}.ko"));
        fs::write(target, module(file)?).map_err(failed)?;
    }
    let archive = folder.join("initramfs.cpio");
    let pack = "find . | cpio --quiet --create --format=newc --owner=0:0 > \"$1\"";
    let mut sh = command("sh", &["-e", "-c", pack, "sh"]);
    shell::output(sh.arg(&archive).current_dir(&tree))?;
    Ok(archive)
}

/// Reads a module, decompressed for busybox; kernels since Debian 13 have compressed modules.
fn module(file: &Path) -> Result<Vec<u8>, String> {
    if file.extension().is_some_and(|extension| extension == "xz") {
        return shell::bytes(command("xz", &["--decompress", "--stdout"]).arg(file));
    }
    fs::read(file).map_err(|error| format!("{}: {error}", file.display()))
}
