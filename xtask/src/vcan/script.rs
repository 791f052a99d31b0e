//! Shell script for the guest from a command line, its folder and its environment.

use std::path::Path;

/// Environment variables that are passed to the guest, in addition to those that begin with [`OURS`].
const PASSED_ON: [&str; 10] = [
    "PATH",
    "HOME",
    "LANG",
    "CI",
    "CARGO_HOME",
    "RUSTUP_HOME",
    "CARGO_TARGET_DIR",
    "PYTHONPATH",
    "RUST_BACKTRACE",
    "RUST_LOG",
];
const OURS: &str = "ROLLWALK_";

/// Returns a script that runs `command` in `folder`.
pub fn of(
    command: &[String],
    folder: &Path,
    environment: impl IntoIterator<Item = (String, String)>,
) -> String {
    let mut script = format!("cd {} || exit\n", quoted(&folder.to_string_lossy()));
    for (name, value) in environment {
        if PASSED_ON.contains(&name.as_str()) || name.starts_with(OURS) {
            script += &format!("export {name}={}\n", quoted(&value));
        }
    }
    let words: Vec<String> = command.iter().map(|word| quoted(word)).collect();
    script + "exec " + &words.join(" ") + "\n"
}

/// Quotes a word for the shell.
fn quoted(word: &str) -> String {
    format!("'{}'", word.replace('\'', r"'\''"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shell;

    #[test]
    fn the_shell_gets_folder_environment_and_every_word() {
        let words = ["printf", "%s|", "it's", "", "two words", "$HOME", "`a`\\\"\n*"];
        let command: Vec<String> = words.map(String::from).into();
        let mine = ("ROLLWALK_X".into(), "a 'b'".into());
        let script = of(&command, Path::new("/"), [mine, ("SECRET".into(), "no".into())]);
        assert!(!script.contains("SECRET"));
        let printed = shell::output(&mut shell::command("sh", &["-c", &script])).unwrap();
        assert_eq!(printed, "it's||two words|$HOME|`a`\\\"\n*|");

        let command: Vec<String> = ["sh", "-c", "pwd; echo $ROLLWALK_X"].map(String::from).into();
        let script = of(&command, Path::new("/"), [("ROLLWALK_X".into(), "a 'b'".into())]);
        let printed = shell::output(&mut shell::command("sh", &["-c", &script])).unwrap();
        assert_eq!(printed, "/\na 'b'\n");
    }
}
