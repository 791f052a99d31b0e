//! Keyframe `home`: positions of all joints, in the order of the bodies.

use super::numbers::Reader;
use crate::document::Span;
use crate::urdf::elements::tag;
use crate::urdf::model::{ITEMS_MAX, Urdf};
use roxmltree::Node;

/// Name of the keyframe with the standing pose.
const NAME: &str = "home";
/// Maximum number of positions: seven for each joint, the number of a free joint.
const POSITIONS_MAX: usize = 7 * ITEMS_MAX;

/// Positions of the keyframe, handed out joint by joint.
pub struct Home {
    key: Option<(Vec<f64>, Span)>,
    next: usize,
}

impl Home {
    /// Reads the keyframe, if the model has one.
    pub fn read<'a, 'i>(root: Node<'a, 'i>, reader: &mut Reader<'_, '_, '_, 'a, 'i>) -> Self {
        let lists = root.children().filter(|node| node.has_tag_name("keyframe"));
        let mut keys = lists.flat_map(|list| list.children());
        let key = keys.find(|key| key.has_tag_name("key") && key.attribute("name") == Some(NAME));
        let positions = key.and_then(|key| Some((key, key.attribute("qpos")?)));
        let key = positions.and_then(|(key, text)| {
            let words = text.split_whitespace().take(POSITIONS_MAX);
            let finite =
                |word: &str| word.parse().ok().filter(|position: &f64| position.is_finite());
            let parsed: Option<Vec<f64>> = words.map(finite).collect();
            if parsed.is_none() {
                let message =
                    format!("key `{NAME}`: `qpos` contains a word that is not a finite number");
                reader.fault(
                    key,
                    message,
                    "write the positions of all joints, separated by blanks",
                );
            }
            Some((parsed?, tag(key)))
        });
        Self { key, next: 0 }
    }

    /// First of the next `count` positions, which belong to one joint.
    pub fn take(&mut self, count: usize) -> Option<f64> {
        let at = self.next;
        self.next += count;
        self.key.as_ref()?.0.get(at).copied()
    }

    /// Removes the positions from the joints if their number is not that of the model.
    pub fn check(self, urdf: &mut Urdf, reader: &mut Reader<'_, '_, '_, '_, '_>) {
        let Some((positions, span)) = self.key else { return };
        if positions.len() == self.next {
            return;
        }
        urdf.joints.iter_mut().for_each(|joint| joint.home = None);
        reader.notes.warn(&span, format_args!(
            "key `{NAME}`: `qpos` has {} numbers, but the joints need {}, so the import ignores the pose; let MuJoCo write the whole model",
            positions.len(),
            self.next
        ));
    }
}
