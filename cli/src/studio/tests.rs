//! Tests of the server with requests of browsers, other sites and other programs.

mod relayed;

use super::Server;
use super::desk::Desk;
use super::relay::Relay;
use rollwalk_terminal::inputs::Source;
use rollwalk_terminal::planning::plan_all;
use serde_json::{Value, json};
use std::fs;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::thread;
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

/// A server that runs until the tests end.
struct TestServer {
    port: String,
    token: String,
}

fn start(files: &[PathBuf]) -> TestServer {
    start_with(files, None)
}

fn start_with(files: &[PathBuf], relay: Option<Relay>) -> TestServer {
    let server = Server::bind(0, Desk::open(files, None).unwrap(), relay).unwrap();
    let address = server.address();
    server.start();
    let (port, token) =
        address.strip_prefix("http://127.0.0.1:").unwrap().split_once("/?token=").unwrap();
    assert_eq!(token.len(), 32);
    TestServer { port: port.to_owned(), token: token.to_owned() }
}

impl TestServer {
    fn connect(&self) -> TcpStream {
        TcpStream::connect(format!("127.0.0.1:{}", self.port)).unwrap()
    }

    /// Sends bytes and returns the complete answer.
    fn exchange(&self, bytes: &[u8]) -> String {
        let mut stream = self.connect();
        // A server may close the connection before it has read everything.
        let _ = stream.write_all(bytes);
        let mut answer = Vec::new();
        let _ = stream.read_to_end(&mut answer);
        String::from_utf8_lossy(&answer).into_owned()
    }

    /// Returns the status of a request with the given fields.
    fn status(&self, line: &str, fields: &[&str]) -> u16 {
        let answer =
            self.exchange(format!("{line} HTTP/1.1\r\n{}\r\n\r\n", fields.join("\r\n")).as_bytes());
        answer.split(' ').nth(1).and_then(|status| status.parse().ok()).unwrap_or_default()
    }

    fn socket(
        &self,
        path: &str,
        origin: &str,
        token: &str,
    ) -> Result<WebSocket<TcpStream>, Box<tungstenite::Error>> {
        let address = format!("ws://127.0.0.1:{}/{path}?token={token}", self.port);
        let mut request = address.into_client_request().unwrap();
        request.headers_mut().insert("Origin", origin.parse().unwrap());
        match tungstenite::client(request, self.connect()) {
            Ok((socket, _)) => Ok(socket),
            Err(tungstenite::HandshakeError::Failure(error)) => Err(error.into()),
            Err(tungstenite::HandshakeError::Interrupted(_)) => panic!("the stream blocks"),
        }
    }

    fn own(&self) -> WebSocket<TcpStream> {
        self.own_at("engine")
    }

    fn own_at(&self, path: &str) -> WebSocket<TcpStream> {
        self.socket(path, &format!("http://127.0.0.1:{}", self.port), &self.token).unwrap()
    }
}

/// Returns the final answer to a request, with its bytes.
fn ask(socket: &mut WebSocket<TcpStream>, request: Value) -> (Value, Vec<u8>) {
    socket.send(Message::text(request.to_string())).unwrap();
    answer(socket)
}

fn answer(socket: &mut WebSocket<TcpStream>) -> (Value, Vec<u8>) {
    loop {
        let answer: Value =
            serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap();
        let bytes = if answer["binary"] == true {
            socket.read().unwrap().into_data().to_vec()
        } else {
            Vec::new()
        };
        if answer["kind"] != "progress" {
            return (answer, bytes);
        }
    }
}

