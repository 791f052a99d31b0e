//! Tour through a library on a simulated robot in virtual time: transfers the library over the simulated bus, arms, plays every
//! transition of the motion graph by command codes, returns to SAFE and disarms.

use crate::world_log::{SharedLog, WorldLog};
use indicatif::{ProgressBar, ProgressStyle};
use miette::IntoDiagnostic;
use rollwalk_host::session::Session;
use rollwalk_multibody::ground::Ground;
use rollwalk_physics::push::Shove;
use rollwalk_protocol::library::{ClipId, ClipInfo, Library, NodeId, PlaceCode, RATE_HZ, place_of};
use rollwalk_protocol::wire::{Parameter, State};
use rollwalk_robot::Robot;
use rollwalk_sim_host::ground::Travel;
use rollwalk_sim_host::rig::Rig;
use rollwalk_terminal::validated_library::ValidatedLibrary;
use rollwalk_terminal::{interrupt, output};
use std::sync::Arc;

/// Planned speed, in 64ths.
const FULL_SPEED_64THS: i8 = 64;
/// Timeout for a selected motion to begin, in addition to the duration of the current motion and the transition, µs.
const SLACK_US: u64 = 5_000_000;
/// Simulated time between checks for Ctrl-C while a loop plays, µs.
const PORTION_US: u64 = 500_000;

/// Options for playing a library.
pub struct Options<'a> {
    /// Ground under the robot; `None` for a stand.
    pub ground: Option<&'a Arc<dyn Ground>>,
    /// Pushes; their times count from power-on.
    pub shoves: Vec<Shove>,
    /// True if the torques of the library are fed forward.
    pub feed_forward: bool,
    /// Number of cycles of a loop, at least one.
    pub cycles: u32,
    /// True to play motions named after a place, such as `climb@stairs`.
    pub at_places: bool,
    /// Robot of the simulated world, if it differs from that of the library.
    pub world_robot: Option<&'a Robot>,
    /// Log of the world; `None` if none is written.
    pub world_log: Option<WorldLog>,
}

/// Time for which the robot is simulated after its tour was stopped, µs.
const REST_US: u64 = 2_000_000;

/// Robot after the tour.
pub struct TourResult {
    /// Simulated robot, with the log of its buses and the records of its control periods.
    pub rig: Rig,
    /// Displacements on the ground.
    pub travels: Vec<Travel>,
    /// Names of the motions in the order of playing.
    pub tour: Vec<String>,
    /// Reason why the tour ended early.
    pub stopped: Option<miette::Report>,
    /// Transfer time of the library on the bus, s.
    pub flash_s: f64,
    /// Duration of the whole session on the robot's clock, s.
    pub session_s: f64,
}

/// Plays a library.
///
/// # Errors
/// Returns an error if the controller refused the library or a setting, or if the log of the world cannot be written.
pub fn play(packed: &ValidatedLibrary, options: Options<'_>) -> miette::Result<TourResult> {
    let (robot, library) = (&packed.robot, &packed.library());
    let mut rig = Rig::new(robot).into_diagnostic()?;
    if let Some(ground) = options.ground {
        rig = rig.onto_ground(options.world_robot.unwrap_or(robot), ground, options.shoves);
    }
    let world_log = options.world_log.map(|log| SharedLog::attach(log, &mut rig));
    let node = rig.node();
    let mut session = Session::connect(rig, node).into_diagnostic()?;
    session.expect_robot(robot.controller_config().into_diagnostic()?.hash());

    let before = session.bus().now();
    let bytes = library.bytes();
    let bar = transfer_bar(bytes.len());
    session.flash(bytes, |progress| bar.set_position(progress.done as u64)).into_diagnostic()?;
    bar.finish_and_clear();
    let flash_s = session.bus().now().as_s() - before.as_s();
    output::print_line(format_args!(
        "✓ flashed {} B over the bus, verified and activated",
        bytes.len()
    ));

    if let Some(log) = &world_log {
        log.on_time(session.bus())?;
    }
    if !options.feed_forward {
        session.set_parameter(Parameter::FeedForward, 0, 0.0).into_diagnostic()?;
        output::print_line("✓ set feed-forward to 0");
    }
    let mut played = vec![library.safe_node()];
    let route = route(library, options.at_places);
    let stopped = walk(&mut session, library, route, options.cycles, &mut played).err();
    let names: Vec<String> = played.into_iter().map(|node| name(library, node)).collect();
    output::print_line(format_args!("✓ played {}", names.join(" → ")));
    if stopped.is_some() {
        // A robot that falls comes to rest.
        session.run_for(REST_US).into_diagnostic()?;
    }
    let mut rig = session.into_bus();
    world_log.map_or(Ok(()), |log| log.end())?;
    let session_s = rig.now().as_s();
    let travels = rig.take_travels();
    Ok(TourResult { rig, travels, tour: names, stopped, flash_s, session_s })
}

