//! Data formats at the boundaries of the system: robot configuration, motion library, wire messages, framing.
//!
//! | module | contents | normative page |
//! |---|---|---|
//! | [`config`] | robot configuration of a controller, and its hash | |
//! | [`library`] | motion library (`.rwl`): encoder, validator, read view, frame decoder | `docs/formats/motion-library.md` |
//! | [`faults`] | catalogue of faults and of the events that raise them | `docs/faults.md` |
//! | [`wire`] | messages between host and controller, and the transport of long ones | `docs/formats/wire-format.md` |
//! | [`actuator`] | messages between controller and servos or wheel drives | `docs/formats/wire-format.md` |
//! | [`actuators`] | protocols of servos and wheel drives, of this project and of other makers | `docs/actuators.md` |
//! | [`packet`] | packets on a serial line | `docs/formats/wire-format.md` |
//! | [`tunnel`] | frames of every bus and the time over one serial line | `firmware/boards/mps2-an386/README.md` |
//! | [`serial`] | link over a serial line | `docs/formats/wire-format.md` |
//! | [`slcan`] | CAN frames as lines of text, for adapters with Lawicel's protocol | |
//! | [`can`] | CAN frame as a value, and its length in bits | |
//! | [`crc`] | checksums of all formats | |
//! | [`time`] | division of times | |
//! | [`text`] | safe printing of names and other untrusted text | |
//!
//! The crate uses no std, no alloc and no `unsafe`, and does not panic on any input. Every decoder accepts arbitrary bytes and
//! returns a value or a refusal, in bounded time.
//!
//! ```
//! use rollwalk_protocol::wire::{Action, Command, Node};
//!
//! let node = Node::new(1).expect("nodes are 0 to 14");
//! let play = Command { seq: 3, action: Action::Play { code: 2, speed_64ths: 64 }, valid_until_ms: 500 };
//! let frame = play.encode(node);
//! assert_eq!(Command::decode(&frame), Ok((node, play)));
//! ```
#![no_std]
#![forbid(unsafe_code)]
#![warn(missing_docs)]

#[cfg(test)]
extern crate std;

pub mod actuator;
pub mod actuators;
pub mod can;
mod coded;
pub mod config;
pub mod crc;
pub mod faults;
pub mod library;
#[cfg(feature = "names")]
pub mod names;
pub mod packet;
pub mod serial;
pub mod slcan;
pub mod text;
pub mod time;
pub mod tunnel;
pub mod wire;
