//! JSON files with format and version, such as plans: one reader with its error messages.
//!
//! serde describes expected values by Rust types. The reader translates its messages to numbers, lists and fields, for users
//! who edit a plan by hand or with a script. Text from files is printed in a safe form.

use miette::Diagnostic;
use rollwalk_protocol::text::Printable;
use rollwalk_robot::document::alternatives;
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};
use serde_json::Value;
use serde_json::error::Category;
use std::fmt;
use thiserror::Error;

/// Maximum length of a message, characters. Messages quote the file.
const WORDS_MAX: usize = 1000;
/// Maximum length of a quoted value, characters.
const VALUE_MAX: usize = 60;

/// Format of JSON files: objects with `format` and `version`.
#[derive(Clone, Copy, Debug)]
pub struct Format {
    /// Required value of `format`.
    pub name: &'static str,
    /// Required value of `version`.
    pub version: u32,
    /// Noun for the file in messages, such as "plan" in "the plan is from a newer rollwalk".
    pub what: &'static str,
    /// Instruction for a file of an older version.
    pub make_again: &'static str,
    /// Hint at the documentation.
    pub help: &'static str,
}

/// Reason why a file is refused.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum JsonError {
    /// The text is not JSON, or a field is missing, unknown or of the wrong type.
    #[error("{file}:{line}:{column}: {message}")]
    Syntax {
        /// Name of the file, as passed by the caller.
        file: String,
        /// Line of the fault, from 1.
        line: usize,
        /// Column of the fault, from 1.
        column: usize,
        /// Fault, with the path of the field, such as `samples[3].com_m`.
        message: String,
        /// Hint at the documentation.
        help: &'static str,
    },
    /// A field has an impossible value.
    #[error("{file}: {path} is {value}; expected {expected}")]
    Value {
        /// Name of the file, as passed by the caller.
        file: String,
        /// JSON path of the field.
        path: String,
        /// Value in the file.
        value: String,
        /// Expected value.
        expected: String,
        /// Hint at the documentation.
        help: &'static str,
    },
}

impl Diagnostic for JsonError {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        let (Self::Syntax { help, .. } | Self::Value { help, .. }) = self;
        Some(Box::new(help))
    }
}

/// Fields that every version of a format has.
#[derive(Deserialize)]
struct Header {
    #[serde(default)]
    format: Value,
    #[serde(default)]
    version: Value,
}

impl Format {
    /// Reads a file of this format and version. Errors name the text by `file`.
    ///
    /// # Errors
    /// Returns an error if the text does not match the format. [`JsonError`] names file, field, value and the expected value.
    pub fn read<T: DeserializeOwned>(&self, file: &str, text: &str) -> Result<T, JsonError> {
        let syntax = |path: &str, error: &serde_json::Error| {
            let message = without_position(error);
            let message = match error.classify() {
                Category::Data => in_words(path, &message),
                Category::Eof if text.trim().is_empty() => {
                    "the file is empty; expected JSON".to_owned()
                }
                Category::Eof => "the JSON is incomplete: the file ends too early".to_owned(),
                // serde_json reports this message also for invalid numbers, keys and words.
                _ if serde_json::from_str::<IgnoredAny>(text).is_ok() => in_words(path, &message),
                _ => format!("{}: {message}", not_json(text, error)),
            };
            JsonError::Syntax {
                file: file.to_owned(),
                line: error.line(),
                column: error.column(),
                message: Printable(&cut(&message, WORDS_MAX)).to_string(),
                help: self.help,
            }
        };
        // Format and version first: a file of another version may differ in any other field.
        let header: Header = serde_json::from_str(text).map_err(|error| syntax(".", &error))?;
        self.check(&header, file)?;
        let mut deserializer = serde_json::Deserializer::from_str(text);
        serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| syntax(&error.path().to_string(), error.inner()))
    }

    fn check(&self, header: &Header, file: &str) -> Result<(), JsonError> {
        let fault = |path: &str, value: &Value, expected: String| {
            let value = if value.is_null() { "missing".to_owned() } else { value.to_string() };
            Err(self.fault(file, path, &cut(&value, VALUE_MAX), expected))
        };
        let &Self { name, version, what, make_again, .. } = self;
        if header.format != name {
            return fault("format", &header.format, format!("\"{name}\""));
        }
        let expected = match header.version.as_u64() {
            Some(found) if found == u64::from(version) => return Ok(()),
            Some(found) if found > u64::from(version) => {
                format!("{version}: update rollwalk, because a newer version wrote the {what}")
            }
            Some(_) => format!(
                "{version}: {make_again}, because an older version of rollwalk \
                wrote the {what}"
            ),
            None => version.to_string(),
        };
        fault("version", &header.version, expected)
    }

    /// Creates the error for an impossible value.
    pub fn fault(
        &self,
        file: &str,
        path: &str,
        value: &str,
        expected: impl Into<String>,
    ) -> JsonError {
        JsonError::Value {
            file: file.to_owned(),
            path: path.to_owned(),
            value: Printable(&cut(value, WORDS_MAX)).to_string(),
            expected: expected.into(),
            help: self.help,
        }
    }
}

