//! The engine as a page talks to it: requests as JSON, answers as JSON and bytes.

use rollwalk_studio::Session;
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// A session whose answers are kept.
#[derive(Default)]
struct Page {
    session: Session,
    seq: u64,
}

/// The last answer to a request, its bytes, and how many came before it.
struct Answer {
    json: Value,
    bytes: Vec<u8>,
    progress: usize,
}

impl Page {
    fn ask(&mut self, request: Value) -> Answer {
        self.ask_with(request, &[])
    }

    fn ask_with(&mut self, mut request: Value, binary: &[u8]) -> Answer {
        self.seq += 1;
        request["seq"] = json!(self.seq);
        let mut answers: Vec<(Value, Vec<u8>)> = Vec::new();
        self.session.request(&request.to_string(), binary, &mut |json, bytes| {
            answers.push((serde_json::from_str(json).unwrap(), bytes.to_vec()));
            ControlFlow::Continue(())
        });
        let (json, bytes) = answers.pop().expect("every request is answered");
        assert!(answers.iter().all(|(json, _)| json["kind"] == "progress"), "{answers:?}");
        assert_eq!(json["seq"], self.seq);
        assert_eq!(json["binary"], !bytes.is_empty());
        Answer { json, bytes, progress: answers.len() }
    }

    fn done(&mut self, request: Value) -> Value {
        let answer = self.ask(request).json;
        assert_eq!(answer["kind"], "done", "{answer}");
        answer
    }

    fn text(&mut self, path: &str) -> String {
        let example = self.done(json!({ "kind": "example", "path": path }));
        example["text"].as_str().unwrap().to_owned()
    }

    fn walk(&mut self) -> String {
        self.text(WALK)
    }

    fn plan(&mut self, text: &str, from: &str, iterations: Option<usize>) -> Answer {
        self.ask(json!({
            "kind": "plan", "files": walk(text), "motion": WALK, "from": from, "iterations": iterations, "frames_hz": 60.0,
        }))
    }

    fn amend(&mut self, text: &str, edit: Value) -> Value {
        self.ask(json!({ "kind": "amend", "files": walk(text), "motion": WALK, "path": WALK, "edit": edit })).json
    }

    /// The text after an edit that brings no faults.
    fn amended(&mut self, text: &str, edit: Value) -> String {
        let answer = self.amend(text, edit);
        assert_eq!(answer["kind"], "done", "{answer}");
        assert_eq!(answer["faults"], json!([]));
        answer["text"].as_str().unwrap().to_owned()
    }
}

const WALK: &str = "motions/walk.toml";

fn walk(text: &str) -> Value {
    json!([{ "path": WALK, "text": text }])
}

/// Lines of a text that are not in another one.
fn new_lines<'t>(text: &'t str, before: &str) -> Vec<&'t str> {
    text.lines().filter(|line| !before.lines().any(|other| other == *line)).collect()
}

#[test]
fn every_shipped_motion_opens_with_what_its_robot_looks_like() {
    let mut page = Page::default();
    let examples = page.done(json!({ "kind": "examples" }))["examples"].clone();
    let motions = examples.as_array().unwrap().iter().filter(|example| example["of"] == "motion");
    let mut count = 0;
    for example in motions {
        let path = example["path"].as_str().unwrap();
        let files = json!([{ "path": path, "text": page.text(path) }]);
        let opened = page.done(json!({ "kind": "open", "files": files, "motion": path }));
        let bodies = opened["scene"]["bodies"].as_array().unwrap();
        assert!(bodies.iter().all(|body| body["shapes"][0].is_object()), "{path}: {bodies:?}");
        let standing = opened["scene"]["standing"].as_array().unwrap();
        assert_eq!(standing.len(), bodies.len(), "{path}");
        let feet = opened["scene"]["end_effectors"].as_array().unwrap().len();
        assert_eq!(opened["motion"]["stance"].as_array().unwrap().len(), feet, "{path}");
        assert_eq!(opened["read"][0], path);
        count += 1;
    }
    assert!(count > 45, "{count} motions");
}

