//! Tests of a page with a robot at the other end of a link: simulated in the page, and on a serial line.

use rollwalk_sim_host::one_leg;
use rollwalk_studio::Session;
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// Path of the robot file that is open in the page.
const ROBOT: &str = "robots/test_leg.toml";

/// Page with its session, its clock, and the bytes that the robot would receive.
struct Page {
    session: Session,
    now_us: u64,
    sent: Vec<u8>,
}

impl Page {
    fn connected(place: &str) -> Self {
        let mut page = Self { session: Session::default(), now_us: 0, sent: Vec::new() };
        let connect =
            json!({ "robot": "connect", "place": place, "files": [], "file": ROBOT, "node": 1 });
        assert_eq!(page.ask(connect, &[])["kind"], "done");
        page
    }

    /// Sends a request about the robot and returns the answer.
    fn ask(&mut self, mut wanted: Value, binary: &[u8]) -> Value {
        wanted["seq"] = json!(1);
        wanted["kind"] = json!("robot");
        wanted["now_us"] = json!(self.now_us);
        let mut answers = Vec::new();
        self.session.request(&wanted.to_string(), binary, &mut |json, bytes| {
            answers.push(serde_json::from_str(json).expect("JSON"));
            self.sent.extend_from_slice(bytes);
            ControlFlow::Continue(())
        });
        assert_eq!(answers.len(), 1, "one answer to {wanted}");
        answers.remove(0)
    }

    fn request(&mut self, wish: Value) -> Value {
        let mut wanted = wish;
        wanted["robot"] = json!("wish");
        self.ask(wanted, &[])["view"].take()
    }

    /// Sends ticks at the rate of a screen until the view satisfies the condition.
    fn until(&mut self, what: &str, condition: impl Fn(&Value) -> bool) -> Value {
        self.until_with(what, &json!({ "robot": "tick", "attended": true }), condition)
    }

    fn until_with(
        &mut self,
        what: &str,
        tick: &Value,
        condition: impl Fn(&Value) -> bool,
    ) -> Value {
        let mut view = Value::Null;
        for _ in 0..60 * 20 {
            self.now_us += 16_667;
            view = self.ask(tick.clone(), &[])["view"].take();
            if condition(&view) {
                return view;
            }
        }
        panic!("waited for {what}: {view:#}");
    }
}

fn contains_message(view: &Value, text: &str) -> bool {
    let messages = view["messages"].as_array().expect("messages");
    messages.iter().any(|message| message["text"].as_str().is_some_and(|said| said.contains(text)))
}

#[test]
fn a_robot_in_the_page_is_flashed_armed_played_and_stopped() {
    let mut page = Page::connected("simulated");
    page.until("contact", |view| view["contact"] == true && view["library"].is_null());
    let robot = rollwalk_shipped::text(ROBOT).expect("it ships");
    let robot = rollwalk_robot::Robot::from_toml(ROBOT, robot).expect("it is valid");
    let library = one_leg::library_for(&robot.controller_config().expect("a configuration"));
    assert_eq!(page.ask(json!({ "robot": "flash" }), &library)["kind"], "done");
    let view =
        page.until("the library", |view| contains_message(view, "uses the transferred library"));
    let motions = view["motions"].as_array().expect("motions");
    assert!(motions.len() > 1 && motions.iter().all(|motion| motion["name"].is_string()));
    assert!(!view["torque"].as_bool().expect("a flag"), "nothing was armed");

    page.request(json!({ "intent": "arm" }));
    page.until("SAFE", |view| view["torque"] == true && view["state"] == "ready");
    page.request(json!({ "intent": "play", "code": one_leg::SWING }));
    let view = page.until("the motion", |view| view["playing"]["time_s"].as_f64() > Some(0.1));
    assert_eq!(view["poses"][0].as_array().map(Vec::len), Some(7));
    page.request(json!({ "intent": "estop" }));
    let view = page.until("the stop", |view| view["torque"] == false);
    assert!(contains_message(&view, "EMERGENCY STOP"));
    assert_eq!(page.ask(json!({ "robot": "leave" }), &[])["view"], Value::Null);
    assert_eq!(page.ask(json!({ "robot": "tick", "attended": true }), &[])["kind"], "error");
}

#[test]
fn a_damaged_library_is_refused_before_anything_is_sent() {
    let mut page = Page::connected("serial");
    page.sent.clear();
    let answer = page.ask(json!({ "robot": "flash" }), &[0; 100]);
    assert_eq!(answer["kind"], "error");
    assert!(answer["message"].as_str().expect("words").contains("does not fit `test_leg`"));
    assert!(page.sent.is_empty());
}

/// Returns the state of a standard gamepad with the given buttons pressed, as a browser reports it.
fn pad(down: &[usize]) -> Value {
    let buttons: Vec<_> = (0..17).map(|index| f32::from(u8::from(down.contains(&index)))).collect();
    json!({ "id": "Xbox 360 Controller (STANDARD GAMEPAD)", "buttons": buttons, "axes": [0, 0, 0, 0] })
}

