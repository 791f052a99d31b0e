//! Robot file as the source and destination of fitted values: search for drives and links that share an entry of the file, and
//! replacement of values that keeps comments and order.

use miette::miette;
use rollwalk_robot::{Channel, Robot};
use rollwalk_simulate::identify::{
    FittedQuantity, Group, Kind, Quantity, QuantityVerdict, Scope, SimulationModel,
};
use std::path::Path;
use toml_edit::{ArrayOfTables, Decor, DocumentMut, Item, Table, TableLike, Value};

pub struct Source {
    document: DocumentMut,
    drives: Vec<Group>,
    links: Vec<Group>,
}

impl Source {
    /// Parses the text of a robot file that was read before.
    ///
    /// # Errors
    /// Returns an error if the text is not TOML, or has links, joints or end effectors in inline tables, which cannot be
    /// changed.
    pub fn new(path: &Path, text: &str, robot: &Robot) -> miette::Result<Self> {
        let document: DocumentMut =
            text.parse().map_err(|error| miette!("{}: {error}", path.display()))?;
        let channels = [("joint", false), ("end_effector", true)]
            .into_iter()
            .flat_map(|(kind, wheels)| of_limbs(&document, kind).map(move |table| (table, wheels)))
            .filter(|(table, wheels)| !wheels || text_of(table, "contact") == "actuated_wheel")
            .filter(|(table, _)| table.contains_key("actuator"))
            .map(|(table, _)| text_of(table, "actuator"));
        let drives = groups(channels);
        let names = of_limbs(&document, "link").map(|link| {
            let name = text_of(link, "name");
            name.trim_start_matches("*_").to_owned()
        });
        let links = groups(names);
        let count =
            |groups: &[Group]| groups.iter().map(|group| group.members.len()).sum::<usize>();
        if [count(&drives), count(&links)] != [robot.channels().count(), robot.links.len()] {
            return Err(miette!(
                help = "write these tables as [[link]], [[joint]] and [[end_effector]]",
                "{}: inline tables of links, joints and end effectors cannot be changed",
                path.display()
            ));
        }
        Ok(Self { document, drives, links })
    }

    /// Quantities that can be fitted: the delay, and all that are not 0 in the robot file, except position gains of wheels.
    pub fn quantities(&self, robot: &Robot) -> Vec<Quantity> {
        let of = |kind: Kind| {
            let groups: Vec<Option<Group>> = match kind.is_of() {
                Scope::Drives => self.drives.iter().cloned().map(Some).collect(),
                Scope::Links => self.links.iter().cloned().map(Some).collect(),
                Scope::Robot => vec![None],
            };
            groups.into_iter().map(move |group| Quantity { kind, group })
        };
        let model = SimulationModel::new(robot);
        let has_one = |of: &Quantity| {
            let channel =
                of.group.as_ref().and_then(|group| robot.channels().nth(group.members[0]));
            let is_wheel = matches!(channel, Some(Channel::Wheel(..)));
            let holds_angle = !(of.kind == Kind::PositionGain && is_wheel);
            of.kind == Kind::Delay || of.value(&model) > 0.0 && holds_angle
        };
        Kind::all().flat_map(of).filter(has_one).collect()
    }

    /// Replaces a changed value, with a comment about the recording.
    pub fn set(&mut self, found: &FittedQuantity, run: &str) {
        if found.verdict != QuantityVerdict::Changed {
            return;
        }
        let Some(key) = found.quantity.kind.key() else { return };
        let share = found.fitted / found.before;
        let change = Change { key, share, deviation: found.deviation / found.fitted, run };
        let group = found.quantity.group.as_ref();
        match found.quantity.kind.is_of() {
            Scope::Drives => {
                let name = group.map_or("", |group| &group.name);
                let actuator = self.document.get_mut("actuator").and_then(|all| all.get_mut(name));
                if let Some(table) = actuator.and_then(Item::as_table_like_mut) {
                    change.apply(table);
                }
            }
            Scope::Robot => each(&mut self.document, "end_effector", |table| change.apply(table)),
            Scope::Links => each(&mut self.document, "link", |table| {
                let name = text_of(table, "name");
                if group.is_some_and(|group| group.name == name.trim_start_matches("*_")) {
                    change.apply_to_link(table);
                }
            }),
        }
    }

