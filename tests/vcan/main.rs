//! The tools and a simulated robot on real CAN interfaces: `vcan0`, `vcan1` and `vcan2`.
//!
//! `cargo xtask vcan` runs these where the kernel has such interfaces. First [`board`] and [`on_vcan`], one test after the other;
//! what they leave behind, other programs then look at in [`afterwards`], where it need not be there.

mod afterwards;
mod bench;
mod board;
mod on_vcan;
