//! Benchmark of the library format on real plans: bytes per second against raw `f32`, postcard deltas and zstd.

mod packing;

use crate::inputs::{self, PlannedLibrary};
use crate::row_filter::RowFilter;
use crate::{Block, Findings, Table, Verdict, verdicts};
use miette::{IntoDiagnostic, miette};
use packing::Bytes;
use rollwalk_planner::library::{ClipStats, frames};
use rollwalk_planner::plan::Plan;
use rollwalk_protocol::library::{ClipId, Library, RATE_HZ, validate};
use rollwalk_terminal::output;
use serde::Serialize;

pub const LIBRARIES: [&str; 5] = [
    "motions/agilebot_library.toml",
    "motions/agilebot_skills_library.toml",
    "motions/swizzlebot_library.toml",
    "motions/skaterbot_library.toml",
    "motions/anymal_library.toml",
];
/// Number of channels that totals are converted to, for comparison between robots.
const CHANNELS: f64 = 16.0;
/// Smallest ratio of the size of raw `f32` to that of the library.
const TIMES: f64 = 5.0;
/// Largest joint error, mrad.
const JOINT_ERROR_MRAD: f64 = 0.5;

#[derive(Serialize)]
struct Clip {
    name: String,
    frames: usize,
    /// Duration at 60 frames per second, s.
    seconds: f64,
    bytes: Bytes,
    /// Ratio of the size of raw `f32` to that of the library.
    times_smaller: f64,
    worst_joint_error_mrad: f64,
    worst_wheel_error_rad_s: f64,
}

#[derive(Serialize)]
struct Row {
    library: String,
    joints: usize,
    wheels: usize,
    seconds: f64,
    /// Sizes of all clips, each packed separately.
    bytes: Bytes,
    /// Size of the whole file, which also contains graph, names, tables, header and footer.
    file_bytes: usize,
    /// Size of the whole file with torques.
    file_bytes_with_torques: usize,
    /// Size of the raw `f32` of all clips, compressed together at level 19.
    zstd_19_of_all: usize,
    /// Ratio of the size of raw `f32` to that of the whole file.
    times_smaller: f64,
    read_ns_per_frame: f64,
    clips: Vec<Clip>,
}

pub fn run(only: &RowFilter) -> miette::Result<Option<Findings>> {
    let mut rows = Vec::new();
    for file in only.choose(&LIBRARIES, |file| file)? {
        output::print_line(file);
        match inputs::library(file)? {
            Some(library) => rows.push(measure(&library)?),
            None => return Ok(None),
        }
    }
    let mut blocks = Vec::new();
    for row in &rows {
        let Row { library, joints, wheels, .. } = row;
        blocks.push(Block::Text(format!("{library}: {joints} joints, {wheels} wheels")));
        blocks.push(Block::Table(clip_table(row)));
    }
    let (targets, passed) = verdicts(targets(&rows));
    blocks.push(Block::Text(format!(
        "All clips of a library, bytes a second for {CHANNELS} channels"
    )));
    blocks.push(Block::Table(library_table(&rows)));
    blocks.push(Block::Text(format!(
        "B/s: bytes for a second of 60 frames. clips: blocks of the motion library with headers, keyframes and \
         CRCs.\nfile: all of the file. torques: all of it with torques. f32: raw. postcard: varints of the quanta's first \
         differences; + zstd: those at\nlevel 19. zstd 3, 19: of f32, clip by clip; one: all clips as one, level 19; i16: of the quanta, level \
         19. times: f32 over\nclips; least: of the worst clip; file: f32 over the whole file. mrad, rad/s: worst \
         error of a joint and of a wheel.\nns/frame: CPU time to read a frame.\n\n{targets}"
    )));
    let verdict = if passed { Verdict::Passed } else { Verdict::NotConverged };
    Ok(Some(Findings { verdict, ..Findings::new("library-format", blocks, &rows) }))
}

