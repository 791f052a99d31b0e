//! Tests of imported and exported files.

use crate::*;

#[test]
fn a_solution_goes_on_in_another_session() {
    let mut page = Page::default();
    let text = page.walk();
    assert_eq!(page.ask(json!({ "kind": "solution" })).json["kind"], "error");
    assert_eq!(page.ask(json!({ "kind": "report" })).json["kind"], "error");
    page.plan(&text, "scratch", None);
    let kept = page.ask(json!({ "kind": "solution" }));
    let again = page.plan(&text, "good", Some(1));
    let mut other = Page::default();
    assert_eq!(other.ask_with(json!({ "kind": "resume" }), &kept.bytes).json["kind"], "done");
    let resumed = other.plan(&text, "good", Some(1));
    assert_eq!(resumed.json["solve"], again.json["solve"]);
    assert_eq!(resumed.bytes, again.bytes);
    assert_eq!(resumed.json["solve"]["iterations"], 1);
    let mut cut = kept.bytes.clone();
    cut.truncate(kept.bytes.len() / 2);
    assert_eq!(other.ask_with(json!({ "kind": "resume" }), &cut).json["kind"], "error");
    let odd =
        String::from_utf8(kept.bytes).unwrap().replacen("\"shifts\":[", "\"shifts\":[0.5,", 1);
    let answer = other.ask_with(json!({ "kind": "resume" }), odd.as_bytes()).json;
    assert!(
        answer["message"].as_str().unwrap().contains("multipliers is incomplete or not finite"),
        "{answer}"
    );
}

#[test]
fn the_shown_plan_is_reported_and_exported() {
    let mut page = Page::default();
    let text = page.walk();
    page.plan(&text, "scratch", None);
    let report = page.done(json!({ "kind": "report" }));
    assert_eq!((&report["consistent"], &report["judgement"]), (&json!(true), &json!("consistent")));
    let slip = report["rows"].as_array().unwrap().iter().find(|row| row["name"] == "slip").unwrap();
    assert_eq!((&slip["unit"], &slip["grid"]), (&json!("mm/s"), &json!("samples")));
    let plan = page.done(json!({ "kind": "plan_json" }));
    let plan = rollwalk_planner::plan::Plan::from_json("plan", plan["text"].as_str().unwrap());
    assert_eq!(plan.unwrap().motion.name, "walk");
    let table = page.done(json!({ "kind": "export", "what": "csv", "rate_hz": 60.0 }));
    assert_eq!(table["text"].as_str().unwrap().lines().count(), 1 + 96);
    let odd = page.ask(json!({ "kind": "export", "what": "csv", "rate_hz": -1.0 })).json;
    assert!(odd["message"].as_str().unwrap().contains("-1 Hz"), "{odd}");
}

/// Reads a file of the import tests.
fn urdf_test(name: &str) -> String {
    let path = format!("{}/../robot/tests/urdf/{name}", env!("CARGO_MANIFEST_DIR"));
    std::fs::read_to_string(&path).unwrap_or_else(|error| panic!("{path}: {error}"))
}

#[test]
fn a_urdf_becomes_a_project_whose_motion_can_be_planned() {
    let mut page = Page::default();
    let urdf = json!({ "path": "rover.urdf", "text": urdf_test("rover.urdf") });
    let side = json!({ "path": "rover.side.toml", "text": urdf_test("rover.side.toml") });
    for side in [Value::Null, side] {
        let imported = page.done(json!({ "kind": "import", "urdf": urdf, "side": side }));
        // Without a side file, the import at least warns that its proposals must be checked.
        assert_eq!(imported["warnings"].as_array().unwrap().is_empty(), !side.is_null());
        let paths: Vec<_> =
            imported["files"].as_array().unwrap().iter().map(|f| &f["path"]).collect();
        assert!(paths.iter().any(|path| *path == "rover.toml"), "{paths:?}");
        let planned = page.done(json!({
            "kind": "plan", "files": imported["files"], "motion": imported["motion"], "from": "scratch",
            "iterations": null, "frames_hz": 60.0,
        }));
        assert_eq!(planned["converged"], true, "{}", planned["solve"]);
        assert_eq!(planned["read"][1], "rover.toml");
    }
}

#[test]
fn faults_of_an_import_are_in_the_file_that_has_them() {
    let mut page = Page::default();
    let bad = json!({ "path": "bad.urdf", "text": "<robot name=\"r\">\n<link/>\n</robot>" });
    let answer = page.ask(json!({ "kind": "import", "urdf": bad, "side": null })).json;
    assert_eq!(answer["kind"], "faults");
    assert_eq!(
        (&answer["faults"][0]["path"], &answer["faults"][0]["line"]),
        (&json!("bad.urdf"), &json!(2))
    );
    let urdf = json!({ "path": "rover.urdf", "text": urdf_test("rover.urdf") });
    let side = json!({ "path": "rover.side.toml", "text": "forward = \"up\"\n" });
    let answer = page.ask(json!({ "kind": "import", "urdf": urdf, "side": side })).json;
    assert_eq!(answer["faults"][0]["path"], "rover.side.toml", "{answer}");
}

#[test]
fn a_plan_is_saved_as_a_picture_that_moves() {
    let mut page = Page::default();
    let text = page.walk();
    assert_eq!(page.ask(json!({ "kind": "animation" })).json["kind"], "error");
    page.plan(&text, "scratch", None);
    let picture = page.done(json!({ "kind": "animation" }));
    let svg = picture["text"].as_str().unwrap();
    assert!(
        svg.starts_with("<svg") && svg.contains("animation-delay") && svg.contains("footfalls")
    );
}

#[test]
fn a_plan_file_is_a_start_for_its_motion_and_no_other_robots() {
    let mut page = Page::default();
    let text = page.walk();
    page.plan(&text, "scratch", None);
    let plan = page.done(json!({ "kind": "plan_json" }))["text"].as_str().unwrap().to_owned();
    let mut other = Page::default();
    let request = |motion: &str, text: &str| {
        json!({
            "kind": "plan", "files": [{ "path": motion, "text": text }], "motion": motion, "from": "plan",
            "iterations": null, "frames_hz": 60.0,
        })
    };
    let again = other.ask_with(request(WALK, &text), plan.as_bytes());
    assert_eq!((&again.json["converged"], &again.json["good"]), (&json!(true), &json!(true)));
    let first = page.plan(&text, "scratch", None).json["solve"]["iterations"].as_u64().unwrap();
    assert!(again.json["solve"]["iterations"].as_u64().unwrap() < first, "{}", again.json["solve"]);
    let anymal = "motions/anymal_drive.toml";
    let drive = other.text(anymal);
    let refused = other.ask_with(request(anymal, &drive), plan.as_bytes()).json;
    assert!(refused["message"].as_str().unwrap().contains("agilebot"), "{refused}");
    let broken = other.ask_with(request(WALK, &text), b"{}").json;
    assert_eq!(broken["kind"], "error", "{broken}");
}
