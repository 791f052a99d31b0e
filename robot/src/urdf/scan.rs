//! First pass over XML text, in linear time. The parser compares the attributes of an element pairwise and copies all
//! namespaces for each element that declares one. This pass bounds both, and the length of names.

use crate::document::{Fault, Span};
use std::collections::BTreeSet;

/// Maximum number of attributes of an element. Elements of MuJoCo have some forty.
const ATTRIBUTES_MAX: usize = 200;
/// Maximum number of attributes of a file, which bounds the memory of the tree.
const ALL_ATTRIBUTES_MAX: usize = 500_000;
/// Maximum number of declared namespaces in a file.
const NAMESPACES_MAX: usize = 64;
/// Maximum depth of elements.
const DEPTH_MAX: usize = 1000;
/// Maximum length of a name, bytes.
const NAME_MAX: usize = 500;
/// Attributes that are names or words, not lists of numbers.
const NAMES: [&str; 11] = [
    "name",
    "class",
    "childclass",
    "joint",
    "joint1",
    "joint2",
    "jointinparent",
    "link",
    "type",
    "model",
    "eulerseq",
];

/// Results of the pass.
#[derive(Debug, Default)]
pub(super) struct Scan<'t> {
    /// End of the name in the first start tag, if it is `<robot`.
    pub after_robot: Option<usize>,
    /// Prefixes that names use without a declaration in the first element.
    pub prefixes: BTreeSet<&'t str>,
}

/// Position in the text, and counts up to it.
struct Scanner<'t> {
    text: &'t str,
    at: usize,
    depth: usize,
    attributes: usize,
    namespaces: usize,
    /// Prefixes declared in the first element.
    declared: BTreeSet<&'t str>,
    elements: usize,
    found: Scan<'t>,
}

/// Exceeded bound: location, message and help.
type Excess = (Span, String, String);

/// Scans a text up to the first syntax error.
///
/// # Errors
/// The first exceeded bound.
pub(super) fn scan(text: &str) -> Result<Scan<'_>, Fault> {
    let mut scanner = Scanner {
        text,
        at: 0,
        depth: 0,
        attributes: 0,
        namespaces: 0,
        declared: BTreeSet::new(),
        elements: 0,
        found: Scan::default(),
    };
    let fault = |(span, message, help)| Fault::new(text, span, message, "here", help);
    while scanner.next().map_err(fault)?.is_some() {}
    let Scanner { mut found, declared, .. } = scanner;
    found.prefixes.retain(|prefix| !declared.contains(prefix));
    Ok(found)
}

impl<'t> Scanner<'t> {
    /// Skips the next markup. Returns `None` at the end.
    fn next(&mut self) -> Result<Option<()>, Excess> {
        let Some(start) = self.skip_to("<") else { return Ok(None) };
        let rest = &self.text[start..];
        let past =
            |end: &str| Ok(self.text[start..].find(end).map(|length| start + length + end.len()));
        let end: Result<_, Excess> = if rest.starts_with("<!--") {
            past("-->")
        } else if rest.starts_with("<![CDATA[") {
            past("]]>")
        } else if rest.starts_with("<?") {
            past("?>")
        } else if rest.starts_with("</") {
            self.depth = self.depth.saturating_sub(1);
            past(">")
        } else {
            self.start_tag(start)
        };
        Ok(end?.map(|end| self.at = end))
    }

    /// Position of the next `mark`.
    fn skip_to(&mut self, mark: &str) -> Option<usize> {
        self.at += self.text[self.at..].find(mark)?;
        Some(self.at)
    }

