//! Tests of a simulated robot that accepts only hosts with its link key.

use crate::simulated::{Robot, command_on, desk_with_library_file, on, once_more_when_late};
use rollwalk_tests::program::{self, PLAYED};
use std::fs;

#[test]
fn a_robot_with_a_link_key_obeys_those_who_have_it() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    desk.make(&["library", "build", "legbot.toml", "-o", "legbot.rwl"]);
    for key in ["robot.key", "other.key"] {
        on(&desk, &bus, &["keys", "new", key]).succeeds();
        on(&desk, &bus, &["keys", "new", key]).fails(1, &["cannot write", key, "exists"]);
    }
    let mut robot = Robot::with(&desk, &bus, &["--link-key", "robot.key"]);

    let without = ["authentication required", "--link-key FILE", "ROLLWALK_LINK_KEY"];
    on(&desk, &bus, &["flash", "legbot.rwl"]).fails(5, &without);
    on(&desk, &bus, &["gains", "reset"]).fails(5, &without);
    on(&desk, &bus, &["disarm"]).fails(5, &without);
    let wrong = ["has another link key"];
    on(&desk, &bus, &["disarm", "--link-key", "other.key"]).fails(5, &wrong);
    let none = ["legbot.toml is not a link key"];
    on(&desk, &bus, &["disarm", "--link-key", "legbot.toml"]).fails(1, &none);

    let with_key = |args: &[&str]| {
        let mut command = command_on(&desk, &bus, args);
        command.env("ROLLWALK_LINK_KEY", "robot.key");
        program::run(&mut command, PLAYED)
    };
    with_key(&["flash", "legbot.rwl"]).succeeds();
    let send = || with_key(&["send", "--arm", "rest"]);
    once_more_when_late(send, || with_key(&["clear"])).succeeds();
    with_key(&["gains", "set", "all", "--kd", "1"]).succeeds();
    // With the key the doctor reads gains, and without it leaves no entry about refused messages.
    let gains = ["gains or limits differ from the robot file", "kd 1 instead of"];
    let unread = "the controller shows them only to hosts with its link key";
    let refusals = || {
        let examined = with_key(&["doctor"]).succeeds();
        assert!(gains.iter().all(|words| examined.contains(words)), "{examined}");
        examined.matches("unauthenticated messages").count()
    };
    let before = refusals();
    on(&desk, &bus, &["doctor"]).succeeds_with(0, &[unread]);
    assert_eq!(refusals(), before);
    // Commands without need of a key accept one.
    for command in ["discover", "doctor", "estop"] {
        with_key(&[command]).succeeds();
    }
    on(&desk, &bus, &["estop"]).succeeds();
    with_key(&["clear"]).succeeds();
    // The verdict depends on the key.
    let arm = ["rollwalk send --arm MOTION --link-key FILE"];
    on(&desk, &bus, &["doctor"]).succeeds_with(0, &arm);
    let refused = on(&desk, &bus, &["doctor", "--link-key", "other.key"]);
    assert!(!refused.stdout.contains("arm the robot"), "{}", refused.stdout);
    refused.succeeds_with(5, &["another link key", "it cannot be armed"]);

    // Session numbers begin with the count of boots, which outlives the process, so a recorded session is not valid in the next
    // process.
    let boots = || {
        let mut files = fs::read_dir(desk.path("state/rollwalk/boots")).expect("a folder");
        let file = files.next().expect("a count of boots").expect("an entry");
        assert!(files.next().is_none(), "one key, one count");
        fs::read_to_string(file.path()).expect("a text")
    };
    assert_eq!(boots(), "0000000001\n");
    robot.stop();
    let _robot = Robot::with(&desk, &bus, &["--link-key", "robot.key"]);
    assert_eq!(boots(), "0000000002\n");
    with_key(&["gains", "reset"]).succeeds();
    desk.write("state/rollwalk/boots/damaged", "");
    for entry in fs::read_dir(desk.path("state/rollwalk/boots")).expect("a folder") {
        fs::write(entry.expect("an entry").path(), "4294967295\n").expect("a text");
    }
    let elsewhere = format!("sim:{}", desk.path("other.sock").display());
    let args = ["robots/legbot.toml", "--bus", &elsewhere, "--link-key", "robot.key"];
    Robot::refuses(&desk, &args).fails(1, &["does not contain a boot count below 4294967295"]);
}