/// Measures a library and the formats for comparison.
fn measure(library: &PlannedLibrary) -> miette::Result<Row> {
    let PlannedLibrary { name, robot, plans, built, with_torques } = library;
    let config = robot.controller_config().into_diagnostic()?;
    let index = validate(&built.bytes, &config).into_diagnostic()?;
    let packed = Library::open(&built.bytes, &index).ok_or_else(|| miette!("not this library"))?;
    let mut all = Vec::new();
    let mut bytes = Bytes::default();
    let mut clips = Vec::new();
    for (number, (plan, stats)) in (0u8..).zip(plans.iter().zip(&built.clips)) {
        let raw = raw(plan)?;
        let quanta = packing::quanta(&packed, ClipId(number))?;
        let clip = clip(stats, Bytes::of(stats.bytes, &raw, &quanta)?);
        all.extend(raw);
        bytes += clip.bytes;
        clips.push(clip);
    }
    let joints = robot.joints.len();
    Ok(Row {
        library: name.clone(),
        joints,
        wheels: packed.channel_count() - joints,
        seconds: clips.iter().map(|clip| clip.seconds).sum(),
        bytes,
        file_bytes: built.bytes.len(),
        file_bytes_with_torques: with_torques.len(),
        zstd_19_of_all: packing::compressed(&all, 19)?,
        times_smaller: all.len() as f64 / built.bytes.len() as f64,
        read_ns_per_frame: packing::read_ns_per_frame(&packed)?,
        clips,
    })
}

fn clip(stats: &ClipStats, bytes: Bytes) -> Clip {
    Clip {
        name: stats.name.clone(),
        frames: stats.frames,
        seconds: stats.frames as f64 / f64::from(RATE_HZ),
        bytes,
        times_smaller: bytes.f32 as f64 / bytes.library as f64,
        worst_joint_error_mrad: 1e3 * stats.worst_joint_error_rad,
        worst_wheel_error_rad_s: stats.worst_wheel_error_rad_s,
    }
}

/// Values of a plan frame by frame, as little-endian `f32`.
fn raw(plan: &Plan) -> miette::Result<Vec<u8>> {
    let frames = frames(plan).into_diagnostic()?;
    let values = frames.iter().flat_map(|at| at.channels(&plan.robot));
    Ok(values.flat_map(|value| (value as f32).to_le_bytes()).collect())
}

/// Table of the clips of a library, in bytes per second for its own channels.
fn clip_table(row: &Row) -> Table {
    let mut table = crate::table([
        "clip", "frames", "s", "B/s", "f32", "postcard", "+ zstd", "zstd 3", "zstd 19", "i16",
        "times", "mrad", "rad/s",
    ]);
    for clip in &row.clips {
        let rate = |bytes: usize| format!("{:.0}", bytes as f64 / clip.seconds);
        table.push(vec![
            clip.name.clone(),
            clip.frames.to_string(),
            format!("{:.2}", clip.seconds),
            rate(clip.bytes.library),
            rate(clip.bytes.f32),
            rate(clip.bytes.postcard),
            rate(clip.bytes.postcard_zstd),
            rate(clip.bytes.zstd_3),
            rate(clip.bytes.zstd_19),
            rate(clip.bytes.zstd_19_i16),
            format!("{:.1}", clip.times_smaller),
            format!("{:.3}", clip.worst_joint_error_mrad),
            format!("{:.5}", clip.worst_wheel_error_rad_s),
        ]);
    }
    table
}

