//! Turns the robot file into constants, so that the image holds no parser, and names the linker script.

use rollwalk_robot::Robot;
use std::env;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// The robot that the image is for, from this folder.
const ROBOT: &str = "../../../robots/agilebot.toml";

fn main() -> Result<(), Box<dyn Error>> {
    let text = fs::read_to_string(ROBOT)?;
    let config = Robot::from_toml(ROBOT, &text)?.controller_config()?;
    let count = config.channels.len();
    let mut code =
        format!("/// The robot's channels.\npub const CHANNELS: [Channel; {count}] = [\n");
    for c in &config.channels {
        writeln!(
            code,
            "    Channel {{ kind: ChannelKind::{:?}, min: {:?}, max: {:?}, max_rate: {:?}, \
             max_torque_nm: {:?}, kp_nm_rad: {:?}, kd_nm_s_rad: {:?}, bus: {}, id: {} }},",
            c.kind,
            c.min,
            c.max,
            c.max_rate,
            c.max_torque_nm,
            c.kp_nm_rad,
            c.kd_nm_s_rad,
            c.bus,
            c.id
        )?;
    }
    writeln!(
        code,
        "];\n/// What the configuration says of the robot's name.\npub const ROBOT: u32 = {};",
        config.robot
    )?;
    let out = env::var("OUT_DIR")?;
    fs::write(Path::new(&out).join("channels.rs"), code)?;

    fs::copy("memory.x", Path::new(&out).join("memory.x"))?;
    println!("cargo:rustc-link-search={out}");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    for file in [ROBOT, "memory.x", "build.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    Ok(())
}
