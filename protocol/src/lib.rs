//! The data that crosses a boundary: robot configuration, motion library, wire messages, framing.
//!
//! | module | is | normative page |
//! |---|---|---|
//! | [`config`] | the robot as the controller sees it, and its hash | |
//! | [`library`] | the motion library (`.rwl`): encoder, validator, read view, frame decoder | `docs/formats/motion-library.md` |
//! | [`faults`] | the catalogue of faults and of the events that raise them | `docs/faults.md` |
//! | [`wire`] | messages between host and controller, and the transport of long ones | `docs/formats/wire-format.md` |
//! | [`actuator`] | messages between controller and servos or wheel drives | `docs/formats/wire-format.md` |
//! | [`actuators`] | the protocols of servos and wheel drives, this and those of other makers | `docs/actuators.md` |
//! | [`packet`] | packets on a serial line | `docs/formats/wire-format.md` |
//! | [`tunnel`] | frames of every bus and the time over one serial line | `firmware/boards/mps2-an386/README.md` |
//! | [`serial`] | the link over a serial line | `docs/formats/wire-format.md` |
//! | [`slcan`] | CAN frames as lines of text, for adapters that speak Lawicel's protocol | |
//! | [`can`] | a CAN frame as a value, and how many bits it takes | |
//! | [`crc`] | the checksums that all of it uses | |
//! | [`time`] | division of times | |
//! | [`text`] | names and other text of strangers: what of it is safe to print | |
//!
//! No std, no alloc, no `unsafe`, no panics whatever the input. Everything that decodes takes
//! arbitrary bytes and answers with a value or a refusal, in bounded time.
//!
//! ```
//! use rollwalk_protocol::wire::{Action, Command, Node};
//!
//! let node = Node::new(1).expect("nodes are 1 to 14");
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
