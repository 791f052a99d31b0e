//! `cargo xtask docs`: builds the documents of the checkout as a site with search by mdBook. The site has a book for users, and
//! in `formats/` a book for implementers of formats.
//!
//! [`book`] converts documents and their sections to chapters, [`mod@reference`] adds pages generated from the code, and
//! [`site`] checks every link of the built pages.

pub mod book;
pub mod reference;
mod site;

use crate::{checkout, shell, toolchain};
use book::{Book, Books};
use std::fs;
use std::path::Path;

const MDBOOK: (&str, &str) = ("mdbook", "0.5.4");

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// Add pages generated from the code: help texts of all commands, and rustdoc, with links to it. This builds the workspace.
    #[arg(long)]
    pub reference: bool,
}

/// Builds the site in `docs-site` of the target folder, and checks its links.
///
/// # Errors
/// Returns the faults of the summaries, or the dead links. If mdBook is missing, the error contains the command that installs
/// it.
pub fn build(options: &Options) -> Result<(), String> {
    let root = shell::workspace_root();
    let files = checkout::text_files(&root)?;
    let books = Books::read(&files)?;
    let mdbook = toolchain::program(
        MDBOOK,
        &["--version"],
        &["--no-default-features", "--features", "search"],
    )?;
    let (source, site) =
        (shell::target_folder().join("docs-book"), shell::target_folder().join("docs-site"));
    let generated = if options.reference { reference::chapters()? } else { Vec::new() };
    for book in &books.books {
        write(&books, book, &root, &source)?;
        for (file, text) in generated.iter().filter(|(file, _)| book.has(file)) {
            let path = source.join("src").join(file);
            let written =
                fs::read_to_string(&path).and_then(|intro| fs::write(&path, intro + text));
            written.map_err(|error| format!("{}: {error}", path.display()))?;
        }
        let mut build = shell::command(&mdbook, &["build"]);
        shell::run(build.arg(&source).arg("--dest-dir").arg(site.join(book.folder)))?;
    }
    if options.reference {
        reference::rustdoc(&site)?;
    }
    let folders: Vec<_> = books.books.iter().map(|book| book.folder).collect();
    let links = site::check(&site, &folders)?;
    let chapters: usize = books.books.iter().map(|book| book.chapters.len()).sum();
    eprintln!("{}: {chapters} chapters and {links} valid links", site.join("index.html").display());
    Ok(())
}

/// Writes the input files of mdBook into a folder.
fn write(books: &Books, book: &Book, root: &Path, folder: &Path) -> Result<(), String> {
    let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    let copy = |from: &Path, to: &Path| {
        let parent = to.parent().expect("it lies in the folder");
        let copied = fs::create_dir_all(parent).and_then(|()| fs::copy(from, to));
        copied.map(drop).map_err(|error| failed(from, error))
    };
    if folder.exists() {
        fs::remove_dir_all(folder).map_err(|error| failed(folder, error))?;
    }
    copy(&root.join("docs/book.toml"), &folder.join("book.toml"))?;
    let source = folder.join("src");
    let put = |file: &str, text: &str| {
        let path = source.join(file);
        fs::create_dir_all(&source)
            .and_then(|()| fs::write(&path, text))
            .map_err(|error| failed(&path, error))
    };
    put("SUMMARY.md", &books.summary(book))?;
    for chapter in &book.chapters {
        let written = books.written(book, chapter)?;
        put(&chapter.file, &written.text)?;
        for file in &written.files {
            copy(&root.join(file), &source.join(book::copied(file)))?;
        }
    }
    Ok(())
}
