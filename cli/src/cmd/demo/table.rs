//! Text tables of the demo's measurements.

use super::outcome::{Bound, Clip, DemoOutcome};
use super::world::World;
use crate::excursion;
use rollwalk_terminal::output::Table;

pub fn render(outcome: &DemoOutcome) -> String {
    let mut clips = Table::new([
        "motion", "code", "iter", "time", "dynamics", "", "slip", "size", "command", "error",
        "tracking", "error", "bus",
    ]);
    let units = ["", "", "", "s", "N", "N·m", "mm/s", "B", "mrad", "rad/s", "mrad", "rad/s", "%"];
    clips.row(units.map(str::to_owned));
    for clip in &outcome.clips {
        clips.row(cells(clip));
    }
    let mut bounds = Table::new(["largest value", "measured", "bound", "unit", ""]);
    for Bound { name, worst, bound, unit, holds } in &outcome.bounds {
        bounds.row([
            (*name).to_owned(),
            number(*worst),
            number(*bound),
            (*unit).to_owned(),
            if *holds { "✓".into() } else { "✗ exceeded".into() },
        ]);
    }
    let stopped = outcome.stopped.as_ref();
    let stopped = stopped.map(|why| format!("The demo was stopped: {why}\n\n")).unwrap_or_default();
    format!(
        "\n{stopped}{}: {} motions and transitions in a library of {} B, flashed in {:.2} s, \
         played in {:.1} s of simulated time\n\n{}\n\n{LEGEND}\n\n{}{}\n",
        outcome.robot,
        outcome.clips.len(),
        outcome.library_bytes,
        outcome.flash_s,
        outcome.session_s,
        clips.render(),
        outcome.world.as_ref().map(on_ground).unwrap_or_default(),
        bounds.render(),
    )
}

/// Table of the motions on the ground.
fn on_ground(world: &World) -> String {
    let mut rows = Table::new([
        "on the ground",
        "played",
        "ahead",
        "planned",
        "left",
        "planned",
        "turned",
        "planned",
        "goals",
        "tilt",
        "slid",
        "force",
        "work",
    ]);
    let units = ["", "s", "m", "m", "m", "m", "rad", "rad", "%", "°", "m", "N", "J"];
    rows.row(units.map(str::to_owned));
    for row in &world.travels {
        let [ahead, left, turned] = row.achieved.values().map(|value| format!("{value:.3}"));
        let planned = row.planned.values().map(|value| format!("{value:.3}"));
        let [planned_ahead, planned_left, planned_turn] = planned;
        let error =
            row.goal_error.map_or_else(String::new, |error| format!("{:.1}", 100.0 * error));
        rows.row([
            row.name.clone(),
            format!("{:.2}", row.played_s),
            ahead,
            planned_ahead,
            left,
            planned_left,
            turned,
            planned_turn,
            error,
            format!("{:.1}", row.totals.tilt_max_rad.to_degrees()),
            format!("{:.3}", row.totals.slid_m),
            format!("{:.0}", row.totals.force_max_n),
            format!("{:.2}", row.totals.work_j),
        ]);
    }
    let excursions = excursion::table(&world.excursions);
    format!("{}\n\n{GROUND_LEGEND}\n\n{excursions}\n\n", rows.render())
}

const GROUND_LEGEND: &str = "\
ahead, left     displacement of the centre of mass in the initial heading; turned: change of heading
goals           largest error relative to a goal of the plan
tilt, slid      largest tilt of the body; total distance that feet and wheels slid
force, work     largest force on one foot or wheel; mechanical work of the motors";

const LEGEND: &str = "\
iter, time      optimiser iterations and wall time, from scratch
dynamics, slip  largest residual of the equations of motion and of rolling, recomputed from the plan
size            bytes of the clip in the library
command error   difference between the plan and the setpoints on the bus: joints, wheels
tracking error  difference between the setpoints on the bus and the motors: joints, wheels
bus             load of the busiest bus while the clip was played";

fn cells(clip: &Clip) -> [String; 13] {
    [
        clip.name.clone(),
        clip.code.map_or_else(String::new, |code| code.to_string()),
        clip.iterations.to_string(),
        format!("{:.2}", clip.solve_s),
        number(clip.dynamics_n),
        number(clip.dynamics_nm),
        number(clip.slip_mm_s),
        clip.bytes.to_string(),
        format!("{:.2}", 1e3 * clip.command_joint_rad),
        format!("{:.3}", clip.command_wheel_rad_s),
        format!("{:.1}", 1e3 * clip.tracking_joint_rad),
        format!("{:.3}", clip.tracking_wheel_rad_s),
        format!("{:.1}", 100.0 * clip.bus_load),
    ]
}

/// Formats a value with two decimals; with four below 1, and with an exponent below 0.001.
fn number(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        small if small < 1e-3 => format!("{value:.1e}"),
        below_one if below_one < 1.0 => format!("{value:.4}"),
        _ => format!("{value:.2}"),
    }
}
