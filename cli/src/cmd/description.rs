//! Text description of a robot: tree, joints and end effectors.

use rollwalk_robot::{Actuator, Channel, Joint, JointRatio, Robot};
use rollwalk_terminal::output::{Table, fixed};
use std::fmt::Write;

/// Describes the robot as text: tree, joints, end effectors.
pub fn describe(robot: &Robot) -> String {
    let wheels = robot.end_effectors.iter().filter(|e| e.contact.rolls()).count();
    let mut text = format!(
        "{}: {:.3} kg, {} links, {} joints, {} wheels, {} feet\n\n",
        robot.name,
        robot.total_mass_kg(),
        robot.links.len(),
        robot.joints.len(),
        wheels,
        robot.end_effectors.len() - wheels,
    );
    branch(robot, 0, "", &mut text);

    let mut joints = Table::new([
        "joint",
        "min rad",
        "max rad",
        "nominal rad",
        "rad/s",
        "N·m",
        "servo",
        "bus:id",
    ]);
    for joint in robot.joints.iter().filter(|joint| !joint.is_prismatic()) {
        let Actuator { model, speed_max_rad_s, torque_max_nm, bus, id, .. } = &joint.actuator;
        let of_motor = |text: String| if joint.is_passive() { "–".to_owned() } else { text };
        joints.row([
            joint.name.clone(),
            fixed::<3>(joint.position_min_rad),
            fixed::<3>(joint.position_max_rad),
            fixed::<3>(joint.nominal_rad),
            of_motor(format!("{speed_max_rad_s:.2}")),
            of_motor(format!("{torque_max_nm:.2}")),
            of_motor(model.clone()),
            of_motor(format!("{bus}:{id}")),
        ]);
    }
    if !robot.joints.iter().all(Joint::is_prismatic) || robot.joints.is_empty() {
        let _ = writeln!(text, "\n{}", joints.render());
    }
    if robot.joints.iter().any(Joint::is_prismatic) {
        let _ = writeln!(text, "\n{}", prismatic(robot).render());
    }
    if robot.joints.iter().any(Joint::is_coupled) {
        let _ = writeln!(text, "\n{}", couplings(robot).render());
    }
    if robot.joints.iter().any(|joint| joint.spring.is_some()) {
        let _ = writeln!(text, "\n{}", springs(robot).render());
    }

    if let Some(lag_s) = robot.joint_lag_s() {
        let _ = writeln!(
            text,
            "\njoints lag by up to kd_nm_s_rad / kp_nm_rad = {:.1} ms, because their servos accept no speed with a setpoint",
            1e3 * lag_s
        );
    }

    let mut contacts = Table::new([
        "end effector",
        "kind",
        "radius m",
        "friction",
        "rad/s",
        "N·m",
        "motor",
        "bus:id",
    ]);
    for end in &robot.end_effectors {
        let motor = end.contact.actuator();
        let of_motor = |show: &dyn Fn(&Actuator) -> String| motor.map_or("–".into(), show);
        contacts.row([
            end.name.clone(),
            end.contact.kind().into(),
            format!("{:.4}", end.radius_m),
            format!("{:.2}", end.friction_coefficient),
            of_motor(&|motor| format!("{:.2}", motor.speed_max_rad_s)),
            of_motor(&|motor| format!("{:.2}", motor.torque_max_nm)),
            of_motor(&|motor| motor.model.clone()),
            of_motor(&|motor| format!("{}:{}", motor.bus, motor.id)),
        ]);
    }
    let _ = write!(text, "\n{}", contacts.render());
    text
}

