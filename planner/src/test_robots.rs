//! Robots and random points for tests.

use crate::motion::{Ends, Footing, Goal, HeightLimit, Motion, Subject, Target};
use crate::plan::Placement;
use crate::problem::Unknowns;
use crate::problem::variables::Layout;
use nalgebra::Vector3;
use rollwalk_multibody::euler::Model;
use rollwalk_robot::{
    Actuator, Contact, EndEffector, JointRatio, JointSpring, Linkage, Robot, RollingDrag,
    TorqueSpeedLine,
};

/// Shipped robots with driven wheels, free wheels and feet, and variants of them: AgileBot on welded wheels, AgileBot with
/// torque-speed lines and coupled motors, AgileBot with passive joints, AgileBot with prismatic joints, SwizzleBot on two inline
/// wheels per leg with drag, and SwizzleBot on skates.
pub fn all() -> Vec<Robot> {
    let [agilebot, swizzlebot, creature3] = [
        ("agilebot.toml", include_str!("../../shipped/robots/agilebot.toml")),
        ("swizzlebot.toml", include_str!("../../shipped/robots/swizzlebot.toml")),
        ("creature3.toml", include_str!("../../shipped/robots/creature3.toml")),
    ]
    .map(|(name, text)| Robot::from_toml(name, text).expect("shipped robots are valid"));
    let made = [
        welded(&agilebot),
        coupled(with_lines(&agilebot)),
        sprung(&agilebot),
        sliding(&agilebot),
        inline(&swizzlebot),
        on_skates(&swizzlebot),
    ];
    made.iter().for_each(|robot| robot.validate().expect("made robots are valid"));
    [agilebot, swizzlebot, creature3].into_iter().chain(made).collect()
}

/// Shipped robots that [`all`] leaves out.
pub fn others() -> Vec<Robot> {
    [
        ("agilebot_sprint.toml", include_str!("../../shipped/robots/agilebot_sprint.toml")),
        ("anymal_wheels.toml", include_str!("../../shipped/robots/anymal_wheels.toml")),
        ("brainbot.toml", include_str!("../../shipped/robots/brainbot.toml")),
        ("car.toml", include_str!("../../shipped/robots/car.toml")),
        ("car_tilted.toml", include_str!("../../shipped/robots/car_tilted.toml")),
        ("dinobot.toml", include_str!("../../shipped/robots/dinobot.toml")),
        ("legbot.toml", include_str!("../../shipped/robots/legbot.toml")),
        ("skatebot.toml", include_str!("../../shipped/robots/skatebot.toml")),
        ("skaterbot.toml", include_str!("../../shipped/robots/skaterbot.toml")),
        ("swizzlebot2.toml", include_str!("../../shipped/robots/swizzlebot2.toml")),
        ("swizzlebot4.toml", include_str!("../../shipped/robots/swizzlebot4.toml")),
        ("swizzlebot5.toml", include_str!("../../shipped/robots/swizzlebot5.toml")),
    ]
    .map(|(name, text)| Robot::from_toml(name, text).expect("shipped robots are valid"))
    .into()
}

/// Returns the robot with its wheels welded to their links.
pub fn welded(robot: &Robot) -> Robot {
    changed(robot, "welded", |ee, axis_in_link, _| {
        vec![EndEffector { contact: Contact::WeldedWheel { axis_in_link }, ..ee }]
    })
}

/// Returns the robot with torque-speed lines for all motors. The lines exceed the limits of the motors.
fn with_lines(robot: &Robot) -> Robot {
    let with_line = |motor: &mut Actuator| {
        motor.torque_speed = Some(TorqueSpeedLine {
            stall_torque_nm: 1.5 * motor.torque_max_nm,
            no_load_speed_rad_s: 1.2 * motor.speed_max_rad_s,
        });
    };
    let mut robot = Robot { name: format!("{}_lines", robot.name), ..robot.clone() };
    robot.joints.iter_mut().for_each(|joint| with_line(&mut joint.actuator));
    for end_effector in &mut robot.end_effectors {
        if let Some(actuator) = end_effector.contact.actuator_mut() {
            with_line(actuator);
        }
    }
    robot
}

