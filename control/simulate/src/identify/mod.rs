//! System identification (thesis 4.7.3): friction, gains of drives and other numbers that a simulation takes from a robot file,
//! fitted until the simulated run matches the recorded one.
//!
//! | module | is |
//! |---|---|
//! | [`series`] | a number over time |
//! | [`recording`] | commands of the drives and measurements |
//! | [`quantity`] | list of the quantities that can be fitted |
//! | `start` | the state in which the recording begins |
//! | `rollout` | the simulated run and its residuals |
//! | [`fit`] | a run fitted, from several starting points over growing parts of it; other runs predicted |
//! | `search` | its searches, each over a part of the run |
//! | [`outcome`] | progress, results and errors |
//! | `parts` | how far parts of the run disagree |
//! | [`together`](mod@together) | several runs, each fitted alone, as one answer |
//! | `effects` | the mean of what disagrees by more than its deviations |
//! | [`quality`] | noise of the measurements, and the error of a simulated run against them |
//!
//! Simulated drives get the recorded commands, with the gains of the model, so a run can be simulated again with other numbers.
//! Measurements are not fed back: a simulated run that is near the recorded one after seconds got there by itself.

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
