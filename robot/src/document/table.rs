//! Typed getters for one TOML table. They record a fault if the text is wrong.

use super::suggest::{closest, in_unit_of};
use super::{Document, Span, alternatives, in_other_unit, line_at};
use rollwalk_protocol::names;
use rollwalk_protocol::text::{Excerpt, Limit, Number, is_plain_name};
use std::cell::RefCell;
use std::fmt::Display;
use std::ops::RangeInclusive;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

/// Maximum length of a string, bytes. It exceeds the longest path of an operating system.
const STRING_MAX: usize = 4096;
/// Maximum length of a name, bytes. It exceeds the longest model name of a motor.
pub const NAME_MAX: usize = 64;

/// Table of a [`Document`], with its name for faults.
///
/// Getters record a fault and return `None` if the value is missing or wrong. Read all keys that the table may have, then call
/// [`Table::done`], which rejects other keys.
#[derive(Clone, Debug)]
pub struct Table<'d> {
    document: &'d Document<'d>,
    table: &'d DeTable<'d>,
    span: Span,
    what: String,
    asked: RefCell<Vec<&'static str>>,
    /// Required keys that are absent, with the messages of their faults.
    missing: RefCell<Vec<(&'static str, String)>>,
}

/// Entry of [`Table::named_numbers`].
#[derive(Clone, Debug)]
pub struct NamedNumber<'d> {
    /// Key of the entry.
    pub name: &'d str,
    /// Span of the key.
    pub name_span: Span,
    /// Value, which is finite.
    pub number: f64,
    /// Span of the value.
    pub number_span: Span,
}

/// Entry of [`Table::named_strings`].
#[derive(Clone, Debug)]
pub struct NamedString<'d> {
    /// Key of the entry.
    pub name: &'d str,
    /// Span of the key.
    pub name_span: Span,
    /// The value.
    pub text: &'d str,
    /// Span of the value.
    pub text_span: Span,
}

impl<'d> Table<'d> {
    pub(super) fn new<'t: 'd>(
        document: &'d Document<'t>,
        table: &'d DeTable<'t>,
        span: Span,
        what: String,
    ) -> Self {
        Self { document, table, span, what, asked: RefCell::default(), missing: RefCell::default() }
    }

    /// Renames the table in faults, for example after its own name has been read.
    pub fn call(&mut self, what: impl Into<String>) {
        self.what = what.into();
    }

    /// Name of the table in faults.
    pub fn what(&self) -> &str {
        &self.what
    }

    /// Span of the table's header, or of the table itself if it is inline.
    pub fn span(&self) -> Span {
        self.span.clone()
    }

    /// Returns true if the key is present. The key then counts as read.
    pub fn has(&self, key: &'static str) -> bool {
        self.raw(key).is_some()
    }

    /// Span of a key's value, or of the table's header if the key is absent.
    pub fn span_of(&self, key: &str) -> Span {
        self.find(key).unwrap_or_else(|| self.span())
    }

    /// Line number of a key's value, or of the table's header if the key is absent, from 1.
    pub fn line_of(&self, key: &str) -> usize {
        line_at(self.document.text, self.span_of(key).start)
    }

    /// Span of a key's value; `None` if the key is absent.
    pub fn find(&self, key: &str) -> Option<Span> {
        self.table.get(key).map(Spanned::span)
    }

    /// Reads an optional key with `read`. `None` if the key is absent or faulty.
    pub fn given<T>(
        &self,
        key: &'static str,
        read: impl FnOnce(&Self, &'static str) -> Option<T>,
    ) -> Option<T> {
        if self.has(key) { read(self, key) } else { None }
    }

    /// Entries of a table with names as keys and strings as values. Do not call [`Table::done`] on such a table.
    pub fn named_strings(&self) -> Vec<NamedString<'d>> {
        let read = |(key, value): (&'d Spanned<DeString<'d>>, &'d Spanned<DeValue<'d>>)| {
            let name = key.get_ref().as_ref();
            let text = self.text(name, value)?;
            Some(NamedString { name, name_span: key.span(), text, text_span: value.span() })
        };
        self.table.iter().filter_map(read).collect()
    }

