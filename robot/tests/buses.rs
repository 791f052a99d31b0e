//! Tests of actuator buses in robot files and of their faults.

use rollwalk_protocol::actuators::bus::{Bus, ControlLoop, Pose, Protocol};
use rollwalk_protocol::actuators::cybergear::CyberGear;
use rollwalk_protocol::actuators::dynamixel::{Dynamixel, table::XM430_W210};
use rollwalk_protocol::actuators::feetech::{Feetech, table::STS3215_C018};
use rollwalk_protocol::actuators::maestro::{Maestro, Pulse};
use rollwalk_protocol::actuators::mit::{AnswerId, MODELS, Mit};
use rollwalk_protocol::actuators::odrive::{Odrive, Version};
use rollwalk_robot::Robot;

/// Robot with a body and an arm on bus 0, which carries a wheel on bus 1.
const ROBOT: &str = r#"name = "arm"

[actuator.servo]
model = "S1"
speed_max_rad_s = 5.0
torque_max_nm = 1.5
kp_nm_rad = 50.0
kd_nm_s_rad = 1.0
armature_kg_m2 = 0.005

[[link]]
name = "body"
parts = [{ mass_kg = 1.0, at_m = [0, 0, 0], box_m = [0.2, 0.2, 0.1] }]

[[link]]
name = "arm"
parts = [{ mass_kg = 0.1, at_m = [0, 0, -0.1], box_m = [0.02, 0.02, 0.2] }]

[[joint]]
name = "shoulder"
parent = "body"
child = "arm"
origin_in_parent_m = [0.1, 0, 0]
axis_in_joint = [0, 1, 0]
position_min_rad = -1.0
position_max_rad = 1.25
nominal_rad = 0.0
actuator = "servo"
bus = 0
id = 70

[[end_effector]]
name = "wheel"
link = "arm"
center_in_link_m = [0, 0, -0.2]
radius_m = 0.03
friction_coefficient = 0.8
contact = "actuated_wheel"
axis_in_link = [0, 1, 0]
actuator = "servo"
bus = 1
id = 2
"#;

const MIT: &str = "protocol = \"mit\"\nmodel = \"AK80-9\"\n";
const ODRIVE: &str = "protocol = \"odrive\"\nfirmware = \"0.6\"\nreduction = -9\n\
    torque_constant_nm_a = 0.05\nestimates_hz = 120\n";
const CYBERGEAR: &str = "protocol = \"cybergear\"\nhost_id = 253\nmax_position_rad = 12.5\n";
const DYNAMIXEL: &str = "protocol = \"dynamixel\"\nmodel = \"XM430-W210\"\nwatchdog_ms = 100\n\
    return_delay_us = 0\nbit_rate = 1_000_000\n";
const FEETECH: &str = "protocol = \"feetech\"\nmodel = \"STS3215-C018\"\nreturn_delay_us = 500\n\
    bit_rate = 1_000_000\n";
const MAESTRO: &str = "protocol = \"maestro\"\nbit_rate = 115_200\npulse_us = [500, 2500]\n";

fn read(number: u8, lines: &str) -> Result<Robot, rollwalk_robot::document::DocumentError> {
    Robot::from_toml("arm.toml", &format!("{ROBOT}\n[[bus]]\nnumber = {number}\n{lines}"))
}

fn bus(number: u8, lines: &str) -> Bus {
    read(number, lines).unwrap().buses[&number]
}

/// Asserts a single fault, at the line that starts with `at`, with the given message and help.
#[track_caller]
fn assert_fault(number: u8, lines: &str, at: &str, message: &str, help: &str) {
    let text = format!("{ROBOT}\n[[bus]]\nnumber = {number}\n{lines}");
    let error = Robot::from_toml("arm.toml", &text).expect_err("it is wrong");
    let found: Vec<_> = error.faults().collect();
    assert_eq!(found.len(), 1, "{found:#?}");
    let line = text.lines().nth(found[0].line - 1).unwrap();
    assert!(line.starts_with(at), "{line}: {found:#?}");
    assert!(found[0].message.contains(message), "{found:#?}");
    assert!(found[0].help.contains(help), "{found:#?}");
}

