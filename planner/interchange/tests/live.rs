//! The server of the live view, over real connections of clients.

use nalgebra::Isometry3;
use rollwalk_interchange::foxglove::{Figure, LiveServer, Posture};
use rollwalk_robot::Robot;
use serde_json::{Value, json};
use std::net::TcpStream;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::{Message, WebSocket};

fn robot() -> Robot {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shipped/robots/legbot.toml");
    Robot::from_toml("legbot", &std::fs::read_to_string(path).unwrap()).unwrap()
}

/// Connects a client that offers a subprotocol. Returns the selected subprotocol, too.
fn connect(live: &LiveServer, offered: &str) -> Result<(WebSocket<TcpStream>, String), String> {
    let address = live.address();
    let mut request = address.as_str().into_client_request().unwrap();
    request.headers_mut().insert("Sec-WebSocket-Protocol", offered.parse().unwrap());
    let stream = TcpStream::connect(address.trim_start_matches("ws://")).unwrap();
    stream.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let (socket, response) =
        tungstenite::client(request, stream).map_err(|error| error.to_string())?;
    let selected = response.headers()["Sec-WebSocket-Protocol"].to_str().unwrap().to_owned();
    Ok((socket, selected))
}

fn text(socket: &mut WebSocket<TcpStream>) -> Value {
    match socket.read().unwrap() {
        Message::Text(text) => serde_json::from_str(&text).unwrap(),
        other => panic!("{other:?}"),
    }
}

fn subscribe(socket: &mut WebSocket<TcpStream>, id: u32, channel: u32) {
    let subscriptions = json!([{ "id": id, "channelId": channel }]);
    let request = json!({ "op": "subscribe", "subscriptions": subscriptions }).to_string();
    socket.send(Message::text(request)).unwrap();
}

/// Waits for a change that the server's thread makes.
fn wait(what: &str, mut happened: impl FnMut() -> bool) {
    let start = Instant::now();
    while !happened() {
        assert!(start.elapsed() < Duration::from_secs(60), "{what}");
        sleep(Duration::from_millis(5));
    }
}

#[test]
fn clients_come_subscribe_get_messages_and_go() {
    let robot = robot();
    let (joint_rad, wheel_rad) = (vec![0.1; robot.joints.len()], vec![0.0; 4]);
    let posture = Posture {
        world_from_body: Isometry3::identity(),
        joint_rad: &joint_rad,
        wheel_rad: &wheel_rad,
    };
    let figure = Figure::new(&robot, &[], "", [1.0; 4]);
    let live = LiveServer::start("legbot", 0).unwrap();
    assert!(!live.has_clients());
    let why = connect(&live, "chat").unwrap_err();
    assert!(why.contains("400"), "{why}");

    let (mut new, selected) = connect(&live, "foxglove.sdk.v1.1, foxglove.sdk.v1").unwrap();
    assert_eq!(selected, "foxglove.sdk.v1");
    let (mut old, selected) = connect(&live, "foxglove.websocket.v1").unwrap();
    assert_eq!(selected, "foxglove.websocket.v1");
    for socket in [&mut new, &mut old] {
        let info = text(socket);
        assert_eq!((&info["op"], &info["name"]), (&json!("serverInfo"), &json!("legbot")));
        assert_eq!(text(socket)["channels"].as_array().unwrap().len(), 5);
    }
    wait("two clients", || live.has_clients());
    // Joints to one client, frames to the other.
    subscribe(&mut new, 7, 3);
    subscribe(&mut old, 8, 1);
    // The server answers after it has accepted the subscription.
    for socket in [&mut new, &mut old] {
        socket.send(Message::text("{}")).unwrap();
        assert_eq!(text(socket)["op"], "status");
    }
    live.frames.log(&figure.transforms(&posture, 2.5), 2.5);
    live.measured.log(&figure.joint_states(&posture, &[], &[], 2.5), 2.5);
    for (socket, id, list) in [(&mut new, 7, "joints"), (&mut old, 8, "transforms")] {
        let Message::Binary(data) = socket.read().unwrap() else { panic!("no data") };
        let head = [&[1][..], &u32::to_le_bytes(id), &2_500_000_000_u64.to_le_bytes()].concat();
        let (found, json) = data.split_at(head.len());
        assert_eq!(found, head);
        let message: Value = serde_json::from_slice(json).unwrap();
        assert!(!message[list].as_array().unwrap().is_empty(), "{message}");
    }
    drop((new, old));
    wait("no clients", || !live.has_clients());
}

#[test]
fn a_client_that_reads_nothing_holds_up_nobody() {
    let robot = robot();
    let figure = Figure::new(&robot, &[], "", [1.0; 4]);
    let solids = figure.solids(0.0);
    let live = LiveServer::start("legbot", 0).unwrap();
    let (mut idle, _) = connect(&live, "foxglove.sdk.v1").unwrap();
    subscribe(&mut idle, 1, 2);
    let (mut keen, _) = connect(&live, "foxglove.sdk.v1").unwrap();
    subscribe(&mut keen, 1, 2);
    for socket in [&mut idle, &mut keen] {
        socket.send(Message::text("{}")).unwrap();
        (0..3).for_each(|_| drop(text(socket)));
    }
    // More than the sockets of the system and the queue can hold.
    let size = serde_json::to_vec(&solids).unwrap().len();
    for _ in 0..(32 << 20) / size {
        live.robot.log(&solids, 0.0);
    }
    // The client that reads gets the newest message.
    live.robot.log(&solids, 9.0);
    wait("the newest message", || {
        let Message::Binary(data) = keen.read().unwrap() else { panic!("no data") };
        data[5..13] == 9_000_000_000_u64.to_le_bytes()
    });
}

#[test]
fn a_port_that_is_taken_is_refused() {
    let live = LiveServer::start("legbot", 0).unwrap();
    let port = live.address().rsplit(':').next().unwrap().parse().unwrap();
    let why = LiveServer::start("legbot", port).err().unwrap().to_string();
    assert!(why.starts_with(&format!("cannot serve Foxglove on 127.0.0.1:{port}: ")), "{why}");
}
