//! What the build scripts of the board images share: the robot as constants, so that an image holds
//! no parser; and the linker script.

use rollwalk_protocol::actuators::bus::Bus;
use rollwalk_robot::Robot;
use std::env;
use std::error::Error;
use std::fmt::Write;
use std::fs;
use std::path::Path;

/// Reads the robot file `robot` (from the board's folder), writes `channels.rs` for the image to
/// include, and hands `memory.x` to the linker.
///
/// # Errors
/// What is wrong with the robot file, or with a file that cannot be read or written.
pub fn prepare(robot: &str) -> Result<(), Box<dyn Error>> {
    let out = env::var("OUT_DIR")?;
    let out = Path::new(&out);
    let text = fs::read_to_string(robot).map_err(|error| format!("{robot}: {error}"))?;
    fs::write(out.join("channels.rs"), channels(robot, &text)?)?;

    fs::copy("memory.x", out.join("memory.x"))?;
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    for file in [robot, "memory.x", "build.rs"] {
        println!("cargo:rerun-if-changed={file}");
    }
    Ok(())
}

/// The robot's channels and name as Rust.
fn channels(name: &str, text: &str) -> Result<String, Box<dyn Error>> {
    let robot = Robot::from_toml(name, text)?;
    let config = robot.controller_config()?;
    if let Some((number, bus)) = robot.buses.iter().find(|(_, bus)| **bus != Bus::default()) {
        let speaks = bus.protocol.name();
        let why = "images of the boards are built for buses of the Rollwalk profile at 1 Mbit/s";
        return Err(format!("{name}: bus {number} speaks {speaks}: {why}").into());
    }
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
    Ok(code)
}
