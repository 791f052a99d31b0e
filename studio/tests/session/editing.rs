//! Tests of edits, and of plans that follow them.

use crate::*;

#[test]
fn a_document_has_one_plan_whatever_was_edited_before() {
    let mut page = Page::default();
    let original = page.walk();
    let first = page.plan(&original, "scratch", None);
    let text = original.clone();
    let text = page.amended(
        &text,
        json!({ "edit": "number", "table": ["goal"], "key": "forward_m", "value": 0.125 }),
    );
    let step = page.plan(&text, "good", Some(2));
    // A plan during a drag is shown, is not a good plan, and cannot count as one that holds.
    assert_eq!((&step.json["good"], &step.json["converged"]), (&json!(false), &json!(false)));
    assert!(step.json["solve"]["iterations"].as_u64().unwrap() <= 2);
    assert!(!step.json["solve"]["words"].as_str().unwrap().contains("played"));
    let last = page.plan(&text, "good", None);
    assert_eq!(last.json["good"], true);
    let fresh = Page::default().plan(&text, "scratch", None);
    assert_eq!((&last.json["solve"], &last.bytes), (&fresh.json["solve"], &fresh.bytes));
    let undone = page.plan(&original, "good", None);
    assert_eq!(undone.bytes, first.bytes);
}

#[test]
fn what_is_in_the_way_is_said_long_before_numbers_that_work() {
    let mut page = Page::default();
    let roll = page.text("motions/test_leg_roll.toml");
    let text = roll.replace("forward_m = 0.2", "forward_m = 3.0");
    assert_ne!(text, roll);
    let files = json!([{ "path": "roll.toml", "text": text }]);
    let answer = page.ask(json!({
        "kind": "plan", "files": files, "motion": "roll.toml", "from": "scratch", "iterations": null, "frames_hz": 60.0,
    }));
    assert_eq!(answer.json["solve"]["status"], "infeasible");
    let (before, refused) = answer.refused.unwrap();
    assert!(5 * before < answer.progress, "{before} of {}", answer.progress);
    let goal = &refused["culprits"][0];
    assert_eq!(goal["constraint"], "displacement goal");
    // A value that was not tried is not shown.
    assert!(goal["fix"].is_null() && !goal["what"].as_str().unwrap().contains("works"), "{goal}");
    assert!(answer.json["solve"]["culprits"][0]["fix"].is_object());
}

/// Requests 1.05 m per period. The planner's own starts reach only 1 m, so the plan for 1 m must be used as the start.
#[test]
#[ignore = "half a minute: cargo xtask nightly --only long"]
fn what_only_the_plan_at_hand_leads_to_is_planned_from_it() {
    let mut page = Page::default();
    let walk = page.walk();
    let mut to = |forward_m: f64| {
        let edit =
            json!({ "edit": "number", "table": ["goal"], "key": "forward_m", "value": forward_m });
        page.amended(&walk, edit)
    };
    let (near, far) = (to(1.0), to(1.05));
    page.plan(&near, "scratch", None);
    page.plan(&far, "good", Some(60));
    assert_eq!(page.plan(&far, "good", None).json["converged"], true);
    assert_eq!(Page::default().plan(&far, "scratch", None).json["converged"], false);
}

#[test]
#[ignore = "minutes: cargo xtask nightly --only long"]
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
    // The failed plan was not the start of the next.
    assert_eq!(page.plan(&good, "good", None).json["converged"], true);
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
    // The front left foot swings at samples 9 to 15.
    let longer = page.amended(&text, edit(16, 17, false));
    let rows = new_lines(&longer, &text);
    assert_eq!(rows[0], "front_left = \"#########.........##############\"");
    assert_eq!(rows.len(), 4, "{rows:?}");
    let landed = page.amended(&longer, edit(9, 17, true));
    let wrapped = page.amended(&landed, edit(30, 1, false));
    assert!(wrapped.contains("front_left = \"..############################..\""), "{wrapped}");
    // A swing that no foot can do is refused with the reason.
    let refused = page.amend(&text, edit(11, 15, true));
    assert_eq!(refused["kind"], "faults");
    assert!(
        refused["faults"][0]["help"].as_str().unwrap().contains("lengthen the swing to 3 samples"),
        "{refused}"
    );
    let beyond = page.amend(&text, edit(30, 32, true));
    assert!(beyond["help"].as_str().unwrap().contains("samples from 0 to 31"), "{beyond}");
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

/// Moves each slider of every shipped robot up by a tenth. The file must contain the value, the robot must be valid, and
/// comments must stay.
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
                // For example a motor beyond its torque-speed line.
                assert_eq!(opened["faults"], amended["faults"]);
                continue;
            }
            let all = opened["scene"]["parameters"].as_array().unwrap();
            let moved = all.iter().find(|other| other["name"] == parameter["name"]).unwrap();
            let off = moved["value"].as_f64().unwrap() / (1.1 * value) - 1.0;
            // Files contain twelve digits.
            assert!(off.abs() < 1e-10, "{path}: {parameter} became {moved}");
        }
    }
    assert!(seen.len() > 12, "{seen:?}");
}
