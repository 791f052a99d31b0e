//! Simulation of a motion library behind the firmware: a tour over its motion graph, with the results of each motion.

use super::Args;
use crate::excursion::{self, Excursion};
use crate::planned::{self, ClipResult};
use crate::terrain::Support;
use crate::tour::{self, Options, TourResult};
use miette::miette;
use rollwalk_physics::world::{NetDisplacement, ObstacleContact, Totals};
use rollwalk_protocol::library::place_of;
use rollwalk_sim_host::ground::{Fall, Travel};
use rollwalk_simulate::Mismatch;
use rollwalk_terminal::files::Rotation;
use rollwalk_terminal::output::Table;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{Exit, interrupt, output};
use serde::Serialize;

#[derive(Serialize)]
struct Document {
    robot: String,
    /// Simulated time, s.
    session_s: f64,
    /// Motions and transitions in the order of playing.
    travels: Vec<Row>,
    /// Net displacements from SAFE to SAFE.
    excursions: Vec<Excursion>,
    falls: Vec<FallRow>,
    /// First contact with an obstacle during each motion.
    obstacle_contacts: Vec<ObstacleContact>,
    /// Reason why the tour ended early.
    stopped: Option<String>,
}

#[derive(Serialize)]
struct Row {
    name: String,
    played_s: f64,
    #[serde(flatten)]
    way: NetDisplacement,
    #[serde(flatten)]
    totals: Totals,
    /// Comparison with the plan; null if the library was not built on this computer.
    plan: Option<ClipResult>,
}

#[derive(Serialize)]
struct FallRow {
    at_s: f64,
    tilt_rad: f64,
    height_m: f64,
}

impl From<&Fall> for FallRow {
    fn from(&Fall { at, how }: &Fall) -> Self {
        Self { at_s: at.as_s(), tilt_rad: how.tilt_rad, height_m: how.height_m }
    }
}

/// Simulates the library of the command line.
pub fn run(args: &Args) -> miette::Result<Exit> {
    if args.rate.is_some() {
        return Err(miette!(
            help = "leave out this option, or simulate a plan",
            "--rate is for plans: a library is simulated with the firmware at a fixed rate"
        ));
    }
    if args.tracking {
        return Err(miette!(
            help = "leave out this option, or simulate a plan",
            "--tracking is for plans: the firmware plays libraries in open loop"
        ));
    }
    if args.contact_stiffness != 1.0 {
        return Err(miette!(
            help = "leave out this option, or simulate a plan",
            "--contact-stiffness is for plans"
        ));
    }
    let packed = ValidatedLibrary::read(&args.what, args.robot.as_deref())?;
    let ground = args.ground.under(Support::Ground, &packed.robot)?;
    let mismatch = Mismatch { mass: args.mass, friction: args.friction, ..Mismatch::default() };
    let world_robot = mismatch.of(&packed.robot);
    interrupt::install_handler();
    let TourResult { rig, travels, session_s, stopped, .. } = tour::play(
        &packed,
        Options {
            ground: ground.as_ref(),
            shoves: args.ground.shoves(),
            feed_forward: !args.no_feed_forward,
            cycles: args.cycles,
            at_places: args.ground.has_terrain(),
            world_robot: Some(&world_robot),
            world_log: args.world_log.begin(&packed.robot, Rotation::OFF)?,
        },
    )?;
    let interrupted = interrupt::requested();
    let catalog = packed.catalog();
    let ways = planned::cached(catalog.library).unwrap_or_default();
    let row = |travel: &Travel| {
        let clip = travel.clip().map(|clip| clip.0);
        let planned = clip.and_then(|clip| ways.get(usize::from(clip)));
        Row {
            plan: planned.map(|planned| planned.compare(travel)),
            name: clip.and_then(|clip| catalog.clip(clip)).unwrap_or_default(),
            played_s: travel.duration_s(),
            way: travel.displacement(),
            totals: travel.totals(),
        }
    };
    let names: Vec<_> = catalog.motions.iter().map(|motion| motion.name.as_str()).collect();
    let ground = rig.body().ground();
    let falls = ground.map(|ground| ground.falls()).unwrap_or_default();
    let contacts = ground.and_then(|ground| ground.obstacle_contacts()).unwrap_or_default();
    let document = Document {
        robot: packed.robot.name.clone(),
        session_s,
        travels: travels.iter().map(row).collect(),
        excursions: excursion::of_tour(&travels, &names, catalog.safe),
        falls: falls.iter().map(FallRow::from).collect(),
        obstacle_contacts: contacts.to_vec(),
        stopped: match stopped {
            Some(why) => Some(why.to_string()),
            None => interrupted.then(|| "interrupted".to_owned()),
        },
    };
    if !args.ground.has_terrain() {
        let placed = names.iter().filter(|name| place_of(name).is_some());
        let text =
            |name| format!("motion `{name}` was not played: give its terrain with --terrain");
        output::print_warnings(&placed.map(text).collect::<Vec<_>>());
    }
    if args.json {
        output::print_json(&document)?;
    } else {
        output::print(&describe(&document))?;
    }
    if interrupted {
        return Ok(Exit::Interrupted);
    }
    let holds = document.falls.is_empty()
        && document.obstacle_contacts.is_empty()
        && document.stopped.is_none()
        && document.missed().next().is_none();
    Ok(if holds { Exit::Ok } else { Exit::DoesNotHold })
}

