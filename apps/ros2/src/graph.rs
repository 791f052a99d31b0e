//! Topics and services of the node in the ROS graph. No call blocks, because the calling thread also sends heartbeats to the
//! robot; slow subscribers lose messages.

use crate::commanded::Velocity;
use crate::environment::Environment;
use crate::messages::{
    DiagnosticArray, JointState, TriggerRequest, TriggerResponse, Twist, TwistStamped,
};
use crate::names::Names;
use miette::{IntoDiagnostic, WrapErr};
use rollwalk_terminal::output;
use ros2_client::builtin_interfaces::Time;
use ros2_client::dds::rustdds::DomainParticipantBuilder;
use ros2_client::error::{ReadError, ReadResult, WriteError};
use ros2_client::log::LogLevel;
use ros2_client::qos::{Durability, History, WhenFull};
use ros2_client::request_id::RmwRequestId;
use ros2_client::{
    Context, MessageTypeName, Node, NodeOptions, Publisher, QosProfile, Server, ServiceTypeName,
    Subscription, rosout,
};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fmt;
use std::net::Ipv4Addr;
use thiserror::Error;

/// Queue length of topics and services, messages.
const DEPTH: usize = 10;

/// Service without arguments: an operator command, with its name in `rollwalk`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Service {
    /// Turn torque on and move to SAFE.
    Arm,
    /// Follow commanded velocities.
    Drive,
    /// Return to SAFE and turn torque off.
    Disarm,
    Return,
    /// Hold the current pose of the motion.
    Pause,
    Resume,
    /// Turn torque off at once.
    Estop,
    /// Clear an emergency stop or a latched fault.
    Clear,
}

impl Service {
    /// Services in the order in which simultaneous calls are handled, because their order of arrival is unknown. Calls that
    /// stop the robot are last, so that no other call overrides them.
    const ALL: [Self; 8] = [
        Self::Clear,
        Self::Arm,
        Self::Drive,
        Self::Resume,
        Self::Pause,
        Self::Return,
        Self::Disarm,
        Self::Estop,
    ];
}

impl fmt::Display for Service {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Arm => "arm",
            Self::Drive => "drive",
            Self::Disarm => "disarm",
            Self::Return => "return",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Estop => "estop",
            Self::Clear => "clear",
        })
    }
}

/// Service call that must be answered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Call {
    pub service: Service,
    id: RmwRequestId,
}

/// Failure of DDS in this process.
#[derive(Clone, Debug, Error)]
#[error("the node can no longer reach ROS: {0}")]
pub struct DdsFailure(String);

/// Topic whose most recent value is sent to new subscribers.
struct Latched {
    publisher: Publisher<String>,
    published: Option<String>,
}

impl Latched {
    fn set(&mut self, value: &str) -> Result<(), DdsFailure> {
        if self.published.as_deref() != Some(value) && publish(&self.publisher, value.to_owned())? {
            self.published = Some(value.to_owned());
        }
        Ok(())
    }
}

/// Velocity topic, with one of its two types.
enum Velocities {
    Plain(Subscription<Twist>),
    Stamped(Subscription<TwistStamped>),
}

/// Name of the velocity topic.
const VELOCITIES: &str = "cmd_vel";

pub struct Graph {
    node: Node,
    joint_states: Publisher<JointState>,
    diagnostics: Publisher<DiagnosticArray>,
    robot_description: Latched,
    state: Latched,
    motion: Latched,
    motions: Latched,
    play: Subscription<String>,
    velocities: Option<Velocities>,
    /// Type and topic of the velocity commands.
    followed: Option<String>,
    services: Vec<(Service, Server<TriggerRequest, TriggerResponse>)>,
}

