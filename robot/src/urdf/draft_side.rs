//! Draft of a side file: joints to lock, wheels and feet, and the axes of the body.

use super::bodies::{Bodies, Rigid, merge};
use super::convert::idle_joints;
use super::guess::{self, Axes, End, EndKind, Heading};
use super::joints::position_limits;
use super::model::{Kind, MOVING_MAX, Urdf};
use super::notes::Notes;
use super::side::{Side, direction, turn};
use super::stance::{Stance, Tip};
use super::tree::{Graph, Tree};
use nalgebra::{Point3, Vector3};
use rollwalk_protocol::config::MAX_CHANNELS;

/// Maximum number of rounds in which joints are locked to fit the channels of a controller. A second round is rare: it
/// follows if locks turn wheels into parts of the limb.
const ROUNDS: usize = 4;

/// Guesses about a robot.
pub(super) struct Draft {
    pub rigid: Rigid,
    pub bodies: Bodies,
    /// Locked joints with their positions, in the order of their reasons.
    pub locks: Vec<(usize, f64)>,
    /// Feet and wheels on the ground.
    pub ends: Vec<End>,
    pub heading: Heading,
    /// Joints without a motor that the draft locks.
    pub passive: Vec<usize>,
    /// Joints that the draft locks because a controller has too few channels.
    pub idle: Vec<usize>,
    /// Number of channels if no joint were locked to reduce it.
    pub channels: usize,
}

/// Body of the robot as a contact, for robots without feet and wheels.
#[derive(Clone, Copy)]
pub(super) struct Base {
    pub link: usize,
    pub center_m: Vector3<f64>,
    pub radius_m: f64,
}

/// Joints and wheels for one set of locks.
struct Guess {
    rigid: Rigid,
    bodies: Bodies,
    axles: Vec<usize>,
    ends: Vec<End>,
}

impl Draft {
    /// Guesses everything that a side file has; values of `side` replace guesses.
    pub fn new(
        urdf: &Urdf,
        graph: &Graph,
        tree: &Tree,
        side: &Side,
        notes: &mut Notes<'_>,
    ) -> Self {
        let index =
            |name: &str| tree.order.iter().copied().find(|&joint| urdf.joints[joint].name == name);
        let mut locks: Vec<(usize, f64)> = side
            .locks
            .iter()
            .filter_map(|lock| Some((index(&lock.joint)?, lock.position)))
            .collect();
        let wheels: Vec<usize> = side
            .end_effectors
            .iter()
            .filter_map(|end| index(&end.wheel_joint.as_ref()?.0))
            .collect();
        let is_new = |locks: &[(usize, f64)], joint: usize| {
            !wheels.contains(&joint) && locks.iter().all(|(locked, _)| *locked != joint)
        };
        for (joint, at) in guess::locks(urdf, tree) {
            if is_new(&locks, joint) {
                locks.push((joint, at));
            }
        }
        let site = Site { urdf, graph, tree, wheels: &wheels };
        let up = side.up.unwrap_or_else(|| guess::up(urdf, &site.open(&locks)));
        // Warnings belong only to the final guess.
        let quiet = &mut Notes::new("", "");
        let first = site.guess(&locks, Axes { forward: first_forward(up), up }, quiet);
        let given: Vec<usize> = side.locks.iter().filter_map(|lock| index(&lock.joint)).collect();
        let in_legs = site.slides_in_legs(&locks, &given, &first, up);
        locks.retain(|(joint, _)| given.contains(joint) || !in_legs.contains(joint));
        let first = match in_legs.is_empty() {
            true => first,
            false => site.guess(&locks, Axes { forward: first_forward(up), up }, quiet),
        };
        let passive = guess::passive(urdf, &first.bodies, &first.axles);
        locks.extend(passive.iter().map(|&joint| (joint, urdf.joints[joint].locked_position())));
        let first = site.guess(&locks, Axes { forward: first_forward(up), up }, quiet);
        let mut heading = site.heading(&locks, &first, up);
        heading.axes.forward = side.forward.unwrap_or(heading.axes.forward);
        if heading.axes.forward / 2 == up / 2 {
            heading.axes.forward = first_forward(up);
        }
        if side.forward.is_some() || side.up.is_some() {
            (heading.because, heading.contradicts) = (None, false);
        }
        let second = site.guess(&locks, heading.axes, quiet);
        let channels = second.channels();
        let idle = second.idle_beyond_channels();
        locks.extend(idle.iter().map(|&joint| (joint, urdf.joints[joint].locked_position())));
        let mut last = site.guess(&locks, heading.axes, quiet);
        let mut all_idle = idle;
        for _ in 0..ROUNDS {
            let excess = last.channels().saturating_sub(MAX_CHANNELS);
            if excess == 0 || last.bodies.moving.len() > MOVING_MAX {
                break;
            }
            for joint in last.outermost_joints(excess) {
                all_idle.push(joint);
                locks.push((joint, urdf.joints[joint].locked_position()));
            }
            last = site.guess(&locks, heading.axes, quiet);
        }
        let Guess { rigid, bodies, ends, .. } = site.guess(&locks, heading.axes, notes);
        Self { rigid, bodies, locks, ends, heading, passive, idle: all_idle, channels }
    }

