//! `rollwalk design keep`: changes parameters so that a feature of the motions stays the same.

use super::outcome::{DesignOutput, Drift, Folder};
use super::parameter_setting::{self, ParameterSetting};
use super::{SolveDisplay, plan_original, read, report};
use miette::miette;
use rollwalk_design::keep;
use rollwalk_planner::sensitivity::Feature;
use rollwalk_terminal::Exit;
use std::path::PathBuf;

/// Change some parameters, and adjust all others so that the motions keep a feature.
///
/// The derivatives of the optimal plans give the change of the feature with respect to every parameter. The command takes the
/// smallest change of the other parameters that keeps the feature (thesis 2.5.2). It writes the same files as `rollwalk design
/// edit`, and compares with that command's result.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk design keep designs/agilebot_legs.toml front_thigh+=0.02 --feature pitch -o level")]
pub struct Args {
    /// Design file (TOML).
    #[arg(value_name = "DESIGN.toml")]
    design: PathBuf,
    /// Parameters and their values, in m or rad; `+=` and `-=` change the value of the robot file.
    #[arg(value_name = "NAME=VALUE", required = true, value_parser = parameter_setting::parse)]
    given: Vec<ParameterSetting>,
    /// Feature that the motions keep: pitch, tilt (roll and pitch), height, body (height and tilt), joints (angles), feet
    /// (contact points).
    #[arg(long, value_name = "FEATURE", value_parser = feature)]
    feature: Feature,
    #[command(flatten)]
    folder: Folder,
}

fn feature(name: &str) -> Result<Feature, String> {
    let found = Feature::ALL.iter().find(|(known, _)| *known == name);
    found.map(|(_, feature)| *feature).ok_or_else(|| {
        let known = Feature::ALL.map(|(name, _)| name).join(", ");
        format!("there is no feature `{name}`: give one of {known}")
    })
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let designed = read(&args.design)?;
    let given = parameter_setting::values(&designed, &args.given)?;
    if given.len() == designed.original().len() {
        return Err(miette!(
            help = "add parameters to the design file, or use `rollwalk design edit`",
            "all parameters are set, so none is left to compensate"
        ));
    }
    let folder = args.folder.open(&designed)?;
    let mut shown = SolveDisplay::new("planning");
    let watch = &mut |motion: &str, state: &_| shown.iteration(motion, state);
    let before = plan_original(&designed, watch)?;
    shown.now("following");
    let kept = keep::keep(&designed, &before, &given, args.feature, &mut |motion, state| {
        shown.iteration(motion, state)
    })
    .map_err(report)?;
    let mut values = designed.rounded(&kept.variant.values);
    let mut by_hand = designed.original().to_vec();
    for (index, value) in given {
        (values[index], by_hand[index]) = (value, value);
    }
    shown.now("again");
    let again = &mut |motion: &str, state: &_| shown.iteration(motion, state);
    let after = designed.plan_from(&kept, &values, true, again).map_err(report)?;
    let manual = designed.plan_from(&before, &by_hand, true, again).map_err(report)?;
    drop(shown);
    let drift = |plans| Drift::between(args.feature, &before, plans);
    let mut outcome = DesignOutput::new("keep", &designed, Some(&before), &after);
    outcome.drifts = vec![("by hand", drift(&manual)), ("kept", drift(&after))];
    folder.write(&outcome, Some(&before), &after)
}
