//! Tests of files from a hostile or careless user: outputs over inputs, devices and links, names with terminal escapes, endless
//! inputs.

use crate::{checkout, desk, desk_with_shipped_files};
use rollwalk_tests::Desk;
use rollwalk_tests::program::{self, LONG, PLANNED, PLAYED};
use std::fmt::Write;
use std::fs;
use std::process::Command;

const STAND: &str = "motions/stand.toml";

#[test]
fn no_input_is_ever_an_output() {
    let desk = desk_with_shipped_files();
    fs::hard_link(desk.path(STAND), desk.path("hard.json")).unwrap();
    let mut outputs =
        vec![STAND, "./motions/../motions/stand.toml", "robots/agilebot.toml", "hard.json"];
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(STAND, desk.path("soft.json")).unwrap();
        outputs.push("soft.json");
    }
    let before = [STAND, "robots/agilebot.toml"].map(|file| desk.read(file));
    for output in outputs {
        desk.run(&["plan", STAND, "-o", output])
            .fails(1, &[&format!("cannot write {output}: it is "), "that this command reads"]);
        desk.run(&["plan", STAND, "-o", "x.json", "--dump", output]).fails(1, &[output]);
    }
    desk.run(&["library", "build", "motions/agilebot_library.toml", "-o", "motions/walk.toml"])
        .fails(1, &["motions/walk.toml, a motion file (TOML) that this command reads"]);
    desk.run(&["dbc", "robots/agilebot.toml", "-o", "robots/agilebot.toml"])
        .fails(1, &["robots/agilebot.toml, a robot file (TOML) that this command reads"]);
    let mut simulator = Command::new(env!("CARGO_BIN_EXE_rollwalk-sim-under-test"));
    let robot = "robots/agilebot.toml";
    simulator.args([robot, "--bus", "sim:robot.sock", "--log", robot]).current_dir(desk.path("."));
    assert_eq!(program::run(&mut simulator, PLAYED).code, 1);
    assert_eq!([STAND, "robots/agilebot.toml"].map(|file| desk.read(file)), before);
    assert!(!desk.path("x.json").exists());

    desk.run(&["plan", STAND, "-o", "plan.json"]).succeeds();
    let plan = desk.read("plan.json");
    for args in [
        &["plot", "plan.json", "-o", "plan.json"][..],
        &["export", "plan.json", "-o", "plan.json"],
        &["plan", STAND, "--from", "plan.json", "-o", "plan.json"],
    ] {
        assert_eq!(desk.run(args).code, 1, "{args:?}");
        assert_eq!(desk.read("plan.json"), plan);
    }
}

/// Checks that files name shipped files as commands do, from any folder, and that a file beside them takes precedence.
#[test]
fn files_name_shipped_files_from_any_folder() {
    let desk = desk();
    let stand = fs::read_to_string(checkout().join("shipped/motions/test_leg_stand.toml")).unwrap();
    let library = fs::read_to_string(checkout().join("shipped/motions/test_leg_library.toml"));
    let library = library.unwrap().replace("../robots/", "robots/");
    desk.write("a/b/stand.toml", &stand);
    desk.write("d/stand.toml", stand.replace("../robots/", "robots/"));
    desk.write("d/library.toml", library.replace("file = \"", "file = \"motions/"));
    for motion in ["a/b/stand.toml", "d/stand.toml"] {
        desk.run(&["plan", motion, "-o", "stand.json"]).succeeds();
    }
    desk.run(&["library", "build", "d/library.toml", "-o", "leg.rwl"]).succeeds();
    desk.write("d/robots/test_leg.toml", "name = 1");
    for args in [["plan", "d/stand.toml"], ["library build", "d/library.toml"]] {
        let words: Vec<_> = args[0].split(' ').chain([args[1], "-o", "x"]).collect();
        desk.run(&words).fails(1, &["d/robots/test_leg.toml"]);
    }
}

