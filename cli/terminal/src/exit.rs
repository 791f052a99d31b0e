//! How a run ends, as scripts see it.

use rollwalk_planner::report::Judgement;
use std::process::ExitCode;

/// The exit codes, part of every help text.
pub const HELP: &str = "\
Exit codes:
  0    done; a plan holds
  1    bad input, or a file that cannot be read or written
  2    wrong command line
  3    a plan does not hold: the optimiser did not converge, or the motion fails as it is played
  4    a measured error exceeds its stated bound; a rule of the fault campaign is broken
  5    the robot refused a command, stopped, or does not answer
  130  interrupted: Ctrl-C, SIGTERM, SIGHUP";

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// Done; a plan holds.
    Ok,
    /// Bad input, or a file that cannot be read or written.
    BadInput,
    /// A plan does not hold: the optimiser did not converge, or a residual between the samples exceeds its tolerance.
    DoesNotHold,
    /// A measured error exceeds its stated bound; a rule of the fault campaign is broken.
    OutOfBounds,
    /// The robot refused, stopped, or does not answer.
    NotDone,
    /// Interrupted: Ctrl-C, SIGTERM, SIGHUP.
    Interrupted,
}

impl Exit {
    /// Its number.
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
