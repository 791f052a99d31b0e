//! Motions in closed loop over a simulated bus, in virtual time: AgileBot on the ground, its firmware, an operator, and a host whose ticks
//! take a given time.

use super::conductor::{Conductor, Phase, wheels};
use super::route::{self, Play};
use super::{timing, tracking};
use crate::inputs::{Library, Source};
use crate::packed::Packed;
use crate::planning::{self, Plans};
use rollwalk_bus::link::LinkBus;
use rollwalk_host::operator::{Leaving, Operator};
use rollwalk_host::session::Session;
use rollwalk_physics::ground::{Ground, Plane};
use rollwalk_physics::push::Shove;
use rollwalk_protocol::library::identity;
use rollwalk_protocol::wire::{Node, State};
use rollwalk_sim_host::rig::Rig;
use rollwalk_simulate::Sequence;
use std::path::Path;
use std::sync::Arc;

const S: u64 = 1_000_000;

/// A library that is planned.
struct Planned {
    library: Library,
    plans: Plans,
    file: Vec<u8>,
}

impl Planned {
    fn agilebot() -> Self {
        Self::new("motions/agilebot_library.toml")
    }

    fn new(path: &str) -> Self {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let library = Source::Disk.library(&root.join(path));
        let library = library.expect("it ships");
        let plans = planning::plan_all(&library, false).expect("files").expect("not interrupted");
        let file = plans.pack(&library).expect("it holds").bytes;
        Self { library, plans, file }
    }

    fn conductor(&self, play: &[&str], rate_hz: u32) -> Conductor<'_> {
        let play: Vec<Play> = play.iter().map(|text| text.parse().expect("a motion")).collect();
        let legs = route::legs(&self.library, &self.plans, &play).expect("a way");
        let sequence = Sequence::new(legs, timing(rate_hz)).expect("they follow each other");
        let robot = &self.library.robot;
        let wheels = wheels(robot, sequence.tree()).expect("encoders");
        let id = identity(&self.file).expect("a library");
        Conductor::new(sequence, robot, wheels, tracking(rate_hz), id)
    }
}

/// A robot with a host.
struct Bench<'p> {
    rig: Rig,
    operator: Operator,
    conductor: Conductor<'p>,
    /// Time of a tick, µs, and whether there are any.
    tick_us: u64,
    waits: bool,
    silent: bool,
    at_us: Option<u64>,
}

impl<'p> Bench<'p> {
    fn new(planned: &Planned, conductor: Conductor<'p>, shoves: Vec<Shove>) -> Self {
        let robot = &planned.library.robot;
        let packed = Packed::new(robot.clone(), planned.file.clone()).expect("it was built");
        let ground: Arc<dyn Ground> = Arc::new(Plane::level());
        let rig = Rig::new(robot).unwrap().onto_ground(robot, &ground, shoves);
        let node = Node::new(1).unwrap();
        let mut session = Session::connect(rig, node).unwrap();
        session.flash(&packed.file, |_| {}).unwrap();
        let config_hash = robot.controller_config().unwrap().hash();
        let operator = Operator::new(node, Some(config_hash));
        let rig = session.into_bus();
        let mut bench = Self {
            rig,
            operator,
            conductor,
            tick_us: 1_000,
            waits: true,
            silent: false,
            at_us: None,
        };
        // Until its heartbeats count in place of those of the session before.
        bench.run(S);
        bench.waits = false;
        bench
    }

    fn now_us(&self) -> u64 {
        self.rig.now_us()
    }

    fn state(&self) -> State {
        self.operator.view(self.now_us()).status.expect("it is heard").state
    }

    fn run_until(&mut self, most_us: u64, reached: impl Fn(&Self) -> bool) {
        let end_us = self.now_us() + most_us;
        while !reached(self) {
            let messages = self.operator.view(self.now_us()).messages;
            assert!(self.now_us() < end_us, "{:?}: {messages:#?}", self.state());
            self.step();
        }
    }

    fn run(&mut self, us: u64) {
        let end_us = self.now_us() + us;
        while self.now_us() < end_us {
            self.step();
        }
    }

    fn step(&mut self) {
        let now_us = self.now_us();
        if !self.waits {
            self.conductor.look(now_us, &mut self.operator);
        }
        if self.at_us.is_some_and(|at_us| now_us >= at_us) {
            self.at_us = None;
            self.conductor.answer(now_us, &mut self.operator);
        }
        while let Some(frame) = self.operator.poll(now_us) {
            if self.rig.send(&frame).is_err() {
                self.operator.not_sent(frame);
                break;
            }
        }
        let wake_us = self.operator.next_poll_us(now_us).clamp(now_us + 200, now_us + 1_000);
        let wake_us = self.at_us.map_or(wake_us, |at_us| wake_us.min(at_us.max(now_us + 1)));
        if let Some(frame) = self.rig.receive(wake_us).unwrap() {
            self.operator.on_frame(self.rig.now_us(), &frame);
            let is_sample = frame.standard_id().is_some_and(|id| id & 0x70F == 0x404);
            if is_sample && !self.silent {
                self.at_us = Some(self.rig.now_us() + self.tick_us);
            }
        }
    }

