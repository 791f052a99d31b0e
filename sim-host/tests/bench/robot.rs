//! The robot of the tests.

pub use rollwalk_sim_host::one_leg::*;
