//! Tests of the engine through requests as JSON, and answers as JSON and bytes.

mod editing;
mod files;
mod libraries;
mod opening;
mod slopes;

use rollwalk_studio::Session;
use serde_json::{Value, json};
use std::ops::ControlFlow;

/// Session with a request counter.
#[derive(Default)]
struct Page {
    session: Session,
    seq: u64,
}

/// Final answer to a request with its bytes, the number of progress answers before it, and the first report of a failed start
/// with its index.
struct Answer {
    json: Value,
    bytes: Vec<u8>,
    progress: usize,
    refused: Option<(usize, Value)>,
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
        let refused = answers.iter().map(|(json, _)| json["refused"].clone());
        let refused = refused.enumerate().find(|(_, refused)| !refused.is_null());
        Answer { json, bytes, progress: answers.len(), refused }
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

    /// Returns the text after an edit that causes no faults.
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

/// Lines of a text that are not in another text.
fn new_lines<'t>(text: &'t str, before: &str) -> Vec<&'t str> {
    text.lines().filter(|line| !before.lines().any(|other| other == *line)).collect()
}