impl Graph {
    /// Joins the ROS graph. If `steers` is false, the velocity topic is not created.
    ///
    /// # Errors
    /// Returns an error if DDS finds no socket, or if a name is not allowed.
    pub fn join(environment: &Environment, names: &Names, steers: bool) -> miette::Result<Self> {
        let mut participant = DomainParticipantBuilder::new(environment.domain);
        if environment.loopback {
            participant = participant.with_only_networks([Ipv4Addr::LOCALHOST]);
        }
        let domain = environment.domain;
        let failed = || format!("cannot create a node in ROS domain {domain}");
        let participant = participant.build().into_diagnostic().wrap_err_with(failed)?;
        let context = Context::from_domain_participant(participant);
        let context = context.into_diagnostic().wrap_err_with(failed)?;
        let options = NodeOptions::new().enable_rosout(true);
        let node = context.new_node(names.node.clone(), options).into_diagnostic();
        let mut making = NodeBuilder { node: node.wrap_err_with(failed)?, names };
        let joint_states =
            making.publisher("joint_states", ("sensor_msgs", "JointState"), &streamed())?;
        let array = ("diagnostic_msgs", "DiagnosticArray");
        let diagnostics = making.publisher("/diagnostics", array, &streamed())?;
        let robot_description = making.latched("robot_description")?;
        let state = making.latched("~/state")?;
        let motion = making.latched("~/motion")?;
        let motions = making.latched("~/motions")?;
        let play = making.subscription("~/play", ("std_msgs", "String"))?;
        let (velocities, kind) = match names.parameters.use_stamped_vel {
            _ if !steers => (None, ""),
            false => (Some(Velocities::Plain(making.velocities("Twist")?)), "Twist"),
            true => (Some(Velocities::Stamped(making.velocities("TwistStamped")?)), "TwistStamped"),
        };
        let name = names.resolve(VELOCITIES)?;
        let followed = velocities.as_ref().map(|_| format!("geometry_msgs/msg/{kind} on {name}"));
        let services = Service::ALL.map(|service| making.server(service, environment));
        let services = services.into_iter().collect::<miette::Result<_>>()?;
        Ok(Self {
            node: making.node,
            joint_states,
            diagnostics,
            robot_description,
            state,
            motion,
            motions,
            play,
            velocities,
            followed,
            services,
        })
    }

    /// Fully qualified name of the node.
    pub fn name(&self) -> String {
        self.node.fully_qualified_name()
    }

    /// Publishes joint states.
    ///
    /// # Errors
    /// Returns an error if DDS has stopped working.
    pub fn joint_states(&self, message: JointState) -> Result<(), DdsFailure> {
        publish(&self.joint_states, message).map(drop)
    }

