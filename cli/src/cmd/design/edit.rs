//! `rollwalk design edit`: changes parameters by hand and plans again.

use super::outcome::{DesignOutput, Folder};
use super::parameter_setting::{self, ParameterSetting};
use super::{SolveDisplay, plan_original, read, report};
use miette::miette;
use rollwalk_terminal::Exit;
use std::path::PathBuf;

/// Change parameters of a robot by hand and plan its motions again.
///
/// Writes a folder with the changed robot file (comments are kept), a plan of each motion, figures of each motion before and
/// after, and a report. The exit code is 3 if a motion fails its checks in simulation afterwards.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design edit designs/agilebot_legs.toml front_thigh=0.13 -o longer
  rollwalk design edit designs/agilebot_legs.toml front_thigh+=0.01 half_track-=0.005 -o longer
  rollwalk design edit designs/agilebot_legs.toml --servo xm540=MX-64AT -o lighter
Then:
  rollwalk simulate longer/walk.plan.json")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Parameters and their values, in m or rad; `+=` and `-=` change the value of the robot file.
    #[arg(value_name = "NAME=VALUE", required_unless_present = "servo", value_parser = parameter_setting::parse)]
    given: Vec<ParameterSetting>,
    /// Other servo for an actuator of the robot file, with its limits, torque-speed line and mass; may be given several times.
    #[arg(long, value_name = "ACTUATOR=SERVO", value_parser = parameter_setting::parse_servo)]
    servo: Vec<[String; 2]>,
    /// Servo catalogue (TOML) [default: the one that ships, robot/servos.toml].
    #[arg(long, value_name = "SERVOS.toml", requires = "servo")]
    servos: Option<PathBuf>,
    #[command(flatten)]
    folder: Folder,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let given = parameter_setting::values(&designed, &args.given)?;
    let catalog = super::catalog(args.servos.as_deref())?;
    let (changed, servos) = parameter_setting::with_servos(&designed, &args.servo, &catalog)?;
    let folder = args.folder.open(&designed)?;
    let mut values = designed.original().to_vec();
    given.iter().for_each(|(index, value)| values[*index] = *value);
    if values == designed.original() && servos.is_empty() {
        return Err(miette!("the robot file already has these values: give other values"));
    }
    let mut shown = SolveDisplay::new("planning");
    let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
    let (before, after) = match designed.beyond() {
        None => {
            let before = plan_original(&designed, watch)?;
            let after = changed.plan_from(&before, &values, true, watch).map_err(report)?;
            (Some(before), after)
        }
        Some(_) => (None, changed.plan(&values, watch).map_err(report)?),
    };
    drop(shown);
    let mut outcome = DesignOutput::new("edit", &designed, before.as_ref(), &after);
    outcome.servos = servos;
    folder.write(&outcome, before.as_ref(), &after)
}
