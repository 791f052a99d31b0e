//! Catalogue of servos: makers' values, and the limits that motions may use.
//!
//! **Derating.** A stall torque is a short peak, at which the motor only heats up. At the no-load speed no torque is left.
//! Motions may therefore use [`TORQUE_USED`] of the stall torque and [`SPEED_USED`] of the no-load speed, as in the shipped
//! robot files. A rated torque in the catalogue replaces the derated stall torque.

use crate::document::{Document, DocumentError, Table};
use std::f64::consts::TAU;

/// Fraction of the no-load speed that joints may use.
pub const SPEED_USED: f64 = 0.75;
/// Fraction of the no-load speed that wheels may use: wheels need little torque on level ground.
pub const WHEEL_SPEED_USED: f64 = 0.85;
/// Fraction of the stall torque that motions may use.
pub const TORQUE_USED: f64 = 0.60;
/// Maximum number of servos in a catalogue.
const SERVOS_MAX: usize = 1000;

/// A servo or drive with position or speed control.
#[derive(Clone, Debug, PartialEq)]
pub struct Servo {
    /// Name in the maker's document.
    pub name: String,
    /// Name of the maker.
    pub maker: String,
    /// Supply voltage of the listed values.
    pub voltage_v: f64,
    /// Speed without load, rad/s.
    pub no_load_speed_rad_s: f64,
    /// Stall torque, N·m; `None` for drives with a rated torque only.
    pub stall_torque_nm: Option<f64>,
    /// Speed limit of a joint, rad/s.
    pub speed_max_rad_s: f64,
    /// Torque limit in a motion, N·m.
    pub torque_max_nm: f64,
    /// Mass, kg.
    pub mass_kg: f64,
    /// Default stiffness of a joint, N·m/rad; `None` if the catalogue has none.
    pub kp_nm_rad: Option<f64>,
    /// Default damping of a joint, N·m·s/rad; `None` if the catalogue has none.
    pub kd_nm_s_rad: Option<f64>,
    /// Inertia of rotor and gears at the output; `None` if the catalogue has none.
    pub armature_kg_m2: Option<f64>,
    /// Document with the maker's values.
    pub source: String,
}

/// List of servos with unique names.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Catalog {
    servos: Vec<Servo>,
}

impl Servo {
    /// Speed limit of a wheel on this servo, rad/s.
    pub fn wheel_speed_max_rad_s(&self) -> f64 {
        to_thousandth(WHEEL_SPEED_USED * self.no_load_speed_rad_s)
    }
}

impl Catalog {
    /// Returns the shipped catalogue.
    ///
    /// # Panics
    /// Never: a test reads the shipped file.
    pub fn shipped() -> Self {
        Self::from_toml("robot/servos.toml", SHIPPED).expect("the catalogue that ships is sound")
    }

    /// Parses a catalogue. `name` appears in messages only.
    ///
    /// # Errors
    /// Returns every fault of the text.
    pub fn from_toml(name: &str, text: &str) -> Result<Self, DocumentError> {
        let document = Document::parse(name, text)?;
        let catalog = catalog(&document);
        document.finish(catalog)
    }

    /// Servos in the order of the file.
    pub fn servos(&self) -> &[Servo] {
        &self.servos
    }

    /// Returns the servo with the given name.
    pub fn get(&self, name: &str) -> Option<&Servo> {
        self.servos.iter().find(|servo| servo.name == name)
    }
}

/// Text of the shipped catalogue.
const SHIPPED: &str = include_str!("../servos.toml");

fn catalog(document: &Document<'_>) -> Option<Catalog> {
    let root = document.root();
    let tables = root.tables_up_to("servo", SERVOS_MAX);
    if tables.is_empty() {
        root.fault("servo", "is missing", "no servos", "write at least one [[servo]] table");
    }
    root.done();
    let mut servos: Vec<Servo> = Vec::new();
    for table in tables {
        let span = table.clone();
        let servo = servo(table)?;
        if servos.iter().any(|other| other.name == servo.name) {
            let problem = format_args!("is \"{}\", the name of an earlier servo", servo.name);
            span.fault("name", problem, "again", "give each servo its own name");
        }
        servos.push(servo);
    }
    Some(Catalog { servos })
}

