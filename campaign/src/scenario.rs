//! What goes wrong in a run: faults with beginning and end, made from a random number.

use fastrand::Rng;
use rollwalk_firmware::BusState;
use rollwalk_protocol::can::Frame;
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::faults::{Fault as Bit, FaultBits};
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::faults::stream::Spoil;
use rollwalk_sim_host::faults::{Fault, Harm, Way};
use rollwalk_sim_host::interface::Interface;
use rollwalk_sim_host::rig::Adapter;

/// What goes wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Scenario {
    /// Nothing but the loss that all scenarios have.
    Loss,
    /// Frames of the link come twice.
    Repeats,
    /// Frames of the link overtake each other.
    Reorder,
    /// Frames of the link come late.
    Delay,
    /// Frames of the link are damaged where no CRC of CAN sees it, or cut.
    Corruption,
    /// A foreign node talks on the link without pause.
    BabbleLink,
    /// A foreign node talks on an actuator bus without pause.
    BabbleActuators,
    /// Nobody acknowledges on an actuator bus.
    NoAck,
    /// Host and controller are disconnected; both keep what they have to send.
    LinkUnplugged,
    /// The controller's end of an actuator bus goes off.
    BusOff,
    /// An actuator neither hears nor answers for a while.
    ActuatorDeaf,
    /// An actuator loses its power for a while.
    ActuatorDead,
    /// Frames of the actuator buses get lost, as many as of the link.
    ActuatorLoss,
    /// Frames of the actuator buses come twice, late and in another order.
    ActuatorDisorder,
    /// Frames of the actuator buses are damaged or cut.
    ActuatorCorruption,
    /// Motor power fails and comes back; the interface has kept what it could not send.
    PowerCut,
    /// The host's program ends, and another is started later.
    HostDead,
    /// The host's program stands still, and then goes on.
    HostStall,
    /// A bridge to the controller stands still, and then passes on all that it has.
    BridgeStall,
    /// The host stops the robot.
    EStop,
    /// The library is transferred while frames are lost, repeated, damaged and late.
    Flash,
    /// Several of these, one after the other and at the same time; of what the host does one.
    Chaos,
}

/// What a program at the host's end does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Host {
    /// Goes on.
    Stays,
    /// Ends at an instant; another one is started at a later one.
    Dies(SimTime, SimTime),
    /// Stands still from one instant to another.
    Stalls(SimTime, SimTime),
    /// Sends an emergency stop at an instant.
    Stops(SimTime),
}

/// What happens in a run.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Besides the loss.
    pub faults: Vec<Fault>,
    /// Between controller and actuators.
    pub adapter: Adapter,
    /// At the other end of the link.
    pub host: Host,
    /// All of it is over.
    pub until: SimTime,
    /// One of these is to be told, if torque is on when it begins.
    pub required: FaultBits,
    /// Others than these are not to be told.
    pub allowed: FaultBits,
}

impl Scenario {
    /// All, in the order of the table.
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

    /// Its name on the command line.
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

