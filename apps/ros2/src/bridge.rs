//! Loop of the node, in one thread with the bus: receives frames of the robot and messages of ROS, and sends frames and
//! messages.
//!
//! The node is the robot's host, like a console. It sends heartbeats while the loop runs. If the loop stalls, or ends in any
//! other way than by [`leaving`](Bridge::run), the robot returns to SAFE by itself and turns torque off. The operator
//! (`rollwalk_host::operator`) decides which requests are permitted; the node passes requests to it and answers with its
//! messages.

use crate::convert::{self, DiagnosticInputs};
use crate::driving::NodePilot;
use crate::graph::{Call, DdsFailure, Graph, Service};
use rollwalk_bus::port::LiveLink;
use rollwalk_host::catalog::Catalog;
use rollwalk_host::describe::state_name;
use rollwalk_host::operator::{ExitStage, Intent, Operator, View, Weight};
use rollwalk_pilot::{ActionAfterStop, END_US, Phase};
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::text::Printable;
use rollwalk_protocol::wire::{FromController, JointTelemetry, State};
use rollwalk_terminal::link::LinkArgs;
use rollwalk_terminal::link::names::NamesArgs;
use rollwalk_terminal::link::operated_bus::{OperatedBus, report_exit};
use rollwalk_terminal::{Exit, interrupt, output};
use ros2_client::builtin_interfaces::Time;
use ros2_client::log::LogLevel;
use std::collections::BTreeMap;

/// Interval between publications of the robot's state, µs.
const LOOK_US: u64 = 20_000;
/// Interval between diagnostics, µs.
const DIAGNOSE_US: u64 = 1_000_000;
/// Maximum length of an untrusted name that a message repeats, characters.
const NAME_CHARS: usize = 64;
/// Time after which a call of the emergency stop is answered with a failure if the robot has not acknowledged it, µs.
const STOPPED_US: u64 = 1_000_000;

/// Call that waits for the robot's answer.
struct PendingCall {
    call: Call,
    outcome: AnsweringEvent,
    since_us: u64,
}

/// Event that answers a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AnsweringEvent {
    /// Message about the intent with the given number.
    Message(u64),
    /// Acknowledgement of an emergency stop.
    Stopped,
    /// Start of following velocities.
    Driven,
    /// Call that is answered when a driven robot has stopped and reached the given state.
    Home(State),
}

/// Node with its robot.
pub struct Bridge<'a> {
    operated: OperatedBus<'a>,
    link: &'a LinkArgs,
    /// Reason why ROS can no longer be reached.
    lost: Option<DdsFailure>,
    graph: Graph,
    bus: String,
    names: &'a NamesArgs,
    /// Configuration and library for which names were looked up.
    named: Option<(u32, Option<u32>)>,
    catalog: Option<Catalog>,
    /// Names of the joints in the URDF, by channel.
    joints: Vec<String>,
    /// Most recent telemetry of each channel since joints were published.
    round: BTreeMap<u8, JointTelemetry>,
    urdf: Option<String>,
    driving: Option<NodePilot>,
    waiting: Vec<PendingCall>,
    /// Number of the most recent operator message that was published.
    said: u64,
    look_us: u64,
    diagnose_us: u64,
}

impl<'a> Bridge<'a> {
    /// Creates a node for the robot on an open bus; with `driving` the robot can follow velocities.
    pub fn new(
        link: &'a LinkArgs,
        names: &'a NamesArgs,
        bus: LiveLink,
        operator: Operator,
        graph: Graph,
        driving: Option<NodePilot>,
    ) -> Self {
        Self {
            operated: OperatedBus::new(link, bus, operator),
            link,
            lost: None,
            graph,
            bus: link.bus.to_string(),
            names,
            named: None,
            catalog: None,
            joints: Vec::new(),
            round: BTreeMap::new(),
            urdf: None,
            driving,
            waiting: Vec::new(),
            said: 0,
            look_us: 0,
            diagnose_us: 0,
        }
    }