    /// Publishes diagnostics.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn diagnostics(&self, message: DiagnosticArray) -> Result<(), DdsFailure> {
        publish(&self.diagnostics, message).map(drop)
    }

    /// Publishes the URDF if it has changed.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn robot_description(&mut self, urdf: &str) -> Result<(), DdsFailure> {
        self.robot_description.set(urdf)
    }

    /// Publishes the changes of the state, of the playing motion, and of the playable motions.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn robot(&mut self, state: &str, motion: &str, motions: &str) -> Result<(), DdsFailure> {
        self.state.set(state)?;
        self.motion.set(motion)?;
        self.motions.set(motions)
    }

    /// Publishes a line on `/rosout`.
    pub fn log(&self, level: LogLevel, text: &str) {
        rosout!(self.node, level, "{text}");
    }

    /// Returns the newest motion that was requested since the previous call. Messages beyond [`DEPTH`] wait for the next call,
    /// so that heartbeats are not delayed.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn play(&self) -> Result<Option<String>, DdsFailure> {
        self.newest(&self.play, "~/play")
    }

    /// Returns the newest velocity that was commanded since the previous call.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn velocity(&self) -> Result<Option<Velocity>, DdsFailure> {
        Ok(match &self.velocities {
            None => None,
            Some(Velocities::Plain(topic)) => {
                let twist = self.newest(topic, VELOCITIES)?;
                twist.map(|twist| Velocity { twist, age_ns: 0 })
            }
            Some(Velocities::Stamped(topic)) => {
                let stamped = self.newest(topic, VELOCITIES)?;
                stamped.map(|TwistStamped { header, twist }| {
                    // Programs without a clock send a time of zero.
                    let stamp = Some(header.stamp).filter(|stamp| *stamp != Time::ZERO);
                    let age = |stamp: Time| Time::now().to_nanos().saturating_sub(stamp.to_nanos());
                    Velocity { twist, age_ns: stamp.map_or(0, age) }
                })
            }
        })
    }

    /// Type and topic of the velocity commands; `None` if the node does not follow velocities.
    pub fn followed(&self) -> Option<&str> {
        self.followed.as_deref()
    }

    /// Returns the newest message of a topic since the previous call.
    fn newest<M: DeserializeOwned + 'static>(
        &self,
        topic: &Subscription<M>,
        name: &str,
    ) -> Result<Option<M>, DdsFailure> {
        let mut newest = None;
        for _ in 0..DEPTH {
            let Some((message, _)) = self.read(topic.take(), name)? else { break };
            newest = Some(message);
        }
        Ok(newest)
    }

    /// Returns the service calls since the previous call; those that stop the robot are last.
    ///
    /// # Errors
    /// Returns the error of [`joint_states`](Self::joint_states).
    pub fn calls(&self) -> Result<Vec<Call>, DdsFailure> {
        let mut calls = Vec::new();
        for (service, server) in &self.services {
            let name = format!("~/{service}");
            for _ in 0..DEPTH {
                let Some((id, _)) = self.read(server.receive_request(), &name)? else { break };
                calls.push(Call { service: *service, id });
            }
        }
        Ok(calls)
    }

    /// Returns the message that was read, or `None` if none has arrived. A malformed message is logged and dropped; any other
    /// error means that DDS has stopped working.
    fn read<T>(&self, outcome: ReadResult<Option<T>>, of: &str) -> Result<Option<T>, DdsFailure> {
        match outcome {
            Ok(value) => Ok(value),
            Err(ReadError::Deserialization { .. } | ReadError::Malformed) => {
                let text = format!(
                    "ignored a malformed message on {of}: run its sender with the \
                     RMW_IMPLEMENTATION of this node"
                );
                self.log(LogLevel::Warn, &text);
                output::print_line(text);
                Ok(None)
            }
            Err(error) => Err(DdsFailure(error.to_string())),
        }
    }

    pub fn answer(&self, call: &Call, success: bool, message: &str) {
        let server = self.services.iter().find(|(service, _)| *service == call.service);
        let answer = TriggerResponse { success, message: message.to_owned() };
        // A caller may disappear before it reads the answer.
        server.map(|(_, server)| server.send_response(call.id, answer));
    }
}

/// Node whose topics and services are being created.
struct NodeBuilder<'a> {
    node: Node,
    names: &'a Names,
}

