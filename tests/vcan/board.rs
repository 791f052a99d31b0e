//! Tests of the emulated Cortex-M4 board, whose UART is an SLCAN adapter to its link: with our tools directly, and as a Linux
//! interface that is joined to `vcan0`.

use crate::bench::{BackgroundProgram, desk, flash, keep, rollwalk, run};
use crate::on_vcan::play_stop_clear_and_play;
use std::fs::{File, OpenOptions};
use std::io::{Read, Write};
use std::path::Path;
use std::thread::sleep;
use std::time::Duration;

/// Log of the board, for [`crate::afterwards`].
pub const LOG: &str = "board.log";

/// Runs the shortest sequence that tests all uses of a bus: transfer, heartbeats, commands, a stop.
fn stand_and_stop(bus: &str) {
    let on = |args: &[&str]| rollwalk(&[args, &["--bus", bus]].concat()).succeeds();
    assert!(on(&["discover", "--json"]).contains("\"node\": 1"), "{bus}");
    flash(bus).succeeds();
    on(&["send", "--arm", "1"]);
    on(&["estop"]);
    on(&["clear"]);
}

/// Sends a single-letter command to the adapter and returns its answer. Frames may arrive before the answer.
#[track_caller]
fn ask(line: &mut File, letter: char) -> String {
    write!(line, "{letter}\r").expect("a UART takes a question");
    loop {
        let mut said = String::new();
        while !said.ends_with('\r') {
            let mut byte = [0];
            line.read_exact(&mut byte).expect("a UART answers");
            said.push(char::from(byte[0]));
        }
        let said = said.trim_matches(['\x07', '\r']);
        if said.starts_with(letter) {
            return said.to_owned();
        }
    }
}

/// Waits until an interface exists (`there`) or is gone.
fn wait_for(interface: &str, there: bool) {
    let path = Path::new("/sys/class/net").join(interface);
    for _ in 0..100 {
        if path.exists() == there {
            return;
        }
        sleep(Duration::from_millis(20));
    }
    panic!("{interface}: it should be {}", if there { "there" } else { "gone" });
}

/// Adds (`-A`) or deletes (`-D`) the rules that join the board's interface and `vcan0`. Other rules are kept, because the
/// kernel may be a developer's.
fn join(what: &str) {
    for (from, to) in [("slcan0", "vcan0"), ("vcan0", "slcan0")] {
        run("cangw", &[what, "-s", from, "-d", to, "-e"]);
    }
}

#[test]
#[ignore = "needs CAN interfaces: cargo xtask vcan"]
fn a_cortex_m4_behind_slcand_plays_is_stopped_cleared_and_plays_again() {
    let (board, line) = BackgroundProgram::board();
    // QEMU drops output to a terminal that no program has opened, and checks this only once a second.
    let mut held = OpenOptions::new().read(true).write(true).open(&line).expect("its UART");
    assert_eq!(ask(&mut held, 'V'), "V1010");
    stand_and_stop(&format!("slcan:{line}"));

    let slcand = BackgroundProgram::slcand(&line, "slcan0");
    wait_for("slcan0", true);
    run("ip", &["link", "set", "slcan0", "up"]);
    stand_and_stop("can:slcan0");

    // Not a loop, because the kernel repeats a frame once.
    join("-A");
    let candump = BackgroundProgram::candump("vcan0", &desk().join(LOG));
    play_stop_clear_and_play();
    sleep(Duration::from_millis(200));
    drop(candump);
    keep(LOG);

    join("-D");
    // Closes the channel. Versions of slcand differ in how they end.
    slcand.interrupt();
    wait_for("slcan0", false);
    // Flags of the adapter: no byte was lost.
    assert_eq!(ask(&mut held, 'F'), "F00");
    drop(board);
}
