//! Effects of a bad adapter or bridge on a stream of frames after the bus.
//!
//! The bus itself neither loses nor damages frames, because CAN repeats unreceived frames and has a CRC. The devices after it
//! (USB adapters, serial bridges, radio) do both.

use crate::clock::SimTime;
use fastrand::Rng;
use rollwalk_protocol::can::Frame;

/// Maximum time that a frame waits to be overtaken.
const OVERTAKEN_WITHIN: SimTime = SimTime::from_ms(100);

/// Effect on frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamFault {
    /// Loses the given fraction of the frames, ‰.
    Lose(u16),
    /// Repeats the given fraction of the frames (‰) once, within the given time.
    Repeat(u16, SimTime),
    /// Delays half of the frames until later frames have overtaken them, at most the given number.
    Reorder(u32),
    /// Delays each frame by a random time between the two given times. If the two times differ, frames overtake each other.
    Delay(SimTime, SimTime),
    /// Flips one to four bits of the payload in this fraction of the frames, ‰.
    Damage(u16),
    /// Truncates the given fraction of the frames, ‰.
    Cut(u16),
    /// Delays all frames until the fault ends, and then releases them together.
    Hold,
}

#[derive(Clone, Copy, Debug)]
struct Late {
    due: SimTime,
    /// Number of frames that have to overtake this one first.
    behind: u32,
    order: u64,
    frame: Frame,
}

/// Delayed frames of a path.
#[derive(Clone, Debug, Default)]
pub struct Stream {
    late: Vec<Late>,
    order: u64,
}

impl Stream {
    /// True if no frame is delayed.
    pub fn is_empty(&self) -> bool {
        self.late.is_empty()
    }

    /// Time at which the next frame is due.
    pub fn next_due(&self) -> Option<SimTime> {
        self.late.iter().map(|late| late.due).min()
    }

    /// Accepts a frame. `faults` are the active faults, each with its end. `fired` is called with the index of each fault that
    /// affected the frame.
    pub fn push(
        &mut self,
        now: SimTime,
        frame: Frame,
        faults: impl Iterator<Item = (StreamFault, SimTime)>,
        random: &mut Rng,
        mut fired: impl FnMut(usize),
    ) {
        let mut late = Late { due: now, behind: 0, order: 0, frame };
        let (mut again, mut lost) = (None, false);
        for (index, (fault, until)) in faults.enumerate() {
            let did = match fault {
                // Loss is last, after all other disturbances.
                StreamFault::Lose(per_mille) => {
                    let loses = hits(random, per_mille);
                    lost |= loses;
                    loses
                }
                StreamFault::Repeat(per_mille, within) if hits(random, per_mille) => {
                    again = Some(now + SimTime::from_ns(random.u64(0..=within.as_ns())));
                    true
                }
                StreamFault::Reorder(window) if random.bool() => {
                    late.behind = random.u32(1..=window.max(1));
                    late.due = late.due.max(now + OVERTAKEN_WITHIN);
                    true
                }
                StreamFault::Delay(least, most) => {
                    let by = SimTime::from_ns(random.u64(least.as_ns()..=most.as_ns()));
                    late.due = late.due.max(now + by);
                    by > SimTime::ZERO
                }
                StreamFault::Damage(per_mille) if hits(random, per_mille) => {
                    change(&mut late.frame, |data| damage(data, random))
                }
                StreamFault::Cut(per_mille) if hits(random, per_mille) => {
                    change(&mut late.frame, |data| data.truncate(random.usize(0..data.len())))
                }
                StreamFault::Hold => {
                    late.due = late.due.max(until);
                    true
                }
                _ => false,
            };
            if did {
                fired(index);
            }
        }
        if !lost {
            self.queue(late);
            if let Some(due) = again {
                self.queue(Late { due: due.max(late.due), behind: 0, ..late });
            }
        }
    }

    fn queue(&mut self, late: Late) {
        self.order += 1;
        self.late.push(Late { order: self.order, ..late });
    }

    /// Returns the next frame that is due; call it until it returns `None`.
    pub fn pop(&mut self, now: SimTime) -> Option<Frame> {
        let due = self.late.iter().enumerate().filter(|(_, late)| late.due <= now);
        let (index, _) = due.min_by_key(|(_, late)| (late.due, late.order))?;
        let gone = self.late.swap_remove(index);
        for late in self.late.iter_mut().filter(|l| l.behind > 0 && l.order < gone.order) {
            late.behind -= 1;
            if late.behind == 0 {
                late.due = now;
            }
        }
        Some(gone.frame)
    }
}

fn hits(random: &mut Rng, per_mille: u16) -> bool {
    random.u16(0..1000) < per_mille
}

/// Changes the payload. Returns false if it is empty.
fn change(frame: &mut Frame, with: impl FnOnce(&mut Vec<u8>)) -> bool {
    let mut data = frame.data().to_vec();
    if data.is_empty() {
        return false;
    }
    with(&mut data);
    *frame = Frame::new(frame.id(), &data).expect("no longer than it was");
    true
}

