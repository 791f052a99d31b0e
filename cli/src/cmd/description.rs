//! Text description of a robot: tree, joints and end effectors.

use rollwalk_robot::{Actuator, Robot};
use rollwalk_terminal::output::Table;
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
    for joint in &robot.joints {
        let Actuator { model, speed_max_rad_s, torque_max_nm, bus, id, .. } = &joint.actuator;
        joints.row([
            joint.name.clone(),
            format!("{:.3}", joint.position_min_rad),
            format!("{:.3}", joint.position_max_rad),
            format!("{:.3}", joint.nominal_rad),
            format!("{speed_max_rad_s:.2}"),
            format!("{torque_max_nm:.2}"),
            model.clone(),
            format!("{bus}:{id}"),
        ]);
    }
    let _ = writeln!(text, "\n{}", joints.render());

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