#[test]
fn every_protocol_is_read_with_its_parameters() {
    let like = Bus::default();
    assert_eq!(bus(0, "protocol = \"rollwalk\"\n"), like);
    let mit = |answers_from| Protocol::Mit(Mit { model: MODELS[4], answers_from });
    assert_eq!(bus(0, MIT), Bus { protocol: mit(AnswerId::Own), ..like });
    let master = format!("{MIT}master_id = 0\nbit_rate = 500_000\ncontrol = \"on_controller\"\n");
    let expected = Bus {
        protocol: mit(AnswerId::Master(0)),
        bit_rate: 500_000,
        control: ControlLoop::OnController,
        ..like
    };
    assert_eq!(bus(0, &master), expected);
    let protocol = Protocol::Odrive(Odrive {
        version: Version::V06,
        reduction: -9.0,
        torque_constant_nm_a: 0.05,
        estimates_hz: 120,
    });
    assert_eq!(bus(1, ODRIVE), Bus { protocol, ..like });
    let protocol = Protocol::CyberGear(CyberGear { host: 253, max_position_rad: 12.5 });
    assert_eq!(bus(1, CYBERGEAR), Bus { protocol, ..like });
    let protocol = Protocol::Dynamixel(Dynamixel {
        model: XM430_W210,
        watchdog_20ms: 5,
        return_delay_us: 0,
        reads_fast: false,
    });
    assert_eq!(bus(1, DYNAMIXEL), Bus { protocol, ..like });
    let sync = format!("{DYNAMIXEL}read = \"sync\"\n");
    assert_eq!(bus(1, &sync), Bus { protocol, ..like });
    let fast = format!("{DYNAMIXEL}read = \"fast\"\n");
    let Protocol::Dynamixel(servos) = protocol else { unreachable!() };
    let protocol = Protocol::Dynamixel(Dynamixel { reads_fast: true, ..servos });
    assert_eq!(bus(1, &fast), Bus { protocol, ..like });
    let robot = read(1, &fast).unwrap();
    let text = serde_json::to_string(&robot).unwrap();
    assert_eq!(serde_json::from_str::<Robot>(&text).unwrap(), robot);
    // The speeds of this arm exceed those of an STS3215 at 12 V.
    let text = ROBOT.replace("speed_max_rad_s = 5.0", "speed_max_rad_s = 4.7");
    let text = format!("{text}\n[[bus]]\nnumber = 1\n{FEETECH}");
    let protocol = Protocol::Feetech(Feetech { model: STS3215_C018, return_delay_us: 500 });
    assert_eq!(Robot::from_toml("arm.toml", &text).unwrap().buses[&1], Bus { protocol, ..like });
    let text = ROBOT.replace("id = 70", "id = 3");
    let text = format!("{text}\n[[bus]]\nnumber = 0\n{MAESTRO}pose = \"assumed_safe\"\n");
    let protocol = Protocol::Maestro(Maestro {
        device: None,
        crc: false,
        set_multiple: true,
        pulse: Pulse { limits_us: (500.0, 2500.0), ..Pulse::default() },
    });
    let expected = Bus { protocol, bit_rate: 115_200, pose: Pose::AssumedSafe, ..like };
    assert_eq!(Robot::from_toml("arm.toml", &text).unwrap().buses[&0], expected);
}

#[test]
fn buses_without_a_table_speak_the_rollwalk_profile() {
    let robot = read(1, CYBERGEAR).unwrap();
    let buses = robot.controller_buses();
    assert_eq!(buses.len(), 2);
    assert_eq!((buses[0], buses[1]), (Bus::default(), robot.buses[&1]));
    assert!(Robot::from_toml("arm.toml", ROBOT).unwrap().controller_buses().is_empty());
}

