//! The ROS 2 node as colcon builds and installs it: a simulated robot as clients over Cyclone DDS see it (`tests/ros2/`), which
//! needs no ROS.

use crate::python::Environment;
use crate::{shell, toolchain, workspace};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// An implementation of DDS beside the node's, definitions of ROS's messages, and readers of YAML and URDF.
const CLIENT: [&str; 4] =
    ["cyclonedds==11.0.1", "rosbags==0.11.9", "ruamel.yaml==0.19.1", "urdf-parser-py==0.0.4"];
/// The build tool of ROS workspaces, with what it needs for `ament_cargo`.
const COLCON: [&str; 4] = [
    "colcon-common-extensions==0.3.0",
    "colcon-core==0.21.3",
    "colcon-cargo==0.2.0",
    "colcon-ros-cargo==0.2.0",
];
/// The subcommand of cargo that colcon calls.
const AMENT_BUILD: (&str, &str) = ("cargo-ament-build", "0.1.11");
/// Name of the package.
const PACKAGE: &str = "rollwalk_ros2";
/// The program in an installed package, and what ROS finds beside it.
const NODE: &str = "lib/rollwalk_ros2/rollwalk-ros2";
const INSTALLED: [&str; 4] = [
    NODE,
    "share/rollwalk_ros2/launch/rollwalk.launch.py",
    "share/rollwalk_ros2/package.xml",
    "share/ament_index/resource_index/packages/rollwalk_ros2",
];

/// Tests the node's crate, and the node that colcon builds, which is optimised.
///
/// # Errors
/// A test or the build failed; or a tool is missing, and the error names the command that installs it.
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

/// Builds the package in a workspace of colcon below the target folder; the node that it installs there.
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
    // It writes into the folder in which it is called.
    shell::run(build.current_dir(&folder))?;
    let installed = folder.join("install").join(PACKAGE);
    let missing: Vec<_> = INSTALLED.iter().filter(|file| !installed.join(file).exists()).collect();
    if missing.is_empty() {
        Ok(installed.join(NODE))
    } else {
        Err(format!("colcon installed no {missing:?} in {}", installed.display()))
    }
}