    /// Serves until a signal requests the end, or ROS is lost. On return the robot is in SAFE and disarmed, or there is no
    /// contact with it.
    pub fn run(&mut self) -> Exit {
        loop {
            let heard = self.operated.received_frames();
            if self.lost.is_none()
                && let Err(error) = self.serve(&heard)
            {
                self.lose(error);
            }
            self.leave_if(interrupt::requested() || self.lost.is_some());
            if let Some(driving) = &mut self.driving {
                driving.turn(self.operated.now_us(), &mut self.operated.operator);
            }
            self.operated.send();
            let leaves = self.operated.operator.leaving() == ExitStage::Now;
            if leaves || self.operated.now_us() >= self.look_us {
                self.publish_news();
            }
            if leaves {
                let exit = report_exit(&self.view());
                return if self.lost.is_some() { Exit::NotDone } else { exit };
            }
            self.operated.receive();
        }
    }

    /// Exchanges messages and calls with ROS.
    fn serve(&mut self, heard: &[Frame]) -> Result<(), DdsFailure> {
        if let Err(report) = self.load_names() {
            // The file has changed since the start. The robot may be moving, so the node continues without names.
            let now_us = self.operated.now_us();
            let text = format!("the names of motions and joints cannot be read: {report}");
            self.operated.operator.notify(now_us, Weight::Warning, text);
        }
        // `on_play` comes before the calls, because a call may stop the robot.
        if let Some(name) = self.graph.play()? {
            self.on_play(&name);
        }
        if let (Some(velocity), Some(driving)) = (self.graph.velocity()?, &mut self.driving) {
            driving.command(self.operated.now_us(), velocity, &mut self.operated.operator);
        }
        for call in self.graph.calls()? {
            self.on_call(call);
        }
        heard.iter().try_for_each(|frame| self.on_frame(frame))
    }

    /// Collects joint telemetry, and publishes it when every joint has reported since the previous publication.
    fn on_frame(&mut self, frame: &Frame) -> Result<(), DdsFailure> {
        let Ok((node, FromController::JointTelemetry(joint))) = FromController::decode(frame)
        else {
            return Ok(());
        };
        if node == self.link.node && usize::from(joint.channel) < self.joints.len() {
            self.round.insert(joint.channel, joint);
            if self.round.len() == self.joints.len() {
                let round = std::mem::take(&mut self.round);
                let joints = self.joints.iter().zip(round.values());
                self.graph.joint_states(convert::joint_state(Time::now(), joints))?;
            }
        }
        Ok(())
    }

    /// Prints new messages of the operator, and publishes the robot's state while DDS works.
    fn publish_news(&mut self) {
        self.operated.diagnose();
        let view = self.view();
        self.look_us = view.now_us + LOOK_US;
        self.pass_on_messages(&view);
        if !view.link.contact {
            // Old measurements together with measurements after a loss would be a state that never existed.
            self.round.clear();
        }
        if self.lost.is_none()
            && let Err(error) = self.publish(&view)
        {
            self.lose(error);
        }
    }

    fn lose(&mut self, error: DdsFailure) {
        output::print_line(&error);
        self.lost = Some(error);
    }

    /// Publishes the changes of the robot's state.
    fn publish(&mut self, view: &View) -> Result<(), DdsFailure> {
        let motion = convert::motion(view, self.catalog.as_ref());
        let motions = convert::motions(self.library());
        self.graph.robot(&convert::state(view), &motion, &motions)?;
        if let Some(urdf) = &self.urdf {
            self.graph.robot_description(urdf)?;
        }
        if view.now_us >= self.diagnose_us {
            self.diagnose_us = view.now_us + DIAGNOSE_US;
            let (node, bus, catalog) = (self.graph.name(), &*self.bus, self.catalog.as_ref());
            let node = node.trim_start_matches('/');
            let of = DiagnosticInputs { view, bus, node, catalog };
            self.graph.diagnostics(convert::diagnostics(Time::now(), &of))?;
        }
        Ok(())
    }

    /// Publishes messages of the operator, and answers the calls that they are about.
    fn pass_on_messages(&mut self, view: &View) {
        let said = self.said;
        for message in view.messages.iter().filter(|message| message.number > said) {
            self.said = message.number;
            let level = match message.weight {
                Weight::Note => LogLevel::Info,
                Weight::Refused | Weight::Warning => LogLevel::Warn,
            };
            output::print_line(&message.text);
            if self.lost.is_some() {
                continue;
            }
            self.graph.log(level, &message.text);
            let is_answered = |waiting: &mut PendingCall| match waiting.outcome {
                AnsweringEvent::Message(intent_number) => message.answers == Some(intent_number),
                _ => false,
            };
            for PendingCall { call, .. } in self.waiting.extract_if(.., is_answered) {
                self.graph.answer(&call, message.weight == Weight::Note, &message.text);
            }
        }
        if self.lost.is_none() {
            self.answer_others(view);
        }
    }

