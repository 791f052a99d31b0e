//! `rollwalk library build`: from a library file to a motion library.

use crate::cmd::robot::print_robot_warnings;
use crate::signing;
use rollwalk_terminal::files::Output;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::link::names;
use rollwalk_terminal::packed::Packed;
use rollwalk_terminal::planning::{PlanOutcome, Plans, plan_all};
use rollwalk_terminal::{Exit, output};
use serde::Serialize;
use std::path::PathBuf;

/// Optimise every motion and transition of a library file and pack them into a motion library.
///
/// The library is written only when every plan converged.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk library build motions/agilebot_library.toml -o agilebot.rwl
  rollwalk library build pup.library.toml -o pup.rwl --json | jq .bytes
  rollwalk library build motions/agilebot_library.toml -o agilebot.rwl --sign owner.pem

The format of library files is described in docs/motion-files.md, that of the result in
docs/motion-library.md.")]
pub struct Args {
    /// Library file (TOML).
    #[arg(value_name = "LIBRARY.toml")]
    library: PathBuf,
    /// Where to write the motion library.
    #[arg(short, long, value_name = "LIB.rwl")]
    output: PathBuf,
    /// Sign the library with this private key (`rollwalk keys new-pair`).
    #[arg(long, value_name = "KEY.pem")]
    sign: Option<PathBuf>,
    /// Print every iteration to stderr.
    #[arg(short, long)]
    verbose: bool,
    /// Print the outcome as JSON.
    #[arg(long)]
    json: bool,
}

/// What `--json` prints.
#[derive(Serialize)]
struct Outcome<'a> {
    robot: &'a str,
    /// Null when a plan does not hold.
    library: Option<&'a PathBuf>,
    bytes: usize,
    plans: Vec<PlanOutcome<'a>>,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let library = Source::Disk.library(&args.library)?;
    let key = args.sign.as_deref().map(signing::private_key).transpose()?;
    let place = Output::at(&args.output)?;
    print_robot_warnings(&library.robot);
    let Some(plans) = plan_all(&library, args.verbose)? else { return Ok(Exit::Interrupted) };
    let converged = plans.failures().is_empty();
    let bytes = if converged { plans.pack(&library)?.bytes } else { Vec::new() };
    if converged {
        match &key {
            Some(key) => place.write(&signing::signed(&bytes, key))?,
            None => place.write(&bytes)?,
        }
        // So that tools know the motions by name wherever the library is flashed to.
        names::keep(&Packed::new(library.robot.clone(), bytes.clone())?.catalog());
    }
    let written = converged.then_some(&args.output);
    if args.json {
        output::print_json(&Outcome {
            robot: &library.robot.name,
            library: written,
            bytes: bytes.len(),
            plans: plans.all().map(|p| PlanOutcome::new(&p.plan, p.took.as_secs_f64())).collect(),
        })?;
    } else {
        place.comment(&describe(&plans, written, bytes.len()))?;
    }
    Ok(if converged { Exit::Ok } else { Exit::DoesNotHold })
}

fn describe(plans: &Plans, written: Option<&PathBuf>, bytes: usize) -> String {
    match written {
        Some(path) => format!(
            "wrote {}: {} motions, {} transitions, {bytes} B",
            path.display(),
            plans.motions.len(),
            plans.transitions.len()
        ),
        None => {
            let mut lines = plans.failures();
            lines.push(
                "nothing written; `rollwalk plan` writes the plan of one motion whether it holds or \
                 not, and `rollwalk report` shows where it fails"
                    .to_owned(),
            );
            lines.join("\n")
        }
    }
}
