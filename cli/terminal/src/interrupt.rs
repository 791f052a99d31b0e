//! Requests to end the program: Ctrl-C, SIGTERM (`kill`, `timeout`, a stopped service) and SIGHUP (a closed terminal). The
//! solver polls the request between iterations.

use crate::output;
use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, Once};

static REQUESTED: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
static LISTENING: Once = Once::new();

/// Installs the signal handler. The first signal requests an orderly end, which the running command polls; a second signal
/// kills the process.
pub fn install_handler() {
    LISTENING.call_once(install);
}

/// Requests an orderly end from another thread of this program, as a signal does.
pub fn request() {
    REQUESTED.store(true, Ordering::Relaxed);
}

fn install() {
    for signal in [SIGINT, SIGTERM].into_iter().chain(hang_up()) {
        let requested = || Arc::clone(&REQUESTED);
        // This order matters: at the first signal, the flag is not set yet.
        let installed = flag::register_conditional_shutdown(signal, 130, requested())
            .and_then(|_| flag::register(signal, requested()));
        if let Err(error) = installed {
            output::print_line(format_args!(
                "cannot handle signal {signal}, which will therefore end the \
                process at once: {error}"
            ));
        }
    }
}

/// SIGHUP, or `None` if it is ignored: `nohup` lets a program outlive its terminal.
#[cfg(target_os = "linux")]
fn hang_up() -> Option<i32> {
    use signal_hook::consts::SIGHUP;
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
    let ignored = u64::from_str_radix(ignored.trim(), 16).ok()?;
    (ignored >> (SIGHUP - 1) & 1 == 0).then_some(SIGHUP)
}

/// Returns `None`, because other systems do not report whether SIGHUP is ignored.
#[cfg(not(target_os = "linux"))]
fn hang_up() -> Option<i32> {
    None
}

/// True if an end was requested since [`install_handler`].
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
