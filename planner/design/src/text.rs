//! Robot file whose values can be changed; comments and order stay.

pub(crate) mod number;
mod split;

use crate::catalog::Servo;
use crate::parameter::{Kind, Location};
use nalgebra::Vector3;
use std::fmt;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Editable text of a robot file.
#[derive(Clone, Debug, Default)]
pub struct RobotText {
    document: DocumentMut,
}

/// Reason for which a parameter changes nothing in a robot file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct NoEffect {
    /// Missing item.
    pub problem: String,
    /// Available items.
    pub help: String,
}

impl fmt::Display for RobotText {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.document.fmt(f)
    }
}

impl RobotText {
    /// Parses the text of a robot file.
    ///
    /// # Errors
    /// If the text is not valid TOML.
    pub fn new(text: &str) -> Result<Self, toml_edit::TomlError> {
        Ok(Self { document: text.parse()? })
    }

    /// Present value of a parameter.
    ///
    /// # Errors
    /// If the robot lacks the part that the parameter changes.
    pub fn value(&mut self, place: &Location) -> Result<f64, NoEffect> {
        if place.kind != Kind::Mount && !place.limbs.is_empty() {
            let templates = split::templates(&mut self.document, place)?;
            let Some(template) = templates.first() else { return Err(no_effect(place, &[])) };
            return self.value(&place.of_template(template));
        }
        if let Some(all) = self.all_of(place)? {
            return all
                .first()
                .map_or_else(|| Err(no_effect(place, &[])), |first| self.value(first));
        }
        match place.kind {
            Kind::Length => Ok(self.reach(place)?.norm()),
            Kind::Speed | Kind::Torque => {
                let key = limit_key(place.kind);
                self.servo(place)?.get(key).and_then(number_of).ok_or_else(|| no_effect(place, &[]))
            }
            Kind::Mount => {
                let axis = place.axis.map_or(0, |axis| axis.index());
                let limbs = self.mounts(place)?;
                let value = limbs.first().and_then(|limb| vector(*limb, "origin_in_parent_m"));
                Ok(value.ok_or_else(|| no_effect(place, &[]))?[axis].abs())
            }
            Kind::Joint | Kind::Center => {
                let (table, key) = self.vector_of(place)?;
                let axis = place.axis.map_or(0, |axis| axis.index());
                Ok(vector(table, key).ok_or_else(|| no_effect(place, &[]))?[axis])
            }
            Kind::Radius => {
                let table = self.named(place, "end_effector")?;
                table.get("radius_m").and_then(number_of).ok_or_else(|| no_effect(place, &[]))
            }
            Kind::Tilt => {
                let table = self.named(place, "end_effector")?;
                let axis = vector(table, "axis_in_link").ok_or_else(|| no_effect(place, &[]))?;
                Ok(axis.z.atan2(axis.y))
            }
            Kind::Mass => {
                let table = self.named(place, "link")?;
                let mass = heaviest(table).and_then(|mass| mass.as_float());
                mass.ok_or_else(|| no_effect(place, &[]))
            }
            Kind::MotionLength | Kind::MotionTime | Kind::MotionAngle => Err(no_effect(place, &[])),
        }
    }

