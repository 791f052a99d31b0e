//! Suggestions for words that users try as commands. The suggestions of clap compare only letters: `pause` for `status`, which
//! would stop a motion.

use clap::error::{ContextKind, ContextValue, ErrorKind};

const PLAY: &str = "arm a robot and play a motion with `rollwalk send --arm MOTION`, or by keys with `rollwalk \
     console`";
const STATE: &str = "print the state of a robot with `rollwalk doctor`, or all changes of its state with `rollwalk \
     monitor`";
const STOP: &str = "return to the safe pose with `rollwalk return`, and also switch torque off \
                    with `rollwalk disarm`; switch torque off at once with `rollwalk estop`";

/// Words, each with its suggestion.
const WORDS: [(&str, &str); 10] = [
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
];

/// Replaces clap's suggestion for an unknown command by that of `WORDS`.
pub fn explain(mut error: clap::Error) -> clap::Error {
    if error.kind() != ErrorKind::InvalidSubcommand {
        return error;
    }
    let Some(ContextValue::String(word)) = error.get(ContextKind::InvalidSubcommand) else {
        return error;
    };
    if let Some((_, tip)) = WORDS.iter().find(|(known, _)| known == word) {
        error.remove(ContextKind::SuggestedSubcommand);
        let tips = ContextValue::StyledStrs(vec![(*tip).into()]);
        error.insert(ContextKind::Suggested, tips);
    }
    error
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::command_line;

    fn error_text(word: &str) -> String {
        let error = command_line().try_get_matches_from(["rollwalk", word]).unwrap_err();
        explain(error).to_string()
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
    fn slips_of_the_fingers_still_have_similar_commands() {
        assert!(error_text("plann").contains("'plan'"));
    }
}
