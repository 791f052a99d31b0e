//! Checks of the frame database against the codecs, the schema, and the generated files.

use crate::dbc_frames::{Sample, actuators, link};
use proptest::prelude::*;
use rollwalk_host::dbc::{ChannelName, Database, Message, Presence, RobotNames};
use rollwalk_protocol::wire::{Node, SCHEMA};
use std::collections::{BTreeMap, BTreeSet};

/// Asserts that the database decodes a frame to the encoded values.
fn check(database: &Database, (schema, frame, expected): &Sample) {
    let message = database.messages.iter().find(|message| Some(message.id) == frame.standard_id());
    let message = message.unwrap_or_else(|| panic!("no message for {frame:?}"));
    assert_eq!(message.schema, *schema);
    assert!(frame.data().len() <= usize::from(message.len), "{}", message.name);
    let whole = !schema.starts_with("transport");
    assert!(!whole || frame.data().len() == usize::from(message.len), "{}", message.name);
    let values = message.values(frame.data());
    let read: BTreeMap<&str, f64> =
        values.iter().map(|v| (v.signal.name.as_str(), v.number)).collect();
    let expected: BTreeMap<&str, f64> =
        expected.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    assert_eq!(read.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "{schema}");
    for value in values {
        let (name, number) = (value.signal.name.as_str(), value.number);
        // Both are a multiple of a decimal fraction in double precision.
        let error = (number - expected[name]).abs();
        let same = number.to_bits() == expected[name].to_bits() || error <= 1e-12 * number.abs();
        assert!(same || number.is_nan() && expected[name].is_nan(), "{schema} {name}: {number}");
        let signal = value.signal;
        let bounded = (signal.min, signal.max) != (0.0, 0.0);
        let within = (signal.min - 1e-9..=signal.max + 1e-9).contains(&number);
        assert!(!bounded || within, "{schema} {name}: {number} beyond its range");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn the_table_reads_what_the_codecs_write(sample in prop_oneof![3 => link().prop_map(|s| (true, s)), 1 => actuators().prop_map(|s| (false, s))]) {
        thread_local! {
            static BOTH: [Database; 2] = [Database::actuators(), Database::link()];
        }
        let (of_link, sample) = sample;
        BOTH.with(|both| check(&both[usize::from(of_link)], &sample));
    }
}

/// Identifiers that match the pattern in a line of the schema.
fn ids(pattern: &str) -> Vec<u16> {
    let number = |digits: &str| u16::from_str_radix(digits, 16).unwrap();
    match pattern.strip_suffix("+n") {
        Some(base) => (0..128).map(|n| number(base) + n).collect(),
        None => (0..16).map(|n| number(&pattern.replace(['n', 'F'], &format!("{n:X}")))).collect(),
    }
}

/// Name and width of a schema field, such as `state:4`, `uid:6*u8` or `position:i16*2e-4rad`.
fn field(text: &str) -> (&str, u16) {
    let Some((name, kind)) = text.split_once(':') else {
        assert_eq!(text, "crc8");
        return (text, 8);
    };
    let (count, kind) = match kind.split_once('*') {
        Some((count, kind)) if count.parse::<u16>().is_ok() => (count.parse().unwrap(), kind),
        _ => (1, kind),
    };
    let kind = kind.split(['*', '/']).next().unwrap();
    (name, count * kind.trim_start_matches(['u', 'i', 'f']).parse::<u16>().unwrap())
}

/// Asserts that the signals cover the bits of each schema field, in the schema's order and under the field's name.
fn check_fields(message: &Message, fields: &str) {
    let mut at = 0;
    for (name, bits) in fields.split_whitespace().map(field) {
        let there = message.signals.iter().filter(|signal| {
            let first = signal.start.min(8 * (signal.start / 8));
            let first =
                if signal.start % 8 == 7 && signal.bits >= 8 { first } else { signal.start };
            (at..at + bits).contains(&first)
        });
        let mut covered = 0;
        for signal in there {
            let stem = name.trim_end_matches('s');
            assert!(signal.name.starts_with(stem), "{}: {} in {name}", message.name, signal.name);
            covered += signal.bits;
        }
        let flags = ["faults", "status"].contains(&name);
        assert!(covered == bits || flags && covered > bits / 2 || name == "zero", "{name}");
        at += bits;
    }
    assert_eq!(at, 8 * u16::from(message.len), "{}", message.name);
}

#[test]
fn the_table_has_every_message_of_the_schema() {
    let (link, actuators) = (Database::link(), Database::actuators());
    let mut known = BTreeSet::new();
    let mut types = Vec::new();
    for line in SCHEMA.lines() {
        let (pattern, rest) = line.split_once(' ').unwrap();
        let (name, fields) = rest.split_once(' ').unwrap_or((rest, ""));
        if pattern == "isotp" {
            let (code, _) = fields.split_once(' ').unwrap_or((fields, ""));
            types.push((u64::from_str_radix(name, 16).unwrap(), code.to_owned()));
            continue;
        }
        known.insert(name);
        let database = if pattern.ends_with("+n") { &actuators } else { &link };
        let of_it: Vec<_> = database.messages.iter().filter(|m| m.schema == name).collect();
        assert!(of_it.len() >= 15, "{} messages for {line}", of_it.len());
        let possible = ids(pattern);
        for message in &of_it {
            assert!(possible.contains(&message.id), "{} for {line}", message.name);
            if fields != "isotp" {
                check_fields(message, fields);
            }
        }
        // Each message has one address; messages of the host also have the address of all.
        let from_host = line.starts_with("7F0")
            || pattern.ends_with('0') && !["status", "joint"].contains(&name);
        let all = from_host && name != "transport_to_controller";
        let expected = if pattern.ends_with("+n") { 128 } else { 15 + usize::from(all) };
        assert_eq!(of_it.len(), expected, "{line}");
    }
    assert!(!types.is_empty());
    for message in link.messages.iter().chain(&actuators.messages) {
        assert!(known.contains(message.schema), "{} is not in the schema", message.schema);
        for signal in message.signals.iter().filter(|signal| signal.name.ends_with("_type")) {
            assert_eq!(signal.names, types);
        }
    }
}

/// Checks the requirements of the DBC format and of its tools.
fn check_form(database: &Database) {
    let mut ids = BTreeSet::new();
    let mut names = BTreeSet::new();
    for message in &database.messages {
        assert!(ids.insert(message.id) && names.insert(&message.name), "{} twice", message.name);
        assert!(message.id < 0x800 && message.len <= 8);
        let mut signals = BTreeSet::new();
        let selectors = message.signals.iter().filter(|s| s.presence == Presence::Selector);
        assert!(selectors.count() <= 1);
        for signal in &message.signals {
            assert!(signals.insert(&signal.name), "{} twice in {}", signal.name, message.name);
            assert!(signal.bits > 0 && signal.raw(&[0; 8][..message.len.into()]).is_some());
            assert!(signal.name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_'));
            assert!(signal.names.iter().all(|(n, _)| *n < 1 << signal.bits));
        }
        for sender in message.sender.iter().chain(&message.receiver) {
            assert!(database.nodes.contains(sender), "{sender}");
        }
    }
    let text = database.to_dbc();
    assert!(text.is_ascii() && text.ends_with('\n'));
}

fn names() -> RobotNames {
    let channel =
        |name: &str, bus, id, is_wheel| ChannelName { name: name.into(), bus, id, is_wheel };
    RobotNames {
        robot: "Pup 2".into(),
        channels: vec![
            channel("front_left_hip", 0, 1, false),
            channel("3rd knee of the right, with a very long name", 1, 1, false),
            channel("3rd knee of the right, with a very long_name", 1, 2, false),
            channel("front_left", 0, 3, true),
        ],
    }
}

#[test]
fn databases_are_well_formed() {
    let names = names();
    for database in [
        Database::link(),
        Database::actuators(),
        Database::link_of(Node::new(3).unwrap(), &names),
        Database::actuators_of(0, &names),
        Database::actuators_of(1, &names),
        Database::actuators_of(7, &names),
    ] {
        check_form(&database);
    }
}

#[test]
fn with_a_robot_joints_have_their_names() {
    let names = names();
    let link = Database::link_of(Node::new(3).unwrap(), &names);
    assert_eq!(link.nodes, ["host", "Pup_2"]);
    let joint = link.messages.iter().find(|message| message.schema == "joint").unwrap();
    assert_eq!((joint.name.as_str(), joint.id), ("JOINT_3", 0x430));
    // The golden frame of the protocol, of channel 3.
    let values = joint.values(&[3, 0x78, 0xEC, 0xE8, 0x03, 0x64, 0x00, 0x01]);
    let shown: Vec<_> = values.iter().map(|v| (v.signal.name.as_str(), v.number)).collect();
    assert_eq!(values[0].name(), Some("front_left"));
    assert_eq!(shown[1], ("front_left_position", -1.0));
    assert_eq!(shown[2], ("front_left_velocity", 2.0));
    assert_eq!(shown[3], ("front_left_torque", 0.5));
    assert_eq!(shown[4], ("front_left_status_enabled", 1.0));

    let bus = Database::actuators_of(0, &names);
    assert_eq!(bus.nodes, ["controller", "front_left_hip", "front_left"]);
    let messages: Vec<_> = bus.messages.iter().map(|m| (m.id, m.name.as_str())).collect();
    let expected = [
        (0x081, "CONTROL_front_left_hip"),
        (0x083, "CONTROL_front_left"),
        (0x101, "JOINT_SETPOINT_front_left_hip"),
        (0x181, "FEEDBACK_front_left_hip"),
        (0x183, "FEEDBACK_front_left"),
        (0x203, "WHEEL_SETPOINT_front_left"),
        (0x281, "JOINT_TORQUE_SETPOINT_front_left_hip"),
        (0x303, "WHEEL_TORQUE_SETPOINT_front_left"),
        (0x381, "WIDE_JOINT_SETPOINT_front_left_hip"),
        (0x403, "WIDE_WHEEL_SETPOINT_front_left"),
        (0x481, "WIDE_FEEDBACK_front_left_hip"),
        (0x483, "WIDE_FEEDBACK_front_left"),
    ];
    assert_eq!(messages, expected);
}

/// Checks that the files are up to date. Writes them instead if `ROLLWALK_UPDATE_DOCS` is set.
#[test]
fn the_files_in_docs_are_generated() {
    for (file, database) in
        [("rollwalk.dbc", Database::link()), ("rollwalk-actuators.dbc", Database::actuators())]
    {
        let path = format!("{}/../docs/{file}", env!("CARGO_MANIFEST_DIR"));
        if std::env::var_os("ROLLWALK_UPDATE_DOCS").is_some() {
            std::fs::write(&path, database.to_dbc()).unwrap();
        }
        let text = std::fs::read_to_string(path).unwrap_or_default().replace("\r\n", "\n");
        assert!(
            text == database.to_dbc(),
            "docs/{file} is of another version; write it with\n\n    \
             ROLLWALK_UPDATE_DOCS=1 cargo test -p rollwalk-host\n"
        );
    }
}
