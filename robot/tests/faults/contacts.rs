//! Tests of the kinds of contact in robot files.

use super::*;
use rollwalk_robot::{Contact, RollingDrag, SoftMaterial};

/// Tiny robot with another contact instead of its foot.
fn with_contact(lines: &str) -> Robot {
    let text = ROBOT.replacen("contact = \"point_foot\"", lines, 1);
    Robot::from_toml("tiny.toml", &text).unwrap()
}

#[test]
fn every_kind_of_contact_is_read_and_mirrored() {
    let axis = "axis_in_link = [0.3, 0.0, 0.4]";
    let left = nalgebra::Vector3::new(0.6, 0.0, 0.8);
    let check = |lines: &str, of: &dyn Fn(nalgebra::Vector3<f64>) -> Contact| {
        let robot = with_contact(&format!("{lines}\n{axis}"));
        assert_eq!(robot.end_effectors[1].contact, of(left));
        // Mirrored axes become −M a, so that an axis across the limb keeps its sign.
        assert_eq!(robot.end_effectors[2].contact, of(-left));
        // Parts without motor have no channel: shoulder, its wheel and two hips.
        assert_eq!(robot.controller_config().unwrap().channels.len(), 4);
    };
    check("contact = \"welded_wheel\"", &|axis_in_link| Contact::WeldedWheel { axis_in_link });
    let drag = |rolling_drag_s_m| RollingDrag { rolling_resistance: 0.02, rolling_drag_s_m };
    check("contact = \"passive_wheel\"\nrolling_resistance = 0.02", &|axis_in_link| {
        Contact::PassiveWheel { axis_in_link, drag: drag(0.0) }
    });
    let skate = "contact = \"skate\"\nrolling_resistance = 0.02\nrolling_drag_s_m = 0.1\n\
                 blade_length_m = 0.12";
    check(skate, &|axis_in_link| Contact::Skate {
        axis_in_link,
        blade_length_m: 0.12,
        drag: drag(0.1),
    });
    let robot = with_contact(&format!("{skate}\n{axis}"));
    assert_eq!(robot.end_effectors[1].clearance_radius_m(), 0.06);
    assert_eq!(robot.end_effectors[0].clearance_radius_m(), 0.03);
}

#[test]
fn a_torque_speed_line_has_two_ends_beyond_the_limits() {
    let line = "stall_torque_nm = 3.0\nno_load_speed_rad_s = 8.0";
    let with = |line: &str| format!("torque_max_nm = 2.0\n{line}");
    let text = ROBOT.replacen("torque_max_nm = 2.0", &with(line), 1);
    let robot = Robot::from_toml("tiny.toml", &text).unwrap();
    let motor = robot.joints[0].actuator.torque_speed.unwrap();
    assert_eq!((motor.stall_torque_nm, motor.no_load_speed_rad_s), (3.0, 8.0));
    assert_eq!(tiny().joints[0].actuator.torque_speed, None);

    let fault = |line: &str| faults("torque_max_nm = 2.0", &with(line));
    let half = fault("stall_torque_nm = 3.0");
    assert_eq!(half.len(), 1, "{half:?}");
    assert!(half[0].1.contains("given without `no_load_speed_rad_s`"), "{half:?}");
    // One data sheet serves several motors; the fault names each.
    let weak = fault("stall_torque_nm = 1.0\nno_load_speed_rad_s = 8.0");
    assert!(weak[0].1.contains("`torque_max_nm` is 2 N·m"), "{weak:?}");
    assert!(weak[0].2.contains("at most 1 N·m, or correct `stall_torque_nm`"), "{weak:?}");
    let slow = fault("stall_torque_nm = 3.0\nno_load_speed_rad_s = 4.0");
    assert!(slow[0].1.contains("`speed_max_rad_s` is 5 rad/s"), "{slow:?}");
    assert!(slow[0].2.contains("at most 4 rad/s, or correct `no_load_speed_rad_s`"), "{slow:?}");
}

