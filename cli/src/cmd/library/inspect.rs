//! `rollwalk library inspect`: validates a library as a controller does, and prints its content.

use crate::signing::{self, Fingerprint};
use rollwalk_protocol::library::{EdgeId, Library, NodeId, RATE_HZ};
use rollwalk_robot::Robot;
use rollwalk_terminal::output::Table;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, output};
use serde::Serialize;
use std::path::PathBuf;

/// Validate a motion library as a controller does and print motions, codes, transitions and sizes.
///
/// A library belongs to one robot: the limits, gains and addresses in its robot file. Without --robot
/// the robots that ship with rollwalk are tried.
#[derive(clap::Args)]
#[command(after_long_help = "\
Examples:
  rollwalk library inspect demo-out/agilebot.rwl
  rollwalk library inspect pup.rwl --robot pup.toml
  rollwalk library inspect demo-out/agilebot.rwl --json | jq '.motions[].code'

The format is described in docs/formats/motion-library.md.")]
pub struct Args {
    /// Motion library.
    #[arg(value_name = "LIB.rwl")]
    library: PathBuf,
    /// Robot file (TOML) of the library's robot.
    #[arg(long, value_name = "ROBOT.toml")]
    robot: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    json: bool,
}

/// Output of `--json`.
#[derive(Serialize)]
struct Content {
    robot: String,
    bytes: u32,
    /// Digest by which a controller identifies the library.
    id: String,
    /// Fingerprint of the key that the file claims as its signer.
    signed_with: Option<String>,
    config_hash: String,
    rate_hz: u16,
    channels: usize,
    torques: bool,
    safe: String,
    motions: Vec<MotionEntry>,
    transitions: Vec<Transition>,
}

#[derive(Serialize)]
struct MotionEntry {
    name: String,
    code: Option<u8>,
    frames: u16,
    duration_s: f64,
    looping: bool,
    bytes: u32,
}

#[derive(Serialize)]
struct Transition {
    from: String,
    exit_frame: u16,
    to: String,
    entry_frame: u16,
    frames: u16,
    duration_s: f64,
    bytes: u32,
}

/// Runs the subcommand.
pub fn run(args: &Args) -> miette::Result<Exit> {
    let packed = ValidatedLibrary::read(&args.library, args.robot.as_deref())?;
    let content = content(&packed.robot, &packed.library(), signing::signer(&packed.file));
    if args.json {
        output::print_json(&content)?;
    } else {
        output::print(&describe(&content))?;
    }
    Ok(Exit::Ok)
}

fn content(robot: &Robot, library: &Library, signer: Option<Fingerprint>) -> Content {
    let name = |node: NodeId| library.name(node).unwrap_or_default().to_owned();
    let seconds = |frames: u16| f64::from(frames) / f64::from(RATE_HZ);
    let motion = |node: NodeId| {
        let clip = library.clip(node.clip())?;
        Some(MotionEntry {
            name: name(node),
            code: clip.code,
            frames: clip.frames,
            // A loop closes one frame after its last; a motion that ends stays at its last frame.
            duration_s: seconds(if clip.looping { clip.frames } else { clip.frames - 1 }),
            looping: clip.looping,
            bytes: clip.bytes,
        })
    };
    let transition = |edge: EdgeId| {
        let edge = library.edge(edge)?;
        let clip = library.clip(edge.clip)?;
        Some(Transition {
            from: name(edge.from),
            exit_frame: edge.exit_frame,
            to: name(edge.to),
            entry_frame: edge.entry_frame,
            frames: clip.frames,
            duration_s: seconds(clip.frames - 1),
            bytes: clip.bytes,
        })
    };
    let index = library.index();
    Content {
        robot: robot.name.clone(),
        bytes: index.len_bytes(),
        id: format!("{:#010x}", index.id()),
        signed_with: signer.map(|key| key.to_string()),
        config_hash: format!("{:#010x}", index.config_hash()),
        rate_hz: RATE_HZ,
        channels: library.channel_count(),
        torques: library.has_torques(),
        safe: name(library.safe_node()),
        motions: library.nodes().filter_map(motion).collect(),
        transitions: library.edges().filter_map(transition).collect(),
    }
}

fn describe(content: &Content) -> String {
    let mut motions = Table::new(["motion", "code", "frames", "s", "B", ""]);
    for motion in &content.motions {
        let safe = if motion.name == content.safe { "SAFE" } else { "" };
        motions.row([
            motion.name.clone(),
            motion.code.map_or_else(String::new, |code| code.to_string()),
            motion.frames.to_string(),
            format!("{:.2}", motion.duration_s),
            motion.bytes.to_string(),
            if motion.looping { "loop".into() } else { safe.into() },
        ]);
    }
    let mut transitions = Table::new(["transition", "leaves at", "enters at", "frames", "s", "B"]);
    for transition in &content.transitions {
        transitions.row([
            format!("{} → {}", transition.from, transition.to),
            transition.exit_frame.to_string(),
            transition.entry_frame.to_string(),
            transition.frames.to_string(),
            format!("{:.2}", transition.duration_s),
            transition.bytes.to_string(),
        ]);
    }
    format!(
        "motion library {} for {} (configuration {}): {} B, {} channels at {} Hz{}\n{}\n\n{}\n\n{}",
        content.id,
        content.robot,
        content.config_hash,
        content.bytes,
        content.channels,
        content.rate_hz,
        if content.torques { ", with torques" } else { ", without torques" },
        match &content.signed_with {
            Some(key) => format!(
                "signed with key {key}; verify the signature with `rollwalk library verify`"
            ),
            None => "not signed".to_owned(),
        },
        motions.render(),
        transitions.render(),
    )
}
