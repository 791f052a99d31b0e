//! Scenario: flash the library, arm, play every motion by its command code from SAFE and back, return, disarm.

use crate::image_keys;
use ed25519_dalek::SigningKey;
use rollwalk_host::authentication::{Credentials, Peer};
use rollwalk_host::session::{Session, SessionError};
use rollwalk_protocol::library::{Library, NodeId, RATE_HZ, validate};
use rollwalk_protocol::wire::State;
use rollwalk_protocol::wire::authentication::{LINK_KEY_LEN, LinkKey};
use rollwalk_sim_host::core::Core;
use rollwalk_sim_host::rig::Rig;

/// Timeout for the start of a motion, µs. The previous motion may have to end first.
const START_TIMEOUT_US: u64 = 20_000_000;

/// Motion of the library.
struct LibraryMotion {
    node: NodeId,
    name: String,
    code: u8,
    duration_us: u64,
}

/// Keys of the host.
#[derive(Default)]
pub struct HostKeys {
    /// Link key of the robot.
    pub link: Option<[u8; LINK_KEY_LEN]>,
    /// Private key for signatures of libraries.
    pub signing: Option<SigningKey>,
}

/// Runs the scenario without keys on a robot that has just been switched on. Calls `say` with a line for each part.
///
/// # Errors
/// Returns an error if the controller refuses a command, or if a motion does not start in time.
pub fn run<C: Core>(rig: Rig<C>, library: &[u8], say: impl Fn(&str)) -> Result<Rig<C>, String> {
    run_with(&HostKeys::default(), rig, library, say)
}

/// Runs the scenario with keys on a robot that has just been switched on. Calls `say` with a line for each part.
///
/// # Errors
/// Returns an error if the controller refuses a command, or if a motion does not start in time.
pub fn run_with<C: Core>(
    keys: &HostKeys,
    rig: Rig<C>,
    library: &[u8],
    say: impl Fn(&str),
) -> Result<Rig<C>, String> {
    let motions = motions(&rig, library)?;
    let signed = keys.signing.as_ref().map(|key| image_keys::signed(library, key));
    // Both runs of a comparison have the same numbers.
    let key = keys.link.as_ref().map(LinkKey::new);
    let credentials = key.map(|key| Credentials { key, nonce: 1 });
    let peer = Peer { node: rig.node(), credentials };
    let session = Session::connect(rig, peer);
    play(session, signed.as_deref().unwrap_or(library), &motions, say)
        .map_err(|error| error.to_string())
}

fn motions<C: Core>(rig: &Rig<C>, bytes: &[u8]) -> Result<Vec<LibraryMotion>, String> {
    let index = validate(bytes, rig.config()).map_err(|reject| {
        format!(
            "the library is not valid: \
            {reject:?}"
        )
    })?;
    let library = Library::open(bytes, &index).ok_or("the library does not match its index")?;
    let motions = library.nodes().filter_map(|node| {
        let frames = library.clip(node.clip())?.frames;
        Some(LibraryMotion {
            node,
            name: library.name(node)?.into(),
            code: library.code_of(node)?,
            duration_us: u64::from(frames) * 1_000_000 / u64::from(RATE_HZ),
        })
    });
    // All motions begin and end at SAFE.
    Ok(motions.filter(|motion| motion.node != library.safe_node()).collect())
}

fn play<C: Core>(
    session: Result<Session<Rig<C>>, SessionError>,
    library: &[u8],
    motions: &[LibraryMotion],
    say: impl Fn(&str),
) -> Result<Rig<C>, SessionError> {
    let mut session = session?;
    session.flash(library, |_| {})?;
    say(&format!("flashed {} bytes, checked and activated", library.len()));
    session.arm()?;
    say("armed, stands in SAFE");
    // Forward and backward through the motions, if the library has transitions between neighbours in both directions.
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
