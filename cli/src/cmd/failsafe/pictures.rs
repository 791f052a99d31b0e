//! The whole machine at a glance: tables for people and documents, a graph for Graphviz.

use super::names::words;
use crate::output::Table;
use rollwalk_firmware::safety::{Action, EVENTS, Event, STATES, State, StateMachine, Torque, step};
use std::fmt::Write;

/// All states, with a mark at the present one.
pub fn states(here: State) -> String {
    let mut table = Table::new(["state", "torque", "motions", ""]);
    for state in STATES {
        table.row([
            format!("{state:?}"),
            words(state.torque()),
            if state.accepts_motions() { "accepted" } else { "refused" }.into(),
            if state == here { "here" } else { "" }.into(),
        ]);
    }
    table.render()
}

/// The events that would change something now, and where they lead.
pub fn events(machine: StateMachine) -> String {
    let mut table = Table::new(["event", "severity", "next", "action", "fault"]);
    for event in EVENTS.into_iter().filter(|&event| machine.can_arise(event)) {
        let mut next = machine;
        let action = next.handle(event);
        if next != machine {
            let fault = event.fault();
            table.row([
                format!("{event:?}"),
                words(event.severity()),
                format!("{:?}", next.state()),
                format!("{action:?}"),
                fault.map_or_else(String::new, |f| format!("{} {}", f.code(), words(f))),
            ]);
        }
    }
    table.render()
}

/// Leads to the same from every state.
fn everywhere(event: Event) -> bool {
    STATES.iter().all(|&state| step(state, event) == step(State::Boot, event))
}

/// What is not "nothing happens", state by state.
fn transitions(state: State) -> impl Iterator<Item = (Event, State, Action)> {
    let led = EVENTS.into_iter().filter(|&event| !everywhere(event)).map(move |event| {
        let (next, action) = step(state, event);
        (event, next, action)
    });
    led.filter(move |&(_, next, action)| (next, action) != (state, Action::None))
}

/// The table of `docs/playback-and-safety.md`.
pub fn table() -> String {
    let mut table = String::from("| state | event | next | action |\n|---|---|---|---|");
    for event in EVENTS.into_iter().filter(|&event| everywhere(event)) {
        let (next, action) = step(State::Boot, event);
        let _ = write!(table, "\n| every | {event:?} | {next:?} | {action:?} |");
    }
    for state in STATES {
        for (event, next, action) in transitions(state) {
            let _ = write!(table, "\n| {state:?} | {event:?} | {next:?} | {action:?} |");
        }
    }
    table
}

/// The machine for Graphviz: states coloured by torque, events with the same outcome on one arrow.
pub fn dot() -> String {
    let mut text = String::from(
        "digraph safety {\n  node [shape=box, style=\"rounded,filled\"]\n  every [label=\"every state\", style=dashed]\n",
    );
    for state in STATES {
        let colour = match state.torque() {
            Torque::Off => "white",
            Torque::Damped => "khaki",
            Torque::Driven => "lightsalmon",
        };
        let _ = writeln!(text, "  {state:?} [fillcolor={colour}]");
    }
    let everywhere = EVENTS.into_iter().filter(|&event| everywhere(event)).map(|event| {
        let (next, action) = step(State::Boot, event);
        (event, next, action)
    });
    arrows("every", everywhere, &mut text);
    for state in STATES {
        arrows(&format!("{state:?}"), transitions(state), &mut text);
    }
    text.push('}');
    text
}

fn arrows(
    from: &str,
    transitions: impl Iterator<Item = (Event, State, Action)>,
    text: &mut String,
) {
    let mut arrows: Vec<(State, Action, Vec<String>)> = Vec::new();
    for (event, next, action) in transitions {
        let name = format!("{event:?}");
        match arrows.iter_mut().find(|(to, does, _)| (*to, *does) == (next, action)) {
            Some((_, _, events)) => events.push(name),
            None => arrows.push((next, action, vec![name])),
        }
    }
    for (next, action, events) in arrows {
        let does = if action == Action::None { String::new() } else { format!("\\n/ {action:?}") };
        let _ = writeln!(text, "  {from} -> {next:?} [label=\"{}{does}\"]", events.join("\\n"));
    }
}
