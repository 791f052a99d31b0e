//! Cursor that moves through the motion graph and chooses the next 60 Hz frame.
//!
//! The cursor plays motions, repeats loops and takes transitions towards the goal node:
//!
//! - A looping motion repeats until a goal elsewhere is set. It is left only at the exit frame of the transition that leads
//!   there. A finite motion is left at its final frame.
//! - When a finite motion ends and no goal is set, the cursor returns to SAFE and stays there.
//! - The first frame of a transition is the exit frame of the motion before it, and its final frame is the entry frame of the
//!   motion after it. Neither is played twice.
//!
//! The blocks in which the cursor will enter the next two clips are checked in advance: all at once when a goal is set, otherwise
//! a portion in each frame.

use rollwalk_protocol::library::{
    ClipCursor, ClipId, Edge, Entry, Library, LibraryReadError, MAX_MOTIONS, NodeId,
};

/// Position in the motion graph.
#[derive(Clone, Copy, Debug)]
enum GraphPosition {
    Motion(NodeId),
    Transition(Edge),
}

/// Reason why a goal is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GoalError {
    /// Goal that no route leads to.
    Unreachable,
}

/// Position in the motion graph of a library, with its goal.
///
/// The cursor stores no reference: the caller passes the library of [`GraphCursor::start`] to every call.
#[derive(Clone, Debug)]
pub struct GraphCursor {
    place: GraphPosition,
    cursor: ClipCursor,
    /// Goal that is not reached yet.
    goal: Option<NodeId>,
    /// Transition out of the current motion or, during a transition, out of the motion at its end.
    onward: Option<Edge>,
    /// Entries into the next two clips.
    entries: [Option<Entry>; 2],
}

impl GraphCursor {
    /// Creates a cursor at rest in the SAFE pose.
    pub fn start(library: &Library<'_>) -> Result<Self, LibraryReadError> {
        let safe = library.safe_node();
        let frames = library.clip(safe.clip()).ok_or(LibraryReadError)?.frames;
        let cursor = ClipCursor::new(library, safe.clip(), frames.saturating_sub(1))?;
        let place = GraphPosition::Motion(safe);
        Ok(Self { place, cursor, goal: None, onward: None, entries: [None; 2] })
    }

    /// Current clip and frame.
    pub fn at(&self) -> (ClipId, u16) {
        (self.cursor.clip(), self.cursor.frame())
    }

    /// Writes the channels' values of the current frame, rad or rad/s.
    pub fn frame_into(
        &self,
        library: &Library<'_>,
        out: &mut [f32],
    ) -> Result<(), LibraryReadError> {
        self.cursor.frame_into(library, out)
    }

    /// Writes the torques of the current frame, N·m.
    pub fn torques_into(
        &self,
        library: &Library<'_>,
        out: &mut [f32],
    ) -> Result<(), LibraryReadError> {
        self.cursor.torques_into(library, out)
    }

    /// Sets the goal. A finite motion that is being played and becomes the goal is played once more.
    pub fn set_goal(&mut self, library: &Library<'_>, goal: NodeId) -> Result<(), GoalError> {
        let (from, arriving) = match self.place {
            GraphPosition::Motion(node) => (node, false),
            GraphPosition::Transition(edge) => (edge.to, true),
        };
        if from == goal && (arriving || self.stays_at(library, goal)) {
            // The cursor is at the goal or on the way to it, so only another goal is dropped.
            self.goal = arriving.then_some(goal);
        } else {
            library.next_hop(from, goal).ok_or(GoalError::Unreachable)?;
            self.goal = Some(goal);
        }
        self.update_next(library);
        // The cursor may leave with the next frame, or arrive with it and leave with the one after.
        self.entries.iter_mut().flatten().for_each(|entry| entry.check_all(library));
        Ok(())
    }

    /// Returns true if all motions that the cursor would enter on its way to a goal are permitted.
    pub fn may_enter(
        &self,
        library: &Library<'_>,
        goal: NodeId,
        permitted: impl Fn(NodeId) -> bool,
    ) -> bool {
        let (mut node, arriving) = match self.place {
            GraphPosition::Motion(node) => (node, false),
            GraphPosition::Transition(edge) => (edge.to, true),
        };
        if node == goal && (arriving || self.stays_at(library, goal)) {
            return true;
        }
        // Routes visit no node twice.
        for _ in 0..MAX_MOTIONS {
            let edge = library.next_hop(node, goal).and_then(|edge| library.edge(edge));
            // Without a route, the goal is refused anyway.
            let Some(edge) = edge else { return true };
            node = edge.to;
            if !permitted(node) {
                return false;
            }
            if node == goal {
                break;
            }
        }
        true
    }

    /// Determines the next transition and entries.
    // Rarely called: kept out of line, so that the image contains it once.
    #[inline(never)]
    fn update_next(&mut self, library: &Library<'_>) {
        let (node, arrival) = match self.place {
            GraphPosition::Motion(node) => (node, None),
            GraphPosition::Transition(edge) => (edge.to, Some((edge.to.clip(), edge.entry_frame))),
        };
        let arrives = arrival.is_some() && self.goal == Some(node);
        let goal = match self.goal.filter(|_| !arrives) {
            // A motion that ends is followed by SAFE.
            None => (!self.stays_at(library, node)).then_some(library.safe_node()),
            goal => goal,
        };
        self.onward = goal.and_then(|goal| library.edge(library.next_hop(node, goal)?));
        let departure = self.onward.map(|edge| (edge.clip, 0));
        let now = self.entry(library, arrival.or(departure));
        let then = self.entry(library, arrival.and(departure));
        self.entries = [now, then];
    }