    /// Name at a position.
    fn name(&self, at: usize) -> Result<&'t str, Excess> {
        let rest = &self.text[at..];
        let ends =
            |c: char| c.is_ascii_whitespace() || matches!(c, '=' | '>' | '/' | '<' | '"' | '\'');
        let name = &rest[..rest.find(ends).unwrap_or(rest.len())];
        if name.len() > NAME_MAX {
            let message = format!("a name has {} bytes", name.len());
            return Err((at..at, message, format!("names have at most {NAME_MAX} bytes")));
        }
        Ok(name)
    }

    fn skip_blanks(&self, at: usize) -> usize {
        self.text.len() - self.text[at..].trim_ascii_start().len()
    }

    /// End of the start tag at `start`; `None` for other text.
    fn start_tag(&mut self, start: usize) -> Result<Option<usize>, Excess> {
        let tag = self.name(start + 1)?;
        let mut at = start + 1 + tag.len();
        let is_first = self.elements == 0;
        self.elements += 1;
        if is_first && tag == "robot" {
            self.found.after_robot = Some(at);
        }
        self.uses(tag);
        let mut count = 0;
        loop {
            at = self.skip_blanks(at);
            let rest = &self.text[at..];
            if rest.starts_with("/>") {
                return Ok(Some(at + 2));
            }
            if rest.starts_with('>') {
                self.depth += 1;
                if self.depth > DEPTH_MAX {
                    let message = format!("more than {DEPTH_MAX} elements are inside each other");
                    let help =
                        "check the path: elements of a robot are a few levels deep".to_owned();
                    return Err((start..at, message, help));
                }
                return Ok(Some(at + 1));
            }
            let name = self.name(at)?;
            let value = self.skip_blanks(at + name.len());
            let Some(rest) = self.text[value..].strip_prefix('=') else { return Ok(None) };
            let open = self.text.len() - rest.trim_ascii_start().len();
            let Some(quote @ ('"' | '\'')) = self.text[open..].chars().next() else {
                return Ok(None);
            };
            let Some(length) = self.text[open + 1..].find(quote) else { return Ok(None) };
            count += 1;
            self.attribute(tag, at, name, length)?;
            if count > ATTRIBUTES_MAX {
                let message = format!("<{tag}> has more than {ATTRIBUTES_MAX} attributes");
                let help =
                    format!("check the path: an element has at most {ATTRIBUTES_MAX} attributes");
                return Err((start..start + 1 + tag.len(), message, help));
            }
            if is_first && let Some(prefix) = name.strip_prefix("xmlns:") {
                self.declared.insert(prefix);
            }
            at = open + 1 + length + 1;
        }
    }

    /// Counts an attribute at a position, whose value has `length` bytes.
    fn attribute(
        &mut self,
        tag: &str,
        at: usize,
        name: &'t str,
        length: usize,
    ) -> Result<(), Excess> {
        let span = at..at + name.len();
        if NAMES.contains(&name) && length > NAME_MAX {
            let message = format!("<{tag}>: `{name}` has {length} bytes");
            return Err((span, message, format!("names have at most {NAME_MAX} bytes")));
        }
        self.attributes += 1;
        if self.attributes > ALL_ATTRIBUTES_MAX {
            let message = format!("the file has more than {ALL_ATTRIBUTES_MAX} attributes");
            let help = "check the path: a robot has a few thousand attributes".to_owned();
            return Err((span, message, help));
        }
        if name == "xmlns" || name.starts_with("xmlns:") {
            self.namespaces += 1;
            if self.namespaces > NAMESPACES_MAX {
                let message =
                    format!("the file declares more than {NAMESPACES_MAX} namespaces (`xmlns`)");
                let help = "remove the declarations: URDF and MJCF need none".to_owned();
                return Err((span, message, help));
            }
        } else {
            self.uses(name);
        }
        Ok(())
    }

    /// Notes the prefix of a name.
    fn uses(&mut self, name: &'t str) {
        if let Some((prefix, _)) = name.split_once(':')
            && !prefix.is_empty()
            && prefix != "xml"
            && self.found.prefixes.len() < NAMESPACES_MAX
        {
            self.found.prefixes.insert(prefix);
        }
    }
}
