//! The data that crosses a boundary: robot configuration, motion library, wire messages, framing.
//!
//! No std, no alloc, no panics on hostile input. Normative byte formats: `docs/motion-library.md`
//! and `docs/wire-format.md`.
#![no_std]
#![forbid(unsafe_code)]

pub mod can;
pub mod config;
