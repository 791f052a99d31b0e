//! Buses for programs on a computer: frames over CAN interfaces, serial lines and sockets, and logs of frames.
//!
//! | module | contents |
//! |---|---|
//! | [`link`] | trait of a bus with a controller, as a host uses it |
//! | [`name`], [`open`] | names of buses, and opening of a bus by its name; errors suggest a valid name |
//! | [`port`] | a bus in real time: an outlet, and a receiving thread |
//! | [`can`] | SocketCAN interfaces with short queues in the kernel; states and advice from error reports of their drivers |
//! | `line` | serial lines and sockets, with short read timeouts and non-blocking writes |
//! | [`priority`] | real-time priority for threads that carry frames |
//! | [`serial`], [`slcan`] | the link over a serial line; CAN adapters on serial lines |
//! | [`tty`] | serial lines of actuators: adapters and pseudo-terminals |
//! | [`sim`] | a simulated robot's link on this computer |
//! | [`lossy`] | a link that loses frames, for tests |
//! | [`candump`] | logs in the format of can-utils |
//!
//! ```
//! use rollwalk_bus::candump::{self, LogEntry};
//! use rollwalk_bus::name::BusName;
//!
//! let bus: BusName = "can:can0@1000000".parse()?;
//! assert_eq!(bus, BusName::Can { interface: "can0".into(), bitrate: Some(1_000_000) });
//!
//! let log: Vec<LogEntry> = candump::parse("(1700000000.123456) can0 123#DEADBEEF")?;
//! assert_eq!(log[0].to_string(), "(1700000000.123456) can0 123#DEADBEEF");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#![warn(missing_docs)]

#[cfg(target_os = "linux")]
pub mod can;
pub mod candump;
pub mod link;
pub mod lossy;
pub mod name;

// The following modules open devices, which a browser cannot.
#[cfg(not(target_family = "wasm"))]
mod error;
#[cfg(not(target_family = "wasm"))]
mod line;
#[cfg(not(target_family = "wasm"))]
pub mod open;
#[cfg(not(target_family = "wasm"))]
pub mod port;
#[cfg(not(target_family = "wasm"))]
pub mod priority;
#[cfg(not(target_family = "wasm"))]
pub mod serial;
#[cfg(not(target_family = "wasm"))]
pub mod sim;
#[cfg(not(target_family = "wasm"))]
pub mod slcan;
#[cfg(not(target_family = "wasm"))]
pub mod tty;
