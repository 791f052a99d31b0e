//! DBC files as cantools reads them: values must equal those of our decoder.
//!
//! This test is not run by default, because it requires cantools. `cargo xtask test --only dbc` installs cantools and runs it.

use crate::dbc_frames::{Sample, actuators, link};
use proptest::strategy::{BoxedStrategy, Strategy, ValueTree};
use proptest::test_runner::TestRunner;
use rollwalk_bus::candump::{self, LogEntry};
use rollwalk_host::dbc::Database;
use serde_json::Value;
use std::collections::BTreeSet;
use std::process::Command;

/// Random frames of a generator with a fixed seed, and thus the same in every run.
fn samples(count: usize) -> Vec<(&'static str, Sample)> {
    let mut runner = TestRunner::deterministic();
    let mut sample = |strategy: &BoxedStrategy<Sample>| {
        strategy.new_tree(&mut runner).expect("nothing is filtered").current()
    };
    let (link, actuators) = (link(), actuators());
    (0..count)
        .map(|i| if i % 3 == 0 { ("act1", sample(&actuators)) } else { ("link0", sample(&link)) })
        .collect()
}

/// Decodes the samples with decode_log.py; returns its output lines.
fn decode(samples: &[(&'static str, Sample)]) -> Vec<Value> {
    let entry = |(i, (interface, (_, frame, _))): (usize, &(&'static str, Sample))| LogEntry {
        at_us: 1_000_000 + i as u64,
        interface: *interface,
        frame: *frame,
    };
    let entries: Vec<_> = samples.iter().enumerate().map(entry).collect();
    let mut text = Vec::new();
    candump::write(&entries, &mut text).unwrap();
    let log = format!("{}/every_frame.log", env!("CARGO_TARGET_TMPDIR"));
    std::fs::write(&log, text).unwrap();
    let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs");
    let output = Command::new("python3")
        .args([&format!("{docs}/formats/decode_log.py"), &log, "--numbers", "--all"])
        .arg(format!("link*={docs}/rollwalk.dbc"))
        .arg(format!("act*={docs}/rollwalk-actuators.dbc"))
        .output()
        .expect("python3 runs docs/formats/decode_log.py");
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{errors}{}", String::from_utf8_lossy(&output.stdout));
    let lines = std::str::from_utf8(&output.stdout).unwrap().lines();
    lines.map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
#[ignore = "needs cantools: cargo xtask test --only dbc"]
fn cantools_reads_what_the_codecs_write() {
    let samples = samples(3000);
    let decoded = decode(&samples);
    assert_eq!(decoded.len(), samples.len());
    let mut seen = BTreeSet::new();
    for ((_, (schema, frame, expected)), line) in samples.iter().zip(&decoded) {
        let name = line["message"].as_str().unwrap();
        assert!(name.starts_with(&schema.to_uppercase()), "{line}");
        assert_eq!(line["id"], u64::from(frame.standard_id().unwrap()));
        let signals = line["signals"].as_object().unwrap();
        assert_eq!(signals.len(), expected.len(), "{line}");
        for (name, value) in expected {
            match &signals[name] {
                Value::Number(number) => {
                    let error = (number.as_f64().unwrap() - value).abs();
                    assert!(error <= 1e-12 * value.abs(), "{name}, {value} expected: {line}");
                }
                other => assert!(!value.is_finite(), "{name} is {other}, {value} expected"),
            }
        }
        seen.insert(*schema);
    }
    let databases = [Database::link(), Database::actuators()];
    let defined =
        databases.iter().flat_map(|database| &database.messages).map(|message| message.schema);
    assert_eq!(seen, defined.collect(), "every message is among the samples");
}
