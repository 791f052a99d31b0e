//! Help for words that users try as commands, and for missing or wrong arguments.
//!
//! clap suggests commands by spelling alone: for `status` it would suggest `pause`, which stops a motion.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::{shipped, spelling};
use std::path::Path;

const PLAY: &str = "arm a robot and play a motion with `rollwalk send --arm MOTION`, or by keys with `rollwalk \
     console`";
const STATE: &str = "print the state of a robot with `rollwalk doctor`, or all changes of its state with `rollwalk \
     monitor`";
const STOP: &str = "return to the safe pose with `rollwalk return`, and also switch torque off \
                    with `rollwalk disarm`; switch torque off at once with `rollwalk estop`";

const SIMULATE: &str = "simulate a robot on a bus with the program `rollwalk-sim`, and a plan or a motion library with \
     `rollwalk simulate`";
const TERRAIN: &str = "docs/stairs.md describes motions over stairs, slopes and past obstacles";
const LICENCE: &str = "the licence is MIT or Apache-2.0, at your choice";

/// Words, each with its suggestion.
const WORDS: [(&str, &str); 17] = [
    ("arm", PLAY),
    ("play", PLAY),
    ("run", PLAY),
    ("start", PLAY),
    ("info", STATE),
    ("state", STATE),
    ("status", STATE),
    ("halt", STOP),
    ("kill", STOP),
    ("stop", STOP),
    ("sim", SIMULATE),
    ("stairs", TERRAIN),
    ("terrain", TERRAIN),
    ("slope", TERRAIN),
    ("licence", LICENCE),
    ("license", LICENCE),
    ("version", "print the version with --version"),
];

/// Minimum number of letters of an abbreviation.
const ABBREVIATION_MIN: usize = 3;

/// Adds help to an error of the command line `root`, and removes suggestions that are not similar.
pub fn explain(mut error: clap::Error, root: &clap::Command) -> clap::Error {
    let tip = match error.kind() {
        ErrorKind::InvalidSubcommand => of_command(&mut error, root),
        ErrorKind::UnknownArgument => of_argument(&mut error),
        ErrorKind::MissingRequiredArgument => of_missing(&error),
        _ => None,
    };
    if let Some(tip) = tip {
        error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
    }
    error
}

/// Help for an unknown command: that of `WORDS`, the subcommands with its name, or a shipped file with its name.
fn of_command(error: &mut clap::Error, root: &clap::Command) -> Option<String> {
    let word = string(error, ContextKind::InvalidSubcommand)?;
    keep_similar(error, ContextKind::SuggestedSubcommand, &word);
    let topic = WORDS.iter().find(|(known, _)| *known == word).map(|(_, tip)| (*tip).to_owned());
    let mut near = Vec::new();
    add_near(root, root.get_name(), &word, &mut near);
    let least = near.iter().map(|(slips, _)| *slips).min();
    let is_typed = least == Some(0);
    let commands = || {
        let names = near.iter().filter(|(slips, _)| Some(*slips) == least);
        let names: Vec<_> = names.map(|(_, name)| format!("`{name}`")).collect();
        (!names.is_empty()).then(|| format!("the command is {}", names.join(" or ")))
    };
    let file = || {
        let kinds = [("rollwalk plan", Kind::Motion), ("rollwalk robot check", Kind::Robot)];
        let of = |kind: Kind| kind.shipped().find(|path| path.file_stem() == Some(word.as_ref()));
        let found = kinds.into_iter().find_map(|(command, kind)| Some((command, of(kind)?)));
        found.map(|(command, file)| format!("type `{command} {}`", file.display()))
    };
    let is_similar = error.get(ContextKind::SuggestedSubcommand).is_some();
    let exact = topic.or_else(|| commands().filter(|_| is_typed)).or_else(file);
    let tip = exact.or_else(|| commands().filter(|_| !is_similar))?;
    error.remove(ContextKind::SuggestedSubcommand);
    Some(tip)
}

/// Help for an unknown argument: the library of the robot that was given to `demo`.
fn of_argument(error: &mut clap::Error) -> Option<String> {
    let given = string(error, ContextKind::InvalidArg)?;
    if given.starts_with('-') {
        keep_similar(error, ContextKind::SuggestedArg, &given);
        return None;
    }
    let ContextValue::StyledStr(usage) = error.get(ContextKind::Usage)? else { return None };
    if !usage.to_string().contains("rollwalk demo") {
        return None;
    }
    let library = shipped::library_of(Path::new(&given)).unwrap_or(Path::new(&given));
    Some(format!("give a library file with --library, such as --library {}", library.display()))
}

