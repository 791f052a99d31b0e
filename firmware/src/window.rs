//! Window of four consecutive frames. [Player](crate::player) and [stream](crate::stream) interpolate between the middle two.

/// Number of frames that define a segment of a curve.
pub(crate) const WINDOW: usize = 4;

/// Frames k−1, k, k+1 and k+2, in a ring buffer so that no frame is copied.
#[derive(Clone, Debug)]
pub(crate) struct Window<T> {
    frames: [T; WINDOW],
    /// Index of the oldest frame.
    first: usize,
}

impl<T: Copy> Window<T> {
    /// Creates a window for a curve that rests in a frame.
    pub fn resting(frame: T) -> Self {
        Self { frames: [frame; WINDOW], first: 0 }
    }

    /// Returns frame k−1, to be overwritten with frame k+3 before [`turn`](Self::turn).
    pub fn oldest(&mut self) -> &mut T {
        let [a, b, c, d] = &mut self.frames;
        match self.first {
            1 => b,
            2 => c,
            3 => d,
            _ => a,
        }
    }

    /// Makes the oldest frame the newest.
    pub fn turn(&mut self) {
        self.first = self.first.wrapping_add(1) % WINDOW;
    }

    /// Frames, the oldest first.
    pub fn frames(&self) -> [&T; WINDOW] {
        let [a, b, c, d] = &self.frames;
        match self.first {
            1 => [b, c, d, a],
            2 => [c, d, a, b],
            3 => [d, a, b, c],
            _ => [a, b, c, d],
        }
    }
}
