//! The tools and a simulated robot on real CAN interfaces: `vcan0`, `vcan1` and `vcan2`, and on the two cards and
//! gamepads of a virtual machine.
//!
//! `cargo xtask vcan` runs these tests where there are such interfaces. First [`board`], [`gamepad`], [`on_hardware`] and
//! [`on_vcan`], one test after the other; then, anywhere, [`afterwards`]: other programs read the logs that they left.
#![cfg(target_os = "linux")]

mod afterwards;
mod bench;
mod board;
mod gamepad;
mod on_hardware;
mod on_vcan;