/// Checks that an existing file always takes precedence over the shipped file of the same path.
#[test]
fn shipped_files_stand_in_for_missing_ones_alone() {
    let desk = desk();
    desk.run(&["robot", "check", "robots/agilebot.toml"]).succeeds();
    let shipped = fs::read_to_string(checkout().join("shipped/motions/stand.toml")).unwrap();
    desk.write("own/stand.toml", shipped.replace("duration_s", "# as shipped\nduration_s"));
    desk.run(&["plan", "own/stand.toml", "-o", "stand.json"]).succeeds();
    fs::create_dir(desk.path("motions")).unwrap();
    desk.run(&["plan", "motions/stand.toml", "-o", "./motions/stand.toml"])
        .fails(1, &["./motions/stand.toml", "that this command reads"]);
    desk.run(&["control", "motions/agilebot_library.toml", "--play", "no-such-motion"])
        .fails(1, &["--bus is missing"]);
    fs::create_dir(desk.path("robots")).unwrap();
    desk.run(&["robot", "check", "robots/agilebot.toml"]).succeeds();
    #[cfg(unix)]
    {
        let link = desk.path("robots/agilebot.toml");
        std::os::unix::fs::symlink("elsewhere.toml", &link).unwrap();
        desk.run(&["robot", "check", "robots/agilebot.toml"]).fails(1, &["robots/agilebot.toml"]);
        fs::remove_file(link).unwrap();
    }
    desk.write("robots/agilebot.toml", "name = 1");
    desk.run(&["plan", "motions/stand.toml", "-o", "x.json"]).fails(1, &["robots/agilebot.toml"]);
}

#[test]
fn formats_that_are_not_written_are_refused_by_name() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", STAND, "-o", "plan.json"]).succeeds();
    desk.run(&["plot", "plan.json", "-o", "x.pdf"])
        .fails(1, &["a figure as x.pdf", "written as .svg or .png", "rsvg-convert"]);
    desk.run(&["plot", "plan.json", "-o", "x.gif"]).fails(1, &["a figure as x.gif", "--animate"]);
    desk.run(&["export", "plan.json", "-o", "x.xlsx"]).fails(
        1,
        &["a plan as x.xlsx", "written as .csv, .json, .mcap, .npz or .xml", "spreadsheets"],
    );
    desk.run(&["export", "plan.json", "--format", "csv", "-o", "x.json"])
        .fails(1, &["the extension of x.json does not match --format"]);
    assert!(["x.pdf", "x.gif", "x.xlsx", "x.json"].iter().all(|name| !desk.path(name).exists()));
    desk.run(&["export", "plan.json", "-o", "x.json"]).succeeds();
    assert!(desk.read_text("x.json").starts_with('{'));
    desk.run(&["export", "plan.json", "-o", "x"]).succeeds();
    assert!(desk.read_text("x").starts_with("time_s,"));
}

#[test]
fn folders_are_not_made_by_a_slip() {
    let desk = desk_with_shipped_files();
    desk.run(&["plan", STAND, "-o", "plnas/stand.json"])
        .fails(1, &["cannot write plnas/stand.json: there is no folder plnas", "mkdir -p plnas"]);
    desk.run(&["demo", "--out", "plnas/demo"]).fails(1, &["there is no folder plnas"]);
    assert!(!desk.path("plnas").exists());
}

#[cfg(unix)]
#[test]
fn devices_links_and_permissions_stay() {
    use std::os::unix::fs::{FileTypeExt, PermissionsExt, symlink};
    let desk = desk_with_shipped_files();
    desk.run(&["plan", STAND, "-o", "/dev/null"]).succeeds();
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());

    desk.write("old.json", "");
    fs::set_permissions(desk.path("old.json"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink("old.json", desk.path("link.json")).unwrap();
    desk.run(&["plan", STAND, "-o", "link.json"]).succeeds();
    assert!(desk.path("link.json").is_symlink());
    assert!(desk.read_text("old.json").starts_with('{'));
    let mode = |name: &str| fs::metadata(desk.path(name)).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode("old.json"), 0o640);
    let program = env!("CARGO_BIN_EXE_rollwalk-under-test");
    let line = format!("umask 077; {program} plan {STAND} -o new.json");
    let mut shell = Command::new("sh");
    program::run(shell.args(["-c", &line]).current_dir(desk.path(".")), PLANNED).succeeds();
    assert_eq!(mode("new.json"), 0o600);
}

/// Runs a command that must fail soon and with a short message: in milliseconds alone, within a minute on a busy computer.
#[track_caller]
fn fails_soon(desk: &Desk, args: &[&str], words: &[&str]) {
    let outcome = program::run(&mut desk.command(args), LONG);
    assert!(outcome.stderr.len() < 8000, "{args:?} says {} bytes", outcome.stderr.len());
    outcome.fails(1, words);
}

