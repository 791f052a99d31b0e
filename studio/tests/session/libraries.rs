//! Tests of libraries: building, comparison with a plan, and edits of the graph.

use crate::*;

#[test]
fn a_library_is_built_with_its_graph_and_can_be_stopped() {
    const LIBRARY: &str = "motions/test_leg_library.toml";
    let mut page = Page::default();
    let build = json!({ "kind": "library", "files": [], "library": LIBRARY });
    let built = page.ask(build.clone());
    let names: Vec<_> =
        built.json["nodes"].as_array().unwrap().iter().map(|node| node["name"].clone()).collect();
    assert_eq!(names, ["stand", "roll"]);
    assert_eq!(built.json["edges"].as_array().unwrap().len(), 2);
    assert_eq!(built.json["failures"], json!([]));
    assert_eq!(&built.bytes[..4], b"ROLL");
    let mut request = build;
    request["seq"] = json!(1);
    let mut last = Value::Null;
    page.session.request(&request.to_string(), &[], &mut |json, _| {
        last = serde_json::from_str(json).unwrap();
        ControlFlow::Break(())
    });
    assert_eq!((&last["kind"], &last["message"]), (&json!("error"), &json!("stopped")));
}

/// Compares the shown plan of a test leg's motion with a library.
fn compare(page: &mut Page, motion: &str, library: &[u8]) -> (Value, String) {
    let named = "motions/test_leg_library.toml";
    let request = json!({ "kind": "compare", "files": [], "motion": motion, "library": named });
    let compared = page.ask_with(request, library).json;
    assert_eq!(compared["kind"], "done", "{compared}");
    (compared["clip"].clone(), compared["why"].as_str().unwrap().to_owned())
}

#[test]
fn a_plan_is_the_motion_of_a_library_by_name_and_by_its_frames() {
    const ROLL: &str = "motions/test_leg_roll.toml";
    let mut page = Page::default();
    let build =
        json!({ "kind": "library", "files": [], "library": "motions/test_leg_library.toml" });
    let library = page.ask(build).bytes;
    let roll = page.text(ROLL);
    let plan = |page: &mut Page, text: String, from: &str| {
        let files = json!([{ "path": ROLL, "text": text }]);
        page.done(json!({
            "kind": "plan", "files": files, "motion": ROLL, "from": from, "iterations": null, "frames_hz": 60.0,
        }));
    };
    plan(&mut page, roll.clone(), "scratch");
    // The library calls the motion `roll`, its second motion.
    assert_eq!(compare(&mut page, ROLL, &library), (json!(1), String::new()));
    // Compared as `stand`, whose frames differ.
    let (clip, why) = compare(&mut page, "motions/test_leg_stand.toml", &library);
    assert!(clip.is_null() && why.contains("`stand`") && why.contains("duration"), "{why}");
    let (clip, why) = compare(&mut page, ROLL, &library[1..]);
    assert!(clip.is_null() && why.contains("different robots"), "{why}");

    // After an edit, the motion has the same name but other frames. After an undo, it is the same again.
    let edited = roll.replace("forward_m = 0.2", "forward_m = 0.19");
    plan(&mut page, edited, "good");
    let (clip, why) = compare(&mut page, ROLL, &library);
    assert!(clip.is_null() && why.contains("rad/s from the plan"), "{why}");
    plan(&mut page, roll, "good");
    assert_eq!(compare(&mut page, ROLL, &library), (json!(1), String::new()));
}

#[test]
fn a_library_begins_with_the_motions_of_the_project_and_is_edited_as_a_graph() {
    let mut page = Page::default();
    let (walk, drive) = (page.walk(), page.text("motions/drive_1m.toml"));
    let mut files = vec![
        json!({ "path": "walk.toml", "text": walk }),
        json!({ "path": "drive.toml", "text": drive }),
    ];
    let begun = page.done(json!({ "kind": "new_library", "files": files, "motion": "walk.toml" }));
    // No motion of the project stands, so a stand is added.
    let added = begun["files"].as_array().unwrap();
    let paths = |begun: &Value| -> Vec<String> {
        let files = begun["files"].as_array().unwrap();
        files.iter().map(|file| file["path"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(paths(&begun), ["agilebot_library.toml", "stand.toml"]);
    // A file of another robot at that path is kept.
    let others = json!({ "path": "stand.toml", "text": page.text("motions/pup_stand.toml") });
    let files_of_two = [&files[..], &[others]].concat();
    let beside = json!({ "kind": "new_library", "files": files_of_two, "motion": "walk.toml" });
    assert_eq!(paths(&page.done(beside)), ["agilebot_library.toml", "stand_2.toml"]);
    files.extend(added.iter().cloned());
    let library = "agilebot_library.toml";
    let graph = |page: &mut Page, files: &[Value]| {
        page.done(json!({ "kind": "graph", "files": files, "library": library }))
    };
    let amend = |page: &mut Page, files: &mut Vec<Value>, edit: Value| {
        let amended = page.done(json!({
            "kind": "amend", "files": files, "motion": "walk.toml", "path": library, "edit": edit,
        }));
        let file = files.iter_mut().find(|file| file["path"] == library).unwrap();
        file["text"] = amended["text"].clone();
    };
    let first = graph(&mut page, &files);
    assert_eq!(first["faults"], json!([]), "{}", files[2]["text"]);
    assert_eq!((&first["safe"], &first["via_safe_s"]), (&json!("stand"), &json!(1.2)));
    let names = |graph: &Value| -> Vec<String> {
        let motions = graph["motions"].as_array().unwrap();
        motions.iter().map(|motion| motion["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&first), ["stand", "walk", "drive_1m"]);
    assert_eq!(first["motions"][1]["periodic"], true);

    amend(
        &mut page,
        &mut files,
        json!({ "edit": "transition", "from": "walk", "to": "drive_1m", "duration_s": 0.9 }),
    );
    let joined = graph(&mut page, &files);
    let expected = json!([{ "from": "walk", "to": "drive_1m", "duration_s": 0.9 }]);
    assert_eq!((&joined["transitions"], &joined["faults"]), (&expected, &json!([])));

    amend(&mut page, &mut files, json!({ "edit": "remove_motion", "name": "drive_1m" }));
    let fewer = graph(&mut page, &files);
    assert_eq!(
        (names(&fewer), &fewer["transitions"]),
        (vec!["stand".into(), "walk".into()], &json!([]))
    );
    assert_eq!(fewer["others"], json!([{ "name": "drive_1m", "file": "drive.toml" }]));

    amend(
        &mut page,
        &mut files,
        json!({ "edit": "add_motion", "name": "drive_1m", "file": "drive.toml" }),
    );
    let again = graph(&mut page, &files);
    assert_eq!((&again["motions"][2]["code"], &again["faults"]), (&json!(3), &json!([])));

    // A graph with a fault is still a graph.
    amend(
        &mut page,
        &mut files,
        json!({ "edit": "text", "table": [], "key": "safe", "value": "walk" }),
    );
    let wrong = graph(&mut page, &files);
    assert!(
        wrong["faults"][0]["message"].as_str().unwrap().contains("does not stand still"),
        "{wrong}"
    );
    assert_eq!(names(&wrong).len(), 3);
}