    /// Answers waiting calls that no message of the operator has answered.
    fn answer_others(&mut self, view: &View) {
        let (graph, operator) = (&self.graph, &self.operated.operator);
        let phase = self.driving.as_ref().map_or(Phase::Off, NodePilot::phase);
        self.waiting.retain(|PendingCall { call, outcome, since_us }| {
            let waited_us = view.now_us.saturating_sub(*since_us);
            let (success, text) = match outcome {
                AnsweringEvent::Message(intent_number) if operator.is_asking(*intent_number) => {
                    return true;
                }
                AnsweringEvent::Message(_) => {
                    (false, "the command was dropped; see /rosout for the reason".into())
                }
                AnsweringEvent::Stopped if !view.stopping => {
                    (true, "stopped: torque is off".into())
                }
                AnsweringEvent::Stopped if waited_us > STOPPED_US => {
                    let text = "the robot has not acknowledged the emergency stop; the stop is \
                        repeated until it is acknowledged";
                    (false, text.into())
                }
                AnsweringEvent::Stopped => return true,
                AnsweringEvent::Driven => match phase {
                    Phase::Beginning => return true,
                    Phase::Steered => (
                        true,
                        format!("the robot follows {}", graph.followed().unwrap_or_default()),
                    ),
                    _ => (
                        false,
                        "the robot does not follow velocities; see /rosout for the reason".into(),
                    ),
                },
                AnsweringEvent::Home(state) => {
                    let reached = view.status.map(|status| status.state);
                    let barred = view.status.is_some_and(|status| match status.state {
                        State::EStopped => true,
                        // Without a fault, these states lead to Disarmed.
                        State::Damped | State::TorqueOff => !status.faults.is_empty(),
                        _ => false,
                    });
                    let is_there = phase == Phase::Off && reached == Some(*state);
                    if !is_there && !barred && waited_us <= END_US {
                        return true;
                    }
                    let words = reached.map_or("not in contact", state_name);
                    (is_there, format!("the robot is {words}"))
                }
            };
            graph.answer(call, success, &text);
            false
        });
    }

    fn on_call(&mut self, call: Call) {
        let now_us = self.operated.now_us();
        let status = self.view().status;
        let intent = match call.service {
            Service::Arm => Intent::Arm,
            Service::Drive => return self.on_drive(call),
            Service::Disarm if self.is_driven() => {
                return self.stop_driving(call, ActionAfterStop::Disarm, State::Disarmed);
            }
            Service::Return | Service::Pause if self.is_driven() => {
                return self.stop_driving(call, ActionAfterStop::Rest, State::Ready);
            }
            Service::Disarm => Intent::Disarm,
            Service::Return => Intent::Return,
            Service::Pause => Intent::Pause,
            Service::Resume if status.is_none_or(|status| status.state != State::Paused) => {
                return self.graph.answer(&call, false, "no motion is paused");
            }
            Service::Resume => Intent::PauseOrResume,
            Service::Estop => Intent::Estop,
            Service::Clear => Intent::Clear,
        };
        let operator = &mut self.operated.operator;
        operator.request(now_us, intent);
        let outcome = match intent {
            Intent::Estop => AnsweringEvent::Stopped,
            _ => AnsweringEvent::Message(operator.latest_intent()),
        };
        self.waiting.push(PendingCall { call, outcome, since_us: now_us });
    }

    /// True if the robot follows velocities, or is about to start or stop doing so.
    fn is_driven(&self) -> bool {
        self.driving.as_ref().is_some_and(|driving| driving.phase() != Phase::Off)
    }

    fn on_drive(&mut self, call: Call) {
        let now_us = self.operated.now_us();
        let begun = match &mut self.driving {
            Some(driving) => driving.begin(now_us, &self.operated.operator),
            None => {
                Err("start the node with --library LIB.rwl, because driving begins at the SAFE \
                pose of the library"
                    .into())
            }
        };
        match begun {
            Ok(()) => self.waiting.push(PendingCall {
                call,
                outcome: AnsweringEvent::Driven,
                since_us: now_us,
            }),
            Err(why) => self.graph.answer(
                &call,
                false,
                &format!("the robot does not follow velocities: {why}"),
            ),
        }
    }

