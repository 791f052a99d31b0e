//! The tools and a simulated robot on real CAN interfaces: `vcan0`, `vcan1` and `vcan2`, and what a virtual
//! machine has: two cards, and gamepads.
//!
//! `cargo xtask vcan` runs these where there are such interfaces. First [`board`], [`gamepad`], [`on_hardware`] and
//! [`on_vcan`], one test after the other; what they leave behind, other programs then look at in [`afterwards`], where it need not be there.

mod afterwards;
mod bench;
mod board;
mod gamepad;
mod on_hardware;
mod on_vcan;