#[test]
fn only_those_get_in_who_have_the_address() {
    let server = start(&[]);
    let TestServer { port, token } = &server;
    let host = format!("Host: 127.0.0.1:{port}");
    let page = format!("GET /?token={token}");
    let own = format!("Origin: http://127.0.0.1:{port}");
    for (line, fields, status) in [
        (&*page, vec![&*host], 200),
        (&page, vec![&host, &own], 200),
        ("GET /studio.js", vec![&host], 200),
        // No token, half a token, a wrong token.
        ("GET /", vec![&host], 403),
        (&page[..page.len() - 1], vec![&host], 403),
        (&format!("GET /?token={}", "0".repeat(32)), vec![&host], 403),
        // Another site with its own name, and a name that was rebound to this server (DNS rebinding).
        (&page, vec!["Host: evil.example"], 403),
        (&page, vec![&format!("Host: evil.example:{port}")], 403),
        (&page, vec![&host, "Origin: https://evil.example"], 403),
        (&page, vec![&host, "Origin: null"], 403),
        (&page, vec![&host, &own, "Origin: https://evil.example"], 400),
        (&page, vec![], 403),
        // Only these files, and only for reading.
        ("GET /../Cargo.toml", vec![&host], 404),
        ("GET /studio.wasm", vec![&host], 404),
        (&format!("POST /?token={token}"), vec![&host], 405),
        // A WebSocket needs a key and an origin.
        (&format!("GET /engine?token={token}"), vec![&host, &own], 400),
        (&format!("GET /engine?token={token}"), vec![&host], 403),
        ("BREW", vec![], 400),
    ] {
        assert_eq!(server.status(line, &fields), status, "{line} {fields:?}");
    }
    let said = server.exchange(format!("{page} HTTP/1.1\r\n{host}\r\n\r\n").as_bytes());
    assert!(
        said.contains("Content-Security-Policy: default-src 'none'; script-src 'self'"),
        "{said}"
    );
    assert!(said.contains(&format!("<meta name=\"token\" content=\"{token}\">")), "{said}");
    assert!(!said.contains("http-equiv"), "one policy, in the head");
    for garbage in [&[0xff; 100][..], b"GET / HTTP/1.1\r\nA: ".as_ref(), &[b'a'; 100_000]] {
        let said = server.exchange(&[garbage, b"\r\n\x00\x00\r\n\r\n"].concat());
        assert!(said.is_empty() || said.starts_with("HTTP/1.1 400"), "{said}");
    }
    assert_eq!(server.status(&page, &[&host]), 200, "it is still there");
}

#[test]
fn a_page_of_another_site_has_no_engine() {
    let server = start(&[]);
    let own = format!("http://127.0.0.1:{}", server.port);
    for (origin, token) in [
        ("https://evil.example", &*server.token),
        ("http://127.0.0.1", &server.token),
        ("null", &server.token),
        (&own, ""),
        (&own, "ffffffffffffffffffffffffffffffff"),
    ] {
        match server.socket("engine", origin, token) {
            Err(error) => assert!(error.to_string().contains("403"), "{error}"),
            Ok(_) => panic!("{origin} with `{token}` was let in"),
        }
    }
    let (examples, _) = ask(&mut server.own(), json!({ "seq": 1, "kind": "examples" }));
    assert!(examples["examples"].as_array().unwrap().len() > 60);
}

#[test]
fn a_browser_that_breaks_the_rules_loses_its_own_session_only() {
    let server = start(&[]);
    let mut other = server.own();
    // A frame with a length of 4 GB.
    let mut huge = server.own();
    huge.get_mut().write_all(&[0x81, 0xff, 0, 0, 0, 1, 0, 0, 0, 0, 1, 2, 3, 4]).unwrap();
    assert!(huge.read().is_err() || !huge.can_read());
    let mut binary = server.own();
    binary.send(Message::binary(vec![1, 2, 3])).unwrap();
    assert!(binary.read().is_err(), "bytes that nothing announced");
    let mut odd = server.own();
    let (answer, _) = ask(&mut odd, json!([1, 2]));
    assert_eq!(answer["kind"], "error");
    let (examples, _) = ask(&mut other, json!({ "seq": 1, "kind": "examples" }));
    assert_eq!(examples["kind"], "done");
}

