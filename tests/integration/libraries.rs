//! Tests of the shipped library files: all motions and transitions converge, the library can be read back, and the simulated
//! robot plays it within the limits of the demo.

use crate::desk_with_shipped_files;
use rollwalk_tests::Desk;
use serde_json::Value;

/// Builds each shipped library, and calls `look` with its file and the output of the build.
fn each_built(options: &[&str], mut look: impl FnMut(&Desk, &str, Value)) {
    let desk = desk_with_shipped_files();
    let folder = std::fs::read_dir(desk.path("motions")).unwrap();
    let mut files: Vec<String> = folder
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with("_library.toml"))
        .collect();
    files.sort();
    assert!(files.len() >= 5, "{files:?}");
    for file in files {
        let file = format!("motions/{file}");
        let build = ["library", "build", &file, "-o", "a.rwl", "--json"];
        let built = desk.run(&[&build[..], options].concat()).succeeds();
        look(&desk, &file, serde_json::from_str(&built).unwrap());
    }
}

#[test]
fn every_shipped_library_builds_and_opens() {
    each_built(&["--no-simulation"], |desk, file, _| {
        let told = desk.run(&["library", "inspect", "a.rwl", "--json"]).succeeds();
        let told: Value = serde_json::from_str(&told).unwrap();
        let motions = desk.read_text(file).matches("[[motion]]").count();
        assert_eq!(told["motions"].as_array().unwrap().len(), motions, "{file}");
    });
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn every_shipped_library_holds_in_simulation() {
    let mut simulated = 0;
    each_built(&[], |_, _, built| simulated += usize::from(!built["simulation"].is_null()));
    assert!(simulated >= 4, "{simulated}");
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
fn libraries_of_other_robots_play_within_the_bounds() {
    let desk = desk_with_shipped_files();
    for (robot, on) in [
        ("swizzlebot", "ground"),
        ("skaterbot", "ground"),
        ("anymal", "ground"),
        ("pup", "ground"),
        ("agilebot", "stand"),
        ("test_leg", "stand"),
    ] {
        let library = format!("motions/{robot}_library.toml");
        let args = ["demo", "--library", &library, "--out", robot, "--on", on, "--json"];
        let told = desk.run(&args).succeeds();
        let told: Value = serde_json::from_str(&told).unwrap();
        assert_eq!(told["world"].is_null(), on == "stand", "{robot}");
    }
    // One leg cannot stand alone.
    desk.run(&["demo", "--library", "motions/test_leg_library.toml", "--out", "leg"])
        .fails(1, &["test_leg cannot stand on the ground", "--on stand"]);
}
