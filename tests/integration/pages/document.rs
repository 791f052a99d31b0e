//! Documents of the checkout, as code blocks and code spans.

use pulldown_cmark::{CodeBlockKind, Event, HeadingLevel, Options, Parser, Tag, TagEnd};
use rollwalk_tests::checkout;
use std::fs;
use std::path::Path;

/// Code block of a document.
pub struct Block {
    /// Line of the opening fence, counted from 1.
    pub line: usize,
    /// Number of the section with the block.
    pub section: usize,
    pub language: String,
    /// Text after the language, in the first line of the block.
    pub mark: String,
    pub code: String,
}

impl Block {
    /// Returns the shell commands with their line numbers; a line ending in `\` is joined with the next.
    pub fn commands(&self) -> Vec<(usize, String)> {
        let mut commands: Vec<(usize, String)> = Vec::new();
        let mut goes_on = false;
        for (number, line) in self.code.lines().enumerate() {
            let (text, next) = line.strip_suffix('\\').map_or((line, false), |text| (text, true));
            match commands.last_mut() {
                Some((_, command)) if goes_on => command.push_str(text),
                _ => commands.push((self.line + 1 + number, text.to_owned())),
            }
            goes_on = next;
        }
        let is_command = |line: &str| !line.trim().is_empty() && !line.starts_with('#');
        commands.retain(|(_, line)| is_command(line));
        commands
    }

    pub fn is_shell(&self) -> bool {
        self.language == "sh"
    }

    pub fn is_run(&self) -> bool {
        self.is_shell() && self.mark.is_empty()
    }
}

pub struct Document {
    /// Path from the checkout's root.
    pub path: String,
    /// Code blocks between fences, in order.
    pub blocks: Vec<Block>,
    /// Code spans, with their lines.
    pub spans: Vec<(usize, String)>,
}

impl Document {
    pub fn parse(path: &str, text: &str) -> Self {
        let (mut blocks, mut spans) = (Vec::<Block>::new(), Vec::new());
        let (mut section, mut is_code) = (0, false);
        let line = |at: usize| text[..at].matches('\n').count() + 1;
        let events = Parser::new_ext(text, Options::ENABLE_TABLES).into_offset_iter();
        for (event, place) in events {
            match event {
                Event::Start(Tag::Heading { level: HeadingLevel::H2, .. }) => section += 1,
                Event::Start(Tag::CodeBlock(CodeBlockKind::Fenced(info))) => {
                    let (language, mark) = info.split_once(' ').unwrap_or((&info, ""));
                    let (language, mark) = (language.into(), mark.trim().into());
                    let line = line(place.start);
                    blocks.push(Block { line, section, language, mark, code: String::new() });
                    is_code = true;
                }
                Event::End(TagEnd::CodeBlock) => is_code = false,
                Event::Text(code) if is_code => {
                    blocks.last_mut().expect("a fence was open").code.push_str(&code);
                }
                Event::Code(span) => spans.push((line(place.start), span.into_string())),
                _ => {}
            }
        }
        Self { path: path.into(), blocks, spans }
    }

    /// True if a command needs a robot that plays in real time.
    pub fn has_robot(&self) -> bool {
        let mut commands =
            self.blocks.iter().filter(|block| block.is_run()).flat_map(Block::commands);
        commands.any(|(_, line)| line.starts_with("rollwalk-sim "))
    }
}

/// Reads all documents of the checkout, in the order of their paths.
pub fn documents() -> Vec<Document> {
    fn find(folder: &Path, into: &mut Vec<String>) {
        let mut entries: Vec<_> =
            fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry")).collect();
        entries.sort_by_key(fs::DirEntry::file_name);
        for entry in entries {
            let name = entry.file_name().to_string_lossy().into_owned();
            if entry.path().is_dir() {
                if !name.starts_with('.') && name != "target" && name != "node_modules" {
                    find(&entry.path(), into);
                }
            } else if name.ends_with(".md") {
                let path = entry.path();
                let path = path.strip_prefix(checkout()).expect("it lies in the checkout");
                into.push(path.to_string_lossy().into_owned());
            }
        }
    }
    let mut paths = Vec::new();
    find(checkout(), &mut paths);
    let read = |path: &String| {
        let text = fs::read_to_string(checkout().join(path)).expect("a document");
        Document::parse(path, &text)
    };
    paths.iter().map(read).collect()
}