/// Returns AgileBot with belts and springs at its knees, and with a differential for roll and steering of each leg. The first
/// knee has a crank at the hip and a rod, which close in every pose.
fn coupled(mut robot: Robot) -> Robot {
    robot.name += "_coupled";
    for hip in (0..robot.joints.len()).step_by(4) {
        let [roll, pitch, knee, steer] = [0, 1, 2, 3].map(|k| hip + k);
        let rows = [
            (roll, [(roll, 1.0), (steer, 0.5)]),
            (knee, [(pitch, 1.3), (knee, 1.3)]),
            (steer, [(roll, 0.8), (steer, -1.0)]),
        ];
        for (motor, row) in rows {
            let row = row.map(|(joint, ratio)| JointRatio { joint, ratio });
            robot.joints[motor].motor_per_joint = row.into();
        }
        let spring = JointSpring { stiffness_nm_rad: 3.0, rest_rad: -0.4, damping_nm_s_rad: 0.05 };
        robot.joints[knee].spring = Some(spring);
    }
    let knee = &mut robot.joints[2];
    knee.motor_per_joint.clear();
    knee.linkage = Some(Linkage {
        link: 1,
        pivot_in_link_m: Vector3::new(0.0, 0.05, 0.0),
        pin_in_link_m: Vector3::new(0.033, 0.05, -0.0226),
        axis_in_link: Vector3::y(),
        rod_in_child_m: Vector3::new(0.0109, 0.0, -0.028),
        nominal_rad: 0.2,
    });
    robot
}

/// Returns AgileBot with springs instead of motors at its front knees, and at the last joint of its other legs.
fn sprung(robot: &Robot) -> Robot {
    let mut robot = Robot { name: format!("{}_sprung", robot.name), ..robot.clone() };
    for (leg, hip) in (0..robot.joints.len()).step_by(4).enumerate() {
        let joint = &mut robot.joints[if leg < 2 { hip + 2 } else { hip + 3 }];
        let rest_rad = joint.nominal_rad - 0.1;
        joint.actuator = Actuator::none();
        joint.spring =
            Some(JointSpring { stiffness_nm_rad: 12.0, rest_rad, damping_nm_s_rad: 0.05 });
    }
    robot
}

/// Returns AgileBot with prismatic joints at different places of its legs: knees, hips, and both ends of a leg.
fn sliding(robot: &Robot) -> Robot {
    let mut robot = Robot { name: format!("{}_sliding", robot.name), ..robot.clone() };
    for (joint, travel_m_per_rad) in [(2, 0.1), (4, 0.2), (6, 0.05), (9, 0.1), (12, 0.1), (15, 0.3)]
    {
        robot.joints[joint].travel_m_per_rad = Some(travel_m_per_rad);
    }
    robot
}

/// Returns the robot with its free wheels replaced by roller blades: a toe and a heel wheel in line, with drag.
pub fn inline(robot: &Robot) -> Robot {
    changed(robot, "inline", |ee, axis_in_link, drag| {
        let drag = RollingDrag { rolling_drag_s_m: 0.05, ..drag };
        let wheel = |part: &str, x: f64| EndEffector {
            name: format!("{}_{part}", ee.name),
            center_in_link_m: ee.center_in_link_m + Vector3::new(x, 0.0, 0.0),
            contact: Contact::PassiveWheel { axis_in_link, drag },
            ..ee.clone()
        };
        vec![wheel("toe", 0.04), wheel("heel", -0.04)]
    })
}

