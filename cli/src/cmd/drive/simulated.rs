//! Drive over terrain in the simulated world. Each horizon begins in the measured state, on the map of the terrain file or a
//! sensed one, and a tracker follows it.

use super::Args;
use super::steps::Step;
use miette::{IntoDiagnostic, Report};
use rollwalk_pilot::Route;
use rollwalk_planner::receding::{Gait, Horizon, HorizonOptions, Steering};
use rollwalk_simulate::elevation::Sensing;
use rollwalk_simulate::steered::{
    Command, Options, SteeredEvent, SteeredGround, SteeredOutcome, steer,
};
use rollwalk_terminal::Exit;
use rollwalk_terminal::inputs::{Source, number_within};
use rollwalk_terminal::output::{self, fixed};
use std::path::Path;
use std::time::Instant;

/// Default of `--sensed`: a depth camera at a distance of a metre.
pub const SENSING: &str = "3,5,200";

/// Parses `--sensed NOISE,HOLES,DELAY`.
pub fn sensing(text: &str) -> Result<Sensing, String> {
    let parts: Vec<&str> = text.split(',').collect();
    let [noise, holes, delay] = parts[..] else {
        return Err(format!("`{text}` is not of the form NOISE,HOLES,DELAY, such as {SENSING}"));
    };
    let within = |name: &str, text: &str, most: f64| {
        number_within(text, 0.0..=most).map_err(|why| format!("{name} `{text}` {why}"))
    };
    Ok(Sensing {
        noise_m: 1e-3 * within("noise in mm", noise, 50.0)?,
        holes: 0.01 * within("holes in %", holes, 90.0)?,
        delay_s: 1e-3 * within("delay in ms", delay, 2000.0)?,
    })
}

/// Steers the robot of a route over a terrain.
pub fn run(args: &Args, route: &Route, terrain: &Path) -> miette::Result<Exit> {
    let file = terrain.display().to_string();
    let terrain = Source::Disk.terrain(terrain)?;
    let interval_s = route.interval_s();
    let stand = Gait::standing(&route.robot, interval_s).into_diagnostic()?;
    let options = HorizonOptions { duration_s: route.horizon_s(), ..HorizonOptions::default() };
    let horizon = Horizon::new(&route.robot, stand.clone(), options).into_diagnostic()?;
    let mut walks = false;
    let command = |step: &Step| {
        let steering = step.steering;
        let gait = route.gait.as_ref().filter(|_| steering != Steering::default());
        let changes = gait.is_some() != std::mem::replace(&mut walks, gait.is_some());
        let gait = changes.then(|| gait.unwrap_or(&stand).clone());
        Command { at_s: step.at_s, steering, gait }
    };
    let commands: Vec<Command> = args.steer.iter().map(command).collect();
    let planning_s = args.steering.budget().as_secs_f64();
    let options = Options {
        duration_s: args.until.unwrap_or_default(),
        replan_samples: (planning_s / interval_s) as usize + 1,
        planning_s,
        ground: Some(SteeredGround { terrain, sensing: args.sensed }),
        ..Options::default()
    };
    let (mut begun, mut took_ms) = (Instant::now(), Vec::new());
    let outcome = steer(&route.robot, horizon, &commands, &options, &mut |event| match event {
        SteeredEvent::PlanBegins => begun = Instant::now(),
        SteeredEvent::PlanEnds => took_ms.push(1e3 * begun.elapsed().as_secs_f64()),
        SteeredEvent::Step => {}
    });
    let outcome = outcome.map_err(Report::msg)?;
    output::print(&words(&file, &outcome, took_ms))?;
    Ok(if holds(&outcome) { Exit::Ok } else { Exit::DoesNotHold })
}

/// Returns true if the robot stayed on its feet and clear of obstacles, and if it followed a plan after the initial one, unless
/// there was no later plan.
fn holds(outcome: &SteeredOutcome) -> bool {
    let plans = outcome.plans.len();
    let followed = plans <= 1 || outcome.rejected() + 1 < plans;
    outcome.fell_at_s.is_none() && outcome.collision.is_none() && followed
}

