//! Steps of `cargo xtask nightly`: the long forms of checks that `cargo xtask test` samples.

use super::Step;
use crate::extent::Extent;
use crate::{
    agreement, board, browsers, crates, deny, docs, explore, exports, fuzz, hostile, miri, mujoco,
    package, replay, ros2, sbom, shell, studio, vcan, wheel, workspace,
};
use clap::ValueEnum;

/// Robot with MIT drives and an ODrive.
const OTHER_ROBOT: &str = "shipped/robots/test_leg.toml";
/// Programs with ignored tests that are ignored only because they take long, by folder and name.
const LONG: [(&str, &str); 11] = [
    ("cli", "rollwalk"),
    ("planner/design", "design"),
    ("planner/design", "rollwalk_design"),
    ("firmware", "rollwalk_firmware"),
    ("physics", "physics"),
    ("planner", "planner"),
    ("planner", "rollwalk_planner"),
    ("control/simulate", "rollwalk_simulate"),
    ("control/simulate", "simulate"),
    ("studio", "session"),
    ("tests", "integration"),
];
/// Filter for the tests that [`NightlyStep::Load`] runs.
const LOAD: &str = "load::";
/// Number of random seeds for each scenario and loss of the fault campaign on a stand.
const CAMPAIGN_SEEDS: &str = "1000";
/// Number of random seeds for each scenario and loss of the fault campaign on the ground.
const GROUND_CAMPAIGN_SEEDS: &str = "9";

/// Step of the nightly command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum NightlyStep {
    /// Advisories, licences, duplicates and sources of all crates; the bills of materials.
    Deny,
    /// Packages of the published crates, built separately; their public items compared with the last release.
    Crates,
    /// Documentation site, with all generated pages.
    Docs,
    /// Debian package, installed on a minimal Debian, with the tutorial of the README.
    Package,
    /// AgileBot with its twenty motors on real CAN interfaces, and the emulated board behind `slcand`.
    Vcan,
    /// Whole demo on the emulated board over its UART, and a robot with other drives.
    BoardUart,
    /// Flash, RAM, stack and instructions of the emulated board's image; the Pico 2's image; planted panics.
    Sizes,
    /// Tests of protocol and firmware in Miri.
    Miri,
    /// Kinematics and dynamics compared with MuJoCo on 1,000 states of every robot.
    Multibody,
    /// Experiments with the differentiable simulator.
    Physics,
    /// Exported robots and plans, read by MuJoCo, Pinocchio and readers of URDF and MCAP.
    Exports,
    /// Sweep over designs: at once, interrupted, and split by GNU parallel and Slurm.
    Explore,
    /// Shipped motions replayed in MuJoCo, with and without feed-forward, level and disturbed.
    Replay,
    /// Verdicts of the planner compared with MuJoCo, on requests for imported and shipped robots and on the shipped motions.
    Agreement,
    /// Tests that take minutes, which `cargo xtask test` leaves out.
    Long,
    /// WebAssembly engine of the studio compared with the native one; the page in real browsers.
    Studio,
    /// Installed Python package: its tests, its tutorial and its type stubs.
    Wheel,
    /// Random faults and their combinations: a thousand runs on the ground, and a thousand of each kind on a stand.
    FaultCampaign,
    /// Fuzz targets, for three minutes each.
    Fuzz,
    /// 100,000 attacks on a simulated robot over its link; commands killed while they write, or writing to a full disk.
    Hostile,
    /// Robots on a computer with four times as many busy processes as cores.
    Load,
    /// ROS 2 node as built by colcon, with a simulated robot and a client over another DDS.
    Ros2,
}

impl Step for NightlyStep {
    const COMMAND: &'static str = "nightly";
    const IS_RESUMED: bool = true;

