//! Scenarios: faults with start and end, drawn from a random generator.

use fastrand::Rng;
use rollwalk_firmware::BusState;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::{Fault as Bit, FaultBits};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::faults::FaultKind::{self, Stream};
use rollwalk_sim_host::faults::stream::StreamFault;
use rollwalk_sim_host::faults::{Fault, FramePath};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::rig::Adapter;

/// Kind of disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scenario {
    /// Random frame loss only, without another disturbance.
    Loss,
    /// Repeated link frames.
    Repeats,
    /// Reordered link frames.
    Reorder,
    /// Delayed link frames.
    Delay,
    /// Link frames that are truncated, or corrupted without an effect on the CRC of CAN.
    Corruption,
    /// Babbling node on the link.
    BabbleLink,
    /// Babbling node on an actuator bus.
    BabbleActuators,
    /// Missing acknowledgements on an actuator bus.
    NoAck,
    /// Disconnected link. Host and controller keep their queued frames.
    LinkUnplugged,
    /// Bus-off state of the controller on an actuator bus.
    BusOff,
    /// Actuator that neither receives nor answers for some time.
    ActuatorDeaf,
    /// Actuator without power for some time.
    ActuatorDead,
    /// Actuator frames lost at the rate of the link.
    ActuatorLoss,
    /// Repeated, delayed and reordered actuator frames.
    ActuatorDisorder,
    /// Corrupted or truncated actuator frames.
    ActuatorCorruption,
    /// Failure and return of motor power. The interface keeps the frames that it could not send.
    PowerCut,
    /// End of the host program, and later start of another one.
    HostDead,
    /// Stall of the host program, which then continues.
    HostStall,
    /// Stall of a bridge to the controller, which then delivers all frames at once.
    BridgeStall,
    /// Emergency stop by the host.
    EStop,
    /// Library transfer during one of the disturbances of the link.
    Flash,
    /// Several of these disturbances, one after the other or at the same time, and at most one host event: end, stall or
    /// emergency stop.
    Chaos,
}

/// Event of the host program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Host {
    Stays,
    /// End of the program at the first time, and start of another one at the second.
    Dies(SimTime, SimTime),
    /// Stall from the first time to the second.
    Stalls(SimTime, SimTime),
    /// Emergency stop at a time.
    Stops(SimTime),
}

/// Disturbances of a run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Faults in addition to the frame loss of the run.
    pub faults: Vec<Fault>,
    /// CAN adapter of the controller on the actuator buses.
    pub adapter: Adapter,
    /// Event of the host.
    pub host: Host,
    /// End of all disturbances.
    pub until: SimTime,
    /// Fault bits, at least one of which must be reported if torque is on at the start.
    pub required: FaultBits,
    /// Fault bits that may be reported.
    pub allowed: FaultBits,
}

