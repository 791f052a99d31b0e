//! A walk through the state machine: lines in, text out.

use super::names::{self, Wrong, words};
use super::{pictures, routes};
use rollwalk_firmware::safety::{
    Action, EVENTS, Event, EventSet, STATES, State, StateMachine, Torque, step,
};
use rollwalk_protocol::wire::{Fault, FaultBits};
use std::fmt::Write;

#[derive(Clone, Copy)]
enum Command {
    Status,
    Events,
    States,
    Why,
    Path,
    Clear,
    Back,
    Reset,
    From,
    Table,
    Dot,
    Help,
    Quit,
}

/// Every command as it is typed, and what it is for.
const COMMANDS: [(&str, Command, &str); 13] = [
    ("status", Command::Status, "state, torque, severity and latched faults"),
    ("events", Command::Events, "the events that would change something now, and where they lead"),
    ("states", Command::States, "all states"),
    ("why", Command::Why, "what led here, and what clears it"),
    ("path", Command::Path, "path STATE: the fewest events that lead to a state"),
    ("clear", Command::Clear, "whether faults can be cleared here, and which"),
    ("back", Command::Back, "takes the last line back"),
    ("reset", Command::Reset, "begins again"),
    ("from", Command::From, "from STATE: goes on in that state, without faults"),
    ("table", Command::Table, "all transitions, as a Markdown table"),
    ("dot", Command::Dot, "all transitions, as a graph for Graphviz"),
    ("help", Command::Help, "this list"),
    ("quit", Command::Quit, "ends"),
];

#[derive(Clone, Copy)]
enum Word {
    Command(Command),
    Event(Event),
}

/// What a line brought.
pub enum Reply {
    /// To be shown.
    Text(String),
    /// An empty line, or a remark.
    Nothing,
    /// The walk is over.
    Quit,
}

/// A transition that was taken, or a place that was gone to.
#[derive(Clone, Copy)]
struct Step {
    before: StateMachine,
    event: Option<(Event, Action)>,
    after: StateMachine,
}

/// The machine where it stands, and how it came there.
pub struct Session {
    start: State,
    machine: StateMachine,
    /// The steps of each line that has changed something.
    past: Vec<Vec<Step>>,
}

impl Session {
    /// Begins in a state, without faults.
    pub fn new(start: State) -> Self {
        Self { start, machine: StateMachine::new(start), past: Vec::new() }
    }

    /// Where it stands.
    pub fn state(&self) -> State {
        self.machine.state()
    }

    /// Carries a line out; one that is wrong changes nothing.
    pub fn obey(&mut self, line: &str) -> Result<Reply, Wrong> {
        let mut words = line.split_whitespace();
        let Some(first) = words.next().filter(|first| !first.starts_with('#')) else {
            return Ok(Reply::Nothing);
        };
        let rest: Vec<&str> = words.collect();
        let command = match names::pick("event or command", first, &vocabulary())? {
            Word::Command(command) => command,
            Word::Event(event) => return self.happen(event, &rest).map(Reply::Text),
        };
        let asked = match (command, &rest[..]) {
            (Command::Path | Command::From, [name]) => Some(names::find("state", name, STATES)?),
            (Command::Path | Command::From, _) => {
                let help = format!("for example `{first} Ready`");
                return Err(Wrong::new(format!("`{first}` needs one state after it"), help));
            }
            (_, []) => None,
            (_, [more, ..]) => {
                let help = format!("`{first}` stands alone; write `{more}` on a line of its own");
                return Err(Wrong::new(format!("`{first}` takes no `{more}`"), help));
            }
        };
        Ok(Reply::Text(match command {
            Command::Quit => return Ok(Reply::Quit),
            Command::Status => self.status(),
            Command::Events => pictures::events(self.machine),
            Command::States => pictures::states(self.state()),
            Command::Why => self.why(),
            Command::Path => self.path(asked.unwrap_or(self.start)),
            Command::Clear => self.clear(),
            Command::Back => self.back()?,
            Command::Reset | Command::From => self.go(asked.unwrap_or(self.start)),
            Command::Table => pictures::table(),
            Command::Dot => pictures::dot(),
            Command::Help => help(),
        }))
    }

    /// State, torque, severity and faults in a line.
    pub fn status(&self) -> String {
        let (state, latched) = (self.state(), self.machine.latched());
        format!(
            "{state:?}: torque {}, severity {}, faults {}{}",
            words(state.torque()),
            words(state.severity(latched)),
            names::faults(latched),
            if self.machine.is_holding() { ", SAFE is held" } else { "" },
        )
    }

    /// Events that arrive together.
    fn happen(&mut self, first: Event, more: &[&str]) -> Result<String, Wrong> {
        let mut events = vec![first];
        for word in more {
            events.push(names::find("event", word, EVENTS)?);
        }
        let mut said = Vec::new();
        let mut set = EventSet::default();
        let mut arrived = Vec::new();
        for event in events {
            if !self.machine.can_arise(event) {
                said.push(format!("{event:?} cannot arise here: {}", why_not(self.machine, event)));
            } else if !arrived.contains(&event) {
                arrived.push(event);
                set.insert(event);
            }
        }
        if arrived.len() > 1 {
            said.push("together; the most severe comes first:".into());
        }
        let mut steps = Vec::new();
        while let Some(event) = set.pop() {
            let before = self.machine;
            let action = self.machine.handle(event);
            let step = Step { before, event: Some((event, action)), after: self.machine };
            said.push(step.describe());
            steps.push(step);
        }
        if steps.iter().any(|step| step.before != step.after) {
            self.past.push(steps);
        }
        said.push(self.status());
        Ok(said.join("\n"))
    }

