//! Books of the site, each ordered by a summary. The chapters are documents of the checkout, or sections of them.
//!
//! A document must also work on a git host, where its links lead to files of the checkout. A book places all chapters in one
//! folder, so links are rewritten. A section that a summary lists gets a separate page in the book; its document keeps the
//! heading and a link.

use crate::checkout::TextFile;
use crate::markdown::{Page, target};
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

/// Folders of the books in the site and in `docs/`: the book for users, and the book for implementers of formats.
const FOLDERS: [&str; 2] = ["", "formats/"];

/// File name of a book's table of contents.
const SUMMARY: &str = "SUMMARY.md";

/// File name of a book's first page, which mdBook calls `index`.
const LANDING: &str = "README.md";

#[derive(Debug, PartialEq, Eq)]
pub struct Chapter {
    /// Path of the chapter's document.
    pub path: String,
    /// Anchor of the chapter's section; empty for the whole document.
    pub section: String,
    /// File name in the book.
    pub file: String,
    title: String,
}

/// Document of the checkout.
struct Document<'a> {
    text: &'a str,
    page: Page,
}

/// Book with its chapters, in the order of its summary.
pub struct Book {
    /// Folder in the site: empty, or with a slash at its end.
    pub folder: &'static str,
    pub chapters: Vec<Chapter>,
}

impl Book {
    /// Path of the summary in the checkout.
    fn summary(&self) -> String {
        format!("docs/{}{SUMMARY}", self.folder)
    }

    /// True if a chapter has this file.
    pub fn has(&self, file: &str) -> bool {
        self.chapters.iter().any(|chapter| chapter.file == file)
    }

    /// True if the book must list a document.
    fn owns(&self, path: &str) -> bool {
        let of =
            |folder: &str| path.strip_prefix("docs/").is_some_and(|path| path.starts_with(folder));
        let deeper = FOLDERS.iter().filter(|folder| folder.len() > self.folder.len());
        of(self.folder) && !deeper.into_iter().any(|folder| of(folder)) && path != self.summary()
    }
}

/// Books of the site, with the documents of their chapters.
pub struct Books<'a> {
    pub books: Vec<Book>,
    documents: BTreeMap<&'a str, Document<'a>>,
}

/// Chapter as written into the book.
pub struct ChapterText {
    /// Markdown with rewritten links.
    pub text: String,
    /// Files of the checkout that the chapter links to and that are not chapters.
    pub files: BTreeSet<String>,
}

impl<'a> Books<'a> {
    /// Reads the summaries and their documents.
    ///
    /// # Errors
    /// Returns all faults of the summaries: dead entries, chapters with the same file name, and pages of `docs/` that are not
    /// listed.
    pub fn read(files: &'a [TextFile]) -> Result<Self, String> {
        let documents = files.iter().filter(|file| file.path.ends_with(".md"));
        let documents: BTreeMap<&str, Document> = documents
            .map(|file| {
                let document = Document { text: &file.text, page: Page::parse(&file.text) };
                (file.path.as_str(), document)
            })
            .collect();
        let mut faults = Vec::new();
        let books = FOLDERS.map(|folder| book(folder, &documents, &mut faults));
        if faults.is_empty() {
            Ok(Self { books: Vec::from(books), documents })
        } else {
            Err(faults.join("\n"))
        }
    }

    /// Returns the summary of a book, with the files of the chapters in the book.
    pub fn summary(&self, book: &Book) -> String {
        let summary = &self.documents[&*book.summary()];
        let places = summary.page.links.iter().filter_map(|link| link.place.clone());
        let files = book.chapters.iter().map(|chapter| chapter.file.clone());
        edited(summary.text, 0..summary.text.len(), places.zip(files).collect())
    }

