//! The book that `docs/SUMMARY.md` orders: its chapters are documents of the checkout, where they are, or sections of them.
//!
//! A document is written once and for a git host, too: its links lead to files of the checkout. The book moves chapters next to
//! each other, so that links are rewritten. A section that the summary lists has a page of its own in the book; its document keeps
//! the heading and a link.

use crate::checkout::TextFile;
use crate::markdown::{Page, target};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// The table of contents.
pub const SUMMARY: &str = "docs/SUMMARY.md";

/// The first page, which the book calls `index`.
const LANDING: &str = "docs/README.md";

#[derive(Debug, PartialEq, Eq)]
pub struct Chapter {
    /// Document that it comes from.
    pub path: String,
    /// Anchor of the section that it is; empty for the whole document.
    pub section: String,
    /// File in the book.
    pub file: String,
    title: String,
}

/// A document of the checkout.
struct Document<'a> {
    text: &'a str,
    page: Page,
}

/// The chapters and what they come from.
pub struct Book<'a> {
    /// Chapters, in the summary's order.
    pub chapters: Vec<Chapter>,
    documents: BTreeMap<&'a str, Document<'a>>,
}

/// A chapter as the book has it.
pub struct Written {
    /// Markdown, with links as the book needs them.
    pub text: String,
    /// Files of the checkout, no chapters, to which it links.
    pub files: BTreeSet<String>,
}

impl<'a> Book<'a> {
    /// Reads the summary and its documents.
    ///
    /// # Errors
    /// All faults of the summary: entries that lead nowhere, chapters of the same name, pages of `docs/` that it leaves out.
    pub fn read(files: &'a [TextFile]) -> Result<Self, String> {
        let documents = files.iter().filter(|file| file.path.ends_with(".md"));
        let documents: BTreeMap<&str, Document> = documents
            .map(|file| {
                let document = Document { text: &file.text, page: Page::parse(&file.text) };
                (file.path.as_str(), document)
            })
            .collect();
        let summary = documents.get(SUMMARY).ok_or_else(|| format!("{SUMMARY} is missing"))?;
        let (mut chapters, mut faults) = (Vec::<Chapter>::new(), Vec::new());
        for link in &summary.page.links {
            let place = format!("{SUMMARY}:{}: `{}`", link.line, link.to);
            let Some((path, section)) = target(SUMMARY, &link.to) else {
                faults.push(format!("{place} is outside of the checkout"));
                continue;
            };
            let is_there = documents.get(&*path).is_some_and(|document| {
                section.is_empty() || document.page.section(&section, document.text).is_some()
            });
            let file = file_of(&path, &section);
            if !is_there {
                faults.push(format!("{place} is no document, or no section of one"));
            } else if let Some(other) = chapters.iter().find(|other| other.file == file) {
                faults.push(format!(
                    "{place} and `{}` would both be `{file}` in the book; rename one",
                    other.path
                ));
            } else {
                chapters.push(Chapter { path, section, file, title: link.text.clone() });
            }
        }
        for path in documents.keys().filter(|path| path.starts_with("docs/") && **path != SUMMARY) {
            if !chapters.iter().any(|chapter| chapter.path == *path) {
                faults.push(format!("{SUMMARY} leaves out `{path}`"));
            }
        }
        if faults.is_empty() { Ok(Self { chapters, documents }) } else { Err(faults.join("\n")) }
    }

    /// The summary, with the chapters' files in the book.
    pub fn summary(&self) -> String {
        let summary = &self.documents[SUMMARY];
        let places = summary.page.links.iter().filter_map(|link| link.place.clone());
        let files = self.chapters.iter().map(|chapter| chapter.file.clone());
        edited(summary.text, 0..summary.text.len(), places.zip(files).collect())
    }

    /// A chapter as the book has it.
    ///
    /// # Errors
    /// A link to a document that is not in the book.
    pub fn written(&self, chapter: &Chapter) -> Result<Written, String> {
        let Document { text, page } = &self.documents[&*chapter.path];
        let part = self.part(chapter);
        let apart = self.chapters.iter().filter(|one| {
            let inside = self.part(one);
            one.path == chapter.path && inside != part && part.contains(&inside.start)
        });
        let mut edits: Vec<(Range<usize>, String)> = apart
            .map(|one| {
                let (heading, section) = page.section(&one.section, text).expect("it was read");
                let link =
                    format!("\nIt has a page of its own: [{}]({}).\n\n", one.title, one.file);
                (heading.place.end..section.end, link)
            })
            .collect();
        let is_here = {
            let apart = edits.clone();
            move |at: usize| {
                part.contains(&at) && !apart.iter().any(|(section, _)| section.contains(&at))
            }
        };
        if let Some((title, section)) = page.section(&chapter.section, text) {
            let inside = page.headings.iter().filter(|one| section.contains(&one.place.start));
            let marks = inside.map(|one| one.place.start..one.place.start + title.level - 1);
            edits.extend(marks.map(|marks| (marks, String::new())));
        }
        // Marks are for tests; mdBook would make classes of them.
        edits.extend(page.blocks.iter().map(|block| (block.marks.clone(), String::new())));
        let mut files = BTreeSet::new();
        for link in &page.links {
            let Some(place) = link.place.clone().filter(|place| is_here(place.start)) else {
                continue;
            };
            let Some((to, anchor)) = target(&chapter.path, &link.to) else { continue };
            let file = match self.located(&to, &anchor) {
                Some(file) => file,
                None if to.ends_with(".md") => {
                    return Err(format!(
                        "{}:{}: {SUMMARY} leaves out `{to}`, to which this links",
                        chapter.path, link.line
                    ));
                }
                None => {
                    files.insert(to.clone());
                    copied(&to)
                }
            };
            edits.push((place, file));
        }
        Ok(Written { text: edited(text, self.part(chapter), edits), files })
    }

