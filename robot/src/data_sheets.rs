//! Comparison of a robot's motors with the catalogue: limits beyond the data sheet, and servos on a bus of another model.

use crate::catalog::{Catalog, Servo};
use crate::model::Robot;
use rollwalk_protocol::actuators::bus::Protocol;
use rollwalk_protocol::actuators::{dynamixel, feetech, mit};

/// Models of a bus's protocol: the one that the bus has, and all that it may have.
struct Models {
    model: &'static str,
    all: Vec<&'static str>,
}

impl Models {
    /// Models of a protocol whose frames depend on the servo; `None` for other protocols.
    fn new(protocol: &Protocol) -> Option<Self> {
        let (model, all) = match protocol {
            Protocol::Dynamixel(of) => {
                (of.model.name, dynamixel::table::MODELS.map(|model| model.name).to_vec())
            }
            Protocol::Feetech(of) => {
                (of.model.name, feetech::table::MODELS.map(|model| model.name).to_vec())
            }
            Protocol::Mit(of) => (of.model.name, mit::MODELS.map(|model| model.name).to_vec()),
            Protocol::CyberGear(_) => ("CyberGear", vec!["CyberGear"]),
            Protocol::Rollwalk | Protocol::Odrive(_) | Protocol::Maestro(_) => return None,
        };
        Some(Self { model, all })
    }
}

/// True if a servo is of a protocol's model. Names of servos may end with a mark of their connector, such as `-T`.
fn is_of(servo: &Servo, model: &str) -> bool {
    let rest = servo.name.strip_prefix(model);
    rest.is_some_and(|rest| ["", "-T", "-R"].contains(&rest))
}

impl Robot {
    /// Warnings about motors that contradict the catalogue of servos, one for each servo and fault. The `model` of a motor names
    /// its servo, and may have an addition after a comma.
    pub fn data_sheet_warnings(&self) -> Vec<String> {
        let catalog = Catalog::shipped();
        let mut warnings = Vec::new();
        for channel in self.channels() {
            let motor = channel.actuator();
            let name = motor.model.split(',').next().unwrap_or_default().trim();
            let Some(servo) = catalog.get(name) else { continue };
            let speed = ("speed_max_rad_s", motor.speed_max_rad_s, Some(servo.no_load_speed_rad_s));
            let torque = ("torque_max_nm", motor.torque_max_nm, servo.stall_torque_nm);
            for (field, given, most) in [speed, torque] {
                let Some(most) = most.filter(|most| given > *most) else { continue };
                warnings.push(format!(
                    "actuator {}: `{field}` is {given}, and its data sheet has {most:.3} at {} V, {}",
                    motor.model,
                    servo.voltage_v,
                    if field.starts_with("speed") { "without a load" } else { "at stall" }
                ));
            }
            let bus = self.buses.get(&motor.bus);
            let models = bus.and_then(|bus| Models::new(&bus.protocol));
            warnings.extend(models.and_then(|of| other_model(&catalog, servo, motor.bus, &of)));
        }
        let mut seen = Vec::new();
        for warning in warnings {
            if !seen.contains(&warning) {
                seen.push(warning);
            }
        }
        seen
    }
}

