//! Words that people try as commands, and the commands that do it. What clap proposes is similar in its letters: `pause` for
//! `status`, which would stop a motion.

use clap::error::{ContextKind, ContextValue, ErrorKind};

const PLAY: &str =
    "`rollwalk send --arm MOTION` arms a robot and plays; `rollwalk console` does it by keys";
const STATE: &str =
    "`rollwalk doctor` says how a robot is; `rollwalk monitor` shows it all the time";
const STOP: &str = "`rollwalk return` goes back to the safe pose, `rollwalk disarm` then lets go of the torque; \
                    `rollwalk estop` takes it away at once";

/// Words with the commands that are meant.
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

/// Names the commands that are meant by a word that is none.
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

    fn said(word: &str) -> String {
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
            let said = said(word);
            assert!(said.contains(tip) && !said.contains("similar"), "{said}");
        }
    }

    #[test]
    fn slips_of_the_fingers_still_have_similar_commands() {
        assert!(said("plann").contains("'plan'"));
    }
}
