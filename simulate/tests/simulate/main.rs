//! Plans on the simulated ground: one binary, one module per subject.

mod estimates;
mod iterations;
mod plays;
mod retargets;
