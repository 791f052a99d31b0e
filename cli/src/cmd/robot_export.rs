//! `rollwalk robot export`: writes a robot file for other tools.

use super::standing::StandingReport;
use miette::{IntoDiagnostic, miette};
use rollwalk_robot::{Joint, Robot};
use rollwalk_terminal::files::{self, Output};
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::{Exit, output};
use std::path::PathBuf;

/// Write a robot file as URDF, as an MJCF model for MuJoCo, or as parameters for the controllers of ros2_control.
///
/// Spinning wheels become separate bodies; meshes are the solids of the robot file.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk robot export robots/agilebot.toml -o agilebot.urdf
  rollwalk robot export robots/agilebot.toml -o agilebot.xml     a model for MuJoCo
  rollwalk robot export robots/agilebot.toml --ros2-control -o agilebot.urdf
  rollwalk robot export robots/agilebot.toml -o agilebot.yaml    its controllers

docs/exports.md describes the content and the limits of each format.")]
pub struct Args {
    /// Robot file (TOML).
    #[arg(value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Output file: .urdf, .xml for MJCF, or .yaml for controllers of ros2_control.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Add a section for ros2_control to a URDF, with the given hardware plugin; without a name, a plugin that mocks the
    /// hardware.
    #[arg(long, value_name = "PLUGIN", num_args = 0..=1, default_missing_value = rollwalk_interchange::MOCK, value_parser = plugin)]
    ros2_control: Option<String>,
}

/// Parses the name of a plugin in pluginlib's form. Rejects a robot file given by mistake.
fn plugin(name: &str) -> Result<String, String> {
    let is_word = |text: &str| {
        !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
    };
    let parts: Vec<&str> = name.split('/').flat_map(|part| part.split("::")).collect();
    if parts.len() > 1 && parts.iter().all(|part| is_word(part)) {
        return Ok(name.to_owned());
    }
    Err(format!(
        "give a plugin as PACKAGE/CLASS or NAMESPACE::CLASS, such as {}; for the default plugin, \
         put --ros2-control after the robot file",
        rollwalk_interchange::MOCK
    ))
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let ending = files::ending(&args.output, "a robot", &["urdf", "xml", "yaml"])?;
    let (robot, parts) = Source::Disk.robot_and_parts(&args.robot)?;
    // A shape that reaches into the ground does so in a simulator as well.
    let standing = StandingReport::new(&robot);
    output::print_warnings(standing.and_then(|standing| standing.shape_in_ground()).as_slice());
    if ending != Some("xml") {
        output::print_warnings(&left_out(&robot));
    }
    let text = match (ending, &args.ros2_control) {
        (Some("xml" | "yaml"), Some(_)) => {
            return Err(miette!(
                help = "give -o a name that ends in .urdf",
                "--ros2-control requires a URDF file, but {} is not a URDF file",
                args.output.display()
            ));
        }
        (Some("xml"), None) => rollwalk_interchange::mjcf(&robot, &parts),
        (Some("yaml"), None) => Ok(rollwalk_interchange::controllers(&robot)),
        (_, None) => rollwalk_interchange::urdf(&robot, &parts),
        (_, Some(plugin)) => rollwalk_interchange::urdf_with_control(&robot, &parts, plugin),
    };
    let place = Output::of_source(&args.output)?;
    place.write(text.into_diagnostic()?.as_bytes())?;
    place.comment(&format!("wrote {}", args.output.display()))?;
    Ok(Exit::Ok)
}

/// Warnings about couplings and springs, which URDF lacks.
fn left_out(robot: &Robot) -> Vec<String> {
    let names = |is: fn(&Joint) -> bool| -> String {
        let joints = robot.joints.iter().filter(|joint| is(joint));
        joints.map(|joint| format!("`{}`", joint.name)).collect::<Vec<_>>().join(", ")
    };
    let coupled = names(Joint::is_coupled);
    let sprung = names(|joint| joint.spring.is_some_and(|spring| spring.stiffness_nm_rad > 0.0));
    let mut warnings = Vec::new();
    if !coupled.is_empty() {
        warnings.push(format!(
            "URDF has no coupled motors: `motor_per_joint` and `linkage` of {coupled} are left out, and angles, speeds and torques are those of the joints; export MJCF (-o ROBOT.xml) for the motors"
        ));
    }
    if !sprung.is_empty() {
        warnings.push(format!(
            "URDF has no springs: `stiffness_nm_rad` of {sprung} is left out; export MJCF (-o ROBOT.xml) for springs"
        ));
    }
    warnings
}

#[cfg(test)]
mod tests {
    use super::plugin;

    #[test]
    fn plugins_have_a_package_and_a_class() {
        for name in [rollwalk_interchange::MOCK, "my_robot/Arm2", "a/b::C", "my_robot::Arm"] {
            assert_eq!(plugin(name).as_deref(), Ok(name));
        }
        for name in
            ["", "Arm", "/Arm", "a/", "a::", "a:b", "robots/agilebot.toml", "a/b c", "<a>/b"]
        {
            assert!(plugin(name).is_err(), "{name}");
        }
    }
}
