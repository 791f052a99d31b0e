//! A clock that stands still, in place of `web-time`, which would bring a browser's clock and wasm-bindgen's imports with it.
//!
//! clarabel times its solves by it, on WebAssembly only. Its answers do not depend on that, as no solve of ours has a time limit.

pub use std::time::Duration;

/// A moment; all are the same.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instant;

impl Instant {
    pub fn now() -> Self {
        Self
    }

    /// Time since then: none.
    pub fn elapsed(&self) -> Duration {
        Duration::ZERO
    }
}
