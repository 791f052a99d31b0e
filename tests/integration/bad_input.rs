//! Tests of bad input of each kind on the command line. The exit code is 1, stdout is empty, no file is written, and the
//! message contains file, location and valid input.

use crate::simulated::Robot;
use crate::{desk, desk_with_shipped_files};
use rollwalk_tests::program::{self, PLAYED};
use rollwalk_tests::{Desk, Outcome};
use std::process::Command;

#[test]
fn a_missing_file_names_its_neighbours_and_what_to_type() {
    let desk = desk_with_shipped_files();
    desk.run(&["robot", "check", "robots/agile.toml"])
        .fails(1, &["no robot file", "robots/agile.toml", "robots contains agilebot.toml"]);
    desk.run(&["plan", "motions/wlak.toml", "-o", "plan.json"])
        .fails(1, &["no motion file", "motions/wlak.toml", "did you mean `motions/walk.toml`"]);
    desk.run(&["report", "plan.json"]).fails(1, &["no plan", "plan.json", "rollwalk plan"]);
    desk.run(&["library", "inspect", "a.rwl"])
        .fails(1, &["no motion library", "a.rwl", "rollwalk library build"]);
    desk.edit("motions/walk.toml", "../robots/agilebot.toml", "../robots/agile.toml");
    let named = "motions/walk.toml names `../robots/agile.toml`";
    let places = "no robot file (TOML) at robots/agile.toml, and rollwalk ships none named \
                  robots/agile.toml";
    desk.run(&["plan", "motions/walk.toml", "-o", "x"]).fails(1, &[named, places]);
}

#[test]
fn a_file_of_another_kind_is_recognised() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/stand.toml", "-o", "plan.json"]).succeeds();
    let (robot, motion) = ("robots/agilebot.toml", "motions/stand.toml");
    let library = "motions/agilebot_library.toml";
    for (args, words) in [
        (&["plan", robot, "-o", "x"][..], [robot, "is a robot file, not a motion file"]),
        (&["plan", library, "-o", "x"], [library, "is a library file, not a motion file"]),
        (&["library", "build", motion, "-o", "x"], [motion, "is a motion file, not a library"]),
        (&["robot", "check", motion], [motion, "is a motion file, not a robot file"]),
        (&["robot", "check", "plan.json"], ["plan.json", "is a plan, not a robot file"]),
        (&["report", robot], [robot, "is a robot file, not a plan"]),
    ] {
        desk.run(args).fails(1, &words);
    }
    assert!(!desk.path("x").exists());
}

/// Checks that the desktop reports a drive that cannot do what the file requires, instead of the drive failing silently on the
/// robot.
#[test]
fn a_drive_that_cannot_do_what_the_file_says_is_named_with_its_line() {
    let file = "robots/test_leg.toml";
    let speed = ("speed_max_rad_s = 8.0", "speed_max_rad_s = 60.0");
    for (from, to, words) in [
        (
            speed.0,
            speed.1,
            &["joint `hip`", "is 60 rad/s, beyond the range of AK80-9", "at most 50 rad/s"][..],
        ),
        ("model = \"AK80-9\"\n#", "model = \"AK80\"\n#", &["bus 0: `model` cannot be", "`AK80-9`"]),
        ("number = 1", "number = 2", &["bus 2: `number` is a bus without motors"]),
    ] {
        let desk = desk_with_shipped_files();
        desk.edit(file, from, to);
        desk.run(&["robot", "check", file]).fails(1, &[words, &[file]].concat());
        simulate(&desk, file).fails(1, words);
    }
    // A robot that depends on the control rate.
    let desk = desk_with_shipped_files();
    desk.edit(file, "estimates_hz = 125", "estimates_hz = 50");
    simulate(&desk, file)
        .fails(1, &[file, "bus 1: set the drives to report their poses at 60 Hz or more"]);
}

#[test]
fn frames_of_another_maker_are_not_described_as_ours() {
    let desk = desk_with_shipped_files();
    desk.run(&["dbc", "robots/test_leg.toml", "--bus", "0"])
        .fails(1, &["bus 0 of test_leg uses AK80-9", "docs/actuators.md"]);
    desk.run(&["dbc", "robots/test_leg.toml"]).succeeds();
}