    /// Text of the robot file with the new values.
    pub fn text(&self) -> String {
        self.document.to_string()
    }
}

struct Change<'a> {
    key: &'static str,
    /// Scale factor of the old value.
    share: f64,
    /// Standard deviation divided by the fitted value.
    deviation: f64,
    /// Name of the recording.
    run: &'a str,
}

/// Start of the comments on fitted values.
const MARK: &str = "fitted to ";

impl Change<'_> {
    fn apply(&self, table: &mut dyn TableLike) {
        let Some(value) = table.get_mut(self.key).and_then(Item::as_value_mut) else { return };
        let Some(before) = number(value) else { return };
        let after = before * self.share;
        let deviation = after * self.deviation;
        let suffix = value.decor().suffix().and_then(|suffix| suffix.as_str()).unwrap_or_default();
        let old = suffix.trim().trim_start_matches('#').trim();
        // The user's part of a comment begins after the part that an earlier fit wrote.
        let own = match old.strip_prefix(MARK) {
            Some(fitted) => fitted.split_once("; ").map_or("", |(_, own)| own),
            None => old,
        };
        let own = if own.is_empty() { String::new() } else { format!("; {own}") };
        let comment = format!(
            "   # {MARK}{}: ± {}, was {before:?}{own}",
            self.run,
            rounded(deviation, deviation)
        );
        replace(value, rounded(after, deviation));
        value.decor_mut().set_suffix(comment);
    }

    /// Scales the mass of a link or of its parts. If the link has its own mass, its inertia is scaled, too.
    fn apply_to_link(&self, table: &mut dyn TableLike) {
        let mut scale = |value: &mut Value| {
            if let Some(before) = number(value) {
                let after = before * self.share;
                replace(value, rounded(after, after * self.deviation));
            }
        };
        match table.get_mut("parts") {
            Some(Item::Value(Value::Array(parts))) => {
                let parts = parts.iter_mut().filter_map(Value::as_inline_table_mut);
                parts.filter_map(|part| part.get_mut(self.key)).for_each(&mut scale);
                if let Some(mut key) = table.key_mut("parts") {
                    self.comment_above(key.leaf_decor_mut());
                }
                return;
            }
            Some(Item::ArrayOfTables(parts)) => {
                for part in parts.iter_mut() {
                    part.get_mut(self.key)
                        .and_then(Item::as_value_mut)
                        .into_iter()
                        .for_each(&mut scale);
                }
                if let Some(first) = parts.get_mut(0) {
                    self.comment_above(first.decor_mut());
                }
                return;
            }
            _ => {}
        }
        if let Some(inertia) = table.get_mut("inertia_in_link_kg_m2").and_then(Item::as_array_mut) {
            inertia.iter_mut().for_each(scale);
        }
        self.apply(table);
    }

    /// Writes a comment on the scaling in a line above the masses of the parts.
    fn comment_above(&self, decor: &mut Decor) {
        let before = decor.prefix().and_then(|prefix| prefix.as_str()).unwrap_or_default();
        let kept: String = before
            .lines()
            .filter(|line| !line.starts_with(&format!("# masses {MARK}")))
            .map(|line| format!("{line}\n"))
            .collect();
        let percent = rounded(100.0 * self.deviation, 100.0 * self.deviation);
        let share = rounded(self.share, self.share * self.deviation);
        decor.set_prefix(format!(
            "{kept}# masses {MARK}{}: {share} times the earlier masses, ± {percent} %\n",
            self.run
        ));
    }
}

/// Rounds a value to two significant digits of its deviation.
pub fn rounded(value: f64, deviation: f64) -> f64 {
    let size =
        if deviation > 0.0 && deviation.is_finite() { deviation } else { value.abs() * 1e-3 };
    if size == 0.0 {
        return value;
    }
    let digits = (1.0 - size.log10().floor()).clamp(0.0, 12.0) as usize;
    format!("{value:.digits$}").parse().unwrap_or(value)
}

