//! Ctrl-C as a value that a solve can look at between two iterations.

use crate::output;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

static REQUESTED: AtomicBool = AtomicBool::new(false);
static LISTENING: Once = Once::new();

/// From here on the first Ctrl-C asks what is running to end; a second one ends the process.
pub fn listen() {
    LISTENING.call_once(install);
}

fn install() {
    let handler = || {
        if REQUESTED.swap(true, Ordering::Relaxed) {
            std::process::exit(130);
        }
    };
    // Refused only when a handler is already installed; then that one stays.
    if let Err(error) = ctrlc::set_handler(handler) {
        output::say(format_args!("Ctrl-C will end the process at once: {error}"));
    }
}

/// Whether Ctrl-C was pressed since [`listen`].
pub fn requested() -> bool {
    REQUESTED.load(Ordering::Relaxed)
}