/// Describes a syntax error. NaN and Infinity, the most likely cause, have their own message.
fn not_json(text: &str, error: &serde_json::Error) -> &'static str {
    let line = text.lines().nth(error.line().saturating_sub(1)).unwrap_or_default();
    // The reader may stop within the word.
    let before = error.column().saturating_sub(1 + "-Infinity".len());
    let near = line.as_bytes().get(before..).unwrap_or_default();
    let near = String::from_utf8_lossy(&near[..near.len().min(2 * "-Infinity".len())]);
    match ["NaN", "Infinity"].iter().any(|word| near.contains(word)) {
        true => "NaN and Infinity are not numbers in JSON",
        false => "this is not JSON",
    }
}

/// Returns the message without serde_json's trailing position. The error contains the position as fields.
fn without_position(error: &serde_json::Error) -> String {
    let message = error.to_string();
    message.rsplit_once(" at line ").map_or(message.clone(), |(head, _)| head.to_owned())
}

/// Rewrites serde's message about the value at a path in terms of the file. Messages of Rollwalk's own readers are unchanged.
fn in_words(path: &str, message: &str) -> String {
    let (start, subject) = match path {
        "." => (String::new(), "the file"),
        path => (format!("{path}: "), path),
    };
    let after = |beginning: &str| message.strip_prefix(beginning);
    let named = |rest: &str| {
        let (name, rest) =
            rest.rsplit_once("`, expected ").unwrap_or((rest.trim_end_matches('`'), ""));
        // Every second piece is in backticks.
        let known: Vec<_> = rest.split('`').skip(1).step_by(2).map(str::to_owned).collect();
        (name.to_owned(), known)
    };
    let likely = |(name, known): &(String, Vec<String>)| {
        alternatives(&cut(name, VALUE_MAX), known.iter().map(String::as_str).collect::<Vec<_>>())
    };
    let wrong = after("invalid type: ").or(after("invalid value: "));
    if let Some((found, wanted)) = wrong.and_then(|rest| rest.rsplit_once(", expected ")) {
        format!("{subject} is {}; expected {}", describe_value(found), describe_type(wanted))
    } else if let Some((length, wanted)) =
        after("invalid length ").and_then(|rest| rest.split_once(", expected "))
    {
        format!("{subject} is a list of length {length}; expected {}", describe_type(wanted))
    } else if let Some(rest) = after("missing field `") {
        format!("{start}`{}` is missing", named(rest).0)
    } else if let Some(rest) = after("duplicate field `") {
        format!("{start}`{}` is given twice", named(rest).0)
    } else if let Some(rest) = after("unknown field `") {
        let field = named(rest);
        // The path leads to the unknown field itself.
        let parent = path.strip_suffix(&field.0).unwrap_or(path).trim_end_matches('.');
        let start = if parent.is_empty() { "" } else { &format!("{parent}: ") };
        format!("{start}unknown field `{}`; {}", cut(&field.0, VALUE_MAX), likely(&field))
    } else if let Some(rest) = after("unknown variant `") {
        let word = named(rest);
        format!("{subject} is \"{}\"; {}", cut(&word.0, VALUE_MAX), likely(&word))
    } else if message == "expected value" {
        format!("{subject} has the wrong type; expected {}", describe_type("string or map"))
    } else if message == "number out of range" {
        format!("{subject} is out of range; expected a number within ±1.8e308")
    } else {
        format!("{start}{message}")
    }
}

/// Converts serde's description of a value to the notation of the file.
fn describe_value(found: &str) -> String {
    let value = |kind: &str| found.strip_prefix(kind)?.strip_suffix('`').map(str::to_owned);
    match found {
        "sequence" => "a list".to_owned(),
        "map" => "an object".to_owned(),
        _ => ["boolean `", "integer `", "floating point `"]
            .into_iter()
            .find_map(value)
            .unwrap_or_else(|| cut(found.strip_prefix("string ").unwrap_or(found), VALUE_MAX)),
    }
}

/// Translates serde's name of an expected type into terms of JSON.
fn describe_type(wanted: &str) -> String {
    if let Some(count) = wanted.strip_prefix("an array of length ") {
        return format!("a list of length {count}");
    }
    let word = match wanted.split_once(' ').map_or(wanted, |(word, _)| word) {
        "f64" | "f32" => "a number",
        "u8" => "a whole number from 0 to 255",
        "u16" | "u32" | "u64" | "usize" => "a whole number of 0 or more",
        "struct" | "internally" => "an object",
        "enum" | "variant" | "unit" => "a word in quotes",
        _ => match wanted {
            "a boolean" => "true or false",
            "a string" | "a borrowed string" => "text in quotes",
            "a sequence" => "a list",
            "a map" => "an object",
            _ if wanted.starts_with("a nonzero ") => "a whole number above 0",
            "string or map" => "a word in quotes or an object",
            _ => wanted,
        },
    };
    word.to_owned()
}