/// Starts `rollwalk-sim`, which must refuse the robot.
fn simulate(desk: &Desk, robot: &str) -> Outcome {
    let mut command = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
    command.args([robot, "--bus", "sim:robot.sock"]).current_dir(desk.path("."));
    command.env("COLUMNS", "1000").env("NO_COLOR", "1");
    program::run(&mut command, PLAYED)
}

#[test]
fn a_malformed_robot_shows_file_line_and_field() {
    let cases = [
        (
            "mass_kg = 0.600",
            "mass_kg = -0.6",
            &["`mass_kg` is -0.6", "give a value from 0.000001 to 1000 kg"][..],
        ),
        ("name = \"body\"", "nam = \"body\"", &["unknown key `nam`", "did you mean `name`"]),
        ("child = \"*_hip\"", "child = \"*_hop\"", &["_hop"]),
        ("[[link]]", "[[link", &["agilebot.toml"]),
    ];
    for (from, to, words) in cases {
        let desk = desk_with_shipped_files();
        desk.edit("robots/agilebot.toml", from, to);
        let line = line_of(&desk, "robots/agilebot.toml", to);
        let place = format!("robots/agilebot.toml:{line}");
        let outcome = desk.run(&["robot", "check", "robots/agilebot.toml"]);
        let file_alone = &["robots/agilebot.toml"][..];
        // A missing name is reported at the table that lacks it, one line above the wrong key.
        let place = if to.starts_with("nam ") { file_alone } else { &[place.as_str()] };
        outcome.fails(1, &[words, place].concat());
        // All commands that read the robot print the same message.
        desk.run(&["plan", "motions/walk.toml", "-o", "plan.json"]).fails(1, words);
        assert!(!desk.path("plan.json").exists());
    }
}

#[test]
fn a_malformed_motion_shows_file_line_and_field() {
    let cases = [
        ("duty = 0.8", "duty = 8.0", &["`duty` is 8", "0.3 to 0.95"][..]),
        ("forward_m", "foward_m", &["unknown key `foward_m`", "`forward_m`"]),
        ("ends = \"periodic\"", "ends = \"cyclic\"", &["`ends`", "cyclic", "periodic"]),
        ("duration_s = 1.6", "duration_s = 1.601", &["duration_s", "60 Hz"]),
        ("swing_height_m = 0.03", "", &["swing_height_m", "missing or 0", "above 0"]),
        (
            "gait = ",
            "all = \"stance\"\ngait = ",
            &["`gait` is given together with `all`", "keep one"],
        ),
        ("gait = \"walk\"", "gait = \"wlak\"", &["`gait`", "wlak", "walk"]),
        ("robots/agilebot.toml", "robots/agilbot.toml", &["no robot file", "agilebot.toml"]),
    ];
    for (from, to, words) in cases {
        let desk = desk_with_shipped_files();
        desk.edit("motions/walk.toml", from, to);
        let outcome = desk.run(&["plan", "motions/walk.toml", "-o", "plan.json"]);
        outcome.fails(1, words);
        assert!(!desk.path("plan.json").exists(), "nothing is written for {to}");
    }
}

#[test]
fn a_malformed_library_file_shows_what_does_not_fit() {
    let cases = [
        ("code = 3", "code = 2", &["code 2 already selects `drive_1m`"][..]),
        ("safe = \"stand\"", "safe = \"walk\"", &["safe", "does not stand still"]),
        ("safe = \"stand\"", "safe = \"drive_1m\"", &["safe", "does not stand still"]),
        ("robots/agilebot.toml", "robots/creature3.toml", &["`stand` is for robot `agilebot`"]),
        ("safe = \"stand\"", "safe = \"stnad\"", &["stnad", "`stand`"]),
        ("file = \"walk.toml\"", "file = \"run.toml\"", &["no motion file", "walk.toml"]),
        ("[via_safe]", "[via_saf]", &["via_saf"]),
    ];
    for (from, to, words) in cases {
        let desk = desk_with_shipped_files();
        desk.edit("motions/agilebot_library.toml", from, to);
        desk.run(&["library", "build", "motions/agilebot_library.toml", "-o", "a.rwl"])
            .fails(1, words);
        assert!(!desk.path("a.rwl").exists(), "nothing is written for {to}");
    }
}

