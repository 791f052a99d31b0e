//! `rollwalk robot import`: converts a URDF, or an MJCF model, and a side file to a robot file.

use super::description::describe;
use super::standing::StandingReport;
use miette::{Report, miette};
use rollwalk_robot::urdf::{self, Survey, Text};
use rollwalk_terminal::files::Output;
use rollwalk_terminal::kind::Kind;
use rollwalk_terminal::output::Table;
use rollwalk_terminal::{Exit, files, output};
use serde::Serialize;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Convert a URDF or an MJCF model to a robot file. A side file adds the data that they lack.
///
/// Without `-o` the command prints joints, likely feet and wheels, and a standing pose. `--template` writes them to a first
/// side file, to be checked and completed. With `--with` the values of another side file replace guesses.
#[derive(clap::Args)]
#[command(override_usage = "\
rollwalk robot import ROBOT [--json]
       rollwalk robot import ROBOT --template SIDE.toml [--with SIDE.toml]
       rollwalk robot import ROBOT --with SIDE.toml --output ROBOT.toml")]
#[command(after_long_help = "\
Examples:
  rollwalk robot import a1.urdf                                      joints, feet, wheels
  rollwalk robot import a1.urdf --template a1.side.toml              a side file to complete
  rollwalk robot import a1.urdf --with axes.toml --template a1.side.toml    with given axes
  rollwalk robot import a1.urdf --with a1.side.toml -o a1.toml
  rollwalk robot import go1.xml --template go1.side.toml             a model of MuJoCo

Side files are described in docs/urdf-import.md, robot files in docs/robot-files.md.")]
pub struct Args {
    /// URDF (XML, xacro expanded) or MJCF model (XML, without <include>).
    #[arg(value_name = "ROBOT.urdf|ROBOT.xml")]
    urdf: PathBuf,
    /// Side file. With `--template` its values replace guesses; an axis alone, such as `forward = "+y"`, is enough there.
    #[arg(long, value_name = "SIDE.toml", requires = "result")]
    with: Option<PathBuf>,
    /// Robot file to write.
    #[arg(
        short,
        long,
        value_name = "ROBOT.toml",
        requires = "with",
        conflicts_with = "template",
        group = "result"
    )]
    output: Option<PathBuf>,
    /// First side file to write. The file must not exist yet.
    #[arg(long, value_name = "SIDE.toml", group = "result")]
    template: Option<PathBuf>,
    /// Print the result as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json` after an import.
#[derive(Serialize)]
struct ImportOutput<'a> {
    robot: &'a Path,
    mass_kg: f64,
    warnings: &'a [String],
}

/// Models of other programs: file name extensions, description of the file, and advice on its conversion. The import also
/// recognises SDF and Xacro by their content.
const FOREIGN: [(&[&str], &str, &str); 4] = [
    (
        &["usd", "usda", "usdc", "usdz"],
        "a USD scene",
        "export the robot as URDF or MJCF, in Isaac Sim with File > Export",
    ),
    (
        &["wbt", "proto"],
        "a model of Webots",
        "export the robot as URDF: in Webots, right-click it in the scene tree and select Export URDF",
    ),
    (
        &["stl", "obj", "dae", "gltf", "glb", "step", "stp"],
        "a mesh or drawing without joints",
        "give the URDF or MJCF file that refers to it",
    ),
    (
        &["mjb"],
        "a compiled model of MuJoCo",
        "give its XML, which `mj_saveLastXML` of the Python package mujoco writes",
    ),
];

/// Rejects models of other programs, which may be binary files.
fn reject_foreign(path: &Path) -> miette::Result<()> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    match FOREIGN.iter().find(|(extensions, ..)| extensions.contains(&extension.as_str())) {
        Some((_, what, help)) => {
            Err(miette!(help = *help, "{} is {what}, not a URDF or MJCF file", path.display()))
        }
        None => Ok(()),
    }
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    reject_foreign(&args.urdf)?;
    let urdf = files::read_text(&args.urdf, Kind::Urdf)?;
    Kind::Urdf.expect(&args.urdf, &urdf)?;
    let urdf_name = args.urdf.to_string_lossy();
    let urdf = Text { name: &urdf_name, text: &urdf };
    match (&args.with, &args.output) {
        (Some(side), Some(robot)) => import(urdf, side, robot, args.json),
        _ => print_survey(urdf, args),
    }
}

