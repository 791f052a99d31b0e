//! Server of Foxglove's live protocol on loopback: <https://docs.foxglove.dev/docs/visualization/connecting/live-data>.
//!
//! Clients can neither command nor change anything ([`session`](super::session)). One thread serves all clients without
//! waiting for any of them. A slow client loses messages and does not delay other clients.

use super::figure::nanoseconds;
use super::messages::{FrameTransforms, JointStates, SceneUpdate, Schema};
use super::session::{Message, Offer, Session, first_messages, subprotocol};
use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::marker::PhantomData;
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};
use std::{io, mem};
use thiserror::Error;
use tungstenite::handshake::MidHandshake;
use tungstenite::handshake::server::{Callback, ErrorResponse, Request, Response, ServerHandshake};
use tungstenite::http::{HeaderValue, StatusCode, header::SEC_WEBSOCKET_PROTOCOL};
use tungstenite::protocol::WebSocketConfig;
use tungstenite::{Error as SocketError, HandshakeError, WebSocket};

/// Address that other computers cannot reach.
const LOOPBACK: &str = "127.0.0.1";
/// Pause between two rounds over the connections.
const PAUSE: Duration = Duration::from_millis(5);
/// Maximum number of connections; the server closes further ones.
const CONNECTIONS_MAX: usize = 32;
/// Timeout of a client's handshake.
const HANDSHAKE: Duration = Duration::from_secs(10);
/// Maximum length of a client's message, bytes. Clients only send requests for subscriptions.
const REQUEST_MAX: usize = 64 * 1024;
/// Maximum number of messages read from a client, or written to it, in a round.
const ROUND_MAX: usize = 64;

/// Failure to start the server.
#[derive(Debug, Error)]
#[error("cannot serve Foxglove on {LOOPBACK}:{port}: {why}")]
pub struct LiveError {
    port: u16,
    why: io::Error,
}

/// Server with the topics of a robot.
pub struct LiveServer {
    address: SocketAddr,
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
    /// Frames of all robots.
    pub frames: Channel<FrameTransforms>,
    /// Solids. Send them repeatedly, because clients connect at any time.
    pub robot: Channel<SceneUpdate>,
    /// Measured joints.
    pub measured: Channel<JointStates>,
    /// Planned or commanded joints.
    pub planned: Channel<JointStates>,
    /// Forces of the ground.
    pub forces: Channel<SceneUpdate>,
}

/// Sessions by connection, shared by the server's thread and the threads that publish.
#[derive(Default)]
struct Shared {
    sessions: Mutex<BTreeMap<u64, Session>>,
    ends: AtomicBool,
}

impl Shared {
    fn sessions(&self) -> MutexGuard<'_, BTreeMap<u64, Session>> {
        self.sessions.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Topic for messages of one schema.
pub struct Channel<M> {
    id: usize,
    shared: Arc<Shared>,
    message: PhantomData<fn(M)>,
}

impl<M: Schema> Channel<M> {
    /// Adds a channel to the channels that the server offers.
    fn offer(topic: &'static str, shared: &Arc<Shared>, offers: &mut Vec<Offer>) -> Self {
        offers.push(Offer { topic, schema_name: M::NAME, schema: M::schema() });
        Self { id: offers.len(), shared: Arc::clone(shared), message: PhantomData }
    }

    /// Sends a message to all subscribers, with its time since 1970.
    pub fn log(&self, message: &M, time_s: f64) {
        if !self.shared.sessions().values().any(|session| session.is_subscribed(self.id)) {
            return;
        }
        let payload = serde_json::to_vec(message).unwrap_or_default();
        for session in self.shared.sessions().values_mut() {
            session.publish(self.id, nanoseconds(time_s), &payload);
        }
    }
}

impl LiveServer {
    /// Starts the server of a robot on a port of loopback. Port 0 selects a free port.
    ///
    /// # Errors
    /// The port is taken.
    pub fn start(robot: &str, port: u16) -> Result<Self, LiveError> {
        let failed = |why| LiveError { port, why };
        let listener = TcpListener::bind((LOOPBACK, port)).map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let address = listener.local_addr().map_err(failed)?;
        let (shared, mut offers) = (Arc::new(Shared::default()), Vec::new());
        let frames = Channel::offer("/tf", &shared, &mut offers);
        let solids = Channel::offer("/robot", &shared, &mut offers);
        let measured = Channel::offer("/joint_states", &shared, &mut offers);
        let planned = Channel::offer("/planned_joint_states", &shared, &mut offers);
        let forces = Channel::offer("/forces", &shared, &mut offers);
        // Clients use it to detect a restarted server.
        let started = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        let greeting = first_messages(robot, &started.as_millis().to_string(), &offers);
        let server = Server {
            listener,
            shared: Arc::clone(&shared),
            greeting,
            channels: offers.len(),
            handshakes: Vec::new(),
            connections: BTreeMap::new(),
            accepted: 0,
        };
        let thread = thread::Builder::new().name("foxglove".to_owned());
        let thread = Some(thread.spawn(|| server.serve()).map_err(failed)?);
        Ok(Self { address, shared, thread, frames, robot: solids, measured, planned, forces })
    }