fn robot_with_links(count: usize) -> String {
    let mut text = "name = \"long\"\n".to_owned();
    for link in 0..count {
        let _ = writeln!(text, "[[link]]\nname=\"l{link}\"");
    }
    text
}

#[test]
fn inputs_have_bounds() {
    let desk = desk_with_shipped_files();
    desk.write("links.toml", robot_with_links(30_000));
    fails_soon(
        &desk,
        &["robot", "check", "links.toml"],
        &["links.toml", "`link` has 30000 entries", "at most 128"],
    );
    let limbs = desk.read_text("robots/agilebot.toml") + &"[[limb]]\n".repeat(20_000);
    desk.write("limbs.toml", limbs);
    fails_soon(
        &desk,
        &["robot", "check", "limbs.toml"],
        &["`limb` has 20004 entries", "at most 128"],
    );
    desk.write("wrong.toml", "x = 1\n".replace('x', "xx") + &wrong_keys(60_000));
    fails_soon(&desk, &["robot", "check", "wrong.toml"], &["unknown key"]);
    desk.write("long.toml", format!("name = \"{}\"\n", "x".repeat(1_000_000)));
    fails_soon(
        &desk,
        &["robot", "check", "long.toml"],
        &["long.toml:1", "`name` has 1000000 bytes"],
    );
    desk.write("large.toml", "#".repeat(20_000_000));
    for (args, kind, most) in [
        (&["robot", "check", "large.toml"][..], "robot file (TOML)", "1048576"),
        (&["plan", "large.toml", "-o", "x"], "motion file (TOML)", "1048576"),
        (&["library", "build", "large.toml", "-o", "x"], "library file (TOML)", "1048576"),
        (&["robot", "import", "large.toml"], "URDF or MJCF file (XML)", "16777216"),
    ] {
        let words = format!("large.toml has 20000000 bytes; a {kind} has at most {most}");
        fails_soon(&desk, args, &[&words]);
    }
    let motions = "[[motion]]\nname = \"a\"\nfile = \"a\"\ncode = 1\n".repeat(20_000);
    desk.edit("motions/agilebot_library.toml", "[via_safe]", &format!("{motions}[via_safe]"));
    fails_soon(
        &desk,
        &["library", "build", "motions/agilebot_library.toml", "-o", "x"],
        &["`motion` has 20004 entries", "at most 32"],
    );
    let targets = "[[target]]\nof = \"com\"\nat_s = 0.5\nup_m = 0.3\n".repeat(20_000);
    desk.write(STAND, desk.read_text(STAND) + &targets);
    fails_soon(&desk, &["plan", STAND, "-o", "x"], &["`target` has 20000 entries", "at most 100"]);
}

fn wrong_keys(count: usize) -> String {
    (0..count).fold(String::new(), |mut text, key| {
        let _ = writeln!(text, "k{key} = 1");
        text
    })
}

#[cfg(unix)]
#[test]
fn what_has_no_end_is_no_input() {
    let desk = desk_with_shipped_files();
    fails_soon(&desk, &["robot", "check", "/dev/zero"], &["/dev/zero has more than 1048576 bytes"]);
    fails_soon(
        &desk,
        &["library", "inspect", "/dev/zero"],
        &["/dev/zero has more than 33554432 bytes"],
    );
    let folder = ["cannot read robots: it is a folder", "robots/agilebot.toml", "robot check"];
    fails_soon(&desk, &["report", "robots"], &folder);
    fails_soon(&desk, &["robot", "check", "robots"], &["give one of its files: robots/"]);
    // The input is checked before the options that depend on it.
    let missing = ["there is no motion file (TOML) at walk", "did you mean `motions/walk.toml`?"];
    fails_soon(&desk, &["plan", "walk"], &missing);
    fails_soon(&desk, &["export", "walk.json", "-o", "walk.x"], &["no plan (JSON) at walk.json"]);
    let made = Command::new("mkfifo").arg(desk.path("pipe")).status().unwrap();
    assert!(made.success());
    for (robot, words) in [
        ("/dev/zero", "it is a device"),
        ("../pipe", "it is a pipe"),
        ("../robots", "it is a folder, not a file with a robot file (TOML)"),
        ("stand.toml", "names `stand.toml`, which is a motion file, not a robot file"),
    ] {
        desk.copy_folder(&checkout().join("shipped/motions"), "motions");
        desk.edit(STAND, "../robots/agilebot.toml", robot);
        fails_soon(&desk, &["plan", STAND, "-o", "x"], &[words]);
    }
    // A shell's `<(program)` is also a pipe.
    desk.copy_folder(&checkout().join("shipped/motions"), "motions");
    let program = env!("CARGO_BIN_EXE_rollwalk-under-test");
    let line = format!("cat robots/agilebot.toml | {program} robot check /dev/stdin");
    let mut shell = Command::new("sh");
    program::run(shell.args(["-c", &line]).current_dir(desk.path(".")), PLAYED).succeeds();
}

