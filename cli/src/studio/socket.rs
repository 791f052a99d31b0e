//! Engine behind a WebSocket. Requests and answers are text; binary data follows if the text contains `"binary": true`.
//!
//! During a solve the socket is polled between iterations. `{"kind":"cancel"}` ends the solve, and so does a closed connection;
//! other requests wait.

use super::desk::Desk;
use rollwalk_studio::Session;
use rollwalk_studio::robot::Names;
use rollwalk_terminal::link::names;
use serde_json::{Value, json};
use std::collections::VecDeque;
use std::net::TcpStream;
use std::ops::ControlFlow;
use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Error, Message, WebSocket};

/// Maximum size of a message, bytes: documents, or the solution of a long motion.
const MESSAGE_MAX: usize = 32 * 1024 * 1024;
/// Maximum number of requests that wait for a solve.
const WAITING_MAX: usize = 64;

/// Serves a browser until it disconnects.
pub fn serve(stream: TcpStream, rest: Vec<u8>, desk: &Desk) {
    let config = WebSocketConfig::default()
        .max_message_size(Some(MESSAGE_MAX))
        .max_frame_size(Some(MESSAGE_MAX));
    let socket = WebSocket::from_partially_read(stream, rest, Role::Server, Some(config));
    let mut line = Line { socket, waiting: VecDeque::new() };
    let mut session = Session::with_names(Names { find: names::cached, keep: names::cache });
    while let Some((json, bytes)) = line.request() {
        match desk.answer(&json) {
            Some(answer) => {
                if line.send(&answer.to_string(), &[]).is_break() {
                    return;
                }
            }
            None => session.request(&json, &bytes, &mut |json, bytes| line.send(json, bytes)),
        }
    }
}

struct Line {
    socket: WebSocket<TcpStream>,
    /// Messages received during a solve.
    waiting: VecDeque<Message>,
}

impl Line {
    /// Returns the next request and its bytes; `None` if the browser has disconnected or violates the protocol.
    fn request(&mut self) -> Option<(String, Vec<u8>)> {
        let json = loop {
            match self.next()? {
                Message::Text(text) if is_cancel(&text) => {}
                Message::Text(text) => break text.to_string(),
                Message::Ping(_) | Message::Pong(_) => {}
                _ => return None,
            }
        };
        let value: Value = serde_json::from_str(&json).unwrap_or_default();
        let bytes = match value["binary"] == json!(true) {
            true => loop {
                match self.next()? {
                    Message::Binary(bytes) => break bytes.to_vec(),
                    Message::Ping(_) | Message::Pong(_) => {}
                    _ => return None,
                }
            },
            false => Vec::new(),
        };
        Some((json, bytes))
    }

    fn next(&mut self) -> Option<Message> {
        self.waiting.pop_front().map_or_else(|| self.socket.read().ok(), Some)
    }

    /// Sends an answer. Breaks if the browser cancels the solve or has disconnected.
    fn send(&mut self, json: &str, bytes: &[u8]) -> ControlFlow<()> {
        let mut sent = self.socket.send(Message::text(json));
        if sent.is_ok() && !bytes.is_empty() {
            sent = self.socket.send(Message::binary(bytes.to_vec()));
        }
        if sent.is_err() { ControlFlow::Break(()) } else { self.poll() }
    }

    /// Reads received messages without waiting.
    fn poll(&mut self) -> ControlFlow<()> {
        let waits = |line: &Self, wait: bool| line.socket.get_ref().set_nonblocking(!wait).is_ok();
        if !waits(self, false) {
            return ControlFlow::Break(());
        }
        let flow = loop {
            match self.socket.read() {
                Err(Error::Io(error)) if error.kind() == std::io::ErrorKind::WouldBlock => {
                    break ControlFlow::Continue(());
                }
                Ok(Message::Text(text)) if is_cancel(&text) => break ControlFlow::Break(()),
                Ok(Message::Ping(_) | Message::Pong(_)) => {}
                Ok(message) if self.waiting.len() < WAITING_MAX => {
                    let goes = message.is_close();
                    self.waiting.push_back(message);
                    if goes {
                        break ControlFlow::Break(());
                    }
                }
                _ => break ControlFlow::Break(()),
            }
        };
        if waits(self, true) { flow } else { ControlFlow::Break(()) }
    }
}

fn is_cancel(text: &str) -> bool {
    serde_json::from_str::<Value>(text).is_ok_and(|value| value["kind"] == "cancel")
}
