//! Comparison of the WebAssembly engine with the native one: the same status, nearly the same plan, and the ratio of solve
//! times.
//!
//! Rounding differs between the two: x86 fuses multiplications with additions, and WebAssembly does not.

use cpu_time::ProcessTime;
use rollwalk_planner::plan::Plan;
use rollwalk_studio::Session;
use serde_json::{Value, json};
use std::env;
use std::io::{BufRead, BufReader, Write};
use std::ops::ControlFlow;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

/// Motions on wheels, on legs, on both, and on blades.
const MOTIONS: [&str; 6] =
    ["drive_1m", "walk", "trot", "swizzlebot_forward", "anymal_drive", "skate"];
/// Maximum difference of a joint angle, rad.
const JOINT_RAD: f64 = 1e-6;
/// Maximum relative difference of the energy.
const ENERGY: f64 = 1e-6;

/// Process of Node.js that runs the engine.
struct Node {
    child: Child,
    requests: ChildStdin,
    answers: BufReader<ChildStdout>,
}

impl Node {
    fn start(wasm: &str) -> Self {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/door.mjs");
        let mut node = Command::new("node");
        node.arg(script).arg(wasm).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = node.spawn().expect("node runs");
        let requests = child.stdin.take().unwrap();
        let answers = BufReader::new(child.stdout.take().unwrap());
        Self { child, requests, answers }
    }

    fn ask(&mut self, request: &Value) -> (Value, f64) {
        writeln!(self.requests, "{request}").unwrap();
        let mut line = String::new();
        self.answers.read_line(&mut line).unwrap();
        let answer: Value = serde_json::from_str(&line).expect("an answer");
        (answer["answer"].clone(), answer["cpu_ms"].as_f64().unwrap())
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        let _ = self.child.kill();
    }
}

fn native(session: &mut Session, request: &Value) -> (Value, f64) {
    let mut last = String::new();
    let start = ProcessTime::now();
    session.request(&request.to_string(), &[], &mut |json, _| {
        json.clone_into(&mut last);
        ControlFlow::Continue(())
    });
    (serde_json::from_str(&last).unwrap(), start.elapsed().as_secs_f64() * 1e3)
}

fn plan(answer: &Value) -> Plan {
    Plan::from_json("plan", answer["text"].as_str().unwrap()).unwrap()
}

/// Path of the WebAssembly engine, from the environment.
fn engine() -> String {
    env::var("STUDIO_WASM").expect("STUDIO_WASM names the engine")
}

/// Creates a request to plan one document.
fn request(path: &str, text: &str, from: &str) -> Value {
    json!({
        "seq": 1, "kind": "plan", "files": [{ "path": path, "text": text }], "motion": path, "from": from,
        "iterations": null, "frames_hz": 60.0,
    })
}

/// Requires the engine at `STUDIO_WASM`, as built by `cargo xtask studio`.
#[test]
#[ignore = "cargo xtask nightly --only studio builds the engine for it"]
fn webassembly_plans_what_the_command_line_plans() {
    let wasm = engine();
    let median = |times: &mut Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    println!(
        "| motion | native, ms | WebAssembly, ms | ratio | again, native | again, WebAssembly | ratio | joints apart, rad |"
    );
    println!("|---|---|---|---|---|---|---|---|");
    for motion in MOTIONS {
        let path = format!("motions/{motion}.toml");
        let text = rollwalk_shipped::text(&path).unwrap();
        let request = |from: &str| request(&path, text, from);
        let (mut node, mut session) = (Node::start(&wasm), Session::default());
        // Node compiles while it runs, so the first call is not typical.
        node.ask(&request("scratch"));
        let mut times: [Vec<f64>; 4] = Default::default();
        for _ in 0..5 {
            let ours = native(&mut session, &request("scratch"));
            let theirs = node.ask(&request("scratch"));
            times[0].push(ours.1);
            times[1].push(theirs.1);
            let solve = |(answer, _): &(Value, f64), key: &str| answer["solve"][key].clone();
            for key in ["status", "iterations"] {
                assert_eq!(solve(&ours, key), solve(&theirs, key), "{motion}: {key}");
            }
            let [a, b] = [&ours, &theirs].map(|answer| solve(answer, "energy").as_f64().unwrap());
            assert!((a / b - 1.0).abs() < ENERGY, "{motion}: energy {a} and {b}");
            // The same request starts from its own plan.
            times[2].push(native(&mut session, &request("good")).1);
            times[3].push(node.ask(&request("good")).1);
        }
        let shown = json!({ "seq": 2, "kind": "plan_json" });
        let (ours, theirs) = (plan(&native(&mut session, &shown).0), plan(&node.ask(&shown).0));
        let pairs = ours.samples.iter().zip(&theirs.samples);
        let apart = pairs.flat_map(|(a, b)| a.joint_rad.iter().zip(&b.joint_rad));
        let apart = apart.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let [a, b, c, d] = times.each_mut().map(median);
        println!(
            "| {motion} | {a:.0} | {b:.0} | {:.1} | {c:.0} | {d:.0} | {:.1} | {apart:.1e} |",
            b / a,
            d / c
        );
        assert!(apart < JOINT_RAD, "{motion}: joints {apart} rad apart");
    }
}

/// Motions that the planner finds only after hundreds of iterations, so that rounding decides whether a plan is found.
const ROUNDING_DECIDES: [&str; 1] = ["motions/pronk.toml"];

/// Checks that every example of the gallery can be planned by either engine.
#[test]
#[ignore = "cargo xtask nightly --only studio builds the engine for it"]
fn every_shipped_motion_that_holds_natively_holds_as_webassembly() {
    let mut node = Node::start(&engine());
    let (mut held, mut lost) = (0, Vec::new());
    let shipped = native(&mut Session::default(), &json!({ "seq": 1, "kind": "examples" })).0;
    let shipped = shipped["examples"].as_array().unwrap();
    let motions = shipped.iter().filter(|example| example["of"] == "motion");
    for path in motions.map(|example| example["path"].as_str().unwrap()) {
        let text = rollwalk_shipped::text(path).unwrap();
        let request = request(path, text, "scratch");
        let ours = native(&mut Session::default(), &request);
        let theirs = node.ask(&request);
        let [(a, a_ms), (b, b_ms)] = [&ours, &theirs].map(|(answer, ms)| {
            let solve = &answer["solve"];
            (format!("{} after {} iterations", solve["status"], solve["iterations"]), ms)
        });
        println!("{path}: {a}, {a_ms:.0} ms; as WebAssembly {b}, {b_ms:.0} ms");
        held += usize::from(ours.0["converged"] == true);
        let decided = !ROUNDING_DECIDES.contains(&path);
        if decided && ours.0["converged"] == true && theirs.0["converged"] != true {
            lost.push(format!("{path}: {a}; as WebAssembly {b}"));
        }
    }
    assert!(lost.is_empty(), "{}", lost.join("\n"));
    assert!(held > 40, "only {held} hold natively");
}