#[test]
fn what_others_wrote_does_not_command_the_terminal() {
    let desk = desk_with_shipped_files();
    let escape = "\\u001b]0;owned\\u0007\\u009b2J";
    // In TOML escapes are written out; in a URDF only C1 controls are allowed.
    let raw = "\u{9b}2J\u{202e}";
    desk.edit(STAND, "name = \"stand\"", &format!("name = \"{escape}\""));
    desk.write(
        "x.urdf",
        format!("<robot name=\"{raw}\"><link name=\"{raw}\"/><joint name=\"{raw}\"/></robot>"),
    );
    desk.write("x.toml", format!("# {raw}\nname = 1 # {raw}\n{raw}"));
    desk.write("key.toml", format!("\"{escape}\" = 1"));
    desk.run(&["plan", "motions/drive_1m.toml", "-o", "plan.json", "--dump", "problem.json"])
        .succeeds();
    desk.edit("plan.json", "\"name\": \"drive_1m\"", &format!("\"name\": \"{escape}\""));
    desk.edit("problem.json", "\"program\": \"", &format!("\"program\": \"{escape}"));
    for args in [
        &["plan", STAND, "-o", "x"][..],
        &["robot", "import", "x.urdf"],
        &["robot", "check", "x.toml"],
        &["robot", "check", "key.toml"],
        &["report", "plan.json"],
        &["plan", "problem.json", "-o", "again.json"],
    ] {
        let outcome = desk.run(args);
        let printed = outcome.stdout + &outcome.stderr;
        let obeyed = |c: char| c.is_control() && c != '\n' || c == '\u{202e}';
        assert!(!printed.contains(obeyed), "{args:?}: {printed:?}");
        assert!(!printed.is_empty());
    }
    desk.run(&["plan", STAND, "-o", "x"])
        .fails(1, &["`name` is \"\\u001b]0;owned", "visible characters only"]);
    desk.run(&["report", "plan.json"]).fails(1, &["motion.name is \"\\u001b]0;owned"]);
}

#[test]
fn two_outputs_are_two_files() {
    let desk = desk();
    let args = ["monitor", "--bus", "sim:none.sock", "--log", "a", "--mcap", "./a"];
    let outcome = desk.run(&args);
    assert_ne!(outcome.code, 0);
    assert!(!desk.path("a").exists());
}

#[test]
fn results_go_to_standard_output_by_themselves() {
    let desk = desk_with_shipped_files();
    for name in ["-", "/dev/stdout"] {
        let outcome = desk.run(&["plan", "motions/stand.toml", "-o", name]);
        let plan: serde_json::Value = serde_json::from_str(&outcome.stdout).expect("a plan alone");
        assert_eq!(plan["motion"]["name"], "stand");
        assert!(outcome.stderr.contains("stand on agilebot: converged"), "{}", outcome.stderr);
        assert_eq!(outcome.code, 0);
    }
    assert!(!desk.path("-").exists());
}

#[test]
fn files_that_people_write_are_no_results_and_no_libraries() {
    let desk = desk_with_shipped_files();
    desk.write("notes.toml", "mine");
    let taken = ["notes.toml: it exists, and this command writes files with another extension"];
    desk.run(&["plan", "motions/stand.toml", "-o", "notes.toml"]).fails(1, &taken);
    assert_eq!(desk.read_text("notes.toml"), "mine");
    let library = "motions/agilebot_library.toml";
    let words = ["is a library file, not a motion library", "rollwalk library build"];
    desk.run(&["library", "inspect", library]).fails(1, &words);
    desk.run(&["flash", library, "--bus", "sim:none.sock"]).fails(1, &words);
}