fn import(urdf: Text<'_>, side: &Path, output: &Path, json: bool) -> miette::Result<Exit> {
    let text = files::read_text(side, Kind::Side)?;
    let side = Text { name: &side.to_string_lossy(), text: &text };
    let imported = urdf::import(urdf, side).map_err(Report::new)?;
    let place = Output::of_source(output)?;
    keep_edits(&place)?;
    place.write(imported.toml.as_bytes())?;
    let standing = StandingReport::new(&imported.robot);
    let standing = standing.iter();
    let found = standing.flat_map(|of| of.implausibilities().iter().cloned().chain(of.overlaps()));
    let warnings: Vec<_> = imported.warnings.iter().cloned().chain(found).collect();
    output::print_warnings(&warnings);
    if json {
        let mass_kg = imported.robot.total_mass_kg();
        output::print_json(&ImportOutput { robot: output, mass_kg, warnings: &warnings })?;
    } else {
        let robot = describe(&imported.robot);
        output::print(&format!("{robot}\n\nwrote {}", output.display()))?;
    }
    Ok(Exit::Ok)
}

/// Refuses to replace a file other than an unchanged output of the import.
fn keep_edits(output: &Output) -> miette::Result<()> {
    let target = output.target();
    if !target.is_file() {
        return Ok(());
    }
    let is_own = std::fs::read_to_string(target).is_ok_and(|text| urdf::is_unchanged(&text));
    if is_own {
        return Ok(());
    }
    Err(miette!(
        help = "give another name, or remove the file",
        "{} exists already, and is not the unchanged output of an import",
        output.path().display()
    ))
}

fn print_survey(urdf: Text<'_>, args: &Args) -> miette::Result<Exit> {
    let survey = match &args.with {
        Some(path) => {
            let text = files::read_text(path, Kind::Side)?;
            urdf::survey_with(urdf, Text { name: &path.to_string_lossy(), text: &text })
        }
        None => urdf::survey(urdf),
    };
    let survey = survey.map_err(Report::new)?;
    if let Some(path) = &args.template {
        // An existing side file may have been completed by the user.
        if path.exists() {
            return Err(miette!(
                help = "give another name, or remove the file",
                "{} exists already",
                path.display()
            ));
        }
        files::write(path, survey.template.as_bytes())?;
    }
    output::print_warnings(&survey.warnings);
    if args.json {
        output::print_json(&survey)?;
        return Ok(Exit::Ok);
    }
    let urdf = args.urdf.display();
    let next = match &args.template {
        Some(side) => format!(
            "wrote {side}: check it, then\n  rollwalk robot import {urdf} --with {side} -o {}",
            Path::new(args.urdf.with_extension("toml").file_name().unwrap_or_default()).display(),
            side = side.display()
        ),
        None => format!("next: rollwalk robot import {urdf} --template SIDE.toml"),
    };
    output::print(&format!("{}\n\n{next}", survey_text(&survey)))?;
    Ok(Exit::Ok)
}

fn survey_text(survey: &Survey) -> String {
    let mut text = format!(
        "{}: {:.3} kg, {} links, {} joints that are not fixed, root `{}` with {} forward and {} up\n\n",
        survey.name,
        survey.mass_kg,
        survey.links.len(),
        survey.joints.len(),
        survey.root,
        survey.axes[0],
        survey.axes[1],
    );
    let mut joints = Table::new(["joint", "type", "min", "max", "proposal"]);
    for joint in &survey.joints {
        let [min, max] =
            joint.limits.map(|limit| limit.map_or("–".into(), |l| format!("{l:.3}")));
        joints.row([joint.name.clone(), joint.kind.clone(), min, max, joint.proposal.clone()]);
    }
    let _ = writeln!(text, "{}\n", joints.render());
    let mut ends = Table::new(["end effector", "link", "kind", "radius m", "standing at m"]);
    for end in &survey.end_effectors {
        let [x, y, z] = end.center_m;
        let guess = if end.measured { "" } else { "?" };
        ends.row([
            end.name.clone(),
            end.link.clone(),
            end.contact.clone(),
            format!("{:.4}{guess}", end.radius_m),
            format!("{x:.3} {y:.3} {z:.3}"),
        ]);
    }
    let _ = writeln!(text, "{}", ends.render());
    if let Some(height) = survey.standing_height_m {
        let _ = write!(text, "\nstanding height of `{}`: {height:.3} m", survey.root);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_of_other_programs_are_named_with_their_conversion() {
        for (name, what, help) in [
            ("go2.usda", "USD scene", "Isaac Sim"),
            ("GO2.USDC", "USD scene", "Isaac Sim"),
            ("worlds/a.wbt", "Webots", "Export URDF"),
            ("shank.STL", "mesh", "URDF or MJCF file that refers"),
            ("go2.mjb", "compiled", "mj_saveLastXML"),
        ] {
            let error = reject_foreign(Path::new(name)).unwrap_err();
            assert!(error.to_string().contains(what), "{error}");
            assert!(error.help().unwrap().to_string().contains(help), "{error:?}");
        }
        for name in ["go2.urdf", "go2.xml", "go2.sdf", "go2.urdf.xacro", "go2"] {
            reject_foreign(Path::new(name)).unwrap();
        }
    }
}
