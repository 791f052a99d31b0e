//! The tables of `docs/playback-and-safety.md` are those of the code.

use std::fmt::Write;

use rollwalk_firmware::safety::{Action, EVENTS, Event, STATES, State, Torque, step};

const PAGE: &str = include_str!("../../../docs/playback-and-safety.md");

/// The lines between `<!-- name -->` and the next comment.
fn block(name: &str) -> &str {
    let start = format!("<!-- {name} -->\n");
    let from = PAGE.find(&start).unwrap_or_else(|| panic!("no `{start}`")) + start.len();
    let rest = &PAGE[from..];
    rest[..rest.find("<!--").expect("an end mark")].trim()
}

#[test]
fn the_table_of_states_is_that_of_the_code() {
    let mut table = String::from("| code | state | torque | motions |\n|---|---|---|---|");
    for s in STATES {
        let torque = match s.torque() {
            Torque::Off => "off",
            Torque::Damped => "damped",
            Torque::Driven => "driven",
        };
        let motions = if s.accepts_motions() { "accepted" } else { "refused" };
        write!(
            table,
            "\n| {} | {s:?} | {torque} | {motions} |",
            rollwalk_protocol::wire::State::from(s).code()
        )
        .unwrap();
    }
    assert_eq!(block("states"), table, "the page should hold:\n{table}");
}

#[test]
fn the_table_of_transitions_is_that_of_the_code() {
    let mut table = String::from("| state | event | next | action |\n|---|---|---|---|");
    let everywhere = |e: &Event| STATES.map(|s| step(s, *e)).windows(2).all(|w| w[0] == w[1]);
    for e in EVENTS.into_iter().filter(everywhere) {
        let (next, action) = step(State::Boot, e);
        write!(table, "\n| every | {e:?} | {next:?} | {action:?} |").unwrap();
    }
    for s in STATES {
        for e in EVENTS.into_iter().filter(|e| !everywhere(e)) {
            let (next, action) = step(s, e);
            if (next, action) != (s, Action::None) {
                write!(table, "\n| {s:?} | {e:?} | {next:?} | {action:?} |").unwrap();
            }
        }
    }
    assert_eq!(block("transitions"), table, "the page should hold:\n{table}");
}

#[test]
fn every_scar_has_its_test() {
    let sources = [
        include_str!("scars.rs"),
        include_str!("arming.rs"),
        include_str!("stopping.rs"),
        include_str!("../../src/store/tests/power_cuts.rs"),
        include_str!("../../../protocol/tests/protocol/actuators_mit.rs"),
    ];
    let scars: Vec<&str> = block("scars").lines().skip(2).collect();
    assert_eq!(scars.len(), 10);
    for (i, scar) in scars.into_iter().enumerate() {
        let test = scar.split('`').nth(1).expect("a test in backticks");
        assert!(test.starts_with(&format!("scar_{}_", i + 1)), "{test}");
        let named = format!("fn {test}(");
        let found = sources
            .iter()
            .find_map(|source| source.split(&named).next().filter(|s| s.len() < source.len()));
        let before = found.unwrap_or_else(|| panic!("no test {test}"));
        assert!(before.trim_end().ends_with("#[test]"), "{test} is not run");
    }
}
