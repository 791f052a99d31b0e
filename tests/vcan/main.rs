//! Tests of the tools and a simulated robot on real CAN interfaces: `vcan0`, `vcan1` and `vcan2`, and the two cards and
//! gamepads of a virtual machine.
//!
//! `cargo xtask vcan` runs these tests on a machine with such interfaces. First run [`board`], [`gamepad`], [`on_hardware`] and
//! [`on_vcan`], one test after the other. Then [`afterwards`] runs anywhere: other programs read the logs of these tests.
#![cfg(target_os = "linux")]

mod afterwards;
mod bench;
mod board;
mod gamepad;
mod on_hardware;
mod on_vcan;