    /// Position from which playback of a clip begins, with the blocks that were already checked.
    // Rarely called: kept out of line, so that the image contains it once.
    #[inline(never)]
    fn entry(&self, library: &Library<'_>, place: Option<(ClipId, u16)>) -> Option<Entry> {
        let (clip, frame) = place?;
        let known = self.entries.iter().flatten().find(|entry| entry.is_at(clip, frame));
        known.copied().or_else(|| Entry::new(library, clip, frame).ok())
    }

    /// Validates one more portion of the blocks at which playback may enter the next clips.
    fn check_ahead(&mut self, library: &Library<'_>) {
        if self.cursor.is_checked_ahead() {
            let _ = self.entries.iter_mut().flatten().any(|entry| entry.check_a_portion(library));
        }
    }

    /// Enters another clip, whose block has usually been checked.
    fn enter(
        &mut self,
        library: &Library<'_>,
        clip: ClipId,
        frame: u16,
    ) -> Result<(), LibraryReadError> {
        let entry = self.entry(library, Some((clip, frame))).ok_or(LibraryReadError)?;
        self.cursor = ClipCursor::enter(library, &entry)?;
        Ok(())
    }

    /// Number of frames until the goal is reached; 0 without a goal.
    pub fn frames_to_goal(&self, library: &Library<'_>) -> u16 {
        let Some(goal) = self.goal else { return 0 };
        let frame = self.cursor.frame();
        let frames = |clip| library.clip(clip).map_or(1, |clip| clip.frames);
        let (mut node, mut at, mut sum) = match self.place {
            GraphPosition::Motion(node) => (node, frame, 0),
            GraphPosition::Transition(edge) => {
                let left = frames(edge.clip).saturating_sub(frame.saturating_add(1));
                if edge.to == goal {
                    return left;
                }
                (edge.to, edge.entry_frame, left)
            }
        };
        // Routes visit no node twice.
        for _ in 0..MAX_MOTIONS {
            let edge = library.next_hop(node, goal).and_then(|edge| library.edge(edge));
            let Some(edge) = edge else { break };
            // One more pass of the loop when the exit frame has just been passed.
            let round = if edge.exit_frame < at { frames(node.clip()) } else { 0 };
            let wait = edge.exit_frame.saturating_add(round).saturating_sub(at);
            sum = sum.saturating_add(wait).saturating_add(frames(edge.clip).saturating_sub(1));
            (node, at) = (edge.to, edge.entry_frame);
            if node == goal {
                break;
            }
        }
        sum
    }

    /// True if the cursor stays at a node until a goal is set.
    fn stays_at(&self, library: &Library<'_>, node: NodeId) -> bool {
        node == library.safe_node() || library.clip(node.clip()).is_some_and(|clip| clip.looping)
    }

    /// True if the cursor rests in the SAFE pose and will stay there.
    pub fn rests_in_safe(&self, library: &Library<'_>) -> bool {
        // In a looping SAFE motion all frames are equal, which the validator checks.
        let still = self.cursor.at_last_frame() || self.cursor.loops();
        match self.place {
            GraphPosition::Motion(node) => {
                node == library.safe_node() && self.goal.is_none() && still
            }
            GraphPosition::Transition(_) => false,
        }
    }

    /// Advances to the next frame. Fails only if `library` is not the one that was validated.
    pub fn advance(&mut self, library: &Library<'_>) -> Result<(), LibraryReadError> {
        let clip = self.cursor.clip();
        match self.place {
            GraphPosition::Motion(node) => self.advance_motion(library, node)?,
            GraphPosition::Transition(edge) => self.advance_transition(library, edge)?,
        }
        // Entering another clip is enough work for one frame.
        if self.cursor.clip() == clip {
            self.check_ahead(library);
        }
        Ok(())
    }

    fn advance_transition(
        &mut self,
        library: &Library<'_>,
        edge: Edge,
    ) -> Result<(), LibraryReadError> {
        self.cursor.advance(library)?;
        if self.cursor.at_last_frame() {
            // The transition's last frame equals the entry frame of the target.
            self.enter(library, edge.to.clip(), edge.entry_frame)?;
            self.place = GraphPosition::Motion(edge.to);
            if self.goal == Some(edge.to) {
                self.goal = None;
            }
            self.update_next(library);
        }
        Ok(())
    }

    fn advance_motion(
        &mut self,
        library: &Library<'_>,
        node: NodeId,
    ) -> Result<(), LibraryReadError> {
        let stays = node == library.safe_node() || self.cursor.loops();
        let ended = self.cursor.at_last_frame() && !stays;
        if ended && self.goal.is_none() {
            self.goal = Some(library.safe_node());
        }
        if self.goal.is_some() {
            let edge = self.onward.ok_or(LibraryReadError)?;
            if edge.exit_frame == self.cursor.frame() {
                // Frame 0 of the transition equals the present frame.
                self.enter(library, edge.clip, 0)?;
                self.place = GraphPosition::Transition(edge);
                self.update_next(library);
                return self.advance_transition(library, edge);
            }
        }
        // At the end of SAFE this has no effect: every other motion that has ended was left above.
        self.cursor.advance(library).map(|_| ())
    }
}
