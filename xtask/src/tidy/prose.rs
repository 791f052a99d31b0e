//! Check of doc comments and Markdown for vague phrases, each with a suggested replacement.

use crate::checkout::TextFile;

/// Refused phrases in lower case, with their replacements.
const REFUSED: [(&str, &str); 14] = [
    ("told", "sent, commanded, reported, configured"),
    ("so often", "interval, period, rate"),
    ("to be said", "to send, to report"),
    ("to say by itself", "unsolicited"),
    ("says by itself", "unsolicited"),
    ("whoever", "the caller, the operator, the host, the drive"),
    ("somebody", "an operator, a program, a node"),
    ("nobody", "no operator, no program, no node"),
    ("anybody", "an operator, a program, a node"),
    ("who it is", "its identity"),
    ("who is there", "the controllers on the bus"),
    ("a wish", "a request"),
    ("all is well", "no fault"),
    ("is believed", "is accepted"),
];

/// Locations of refused phrases.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    let mut found = Vec::new();
    for file in files {
        let is_rust = file.path.ends_with(".rs");
        // History keeps its words, and this file lists them.
        let is_prose = file.path.ends_with(".md") && file.path != "CHANGELOG.md";
        if !(is_rust || is_prose) || file.path == "xtask/src/tidy/prose.rs" {
            continue;
        }
        let mut in_code_block = false;
        for (number, line) in file.text.lines().enumerate() {
            let line = line.trim_start();
            if is_prose && line.starts_with("```") {
                in_code_block = !in_code_block;
            }
            if in_code_block || is_rust && !(line.starts_with("///") || line.starts_with("//!")) {
                continue;
            }
            for (phrase, instead) in REFUSED.iter().filter(|(phrase, _)| contains(line, phrase)) {
                let place = format!("{}:{}", file.path, number + 1);
                found
                    .push(format!("{place}: \"{phrase}\" hides who does what; perhaps: {instead}"));
            }
        }
    }
    found
}

/// True if `line` contains `phrase` as whole words, outside of code spans.
fn contains(line: &str, phrase: &str) -> bool {
    // Every second piece between backticks is prose.
    line.to_lowercase().split('`').step_by(2).any(|prose| {
        prose.match_indices(phrase).any(|(at, _)| {
            let is_letter = |c: char| c.is_alphanumeric() || c == '_';
            !prose[..at].ends_with(is_letter) && !prose[at + phrase.len()..].starts_with(is_letter)
        })
    })
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn refused_phrases_are_found_where_documentation_stands() {
        let files = [
            file(
                "a/src/lib.rs",
                "//! What the drive is told.\nfn told() {} // told\n/// `told`, untold\n",
            ),
            file("docs/a.md", "Nobody acknowledges.\n```\nnobody\n```\n"),
            file("CHANGELOG.md", "nobody\n"),
        ];
        let found = super::violations(&files);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("a/src/lib.rs:1: \"told\""), "{found:?}");
        assert!(found[1].starts_with("docs/a.md:1: \"nobody\""), "{found:?}");
    }
}
