//! Transfer time of a library of 64 KiB in virtual time, compared with the time that its frames alone take on the bus.

use crate::robot::{self, STAND};
use crate::serial_line::{BYTE_US, SerialLine};
use crate::transport_frames;

use rollwalk_bus::link::{LinkBus, LinkError};
use rollwalk_host::session::Session;
use rollwalk_protocol::can::Frame;

use rollwalk_protocol::library::{LibrarySpec, MotionSpec, TransitionSpec, encode, validate};
use rollwalk_protocol::wire::Node;
use rollwalk_sim_host::clock::SimTime;
use rollwalk_sim_host::rig::Rig;

const SIZE: usize = 64 << 10;

/// Noise around the standing pose, as hard to compress as any motion that servos could follow.
fn noise(frames: usize, seed: u64) -> Vec<f32> {
    let mut random = fastrand::Rng::with_seed(seed);
    let stand = robot::motion(STAND);
    let mut values = Vec::new();
    for frame in 0..frames {
        // The motion begins and ends at rest.
        let amplitude = if frame < 2 || frame + 2 >= frames { 0.0 } else { 0.02 };
        for (channel, value) in stand[..3].iter().enumerate() {
            let jitter = if channel < 2 { amplitude * (2.0 * random.f32() - 1.0) } else { 0.0 };
            values.push(value + jitter);
        }
    }
    values
}

/// Library of slightly more than 64 KiB.
fn large_library() -> Vec<u8> {
    let config = robot::config();
    let stand = robot::motion(STAND);
    let names = ["a", "b", "c", "d", "e", "f", "g", "h", "i", "j", "k", "l"];
    let clips: Vec<_> = (0..names.len()).map(|k| noise(3600, k as u64)).collect();
    let still = stand[..3].repeat(6);
    for count in 1..=names.len() {
        let mut motions = vec![MotionSpec {
            name: "stand",
            code: STAND,
            looping: false,
            frames: &stand,
            torques: &[],
        }];
        let mut transitions = Vec::new();
        for k in 0..count {
            let code = 10 + k as u8;
            motions.push(MotionSpec {
                name: names[k],
                code,
                looping: false,
                frames: &clips[k],
                torques: &[],
            });
            transitions.extend([
                TransitionSpec::new(0, 1, 1 + k, 0, &still),
                TransitionSpec::new(1 + k, 3599, 0, 0, &still),
            ]);
        }
        let spec =
            LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
        let mut bytes = vec![0; 1 << 20];
        let length = encode(&spec, &mut bytes).expect("the library is sound");
        if length >= SIZE {
            bytes.truncate(length);
            return bytes;
        }
    }
    panic!("noise packs too well");
}

#[test]
fn on_can_at_1_mbit_a_transfer_takes_at_most_half_again_of_the_bus_s_own_time() {
    let library = large_library();
    let rig = Rig::new(&robot::robot()).unwrap();
    let mut session = Session::connect(rig, Node::new(1).unwrap()).unwrap();
    let before = session.bus().now();
    session.flash(&library, |_| {}).unwrap();
    let rig = session.into_bus();
    let took = (rig.now() - before).as_s();
    // Frames of seven bytes in sequence, without answers.
    let bits: u64 = transport_frames(&rig).map(|frame| u64::from(frame.exact_bits())).sum();
    let theory = bits as f64 * 1e-6;
    println!("{} B in {took:.3} s, {theory:.3} s of frames: {:.3}", library.len(), took / theory);
    assert!(took < 1.5 * theory, "{took} s, {theory} s of frames");
}

#[test]
fn on_a_serial_line_at_1_mbaud_a_transfer_takes_at_most_half_again_of_the_line_s_own_time() {
    let library = large_library();
    let line = SerialLine::new(Rig::new(&robot::robot()).unwrap());
    let mut session = Session::connect(line, Node::new(1).unwrap()).unwrap();
    let (before_us, before) = (session.bus().now_us(), session.bus().bytes);
    session.flash(&library, |_| {}).unwrap();
    let line = session.into_bus();
    let took = (line.now_us() - before_us) as f64 * 1e-6;
    // Only the bytes of the library.
    let theory = (library.len() as u64 * BYTE_US) as f64 * 1e-6;
    let (length, bytes) = (library.len(), line.bytes - before);
    println!("{length} B, {bytes} B both ways, in {took:.3} s: {:.3}", took / theory);
    assert!(took < 1.5 * theory, "{took} s, {theory} s of bytes");
}

/// Link that breaks permanently when the controller has received `at` bytes.
struct CutLink<B> {
    bus: B,
    has: std::rc::Rc<std::cell::Cell<usize>>,
    at: usize,
}

impl<B: LinkBus> LinkBus for CutLink<B> {
    fn now_us(&self) -> u64 {
        self.bus.now_us()
    }

    fn send(&mut self, frame: &Frame) -> Result<(), LinkError> {
        if self.has.get() >= self.at {
            return Err(LinkError::Down("cut".into()));
        }
        self.bus.send(frame)
    }

    fn receive(&mut self, deadline_us: u64) -> Result<Option<Frame>, LinkError> {
        self.bus.receive(deadline_us)
    }
}

/// Cuts a transfer at every block: each session transfers one block more than the previous one. `wait` advances the time by 1.5
/// s, after which a controller has dropped the incomplete message.
fn cut_at_every_block<B: LinkBus>(mut bus: B, wait: impl Fn(&mut B)) {
    let library = large_library();
    let node = Node::new(1).unwrap();
    let mut cuts = 0;
    for at in (0..library.len()).step_by(512).skip(1) {
        let has = std::rc::Rc::new(std::cell::Cell::new(0));
        let cut = CutLink { bus, has: has.clone(), at };
        let mut session = Session::connect(cut, node).unwrap();
        let mut begun = None;
        let outcome = session.flash(&library, |progress| {
            begun = begun.or(Some(progress.done));
            has.set(progress.done);
        });
        assert!(outcome.is_err(), "the link was cut at {at}");
        assert_eq!(begun, Some(at - 512), "it goes on where the last one stopped");
        bus = session.into_bus().bus;
        wait(&mut bus);
        cuts += 1;
    }
    assert_eq!(cuts, library.len().div_ceil(512) - 1);
    let mut session = Session::connect(bus, node).unwrap();
    session.flash(&library, |_| {}).unwrap();
    assert_eq!(session.hello().library, validated_id(&library));
}

#[test]
fn a_transfer_goes_on_after_a_cut_at_any_block() {
    cut_at_every_block(Rig::new(&robot::robot()).unwrap(), |rig| {
        rig.run_until(rig.now() + SimTime::from_ms(1500));
    });
}

#[test]
fn on_a_serial_line_it_goes_on_as_well() {
    cut_at_every_block(SerialLine::new(Rig::new(&robot::robot()).unwrap()), |line| {
        let deadline_us = line.now_us() + 1_500_000;
        while line.receive(deadline_us).unwrap().is_some() {}
    });
}

fn validated_id(library: &[u8]) -> Option<u32> {
    Some(validate(library, &robot::config()).unwrap().id())
}
