//! Tests of opening documents in the page: scenes, frames, faults.

use crate::*;

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
    // A right leg is the mirror image of the left leg.
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
        (json!({ "kind": "example", "path": "../secret" }), "no file `../secret` ships"),
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
            .contains("`../robots/agilbot.toml` (named in motions/walk.toml)")
    );
}
