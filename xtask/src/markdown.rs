//! Parser of Markdown pages, for checks and for the book: headings with their anchors, links, code blocks and code spans, each
//! with its position in the text.

use pulldown_cmark::{CodeBlockKind, Event, Options, Parser, Tag, TagEnd};
use std::collections::BTreeMap;
use std::ops::Range;

#[derive(Debug, Default, PartialEq, Eq)]
pub struct Page {
    pub headings: Vec<Heading>,
    /// Links and images, in order.
    pub links: Vec<Link>,
    /// Code blocks with a language, in order.
    pub blocks: Vec<Block>,
    /// Code spans in order: line, counted from 1, and text.
    pub spans: Vec<(usize, String)>,
}

#[derive(Debug, PartialEq, Eq)]
pub struct Heading {
    /// Level: 1 for the title, higher for subsections.
    pub level: usize,
    /// Anchor of the heading: text behind `#` in links, by the rules of git hosts and mdBook.
    pub anchor: String,
    /// Byte range of the heading in the page.
    pub place: Range<usize>,
}

/// Link or image.
#[derive(Debug, PartialEq, Eq)]
pub struct Link {
    /// Line, counted from 1.
    pub line: usize,
    /// Destination, as written.
    pub to: String,
    /// Text of the link, without markup.
    pub text: String,
    /// Byte range of the destination in the page; `None` if the destination is not directly behind the text.
    pub place: Option<Range<usize>>,
}

/// Code block.
#[derive(Debug, PartialEq, Eq)]
pub struct Block {
    /// Number of the first line of code, counted from 1.
    pub line: usize,
    /// Text behind the opening fence: a language, and optional marks for tests.
    pub info: String,
    /// Byte range of the marks, with the preceding blank; empty without marks.
    pub marks: Range<usize>,
    pub code: String,
}

impl Page {
    pub fn parse(text: &str) -> Self {
        let mut page = Self::default();
        let mut used: BTreeMap<String, usize> = BTreeMap::new();
        let line = |at: usize| text[..at].matches('\n').count() + 1;
        // Text since the start of the heading, link or block.
        let (mut heading, mut link, mut code) = (String::new(), String::new(), String::new());
        // Open links and blocks: line, and destination or info. An image may be the text of a link.
        let mut open: Vec<(usize, String)> = Vec::new();
        let events = Parser::new_ext(text, Options::ENABLE_TABLES | Options::ENABLE_STRIKETHROUGH);
        for (event, place) in events.into_offset_iter() {
            match event {
                Event::Start(Tag::Heading { .. }) => heading.clear(),
                Event::End(TagEnd::Heading(level)) => {
                    let anchor = distinct(anchor(&heading), &mut used);
                    page.headings.push(Heading { level: level as usize, anchor, place });
                }
                Event::Start(Tag::Link { dest_url, .. } | Tag::Image { dest_url, .. }) => {
                    link.clear();
                    open.push((line(place.start), dest_url.into_string()));
                }
                Event::End(TagEnd::Link | TagEnd::Image) => {
                    if let Some((line, to)) = open.pop() {
                        // The destination ends the link; its text may contain the same letters.
                        let at = text[place.clone()].rfind(&format!("]({to}"));
                        let place = at.map(|at| place.start + at + 2).map(|at| at..at + to.len());
                        page.links.push(Link { line, to, text: link.clone(), place });
                    }
                }
                Event::Start(Tag::CodeBlock(kind)) => {
                    code.clear();
                    let info = match kind {
                        CodeBlockKind::Fenced(info) => info.into_string(),
                        CodeBlockKind::Indented => String::new(),
                    };
                    open.push((line(place.start) + 1, info));
                }
                Event::End(TagEnd::CodeBlock) => {
                    if let Some((line, info)) = open.pop() {
                        let fence = text[place.clone()].lines().next().unwrap_or_default();
                        let end = place.start + fence.len();
                        let language = info.split(' ').next().unwrap_or_default();
                        let marks = end - (info.len() - language.len())..end;
                        page.blocks.push(Block { line, info, marks, code: code.clone() });
                    }
                }
                Event::Code(span) => {
                    heading.push_str(&span);
                    link.push_str(&span);
                    page.spans.push((line(place.start), span.into_string()));
                }
                Event::Text(part) => {
                    heading.push_str(&part);
                    link.push_str(&part);
                    code.push_str(&part);
                }
                _ => {}
            }
        }
        page
    }