    /// Drops ends above the centre of mass of the standing robot, on which it cannot stand.
    pub fn below_the_body(mut self, stance: &Stance) -> Self {
        let mut centers = stance.tips_m.iter();
        self.ends.retain(|end| {
            let center = centers.next();
            let is_below = |at: &Vector3<f64>| at.z - end.radius_m < stance.com_m.z;
            end.axle.is_some() || center.is_none_or(is_below)
        });
        self
    }
}

/// Model to guess about.
struct Site<'a> {
    urdf: &'a Urdf,
    graph: &'a Graph,
    tree: &'a Tree,
    /// Axles that the side file gives.
    wheels: &'a [usize],
}

impl Site<'_> {
    /// Locked prismatic joints with a stroke that carry a foot or wheel of a guess, except `given` ones. If all its feet and
    /// wheels are on the body, they are sought with free slides.
    fn slides_in_legs(
        &self,
        locks: &[(usize, f64)],
        given: &[usize],
        guess: &Guess,
        up: usize,
    ) -> Vec<usize> {
        let Self { urdf, graph, tree, .. } = *self;
        let slides = |index: usize| {
            let joint = &urdf.joints[index];
            let [lower, upper] = position_limits(urdf, joint);
            joint.kind == Kind::Prismatic
                && joint.mimics.is_none()
                && lower < upper
                && !given.contains(&index)
        };
        if !locks.iter().any(|(index, _)| slides(*index)) {
            return Vec::new();
        }
        let mut links: Vec<_> = guess.ends.iter().map(|end| end.link).collect();
        if guess.ends.iter().all(|end| end.tip.body == 0) {
            let rest: Vec<_> = locks.iter().copied().filter(|(index, _)| !slides(*index)).collect();
            let axes = Axes { forward: first_forward(up), up };
            let free = self.guess(&rest, axes, &mut Notes::new("", ""));
            links = free.ends.iter().map(|end| end.link).collect();
        }
        let mut found = Vec::new();
        for mut link in links {
            while let Some(&index) = tree.order.iter().find(|&&index| graph.ends[index].1 == link) {
                if slides(index) {
                    found.push(index);
                }
                link = graph.ends[index].0;
            }
        }
        found
    }

    /// Bodies with their root axes, and wheels as separate bodies.
    fn open(&self, locks: &[(usize, f64)]) -> Bodies {
        let rigid = Rigid { locked: locks.iter().copied().collect(), ..Rigid::default() };
        merge(self.urdf, self.graph, self.tree, &rigid, &mut Notes::new("", ""))
    }

    fn heading(&self, locks: &[(usize, f64)], guess: &Guess, up: usize) -> Heading {
        let mut rigid = Rigid { locked: locks.iter().copied().collect(), ..Rigid::default() };
        rigid.wheels.clone_from(&guess.rigid.wheels);
        let whole = merge(self.urdf, self.graph, self.tree, &rigid, &mut Notes::new("", ""));
        guess::forward(self.urdf, &self.open(locks), &whole, &guess.ends, up)
    }

    fn guess(&self, locks: &[(usize, f64)], axes: Axes, notes: &mut Notes<'_>) -> Guess {
        let Self { urdf, graph, tree, .. } = *self;
        let mut rigid = Rigid { locked: locks.iter().copied().collect(), ..Rigid::default() };
        let mut axles = guess::axles(urdf, graph, tree, &rigid, &direction(axes.up));
        axles.extend(self.wheels.iter().filter(|wheel| !axles.contains(wheel)).collect::<Vec<_>>());
        rigid.wheels = axles.iter().copied().collect();
        rigid.body_from_root = turn(axes.forward, axes.up);
        let all = merge(urdf, graph, tree, &rigid, &mut Notes::new("", ""));
        let ends = guess::ends(urdf, graph, &all, &rigid);
        // Wheels above the ground are no end effectors; their joints remain joints.
        let grounded: Vec<usize> = ends.iter().filter_map(|end| end.axle).collect();
        rigid.wheels = grounded.iter().chain(self.wheels).copied().collect();
        let bodies = merge(urdf, graph, tree, &rigid, notes);
        let tip = |end: End| {
            let (body, pose) = bodies.places[end.link]?;
            let center_m = (pose * Point3::from(end.center_in_link_m)).coords;
            Some(End { tip: Tip { body, center_m, ..end.tip }, ..end })
        };
        let ends = ends.into_iter().filter_map(tip).collect();
        Guess { rigid, bodies, axles, ends }
    }
}