#[test]
fn wheels_are_bodies_that_turn_and_as_wide_as_their_part() {
    let mut page = Page::default();
    let files = walk(&page.walk());
    let opened = page.done(json!({ "kind": "open", "files": files, "motion": WALK }));
    let scene = &opened["scene"];
    assert_eq!(scene["bodies"].as_array().unwrap().len(), 17 + 4);
    assert_eq!(scene["end_effectors"][3]["wheel_body"], 20);
    let wheel = &scene["bodies"][20]["shapes"];
    let expected = json!([{
        "shape": "cylinder", "radius_m": 0.05, "length_m": 0.02, "position_m": [0.0, 0.0, 0.0],
        "orientation_wxyz": [1.0, 0.0, 0.0, 0.0], "role": "wheel",
    }]);
    assert_eq!(*wheel, expected);
    let fork = &scene["bodies"][scene["end_effectors"][3]["body"].as_u64().unwrap() as usize];
    let parts = fork["shapes"].as_array().unwrap().iter().filter(|shape| shape["role"] == "part");
    assert_eq!(parts.count(), 2, "its third part is the wheel");
    // A right leg is the mirror image of the left one.
    let motor_y = fork["shapes"][1]["position_m"][1].as_f64().unwrap();
    assert_eq!((&fork["name"], motor_y), (&json!("rear_right_fork"), 0.03));
}

#[test]
fn frames_are_the_motion_as_it_is_played() {
    let mut page = Page::default();
    let text = page.walk();
    let answer = page.plan(&text, "scratch", None);
    assert_eq!(answer.json["solve"]["status"], "converged", "{}", answer.json["solve"]);
    assert_eq!((&answer.json["converged"], &answer.json["good"]), (&json!(true), &json!(true)));
    assert!(answer.progress > 3);
    let frames = &answer.json["frames"];
    let number = |pointer: &str| frames.pointer(pointer).unwrap().as_u64().unwrap() as usize;
    let (count, width) = (number("/count"), number("/width"));
    // A period of 1.6 s ends where the next begins.
    assert_eq!((count, answer.bytes.len()), (96, 4 * 96 * width));
    let numbers: Vec<f32> =
        answer.bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let scene = &answer.json["scene"];
    let mut weight_n = 0.0;
    for row in numbers.chunks_exact(width) {
        for (j, foot) in scene["end_effectors"].as_array().unwrap().iter().enumerate() {
            let wheel = 7 * foot["wheel_body"].as_u64().unwrap() as usize;
            let at = number("/columns/end_effectors") + 7 * j;
            let apart: f32 = (0..3).map(|k| (row[wheel + k] - row[at + 1 + k]).powi(2)).sum();
            // Centre of a wheel and its contact point; float32 at less than 1 m.
            assert!((apart.sqrt() - 0.05).abs() < 1e-6, "{}", apart.sqrt());
            weight_n += row[at + 6] / count as f32;
        }
        let unit: f32 = row[3..7].iter().map(|q| q * q).sum();
        assert!((unit - 1.0).abs() < 1e-6);
    }
    let expected_n = scene["mass_kg"].as_f64().unwrap() as f32 * 9.80665;
    // Over a period the forces carry the weight; sums of a spline at 96 points are not its integral to the last digit.
    assert!((weight_n / expected_n - 1.0).abs() < 0.01, "{weight_n} N of {expected_n} N");
    let moved_m = frames["period"]["offset_m"][0].as_f64().unwrap();
    assert!((moved_m - 0.12).abs() < 1e-3, "the goal, within its tolerance: {moved_m}");
}

#[test]
fn an_edit_plans_again_from_the_plan_at_hand() {
    let mut page = Page::default();
    let text = page.walk();
    let first = page.plan(&text, "scratch", None);
    let text = page.amended(
        &text,
        json!({ "edit": "number", "table": ["goal"], "key": "forward_m", "value": 0.125 }),
    );
    let step = page.plan(&text, "good", Some(2));
    // What is dragged is shown, is no good plan, and cannot be taken for one that holds.
    assert_eq!((&step.json["good"], &step.json["converged"]), (&json!(false), &json!(false)));
    assert!(step.json["solve"]["iterations"].as_u64().unwrap() <= 2);
    assert!(!step.json["solve"]["words"].as_str().unwrap().contains("played"));
    let last = page.plan(&text, "good", None);
    assert_eq!(last.json["good"], true);
    let iterations = |answer: &Answer| answer.json["solve"]["iterations"].as_u64().unwrap();
    assert!(iterations(&last) < iterations(&first));
    let fresh = Page::default().plan(&text, "scratch", None);
    let energy = |answer: &Answer| answer.json["solve"]["energy"].as_f64().unwrap();
    // Both stop when a step gains less than a thousandth.
    assert!((energy(&last) / energy(&fresh) - 1.0).abs() < 5e-3);
}