    /// Sets a parameter.
    ///
    /// # Errors
    /// If the robot lacks the part that the parameter changes.
    pub fn set(&mut self, place: &Location, to: f64) -> Result<(), NoEffect> {
        if place.kind != Kind::Mount && !place.limbs.is_empty() {
            let templates = split::apart(&mut self.document, place)?;
            return templates.iter().try_for_each(|of| self.set(&place.of_template(of), to));
        }
        if let Some(all) = self.all_of(place)? {
            let first = self.value(place)?;
            for one in all {
                // Mirrored sides have the other sign.
                let to = if self.value(&one)? * first < 0.0 { -to } else { to };
                self.set(&one, to)?;
            }
            return Ok(());
        }
        let by = to - self.value(place)?;
        match place.kind {
            Kind::Length => self.stretch(place, to)?,
            Kind::Speed | Kind::Torque => {
                let key = limit_key(place.kind);
                set_number(self.servo(place)?.get_mut(key), to);
            }
            Kind::Mount => {
                let axis = place.axis.map_or(0, |axis| axis.index());
                for limb in self.mounts(place)? {
                    if let Some(mut origin) = vector(limb, "origin_in_parent_m") {
                        // Away from the middle of the robot, on both sides and at both ends.
                        if origin[axis] != 0.0 {
                            origin[axis] += by * origin[axis].signum();
                        }
                        set_vector(limb, "origin_in_parent_m", origin);
                    }
                }
            }
            Kind::Joint | Kind::Center => {
                let axis = place.axis.map_or(0, |axis| axis.index());
                let (table, key) = self.vector_of(place)?;
                if let Some(mut at) = vector(table, key) {
                    at[axis] = to;
                    set_vector(table, key, at);
                }
            }
            Kind::Radius => set_number(self.named(place, "end_effector")?.get_mut("radius_m"), to),
            Kind::Tilt => {
                let table = self.named(place, "end_effector")?;
                if let Some(axis) = vector(table, "axis_in_link") {
                    let across = axis.y.hypot(axis.z);
                    let turned = Vector3::new(axis.x, across * to.cos(), across * to.sin());
                    set_vector(table, "axis_in_link", turned);
                }
            }
            Kind::Mass => {
                if let Some(mass) = heaviest(self.named(place, "link")?) {
                    replace(mass, to);
                }
            }
            Kind::MotionLength | Kind::MotionTime | Kind::MotionAngle => {}
        }
        Ok(())
    }

    /// Sets the model and limits of an actuator to those of another servo, and the mass of the parts that name the actuator.
    pub(crate) fn set_servo(&mut self, actuator: &str, servo: &Servo) {
        let mut turns = |kind| {
            self.everywhere(kind).iter().any(|table| text_of(&**table, "actuator") == actuator)
        };
        let turns_wheels_only = turns("end_effector") && !turns("joint");
        let speed_max_rad_s =
            if turns_wheels_only { servo.wheel_speed_max_rad_s() } else { servo.speed_max_rad_s };
        for part in self.parts_of(actuator) {
            set_number(part.get_mut("mass_kg"), servo.mass_kg);
        }
        let all = self.document.get_mut("actuator").and_then(Item::as_table_like_mut);
        let found = all.and_then(|all| all.get_mut(actuator)).and_then(Item::as_table_like_mut);
        let Some(table) = found else { return };
        if let Some(model) = table.get_mut("model").and_then(Item::as_value_mut) {
            let decor = model.decor().clone();
            *model = Value::from(servo.name.as_str());
            *model.decor_mut() = decor;
        }
        set_number(table.get_mut("speed_max_rad_s"), speed_max_rad_s);
        set_number(table.get_mut("torque_max_nm"), servo.torque_max_nm);
        match servo.stall_torque_nm {
            Some(stall_nm) => {
                put_number(table, "stall_torque_nm", stall_nm);
                put_number(table, "no_load_speed_rad_s", servo.no_load_speed_rad_s);
            }
            None => {
                table.remove("stall_torque_nm");
                table.remove("no_load_speed_rad_s");
            }
        }
    }

    /// Model of an actuator; `None` if the file has no actuator with the given name.
    pub(crate) fn model_of(&self, actuator: &str) -> Option<&str> {
        self.document.get("actuator")?.get(actuator)?.get("model")?.as_str()
    }

    /// Parts of links that name the given actuator.
    pub(crate) fn parts_of(&mut self, actuator: &str) -> Vec<&mut dyn TableLike> {
        let links = self.everywhere("link").into_iter();
        let parts = links.flat_map(|link| inner(link, "parts"));
        parts.filter(|part| text_of(&**part, "actuator") == actuator).collect()
    }

