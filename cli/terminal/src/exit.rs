//! Results of runs, with exit codes for scripts.

use rollwalk_planner::report::Judgement;
use std::process::ExitCode;

/// Exit codes at the end of a help text: those of every command, and `exits` of this one.
pub(crate) fn help(exits: &[Exit]) -> String {
    let has = |exit| exits.contains(&exit);
    let done = if has(Exit::DoesNotHold) { "done; a plan holds" } else { "done" };
    let mut text = format!(
        "Exit codes:\n  0    {done}\n  1    bad input, or a file that cannot be read or written\n  2    wrong command line"
    );
    for (exit, meaning) in [
        (
            Exit::DoesNotHold,
            "a plan does not hold: the optimiser did not converge, or the motion fails as it is played",
        ),
        (Exit::OutOfBounds, "a measured error or count exceeds its stated bound"),
        (Exit::NotDone, "the robot refused a command, stopped, or does not answer"),
    ] {
        if has(exit) {
            text += &format!("\n  {}    {meaning}", exit.code());
        }
    }
    text + "\n  130  interrupted: Ctrl-C, SIGTERM, SIGHUP"
}

/// Result of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done; a plan holds.
    Ok,
    /// Bad input, or a file that cannot be read or written.
    BadInput,
    /// A plan does not hold: the optimiser did not converge, or a residual between the samples exceeds its tolerance.
    DoesNotHold,
    /// A measured error or count exceeds its stated bound, such as a rule of the fault campaign.
    OutOfBounds,
    /// The robot refused, stopped, or does not answer.
    NotDone,
    /// Interrupted: Ctrl-C, SIGTERM, SIGHUP.
    Interrupted,
}

impl Exit {
    /// Exit code of the process.
    pub fn code(self) -> u8 {
        // 2 is clap's for a wrong command line, 130 what shells report for an interrupt.
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