#[test]
fn files_of_the_command_line_are_opened_and_saved_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let walk = folder.path().join("walk.toml");
    fs::write(&walk, rollwalk_shipped::text("motions/walk.toml").unwrap()).unwrap();
    let other = folder.path().join("other.toml");
    fs::write(&other, "a = 1\n").unwrap();
    let server = start(std::slice::from_ref(&walk));
    let mut socket = server.own();
    let (given, _) = ask(&mut socket, json!({ "seq": 1, "kind": "given" }));
    let name = given["desired"]["motion"].as_str().unwrap().to_owned();
    assert_eq!(given["files"].as_array().unwrap().len(), 1);
    // The named robot file is missing; the shipped robot with the same name is used.
    let (opened, _) = ask(
        &mut socket,
        json!({ "seq": 2, "kind": "open", "files": given["files"], "motion": name }),
    );
    assert_eq!(opened["read"][1], "robots/agilebot.toml");
    let mut save = |path: &str, text: &str| {
        ask(&mut socket, json!({ "seq": 3, "kind": "save", "path": path, "text": text })).0
    };
    assert_eq!(save(&name, "# mine\n")["kind"], "done");
    assert_eq!(fs::read_to_string(&walk).unwrap(), "# mine\n");
    assert_eq!(save(&name, "# mine again\n")["kind"], "done");
    let by_another = name.replace("walk", "other");
    for path in [&*by_another, "/etc/passwd", "../walk.toml", ""] {
        let answer = save(path, "x");
        assert!(answer["message"].as_str().unwrap().contains("is not among the files"), "{answer}");
    }
    assert_eq!(fs::read_to_string(&other).unwrap(), "a = 1\n");
    fs::write(&walk, "# by an editor\n").unwrap();
    let answer = save(&name, "# mine\n");
    assert!(answer["message"].as_str().unwrap().contains("changed by another program"), "{answer}");
    assert_eq!(fs::read_to_string(&walk).unwrap(), "# by an editor\n");
}

#[test]
fn what_a_strangers_motion_names_is_opened_if_it_is_a_document_and_written_if_it_lies_below() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let pup = include_str!("../../../shipped/robots/pup.toml");
    for name in ["secret/id", "secret/credentials.toml", "secret/pup.toml", "mine/below/pup.toml"] {
        fs::create_dir_all(at(name).parent().unwrap()).unwrap();
        fs::write(at(name), if name.ends_with("pup.toml") { pup } else { "token = \"x\"\n" })
            .unwrap();
    }
    let opened = |robot: &str| {
        let motion = "name = \"m\"\nrobot = \"ROBOT\"\nends = \"at_rest\"\nduration_s = 1.0\n[footfalls]\nall = \"stance\"\n";
        fs::write(at("mine/m.toml"), motion.replace("ROBOT", robot)).unwrap();
        let server = start(&[at("mine/m.toml")]);
        let mut page = server.own();
        let (given, _) = ask(&mut page, json!({ "seq": 1, "kind": "given" }));
        let files = given["files"].as_array().unwrap().clone();
        let named = files.iter().find(|file| !file["path"].as_str().unwrap().ends_with("/m.toml"));
        named.map(|file| {
            let save = json!({ "seq": 2, "kind": "save", "path": file["path"], "text": pup });
            ask(&mut page, save).0["kind"].as_str().unwrap().to_owned()
        })
    };
    assert_eq!(opened("../secret/id"), None);
    assert_eq!(opened("../secret/credentials.toml"), None);
    assert_eq!(opened("../secret/pup.toml").as_deref(), Some("error"));
    assert_eq!(opened("below/pup.toml").as_deref(), Some("done"));
    // A link in this folder points to another folder.
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(at("secret/pup.toml"), at("mine/link.toml")).unwrap();
        assert_eq!(opened("link.toml").as_deref(), Some("error"));
    }
}

#[test]
fn slow_connections_keep_no_page_away() {
    let server = start(&[]);
    let slow: Vec<_> = (0..60)
        .map(|_| {
            let mut stream = server.connect();
            stream.write_all(b"GET / HTTP/1.1\r\nX: ").unwrap();
            stream
        })
        .collect();
    let host = format!("Host: 127.0.0.1:{}", server.port);
    assert_eq!(server.status(&format!("GET /?token={}", server.token), &[&host]), 200);
    // A client that sends a byte now and then is disconnected in the end.
    let mut stream = slow.into_iter().next().unwrap();
    // The server permits 2 s, and a minute on a busy computer.
    let ended = (0..600).any(|_| {
        thread::sleep(std::time::Duration::from_millis(100));
        stream.write_all(b"T").is_err()
    });
    assert!(ended, "a head in parts is waited for without end");
}

