//! Replay of the scenario's script from the memory of the emulated board. The board compares each of its answers with the
//! answer of the firmware in this process.

use crate::script::{Recording, Script};
use crate::{emulator, scenario, write};
use rollwalk_firmware::Settings;
use rollwalk_protocol::tunnel::{Answer, Deframer, Figures, Hello, StepResult};
use rollwalk_robot::Robot;
use rollwalk_sim_host::core::LocalController;
use rollwalk_sim_host::rig::Rig;
use serde_json::json;
use std::path::Path;
use std::time::Instant;

/// Result of a replay.
struct ReplayResult {
    /// Identity of the image, with the number of its steps up to and including the first wrong answer.
    hello: Hello,
    figures: Figures,
    wrong: Option<StepResult>,
}

/// Records the scenario, replays it on an image, and prints steps and cost as JSON.
///
/// First checks that the replay detects a corrupted script.
///
/// # Errors
/// Returns an error if an answer of the board differs, if the corrupted script is not detected, or if recording or replay
/// fails.
pub fn run(robot: &Robot, image: &Path, library: &[u8], out: &Path) -> Result<(), String> {
    let (script, robot_s) = record(robot, library)?;
    let frames = script.frames();
    eprintln!("recorded {} steps, {frames} frames and {robot_s:.1} s of robot time", script.len());

    let (number, corrupted) = script.corrupted().ok_or("the script has no frame to corrupt")?;
    let replayed = replay(image, &corrupted, &out.join("corrupted.script"))?;
    match difference(&corrupted, &replayed) {
        Some(_) if replayed.hello.steps as usize == number => {}
        _ => {
            return Err(format!(
                "one bit was wrong in step {number} of the script, but the replay ended after step \
                 {} without reporting this bit",
                replayed.hello.steps
            ));
        }
    }

    let start = Instant::now();
    let replayed = replay(image, &script, &out.join("demo.script"))?;
    let config = robot.controller_config().map_err(|error| error.to_string())?;
    if replayed.hello.config_hash != config.hash() {
        let (image, robot) = (replayed.hello.config_hash, config.hash());
        return Err(format!("the image is for robot {image:08x}; expected robot {robot:08x}"));
    }
    if let Some(difference) = difference(&script, &replayed) {
        return Err(difference);
    }
    eprintln!(
        "replayed in {:.1} s; all answers equal those of the simulation, and a script with one \
         wrong bit was detected",
        start.elapsed().as_secs_f64()
    );
    let Figures { periods, start_stack_bytes, stack_bytes, .. } = replayed.figures;
    let figures = replayed.figures;
    let mean = |all: u64, count: u32| emulator::instructions(all as f64 / f64::from(count.max(1)));
    println!(
        "{}",
        json!({
            "steps": script.len(),
            "frames": frames,
            "robot_s": robot_s,
            "periods": periods,
            "mean_tick_instructions": mean(figures.all_ticks, periods),
            "worst_tick_instructions": emulator::instructions(figures.worst_tick.into()),
            "mean_period_instructions": mean(figures.all_periods, periods.saturating_sub(1)),
            "worst_period_instructions": emulator::instructions(figures.worst_period.into()),
            "start_stack_bytes": start_stack_bytes,
            "stack_bytes": stack_bytes,
        })
    );
    Ok(())
}

/// Runs the scenario with the firmware in this process. Returns the script and the duration of the scenario in robot time, s.
fn record(robot: &Robot, library: &[u8]) -> Result<(Script, f64), String> {
    let config = robot.controller_config().map_err(|error| error.to_string())?;
    let core = LocalController::new(config, robot.controller_buses(), Settings::default());
    let rig = Rig::with_core(robot, Recording::new(core)).map_err(|error| error.to_string())?;
    let mut rig = scenario::run(rig, library, |_| {})?;
    let robot_s = rig.now().as_s();
    Ok((rig.core_mut().script().clone(), robot_s))
}

fn replay(image: &Path, script: &Script, path: &Path) -> Result<ReplayResult, String> {
    write(path, &script.encode()?)?;
    let said = emulator::replay(image, path)?;
    let mut deframer = Deframer::default();
    let (mut hello, mut figures, mut wrong) = (None, None, None);
    for byte in said {
        match deframer.push(byte).and_then(Answer::decode) {
            Some((_, Answer::Hello(answer))) => hello = Some(answer),
            Some((_, Answer::Figures(answer))) => figures = Some(answer),
            Some((_, Answer::Stepped(answer))) => wrong = Some(answer),
            None => {}
        }
    }
    let (Some(hello), Some(figures)) = (hello, figures) else {
        return Err("the board ended without a report".into());
    };
    Ok(ReplayResult { hello, figures, wrong })
}

/// Describes the first step in which board and script differ; `None` if they agree.
fn difference(script: &Script, replayed: &ReplayResult) -> Option<String> {
    let steps = replayed.hello.steps as usize;
    if let Some(wrong) = replayed.wrong {
        let expected = script.expected(steps);
        return Some(format!(
            "board and simulation differ in step {steps}\n  board:    {wrong:?}\n  expected: {expected:?}"
        ));
    }
    let all = script.len();
    (steps != all).then(|| format!("the board executed {steps} of {all} steps"))
}
