//! Parser of command lines that checks the input files first: a missing file is reported before a missing option.

use crate::files;
use crate::inputs;
use crate::kind::Kind;
use clap::error::ErrorKind;
use clap::{ArgMatches, FromArgMatches};
use std::ffi::OsString;
use std::path::Path;

/// Parses `words`, which begin with the name of the program. Help texts, and errors that `explain` completes, end the process.
///
/// # Errors
/// Returns an error if an input file does not exist or is a folder. If an argument is missing, an input file of another kind is
/// an error, too.
pub fn parse<C: FromArgMatches>(
    command: clap::Command,
    words: &[OsString],
    explain: impl FnOnce(clap::Error) -> clap::Error,
) -> miette::Result<C> {
    let parsed = command.clone().try_get_matches_from(words);
    let parsed = parsed.and_then(|matches| C::from_arg_matches(&matches));
    match &parsed {
        Ok(_) => check(command, words, false)?,
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => {
            check(command, words, true)?;
        }
        Err(_) => {}
    }
    Ok(parsed.unwrap_or_else(|error| explain(error).exit()))
}

/// Checks the input files among `words`, and their kinds if `reads`.
fn check(command: clap::Command, words: &[OsString], reads: bool) -> miette::Result<()> {
    let command = command.ignore_errors(true);
    let Ok(matches) = command.clone().try_get_matches_from(words) else { return Ok(()) };
    let (mut command, mut matches) = (&command, &matches);
    while let Some((name, below)) = matches.subcommand() {
        let Some(found) = command.find_subcommand(name) else { break };
        (command, matches) = (found, below);
    }
    for (path, kind) in inputs_of(command, matches) {
        files::check(path, kind)?;
        if reads {
            inputs::expect(path, kind)?;
        }
    }
    Ok(())
}

/// Input files among the positional arguments of a command, with the kinds that it expects.
fn inputs_of<'m>(
    command: &clap::Command,
    matches: &'m ArgMatches,
) -> impl Iterator<Item = (&'m Path, Kind)> {
    command.get_positionals().flat_map(|arg| {
        let id = arg.get_id().as_str();
        let paths = matches.try_get_raw(id).ok().flatten().into_iter().flatten().map(Path::new);
        let names = arg.get_value_names().unwrap_or_default().to_vec();
        paths.filter_map(move |path| Some((path, Kind::of_argument(names.first()?, path)?)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::{Arg, value_parser};
    use std::path::PathBuf;

    fn error(words: &[&str]) -> Option<String> {
        let path = |id, name| Arg::new(id).value_name(name).value_parser(value_parser!(PathBuf));
        let sub = clap::Command::new("do")
            .arg(path("input", "MOTION.toml").required(true))
            .arg(path("output", "PLAN.json").short('o').required(true));
        let command = clap::Command::new("it").subcommand(sub);
        let words: Vec<_> = words.iter().map(OsString::from).collect();
        check(command, &words, true).err().map(|error| error.to_string())
    }

    #[test]
    fn an_input_is_checked_without_the_options_that_depend_on_it() {
        let missing = "there is no motion file (TOML) at wlk.toml";
        for words in [&["it", "do", "wlk.toml"][..], &["it", "do", "-o", "x/y", "wlk.toml"]] {
            assert_eq!(error(words).as_deref(), Some(missing));
        }
        let folder = tempfile::tempdir().unwrap();
        let of = |path: &Path| error(&["it", "do", path.to_str().unwrap()]);
        assert!(of(folder.path()).unwrap().contains("it is a folder"));
        let file = folder.path().join("pup.toml");
        std::fs::write(&file, rollwalk_shipped::text("robots/pup.toml").unwrap()).unwrap();
        assert!(of(&file).unwrap().ends_with("is a robot file, not a motion file"));
        std::fs::write(&file, "[footfalls]").unwrap();
        assert_eq!(of(&file), None);
        // Outputs, and commands without arguments, are not checked.
        assert_eq!(error(&["it", "do", "-o", "wlk.json"]), None);
        assert_eq!(error(&["it"]), None);
    }
}