    /// Tables of a kind, such as `link`, inside and outside templates.
    fn everywhere(&mut self, kind: &str) -> Vec<&mut dyn TableLike> {
        let mut found: Vec<&mut dyn TableLike> = Vec::new();
        for (key, item) in self.document.as_table_mut().iter_mut() {
            if key == kind {
                found.extend(tables_in(item));
            } else if let Some(templates) = item.as_table_like_mut().filter(|_| key == "template") {
                let templates = templates.iter_mut().filter_map(|(_, of)| of.as_table_like_mut());
                found.extend(templates.flat_map(|template| inner(template, kind)));
            }
        }
        found
    }

    /// Expands a name with `*` outside templates to all matching parts. Inside templates, `*` is the name of the limb.
    fn all_of(&mut self, place: &Location) -> Result<Option<Vec<Location>>, NoEffect> {
        let table = match place.kind {
            Kind::Length | Kind::Mass => "link",
            Kind::Joint => "joint",
            Kind::Center | Kind::Radius | Kind::Tilt => "end_effector",
            _ => return Ok(None),
        };
        let Some((start, end)) = place.name.split_once('*').filter(|_| place.template.is_none())
        else {
            return Ok(None);
        };
        let known: Vec<String> = self
            .tables(place, table)
            .iter()
            .map(|table| text_of(&**table, "name").to_owned())
            .collect();
        let fits = |name: &&String| {
            name.strip_prefix(start)
                .is_some_and(|rest| rest.len() >= end.len() && rest.ends_with(end))
        };
        let one = |name: &String| Location { name: name.clone(), ..place.clone() };
        let all: Vec<Location> = known.iter().filter(fits).map(one).collect();
        if all.is_empty() { Err(no_effect(place, &known)) } else { Ok(Some(all)) }
    }

    /// Vector from a link's joint to its next joint, or to its foot or wheel, in the link's frame.
    fn reach(&mut self, place: &Location) -> Result<Vector3<f64>, NoEffect> {
        self.named(place, "link")?;
        let ends = [
            ("joint", "parent", "origin_in_parent_m"),
            ("end_effector", "link", "center_in_link_m"),
        ];
        for (kind, of, key) in ends {
            let found = self
                .tables(place, kind)
                .into_iter()
                .filter(|table| text_of(*table, of) == place.name)
                .find_map(|table| vector(table, key).filter(|at| at.norm() > 0.0));
            if let Some(at) = found {
                return Ok(at);
            }
        }
        Err(NoEffect {
            problem: format!(
                "link `{}` has no length, because every joint, foot and wheel on it is at its own joint",
                place.name
            ),
            help: "name a link with a joint, a foot or a wheel at a distance from its own joint"
                .into(),
        })
    }

    /// Scales all positions in a link along its length. Parts that stretch keep their cross-section, so that their mass grows
    /// with the length.
    fn stretch(&mut self, place: &Location, length_m: f64) -> Result<(), NoEffect> {
        let reach = self.reach(place)?;
        let along = reach.normalize();
        let more = length_m / reach.norm() - 1.0;
        let moved = |at: Vector3<f64>| at + along * (at.dot(&along) * more);
        let longest = along.iamax();
        let ends = [
            ("joint", "parent", "origin_in_parent_m"),
            ("end_effector", "link", "center_in_link_m"),
        ];
        for (kind, of, key) in ends {
            for table in self.tables(place, kind) {
                if text_of(table, of) == place.name {
                    move_vector(table, key, moved);
                }
            }
        }
        let link = self.named(place, "link")?;
        move_vector(link, "com_in_link_m", moved);
        for part in inner(link, "parts") {
            move_vector(part, "at_m", moved);
            if part.get("stretches").and_then(Item::as_bool) == Some(true) {
                scale(part.get_mut("mass_kg").and_then(Item::as_value_mut), 1.0 + more);
                scale(size_along(part, longest), 1.0 + more);
            }
        }
        for shape in inner(link, "shapes") {
            for key in ["at_m", "from_m", "to_m"] {
                move_vector(shape, key, moved);
            }
            let sides = shape.get_mut("box_m").and_then(Item::as_array_mut);
            scale(sides.and_then(|sides| sides.get_mut(longest)), 1.0 + more);
        }
        Ok(())
    }

