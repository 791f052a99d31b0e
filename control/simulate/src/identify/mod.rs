//! What a robot is, from how it ran (thesis 4.7.3): friction, gains of drives and what else a simulation takes from a robot file,
//! fitted until the simulated run is the recorded one.
//!
//! | module | is |
//! |---|---|
//! | [`series`] | a number over time |
//! | [`recording`] | commands of the drives and measurements |
//! | [`quantity`] | what can be fitted, in one list |
//! | `start` | the state in which the recording begins |
//! | `rollout` | the run simulated again, and what it misses |
//! | [`fit`] | a run fitted, from several starting points over growing parts of it; other runs predicted |
//! | `search` | its searches, each over a part of the run |
//! | [`outcome`] | what it says and finds, or why it finds nothing |
//! | `parts` | how far parts of the run disagree |
//! | [`together`](mod@together) | several runs, each fitted alone, as one answer |
//! | `effects` | the mean of what disagrees by more than its deviations |
//! | [`quality`] | noise of the measurements, and the error of a simulated run against them |
//!
//! Drives do what they were commanded in the recording, with the gains of the model; so a run can be simulated again with other
//! numbers. There is no feedback from what was measured: a simulated run that is near to the recorded one after seconds has
//! come there by itself.

mod effects;
pub mod fit;
pub mod outcome;
mod parts;
pub mod quality;
pub mod quantity;
pub mod recording;
mod rollout;
mod search;
pub mod series;
mod start;
#[cfg(test)]
mod tests;
pub mod together;

pub use fit::{Options, identify, predict};
pub use outcome::{Found, Identified, Stage, Unfit, Verdict};
pub use quality::Quality;
pub use quantity::{Group, Kind, Model, Of, Quantity};
pub use recording::{Drive, Idle, Recording, TableError, Wanted, motor_names};
pub use rollout::Signal;
pub use series::Series;
pub use together::{Combined, Together, together};
