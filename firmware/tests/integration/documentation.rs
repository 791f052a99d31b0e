//! Documents match the code. The tables of `docs/playback-and-safety.md` and `docs/formats/wire-format.md` are generated from
//! it, and `docs/faults.md` names its faults, events and settings.

use std::cmp::Reverse;
use std::fmt::Debug;
use std::{env, fs, iter};

use rollwalk_firmware::Settings;
use rollwalk_firmware::safety::{Action, step};
use rollwalk_protocol::faults::{Description, Event, Fault, Severity};
use rollwalk_protocol::wire::{State, Torque};

/// Text of a page between `<!-- name -->` and the next comment.
fn block<'a>(page: &'a str, name: &str) -> &'a str {
    let start = format!("<!-- {name} -->\n");
    let (_, rest) = page.split_once(&start).unwrap_or_else(|| panic!("no `{start}`"));
    rest.split_once("<!--").expect("an end mark").0.trim()
}

/// Compares the tables of the documents with the code. Writes them instead if `ROLLWALK_UPDATE_DOCS` is set.
#[test]
fn the_tables_are_those_of_the_code() {
    for (page, tables) in [
        ("playback-and-safety.md", &[("states", states()), ("transitions", transitions())][..]),
        (
            "formats/wire-format.md",
            &[
                ("states", listed(State::ALL, State::code)),
                ("severities", listed(Severity::ALL, Severity::code)),
                ("faults", listed(Fault::ALL, Fault::code)),
                ("events", events()),
            ],
        ),
    ] {
        let path = format!("{}/../docs/{page}", env!("CARGO_MANIFEST_DIR"));
        let mut text = fs::read_to_string(&path).unwrap().replace("\r\n", "\n");
        for (name, table) in tables {
            if env::var_os("ROLLWALK_UPDATE_DOCS").is_some() {
                let start = format!("<!-- {name} -->\n");
                text = text.replacen(&(start.clone() + block(&text, name)), &(start + table), 1);
                fs::write(&path, &text).unwrap();
            }
            assert_eq!(
                block(&text, name),
                table,
                "docs/{page} is not up to date; write its tables with\n\n    \
                 ROLLWALK_UPDATE_DOCS=1 cargo test -p rollwalk-firmware\n"
            );
        }
    }
}

/// Table in Markdown.
fn table(head: &str, rows: impl IntoIterator<Item = String>) -> String {
    let rule = "|---".repeat(head.matches('|').count() - 1) + "|";
    iter::once(head.to_owned()).chain([rule]).chain(rows).collect::<Vec<_>>().join("\n")
}

/// Codes and names of an enumeration's values.
fn listed<T: Copy + Debug>(all: &[T], code: fn(T) -> u8) -> String {
    let values: Vec<_> = all.iter().map(|&value| format!("{} {value:?}", code(value))).collect();
    values.join(", ")
}

/// States by their torque.
fn states() -> String {
    let listed = |torque: Torque| {
        let states = State::ALL.iter().filter(|state| state.torque() == torque);
        states.map(|state| format!("{state:?}")).collect::<Vec<_>>().join(", ")
    };
    let [off, driven, damped] = [Torque::Off, Torque::Driven, Torque::Damped].map(listed);
    format!("Torque: off in {off}; driven in {driven}; damped in {damped}")
}

/// Events, in the order in which the controller handles events that arise together.
fn by_severity() -> Vec<Event> {
    let mut events = Event::ALL.to_vec();
    events.sort_by_key(|event| Reverse(event.severity()));
    events
}

/// States and events that lead to the same state by the same action.
type Transition = (Vec<State>, Vec<Event>, (State, Action));

/// Transitions. A row contains all states and events that lead to the same state by the same action.
fn transitions() -> String {
    let steps = |event: Event| {
        let lead = State::ALL.iter().map(move |&state| (state, step(state, event)));
        lead.filter(|&(state, to)| to != (state, Action::None))
    };
    let mut rows: Vec<Transition> = Vec::new();
    for event in by_severity() {
        for (first, to) in steps(event) {
            let states: Vec<_> =
                steps(event).filter(|step| step.1 == to).map(|(state, _)| state).collect();
            if states[0] != first {
                continue; // in the row of the first state
            }
            match rows.iter_mut().find(|row| row.0 == states && row.2 == to) {
                Some((_, events, _)) => events.push(event),
                None => rows.push((states, vec![event], to)),
            }
        }
    }
    let row = |(states, events, (next, action)): Transition| {
        let events: Vec<_> = events.iter().map(|event| format!("{event:?}")).collect();
        let states: Vec<_> = states.iter().map(|state| format!("{state:?}")).collect();
        let states = match states.len() == State::ALL.len() {
            true => "every".to_owned(),
            false => states.join(", "),
        };
        format!("| {states} | {} | {next:?} | {action:?} |", events.join(", "))
    };
    table("| state | event | next | action |", rows.into_iter().map(row))
}