/// Returns the robot with its free wheels replaced by blades with a curvature radius of 0.5 m.
fn on_skates(robot: &Robot) -> Robot {
    changed(robot, "skates", |ee, axis_in_link, drag| {
        let radius_m = 0.5;
        let center_in_link_m = ee.center_in_link_m + Vector3::z() * (radius_m - ee.radius_m);
        let contact = Contact::Skate { axis_in_link, blade_length_m: 0.12, drag };
        vec![EndEffector { radius_m, center_in_link_m, contact, ..ee }]
    })
}

/// Returns the robot with other end effectors. `change` receives each end effector with its axis and drag.
fn changed(
    robot: &Robot,
    how: &str,
    change: impl Fn(EndEffector, Vector3<f64>, RollingDrag) -> Vec<EndEffector>,
) -> Robot {
    let no_drag = RollingDrag { rolling_resistance: 0.0, rolling_drag_s_m: 0.0 };
    let ends = robot.end_effectors.iter().flat_map(|ee| {
        let axis = ee.contact.axis_in_link().copied().unwrap_or_else(Vector3::y);
        change(ee.clone(), axis, ee.contact.drag().unwrap_or(no_drag))
    });
    Robot { name: format!("{}_{how}", robot.name), end_effectors: ends.collect(), ..robot.clone() }
}

/// Uniform random numbers in −1..1 from a linear congruential generator (Knuth's MMIX constants).
pub fn uniform(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// Random slots and a fixed placement. Rotations between consecutive slots are well below half a revolution.
pub fn random_unknowns(model: &Model, slots: usize, seed: u64) -> Unknowns {
    let layout = Layout::new(model);
    let mut random = uniform(seed);
    let slots = (0..slots)
        .map(|_| {
            let mut vars = layout.scale.map(|scale| 0.4 * scale * random());
            for dof in 0..layout.dofs {
                vars[dof] += model.nominal_q()[dof];
            }
            vars
        })
        .collect();
    let placement = Placement { offset_m: [0.3, -0.2], yaw_rad: 0.5 };
    Unknowns { slots, placement }
}

/// Short motion in which every end effector swings.
pub fn motion(robot: &Robot, ends: Ends) -> Motion {
    let count = robot.end_effectors.len();
    let stance = (0..5).map(|i| (0..count).map(|j| (i + j) % 4 != 1).collect()).collect();
    Motion {
        name: "test".into(),
        duration_s: 0.5,
        ends,
        stance,
        swing_height_m: 0.03,
        goal: Goal { forward_m: Some(0.1), left_m: Some(0.02), turn_rad: Some(0.2) },
        posture_rad: robot.joints.iter().map(|joint| joint.nominal_rad).collect(),
        lying_rad: None,
        held_wheels: vec![false; count],
        targets: Vec::new(),
        heights: Vec::new(),
        reserve: Default::default(),
        terrain: None,
        ground: Footing::default(),
        needs_feedback: None,
        timing: Default::default(),
    }
}

/// Targets of every kind for [`motion`]: at a sample, between samples, and in the half intervals at both ends.
pub fn targets() -> Vec<Target> {
    let target = |of, at_s, heading_rad| Target {
        of,
        at_s,
        position_m: [Some(0.1), Some(-0.02), Some(0.2)],
        velocity_m_s: [Some(0.3), Some(0.1), Some(-0.1)],
        heading_rad,
    };
    vec![
        target(Subject::Com, 0.01, None),
        target(Subject::Body, 0.23, Some(0.1)),
        Target {
            position_m: [Some(0.1), None, None],
            ..target(Subject::EndEffector(0), 0.31, None)
        },
        target(Subject::Com, 0.49, None),
    ]
}

/// Height limits of every kind for [`motion`]. The robots violate some of them.
pub fn heights() -> Vec<HeightLimit> {
    let limit = |of, above_m, below_m| HeightLimit { of, from_s: 0.1, to_s: 0.3, above_m, below_m };
    vec![
        limit(Subject::Com, Some(0.1), Some(0.12)),
        limit(Subject::Body, Some(0.4), None),
        limit(Subject::EndEffector(0), None, Some(0.3)),
    ]
}