    /// Address that clients connect to.
    pub fn address(&self) -> String {
        format!("ws://{}", self.address)
    }

    /// True if a program is connected.
    pub fn has_clients(&self) -> bool {
        !self.shared.sessions().is_empty()
    }
}

impl Drop for LiveServer {
    fn drop(&mut self) {
        self.shared.ends.store(true, Ordering::Relaxed);
        // A panic of the thread has been printed.
        let _ = self.thread.take().map(JoinHandle::join);
    }
}

/// Answers a handshake with the selected subprotocol, or refuses it.
struct Negotiation;

impl Callback for Negotiation {
    fn on_request(self, request: &Request, answer: Response) -> Result<Response, ErrorResponse> {
        let fields = request.headers().get_all(SEC_WEBSOCKET_PROTOCOL);
        let mut answer = answer;
        match subprotocol(fields.iter().filter_map(|field| field.to_str().ok())) {
            Some(selected) => {
                let selected = HeaderValue::from_static(selected);
                answer.headers_mut().insert(SEC_WEBSOCKET_PROTOCOL, selected);
                Ok(answer)
            }
            None => {
                let mut refusal = ErrorResponse::new(Some(
                    "the request names no supported \
                    subprotocol"
                        .to_owned(),
                ));
                *refusal.status_mut() = StatusCode::BAD_REQUEST;
                Err(refusal)
            }
        }
    }
}

type Handshake = ServerHandshake<TcpStream, Negotiation>;

/// State of the server's thread.
struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
    greeting: [String; 2],
    channels: usize,
    handshakes: Vec<(Instant, MidHandshake<Handshake>)>,
    connections: BTreeMap<u64, WebSocket<TcpStream>>,
    /// Connections since the start.
    accepted: u64,
}

impl Server {
    fn serve(mut self) {
        while !self.shared.ends.load(Ordering::Relaxed) {
            self.accept();
            let shared = &self.shared;
            self.connections.retain(|id, socket| {
                let stays = exchange(socket, *id, shared).is_ok();
                if !stays {
                    shared.sessions().remove(id);
                }
                stays
            });
            thread::sleep(PAUSE);
        }
    }

    /// Accepts new connections and continues their handshakes.
    fn accept(&mut self) {
        for (begun, handshake) in mem::take(&mut self.handshakes) {
            if begun.elapsed() < HANDSHAKE {
                self.on_handshake(begun, handshake.handshake());
            }
        }
        while let Ok((stream, _)) = self.listener.accept() {
            let count = self.connections.len() + self.handshakes.len();
            let is_ready = stream.set_nonblocking(true).and(stream.set_nodelay(true)).is_ok();
            if count < CONNECTIONS_MAX && is_ready {
                let config = WebSocketConfig::default()
                    .max_message_size(Some(REQUEST_MAX))
                    .max_frame_size(Some(REQUEST_MAX));
                let handshake = ServerHandshake::start(stream, Negotiation, Some(config));
                self.on_handshake(Instant::now(), handshake.handshake());
            }
        }
    }

    fn on_handshake(
        &mut self,
        begun: Instant,
        outcome: Result<WebSocket<TcpStream>, HandshakeError<Handshake>>,
    ) {
        match outcome {
            Ok(socket) => {
                self.accepted += 1;
                let session = Session::new(self.channels, self.greeting.clone());
                self.shared.sessions().insert(self.accepted, session);
                self.connections.insert(self.accepted, socket);
            }
            Err(HandshakeError::Interrupted(handshake)) => self.handshakes.push((begun, handshake)),
            Err(HandshakeError::Failure(_)) => {}
        }
    }
}

/// Reads requests of a client and writes its pending messages, until either would block.
///
/// # Errors
/// The client disconnected or violates the protocol.
fn exchange(
    socket: &mut WebSocket<TcpStream>,
    id: u64,
    shared: &Shared,
) -> Result<(), SocketError> {
    let session = |act: &mut dyn FnMut(&mut Session)| {
        if let Some(session) = shared.sessions().get_mut(&id) {
            act(session);
        }
    };
    for _ in 0..ROUND_MAX {
        match would_block(socket.read())? {
            Some(tungstenite::Message::Text(text)) => session(&mut |of| of.on_text(&text)),
            Some(_) => {}
            None => break,
        }
    }
    for _ in 0..ROUND_MAX {
        // A message is taken only after the previous message was sent, so that no queue grows in the socket.
        if would_block(socket.flush())?.is_none() {
            break;
        }
        let mut next = None;
        session(&mut |of| next = of.next());
        let message = match next {
            Some(Message::Text(text)) => tungstenite::Message::text(text),
            Some(Message::Binary(data)) => tungstenite::Message::binary(data),
            None => break,
        };
        would_block(socket.write(message))?;
    }
    Ok(())
}

/// Outcome of a call; `None` if the call would block.
fn would_block<T>(outcome: Result<T, SocketError>) -> Result<Option<T>, SocketError> {
    match outcome {
        Ok(done) => Ok(Some(done)),
        Err(SocketError::Io(error)) if error.kind() == ErrorKind::WouldBlock => Ok(None),
        Err(error) => Err(error),
    }
}
