//! Test of the ROS 2 node as colcon builds and installs it, with a simulated robot and clients over Cyclone DDS
//! (`tests/ros2/`); needs no ROS.

use crate::python::Environment;
use crate::{shell, toolchain, workspace};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Python packages of the clients: another DDS implementation, definitions of ROS messages, and readers of YAML and URDF.
const CLIENT: [&str; 4] =
    ["cyclonedds==11.0.1", "rosbags==0.11.9", "ruamel.yaml==0.19.1", "urdf-parser-py==0.0.4"];
/// Build tool of ROS workspaces, with its packages for `ament_cargo`.
const COLCON: [&str; 4] = [
    "colcon-common-extensions==0.3.0",
    "colcon-core==0.21.3",
    "colcon-cargo==0.2.0",
    "colcon-ros-cargo==0.2.0",
];
/// Subcommand of cargo that colcon calls.
const AMENT_BUILD: (&str, &str) = ("cargo-ament-build", "0.1.11");
/// Name of the package.
const PACKAGE: &str = "rollwalk_ros2";
/// Path of the program in an installed package.
const NODE: &str = "lib/rollwalk_ros2/rollwalk-ros2";
/// Files of an installed package that ROS uses.
const INSTALLED: [&str; 4] = [
    NODE,
    "share/rollwalk_ros2/launch/rollwalk.launch.py",
    "share/rollwalk_ros2/package.xml",
    "share/ament_index/resource_index/packages/rollwalk_ros2",
];

/// Tests the node's crate, and the optimised node that colcon builds.
///
/// # Errors
/// Returns an error if a test or the build fails. If a tool is missing, the error contains the command that installs it.
pub fn check() -> Result<(), String> {
    let programs = workspace::programs()?;
    let program = |folder, name| {
        workspace::find(&programs, folder, name, false).map(|program| program.path.clone())
    };
    for tests in
        programs.iter().filter(|program| program.is_test && program.folder.ends_with("ros2"))
    {
        shell::run(&mut tests.command(&[]))?;
    }
    let node = colcon()?;
    let python = Environment::kept("ros2", &CLIENT)?;
    let mut tests = python.module("unittest", &["discover", "-v", "-f", "-s", "tests/ros2"]);
    tests.env("ROLLWALK", program("tests", "rollwalk-under-test")?);
    tests.env("ROLLWALK_SIM", program("tests", "rollwalk-sim-under-test")?);
    shell::run(tests.env("ROLLWALK_ROS2", node))
}

/// Builds the package in a colcon workspace below the target folder; returns the path of the installed node.
fn colcon() -> Result<PathBuf, String> {
    let python = Environment::kept("colcon-python", &COLCON)?;
    let ament_build = toolchain::program(AMENT_BUILD, &["ament-build", "--help"], &[])?;
    let folder = shell::target_folder().join("colcon");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    let mut build = shell::command(&python.script("colcon").to_string_lossy(), &["build"]);
    build.arg("--base-paths").arg(shell::workspace_root().join("apps/packaging").join(PACKAGE));
    build.args(["--cargo-args", "--locked", "--release"]);
    if let Some(tools) = Path::new(&ament_build).parent().filter(|path| path.is_absolute()) {
        let others = env::var_os("PATH");
        let others = others.iter().flat_map(env::split_paths);
        let path = env::join_paths([tools.to_owned()].into_iter().chain(others));
        build.env("PATH", path.map_err(|error| error.to_string())?);
    }
    // The command writes to its current folder.
    shell::run(build.current_dir(&folder))?;
    let installed = folder.join("install").join(PACKAGE);
    let missing: Vec<_> = INSTALLED.iter().filter(|file| !installed.join(file).exists()).collect();
    if missing.is_empty() {
        Ok(installed.join(NODE))
    } else {
        Err(format!("colcon did not install {missing:?} in {}", installed.display()))
    }
}