/// Events of LOG, with the bits of the faults that they raise.
fn events() -> String {
    let row = |event: &Event| {
        let bit = event.fault().map_or(String::new(), |fault| format!(" (bit {})", fault.code()));
        format!("{} {event:?}{bit}", event.code())
    };
    Event::ALL.iter().map(row).collect::<Vec<_>>().join(", ")
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
    let rows = sources[0].lines().filter(|line| line.starts_with("//! | "));
    let scars: Vec<&str> = rows.skip(1).collect();
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

const RUNBOOK: &str = include_str!("../../../docs/faults.md");

/// Title and text of each fault's section.
fn sections() -> Vec<(&'static str, &'static str)> {
    let (_, faults) = RUNBOOK.split_once("<!-- faults -->\n\n## ").expect("the faults");
    faults.split("\n## ").map(|s| s.split_once('\n').expect("a title and a text")).collect()
}

#[test]
fn the_runbook_has_a_section_for_each_bit_with_the_events_that_raise_it() {
    let titles: Vec<_> = sections().iter().map(|(title, _)| *title).collect();
    let expected: Vec<_> = (0..16)
        .map(|bit| match Fault::from_code(bit) {
            Some(fault) => format!("{bit} {fault:?}"),
            None => format!("{bit} reserved"),
        })
        .collect();
    assert_eq!(titles, expected);
    for (bit, (title, text)) in (0..16).zip(sections()) {
        let raises = |e: &Event| e.fault().is_some_and(|fault| fault.code() == bit);
        let mut expected: Vec<_> = Event::ALL
            .iter()
            .filter(|e| raises(e))
            .map(|&e| format!("Event: {e:?}, severity {}.", severity(e)))
            .collect();
        if expected.is_empty() {
            expected.push("Event: none.".into());
        }
        let stated: Vec<_> = text.lines().filter(|line| line.starts_with("Event: ")).collect();
        assert_eq!(stated, expected, "{title}");
    }
}

fn severity(event: Event) -> &'static str {
    match event.severity() {
        Severity::None | Severity::Notice => panic!("{event:?} is no fault"),
        Severity::Return => "return",
        Severity::Damp => "damp",
        Severity::TorqueOff => "torque off",
        Severity::EStop => "stop",
    }
}

#[test]
fn each_section_of_the_runbook_says_what_an_operator_needs() {
    for (title, text) in sections().into_iter().filter(|(title, _)| !title.ends_with("reserved")) {
        let mut rest = text;
        for part in
            ["Means", "The robot", "FAULT reports", "Look at, in this order", "Go on", "Do not"]
        {
            let (_, after) = rest
                .split_once(&format!("\n**{part}:**"))
                .unwrap_or_else(|| panic!("{title}: no {part}, or in another place"));
            rest = after;
        }
        assert!(text.contains("\n1. "), "{title}: nothing to look at");
    }
}

/// Checks that each section of docs/faults.md names channel and value of a report as [`Fault::description`] does.
#[test]
fn the_runbook_says_what_each_fault_reports() {
    for (fault, (_, text)) in (0..).map(Fault::from_code).zip(sections()) {
        let Some(fault) = fault else { continue };
        let Description { channel, value, .. } = fault.description();
        let contents = match (channel, value) {
            ("", None) => "neither channel nor value".to_owned(),
            ("", Some(value)) => format!("value ({value})"),
            (channel, value) => {
                format!("channel ({channel}), value ({})", value.expect("comes with a channel"))
            }
        };
        let expected = format!("\n**FAULT reports:** {contents}.");
        assert!(text.contains(&expected), "{fault:?}: docs/faults.md lacks{expected}");
    }
}

/// Settings appear under their names, and the documented values are the defaults.
#[test]
fn the_runbook_speaks_of_settings_that_there_are() {
    let settings = format!("{:?}", Settings::default());
    let quoted = RUNBOOK.split('`').skip(1).step_by(2);
    let units = ["_us", "_rad", "_rad_s", "_hz", "_ticks"];
    let named: Vec<_> = quoted.filter(|n| units.iter().any(|unit| n.ends_with(unit))).collect();
    assert!(named.len() > 10, "{named:?}");
    for name in named.into_iter().filter(|&name| name != "now_us") {
        assert!(settings.contains(&format!(" {name}: ")), "there is no setting {name}");
    }
    let Settings {
        heartbeat_timeout_us: 250_000,
        silent_ticks: 12,
        control_hz: 120,
        follow_patience_us: 500_000,
        align_patience_us: 1_000_000,
        overrun_us: 50_000,
        tilt_patience_us: 100_000,
        follow_tolerance_rad,
        align_tolerance_rad,
        out_of_range_rad,
        lean_rad,
        tip_rad,
        ..
    } = Settings::default()
    else {
        panic!("docs/faults.md tells other values: {settings}")
    };
    let angles = [follow_tolerance_rad, align_tolerance_rad, out_of_range_rad, lean_rad, tip_rad];
    assert_eq!(angles, [0.8, 0.35, 0.2, 0.35, 0.8], "docs/faults.md tells other values");
}