    /// The losses that it is run with, of a thousand frames.
    pub fn losses(self) -> &'static [u16] {
        match self {
            Self::EStop => &[0, 10, 30, 100, 300, 900, 1000],
            // Without loss nothing goes wrong in it.
            Self::ActuatorLoss => &[10, 30, 100, 300],
            _ => &[0, 10, 30, 100, 300],
        }
    }

    /// Whether frames of the actuator buses, or actuators, are disturbed: then a motor may learn that it
    /// is to be off from its own watchdog only.
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

    /// What happens after `start`.
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
        // Long enough for anything to be noticed, or hardly.
        let long = random.bool();
        let lasts = if long { between(random, 600, 2500) } else { between(random, 60, 400) };
        let until = start + lasts;
        let link = [Way::LinkToController, Way::LinkToHost];
        let buses = config.channels.iter().map(|c| c.bus).max().map_or(0, |most| most + 1);
        let bus = random.u8(0..buses.max(1));
        let channel = random.usize(0..config.channels.len().max(1));
        let mut faults = Vec::new();
        let mut add = |harm, until| faults.push(Fault { harm, from: start, until });
        let mut required: &[Bit] = &[];
        let mut allowed: &[Bit] = &[];
        // One that is not reached, by whatever.
        const UNREACHED: &[Bit] =
            &[Bit::ActuatorSilent, Bit::ActuatorFault, Bit::BusNoAck, Bit::BusPassive];
        // Streams of few frames take longer until something has happened to one.
        let while_streaming = start + between(random, 1500, 4000);
        let mut ends = until;
        match self {
            Self::Loss | Self::Flash => {}
            Self::Repeats => {
                ends = while_streaming;
                let rate = random.u16(100..=600);
                let within = between(random, 0, 700);
                link.iter()
                    .for_each(|&way| add(Harm::Stream(way, Spoil::Repeat(rate, within)), ends));
            }
            Self::Reorder => {
                ends = while_streaming;
                let window = random.u32(1..=12);
                link.iter().for_each(|&way| add(Harm::Stream(way, Spoil::Reorder(window)), ends));
                if loss_per_mille > 0 {
                    allowed = &[Bit::HostLost];
                }
            }
            Self::Delay => {
                ends = while_streaming;
                let most = between(random, 5, 150);
                let least = if random.bool() { most } else { SimTime::ZERO };
                link.iter()
                    .for_each(|&way| add(Harm::Stream(way, Spoil::Delay(least, most)), ends));
                if loss_per_mille > 0 {
                    allowed = &[Bit::HostLost];
                }
            }
            Self::Corruption => {
                ends = while_streaming;
                for way in link {
                    add(Harm::Stream(way, Spoil::Damage(random.u16(50..=300))), ends);
                    add(Harm::Stream(way, Spoil::Cut(random.u16(20..=100))), ends);
                }
                allowed = &[Bit::HostLost];
            }
            Self::BabbleLink => {
                let every = SimTime::from_us(random.u64(40..=200));
                // Urgent, and of no node that is there.
                let frame = noise(random.u16(0x001..=0x00F), random);
                add(Harm::Babble(Interface::Link, frame, every), until);
                allowed = &[Bit::HostLost];
            }
            Self::BabbleActuators => {
                let every = SimTime::from_us(random.u64(40..=200));
                let frame = noise(random.u16(0x000..=0x07F), random);
                add(Harm::Babble(Interface::Actuator(bus), frame, every), until);
                allowed = UNREACHED;
            }
            Self::NoAck => {
                add(Harm::NoAck(Interface::Actuator(bus)), until);
                plan.adapter = adapter(random);
                (required, allowed) = (if long { UNREACHED } else { &[] }, UNREACHED);
            }
            Self::LinkUnplugged => {
                add(Harm::NoAck(Interface::Link), until);
                allowed = &[Bit::HostLost];
                required = if long { allowed } else { &[] };
            }
            Self::BusOff => {
                add(Harm::BusOff(bus), until);
                required = &[Bit::BusOff];
                allowed = &[Bit::BusOff, Bit::ActuatorSilent, Bit::ActuatorFault];
            }
            Self::ActuatorDeaf => {
                add(Harm::Deaf(channel), until);
                plan.adapter = adapter(random);
                (required, allowed) = (if long { UNREACHED } else { &[] }, UNREACHED);
            }
            Self::ActuatorDead => {
                add(Harm::Unpowered(channel), until);
                plan.adapter = adapter(random);
                // However short it was, its torque is off now.
                (required, allowed) = (UNREACHED, UNREACHED);
            }
            Self::ActuatorLoss => {
                ends = while_streaming;
                // In chaos also where the link loses nothing.
                let loss = loss_per_mille.max(10);
                for bus in 0..buses {
                    for way in [Way::ToActuators(bus), Way::FromActuators(bus)] {
                        add(Harm::Stream(way, Spoil::Lose(loss)), ends);
                    }
                }
                allowed = UNREACHED;
            }
            Self::ActuatorDisorder => {
                ends = while_streaming;
                let spoils = [
                    Spoil::Repeat(random.u16(50..=400), between(random, 0, 40)),
                    Spoil::Reorder(random.u32(1..=4)),
                    Spoil::Delay(SimTime::ZERO, between(random, 0, 40)),
                ];
                for bus in 0..buses {
                    for way in [Way::ToActuators(bus), Way::FromActuators(bus)] {
                        for spoil in spoils.into_iter().filter(|_| random.bool()) {
                            add(Harm::Stream(way, spoil), ends);
                        }
                    }
                    add(Harm::Stream(Way::FromActuators(bus), spoils[0]), ends);
                }
                allowed = UNREACHED;
            }
            Self::ActuatorCorruption => {
                ends = while_streaming;
                for bus in 0..buses {
                    let (damage, cut) = (random.u16(1..=100), random.u16(1..=100));
                    add(Harm::Stream(Way::FromActuators(bus), Spoil::Damage(damage)), ends);
                    add(Harm::Stream(Way::FromActuators(bus), Spoil::Cut(cut)), ends);
                    add(Harm::Stream(Way::ToActuators(bus), Spoil::Cut(cut)), ends);
                }
                allowed = &[Bit::ActuatorSilent, Bit::ActuatorFault, Bit::TrackingError];
            }
            Self::PowerCut => {
                let whole = random.bool();
                for (channel, c) in config.channels.iter().enumerate() {
                    if whole || c.bus == bus {
                        add(Harm::Unpowered(channel), until);
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
                let ways = [&link[..], &link[..1], &link[1..]][random.usize(0..3)];
                ways.iter().for_each(|&way| add(Harm::Stream(way, Spoil::Hold), until));
                // A host that hears nothing is heard nevertheless.
                if ways.contains(&Way::LinkToController) {
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

/// So many milliseconds, more or less.
pub(super) fn between(random: &mut Rng, least_ms: u64, most_ms: u64) -> SimTime {
    SimTime::from_us(random.u64(1000 * least_ms..=1000 * most_ms))
}

/// A frame that means nothing.
fn noise(id: u16, random: &mut Rng) -> Frame {
    let data: Vec<u8> = (0..random.usize(0..=8)).map(|_| random.u8(..)).collect();
    Frame::standard(id, &data).expect("8 bytes at most")
}

/// One of those that there are.
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
    use crate::Subject;

    #[test]
    fn chaos_has_what_the_host_does_and_lost_frames_of_actuators_too() {
        let config = Subject::one_leg().config();
        let plans: Vec<Plan> = (0..200)
            .map(|seed| Scenario::Chaos.plan(SimTime::ZERO, 0, &config, &mut Rng::with_seed(seed)))
            .collect();
        let hosts = |which: fn(&Host) -> bool| plans.iter().any(|plan| which(&plan.host));
        assert!(hosts(|host| matches!(host, Host::Stays)));
        assert!(hosts(|host| matches!(host, Host::Dies(..))));
        assert!(hosts(|host| matches!(host, Host::Stalls(..))));
        assert!(hosts(|host| matches!(host, Host::Stops(_))));
        let mut harms = plans.iter().flat_map(|plan| &plan.faults).map(|fault| fault.harm);
        assert!(harms.any(|harm| harm == Harm::Stream(Way::ToActuators(0), Spoil::Lose(10))));
    }
}