    /// Entries of a table with names as keys and numbers as values. Do not call [`Table::done`] on such a table.
    pub fn named_numbers(&self) -> Vec<NamedNumber<'d>> {
        let read = |(key, value): (&'d Spanned<DeString<'d>>, &'d Spanned<DeValue<'d>>)| {
            let name = key.get_ref().as_ref();
            let given = self.typed(name, value, "a finite number", number)?;
            Some(NamedNumber {
                name,
                name_span: key.span(),
                number: given,
                number_span: value.span(),
            })
        };
        self.table.iter().filter_map(read).collect()
    }

    /// Prefix of messages about this table; empty for the whole file.
    fn start(&self) -> String {
        if self.what.is_empty() { String::new() } else { format!("{}: ", self.what) }
    }

    /// Records a fault at the value of `key`.
    pub fn fault(&self, key: &str, problem: impl Display, label: impl Display, help: impl Display) {
        let message = format!("{}`{key}` {problem}", self.start());
        self.document.fault(self.span_of(key), message, label.to_string(), help.to_string());
    }

    /// Rejects unread keys. A key that is missing because the file has a similar one, or one in another unit, is one fault.
    pub fn done(&self) {
        let asked = self.asked.borrow();
        for (key, value) in self.table.iter() {
            let name = key.get_ref().as_ref();
            if asked.contains(&name) {
                continue;
            }
            let absent = asked.iter().copied().filter(|known| !self.table.contains_key(*known));
            let in_unit = in_unit_of(name, absent);
            let meant = match in_unit {
                Some((right, ..)) => Some(right),
                None => closest(name, asked.iter().copied()),
            };
            let mut message = format!("{}unknown key `{name}`", self.start());
            let missing = self.missing.borrow();
            if let Some((key, fault)) = missing.iter().find(|(key, _)| Some(*key) == meant) {
                self.document.retract(&self.span, fault);
                message += &format!(", and `{key}` is missing");
            }
            let (label, help) = match in_unit {
                Some((right, unit, factor)) => {
                    let help = match converted(value.get_ref(), factor) {
                        Some(value) => format!("give `{right} = {value}`"),
                        None => format!("give `{right}`, in its unit"),
                    };
                    (format!("in {unit}"), help)
                }
                None => {
                    let help = alternatives(name, asked.iter().copied());
                    ("not a key of this table".to_owned(), help)
                }
            };
            self.document.fault(key.span(), message, label, help);
        }
    }

    /// Reads a required string.
    pub fn string(&self, key: &'static str) -> Option<String> {
        let value = self.required(key, "a string in quotes")?;
        self.text(key, value).map(str::to_owned)
    }

    /// Reads a required name: a short string of visible characters.
    pub fn name(&self, key: &'static str) -> Option<String> {
        let name = self.string(key)?;
        self.is_name(key, &name, self.span_of(key)).then_some(name)
    }

    /// Returns true if the name at `key` is short and visible. Otherwise records a fault.
    fn is_name(&self, key: &str, name: &str, span: Span) -> bool {
        let (problem, label) = if name.is_empty() {
            ("is empty".to_owned(), "no name")
        } else if name.len() > NAME_MAX {
            (format!("has {} bytes: \"{}\"", name.len(), Excerpt::start_of(name)), "too long")
        } else if !is_plain_name(name) {
            (
                format!("is \"{}\"", Excerpt::start_of(name)),
                "invisible character, or space at the start or end",
            )
        } else if let Some(problem) = names::problem(name) {
            (
                format!("is `{}`, which {problem}", Excerpt::start_of(name)),
                "can be mistaken for \
                another name",
            )
        } else {
            return true;
        };
        let help = format!(
            "give a name of 1 to {NAME_MAX} bytes of visible characters, without a space at the \
             start or end; {}",
            names::HELP
        );
        let message = format!("{}`{key}` {problem}", self.start());
        self.document.fault(span, message, label, help);
        false
    }

    /// Reads a string of bounded length.
    fn text(&self, key: &str, value: &'d Spanned<DeValue<'d>>) -> Option<&'d str> {
        let text = self.typed(key, value, "a string in quotes", DeValue::as_str)?;
        if text.len() <= STRING_MAX {
            return Some(text);
        }
        let problem = format!("has {} bytes: \"{}\"", text.len(), Excerpt::start_of(text));
        let message = format!("{}`{key}` {problem}", self.start());
        let help = format!("shorten the string to at most {STRING_MAX} bytes");
        self.document.fault(value.span(), message, "too long", help);
        None
    }

    /// Reads a required string that must be one of `choices`, and returns its index.
    pub fn choice(&self, key: &'static str, choices: &[&'static str]) -> Option<usize> {
        let listed: Vec<_> = choices.iter().map(|choice| format!("\"{choice}\"")).collect();
        let value = self.required(key, &listed.join(" or "))?;
        let given = self.text(key, value)?;
        let found = choices.iter().position(|choice| *choice == given);
        if found.is_none() {
            let help = alternatives(given, choices.iter().copied());
            self.fault(key, format_args!("cannot be \"{given}\""), "not one of the choices", help);
        }
        found
    }

    /// Reads a required `true` or `false`.
    pub fn boolean(&self, key: &'static str) -> Option<bool> {
        let value = self.required(key, "true or false")?;
        self.typed(key, value, "true or false", DeValue::as_bool)
    }

    /// Reads a required number, which may be an integer.
    pub fn number(&self, key: &'static str) -> Option<f64> {
        let value = self.required(key, "a number")?;
        self.typed(key, value, "a finite number", number)
    }

    /// Reads a required number within a range. `unit` appears in the help text.
    pub fn number_in(
        &self,
        key: &'static str,
        range: RangeInclusive<f64>,
        unit: &str,
    ) -> Option<f64> {
        let value = self.number(key)?;
        if range.contains(&value) {
            return Some(value);
        }
        let (least, most) = (Limit::AtLeast(*range.start()), Limit::AtMost(*range.end()));
        let slip = in_other_unit(value, &range, unit);
        let help =
            format!("{}{slip}", format!("give a value from {least} to {most} {unit}").trim_end());
        self.fault(key, format_args!("is {value}"), "out of range", help);
        None
    }

    /// Reads a required integer within a range.
    pub fn integer(&self, key: &'static str, range: RangeInclusive<u32>) -> Option<u32> {
        let expected = format!("a whole number from {} to {}", range.start(), range.end());
        let value = self.required(key, &expected)?;
        if let Some(number) = whole(value.get_ref())
            && !(i64::from(*range.start())..=i64::from(*range.end())).contains(&number)
        {
            let label = match number > i64::from(*range.end()) {
                true => format!("above {}", range.end()),
                false => format!("below {}", range.start()),
            };
            let message = format!("{}`{key}` must be {expected}", self.start());
            self.document.fault(value.span(), message, label, format!("give {expected}"));
            return None;
        }
        self.typed(key, value, &expected, |value| whole(value)?.try_into().ok())
    }

    /// Reads a required array of exactly `N` numbers.
    pub fn numbers<const N: usize>(&self, key: &'static str) -> Option<[f64; N]> {
        let expected = format!("an array of {N} finite numbers");
        let value = self.required(key, &expected)?;
        self.typed(key, value, &expected, |value| {
            let numbers: Option<Vec<f64>> =
                value.as_array()?.iter().map(|item| number(item.get_ref())).collect();
            numbers?.try_into().ok()
        })
    }

    /// Reads a required array of numbers, with a length within `count`.
    pub fn list(&self, key: &'static str, count: RangeInclusive<usize>) -> Option<Vec<f64>> {
        let expected = format!("an array of {} to {} finite numbers", count.start(), count.end());
        let value = self.required(key, &expected)?;
        self.typed(key, value, &expected, |value| {
            let items = value.as_array()?;
            let numbers = items.iter().map(|item| number(item.get_ref()));
            if count.contains(&items.len()) { numbers.collect() } else { None }
        })
    }

    /// Returns true if the value of a key is an array.
    pub fn is_array(&self, key: &'static str) -> bool {
        self.raw(key).is_some_and(|value| value.get_ref().is_array())
    }

    /// Reads a required array of strings, each with its span.
    pub fn strings(&self, key: &'static str) -> Option<Vec<(&'d str, Span)>> {
        let expected = "an array of strings in quotes";
        let value = self.required(key, expected)?;
        let items = self.typed(key, value, expected, |value| {
            let items = value.as_array()?;
            items.iter().all(|item| item.get_ref().is_str()).then_some(items)
        })?;
        items.iter().map(|item| Some((self.text(key, item)?, item.span()))).collect()
    }

    /// Reads a required table.
    pub fn table(&self, key: &'static str) -> Option<Table<'d>> {
        let value = self.required(key, "a table")?;
        let what = format!("[{key}]");
        let table = self.typed(key, value, "a table", DeValue::as_table)?;
        Some(Table::new(self.document, table, value.span(), what))
    }

    /// Reads an array of tables; empty if the key is absent. Faults call each table "`key` number n" until its name is known.
    pub fn tables(&self, key: &'static str) -> Vec<Table<'d>> {
        let Some(value) = self.raw(key) else { return Vec::new() };
        let expected = "an array of tables, written [[like this]]";
        let Some(items) = self.typed(key, value, expected, |value| value.as_array()) else {
            return Vec::new();
        };
        let mut tables = Vec::new();
        for (index, item) in items.iter().enumerate() {
            if let Some(table) = self.typed(key, item, "a table", DeValue::as_table) {
                let what = format!("{key} number {}", index + 1);
                tables.push(Table::new(self.document, table, item.span(), what));
            }
        }
        tables
    }

    /// Reads an array of at most `most` tables. A longer array records a fault and gives an empty list.
    pub fn tables_up_to(&self, key: &'static str, most: usize) -> Vec<Table<'d>> {
        let tables = self.tables(key);
        if self.count(key, tables.len(), most) { tables } else { Vec::new() }
    }

    /// Returns true if `count` is at most `most`. Otherwise records a fault.
    pub fn count(&self, key: &str, count: usize, most: usize) -> bool {
        if count > most {
            let help = format_args!("keep at most {most} entries");
            self.fault(key, format_args!("has {count} entries"), "too many", help);
        }
        count <= most
    }

    /// Reads the tables of a table with names as keys, such as `[actuator.NAME]`; empty if the key is absent.
    pub fn named_tables(&self, key: &'static str) -> Vec<(&'d str, Table<'d>)> {
        let Some(value) = self.raw(key) else { return Vec::new() };
        let expected = format!("tables, written [{key}.NAME]");
        let Some(entries) = self.typed(key, value, &expected, DeValue::as_table) else {
            return Vec::new();
        };
        let mut tables = Vec::new();
        for (name, item) in entries.iter() {
            if !self.is_name(key, name.get_ref(), name.span()) {
                continue;
            }
            if let Some(table) = self.typed(key, item, &expected, DeValue::as_table) {
                let what = format!("{key} `{}`", name.get_ref());
                let table = Table::new(self.document, table, name.span(), what);
                tables.push((name.get_ref().as_ref(), table));
            }
        }
        tables
    }

    fn raw(&self, key: &'static str) -> Option<&'d Spanned<DeValue<'d>>> {
        let mut asked = self.asked.borrow_mut();
        if !asked.contains(&key) {
            asked.push(key);
        }
        self.table.get(key)
    }

    fn required(&self, key: &'static str, expected: &str) -> Option<&'d Spanned<DeValue<'d>>> {
        let value = self.raw(key);
        if value.is_none() {
            let message = format!("{}`{key}` is missing", self.start());
            let help = format!("give `{key}`, {expected}");
            self.document.fault(self.span(), &*message, format!("needs `{key}`"), help);
            self.missing.borrow_mut().push((key, message));
        }
        value
    }

    fn typed<T>(
        &self,
        key: &str,
        value: &'d Spanned<DeValue<'d>>,
        expected: &str,
        convert: impl FnOnce(&'d DeValue<'d>) -> Option<T>,
    ) -> Option<T> {
        let converted = convert(value.get_ref());
        if converted.is_none() {
            let message = format!("{}`{key}` must be {expected}", self.start());
            let label = match value.get_ref() {
                DeValue::Array(items) => format!("this array has {} entries", items.len()),
                other => format!("this value has type {}", other.type_str()),
            };
            self.document.fault(value.span(), message, label, format!("give {expected}"));
        }
        converted
    }
}

/// Number or array of numbers in another unit, in the spelling of TOML.
fn converted(value: &DeValue<'_>, factor: f64) -> Option<String> {
    let show = |value: f64| Number(value * factor).to_string();
    let Some(items) = value.as_array() else { return number(value).map(show) };
    let numbers: Option<Vec<_>> =
        items.iter().map(|item| number(item.get_ref()).map(show)).collect();
    Some(format!("[{}]", numbers?.join(", ")))
}

fn number(value: &DeValue<'_>) -> Option<f64> {
    let number = match value {
        DeValue::Float(float) => float.as_str().parse().ok()?,
        DeValue::Integer(_) => whole(value)? as f64,
        _ => return None,
    };
    f64::is_finite(number).then_some(number)
}

fn whole(value: &DeValue<'_>) -> Option<i64> {
    let integer = value.as_integer()?;
    i64::from_str_radix(integer.as_str(), integer.radix()).ok()
}