/// Tests that another protocol changes the configuration hash, and that explicit defaults do not.
#[test]
fn what_a_bus_speaks_is_part_of_the_configuration() {
    let hash =
        |number, lines: &str| read(number, lines).unwrap().controller_config().unwrap().hash();
    let plain = Robot::from_toml("arm.toml", ROBOT).unwrap().controller_config().unwrap().hash();
    assert_eq!(hash(0, "protocol = \"rollwalk\"\nbit_rate = 1_000_000\n"), plain);
    let slow = "bit_rate = 500_000\n";
    let mut hashes = vec![
        plain,
        hash(0, MIT),
        hash(1, MIT),
        hash(0, &format!("{MIT}{slow}")),
        hash(0, &format!("{MIT}master_id = 0\n")),
        hash(1, ODRIVE),
        hash(1, &ODRIVE.replace("-9", "9")),
        hash(1, CYBERGEAR),
        hash(1, DYNAMIXEL),
    ];
    hashes.sort_unstable();
    hashes.dedup();
    assert_eq!(hashes.len(), 9);
    // These numbers must not change, because built libraries contain their hash.
    assert_eq!(
        [(0, MIT), (1, ODRIVE), (1, CYBERGEAR), (1, DYNAMIXEL)]
            .map(|(number, lines)| hash(number, lines)),
        [675860799, 1155304575, 799955391, 2865593222]
    );
    let maestro = ROBOT.replace("id = 70", "id = 3");
    let maestro = format!("{maestro}\n[[bus]]\nnumber = 0\n{MAESTRO}");
    let maestro = Robot::from_toml("arm.toml", &maestro).unwrap();
    assert_eq!(maestro.controller_config().unwrap().hash(), 410774510);
}