/// Shortens a text to `most` characters.
fn cut(text: &str, most: usize) -> String {
    match text.char_indices().nth(most) {
        Some((at, _)) => format!("{}…", &text[..at]),
        None => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    const FORMAT: Format = Format {
        name: "thing",
        version: 2,
        what: "thing",
        make_again: "make it again",
        help: "see the book",
    };

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(rename_all = "snake_case")]
    enum Colour {
        Red,
        Green,
    }

    #[derive(Debug, Deserialize)]
    #[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
    #[expect(dead_code, reason = "read from files only")]
    enum Shape {
        Ball { radius_m: f64 },
    }

    #[derive(Debug, Deserialize)]
    #[serde(deny_unknown_fields)]
    #[expect(dead_code, reason = "read from files only")]
    struct Example {
        format: String,
        version: u32,
        sizes_m: Vec<[f64; 3]>,
        colour: Colour,
        shape: Shape,
        named: BTreeMap<u8, bool>,
        count: u64,
        note: Option<String>,
    }

    const GOOD: &str = r#"{"format": "thing", "version": 2, "sizes_m": [[1, 2, 3], [4, 5, 6]], "colour": "red",
        "shape": {"kind": "ball", "radius_m": 1}, "named": {"7": true}, "count": 5, "note": null}"#;

    fn refused(text: &str) -> String {
        let error = FORMAT.read::<Example>("x.json", text).unwrap_err();
        assert_eq!(error.help().unwrap().to_string(), FORMAT.help);
        error.to_string()
    }

    #[test]
    fn every_slip_is_told_in_words_of_the_file() {
        FORMAT.read::<Example>("x.json", GOOD).unwrap();
        for (from, to, expected) in [
            (
                "[1, 2, 3]",
                "[1, \"2\", 3]",
                "x.json:1:53: sizes_m[0][1] is \"2\"; expected a number",
            ),
            (
                "[1, 2, 3]",
                "[1, 2]",
                "sizes_m[0] is a list of length 2; expected a list of length 3",
            ),
            ("[1, 2, 3]", "[1, true, 2]", "sizes_m[0][1] is true; expected a number"),
            ("[[1, 2, 3], [4, 5, 6]]", "{}", "sizes_m is an object; expected a list"),
            (
                "\"red\"",
                "\"gren\"",
                "colour is \"gren\"; did you mean `green`? valid names: `red`, `green`",
            ),
            ("\"red\"", "7", "colour has the wrong type; expected a word in quotes or an object"),
            ("\"ball\"", "\"cube\"", "shape.kind is \"cube\"; valid names: `ball`"),
            (
                "\"radius_m\": 1",
                "\"radius_mm\": 1",
                "shape: unknown field `radius_mm`; did you mean `radius_m`?",
            ),
            ("\"kind\": \"ball\", ", "", "shape: `kind` is missing"),
            (", \"radius_m\": 1", "", "shape: `radius_m` is missing"),
            ("true", "0.5", "named.7 is 0.5; expected true or false"),
            ("\"count\": 5", "\"count\": -5", "count is -5; expected a whole number of 0 or more"),
            (
                "\"count\": 5",
                "\"cuont\": 5",
                "x.json:2:79: unknown field `cuont`; did you mean `count`?",
            ),
            ("\"count\": 5", "\"count\": 5, \"count\": 6", "`count` is given twice"),
            ("\"count\": 5, ", "", "`count` is missing"),
            ("null", "[]", "note is a list; expected text in quotes"),
            ("1, 2, 3", "1, 1e999, 3", "sizes_m[0][1] is out of range; expected a number"),
            ("null", "NaN", "NaN and Infinity are not numbers in JSON"),
            (
                "\"version\": 2",
                "\"version\": 1",
                "version is 1; expected 2: make it again, because an older version",
            ),
            ("\"version\": 2", "\"version\": {}", "version is {}; expected 2"),
            ("\"format\": \"thing\", ", "", "format is missing; expected \"thing\""),
            (GOOD, "[]", "x.json: format is missing"),
            (GOOD, "7", "the file is 7; expected an object"),
        ] {
            assert!(GOOD.contains(from), "{from}");
            let message = refused(&GOOD.replacen(from, to, 1));
            assert!(message.contains(expected), "{from} -> {to}:\n{message}\n{expected}");
            assert!(message.starts_with("x.json:"), "{message}");
        }
    }

    #[test]
    fn what_strangers_wrote_is_short_and_without_escapes() {
        let long = format!("\u{1b}[2J{}", "x`, ".repeat(10_000));
        for hostile in [
            GOOD.replace("\"count\"", &format!("\"{}\"", long.replace('\u{1b}', "\\u001b"))),
            GOOD.replace("\"red\"", &format!("\"{}\"", long.replace('\u{1b}', "\\u001b"))),
            GOOD.replace("\"thing\"", &format!("\"{}\"", long.replace('\u{1b}', "\\u001b"))),
            GOOD.replace("null", "[\"\\u202e\"]"),
        ] {
            let message = refused(&hostile);
            assert!(message.len() < 500, "{message}");
            assert!(!message.contains(['\u{1b}', '\u{202e}']), "{message:?}");
        }
    }
}
