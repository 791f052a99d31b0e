//! The scenario: flash the library, arm, play every motion by its code there and back, return, disarm.

use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::library::{Library, NodeId, RATE_HZ, validate};
use rollwalk_protocol::wire::State;
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::rig::Rig;

/// Longest wait for a motion to begin: the one before may have to end first, µs.
const START_TIMEOUT_US: u64 = 20_000_000;

/// A motion of the library.
struct Motion {
    node: NodeId,
    name: String,
    code: u8,
    duration_us: u64,
}

/// Runs the scenario on a robot that has just been switched on; `say` gets a line for each part.
///
/// # Errors
/// The controller's refusal, or the motion that did not begin.
pub fn run<C: Core>(rig: Rig<C>, library: &[u8], say: impl Fn(&str)) -> Result<Rig<C>, String> {
    let motions = motions(&rig, library)?;
    let node = rig.node();
    play(Session::connect(rig, node), library, &motions, say).map_err(|error| error.to_string())
}

fn motions<C: Core>(rig: &Rig<C>, bytes: &[u8]) -> Result<Vec<Motion>, String> {
    let index =
        validate(bytes, rig.config()).map_err(|reject| format!("the library: {reject:?}"))?;
    let library = Library::open(bytes, &index).ok_or("the library is not the one of its index")?;
    let motions = library.nodes().filter_map(|node| {
        let frames = library.clip(node.clip())?.frames;
        Some(Motion {
            node,
            name: library.name(node)?.into(),
            code: library.code_of(node)?,
            duration_us: u64::from(frames) * 1_000_000 / u64::from(RATE_HZ),
        })
    });
    // SAFE is where all begin and end.
    Ok(motions.filter(|motion| motion.node != library.safe_node()).collect())
}

fn play<C: Core>(
    session: Result<Session<Rig<C>>, SessionError>,
    library: &[u8],
    motions: &[Motion],
    say: impl Fn(&str),
) -> Result<Rig<C>, SessionError> {
    let mut session = session?;
    session.flash(library, |_| {})?;
    say(&format!("flashed {} bytes, checked and taken into use", library.len()));
    session.arm()?;
    say("armed, stands in SAFE");
    // There and back again: transitions between neighbours both ways, where the library has them.
    for motion in motions.iter().chain(motions.iter().rev()) {
        session.select(motion.code)?;
        let name = format!("motion {}", motion.name);
        session.wait_until(&name, START_TIMEOUT_US, |status| match status.state {
            State::Playing => (status.clip == Some(motion.node.0)).then_some(true),
            State::Ready => None,
            _ => Some(false),
        })?;
        session.run_for(motion.duration_us)?;
        say(&format!("played {} by code {}", motion.name, motion.code));
    }
    session.return_to_safe()?;
    say("returned to SAFE");
    session.disarm()?;
    say("disarmed");
    Ok(session.into_bus())
}
