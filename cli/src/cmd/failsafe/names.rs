//! Names of states, events and commands as people type them, and as they are read.

use miette::Diagnostic;
use rollwalk_protocol::wire::FaultBits;
use std::fmt::Debug;
use thiserror::Error;

/// A line that cannot be carried out, and what would be right.
#[derive(Debug, Error, Diagnostic)]
#[error("{what}")]
pub struct Wrong {
    what: String,
    #[help]
    help: String,
}

impl Wrong {
    /// With what is wrong and what would be right.
    pub fn new(what: String, help: String) -> Self {
        Self { what, help }
    }
}

/// The one of `known` that `given` names: without regard to capitals, and shortened as long as it stays
/// unambiguous.
pub fn find<T: Copy + Debug>(
    kind: &str,
    given: &str,
    known: impl IntoIterator<Item = T>,
) -> Result<T, Wrong> {
    let named = known.into_iter().map(|one| (format!("{one:?}"), one));
    pick(kind, given, &named.collect::<Vec<_>>())
}

/// As [`find`], of things that have their names beside them.
pub fn pick<T: Copy>(kind: &str, given: &str, known: &[(String, T)]) -> Result<T, Wrong> {
    let lower = given.to_lowercase();
    if let Some((_, one)) = known.iter().find(|(name, _)| name.to_lowercase() == lower) {
        return Ok(*one);
    }
    let begin: Vec<_> =
        known.iter().filter(|(name, _)| name.to_lowercase().starts_with(&lower)).collect();
    match begin[..] {
        [(_, one)] => Ok(*one),
        [] => Err(Wrong::new(format!("there is no {kind} `{given}`"), meant(&lower, known))),
        _ => {
            let names = quoted(begin.iter().map(|(name, _)| name.as_str()));
            Err(Wrong::new(format!("`{given}` can be {names}"), "write more of it".into()))
        }
    }
}

/// Which of `known` may have been meant, and what there is.
fn meant<T>(lower: &str, known: &[(String, T)]) -> String {
    let score = |name: &str| strsim::normalized_damerau_levenshtein(lower, &name.to_lowercase());
    let closest = known
        .iter()
        .map(|(name, _)| (score(name), name))
        // One slip in three letters is still a slip; more is another word.
        .filter(|(score, _)| *score >= 0.6)
        .max_by(|a, b| a.0.total_cmp(&b.0));
    let list = quoted(known.iter().map(|(name, _)| name.as_str()));
    match closest {
        Some((_, name)) => format!("did you mean `{name}`? known are: {list}"),
        None => format!("known are: {list}"),
    }
}

fn quoted<'a>(names: impl Iterator<Item = &'a str>) -> String {
    names.map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ")
}

/// A name of the code in words: `HostLost` is "host lost".
pub fn words(name: impl Debug) -> String {
    let name = format!("{name:?}");
    if name == "EStop" {
        return "emergency stop".into();
    }
    let mut text = String::new();
    for letter in name.chars() {
        if letter.is_uppercase() && !text.is_empty() {
            text.push(' ');
        }
        text.extend(letter.to_lowercase());
    }
    text
}

/// The faults of a set with their bits: "2 host lost, 5 tracking error".
pub fn faults(set: FaultBits) -> String {
    let all: Vec<_> = set.iter().map(|f| format!("{} {}", f.code(), words(f))).collect();
    if all.is_empty() { "none".into() } else { all.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_firmware::safety::{EVENTS, Event, STATES, State};

    #[test]
    fn names_are_found_shortened_and_in_any_case() {
        assert_eq!(find("event", "hostlost", EVENTS).unwrap(), Event::HostLost);
        let wrong = find("event", "HO", EVENTS).unwrap_err();
        assert_eq!(wrong.to_string(), "`HO` can be `HostLost`, `HoldElapsed`");
        assert_eq!(find("event", "hos", EVENTS).unwrap(), Event::HostLost);
        // The whole name of one that is the beginning of another.
        assert_eq!(find("event", "Aligned", EVENTS).unwrap(), Event::Aligned);
        assert_eq!(find("state", "pl", STATES).unwrap(), State::Playing);
    }

    #[test]
    fn slips_are_told_what_was_meant() {
        let wrong = find("event", "hsotlost", EVENTS).unwrap_err();
        assert_eq!(wrong.to_string(), "there is no event `hsotlost`");
        assert!(wrong.help.starts_with("did you mean `HostLost`? known are: `EStop`, `BusOff`"));
        assert!(find("event", "coffee", EVENTS).unwrap_err().help.starts_with("known are:"));
    }

    #[test]
    fn names_read_as_words() {
        use rollwalk_protocol::wire::Fault;
        assert_eq!(words(Fault::HostLost), "host lost");
        assert_eq!(words(Fault::EStop), "emergency stop");
        assert_eq!(faults(FaultBits::default()), "none");
        let two = FaultBits::default().with(Fault::Tilt).with(Fault::HostLost);
        assert_eq!(faults(two), "2 host lost, 7 tilt");
    }
}
