//! Runs in which something goes wrong, and what must hold in each of them.
//!
//! A run is a story in virtual time: connect, arm, play motions by code, a fault, what follows, and the way
//! back to playing. [`monitor`] looks at every frame of it. All of it follows from scenario, loss and
//! seed, so whatever happens can be made to happen again. The document is `docs/fault-campaign.md`.
//!
//! | module | is |
//! |---|---|
//! | [`scenario`] | what goes wrong |
//! | [`operator`], [`mod@bench`] | who does what at the host's end, and the robot that both share |
//! | [`story`] | one run |
//! | [`monitor`] | the rules, checked on every frame and every step of the motors |
//! | [`table`] | what came of many |

pub mod bench;
pub mod monitor;
pub mod operator;
pub mod scenario;
pub mod story;
pub mod table;

use crate::monitor::{Seen, Violation};
use rollwalk_firmware::Settings;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_robot::Robot;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::{Core, Local};
use rollwalk_sim_host::interface::LogEntry;
use rollwalk_sim_host::one_leg;
use scenario::Scenario;

/// The robot and library of a campaign.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The robot.
    pub robot: Robot,
    /// Its library.
    pub library: Vec<u8>,
    /// Command codes of the library's motions, in its order; the first is SAFE.
    pub codes: Vec<u8>,
    /// The way to SAFE takes no longer than this, whatever is played.
    pub way_home: SimTime,
}

impl Subject {
    /// One leg with hip, knee and wheel, on two actuator buses.
    pub fn one_leg() -> Self {
        Self {
            robot: one_leg::robot(),
            library: one_leg::library(),
            codes: vec![one_leg::STAND, one_leg::SWING, one_leg::ROLL, one_leg::BOW],
            // A transition that has just begun, a motion, and another transition: 60, 90 and 60 frames;
            // and two seconds in which a halt can end.
            way_home: SimTime::from_ms(5_500),
        }
    }

    /// What its controller knows.
    pub fn config(&self) -> RobotConfig {
        self.robot.controller_config().expect("the robot is sound")
    }
}

/// One run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Case {
    /// What goes wrong.
    pub scenario: Scenario,
    /// So many of a thousand frames of the link are lost.
    pub loss_per_mille: u16,
    /// Where all that is random comes from.
    pub seed: u64,
}

/// What became of the robot after the fault began.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Outcome {
    /// It went on as if nothing had happened.
    WentOn,
    /// It returned to SAFE by the graph and lay down.
    WentHome,
    /// It was let down damped.
    LetDown,
    /// It was stopped.
    Stopped,
    /// The library was transferred in spite of it.
    Transferred,
    /// The transfer failed, and was taken up later.
    TakenUp,
}

impl Outcome {
    /// All, in the order of the table.
    pub const ALL: [Self; 6] = [
        Self::WentOn,
        Self::WentHome,
        Self::LetDown,
        Self::Stopped,
        Self::Transferred,
        Self::TakenUp,
    ];

    /// In a word or two.
    pub fn name(self) -> &'static str {
        match self {
            Self::WentOn => "went on",
            Self::WentHome => "went home",
            Self::LetDown => "let down",
            Self::Stopped => "stopped",
            Self::Transferred => "transferred",
            Self::TakenUp => "taken up",
        }
    }
}

/// What came of a run.
#[derive(Clone, Debug)]
pub struct Report {
    /// Which.
    pub case: Case,
    /// What became of the robot.
    pub outcome: Outcome,
    /// Rules that were broken, as the monitor saw it.
    pub violations: Vec<Violation>,
    /// What else was wrong: stuck, the wrong fault, no fault, a fault that never fired.
    pub complaints: Vec<String>,
    /// How often faults did something: loss, and the others.
    pub fired: [u64; 2],
    /// What the monitor looked at.
    pub seen: Seen,
    /// How long after the host's first emergency stop the motors were without torque.
    pub stopped_after: Option<SimTime>,
    /// Virtual time that it took.
    pub took: SimTime,
}

impl Report {
    /// Nothing was wrong.
    pub fn is_clean(&self) -> bool {
        self.violations.is_empty() && self.complaints.is_empty()
    }
}

/// Runs a case with the firmware in this process. Also returns every frame of every bus.
pub fn run(subject: &Subject, case: Case) -> (Report, Vec<LogEntry>) {
    let (config, settings) = (subject.config(), Settings::default());
    let buses = subject.robot.controller_buses();
    let core = if case.scenario == Scenario::Flash {
        Local::new(config, buses, settings)
    } else {
        Local::with_library(config, buses, settings, &subject.library)
    };
    run_with(subject, case, core)
}

/// Runs a case with a controller that has just been switched on: without library in [`Scenario::Flash`],
/// with that of the subject in all others.
pub fn run_with<C: Core>(subject: &Subject, case: Case, core: C) -> (Report, Vec<LogEntry>) {
    story::tell(subject, case, core)
}