/// Table of the libraries, in bytes per second for [`CHANNELS`] channels.
fn library_table(rows: &[Row]) -> Table {
    let mut table = crate::table([
        "library", "channels", "s", "clips", "file", "torques", "f32", "postcard", "+ zstd",
        "zstd 3", "zstd 19", "one", "i16", "times", "least", "file", "mrad", "rad/s", "ns/frame",
    ]);
    for row in rows {
        let channels = row.joints + row.wheels;
        let rate = |bytes: usize| {
            format!("{:.0}", bytes as f64 / row.seconds * CHANNELS / channels as f64)
        };
        table.push(vec![
            row.library.clone(),
            channels.to_string(),
            format!("{:.1}", row.seconds),
            rate(row.bytes.library),
            rate(row.file_bytes),
            rate(row.file_bytes_with_torques),
            rate(row.bytes.f32),
            rate(row.bytes.postcard),
            rate(row.bytes.postcard_zstd),
            rate(row.bytes.zstd_3),
            rate(row.bytes.zstd_19),
            rate(row.zstd_19_of_all),
            rate(row.bytes.zstd_19_i16),
            format!("{:.1}", row.bytes.f32 as f64 / row.bytes.library as f64),
            format!("{:.1}", least(row.clips.iter().map(|clip| clip.times_smaller))),
            format!("{:.1}", row.times_smaller),
            format!("{:.3}", most(row.clips.iter().map(|clip| clip.worst_joint_error_mrad))),
            format!("{:.5}", most(row.clips.iter().map(|clip| clip.worst_wheel_error_rad_s))),
            format!("{:.0}", row.read_ns_per_frame),
        ]);
    }
    table
}

/// Targets, and flags that are true if the target is met.
fn targets(rows: &[Row]) -> [(String, bool); 3] {
    let clips = || rows.iter().flat_map(|row| &row.clips);
    let file = least(rows.iter().map(|row| row.times_smaller));
    let clip = least(clips().map(|clip| clip.times_smaller));
    let error = most(clips().map(|clip| clip.worst_joint_error_mrad));
    [
        (
            format!("every file is at least {TIMES} times smaller than f32: {file:.1}"),
            file >= TIMES,
        ),
        (
            format!("every clip is at least {TIMES} times smaller than f32: {clip:.1}"),
            clip >= TIMES,
        ),
        (
            format!("every joint is within {JOINT_ERROR_MRAD} mrad of its plan: {error:.3}"),
            error <= JOINT_ERROR_MRAD,
        ),
    ]
}

fn least(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}

fn most(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Creates the row of a library with one clip of the given size and error. As raw `f32` the clip has 1000 bytes.
    fn row(clip_bytes: usize, file_bytes: usize, error_mrad: f64) -> Row {
        let bytes = Bytes { library: clip_bytes, f32: 1000, ..Bytes::default() };
        let stats = ClipStats {
            name: "walk".into(),
            frames: 30,
            bytes: clip_bytes,
            worst_joint_error_rad: 1e-3 * error_mrad,
            worst_wheel_error_rad_s: 0.0,
            clamped: 0.0,
        };
        Row {
            library: "robot".into(),
            joints: 3,
            wheels: 1,
            seconds: 0.5,
            bytes,
            file_bytes,
            file_bytes_with_torques: 2 * file_bytes,
            zstd_19_of_all: 900,
            times_smaller: 1000.0 / file_bytes as f64,
            read_ns_per_frame: 100.0,
            clips: vec![clip(&stats, bytes)],
        }
    }

    #[test]
    fn each_target_can_be_missed() {
        assert!(verdicts(targets(&[row(190, 200, 0.5)])).1);
        for (missed, rows) in [
            ("every file", [row(190, 200, 0.4), row(199, 201, 0.4)]),
            ("every clip", [row(201, 200, 0.4), row(190, 200, 0.4)]),
            ("every joint", [row(190, 200, 0.4), row(190, 200, 0.501)]),
        ] {
            let (text, passed) = verdicts(targets(&rows));
            assert!(!passed && text.matches("NO ").count() == 1, "{text}");
            assert!(text.contains(&format!("NO  {missed}")), "{text}");
        }
    }

    #[test]
    fn totals_are_for_16_channels() {
        let table = library_table(&[row(190, 200, 0.4)]);
        // Four channels and half a second. 16 channels and one second need eight times as much.
        assert_eq!(table[1][..7], ["robot", "4", "0.5", "1520", "1600", "3200", "8000"]);
    }
}