impl Scenario {
    /// Scenarios in the order of the table.
    pub const ALL: [Self; 22] = [
        Self::Loss,
        Self::Repeats,
        Self::Reorder,
        Self::Delay,
        Self::Corruption,
        Self::BabbleLink,
        Self::BabbleActuators,
        Self::NoAck,
        Self::LinkUnplugged,
        Self::BusOff,
        Self::ActuatorDeaf,
        Self::ActuatorDead,
        Self::ActuatorLoss,
        Self::ActuatorDisorder,
        Self::ActuatorCorruption,
        Self::PowerCut,
        Self::HostDead,
        Self::HostStall,
        Self::BridgeStall,
        Self::EStop,
        Self::Flash,
        Self::Chaos,
    ];

    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::Repeats => "repeats",
            Self::Reorder => "reorder",
            Self::Delay => "delay",
            Self::Corruption => "corruption",
            Self::BabbleLink => "babble-link",
            Self::BabbleActuators => "babble-actuators",
            Self::NoAck => "no-ack",
            Self::LinkUnplugged => "link-unplugged",
            Self::BusOff => "bus-off",
            Self::ActuatorDeaf => "actuator-deaf",
            Self::ActuatorDead => "actuator-dead",
            Self::ActuatorLoss => "actuator-loss",
            Self::ActuatorDisorder => "actuator-disorder",
            Self::ActuatorCorruption => "actuator-corruption",
            Self::PowerCut => "power-cut",
            Self::HostDead => "host-dead",
            Self::HostStall => "host-stall",
            Self::BridgeStall => "bridge-stall",
            Self::EStop => "estop",
            Self::Flash => "flash",
            Self::Chaos => "chaos",
        }
    }

    /// Losses of link frames at which the scenario is run, per mille.
    pub fn losses(self) -> &'static [u16] {
        match self {
            Self::EStop => &[0, 10, 30, 100, 300, 900, 1000],
            // Without loss, nothing would disturb the scenario.
            Self::ActuatorLoss => &[10, 30, 100, 300],
            _ => &[0, 10, 30, 100, 300],
        }
    }

    /// True if actuators or their frames are disturbed. The watchdog of a motor may then be the only means to switch it off.
    pub fn disturbs_actuators(self) -> bool {
        match self {
            Self::BabbleActuators
            | Self::NoAck
            | Self::BusOff
            | Self::ActuatorDeaf
            | Self::ActuatorDead
            | Self::ActuatorLoss
            | Self::ActuatorDisorder
            | Self::ActuatorCorruption
            | Self::PowerCut
            | Self::Chaos => true,
            Self::Loss
            | Self::Repeats
            | Self::Reorder
            | Self::Delay
            | Self::Corruption
            | Self::BabbleLink
            | Self::LinkUnplugged
            | Self::HostDead
            | Self::HostStall
            | Self::BridgeStall
            | Self::EStop
            | Self::Flash => false,
        }
    }

    /// Draws the disturbances, which begin at `start` or later.
    pub fn plan(
        self,
        start: SimTime,
        loss_per_mille: u16,
        config: &RobotConfig,
        random: &mut Rng,
    ) -> Plan {
        let mut plan = Plan {
            faults: Vec::new(),
            adapter: Adapter::default(),
            host: Host::Stays,
            until: start,
            required: FaultBits::default(),
            // Five heartbeats in a row must be lost: at 3 %, once in 41 million.
            allowed: bits(if loss_per_mille >= 100 { &[Bit::HostLost] } else { &[] }),
        };
        self.add_to(&mut plan, start, loss_per_mille, config, random);
        plan
    }

    fn add_to(
        self,
        plan: &mut Plan,
        start: SimTime,
        loss_per_mille: u16,
        config: &RobotConfig,
        random: &mut Rng,
    ) {
        // A long disturbance is certainly detected; a short one may not be.
        let long = random.bool();
        let lasts = if long { between(random, 600, 2500) } else { between(random, 60, 400) };
        let until = start + lasts;
        let link = [FramePath::LinkToController, FramePath::LinkToHost];
        let buses = config.channels.iter().map(|c| c.bus).max().map_or(0, |most| most + 1);
        let bus = random.u8(0..buses.max(1));
        let channel = random.usize(0..config.channels.len().max(1));
        let mut faults = Vec::new();
        let mut add = |kind, until| faults.push(Fault { kind, from: start, until });
        let mut required: &[Bit] = &[];
        let mut allowed: &[Bit] = &[];
        // Faults that may follow if an actuator is out of reach for any reason.
        const UNREACHED: &[Bit] =
            &[Bit::ActuatorSilent, Bit::ActuatorFault, Bit::BusNoAck, Bit::BusPassive];
        // Disturbances of streams with few frames take longer to hit one.
        let while_streaming = start + between(random, 1500, 4000);
        let mut ends = until;
        match self {
            Self::Loss | Self::Flash => {}
            Self::Repeats => {
                ends = while_streaming;
                let rate = random.u16(100..=600);
                let within = between(random, 0, 700);
                link.iter()
                    .for_each(|&path| add(Stream(path, StreamFault::Repeat(rate, within)), ends));
            }
            Self::Reorder => {
                ends = while_streaming;
                let window = random.u32(1..=12);
                link.iter().for_each(|&path| add(Stream(path, StreamFault::Reorder(window)), ends));
                if loss_per_mille > 0 {
                    allowed = &[Bit::HostLost];
                }
            }
            Self::Delay => {
                ends = while_streaming;
                let most = between(random, 5, 150);
                let least = if random.bool() { most } else { SimTime::ZERO };
                link.iter()
                    .for_each(|&path| add(Stream(path, StreamFault::Delay(least, most)), ends));
                if loss_per_mille > 0 {
                    allowed = &[Bit::HostLost];
                }
            }
            Self::Corruption => {
                ends = while_streaming;
                for path in link {
                    add(Stream(path, StreamFault::Damage(random.u16(50..=300))), ends);
                    add(Stream(path, StreamFault::Cut(random.u16(20..=100))), ends);
                }
                allowed = &[Bit::HostLost];
            }
            Self::BabbleLink => {
                let every = SimTime::from_us(random.u64(40..=200));
                // High priority, from a node outside the protocol.
                let frame = noise(random.u16(0x001..=0x00F), random);
                add(FaultKind::Babble(Interface::Link, frame, every), until);
                allowed = &[Bit::HostLost];
            }
            Self::BabbleActuators => {
                let every = SimTime::from_us(random.u64(40..=200));
                let frame = noise(random.u16(0x000..=0x07F), random);
                add(FaultKind::Babble(Interface::Actuator(bus), frame, every), until);
                allowed = UNREACHED;
            }
            Self::NoAck => {
                add(FaultKind::NoAck(Interface::Actuator(bus)), until);
                plan.adapter = adapter(random);
                (required, allowed) = (if long { UNREACHED } else { &[] }, UNREACHED);
            }
            Self::LinkUnplugged => {
                add(FaultKind::NoAck(Interface::Link), until);
                allowed = &[Bit::HostLost];
                required = if long { allowed } else { &[] };
            }
            Self::BusOff => {
                add(FaultKind::BusOff(bus), until);
                required = &[Bit::BusOff];
                allowed = &[Bit::BusOff, Bit::ActuatorSilent, Bit::ActuatorFault];
            }
            Self::ActuatorDeaf => {
                add(FaultKind::Deaf(channel), until);
                plan.adapter = adapter(random);
                (required, allowed) = (if long { UNREACHED } else { &[] }, UNREACHED);
            }
            Self::ActuatorDead => {
                add(FaultKind::Unpowered(channel), until);
                plan.adapter = adapter(random);
                // Even a short power cut switches the torque of the actuator off.
                (required, allowed) = (UNREACHED, UNREACHED);
            }
            Self::ActuatorLoss => {
                ends = while_streaming;
                // Chaos includes loss even if the link has none.
                let loss = loss_per_mille.max(10);
                for bus in 0..buses {
                    for path in [FramePath::ToActuators(bus), FramePath::FromActuators(bus)] {
                        add(Stream(path, StreamFault::Lose(loss)), ends);
                    }
                }
                allowed = UNREACHED;
            }
            Self::ActuatorDisorder => {
                ends = while_streaming;
                let disorders = [
                    StreamFault::Repeat(random.u16(50..=400), between(random, 0, 40)),
                    StreamFault::Reorder(random.u32(1..=4)),
                    StreamFault::Delay(SimTime::ZERO, between(random, 0, 40)),
                ];
                for bus in 0..buses {
                    for path in [FramePath::ToActuators(bus), FramePath::FromActuators(bus)] {
                        for disorder in disorders.into_iter().filter(|_| random.bool()) {
                            add(Stream(path, disorder), ends);
                        }
                    }
                    add(Stream(FramePath::FromActuators(bus), disorders[0]), ends);
                }
                allowed = UNREACHED;
            }
            Self::ActuatorCorruption => {
                ends = while_streaming;
                for bus in 0..buses {
                    let (damage, cut) = (random.u16(1..=100), random.u16(1..=100));
                    add(Stream(FramePath::FromActuators(bus), StreamFault::Damage(damage)), ends);
                    add(Stream(FramePath::FromActuators(bus), StreamFault::Cut(cut)), ends);
                    add(Stream(FramePath::ToActuators(bus), StreamFault::Cut(cut)), ends);
                }
                allowed = &[Bit::ActuatorSilent, Bit::ActuatorFault, Bit::TrackingError];
            }
            Self::PowerCut => {
                let whole = random.bool();
                for (channel, c) in config.channels.iter().enumerate() {
                    if whole || c.bus == bus {
                        add(FaultKind::Unpowered(channel), until);
                    }
                }
                plan.adapter = adapter(random);
                plan.adapter.depth = random.usize(1..=32);
                (required, allowed) = (UNREACHED, UNREACHED);
            }
            Self::HostDead => {
                plan.host = Host::Dies(start, until);
                allowed = &[Bit::HostLost];
                required = if long { allowed } else { &[] };
            }
            Self::HostStall => {
                plan.host = Host::Stalls(start, until);
                allowed = &[Bit::HostLost];
                required = if long { allowed } else { &[] };
            }
            Self::BridgeStall => {
                let paths = [&link[..], &link[..1], &link[1..]][random.usize(0..3)];
                paths.iter().for_each(|&path| add(Stream(path, StreamFault::Hold), until));
                // Heartbeats still arrive if only the other direction stalls.
                if paths.contains(&FramePath::LinkToController) {
                    allowed = &[Bit::HostLost];
                    required = if long { allowed } else { &[] };
                }
            }
            Self::EStop => {
                plan.host = Host::Stops(start);
                required = &[Bit::EStop];
                allowed = &[Bit::EStop, Bit::HostLost];
            }
            Self::Chaos => {
                let choice: Vec<Self> = (Self::ALL.into_iter())
                    .filter(|one| !matches!(one, Self::Loss | Self::Flash | Self::Chaos))
                    .collect();
                for _ in 0..random.usize(2..=4) {
                    let one = choice[random.usize(0..choice.len())];
                    let start = start + between(random, 0, 1500);
                    one.add_to(plan, start, loss_per_mille, config, random);
                }
                plan.required = FaultBits::default();
                plan.allowed = plan.allowed.with(Bit::HostLost);
                return;
            }
        }
        plan.faults.append(&mut faults);
        plan.until = plan.until.max(ends);
        plan.required = bits(required);
        plan.allowed = FaultBits(plan.allowed.0 | bits(allowed).0);
    }
}

