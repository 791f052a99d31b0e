//! `rollwalk failsafe`: walks the controller's safety state machine, which is the firmware's own code.

mod names;
mod pictures;
mod routes;
mod session;

use crate::{Exit, output};
use miette::{Diagnostic, miette};
use rollwalk_firmware::safety::{STATES, State};
use session::{Reply, Session};
use std::io::{self, BufRead, IsTerminal, Write};

/// Walk the safety state machine of the controller: what happens when the host is lost, and then?
///
/// Reads events and commands from the terminal or from standard input, one line after the other; `help`
/// lists the commands. Events on one line arrive together. With arguments, each one is a line.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk failsafe                                    walk by hand
  rollwalk failsafe ArmConfirmed Aligned HostLost why
  rollwalk failsafe --from Playing 'HostLost FeedbackLost'
  rollwalk failsafe --from EStopped 'path Ready'
  rollwalk failsafe dot | dot -Tsvg > safety.svg
  rollwalk failsafe < session.txt

Names need no capitals, and only as much of them as is unambiguous. A line that begins with # is a remark.
States, events and faults are described in docs/playback-and-safety.md and docs/faults.md.")]
pub struct Args {
    /// Lines to carry out instead of reading standard input: an event, several in quotes, or a command.
    #[arg(value_name = "LINE")]
    lines: Vec<String>,
    /// The state to begin in.
    #[arg(long, value_name = "STATE", default_value = "Disarmed", value_parser = state)]
    from: State,
}

fn state(given: &str) -> Result<State, String> {
    names::find("state", given, STATES).map_err(|unknown| match unknown.help() {
        Some(help) => format!("{unknown}; {help}"),
        None => unknown.to_string(),
    })
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let session = Session::new(args.from);
    if args.lines.is_empty() { read(session) } else { carry_out(session, &args.lines) }
}

/// All lines or, with one that is wrong, none.
fn carry_out(mut session: Session, lines: &[String]) -> miette::Result<Exit> {
    let mut said = Vec::new();
    for line in lines {
        match session.obey(line)? {
            Reply::Text(text) => said.push(text),
            Reply::Nothing => {}
            Reply::Quit => break,
        }
    }
    output::print(&said.join("\n"))?;
    Ok(Exit::Ok)
}

/// Line by line; a wrong one is told and ends nothing.
fn read(mut session: Session) -> miette::Result<Exit> {
    let by_hand = io::stdin().is_terminal();
    let mut input = io::stdin().lock();
    if by_hand {
        output::print(&format!("{}\n`help` lists what can be said.", session.status()))?;
    }
    loop {
        if by_hand {
            prompt(session.state());
        }
        let mut line = Vec::new();
        let read = input.read_until(b'\n', &mut line);
        if read.map_err(|error| miette!("cannot read standard input: {error}"))? == 0 {
            return Ok(Exit::Ok);
        }
        match session.obey(&String::from_utf8_lossy(&line)) {
            Ok(Reply::Text(text)) => output::print(&text)?,
            Ok(Reply::Nothing) => {}
            Ok(Reply::Quit) => return Ok(Exit::Ok),
            Err(wrong) => {
                let help = wrong.help().map(|help| format!("; {help}")).unwrap_or_default();
                output::say(format_args!("{wrong}{help}"));
            }
        }
    }
}

fn prompt(state: State) {
    let mut stdout = io::stdout().lock();
    // Without a prompt one can still type; a closed output shows with the next result.
    let _ = write!(stdout, "{state:?}> ").and_then(|()| stdout.flush());
}