/// Motors that turn other joints than their own, with their ranges, and the speeds and torques of all motors at the joints.
fn couplings(robot: &Robot) -> Table {
    let transmission = robot.transmission();
    let ratios = transmission.nominal();
    let mut table = Table::new([
        "joint",
        "motor min rad",
        "motor max rad",
        "motor per joint, nominal pose",
        "joint rad/s",
        "joint N·m",
    ]);
    for (index, joint) in robot.joints.iter().enumerate() {
        if joint.is_passive() {
            continue;
        }
        let speed_rad_s = ratios.joint_speed_max_rad_s(robot, index);
        let torque_nm = ratios.joint_torque_max_nm(robot, index);
        let moves_alone = !joint.is_coupled() && torque_nm == joint.actuator.torque_max_nm;
        if moves_alone && speed_rad_s == joint.actuator.speed_max_rad_s {
            continue;
        }
        let channel = Channel::Joint(joint).config(robot);
        let shown = |of: &JointRatio| format!("{:.3} {}", of.ratio, robot.joints[of.joint].name);
        let shown: Vec<_> = ratios.ratios(index).iter().map(shown).collect();
        table.row([
            joint.name.clone(),
            fixed::<3>(channel.min.into()),
            fixed::<3>(channel.max.into()),
            shown.join(" + "),
            format!("{speed_rad_s:.2}"),
            format!("{torque_nm:.2}"),
        ]);
    }
    table
}

/// Prismatic joints, in metres and newtons, with the travel per radian of the servo.
fn prismatic(robot: &Robot) -> Table {
    let mut table = Table::new([
        "prismatic joint",
        "min m",
        "max m",
        "nominal m",
        "m/s",
        "N",
        "m per rad",
        "servo",
        "bus:id",
    ]);
    for joint in &robot.joints {
        let Some(travel) = joint.travel_m_per_rad else { continue };
        let Actuator { model, speed_max_rad_s, torque_max_nm, bus, id, .. } = &joint.actuator;
        let of_motor = |text: String| if joint.is_passive() { "–".to_owned() } else { text };
        table.row([
            joint.name.clone(),
            fixed::<4>(joint.position_min_rad * travel),
            fixed::<4>(joint.position_max_rad * travel),
            fixed::<4>(joint.nominal_rad * travel),
            of_motor(format!("{:.3}", speed_max_rad_s * travel)),
            of_motor(format!("{:.1}", torque_max_nm / travel)),
            format!("{travel:.5}"),
            of_motor(model.clone()),
            of_motor(format!("{bus}:{id}")),
        ]);
    }
    table
}

/// Springs and dampers of joints, with the torque of the spring in the nominal pose.
fn springs(robot: &Robot) -> Table {
    let mut table = Table::new([
        "spring of joint",
        "stiffness N·m/rad",
        "rest rad",
        "damping N·m·s/rad",
        "torque in nominal pose N·m",
    ]);
    for joint in &robot.joints {
        let Some(spring) = &joint.spring else { continue };
        table.row([
            name_with_unit(joint),
            fixed::<3>(spring.stiffness_nm_rad),
            fixed::<3>(spring.rest_rad),
            fixed::<3>(spring.damping_nm_s_rad),
            fixed::<3>(spring.torque_nm(joint.nominal_rad, 0.0)),
        ]);
    }
    table
}

/// Name of a joint, with the unit of the angles of a prismatic joint.
pub fn name_with_unit(joint: &Joint) -> String {
    match joint.travel_m_per_rad {
        Some(travel) => format!("{} (1 rad = {travel} m)", joint.name),
        None => joint.name.clone(),
    }
}

/// Draws `link` with the links below it.
fn branch(robot: &Robot, link: usize, indent: &str, text: &mut String) {
    let _ = writeln!(text, "{} ({:.3} kg)", robot.links[link].name, robot.links[link].mass_kg);
    let joints: Vec<_> = robot.joints.iter().filter(|joint| joint.parent == link).collect();
    let ends: Vec<_> = robot.end_effectors.iter().filter(|end| end.link == link).collect();
    let count = joints.len() + ends.len();
    for (number, end) in ends.iter().enumerate() {
        let fork = if number + 1 == count { "└─" } else { "├─" };
        let _ = writeln!(text, "{indent}{fork} {}", end.name);
    }
    for (number, joint) in joints.iter().enumerate() {
        let last = ends.len() + number + 1 == count;
        let (fork, rail) = if last { ("└─", "   ") } else { ("├─", "│  ") };
        let _ = write!(text, "{indent}{fork} {} → ", joint.name);
        branch(robot, joint.child, &format!("{indent}{rail}"), text);
    }
}