/// Help for a missing argument.
fn of_missing(error: &clap::Error) -> Option<String> {
    let ContextValue::Strings(missing) = error.get(ContextKind::InvalidArg)? else { return None };
    let lacks = |name: &str| missing.iter().any(|arg| arg.starts_with(name));
    let tips = [
        (
            "--bus ",
            "add the bus of the robot: --bus sim for a robot of `rollwalk-sim`, otherwise for \
             example --bus can:can0",
        ),
        ("--with ", "write a first side file with --template SIDE.toml, and complete it"),
    ];
    tips.into_iter().find(|(name, _)| lacks(name)).map(|(_, tip)| tip.to_owned())
}

/// Adds the full names of the subcommands of which `word` may be a misspelling, with the number of wrong letters.
fn add_near(command: &clap::Command, path: &str, word: &str, into: &mut Vec<(usize, String)>) {
    for below in command.get_subcommands() {
        let name = format!("{path} {}", below.get_name());
        add_near(below, &name, word, into);
        into.extend(spelling::slips(word, below.get_name()).map(|slips| (slips, name)));
    }
}

/// Value of an error that is a string.
fn string(error: &clap::Error, kind: ContextKind) -> Option<String> {
    match error.get(kind)? {
        ContextValue::String(text) => Some(text.clone()),
        _ => None,
    }
}

/// Removes the suggestions that are neither a correction nor a completion of the given word.
fn keep_similar(error: &mut clap::Error, kind: ContextKind, given: &str) {
    let suggested = match error.remove(kind) {
        Some(ContextValue::String(one)) => vec![one],
        Some(ContextValue::Strings(all)) => all,
        _ => return,
    };
    let letters = |word: &str| word.trim_start_matches('-').to_owned();
    let given = letters(given);
    let is_similar = |word: &String| {
        let word = letters(word);
        let is_short = given.len() >= ABBREVIATION_MIN && word.starts_with(&given);
        is_short || spelling::slips(&given, &word).is_some()
    };
    let kept: Vec<_> = suggested.into_iter().filter(is_similar).collect();
    // An option has one suggestion, a command any number.
    let value = match (&kept[..], kind) {
        ([], _) => return,
        ([one, ..], ContextKind::SuggestedArg) => ContextValue::String(one.clone()),
        _ => ContextValue::Strings(kept),
    };
    error.insert(kind, value);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line;

    fn error_text(word: &str) -> String {
        error_of(&[word])
    }

    fn error_of(words: &[&str]) -> String {
        let words = std::iter::once("rollwalk").chain(words.iter().copied());
        let error = command_line().try_get_matches_from(words).unwrap_err();
        explain(error, &command_line()).to_string()
    }

    #[test]
    fn words_are_no_commands_and_name_commands_that_there_are() {
        let commands = command_line();
        let is_command = |word: &str| commands.find_subcommand(word).is_some();
        for (word, tip) in WORDS {
            assert!(!is_command(word), "{word}");
            for named in tip.split('`').filter_map(|part| part.strip_prefix("rollwalk ")) {
                assert!(named.split(' ').next().is_some_and(is_command), "{named}");
            }
            let said = error_text(word);
            assert!(said.contains(tip) && !said.contains("similar"), "{said}");
        }
    }

    #[test]
    fn only_slips_of_the_fingers_have_similar_commands() {
        assert!(error_text("plann").contains("'plan'"));
        assert!(error_text("monit").contains("'monitor'"));
        assert!(error_of(&["plan", "a.toml", "--iteration", "3"]).contains("'--iterations'"));
        for word in ["balance", "stares", "concole-x", "torque"] {
            let said = error_text(word);
            assert!(!said.contains("tip:"), "{said}");
        }
    }

    #[test]
    fn names_of_subcommands_and_shipped_files_lead_to_commands() {
        for (word, tip) in [
            ("build", "the command is `rollwalk library build`"),
            ("check", "the command is `rollwalk robot check` or `rollwalk design check`"),
            ("chek", "the command is `rollwalk robot check` or `rollwalk design check`"),
            ("walk", "type `rollwalk plan motions/walk.toml`"),
            ("pup", "type `rollwalk robot check robots/pup.toml`"),
        ] {
            let said = error_text(word);
            assert!(said.contains(tip) && !said.contains("similar"), "{said}");
        }
    }

    #[test]
    fn missing_and_wrong_arguments_are_shown_right() {
        for robot in ["robots/pup.toml", "pup"] {
            let said = error_of(&["demo", robot]);
            assert!(said.contains("--library motions/pup_library.toml"), "{said}");
        }
        let said = error_of(&["demo", "my.library.toml"]);
        assert!(said.contains("--library my.library.toml"), "{said}");
        assert!(error_of(&["flash", "a.rwl"]).contains("--bus sim"));
        let said = error_of(&["robot", "import", "a.urdf", "-o", "a.toml"]);
        assert!(said.contains("--template SIDE.toml, and complete it"), "{said}");
    }
}