    /// Stops a driven robot with all feet on the ground, then sends it to SAFE; stopping within a step would make it fall.
    fn stop_driving(&mut self, call: Call, after: ActionAfterStop, state: State) {
        let now_us = self.operated.now_us();
        if let Some(driving) = &mut self.driving {
            driving.stop(now_us, after, &mut self.operated.operator);
        }
        self.waiting.push(PendingCall {
            call,
            outcome: AnsweringEvent::Home(state),
            since_us: now_us,
        });
    }

    /// Motion names of the controller's library; `None` if the node has no names, or those of another library.
    fn library(&self) -> Option<&Catalog> {
        let library = self.operated.operator.hello()?.library?;
        self.catalog.as_ref().filter(|catalog| catalog.library == library)
    }

    /// Plays a motion by its name in the library, or by its code.
    fn on_play(&mut self, name: &str) {
        let now_us = self.operated.now_us();
        if self.is_driven() {
            let text = "motion not played, because the robot is driven: end driving with ~/return";
            return self.operated.operator.notify(now_us, Weight::Refused, text);
        }
        let by_name = self.library().and_then(|catalog| catalog.motion(name));
        let code = by_name.and_then(|motion| motion.code).or_else(|| name.parse().ok());
        if let Some(code) = code {
            return self.operated.operator.request(now_us, Intent::Play { code });
        }
        let cut: String = name.chars().take(NAME_CHARS).collect();
        let name = Printable(&cut);
        let text = match self.library() {
            Some(catalog) if !catalog.motions.is_empty() => format!(
                "not sent: the library has no motion `{name}`; give one of {}",
                convert::motions(Some(catalog)).replace('\n', ", ")
            ),
            _ if self.operated.operator.hello().is_none() => {
                format!("`{name}` not played: the controller has not reported its library yet")
            }
            _ => format!(
                "`{name}` not played: the motion names of the controller's library are unknown on \
                 this computer; start the node with --library LIB.rwl, or publish the code of the \
                 motion"
            ),
        };
        self.operated.operator.notify(now_us, Weight::Refused, text);
    }

    /// Returns the robot to SAFE and then ends the node, if `wanted`. A driven robot stops first. Without contact to the robot,
    /// the node ends at once.
    fn leave_if(&mut self, wanted: bool) {
        let now_us = self.operated.now_us();
        let operator = &mut self.operated.operator;
        if wanted && operator.leaving() == ExitStage::No {
            let driving = self.driving.as_mut();
            if !driving.is_some_and(|driving| driving.leave(now_us, operator)) {
                operator.request(now_us, Intent::Quit);
            }
        }
        if operator.leaving() == ExitStage::WhenHome && !operator.view(now_us).link.contact {
            operator.request(now_us, Intent::Quit);
        }
    }

    /// Looks up names and the URDF when the controller has reported its robot and library.
    fn load_names(&mut self) -> miette::Result<()> {
        let Some(hello) = self.operated.operator.hello().copied() else { return Ok(()) };
        let wanted = Some((hello.config_hash, hello.library));
        if self.named == wanted {
            return Ok(());
        }
        self.named = wanted;
        // The catalog belongs to another library. Even if a look-up fails, the node must not send codes of that library to this
        // robot.
        self.catalog = None;
        self.operated.operator.set_catalog(None);
        self.joints.clear();
        self.round.clear();
        self.urdf = None;
        let now_us = self.operated.now_us();
        self.catalog = self.names.look_up(Some(&hello))?;
        self.operated.operator.set_catalog(self.catalog.clone());
        if hello.library.is_none() {
            let text = "the controller has no library: flash one with `rollwalk flash LIB.rwl`";
            self.operated.operator.notify(now_us, Weight::Warning, text);
        }
        let Some((robot, parts)) = self.names.robot(hello.config_hash)? else {
            let text = "the robot does not ship with rollwalk: to publish robot_description, give \
                --robot ROBOT.toml";
            self.operated.operator.notify(now_us, Weight::Warning, text);
            self.joints = self.catalog.as_ref().map_or_else(Vec::new, |c| c.channels.clone());
            return Ok(());
        };
        self.joints = rollwalk_interchange::joint_names(&robot);
        // The URDF is written to memory, so this cannot fail.
        self.urdf = rollwalk_interchange::urdf(&robot, &parts).ok();
        Ok(())
    }

    fn view(&self) -> View {
        self.operated.operator.view(self.operated.now_us())
    }
}
