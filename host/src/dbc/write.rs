//! Writer of the DBC format as read by cantools, SavvyCAN and Wireshark.

use super::{ByteOrder, Database, Message, NumberFormat, Presence, Signal};
use std::collections::BTreeSet;
use std::fmt::Write;

/// Node that stands for an unknown sender or receiver, spelled as in Vector's "DBC File Format Documentation".
const UNKNOWN_NODE: &str = "Vector__XXX";

pub(super) fn dbc(database: &Database) -> String {
    let mut text = String::new();
    let t = &mut text;
    // Writing to a string cannot fail.
    let _ = write!(t, "VERSION \"Rollwalk {}\"\n\nNS_ :\n\nBS_:\n\n", database.title);
    let _ = write!(t, "BU_: {}\n\n", database.nodes.join(" "));
    for message in &database.messages {
        let Message { id, name, len, .. } = message;
        let _ = writeln!(t, "BO_ {id} {name}: {len} {}", node(&message.sender));
        for signal in &message.signals {
            let _ = writeln!(t, " {} {}", definition(signal), node(&message.receiver));
        }
        t.push('\n');
    }
    comments(t, database);
    cycle_times(t, database);
    for (message, signal) in signals(database).filter(|(_, signal)| !signal.names.is_empty()) {
        let _ = write!(t, "VAL_ {} {}", message.id, signal.name);
        signal.names.iter().for_each(|(number, name)| {
            let _ = write!(t, " {number} \"{name}\"");
        });
        t.push_str(" ;\n");
    }
    for (message, signal) in signals(database).filter(|(_, s)| s.coding == NumberFormat::Float) {
        let _ = writeln!(t, "SIG_VALTYPE_ {} {} : 1;", message.id, signal.name);
    }
    text
}

fn node(name: &Option<String>) -> &str {
    name.as_deref().unwrap_or(UNKNOWN_NODE)
}

fn signals(database: &Database) -> impl Iterator<Item = (&Message, &Signal)> {
    database.messages.iter().flat_map(|message| message.signals.iter().map(move |s| (message, s)))
}

fn definition(signal: &Signal) -> String {
    let Signal { name, start, bits, scale, min, max, unit, .. } = signal;
    let presence = match signal.presence {
        Presence::Always => String::new(),
        Presence::Selector => " M".into(),
        Presence::When(value) => format!(" m{value}"),
    };
    let order = match signal.order {
        ByteOrder::Intel => 1,
        ByteOrder::Motorola => 0,
    };
    let sign = if signal.coding == NumberFormat::Unsigned { '+' } else { '-' };
    format!(
        "SG_ {name}{presence} : {start}|{bits}@{order}{sign} ({scale},0) [{min}|{max}] \"{unit}\""
    )
}

/// Writes the comments of each kind of message once, for the first address. Comments do not depend on the address.
fn comments(t: &mut String, database: &Database) {
    let mut described = BTreeSet::new();
    for message in database.messages.iter().filter(|message| described.insert(message.schema)) {
        let _ = writeln!(t, "CM_ BO_ {} \"{}\";", message.id, message.comment);
        for Signal { name, comment, .. } in message.signals.iter().filter(|s| !s.comment.is_empty())
        {
            let _ = writeln!(t, "CM_ SG_ {} {name} \"{comment}\";", message.id);
        }
    }
}

fn cycle_times(t: &mut String, database: &Database) {
    if database.messages.iter().all(|message| message.period_ms == 0) {
        return;
    }
    t.push_str(
        "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n",
    );
    for Message { id, period_ms, .. } in database.messages.iter().filter(|m| m.period_ms > 0) {
        let _ = writeln!(t, "BA_ \"GenMsgCycleTime\" BO_ {id} {period_ms};");
    }
}
