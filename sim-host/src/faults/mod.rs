//! Faults of buses, actuators and adapters, each with a start and an end in virtual time.
//!
//! A schedule of faults is a value: together with its seed it reproduces a run bit by bit. Each fault counts its effects,
//! because a fault without effects tests nothing.
//!
//! | module | faults |
//! |---|---|
//! | [`stream`] | frames that are lost, repeated, late, reordered or damaged |
//!
//! [`crate::rig`] applies them.

pub mod stream;

use crate::clock::SimTime;
use crate::interface::Interface;
use fastrand::Rng;
use rollwalk_protocol::can::Frame;
use std::collections::BTreeMap;
use stream::{Stream, StreamFault};

/// Path of frames from a bus to a receiver.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum FramePath {
    /// Frames from the host.
    LinkToController,
    /// Frames from the controller.
    LinkToHost,
    /// Frames to the actuators of a bus.
    ToActuators(u8),
    /// Frames from the actuators of a bus.
    FromActuators(u8),
}

/// Kind of a fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FaultKind {
    /// Frames are lost, delayed or damaged after the bus.
    Stream(FramePath, StreamFault),
    /// A foreign node sends the given frame periodically.
    Babble(Interface, Frame, SimTime),
    /// Missing acknowledgement on this bus, so that the sender repeats its frame. A serial line is cut instead: bytes sent on
    /// it are lost.
    NoAck(Interface),
    /// Bus-off of the controller at an actuator bus, as after a short circuit. A serial line is not affected.
    BusOff(u8),
    /// An actuator neither receives nor answers. It keeps its set-point until its own watchdog expires.
    Deaf(usize),
    /// An actuator has no power, and therefore no torque, no answers and no stored state.
    Unpowered(usize),
}

/// Fault with its interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// Kind.
    pub kind: FaultKind,
    /// Start.
    pub from: SimTime,
    /// End, exclusive.
    pub until: SimTime,
}

impl FaultKind {
    /// True if the actuator of a channel neither receives nor answers.
    pub fn silences(&self, channel: usize) -> bool {
        [Self::Deaf(channel), Self::Unpowered(channel)].contains(self)
    }
}

impl Fault {
    fn is_on(&self, now: SimTime) -> bool {
        self.from <= now && now < self.until
    }
}

/// Schedule of faults with their effects.
#[derive(Clone, Debug)]
pub struct Faults {
    schedule: Vec<(Fault, u64)>,
    streams: BTreeMap<FramePath, Stream>,
    random: Rng,
}

impl Default for Faults {
    fn default() -> Self {
        Self::new(0)
    }
}

impl Faults {
    /// Creates an empty schedule with the seed of all random numbers.
    pub fn new(seed: u64) -> Self {
        Self { schedule: Vec::new(), streams: BTreeMap::new(), random: Rng::with_seed(seed) }
    }

    /// Adds a fault.
    pub fn add(&mut self, fault: Fault) {
        self.schedule.push((fault, 0));
    }

    /// Iterates over all faults, with the number of effects of each.
    pub fn all(&self) -> impl Iterator<Item = (&Fault, u64)> {
        self.schedule.iter().map(|(fault, fired)| (fault, *fired))
    }

    /// Kinds of the faults active at `now`.
    pub fn on(&self, now: SimTime) -> impl Iterator<Item = &FaultKind> {
        self.schedule.iter().map(|(fault, _)| fault).filter(move |f| f.is_on(now)).map(|f| &f.kind)
    }

    /// Counts one effect for every active fault for which `which` returns true.
    pub fn fire(&mut self, now: SimTime, which: impl Fn(&FaultKind) -> bool) {
        for (fault, fired) in &mut self.schedule {
            if fault.is_on(now) && which(&fault.kind) {
                *fired += 1;
            }
        }
    }

    /// Next time after `now` at which a fault starts or ends; `None` if there is none.
    pub fn next_edge(&self, now: SimTime) -> Option<SimTime> {
        let edges = self.schedule.iter().flat_map(|(fault, _)| [fault.from, fault.until]);
        edges.filter(|&at| at > now).min()
    }