    /// Heading with the given anchor, and the byte range from it to the next heading of the same or a higher level.
    pub fn section(&self, anchor: &str, text: &str) -> Option<(&Heading, Range<usize>)> {
        let at = self.headings.iter().position(|heading| heading.anchor == anchor)?;
        let heading = &self.headings[at];
        let next = self.headings[at + 1..].iter().find(|other| other.level <= heading.level);
        let end = next.map_or(text.len(), |next| next.place.start);
        Some((heading, heading.place.start..end))
    }
}

/// Anchor of a heading: its letters in lower case, blanks as `-`, without punctuation.
pub fn anchor(heading: &str) -> String {
    let kept = |c: char| match c {
        ' ' => Some('-'),
        '-' | '_' => Some(c),
        _ => c.is_alphanumeric().then_some(c),
    };
    heading.trim().to_lowercase().chars().filter_map(kept).collect()
}

/// Makes an anchor unique by a number if the page already has it.
fn distinct(anchor: String, used: &mut BTreeMap<String, usize>) -> String {
    let count = used.entry(anchor.clone()).or_default();
    *count += 1;
    if *count == 1 { anchor } else { format!("{anchor}-{}", *count - 1) }
}

/// Resolves a link on the page `from` to the path of a file and an anchor; an empty path in the link stands for the page
/// itself. Returns `None` for links outside of the checkout.
pub fn target(from: &str, to: &str) -> Option<(String, String)> {
    let has_scheme = to.split(['/', '#']).next().is_some_and(|head| head.contains(':'));
    if has_scheme {
        return None;
    }
    let (path, anchor) = to.split_once('#').unwrap_or((to, ""));
    if path.is_empty() {
        return Some((from.into(), anchor.into()));
    }
    let mut parts: Vec<&str> = from.split('/').collect();
    parts.pop();
    for part in path.split('/') {
        match part {
            "." | "" => {}
            ".." => drop(parts.pop()),
            name => parts.push(name),
        }
    }
    Some((parts.join("/"), anchor.into()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn anchors_are_those_of_git_hosts() {
        for (heading, expected) in [
            ("Dynamixel Protocol 2.0", "dynamixel-protocol-20"),
            ("[actuator.NAME]", "actuatorname"),
            ("Status, FAULT", "status-fault"),
            ("snake_case and–dash", "snake_case-anddash"),
        ] {
            assert_eq!(anchor(heading), expected);
        }
        let page = Page::parse("# A\n## B\n## `B`\n");
        let anchors: Vec<_> = page.headings.iter().map(|one| one.anchor.as_str()).collect();
        assert_eq!(anchors, ["a", "b", "b-1"]);
    }

    #[test]
    fn links_spans_and_blocks_have_their_places() {
        let text = "# T\n\nsee [`x` y](a.md#b), ![i](i.svg)\n\n```sh not-run: r\nls # z\n```\n\n<https://x.org>\n";
        let page = Page::parse(text);
        let found: Vec<_> = page
            .links
            .iter()
            .map(|link| (link.line, link.to.as_str(), link.text.as_str()))
            .collect();
        assert_eq!(
            found,
            [(3, "a.md#b", "x y"), (3, "i.svg", "i"), (9, "https://x.org", "https://x.org")]
        );
        assert_eq!(&text[page.links[0].place.clone().unwrap()], "a.md#b");
        assert_eq!(page.links[2].place, None);
        let (block, code) = (&page.blocks[0], "ls # z\n");
        assert_eq!((block.line, &*block.info, &*block.code), (6, "sh not-run: r", code));
        assert_eq!(&text[block.marks.clone()], " not-run: r");
        assert_eq!(page.spans, [(3, "x".to_owned())]);
    }

    #[test]
    fn a_section_ends_before_the_next_of_its_level() {
        let text = "# T\n## A\na\n### C\nc\n## B\n";
        let page = Page::parse(text);
        let (heading, place) = page.section("a", text).unwrap();
        assert_eq!((heading.level, &text[place]), (2, "## A\na\n### C\nc\n"));
        assert_eq!(page.section("z", text), None);
    }

    #[test]
    fn links_lead_from_the_folder_of_their_page() {
        let to = |path: &str, anchor: &str| Some((path.to_owned(), anchor.to_owned()));
        assert_eq!(target("docs/a.md", "../robots/pup.toml"), to("robots/pup.toml", ""));
        assert_eq!(target("docs/a.md", "#b"), to("docs/a.md", "b"));
        assert_eq!(target("README.md", "docs/a.md#b"), to("docs/a.md", "b"));
        assert_eq!(target("README.md", "https://x.org/#b"), None);
    }
}
