//! `rollwalk gains`: reads and sets stiffness, damping, torque limits and the fraction of torque feed-forward at run time.

use miette::miette;
use rollwalk_host::catalog::{Catalog, channel_name};
use rollwalk_host::session::SessionError;
use rollwalk_protocol::text::Limit;
use rollwalk_protocol::wire::{Parameter, ParameterOrigin, ParameterResult};
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::{LinkArgs, LiveSession, report_failure};
use rollwalk_terminal::output::Table;
use rollwalk_terminal::{Exit, output};
use serde::Serialize;

/// Show or set stiffness, damping and torque limit of every servo.
///
/// A new value takes effect at once, or within half a second while the robot moves, and lasts until the controller loses power;
/// `gains save` stores all values permanently. The robot file sets their limits.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk gains show --bus can:can0
  rollwalk gains set front_left_knee --kp 60 --kd 1.5 --bus can:can0
  rollwalk gains feed-forward 0.5 --bus can:can0
  rollwalk gains save --bus can:can0
  rollwalk gains reset --bus can:can0       # values of the robot file

docs/parameters.md describes the values and how they are stored.")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(clap::Args)]
struct Show {
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

#[derive(clap::Subcommand)]
enum Action {
    /// Show all values.
    #[command(after_long_help = "Examples:\n  rollwalk gains show --bus can:can0")]
    Show(Show),
    /// Set values of one channel or of all channels.
    #[command(after_long_help = "\
Examples:
  rollwalk gains set front_left_knee --kp 60 --kd 1.5 --bus can:can0
  rollwalk gains set all --torque-limit 1.2 --bus can:can0")]
    Set(Set),
    /// Set the fraction of the library's torques that is fed forward, for all channels.
    #[command(after_long_help = "Examples:\n  rollwalk gains feed-forward 0.5 --bus can:can0")]
    FeedForward(FeedForward),
    /// Set all values to those of the robot file, and feed-forward to 1.
    #[command(after_long_help = "Examples:\n  rollwalk gains reset --bus can:can0")]
    Reset(Link),
    /// Store the current values permanently; only while disarmed.
    #[command(after_long_help = "Examples:\n  rollwalk gains save --bus can:can0")]
    Save(Link),
}

#[derive(clap::Args)]
struct FeedForward {
    /// Fraction of the planned torques, from 0 (no feed-forward) to 1 (full feed-forward).
    #[arg(value_name = "SHARE", value_parser = share)]
    share: f32,
    #[command(flatten)]
    link: LinkArgs,
}

#[derive(clap::Args)]
struct Link {
    #[command(flatten)]
    link: LinkArgs,
}

#[derive(clap::Args)]
struct Set {
    /// Joint or wheel by name or number, or `all`.
    #[arg(value_name = "CHANNEL")]
    channel: String,
    #[command(flatten)]
    link: LinkArgs,
    #[command(flatten)]
    names: NamesArgs,
    #[command(flatten)]
    values: Values,
}

#[derive(clap::Args)]
#[group(required = true, multiple = true)]
struct Values {
    /// Stiffness, N·m/rad.
    #[arg(long, value_name = "N·m/rad", value_parser = gain)]
    kp: Option<f32>,
    /// Damping, N·m·s/rad.
    #[arg(long, value_name = "N·m·s/rad", value_parser = gain)]
    kd: Option<f32>,
    /// Torque limit, N·m.
    #[arg(long, value_name = "N·m", value_parser = gain)]
    torque_limit: Option<f32>,
}

fn share(text: &str) -> Result<f32, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "give a number from 0 to 1".into())
}

fn gain(text: &str) -> Result<f32, String> {
    let gain = text.parse().ok().filter(|gain: &f32| gain.is_finite() && *gain >= 0.0);
    gain.ok_or_else(|| "give a number of at least 0".into())
}

/// Command-line option of a parameter, and its unit.
fn words(parameter: Parameter) -> (&'static str, &'static str) {
    match parameter {
        Parameter::Kp => ("--kp", " N·m/rad"),
        Parameter::Kd => ("--kd", " N·m·s/rad"),
        Parameter::MaxTorque => ("--torque-limit", " N·m"),
        Parameter::FeedForward => ("feed-forward", ""),
    }
}

impl Values {
    /// Parameters to set, with their values.
    fn given(&self) -> impl Iterator<Item = (Parameter, f32)> {
        let all = [
            (Parameter::Kp, self.kp),
            (Parameter::Kd, self.kd),
            (Parameter::MaxTorque, self.torque_limit),
        ];
        all.into_iter().filter_map(|(parameter, value)| Some((parameter, value?)))
    }
}

/// Channel in the output of `--json`; null for a parameter that its actuator does not have.
#[derive(Serialize)]
struct Row {
    channel: u8,
    name: Option<String>,
    kp_nm_rad: Option<f32>,
    kd_nm_s_rad: Option<f32>,
    torque_limit_nm: Option<f32>,
}