#[test]
fn the_middle_of_a_blade_is_below_its_link() {
    let skate = |axis: &str| {
        let lines = "contact = \"skate\"\nrolling_resistance = 0.02\nblade_length_m = 0.01";
        let text = format!("{lines}\naxis_in_link = {axis}");
        Robot::from_toml("tiny.toml", &ROBOT.replacen("contact = \"point_foot\"", &text, 1))
    };
    let blade = skate("[0.0, 0.8, 0.6]").unwrap().end_effectors[1].blade().unwrap();
    // Perpendicular to the axis; a radius of 0.01 m and half a blade of 0.005 m: 0.5 rad.
    assert!((blade.middle_in_link - nalgebra::Vector3::new(0.0, 0.6, -0.8)).norm() < 1e-12);
    assert!((blade.reach_m - 0.01 * 0.5f64.sin()).abs() < 1e-15);
    assert_eq!(tiny().end_effectors[0].blade(), None);
    let error = skate("[0.0, 0.1, 1.0]").unwrap_err();
    assert!(error.faults().any(|f| f.help.contains("not the z axis of the link")), "{error}");
}

#[test]
fn feet_can_be_soft_and_what_turns_cannot() {
    let foot = "contact = \"point_foot\"";
    let soft = |young: &str, density: &str| {
        let material = format!("young_pa = {young}, poisson = 0.3, density_kg_m3 = {density}");
        format!("{foot}\nsoft = {{ {material}, viscosity_pa_s = 5 }}")
    };
    let found = with_contact(&soft("2e5", "60.0")).end_effectors[1].soft.unwrap();
    assert_eq!((found.young_pa, found.density_kg_m3, found.viscosity_pa_s), (2e5, 60.0, 5.0));
    assert_eq!(tiny().end_effectors[1].soft, None);
    let stiff = faults(foot, &soft("2e11", "60.0"));
    assert!(stiff[0].1.contains("`young_pa` is 200000000000 Pa"), "{stiff:?}");
    assert!(stiff[0].2.contains("rubber 1e6 to 1e7"), "{stiff:?}");
    let mut large = with_contact(&soft("2e5", "500.0"));
    large.end_effectors[1].radius_m = 0.05;
    let heavy = large.validate().unwrap_err().to_string();
    assert!(heavy.contains("`density_kg_m3` is 500 kg/m³"), "{heavy}");
    // A rod that ends in a ball. Its mass is sufficient, its inertia about the rod is not.
    let mut rod = with_contact(&soft("2e5", "100.0"));
    let foot_link = rod.end_effectors[1].link;
    rod.end_effectors[1].radius_m = 0.03;
    rod.links[foot_link].mass_kg = 0.05;
    let thin = nalgebra::Vector3::new(5e-5, 5e-5, 2e-6);
    rod.links[foot_link].inertia_in_link_kg_m2 = nalgebra::Matrix3::from_diagonal(&thin);
    let hollow = rod.validate().unwrap_err();
    let told: Vec<&str> = hollow.violations.iter().map(|of| of.field).collect();
    assert_eq!(told, ["inertia_in_link_kg_m2"], "{hollow}");
    assert!(hollow.violations[0].help.contains("without the feet"), "{hollow}");
    let wheel =
        "contact = \"passive_wheel\"\naxis_in_link = [0.0, 1.0, 0.0]\nrolling_resistance = 0.02";
    let wheel = faults(foot, &soft("2e5", "60.0").replace(foot, wheel));
    assert!(wheel[0].1.contains("soft"), "{wheel:?}");
    let less = faults(foot, &format!("{foot}\nsoft = {{ young_pa = 2e5 }}"));
    assert!(less[0].1.contains("poisson"), "{less:?}");
}

#[test]
fn legbot_carries_feet_of_foam() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/legbot.toml");
    let mut robot = Robot::from_toml("legbot", &std::fs::read_to_string(path).unwrap()).unwrap();
    for foot in &mut robot.end_effectors {
        // Foam: soft feet as in docs/identification.md, Retargeting.
        foot.soft = Some(SoftMaterial {
            young_pa: 1e5,
            poisson: 0.3,
            density_kg_m3: 80.0,
            viscosity_pa_s: 5.0,
        });
    }
    robot.validate().unwrap();
}
