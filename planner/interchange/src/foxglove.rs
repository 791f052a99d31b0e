//! Messages that Foxglove and Lichtblick draw: frames of all bodies, their solids, angles of joints, forces of the ground; in a
//! file ([`recording`]) or as they happen ([`LiveServer`]).
//!
//! A robot is published once as solids that are locked to frames, then as frames, so that a file has its geometry once. A
//! prefix of all frames tells robots apart: the planned one beside the measured one.

mod figure;
mod live;
mod messages;
mod recording;
mod session;

pub use figure::{Figure, Posture};
pub use live::{LiveError, LiveServer};
pub use recording::{RecordingError, recording};
