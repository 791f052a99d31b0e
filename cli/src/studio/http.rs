//! Subset of HTTP/1.1 that the page needs: the head of a GET request, and a response that closes the connection.

use super::assets::Asset;
use std::io::{self, Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use tungstenite::handshake::derive_accept_key;

/// Maximum size of a head, bytes.
const HEAD_MAX: usize = 8 * 1024;
/// Maximum number of fields in a head.
const FIELDS_MAX: usize = 64;
/// Timeout for a complete head; the browser is on the same computer.
const HEAD: Duration = Duration::from_secs(2);
/// Timeout for a browser that does not read a response.
const PATIENCE: Duration = Duration::from_secs(10);

/// Head of a request.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    pub method: String,
    pub target: String,
    /// `Host`.
    pub host: Option<String>,
    /// `Origin`.
    pub origin: Option<String>,
    /// `Sec-WebSocket-Key` of a request for a WebSocket.
    pub key: Option<String>,
    /// Bytes received after the head.
    pub rest: Vec<u8>,
}

/// Reads a head; returns `None` if it is invalid or too long.
///
/// # Errors
/// Returns an error if the connection ends or is too slow.
pub fn read(stream: &mut TcpStream) -> io::Result<Option<Head>> {
    stream.set_write_timeout(Some(PATIENCE))?;
    let begun = Instant::now();
    let mut bytes = Vec::new();
    let mut chunk = [0; 2048];
    loop {
        let left = HEAD.checked_sub(begun.elapsed()).filter(|left| !left.is_zero());
        stream.set_read_timeout(Some(left.ok_or(io::ErrorKind::TimedOut)?))?;
        let count = stream.read(&mut chunk)?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        bytes.extend_from_slice(&chunk[..count]);
        match parse(&bytes) {
            ParsedHead::Whole(head) => return Ok(Some(head)),
            ParsedHead::Partial if bytes.len() < HEAD_MAX => {}
            ParsedHead::Partial | ParsedHead::Bad => return Ok(None),
        }
    }
}

enum ParsedHead {
    Whole(Head),
    Partial,
    Bad,
}

fn parse(bytes: &[u8]) -> ParsedHead {
    let mut fields = [httparse::EMPTY_HEADER; FIELDS_MAX];
    let mut request = httparse::Request::new(&mut fields);
    let length = match request.parse(bytes) {
        Ok(httparse::Status::Complete(length)) => length,
        Ok(httparse::Status::Partial) => return ParsedHead::Partial,
        Err(_) => return ParsedHead::Bad,
    };
    let field = |name: &str| {
        let mut found =
            request.headers.iter().filter(|field| field.name.eq_ignore_ascii_case(name));
        let value = found.next().and_then(|field| std::str::from_utf8(field.value).ok());
        // A header that occurs twice is ignored.
        value.filter(|_| found.next().is_none()).map(str::to_owned)
    };
    let twice = |name: &str| {
        request.headers.iter().filter(|field| field.name.eq_ignore_ascii_case(name)).count() > 1
    };
    if twice("origin") || twice("host") {
        return ParsedHead::Bad;
    }
    let is_socket = field("upgrade").is_some_and(|to| to.eq_ignore_ascii_case("websocket"))
        && field("sec-websocket-version").as_deref() == Some("13");
    ParsedHead::Whole(Head {
        method: request.method.unwrap_or_default().to_owned(),
        target: request.path.unwrap_or_default().to_owned(),
        host: field("host"),
        origin: field("origin"),
        key: field("sec-websocket-key").filter(|_| is_socket),
        rest: bytes[length..].to_vec(),
    })
}

/// Sends a file of the page.
///
/// # Errors
/// Returns an error if the connection ends.
pub fn send(mut stream: TcpStream, asset: &Asset<'_>, port: u16) -> io::Result<()> {
    // The page loads nothing from other servers, and connects to this server only.
    let policy = format!(
        "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; style-src 'self'; img-src 'self' data: blob:; \
         connect-src 'self' ws://127.0.0.1:{port} ws://localhost:{port}; worker-src blob:; base-uri 'none'; \
         form-action 'none'; frame-ancestors 'none'"
    );
    let head = format!(
        "HTTP/1.1 200 OK\r\nContent-Type: {}\r\nContent-Length: {}\r\nContent-Security-Policy: {policy}\r\n\
         X-Content-Type-Options: nosniff\r\nReferrer-Policy: no-referrer\r\nCross-Origin-Resource-Policy: same-origin\r\n\
         Cross-Origin-Opener-Policy: same-origin\r\nCache-Control: no-store\r\nConnection: close\r\n\r\n",
        asset.kind,
        asset.bytes.len()
    );
    stream.write_all(head.as_bytes())?;
    stream.write_all(asset.bytes)
}

/// Refuses a request.
///
/// # Errors
/// Returns an error if the connection ends.
pub fn refuse(mut stream: TcpStream, status: u16) -> io::Result<()> {
    let reason = match status {
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        503 => "Service Unavailable",
        _ => "Method Not Allowed",
    };
    let body = match status {
        403 => "open the address that `rollwalk studio` printed\n",
        _ => "",
    };
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status} {reason}\r\nContent-Type: text/plain\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n{body}"
    );
    stream.write_all(head.as_bytes())
}

/// Upgrades a connection to a WebSocket.
///
/// # Errors
/// Returns an error if the connection ends.
pub fn upgrade(stream: &mut TcpStream, key: &str) -> io::Result<()> {
    let accept = derive_accept_key(key.as_bytes());
    let head = format!(
        "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: {accept}\r\n\r\n"
    );
    stream.write_all(head.as_bytes())?;
    // Bytes after an answer must not wait for the acknowledgement of the browser, which takes 40 ms.
    stream.set_nodelay(true)?;
    // A page may send nothing for hours.
    stream.set_read_timeout(None)
}
