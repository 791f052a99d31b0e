//! Fault campaign: runs of the simulated robot with faults, and rules that must be satisfied in each run.
//!
//! A run takes place in virtual time: an operator connects, arms and plays motions, a fault strikes, and the operator recovers
//! the robot. The [`monitor`] checks every frame. Scenario, loss and seed determine a run bit by bit, so that every run can be
//! repeated. `docs/fault-campaign.md` describes the campaign.
//!
//! | module | contents |
//! |---|---|
//! | [`scenario`] | faults |
//! | [`operator`], [`shared_rig`] | operator at the host, and the robot that operator and run share |
//! | [`mod@run`] | execution of one run |
//! | [`monitor`] | rules, checked on every frame and every step of the motors |
//! | [`world`] | behaviour of a robot on the ground |
//! | [`table`] | results of many runs |

pub mod monitor;
pub mod operator;
pub mod run;
pub mod scenario;
pub mod shared_rig;
pub mod table;
pub mod world;

use crate::campaign::monitor::{Coverage, Violation};
use rollwalk_firmware::Settings;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{ClipId, Library, NodeId, validate};
use rollwalk_robot::Robot;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::core::{Core, LocalController};
use rollwalk_sim_host::interface::LogEntry;
use rollwalk_sim_host::one_leg;
use scenario::Scenario;
use serde::{Deserialize, Serialize};
use world::WorldReport;

/// Robot and library of a campaign.
#[derive(Clone, Debug)]
pub struct Subject {
    pub robot: Robot,
    pub library: Vec<u8>,
    /// Command codes of the library's motions, in its order; the first is SAFE.
    pub codes: Vec<u8>,
    /// Intermediate motions, which the robot plays without a command for them: pairs of goal and intermediate motion.
    pub on_the_way: Vec<(u8, u8)>,
    /// Maximum time of the return to SAFE from any motion.
    pub way_home: SimTime,
    /// True for a robot on the ground, false for a robot on a stand. Half of the runs on the ground, chosen at random, are on a
    /// slope.
    pub on_ground: bool,
}

impl Subject {
    /// Creates a single leg with hip, knee and wheel, on two actuator buses.
    pub fn one_leg() -> Self {
        Self {
            robot: one_leg::robot(),
            library: one_leg::library(),
            codes: vec![one_leg::STAND, one_leg::SWING, one_leg::ROLL, one_leg::BOW],
            // All transitions begin or end at SAFE.
            on_the_way: Vec::new(),
            // A transition that has just begun, a motion, and another transition take 60, 90 and 60 frames. A halt takes up to
            // two seconds.
            way_home: SimTime::from_ms(5_500),
            on_ground: false,
        }
    }

    /// Creates the subject for a robot on the ground; `None` if the library is not valid for the robot, or if its first motion
    /// is not SAFE.
    pub fn on_ground(robot: Robot, library: Vec<u8>, way_home: SimTime) -> Option<Self> {
        let index = validate(&library, &robot.controller_config().ok()?).ok()?;
        let view = Library::open(&library, &index)?;
        let motions = view.node_count();
        if view.safe_node() != NodeId(0) {
            return None;
        }
        let codes =
            (0..motions).map(|clip| view.clip(ClipId(clip))?.code).collect::<Option<_>>()?;
        let on_the_way = (0..motions).flat_map(|from| (0..motions).map(move |goal| (from, goal)));
        let on_the_way = on_the_way.flat_map(|(from, goal)| {
            let hop = |&at: &u8| {
                let edge = view.edge(view.next_hop(NodeId(at), NodeId(goal))?)?;
                (edge.to.0 != goal).then_some(edge.to.0)
            };
            let between = std::iter::successors(hop(&from), hop);
            between.map(|station| (goal, station)).collect::<Vec<_>>()
        });
        let on_the_way = on_the_way.collect();
        Some(Self { robot, library, codes, on_the_way, way_home, on_ground: true })
    }

    /// Configuration of the robot's controller.
    pub fn config(&self) -> RobotConfig {
        self.robot.controller_config().expect("the robot is sound")
    }
}

/// Parameters that determine a run of the campaign.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Case {
    pub scenario: Scenario,
    /// Lost frames of the link, per mille.
    pub loss_per_mille: u16,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Reaction of the robot to the fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Reaction {
    WentOn,
    /// Returned to SAFE along the motion graph and switched torque off.
    WentHome,
    LetDown,
    Stopped,
    /// Transferred the library at the first attempt.
    Transferred,
    /// Transferred the library after a failed attempt.
    TakenUp,
}

impl Reaction {
    /// Outcomes in the order of the table.
    pub const ALL: [Self; 6] = [
        Self::WentOn,
        Self::WentHome,
        Self::LetDown,
        Self::Stopped,
        Self::Transferred,
        Self::TakenUp,
    ];

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

/// Result of a run.
#[derive(Clone, Debug)]
pub struct RunReport {
    pub case: Case,
    /// Reaction of the robot to the fault.
    pub outcome: Reaction,
    /// Violations that the monitor found.
    pub violations: Vec<Violation>,
    /// Other errors: no recovery, a wrong or missing fault bit, a fault without effect.
    pub errors: Vec<String>,
    /// Numbers of frames or events that were disturbed by the loss, and by other faults.
    pub fired: [u64; 2],
    /// Counts of the monitor's checks.
    pub coverage: Coverage,
    /// Time from the first frame of the host's emergency stop to motors without torque.
    pub stopped_after: Option<SimTime>,
    /// Report on a robot on the ground.
    pub world: Option<WorldReport>,
    /// Virtual time of the run.
    pub took: SimTime,
}

impl RunReport {
    /// True if the run has neither violations nor errors.
    pub fn is_clean(&self) -> bool {
        self.violations.is_empty() && self.errors.is_empty()
    }
}

/// Runs a case with the firmware in this process. Returns the report and every frame of every bus.
pub fn run(subject: &Subject, case: Case) -> (RunReport, Vec<LogEntry>) {
    let (config, settings) = (subject.config(), Settings::default());
    let buses = subject.robot.controller_buses();
    let core = if case.scenario == Scenario::Flash {
        LocalController::new(config, buses, settings)
    } else {
        LocalController::with_library(config, buses, settings, &subject.library)
    };
    run_with(subject, case, core)
}

/// Runs a case with a controller that has just been switched on. The controller has the library of the subject, or no library
/// in [`Scenario::Flash`].
pub fn run_with<C: Core>(subject: &Subject, case: Case, core: C) -> (RunReport, Vec<LogEntry>) {
    run::run(subject, case, core)
}