#[test]
fn a_document_with_faults_is_opened_to_be_mended() {
    let folder = tempfile::tempdir().unwrap();
    for text in ["name = ", "footfalls.all = \"stance\"", "link = []"] {
        let path = folder.path().join("mine.toml");
        fs::write(&path, text).unwrap();
        assert!(Desk::open(&[path], None).is_ok(), "{text}");
    }
}

/// Checks that files which are not documents are refused, such as the README, although it quotes robot and motion files.
#[test]
fn what_is_no_document_is_refused_with_what_would_be() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    for file in ["README.md", "CHANGELOG.md", "Cargo.toml", "host/gamepads/xbox.toml"] {
        let error = Desk::open(&[root.join(file)], None).err().unwrap();
        let text = error.to_string();
        assert!(text.contains("robot, motion, library and design files"), "{text}");
        assert!(text.contains(&format!("{file} is a file of another kind;")), "{text}");
    }
}

#[test]
fn libraries_for_controllers_folders_and_plans_of_unknown_motions_are_refused_with_what_to_open() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("plans")).unwrap();
    let plan =
        r#"{"format": "rollwalk-plan", "motion": {"name": "hop"}, "robot": {"name": "pup"}}"#;
    fs::write(at("plans/hop.json"), plan).unwrap();
    fs::write(at("pup.rwl"), [b"ROLLWALK".as_slice(), &[0xff; 40]].concat()).unwrap();
    let refused = |path: PathBuf| format!("{:?}", Desk::open(&[path], None).err().unwrap());
    for (path, words) in [
        ("pup.rwl", ["library for a controller", "the library file (TOML)"]),
        ("", ["is a folder", "hop.json"]),
        ("plans/hop.json", ["plan of motion `hop` of robot `pup`", "MOTION.toml"]),
    ] {
        let said = refused(at(path)).replace(['\n', ' ', '│'], "");
        assert!(words.iter().all(|word| said.contains(&word.replace(' ', ""))), "{path}: {said}");
    }
    // The plan is opened together with its motion.
    fs::write(at("hop.toml"), "footfalls.all = \"stance\"\n").unwrap();
    let opened = Desk::open(&[at("hop.toml"), at("plans/hop.json")], None).unwrap();
    let given = opened.answer(r#"{"seq": 1, "kind": "given"}"#).unwrap();
    let name = |of: &str| given["desired"][of].as_str().unwrap_or_default().to_owned();
    assert!(name("motion").ends_with("hop.toml") && name("plan").ends_with("hop.json"), "{given}");
}

