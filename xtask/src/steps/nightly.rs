//! The steps of `cargo xtask nightly`: the long forms of what `cargo xtask test` samples.

use super::Step;
use crate::extent::Extent;
use crate::{
    agreement, board, browsers, crates, deny, docs, explore, exports, fuzz, hostile, miri, mujoco,
    package, replay, ros2, sbom, shell, studio, vcan, wheel, workspace,
};
use clap::ValueEnum;

/// A robot of MIT drives and an ODrive.
const OTHER_ROBOT: &str = "shipped/robots/test_leg.toml";
/// Programs with ignored tests that only take long, by folder and name.
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
/// Tests that [`NightlyStep::Load`] runs.
const LOAD: &str = "load::";
/// Random seeds of the fault campaign on a stand, and on the ground: of each scenario and loss, a thousand runs.
const CAMPAIGN_SEEDS: &str = "1000";
const GROUND_CAMPAIGN_SEEDS: &str = "9";

/// A step of the nightly command.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum NightlyStep {
    /// Advisories, licences, duplicates and sources of all crates; the bills of materials.
    Deny,
    /// Packages of the published crates, built alone; their public items against the last release.
    Crates,
    /// Documentation site, with all generated pages.
    Docs,
    /// Debian package, installed on a bare Debian, with the tutorial of README.
    Package,
    /// AgileBot with its twenty motors on real CAN interfaces, and the emulated board behind `slcand`.
    Vcan,
    /// The whole demo on the emulated board, over its UART, and a robot of other drives.
    BoardUart,
    /// Flash, RAM, stack and instructions of the emulated board's image; the Pico 2's image; planted panics.
    Sizes,
    /// Tests of protocol and firmware in Miri.
    Miri,
    /// Kinematics and dynamics against MuJoCo on 1,000 states of every robot.
    Multibody,
    /// The experiments of the differentiable simulator.
    Physics,
    /// Exported robots and plans as MuJoCo, Pinocchio and readers of URDF and MCAP read them.
    Exports,
    /// A sweep over designs, whole, interrupted, and split by GNU parallel and Slurm.
    Explore,
    /// Shipped motions replayed in MuJoCo, without and with feed-forward, level and disturbed.
    Replay,
    /// Verdicts of the planner on 186 requests of imported and shipped robots, against MuJoCo.
    Agreement,
    /// Tests that take minutes, which `cargo xtask test` leaves out.
    Long,
    /// The studio's engine as WebAssembly against the native one; its page in real browsers.
    Studio,
    /// The Python package, as it is installed: its tests and its tutorial.
    Wheel,
    /// Random faults and combinations of them: a thousand runs on the ground, and on a stand a thousand of each.
    FaultCampaign,
    /// Fuzz targets, for ten minutes each.
    Fuzz,
    /// 100,000 attacks on a simulated robot over its link; commands killed, and on a full disk, while they write.
    Hostile,
    /// Robots on a computer with four times as many busy processes as cores.
    Load,
    /// The ROS 2 node as colcon builds it, on a simulated robot, from a client over another DDS.
    Ros2,
}

impl Step for NightlyStep {
    const COMMAND: &'static str = "nightly";

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
            Self::Multibody => "kinematics and dynamics against MuJoCo, 1,000 states a robot",
            Self::Physics => "experiments of the differentiable simulator",
            Self::Exports => "exports as other tools read them",
            Self::Explore => "a sweep over designs, split in every way",
            Self::Replay => "every shipped motion replayed in MuJoCo",
            Self::Agreement => "verdicts on random requests and imported robots, against MuJoCo",
            Self::Hostile => "attacks on a simulated robot, and on files being written",
            Self::Long => "tests that take minutes",
            Self::Load => "robots on a busy computer",
            Self::Fuzz => "fuzz targets, ten minutes each",
            Self::Studio => {
                "the studio's engine as WebAssembly against the native one; its page in real browsers"
            }
            Self::Wheel => "the Python package as it is installed",
            Self::Ros2 => "the ROS 2 node as colcon builds it, from another DDS",
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
                // One after the other: each has the cores busy by itself.
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

    /// The experiments keep one core busy for an hour.
    fn is_beside(&self) -> bool {
        *self == Self::Physics || *self == Self::Vcan && vcan::in_virtual_machine()
    }

    /// Simulated robots play in real time.
    fn is_alone(&self) -> bool {
        matches!(self, Self::Hostile | Self::Load | Self::Ros2)
    }
}
