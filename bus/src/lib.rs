//! The buses, as programs on a computer see them: frames over whatever carries them, and logs of them.
//!
//! | module | is |
//! |---|---|
//! | [`link`] | the trait: a bus with the controller on it, seen from the host |
//! | [`name`], [`open`] | from what the user types to an open bus, or to what to type instead |
//! | [`port`] | a bus in real time: an outlet, and a thread that listens |
//! | [`can`] | SocketCAN: short queues, and what drivers report as states and sentences |
//! | `line` | the ends of a serial line: reading that waits a little, writing that does not |
//! | [`serial`], [`slcan`] | the link over a serial line; CAN adapters on serial lines |
//! | [`sim`] | a simulated robot's link on this computer |
//! | [`lossy`] | a link that loses frames, for tests |
//! | [`candump`] | logs in the format of can-utils |

#[cfg(target_os = "linux")]
pub mod can;
pub mod candump;
mod line;
pub mod link;
pub mod lossy;
pub mod name;
pub mod open;
pub mod port;
pub mod serial;
pub mod sim;
pub mod slcan;
