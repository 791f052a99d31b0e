//! Every example in a help text is a command line that is understood.

use crate::{command_line, sim};

/// The commands of a help text: what follows two blanks or a `#` explains, what follows a `|`, `<` or `>` is the
/// shell's.
fn examples(help: &str) -> Vec<Vec<String>> {
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

/// Help texts of a command and of those below it.
fn helps(command: &clap::Command, into: &mut Vec<String>) {
    into.extend(command.get_after_long_help().map(ToString::to_string));
    command.get_subcommands().for_each(|below| helps(below, into));
}

#[test]
fn words_end_where_the_explanation_or_the_shell_begins() {
    for (line, expected) in [
        ("rollwalk plan a.toml -v      every iteration", &["rollwalk", "plan", "a.toml", "-v"][..]),
        ("rollwalk gains reset # what the file says", &["rollwalk", "gains", "reset"]),
        ("rollwalk plot 'my plan.json' | less", &["rollwalk", "plot", "my plan.json"]),
    ] {
        assert_eq!(words(line), expected);
    }
}

/// Commands that have no example in their help or in that of the command that they are a part of.
fn without_examples(command: &clap::Command, typed: &str, above: &str) -> Vec<String> {
    let help = command.get_after_long_help().map_or_else(String::new, ToString::to_string);
    if command.has_subcommands() {
        let below = |below| (below, format!("{typed} {}", clap::Command::get_name(below)));
        let below = command.get_subcommands().map(below);
        return below.flat_map(|(below, typed)| without_examples(below, &typed, &help)).collect();
    }
    let is_of_it =
        |words: Vec<String>| format!("{} ", words.join(" ")).starts_with(&format!("{typed} "));
    let has_one = examples(&format!("{above}\n{help}")).into_iter().any(is_of_it);
    if has_one { Vec::new() } else { vec![typed.to_owned()] }
}

#[test]
fn every_command_has_an_example() {
    assert_eq!(without_examples(&command_line(), "rollwalk", ""), [""; 0]);
}

#[test]
fn every_example_is_understood() {
    let mut texts = Vec::new();
    helps(&command_line(), &mut texts);
    helps(&sim::command_line(), &mut texts);
    let examples: Vec<_> = texts.iter().flat_map(|text| examples(text)).collect();
    assert!(examples.len() > 60, "{} examples", examples.len());
    for words in examples {
        let command = if words[0] == "rollwalk-sim" { sim::command_line() } else { command_line() };
        let parsed = command.try_get_matches_from(&words);
        assert!(parsed.is_ok(), "{}: {}", words.join(" "), parsed.unwrap_err());
    }
}