/// Output of `--json`.
#[derive(Serialize)]
struct GainsOutput {
    /// Source of the values in force after power-on.
    origin: String,
    /// Fraction of the library's torques that is fed forward.
    feed_forward: Option<f32>,
    channels: Vec<Row>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    match &args.action {
        Action::Show(args) => show(args),
        Action::Set(args) => set(args),
        Action::FeedForward(FeedForward { share, link }) => {
            let outcome = link.visit()?.set_parameter(Parameter::FeedForward, 0, *share);
            report_outcome(
                link,
                outcome,
                "set until the next power cycle; to keep the value, type `rollwalk gains save`",
            )
        }
        Action::Reset(Link { link }) => {
            let outcome = link.visit()?.reset_parameters();
            report_outcome(
                link,
                outcome,
                "all values are reset to the robot file until the next power cycle",
            )
        }
        Action::Save(Link { link }) => save(link),
    }
}

/// Saves the values in force, and prints them.
fn save(link: &LinkArgs) -> miette::Result<Exit> {
    let mut session = link.visit()?;
    let catalog = NamesArgs::default().look_up(Some(session.hello()))?;
    let saved = session.save_parameters().and_then(|()| read(&mut session, catalog.as_ref()));
    match saved {
        Ok(shown) => {
            let values = values_table(&shown);
            output::print(&format!("saved, and used after each power-on:\n\n{values}"))?;
            Ok(Exit::Ok)
        }
        Err(error) => Ok(report_failure(link, &error)),
    }
}

fn report_outcome(
    link: &LinkArgs,
    outcome: Result<(), SessionError>,
    what: &str,
) -> miette::Result<Exit> {
    match outcome {
        Ok(()) => output::print(what).map(|()| Exit::Ok),
        Err(error) => Ok(report_failure(link, &error)),
    }
}

fn show(args: &Show) -> miette::Result<Exit> {
    let mut session = args.link.visit()?;
    let catalog = args.names.look_up(Some(session.hello()))?;
    match read(&mut session, catalog.as_ref()) {
        Ok(shown) if args.json => output::print_json(&shown)?,
        Ok(shown) => output::print(&table(&shown))?,
        Err(error) => return Ok(report_failure(&args.link, &error)),
    }
    Ok(Exit::Ok)
}

fn read(session: &mut LiveSession, catalog: Option<&Catalog>) -> Result<GainsOutput, SessionError> {
    let mut channels = Vec::new();
    for channel in 0..session.hello().channels {
        channels.push(Row {
            channel,
            name: catalog.and_then(|c| c.channels.get(usize::from(channel)).cloned()),
            kp_nm_rad: value(session, Parameter::Kp, channel)?,
            kd_nm_s_rad: value(session, Parameter::Kd, channel)?,
            torque_limit_nm: value(session, Parameter::MaxTorque, channel)?,
        });
    }
    let origin = match session.parameter_origin()? {
        ParameterOrigin::Configuration => "the robot file, because no values are saved",
        ParameterOrigin::Saved => "the saved values",
        ParameterOrigin::OtherConfiguration => {
            "the robot file, because the saved values are for another configuration"
        }
        ParameterOrigin::OutOfRange => "the robot file, because a saved value is out of range",
    };
    let feed_forward = value(session, Parameter::FeedForward, 0)?;
    Ok(GainsOutput { origin: origin.to_owned(), feed_forward, channels })
}