#[test]
fn edits_are_kept_for_the_files_that_they_are_of() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let desk = |name: &str| {
        fs::write(at(name), "footfalls.all = \"stance\"\n").unwrap();
        Desk::open(&[at(name)], Some(at("state"))).unwrap()
    };
    let kept = |desk: &Desk| {
        let given = desk.answer(r#"{"seq": 1, "kind": "given"}"#).unwrap();
        given["edits"]["page"].as_str().map(str::to_owned)
    };
    let keep = |desk: &Desk, text: &str| {
        let request = json!({ "seq": 2, "kind": "keep", "text": text });
        desk.answer(&request.to_string()).unwrap()["kind"].as_str().unwrap().to_owned()
    };
    assert_eq!(kept(&desk("a.toml")), None);
    assert_eq!(keep(&desk("a.toml"), "mine"), "done");
    assert_eq!(kept(&desk("a.toml")).as_deref(), Some("mine"));
    assert_eq!(kept(&desk("b.toml")), None);
    let is_current = |desk: Desk| {
        desk.answer(r#"{"seq": 1, "kind": "given"}"#).unwrap()["edits"]["is_current"].clone()
    };
    assert_eq!(is_current(desk("a.toml")), true);
    fs::write(at("a.toml"), "footfalls.all = \"stance\"\n# by an editor\n").unwrap();
    assert_eq!(is_current(Desk::open(&[at("a.toml")], Some(at("state"))).unwrap()), false);
    assert_eq!(keep(&desk("a.toml"), &"x".repeat(17 << 20)), "error");
    assert_eq!(kept(&desk("a.toml")).as_deref(), Some("mine"), "what was kept stays");
    for damaged in [b"{".as_slice(), b"[]", &[0xff]] {
        let file = fs::read_dir(at("state")).unwrap().next().unwrap().unwrap().path();
        fs::write(file, damaged).unwrap();
        assert_eq!(kept(&desk("a.toml")), None);
    }
    assert_eq!(keep(&Desk::open(&[], None).unwrap(), "mine"), "error", "there is no folder");
}

/// Two tabs edit the same files. A tab replaces the edits that it has opened, but not those that the other has stored since.
#[test]
fn a_tab_does_not_overwrite_the_edits_that_another_one_keeps() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("a.toml"), "footfalls.all = \"stance\"\n").unwrap();
    let desk = Desk::open(&[at("a.toml")], Some(at("state"))).unwrap();
    let keep = |text: &str, by: &str, from: &str| {
        let request = json!({ "seq": 2, "kind": "keep", "text": text, "by": by, "from": from });
        let answer = desk.answer(&request.to_string()).unwrap();
        answer["message"].as_str().unwrap_or_default().to_owned()
    };
    let edits = || desk.answer(r#"{"seq": 1, "kind": "given"}"#).unwrap()["edits"].clone();
    assert_eq!([keep("1", "first", ""), keep("2", "first", "")], ["", ""]);
    assert_eq!((edits()["page"].clone(), edits()["by"].clone()), ("2".into(), "first".into()));
    // The second tab has opened the edits of the first.
    assert_eq!([keep("3", "second", "first"), keep("4", "second", "first")], ["", ""]);
    let refused = keep("5", "first", "");
    assert!(refused.contains("another tab has unsaved edits"), "{refused}");
    assert_eq!(edits()["page"], "4");
    // A new start of the studio.
    assert_eq!(keep("6", "third", "second"), "");
    assert_eq!(edits()["page"], "6");
}

#[test]
fn a_solve_can_be_cancelled_and_the_next_request_is_answered() {
    let server = start(&[]);
    let mut socket = server.own();
    let path = "motions/flying_trot.toml";
    let files = json!([{ "path": path, "text": rollwalk_shipped::text(path).unwrap() }]);
    let plan = json!({
        "seq": 1, "kind": "plan", "files": files, "motion": path, "from": "scratch", "iterations": null, "frames_hz": 60.0,
    });
    socket.send(Message::text(plan.to_string())).unwrap();
    socket.send(Message::text(json!({ "seq": 2, "kind": "cancel" }).to_string())).unwrap();
    socket
        .send(Message::text(json!({ "seq": 3, "kind": "example", "path": path }).to_string()))
        .unwrap();
    let (planned, _) = answer(&mut socket);
    assert_eq!((&planned["seq"], &planned["solve"]["status"]), (&json!(1), &json!("interrupted")));
    assert_eq!(planned["good"], false);
    assert_eq!(answer(&mut socket).0["seq"], 3);
}

#[test]
fn the_studio_builds_the_library_of_the_command_line() {
    const LIBRARY: &str = "motions/test_leg_library.toml";
    let library = Source::Shipped.library(Path::new(LIBRARY)).unwrap();
    let expected = plan_all(&library, false).unwrap().unwrap().pack(&library).unwrap().bytes;
    let mut socket = start(&[]).own();
    let (built, bytes) =
        ask(&mut socket, json!({ "seq": 1, "kind": "library", "files": [], "library": LIBRARY }));
    assert_eq!(built["failures"], json!([]));
    assert_eq!(bytes, expected);
}
