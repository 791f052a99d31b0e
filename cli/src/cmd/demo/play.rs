//! The robot's side of the demo: flash the library over the simulated bus, arm, walk over every
//! transition of the motion graph by command codes, back to SAFE, disarm.

use crate::inputs::Library;
use crate::{interrupt, output};
use indicatif::{ProgressBar, ProgressStyle};
use miette::IntoDiagnostic;
use rollwalk_host::session::Session;
use rollwalk_planner::motion::Ends;
use rollwalk_protocol::wire::{Parameter, State};
use rollwalk_sim_host::rig::Rig;

/// Longest wait for a motion to begin, beyond what is being played before it, µs.
const SLACK_US: u64 = 5_000_000;

/// The robot after the demo.
pub struct Played {
    /// Buses, motors and what was recorded.
    pub rig: Rig,
    /// Names of the motions in the order in which they were played.
    pub tour: Vec<String>,
    /// How long the transfer of the library took on the bus, s.
    pub flash_s: f64,
    /// How long the whole session took on the robot's clock, s.
    pub session_s: f64,
}

/// Plays a packed library.
///
/// # Errors
/// The controller refused something, or the robot did not get where it was sent.
pub fn play(library: &Library, packed: &[u8]) -> miette::Result<Played> {
    let rig = Rig::new(&library.robot).into_diagnostic()?;
    let node = rig.node();
    let mut session = Session::connect(rig, node).into_diagnostic()?;
    session.expect_robot(library.robot.controller_config().into_diagnostic()?.hash());

    let before = session.bus().now();
    let bar = transfer_bar(packed.len());
    session.flash(packed, |progress| bar.set_position(progress.done as u64)).into_diagnostic()?;
    bar.finish_and_clear();
    let flash_s = session.bus().now().as_s() - before.as_s();
    output::say(format_args!("✓ flashed {} B over the bus, verified and activated", packed.len()));

    // In the air, torques that hold the robot's weight would push its limbs away from their targets.
    session.set_parameter(Parameter::FeedForward, 0, 0.0).into_diagnostic()?;
    output::say("✓ set feed-forward to 0: the simulated robot hangs on a stand");
    session.arm().into_diagnostic()?;
    output::say("✓ armed");

    let safe = library.file.safe;
    let mut here = safe;
    let mut tour = vec![safe];
    let bar = ProgressBar::new_spinner();
    for node in route(library) {
        if interrupt::requested() {
            break;
        }
        bar.set_message(format!("{} → {}", name(library, here), name(library, node)));
        bar.tick();
        go(&mut session, library, here, node)?;
        (here, tour) = (node, [tour, vec![node]].concat());
    }
    session.return_to_safe().into_diagnostic()?;
    bar.finish_and_clear();
    if here != safe {
        tour.push(safe);
    }
    let tour: Vec<String> = tour.into_iter().map(|node| name(library, node)).collect();
    output::say(format_args!("✓ played {}", tour.join(" → ")));

    session.disarm().into_diagnostic()?;
    output::say("✓ disarmed");
    let rig = session.into_bus();
    let session_s = rig.now().as_s();
    Ok(Played { rig, tour, flash_s, session_s })
}

fn name(library: &Library, node: usize) -> String {
    library.file.motions[node].name.clone()
}

/// How far a transfer is.
pub fn transfer_bar(bytes: usize) -> ProgressBar {
    let bar = ProgressBar::new(bytes as u64);
    bar.set_style(
        ProgressStyle::with_template("flashing {wide_bar} {bytes}/{total_bytes}")
            .unwrap_or_else(|_| ProgressStyle::default_bar()),
    );
    bar
}

/// Selects a motion by its code and waits until it is played; a loop then goes round once.
fn go(session: &mut Session<Rig>, library: &Library, from: usize, to: usize) -> miette::Result<()> {
    let wanted = &library.file.motions[to];
    session.select(wanted.code).into_diagnostic()?;
    // The present motion may have to come to its end first, and a transition takes its time.
    let seconds = |duration_s: f64| (duration_s * 1e6) as u64;
    let longest = library.file.transitions.iter().map(|edge| edge.motion.duration_s);
    let longest = longest.fold(0.0, f64::max) + library.motions[from].duration_s;
    let safe = to == library.file.safe;
    session
        .wait_until(&format!("motion {}", wanted.name), seconds(longest) + SLACK_US, |status| {
            match status.state {
                State::Ready if safe => Some(true),
                State::Playing | State::Ready => {
                    (!safe && status.clip.map(usize::from) == Some(to)).then_some(true)
                }
                _ => Some(false),
            }
        })
        .into_diagnostic()?;
    if library.motions[to].ends == Ends::Periodic {
        session.run_for(seconds(library.motions[to].duration_s)).into_diagnostic()?;
    }
    Ok(())
}

/// Motions to select one after the other, from SAFE, so that every transition is played: an edge
/// that was not played yet where there is one, else towards the next such edge.
fn route(library: &Library) -> Vec<usize> {
    let edges = library.file.transitions.iter().map(|edge| (edge.from, edge.to));
    tour(library.file.safe, edges.collect())
}

fn tour(start: usize, mut unplayed: Vec<(usize, usize)>) -> Vec<usize> {
    let mut here = start;
    let mut route = Vec::new();
    while !unplayed.is_empty() {
        match unplayed.iter().position(|&(from, _)| from == here) {
            Some(index) => here = unplayed.remove(index).1,
            None => {
                // The controller finds the way; edges that it plays on it are played again later.
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
        assert!(tour(0, Vec::new()).is_empty());
    }
}