#[test]
fn a_request_that_cannot_be_met_says_who_is_to_blame_and_its_fix_works() {
    let mut page = Page::default();
    let good = page.walk();
    page.plan(&good, "scratch", None);
    let edit = json!({ "edit": "number", "table": ["goal"], "key": "forward_m", "value": 1.2 });
    let text = page.amended(&good, edit);
    let broken = page.plan(&text, "good", None).json;
    assert_eq!(
        (&broken["solve"]["status"], &broken["good"]),
        (&json!("infeasible"), &json!(false))
    );
    let culprits = broken["solve"]["culprits"].as_array().unwrap();
    let fix = culprits.iter().find_map(|culprit| culprit["fix"].as_object()).expect("a fix");
    assert!(fix["label"].as_str().unwrap().starts_with("Set "), "{fix:?}");
    assert_eq!(fix["path"], WALK);
    let text = page.amended(&text, fix["edit"].clone());
    let mended = page.plan(&text, "good", None).json;
    assert_eq!(mended["converged"], true, "{fix:?}: {}", mended["solve"]);
    // The plan that failed was no start for the next.
    assert_eq!(page.plan(&good, "good", None).json["converged"], true);
}

#[test]
fn faults_point_into_the_text() {
    let mut page = Page::default();
    let text = page.walk().replace("duration_s = 1.6", "duration_s = 1.61 # mm: µm");
    let files = walk(&text);
    let answer = page.ask(json!({ "kind": "open", "files": files, "motion": WALK })).json;
    assert_eq!(answer["kind"], "faults");
    let fault = &answer["faults"][0];
    let span = [0, 1].map(|end| fault["span"][end].as_u64().unwrap() as usize);
    assert_eq!(&text[span[0]..span[1]], "1.61");
    assert_eq!(
        (&fault["path"], &fault["line"], &fault["column"]),
        (&json!(WALK), &json!(6), &json!(14))
    );
    assert!(fault["help"].as_str().unwrap().contains("1.6000 or 1.6167"), "{fault}");
}

#[test]
fn requests_that_cannot_be_served_say_why() {
    let mut page = Page::default();
    let text = page.walk();
    let plan = |hz: f64| json!({ "kind": "plan", "files": walk(&text), "motion": WALK, "from": "good", "iterations": null, "frames_hz": hz });
    for (request, message) in [
        (json!({ "kind": "fly" }), "unknown variant `fly`"),
        (json!({ "kind": "example", "path": "../secret" }), "nothing called `../secret` ships"),
        (json!({ "kind": "open", "files": [], "motion": "mine.toml" }), "`mine.toml` is not open"),
        (plan(0.0), "frames at 0 Hz"),
        (plan(1e9), "frames at 1000000000 Hz"),
    ] {
        let answer = Page::default().ask(request).json;
        assert_eq!(answer["kind"], "error");
        assert!(answer["message"].as_str().unwrap().contains(message), "{answer}");
        assert_ne!(answer["help"], "");
    }
    let lost = text.replace("../robots/agilebot.toml", "../robots/agilbot.toml");
    let answer = page.ask(json!({ "kind": "open", "files": walk(&lost), "motion": WALK })).json;
    assert!(
        answer["message"]
            .as_str()
            .unwrap()
            .contains("`../robots/agilbot.toml`, which motions/walk.toml names")
    );
}

#[test]
fn edits_change_one_thing_and_keep_comments() {
    let mut page = Page::default();
    let text = page.walk();
    let mut check = |edit: Value, expected: &[&str]| {
        let new = page.amended(&text, edit);
        assert_eq!(new_lines(&new, &text), expected);
        new
    };
    check(
        json!({ "edit": "number", "table": [], "key": "samples", "value": 40 }),
        &["samples = 40"],
    );
    check(
        json!({ "edit": "number", "table": ["goal"], "key": "left_m", "value": 0.1 + 0.2 }),
        &["left_m = 0.3"],
    );
    check(json!({ "edit": "number", "table": ["goal"], "key": "left_m", "value": null }), &[]);
    check(json!({ "edit": "gait", "gait": "trot", "duty": null }), &["gait = \"trot\""]);
    check(json!({ "edit": "gait", "gait": "stance", "duty": null }), &["all = \"stance\""]);
    let target = json!({ "of": "body", "at_s": 0.8, "left_m": 0.01 });
    let with_target = check(
        json!({ "edit": "target", "index": null, "target": target }),
        &["[[target]]", "at_s = 0.8", "left_m = 0.01", "of = \"body\""],
    );
    let opened = page.done(json!({ "kind": "open", "files": walk(&with_target), "motion": WALK }));
    assert_eq!(opened["motion"]["targets"], json!([target]));
    let without =
        page.amended(&with_target, json!({ "edit": "target", "index": 0, "target": null }));
    assert_eq!(without, text);
}