    /// Returns a chapter as written into its book.
    ///
    /// # Errors
    /// Returns an error if a link leads to a document that is not in a book.
    pub fn written(&self, book: &Book, chapter: &Chapter) -> Result<ChapterText, String> {
        let Document { text, page } = &self.documents[&*chapter.path];
        let part = self.part(chapter);
        let apart = book.chapters.iter().filter(|one| {
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
        // Marks are for tests; mdBook would turn them into classes.
        edits.extend(page.blocks.iter().map(|block| (block.marks.clone(), String::new())));
        let mut files = BTreeSet::new();
        for link in &page.links {
            let Some(place) = link.place.clone().filter(|place| is_here(place.start)) else {
                continue;
            };
            let Some((to, anchor)) = target(&chapter.path, &link.to) else { continue };
            let file = match self.located(book, &to, &anchor) {
                Some(file) => file,
                None if to.ends_with(".md") => {
                    return Err(format!(
                        "{}:{}: {} omits `{to}`, to which this line links",
                        chapter.path,
                        link.line,
                        book.summary()
                    ));
                }
                None => {
                    files.insert(to.clone());
                    copied(&to)
                }
            };
            edits.push((place, file));
        }
        Ok(ChapterText { text: edited(text, self.part(chapter), edits), files })
    }

    /// Byte range of a chapter in its document.
    fn part(&self, chapter: &Chapter) -> Range<usize> {
        let Document { text, page } = &self.documents[&*chapter.path];
        page.section(&chapter.section, text).map_or(0..text.len(), |(_, section)| section)
    }

    /// File and anchor of a document's anchor, as a chapter of `from` links to it.
    fn located(&self, from: &Book, path: &str, anchor: &str) -> Option<String> {
        let Document { text, page } = self.documents.get(path)?;
        let place = page.section(anchor, text).map(|(heading, _)| heading.place.start);
        let is_of = |section: &str, at| {
            page.section(section, text).is_some_and(|(_, place)| place.contains(&at))
        };
        let of =
            || self.books.iter().flat_map(|book| book.chapters.iter().map(move |one| (book, one)));
        let of = || of().filter(|(_, chapter)| chapter.path == path);
        let own = of().find(|(_, chapter)| place.is_some_and(|at| is_of(&chapter.section, at)));
        let (book, chapter) = own.or_else(|| of().find(|(_, one)| one.section.is_empty()))?;
        let is_title = anchor.is_empty() || anchor == chapter.section;
        let anchor = if is_title { String::new() } else { format!("#{anchor}") };
        let file = format!("{}{anchor}", chapter.file);
        let up = "../".repeat(from.folder.matches('/').count());
        Some(if from.folder == book.folder { file } else { format!("{up}{}{file}", book.folder) })
    }
}

/// Reads a book, and appends the faults of its summary to `faults`.
fn book(
    folder: &'static str,
    documents: &BTreeMap<&str, Document>,
    faults: &mut Vec<String>,
) -> Book {
    let mut book = Book { folder, chapters: Vec::new() };
    let summary = book.summary();
    let Some(contents) = documents.get(&*summary) else {
        faults.push(format!("{summary} is missing"));
        return book;
    };
    for link in &contents.page.links {
        let place = format!("{summary}:{}: `{}`", link.line, link.to);
        let Some((path, section)) = target(&summary, &link.to) else {
            faults.push(format!("{place} leads outside the checkout"));
            continue;
        };
        let is_there = documents.get(&*path).is_some_and(|document| {
            section.is_empty() || document.page.section(&section, document.text).is_some()
        });
        let file = file_of(folder, &path, &section);
        if !is_there {
            faults.push(format!("{place} is not a document or a section of a document"));
        } else if let Some(other) = book.chapters.iter().find(|other| other.file == file) {
            faults.push(format!(
                "{place} and `{}` would both be `{file}` in the book; rename one of them",
                other.path
            ));
        } else {
            book.chapters.push(Chapter { path, section, file, title: link.text.clone() });
        }
    }
    for path in documents.keys().filter(|path| book.owns(path)) {
        if !book.chapters.iter().any(|chapter| chapter.path == *path) {
            faults.push(format!("{summary} omits `{path}`"));
        }
    }
    book
}

/// File name of a chapter in the book, where all chapters are in one folder.
fn file_of(folder: &str, path: &str, section: &str) -> String {
    if !section.is_empty() {
        return format!("{section}.md");
    }
    let name = path.strip_prefix("docs/").unwrap_or(path);
    let name = name.strip_prefix(folder).unwrap_or(name);
    if name == LANDING && path != LANDING {
        return "index.md".into();
    }
    // A folder's README describes the folder, and the first README the whole project.
    match name.strip_suffix("README.md") {
        Some("") => "rollwalk.md".into(),
        Some(folder) => format!("{}.md", folder.trim_end_matches('/').replace('/', "-")),
        None => name.to_lowercase().replace('/', "-"),
    }
}

/// Path in the book of a copied file of the checkout.
pub fn copied(path: &str) -> String {
    format!("files/{path}")
}

/// Returns part of a text with some ranges replaced; if one range contains another, the outer one is replaced.
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

    fn files(summary: &str) -> [TextFile; 7] {
        [
            file("docs/SUMMARY.md", summary),
            file("docs/README.md", "# Landing\n[r](../README.md#begin) [s](../README.md#sub)\n"),
            file("docs/formats/SUMMARY.md", "[F](README.md)\n[W](wire.md)\n"),
            file("docs/formats/README.md", "# Formats\n[deep](../a.md#deep)\n"),
            file("docs/formats/wire.md", "# Wire\n[F](README.md)\n"),
            file("docs/a.md", "# A\n[w](formats/wire.md)\n## Deep\n```sh not-run: why\nls\n```\n"),
            file("README.md", README),
        ]
    }

    #[test]
    fn sections_become_pages_and_links_follow() {
        let files = files(
            "# Summary\n[L](README.md)\n- [Go](../README.md#begin)\n- [R](../README.md)\n- [A](a.md)\n",
        );
        let books = Books::read(&files).unwrap();
        let users = &books.books[0];
        assert_eq!(
            books.summary(users),
            "# Summary\n[L](index.md)\n- [Go](begin.md)\n- [R](rollwalk.md)\n- [A](a.md)\n"
        );
        let of = |book: &Book| -> Vec<ChapterText> {
            book.chapters.iter().map(|one| books.written(book, one).unwrap()).collect()
        };
        let written = of(users);
        assert_eq!(written[0].text, "# Landing\n[r](begin.md) [s](begin.md#sub)\n");
        assert_eq!(written[1].text, "# Begin\n\n[f](files/pup.toml)\n\n## Sub\n\nx\n\n");
        assert_eq!(written[1].files, BTreeSet::from(["pup.toml".to_owned()]));
        assert_eq!(
            written[2].text,
            "# Pup\n\n[a](a.md#deep)\n\n## Begin\n\nIt has a page of its own: [Go](begin.md).\n\n\
             ## End\n\n[s](begin.md#sub)\n"
        );
        assert!(written[2].files.is_empty());
        assert_eq!(written[3].text, "# A\n[w](formats/wire.md)\n## Deep\n```sh\nls\n```\n");
        let written = of(&books.books[1]);
        assert_eq!(books.summary(&books.books[1]), "[F](index.md)\n[W](wire.md)\n");
        assert_eq!(written[0].text, "# Formats\n[deep](../a.md#deep)\n");
        assert_eq!(written[1].text, "# Wire\n[F](index.md)\n");
    }

    #[test]
    fn what_the_summary_lacks_or_has_twice_is_named() {
        let files = files("[L](README.md)\n[L](README.md)\n[g](gone.md)\n[g](../README.md#gone)\n");
        let faults = Books::read(&files).err().unwrap();
        let faults: Vec<_> = faults.lines().collect();
        assert_eq!(faults.len(), 4, "{faults:#?}");
        assert!(faults[0].contains("SUMMARY.md:2") && faults[0].contains("both be `index.md`"));
        assert!(faults[1].contains("`gone.md` is not a document"));
        assert!(faults[3].contains("omits `docs/a.md`"));
    }

    #[test]
    fn a_link_to_a_document_outside_of_the_book_is_named() {
        let files = files("[L](README.md)\n[A](a.md)\n");
        let books = Books::read(&files).unwrap();
        let users = &books.books[0];
        let fault = books.written(users, &users.chapters[0]).err().unwrap();
        assert!(fault.starts_with("docs/README.md:2") && fault.contains("`README.md`"), "{fault}");
    }
}