    /// Tables of a kind in the parameter's template, or outside templates if it has none.
    fn tables(&mut self, place: &Location, kind: &str) -> Vec<&mut dyn TableLike> {
        let group: Option<&mut dyn TableLike> = match &place.template {
            Some(template) => {
                let all = self.document.get_mut("template").and_then(Item::as_table_like_mut);
                all.and_then(|all| all.get_mut(template)).and_then(Item::as_table_like_mut)
            }
            None => Some(self.document.as_table_mut()),
        };
        group.map_or_else(Vec::new, |group| inner(group, kind))
    }

    /// Table of a kind with the parameter's name.
    fn named(&mut self, place: &Location, kind: &str) -> Result<&mut dyn TableLike, NoEffect> {
        let tables = self.tables(place, kind);
        let known: Vec<String> =
            tables.iter().map(|table| text_of(&**table, "name").to_owned()).collect();
        let found = tables.into_iter().find(|table| text_of(&**table, "name") == place.name);
        found.ok_or_else(|| no_effect(place, &known))
    }

    fn vector_of(
        &mut self,
        place: &Location,
    ) -> Result<(&mut dyn TableLike, &'static str), NoEffect> {
        let (kind, key) = match place.kind {
            Kind::Joint => ("joint", "origin_in_parent_m"),
            _ => ("end_effector", "center_in_link_m"),
        };
        Ok((self.named(place, kind)?, key))
    }

    fn servo(&mut self, place: &Location) -> Result<&mut dyn TableLike, NoEffect> {
        let all = self.document.get_mut("actuator").and_then(Item::as_table_like_mut);
        let known: Vec<String> = all
            .as_ref()
            .map(|all| all.iter().map(|(name, _)| name.to_owned()).collect())
            .unwrap_or_default();
        let found = all.and_then(|all| all.get_mut(&place.name)).and_then(Item::as_table_like_mut);
        found.ok_or_else(|| no_effect(place, &known))
    }

    /// Tables of the limbs that the parameter lists, or of all limbs of its template.
    fn mounts(&mut self, place: &Location) -> Result<Vec<&mut dyn TableLike>, NoEffect> {
        let limbs = inner(self.document.as_table_mut(), "limb");
        let known: Vec<String> =
            limbs.iter().map(|table| text_of(&**table, "name").to_owned()).collect();
        let is_meant = |limb: &&mut dyn TableLike| {
            let name = text_of(&**limb, "name");
            if place.limbs.is_empty() {
                text_of(&**limb, "template") == place.name
            } else {
                place.limbs.iter().any(|limb| limb == name)
            }
        };
        let found: Vec<_> = limbs.into_iter().filter(is_meant).collect();
        if found.is_empty() { Err(no_effect(place, &known)) } else { Ok(found) }
    }
}

fn no_effect(place: &Location, known: &[String]) -> NoEffect {
    let template = place.template.as_ref().map_or(String::new(), |of| format!("{of}/"));
    let problem = format!("the robot has no `{template}{}` to change", place.name);
    let help = if known.is_empty() {
        "name a part of the robot file".into()
    } else if place.template.is_none() && place.name.contains('*') {
        format!(
            "give one of {}, or TEMPLATE/{} for parts of a template",
            known.join(", "),
            place.name
        )
    } else {
        format!("give one of {}", known.join(", "))
    };
    NoEffect { problem, help }
}

fn limit_key(kind: Kind) -> &'static str {
    if kind == Kind::Speed { "speed_max_rad_s" } else { "torque_max_nm" }
}

/// Tables of an array under `key`; empty if the key is missing.
fn inner<'t>(table: &'t mut dyn TableLike, key: &str) -> Vec<&'t mut dyn TableLike> {
    table.get_mut(key).map_or_else(Vec::new, tables_in)
}

