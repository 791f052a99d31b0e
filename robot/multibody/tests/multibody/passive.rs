//! Tests of passive joints of a standing robot against closed forms.

use crate::closed_forms::actuator;
use crate::robots::body;
use nalgebra::{Isometry3, Matrix3, Vector3};
use rollwalk_multibody::{PassiveLoad, Standing, Tree, passive_loads, warnings};
use rollwalk_robot::{
    Actuator, Contact, EndEffector, GRAVITY_M_S2, Joint, JointSpring, Link, Robot,
};
use std::f64::consts::TAU;

const MASS_KG: f64 = 8.0;
const FAR_M: f64 = 1e3;
const HIP_M: f64 = 0.4;
/// Horizontal lever of each foot in front of its ankle, m, and its height below the ankle.
const LEVER_M: f64 = 0.06;
const DROP_M: f64 = 0.02;
const FOOT_KG: f64 = 1e-6;

/// Robot on four straight legs of a driven hip and a passive ankle, with a foot in front of each ankle.
fn on_ankles(spring: JointSpring, nominal_rad: f64) -> Robot {
    let mut robot = body(MASS_KG, [0.1, 0.1, 0.1]);
    robot.links[0].com_in_link_m = Vector3::new(LEVER_M, 0.0, 0.0);
    // Hips are so far apart that forces stay equal as feet turn.
    let hips = [[FAR_M, FAR_M], [FAR_M, -FAR_M], [-FAR_M, FAR_M], [-FAR_M, -FAR_M]];
    for (leg, [x, y]) in hips.iter().enumerate() {
        for (name, parent, origin, nominal_rad, actuator, spring) in [
            ("hip", 0, [*x, *y, 0.0], 0.0, actuator(0.01), None),
            ("ankle", 2 * leg + 1, [0.0, 0.0, -HIP_M], nominal_rad, Actuator::none(), Some(spring)),
        ] {
            robot.joints.push(Joint {
                name: format!("{name} {leg}"),
                parent,
                child: robot.links.len(),
                parent_from_joint: Isometry3::translation(origin[0], origin[1], origin[2]),
                axis_in_joint: Vector3::y(),
                travel_m_per_rad: None,
                position_min_rad: -1.0,
                position_max_rad: 1.0,
                nominal_rad,
                actuator,
                motor_per_joint: Vec::new(),
                linkage: None,
                spring,
            });
            robot.links.push(Link {
                name: format!("{name} link {leg}"),
                mass_kg: FOOT_KG,
                com_in_link_m: Vector3::zeros(),
                inertia_in_link_kg_m2: Matrix3::identity() * FOOT_KG,
                shapes: vec![],
            });
        }
        robot.end_effectors.push(EndEffector {
            name: format!("foot {leg}"),
            link: robot.links.len() - 1,
            center_in_link_m: Vector3::new(LEVER_M, 0.0, -DROP_M),
            radius_m: 0.01,
            friction_coefficient: 0.7,
            contact: Contact::PointFoot,
            soft: None,
        });
    }
    robot
}

fn loads(robot: &Robot) -> (Vec<PassiveLoad>, Vec<String>) {
    let tree = Tree::new(robot);
    let standing = Standing::new(&tree).expect("it stands");
    (passive_loads(&tree, &standing), warnings(&tree, &standing))
}

#[test]
fn an_ankle_yields_by_force_times_lever_over_stiffness() {
    let force_n = MASS_KG * GRAVITY_M_S2 / 4.0;
    let lever_nm = force_n * LEVER_M;
    for stiffness_nm_rad in [12.0, 120.0, 1200.0] {
        let spring = JointSpring { stiffness_nm_rad, rest_rad: 0.0, damping_nm_s_rad: 0.002 };
        let (loads, _) = loads(&on_ankles(spring, 0.0));
        assert_eq!(loads.len(), 4);
        for load in loads {
            let at_rad = load.stands_at_rad.expect("stiff enough");
            // The ground turns the toe up, about −y. The lever is that of the turned foot.
            let (sine, cosine) = at_rad.sin_cos();
            let turned_m = LEVER_M * cosine - DROP_M * sine;
            let balance_nm = stiffness_nm_rad * at_rad + force_n * turned_m;
            assert!(balance_nm.abs() < 1e-4 * lever_nm, "{balance_nm} N·m at {at_rad} rad");
            // To first order in the deflection: F l / k.
            let yields_rad = lever_nm / stiffness_nm_rad;
            assert!((at_rad + yields_rad).abs() < 0.5 * yields_rad * yields_rad, "{at_rad}");
            assert!((load.nominal_nm - lever_nm).abs() < 1e-4 * lever_nm, "{}", load.nominal_nm);
            let rate_rad_s = (stiffness_nm_rad / FOOT_KG).sqrt();
            assert!((load.natural_hz * TAU / rate_rad_s - 1.0).abs() < 1e-9);
            let ratio = 0.002 / (2.0 * FOOT_KG * rate_rad_s);
            assert!((load.damping_ratio / ratio - 1.0).abs() < 1e-9);
        }
    }
}

#[test]
fn ankles_that_do_not_carry_the_robot_are_named_with_a_value_that_does() {
    let lever_nm = MASS_KG * GRAVITY_M_S2 / 4.0 * LEVER_M;
    let spring = |stiffness_nm_rad, rest_rad| JointSpring {
        stiffness_nm_rad,
        rest_rad,
        damping_nm_s_rad: 0.0,
    };
    // Legs so far apart raise other warnings, too.
    let is_of_springs =
        |text: &String| ["`rest_rad`", "too soft"].iter().any(|of| text.contains(of));
    let springs = |spring, nominal_rad| {
        let (_, warnings) = loads(&on_ankles(spring, nominal_rad));
        warnings.into_iter().filter(|warning| is_of_springs(warning)).collect::<Vec<_>>()
    };
    // The load grows by F h as the ankle bends, 0.39 N·m/rad: the foot is below it.
    let soft = springs(spring(0.3, lever_nm / 0.3), 0.0);
    assert!(soft[0].contains("too soft to stand"), "{soft:?}");
    assert!(
        soft[0].contains("grows by 0.39 N·m/rad") && soft[0].contains("at least 0.78"),
        "{soft:?}"
    );
    let unloaded = springs(spring(40.0, 0.0), 0.0);
    let rest = format!("give `rest_rad` = {:.3}", lever_nm / 40.0);
    assert!(unloaded[0].contains(&rest), "{unloaded:?} lacks {rest}");
    assert!(unloaded[0].contains("not at `nominal_rad` 0"), "{unloaded:?}");
    let beyond = springs(spring(0.85, 0.0), 0.0);
    assert!(beyond[0].contains("within the limits of the joint"), "{beyond:?}");
    assert_eq!(springs(spring(40.0, lever_nm / 40.0), 0.0), [""; 0]);
}