#[test]
fn a_wrong_plan_names_the_field() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/stand.toml", "-o", "plan.json"]).succeeds();
    let good = desk.read_text("plan.json");
    let cases = [
        (good.replacen("rollwalk-plan", "somebody-else", 1), &["format", "rollwalk-plan"][..]),
        (good.replacen("\"version\": 3", "\"version\": 7", 1), &["version", "7"]),
        (good.replacen("\"com_m\"", "\"com\"", 1), &["samples[0]", "com_m"]),
        (good[..good.len() / 2].to_owned(), &["plan.json"]),
        ("samples: none".to_owned(), &["plan.json:1:1: this is not JSON"]),
    ];
    for (bad, words) in cases {
        assert_ne!(bad, good);
        desk.write("bad/plan.json", &bad);
        for args in [
            &["report", "bad/plan.json"][..],
            &["plot", "bad/plan.json", "-o", "out"],
            &["export", "bad/plan.json", "-o", "out"],
        ] {
            desk.run(args).fails(1, words);
        }
        assert!(!desk.path("out").exists());
    }
}

#[test]
fn a_damaged_library_says_how() {
    let desk = desk_with_shipped_files();
    let good = built_library(&desk);
    let flipped = |at: usize| {
        let mut bytes = good.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    let mut future = good.clone();
    future[8..10].copy_from_slice(&2u16.to_le_bytes());
    let header_crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(&future[..20]);
    future[20..24].copy_from_slice(&header_crc.to_le_bytes());
    let cases = [
        (flipped(good.len() / 2), &["corrupted", "CRC"][..]),
        (flipped(12), &["header", "corrupted"]),
        (good[..good.len() - 100].to_vec(), &["truncated"]),
        (good[..10].to_vec(), &["truncated: 10 of"]),
        (Vec::new(), &["truncated: 0 of"]),
        ([good.clone(), vec![0; 4]].concat(), &["remove the bytes after the library"]),
        (future, &["format version 2", "supports version 1"]),
        (
            b"# Not a library at all, but long enough to be one.\n".repeat(4),
            &["not a motion library"],
        ),
    ];
    for (bad, words) in cases {
        desk.write("bad.rwl", &bad);
        let words = [&["bad.rwl"], words].concat();
        desk.run(&["library", "inspect", "bad.rwl"]).fails(1, &words);
    }
}

/// Controllers ignore names, but users identify motions by them.
#[test]
fn a_library_whose_names_mislead_is_refused() {
    let desk = desk_with_shipped_files();
    let good = built_library(&desk);
    for (name, words) in [
        (b"driv\x1b[2J", "\"driv\\u001b[2J\", has invisible characters"),
        (b"drive\n1m", "\"drive\\u000a1m\", has invisible characters"),
        (b"drive_1\0", "\"drive_1\\u0000\", has invisible characters"),
    ] {
        desk.write("bad.rwl", renamed(&good, b"\x08drive_1m", &[b"\x08", &name[..]].concat()));
        desk.run(&["library", "inspect", "bad.rwl"])
            .fails(1, &["bad.rwl: the name of motion 1", words]);
    }
    desk.edit("motions/small.toml", "name = \"drive_1m\"", "name = \"drive\"");
    desk.run(&["library", "build", "motions/small.toml", "-o", "a.rwl"]).succeeds();
    desk.write("bad.rwl", renamed(&desk.read("a.rwl"), b"\x05drive", b"\x05stand"));
    desk.run(&["library", "inspect", "bad.rwl"])
        .fails(1, &["motions 0 and 1 have the same name, `stand`"]);
}

/// Returns the library with a name replaced, and with valid checksums.
fn renamed(good: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let mut bytes = good.to_vec();
    let at = bytes.windows(from.len()).position(|window| window == from).expect("the name");
    bytes[at..at + to.len()].copy_from_slice(to);
    let footer = bytes.len() - 24;
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISCSI);
    let body = crc.checksum(&bytes[..footer]).to_le_bytes();
    bytes[footer + 12..footer + 16].copy_from_slice(&body);
    let own = crc.checksum(&bytes[footer..footer + 20]).to_le_bytes();
    bytes[footer + 20..].copy_from_slice(&own);
    bytes
}