fn servo(mut table: Table<'_>) -> Option<Servo> {
    let name = table.name("name")?;
    table.call(format!("servo `{name}`"));
    let maker = table.name("maker");
    let source = table.string("source");
    let voltage_v = table.number_in("voltage_v", 1.0..=1000.0, "V");
    let speed_rev_min = table.number_in("no_load_speed_rev_min", 0.1..=100_000.0, "rev/min");
    let mass_kg = table.number_in("mass_kg", 1e-4..=100.0, "kg");
    let torque = |key| table.given(key, |table, key| table.number_in(key, 1e-4..=10_000.0, "N·m"));
    let [stall, rated] = ["stall_torque_nm", "rated_torque_nm"].map(torque);
    let positive =
        |key, unit| table.given(key, |table, key| table.number_in(key, 1e-9..=10_000.0, unit));
    let (kp_nm_rad, kd_nm_s_rad) =
        (positive("kp_nm_rad", "N·m/rad"), positive("kd_nm_s_rad", "N·m·s/rad"));
    let armature_kg_m2 = positive("armature_kg_m2", "kg·m²");
    table.done();
    let Some(torque_max_nm) = rated.or(stall.map(|stall| TORQUE_USED * stall)) else {
        let help = "give `stall_torque_nm`, or `rated_torque_nm` if the maker states a rated \
            torque";
        table.fault("stall_torque_nm", "is missing", "no torque", help);
        return None;
    };
    let no_load_speed_rad_s = speed_rev_min? * TAU / 60.0;
    Some(Servo {
        name,
        maker: maker?,
        voltage_v: voltage_v?,
        no_load_speed_rad_s: to_thousandth(no_load_speed_rad_s),
        stall_torque_nm: stall,
        speed_max_rad_s: to_thousandth(SPEED_USED * no_load_speed_rad_s),
        torque_max_nm: to_thousandth(torque_max_nm),
        mass_kg: mass_kg?,
        kp_nm_rad,
        kd_nm_s_rad,
        armature_kg_m2,
        source: source?,
    })
}

/// Rounds to three decimals. Datasheets have no more digits, and robot files read better.
fn to_thousandth(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shipped_catalogue_agrees_with_the_shipped_robots() {
        let catalog = Catalog::shipped();
        assert!(catalog.servos().len() >= 20);
        // Values of robots/agilebot.toml, which were copied from the same documents.
        for (name, speed, torque, mass) in
            [("XM430-W210-T", 6.05, 1.8, 0.082), ("XM540-W150-T", 4.16, 4.38, 0.165)]
        {
            let servo = catalog.get(name).unwrap();
            assert!((servo.speed_max_rad_s - speed).abs() < 0.005, "{servo:?}");
            assert_eq!((servo.torque_max_nm, servo.mass_kg), (torque, mass));
        }
        let rated = catalog.get("AK80-6").unwrap();
        assert_eq!((rated.torque_max_nm, rated.stall_torque_nm), (6.0, None));
        assert_eq!(catalog.get("none"), None);
    }

    #[test]
    fn faults_say_what_would_be_right() {
        const SERVO: &str = "[[servo]]\nname = \"a\"\nmaker = \"m\"\nvoltage_v = 12.0\n\
            no_load_speed_rev_min = 60.0\nstall_torque_nm = 2.0\nmass_kg = 0.1\nsource = \"s\"\n";
        let faults = |text: &str| {
            let error = Catalog::from_toml("servos.toml", text).unwrap_err();
            error.faults().map(|fault| format!("{fault}; {}", fault.help)).collect::<String>()
        };
        assert!(Catalog::from_toml("servos.toml", SERVO).is_ok());
        let twice = faults(&SERVO.repeat(2));
        assert!(twice.contains("\"a\", the name of an earlier servo"), "{twice}");
        let no_torque = faults(&SERVO.replace("stall_torque_nm = 2.0\n", ""));
        assert!(no_torque.contains("or `rated_torque_nm`"), "{no_torque}");
        let negative = faults(&SERVO.replace("mass_kg = 0.1", "mass_kg = -0.1"));
        assert!(negative.contains("`mass_kg` is -0.1"), "{negative}");
        assert!(faults("").contains("`servo` is missing"));
    }
}
