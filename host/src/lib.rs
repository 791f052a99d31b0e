//! The operator's end of the link: what a program on a computer does with a controller, over any bus.
//!
//! | module | is |
//! |---|---|
//! | [`session`] | what to do in which order: connect, flash, arm, select motions, stop |
//! | [`dbc`] | every frame signal by signal, and as a DBC file |
//! | [`client`] | the protocol without clock or bus: frames and time in, frames out |
//! | [`operator`] | somebody at a console: wishes, frames and time in, frames and what to show out |
//! | [`discover`], [`overhear`] | who is on the link; who else talks to a controller |
//! | [`catalog`] | names for the numbers of a library |
//! | [`doctor`] | what is wrong with a robot, and how to clear it |
//! | [`told`], [`telemetry`] | what a frame says by name; telemetry files for Foxglove |
//! | [`advice`] | what to do about a fault or in a state, in a sentence |
//! | [`refusal`] | what the controller says no with, in sentences |

pub mod advice;
pub mod catalog;
pub mod client;
pub mod dbc;
pub mod discover;
pub mod doctor;
pub mod operator;
pub mod overhear;
pub mod refusal;
pub mod session;
pub mod telemetry;
pub mod told;
