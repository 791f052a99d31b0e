//! End-to-end tests of the command line, one module per subject.

mod authenticated;
mod bad_input;
mod bench;
mod command_line;
mod console;
mod controlled;
mod controlling;
mod couplings;
mod demo;
mod designs;
mod diagnosis;
mod driving;
mod explored;
mod files;
mod grounded;
mod identified;
mod libraries;
mod lines;
mod load;
mod operating;
mod pages;
mod problem_files;
mod recording;
mod results;
mod retargeting;
mod robots;
mod sending;
mod servo_lines;
mod signed;
mod simulated;
mod solver_options;
mod studio;
mod torques;
mod urdf;

use rollwalk_tests::{Desk, checkout};

/// Creates a desk with the command line under test.
fn desk() -> Desk {
    Desk::new(env!("CARGO_BIN_EXE_rollwalk-under-test"))
}

/// Creates a desk with the command line under test and its benchmark program.
fn desk_with_programs() -> Desk {
    Desk::with_programs(
        env!("CARGO_BIN_EXE_rollwalk-under-test"),
        env!("CARGO_BIN_EXE_rollwalk-bench-under-test"),
    )
}

/// Creates a desk with the shipped robots and motions, as in a checkout.
fn desk_with_shipped_files() -> Desk {
    let desk = desk();
    copy_shipped_files(&desk);
    desk
}

fn copy_shipped_files(desk: &Desk) {
    for folder in ["robots", "motions"] {
        desk.copy_folder(&checkout().join("shipped").join(folder), folder);
    }
}