    fn go(&mut self, state: State) -> String {
        let before = self.machine;
        self.machine = StateMachine::new(state);
        self.past.push(vec![Step { before, event: None, after: self.machine }]);
        self.status()
    }

    fn back(&mut self) -> Result<String, Wrong> {
        let line = self.past.pop();
        let step = line.and_then(|steps| steps.first().copied()).ok_or_else(|| {
            let help = "nothing has changed since the beginning".into();
            Wrong::new("there is nothing to take back".into(), help)
        })?;
        self.machine = step.before;
        Ok(self.status())
    }

    fn why(&self) -> String {
        let steps = || self.past.iter().flatten().rev();
        let mut text = match steps().find(|step| step.before.state() != step.after.state()) {
            Some(step @ Step { event: Some((event, _)), .. }) => format!(
                "{}\n{event:?} is of severity {}.",
                step.describe(),
                words(event.severity())
            ),
            _ => format!("It began in {:?}.", self.state()),
        };
        let latched = self.machine.latched();
        for fault in latched.iter() {
            let raised_by = steps().find_map(|step| {
                let new = !step.before.latched().contains(fault);
                let (event, _) = step.event.filter(|(e, _)| new && e.fault() == Some(fault))?;
                Some(format!("{event:?} in {:?}", step.before.state()))
            });
            let by = raised_by.unwrap_or_default();
            let _ = write!(text, "\nFault {} {} is latched: {by}.", fault.code(), words(fault));
        }
        if latched.is_empty() {
            text.push_str("\nNo fault is latched: nothing has to be cleared.");
        } else {
            let cleared = routes::shortest(self.machine, |machine| machine.latched().is_empty());
            let _ = write!(text, "\nCleared by: {}.", list(&cleared.unwrap_or_default()));
        }
        text
    }

    fn path(&self, to: State) -> String {
        match routes::shortest(self.machine, |machine| machine.state() == to) {
            None => format!("No event leads to {to:?}, only switching the power on does."),
            Some(way) if way.is_empty() => format!("It is in {to:?}."),
            Some(way) => {
                let mut machine = self.machine;
                let steps = way.into_iter().map(|event| {
                    let before = machine;
                    let action = machine.handle(event);
                    Step { before, event: Some((event, action)), after: machine }.describe()
                });
                steps.collect::<Vec<_>>().join("\n")
            }
        }
    }

    fn clear(&self) -> String {
        let accepts = |state| step(state, Event::ClearConfirmed) != (state, Action::None);
        let latched = names::faults(self.machine.latched());
        if accepts(self.state()) {
            return format!(
                "CLEAR is accepted in {:?}; ClearConfirmed forgets: {latched}.",
                self.state()
            );
        }
        let way = routes::shortest(self.machine, |machine| accepts(machine.state()));
        let places: Vec<_> = STATES.into_iter().filter(|&state| accepts(state)).collect();
        format!(
            "CLEAR is refused in {:?}, only {} accept it. Latched: {latched}. The nearest way there: {}.",
            self.state(),
            places.iter().map(|state| format!("{state:?}")).collect::<Vec<_>>().join(" and "),
            list(&way.unwrap_or_default()),
        )
    }
}

impl Step {
    /// `Ready --HostLost--> Returning: RouteToSafe; fault 2 host lost latched`
    fn describe(&self) -> String {
        let (before, after) = (self.before, self.after);
        let Some((event, action)) = self.event else {
            return format!("{:?}", after.state());
        };
        let outcome = match action {
            Action::None if before.state() != after.state() => String::new(),
            Action::None => ": nothing to do".into(),
            action => format!(": {action:?}"),
        };
        let new = FaultBits(after.latched().0 & !before.latched().0);
        let gone = FaultBits(before.latched().0 & !after.latched().0);
        let faults = |set: FaultBits, what: &str| {
            let each = |f: Fault| format!("; fault {} {} {what}", f.code(), words(f));
            set.iter().map(each).collect::<String>()
        };
        format!(
            "{:?} --{event:?}--> {:?}{outcome}{}{}",
            before.state(),
            after.state(),
            faults(new, "latched"),
            faults(gone, "forgotten")
        )
    }
}

/// What can stand at the beginning of a line.
fn vocabulary() -> Vec<(String, Word)> {
    let commands =
        COMMANDS.iter().map(|(name, command, _)| ((*name).to_owned(), Word::Command(*command)));
    let events = EVENTS.into_iter().map(|event| (format!("{event:?}"), Word::Event(event)));
    commands.chain(events).collect()
}

fn list(events: &[Event]) -> String {
    events.iter().map(|event| format!("{event:?}")).collect::<Vec<_>>().join(", ")
}

/// Why the controller does not find an event to have happened.
fn why_not(machine: StateMachine, event: Event) -> String {
    let places: Vec<_> = STATES
        .into_iter()
        .filter(|&state| StateMachine::new(state).can_arise(event))
        .map(|state| format!("{state:?}"))
        .collect();
    match event {
        Event::HoldElapsed => "SAFE is not held; in Returning SafeReached begins it".into(),
        Event::FaultFree if machine.state() == State::TorqueOff => {
            format!("latched are faults {}", names::faults(machine.latched()))
        }
        _ if machine.state().torque() == Torque::Off && places.len() > 1 => {
            "without torque it is no fault, but arming is refused".into()
        }
        _ => format!("it does in {}", places.join(", ")),
    }
}

fn help() -> String {
    let width = COMMANDS.iter().map(|(name, ..)| name.len()).max().unwrap_or(0);
    let mut text = String::from("An event, or several that arrive together, by name; or:");
    for (name, _, what) in COMMANDS {
        let _ = write!(text, "\n  {name:width$}  {what}");
    }
    text
}