    /// True if a fault may change, delay or lose frames on the given path.
    fn is_disturbed(&self, now: SimTime, path: FramePath) -> bool {
        let waits = self.streams.get(&path).is_some_and(|stream| !stream.is_empty());
        waits || self.on(now).any(|kind| matches!(kind, FaultKind::Stream(on, _) if *on == path))
    }

    /// Accepts a frame that has crossed the bus. Returns it if no fault affects its path. Otherwise it is lost, or
    /// [`Self::pop`] returns it later, possibly changed.
    pub fn push(&mut self, now: SimTime, path: FramePath, frame: Frame) -> Option<Frame> {
        if !self.is_disturbed(now, path) {
            return Some(frame);
        }
        let (indices, stream_faults): (Vec<_>, Vec<_>) = (self.schedule.iter().enumerate())
            .filter_map(|(index, (fault, _))| match fault.kind {
                FaultKind::Stream(on, stream_fault) if on == path && fault.is_on(now) => {
                    Some((index, (stream_fault, fault.until)))
                }
                _ => None,
            })
            .unzip();
        let Self { schedule, streams, random } = self;
        let stream = streams.entry(path).or_default();
        stream.push(now, frame, stream_faults.into_iter(), random, |k| schedule[indices[k]].1 += 1);
        None
    }

    /// Time and path of the next delayed frame.
    pub fn next_due(&self) -> Option<(SimTime, FramePath)> {
        let due =
            self.streams.iter().filter_map(|(&path, stream)| Some((stream.next_due()?, path)));
        due.min()
    }

    /// Returns the next delayed frame of a path that is due at `now`.
    pub fn pop(&mut self, now: SimTime, path: FramePath) -> Option<Frame> {
        self.streams.get_mut(&path)?.pop(now)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(ms: u64) -> SimTime {
        SimTime::from_ms(ms)
    }

    #[test]
    fn a_fault_begins_and_ends_and_counts_what_it_did() {
        let mut faults = Faults::new(1);
        let lose = FaultKind::Stream(FramePath::LinkToHost, StreamFault::Lose(1000));
        faults.add(Fault { kind: lose, from: ms(10), until: ms(20) });
        faults.add(Fault { kind: FaultKind::BusOff(1), from: ms(15), until: ms(30) });
        let edges = std::iter::successors(Some(ms(0)), |&at| faults.next_edge(at));
        assert_eq!(edges.collect::<Vec<_>>(), [0, 10, 15, 20, 30].map(ms));

        let frame = Frame::standard(1, &[1]).unwrap();
        for at in 0..40 {
            let arrives = faults.push(ms(at), FramePath::LinkToHost, frame).is_some();
            assert_eq!(arrives, !(10..20).contains(&at), "{at}");
            assert!(faults.push(ms(at), FramePath::LinkToController, frame).is_some());
        }
        faults.fire(ms(14), |kind| *kind == FaultKind::BusOff(1));
        faults.fire(ms(15), |kind| *kind == FaultKind::BusOff(1));
        faults.fire(ms(15), |kind| *kind == FaultKind::BusOff(0));
        assert_eq!(faults.all().map(|(_, fired)| fired).collect::<Vec<_>>(), [10, 1]);
    }

    #[test]
    fn what_is_late_is_not_overtaken_by_what_comes_when_all_is_well_again() {
        let mut faults = Faults::new(1);
        let hold = FaultKind::Stream(FramePath::ToActuators(0), StreamFault::Hold);
        faults.add(Fault { kind: hold, from: ms(0), until: ms(10) });
        let frame = |number| Frame::standard(1, &[number]).unwrap();
        assert_eq!(faults.push(ms(1), FramePath::ToActuators(0), frame(1)), None);
        assert_eq!(faults.next_due(), Some((ms(10), FramePath::ToActuators(0))));
        assert_eq!(faults.push(ms(10), FramePath::ToActuators(0), frame(2)), None);
        let out: Vec<_> =
            std::iter::from_fn(|| faults.pop(ms(10), FramePath::ToActuators(0))).collect();
        assert_eq!(out, [frame(1), frame(2)]);
        assert_eq!(faults.push(ms(10), FramePath::ToActuators(0), frame(3)), Some(frame(3)));
    }
}
