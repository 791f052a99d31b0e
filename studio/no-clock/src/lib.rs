//! Clock that stands still. It replaces `web-time`, which would require a browser's clock and imports of wasm-bindgen.
//!
//! clarabel times its solves by this clock, on WebAssembly only. Its results do not depend on time, because no solve here has a
//! time limit.

pub use std::time::Duration;

/// Instant; all instants are equal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instant;

impl Instant {
    pub fn now() -> Self {
        Self
    }

    /// Returns zero.
    pub fn elapsed(&self) -> Duration {
        Duration::ZERO
    }
}