    /// Bytes of a chapter in its document.
    fn part(&self, chapter: &Chapter) -> Range<usize> {
        let Document { text, page } = &self.documents[&*chapter.path];
        page.section(&chapter.section, text).map_or(0..text.len(), |(_, section)| section)
    }

    /// Where the book has an anchor of a document.
    fn located(&self, path: &str, anchor: &str) -> Option<String> {
        let Document { text, page } = self.documents.get(path)?;
        let place = page.section(anchor, text).map(|(heading, _)| heading.place.start);
        let is_of = |section: &str, at| {
            page.section(section, text).is_some_and(|(_, place)| place.contains(&at))
        };
        let own = self.chapters.iter().find(|chapter| {
            chapter.path == path && place.is_some_and(|at| is_of(&chapter.section, at))
        });
        let whole = || self.chapters.iter().find(|one| one.path == path && one.section.is_empty());
        let chapter = own.or_else(whole)?;
        let is_title = anchor.is_empty() || anchor == chapter.section;
        Some(if is_title { chapter.file.clone() } else { format!("{}#{anchor}", chapter.file) })
    }
}

/// File of a chapter in the book, where all lie beside each other.
fn file_of(path: &str, section: &str) -> String {
    if !section.is_empty() {
        return format!("{section}.md");
    }
    if path == LANDING {
        return "index.md".into();
    }
    let name = path.strip_prefix("docs/").unwrap_or(path);
    // A folder's README is about the folder, and the first one about the whole.
    match name.strip_suffix("README.md") {
        Some("") => "rollwalk.md".into(),
        Some(folder) => format!("{}.md", folder.trim_end_matches('/').replace('/', "-")),
        None => name.to_lowercase().replace('/', "-"),
    }
}

/// Where the book has the copy of a file of the checkout.
pub fn copied(path: &str) -> String {
    format!("files/{path}")
}

/// A part of a text with some places replaced; of places in each other, the outer one counts.
fn edited(text: &str, part: Range<usize>, mut edits: Vec<(Range<usize>, String)>) -> String {
    edits.sort_by_key(|(place, _)| (place.start, std::cmp::Reverse(place.end)));
    let (mut written, mut at) = (String::new(), part.start);
    for (place, instead) in edits {
        if place.start >= at && place.end <= part.end {
            written.push_str(&text[at..place.start]);
            written.push_str(&instead);
            at = place.end;
        }
    }
    written + &text[at..part.end]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checkout::file;

    const README: &str = "# Pup\n\n[a](docs/a.md#deep)\n\n## Begin\n\n[f](pup.toml)\n\n### Sub\n\nx\n\n## End\n\n[s](#sub)\n";

    fn files(summary: &str) -> [TextFile; 4] {
        [
            file(SUMMARY, summary),
            file(LANDING, "# Landing\n[r](../README.md#begin) [s](../README.md#sub)\n"),
            file("docs/a.md", "# A\n## Deep\n```sh not-run: why\nls\n```\n"),
            file("README.md", README),
        ]
    }

    #[test]
    fn sections_become_pages_and_links_follow() {
        let files = files(
            "# Summary\n[L](README.md)\n- [Go](../README.md#begin)\n- [R](../README.md)\n- [A](a.md)\n",
        );
        let book = Book::read(&files).unwrap();
        assert_eq!(
            book.summary(),
            "# Summary\n[L](index.md)\n- [Go](begin.md)\n- [R](rollwalk.md)\n- [A](a.md)\n"
        );
        let written: Vec<_> = book.chapters.iter().map(|one| book.written(one).unwrap()).collect();
        assert_eq!(written[0].text, "# Landing\n[r](begin.md) [s](begin.md#sub)\n");
        assert_eq!(written[1].text, "# Begin\n\n[f](files/pup.toml)\n\n## Sub\n\nx\n\n");
        assert_eq!(written[1].files, BTreeSet::from(["pup.toml".to_owned()]));
        assert_eq!(
            written[2].text,
            "# Pup\n\n[a](a.md#deep)\n\n## Begin\n\nIt has a page of its own: [Go](begin.md).\n\n\
             ## End\n\n[s](begin.md#sub)\n"
        );
        assert!(written[2].files.is_empty());
        assert_eq!(written[3].text, "# A\n## Deep\n```sh\nls\n```\n");
    }

    #[test]
    fn what_the_summary_lacks_or_has_twice_is_named() {
        let files = files("[L](README.md)\n[L](README.md)\n[g](gone.md)\n[g](../README.md#gone)\n");
        let faults = Book::read(&files).err().unwrap();
        let faults: Vec<_> = faults.lines().collect();
        assert_eq!(faults.len(), 4, "{faults:#?}");
        assert!(faults[0].contains("SUMMARY.md:2") && faults[0].contains("both be `index.md`"));
        assert!(faults[1].contains("`gone.md` is no document"));
        assert!(faults[3].contains("leaves out `docs/a.md`"));
    }

    #[test]
    fn a_link_to_a_document_outside_of_the_book_is_named() {
        let files = files("[L](README.md)\n[A](a.md)\n");
        let book = Book::read(&files).unwrap();
        let fault = book.written(&book.chapters[0]).err().unwrap();
        assert!(fault.starts_with("docs/README.md:2") && fault.contains("`README.md`"), "{fault}");
    }
}
