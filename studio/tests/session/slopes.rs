//! Tests of the effect of each slider on a plan.

use crate::*;

const ROBOT: &str = "robots/agilebot.toml";

/// Returns a page whose good plan is the walk of a robot with the given text, and the documents.
fn planned(robot: &str) -> (Page, Value) {
    let mut page = Page::default();
    let text = page.walk();
    let files = json!([{ "path": WALK, "text": text }, { "path": ROBOT, "text": robot }]);
    let plan = json!({
        "kind": "plan", "files": files, "motion": WALK, "from": "scratch", "iterations": null, "frames_hz": 60.0,
    });
    assert_eq!(page.done(plan)["good"], true);
    (page, files)
}

/// Returns quantities with their slopes, by name of the parameter.
fn slopes(page: &mut Page, files: &Value) -> Value {
    let kept = page.ask(json!({ "kind": "solution" })).bytes;
    let answer =
        page.ask_with(json!({ "kind": "slopes", "files": files, "motion": WALK }), &kept).json;
    assert_eq!(answer["kind"], "done", "{answer}");
    answer["quantities"].clone()
}

fn find<'v>(list: &'v Value, name: &str) -> &'v Value {
    let mut found = list.as_array().unwrap().iter().filter(|one| one["name"] == name);
    found.next().unwrap_or_else(|| panic!("{name} is not in {list}"))
}

#[test]
#[ignore = "ten seconds and more: cargo xtask nightly --only long"]
fn slopes_say_what_a_slider_does_to_the_optimum() {
    let original = Page::default().text(ROBOT);
    let (mut page, files) = planned(&original);
    let opened = page.done(json!({ "kind": "open", "files": files, "motion": WALK }));
    let parameters = opened["scene"]["parameters"].clone();
    let here = slopes(&mut page, &files);
    assert_eq!(here.as_array().unwrap().len(), 6, "{here}");
    for quantity in here.as_array().unwrap() {
        let by = quantity["slopes"].as_array().unwrap();
        assert_eq!(by.len(), parameters.as_array().unwrap().len(), "{quantity}");
    }
    // Compared with plans of the neighbouring robots, each at its own optimum.
    let parameter = parameters[0].clone();
    let (name, value) = (parameter["name"].as_str().unwrap(), parameter["value"].as_f64().unwrap());
    let change_m = 1e-3;
    let [ahead, behind] = [change_m, -change_m].map(|by| {
        let edit = json!({ "edit": "parameter", "name": name, "value": value + by });
        let amended =
            json!({ "kind": "amend", "files": files, "motion": WALK, "path": ROBOT, "edit": edit });
        let text = page.done(amended)["text"].as_str().unwrap().to_owned();
        let (mut other, files) = planned(&text);
        slopes(&mut other, &files)
    });
    for quantity in ["joint_torque", "peak_joint_torque", "peak_joint_speed"] {
        let value = |of: &Value| find(of, quantity)["value"].as_f64().unwrap();
        let slope = find(&find(&here, quantity)["slopes"], name);
        let predicted = slope["by_step"].as_f64().unwrap() / slope["step"].as_f64().unwrap();
        let found = (value(&ahead) - value(&behind)) / (2.0 * change_m);
        let apart = (predicted - found).abs();
        assert!(
            apart < 0.02 * found.abs(),
            "{quantity} by {name}: {predicted}, and by differences {found}"
        );
    }
}

#[test]
fn a_plan_that_is_none_has_no_slopes() {
    let (mut page, files) = planned(&Page::default().text(ROBOT));
    let asked = json!({ "kind": "slopes", "files": files, "motion": WALK });
    let answer = page.ask_with(asked, b"{}").json;
    assert_eq!(answer["kind"], "error", "{answer}");
}