/// Replaces a value, and keeps its comments.
fn replace(value: &mut Value, number: f64) {
    let decor = value.decor().clone();
    *value = Value::from(number);
    *value.decor_mut() = decor;
}

fn number(value: &Value) -> Option<f64> {
    value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64))
}

fn text_of<'t>(table: &'t Table, key: &str) -> &'t str {
    table.get(key).and_then(Item::as_str).unwrap_or_default()
}

/// Groups equal names in the order of first appearance. The members of a group are indices into `names`.
fn groups(names: impl Iterator<Item = impl Into<String>>) -> Vec<Group> {
    let mut groups: Vec<Group> = Vec::new();
    for (number, name) in names.map(Into::into).enumerate() {
        match groups.iter_mut().find(|group| group.name == name) {
            Some(group) => group.members.push(number),
            None => groups.push(Group { name, members: vec![number] }),
        }
    }
    groups
}

/// Tables of a kind in the order of the robot: those of the robot itself, then those of each limb's template.
fn of_limbs<'d>(document: &'d DocumentMut, kind: &'d str) -> impl Iterator<Item = &'d Table> {
    let array = |item: Option<&'d Item>| {
        item.and_then(Item::as_array_of_tables).into_iter().flat_map(ArrayOfTables::iter)
    };
    let limbs = array(document.get("limb"));
    let of_templates = limbs.flat_map(move |limb| {
        let template = document.get("template").and_then(|all| all.get(text_of(limb, "template")));
        array(template.and_then(|template| template.get(kind)))
    });
    array(document.get(kind)).chain(of_templates)
}