fn bits(faults: &[Bit]) -> FaultBits {
    faults.iter().fold(FaultBits::default(), |all, &fault| all.with(fault))
}

/// Random duration within a range, ms.
pub(super) fn between(random: &mut Rng, least_ms: u64, most_ms: u64) -> SimTime {
    SimTime::from_us(random.u64(1000 * least_ms..=1000 * most_ms))
}

/// Frame with random data.
fn noise(id: u16, random: &mut Rng) -> Frame {
    let data: Vec<u8> = (0..random.usize(0..=8)).map(|_| random.u8(..)).collect();
    Frame::standard(id, &data).expect("8 bytes at most")
}

/// Random CAN adapter.
fn adapter(random: &mut Rng) -> Adapter {
    Adapter {
        depth: if random.bool() { 1 } else { random.usize(2..=16) },
        calls_back: random.bool(),
        alone: if random.bool() { BusState::NotAcknowledged } else { BusState::Passive },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::Subject;

    #[test]
    fn chaos_includes_host_events_and_actuator_loss() {
        let config = Subject::one_leg().config();
        let plans: Vec<Plan> = (0..200)
            .map(|seed| Scenario::Chaos.plan(SimTime::ZERO, 0, &config, &mut Rng::with_seed(seed)))
            .collect();
        let hosts = |which: fn(&Host) -> bool| plans.iter().any(|plan| which(&plan.host));
        assert!(hosts(|host| matches!(host, Host::Stays)));
        assert!(hosts(|host| matches!(host, Host::Dies(..))));
        assert!(hosts(|host| matches!(host, Host::Stalls(..))));
        assert!(hosts(|host| matches!(host, Host::Stops(_))));
        let mut kinds = plans.iter().flat_map(|plan| &plan.faults).map(|fault| fault.kind);
        assert!(kinds.any(|kind| kind == Stream(FramePath::ToActuators(0), StreamFault::Lose(10))));
    }
}