    /// Where the body is, m, and its heading, rad.
    fn place(&self) -> [f64; 3] {
        let (position, rotation) = self.rig.body().ground().expect("on the ground").world().base();
        [position.x, position.y, rotation[(1, 0)].atan2(rotation[(0, 0)])]
    }

    fn falls(&self) -> usize {
        self.rig.body().ground().expect("on the ground").falls().len()
    }
}

#[test]
fn a_robot_walks_in_closed_loop_over_a_bus() {
    let planned = Planned::agilebot();
    let mut bench = Bench::new(&planned, planned.conductor(&["walk:4"], 120), Vec::new());
    bench.run_until(10 * S, |bench| bench.conductor.phase() == Phase::Playing);
    let before = bench.place();
    bench.run_until(60 * S, |bench| bench.conductor.phase() == Phase::Homeward);
    let after = bench.place();
    let way = (after[0] - before[0]).hypot(after[1] - before[1]);
    let wanted: f64 = bench
        .conductor
        .sequence()
        .legs()
        .iter()
        .map(|leg| {
            leg.plan().end_placement.offset_m[0]
                * if leg.plan().motion.name == "walk" { 4.0 } else { 1.0 }
        })
        .sum();
    println!("{way} of {wanted}: {:?}", bench.conductor.tally());
    for message in &bench.operator.view(bench.now_us()).messages {
        println!("{:9.3} {}", message.at_us as f64 * 1e-6, message.text);
    }
    assert_eq!(bench.falls(), 0);
    bench.run_until(20 * S, |bench| bench.operator.leaving() == Leaving::Now);
    assert_eq!(bench.state(), State::Disarmed);
    assert!((way / wanted - 1.0).abs() < 0.05);
    let tally = bench.conductor.tally();
    assert!(tally.complete && tally.lost == 0);
}

#[test]
#[ignore = "scratch"]
fn scratch() {
    let args: Vec<String> =
        std::env::var("SCRATCH").unwrap().split(' ').map(String::from).collect();
    let planned = Planned::new(&args[0]);
    for failure in planned.plans.failures() {
        println!("{failure}");
    }
    let plays: Vec<&str> = args[1].split(',').collect();
    for rate in args[2].split(',') {
        for tick_us in args[3].split(',') {
            let shoves: Vec<Shove> = args
                .get(4)
                .into_iter()
                .flat_map(|of| of.split(';'))
                .map(|of| {
                    let n: Vec<f64> = of.split(',').map(|x| x.parse().unwrap()).collect();
                    Shove { from_s: n[0], duration_s: n[1], force_n: [n[2], n[3], 0.0].into() }
                })
                .collect();
            let mut bench =
                Bench::new(&planned, planned.conductor(&plays, rate.parse().unwrap()), shoves);
            bench.tick_us = tick_us.parse().unwrap();
            bench.run_until(10 * S, |bench| bench.conductor.phase() == Phase::Playing);
            let before = bench.place();
            let mut last = before[2];
            let mut turned = 0.0;
            let end = bench.now_us() + 120 * S;
            let begin = bench.now_us();
            let silent: Vec<f64> = std::env::var("SILENT")
                .ok()
                .into_iter()
                .flat_map(|of| of.split(',').map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>())
                .collect();
            while bench.conductor.phase() == Phase::Playing && bench.now_us() < end {
                if let &[from, len] = silent.as_slice() {
                    let t = (bench.now_us() - begin) as f64 * 1e-6;
                    bench.silent = t >= from && t < from + len;
                }
                bench.step();
                let h = bench.place()[2];
                let d = (h - last + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU)
                    - std::f64::consts::PI;
                turned += d;
                last = h;
            }
            if !silent.is_empty() && bench.state() != State::Streaming {
                bench.run(3 * S);
            }
            let after = bench.place();
            let way = (after[0] - before[0]).hypot(after[1] - before[1]);
            let legs = bench.conductor.sequence().legs();
            let wanted: f64 = legs
                .iter()
                .map(|leg| leg.plan().end_placement.offset_m[0] * leg.cycles() as f64)
                .sum();
            let wanted_turn: f64 =
                legs.iter().map(|leg| leg.plan().end_placement.yaw_rad * leg.cycles() as f64).sum();
            let t = bench.conductor.tally().clone();
            println!(
                "rate {rate} tick {tick_us}: way {way:.3} of {wanted:.3} ({:.3}), turn {turned:.3} of {wanted_turn:.3} ({:.3}), place {:.3} {:.3} {:.3}, falls {}, answered {} untracked {} late {:?} lost {} stale {} {:?}",
                way / wanted,
                turned / wanted_turn,
                after[0] - before[0],
                after[1] - before[1],
                after[2] - before[2],
                bench.falls(),
                t.answered,
                t.untracked,
                &t.late[..6],
                t.lost,
                t.stale,
                bench.state()
            );
            for message in bench
                .operator
                .view(bench.now_us())
                .messages
                .iter()
                .filter(|m| m.weight != rollwalk_host::operator::Weight::Note)
            {
                println!("   {:9.3} {}", message.at_us as f64 * 1e-6, message.text);
            }
        }
    }
}