impl Guess {
    /// Joints and actuated wheels.
    fn channels(&self) -> usize {
        let driven = self.ends.iter().filter(|end| end.kind == EndKind::DrivenWheel);
        self.bodies.moving.len() + driven.count()
    }

    /// Joints of arms and similar limbs, if a controller has too few channels for them.
    fn idle_beyond_channels(&self) -> Vec<usize> {
        // The survey refuses robots with very many joints.
        if self.channels() <= MAX_CHANNELS || self.bodies.moving.len() > MOVING_MAX {
            return Vec::new();
        }
        let tips: Vec<_> = self.ends.iter().map(|end| end.tip.body).collect();
        let idle = idle_joints(&self.bodies, &tips);
        idle.into_iter().map(|index| self.bodies.moving[index].joint).collect()
    }

    /// Joints with the largest number of joints between them and the root.
    fn outermost_joints(&self, count: usize) -> Vec<usize> {
        let mut depths = vec![0_usize; self.bodies.bodies.len()];
        for moving in &self.bodies.moving {
            depths[moving.child] = depths[moving.parent] + 1;
        }
        let mut moving: Vec<_> = self.bodies.moving.iter().collect();
        moving.sort_by_key(|moving| std::cmp::Reverse(depths[moving.child]));
        moving.into_iter().take(count).map(|moving| moving.joint).collect()
    }
}

/// Horizontal axis of the root that is taken as forward at first.
fn first_forward(up: usize) -> usize {
    if up / 2 == 0 { 2 } else { 0 }
}

/// Point of the body below its centre of mass, if the draft has no feet and wheels.
pub(super) fn base(root: usize, draft: &Draft, stance: &Stance) -> Option<Base> {
    if !draft.ends.is_empty() {
        return None;
    }
    let size_m = draft.bodies.size_m().max(0.1);
    let (_, body_from_link) = draft.bodies.places[root]?;
    let below = stance.com_m - Vector3::z() * (0.5 * size_m);
    let center_m = body_from_link.inverse_transform_point(&Point3::from(below)).coords;
    Some(Base { link: root, center_m, radius_m: 0.05 * size_m })
}