impl NodeBuilder<'_> {
    fn publisher<M: Serialize>(
        &mut self,
        name: &str,
        (package, kind): (&str, &str),
        qos: &QosProfile,
    ) -> miette::Result<Publisher<M>> {
        let resolved = self.names.resolve(name)?;
        let kind = MessageTypeName::new(package, kind);
        let topic = self.node.create_topic(&resolved, kind, qos).into_diagnostic();
        let publisher = topic.and_then(|topic| {
            self.node.create_publisher(&topic, Some(qos.clone())).into_diagnostic()
        });
        publisher.wrap_err_with(|| format!("cannot create topic {resolved}"))
    }

    fn latched(&mut self, name: &str) -> miette::Result<Latched> {
        let qos = reliable(1).durability(Durability::TransientLocal);
        let publisher = self.publisher(name, ("std_msgs", "String"), &qos)?;
        Ok(Latched { publisher, published: None })
    }

    fn velocities<M: DeserializeOwned + 'static>(
        &mut self,
        kind: &str,
    ) -> miette::Result<Subscription<M>> {
        self.subscription(VELOCITIES, ("geometry_msgs", kind))
    }

    fn subscription<M: DeserializeOwned + 'static>(
        &mut self,
        name: &str,
        (package, kind): (&str, &str),
    ) -> miette::Result<Subscription<M>> {
        let resolved = self.names.resolve(name)?;
        let kind = MessageTypeName::new(package, kind);
        let topic = self.node.create_topic(&resolved, kind, &streamed()).into_diagnostic();
        let subscription = topic.and_then(|topic| {
            self.node.create_subscription(&topic, Some(streamed())).into_diagnostic()
        });
        subscription.wrap_err_with(|| format!("cannot create topic {resolved}"))
    }

    fn server(
        &mut self,
        service: Service,
        environment: &Environment,
    ) -> miette::Result<(Service, Server<TriggerRequest, TriggerResponse>)> {
        let name = self.names.resolve(&format!("~/{service}"))?;
        let kind = ServiceTypeName::new("std_srvs", "Trigger");
        let mapping = environment.mapping;
        let server = self.node.create_server(mapping, &name, &kind, streamed(), streamed());
        Ok((
            service,
            server.into_diagnostic().wrap_err_with(|| format!("cannot create service {name}"))?,
        ))
    }
}

/// Reliable quality of service, because subscribers that require it cannot connect otherwise.
fn reliable(depth: usize) -> QosProfile {
    QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .history(History::KeepLast { depth })
}

fn streamed() -> QosProfile {
    reliable(DEPTH)
}

/// Publishes a message. Returns false if the queue is full.
fn publish<M: Serialize>(publisher: &Publisher<M>, message: M) -> Result<bool, DdsFailure> {
    match publisher.publish(message) {
        Ok(()) => Ok(true),
        Err(WriteError::WouldBlock { .. }) => Ok(false),
        Err(error) => Err(DdsFailure(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ros2_client::{Name, ServiceMapping};
    use std::thread;
    use std::time::{Duration, Instant};

    /// Tests the mapping of Fast DDS, the default of ROS; `tests/ros2/` tests the mapping of Cyclone DDS.
    #[test]
    fn a_call_is_answered_with_the_number_of_its_request() {
        // Linux assigns ports of higher domains to other programs.
        let domain = 1 + (std::process::id() % 100) as u16;
        let mapping = ServiceMapping::Enhanced;
        let environment = Environment { domain, loopback: true, mapping };
        let (names, _) = Names::split([]).unwrap();
        let graph = Graph::join(&environment, &names, false).unwrap();
        let participant =
            DomainParticipantBuilder::new(domain).with_only_networks([Ipv4Addr::LOCALHOST]).build();
        let context = Context::from_domain_participant(participant.unwrap()).unwrap();
        let name = ros2_client::NodeName::new("/", "caller").unwrap();
        let mut caller = context.new_node(name, NodeOptions::new()).unwrap();
        let (service, kind) =
            (Name::new("/rollwalk", "arm").unwrap(), ServiceTypeName::new("std_srvs", "Trigger"));
        let client = caller
            .create_client::<TriggerRequest, TriggerResponse>(
                mapping,
                &service,
                &kind,
                streamed(),
                streamed(),
            )
            .unwrap();
        let end = Instant::now() + Duration::from_secs(30);
        let mut sent = Vec::new();
        let (id, answer) = loop {
            assert!(Instant::now() < end, "no answer to {sent:?}");
            // Requests are lost until client and server have discovered each other.
            sent.push(client.send_request(TriggerRequest::default()).unwrap());
            thread::sleep(Duration::from_millis(100));
            for call in graph.calls().unwrap() {
                assert_eq!(call.service, Service::Arm);
                graph.answer(&call, true, "armed");
            }
            thread::sleep(Duration::from_millis(100));
            if let Some(answer) = client.receive_response().unwrap() {
                break answer;
            }
        };
        assert!(sent.contains(&id), "{id:?} of {sent:?}");
        assert_eq!(answer, TriggerResponse { success: true, message: "armed".into() });
    }
}
