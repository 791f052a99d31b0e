//! Tests that generated modules contain configuration and buses of the robot files, and that robots with too many buses for a
//! board are refused.

mod test_leg;

use rollwalk_robot::Robot;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Robot with buses of two protocols, and its generated module.
const TEST_LEG: (&str, &str) =
    ("shipped/robots/test_leg.toml", "apps/board-bench/tests/test_leg.rs");

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn bench(robot: &str, arguments: &[&str]) -> Output {
    let mut bench = Command::new(env!("CARGO_BIN_EXE_rollwalk-board-bench"));
    bench.args(["--robot", robot]).args(arguments).current_dir(root()).output().unwrap()
}

fn robot(file: &str) -> Robot {
    let text = std::fs::read_to_string(root().join(file)).unwrap();
    Robot::from_toml(file, &text).unwrap()
}

/// Returns the generated module of a robot.
fn module(file: &str) -> String {
    let output = bench(file, &["config"]);
    assert!(output.status.success(), "{output:?}");
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn a_generated_module_is_that_of_the_robot_file() {
    let (file, path) = TEST_LEG;
    assert!(
        module(file) == std::fs::read_to_string(root().join(path)).unwrap(),
        "{file} has changed: cargo run -p rollwalk-board-bench -- --robot {file} config > {path}"
    );
}

#[test]
fn a_generated_module_holds_the_robot() {
    let robot = robot(TEST_LEG.0);
    let (config, buses) = (test_leg::config(), test_leg::buses());
    let expected = robot.controller_config().unwrap();
    assert_eq!((&config, config.hash()), (&expected, expected.hash()));
    assert_eq!(buses, Some(robot.controller_buses()));
    assert_eq!(expected.channels.as_slice(), test_leg::CHANNELS);
    assert_eq!(buses.unwrap().len(), 2);
}

#[test]
fn a_robot_without_buses_in_its_file_has_none_in_its_module() {
    let module = module("shipped/robots/agilebot.toml");
    assert!(module.contains("Some(Buses::new())") && !module.contains("BUSES"), "{module}");
    assert_eq!(module.matches("    channel(").count(), 20, "{module}");
}

/// Returns the wiring of a robot, or the error if it is refused.
fn image(robot: &str, board: &str) -> Result<String, String> {
    let folder = tempfile::tempdir().unwrap();
    let module = folder.path().join("robot.rs");
    let output = bench(robot, &["image", board, "--out", module.to_str().unwrap()]);
    assert_eq!(module.exists(), output.status.success(), "nothing is left of a refused robot");
    if output.status.success() {
        let config = bench(robot, &["config"]).stdout;
        assert!(std::fs::read(module).unwrap() == config);
        Ok(String::from_utf8(output.stdout).unwrap())
    } else {
        Err(String::from_utf8(output.stderr).unwrap())
    }
}

/// Writes a robot file with changes, each of which must apply.
fn changed(file: &str, changes: &[(&str, &str)]) -> tempfile::NamedTempFile {
    let mut text = std::fs::read_to_string(root().join(file)).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from}");
        text = text.replace(from, to);
    }
    let file = tempfile::Builder::new().suffix(".toml").tempfile().unwrap();
    std::fs::write(file.path(), text).unwrap();
    file
}

#[test]
fn wiring_names_every_motor_at_its_port() {
    let text = image("shipped/robots/test_leg.toml", "nucleo-g474re").unwrap();
    let lines: Vec<_> = text.lines().collect();
    assert!(lines[0].starts_with("bus 0  AK80-9, 1000 kbit/s  FDCAN2: RX PB12"), "{text}");
    assert!(lines[3].starts_with("bus 1  ODrive"), "{text}");
    assert!(lines[3].contains("FDCAN3: RX PA8"), "{text}");
    for channel in robot("shipped/robots/test_leg.toml").channels() {
        let motor = format!("  id {:>3}  {}", channel.actuator().id, channel.name());
        assert_eq!(lines.iter().filter(|line| **line == motor).count(), 1, "{text}");
    }
    assert!(text.contains("emergency stop  PA10"), "{text}");
}

#[test]
fn every_shipped_robot_gets_an_image_or_is_refused_by_its_bus() {
    for entry in std::fs::read_dir(root().join("shipped/robots")).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_none_or(|extension| extension != "toml") {
            continue;
        }
        let file = path.to_str().unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let Ok(robot) = Robot::from_toml(file, &text) else { continue };
        let used: std::collections::BTreeSet<u8> =
            robot.channels().map(|channel| channel.actuator().bus).collect();
        let on_can =
            |number: &&u8| robot.buses.get(number).is_none_or(|bus| !bus.protocol.is_serial());
        let can = used.iter().filter(on_can).count();
        let fits = can <= 2 && used.len() - can <= 1;
        let outcome = image(file, "nucleo-g474re");
        assert_eq!(outcome.is_ok(), fits, "{file}: {outcome:?}");
        if let Err(why) = outcome {
            assert!(why.contains(": bus ") && why.contains("its ports for actuators"), "{why}");
        }
    }
}

#[test]
fn a_bus_that_a_board_cannot_be_is_refused_with_what_it_offers() {
    let servos = "protocol = \"dynamixel\"\nbit_rate = 1000000\nmodel = \"XM430-W210\"\n\
                  watchdog_ms = 100\nreturn_delay_us = 20\n# ";
    let odrive = "protocol = \"odrive\"\nfirmware = \"0.5\"\nreduction";
    let serial = changed(
        "shipped/robots/test_leg.toml",
        &[
            (odrive, servos),
            ("torque_constant_nm_a", "# "),
            ("estimates_hz", "# "),
            ("speed_max_rad_s = 20.0", "speed_max_rad_s = 6.0"),
        ],
    );
    let serial = serial.path().to_str().unwrap();
    let text = image(serial, "nucleo-g474re").unwrap();
    assert!(text.contains("XM430-W210, 1000 kbit/s  USART3: data PB10"), "{text}");
    let why = image(serial, "mps2-an386").unwrap_err();
    let expected = "mps2-an386 has no port left for this bus; its ports for actuators on serial lines are: none";
    assert!(why.starts_with(&format!("{serial}: bus 1 (")) && why.contains(expected), "{why}");
    let why = image(serial, "pico2").unwrap_err();
    let expected = "bus 0 (AK80-9): pico2 has no port left for this bus; its ports for actuators on CAN are: none";
    assert!(why.contains(expected), "{why}");

    let slow =
        changed("shipped/robots/test_leg.toml", &[("estimates_hz = 125", "estimates_hz = 10")]);
    let why = image(slow.path().to_str().unwrap(), "nucleo-g474re").unwrap_err();
    assert!(why.contains("bus 1: no controller can drive its actuators"), "{why}");

    let why = image("shipped/robots/test_leg.toml", "mps2-an386-slcan").unwrap_err();
    assert!(
        why.contains("bus 0 (AK80-9): mps2-an386-slcan supports only the simulated servos"),
        "{why}"
    );
    let why = image("shipped/robots/agilebot.toml", "bluepill").unwrap_err();
    assert!(
        why.contains("give one of the boards mps2-an386, mps2-an386-slcan, nucleo-g474re, pico2"),
        "{why}"
    );
}
