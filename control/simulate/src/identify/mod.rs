//! System identification (thesis 4.7.3): fits friction, gains of drives and other parameters of a robot file until the
//! simulated run matches the recorded one.
//!
//! | module | contents |
//! |---|---|
//! | [`series`] | time series of one value |
//! | [`recording`] | commands of the drives, and measurements |
//! | [`quantity`] | quantities that can be fitted |
//! | `start` | start state of the recording |
//! | `rollout` | simulated run and its residuals |
//! | [`fit`] | fit of one run, and prediction of other runs |
//! | `search` | searches of a fit, each over a part of the run |
//! | [`outcome`] | progress, results and errors |
//! | `parts` | disagreement between parts of a run |
//! | [`combine_fits`](mod@together) | combination of fits to several runs |
//! | `effects` | mean of values that disagree by more than their standard deviations |
//! | [`quality`] | noise of the measurements, and error of a simulated run |
//!
//! Simulated drives get the recorded commands and use the gains of the model, so that a run can be simulated with other
//! parameters. Measurements are not fed back: a simulated run stays near the recorded one only if the model is right.

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
pub use outcome::{FitError, FitResult, FittedQuantity, QuantityVerdict, Stage};
pub use quality::Quality;
pub use quantity::{Group, Kind, Quantity, Scope, SimulationModel};
pub use recording::{DriveSeries, NoMovement, Recording, RequestedSpan, TableError, motor_names};
pub use rollout::Signal;
pub use series::Series;
pub use together::{CombinedFit, CombinedQuantity, combine_fits};