#[test]
fn a_robot_with_buses_is_the_same_after_json() {
    for lines in [MIT, ODRIVE, CYBERGEAR, DYNAMIXEL] {
        let robot = read(1, lines).unwrap();
        let text = serde_json::to_string(&robot).unwrap();
        assert_eq!(serde_json::from_str::<Robot>(&text).unwrap(), robot);
    }
    let text = serde_json::to_string(&read(1, MIT).unwrap()).unwrap();
    assert!(
        text.contains(r#""protocol":{"mit":{"model":"AK80-9","answers_from":"own"}}"#),
        "{text}"
    );
    let error = serde_json::from_str::<Robot>(&text.replace("AK80-9", "AK8")).unwrap_err();
    assert!(error.to_string().contains("\"AK8\", expected one of AK10-9"), "{error}");
    // Robots without such tables are written as before.
    let text = serde_json::to_string(&Robot::from_toml("arm.toml", ROBOT).unwrap()).unwrap();
    assert!(!text.contains("buses"), "{text}");
}

#[test]
fn a_table_that_cannot_be_read_is_named() {
    assert_fault(0, "protocol = \"canopen\"\n", "protocol", "bus 0: `protocol`", "`mit`");
    assert_fault(0, "", "[[bus]]", "bus 0: `protocol` is missing", "give `protocol`");
    assert_fault(
        0,
        "protocol = \"mit\"\nmodel = \"AK80-8\"\n",
        "model",
        "\"AK80-8\"",
        "valid names: `AK10-9`, ",
    );
    assert_fault(
        0,
        &format!("{MIT}estimates_hz = 1\n"),
        "estimates_hz",
        "unknown key",
        "valid names",
    );
    assert_fault(
        0,
        &format!("{MIT}master_id = 2048\n"),
        "master_id",
        "master_id",
        "from 0 to 2047",
    );
    let odd = DYNAMIXEL.replace("= 100", "= 90");
    assert_fault(1, &odd, "watchdog_ms", "not a multiple of 20 ms", "multiple");
    assert_fault(
        1,
        &DYNAMIXEL.replace("bit_rate = 1_000_000\n", ""),
        "[[bus]]",
        "`bit_rate` is missing",
        "",
    );
    assert_fault(
        1,
        &FEETECH.replace("STS3215-C018", "STS3215"),
        "model",
        "\"STS3215\"",
        "valid names: `STS3215-C001`, ",
    );
    assert_fault(
        1,
        &FEETECH.replace("return_delay_us = 500\n", ""),
        "[[bus]]",
        "`return_delay_us` is missing",
        "",
    );
    let late = FEETECH.replace("= 500", "= 509");
    assert_fault(1, &late, "return_delay_us", "`return_delay_us`", "from 0 to 508");
    assert_fault(
        1,
        &format!("{FEETECH}watchdog_ms = 100\n"),
        "watchdog_ms",
        "unknown key",
        "valid names",
    );
    let bulk = format!("{DYNAMIXEL}read = \"bulk\"\n");
    assert_fault(1, &bulk, "read", "\"bulk\"", "`sync`");
    let again = format!("{CYBERGEAR}[[bus]]\nnumber = 1\n{MIT}");
    assert_fault(1, &again, "number = 1", "as in an earlier [[bus]] table", "keep one");
    assert_fault(1, &format!("{MIT}control = 1\n"), "control", "control", "string");
    assert_fault(0, &format!("{MAESTRO}crc = 1\n"), "crc", "`crc`", "true or false");
}

#[test]
fn a_bus_that_cannot_be_is_refused() {
    assert_fault(2, MIT, "number = 2", "a bus without motors", "leave out the table");
    assert_fault(
        0,
        &format!("{MIT}bit_rate = 115_200\n"),
        "bit_rate",
        "is 115200",
        "125000, 250000",
    );
    for rate in ["2_000_000", "300_000"] {
        let fast = FEETECH.replace("1_000_000", rate);
        let expected =
            format!("is {}, a rate that STS3215-C018 servos do not have", rate.replace('_', ""));
        assert_fault(1, &fast, "bit_rate", &expected, "1000000, 500000, 250000");
    }
    for rate in ["1_500_000", "250_000"] {
        let odd = DYNAMIXEL.replace("1_000_000", rate);
        let expected =
            format!("is {}, a rate that XM430-W210 servos do not have", rate.replace('_', ""));
        assert_fault(1, &odd, "bit_rate", &expected, "57600, 115200, 1000000");
    }
    let flat = ODRIVE.replace("-9", "0");
    assert_fault(1, &flat, "reduction", "is 0", "motor turns per joint turn");
    let motor = ODRIVE.replace("0.05", "-0.05");
    assert_fault(1, &motor, "torque_constant", "is -0.05 N·m/A", "8.27");
    let range = CYBERGEAR.replace("12.5", "12.0");
    assert_fault(1, &range, "max_position_rad", "is 12 rad", "12.5 or 12.566");
    let alone = "protocol = \"rollwalk\"\ncontrol = \"on_controller\"\n";
    assert_fault(0, alone, "control", "Rollwalk has no torque command", "leave out `control`");
    // A bus that the controller does not have is a fault only of the motor on it.
    let text = ROBOT.replace("bus = 1", "bus = 4");
    let error = Robot::from_toml("arm.toml", &format!("{text}\n[[bus]]\nnumber = 4\n{MIT}"));
    let error = error.expect_err("it is wrong");
    let found: Vec<_> = error.faults().map(|fault| (&fault.message, &fault.help)).collect();
    assert_eq!(found.len(), 1, "{found:#?}");
    assert!(found[0].0.contains("`wheel`: `bus` must be"), "{found:#?}");
    let assumed = format!("{MIT}pose = \"assumed_safe\"\n");
    assert_fault(0, &assumed, "pose", "AK80-9 reports its position", "leave out `pose`");
}

/// Tests that robots from JSON are checked like robot files. Plan files contain robots as JSON.
#[test]
fn numbers_that_no_drive_can_be_set_to_are_refused_from_json_too() {
    let json = |lines: &str| serde_json::to_string(&read(1, lines).unwrap()).unwrap();
    let maestro = Protocol::Maestro(Maestro {
        device: Some(12),
        crc: false,
        set_multiple: true,
        pulse: Pulse { limits_us: (500.0, 2500.0), ..Pulse::default() },
    });
    let text = ROBOT.replace("id = 70", "id = 3");
    let mut board = Robot::from_toml("arm.toml", &text).unwrap();
    board.buses.insert(0, Bus { protocol: maestro, ..Bus::default() });
    let board = serde_json::to_string(&board).unwrap();
    for (text, key, [last, beyond], expected) in [
        (json(&format!("{MIT}master_id = 0\n")), "master", ["2047", "2048"], "`master_id` is 2048"),
        (json(ODRIVE), "estimates_hz", ["1", "0"], "`estimates_hz` is 0 Hz"),
        (json(ODRIVE), "estimates_hz", ["10000", "10001"], "`estimates_hz` is 10001 Hz"),
        (json(DYNAMIXEL), "watchdog_20ms", ["127", "128"], "`watchdog_ms` is 2560 ms"),
        (json(DYNAMIXEL), "return_delay_us", ["508", "509"], "`return_delay_us` is 509 µs"),
        (board, "device", ["127", "128"], "`device` is 128"),
    ] {
        let (before, rest) = text.split_once(&format!("\"{key}\":")).unwrap();
        let rest = rest.trim_start_matches(|c: char| c.is_ascii_digit());
        let with = |number| {
            let text = format!("{before}\"{key}\":{number}{rest}");
            serde_json::from_str::<Robot>(&text).unwrap().validate()
        };
        assert_eq!(with(last), Ok(()), "{key}");
        let error = with(beyond).expect_err("it is wrong");
        assert_eq!(error.violations.len(), 1, "{error}");
        assert!(error.to_string().contains(expected), "{error}");
    }
}

/// Tests faults that the self-test of a controller does not detect, and that would leave a drive silent.
#[test]
fn what_an_actuator_cannot_be_told_is_found_at_the_motor() {
    // Limits of the data sheet, above those of the bus.
    assert_fault(0, ODRIVE, "id = 70", "is 70, beyond the range of ODrive on bus 0", "0 to 63");
    let wheel = MAESTRO;
    assert_fault(1, wheel, "bus = 1", "cannot drive this motor", "wheel speed");
    let text = |from: &str, to: &str, lines: &str| {
        assert!(ROBOT.contains(from));
        let text = format!("{}\n[[bus]]\nnumber = 1\n{lines}", ROBOT.replace(from, to));
        let error = Robot::from_toml("arm.toml", &text).expect_err("it is wrong");
        let fault = error.faults().next().unwrap();
        let line = text.lines().nth(fault.line - 1).unwrap().to_owned();
        (line, format!("{} ({})", fault.message, fault.help))
    };
    for (from, to, lines, expected) in [
        ("speed_max_rad_s = 5.0", "speed_max_rad_s = 40.0", CYBERGEAR, "at most 30 rad/s"),
        ("torque_max_nm = 1.5", "torque_max_nm = 13.0", CYBERGEAR, "at most 12 N·m"),
        (
            "torque_max_nm = 1.5",
            "torque_max_nm = 30.0",
            DYNAMIXEL,
            "at most 4.18 N·m; 30 kg·cm would be 2.94 N·m",
        ),
        ("torque_max_nm = 1.5", "torque_max_nm = 4.5", DYNAMIXEL, "at most 4.18"),
        ("kd_nm_s_rad = 1.0", "kd_nm_s_rad = 5.5", MIT, "at most 5 N·m·s/rad"),
        // No frame limits its torque: the drive may apply the full scale.
        ("torque_max_nm = 1.5", "torque_max_nm = 18.5", MIT, "at most 18 N·m"),
        ("kd_nm_s_rad = 1.0", "kd_nm_s_rad = 0", ODRIVE, "give kd above 0"),
        ("speed_max_rad_s = 5.0", "speed_max_rad_s = 9.0", DYNAMIXEL, "at most 7.91"),
        ("speed_max_rad_s = 5.0", "speed_max_rad_s = 4.8", FEETECH, "at most 4.71"),
    ] {
        let (line, said) = text(from, to, lines);
        assert_eq!(line, to, "{said}");
        assert!(said.contains("end effector `wheel`") && said.contains(expected), "{said}");
    }
}
