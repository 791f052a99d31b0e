//! Tests of a simulated robot that plays only libraries with its owner's signature.

use crate::simulated::{Robot, desk_with_library_file, in_time, on};
use std::fs;

#[test]
fn a_robot_with_a_library_key_plays_only_what_its_owner_signed() {
    let desk = desk_with_library_file();
    let bus = format!("sim:{}", desk.path("robot.sock").display());
    for pair in ["owner.pem", "other.pem"] {
        let made = on(&desk, &bus, &["keys", "new-pair", pair]).succeeds();
        assert!(made.contains("BEGIN PUBLIC KEY"), "{made}");
        on(&desk, &bus, &["keys", "new-pair", pair]).fails(1, &["cannot write", "exists"]);
    }
    let build = ["library", "build", "legbot.toml", "-o", "own.rwl", "--sign", "owner.pem"];
    on(&desk, &bus, &build).succeeds();
    let sign = |from, key, to| on(&desk, &bus, &["library", "sign", from, "--key", key, "-o", to]);
    sign("own.rwl", "other.pem", "others.rwl").succeeds();
    // Signing replaces a signature, and equal libraries have equal signatures.
    sign("others.rwl", "owner.pem", "again.rwl").succeeds();
    let read = |name: &str| fs::read(desk.path(name)).unwrap();
    assert_eq!(read("again.rwl"), read("own.rwl"));
    let signed = read("own.rwl");
    desk.write("plain.rwl", &signed[..signed.len() - 80]);
    let mut changed = read("own.rwl");
    *changed.last_mut().unwrap() ^= 1;
    desk.write("changed.rwl", changed);
    sign("own.rwl", "owner.pub.pem", "x.rwl").fails(1, &["private", "this file is a public key"]);
    sign("own.rwl", "owner.pem", "own.rwl").fails(1, &["cannot write"]);

    let verify = |file| on(&desk, &bus, &["library", "verify", file, "--key", "owner.pub.pem"]);
    verify("own.rwl").succeeds();
    verify("plain.rwl").fails(1, &["plain.rwl is not signed", "rollwalk library sign"]);
    verify("others.rwl").fails(1, &["others.rwl is signed with key", "not with"]);
    verify("changed.rwl")
        .fails(1, &["changed.rwl was changed after it was signed", "get the library again"]);
    // No advice to sign a file that is no library.
    verify("legbot.toml").fails(1, &["legbot.toml is a library file", "rollwalk library build"]);
    verify("owner.pub.pem").fails(1, &["owner.pub.pem is not a motion library"]);
    let shown = on(&desk, &bus, &["library", "inspect", "own.rwl"]).succeeds();
    assert!(shown.contains("signed with key"), "{shown}");
    let shown = on(&desk, &bus, &["library", "inspect", "plain.rwl"]).succeeds();
    assert!(shown.contains("not signed"), "{shown}");

    let insists = ["--library-key", "owner.pub.pem", "--library", "memory.rwl"];
    let mut robot = Robot::with(&desk, &bus, &insists);
    let flash = |file| on(&desk, &bus, &["flash", file]);
    let remedy = ["not signed with the key of this controller", "rollwalk library sign"];
    let not_signed = [&remedy[..], &["plain.rwl is not signed"]].concat();
    flash("plain.rwl").fails(5, &not_signed);
    flash("others.rwl").fails(5, &[&remedy[..], &["others.rwl is signed with key"]].concat());
    flash("changed.rwl").fails(5, &remedy);
    flash("own.rwl").succeeds();
    // The library remains after another one is refused, before the first play and after.
    flash("plain.rwl").fails(5, &not_signed);
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
    flash("plain.rwl").fails(5, &not_signed);
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();

    // The library remains after a restart, and a robot with another key does not load it.
    robot.stop();
    assert_eq!(read("memory.rwl"), signed);
    let mut robot = Robot::with(&desk, &bus, &insists);
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
    robot.stop();
    let other = ["robots/legbot.toml", "--bus", &bus, "--library", "memory.rwl"];
    let started =
        Robot::refuses(&desk, &[&other[..], &["--library-key", "other.pub.pem"]].concat());
    started.fails(1, &["memory.rwl is signed with key", "not with"]);

    // A robot without a key also loads it, and does not change the file.
    let mut robot = Robot::with(&desk, &bus, &["--library", "memory.rwl"]);
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
    robot.stop();
    assert_eq!(read("memory.rwl"), signed);

    // The robot accepts a library that is sent.
    let _robot = Robot::start(&desk, &bus);
    let flashed = flash("own.rwl");
    assert!(flashed.stderr.contains("does not check signatures"), "{}", flashed.stderr);
    flashed.succeeds();
    in_time(&desk, &bus, &["send", "--arm", "rest"]).succeeds();
}