#[test]
fn a_library_of_another_robot_is_refused() {
    let desk = desk_with_shipped_files();
    built_library(&desk);
    desk.run(&["library", "inspect", "a.rwl", "--robot", "robots/creature3.toml"])
        .fails(1, &["built for another robot", "build the library again"]);
    // The simulator has no option `--robot`, so its hint does not name it.
    let args = ["robots/creature3.toml", "--bus", "sim:none.sock", "--library", "a.rwl"];
    let refused = Robot::refuses(&desk, &args);
    assert!(!refused.stderr.contains("--robot"), "{}", refused.stderr);
    refused.fails(1, &["built for another robot", "start rollwalk-sim with the robot file"]);
    // The same robot with a stiffer servo is another robot, because gains are part of its configuration.
    desk.edit("robots/agilebot.toml", "kp_nm_rad = 80.0", "kp_nm_rad = 81.0");
    desk.run(&["library", "inspect", "a.rwl", "--robot", "robots/agilebot.toml"])
        .fails(1, &["built for another robot"]);
}

#[test]
fn an_impossible_rate_is_refused() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", "motions/stand.toml", "-o", "plan.json"]).succeeds();
    for rate in ["0", "-5", "nan", "1e9"] {
        let rate = format!("--rate={rate}");
        desk.run(&["export", "plan.json", &rate, "-o", "out.csv"])
            .fails(1, &["expected a rate above 0"]);
    }
    assert!(!desk.path("out.csv").exists());
    desk.run(&["export", "plan.json", "--rate=1e-9", "-o", "out.csv"])
        .fails(1, &["--rate is too low", "fewer than two rows"]);
    let export = |args: &[&str]| desk.run(&[&["export", "plan.json"], args].concat());
    export(&["--rate=0.1", "-o", "out.npz"]).fails(1, &["--rate is too low"]);
    for length in ["0", "-5", "nan", "1e9"] {
        let length = format!("--length={length}");
        export(&[&length, "-o", "out.npz"]).fails(1, &["expected a length above 0 and up to 3600"]);
    }
    export(&["--length=5", "-o", "out.csv"]).fails(1, &["--length is for motion data (.npz)"]);
    assert!(!desk.path("out.npz").exists());
}

#[test]
fn an_unwritable_output_is_named() {
    let desk = desk_with_shipped_files();
    desk.write("in_the_way", "");
    desk.run(&["plan", "motions/stand.toml", "-o", "in_the_way/plan.json"])
        .fails(1, &["cannot write into in_the_way"]);
    desk.run(&["plan", "motions/stand.toml", "-o", "motions"]).fails(1, &["cannot write motions"]);
    // The error comes before a long run, not after it.
    let outcome = desk.run(&["demo", "--out", "in_the_way"]);
    assert!(!outcome.stderr.contains("Planning"), "{}", outcome.stderr);
    outcome.fails(1, &["cannot write into in_the_way: it is not a folder"]);
}

#[test]
fn text_that_is_not_utf8_is_refused() {
    let desk = desk();
    desk.write("robot.toml", [0xff, 0xfe, 0x00]);
    desk.run(&["robot", "check", "robot.toml"]).fails(1, &["robot.toml", "not UTF-8"]);
}

/// Builds a small library and returns its bytes.
fn built_library(desk: &Desk) -> Vec<u8> {
    desk.write(
        "motions/small.toml",
        "name = \"small\"\nrobot = \"../robots/agilebot.toml\"\nsafe = \"stand\"\n\
         [[motion]]\nname = \"stand\"\nfile = \"stand.toml\"\ncode = 1\n\
         [[motion]]\nname = \"drive_1m\"\nfile = \"drive_1m.toml\"\ncode = 2\n\
         [via_safe]\nduration_s = 1.2\nsamples = 13\n",
    );
    desk.run(&["library", "build", "motions/small.toml", "-o", "a.rwl"]).succeeds();
    desk.read("a.rwl")
}

/// Returns the number of the first line that contains `text`.
fn line_of(desk: &Desk, file: &str, text: &str) -> usize {
    let content = desk.read_text(file);
    1 + content.lines().position(|line| line.contains(text)).expect("the edit is in the file")
}