impl Document {
    /// Motions that miss the goals of their plans and do not need feedback.
    fn missed(&self) -> impl Iterator<Item = (&str, &str)> {
        self.travels.iter().filter_map(|Row { name, plan, .. }| {
            let plan = plan.as_ref().filter(|plan| !plan.needs_feedback)?;
            Some((name.as_str(), plan.miss.as_deref()?))
        })
    }
}

fn describe(document: &Document) -> String {
    let mut rows = Table::new([
        "on the ground",
        "played",
        "ahead",
        "left",
        "turned",
        "of plan",
        "tilt",
        "slid",
        "force",
        "work",
    ]);
    rows.row(["", "s", "m", "m", "rad", "", "°", "m", "N", "J"].map(str::to_owned));
    for Row { name, played_s, way, totals, plan } in &document.travels {
        let of_plan = plan.as_ref().and_then(|plan| plan.of_plan);
        let [ahead, left, turned] = way.values().map(|value| format!("{value:.3}"));
        rows.row([
            name.clone(),
            format!("{played_s:.2}"),
            ahead,
            left,
            turned,
            of_plan.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.3}")),
            format!("{:.1}", totals.tilt_max_rad.to_degrees()),
            format!("{:.3}", totals.slid_m),
            format!("{:.0}", totals.force_max_n),
            format!("{:.2}", totals.work_j),
        ]);
    }
    let falls = match &document.falls[..] {
        [] => "no falls".to_owned(),
        [first, ..] => {
            let count = document.falls.len();
            format!(
                "{count} {}, the first after {:.2} s, tilted by {:.2} rad",
                if count == 1 { "fall" } else { "falls" },
                first.at_s,
                first.tilt_rad
            )
        }
    };
    let stopped = document.stopped.as_ref().map(|why| format!("; {why}")).unwrap_or_default();
    let mut text = format!(
        "{}\n\n{}\n\n{} in {:.1} s: {falls}{stopped}",
        rows.render(),
        excursion::table(&document.excursions),
        document.robot,
        document.session_s
    );
    for contact in &document.obstacle_contacts {
        text += &format!("\n{contact}");
    }
    for (name, miss) in document.missed() {
        text += &format!("\n{name} fails in simulation: {miss}");
    }
    if document.travels.iter().all(|row| row.plan.is_none()) {
        text += "\nno verdict on the motions: their plans are known only on the computer where \
            `rollwalk library build` made the library";
    }
    text
}