/// Reads a value; returns `None` if the actuator does not have the parameter.
fn value(
    session: &mut LiveSession,
    parameter: Parameter,
    channel: u8,
) -> Result<Option<f32>, SessionError> {
    match session.parameter(parameter, channel) {
        Ok(value) => Ok(Some(value)),
        Err(SessionError::ParameterRefused { result: ParameterResult::NotSupported, .. }) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

fn table(shown: &GainsOutput) -> String {
    let values = values_table(shown);
    format!("{values}\n\nAfter power-on, the values came from {}.", shown.origin)
}

/// Table of all values.
fn values_table(shown: &GainsOutput) -> String {
    let number =
        |value: Option<f32>| value.map_or_else(|| "-".into(), |value| format!("{value:.3}"));
    let mut table = Table::new(["channel", "", "kp N·m/rad", "kd N·m·s/rad", "limit N·m"]);
    for row in &shown.channels {
        table.row([
            row.channel.to_string(),
            row.name.clone().unwrap_or_default(),
            number(row.kp_nm_rad),
            number(row.kd_nm_s_rad),
            number(row.torque_limit_nm),
        ]);
    }
    let share = number(shown.feed_forward);
    let table = table.render();
    format!("{table}\n\nTorque feed-forward: {share}")
}

fn set(args: &Set) -> miette::Result<Exit> {
    let mut session = args.link.visit()?;
    let catalog = args.names.look_up(Some(session.hello()))?;
    let channels = chosen(&args.channel, session.hello().channels, catalog.as_ref())?;
    let name = |channel: u8| {
        channel_name(catalog.as_ref().map_or(&[], |catalog| &catalog.channels), channel)
    };
    let (mut set, mut without) = (0, Vec::<String>::new());
    for &channel in &channels {
        for (parameter, value) in args.values.given() {
            match session.set_parameter(parameter, channel, value) {
                Ok(()) => set += 1,
                // `all` sets the channels that have the parameter.
                Err(error) if channels.len() > 1 && has_none(&error) => {
                    // A channel that lacks both stiffness and damping is listed once.
                    if without.last() != Some(&name(channel)) {
                        without.push(name(channel));
                    }
                }
                Err(error) => {
                    let before = match set {
                        0 => "nothing was changed".to_owned(),
                        set => format!(
                            "{} set before; to reset all values to the robot file, type `rollwalk \
                             gains reset`",
                            values(set)
                        ),
                    };
                    let (option, unit) = words(parameter);
                    let what = format!("{}: {option} {value}{unit}", name(channel));
                    let Some(why) = refusal(&error, &what, value, unit) else {
                        output::print_line(format_args!("{what} was not set, {before}:"));
                        return Ok(report_failure(&args.link, &error));
                    };
                    output::print_report(&miette!(help = before, "{why}"));
                    return Ok(Exit::NotDone);
                }
            }
        }
    }
    if !without.is_empty() {
        output::print_line(format_args!(
            "skipped, because these channels do not have this parameter: {}",
            without.join(", ")
        ));
    }
    // A script must not continue without a limit that it believes to be set.
    if set == 0 {
        output::print_line("nothing was set");
        return Ok(Exit::NotDone);
    }
    output::print(&format!(
        "{} set until the next power cycle; to keep them, type `rollwalk gains save`",
        values(set)
    ))?;
    Ok(Exit::Ok)
}

/// Formats a number of values.
fn values(count: usize) -> String {
    if count == 1 { "1 value".to_owned() } else { format!("{count} values") }
}

/// True if a value was refused because the channel does not have the parameter, such as the stiffness of a wheel.
fn has_none(error: &SessionError) -> bool {
    let SessionError::ParameterRefused { result, value, .. } = error else { return false };
    match result {
        ParameterResult::NotSupported => true,
        // The upper bound is 0, so only 0 is possible.
        ParameterResult::OutOfRange => *value == 0.0,
        _ => false,
    }
}

/// Reason why a value is not allowed; `None` for other errors. `what` is the channel and parameter in the message.
fn refusal(error: &SessionError, what: &str, value: f32, unit: &str) -> Option<String> {
    let SessionError::ParameterRefused { result, value: limit, .. } = error else { return None };
    match result {
        ParameterResult::NotSupported => Some(format!(
            "{what}: the drive uses its own value, not the value of the controller (docs/actuators.md)"
        )),
        _ if has_none(error) => Some(format!(
            "{what}: this channel does not have this value (wheels have no stiffness)"
        )),
        ParameterResult::OutOfRange if value > *limit => Some(format!(
            "{what} is too high: the robot file allows at most {}{unit}",
            Limit::AtMost(*limit)
        )),
        ParameterResult::OutOfRange => Some(format!(
            "{what} is too low: give at least {}{unit} (while torque is on, half of the value in \
             the robot file)",
            Limit::AtLeast(*limit)
        )),
        _ => None,
    }
}

/// Returns the numbers of the channels that `text` selects.
fn chosen(text: &str, count: u8, catalog: Option<&Catalog>) -> miette::Result<Vec<u8>> {
    if text == "all" {
        return Ok((0..count).collect());
    }
    if let Ok(channel) = text.parse::<u8>() {
        let known = channel < count;
        return known.then(|| vec![channel]).ok_or_else(|| {
            miette!(
                "there is no channel {channel}: give a channel from 0 to {}",
                count.saturating_sub(1)
            )
        });
    }
    let Some(catalog) = catalog else {
        return Err(miette!(
            help = "give the robot file with --robot ROBOT.toml, or the number of the channel",
            "`{text}`: the joint names of this robot are unknown on this computer"
        ));
    };
    let found = (0..).zip(&catalog.channels).find(|(_, name)| *name == text);
    let found = found.map(|(channel, _)| vec![channel]);
    found.ok_or_else(|| {
        miette!(
            help = format!("give one of {}", catalog.channels.join(", ")),
            "{} has no joint or wheel `{text}`",
            catalog.robot
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn catalog() -> Catalog {
        Catalog {
            robot: "pup".into(),
            config_hash: 1,
            library: 2,
            motions: Vec::new(),
            transitions: Vec::new(),
            safe: 0,
            channels: vec!["hip".into(), "knee".into()],
            actuators: Default::default(),
        }
    }

    #[test]
    fn channels_are_chosen_by_name_by_number_or_all() {
        let catalog = catalog();
        assert_eq!(chosen("all", 2, None).unwrap(), [0, 1]);
        assert_eq!(chosen("1", 2, None).unwrap(), [1]);
        assert_eq!(chosen("knee", 2, Some(&catalog)).unwrap(), [1]);
        let error = chosen("2", 2, None).unwrap_err().to_string();
        assert!(error.contains("0 to 1"), "{error}");
        let error = chosen("ankle", 2, Some(&catalog)).unwrap_err().to_string();
        assert!(error.contains("pup has no joint or wheel `ankle`"), "{error}");
        assert!(chosen("knee", 2, None).is_err());
    }
}
