//! Tree of links and joints: resolves names, finds the root, and orders joints so that parents come first.

use super::model::{Kind, Solid, Urdf};
use super::notes::Notes;
use crate::document::alternatives;
use std::collections::HashMap;

/// Names of links that represent the ground.
const GROUND: [&str; 5] = ["world", "map", "odom", "universe", "ground"];

/// Graph of a URDF's joints, by indices.
#[derive(Debug)]
pub(super) struct Graph {
    pub link_index: HashMap<String, usize>,
    /// Parent and child link of every joint.
    pub ends: Vec<(usize, usize)>,
    /// Joints that leave a link, in file order.
    pub leaving: Vec<Vec<usize>>,
    /// Links that no joint leads to, in file order.
    pub roots: Vec<usize>,
}

/// Tree of joints below a root.
#[derive(Debug)]
pub(super) struct Tree {
    pub root: usize,
    /// Joints of the tree, limb by limb, parents first.
    pub order: Vec<usize>,
}

/// Resolves names. Notes duplicates, unknown names and loops.
pub(super) fn graph(urdf: &Urdf, notes: &mut Notes<'_>) -> Option<Graph> {
    let mut link_index = HashMap::new();
    for (index, link) in urdf.links.iter().enumerate() {
        if link_index.insert(link.name.clone(), index).is_some() {
            let message = format!("the model has two links `{}`", link.name);
            notes.fault(link.span.clone(), message, "second", "give every link its own name");
        }
    }
    let mut names = HashMap::new();
    let mut carrier: HashMap<usize, usize> = HashMap::new();
    let mut ends = Vec::new();
    let mut leaving = vec![Vec::new(); urdf.links.len()];
    for (index, joint) in urdf.joints.iter().enumerate() {
        if names.insert(&joint.name, index).is_some() {
            let message = format!("the model has two joints `{}`", joint.name);
            notes.fault(joint.span.clone(), message, "second", "give every joint its own name");
        }
        let [parent, child] =
            [("parent", &joint.parent), ("child", &joint.child)].map(|(end, name)| {
                let found = link_index.get(name).copied();
                if found.is_none() {
                    let message =
                        format!("joint `{}`: {end} link `{name}` does not exist", joint.name);
                    let known = urdf.links.iter().take(40).map(|link| link.name.as_str());
                    notes.fault(
                        joint.span.clone(),
                        message,
                        "unknown link",
                        alternatives(name, known),
                    );
                }
                found
            });
        let (Some(parent), Some(child)) = (parent, child) else { continue };
        if let Some(other) = carrier.insert(child, index) {
            let message = format!(
                "link `{}` is the child of two joints, `{}` and `{}`",
                joint.child, urdf.joints[other].name, joint.name
            );
            let help = "remove one of the two joints, and fix the links that only this joint moves: robots are trees";
            notes.fault(joint.span.clone(), message, "closes a loop", help);
        }
        ends.push((parent, child));
        leaving[parent].push(index);
    }
    if !notes.faults.is_empty() {
        return None;
    }
    let roots: Vec<_> = (0..urdf.links.len()).filter(|link| !carrier.contains_key(link)).collect();
    let graph = Graph { link_index, ends, leaving, roots };
    let mut reached = vec![false; urdf.links.len()];
    for &root in &graph.roots {
        reached[root] = true;
        graph.tree(root).order.iter().for_each(|&joint| reached[graph.ends[joint].1] = true);
    }
    // From every link, parents lead to a root or around a loop.
    if let Some(link) = reached.iter().position(|reached| !reached) {
        let link = &urdf.links[link];
        let message = format!("link `{}` belongs to a loop of joints without a root", link.name);
        let help = "cut the loop: a robot is a tree with one root, the body";
        notes.fault(link.span.clone(), message, "not part of a tree", help);
        return None;
    }
    Some(graph)
}

impl Graph {
    /// Tree below a root. The search ends, because each link is the child of one joint.
    pub fn tree(&self, root: usize) -> Tree {
        let mut order = Vec::new();
        let mut open: Vec<usize> = self.leaving[root].iter().rev().copied().collect();
        while let Some(joint) = open.pop() {
            order.push(joint);
            open.extend(self.leaving[self.ends[joint].1].iter().rev());
        }
        Tree { root, order }
    }

    /// Root with the most links, without the links that place the robot in the world: those called `world` or similar, and
    /// massless links with a single moving joint.
    pub fn likely_root(&self, urdf: &Urdf) -> usize {
        let size = |root: &usize| self.tree(*root).order.len();
        // Of equals, the first.
        let largest = self.roots.iter().rev().copied().max_by_key(size);
        let mut root = largest.unwrap_or(0);
        loop {
            let link = &urdf.links[root];
            let &[joint] = &self.leaving[root][..] else { return root };
            let ground = GROUND.contains(&link.name.to_ascii_lowercase().as_str());
            let empty =
                link.mass.is_none() && link.shapes.iter().all(|shape| shape.solid == Solid::Mesh);
            if !(ground || empty && urdf.joints[joint].kind != Kind::Fixed) {
                return root;
            }
            root = self.ends[joint].1;
        }
    }
}

/// Tree of the robot, below the link that the side file names or below the only root.
pub(super) fn choose(
    urdf: &Urdf,
    graph: &Graph,
    root: Option<usize>,
    notes: &mut Notes<'_>,
) -> Option<Tree> {
    if root.is_none() && graph.roots.len() > 1 {
        let names: Vec<_> = graph
            .roots
            .iter()
            .take(10)
            .map(|&root| format!("`{}`", urdf.links[root].name))
            .collect();
        let span = urdf.links[graph.roots[1]].span.clone();
        let message = format!("the robot has {} roots: {}", graph.roots.len(), names.join(", "));
        let help = "name the body as `root` in the side file, or join the parts with fixed joints";
        notes.fault(span, message, "no joint leads to it", help);
        return None;
    }
    let tree = graph.tree(root.unwrap_or_else(|| graph.likely_root(urdf)));
    let mut kept = vec![false; urdf.links.len()];
    kept[tree.root] = true;
    tree.order.iter().for_each(|&joint| kept[graph.ends[joint].1] = true);
    for (index, link) in urdf.links.iter().enumerate().filter(|(index, _)| !kept[*index]) {
        let lost = link.mass.map_or(String::new(), |mass| format!(" with {} kg", mass.mass_kg));
        if graph.roots.contains(&index) || !lost.is_empty() {
            let root = &urdf.links[tree.root].name;
            notes.warn(
                &link.span,
                format_args!("link `{}`{lost} is dropped, because no joint leads from the root `{root}` to this link; to keep the link, name another `root` in the side file", link.name),
            );
        }
    }
    Some(tree)
}
