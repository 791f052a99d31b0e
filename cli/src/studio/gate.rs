//! Access control of requests, from their head alone.
//!
//! A page of another site can make the user's browser send requests here. For a WebSocket the browser adds `Origin`, which the
//! page can neither omit nor choose. After rebinding its own name to 127.0.0.1, `Host` still contains that name. Other programs
//! on this computer can send anything, but do not have the token. A program that can read the token from this user's memory or
//! browser does not need the studio.

use super::assets::{self, Asset};
use super::http::Head;

/// Port and token of this server.
pub struct Gate {
    pub port: u16,
    /// Token of 32 hexadecimal digits.
    pub token: String,
}

/// Answer to a request.
#[derive(Debug, PartialEq, Eq)]
pub enum Reply {
    Page,
    /// File of the page.
    File(Asset<'static>),
    /// WebSocket to an engine, with the browser's key.
    Engine {
        /// `Sec-WebSocket-Key`.
        key: String,
    },
    /// WebSocket to the bus, with the browser's key.
    Link {
        /// `Sec-WebSocket-Key`.
        key: String,
    },
    /// Refusal with an HTTP status.
    Refused(u16),
}

impl Gate {
    /// Address of the page.
    pub fn address(&self) -> String {
        format!("http://127.0.0.1:{}/?token={}", self.port, self.token)
    }

    /// Decides the answer to a request.
    pub fn reply(&self, head: &Head) -> Reply {
        let hosts = ["127.0.0.1", "localhost"].map(|name| format!("{name}:{}", self.port));
        if !head.host.as_ref().is_some_and(|host| hosts.contains(host)) {
            return Reply::Refused(403);
        }
        let origins = hosts.map(|host| format!("http://{host}"));
        let is_own = |origin: &String| origins.contains(origin);
        if head.origin.as_ref().is_some_and(|origin| !is_own(origin)) {
            return Reply::Refused(403);
        }
        if head.method != "GET" {
            return Reply::Refused(405);
        }
        let (path, query) = head.target.split_once('?').unwrap_or((&head.target, ""));
        match path {
            "/" if self.knows_token(query) => Reply::Page,
            "/engine" | "/link" if self.knows_token(query) && head.origin.is_some() => {
                match (path, head.key.clone()) {
                    (_, None) => Reply::Refused(400),
                    ("/link", Some(key)) => Reply::Link { key },
                    (_, Some(key)) => Reply::Engine { key },
                }
            }
            "/" | "/engine" | "/link" => Reply::Refused(403),
            _ => match assets::file(path.trim_start_matches('/')) {
                Some(asset) => Reply::File(asset),
                None => Reply::Refused(404),
            },
        }
    }

    /// True if the query contains the token. The comparison time depends only on the length of the query's token.
    fn knows_token(&self, query: &str) -> bool {
        let given = query.split('&').find_map(|pair| pair.strip_prefix("token="));
        let given = given.unwrap_or_default().as_bytes();
        let differ = given.iter().zip(self.token.as_bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
        given.len() == self.token.len() && differ == 0
    }
}
