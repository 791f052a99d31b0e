//! Sequence of plans that a robot plays in closed loop: `--play NAME:CYCLES` of a library, joined by its transitions.

use miette::miette;
use rollwalk_planner::motion::Ends;
use rollwalk_planner::plan::{Plan, Status};
use rollwalk_simulate::sequence::Leg;
use rollwalk_terminal::inputs::Library;
use rollwalk_terminal::planning::{Plans, TimedPlan};
use std::collections::VecDeque;
use std::str::FromStr;

/// Maximum number of cycles of a motion.
const CYCLES_MAX: u32 = 100_000;
/// Standing time in SAFE before the first motion and after the last, s.
const STANDS_S: f64 = 0.5;

/// Motion with its number of cycles.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Play {
    /// Name of the motion in the library.
    pub motion: String,
    pub cycles: u32,
}

impl FromStr for Play {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (motion, cycles) = match text.rsplit_once(':') {
            None => (text, 1),
            Some((motion, cycles)) => {
                let cycles = cycles.parse().ok().filter(|cycles| (1..=CYCLES_MAX).contains(cycles));
                let form = "is not of the form MOTION or MOTION:CYCLES, such as walk:5 (1 to 100000 \
                     cycles)";
                (motion, cycles.ok_or(form)?)
            }
        };
        Ok(Self { motion: motion.to_owned(), cycles })
    }
}

/// Step along the motion graph of a library.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Edge {
    /// Index of a motion, and its number of cycles.
    Motion(usize, u32),
    /// Index of a transition.
    Transition(usize),
}

/// Checks that the library contains the motions of a route.
///
/// # Errors
/// Returns an error if a motion is missing.
pub fn check(library: &Library, route: &[Play]) -> miette::Result<()> {
    route.iter().try_for_each(|play| find(library, &play.motion).map(drop))
}

fn find(library: &Library, motion: &str) -> miette::Result<usize> {
    let names: Vec<_> = library.file.motions.iter().map(|motion| motion.name.as_str()).collect();
    names.iter().position(|name| *name == motion).ok_or_else(|| {
        let help = format!("give one of its motions: {}", names.join(", "));
        miette!(help = help, "{} has no motion `{motion}`", library.file.name)
    })
}

/// Returns the plans of a route from SAFE to SAFE, in order.
///
/// # Errors
/// Returns an error if a motion is not in the library, if it cannot be reached, or if a plan failed its checks.
pub fn legs<'p>(
    library: &Library,
    plans: &'p Plans,
    route: &[Play],
) -> miette::Result<Vec<Leg<'p>>> {
    let safe = library.file.safe;
    let mut edges = vec![Edge::Motion(safe, 1)];
    let mut at = safe;
    for Play { motion, cycles } in route {
        let to = find(library, motion)?;
        let repeats = plans.motions[to].plan.motion.ends == Ends::Periodic;
        let (times, cycles) = if repeats { (1, *cycles) } else { (*cycles, 1) };
        for _ in 0..times {
            // A robot in SAFE stays there, and a loop repeats: neither needs a route.
            if at != to || !(repeats || to == safe) {
                append_path(plans, at, to, &mut edges).ok_or_else(|| no_route(library, at, to))?;
            }
            edges.push(Edge::Motion(to, cycles));
            at = to;
        }
    }
    if at != safe {
        append_path(plans, at, safe, &mut edges).ok_or_else(|| no_route(library, at, safe))?;
        edges.push(Edge::Motion(safe, 1));
    }
    let last = edges.len() - 1;
    let legs = edges.into_iter().enumerate().map(|(index, edge)| {
        let planned = match edge {
            Edge::Motion(motion, _) => &plans.motions[motion],
            Edge::Transition(transition) => &plans.transitions[transition].planned,
        };
        let leg = Leg::new(holds(planned)?);
        Ok(match edge {
            Edge::Motion(_, cycles) if index == 0 || index == last => {
                leg.times(cycles).held(STANDS_S)
            }
            Edge::Motion(_, cycles) => leg.times(cycles),
            Edge::Transition(_) => leg,
        })
    });
    legs.collect()
}

/// Appends the shortest path from one motion to another: its transitions, and one cycle of each motion in between. Returns
/// `None` if there is no path.
fn append_path(plans: &Plans, from: usize, to: usize, edges: &mut Vec<Edge>) -> Option<()> {
    // Transition by which the search first reached each motion.
    let mut reached: Vec<Option<usize>> = vec![None; plans.motions.len()];
    let mut queue = VecDeque::from([from]);
    while let Some(at) = queue.pop_front() {
        for (index, transition) in plans.transitions.iter().enumerate() {
            if transition.from == at && reached[transition.to].is_none() {
                reached[transition.to] = Some(index);
                queue.push_back(transition.to);
            }
        }
    }
    let mut back = Vec::new();
    let mut at = to;
    loop {
        let index = reached[at]?;
        back.push(Edge::Transition(index));
        at = plans.transitions[index].from;
        if at == from {
            break;
        }
        back.push(Edge::Motion(at, 1));
    }
    edges.extend(back.into_iter().rev());
    Some(())
}

fn no_route(library: &Library, from: usize, to: usize) -> miette::Report {
    let name = |index: usize| &library.file.motions[index].name;
    miette!(
        help = "add a [[transition]] or [via_safe] to the library file, or a motion in between",
        "no transitions of {} lead from `{}` to `{}`",
        library.file.name,
        name(from),
        name(to)
    )
}

fn holds(planned: &TimedPlan) -> miette::Result<&Plan> {
    let plan = &planned.plan;
    if plan.solve.status != Status::Converged {
        return Err(miette!(
            help = "find the reason with `rollwalk library build`",
            "the plan of `{}` fails its checks",
            plan.motion.name
        ));
    }
    Ok(plan)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_motion_is_named_with_its_cycles() {
        let play = |motion: &str, cycles| Ok(Play { motion: motion.into(), cycles });
        assert_eq!("walk".parse(), play("walk", 1));
        assert_eq!("walk:12".parse(), play("walk", 12));
        assert_eq!("a:b:2".parse(), play("a:b", 2));
        for bad in ["walk:0", "walk:", "walk:x", "walk:100001", "walk:-1"] {
            assert!(bad.parse::<Play>().is_err(), "{bad}");
        }
    }
}
