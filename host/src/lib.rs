//! The operator's end of the link: what a program on a computer does with a controller, over any bus.
//!
//! | module | is |
//! |---|---|
//! | [`session`] | what to do in which order: connect, flash, arm, select motions, stop |
//! | [`dbc`] | every frame signal by signal, and as a DBC file |
//! | [`decode`] | frames as named signals, for logs |
//! | [`telemetry`] | telemetry files for Foxglove |
//! | [`client`] | the protocol without clock or bus: frames and time in, frames out |
//! | [`operator`] | somebody at a console: wishes, frames and time in, frames and what to show out |
//! | [`discover`], [`overhear`] | who is on the link; who else talks to a controller |
//! | [`catalog`] | names for the numbers of a library |
//! | [`doctor`] | what is wrong with a robot, and how to clear it |
//! | [`describe`] | states, events and faults in words, and what to do next |
//! | [`refusal`] | what the controller says no with, in sentences |

pub mod catalog;
pub mod client;
pub mod dbc;
pub mod decode;
pub mod describe;
pub mod discover;
pub mod doctor;
pub mod operator;
pub mod overhear;
pub mod refusal;
pub mod session;
pub mod telemetry;
