//! Checks of the documents' commands against the command lines of their programs.

use super::document::Document;

/// Placeholder of a bus in the documents, which a user replaces by the bus of the robot.
const BUS_OF_THE_READER: &str = "BUS";

/// Splits a command into words, without its comment and without the programs that it is piped to.
pub fn words(line: &str) -> Result<Vec<String>, String> {
    let line = line.split(" | ").next().unwrap_or(line);
    shlex::split(line).ok_or_else(|| "a quote that does not end".into())
}

/// Returns name and value of an `export`.
pub fn exported(words: &[String]) -> Option<(String, String)> {
    let [export, setting] = words else { return None };
    let (name, value) = setting.split_once('=')?;
    (export == "export").then(|| (name.to_owned(), value.to_owned()))
}

/// Returns the command line of one of our programs, including the subcommands that `rollwalk` passes to `rollwalk-bench`.
fn command_line(program: Option<&str>) -> Option<clap::Command> {
    match program {
        Some("rollwalk") => {
            let [bench, explore] = rollwalk_bench::program::command_lines();
            let design = |design: clap::Command| {
                design.mut_subcommand("explore", |_| explore.name("explore"))
            };
            let rollwalk = rollwalk::command_line().mut_subcommand("design", design);
            Some(rollwalk.mut_subcommand("bench", |_| bench.name("bench")))
        }
        Some("rollwalk-sim") => Some(rollwalk::sim::command_line()),
        _ => None,
    }
}

/// Checks a command against the command line of its program; `bus` is the bus that the document has exported. Returns true if
/// the command is one of ours.
fn check_command(words: &[String], bus: Option<&str>) -> Result<bool, String> {
    let from_source = ["cargo", "run", "--release", "--"].map(String::from);
    let mut words = match words.strip_prefix(&from_source) {
        Some(words) => [&["rollwalk".to_owned()], words].concat(),
        None => words.to_vec(),
    };
    let Some(command) = command_line(words.first().map(String::as_str)) else {
        return Ok(false);
    };
    for word in words.iter_mut().filter(|word| *word == BUS_OF_THE_READER) {
        *word = "sim".into();
    }
    let below = |command, word| clap::Command::find_subcommand(command, word).unwrap_or(command);
    let innermost = words[1..].iter().fold(&command, below);
    let takes_bus = innermost.get_arguments().any(|one| one.get_long() == Some("bus"));
    if let (Some(bus), true) = (bus, takes_bus && !words.iter().any(|word| word == "--bus")) {
        words.extend(["--bus".into(), bus.into()]);
    }
    match command.try_get_matches_from(words) {
        Ok(_) => Ok(true),
        Err(error) => Err(error.to_string().lines().take(3).collect::<Vec<_>>().join(" ")),
    }
}

/// Returns the invalid commands of the documents, and the number of valid ones.
pub fn invalid_commands(documents: &[Document]) -> (Vec<String>, usize) {
    let (mut faults, mut checked) = (Vec::new(), 0);
    for document in documents {
        let mut bus = None;
        for block in document.blocks.iter().filter(|block| block.is_shell()) {
            let place = format!("{}:{}", document.path, block.line);
            let reason = block.mark.strip_prefix("not-run: ").unwrap_or_default();
            if !block.is_run() && reason.is_empty() {
                let mark = &block.mark;
                faults.push(format!("{place}: `{mark}` is no mark; `not-run: REASON` is"));
            }
            for (line, command) in block.commands() {
                let words = words(&command);
                if let Some((name, value)) = words.as_ref().ok().and_then(|words| exported(words))
                    && name == "ROLLWALK_BUS"
                {
                    bus = Some(value);
                }
                match words.and_then(|words| check_command(&words, bus.as_deref())) {
                    Ok(is_ours) => checked += usize::from(is_ours),
                    Err(why) => {
                        faults.push(format!("{}:{line}: `{command}`: {why}", document.path));
                    }
                }
            }
        }
    }
    (faults, checked)
}

/// Returns the command or option in a code span that its program lacks. `rollwalk plan --samples-fixed`, for example, names a
/// command and an option.
pub fn unknown(span: &str) -> Option<String> {
    let words: Vec<&str> = span.split_whitespace().collect();
    let command = command_line(words.first().copied())?;
    let mut innermost = &command;
    let mut has_arguments = false;
    for word in &words[1..] {
        if let Some(option) = word.strip_prefix("--") {
            let name = option.split('=').next().unwrap_or(option);
            let mut options = innermost.get_arguments().filter_map(|one| one.get_long());
            if !options.any(|long| long == name) && !["help", "version"].contains(&name) {
                return Some(format!("`{}` has no option `--{name}`", innermost.get_name()));
            }
            has_arguments = true;
        } else if let (Some(below), false) = (innermost.find_subcommand(word), has_arguments) {
            innermost = below;
        } else if innermost.has_subcommands()
            && !has_arguments
            && word.starts_with(|c: char| c.is_ascii_lowercase())
        {
            return Some(format!("`{}` has no command `{word}`", innermost.get_name()));
        } else {
            has_arguments = true;
        }
    }
    None
}
