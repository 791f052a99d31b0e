//! Check of doc comments: each begins with a noun of the field or a verb in the third person, and its lines fit a screen.

use crate::checkout::TextFile;

/// First words that postpone the noun of the field.
const REFUSED: [&str; 52] = [
    "All", "And", "Any", "As", "At", "Between", "Both", "But", "By", "Each", "Every", "For",
    "From", "He", "Here", "How", "If", "In", "It", "Its", "No", "None", "Not", "Nothing", "Of",
    "On", "One", "Only", "She", "So", "Some", "Than", "That", "Their", "Them", "There", "These",
    "They", "This", "Those", "To", "What", "When", "Where", "Whether", "Which", "Who", "Whose",
    "Why", "With", "Without", "You",
];
/// Maximum length of a comment line with its indentation, characters.
const WIDTH: usize = 130;

/// Doc comments that begin with a refused word, and lines that are too long.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    let mut found = Vec::new();
    for file in files.iter().filter(|file| file.path.ends_with(".rs")) {
        let mut continues = false;
        for (number, line) in file.text.lines().enumerate() {
            let place = || format!("{}:{}", file.path, number + 1);
            let text = line.trim_start();
            let Some(text) = text.strip_prefix("///").or_else(|| text.strip_prefix("//!")) else {
                continues = false;
                continue;
            };
            // Rows of tables and links do not wrap.
            let wraps = !text.contains('|') && !text.contains("](") && !text.contains("://");
            if wraps && line.chars().count() > WIDTH {
                found.push(format!("{}: wrap this comment at {WIDTH} characters", place()));
            }
            let word = text.trim_start_matches(|c: char| !c.is_alphanumeric());
            let word = word.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default();
            if !continues && REFUSED.contains(&word) {
                let instead = "begin with a noun of the field or a verb in the third person";
                found.push(format!("{}: \"{word}\": {instead}", place()));
            }
            continues = true;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::WIDTH;
    use crate::checkout::file;

    #[test]
    fn first_words_and_long_lines_are_refused() {
        let long = "a".repeat(WIDTH);
        let text = format!(
            "//! Poses.\n\n/// What it is.\nfn a() {{}}\n/// Pose of the body.\n/// What follows continues.\nfn b() {{}}\n    /// `x`: fine\n\
             /// {long}\n/// | {long} |\n// What a plain comment begins with is free.\n/// Whatever\n"
        );
        let found = super::violations(&[file("a/src/lib.rs", &text), file("a.md", &text)]);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("a/src/lib.rs:3: \"What\""), "{found:?}");
        assert!(found[1].starts_with("a/src/lib.rs:9: wrap"), "{found:?}");
    }
}
