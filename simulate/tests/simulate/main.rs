//! Plans on the simulated ground: one binary, one module per subject.

mod iterations;
mod plays;
mod retargets;
