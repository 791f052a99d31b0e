//! Search over the times of lift-off and touch-down, sample by sample.

use super::candidates::Candidates;
use super::duration;
use super::edits::{edits, longer_swings};

/// Smallest relative decrease of the costs for which an edit is kept. Smaller decreases are within the accuracy of a solve.
const GAIN: f64 = 0.005;
/// Maximum number of edits that are tried.
const MOST: usize = 32;
/// Maximum number of edits that are tried from one plan.
const MOST_OF_ONE: usize = 8;

/// Edits the footfalls of the best plan until nothing improves. Stores all plans in `candidates`.
pub fn search(candidates: &mut Candidates<'_>) {
    if candidates.best().is_none() {
        lengthen(candidates);
    }
    let most = candidates.tried() + MOST;
    while let Some(best) = candidates.best() {
        let Some(prices) = candidates.prices(best) else { return };
        let known = candidates.at(best);
        let (motion, cost) = (known.motion().clone(), known.cost());
        let edits = edits(candidates.given(), &motion, &prices);
        let holds = candidates.holds(best);
        // A plan that fails as played may be mended by any edit.
        let promising = edits.into_iter().filter(|edit| !holds || edit.predicted < -GAIN * cost);
        let mut improved = false;
        for edit in promising.take(MOST_OF_ONE) {
            if candidates.tried() >= most || candidates.interrupted() {
                return;
            }
            let found = candidates.solve(motion.with_stance(edit.stance), Some(best));
            improved = found.is_some_and(|found| {
                let is_cheaper = candidates.at(found).cost() < (1.0 - GAIN) * cost;
                (is_cheaper || !holds) && candidates.holds(found)
            });
            if improved {
                break;
            }
        }
        if !improved {
            return;
        }
    }
}

/// Seeks a plan with longer swings, first in the given time and then in the longest.
fn lengthen(candidates: &mut Candidates<'_>) {
    let given = candidates.given();
    let longest = given.stretched_to(*given.frames_allowed().end());
    for stretched in [given, &longest] {
        for stance in longer_swings(given) {
            if candidates.interrupted() {
                return;
            }
            let motion = stretched.with_stance(stance);
            if candidates.solve(motion.clone(), None).is_some() {
                duration::search(candidates, &motion);
                return;
            }
        }
    }
}
