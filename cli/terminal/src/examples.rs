//! Examples in help texts. Tests parse each of them with the program's own command line.

/// Extracts the command lines of a help text, without explanations (after two blanks or `#`) and without pipes and
/// redirections.
fn commands(help: &str) -> Vec<Vec<String>> {
    let help: String = help.split("\\\n").map(|part| part.trim_start_matches(' ')).collect();
    let lines = help.lines().filter_map(|line| line.strip_prefix("  "));
    let lines = lines.filter(|line| line.starts_with("rollwalk"));
    lines.map(words).collect()
}

fn words(line: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let (mut is_quoted, mut before) = (false, 'r');
    for c in line.chars() {
        match c {
            '\'' => is_quoted = !is_quoted,
            '#' | '|' | '<' | '>' if !is_quoted && before == ' ' => break,
            ' ' if !is_quoted && before == ' ' => break,
            ' ' if !is_quoted => words.push(String::new()),
            _ => words.last_mut().expect("it has a first word").push(c),
        }
        before = c;
    }
    words.retain(|word| !word.is_empty());
    words
}

/// Collects the help texts of a command and its subcommands.
fn helps(command: &clap::Command, into: &mut Vec<String>) {
    into.extend(command.get_after_long_help().map(ToString::to_string));
    command.get_subcommands().for_each(|below| helps(below, into));
}

/// Returns the examples in the help texts of a command and its subcommands, as lists of words.
pub fn of(command: &clap::Command) -> Vec<Vec<String>> {
    let mut texts = Vec::new();
    helps(command, &mut texts);
    texts.iter().flat_map(|text| commands(text)).collect()
}

/// Returns the commands, among `command` and its subcommands, whose help text has no example of them or of a subcommand.
///
/// `typed` is the command line that selects `command`.
pub fn missing(command: &clap::Command, typed: &str) -> Vec<String> {
    let help = command.get_after_long_help().map_or_else(String::new, ToString::to_string);
    let is_of_it =
        |words: Vec<String>| format!("{} ", words.join(" ")).starts_with(&format!("{typed} "));
    let has_one = commands(&help).into_iter().any(is_of_it);
    let own = (!has_one).then(|| typed.to_owned());
    let below = command.get_subcommands();
    let below = below.flat_map(|below| missing(below, &format!("{typed} {}", below.get_name())));
    own.into_iter().chain(below).collect()
}

#[cfg(test)]
mod tests {
    use super::words;

    #[test]
    fn words_end_where_the_explanation_or_the_shell_begins() {
        for (line, expected) in [
            (
                "rollwalk plan a.toml -v      every iteration",
                &["rollwalk", "plan", "a.toml", "-v"][..],
            ),
            ("rollwalk gains reset # what the file says", &["rollwalk", "gains", "reset"]),
            ("rollwalk plot 'my plan.json' | less", &["rollwalk", "plot", "my plan.json"]),
        ] {
            assert_eq!(words(line), expected);
        }
    }
}
