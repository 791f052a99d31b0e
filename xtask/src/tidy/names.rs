//! Check of the names of types and functions: nouns and verbs of the field, not words that fit everything.

use crate::checkout::TextFile;

/// Refused names, with suggestions.
const REFUSED: [(&str, &str); 29] = [
    ("Asked", "Request"),
    ("Found", "Match, Result"),
    ("Heard", "ReceivedFrame"),
    ("Kept", "Stored, Bounded"),
    ("Looked", "SearchOutcome"),
    ("Meant", "Target"),
    ("Place", "Location, Position, Pose"),
    ("Said", "Output"),
    ("Spot", "Geometry"),
    ("Thing", "the noun of the field"),
    ("Told", "Sent, Command"),
    ("Wanted", "Request"),
    ("Way", "Displacement, Path"),
    ("Wish", "Request"),
    ("found", "find, result"),
    ("hear", "receive"),
    ("heard", "received"),
    ("look", "update, check, poll"),
    ("looked", "checked"),
    ("meant", "target"),
    ("said", "output"),
    ("say", "print, notify, report"),
    ("says", "reports"),
    ("tell", "send, report, suggest"),
    ("told", "sent, commanded"),
    ("want", "request"),
    ("wanted", "requested, expected"),
    ("wish", "request"),
    ("wishes", "requests"),
];
/// Keywords before the name of an item.
const KEYWORDS: [&str; 6] = ["struct", "enum", "trait", "type", "union", "fn"];

/// Definitions with refused names.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    let mut found = Vec::new();
    for file in files.iter().filter(|file| file.path.ends_with(".rs")) {
        // The test of this file defines refused names.
        if file.path == "xtask/src/tidy/names.rs" {
            continue;
        }
        for (number, line) in file.text.lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            let mut words = code.split(|c: char| !c.is_alphanumeric() && c != '_' && c != '"');
            while let Some(word) = words.next() {
                if !KEYWORDS.contains(&word) {
                    continue;
                }
                let Some(name) = words.next() else { continue };
                if let Some((_, instead)) = REFUSED.iter().find(|(refused, _)| *refused == name) {
                    let place = format!("{}:{}", file.path, number + 1);
                    found.push(format!("{place}: `{name}` fits everything; perhaps: {instead}"));
                }
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn definitions_with_refused_names_are_found() {
        let text = "pub struct Told;\nfn told() {} // fn say()\nlet told = find_it();\nfn untold(says: u8) {}\n";
        let found = super::violations(&[file("a/src/lib.rs", text), file("a.md", text)]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("a/src/lib.rs:1: `Told`"), "{found:?}");
        assert!(found[1].starts_with("a/src/lib.rs:2: `told`"), "{found:?}");
    }
}
