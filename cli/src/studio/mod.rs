//! Server of the studio: the page and the native engine, for this computer alone.
//!
//! The server listens on 127.0.0.1. Page and engine require a token that only the printed address contains. Requests that
//! another site makes in the user's browser are refused by their `Host` and `Origin` ([`gate`]). Every connection has a thread;
//! every WebSocket to the engine has a session ([`socket`]). Files are those of the command line ([`desk`]). The bus of the
//! command line serves one page at a time ([`relay`]).

mod assets;
pub mod desk;
mod gate;
mod http;
pub mod relay;
mod socket;
#[cfg(test)]
mod tests;

use assets::Asset;
use desk::Desk;
use gate::{Gate, Reply};
use miette::{IntoDiagnostic, WrapErr};
use relay::Relay;
use rollwalk_terminal::{keys, output};
use std::io;
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

/// Maximum number of simultaneous connections. A page has five engines and a bus, and loads four files.
const CONNECTIONS_MAX: usize = 32;
/// Maximum number of connections with an incomplete head. They are not counted by `CONNECTIONS_MAX`.
const PENDING_MAX: usize = 256;

/// Server that has not started.
pub struct Server {
    listener: TcpListener,
    shared: Arc<Shared>,
}

struct Shared {
    gate: Gate,
    desk: Desk,
    relay: Option<Relay>,
    pending: AtomicUsize,
    connections: AtomicUsize,
}

impl Server {
    /// Binds a port, any free one for 0. With a relay, a page can use its bus.
    ///
    /// # Errors
    /// Returns an error if the port cannot be used, or if the operating system provides no random numbers for the token.
    pub fn bind(port: u16, desk: Desk, relay: Option<Relay>) -> miette::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))
            .into_diagnostic()
            .wrap_err_with(|| format!("port {port} of this computer cannot be used"))?;
        let port = listener.local_addr().into_diagnostic()?.port();
        let gate = Gate { port, token: hex(&keys::random::<16>()?) };
        let [pending, connections] = [0, 0].map(AtomicUsize::new);
        Ok(Self { listener, shared: Arc::new(Shared { gate, desk, relay, pending, connections }) })
    }

    /// Address of the page.
    pub fn address(&self) -> String {
        self.shared.gate.address()
    }

    /// Serves in another thread, until the process ends.
    pub fn start(self) {
        thread::spawn(move || self.serve());
    }

    fn serve(self) {
        for stream in self.listener.incoming() {
            match stream {
                Ok(stream) => self.shared.accept(stream),
                Err(error) => output::print_line(format_args!("a connection failed: {error}")),
            }
        }
    }
}

impl Shared {
    fn accept(self: &Arc<Self>, stream: TcpStream) {
        let shared = Arc::clone(self);
        thread::spawn(move || {
            // A browser that closes its connection is not an error.
            let _ = shared.serve(stream);
        });
    }

    fn serve(&self, mut stream: TcpStream) -> io::Result<()> {
        let Some(pending) = OpenConnection::below(PENDING_MAX, &self.pending) else {
            return Ok(());
        };
        let Some(head) = http::read(&mut stream)? else { return http::refuse(stream, 400) };
        drop(pending);
        let Some(_open) = OpenConnection::below(CONNECTIONS_MAX, &self.connections) else {
            return http::refuse(stream, 503);
        };
        match self.gate.reply(&head) {
            Reply::Page => {
                let bus = self.relay.as_ref().map(Relay::bus);
                let page = assets::page(&self.gate.token, bus);
                let asset = Asset { kind: "text/html; charset=utf-8", bytes: page.as_bytes() };
                http::send(stream, &asset, self.gate.port)
            }
            Reply::File(asset) => http::send(stream, &asset, self.gate.port),
            Reply::Engine { key } => {
                http::upgrade(&mut stream, &key)?;
                socket::serve(stream, head.rest, &self.desk);
                Ok(())
            }
            Reply::Link { key } => match &self.relay {
                Some(relay) => {
                    http::upgrade(&mut stream, &key)?;
                    relay.serve(stream, head.rest);
                    Ok(())
                }
                None => http::refuse(stream, 404),
            },
            Reply::Refused(status) => http::refuse(stream, status),
        }
    }
}

/// Open connection, counted from its creation to its drop, even if the engine panics.
struct OpenConnection<'c>(&'c AtomicUsize);

impl<'c> OpenConnection<'c> {
    /// Counts a connection; returns `None` if the maximum is reached.
    fn below(most: usize, count: &'c AtomicUsize) -> Option<Self> {
        let open = Self(count);
        (count.fetch_add(1, Ordering::Relaxed) < most).then_some(open)
    }
}

impl Drop for OpenConnection<'_> {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}