#[test]
fn painted_swings_are_rows_and_may_pass_the_end_of_a_period() {
    let mut page = Page::default();
    let text = page.walk();
    let edit = |from: usize, to: usize, stance: bool| json!({ "edit": "swing", "end_effector": 0, "from": from, "to": to, "stance": stance });
    // Front left swings at 9 to 15.
    let longer = page.amended(&text, edit(16, 17, false));
    let rows = new_lines(&longer, &text);
    assert_eq!(rows[0], "front_left = \"#########.........##############\"");
    assert_eq!(rows.len(), 4, "{rows:?}");
    let landed = page.amended(&longer, edit(9, 17, true));
    let wrapped = page.amended(&landed, edit(30, 1, false));
    assert!(wrapped.contains("front_left = \"..############################..\""), "{wrapped}");
    // What no foot can do is refused with the reason.
    let refused = page.amend(&text, edit(11, 15, true));
    assert_eq!(refused["kind"], "faults");
    assert!(
        refused["faults"][0]["help"].as_str().unwrap().contains("a swing needs 3 samples"),
        "{refused}"
    );
    let beyond = page.amend(&text, edit(30, 32, true));
    assert!(beyond["help"].as_str().unwrap().contains("samples 0 to 31"), "{beyond}");
}

#[test]
fn an_edit_leads_out_of_a_document_with_faults() {
    let mut page = Page::default();
    let broken = page.walk().replace("duration_s = 1.6", "duration_s = 99.0");
    let edit = json!({ "edit": "number", "table": [], "key": "duration_s", "value": 1.6 });
    assert_eq!(page.amended(&broken, edit), page.walk());
    let edit = json!({ "edit": "number", "table": [], "key": "samples", "value": 30 });
    let still = page.amend(&broken, edit);
    assert_eq!(still["kind"], "done");
    assert!(still["faults"][0]["message"].as_str().unwrap().contains("duration_s"), "{still}");
}

/// A slider of every robot that ships, moved up by a tenth: the file says so, the robot is valid, and comments stay.
#[test]
fn every_slider_of_every_shipped_robot_moves() {
    let mut page = Page::default();
    let examples = page.done(json!({ "kind": "examples" }))["examples"].clone();
    let mut seen = Vec::new();
    for example in examples.as_array().unwrap() {
        let (motion, Some(robot)) = (example["path"].as_str().unwrap(), example["robot"].as_str())
        else {
            continue;
        };
        if example["of"] != "motion" || seen.contains(&robot.to_owned()) {
            continue;
        }
        seen.push(robot.to_owned());
        let text = page.text(motion);
        let mut files = json!([{ "path": motion, "text": text }]);
        let opened = page.done(json!({ "kind": "open", "files": files, "motion": motion }));
        let path = opened["read"][1].as_str().unwrap().to_owned();
        let robot_text = page.text(&path);
        files.as_array_mut().unwrap().push(json!({ "path": path, "text": robot_text }));
        let parameters = opened["scene"]["parameters"].as_array().unwrap().clone();
        assert!(parameters.len() >= 3, "{path}: {parameters:?}");
        for parameter in &parameters {
            let value = parameter["value"].as_f64().unwrap();
            assert!(
                parameter["min"].as_f64().unwrap() < value
                    && value < parameter["max"].as_f64().unwrap()
            );
            let edit =
                json!({ "edit": "parameter", "name": parameter["name"], "value": 1.1 * value });
            let amend = json!({ "kind": "amend", "files": files, "motion": motion, "path": path, "edit": edit });
            let amended = page.done(amend);
            let text = amended["text"].as_str().unwrap();
            let comments = |text: &str| text.matches('#').count();
            assert_eq!(comments(text), comments(&robot_text), "{path}: {parameter}");
            let files = json!([files[0], { "path": path, "text": text }]);
            let opened = page.ask(json!({ "kind": "open", "files": files, "motion": motion })).json;
            if opened["kind"] == "faults" {
                // A motor that is beyond its torque-speed line, for one.
                assert_eq!(opened["faults"], amended["faults"]);
                continue;
            }
            let all = opened["scene"]["parameters"].as_array().unwrap();
            let moved = all.iter().find(|other| other["name"] == parameter["name"]).unwrap();
            let off = moved["value"].as_f64().unwrap() / (1.1 * value) - 1.0;
            // Files have twelve digits.
            assert!(off.abs() < 1e-10, "{path}: {parameter} became {moved}");
        }
    }
    assert!(seen.len() > 12, "{seen:?}");
}

