//! `ros2_control` of ROS 2: the section of a URDF that names interfaces of joints and wheels, and parameters of a controller
//! manager. <https://control.ros.org/master/doc/getting_started/getting_started.html>.
//!
//! Joints accept positions and driven wheels speeds, like the controller's channels. Both report angle, speed and torque.
//! Parts without a motor, such as casters, have no interface.

use crate::bodies::{Body, Hinge, HingeOrigin, driven};
use crate::urdf::urdf_with;
use crate::xml::Xml;
use rollwalk_robot::{Robot, Solid};
use serde_json::json;
use std::io;

/// Hardware plugin in every installation of `ros2_control`. It copies commands to states, without a robot.
pub const MOCK: &str = "mock_components/GenericSystem";

/// Rate of the controller manager, Hz: its default.
const UPDATE_RATE_HZ: u32 = 100;

/// Writes a robot as [`urdf`](crate::urdf) does, with a section for the hardware `plugin`, the name of a
/// `hardware_interface::SystemInterface`.
///
/// # Errors
/// None: the text is written to memory.
pub fn urdf_with_control(robot: &Robot, parts: &[Vec<Solid>], plugin: &str) -> io::Result<String> {
    urdf_with(robot, parts, |xml, bodies| {
        let system = [("name", robot.name.clone()), ("type", "system".into())];
        xml.element("ros2_control", &system, |xml| {
            xml.element("hardware", &[], |xml| {
                xml.text("plugin", &[], plugin)?;
                // Wheels rotate as commanded.
                let turns = plugin == MOCK;
                if turns { param(xml, "calculate_dynamics", &true) } else { Ok(()) }
            })?;
            channels(bodies).into_iter().try_for_each(|of| interfaces(xml, of))
        })
    })
}

/// Parameters of a controller manager, as YAML: a broadcaster of joint states, a trajectory controller for the joints, a
/// velocity controller for the driven wheels.
pub fn controllers(robot: &Robot) -> String {
    let bodies = crate::bodies::bodies(robot, &[], crate::bodies::Blades::Fixed);
    let (joints, wheels): (Vec<_>, Vec<_>) =
        channels(&bodies).into_iter().partition(|of| matches!(of.of, HingeOrigin::Joint { .. }));
    let mut kinds =
        vec![("joint_state_broadcaster", "joint_state_broadcaster/JointStateBroadcaster")];
    let mut parameters = String::new();
    if !joints.is_empty() {
        let name = "joint_trajectory_controller";
        kinds.push((name, "joint_trajectory_controller/JointTrajectoryController"));
        parameters += &group(name, &joints);
        parameters +=
            "    command_interfaces: [position]\n    state_interfaces: [position, velocity]\n";
    }
    if !wheels.is_empty() {
        let name = "wheel_velocity_controller";
        kinds.push((name, "velocity_controllers/JointGroupVelocityController"));
        parameters += &group(name, &wheels);
    }
    let kinds = kinds.iter().map(|(name, kind)| format!("    {name}:\n      type: {kind}\n"));
    format!(
        "# {}, written by rollwalk robot export\ncontroller_manager:\n  ros__parameters:\n    \
         update_rate: {UPDATE_RATE_HZ}\n{}{parameters}",
        robot.name,
        kinds.collect::<String>()
    )
}

/// Controller of some joints. A JSON string is also a YAML string.
fn group(name: &str, hinges: &[&Hinge<'_>]) -> String {
    let joints = hinges.iter().map(|of| format!("      - {}\n", json!(of.name)));
    format!("\n{name}:\n  ros__parameters:\n    joints:\n{}", joints.collect::<String>())
}

/// Hinges with motors in the order of channels.
fn channels<'b>(bodies: &'b [Body<'b>]) -> Vec<&'b Hinge<'b>> {
    let mut all: Vec<_> = driven(bodies).collect();
    all.sort_by_key(|of| of.of.order());
    all
}

fn interfaces(xml: &mut Xml, of: &Hinge<'_>) -> io::Result<()> {
    let (command, min, max, start) = match of.of {
        HingeOrigin::Joint { joint, .. } => {
            let in_unit = |angle_rad: f64| angle_rad * joint.per_rad();
            let range = [joint.position_min_rad, joint.position_max_rad].map(in_unit);
            ("position", range[0], range[1], in_unit(joint.nominal_rad))
        }
        HingeOrigin::Wheel { .. } => {
            let speed_rad_s = of.of.actuator().map_or(0.0, |motor| motor.speed_max_rad_s);
            ("velocity", -speed_rad_s, speed_rad_s, 0.0)
        }
    };
    xml.element("joint", &[("name", of.name.clone())], |xml| {
        xml.element("command_interface", &[("name", command.into())], |xml| {
            param(xml, "min", &min)?;
            param(xml, "max", &max)
        })?;
        xml.element("state_interface", &[("name", "position".into())], |xml| {
            param(xml, "initial_value", &start)
        })?;
        ["velocity", "effort"]
            .iter()
            .try_for_each(|name| xml.empty("state_interface", &[("name", (*name).into())]))
    })
}

fn param(xml: &mut Xml, name: &str, value: &dyn ToString) -> io::Result<()> {
    xml.text("param", &[("name", name.into())], &value.to_string())
}
