//! Server's end of one connection of Foxglove's WebSocket protocol, without I/O: texts in, messages out.
//!
//! Specification: <https://github.com/foxglove/ws-protocol/blob/main/docs/spec.md>. The server offers no capability, so that a
//! client can only subscribe to channels.

use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, VecDeque};

/// Subprotocols of the server, the preferred one first. The messages used here are the same in both.
const SUBPROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Maximum size of pending data for a client, bytes: about a second of the data of one robot. Beyond that, the oldest message is
/// dropped.
const DATA_MAX: usize = 4 * 1024 * 1024;
/// Maximum number of pending texts for a client; further texts are dropped.
const TEXTS_MAX: usize = 16;
/// Opcode of a binary message with data.
const MESSAGE_DATA: u8 = 1;

/// Channel that a server offers.
pub struct Offer {
    /// Topic.
    pub topic: &'static str,
    /// Name of the schema.
    pub schema_name: &'static str,
    /// JSON schema.
    pub schema: Value,
}

/// Selects the subprotocol among those in the `Sec-WebSocket-Protocol` fields of a client.
pub fn subprotocol<'a>(offered: impl IntoIterator<Item = &'a str>) -> Option<&'static str> {
    let offered: Vec<&str> = offered.into_iter().flat_map(|field| field.split(',')).collect();
    SUBPROTOCOLS.into_iter().find(|known| offered.iter().any(|name| name.trim() == *known))
}

/// Texts that every client gets first: the server's name and its channels, whose identifiers count from 1.
pub fn first_messages(name: &str, session: &str, offers: &[Offer]) -> [String; 2] {
    let channel = |(id, offer): (usize, &Offer)| {
        json!({
            "id": id,
            "topic": offer.topic,
            "encoding": "json",
            "schemaName": offer.schema_name,
            "schema": offer.schema.to_string(),
            "schemaEncoding": "jsonschema",
        })
    };
    let channels: Vec<Value> = (1..).zip(offers).map(channel).collect();
    let info =
        json!({ "op": "serverInfo", "name": name, "capabilities": [], "sessionId": session });
    [info, json!({ "op": "advertise", "channels": channels })].map(|text| text.to_string())
}

/// Message from the server to a client.
#[derive(Clone, Debug, PartialEq)]
pub enum Message {
    /// JSON.
    Text(String),
    /// Opcode and data.
    Binary(Vec<u8>),
}

/// Requests of clients that need no capability.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Request {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

/// Subscriptions of a client and its pending messages.
pub struct Session {
    channels: usize,
    subscriptions: BTreeMap<usize, u32>,
    texts: VecDeque<String>,
    data: VecDeque<Vec<u8>>,
    data_bytes: usize,
}

impl Session {
    /// Creates a session with `channels` channels, which begins with the greeting of the server.
    pub fn new(channels: usize, greeting: [String; 2]) -> Self {
        let (subscriptions, data) = (BTreeMap::new(), VecDeque::new());
        Self { channels, subscriptions, texts: greeting.into(), data, data_bytes: 0 }
    }

    /// Processes a text from the client.
    pub fn on_text(&mut self, text: &str) {
        match serde_json::from_str(text) {
            Ok(Request::Subscribe { subscriptions }) => {
                for Subscription { id, channel_id } in subscriptions {
                    let is_taken = self.subscriptions.values().any(|taken| *taken == id);
                    let why = if !(1..=self.channels).contains(&channel_id) {
                        format!("there is no channel {channel_id}")
                    } else if is_taken || self.is_subscribed(channel_id) {
                        format!("subscription {id} or one to channel {channel_id} exists already")
                    } else {
                        self.subscriptions.insert(channel_id, id);
                        continue;
                    };
                    self.refuse(&why);
                }
            }
            Ok(Request::Unsubscribe { subscription_ids }) => {
                self.subscriptions.retain(|_, id| !subscription_ids.contains(id));
            }
            Err(error) => self.refuse(&format!("clients can only subscribe: {error}")),
        }
    }

    /// Answers with a status of level 2, an error.
    fn refuse(&mut self, why: &str) {
        if self.texts.len() < TEXTS_MAX {
            let status = json!({ "op": "status", "level": 2, "message": why });
            self.texts.push_back(status.to_string());
        }
    }

    /// True if the client has subscribed to a channel.
    pub fn is_subscribed(&self, channel: usize) -> bool {
        self.subscriptions.contains_key(&channel)
    }

    /// Queues data of a channel if the client has subscribed to it.
    pub fn publish(&mut self, channel: usize, log_time_ns: u64, payload: &[u8]) {
        let Some(id) = self.subscriptions.get(&channel) else { return };
        let head = [&[MESSAGE_DATA][..], &id.to_le_bytes(), &log_time_ns.to_le_bytes()].concat();
        let message = [&head, payload].concat();
        self.data_bytes += message.len();
        self.data.push_back(message);
        while self.data_bytes > DATA_MAX
            && let Some(oldest) = self.data.pop_front()
        {
            self.data_bytes -= oldest.len();
        }
    }

