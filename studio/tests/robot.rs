//! A page with a robot at the other end of a link: simulated in the page, and at a serial line.

use rollwalk_sim_host::one_leg;
use rollwalk_studio::Session;
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// Path of the robot file that the page has open.
const ROBOT: &str = "robots/test_leg.toml";

/// A page: its session, its clock, and what the robot would receive.
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

    /// The answer to a request about the robot.
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

    fn wish(&mut self, wish: Value) -> Value {
        let mut wanted = wish;
        wanted["robot"] = json!("wish");
        self.ask(wanted, &[])["view"].take()
    }

    /// Ticks at the rate of a screen until the view is as wished.
    fn until(&mut self, what: &str, wished: impl Fn(&Value) -> bool) -> Value {
        let mut view = Value::Null;
        for _ in 0..60 * 20 {
            self.now_us += 16_667;
            view = self.ask(json!({ "robot": "tick" }), &[])["view"].take();
            if wished(&view) {
                return view;
            }
        }
        panic!("waited for {what}: {view:#}");
    }
}

fn says(view: &Value, text: &str) -> bool {
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
    let view = page.until("the library", |view| says(view, "has it in use"));
    let motions = view["motions"].as_array().expect("motions");
    assert!(motions.len() > 1 && motions.iter().all(|motion| motion["name"].is_string()));
    assert!(!view["torque"].as_bool().expect("a flag"), "nothing was armed");

    page.wish(json!({ "intent": "arm" }));
    page.until("SAFE", |view| view["torque"] == true && view["state"] == "ready");
    page.wish(json!({ "intent": "play", "code": one_leg::SWING }));
    let view = page.until("the motion", |view| view["playing"]["frame"].as_u64() > Some(5));
    assert_eq!(view["poses"][0].as_array().map(Vec::len), Some(7));
    page.wish(json!({ "intent": "estop" }));
    let view = page.until("the stop", |view| view["torque"] == false);
    assert!(says(&view, "EMERGENCY STOP"));
    assert_eq!(page.ask(json!({ "robot": "leave" }), &[])["view"], Value::Null);
    assert_eq!(page.ask(json!({ "robot": "tick" }), &[])["kind"], "error");
}

#[test]
fn a_damaged_library_is_refused_before_anything_is_sent() {
    let mut page = Page::connected("serial");
    page.sent.clear();
    let answer = page.ask(json!({ "robot": "flash" }), &[0; 100]);
    assert_eq!(answer["kind"], "error");
    assert!(answer["message"].as_str().expect("words").contains("not one for `test_leg`"));
    assert!(page.sent.is_empty());
}
