//! Writer of XML elements with attributes, indented, with exact numbers.

use nalgebra::Vector3;
use quick_xml::Writer;
use quick_xml::events::{BytesStart, BytesText, Event};
use std::io;

/// Document under construction.
pub struct Xml(Writer<Vec<u8>>);

impl Xml {
    /// Creates an empty document that begins with a comment.
    pub fn new(comment: &str) -> io::Result<Self> {
        let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
        // Two hyphens would end a comment.
        let comment = format!(" {} ", comment.replace("--", "- -"));
        writer.write_event(Event::Comment(BytesText::from_escaped(comment)))?;
        Ok(Self(writer))
    }

    /// Writes an element without content.
    pub fn empty(&mut self, name: &str, attributes: &[(&str, String)]) -> io::Result<()> {
        self.0.write_event(Event::Empty(start(name, attributes)))
    }

    /// Writes an element around the output of `content`.
    pub fn element(
        &mut self,
        name: &str,
        attributes: &[(&str, String)],
        content: impl FnOnce(&mut Self) -> io::Result<()>,
    ) -> io::Result<()> {
        let start = start(name, attributes);
        self.0.write_event(Event::Start(start.borrow()))?;
        content(self)?;
        self.0.write_event(Event::End(start.to_end()))
    }

    /// Writes an element around a text.
    pub fn text(
        &mut self,
        name: &str,
        attributes: &[(&str, String)],
        text: &str,
    ) -> io::Result<()> {
        self.element(name, attributes, |xml| xml.0.write_event(Event::Text(BytesText::new(text))))
    }

    /// Returns the document as text.
    pub fn finish(self) -> String {
        // Names and numbers went in as text.
        String::from_utf8(self.0.into_inner()).unwrap_or_default() + "\n"
    }
}

fn start<'n>(name: &'n str, attributes: &[(&str, String)]) -> BytesStart<'n> {
    let attributes = attributes.iter().map(|(key, value)| (*key, value.as_str()));
    BytesStart::new(name).with_attributes(attributes)
}

/// Numbers separated by blanks, in the shortest form that reads back exactly, without negative zeros.
pub fn numbers<'v>(values: impl IntoIterator<Item = &'v f64>) -> String {
    let values: Vec<_> = values.into_iter().map(|value| (value + 0.0).to_string()).collect();
    values.join(" ")
}

/// The components of a vector.
pub fn vector(v: &Vector3<f64>) -> String {
    numbers(v.iter())
}
