//! Messages for Foxglove and Lichtblick: frames and solids of all bodies, joint angles, ground forces. They are written to a
//! file ([`recording`]) or sent live ([`LiveServer`]).
//!
//! A robot is published once as solids locked to frames, then as frames only, so that a file contains its geometry once. A
//! prefix of all frames distinguishes robots, such as the planned and the measured one.

mod figure;
mod live;
mod messages;
mod recording;
mod session;

pub use figure::{Figure, Posture};
pub use live::{LiveError, LiveServer};
pub use recording::{RecordingError, recording};