/// Summary of a drive.
fn words(file: &str, outcome: &SteeredOutcome, mut took_ms: Vec<f64>) -> String {
    took_ms.sort_by(f64::total_cmp);
    let at = |part: f64| {
        let last = took_ms.len().saturating_sub(1);
        took_ms.get(((part * took_ms.len() as f64) as usize).min(last)).copied().unwrap_or(0.0)
    };
    let [x, y, _] = outcome.end_m;
    let ends = match outcome.fell_at_s {
        Some(at_s) => format!("the robot fell after {at_s:.1} s"),
        None => format!("the robot did not fall in {:.1} s", outcome.time_s),
    };
    let collision = outcome.collision.as_ref().map(|contact| {
        format!("; {contact}: steer round it, because the planner of `drive` ignores obstacles")
    });
    let untracked = match outcome.untracked {
        0 => String::new(),
        ticks => format!("; motors kept their setpoints in {ticks} untracked ticks"),
    };
    format!(
        "{file}: {ends}{}; it moved {} m along x and {} m along y of the world; {} horizons, {:.0} ms \
         each (median; 99 %: {:.0} ms), {} rejected{untracked}",
        collision.unwrap_or_default(),
        fixed::<2>(x),
        fixed::<2>(y),
        outcome.plans.len(),
        at(0.5),
        at(0.99),
        outcome.rejected()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rollwalk_planner::families::Family;
    use rollwalk_simulate::steered::HorizonResult;

    /// Outcome of a run with these plans, accepted or not.
    fn outcome(accepted: &[bool]) -> SteeredOutcome {
        let plan = |accepted: &bool| HorizonResult {
            iterations: 3,
            accepted: *accepted,
            worst_level: 0.1,
            worst_constraint: Family::Foothold,
        };
        SteeredOutcome {
            fell_at_s: None,
            collision: None,
            time_s: 3.0,
            plans: accepted.iter().map(plan).collect(),
            untracked: 0,
            rate_hz: 500.0,
            velocities: Vec::new(),
            end_m: [0.5, -0.1, 0.2],
        }
    }

    #[test]
    fn a_drive_without_followed_plans_does_not_hold() {
        for (plans, expected) in [
            (&[true][..], true),
            (&[true, false, true], true),
            (&[true, false], false),
            (&[true, false, false], false),
        ] {
            assert_eq!(holds(&outcome(plans)), expected, "{plans:?}");
        }
    }

    #[test]
    fn the_summary_has_world_axes_times_and_untracked_ticks() {
        let mut of = outcome(&[true, false]);
        let told = words("a.toml", &of, vec![12.0]);
        assert_eq!(
            told,
            "a.toml: the robot did not fall in 3.0 s; it moved 0.50 m along x and -0.10 m along y \
             of the world; 2 horizons, 12 ms each (median; 99 %: 12 ms), 1 rejected"
        );
        of.untracked = 7;
        let told = words("a.toml", &of, vec![12.0]);
        assert!(told.ends_with("setpoints in 7 untracked ticks"), "{told}");
    }

    #[test]
    fn sensed_maps_are_described_by_three_numbers() {
        let expected = Sensing { noise_m: 0.005, holes: 0.1, delay_s: 0.3 };
        assert_eq!(sensing("5,10,300"), Ok(expected));
        assert_eq!(sensing(SENSING), Ok(Sensing::default()));
        for (text, why) in [
            ("5", "NOISE,HOLES,DELAY"),
            ("5,10", "NOISE,HOLES,DELAY"),
            ("60,10,300", "noise in mm `60`"),
            ("5,10,-1", "delay in ms `-1`"),
        ] {
            assert!(sensing(text).unwrap_err().contains(why), "{text}");
        }
    }
}