/// Warning about a servo on a bus of another model.
fn other_model(catalog: &Catalog, servo: &Servo, bus: u8, models: &Models) -> Option<String> {
    if is_of(servo, models.model) {
        return None;
    }
    let of_bus = catalog.servos().iter().find(|other| is_of(other, models.model));
    let volts = of_bus.map_or(String::new(), |of| format!(" ({} V)", of.voltage_v));
    let remedy = match models.all.iter().find(|model| is_of(servo, model)) {
        Some(right) => format!(
            "give this [[bus]] `model = \"{right}\"`, or move the motors to a bus of their model"
        ),
        None => format!(
            "give the motors a bus whose protocol has their model; this one has {}",
            models.all.join(", ")
        ),
    };
    Some(format!(
        "actuator {} ({} V) is on bus {bus} with `model = \"{}\"`{volts}, so torque limits and readings would be wrong: {remedy}",
        servo.name, servo.voltage_v, models.model
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Contact;
    use rollwalk_protocol::actuators::bus::Bus;

    const PUP: &str = include_str!("../../shipped/robots/pup.toml");

    /// Robot whose motors have the model of a servo, on buses of a protocol.
    fn warnings(servo: &Servo, protocol: Protocol) -> Vec<String> {
        let mut robot = Robot::from_toml("pup.toml", PUP).unwrap();
        let joints = robot.joints.iter_mut().map(|joint| &mut joint.actuator);
        let wheels = robot.end_effectors.iter_mut().filter_map(|end| match &mut end.contact {
            Contact::ActuatedWheel { actuator, .. } => Some(actuator),
            _ => None,
        });
        for actuator in joints.chain(wheels) {
            actuator.model.clone_from(&servo.name);
            actuator.speed_max_rad_s = 0.1;
            actuator.torque_max_nm = 0.1;
        }
        let numbers: Vec<u8> = robot.channels().map(|channel| channel.actuator().bus).collect();
        for number in numbers {
            robot.buses.insert(number, Bus { protocol, ..Bus::default() });
        }
        robot.data_sheet_warnings()
    }

    /// Models of all protocols on a bus, with the supply of its servos.
    fn models() -> Vec<(&'static str, Protocol, Option<f32>)> {
        let dynamixel = dynamixel::table::MODELS.into_iter().map(|model| {
            let settings = dynamixel::Dynamixel {
                model,
                return_delay_us: 0,
                reads_fast: false,
                watchdog_20ms: 5,
            };
            (model.name, Protocol::Dynamixel(settings), Some(model.supply_v()))
        });
        let feetech = feetech::table::MODELS.into_iter().map(|model| {
            let settings = feetech::Feetech { model, return_delay_us: 0 };
            (model.name, Protocol::Feetech(settings), Some(model.supply_v))
        });
        let mit = mit::MODELS.into_iter().map(|model| {
            let settings = mit::Mit { model, answers_from: mit::AnswerId::Own };
            (model.name, Protocol::Mit(settings), None)
        });
        dynamixel.chain(feetech).chain(mit).collect()
    }

    /// Pairs of a servo in the catalogue and a model of a bus give a warning unless the servo is of the model.
    #[test]
    fn a_servo_on_a_bus_of_another_model_is_named() {
        for servo in Catalog::shipped().servos() {
            for (model, protocol, _) in models() {
                let same = [model.to_owned(), format!("{model}-T"), format!("{model}-R")];
                let found = warnings(servo, protocol);
                assert_eq!(
                    found.is_empty(),
                    same.contains(&servo.name),
                    "{servo:?} {model}: {found:?}"
                );
                assert!(found.len() <= 1, "{found:?}");
            }
        }
        let catalog = Catalog::shipped();
        let on = |servo: &str, model: &str| {
            let (_, protocol, _) = models().into_iter().find(|of| of.0 == model).unwrap();
            warnings(catalog.get(servo).unwrap(), protocol)
        };
        assert_eq!(
            on("STS3215-C001", "STS3215-C018"),
            [
                "actuator STS3215-C001 (7.4 V) is on bus 0 with `model = \"STS3215-C018\"` (12 V), so torque limits and readings would be wrong: give this [[bus]] `model = \"STS3215-C001\"`, or move the motors to a bus of their model"
            ]
        );
        let other = on("AK80-6", "STS3215-C018");
        assert!(
            other[0].contains("whose protocol has their model; this one has STS3215-C001, "),
            "{other:?}"
        );
    }

    /// The supply of a simulated servo is that of the catalogue.
    #[test]
    fn models_have_the_supply_of_the_catalogue() {
        let catalog = Catalog::shipped();
        let mut compared = 0;
        for (model, _, supply_v) in models() {
            let listed = catalog.servos().iter().filter(|servo| is_of(servo, model));
            for (servo, supply_v) in listed.filter_map(|servo| Some((servo, supply_v?))) {
                assert_eq!(servo.voltage_v as f32, supply_v, "{model}");
                compared += 1;
            }
        }
        assert!(compared >= 13, "{compared}");
    }

    /// Simulated servos and torque limits of a bus follow the table of the protocol, plans the catalogue.
    #[test]
    fn models_have_the_speed_and_torque_of_the_catalogue() {
        let catalog = Catalog::shipped();
        for model in feetech::table::MODELS {
            let servo = catalog.servos().iter().find(|servo| is_of(servo, model.name));
            let Some(servo) = servo else { continue };
            let speed_rad_s = f64::from(model.max_velocity as f32 * feetech::table::STEP_RAD);
            let torque_nm = servo.stall_torque_nm.unwrap();
            // The table rounds to whole steps per second, the catalogue torques to 0.01 N·m.
            let speed = speed_rad_s / servo.no_load_speed_rad_s - 1.0;
            let torque = f64::from(model.stall_torque_nm) / torque_nm - 1.0;
            assert!(speed.abs() < 5e-4, "{}: {speed_rad_s} rad/s", model.name);
            assert!(torque.abs() < 3e-3, "{}: {torque_nm} N·m", model.name);
        }
    }

    #[test]
    fn limits_beyond_the_data_sheet_are_named_whatever_follows_the_name() {
        let mut robot = Robot::from_toml("pup.toml", PUP).unwrap();
        assert_eq!(robot.data_sheet_warnings(), [""; 0]);
        for joint in &mut robot.joints {
            joint.actuator.model = "XL330-M288-T, geared".to_owned();
            joint.actuator.torque_max_nm = 5.0;
        }
        let expected = "actuator XL330-M288-T, geared: `torque_max_nm` is 5, and its data sheet has 0.520 at 5 V, at stall";
        assert_eq!(robot.data_sheet_warnings(), [expected]);
    }
}
