//! The tables of `docs/playback-and-safety.md` are those of the code, and `docs/faults.md` names its
//! faults, events and settings.

use std::fmt::Write;

use rollwalk_firmware::Settings;
use rollwalk_firmware::safety::{Action, EVENTS, Event, STATES, State, Torque, step};
use rollwalk_protocol::wire::{Fault, LogEvent, Severity};

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
        let mut expected: Vec<_> = EVENTS
            .into_iter()
            .filter(raises)
            .map(|e| format!("Event: {e:?}, severity {}.", severity(e)))
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
            ["Means", "The robot", "FAULT tells", "Look at, in this order", "Go on", "Do not"]
        {
            let (_, after) = rest
                .split_once(&format!("\n**{part}:**"))
                .unwrap_or_else(|| panic!("{title}: no {part}, or in another place"));
            rest = after;
        }
        assert!(text.contains("\n1. "), "{title}: nothing to look at");
    }
}

/// Settings appear by their names, and the documented values are the defaults.
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

/// The events of LOG and the faults that they are, with the codes of the link.
#[test]
fn the_table_of_events_is_that_of_the_code() {
    let page = include_str!("../../../docs/wire-format.md");
    let (_, table) = page.split_once("| event | | fault |\n|---|---|---|\n").expect("the table");
    let rows: Vec<Vec<&str>> = table
        .lines()
        .take_while(|line| line.starts_with('|'))
        .map(|line| line.split('|').map(str::trim).collect())
        .collect();
    assert_eq!(rows.len(), EVENTS.len());
    for (row, event) in rows.into_iter().zip(EVENTS) {
        let code = LogEvent::from(event).code();
        let name = row[2].split(':').next().unwrap_or_default();
        let fault = event.fault().map_or(String::new(), |fault| fault.code().to_string());
        let expected = (code.to_string(), format!("{event:?}"), fault);
        assert_eq!((row[1].to_owned(), name.to_owned(), row[3].to_owned()), expected);
    }
}
