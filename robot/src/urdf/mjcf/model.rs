//! Settings of a whole model: `<compiler>`, and classes of defaults.

use roxmltree::{Attribute, Node};
use std::collections::HashMap;

/// Name of the default class.
const MAIN: &str = "main";
/// Elements of actuators, which share their defaults.
const ACTUATORS: [&str; 5] = ["general", "motor", "position", "velocity", "intvelocity"];
/// Maximum depth of nested classes.
const DEPTH_MAX: usize = 16;

/// Bodies whose masses the geoms determine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FromGeoms {
    Never,
    /// Bodies without `<inertial>`.
    Missing,
    Always,
}

/// Class of defaults.
struct Class<'a, 'i> {
    parent: Option<&'a str>,
    nodes: Vec<Node<'a, 'i>>,
    /// Attributes by element and name.
    attributes: HashMap<(&'a str, &'a str), Attribute<'a, 'i>>,
}

impl Class<'_, '_> {
    /// Lists the attributes. The last `<default>` and the first element in it take precedence.
    fn list(&mut self) {
        for element in self.nodes.iter().rev().flat_map(|node| node.children()) {
            let tag = shared(element.tag_name().name());
            for attribute in element.attributes().filter(|a| a.namespace().is_none()) {
                self.attributes.entry((tag, attribute.name())).or_insert(attribute);
            }
        }
    }
}

/// Element whose defaults hold for a tag.
fn shared(tag: &str) -> &str {
    if ACTUATORS.contains(&tag) { ACTUATORS[0] } else { tag }
}

/// Settings and defaults of a model.
pub struct Model<'a, 'i> {
    /// True if angles are in degrees.
    pub degrees: bool,
    /// Axes of Euler angles. Axes with small letters turn with the body.
    pub euler: &'a str,
    pub from_geoms: FromGeoms,
    /// True if a range is a limit by default.
    pub autolimits: bool,
    /// First and last group of geoms that have mass.
    pub groups: [f64; 2],
    /// Least mass of a body, kg, and least principal moment of inertia, kg·m².
    pub bounds: [f64; 2],
    /// True if impossible moments of inertia become equal.
    pub balances: bool,
    /// `<compiler>` with global coordinates.
    pub global: Option<Node<'a, 'i>>,
    /// `<compiler>` that scales all masses.
    pub scaled: Option<Node<'a, 'i>>,
    classes: HashMap<&'a str, Class<'a, 'i>>,
}

impl<'a, 'i> Model<'a, 'i> {
    /// Reads settings and defaults of the model below `root`.
    pub fn new(root: Node<'a, 'i>) -> Self {
        let mut model = Self {
            degrees: true,
            euler: "xyz",
            from_geoms: FromGeoms::Missing,
            autolimits: true,
            groups: [0.0, 5.0],
            bounds: [f64::NEG_INFINITY; 2],
            balances: false,
            global: None,
            scaled: None,
            classes: HashMap::new(),
        };
        for compiler in root.children().filter(|node| node.has_tag_name("compiler")) {
            model.set(compiler);
        }
        for default in root.children().filter(|node| node.has_tag_name("default")) {
            model.add_classes(default);
        }
        model.classes.values_mut().for_each(Class::list);
        model
    }

    fn set(&mut self, compiler: Node<'a, 'i>) {
        let is = |name: &str, value: &str| compiler.attribute(name) == Some(value);
        if let Some(angle) = compiler.attribute("angle") {
            self.degrees = angle != "radian";
        }
        if let Some(order) = compiler.attribute("eulerseq") {
            self.euler = order;
        }
        match compiler.attribute("inertiafromgeom") {
            Some("true") => self.from_geoms = FromGeoms::Always,
            Some("false") => self.from_geoms = FromGeoms::Never,
            _ => {}
        }
        if is("autolimits", "false") {
            self.autolimits = false;
        }
        if let Some(range) = compiler.attribute("inertiagrouprange") {
            let mut words = range.split_whitespace().filter_map(|word| word.parse().ok());
            if let (Some(from), Some(to)) = (words.next(), words.next()) {
                self.groups = [from, to];
            }
        }
        let number = |name: &str| compiler.attribute(name)?.trim().parse::<f64>().ok();
        for (bound, name) in self.bounds.iter_mut().zip(["boundmass", "boundinertia"]) {
            *bound = number(name).unwrap_or(*bound);
        }
        if let Some(balances) = compiler.attribute("balanceinertia") {
            self.balances = balances == "true";
        }
        if number("settotalmass").is_some_and(|mass_kg| mass_kg > 0.0) {
            self.scaled = Some(compiler);
        }
        if is("coordinate", "global") {
            self.global = Some(compiler);
        }
    }

    /// Adds a class and the classes in it.
    fn add_classes(&mut self, outermost: Node<'a, 'i>) {
        let mut open = vec![(outermost, None)];
        while let Some((node, parent)) = open.pop() {
            let name = node.attribute("class").unwrap_or(MAIN);
            let class = Class { parent, nodes: Vec::new(), attributes: HashMap::new() };
            self.classes.entry(name).or_insert(class).nodes.push(node);
            let inner = node.children().filter(|child| child.has_tag_name("default"));
            open.extend(inner.map(|child| (child, Some(name))));
        }
    }

    /// True if the class exists.
    pub fn has_class(&self, name: &str) -> bool {
        name == MAIN || self.classes.contains_key(name)
    }

    /// Names of all classes in alphabetical order.
    pub fn classes(&self) -> Vec<&'a str> {
        let mut names: Vec<_> = self.classes.keys().copied().collect();
        names.sort_unstable();
        names
    }

    /// Attribute of an element, else of its class. The default class is that of the bodies around it.
    pub fn attribute(
        &self,
        node: Node<'a, 'i>,
        around: Option<&'a str>,
        name: &str,
    ) -> Option<Attribute<'a, 'i>> {
        if let Some(attribute) = node.attribute_node(name) {
            return Some(attribute);
        }
        let tag = shared(node.tag_name().name());
        let mut class = Some(node.attribute("class").or(around).unwrap_or(MAIN));
        for _ in 0..DEPTH_MAX {
            let here = self.classes.get(class?)?;
            if let Some(attribute) = here.attributes.get(&(tag, name)) {
                return Some(*attribute);
            }
            class = here.parent;
        }
        None
    }
}
