//! Check of the last commit's subject: imperative, and short enough for one line of a log.

use crate::shell;

/// Maximum length of a subject, characters.
const LENGTH: usize = 72;

/// Faults of the last commit's subject; empty without git.
pub fn violations() -> Vec<String> {
    let log =
        shell::output(&mut shell::command("git", &["log", "-1", "--no-merges", "--format=%s"]));
    log.ok().and_then(|subject| fault(subject.trim())).into_iter().collect()
}

fn fault(subject: &str) -> Option<String> {
    let first = subject.split(' ').next().unwrap_or_default();
    let why = if subject.chars().count() > LENGTH {
        format!("has {} characters; at most {LENGTH} are allowed", subject.chars().count())
    } else if subject.ends_with('.') {
        "ends with a full stop".to_owned()
    } else if !first.starts_with(char::is_uppercase) || first.ends_with(':') {
        "must begin with a capital letter, without a prefix".to_owned()
    } else if ["ed", "ing"].iter().any(|ending| first.ends_with(ending))
        && !IMPERATIVES.contains(&first)
    {
        format!("must begin with an imperative, not \"{first}\"")
    } else {
        return None;
    };
    Some(format!("subject of the last commit, \"{subject}\": {why}"))
}

/// Imperatives with the ending of a participle.
const IMPERATIVES: [&str; 6] = ["Bring", "Embed", "Feed", "Need", "Speed", "String"];

#[cfg(test)]
mod tests {
    use super::fault;

    #[test]
    fn imperatives_of_a_line_pass() {
        assert_eq!(fault("Resend late set-points in tests"), None);
        assert_eq!(fault("Feed wheel speeds forward"), None);
        for (subject, why) in [
            ("Added a test", "imperative"),
            ("Adding a test", "imperative"),
            ("docs: Add a page", "prefix"),
            ("add a page", "capital"),
            ("Add a page.", "full stop"),
            (&"Add words ".repeat(9), "characters"),
        ] {
            let found = fault(subject).expect("a fault");
            assert!(found.contains(why), "{found}");
        }
    }
}