#[test]
fn a_solution_goes_on_in_another_session() {
    let mut page = Page::default();
    let text = page.walk();
    assert_eq!(page.ask(json!({ "kind": "solution" })).json["kind"], "error");
    assert_eq!(page.ask(json!({ "kind": "report" })).json["kind"], "error");
    let first = page.plan(&text, "scratch", None);
    let kept = page.ask(json!({ "kind": "solution" }));
    let again = page.plan(&text, "good", None);
    let mut other = Page::default();
    assert_eq!(other.ask_with(json!({ "kind": "resume" }), &kept.bytes).json["kind"], "done");
    let resumed = other.plan(&text, "good", None);
    assert_eq!(resumed.json["solve"], again.json["solve"]);
    assert_eq!(resumed.bytes, again.bytes);
    assert_ne!(first.json["solve"]["iterations"], again.json["solve"]["iterations"]);
    let mut cut = kept.bytes.clone();
    cut.truncate(kept.bytes.len() / 2);
    assert_eq!(other.ask_with(json!({ "kind": "resume" }), &cut).json["kind"], "error");
    let odd =
        String::from_utf8(kept.bytes).unwrap().replacen("\"shifts\":[", "\"shifts\":[0.5,", 1);
    let answer = other.ask_with(json!({ "kind": "resume" }), odd.as_bytes()).json;
    assert!(answer["message"].as_str().unwrap().contains("multipliers is not sound"), "{answer}");
}

#[test]
fn the_shown_plan_is_reported_and_exported() {
    let mut page = Page::default();
    let text = page.walk();
    page.plan(&text, "scratch", None);
    let report = page.done(json!({ "kind": "report" }));
    assert_eq!((&report["holds"], &report["judgement"]), (&json!(true), &json!("holds")));
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

/// The comparison of the shown plan of a test leg's motion with a library.
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
    // The library calls it `roll`, its second motion.
    assert_eq!(compare(&mut page, ROLL, &library), (json!(1), String::new()));
    // As `stand`, whose frames are others.
    let (clip, why) = compare(&mut page, "motions/test_leg_stand.toml", &library);
    assert!(clip.is_null() && why.contains("`stand`") && why.contains("duration"), "{why}");
    let (clip, why) = compare(&mut page, ROLL, &library[1..]);
    assert!(clip.is_null() && why.contains("another robot"), "{why}");

    // After an edit it has the same name, and is another motion; undone it is the same again.
    let edited = roll.replace("forward_m = 0.2", "forward_m = 0.19");
    plan(&mut page, edited, "good");
    let (clip, why) = compare(&mut page, ROLL, &library);
    assert!(clip.is_null() && why.contains("rad/s from the plan"), "{why}");
    plan(&mut page, roll, "good");
    assert_eq!(compare(&mut page, ROLL, &library), (json!(1), String::new()));
}

/// A file of the tests of the import.
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
        // Without a side file, it says at least that what it proposes is to be checked.
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
fn a_library_begins_with_the_motions_of_the_project_and_is_edited_as_a_graph() {
    let mut page = Page::default();
    let (walk, drive) = (page.walk(), page.text("motions/drive_1m.toml"));
    let mut files = vec![
        json!({ "path": "walk.toml", "text": walk }),
        json!({ "path": "drive.toml", "text": drive }),
    ];
    let begun = page.done(json!({ "kind": "new_library", "files": files, "motion": "walk.toml" }));
    // Nothing of the project stands still, so that a motion that does is added.
    let added = begun["files"].as_array().unwrap();
    let paths = |begun: &Value| -> Vec<String> {
        let files = begun["files"].as_array().unwrap();
        files.iter().map(|file| file["path"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(paths(&begun), ["agilebot_library.toml", "stand.toml"]);
    // What another robot has at that path stays.
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