    /// Removes and returns the next message of the queue, texts before data.
    pub fn next(&mut self) -> Option<Message> {
        if let Some(text) = self.texts.pop_front() {
            return Some(Message::Text(text));
        }
        let data = self.data.pop_front()?;
        self.data_bytes -= data.len();
        Some(Message::Binary(data))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn session() -> Session {
        let offer = |topic| Offer { topic, schema_name: "foxglove.Any", schema: json!({ "a": 1 }) };
        let greeting = first_messages("dog", "17", &[offer("/tf"), offer("/robot")]);
        Session::new(2, greeting)
    }

    /// Texts that wait, as JSON.
    fn texts(session: &mut Session) -> Vec<Value> {
        let next = || match session.next()? {
            Message::Text(text) => Some(serde_json::from_str(&text).unwrap()),
            Message::Binary(data) => panic!("{data:?}"),
        };
        std::iter::from_fn(next).collect()
    }

    #[test]
    fn clients_are_greeted_with_the_server_and_its_channels() {
        let [info, advertise] = texts(&mut session()).try_into().unwrap();
        let expected =
            json!({ "op": "serverInfo", "name": "dog", "capabilities": [], "sessionId": "17" });
        assert_eq!(info, expected);
        assert_eq!(advertise["op"], "advertise");
        let second = json!({
            "id": 2,
            "topic": "/robot",
            "encoding": "json",
            "schemaName": "foxglove.Any",
            "schema": "{\"a\":1}",
            "schemaEncoding": "jsonschema",
        });
        assert_eq!(advertise["channels"][1], second);
    }

    #[test]
    fn data_goes_to_subscribers_with_their_own_numbers() {
        let mut session = session();
        texts(&mut session);
        session.publish(1, 1, b"nobody");
        session.on_text(r#"{"op":"subscribe","subscriptions":[{"id":258,"channelId":1}]}"#);
        assert!(session.is_subscribed(1) && !session.is_subscribed(2));
        session.publish(2, 2, b"not this one");
        session.publish(1, 772, b"{}");
        let data = [1, 2, 1, 0, 0, 4, 3, 0, 0, 0, 0, 0, 0, b'{', b'}'];
        assert_eq!(session.next(), Some(Message::Binary(data.to_vec())));
        session.on_text(r#"{"op":"unsubscribe","subscriptionIds":[258]}"#);
        session.publish(1, 3, b"{}");
        assert_eq!(session.next(), None);
    }

    #[test]
    fn requests_that_cannot_be_met_are_refused_and_change_nothing() {
        let mut session = session();
        texts(&mut session);
        let subscribe = |id: u32, channel: u32| {
            json!({ "op": "subscribe", "subscriptions": [{ "id": id, "channelId": channel }] })
                .to_string()
        };
        session.on_text(&subscribe(7, 1));
        assert_eq!(texts(&mut session), [json!(null); 0]);
        let publish = json!({ "op": "advertise", "channels": [] }).to_string();
        let bad = [subscribe(8, 0), subscribe(8, 3), subscribe(7, 2), subscribe(8, 1), publish];
        for bad in bad.iter().map(String::as_str).chain(["", "{", "[]", r#"{"op":1}"#]) {
            session.on_text(bad);
            let answers = texts(&mut session);
            assert_eq!((answers.len(), &answers[0]["level"]), (1, &json!(2)), "{bad}");
        }
        assert_eq!(session.subscriptions, BTreeMap::from([(1, 7)]));
    }

    #[test]
    fn queues_of_a_client_that_reads_nothing_are_bounded() {
        let mut session = session();
        for _ in 0..1000 {
            session.on_text("nonsense");
        }
        assert_eq!(texts(&mut session).len(), TEXTS_MAX);
        session.on_text(r#"{"op":"subscribe","subscriptions":[{"id":0,"channelId":2}]}"#);
        for time_ns in 0..100 {
            session.publish(2, time_ns, &[b'x'; DATA_MAX / 10]);
        }
        assert!(session.data_bytes <= DATA_MAX);
        let times = session.data.iter().map(|data| data[5]);
        assert_eq!(times.collect::<Vec<_>>(), (91..100).collect::<Vec<_>>(), "the newest");
        session.publish(2, 100, &[b'x'; DATA_MAX]);
        assert_eq!((session.next(), session.data_bytes), (None, 0));
    }

    #[test]
    fn the_preferred_subprotocol_of_a_client_is_selected() {
        let [new, old] = SUBPROTOCOLS;
        assert_eq!(subprotocol([old]), Some(old));
        assert_eq!(subprotocol([old, new]), Some(new));
        assert_eq!(subprotocol(["foxglove.sdk.v1.1, foxglove.sdk.v1"]), Some(new));
        assert_eq!(subprotocol(["foxglove.sdk.v1.1", "chat"]), None);
        assert_eq!(subprotocol([]), None);
    }
}
