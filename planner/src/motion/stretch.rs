//! Motions with other times: another duration, or other footfalls.

use super::Motion;
use rollwalk_protocol::library::{MAX_CLIP_FRAMES, RATE_HZ};

/// Shortest duration of a motion, s.
const SHORTEST_S: f64 = 0.1;

impl Motion {
    /// Returns the number of library frames in the duration.
    pub fn frames(&self) -> usize {
        (self.duration_s * f64::from(RATE_HZ)).round() as usize
    }

    /// Returns the numbers of library frames that the timing permits for the duration.
    pub fn frames_allowed(&self) -> std::ops::RangeInclusive<usize> {
        let range = self.timing.range(self.frames());
        let shortest = (SHORTEST_S * f64::from(RATE_HZ)).ceil() as usize;
        let shortest = shortest.min(self.frames());
        (*range.start()).max(shortest)..=(*range.end()).min(MAX_CLIP_FRAMES as usize)
    }

    /// Returns the motion with a duration of a number of library frames. All times are stretched alike.
    pub fn stretched_to(&self, frames: usize) -> Self {
        let duration_s = frames as f64 / f64::from(RATE_HZ);
        self.stretched(duration_s)
    }

    /// Returns the motion with another duration. All times are stretched alike.
    pub fn stretched(&self, duration_s: f64) -> Self {
        let factor = duration_s / self.duration_s;
        let mut motion = Self { duration_s, ..self.clone() };
        motion.targets.iter_mut().for_each(|target| target.at_s *= factor);
        for limit in &mut motion.heights {
            limit.from_s *= factor;
            limit.to_s *= factor;
        }
        motion
    }

    /// Returns the motion with other footfalls on the same samples.
    pub fn with_stance(&self, stance: Vec<Vec<bool>>) -> Self {
        Self { stance, ..self.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::Ends;
    use crate::test_robots;

    #[test]
    fn all_times_of_a_motion_are_stretched() {
        let robot = &test_robots::all()[0];
        let mut motion = test_robots::motion(robot, Ends::Periodic);
        motion.targets = test_robots::targets();
        motion.heights = test_robots::heights();
        let longer = motion.stretched_to(2 * motion.frames());
        assert_eq!((longer.duration_s, longer.frames()), (1.0, 60));
        let twice = |x: f64| 2.0 * x;
        assert!(longer.targets.iter().zip(&motion.targets).all(|(b, a)| b.at_s == twice(a.at_s)));
        assert!(longer.heights.iter().zip(&motion.heights).all(|(b, a)| b.to_s == twice(a.to_s)));
        assert_eq!(longer.stretched_to(motion.frames()), motion);
    }

    #[test]
    fn a_motion_stays_within_the_frames_of_a_library() {
        let robot = &test_robots::all()[0];
        let motion = test_robots::motion(robot, Ends::Periodic);
        assert_eq!(motion.frames_allowed(), 21..=42);
        let short = motion.stretched(0.1);
        assert_eq!(short.frames_allowed(), 6..=8);
        let long = motion.stretched(60.0);
        assert_eq!(*long.frames_allowed().end(), MAX_CLIP_FRAMES as usize);
    }
}