    fn title(&self) -> &'static str {
        match self {
            Self::Deny => "advisories, licences and duplicates; bills of materials",
            Self::Crates => "packages of the published crates, built alone",
            Self::Docs => "the site of the documents, and its links",
            Self::Package => "the Debian package on a fresh Debian",
            Self::Vcan => "AgileBot and the emulated board on real CAN interfaces",
            Self::BoardUart => "the whole demo and another robot on the emulated board",
            Self::Sizes => "sizes and instructions of the emulated board's image",
            Self::Miri => "tests of protocol and firmware in Miri",
            Self::Multibody => "kinematics and dynamics against MuJoCo, 1,000 states of each robot",
            Self::Physics => "experiments with the differentiable simulator",
            Self::Exports => "exports, read by other tools",
            Self::Explore => "a sweep over designs, split in every way",
            Self::Replay => "every shipped motion replayed in MuJoCo",
            Self::Agreement => "verdicts on random requests and imported robots, against MuJoCo",
            Self::Hostile => "attacks on a simulated robot, and on files being written",
            Self::Long => "tests that take minutes",
            Self::Load => "simulated robots in real time on a busy computer",
            Self::Fuzz => "fuzz targets, three minutes each",
            Self::Studio => {
                "the studio's engine as WebAssembly against the native one; its page in real browsers"
            }
            Self::Wheel => "the installed Python package",
            Self::Ros2 => "the ROS 2 node, built by colcon and addressed from another DDS",
            Self::FaultCampaign => "fault campaign with 1,000 seeds, and 1,000 runs on the ground",
        }
    }

    fn check(&self, _: Extent) -> Result<(), String> {
        workspace::select_all();
        match self {
            Self::Deny => deny::check().and_then(|()| sbom::write(None)),
            Self::Crates => crates::check(Extent::Full),
            Self::Docs => docs::build(&docs::Options { reference: true }),
            Self::Package => package::check(),
            Self::Vcan => vcan::check(),
            Self::BoardUart => board::demo_over_uart()
                .and_then(|()| board::other_robot(&shell::workspace_root().join(OTHER_ROBOT))),
            Self::Sizes => board::sizes(false)
                .and_then(|()| board::other_boards())
                .and_then(|()| board::planted_panics()),
            Self::Miri => miri::check(),
            Self::Multibody => mujoco::check(Extent::Full),
            Self::Physics => {
                let programs = workspace::optimised_programs()?;
                let bench = workspace::find(&programs, "apps/bench", "rollwalk-bench", false)?;
                let out = shell::target_folder().join("physics");
                shell::run(bench.command(&["physics", "--out"]).arg(out))
            }
            Self::Exports => exports::check(Extent::Full),
            Self::Explore => explore::check(),
            Self::Replay => replay::check(Extent::Full),
            Self::Agreement => agreement::check(),
            Self::Hostile => hostile::check(Extent::Full),
            Self::Long => {
                let programs = workspace::programs()?;
                let all = LONG.map(|(folder, name)| {
                    let tests = workspace::find(&programs, folder, name, true)?;
                    shell::run(&mut tests.tests(&["--ignored", "--skip", LOAD])?)
                });
                let failures: Vec<_> = all.into_iter().filter_map(Result::err).collect();
                if failures.is_empty() { Ok(()) } else { Err(failures.join("\n\n")) }
            }
            Self::Load => {
                let programs = workspace::programs()?;
                let tests = workspace::find(&programs, "tests", "integration", true)?;
                // In sequence, because each uses all cores.
                let load = [LOAD, "--ignored", "--test-threads=1", "--nocapture"];
                shell::run(&mut tests.command(&load))
            }
            Self::Fuzz => fuzz::check(),
            Self::Studio => {
                let wasm = studio::engine()?;
                let programs = workspace::optimised_programs()?;
                let tests = workspace::find(&programs, "studio", "against_wasm", true)?;
                let mut test = tests.tests(&["--ignored", "--nocapture"])?;
                shell::run(test.env("STUDIO_WASM", wasm))?;
                browsers::check(Extent::Full)
            }
            Self::Wheel => wheel::check(),
            Self::Ros2 => ros2::check(),
            Self::FaultCampaign => {
                let out = shell::target_folder().join("fault-campaign");
                let programs = workspace::optimised_programs()?;
                let bench = workspace::find(&programs, "apps/bench", "rollwalk-bench", false)?;
                let run = |on, seeds| {
                    let campaign = ["fault-campaign", "--on", on, "--seeds", seeds];
                    let out = out.with_extension(on);
                    shell::run(bench.command(&campaign).arg("--out").arg(out))
                };
                run("ground", GROUND_CAMPAIGN_SEEDS).and_then(|()| run("stand", CAMPAIGN_SEEDS))
            }
        }
    }

    /// True for the experiments, which keep one core busy for an hour, and for the virtual machine.
    fn is_beside(&self) -> bool {
        *self == Self::Physics || *self == Self::Vcan && vcan::in_virtual_machine()
    }

    /// True for the steps with simulated robots that play in real time.
    fn is_alone(&self) -> bool {
        matches!(self, Self::Hostile | Self::Load | Self::Ros2)
    }
}
