//! Second half of validation: motion graph, command codes, safe pose and names.

use super::container::u16_at;
use super::cursor::ClipCursor;
use super::records::CodeRecord;
use super::reject::{Reject, RejectReason, Section};
use super::routes::{Arc, hops_to};
use super::validate::Validation;
use super::view::Track;
use super::{MAX_MOTIONS, MAX_NAME, MAX_TRANSITIONS, NodeId};

impl Validation<'_> {
    /// Checks that transitions join existing motions without a gap, at frames at which a motion may be left or entered.
    pub fn edges(&self) -> Result<(), Reject> {
        for id in self.library.edges() {
            let fail = |why| self.fail(Section::Edges, usize::from(id.0), why);
            let bad = fail(RejectReason::BadEdge { edge: id });
            let edge = self.library.edge(id).ok_or(bad)?;
            let motions = self.library.node_count();
            if edge.from.0 >= motions || edge.to.0 >= motions || edge.from == edge.to {
                return Err(bad);
            }
            let source = self.library.clip(edge.from.clip()).ok_or(bad)?;
            let target = self.library.clip(edge.to.clip()).ok_or(bad)?;
            let own = self.library.clip(edge.clip).ok_or(bad)?;
            if edge.exit_frame >= source.frames || edge.entry_frame >= target.frames {
                return Err(bad);
            }
            let (exit_frame, last) = (edge.exit_frame, source.frames.saturating_sub(1));
            if !source.looping && exit_frame != last {
                return Err(fail(RejectReason::ExitBeforeEnd { edge: id, exit_frame, last }));
            }
            let own_last = own.frames.saturating_sub(1);
            let ends = [
                ("first frame", "first torque", 0, edge.from.clip(), edge.exit_frame),
                ("last frame", "last torque", own_last, edge.to.clip(), edge.entry_frame),
            ];
            for (end, torque, frame, joined, joined_frame) in ends {
                let found = ClipCursor::new(&self.library, edge.clip, frame).map_err(|_| bad)?;
                let expected =
                    ClipCursor::new(&self.library, joined, joined_frame).map_err(|_| bad)?;
                for &track in self.library.tracks() {
                    let pairs = found.track_quanta(track).zip(expected.track_quanta(track));
                    let different =
                        |&(_, (found, expected)): &(usize, (i16, i16))| found != expected;
                    if let Some((channel, (found, expected))) = pairs.enumerate().find(different) {
                        let value = |quanta| self.library.track_value(track, channel, quanta);
                        return Err(fail(RejectReason::EndMismatch {
                            edge: id,
                            end: if track == Track::Values { end } else { torque },
                            channel: channel as u8,
                            found: value(i32::from(found)).unwrap_or(f32::NAN),
                            expected: value(i32::from(expected)).unwrap_or(f32::NAN),
                        }));
                    }
                }
            }
        }
        Ok(())
    }

    /// Checks that every motion has a route to SAFE, and that the table contains the shortest routes.
    pub fn routes(&self) -> Result<(), Reject> {
        let cell = |from: NodeId, to: NodeId| {
            usize::from(from.0) * usize::from(self.library.node_count()) + usize::from(to.0)
        };
        let safe = self.library.safe_node();
        for node in self.library.nodes() {
            if node != safe && self.library.next_hop(node, safe).is_none() {
                let why = RejectReason::NoRouteToSafe { node, safe };
                return Err(self.fail(Section::Routes, cell(node, safe), why));
            }
        }
        let mut arcs = [Arc { from: 0, to: 0, frames: 0 }; MAX_TRANSITIONS];
        let edges = self.library.edges().filter_map(|id| self.library.edge(id));
        let mut count = 0;
        for (slot, edge) in arcs.iter_mut().zip(edges) {
            let frames = self.library.clip(edge.clip).map_or(0, |clip| clip.frames);
            *slot = Arc { from: edge.from.0, to: edge.to.0, frames };
            count += 1;
        }
        let arcs = arcs.get(..count).unwrap_or_default();
        let stored = self.library.payload(Section::Routes).unwrap_or_default();
        for to in self.library.nodes() {
            let hops = hops_to(to.0, self.library.node_count(), arcs);
            for (from, hop) in self.library.nodes().zip(hops) {
                if stored.get(cell(from, to)) != Some(&hop) {
                    let why = RejectReason::BadRoute { from, to };
                    return Err(self.fail(Section::Routes, cell(from, to), why));
                }
            }
        }
        Ok(())
    }

    pub fn codes(&self) -> Result<(), Reject> {
        let motions = self.library.node_count();
        let mut seen = [false; MAX_MOTIONS];
        let mut previous = None;
        for i in 0..usize::from(motions) {
            let fail = |why| self.fail(Section::Codes, i, why);
            let record: CodeRecord = self
                .library
                .record(Section::Codes, i)
                .ok_or_else(|| fail(RejectReason::BadRecord { record: i as u32 }))?;
            let CodeRecord { code, node } = record;
            if node >= motions {
                return Err(fail(RejectReason::CodeWithoutMotion { code, node, motions }));
            }
            if previous.is_some_and(|previous| previous >= code) {
                return Err(fail(RejectReason::DuplicateCode { code }));
            }
            previous = Some(code);
            if let Some(seen) = seen.get_mut(usize::from(node)) {
                if *seen {
                    return Err(fail(RejectReason::MotionWithTwoCodes { node: NodeId(node) }));
                }
                *seen = true;
            }
        }
        Ok(())
    }

    /// Checks that the safe motion rests in the safe pose: in its last frame, or in all frames if it loops.
    pub fn safe_pose(&self) -> Result<(), Reject> {
        let fail = |channel| {
            self.fail(
                Section::SafePose,
                channel,
                RejectReason::SafeNotAtRest { channel: channel as u8 },
            )
        };
        let clip = self.library.safe_node().clip();
        let info = self.library.clip(clip).ok_or_else(|| fail(0))?;
        let start = if info.looping { 0 } else { info.frames.saturating_sub(1) };
        let mut cursor = ClipCursor::new(&self.library, clip, start).map_err(|_| fail(0))?;
        let pose = self.library.payload(Section::SafePose).ok_or_else(|| fail(0))?;
        loop {
            for (channel, (quanta, record)) in cursor.quanta().zip(&self.records).enumerate() {
                let posed = u16_at(pose, 2 * channel).map(|bits| bits as i16);
                if posed != Some(quanta) || (record.kind == 1 && quanta != 0) {
                    return Err(fail(channel));
                }
            }
            if cursor.at_last_frame() {
                return Ok(());
            }
            cursor.advance(&self.library).map_err(|_| fail(0))?;
        }
    }

    /// Checks the names. Each name must have a valid length and follow a byte with that length. The section must have no other
    /// data.
    pub fn names(&self) -> Result<(), Reject> {
        let mut rest = self.library.payload(Section::Names).unwrap_or_default();
        let mut last = NodeId(0);
        for node in self.library.nodes() {
            let fail = || self.fail(Section::Names, 0, RejectReason::BadName { node });
            let name = self.library.name(node).ok_or_else(fail)?;
            let is_sound = !name.is_empty() && name.len() <= MAX_NAME;
            let behind = rest.get(1_usize.saturating_add(name.len())..);
            let length = rest.first().map(|&length| usize::from(length));
            rest = behind.filter(|_| is_sound && length == Some(name.len())).ok_or_else(fail)?;
            last = node;
        }
        if rest.is_empty() {
            Ok(())
        } else {
            Err(self.fail(Section::Names, 0, RejectReason::BadName { node: last }))
        }
    }
}