/// Tables of an array, written as `[[name]]` or in one line.
fn tables_in(item: &mut Item) -> Vec<&mut dyn TableLike> {
    match item {
        Item::ArrayOfTables(tables) => {
            tables.iter_mut().map(|table| table as &mut dyn TableLike).collect()
        }
        Item::Value(Value::Array(values)) => values
            .iter_mut()
            .filter_map(Value::as_inline_table_mut)
            .map(|table| table as &mut dyn TableLike)
            .collect(),
        _ => Vec::new(),
    }
}

fn text_of<'t>(table: &'t dyn TableLike, key: &str) -> &'t str {
    table.get(key).and_then(Item::as_str).unwrap_or_default()
}

fn number_of(item: &Item) -> Option<f64> {
    item.as_float().or_else(|| item.as_integer().map(|whole| whole as f64))
}

fn vector(table: &dyn TableLike, key: &str) -> Option<Vector3<f64>> {
    let array = table.get(key)?.as_array()?;
    let numbers: Option<Vec<f64>> = array
        .iter()
        .map(|value| value.as_float().or_else(|| value.as_integer().map(|whole| whole as f64)))
        .collect();
    (array.len() == 3).then(|| numbers.map(|numbers| Vector3::from_column_slice(&numbers)))?
}

fn set_vector(table: &mut dyn TableLike, key: &str, to: Vector3<f64>) {
    let Some(array) = table.get_mut(key).and_then(Item::as_array_mut) else { return };
    for (value, to) in array.iter_mut().zip(to.iter()) {
        if value.as_float() != Some(*to) {
            replace(value, *to);
        }
    }
}

fn move_vector(table: &mut dyn TableLike, key: &str, moved: impl Fn(Vector3<f64>) -> Vector3<f64>) {
    if let Some(at) = vector(table, key) {
        set_vector(table, key, moved(at));
    }
}

fn set_number(item: Option<&mut Item>, to: f64) {
    if let Some(value) = item.and_then(Item::as_value_mut) {
        replace(value, to);
    }
}

/// Sets a number under a key, which may be missing.
fn put_number(table: &mut dyn TableLike, key: &str, to: f64) {
    match table.get_mut(key) {
        Some(item) => set_number(Some(item), to),
        None => drop(table.insert(key, toml_edit::value(to))),
    }
}

/// Size of a part along a coordinate axis: a side of its box, or the length of its cylinder.
fn size_along(part: &mut dyn TableLike, axis: usize) -> Option<&mut Value> {
    const CYLINDERS: [&str; 3] = ["cylinder_x_m", "cylinder_y_m", "cylinder_z_m"];
    let (key, index) =
        if part.contains_key("box_m") { ("box_m", axis) } else { (CYLINDERS[axis], 1) };
    part.get_mut(key)?.as_array_mut()?.get_mut(index)
}

/// Mass of a link's heaviest part, or the mass of the link itself.
fn heaviest(link: &mut dyn TableLike) -> Option<&mut Value> {
    if link.contains_key("mass_kg") {
        return link.get_mut("mass_kg")?.as_value_mut();
    }
    let masses = inner(link, "parts").into_iter().filter_map(|part| part.get_mut("mass_kg"));
    masses
        .filter_map(Item::as_value_mut)
        .max_by(|a, b| a.as_float().unwrap_or(0.0).total_cmp(&b.as_float().unwrap_or(0.0)))
}

fn scale(value: Option<&mut Value>, by: f64) {
    if let Some(value) = value
        && let Some(before) = value.as_float()
    {
        replace(value, before * by);
    }
}

/// Replaces a value, and keeps its comments. Rounding to twelve digits writes 0.07 instead of 0.06999999999999999.
fn replace(value: &mut Value, number: f64) {
    let decor = value.decor().clone();
    let twelve_digits = format!("{number:.11e}").parse().unwrap_or(number);
    *value = Value::from(twelve_digits);
    *value.decor_mut() = decor;
}

#[cfg(test)]
mod tests;
