//! Window of four consecutive frames; [player](crate::player) and [stream](crate::stream) interpolate between the middle two.

/// Frames that define a segment of a curve.
pub(crate) const WINDOW: usize = 4;

/// Frames k−1, k, k+1, k+2. A ring buffer, so that no frame is ever copied.
#[derive(Clone, Debug)]
pub(crate) struct Window<T> {
    frames: [T; WINDOW],
    /// Place of the oldest.
    first: usize,
}

impl<T: Copy> Window<T> {
    /// A curve that rests in a frame.
    pub fn resting(frame: T) -> Self {
        Self { frames: [frame; WINDOW], first: 0 }
    }

    /// Frame k−1, to be overwritten with frame k+3 before [`turn`](Self::turn).
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

    /// The frames, the oldest first.
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