/// Flips one to four random bits until the data has changed.
fn damage(data: &mut [u8], random: &mut Rng) {
    let before = data.to_vec();
    while data == before {
        for _ in 0..random.u8(1..=4) {
            let bit = random.usize(0..8 * data.len());
            data[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FOREVER: SimTime = SimTime::from_ms(1_000_000);

    fn ms(ms: u64) -> SimTime {
        SimTime::from_ms(ms)
    }

    /// Sends a hundred numbered frames, one per millisecond. Returns numbers and times of the received frames, and the number
    /// of effects of the fault.
    fn through(fault: StreamFault, until: SimTime) -> (Vec<(u8, SimTime)>, u32) {
        let mut stream = Stream::default();
        let mut random = Rng::with_seed(7);
        let (mut out, mut fired) = (Vec::new(), 0);
        for k in 0..400 {
            let now = ms(k);
            if k < 100 {
                let frame = Frame::standard(0x123, &[k as u8, 0]).unwrap();
                let faults = [(fault, until)].into_iter().filter(|_| now < until);
                stream.push(now, frame, faults, &mut random, |_| fired += 1);
            }
            while let Some(frame) = stream.pop(now) {
                out.push((frame.data().first().copied().unwrap_or(255), now));
            }
        }
        assert!(stream.is_empty());
        (out, fired)
    }

    fn numbers(out: &[(u8, SimTime)]) -> Vec<u8> {
        out.iter().map(|&(number, _)| number).collect()
    }

    #[test]
    fn what_is_lost_is_counted() {
        let (out, fired) = through(StreamFault::Lose(300), FOREVER);
        assert_eq!(out.len() + fired as usize, 100);
        // Three standard deviations of a binomial distribution: 14.
        assert!((16..=44).contains(&fired), "{fired}");
        assert_eq!(through(StreamFault::Lose(0), FOREVER).1, 0);
        assert_eq!(through(StreamFault::Lose(1000), FOREVER).0, []);
    }

    #[test]
    fn what_is_repeated_comes_again_unchanged() {
        let (out, fired) = through(StreamFault::Repeat(500, ms(20)), FOREVER);
        assert_eq!(out.len(), 100 + fired as usize);
        for number in 0..100 {
            assert!((1..=2).contains(&out.iter().filter(|o| o.0 == number).count()));
        }
    }

    #[test]
    fn what_is_overtaken_is_so_by_no_more_than_the_window() {
        let (out, fired) = through(StreamFault::Reorder(3), FOREVER);
        let numbers = numbers(&out);
        assert!(fired > 20 && !numbers.is_sorted());
        let mut sorted = numbers.clone();
        sorted.sort();
        assert_eq!(sorted, (0..100).collect::<Vec<u8>>());
        for (place, &number) in numbers.iter().enumerate() {
            let overtaken_by = numbers[..place].iter().filter(|&&n| n > number).count();
            // The last frames have no later frames that could overtake them.
            assert!(overtaken_by <= 3 || number > 95, "{number} after {overtaken_by} later ones");
        }
    }

    #[test]
    fn a_constant_delay_keeps_the_order() {
        let (out, fired) = through(StreamFault::Delay(ms(30), ms(30)), FOREVER);
        assert_eq!((numbers(&out), fired), ((0..100).collect(), 100));
        assert!(out.iter().all(|&(number, at)| at == ms(u64::from(number) + 30)));
        let (out, _) = through(StreamFault::Delay(ms(0), ms(30)), FOREVER);
        assert!(!numbers(&out).is_sorted() && out.len() == 100);
    }

    #[test]
    fn what_is_held_comes_at_once_and_in_order() {
        let (out, fired) = through(StreamFault::Hold, ms(50));
        assert_eq!((numbers(&out), fired), ((0..100).collect(), 50));
        assert!(out[..50].iter().all(|&(_, at)| at == ms(50)));
        assert_eq!(out[60].1, ms(60));
    }

    #[test]
    fn damage_is_damage_and_a_cut_is_shorter() {
        let mut random = Rng::with_seed(1);
        for fault in [StreamFault::Damage(1000), StreamFault::Cut(1000)] {
            let frame = Frame::standard(0x123, &[1, 2, 3]).unwrap();
            for _ in 0..1000 {
                let mut stream = Stream::default();
                let mut fired = false;
                let faults = std::iter::once((fault, FOREVER));
                stream.push(ms(0), frame, faults, &mut random, |_| fired = true);
                let out = stream.pop(ms(0)).unwrap();
                assert!(fired && out != frame);
                assert_eq!(out.id(), frame.id());
                assert_eq!(out.data().len() < 3, fault == StreamFault::Cut(1000));
            }
            // An empty frame contains nothing to damage.
            let empty = Frame::standard(0x123, &[]).unwrap();
            let mut stream = Stream::default();
            let faults = std::iter::once((fault, FOREVER));
            stream.push(ms(0), empty, faults, &mut random, |_| panic!("nothing happened"));
            assert_eq!(stream.pop(ms(0)), Some(empty));
        }
    }
}