/// Calls `of` for all tables of a kind, those of the robot itself and those of templates.
fn each(document: &mut DocumentMut, kind: &str, mut of: impl FnMut(&mut Table)) {
    let mut visit = |item: Option<&mut Item>| {
        let tables = item.and_then(Item::as_array_of_tables_mut);
        tables.into_iter().flat_map(ArrayOfTables::iter_mut).for_each(&mut of);
    };
    visit(document.get_mut(kind));
    let templates = document.get_mut("template").and_then(Item::as_table_like_mut);
    for (_, template) in templates.into_iter().flat_map(|all| all.iter_mut()) {
        visit(template.get_mut(kind));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn agilebot() -> (Source, String, Robot) {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../shipped/robots/agilebot.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let robot = Robot::from_toml("agilebot", &text).unwrap();
        (Source::new(Path::new("agilebot.toml"), &text, &robot).unwrap(), text, robot)
    }

    #[test]
    fn quantities_have_the_names_of_the_file() {
        let (source, _, robot) = agilebot();
        let quantities = source.quantities(&robot);
        let names: Vec<String> = quantities.iter().map(Quantity::name).collect();
        let expected = [
            "friction",
            "kp.xm430",
            "kp.xm540",
            "kd.xm430",
            "kd.xm540",
            "kd.xm430_drive",
            "armature.xm430",
            "armature.xm540",
            "armature.xm430_drive",
            "mass.body",
            "mass.hip",
            "mass.thigh",
            "mass.shank",
            "mass.fork",
            "stiffness",
            "stick",
            "delay",
        ];
        assert_eq!(names, expected);
        let drives = quantities[1].group.as_ref().unwrap();
        assert_eq!(drives.members, [0, 3, 4, 7, 8, 11, 12, 15]);
        for quantity in &quantities {
            let group = quantity.group.as_ref();
            let of_file = |member: usize| match quantity.kind.is_of() {
                Scope::Links => robot.links[member].mass_kg,
                _ => robot.channels().nth(member).unwrap().actuator().armature_kg_m2,
            };
            let values = group.into_iter().flat_map(|group| group.members.iter().copied());
            let values: Vec<f64> = values.map(of_file).collect();
            assert!(values.iter().all(|value| *value == values[0]), "{quantity:?}");
        }
    }

    #[test]
    fn numbers_change_and_nothing_else_does() {
        let (mut source, text, robot) = agilebot();
        for (name, share) in
            [("kp.xm430", 0.7), ("friction", 0.5), ("mass.fork", 2.0), ("kd.xm430_drive", 1.1)]
        {
            let quantity =
                source.quantities(&robot).into_iter().find(|of| of.name() == name).unwrap();
            let before = quantity.value(&SimulationModel::new(&robot));
            let (fitted, deviation) = (before * share, before * 1e-3);
            let verdict = QuantityVerdict::Changed;
            source.set(&FittedQuantity { quantity, before, fitted, deviation, verdict }, "run.csv");
        }
        let changed = source.text();
        let fitted = Robot::from_toml("fitted", &changed).unwrap();
        assert_eq!(fitted.joints[0].actuator.kp_nm_rad, 56.0);
        assert_eq!(fitted.joints[1].actuator.kp_nm_rad, 100.0);
        assert_eq!(fitted.end_effectors[3].friction_coefficient, 0.4);
        assert!((fitted.links[16].mass_kg - 2.0 * robot.links[16].mass_kg).abs() < 1e-9);
        let new = "kp_nm_rad = 56.0   # fitted to run.csv: ± 0.08, was 80.0; chosen: plans transfer from about 60 N·m/rad on";
        assert!(changed.contains(new), "{changed}");
        let lines: Vec<&str> = text.lines().collect();
        let off = changed.lines().filter(|line| !lines.contains(line)).count();
        // Three lines of the fork change, and four lines of comment.
        assert_eq!(off, 3 + 4, "{changed}");
        assert_eq!(changed.lines().count(), text.lines().count() + 1);
        // Another fit replaces the first.
        let quantity = source.quantities(&fitted).swap_remove(1);
        let found = FittedQuantity {
            quantity,
            before: 56.0,
            fitted: 60.0,
            deviation: 0.5,
            verdict: QuantityVerdict::Changed,
        };
        source.set(&found, "again.csv");
        let again = "kp_nm_rad = 60.0   # fitted to again.csv: ± 0.5, was 56.0; chosen: plans transfer from about 60 N·m/rad on";
        assert!(source.text().contains(again), "{}", source.text());
    }

    #[test]
    fn masses_of_parts_change_however_they_are_written() {
        let (_, text, _) = agilebot();
        let mut document: DocumentMut = text.parse().unwrap();
        let body = document["link"].as_array_of_tables_mut().unwrap().get_mut(0).unwrap();
        let parts = body.remove("parts").unwrap().into_array_of_tables().unwrap();
        body.insert("parts", Item::ArrayOfTables(parts));
        let text = document.to_string();
        assert!(text.contains("[[link.parts]]"), "{text}");
        let robot = Robot::from_toml("tables", &text).unwrap();
        let mut source = Source::new(Path::new("tables.toml"), &text, &robot).unwrap();
        let mut all = source.quantities(&robot).into_iter();
        let quantity = all.find(|of| of.name() == "mass.body").unwrap();
        let before = quantity.value(&SimulationModel::new(&robot));
        let (fitted, deviation, verdict) = (1.5 * before, 1e-4, QuantityVerdict::Changed);
        for run in ["run.csv", "again.csv"] {
            let quantity = quantity.clone();
            source.set(&FittedQuantity { quantity, before, fitted, deviation, verdict }, run);
        }
        let changed = source.text();
        let heavier = Robot::from_toml("heavier", &changed).unwrap();
        let share = heavier.links[0].mass_kg / robot.links[0].mass_kg;
        assert!((share - 1.5 * 1.5).abs() < 1e-3, "{share}");
        assert_eq!(changed.matches("# masses fitted to").count(), 1);
        assert!(changed.contains("# masses fitted to again.csv: 1.5 times"), "{changed}");
    }

    #[test]
    fn numbers_have_the_digits_that_are_known() {
        for (value, deviation, expected) in
            [(56.1234, 0.16, 56.12), (0.251_99, 0.0006, 0.251_99), (1236.4, 30.0, 1236.0)]
        {
            assert_eq!(rounded(value, deviation), expected);
        }
    }
}