impl Page {
    /// Sends ticks with the same input for a time; returns the final view.
    fn pass(&mut self, seconds: f64, tick: &Value) -> Value {
        let mut view = Value::Null;
        for _ in 0..(seconds * 60.0) as usize {
            self.now_us += 16_667;
            view = self.ask(tick.clone(), &[])["view"].take();
        }
        view
    }

    /// Connects to a simulated robot, transfers its library, and waits until it can be armed.
    fn flashed(gamepad: bool) -> Self {
        let mut page = Self::connected("simulated");
        let connect = json!({
            "robot": "connect", "place": "simulated", "files": [], "file": ROBOT, "node": 1, "gamepad": gamepad,
        });
        page.ask(connect, &[]);
        page.until("contact", |view| view["contact"] == true);
        let robot = rollwalk_shipped::text(ROBOT).expect("it ships");
        let robot = rollwalk_robot::Robot::from_toml(ROBOT, robot).expect("it is valid");
        let library = one_leg::library_for(&robot.controller_config().expect("a configuration"));
        page.ask(json!({ "robot": "flash" }), &library);
        page.until("the library", |view| contains_message(view, "uses the transferred library"));
        page
    }
}

#[test]
fn a_gamepad_moves_the_robot_only_with_its_deadman_and_arms_by_holding() {
    const START: usize = 9;
    const DEADMAN: usize = 5;
    let mut page = Page::flashed(true);
    let tick = |gamepad: Value| json!({ "robot": "tick", "attended": true, "gamepad": [gamepad] });
    let view = page.request(json!({ "intent": "arm" }));
    assert!(contains_message(&view, "hold the deadman"), "the page's own button is barred, too");
    assert!(view["gamepad"].as_str().is_some_and(|words| words.contains("press a button")));
    page.pass(0.1, &tick(pad(&[])));
    page.pass(1.5, &tick(pad(&[START])));
    page.pass(0.1, &tick(pad(&[DEADMAN])));
    let view = page.pass(0.9, &tick(pad(&[DEADMAN, START])));
    assert_eq!(view["torque"], false, "not yet a second");
    page.pass(0.2, &tick(pad(&[DEADMAN, START])));
    // The leg has one wheel and falls soon, so no step takes longer than necessary.
    page.until_with("SAFE", &tick(pad(&[DEADMAN])), |view| view["state"] == "ready");
    page.pass(0.02, &tick(pad(&[DEADMAN, 12])));
    page.until_with("the motion", &tick(pad(&[DEADMAN])), |view| view["playing"]["rate"] == 1.0);
    // A page without the gamepad's state holds no button.
    page.pass(0.2, &json!({ "robot": "tick", "attended": true }));
    assert_eq!(page.pass(0.02, &json!({ "robot": "tick", "attended": true }))["state"], "playing");
    let view = page.pass(0.1, &json!({ "robot": "tick", "attended": true }));
    assert_eq!(view["state"], "paused", "{view}");
    // A button that was held all the time must be released first.
    let view = page.pass(0.2, &tick(pad(&[DEADMAN, 12])));
    assert_eq!(view["state"], "paused");
    // A tap on the emergency stop within one tick.
    let tap = json!({ "robot": "tick", "attended": true, "gamepad": [pad(&[1]), pad(&[])] });
    assert!(contains_message(&page.pass(0.02, &tap), "EMERGENCY STOP"));
}

#[test]
fn without_anybody_at_the_page_the_robot_returns_to_safe() {
    let mut page = Page::flashed(false);
    page.request(json!({ "intent": "arm" }));
    page.until("SAFE", |view| view["state"] == "ready");
    let nobody = json!({ "robot": "tick", "attended": false });
    let view = page.pass(0.2, &nobody);
    assert_eq!(view["torque"], true);
    let view = page.pass(4.0, &nobody);
    assert_eq!(view["torque"], false, "{view}");
    assert!(
        contains_message(&view, "the page or terminal does not respond")
            && contains_message(&view, "heartbeat lost")
    );
}

#[test]
fn a_file_that_is_no_key_is_refused_before_anything_is_sent() {
    let mut page = Page::connected("serial");
    page.sent.clear();
    let key = json!({ "text": "rollwalk-link-key-1 00", "nonce": [1, 2] });
    let answer = page.ask(
        json!({ "robot": "connect", "place": "serial", "files": [], "file": ROBOT, "node": 1, "key": key }),
        &[],
    );
    assert_eq!(answer["kind"], "error");
    assert!(
        answer["message"].as_str().is_some_and(|words| words.contains("not a link key")),
        "{answer}"
    );
    assert!(page.sent.is_empty());
    let key = json!({ "text": format!("rollwalk-link-key-1 {}", "0f".repeat(32)), "nonce": [1, 4_294_967_295u32] });
    page.ask(
        json!({ "robot": "connect", "place": "serial", "files": [], "file": ROBOT, "node": 14, "key": key }),
        &[],
    );
    page.ask(json!({ "robot": "tick", "attended": true }), &[]);
    assert!(!page.sent.is_empty(), "it asks for a session");
}
