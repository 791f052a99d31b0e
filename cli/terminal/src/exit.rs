//! Results of runs, with their exit codes for scripts.

use rollwalk_planner::report::Judgement;
use std::process::ExitCode;

/// Exit codes for the end of a help text: the codes that all commands share, and `exits` of this command. `Exit::Ok` in
/// `exits` marks a command that runs until a signal ends it.
pub(crate) fn help(exits: &[Exit]) -> String {
    let has = |exit| exits.contains(&exit);
    let done = match (has(Exit::Ok), has(Exit::DoesNotHold)) {
        (true, _) => "done, or ended by Ctrl-C, SIGTERM or SIGHUP",
        (false, true) => "done, and every plan passed its checks",
        (false, false) => "done",
    };
    let mut text = format!(
        "Exit codes:\n  0    {done}\n  1    bad input, or a file that cannot be read or written\n  2    wrong command line"
    );
    for (exit, meaning) in [
        (
            Exit::DoesNotHold,
            "a plan failed a check: the optimiser did not converge, or the motion fails in simulation",
        ),
        (Exit::OutOfBounds, "a measured error or count exceeds its limit"),
        (Exit::NotDone, "the robot refused a command, stopped, or did not answer"),
    ] {
        if has(exit) {
            text += &format!("\n  {}    {meaning}", exit.code());
        }
    }
    text + match has(Exit::Ok) {
        true => "\n  130  ended at once by a second signal",
        false => "\n  130  interrupted before the end: Ctrl-C, SIGTERM, SIGHUP",
    }
}

/// Result of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Success; a plan passed its checks.
    Ok,
    /// Bad input, or a file that cannot be read or written.
    BadInput,
    /// A plan failed its checks: the optimiser did not converge, a residual between the samples exceeds its tolerance, or the
    /// motion fails in simulation.
    DoesNotHold,
    /// A measured error or count exceeds its limit, such as a rule of the fault campaign.
    OutOfBounds,
    /// The robot refused, stopped or did not answer.
    NotDone,
    /// Interrupted by Ctrl-C, SIGTERM or SIGHUP.
    Interrupted,
}

impl Exit {
    /// Exit code of the process.
    pub fn code(self) -> u8 {
        // clap returns 2 for a wrong command line; shells report 130 for an interrupt.
        match self {
            Exit::Ok => 0,
            Exit::BadInput => 1,
            Exit::DoesNotHold => 3,
            Exit::OutOfBounds => 4,
            Exit::NotDone => 5,
            Exit::Interrupted => 130,
        }
    }
}

impl From<Exit> for ExitCode {
    fn from(exit: Exit) -> Self {
        ExitCode::from(exit.code())
    }
}

impl From<Judgement> for Exit {
    fn from(judgement: Judgement) -> Self {
        if judgement.is_good() { Exit::Ok } else { Exit::DoesNotHold }
    }
}