/// Arms, plays the motions of a route, returns to SAFE and disarms. Appends the motions to `played`.
fn walk(
    session: &mut Session<Rig>,
    library: &Library<'_>,
    route: Vec<NodeId>,
    cycles: u32,
    played: &mut Vec<NodeId>,
) -> miette::Result<()> {
    session.arm().into_diagnostic()?;
    output::print_line("✓ armed");
    let safe = library.safe_node();
    let mut here = safe;
    let bar = ProgressBar::new_spinner();
    for node in route {
        if interrupt::requested() {
            break;
        }
        bar.set_message(format!("{} → {}", name(library, here), name(library, node)));
        bar.tick();
        go(session, library, here, node, cycles)?;
        here = node;
        played.push(node);
    }
    if interrupt::requested() {
        output::print_line("interrupted: returning to SAFE");
    }
    session.return_to_safe().into_diagnostic()?;
    bar.finish_and_clear();
    if here != safe {
        played.push(safe);
    }
    session.disarm().into_diagnostic()?;
    output::print_line("✓ disarmed");
    Ok(())
}

fn name(library: &Library<'_>, node: NodeId) -> String {
    library.name(node).expect("a validated library has a name for every motion").to_owned()
}

/// Duration of a clip, s; one cycle of a loop.
fn duration_s(clip: &ClipInfo) -> f64 {
    let steps = if clip.looping { clip.frames } else { clip.frames.saturating_sub(1) };
    f64::from(steps) / f64::from(RATE_HZ)
}

/// Progress bar of a transfer.
pub fn transfer_bar(bytes: usize) -> ProgressBar {
    let bar = ProgressBar::new(bytes as u64);
    bar.set_style(
        ProgressStyle::with_template("flashing {wide_bar} {bytes}/{total_bytes}")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}

/// Selects a motion by its code and waits until it plays; a loop then completes its cycles.
fn go(
    session: &mut Session<Rig>,
    library: &Library<'_>,
    from: NodeId,
    to: NodeId,
    cycles: u32,
) -> miette::Result<()> {
    let code = library.code_of(to).expect("a validated library has a code for every motion");
    let place = PlaceCode::of_motion(&name(library, to));
    session.select_from(place, code, FULL_SPEED_64THS).into_diagnostic()?;
    // The present motion may have to end first, and a transition takes time.
    let seconds = |duration_s: f64| (duration_s * 1e6) as u64;
    let clip_s = |clip| library.clip(clip).as_ref().map_or(0.0, duration_s);
    let transitions = library.edges().filter_map(|edge| library.edge(edge));
    let longest = transitions.map(|edge| clip_s(edge.clip)).fold(0.0, f64::max);
    let longest = longest + clip_s(ClipId(from.0));
    let safe = to == library.safe_node();
    let what = format!("motion {}", name(library, to));
    session
        .wait_until(&what, seconds(longest) + SLACK_US, |status| match status.state {
            State::Ready if safe => Some(true),
            State::Playing | State::Ready => (!safe && status.clip == Some(to.0)).then_some(true),
            _ => Some(false),
        })
        .into_diagnostic()?;
    if library.clip(ClipId(to.0)).is_some_and(|clip| clip.looping) {
        // The next motion begins at the end of the last round.
        let rounds = f64::from(cycles) - 0.5;
        let mut left_us = seconds(rounds * clip_s(ClipId(to.0)));
        while left_us > 0 && !interrupt::requested() {
            let portion_us = left_us.min(PORTION_US);
            session.run_for(portion_us).into_diagnostic()?;
            left_us -= portion_us;
        }
    }
    Ok(())
}

/// Returns the motions to select from SAFE, in order, so that every transition is played. Without `at_places`, motions for a
/// place and their transitions are left out.
///
/// The route leaves each motion by an unplayed edge. Without one, it selects the origin of the first unplayed edge.
fn route(library: &Library<'_>, at_places: bool) -> Vec<NodeId> {
    let edges = library.edges().filter_map(|edge| library.edge(edge));
    let is_played = |node| at_places || place_of(&name(library, node)).is_none();
    let played = edges.filter(|edge| is_played(edge.from) && is_played(edge.to));
    tour(library.safe_node(), played.map(|edge| (edge.from, edge.to)).collect())
}

fn tour<N: Copy + PartialEq>(start: N, mut unplayed: Vec<(N, N)>) -> Vec<N> {
    let mut here = start;
    let mut route = Vec::new();
    while !unplayed.is_empty() {
        match unplayed.iter().position(|&(from, _)| from == here) {
            Some(index) => here = unplayed.remove(index).1,
            None => {
                // The controller plans the route. Edges that the route contains are played again later.
                here = unplayed[0].0;
            }
        }
        route.push(here);
    }
    route
}

#[cfg(test)]
mod tests {
    use super::tour;

    #[test]
    fn every_edge_is_played() {
        let edges = [(3, 2), (2, 3), (0, 1), (1, 0), (0, 2), (2, 0), (0, 3), (3, 0)];
        let route = tour(0, edges.to_vec());
        let walked: Vec<_> =
            std::iter::once(0).chain(route.iter().copied()).zip(route.iter().copied()).collect();
        for edge in edges {
            assert!(walked.contains(&edge), "{edge:?} is not in {route:?}");
        }
    }

    #[test]
    fn a_library_without_transitions_stays_in_safe() {
        assert!(tour(0, Vec::<(u8, u8)>::new()).is_empty());
    }
}
